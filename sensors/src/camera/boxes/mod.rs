//! Boxes around things: in the picture, and in the environment.

mod alone;
mod flat;
mod occlusion;
mod outline;
mod solid;

pub use flat::{Box2d, PixelBox};
pub use occlusion::Occlusion;
pub use solid::Box3d;
