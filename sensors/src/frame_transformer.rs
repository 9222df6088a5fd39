//! Frame transformer: poses of frames in the world and relative to a source frame.

use crate::body_state::{check_offset, pose, write_front};
use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampled, Sampler, SamplingCfg};
use crate::schedule::Schedule;
use crate::select::{Selection, at_least_one, matching};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::pose::{from_row, to_wxyz};
use kinetoscope_scene::{Marker, Pose, SceneState};
use ndarray::{ArrayView2, ArrayView3};
use serde::{Deserialize, Serialize};
use std::fmt;

/// Configuration of a [`FrameTransformer`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrameTransformerCfg {
    /// Body of the source frame: `uid/link`, the link alone if only one body has this name, or the uid of an object.
    pub source: String,
    /// Pose of the source frame in the frame of its body.
    #[serde(default, with = "kinetoscope_scene::file_format::pose")]
    pub source_offset: Pose,
    /// The target frames, in the order they are reported; at least one.
    pub targets: Vec<TargetFrameCfg>,
    /// Rate, history, latency, dropout and noise; channels that can have noise: `source_pos_w`, `target_pos_w` and
    /// `target_pos_source`. The noise of each channel is independent of the others.
    #[serde(default)]
    pub sampling: SamplingCfg,
    /// Shows the axes of source and targets ([`Sensor::markers`]).
    #[serde(default)]
    pub debug_vis: bool,
}

/// A target frame, or a target frame on each of several bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TargetFrameCfg {
    /// Name pattern of the bodies, for full names (`uid/link`, the uid of an object) or the part after the first slash;
    /// the source body may be a target too.
    pub bodies: String,
    /// Name of the frame; `None` is the full name of its body. If the pattern matches several bodies, the frames are
    /// named `name/uid/link`.
    pub name: Option<String>,
    /// Pose of the frame in the frame of its body.
    #[serde(default, with = "kinetoscope_scene::file_format::pose")]
    pub offset: Pose,
}

impl TargetFrameCfg {
    /// Creates target frames at the origins of the bodies that a pattern matches.
    pub fn for_bodies(bodies: impl Into<String>) -> Self {
        Self { bodies: bodies.into(), name: None, offset: Pose::identity() }
    }
}

impl FrameTransformerCfg {
    /// Creates a configuration with targets relative to a source body.
    pub fn new(source: impl Into<String>, targets: Vec<TargetFrameCfg>) -> Self {
        let sampling = SamplingCfg::default();
        Self { source: source.into(), source_offset: Pose::identity(), targets, sampling, debug_vis: false }
    }
}

/// A frame on a body.
#[derive(Clone, Copy, Debug)]
struct BodyFrame {
    /// Index of the body in [`SceneState`].
    body: usize,
    body_from_frame: Pose,
}

/// Poses of target frames in the environment and in the source frame, in all environments. Shapes: N environments, M
/// targets.
#[derive(Clone, Debug)]
pub struct FrameTransformer {
    source_name: String,
    source: BodyFrame,
    targets: Vec<BodyFrame>,
    names: Vec<String>,
    sampler: Sampler,
}

impl SensorCfg for FrameTransformerCfg {
    type Sensor = FrameTransformer;

