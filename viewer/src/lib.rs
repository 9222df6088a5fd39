//! Seeing a simulation that runs, and acting on it: what every window and browser view is made of, and the window.
//!
//! ```text
//! simulation's thread                              a viewer's own thread
//! SimulationManager -> Conductor -> Snapshot  ==>  Viewer -> Painter -> Canvas
//!                      Conductor <- Command   <==  Viewer
//! ```
//!
//! The [`Conductor`] is an observer of the simulation. At most as often as somebody wants to see something it copies where
//! everything is to a [`Snapshot`]; it waits for no viewer, and draws nothing. Viewers draw what they like of the newest
//! snapshot, on their own threads, and send commands. [`Screenshot`] is a picture in one call; [`plot`] draws numbers over time.
#![forbid(unsafe_code)]

mod control;
mod file_extension;
pub mod plot;
#[cfg(test)]
mod sample;
mod screenshot;
mod serve;
mod stage;
pub mod window;

pub use control::{
    Command, Conductor, Film, Play, PlayError, RecordButton, Recording, RecordingState, Speed, Viewer, Viewing, Wants,
};
pub use screenshot::{Screenshot, ScreenshotCfg, ScreenshotError};
pub use serve::{Serve, ServeCfg, ServeError, Served};
pub use stage::{
    CameraView, Canvas, EnvStage, Eye, JointName, Look, Names, Overlays, Painter, Run, Shown, Snapshot, Timeline,
};
pub use window::{Closed, ImageWindow, ImageWindowCfg, OpenWindow, Window, WindowCfg, WindowError};
