//! Live views of a running simulation: native windows, browser views, screenshots and plots.
//!
//! ```text
//! simulation thread                                     viewer thread
//! SimulationManager -> ViewController -> Snapshot  ==>  Viewer -> SceneRenderer -> Canvas
//!                      ViewController <- Command   <==  Viewer
//! ```
//!
//! The [`ViewController`] is an observer of the simulation. It copies the scene state into a [`Snapshot`] at the
//! highest rate that any viewer requests. It renders nothing, and waits only while viewers pause or slow down the
//! simulation. Each viewer renders the newest snapshot on its own thread and sends commands back.
//!
//! | Module | Contents |
//! |---|---|
//! | `control` | [`ViewController`], [`Viewer`] handles, commands, recording playback |
//! | `scene_view` | snapshots, camera model, rendering, overlays, picking |
//! | [`window`] | native X11 windows |
//! | `serve` | HTTP and WebSocket server of the browser view |
//! | `screenshot` | [`Screenshot`]: one image in one call |
//! | [`plot`] | plots of numbers over time, as SVG or PNG |
//!
//! ```no_run
//! use kinetoscope_sim::{SimulationManager, SimulationManagerCfg};
//! use kinetoscope_viewer::OpenWindow;
//!
//! let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
//! let window = sim.open_window()?;
//! while window.is_open() {
//!     sim.update(1);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

mod control;
mod file_extension;
pub mod plot;
#[cfg(test)]
mod sample;
mod scene_view;
mod screenshot;
mod serve;
pub mod window;

pub use embedded_graphics;

pub use control::{
    Command, Play, PlayError, PlaybackSource, RecordButton, RecordControl, RecordingState, SnapshotRequest, Speed,
    ViewController, Viewer, ViewerExt,
};
pub use scene_view::{
    CameraView, Canvas, EnvSelection, JointEntry, Names, OrbitCamera, Overlays, RunState, Snapshot, SnapshotEnv,
    Timeline,
};
pub use screenshot::{Screenshot, ScreenshotCfg, ScreenshotError};
pub use serve::{Serve, ServeCfg, ServeError, ServerHandle};
pub use window::{Closed, ImageWindow, ImageWindowCfg, OpenWindow, Window, WindowCfg, WindowError};
