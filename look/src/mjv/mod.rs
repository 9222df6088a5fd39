//! Scenes of MuJoCo's visualizer (`mjvScene`), read from their memory.
//!
//! The structures of the visualizer differ between versions of MuJoCo. A layout describes where their fields are, so
//! that one program reads all versions: [`GeomLayout`] for `mjvGeom`, [`LightLayout`] for `mjvLight`.
//!
//! [`MjvReader`] turns the geoms and lights of one update into an [`MjvFrame`]: a scene, which consecutive frames share
//! as long as only poses change, and the poses.

mod camera;
mod decor;
mod frame;
mod layout;
mod reader;
mod soft;
mod tessellation;
#[cfg(test)]
mod tests;
mod texture_rule;
mod wireframe;

pub use camera::{MjvCamera, MjvCameraError};
pub use decor::LineView;
pub use frame::{Background, DrawFlags, MjvFrame, MjvObject};
pub use layout::{DecorTypes, GeomLayout, LayoutError, LightLayout, SoftTypes};
pub use reader::MjvReader;
pub use soft::{MjvMemory, SkinFaces};
pub use texture_rule::TextureRule;
