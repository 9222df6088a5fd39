//! Rows of a recorder's MCAP file as arrays of a NumPy archive, for replay.

use super::mcap::{McapItem, visit_items};
use crate::error::{RecordError, Result};
use crate::npz::{INITIAL_STATE, METADATA};
use crate::packet::EventKind;
use crate::ros::Value as Message;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Arrays by name: shape and values.
pub(crate) type Arrays = BTreeMap<String, (Vec<usize>, Vec<f64>)>;

/// Content of a file: description of its streams, initial state, arrays.
pub(crate) struct McapArrays {
    pub(crate) metadata: Value,
    pub(crate) start: Vec<u8>,
    pub(crate) arrays: Arrays,
}

/// A stream while its messages are read.
struct StreamAssembler {
    name: String,
    envs: Vec<usize>,
    /// Names, shapes and widths of its arrays.
    parts: Vec<(String, Vec<usize>, usize)>,
    /// Frames of poses.
    frames: Vec<String>,
    /// Physics steps of the complete rows since the beginning of the recording.
    steps: Vec<f64>,
    /// Rows of each array.
    rows: Vec<Vec<f64>>,
    /// Values of the present row, of each array and environment. Values without a message are those of the row before.
    present_row: Vec<Vec<f64>>,
    has_message: Vec<bool>,
    step: f64,
}

/// Name endings of streams of poses, which are transform messages, and of joints, which have messages of their own.
const POSES: [&str; 3] = ["/link_poses", "/body_poses", "/pose"];
const JOINTS: [&str; 2] = ["/joint_states", "/targets"];

impl StreamAssembler {
    fn name_ends_with(&self, ends: &[&str]) -> bool {
        ends.iter().any(|end| self.name.ends_with(end))
    }

    fn of(stream: &Value) -> Option<Self> {
        let texts = |values: &Value| -> Vec<String> {
            values.as_array().into_iter().flatten().filter_map(|text| text.as_str().map(String::from)).collect()
        };
        let whole = |number: &Value| usize::try_from(number.as_u64()?).ok();
        let envs: Vec<usize> = stream["env_ids"].as_array()?.iter().map(whole).collect::<Option<_>>()?;
        let part = |part: &Value| {
            let shape: Vec<usize> = part["shape"].as_array()?.iter().map(whole).collect::<Option<_>>()?;
            let width = shape.iter().try_fold(1_usize, |all, axis| all.checked_mul(*axis))?;
            Some((part["name"].as_str()?.to_string(), shape, width))
        };
        let parts: Vec<_> = stream["arrays"].as_array()?.iter().map(part).collect::<Option<_>>()?;
        // Rows have the width of their messages, so that a declared width cannot request memory.
        let (present_row, rows) = (vec![Vec::new(); parts.len() * envs.len()], vec![Vec::new(); parts.len()]);
        let has_message = vec![false; parts.len() * envs.len()];
        let (name, frames) = (stream["name"].as_str()?.to_string(), texts(&stream["columns"]));
        Some(Self { name, envs, parts, frames, steps: Vec::new(), rows, present_row, has_message, step: 0.0 })
    }

    /// Adds the values of an array in an environment at a step; `None` if they do not have the declared width, the
    /// environment is unknown, or the row before lacks an environment.
    fn add_values(&mut self, part: usize, env: usize, step: f64, numbers: Vec<f64>) -> Option<()> {
        let row = self.envs.iter().position(|of| *of == env)?;
        if self.parts.get(part)?.2 != numbers.len() {
            return None;
        }
        let place = part * self.envs.len() + row;
        if self.has_message[place] || (step != self.step && self.has_message.contains(&true)) {
            self.end_row()?;
        }
        self.step = step;
        self.has_message[place] = true;
        self.present_row[place] = numbers;
        Some(())
    }

