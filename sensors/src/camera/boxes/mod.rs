//! Bounding boxes of segments, in the image and in the environment, and their occlusion.

mod box_2d;
mod box_3d;
mod isolated;
mod occlusion;
mod projected_extent;

pub use box_2d::{Box2d, PixelBox};
pub use box_3d::Box3d;
pub use occlusion::Occlusion;
