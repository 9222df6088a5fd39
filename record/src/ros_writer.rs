//! ROS 2 messages of a recording: topics, types and content. An MCAP file and the server for Foxglove get the same messages.
//!
//! | content | topic | type |
//! |---|---|---|
//! | joint states, targets | `/env_0/arm/joint_states`, `/env_0/arm/targets` | `sensor_msgs/msg/JointState` |
//! | poses of links and objects | `/env_0/tf` | `tf2_msgs/msg/TFMessage`, frames `env_0/arm/link` |
//! | color | `/env_0/camera/color` | `sensor_msgs/msg/CompressedImage`, PNG |
//! | albedo | `/env_0/camera/albedo` | the same; a pixel shows a surface where the mask is not 0 |
//! | other channels | `/env_0/camera/depth` | `sensor_msgs/msg/Image`, `32FC1`, `32FC2`, `32FC3` |
//! | masks | `/env_0/camera/mask` | `sensor_msgs/msg/Image`, `16UC1`; `32SC1` if an id exceeds 16 bits |
//! | stereo cameras | `/env_0/pair/left/depth`, `/env_0/pair/disparity` | frames `env_0/sensors/pair/left` |
//! | camera intrinsics, if ROS has the lens model | `/env_0/camera/camera_info` | `sensor_msgs/msg/CameraInfo` |
//! | camera pose | `/env_0/tf` | frame `env_0/sensors/camera` |
//! | IMU | `/env_0/imu`, `/env_0/tf` | `sensor_msgs/msg/Imu` |
//! | IMU velocity, in its own axes | `/env_0/imu/velocity` | `geometry_msgs/msg/TwistStamped` |
//! | IMU acceleration, in its own axes | `/env_0/imu/acceleration` | `geometry_msgs/msg/AccelStamped` |
//! | ray caster hits | `/env_0/scanner/points` | `sensor_msgs/msg/PointCloud2`: x, y, z, distance, normal, mask id |
//! | distances of all rays | `/env_0/scanner/distances` | `std_msgs/msg/Float64MultiArray`; infinite for a miss |
//! | ray caster parent body | `/env_0/tf` | frame `env_0/sensors/scanner` |
//! | other sensors | `/env_0/feet/net_forces_w` | `std_msgs/msg/Float64MultiArray` |
//! | resets, writes, divergence, notes | `/events` | `rcl_interfaces/msg/Log` |
//! | origins of environments | `/tf_static` | `tf2_msgs/msg/TFMessage`, from `world` to `env_0` |
//! | MJCF parts: poses of bodies | `/env_0/tf` | frames `env_0/part/body` |
//! | task results | `/env_0/task/{reward,terminated,truncated}` | `std_msgs/msg/Float64MultiArray` |
//! | appearance | `/env_0/scene` | `foxglove_msgs/msg/SceneUpdate`: complete, at the beginning and at changes |
//!
//! The channel metadata of other sensors has `rows` and `filters` (names of bodies) and `unit`.
//!
//! Messages have the time of capture, on the clock of the recording (`clock.rs`). Forces, efforts and accelerations of
//! sensors, all values of IMUs, and those of contact sensors except poses, have the time of the beginning of the last
//! MuJoCo step. A robot's joint state message has a single time, that of its positions; its efforts are those of the
//! step that led there.

use crate::packet::{Event, Packet, StreamRows, ValueBuffer};
use crate::png::PngWriter;
use crate::ros::{self, CdrWriter, RayHits, RosHeader, Schema};
use crate::scene_update::SceneUpdate;
use crate::stream::{ElementType, StreamKind, StreamSchema};
use crate::writer::WriteResult;
use ndarray::Array2;
use std::collections::BTreeMap;
use std::io;

/// Name of the scene topic, below the environment.
const SCENE_TOPIC: &str = "scene";
/// Topic of the origins of environments.
const PLACES_TOPIC: &str = "/tf_static";

/// A destination of messages.
pub(crate) trait MessageSink: Send {
    /// Adds a channel for a topic that has none, and returns its id.
    fn add_channel(
        &mut self,
        topic: &str,
        schema: Schema,
        metadata: BTreeMap<String, String>,
        lifetime: MessageLifetime,
    ) -> io::Result<u16>;

    /// False if the next message of a channel has no reader, so that its content is not computed.
    fn wants(&self, channel: u16) -> bool;

    /// Writes a message with its time \[ns\].
    fn write(&mut self, channel: u16, nanos: u64, data: &[u8]) -> io::Result<()>;
}

/// Validity of messages after their time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum MessageLifetime {
    /// The message describes one moment.
    Once,
    /// The message is valid until the next one of its topic, so that later readers need it too.
    UntilNext,
}

