//! What the streams of a recording are called in a LeRobot dataset.

use super::COMMON;
use super::parquet;
use crate::error::{RecordError, Result};
use crate::stream::{Kind, Stream};
use serde_json::{Map, Value, json};
use std::path::Path;

/// Everything that a frame has, in the order of its columns.
pub(super) struct Features {
    pub(super) numbers: Vec<Feature>,
    /// Stream, name, width and height.
    pub(super) pictures: Vec<(usize, String, [usize; 2])>,
    /// The stream whose rows are frames.
    pub(super) base: usize,
}

/// Numbers of a frame.
pub(super) struct Feature {
    name: String,
    /// What each of them is.
    pub(super) names: Vec<String>,
    /// Streams, and which numbers of their rows.
    parts: Vec<(usize, std::ops::Range<usize>)>,
    /// Whether it is an action: that of a frame comes with the row after it.
    pub(super) later: bool,
}

const STATE: [(&str, bool); 3] =
    [("observation.state", false), ("observation.velocity", false), ("observation.effort", false)];
const TARGETS: [(&str, bool); 3] = [("action", true), ("target.velocity", true), ("target.effort", true)];
const CONTROLS: [(&str, bool); 3] = [STATE[0], STATE[1], TARGETS[0]];

/// Whether a dataset has a place for a stream.
pub(crate) fn holds(stream: &Stream) -> bool {
    match &stream.kind {
        Kind::Joints { .. } | Kind::Imu | Kind::Numbers => true,
        Kind::Poses { .. } => is_object(stream),
        Kind::Picture { channel, .. } => channel == "color",
        Kind::Lens { .. } | Kind::Points => false,
    }
}

/// Links have several poses, and follow from joints.
fn is_object(stream: &Stream) -> bool {
    matches!(&stream.kind, Kind::Poses { frames } if stream.name == format!("{}/pose", frames.join("/")))
}

fn is_mjcf(stream: &Stream) -> bool {
    stream.name.ends_with("/state")
        && stream.parts.iter().map(|part| &*part.name).eq(["positions", "velocities", "controls"])
}

/// Names of features have no strokes.
fn dotted(name: &str) -> String {
    name.replace('/', ".")
}

impl Features {
    pub(super) fn of(path: &Path, streams: &[Stream]) -> Result<Self> {
        let mut all = Self { numbers: Vec::new(), pictures: Vec::new(), base: 0 };
        let mut base = None;
        for (s, stream) in streams.iter().enumerate() {
            let uid = stream.name.rsplit_once('/').map_or(stream.name.as_str(), |(uid, _)| uid);
            let roles: Option<[(&str, bool); 3]> = match &stream.kind {
                Kind::Joints { .. } if stream.name.ends_with("/targets") => Some(TARGETS),
                Kind::Joints { .. } => Some(STATE),
                _ if is_mjcf(stream) => Some(CONTROLS),
                _ => None,
            };
            if let Kind::Picture { camera, height, width, .. } = &stream.kind {
                all.pictures.push((s, format!("observation.images.{}", dotted(camera)), [*width, *height]));
                continue;
            }
            if roles.is_some() || is_object(stream) {
                base.get_or_insert(s);
            }
            let mut first = 0;
            for (k, part) in stream.parts.iter().enumerate() {
                let range = first..first + part.width();
                first = range.end;
                let names: Vec<String> = match &stream.kind {
                    Kind::Joints { names } => names.iter().map(|name| format!("{uid}/{name}")).collect(),
                    Kind::Poses { frames } => ["x", "y", "z", "qw", "qx", "qy", "qz"]
                        .map(|number| format!("{}.{number}", frames.join("/")))
                        .into(),
                    _ => (0..part.width()).map(|number| format!("{}/{}[{number}]", stream.name, part.name)).collect(),
                };
                let (feature, later) = match roles {
                    Some(roles) => (roles[k].0.to_string(), roles[k].1),
                    None if is_object(stream) => ("observation.environment_state".to_string(), false),
                    None => (format!("sensors.{}.{}", dotted(&stream.name), dotted(&part.name)), false),
                };
                all.append(feature, later, names, (s, range));
            }
        }
        all.numbers.retain(|feature| !feature.names.is_empty());
        all.base = base.ok_or_else(|| RecordError::NoPlace {
            path: path.into(),
            format: crate::Format::LeRobot,
            topic: "sensors alone: frames are rows of joints or objects".into(),
        })?;
        let mut names: Vec<&str> = all.names().collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(RecordError::SameName { path: path.into(), name: pair[0].into() });
        }
        Ok(all)
    }

    /// Joints of several robots are one feature.
    fn append(&mut self, name: String, later: bool, names: Vec<String>, part: (usize, std::ops::Range<usize>)) {
        match self.numbers.iter_mut().find(|feature| feature.name == name && !name.starts_with("sensors.")) {
            Some(feature) => {
                feature.names.extend(names);
                feature.parts.push(part);
            }
            None => self.numbers.push(Feature { name, names, parts: vec![part], later }),
        }
    }

    pub(super) fn names(&self) -> impl Iterator<Item = &str> {
        self.numbers.iter().map(|feature| &*feature.name).chain(self.pictures.iter().map(|(_, name, _)| &**name))
    }

    /// Width and height of the pictures of a stream, if it has any.
    pub(super) fn size_of(&self, stream: usize) -> Option<[usize; 2]> {
        self.pictures.iter().find(|(of, ..)| *of == stream).map(|(.., size)| *size)
    }

    pub(super) fn columns(&self) -> Vec<(String, parquet::Kind)> {
        let numbers = self.numbers.iter().map(|feature| (feature.name.clone(), feature.kind()));
        let pictures = self.pictures.iter().map(|(_, name, _)| (name.clone(), parquet::Kind::Picture));
        let common = COMMON.iter().map(|(name, kind)| {
            (name.to_string(), if *kind == "int64" { parquet::Kind::Int64 } else { parquet::Kind::Float32(1) })
        });
        numbers.chain(pictures).chain(common).collect()
    }

    /// As `meta/info.json` has them.
    pub(super) fn described(&self) -> Map<String, Value> {
        let numbers = self.numbers.iter().map(|Feature { name, names, .. }| {
            (name.clone(), json!({ "dtype": "float32", "shape": [names.len()], "names": names }))
        });
        let pictures = self.pictures.iter().map(|(_, name, [width, height])| {
            let names = ["height", "width", "channels"];
            (name.clone(), json!({ "dtype": "image", "shape": [height, width, 3], "names": names }))
        });
        numbers.chain(pictures).collect()
    }
}

impl Feature {
    /// Its numbers among the rows of all streams, if they are all there.
    pub(super) fn values(&self, rows: &[Option<Vec<f32>>]) -> Option<Vec<f32>> {
        let mut values = Vec::with_capacity(self.names.len());
        for (stream, range) in &self.parts {
            values.extend_from_slice(rows.get(*stream)?.as_ref()?.get(range.clone())?);
        }
        Some(values)
    }
}
