//! Recordings: their content, held against the simulation and read by independent readers.

mod contents;
mod episodes;
mod hdf5;
mod images;
mod kill;
mod lerobot;
mod outcomes;
mod readers;
mod refusals;
mod scenes;
mod stage;

pub(crate) use crate::{
    Format, Record, RecordError, Recorded, RecorderCfg, RecorderId, Recording, StageCfg, Topic, Wanted, recover,
    recover_to,
};
pub(crate) use scene::Pose;
pub(crate) use sensors::camera::{
    Camera, CameraCfg, CameraConvention, Channels, Extrinsics, Intrinsics, Placement, RasterCfg, Renderer,
    StereoCameraCfg,
};
pub(crate) use sensors::ray::RayCasterCfg;
pub(crate) use sensors::{ContactSensorCfg, ImuCfg, JointStateCfg, Sampled};
pub(crate) use sim::{
    BodyType, DriveCfg, DriveType, EnvId, MjcfCfg, MjcfFile, ObjectShape, RigidObjectCfg, RobotCfg, SimulationManager,
    SimulationManagerCfg,
};
use std::borrow::Borrow;
use std::path::Path;
pub(crate) use testkit::worlds::RecordedWorld as World;

/// Steps between two images, and between two measurements of the IMU.
pub(crate) const PICTURE_EVERY: u32 = World::IMAGE_EVERY;
pub(crate) const IMU_EVERY: u32 = World::IMU_EVERY;

/// A message of an MCAP file.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Message {
    pub(crate) topic: String,
    pub(crate) schema: String,
    pub(crate) time: u64,
    pub(crate) data: Vec<u8>,
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
pub(crate) fn of<'m>(messages: &'m [Message], topic: &str) -> Vec<&'m Message> {
    messages.iter().filter(|message| message.topic == topic).collect()
}

/// The bytes of numbers, as messages have them.
pub(crate) fn bytes(numbers: impl IntoIterator<Item: Borrow<f64>>) -> Vec<u8> {
    numbers.into_iter().flat_map(|x| x.borrow().to_le_bytes()).collect()
}

pub(crate) fn contains(data: &[u8], part: &[u8]) -> bool {
    data.windows(part.len()).any(|window| window == part)
}