    fn requires(&self) -> StateFields {
        StateFields::POSES
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// An unknown source body, no targets, a pattern that matches nothing, two target frames with the same name, an
    /// offset that is not a pose, or an invalid sampling configuration.
    fn build(&self, context: &SensorContext) -> Result<FrameTransformer, SensorError> {
        let source = context.body(&self.source)?;
        at_least_one(
            self.targets.len(),
            Selection { sensor: "frame transformer", field: "targets", what: "target" },
            &context.bodies,
        )?;
        let (mut targets, mut names) = (Vec::new(), Vec::<String>::new());
        for target in &self.targets {
            let bodies = matching(&target.bodies, &context.bodies, "body")?;
            for &body in &bodies {
                let name = match &target.name {
                    None => context.bodies[body].clone(),
                    Some(name) if bodies.len() == 1 => name.clone(),
                    Some(name) => format!("{name}/{}", context.bodies[body]),
                };
                if names.contains(&name) {
                    return Err(SensorError::DuplicateName { what: "target frame", name });
                }
                names.push(name);
                targets.push(BodyFrame { body, body_from_frame: target.offset });
            }
        }
        check_offset("source_offset", &self.source_offset)?;
        self.targets
            .iter()
            .try_for_each(|t| check_offset(&format!("the offset of target {:?}", t.bodies), &t.offset))?;
        let m = targets.len();
        let channels = [
            SampleChannel::new("source_pos_w", 3).with_unit("m"),
            SampleChannel::noiseless("source_quat_w", 4),
            SampleChannel::new("target_pos_w", 3 * m).with_unit("m"),
            SampleChannel::noiseless("target_quat_w", 4 * m),
            SampleChannel::new("target_pos_source", 3 * m).with_unit("m"),
            SampleChannel::noiseless("target_quat_source", 4 * m),
        ];
        Ok(FrameTransformer {
            source_name: context.bodies[source].clone(),
            source: BodyFrame { body: source, body_from_frame: self.source_offset },
            targets,
            names,
            sampler: Sampler::new("frame transformer", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

/// Writes the measurement of environment `env` to `row`.
fn read(source: &BodyFrame, targets: &[BodyFrame], state: &SceneState, env: usize, row: &mut [f64]) {
    let Some(poses) = &state.body_poses else { return };
    let world_from = |frame: &BodyFrame| pose(poses, env, frame.body) * frame.body_from_frame;
    let world_from_source = world_from(source);
    let source_from_world = world_from_source.inverse();
    let row = write_front(row, world_from_source.translation.vector.as_slice());
    let row = write_front(row, &to_wxyz(&world_from_source.rotation));
    let (mut positions, row) = row.split_at_mut(3 * targets.len());
    let (mut rotations, row) = row.split_at_mut(4 * targets.len());
    let (mut seen_positions, mut seen_rotations) = row.split_at_mut(3 * targets.len());
    for target in targets {
        let world_from_target = world_from(target);
        let source_from_target = source_from_world * world_from_target;
        positions = write_front(positions, world_from_target.translation.vector.as_slice());
        rotations = write_front(rotations, &to_wxyz(&world_from_target.rotation));
        seen_positions = write_front(seen_positions, source_from_target.translation.vector.as_slice());
        seen_rotations = write_front(seen_rotations, &to_wxyz(&source_from_target.rotation));
    }
}

impl Sensor for FrameTransformer {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(&self.source, &self.targets, state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(&self.source, &self.targets, state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(&self.source, &self.targets, state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// The axes of all frames.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let axes = |p: [f64; 3], q: [f64; 4]| Marker::axes(from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]), 0.2);
        let (p, q) = (self.source_pos_w(), self.source_quat_w());
        let mut markers = vec![axes([0, 1, 2].map(|k| p[(env, k)]), [0, 1, 2, 3].map(|k| q[(env, k)]))];
        let (p, q) = (self.target_pos_w(), self.target_quat_w());
        let target = |t| axes([0, 1, 2].map(|k| p[(env, t, k)]), [0, 1, 2, 3].map(|k| q[(env, t, k)]));
        markers.extend((0..self.target_frame_names().len()).map(target));
        markers
    }
}

/// Writes a summary of several lines.
impl fmt::Display for FrameTransformer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(
            f,
            "Frame transformer",
            &self.sampler,
            &[
                ("source body", &self.source_name),
                ("number of targets", &self.names.len()),
                ("target frames", &summary::list(&self.names)),
            ],
        )
    }
}

impl Sampled for FrameTransformer {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.names
    }
}

impl FrameTransformer {
    /// Names of the target frames, in the order of the axis M: the order of the configuration, and within a pattern the
    /// order of the bodies.
    pub fn target_frame_names(&self) -> &[String] {
        &self.names
    }

    /// Position of the source frame in the frame of the environment \[m\], shape (N, 3).
    pub fn source_pos_w(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("source_pos_w")
    }

    /// Orientation of the source frame in the frame of the environment, w x y z, shape (N, 4).
    pub fn source_quat_w(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("source_quat_w")
    }

    fn rows(&self, channel: &str, width: usize) -> ArrayView3<'_, f64> {
        self.sampler.values_as(channel, (self.sampler.num_envs(), self.targets.len(), width))
    }

    /// Positions of the targets in the frame of the environment \[m\], shape (N, M, 3).
    pub fn target_pos_w(&self) -> ArrayView3<'_, f64> {
        self.rows("target_pos_w", 3)
    }

    /// Orientations of the targets in the frame of the environment, w x y z, shape (N, M, 4).
    pub fn target_quat_w(&self) -> ArrayView3<'_, f64> {
        self.rows("target_quat_w", 4)
    }

    /// Positions of the targets in the source frame \[m\], shape (N, M, 3).
    pub fn target_pos_source(&self) -> ArrayView3<'_, f64> {
        self.rows("target_pos_source", 3)
    }

    /// Orientations of the targets in the source frame, w x y z, shape (N, M, 4).
    pub fn target_quat_source(&self) -> ArrayView3<'_, f64> {
        self.rows("target_quat_source", 4)
    }
}
