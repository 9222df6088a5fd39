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
//! snapshot, on their own threads, and send commands.
#![forbid(unsafe_code)]

pub mod control;
#[cfg(test)]
mod sample;
pub mod serve;
pub mod stage;
pub mod window;

pub use control::{Command, Conductor, RecordButton, Recording, RecordingState, Speed, Viewer, Viewing, Wants};
pub use serve::{Serve, ServeCfg, ServeError, Served};
pub use stage::{Canvas, Eye, Overlays, Painter, Shown, Snapshot};
pub use window::{Closed, OpenWindow, Window, WindowCfg, WindowError};
