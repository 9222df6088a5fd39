//! What MuJoCo solves for the state before a step, captured inside the step: contacts, accelerations, joint wrenches.
//!
//! After `mj_step2` forces and contacts belong together; the `mj_step1` that follows makes a new contact list that nobody
//! has solved yet. Between the two, positions and all that comes from them are still those of the beginning of the step,
//! while `qpos` and `qvel` are those of its end.

mod contacts;
mod motion;

use crate::body_pose::BodyFrame;
use crate::index::{FreeIndex, PartIndex, RobotIndex};
use kinetoscope_mujoco::{Data, EngineError, Model};
use kinetoscope_scene::Contact;
use kinetoscope_scene::Requires;
use std::sync::Arc;

pub(crate) use motion::body_velocity;

/// Where what is captured is in MuJoCo's arrays: the same for all environments.
#[derive(Debug)]
pub(crate) struct Plan {
    /// Index on the body axis of what each geom belongs to; `None` is the world.
    owners: Vec<Option<u32>>,
    /// The frame of everything on the body axis.
    bodies: Vec<BodyFrame>,
    /// Whether a body of the axis is a MuJoCo body of its own, not one that is fused to another.
    carries: Vec<bool>,
}

/// What to capture in a step.
#[derive(Clone, Debug)]
pub(crate) struct Capture {
    pub(crate) plan: Arc<Plan>,
    pub(crate) fields: Requires,
}

/// What was captured in one environment; empty where nothing was, or where a step failed.
#[derive(Debug, Default)]
pub(crate) struct Solved {
    pub(crate) contacts: Vec<Contact>,
    /// Rows of 7 per body.
    pub(crate) poses: Vec<f64>,
    /// Rows of 6 per body.
    pub(crate) velocities: Vec<f64>,
    /// Rows of 6 per body.
    pub(crate) accelerations: Vec<f64>,
    /// Rows of 6 per body.
    pub(crate) wrenches: Vec<f64>,
    /// Room for the engine's velocities.
    spare: Vec<f64>,
}

impl Plan {
    /// The plan of a compiled scene; `carriers` is as in [`kinetoscope_sensors::SensorContext`].
    pub(crate) fn new(
        model: &Model,
        robots: &[RobotIndex],
        objects: &[FreeIndex],
        parts: &[PartIndex],
        carriers: &[usize],
    ) -> Self {
        let links = robots.iter().flat_map(|robot| robot.links.iter().copied());
        let bodies: Vec<BodyFrame> = links
            .chain(objects.iter().map(|object| BodyFrame::of_body(object.body)))
            .chain(parts.iter().flat_map(|part| part.frames.iter().copied()))
            .collect();
        let mut owners = vec![None; model.ngeom()];
        let mut first = 0;
        for robot in robots {
            for geom in &robot.geoms {
                owners[geom.geom] = Some((first + geom.link) as u32);
            }
            first += robot.links.len();
        }
        for (geom, &body) in model.geom_bodyid().iter().enumerate() {
            if let Some(k) = objects.iter().position(|object| object.body == body as usize) {
                owners[geom] = Some((first + k) as u32);
            }
        }
        first += objects.len();
        for part in parts {
            for &geom in &part.geoms {
                let body = model.geom_bodyid()[geom] as usize;
                // The first body is the file's world, which is part of the world; frame k is body k + 1.
                let frame = part.bodies[1..].iter().position(|other| *other == body);
                owners[geom] = frame.map(|frame| (first + frame) as u32);
            }
            first += part.frames.len();
        }
        let carries = carriers.iter().enumerate().map(|(body, &carrier)| body == carrier).collect();
        Self { owners, bodies, carries }
    }

    /// The frame of everything on the body axis.
    pub(crate) fn bodies(&self) -> &[BodyFrame] {
        &self.bodies
    }
}

impl Capture {
    /// Captures after `mj_step2` of a step that began with the velocities `qvel`. Nothing that decides a later step changes.
    pub(crate) fn take(&self, data: &mut Data, qvel: &[f64], solved: &mut Solved) -> Result<(), EngineError> {
        if self.fields.contains(Requires::CONTACTS) {
            contacts::capture(&self.plan.owners, data, &mut solved.contacts);
        }
        let (accelerations, wrenches) =
            (self.fields.contains(Requires::ACCELERATIONS), self.fields.contains(Requires::JOINT_WRENCHES));
        if accelerations || wrenches {
            data.solve_accelerations(qvel, &mut solved.spare)?;
        }
        if accelerations {
            motion::capture(&self.plan.bodies, data, solved);
        }
        if wrenches {
            motion::capture_wrenches(&self.plan, data, &mut solved.wrenches);
        }
        Ok(())
    }
}

impl Solved {
    /// Forgets everything: what was captured is of a step that was not done.
    pub(crate) fn clear(&mut self) {
        self.contacts.clear();
        for values in [&mut self.poses, &mut self.velocities, &mut self.accelerations, &mut self.wrenches] {
            values.clear();
        }
    }
}
