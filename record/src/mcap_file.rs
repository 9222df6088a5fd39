//! MCAP files of ROS 2 messages.
//!
//! | what | topic | type |
//! |---|---|---|
//! | joint states, targets | `/env_0/arm/joint_states`, `/env_0/arm/targets` | `sensor_msgs/msg/JointState` |
//! | poses of links and objects | `/env_0/tf` | `tf2_msgs/msg/TFMessage`, frames `env_0/arm/link` |
//! | colour | `/env_0/camera/color` | `sensor_msgs/msg/CompressedImage`, PNG |
//! | other channels | `/env_0/camera/depth` | `sensor_msgs/msg/Image`, `32FC1`, `32SC1`, `32FC3` |
//! | lens and pose of a camera | `/env_0/camera/camera_info`, where ROS has words for the lens, `/env_0/tf` | `sensor_msgs/msg/CameraInfo`, frame `env_0/sensors/camera` |
//! | IMU | `/env_0/imu` | `sensor_msgs/msg/Imu` |
//! | ray caster | `/env_0/scanner/points` | `sensor_msgs/msg/PointCloud2` |
//! | other sensors | `/env_0/feet/net_forces_w` | `std_msgs/msg/Float64MultiArray` |
//! | resets, writes | `/events` | `rcl_interfaces/msg/Log` |
//! | places of environments | `/tf_static` | `tf2_msgs/msg/TFMessage`, from `world` to `env_0` |
//! | the scene | attachment `scene.zip` | MJCF with meshes: see `scene_file.rs` |
//!
//! Messages have the time of capture, on the clock of the recording (`clock.rs`): forces, efforts and accelerations of sensors
//! that of the beginning of the step. The message of joint states of a robot has one time, that of its positions; its efforts
//! are those of the step that led there.
//!
//! Of ray casters, points that hit something are written; NumPy archives have the distances and the misses too.

