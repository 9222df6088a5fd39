//! Joint wrench sensor: six-axis force and torque in joints.

use crate::body_state::{pose, vector, write_front};
use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampled, Sampler, SamplingCfg, Stamp};
use crate::schedule::Schedule;
use crate::select::{Selection, at_least_one, select};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{Marker, Pose, SceneState};
use nalgebra::Vector3;
use ndarray::ArrayView3;
use serde::{Deserialize, Serialize};
use std::fmt;

/// Configuration of a [`JointWrench`] sensor.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointWrenchCfg {
    /// Name patterns of the links whose joints are measured (`uid/link`, or `link` alone). Results have the order of
    /// the patterns. A link that fixed joints fuse to another link has no measurable joint and is an error; list it in
    /// `frames` instead.
    pub links: Vec<String>,
    /// Name patterns of links in whose frames to measure, reported after `links`. Each gives the wrench of the joint
    /// that moves the named link, about the origin and in the axes of the named link. If the link is fused to another
    /// link, this is the joint of the other link. The mount of a real force-torque sensor is such a link.
    pub frames: Vec<String>,
    /// Rate, history, latency, dropout and noise; the channels are `forces` and `torques`.
    pub sampling: SamplingCfg,
    /// Shows arrows of every force, 1 m for 500 N, and of every torque, 1 m for 50 N m, at their frames
    /// ([`Sensor::markers`]).
    pub debug_vis: bool,
}

/// Wrench of the joint of each link, in all environments: the force and the torque that the joint exerts on the link.
/// Shapes: N environments, B links.
///
/// Both are in the axes of the link and about its origin: the joint frame on the child side, as URDF defines it. For
/// [`JointWrenchCfg::frames`], the wrench is moved to the origin of the frame and rotated into its axes. `F` is the
/// force and `T` the torque about the origin of the link; the frame is at `p` with the rotation `R` in the link. The
/// force is then `Rᵀ F` and the torque `Rᵀ (T - p x F)`. The wrench is always that of the whole joint, independent of
/// the position of the frame.
///
/// The sign is that of the wrench **on the link**: a load that hangs from its joint reads an upward force of its
/// weight. Gravity and contacts of the link are not part of the wrench, but the reaction to them is. The effort of the
/// drive along the joint axis is part of the wrench. For the root of a fixed robot or a static object, the wrench is
/// that of the world on it; for a floating base or a free object it is 0.
#[derive(Clone, Debug)]
pub struct JointWrench {
    measured: Vec<MeasuredWrench>,
    names: Vec<String>,
    sampler: Sampler,
}

/// A measured wrench.
#[derive(Clone, Copy, Debug)]
struct MeasuredWrench {
    /// Link whose joint is measured.
    link: usize,
    /// Link in whose frame the wrench is expressed, if that is another link.
    frame: Option<usize>,
}

impl SensorCfg for JointWrenchCfg {
    type Sensor = JointWrench;

    fn requires(&self) -> StateFields {
        if !self.frames.is_empty() {
            StateFields::JOINT_WRENCHES | StateFields::POSES
        } else {
            StateFields::JOINT_WRENCHES
        }
    }

    fn debug_vis(&self) -> bool {
        self.debug_vis
    }

    fn lazy(&self, dt: f64) -> Option<Schedule> {
        self.sampling.lazy_schedule(dt)
    }

    /// # Errors
    ///
    /// A pattern that matches nothing, a link that two patterns of one list match, an empty selection of `links` and
    /// `frames`, an entry of `links` that is fused to another link (the error names that link), or an invalid sampling
    /// configuration.
    fn build(&self, context: &SensorContext) -> Result<JointWrench, SensorError> {
        let links = select(&self.links, &context.bodies, "link")?;
        for &link in &links {
            if let Some(&carrier) = context.moving_bodies.get(link).filter(|&&carrier| carrier != link) {
                let (link, moving_link) = (context.bodies[link].clone(), context.bodies[carrier].clone());
                return Err(SensorError::FusedLink { link, moving_link });
            }
        }
        let frames = select(&self.frames, &context.bodies, "link")?;
        at_least_one(
            links.len() + frames.len(),
            Selection { sensor: "joint wrench", field: "links and frames", what: "link" },
            &context.bodies,
        )?;
        let names = links.iter().chain(&frames).map(|&link| context.bodies[link].clone()).collect();
        let in_frame = |frame: usize| {
            let link = context.moving_bodies.get(frame).copied().unwrap_or(frame);
            MeasuredWrench { link, frame: (link != frame).then_some(frame) }
        };
        let in_links = links.into_iter().map(|link| MeasuredWrench { link, frame: None });
        let measured: Vec<MeasuredWrench> = in_links.chain(frames.into_iter().map(in_frame)).collect();
        let channels = [("forces", "N"), ("torques", "N m")]
            .map(|(name, unit)| SampleChannel::new(name, 3 * measured.len()).with_unit(unit).with_stamp(Stamp::Force));
        Ok(JointWrench {
            names,
            measured,
            sampler: Sampler::new("joint wrench", self.requires(), context, &self.sampling, &channels)?,
        })
    }
}

