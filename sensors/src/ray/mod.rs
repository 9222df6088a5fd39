//! Ray casters and ray-caster cameras. The ray geometry is in [`kinetoscope_render::geometry`].

mod camera;
mod cast_order;
mod caster;
mod error;
pub mod pattern;
mod sampler;
mod scan;
mod targets;

pub use camera::{RayCasterCamera, RayCasterCameraCfg, RayImages};
pub use caster::{RayAlignment, RayCaster, RayCasterCfg};
pub use error::RayError;
pub use pattern::RayPattern;
pub use targets::HitTargets;
