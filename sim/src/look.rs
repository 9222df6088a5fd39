//! What a viewer wants to know of an environment: where everything is that can be seen, its links, its joints, its contacts.

use crate::capture::{Capture, body_velocity, link_pose};
use crate::env::EnvStatus;
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list, env_mask};
use crate::manager::SimulationManager;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::Data;
use kinetoscope_scene::state::Contact;
use kinetoscope_scene::{Light, OwnScene, Pose, PoseF32, RenderScene};
use kinetoscope_sensors::Requires;
use nalgebra::Vector3;
use ndarray::Array2;
use std::sync::Arc;

/// One environment as it is now; see [`SimulationManager::look`]. Everything is in the frame of the environment.
#[derive(Clone, Debug, Default)]
pub struct Look {
    /// Simulation time \[s\].
    pub time: f64,
    /// Why the environment stands still, where it diverged.
    pub diverged: Option<String>,
    /// What it looks like, where its sizes or colours are its own or a shape [changes](kinetoscope_scene::Instance::deforms).
    pub own_scene: OwnScene,
    /// World from instance, in the order of the instances of [`Visible::scene`](crate::Visible::scene).
    pub instances: Vec<PoseF32>,
    /// The lamps of that scene where they are now.
    pub lights: Vec<Light>,
    /// Poses of links and objects, in the order of [`SimulationManager::body_names`].
    pub bodies: Vec<Pose>,
    /// Centres of mass \[m\] of what moves as one piece, and its mass \[kg\]; without what has none.
    pub masses: Vec<([f64; 3], f64)>,
    /// Axes of joints that turn or slide.
    pub joints: Vec<JointAxis>,
}

/// Axis of a joint with one degree of freedom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointAxis {
    /// A point of it \[m\].
    pub anchor: [f64; 3],
    /// Its direction, of length 1.
    pub axis: [f64; 3],
    /// Whether the joint slides along it instead of turning about it.
    pub slides: bool,
}

/// How a link or an object moves; see [`SimulationManager::body_motion`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyMotion {
    /// Pose of its frame.
    pub pose: Pose,
    /// Velocity of its frame's origin \[m/s\], in world axes.
    pub linear: [f64; 3],
    /// Angular velocity \[rad/s\], in world axes.
    pub angular: [f64; 3],
    /// Mass of it and of all that hangs on it \[kg\].
    pub carried_mass: f64,
    /// Whether nothing that is done to it moves it: it is a part of the world, or moved by hand.
    pub is_fixed: bool,
}

impl SimulationManager {
    /// Names of links (`uid/link`, of all robots), of objects, and of bodies and sites of MJCF files (`uid/body`): the order
    /// in which sensors and viewers number bodies.
    pub fn body_names(&self) -> Arc<[String]> {
        self.contents.body_names()
    }