/// Writes the measurement of environment `env` to `row`.
fn read(measured: &[MeasuredWrench], state: &SceneState, env: usize, row: &mut [f64]) {
    let Some(wrenches) = &state.joint_wrenches else { return };
    let (mut forces, mut torques) = row.split_at_mut(3 * measured.len());
    for MeasuredWrench { link, frame } in measured {
        let (mut force, mut torque) = (vector(wrenches, env, *link, 0), vector(wrenches, env, *link, 3));
        if let (Some(frame), Some(poses)) = (frame, &state.body_poses) {
            // Both frames are on one rigid body: their relative pose is constant.
            (force, torque) =
                wrench_in_frame(&(pose(poses, env, *link).inverse() * pose(poses, env, *frame)), force, torque);
        }
        forces = write_front(forces, force.as_slice());
        torques = write_front(torques, torque.as_slice());
    }
}

/// Transforms a wrench from the origin and axes of a link to the origin and axes of a frame on the link.
fn wrench_in_frame(link_from_frame: &Pose, force: Vector3<f64>, torque: Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let Pose { translation, rotation } = link_from_frame;
    let torque = torque - translation.vector.cross(&force);
    (rotation.inverse_transform_vector(&force), rotation.inverse_transform_vector(&torque))
}

impl Sensor for JointWrench {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.update(state, |env, row| read(&self.measured, state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.reset(env_ids, state, |env, row| read(&self.measured, state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.refresh(env_ids, state, |env, row| read(&self.measured, state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// Arrows of forces (orange, 1 m for 500 N) and torques (violet, 1 m for 50 N m) at their frames.
    fn markers(&self, env: usize, pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let (forces, torques) = (self.forces(), self.torques());
        let arrows = |(k, measured): (usize, &MeasuredWrench)| {
            let place = pose(measured.frame.unwrap_or(measured.link));
            let arrow = |values: &ArrayView3<'_, f64>, per_meter: f64, rgba| {
                let vector = place.rotation * Vector3::from_fn(|axis, _| values[(env, k, axis)]) / per_meter;
                Marker::arrow(place.translation.vector.into(), vector.into(), rgba)
            };
            let force = arrow(&forces, 500.0, [0.95, 0.6, 0.1, 1.0]);
            force.into_iter().chain(arrow(&torques, 50.0, [0.6, 0.2, 0.9, 1.0]))
        };
        self.measured.iter().enumerate().flat_map(arrows).collect()
    }
}

/// Writes a summary of several lines.
impl fmt::Display for JointWrench {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(f, "Joint wrench", &self.sampler, &[("links", &summary::list(&self.names))])
    }
}

impl Sampled for JointWrench {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.names
    }
}

impl JointWrench {
    /// Names of the measured links, then of the frame links, in the order of the axis B.
    pub fn link_names(&self) -> &[String] {
        &self.names
    }

    /// Forces on the links through their joints \[N\], in the axes of each link or frame, shape (N, B, 3). Captured at
    /// [`Sampled::force_stamps`], as the torques.
    pub fn forces(&self) -> ArrayView3<'_, f64> {
        self.sampler.values_as("forces", (self.sampler.num_envs(), self.measured.len(), 3))
    }

    /// Torques on the links through their joints \[N m\], about the origin and in the axes of each link or frame, shape
    /// (N, B, 3).
    pub fn torques(&self) -> ArrayView3<'_, f64> {
        self.sampler.values_as("torques", (self.sampler.num_envs(), self.measured.len(), 3))
    }
}
