//! Arrays of any element type, on their way from a sensor to NumPy.

use crate::arguments::is_plain;
use crate::errors::Failure;
use crate::shared::Shared;
use kinetoscope::ndarray::{Array, ArrayView, ArrayViewMutD, CowArray, Dimension, IxDyn};
use kinetoscope::sim::SimulationManager;
use numpy::{IntoPyArray, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

/// An array of one of the element types of sensors, owned or borrowed from a sensor.
#[derive(Debug)]
pub(crate) enum Values<'s> {
    U8(CowArray<'s, u8, IxDyn>),
    I32(CowArray<'s, i32, IxDyn>),
    U64(CowArray<'s, u64, IxDyn>),
    F32(CowArray<'s, f32, IxDyn>),
    F64(CowArray<'s, f64, IxDyn>),
    Bool(CowArray<'s, bool, IxDyn>),
}

/// Declares the conversions of element types.
macro_rules! elements {
    ($($Variant:ident($Element:ty),)*) => {
        $(impl<D: Dimension> From<Array<$Element, D>> for Values<'_> {
            fn from(array: Array<$Element, D>) -> Self {
                Self::$Variant(array.into_dyn().into())
            }
        }

        impl<'s, D: Dimension> From<ArrayView<'s, $Element, D>> for Values<'s> {
            fn from(view: ArrayView<'s, $Element, D>) -> Self {
                Self::$Variant(view.into_dyn().into())
            }
        })*

        impl Values<'_> {
            /// Copies borrowed values.
            pub(crate) fn into_owned(self) -> Values<'static> {
                match self {
                    $(Self::$Variant(array) => Values::$Variant(array.into_owned().into()),)*
                }
            }

            /// Hands the memory of owned values over to NumPy. Borrowed values are copied.
            pub(crate) fn into_python(self, py: Python<'_>) -> Bound<'_, PyAny> {
                match self {
                    $(Self::$Variant(array) => array.into_owned().into_pyarray(py).into_any(),)*
                }
            }

            /// Element type and shape, for messages.
            fn layout(&self) -> (&'static str, &[usize]) {
                match self {
                    $(Self::$Variant(array) => (stringify!($Element), array.shape()),)*
                }
            }
        }

        /// Copies values of the simulation into an array of the caller, which must have their element type and shape.
        pub(crate) fn read_into(
            py: Python<'_>,
            shared: &Shared,
            out: &Bound<'_, PyAny>,
            values: impl for<'s> FnOnce(&'s SimulationManager) -> Result<Values<'s>, Failure> + Send,
        ) -> PyResult<()> {
            $(if let Ok(array) = out.cast::<PyArrayDyn<$Element>>()
                && is_plain(array)
                && array.strides().iter().zip(array.shape()).all(|(stride, length)| *stride != 0 || *length < 2)
                && let Ok(mut guard) = array.try_readwrite()
            {
                let view = guard.as_array_mut();
                return shared.read(py, |sim| match values(sim)? {
                    Values::$Variant(array) if array.shape() == view.shape() => {
                        copy(&array, view);
                        Ok(())
                    }
                    other => Err(mismatch(&other)),
                });
            })*
            // Not an array, read-only, with gaps that are no multiple of an element, or of a type that no sensor has.
            shared.read(py, |sim| Err(mismatch(&values(sim)?)))
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

fn copy<T: Copy>(from: &CowArray<'_, T, IxDyn>, mut to: ArrayViewMutD<'_, T>) {
    match (from.as_slice(), to.as_slice_mut()) {
        (Some(from), Some(to)) => to.copy_from_slice(from),
        _ => to.assign(from),
    }
}

fn mismatch(values: &Values<'_>) -> Failure {
    let (element, shape) = values.layout();
    Failure::argument("out", format!("expected a writable, aligned array of {element}, shape {shape:?}"))
}