    /// Completes the present row; `None` if an environment has no values yet.
    fn end_row(&mut self) -> Option<()> {
        if !self.has_message.contains(&true) {
            return Some(());
        }
        for ((part, (_, _, width)), of_part) in self.parts.iter().enumerate().zip(&mut self.rows) {
            for row in 0..self.envs.len() {
                let numbers = &self.present_row[part * self.envs.len() + row];
                if numbers.len() != *width {
                    return None;
                }
                of_part.extend_from_slice(numbers);
            }
        }
        self.steps.push(self.step);
        self.has_message.fill(false);
        Some(())
    }
}

/// Values of a list of numbers in a message; empty without such a list.
fn numbers(message: &Message, field: &str) -> Vec<f64> {
    match message.field(field) {
        Some(Message::Numbers(numbers)) => numbers.clone(),
        _ => Vec::new(),
    }
}

/// Frames and poses of a transform message, `[x, y, z, qw, qx, qy, qz]` each.
fn transforms(message: &Message) -> Vec<(String, [f64; 7])> {
    let Some(Message::List(all)) = message.field("transforms") else { return Vec::new() };
    let one = |one: &Message| {
        let Some(Message::Text(frame)) = one.field("child_frame_id") else { return None };
        let of = |part: &str, axis: &str| match one.field("transform")?.field(part)?.field(axis) {
            Some(Message::Number(number)) => Some(*number),
            _ => None,
        };
        let (place, turn) = (|axis| of("translation", axis), |axis| of("rotation", axis));
        let pose = [place("x")?, place("y")?, place("z")?, turn("w")?, turn("x")?, turn("y")?, turn("z")?];
        Some((frame.clone(), pose))
    };
    all.iter().filter_map(one).collect()
}

/// Splits a topic or a frame such as `/env_2/arm/targets` into 2 and `arm/targets`; `None` without an environment.
fn of_env(name: &str) -> Option<(usize, &str)> {
    let (env, rest) = name.trim_start_matches('/').strip_prefix("env_")?.split_once('/')?;
    Some((env.parse().ok()?, rest))
}

/// Parses the text of an event message: kind and physics step. `None` for other text.
fn parse_event(text: &str) -> Option<(EventKind, f64)> {
    let (kind, rest) = text.split_once(" at step ")?;
    let kinds = [EventKind::Reset, EventKind::Written, EventKind::Diverged, EventKind::Note];
    let kind = kinds.into_iter().find(|known| known.name() == kind)?;
    Some((kind, rest.split(',').next()?.parse().ok()?))
}

