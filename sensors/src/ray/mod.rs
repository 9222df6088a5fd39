//! Ray casters, and cameras made of rays. The geometry is in [`kinetoscope_render::geometry`].

pub mod camera;
pub mod caster;
mod error;
pub mod pattern;

pub use camera::{RayCasterCamera, RayCasterCameraCfg, RayPictures};
pub use caster::{HitTargets, RayAlignment, RayCaster, RayCasterCfg};
pub use error::RayError;
pub use kinetoscope_render::geometry::assets::Assets;
pub use kinetoscope_render::geometry::assets::RayAssets;
pub use kinetoscope_render::geometry::world::{RayHit, RayTargets, RayWorld};
pub use kinetoscope_scene::Ray;
pub use pattern::RayPattern;