/// Writes packets as messages.
pub(crate) struct RosWriter<S> {
    pub(crate) sink: S,
    /// Channels by topic.
    channels: BTreeMap<String, u16>,
    /// Channels of each row of each stream, in the order of [`topics`].
    rows: Vec<Vec<Vec<u16>>>,
    events: u16,
    cdr: CdrWriter,
    png: PngWriter,
}

/// Converts a time to nanoseconds; negative times become 0.
pub(crate) fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

impl<S: MessageSink> RosWriter<S> {
    /// Adds the channels of all streams, and writes the origins of the recorded environments. `origins` are those of all
    /// environments in the world \[m\], shape (N, 3). `start` is the time at which the recording begins \[s\].
    pub(crate) fn create(sink: S, streams: &[StreamSchema], origins: &Array2<f64>, start: f64) -> io::Result<Self> {
        let (rows, cdr, png) = (Vec::new(), CdrWriter::default(), PngWriter::default());
        let mut writer = Self { sink, channels: BTreeMap::new(), rows, events: 0, cdr, png };
        for stream in streams {
            let mut of_stream = Vec::new();
            for env in &stream.env_ids {
                let mut of_row = Vec::new();
                for (k, (topic, schema)) in topics(stream).into_iter().enumerate() {
                    let about = channel_metadata(stream, k);
                    of_row.push(writer.channel(format!("/env_{env}/{topic}"), schema, about, MessageLifetime::Once)?);
                }
                of_stream.push(of_row);
            }
            writer.rows.push(of_stream);
        }
        writer.events = writer.channel("/events".into(), Schema::Log, BTreeMap::new(), MessageLifetime::Once)?;
        writer.write_places(streams, origins, start)?;
        Ok(writer)
    }

    /// The channel of a topic; added at the first call.
    fn channel(
        &mut self,
        topic: String,
        schema: Schema,
        metadata: BTreeMap<String, String>,
        lifetime: MessageLifetime,
    ) -> io::Result<u16> {
        if let Some(id) = self.channels.get(&topic) {
            return Ok(*id);
        }
        let id = self.sink.add_channel(&topic, schema, metadata, lifetime)?;
        self.channels.insert(topic, id);
        Ok(id)
    }

    fn write_places(&mut self, streams: &[StreamSchema], origins: &Array2<f64>, start: f64) -> io::Result<()> {
        let channel =
            self.channel(PLACES_TOPIC.into(), Schema::TfMessage, BTreeMap::new(), MessageLifetime::UntilNext)?;
        let mut envs: Vec<usize> = streams.iter().flat_map(|stream| stream.env_ids.iter().copied()).collect();
        envs.sort_unstable();
        envs.dedup();
        let frames: Vec<String> = envs.iter().map(|env| format!("env_{env}")).collect();
        let place = |env: &usize| [origins[(*env, 0)], origins[(*env, 1)], origins[(*env, 2)], 1.0, 0.0, 0.0, 0.0];
        let poses: Vec<f64> = envs.iter().flat_map(place).collect();
        self.cdr.begin();
        ros::transforms(&mut self.cdr, RosHeader { nanos: nanos(start), frame: "world" }, "", &frames, &poses);
        self.sink.write(channel, nanos(start), self.cdr.bytes())
    }

