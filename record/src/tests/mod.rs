//! Tests of recordings: their content is compared with the simulation and read by independent readers. Shared functions
//! of the tests of this crate.

mod archives;
mod contents;
mod episodes;
mod errors;
mod hostile;
mod images;
mod kill;
mod lerobot;
mod own_sensor;
mod readers;
mod scenes;
mod task_results;

pub(crate) use crate::archive;
pub(crate) use crate::{
    FieldSelector, Format, OverviewCfg, Record, RecordError, RecorderCfg, Recording, RecordingSummary, Topic, recover,
    recover_to,
};
pub(crate) use kinetoscope_render::frame::Channels;
pub(crate) use kinetoscope_render::{Intrinsics, RasterCfg, Renderer};
pub(crate) use kinetoscope_scene::Pose;
pub(crate) use kinetoscope_scene::npy;
pub(crate) use kinetoscope_sensors::camera::{Camera, CameraCfg, CameraConvention, StereoCameraCfg};
pub(crate) use kinetoscope_sensors::ray::RayCasterCfg;
pub(crate) use kinetoscope_sensors::ray::pattern::Grid;
pub(crate) use kinetoscope_sensors::{ContactSensorCfg, ImuCfg, JointStateCfg, Sampled};
pub(crate) use kinetoscope_sim::{EnvId, MjcfPartCfg, ObjectShape, SimulationManager};
pub(crate) use kinetoscope_testkit::worlds::{RecordedWorld as World, look_at};
pub(crate) use ndarray::{Array2, Axis, array};
pub(crate) use serde_json::{Value, json};
pub(crate) use std::path::{Path, PathBuf};

pub(crate) use archives::{falling, member, numbers_of, rows};
use kinetoscope_testkit::test_resources::{python_readers, read_json};
use std::borrow::Borrow;
use tempfile::TempDir;

/// Steps between two images, and between two measurements of the IMU, of [`World`].
pub(crate) const IMAGE_EVERY: u32 = World::IMAGE_EVERY;
pub(crate) const IMU_EVERY: u32 = World::IMU_EVERY;

/// A folder that is removed with the value, and the path of a file in it.
pub(crate) fn scratch(name: &str) -> (TempDir, PathBuf) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    (folder, path)
}

/// Names in a folder, sorted.
pub(crate) fn names(folder: impl AsRef<Path>) -> Vec<String> {
    let entries = std::fs::read_dir(folder).unwrap();
    let mut names: Vec<String> =
        entries.map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

/// A simulation without objects.
pub(crate) fn simulation(num_envs: usize) -> SimulationManager {
    kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::cfg(num_envs, 2))
}

/// Records what `run` does.
pub(crate) fn record(
    sim: &mut SimulationManager,
    cfg: RecorderCfg,
    run: impl FnOnce(&mut SimulationManager),
) -> RecordingSummary {
    let recorder = sim.record(cfg).unwrap();
    run(sim);
    sim.finish_recording(recorder).unwrap()
}

/// Records steps of a world.
pub(crate) fn record_steps(world: &mut World, cfg: RecorderCfg, steps: u32) -> RecordingSummary {
    let recorder = world.sim.record(cfg).unwrap();
    (0..steps).for_each(|step| world.step(step));
    world.sim.finish_recording(recorder).unwrap()
}

/// Allows a configuration to replace files.
pub(crate) fn overwriting(cfg: RecorderCfg) -> RecorderCfg {
    RecorderCfg { overwrite: true, ..cfg }
}

pub(crate) fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

/// A message of an MCAP file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    pub(crate) topic: String,
    pub(crate) schema: String,
    pub(crate) time: u64,
    pub(crate) data: Vec<u8>,
}

impl Message {
    /// Number of the step at its time, for steps of 10 ms.
    pub(crate) fn step(&self) -> u64 {
        (self.time as f64 / 1e7).round() as u64
    }

    /// True if its data contain these bytes.
    pub(crate) fn contains(&self, part: &[u8]) -> bool {
        self.data.windows(part.len()).any(|window| window == part)
    }
}

pub(crate) fn messages(path: &Path) -> Vec<Message> {
    let bytes = std::fs::read(path).unwrap();
    let all = mcap::MessageStream::new(&bytes).unwrap().map(|message| {
        let message = message.unwrap();
        Message {
            topic: message.channel.topic.clone(),
            schema: message.channel.schema.as_ref().unwrap().name.clone(),
            time: message.log_time,
            data: message.data.to_vec(),
        }
    });
    all.collect()
}

/// The messages of one topic.
pub(crate) fn messages_on<'m>(messages: &'m [Message], topic: &str) -> Vec<&'m Message> {
    messages.iter().filter(|message| message.topic == topic).collect()
}

/// Steps at which a topic has messages.
pub(crate) fn steps_of(messages: &[Message], topic: &str) -> Vec<u64> {
    messages_on(messages, topic).iter().map(|message| message.step()).collect()
}

/// Texts of the events in an MCAP file.
pub(crate) fn logs(path: &Path) -> Vec<String> {
    let text = |message: &&Message| String::from_utf8_lossy(&message.data).into_owned();
    messages_on(&messages(path), "/events").iter().map(text).collect()
}

/// Little-endian bytes of numbers, as in messages.
pub(crate) fn bytes(numbers: impl IntoIterator<Item: Borrow<f64>>) -> Vec<u8> {
    numbers.into_iter().flat_map(|x| x.borrow().to_le_bytes()).collect()
}

/// The JSON that a script of this folder prints about a file.
pub(crate) fn script_output(script: &str, file: &Path) -> Value {
    read_json(&python_readers(), &Path::new(env!("CARGO_MANIFEST_DIR")).join("src/tests").join(script), file)
}

/// Replaces floating-point numbers by strings of their bits, as the scripts do, so that no precision is lost.
pub(crate) fn bits(value: Value) -> Value {
    match value {
        Value::Number(number) if number.is_f64() => number.as_f64().unwrap().to_bits().to_string().into(),
        Value::Array(values) => values.into_iter().map(bits).collect(),
        Value::Object(values) => values.into_iter().map(|(name, value)| (name, bits(value))).collect(),
        other => other,
    }
}

/// Converts a string of bits to a number.
pub(crate) fn number(text: &Value) -> f64 {
    f64::from_bits(text.as_str().unwrap().parse().unwrap())
}

/// Converts strings of bits to numbers.
pub(crate) fn numbers(values: &Value) -> Vec<f64> {
    list(values).iter().map(number).collect()
}

/// The elements of a JSON array.
pub(crate) fn list(value: &Value) -> &Vec<Value> {
    value.as_array().unwrap()
}

/// The sum of numbers weighted by their positions, so that exchanged numbers change it.
pub(crate) fn weighted_sum<T>(numbers: impl IntoIterator<Item = T>, number: impl Fn(T) -> u64) -> u64 {
    numbers.into_iter().zip(1..).map(|(x, k)| number(x) * k).sum()
}

/// Red, green and blue of an image with an alpha channel.
pub(crate) fn rgb(color: &ndarray::Array3<u8>) -> Vec<u8> {
    color.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]]).collect()
}
