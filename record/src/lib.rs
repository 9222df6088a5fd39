//! Recording of simulations to files, and reading, recovery and replay of recordings.
//!
//! ```text
//! SimulationManager -> Recorder (an observer) -> bounded pool of packets -> writer thread -> mcap | npz | png | ...
//!                      topic: what is recorded                              format: how it is written
//! ```
//!
//! A [`Recorder`] is notified of steps and copies the due values into a packet of a bounded pool. A thread of its own
//! writes the packets in their order. No packet is dropped: while all packets are in use, the simulation waits.
//! [`RecordingSummary`] reports the number and the total duration of these waits.
//!
//! | modules | content |
//! |---|---|
//! | `recorder`, `cfg`, `topic`, `source`, `stream`, `overview`, `clock` | the observer: what is recorded, and when |
//! | `packet`, `writer`, `file`, `folder` | packets, the writer thread, atomic files and folders |
//! | `ros_writer`, `mcap_writer`, `ros`, `scene_update` | ROS 2 messages, and MCAP files of them |
//! | `live` | live streams to Foxglove, behind the feature `foxglove` |
//! | `npz`, `archive` | NumPy archives |
//! | `image_folder`, `png`, `animation` | PNG files and animations |
//! | `episodes`, `lerobot` | datasets of episodes for learning, behind the feature `lerobot` |
//! | `read`, `recorded_arrays`, `recover` | [`Recording`]: numbers over time, and recovery of unfinished files |
//! | [`replay`], `playback`, `scene_file` | simulation of recorded actions, and display of recorded motion ([`Playback`]) |
//!
//! ```no_run
//! use kinetoscope_record::{Record, RecorderCfg, Topic};
//! use kinetoscope_sim::{SimulationManager, SimulationManagerCfg};
//!
//! let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
//! let recorder = sim.record(RecorderCfg::new("run.mcap"))?;
//! sim.update(100);
//! println!("{}", sim.finish_recording(recorder)?);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]
#![cfg_attr(docsrs, feature(doc_cfg))]

mod animation;
mod archive;
mod cfg;
mod clock;
#[cfg(feature = "lerobot")]
mod episodes;
mod error;
mod file;
mod folder;
mod format;
mod image_folder;
#[cfg(feature = "lerobot")]
mod lerobot;
#[cfg(feature = "foxglove")]
mod live;
mod mcap_records;
mod mcap_writer;
mod npz;
mod overview;
mod packet;
mod playback;
mod png;
mod read;
mod recorded_arrays;
mod recorder;
mod recover;
pub mod replay;
mod ros;
mod ros_writer;
mod scene_file;
mod scene_update;
mod source;
mod stream;
#[cfg(test)]
mod tests;
mod topic;
mod writer;

pub use cfg::RecorderCfg;
pub use error::{RecordError, Result};
pub use format::Format;
#[cfg(feature = "foxglove")]
pub use kinetoscope_http::ServeError;
#[cfg(feature = "foxglove")]
pub use live::{FoxgloveCfg, FoxgloveServer, StreamToFoxglove};
pub use overview::OverviewCfg;
pub use packet::{Event, EventKind};
pub use playback::{Playback, frame_at};
pub use read::{FieldSelector, RecordedTopic, Recording, TimeSeries};
pub use recorder::{Record, Recorder, RecorderId, RecordingSummary};
pub use recover::{Recovered, recover, recover_to};
pub use stream::{Distortion, StreamField, StreamKind, StreamSchema};
pub use topic::Topic;