/// Reads the rows of a file.
///
/// # Errors
/// It is not an MCAP file of a recorder, or is incomplete.
pub(crate) fn read_arrays(path: &Path) -> Result<McapArrays> {
    let malformed = |what: String| RecordError::Malformed { path: path.into(), what };
    let (mut about, mut start) = (None, None);
    let mut streams: Vec<StreamAssembler> = Vec::new();
    let mut start_times: BTreeMap<usize, u64> = BTreeMap::new();
    let mut events: [Vec<f64>; 4] = Default::default();
    let mut dt = 0.0;
    visit_items(path, |told| {
        let (channel, time, data) = match told {
            McapItem::Attachment(attachment) => {
                if attachment.name == INITIAL_STATE {
                    start = Some(attachment.data.into_owned());
                } else if attachment.name == METADATA {
                    let json: Option<Value> = serde_json::from_slice(&attachment.data).ok();
                    let json = json.ok_or_else(|| malformed(format!("{METADATA} is not valid JSON")))?;
                    dt = json["physics_dt"].as_f64().filter(|dt| *dt > 0.0).unwrap_or_default();
                    streams =
                        json["streams"].as_array().into_iter().flatten().filter_map(StreamAssembler::of).collect();
                    about = Some(json);
                }
                return Ok(());
            }
            McapItem::Message { channel, time, data } => (channel, time, data),
        };
        // Without the description, a message cannot be assigned to a stream.
        let Some(reads) = channel.message_type.as_ref().filter(|_| dt > 0.0) else { return Ok(()) };
        if channel.topic == "/events" {
            let message = reads.read(data);
            let text = |field: &str| match message.as_ref().and_then(|message| message.field(field)) {
                Some(Message::Text(text)) => text.clone(),
                _ => String::new(),
            };
            let env = text("name").strip_prefix("env_").and_then(|env| env.parse::<f64>().ok());
            if let (Some(env), Some((kind, step))) = (env, parse_event(&text("msg"))) {
                let row = [step, env, f64::from(kind.number()), f64::NAN];
                events.iter_mut().zip(row).for_each(|(column, number)| column.push(number));
            }
            return Ok(());
        }
        let Some((env, name)) = of_env(&channel.topic) else { return Ok(()) };
        let step = |begun: &mut BTreeMap<usize, u64>| {
            let first = *begun.entry(env).or_insert(time);
            (time.saturating_sub(first) as f64 / 1e9 / dt).round()
        };
        let mismatch = || malformed(format!("{} does not match its description in {METADATA}", channel.topic));
        if name == "tf" {
            let Some(message) = reads.read(data) else { return Err(mismatch()) };
            let poses = transforms(&message);
            let Some((_, first)) = poses.first().and_then(|(frame, _)| of_env(frame)) else { return Ok(()) };
            let has_it = |stream: &&mut StreamAssembler| {
                stream.name_ends_with(&POSES)
                    && stream.parts.len() == 1
                    && stream.frames.first().is_some_and(|frame| frame == first)
            };
            let stream = streams.iter_mut().find(has_it);
            if let Some(stream) = stream {
                let step = step(&mut start_times);
                stream
                    .add_values(0, env, step, poses.iter().flat_map(|(_, pose)| *pose).collect())
                    .ok_or_else(mismatch)?;
            }
            return Ok(());
        }
        let is_it = |stream: &&mut StreamAssembler| {
            stream.name == name && stream.name_ends_with(&JOINTS) && stream.parts.len() == 3
        };
        if let Some(stream) = streams.iter_mut().find(is_it) {
            let Some(message) = reads.read(data) else { return Err(mismatch()) };
            let step = step(&mut start_times);
            for (part, field) in ["position", "velocity", "effort"].into_iter().enumerate() {
                stream.add_values(part, env, step, numbers(&message, field)).ok_or_else(mismatch)?;
            }
        } else if let Some((stream, part)) = streams.iter_mut().find_map(|stream| {
            let part = stream.parts.iter().position(|(array, ..)| array == name)?;
            stream.name.ends_with("/state").then_some((stream, part))
        }) {
            let Some(message) = reads.read(data) else { return Err(mismatch()) };
            let step = step(&mut start_times);
            stream.add_values(part, env, step, numbers(&message, "data")).ok_or_else(mismatch)?;
        }
        Ok(())
    })?;
    let missing =
        |name: &str| malformed(format!("it has no {name}: it was not written by this recorder, or by an older one"));
    let (metadata, start) = (about.ok_or_else(|| missing(METADATA))?, start.ok_or_else(|| missing(INITIAL_STATE))?);
    let mut arrays = Arrays::new();
    for mut stream in streams {
        stream.end_row().ok_or_else(|| malformed(format!("{} lacks an environment", stream.name)))?;
        let count = stream.steps.len();
        if count == 0 {
            continue;
        }
        for ((name, shape, _), numbers) in stream.parts.into_iter().zip(stream.rows) {
            arrays.insert(name, ([&[count, stream.envs.len()][..], &shape].concat(), numbers));
        }
        arrays.insert(format!("{}/step", stream.name), (vec![count], stream.steps));
    }
    for (name, numbers) in ["step", "env", "kind", "time"].into_iter().zip(events) {
        arrays.insert(format!("events/{name}"), (vec![numbers.len()], numbers));
    }
    Ok(McapArrays { metadata, start, arrays })
}
