//! Ray casters, and cameras made of rays. The geometry is in [`kinetoscope_render::geometry`].

pub mod camera;
pub mod caster;
mod error;
mod order;
pub mod pattern;
mod sampler;
mod scan;
mod targets;

pub use camera::{RayCasterCamera, RayCasterCameraCfg, RayPictures};
pub use caster::{RayAlignment, RayCaster, RayCasterCfg};
pub use error::RayError;
pub use kinetoscope_render::geometry::assets::Assets;
pub use kinetoscope_render::geometry::assets::RayAssets;
pub use kinetoscope_render::geometry::world::{RayHit, RayTargets, RayWorld};
pub use kinetoscope_scene::Ray;
pub use pattern::RayPattern;
pub use targets::HitTargets;
