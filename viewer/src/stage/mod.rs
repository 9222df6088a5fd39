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
pub use eye::Eye;
pub use overlay::Overlays;
pub use painter::{Look, Painter};
pub(crate) use panel::Panel;
pub(crate) use pick::contacts_wanted;
pub(crate) use pick::{Picked, describe};
pub(crate) use pool::Pool;
pub(crate) use pull::Pull;
pub(crate) use slider::slider_range;
pub use snapshot::{EnvStage, JointName, Names, Run, Shown, Snapshot, Timeline};
pub(crate) use trail::Trails;