use crate::error::{RecordError, Result};
use crate::file::{PartFile, Storage, lock_left, part_of, remove};
use crate::packet::{Block, Event, Packet};
use crate::picture::Png;
use crate::ros::{self, Cdr, Schema, Stamp};
use crate::scene_file::SCENE;
use crate::stream::{Element, Kind, Stream};
use crate::writer::{Sink, Written};
use mcap::records::{AttachmentHeader, MessageHeader, Record};
use mcap::sans_io::{LinearReadEvent, LinearReader, LinearReaderOptions};
use mcap::{Attachment, Compression, McapError, WriteOptions, Writer};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::io::{self, BufWriter, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Messages that are compressed together \[bytes\].
const CHUNK: u64 = 1 << 20;
const PROFILE: &str = "ros2";
const ENCODING: &str = "cdr";
const SCHEMA_ENCODING: &str = "ros2msg";

/// An MCAP file on its way.
pub(crate) struct McapFile {
    part: PartFile,
    /// `None` once the file is whole.
    writer: Option<Writer<BufWriter<Box<dyn Storage>>>>,
    channels: Channels,
    /// Channels of every row of every stream, in the order of what a row is written as.
    rows: Vec<Vec<Vec<u16>>>,
    events: u16,
    cdr: Cdr,
    png: Png,
}

/// The channels of a file, by topic.
#[derive(Default)]
struct Channels {
    schemas: BTreeMap<Schema, u16>,
    known: BTreeMap<String, u16>,
    /// Messages in each channel.
    counts: BTreeMap<u16, u32>,
}

impl Channels {
    fn add(&mut self, writer: &mut Writer<impl Write + Seek>, topic: String, schema: Schema) -> io::Result<u16> {
        if let Some(id) = self.known.get(&topic) {
            return Ok(*id);
        }
        let schema_id = match self.schemas.get(&schema) {
            Some(id) => *id,
            None => {
                let id =
                    writer.add_schema(schema.name(), SCHEMA_ENCODING, schema.text().as_bytes()).map_err(io_error)?;
                self.schemas.insert(schema, id);
                id
            }
        };
        let id = writer.add_channel(schema_id, &topic, ENCODING, &BTreeMap::new()).map_err(io_error)?;
        self.known.insert(topic, id);
        Ok(id)
    }

    fn write(
        &mut self,
        writer: &mut Writer<impl Write + Seek>,
        channel: u16,
        nanos: u64,
        data: &[u8],
    ) -> io::Result<()> {
        let sequence = self.counts.entry(channel).or_insert(0);
        let header = MessageHeader { channel_id: channel, sequence: *sequence, log_time: nanos, publish_time: nanos };
        *sequence = sequence.wrapping_add(1);
        writer.write_to_known_channel(&header, data).map_err(io_error)
    }
}

fn io_error(error: McapError) -> io::Error {
    match error {
        McapError::Io(error) => error,
        other => io::Error::other(other),
    }
}

fn finished() -> io::Error {
    io::Error::other("the file is finished already")
}

/// A time in nanoseconds; times before 0 are 0.
fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

fn options() -> WriteOptions {
    WriteOptions::new()
        .compression(Some(Compression::Lz4))
        .chunk_size(Some(CHUNK))
        // Chunks are made in memory and written with their lengths: a killed process leaves no length that is wrong.
        .disable_seeking(true)
        .profile(PROFILE)
        .library(concat!("kinetoscope ", env!("CARGO_PKG_VERSION")))
}

impl McapFile {
    /// Begins a file; `origins` are the places of all environments in the world \[m\], (N, 3), and `start` is the time at which
    /// the recording begins \[s\].
    pub(crate) fn create(
        mut part: PartFile,
        storage: Box<dyn Storage>,
        streams: &[Stream],
        origins: &Array2<f64>,
        start: f64,
        scene: Option<&[u8]>,
    ) -> io::Result<Self> {
        let to = BufWriter::with_capacity(1 << 16, storage);
        let mut writer = options().create(to).map_err(io_error)?;
        if let Some(scene) = scene {
            let (name, media_type, data) = (SCENE.into(), "application/zip".into(), scene.into());
            let at = nanos(start);
            writer.attach(&Attachment { log_time: at, create_time: at, name, media_type, data }).map_err(io_error)?;
        }
        let mut channels = Channels::default();
        let mut rows = Vec::new();
        for stream in streams {
            let mut of_stream = Vec::new();
            for env in &stream.env_ids {
                let mut of_row = Vec::new();
                for (topic, schema) in topics(stream) {
                    of_row.push(channels.add(&mut writer, format!("/env_{env}/{topic}"), schema)?);
                }
                of_stream.push(of_row);
            }
            rows.push(of_stream);
        }
        let events = channels.add(&mut writer, "/events".into(), Schema::Log)?;
        let places = channels.add(&mut writer, "/tf_static".into(), Schema::TfMessage)?;
        let mut cdr = Cdr::default();
        cdr.begin();
        let mut envs: Vec<usize> = streams.iter().flat_map(|stream| stream.env_ids.iter().copied()).collect();
        envs.sort_unstable();
        envs.dedup();
        let frames: Vec<String> = envs.iter().map(|env| format!("env_{env}")).collect();
        let place = |env: &usize| [origins[(*env, 0)], origins[(*env, 1)], origins[(*env, 2)], 1.0, 0.0, 0.0, 0.0];
        let poses: Vec<f64> = envs.iter().flat_map(place).collect();
        ros::transforms(&mut cdr, Stamp { nanos: nanos(start), frame: "world" }, "", &frames, &poses);
        channels.write(&mut writer, places, nanos(start), cdr.bytes())?;
        part.keep();
        Ok(Self { part, writer: Some(writer), channels, rows, events, cdr, png: Png::default() })
    }

    fn write_event(&mut self, event: &Event) -> io::Result<()> {
        let at = nanos(event.at);
        let writer = self.writer.as_mut().ok_or_else(finished)?;
        for (env, time) in event.env_ids.iter().zip(&event.times) {
            let (kind, step) = (event.kind.name(), event.step);
            self.cdr.begin();
            let message = format!("{kind} at step {step}, simulation time now {time} s");
            ros::log(&mut self.cdr, at, &format!("env_{env}"), &message);
            self.channels.write(writer, self.events, at, self.cdr.bytes())?;
        }
        Ok(())
    }

    fn write_row(&mut self, stream: &Stream, block: &Block, index: usize, row: usize) -> Written {
        let writer = self.writer.as_mut().ok_or_else(finished)?;
        let env = stream.env_ids[row];
        let at = nanos(block.stamps[row]);
        let (channels, width) = (self.rows[index][row].clone(), stream.width());
        let range = row * width..(row + 1) * width;
        let states = block.values.states().get(range.clone()).unwrap_or(&[]);
        let home = format!("env_{env}");
        let own = |name: &str| format!("{home}/{name}");
        // An object may be called as a sensor: their frames are not.
        let sensors = own("sensors/");
        let seen_by = |sensor: &str| format!("{sensors}{sensor}");
        let (cdr, in_env) = (&mut self.cdr, Stamp { nanos: at, frame: &home });
        cdr.begin();
        match &stream.kind {
            Kind::Joints { names } => ros::joint_state(cdr, in_env, names, states),
            Kind::Poses { frames } => ros::transforms(cdr, in_env, &own(""), frames, states),
            Kind::Picture { camera, height, width, .. } => {
                let frame = seen_by(camera);
                let stamp = Stamp { nanos: at, frame: &frame };
                if stream.element == Element::U8 {
                    let pixels = block.values.bytes().get(range).unwrap_or(&[]);
                    ros::compressed_image(cdr, stamp, self.png.rgb(pixels, [*width, *height])?);
                } else {
                    let components = stream.parts.first().map_or(1, |part| part.shape.get(2).copied().unwrap_or(1));
                    let kind = if stream.element == Element::I32 { "32SC" } else { "32FC" };
                    let shape = (*height, *width, 4 * components * *width);
                    let put = |bytes: &mut Vec<u8>| block.values.put(range, bytes);
                    ros::image(cdr, stamp, &format!("{kind}{components}"), shape, put);
                }
            }
            Kind::Lens { camera, height, width, distortion } => {
                let (k, pose) = states.split_at(9.min(states.len()));
                ros::transforms(cdr, in_env, &sensors, std::slice::from_ref(camera), pose);
                let Some(distortion) = distortion else {
                    return Ok(self.channels.write(writer, channels[0], at, cdr.bytes())?);
                };
                self.channels.write(writer, channels[1], at, cdr.bytes())?;
                cdr.begin();
                let frame = seen_by(camera);
                ros::camera_info(cdr, Stamp { nanos: at, frame: &frame }, (*height, *width), k, distortion);
            }
            Kind::Imu => {
                let part = |name: &str| {
                    let before = stream.parts.iter().take_while(|part| part.name != name);
                    let first: usize = before.map(|part| part.width()).sum();
                    let width = stream.parts.iter().find(|part| part.name == name).map_or(0, |part| part.width());
                    states.get(first..first + width).unwrap_or(&[])
                };
                let pose = [part("pos_w"), part("quat_w")].concat();
                ros::transforms(cdr, in_env, &sensors, std::slice::from_ref(&stream.name), &pose);
                self.channels.write(writer, channels[1], at, cdr.bytes())?;
                cdr.begin();
                let frame = seen_by(&stream.name);
                let stamp = Stamp { nanos: at, frame: &frame };
                ros::imu(cdr, stamp, part("quat_w"), part("ang_vel_b"), part("lin_acc_b"));
            }
            Kind::Points => {
                let points = stream.parts.first().map_or(0, |part| part.width());
                ros::points(cdr, in_env, states.get(..points).unwrap_or(&[]));
            }
            Kind::Numbers => {
                let mut rest = states;
                for (part, channel) in stream.parts.iter().zip(&channels) {
                    let (mine, after) = rest.split_at(part.width().min(rest.len()));
                    rest = after;
                    cdr.begin();
                    ros::numbers(cdr, &part.name, &part.shape, mine);
                    self.channels.write(writer, *channel, nanos(block.stamp(part, row)), cdr.bytes())?;
                }
                return Ok(());
            }
        }
        Ok(self.channels.write(writer, channels[0], at, cdr.bytes())?)
    }
}

/// A topic that streams would share whose messages are of different types: one of them would be read as the other.
pub(crate) fn taken(streams: &[&Stream]) -> Option<String> {
    let mut known: BTreeMap<String, Schema> = BTreeMap::new();
    streams.iter().flat_map(|stream| topics(stream)).find_map(|(topic, schema)| match known.get(&topic) {
        Some(other) => (*other != schema).then_some(topic),
        None => {
            known.insert(topic, schema);
            None
        }
    })
}

/// What a row of a stream is written as: topics behind the environment, and types.
fn topics(stream: &Stream) -> Vec<(String, Schema)> {
    let name = stream.name.clone();
    let transforms = || ("tf".to_string(), Schema::TfMessage);
    match &stream.kind {
        Kind::Joints { .. } => vec![(name, Schema::JointState)],
        Kind::Poses { .. } => vec![transforms()],
        Kind::Picture { .. } if stream.element == Element::U8 => vec![(name, Schema::CompressedImage)],
        Kind::Picture { .. } => vec![(name, Schema::Image)],
        Kind::Lens { distortion: None, .. } => vec![transforms()],
        Kind::Lens { camera, .. } => vec![(format!("{camera}/camera_info"), Schema::CameraInfo), transforms()],
        Kind::Imu => vec![(name, Schema::Imu), transforms()],
        Kind::Points => vec![(format!("{name}/points"), Schema::PointCloud2)],
        Kind::Numbers => {
            let topic = |part: &crate::stream::Part| (format!("{name}/{}", part.name), Schema::Float64MultiArray);
            stream.parts.iter().map(topic).collect()
        }
    }
}

impl Sink for McapFile {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written {
        if let Some(event) = &packet.event {
            self.write_event(event)?;
        }
        for (index, (stream, block)) in streams.iter().zip(&packet.blocks).enumerate().filter(|(_, (_, b))| b.used) {
            for row in (0..stream.env_ids.len()).filter(|row| block.fresh[*row]) {
                self.write_row(stream, block, index, row)?;
            }
        }
        Ok(())
    }

    /// Ends the chunk: what a killed process leaves ends with a whole one.
    fn flush(&mut self) -> Written {
        Ok(self.writer.as_mut().ok_or_else(finished)?.flush().map_err(io_error)?)
    }

    fn finish(&mut self, _streams: &[Stream]) -> Written<u64> {
        let mut writer = self.writer.take().ok_or_else(finished)?;
        writer.finish().map_err(io_error)?;
        writer.into_inner().flush()?;
        Ok(self.part.commit()?)
    }

    fn kept(&self) -> Option<PathBuf> {
        self.part.kept()
    }
}

/// How many messages stand in whole and undamaged chunks at the beginning of a file, what is attached there, and what is wrong with the next chunk, if
/// that is more than a torn end. Chunks are compared with their checksums before anything in them is believed: a length that is
/// no length would be asked for as memory.
fn sound_messages(bytes: &[u8]) -> (usize, Vec<Attachment<'static>>, Option<String>) {
    let options = LinearReaderOptions::default()
        .with_skip_end_magic(true)
        .with_prevalidate_chunk_crcs(true)
        .with_record_length_limit(bytes.len().max(LARGEST_CHUNK));
    let (mut reader, mut rest, mut messages) = (LinearReader::new_with_options(options), bytes, 0);
    let (mut attachments, mut lost) = (Vec::new(), None);
    while let Some(event) = reader.next_event() {
        match event {
            Ok(LinearReadEvent::ReadRequest(wanted)) => {
                let (given, left) = rest.split_at(wanted.min(rest.len()));
                reader.insert(given.len())[..given.len()].copy_from_slice(given);
                reader.notify_read(given.len());
                rest = left;
            }
            Ok(LinearReadEvent::Record { opcode, data }) => {
                messages += usize::from(opcode == mcap::records::op::MESSAGE);
                if opcode != mcap::records::op::ATTACHMENT {
                    continue;
                }
                match mcap::parse_record(opcode, data) {
                    Ok(Record::Attachment { header, data, .. }) => {
                        let AttachmentHeader { log_time, create_time, name, media_type } = header;
                        let data = data.into_owned().into();
                        attachments.push(Attachment { log_time, create_time, name, media_type, data });
                    }
                    Ok(_) => {}
                    // The messages may be whole; that something is lost is said.
                    Err(error) => lost = Some(error.to_string()),
                }
            }
            // Where the process was killed.
            Err(McapError::UnexpectedEof) => break,
            Err(error) => return (messages, attachments, Some(error.to_string())),
        }
    }
    (messages, attachments, lost)
}

/// Chunks are smaller by far, before they are compressed \[bytes\].
const LARGEST_CHUNK: usize = 1 << 30;

/// What was made of a recording that was killed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Recovered {
    /// Messages in the file.
    pub messages: u64,
    /// What stands in the way of the rest, where that is more than a last chunk that was not written whole: then what was left
    /// is still there, for other tools.
    pub damage: Option<String>,
}