    /// Writes the content of a packet.
    pub(crate) fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        if let Some(event) = &packet.event {
            self.write_event(event)?;
        }
        packet.scenes.iter().try_for_each(|update| self.write_scene(update))?;
        for (index, (stream, block)) in
            streams.iter().zip(&packet.streams).enumerate().filter(|(_, (_, b))| b.has_content)
        {
            for row in (0..stream.env_ids.len()).filter(|row| block.is_new[*row]) {
                self.write_row(stream, block, index, row)?;
            }
        }
        Ok(())
    }

    fn write_event(&mut self, event: &Event) -> io::Result<()> {
        let at = nanos(event.recorded_time);
        for (env, time) in event.env_ids.iter().zip(&event.times) {
            let (kind, step) = (event.kind.name(), event.step);
            self.cdr.begin();
            let mut message = format!("{kind} at step {step}, simulation time now {time} s");
            if !event.text.is_empty() {
                message = format!("{message}: {}", event.text);
            }
            ros::log(&mut self.cdr, at, event.kind.is_warning(), &format!("env_{env}"), &message);
            self.sink.write(self.events, at, self.cdr.bytes())?;
        }
        Ok(())
    }

    fn write_scene(&mut self, update: &SceneUpdate) -> io::Result<()> {
        let (at, home) = (nanos(update.at), format!("env_{}", update.env));
        let topic = format!("/{home}/{SCENE_TOPIC}");
        let channel = self.channel(topic, Schema::SceneUpdate, BTreeMap::new(), MessageLifetime::UntilNext)?;
        // Scene messages are large, so that their memory is not kept.
        let mut cdr = CdrWriter::default();
        cdr.begin();
        ros::scene_update(&mut cdr, RosHeader { nanos: at, frame: &home }, update);
        self.sink.write(channel, at, cdr.bytes())
    }

    fn write_row(&mut self, stream: &StreamSchema, block: &StreamRows, index: usize, row: usize) -> WriteResult {
        let channels = &self.rows[index][row];
        if !channels.iter().any(|channel| self.sink.wants(*channel)) {
            return Ok(());
        }
        let env = stream.env_ids[row];
        let at = nanos(block.recorded_times[row]);
        let width = stream.width();
        let range = row * width..(row + 1) * width;
        let states = block.values.as_f64s().get(range.clone()).unwrap_or(&[]);
        let home = format!("env_{env}");
        let own = |name: &str| format!("{home}/{name}");
        // An object may have the name of a sensor. The prefix keeps their frames apart.
        let sensors = own("sensors/");
        let seen_by = |sensor: &str| format!("{sensors}{sensor}");
        let (cdr, in_env) = (&mut self.cdr, RosHeader { nanos: at, frame: &home });
        cdr.begin();
        match &stream.kind {
            StreamKind::Joints { names } => ros::joint_state(cdr, in_env, names, states),
            StreamKind::Poses { frames } => ros::transforms(cdr, in_env, &own(""), frames, states),
            StreamKind::Image { camera, height, width, .. } => {
                let frame = seen_by(camera);
                let stamp = RosHeader { nanos: at, frame: &frame };
                if stream.element_type == ElementType::U8 {
                    let pixels = block.values.as_u8s().get(range).unwrap_or(&[]);
                    ros::compressed_image(cdr, stamp, self.png.encode_rgb(pixels, [*width, *height])?);
                } else {
                    let components = stream.fields.first().map_or(1, |part| part.shape.get(2).copied().unwrap_or(1));
                    if let Some(ids) = small_mask_ids(&block.values, range.clone()) {
                        let put =
                            |bytes: &mut Vec<u8>| ids.iter().for_each(|id| bytes.extend_from_slice(&id.to_le_bytes()));
                        ros::image(cdr, stamp, "16UC1", *height, *width, 2 * *width, put);
                    } else {
                        let kind = if stream.element_type == ElementType::I32 { "32SC" } else { "32FC" };
                        let (encoding, row_bytes) = (format!("{kind}{components}"), 4 * components * *width);
                        let put = |bytes: &mut Vec<u8>| block.values.append_bytes(range, bytes);
                        ros::image(cdr, stamp, &encoding, *height, *width, row_bytes, put);
                    }
                }
            }
            StreamKind::CameraInfo { camera, height, width, distortion } => {
                let part = |name| stream.field(states, name);
                ros::transforms(cdr, in_env, &sensors, std::slice::from_ref(camera), part("pose"));
                let Some(distortion) = distortion else {
                    return Ok(self.sink.write(channels[0], at, cdr.bytes())?);
                };
                self.sink.write(channels[1], at, cdr.bytes())?;
                cdr.begin();
                let frame = seen_by(camera);
                let stamp = RosHeader { nanos: at, frame: &frame };
                let matrices = ["intrinsics", "rectification", "projection"].map(part);
                ros::camera_info(cdr, stamp, *height, *width, matrices, distortion);
            }
            StreamKind::Imu => {
                let part = |name| stream.field(states, name);
                let pose = [part("pos_w"), part("quat_w")].concat();
                ros::transforms(cdr, in_env, &sensors, std::slice::from_ref(&stream.name), &pose);
                self.sink.write(channels[1], at, cdr.bytes())?;
                cdr.begin();
                let frame = seen_by(&stream.name);
                let stamp = RosHeader { nanos: at, frame: &frame };
                ros::twist_or_accel(cdr, stamp, part("lin_vel_b"), part("ang_vel_b"));
                self.sink.write(channels[2], at, cdr.bytes())?;
                cdr.begin();
                ros::twist_or_accel(cdr, stamp, part("lin_acc_b"), part("ang_acc_b"));
                self.sink.write(channels[3], at, cdr.bytes())?;
                cdr.begin();
                ros::imu(cdr, stamp, part("quat_w"), part("ang_vel_b"), part("lin_acc_b"));
            }
            StreamKind::RayHits => {
                let part = |name| stream.field(states, name);
                let pose = [part("pos_w"), part("quat_w")].concat();
                ros::transforms(cdr, in_env, &sensors, std::slice::from_ref(&stream.name), &pose);
                self.sink.write(channels[1], at, cdr.bytes())?;
                cdr.begin();
                let distances = part("distances");
                ros::float64_multi_array(cdr, "distances", &[distances.len()], distances);
                self.sink.write(channels[2], at, cdr.bytes())?;
                cdr.begin();
                let hits = RayHits { points: part("hits"), distances, normals: part("normals"), ids: part("ids") };
                ros::point_cloud(cdr, in_env, hits);
            }
            StreamKind::SensorValues { .. } | StreamKind::EngineState | StreamKind::TaskResult => {
                let mut rest = states;
                for (part, channel) in stream.fields.iter().zip(channels) {
                    let (mine, after) = rest.split_at(part.width().min(rest.len()));
                    rest = after;
                    cdr.begin();
                    ros::float64_multi_array(cdr, &part.name, &part.shape, mine);
                    self.sink.write(*channel, nanos(block.recorded_time(part, row)), cdr.bytes())?;
                }
                return Ok(());
            }
        }
        Ok(self.sink.write(channels[0], at, cdr.bytes())?)
    }
}

