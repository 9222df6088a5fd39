//! Capture of the quantities that MuJoCo solves inside a step: contacts, accelerations, joint wrenches.
//!
//! After `mj_step2`, forces and contacts belong together. The following `mj_step1` replaces the contact list by an
//! unsolved one, so the capture runs between the two. At that point, positions and all quantities derived from them
//! still belong to the start of the step, while `qpos` and `qvel` belong to its end.

mod contacts;
mod motion;

use crate::body_pose::BodyFrame;
use crate::indexing::{BodyIndexing, MjcfIndexing, RobotIndexing};
use kinetoscope_mujoco::{Data, EngineError, Model};
use kinetoscope_scene::Contact;
use kinetoscope_scene::StateFields;
use std::sync::Arc;

pub(crate) use contacts::SolvedContact;
pub(crate) use motion::{SolvedBodies, body_velocity};

/// Indices of the captured quantities in MuJoCo's arrays, the same for all environments.
#[derive(Debug)]
pub(crate) struct BodyAxis {
    /// Index on the body axis of the owner of each geom; `None` for the world.
    geom_owners: Vec<Option<u32>>,
    /// Frame of each body on the body axis.
    bodies: Vec<BodyFrame>,
    /// True if a body of the body axis is its own entry in `moving_bodies`, false if it is fused to another body.
    is_moving_body: Vec<bool>,
}

/// Request to capture quantities in a step.
#[derive(Clone, Debug)]
pub(crate) struct CaptureRequest {
    pub(crate) body_axis: Arc<BodyAxis>,
    pub(crate) fields: StateFields,
}

/// Captured quantities of one environment; empty without a capture or after a failed step.
#[derive(Clone, Debug, Default)]
pub(crate) struct CapturedStep {
    pub(crate) contacts: Vec<Contact>,
    /// Poses `[x, y, z, qw, qx, qy, qz]` in the environment \[m\] at the start of the step, 7 numbers per body.
    pub(crate) poses: Vec<f64>,
    /// Velocity of the frame, then angular velocity \[m/s, rad/s\] in world axes at the start of the step, 6 numbers
    /// per body.
    pub(crate) velocities: Vec<f64>,
    /// Acceleration of the frame, then angular acceleration \[m/s², rad/s²\] in world axes, 6 numbers per body; 0 at
    /// rest, gravity in free fall.
    pub(crate) accelerations: Vec<f64>,
    /// Force, then torque \[N, N m\] that each body receives from its parent, about the origin of the body, in body
    /// axes, 6 numbers per body; NaN for a body fused to another.
    pub(crate) wrenches: Vec<f64>,
    /// Scratch memory for velocities of the engine.
    scratch: Vec<f64>,
}

impl BodyAxis {
    /// Creates the body axis of a compiled scene: links of robots, objects, then frames of attached MJCF files.
    /// `carriers` is [`moving_bodies`](kinetoscope_sensors::SensorContext::moving_bodies).
    pub(crate) fn new(
        model: &Model,
        robots: &[RobotIndexing],
        objects: &[BodyIndexing],
        parts: &[MjcfIndexing],
        carriers: &[usize],
    ) -> Self {
        let links = robots.iter().flat_map(|robot| robot.links.iter().copied());
        let bodies: Vec<BodyFrame> = links
            .chain(objects.iter().map(|object| BodyFrame::of_body(object.body)))
            .chain(parts.iter().flat_map(|part| part.frames.iter().copied()))
            .collect();
        let mut geom_owners = vec![None; model.ngeom()];
        let mut first = 0;
        for robot in robots {
            for geom in &robot.geoms {
                geom_owners[geom.geom] = Some((first + geom.link) as u32);
            }
            first += robot.links.len();
        }
        for (geom, &body) in model.geom_bodyid().iter().enumerate() {
            if let Some(k) = objects.iter().position(|object| object.body == body as usize) {
                geom_owners[geom] = Some((first + k) as u32);
            }
        }
        first += objects.len();
        for part in parts {
            for &geom in &part.geoms {
                let body = model.geom_bodyid()[geom] as usize;
                // The first body is the file's world, which belongs to the world; frame k is body k + 1.
                let frame = part.bodies[1..].iter().position(|other| *other == body);
                geom_owners[geom] = frame.map(|frame| (first + frame) as u32);
            }
            first += part.frames.len();
        }
        let is_moving_body = carriers.iter().enumerate().map(|(body, &carrier)| body == carrier).collect();
        Self { geom_owners, bodies, is_moving_body }
    }

    /// Frame of each body on the body axis.
    pub(crate) fn bodies(&self) -> &[BodyFrame] {
        &self.bodies
    }
}

impl CaptureRequest {
    /// Captures quantities after `mj_step2` of a step that began with the velocities `qvel`. Later steps are not
    /// affected.
    pub(crate) fn capture(&self, data: &mut Data, qvel: &[f64], solved: &mut CapturedStep) -> Result<(), EngineError> {
        if self.fields.contains(StateFields::CONTACTS) {
            contacts::capture(&self.body_axis.geom_owners, data, &mut solved.contacts);
        }
        let (accelerations, wrenches) =
            (self.fields.contains(StateFields::ACCELERATIONS), self.fields.contains(StateFields::JOINT_WRENCHES));
        if accelerations || wrenches {
            data.rne_post_constraint(qvel, &mut solved.scratch)?;
            let gravity = data.model().gravity();
            self.capture_motion(data, gravity, solved);
        }
        Ok(())
    }

    /// Captures solved contacts.
    pub(crate) fn capture_contacts(&self, contacts: impl Iterator<Item = SolvedContact>, solved: &mut CapturedStep) {
        contacts::of_solved(&self.body_axis.geom_owners, contacts, &mut solved.contacts);
    }

    /// Captures accelerations and joint wrenches. `gravity` is that of the environment, in world axes \[m/s²\].
    pub(crate) fn capture_motion(&self, data: &impl SolvedBodies, gravity: [f64; 3], solved: &mut CapturedStep) {
        if self.fields.contains(StateFields::ACCELERATIONS) {
            motion::capture(&self.body_axis.bodies, data, gravity, solved);
        }
        if self.fields.contains(StateFields::JOINT_WRENCHES) {
            motion::capture_wrenches(&self.body_axis, data, &mut solved.wrenches);
        }
    }
}

impl CapturedStep {
    /// Clears the capture of a step that was not completed.
    pub(crate) fn clear(&mut self) {
        self.contacts.clear();
        for values in [&mut self.poses, &mut self.velocities, &mut self.accelerations, &mut self.wrenches] {
            values.clear();
        }
    }
}
