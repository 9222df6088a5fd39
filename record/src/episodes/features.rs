//! Features of frames: values of streams, with the names of a dataset format.

use crate::error::{RecordError, Result};
use crate::format::Format;
use crate::stream::{StreamKind, StreamSchema};
use std::ops::Range;
use std::path::Path;

/// Content of frames, in the order of the columns.
pub(crate) struct Features {
    pub(crate) numbers: Vec<Feature>,
    pub(crate) images: Vec<ImageFeature>,
    /// Stream whose rows are frames.
    pub(crate) frame_stream: usize,
    /// Stream with the results of task steps; `None` without a task.
    pub(crate) result_stream: Option<usize>,
}

/// A range of values in the rows of a stream.
#[derive(Clone, Debug, PartialEq)]
struct StreamRange {
    stream: usize,
    range: Range<usize>,
}

/// A feature of numbers.
pub(crate) struct Feature {
    pub(crate) role: Role,
    /// Name in the dataset.
    pub(crate) name: String,
    /// Name of each number.
    pub(crate) names: Vec<String>,
    /// Sources of the numbers.
    parts: Vec<StreamRange>,
}

/// A feature of images.
pub(crate) struct ImageFeature {
    pub(crate) stream: usize,
    /// Name in the dataset.
    pub(crate) name: String,
    /// Width and height \[pixels\].
    pub(crate) size: [usize; 2],
}

/// Meaning of a feature.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// Joint positions.
    Positions,
    Velocities,
    Efforts,
    /// Joint position targets, or controls.
    Action,
    TargetVelocities,
    TargetEfforts,
    /// Object poses.
    Objects,
    /// Channel of a sensor.
    Sensor {
        stream: String,
        channel: String,
    },
    /// Color image of a camera.
    Image(String),
}

const STATE: [Role; 3] = [Role::Positions, Role::Velocities, Role::Efforts];
const TARGETS: [Role; 3] = [Role::Action, Role::TargetVelocities, Role::TargetEfforts];
const CONTROLS: [Role; 3] = [Role::Positions, Role::Velocities, Role::Action];

impl Role {
    /// True for targets and controls: the value of a frame is that of the next row.
    pub(crate) fn is_action(&self) -> bool {
        matches!(self, Self::Action | Self::TargetVelocities | Self::TargetEfforts)
    }
}

fn is_mjcf(stream: &StreamSchema) -> bool {
    stream.name.ends_with("/state")
        && stream.fields.iter().map(|part| &*part.name).eq(["positions", "velocities", "controls"])
}

impl Features {
    /// Collects the features of streams. `name` returns the name of a role in the dataset.
    ///
    /// # Errors
    /// No stream has rows that can be frames, or two features have the same name.
    pub(crate) fn of(path: &Path, format: Format, streams: &[StreamSchema], name: fn(&Role) -> String) -> Result<Self> {
        let mut all = Self { numbers: Vec::new(), images: Vec::new(), frame_stream: 0, result_stream: None };
        let mut base = None;
        for (s, stream) in streams.iter().enumerate() {
            let uid = stream.name.rsplit_once('/').map_or(stream.name.as_str(), |(uid, _)| uid);
            let roles: Option<[Role; 3]> = match &stream.kind {
                StreamKind::Joints { .. } if stream.name.ends_with("/targets") => Some(TARGETS),
                StreamKind::Joints { .. } => Some(STATE),
                _ if is_mjcf(stream) => Some(CONTROLS),
                _ => None,
            };
            if let StreamKind::Image { camera, height, width, .. } = &stream.kind {
                let name = name(&Role::Image(camera.clone()));
                all.images.push(ImageFeature { stream: s, name, size: [*width, *height] });
                continue;
            }
            if stream.kind == StreamKind::TaskResult {
                all.result_stream = Some(s);
                continue;
            }
            if roles.is_some() || stream.is_object_pose() {
                base.get_or_insert(s);
            }
            let mut first = 0;
            for (k, part) in stream.fields.iter().enumerate() {
                let range = first..first + part.width();
                first = range.end;
                let names: Vec<String> = match &stream.kind {
                    StreamKind::Joints { names } => names.iter().map(|name| format!("{uid}/{name}")).collect(),
                    StreamKind::Poses { frames } => ["x", "y", "z", "qw", "qx", "qy", "qz"]
                        .map(|number| format!("{}.{number}", frames.join("/")))
                        .into(),
                    _ => (0..part.width()).map(|number| format!("{}/{}[{number}]", stream.name, part.name)).collect(),
                };
                let role = match &roles {
                    Some(roles) => roles[k].clone(),
                    None if stream.is_object_pose() => Role::Objects,
                    None => Role::Sensor { stream: stream.name.clone(), channel: part.name.clone() },
                };
                all.append(role, name, names, StreamRange { stream: s, range });
            }
        }
        all.numbers.retain(|feature| !feature.names.is_empty());
        all.frame_stream = base.ok_or_else(|| RecordError::UnsupportedTopic {
            path: path.into(),
            format,
            topic: "a recording of sensors only; its frames are rows of joints or objects".into(),
        })?;
        let mut names: Vec<&str> = all.names().collect();
        names.sort_unstable();
        if let Some(pair) = names.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(RecordError::DuplicateName { path: path.into(), name: pair[0].into() });
        }
        Ok(all)
    }

    /// Adds values to the feature of a role. The joints of several robots are one feature.
    fn append(&mut self, role: Role, name: fn(&Role) -> String, names: Vec<String>, part: StreamRange) {
        let joins = !matches!(role, Role::Sensor { .. });
        match self.numbers.iter_mut().find(|feature| joins && feature.role == role) {
            Some(feature) => {
                feature.names.extend(names);
                feature.parts.push(part);
            }
            None => self.numbers.push(Feature { name: name(&role), role, names, parts: vec![part] }),
        }
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.numbers.iter().map(|feature| &*feature.name).chain(self.images.iter().map(|image| &*image.name))
    }

    /// Width and height of the images of a stream, if it has images.
    pub(crate) fn image_size(&self, stream: usize) -> Option<[usize; 2]> {
        self.images.iter().find(|image| image.stream == stream).map(|image| image.size)
    }
}

impl Feature {
    /// Values of the feature. `rows` has the current row of each stream; `None` if a stream of the feature has no row
    /// yet.
    pub(crate) fn values(&self, rows: &[Option<Vec<f64>>]) -> Option<Vec<f64>> {
        let mut values = Vec::with_capacity(self.names.len());
        for StreamRange { stream, range } in &self.parts {
            values.extend_from_slice(rows.get(*stream)?.as_ref()?.get(range.clone())?);
        }
        Some(values)
    }
}
