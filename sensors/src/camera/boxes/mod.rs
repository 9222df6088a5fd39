//! Bounding boxes of segments, in the image and in the environment, and their occlusion.

mod alone;
mod flat;
mod occlusion;
mod outline;
mod solid;

pub use flat::{Box2d, PixelBox};
pub use occlusion::Occlusion;
pub use solid::Box3d;