/// Makes a whole file of what a recording has left that was killed: `path` is the name that it was to have. The scene, and
/// the messages of all chunks from the beginning that are whole, are in it, and what was left is taken away, unless something in it is damaged.
///
/// # Errors
/// There is no such recording, somebody is writing it, there is a file called `path` already, or no message can be read.
/// What was left is as it was then.
pub fn recover(path: impl AsRef<Path>) -> Result<Recovered> {
    let path = path.as_ref();
    let left = part_of(path);
    let missing = || RecordError::file(&left, io::ErrorKind::NotFound.into());
    let mut locked = lock_left(&left)?.ok_or_else(missing)?;
    let mut bytes = Vec::new();
    locked.read_to_end(&mut bytes).map_err(|error| RecordError::file(&left, error))?;
    let nothing =
        |why: String| RecordError::Malformed { path: left.clone(), what: format!("nothing of it can be read: {why}") };
    if !bytes.starts_with(mcap::MAGIC) {
        return Err(nothing("this is no MCAP file".into()));
    }
    // What an earlier attempt left that was killed is of no use.
    let on_the_way = left.with_extension("recovered");
    remove(&on_the_way)?;
    let (mut part, file) = PartFile::create_as(path, on_the_way, false)?;
    let failed = |error: McapError| RecordError::file(path, io_error(error));
    let mut writer = options().create(BufWriter::new(file)).map_err(failed)?;
    let (sound, attachments, mut damage) = sound_messages(&bytes);
    for attachment in &attachments {
        writer.attach(attachment).map_err(failed)?;
    }
    let messages = mcap::MessageStream::new_with_options(&bytes, mcap::read::Options::IgnoreEndMagic.into());
    let mut recovered = Recovered { messages: 0, damage: None };
    for message in messages.map_err(|error| nothing(error.to_string()))?.take(sound) {
        match message {
            Ok(message) => writer.write(&message).map_err(failed)?,
            Err(error) => {
                damage = Some(error.to_string());
                break;
            }
        }
        recovered.messages += 1;
    }
    recovered.damage = damage;
    if recovered.messages == 0 {
        return Err(nothing(recovered.damage.unwrap_or_else(|| "there is no whole message in it".into())));
    }
    writer.finish().map_err(failed)?;
    writer.into_inner().flush().map_err(|error| RecordError::file(path, error))?;
    part.commit().map_err(|error| RecordError::file(path, error))?;
    if recovered.damage.is_none() {
        remove(&left)?;
    }
    Ok(recovered)
}
