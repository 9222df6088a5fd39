//! Snapshots of the simulation, and everything that is drawn from them: cameras, images, overlays, picking.

mod camera;
mod camera_panel;
mod canvas;
mod color;
mod merged_scene;
mod mouse_spring;
mod orbit_camera;
mod overlay;
mod pick;
mod png;
mod scene_renderer;
mod slider;
mod snapshot;
mod snapshot_pool;
mod trail;

#[cfg(test)]
mod tests;

pub use camera::CameraView;
pub(crate) use camera_panel::CameraPanel;
pub use canvas::Canvas;
pub(crate) use mouse_spring::MouseSpring;
pub use orbit_camera::OrbitCamera;
pub use overlay::Overlays;
pub(crate) use pick::required_contacts;
pub(crate) use pick::{Selection, selection_text};
pub(crate) use scene_renderer::{SceneRenderer, ViewOptions};
pub(crate) use slider::slider_range;
pub use snapshot::{EnvSelection, JointEntry, Names, RunState, Snapshot, SnapshotEnv, Timeline};
pub(crate) use snapshot_pool::SnapshotPool;
pub(crate) use trail::Trails;
