//! Writes what happens in a simulation to files, without losing anything silently.
//!
//! ```text
//! SimulationManager -> Recorder (an observer) -> pool of packets -> thread of the file -> mcap | npz | png | ...
//!                      topic: what is read                          format: how it is written
//! ```
//!
//! A [`Recorder`] is told of steps, copies what is due into a packet of a bounded pool, and a thread of its own writes the
//! packets in their order. When all packets are on their way, the simulation waits for one, and [`Recorded`] says how often
//! and how long. [`Recording`] reads the numbers again, [`replay`] does the actions again.
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

mod animation;
mod archive;
mod cfg;
mod clock;
mod episodes;
mod error;
mod file;
mod film;
mod folder;
mod format;
mod lerobot;
mod mcap_file;
pub mod npy;
mod npz;
mod packet;
mod picture;
mod picture_folder;
mod read;
mod recorder;
mod recover;
pub mod replay;
#[cfg(feature = "hdf5")]
mod robomimic;
mod ros;
mod scene_file;
mod scene_update;
mod source;
mod stage;
mod stream;
#[cfg(test)]
mod tests;
mod topic;
mod writer;
mod zip;

pub use cfg::RecorderCfg;
pub use error::{RecordError, Result};
pub use film::Film;
pub use format::Format;
pub use packet::{Event, EventKind};
pub use read::{RecordedTopic, Recording, Samples, Wanted};
pub use recorder::{Record, Recorded, Recorder, RecorderId};
pub use recover::{Recovered, recover, recover_to};
pub use stage::StageCfg;
pub use stream::{Distortion, Element, Kind, Part, Stream};
pub use topic::Topic;
