//! Arrays of any element type, on their way from a sensor to NumPy.

use crate::errors::Failure;
use kinetoscope::ndarray::{Array, ArrayD, ArrayView, Dimension};
use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;

/// An owned array of one of the element types of sensors.
#[derive(Debug)]
pub(crate) enum Values {
    U8(ArrayD<u8>),
    I32(ArrayD<i32>),
    U64(ArrayD<u64>),
    F32(ArrayD<f32>),
    F64(ArrayD<f64>),
    Bool(ArrayD<bool>),
}

/// Declares the conversions of element types.
macro_rules! elements {
    ($($Variant:ident($Element:ty),)*) => {
        $(impl<D: Dimension> From<Array<$Element, D>> for Values {
            fn from(array: Array<$Element, D>) -> Self {
                Self::$Variant(array.into_dyn())
            }
        }

        impl<D: Dimension> From<ArrayView<'_, $Element, D>> for Values {
            fn from(view: ArrayView<'_, $Element, D>) -> Self {
                Self::$Variant(view.to_owned().into_dyn())
            }
        })*

        impl Values {
            /// Hands the memory over to NumPy.
            pub(crate) fn into_python(self, py: Python<'_>) -> Bound<'_, PyAny> {
                match self {
                    $(Self::$Variant(array) => array.into_pyarray(py).into_any(),)*
                }
            }

            /// Copies the values to an array of the same shape and element type.
            pub(crate) fn copy_to(&self, out: &Bound<'_, PyAny>) -> PyResult<()> {
                match self {
                    $(Self::$Variant(array) => {
                        let wrong = || {
                            let (shape, element) = (array.shape(), stringify!($Element));
                            Failure::argument("out", format!("expected a writable array of {element}, shape {shape:?}"))
                        };
                        let out = out.cast::<PyArrayDyn<$Element>>().map_err(|_| wrong())?;
                        let mut out = out.try_readwrite().map_err(|_| wrong())?;
                        let mut view = out.as_array_mut();
                        if view.shape() != array.shape() {
                            return Err(wrong().into());
                        }
                        view.assign(array);
                    })*
                }
                Ok(())
            }
        }
    };
}

elements! {
    U8(u8),
    I32(i32),
    U64(u64),
    F32(f32),
    F64(f64),
    Bool(bool),
}
