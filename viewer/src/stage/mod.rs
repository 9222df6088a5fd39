//! Snapshots of the simulation, and everything that is drawn from them: cameras, images, overlays, picking.

mod assembly;
mod camera;
mod canvas;
mod color;
mod eye;
mod overlay;
mod painter;
mod panel;
mod pick;
mod png;
mod pool;
mod pull;
mod slider;
mod snapshot;
mod trail;

#[cfg(test)]
mod tests;

pub use camera::CameraView;
pub use canvas::Canvas;
pub use eye::OrbitCamera;
pub use overlay::Overlays;
pub use painter::{SceneRenderer, ViewOptions};
pub(crate) use panel::CameraPanel;
pub(crate) use pick::required_contacts;
pub(crate) use pick::{Selection, selection_text};
pub(crate) use pool::SnapshotPool;
pub(crate) use pull::MouseSpring;
pub(crate) use slider::slider_range;
pub use snapshot::{EnvSelection, JointEntry, Names, RunState, Snapshot, SnapshotEnv, Timeline};
pub(crate) use trail::Trails;
