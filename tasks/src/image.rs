//! Images as observations.

use crate::context::TermContext;
use crate::error::{EnvError, Result, TermKind, TermResult};
use crate::guard::guard;
use ndarray::{Array4, Axis};
use std::fmt;

type ReadImages = Box<dyn Fn(&TermContext<'_>) -> TermResult<ImageBatch> + Send>;

/// Images of all environments, shape (N, height, width, components), by the type of a component.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum ImageBatch {
    /// Integers from 0 to 255, such as colors.
    U8(Array4<u8>),
    /// Numbers of single precision, such as depths.
    F32(Array4<f32>),
    /// Integers, such as mask ids.
    I32(Array4<i32>),
}

/// Calls a function with the array of a batch, of any type.
macro_rules! with_array {
    ($batch:expr, $array:ident => $result:expr) => {
        match $batch {
            ImageBatch::U8($array) => $result,
            ImageBatch::F32($array) => $result,
            ImageBatch::I32($array) => $result,
        }
    };
}

impl ImageBatch {
    /// Shape (N, height, width, components).
    pub fn shape(&self) -> [usize; 4] {
        with_array!(self, array => array.dim().into())
    }

    /// Type of a component.
    pub fn element(&self) -> ImageElement {
        match self {
            Self::U8(_) => ImageElement::U8,
            Self::F32(_) => ImageElement::F32,
            Self::I32(_) => ImageElement::I32,
        }
    }

    /// Images of zeros.
    fn zeros(shape: [usize; 4], element: ImageElement) -> Self {
        match element {
            ImageElement::U8 => Self::U8(Array4::zeros(shape)),
            ImageElement::F32 => Self::F32(Array4::zeros(shape)),
            ImageElement::I32 => Self::I32(Array4::zeros(shape)),
        }
    }

    /// Copies the images of some environments from another batch of the same shape and type.
    fn copy_rows(&mut self, from: &Self, envs: &[usize]) {
        macro_rules! copy {
            ($($Variant:ident)*) => {
                match (self, from) {
                    $((Self::$Variant(to), Self::$Variant(from)) => for &env in envs {
                        to.index_axis_mut(Axis(0), env).assign(&from.index_axis(Axis(0), env));
                    },)*
                    // The type is checked before.
                    _ => {}
                }
            };
        }
        copy!(U8 F32 I32);
    }
}

/// Type of a component of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum ImageElement {
    /// Unsigned integers of 8 bits.
    U8,
    /// Floating-point numbers of 32 bits.
    F32,
    /// Signed integers of 32 bits.
    I32,
}

/// Shape and values of the images of one environment: Gymnasium's `Box` with three axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ImageSpace {
    /// Number of rows of pixels.
    pub height: usize,
    /// Number of columns of pixels.
    pub width: usize,
    /// Components of a pixel.
    pub components: usize,
    /// Type of a component.
    pub element: ImageElement,
    /// Smallest and largest value of a component.
    pub bounds: [f64; 2],
}

/// Images that are part of an observation group, such as the color of a camera. [`terms`](crate::terms) has ready-made
/// ones.
pub struct ImageTerm {
    pub(crate) name: String,
    pub(crate) space: ImageSpace,
    read: ReadImages,
}

impl ImageTerm {
    /// Creates a term with images of `space`. `read` returns the images of all environments, and depends on its
    /// argument only: it may be called twice in a step, because environments that begin a new episode are observed
    /// again.
    pub fn new(
        name: impl Into<String>,
        space: ImageSpace,
        read: impl Fn(&TermContext<'_>) -> TermResult<ImageBatch> + Send + 'static,
    ) -> Self {
        Self { name: name.into(), space, read: Box::new(read) }
    }

    pub(crate) fn check(&self) -> Result<()> {
        let ImageSpace { height, width, components, bounds: [low, high], .. } = self.space;
        let wrong = |field: &str, value: String, expected| {
            let field = format!("{field} of the image term {:?}", self.name);
            Err(EnvError::Config { field, value, expected })
        };
        if [height, width, components].contains(&0) {
            return wrong("shape", format!("{height} x {width} x {components}"), "an image has at least one pixel");
        }
        if low.is_nan() || high.is_nan() || low > high {
            return wrong("bounds", format!("{low} to {high}"), "the first must be at most the second");
        }
        Ok(())
    }

    /// Images of zeros for `num_envs` environments.
    pub(crate) fn zeros(&self, num_envs: usize) -> ImageBatch {
        ImageBatch::zeros(self.shape(num_envs), self.space.element)
    }

    fn shape(&self, num_envs: usize) -> [usize; 4] {
        [num_envs, self.space.height, self.space.width, self.space.components]
    }

    /// Reads the images of the environments `envs` into `into`.
    pub(crate) fn read(&self, now: &TermContext<'_>, envs: &[usize], into: &mut ImageBatch) -> Result<()> {
        let images = guard(TermKind::Observation, &self.name, || (self.read)(now))?;
        let what = || TermKind::Observation.result_label(&self.name);
        let (found, expected) = (images.shape(), self.shape(now.num_envs()));
        if found != expected {
            let (found, expected) = (found.to_vec(), expected.to_vec());
            return Err(EnvError::Shape {
                what: what(),
                found,
                expected,
                meaning: "environments, height, width, components",
            });
        }
        let (found, expected) = (images.element(), self.space.element);
        if found != expected {
            return Err(EnvError::Element { what: what(), found, expected });
        }
        if let ImageBatch::F32(values) = &images
            && let Some(&env) = envs.iter().find(|env| !is_finite(values, **env))
        {
            let row = values.index_axis(Axis(0), env);
            let wrong = row.indexed_iter().find(|(_, value)| !value.is_finite());
            let ((v, u, k), value) = wrong.map_or(((0, 0, 0), f64::NAN), |(at, value)| (at, f64::from(*value)));
            let column = format!("row {v}, column {u}, component {k}");
            return Err(EnvError::NotFinite { what: what(), env, column, value });
        }
        if envs.len() == now.num_envs() {
            *into = images;
        } else {
            into.copy_rows(&images, envs);
        }
        Ok(())
    }
}

fn is_finite(images: &Array4<f32>, env: usize) -> bool {
    images.index_axis(Axis(0), env).iter().all(|value| value.is_finite())
}

impl fmt::Debug for ImageTerm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ImageTerm").field("name", &self.name).field("space", &self.space).finish_non_exhaustive()
    }
}