    /// Copies what there is to see of an environment to `look`, whose memory is used again.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn look(&mut self, env: EnvId, look: &mut Look) -> Result<()> {
        env_mask(Some(&[env]), self.num_envs())?;
        let visible = self.visible();
        let own = self.own_scene(env).clone();
        let plan = &self.simulation.plan;
        let index = env.0;
        self.simulation.batch.read(index, |env| {
            let data = env.data();
            look.time = data.time();
            look.diverged = match env.status() {
                EnvStatus::Running => None,
                EnvStatus::Diverged { step, reason } => Some(format!("step {step}: {reason}")),
            };
            look.instances.resize(visible.scene().instances().len(), PoseF32::IDENTITY);
            look.lights.clone_from(&visible.scene().lights);
            visible.read(data, &mut look.instances, &mut look.lights);
            visible.shape(data, (index, &own), &mut look.own_scene);
            look.bodies.clear();
            look.bodies.extend(plan.bodies().iter().map(|place| link_pose(data, place)));
            look.masses.clear();
            let masses = data.xipos().as_chunks::<3>().0.iter().zip(data.model().body_mass());
            look.masses.extend(masses.skip(1).filter(|(_, mass)| **mass > 0.0).map(|(at, mass)| (*at, *mass)));
            look.joints.clear();
            look.joints.extend(axes(data));
        });
        Ok(())
    }

    /// What is drawn of an environment, in the order of [`Look::instances`]: the same value for all whose sizes and colours are not
    /// their own, until something is added. Shapes that [change](kinetoscope_scene::Instance::deforms) are not those of now.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn scene_of(&mut self, env: EnvId) -> Result<Arc<RenderScene>> {
        env_mask(Some(&[env]), self.num_envs())?;
        let visible = self.visible();
        Ok(self.own_scene(env).0.clone().unwrap_or_else(|| Arc::clone(visible.scene())))
    }

    /// Positions and velocities of all joints of the scene as MuJoCo has them (`qpos`, `qvel`), one row for each environment: shapes
    /// (N, nq) and (N, nv).
    pub fn engine_states(&self) -> [Array2<f64>; 2] {
        let model = self.simulation.batch.model();
        let mut states = [Array2::zeros((self.num_envs(), model.nq())), Array2::zeros((self.num_envs(), model.nv()))];
        self.simulation.batch.for_each(|index, env| {
            let data = env.data();
            for (table, numbers) in states.iter_mut().zip([data.qpos(), data.qvel()]) {
                table.row_mut(index).iter_mut().zip(numbers).for_each(|(to, from)| *to = *from);
            }
        });
        states
    }

    /// The contacts of environments as they are now, with the forces that the engine solves for this instant: a list for each
    /// of `env_ids` (all where `None`). Bodies are numbered as in [`body_names`](Self::body_names). An environment that
    /// diverged has none. Nothing that a sensor measures changes, nor any later step.
    ///
    /// # Errors
    /// An environment does not exist.
    pub fn contacts(&mut self, env_ids: Option<&[EnvId]>) -> Result<Vec<Vec<Contact>>> {
        let capture = Capture { plan: Arc::clone(&self.simulation.plan), fields: Requires::CONTACTS };
        let batch = &mut self.simulation.batch;
        let of_env = |env: usize| {
            let mut contacts = Vec::new();
            batch.write(env, |env| env.present_contacts(&capture, &mut contacts));
            contacts
        };
        Ok(env_list(env_ids, self.cfg.num_envs)?.into_iter().map(of_env).collect())
    }

    /// How a body moves in an environment; `body` is its place in [`body_names`](Self::body_names).
    ///
    /// # Errors
    /// There is no such environment or body.
    pub fn body_motion(&self, env: EnvId, body: usize) -> Result<BodyMotion> {
        env_mask(Some(&[env]), self.num_envs())?;
        let place = self.place_of(body)?;
        Ok(self.simulation.batch.read(env.0, |env| {
            let (data, pose) = (env.data(), link_pose(env.data(), place));
            let [linear, angular] = body_velocity(data, place.0, &pose.translation.vector);
            BodyMotion {
                pose,
                linear: linear.into(),
                angular: angular.into(),
                carried_mass: data.model().body_subtreemass()[place.0],
                is_fixed: data.model().body_weldid()[place.0] == 0,
            }
        }))
    }

    /// Pulls at a body with forces, together: each is a point of the environment \[m\], as the body is now, and the force there
    /// \[N\] in the axes of the environment. They act from the next step on, until the body is pulled otherwise, the environment is
    /// reset, or something is added to the simulation; none ends it. They stay as they are while the body moves: who means a
    /// spring pulls anew in every step. What [`RobotMut::set_external_wrench`](crate::RobotMut::set_external_wrench) applies acts
    /// besides.
    ///
    /// `body` is its place in [`body_names`](Self::body_names).
    ///
    /// # Errors
    /// There is no such environment or body, or a number is not finite; then nothing has changed.
    pub fn pull(&mut self, env: EnvId, body: usize, forces: &[([f64; 3], [f64; 3])]) -> Result<()> {
        env_mask(Some(&[env]), self.num_envs())?;
        let &(mujoco_body, _) = self.place_of(body)?;
        for (of, numbers) in forces.iter().flat_map(|(point, force)| [("the point", point), ("the force", force)]) {
            if let Some(column) = numbers.iter().position(|x| !x.is_finite()) {
                let (of, value) = (of.to_string(), numbers[column]);
                return Err(Error::NotFinite { argument: "pull", row: env.0, column, of, value });
            }
        }
        self.simulation.batch.write(env.0, |env| {
            let center = &env.data().xipos()[3 * mujoco_body..3 * mujoco_body + 3];
            let center = Vector3::new(center[0], center[1], center[2]);
            let of = |&(point, force): &([f64; 3], [f64; 3])| {
                let force = Vector3::from(force);
                [force, (Vector3::from(point) - center).cross(&force)]
            };
            let none = [Vector3::zeros(); 2];
            let [force, torque] = forces.iter().map(of).fold(none, |[f, t], [force, torque]| [f + force, t + torque]);
            env.set_wrenches(|wrenches| wrenches.pull(body, mujoco_body, force, torque));
        });
        Ok(())
    }

    /// MuJoCo's body of a body, and the frame in it.
    fn place_of(&self, body: usize) -> Result<&(usize, Pose)> {
        let bodies = self.simulation.plan.bodies();
        bodies.get(body).ok_or(Error::UnknownIndex { what: "body", index: body, count: bodies.len() })
    }
}

/// Axes of joints that turn or slide.
fn axes(data: &Data) -> impl Iterator<Item = JointAxis> {
    let anchors = data.xanchor().as_chunks::<3>().0.iter().zip(data.xaxis().as_chunks::<3>().0);
    anchors.zip(data.model().jnt_type()).filter_map(|((anchor, axis), kind)| {
        let kind = *kind as u32;
        let slides = kind == mj::mjJNT_SLIDE;
        (slides || kind == mj::mjJNT_HINGE).then_some(JointAxis { anchor: *anchor, axis: *axis, slides })
    })
}