/// Mask ids as 16-bit numbers, which viewers support; `None` for other types of values, and if an id is negative or
/// larger.
fn small_mask_ids(values: &ValueBuffer, range: std::ops::Range<usize>) -> Option<Vec<u16>> {
    let ValueBuffer::I32(ids) = values else { return None };
    ids.get(range)?.iter().map(|id| u16::try_from(*id).ok()).collect()
}

/// Channel metadata of field number `part` of a stream of sensor values: names, separated by commas, and the unit.
/// Empty for other streams.
fn channel_metadata(stream: &StreamSchema, part: usize) -> BTreeMap<String, String> {
    let StreamKind::SensorValues { rows, filters } = &stream.kind else { return BTreeMap::new() };
    let unit = stream.fields.get(part).map(|part| part.unit.clone()).unwrap_or_default();
    let all = [("rows", rows.join(",")), ("filters", filters.join(",")), ("unit", unit)];
    all.into_iter().filter(|(_, text)| !text.is_empty()).map(|(what, text)| (what.to_string(), text)).collect()
}

/// Finds a topic that streams with different message types would share; `None` without a conflict. With `scenes`,
/// includes the scene topic.
pub(crate) fn topic_conflict(streams: &[&StreamSchema], scenes: bool) -> Option<String> {
    let scene = scenes.then(|| (SCENE_TOPIC.to_string(), Schema::SceneUpdate));
    let mut known: BTreeMap<String, Schema> = scene.into_iter().collect();
    streams.iter().flat_map(|stream| topics(stream)).find_map(|(topic, schema)| match known.get(&topic) {
        Some(other) => (*other != schema).then_some(topic),
        None => {
            known.insert(topic, schema);
            None
        }
    })
}

/// Topics below the environment, and message types, of a row of a stream.
fn topics(stream: &StreamSchema) -> Vec<(String, Schema)> {
    let name = stream.name.clone();
    let transforms = || ("tf".to_string(), Schema::TfMessage);
    match &stream.kind {
        StreamKind::Joints { .. } => vec![(name, Schema::JointState)],
        StreamKind::Poses { .. } => vec![transforms()],
        StreamKind::Image { .. } if stream.element_type == ElementType::U8 => vec![(name, Schema::CompressedImage)],
        StreamKind::Image { .. } => vec![(name, Schema::Image)],
        StreamKind::CameraInfo { distortion: None, .. } => vec![transforms()],
        StreamKind::CameraInfo { camera, .. } => {
            vec![(format!("{camera}/camera_info"), Schema::CameraInfo), transforms()]
        }
        StreamKind::Imu => {
            let (velocity, acceleration) = (format!("{name}/velocity"), format!("{name}/acceleration"));
            vec![
                (name, Schema::Imu),
                transforms(),
                (velocity, Schema::TwistStamped),
                (acceleration, Schema::AccelStamped),
            ]
        }
        StreamKind::RayHits => vec![
            (format!("{name}/points"), Schema::PointCloud2),
            transforms(),
            (format!("{name}/distances"), Schema::Float64MultiArray),
        ],
        StreamKind::SensorValues { .. } | StreamKind::EngineState | StreamKind::TaskResult => {
            let called = |part: &str| if part.is_empty() { name.clone() } else { format!("{name}/{part}") };
            let topic = |part: &crate::stream::StreamField| (called(&part.name), Schema::Float64MultiArray);
            stream.fields.iter().map(topic).collect()
        }
    }
}
