//! ROS 2 messages: their types, writing and reading.
//!
//! The names and the order of the fields are those of the ROS packages `builtin_interfaces`, `foxglove_msgs`,
//! `geometry_msgs`, `rcl_interfaces`, `sensor_msgs`, `std_msgs` and `tf2_msgs`. The bytes are little-endian CDR.

mod cdr;
mod message;
mod read;
mod scene;
mod schema;

pub(crate) use cdr::CdrWriter;
pub(crate) use message::{
    RayHits, RosHeader, camera_info, compressed_image, float64_multi_array, image, imu, joint_state, log, point_cloud,
    transforms, twist_or_accel,
};
pub(crate) use read::{MessageType, PathSegment, Value};
pub(crate) use scene::scene_update;
pub(crate) use schema::{ENCODING, SCENE_UPDATE, SCHEMA_ENCODING, Schema};
