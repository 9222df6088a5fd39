//! Entities of a simulation by name, for code that did not create them: recorders, inspectors, viewers.

use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::{MjcfId, RigidObjectId, RobotId, TerrainId};
use crate::manager::SimulationManager;
use crate::objects::articulation::ArticulationId;
use crate::objects::robot_data::RobotData;
use crate::objects::terrain::Terrain;
use crate::sensor_list::SensorId;
use kinetoscope_mujoco::ObjectKind;
use kinetoscope_sensors::Sensor;
use ndarray::{Array2, Axis};
use std::sync::Arc;

impl SimulationManager {
    /// Entities of the simulation by name.
    pub fn entities(&self) -> Entities<'_> {
        Entities::new(self)
    }
}

/// Entities of a simulation by name; see [`SimulationManager::entities`].
#[derive(Clone, Copy, Debug)]
pub struct Entities<'a> {
    sim: &'a SimulationManager,
}

impl<'a> Entities<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// Handle of the robot `uid`, which is not an articulation.
    ///
    /// # Errors
    /// The uid is unknown; the error lists the known uids.
    pub fn robot_id(&self, uid: &str) -> Result<RobotId> {
        self.sim.find_robot(uid, "robot", RobotData::is_robot)
    }

    /// All robots and articulations with their uids, in insertion order of both together.
    pub fn robot_ids(&self) -> Vec<(&'a str, RobotId)> {
        let robots = self.sim.entities.robots.iter().enumerate();
        robots.map(|(index, robot)| (robot.uid(), RobotId { manager: self.sim.serial, index })).collect()
    }

    /// Handle of the rigid object `uid`.
    ///
    /// # Errors
    /// The uid is unknown; the error lists the known uids.
    pub fn rigid_object_id(&self, uid: &str) -> Result<RigidObjectId> {
        let index = self.sim.entities.objects.iter().position(|o| o.uid() == uid);
        index.map(|index| RigidObjectId { manager: self.sim.serial, index }).ok_or_else(|| Error::UnknownName {
            what: "rigid object",
            name: uid.into(),
            candidates: self.sim.entities.objects.iter().map(|o| o.uid().to_string()).collect(),
        })
    }

    /// Handle of the MJCF part `uid`, an attached MJCF file.
    ///
    /// # Errors
    /// The uid is unknown; the error lists the known uids.
    pub fn mjcf_id(&self, uid: &str) -> Result<MjcfId> {
        let index = self.sim.entities.mjcf_models.iter().position(|p| p.uid() == uid);
        index.map(|index| MjcfId { manager: self.sim.serial, index }).ok_or_else(|| Error::UnknownName {
            what: "MJCF part",
            name: uid.into(),
            candidates: self.sim.entities.mjcf_models.iter().map(|p| p.uid().to_string()).collect(),
        })
    }

    /// Handle of the articulation `uid`.
    ///
    /// # Errors
    /// The uid is unknown; the error lists the known uids.
    pub fn articulation_id(&self, uid: &str) -> Result<ArticulationId> {
        self.sim.find_robot(uid, "articulation", |robot| !robot.is_robot()).map(ArticulationId)
    }

    /// Uids of all robots, then of all articulations, each in insertion order.
    pub fn articulated_uids(&self) -> Vec<&'a str> {
        let of = |robots: bool| self.sim.entities.robots.iter().filter(move |data| data.is_robot() == robots);
        of(true).chain(of(false)).map(|data| data.uid()).collect()
    }

    /// Handle of the robot or articulation `uid`, for methods that both share.
    ///
    /// # Errors
    /// The uid is unknown; the error lists the known uids.
    pub fn articulated_id(&self, uid: &str) -> Result<RobotId> {
        self.sim.find_robot(uid, "robot or articulation", |_: &RobotData| true)
    }

    /// Uids of all rigid objects, in insertion order.
    pub fn rigid_object_uids(&self) -> Vec<&'a str> {
        self.sim.entities.objects.iter().map(|object| object.uid()).collect()
    }

    /// Uids of all attached MJCF files, in insertion order.
    pub fn mjcf_uids(&self) -> Vec<&'a str> {
        self.sim.entities.mjcf_models.iter().map(|part| part.uid()).collect()
    }

    /// Uids of all sensors, in insertion order.
    pub fn sensor_uids(&self) -> Vec<&'a str> {
        self.sim.sensors.uids().collect()
    }

    /// The sensor `uid` as a trait object; `&dyn Sensor` converts to `&dyn Any`. As with [`SimulationManager::sensor`],
    /// a lazy sensor runs its pending measurement now.
    ///
    /// # Errors
    /// The uid is unknown, or the sensor failed, in an earlier step or now.
    pub fn sensor_by_uid(&self, uid: &str) -> Result<&'a dyn Sensor> {
        self.sim.sensors.by_uid(uid)
    }

    /// Physics steps until the sensor `uid` next measures, delivers a delayed measurement or opens its shutter in any
    /// environment, at least 1; [`u64::MAX`] for a failed sensor.
    ///
    /// # Errors
    /// The uid is unknown.
    pub fn sensor_due_in(&self, uid: &str) -> Result<u64> {
        self.sim.sensors.due_in(uid, &self.sim.simulation)
    }

    /// Names and handles of all sensors of type `S` in insertion order, without failed sensors.
    pub fn sensor_ids<S: Sensor>(&self) -> Vec<(String, SensorId<S>)> {
        self.sim.sensors.ids()
    }

    /// Returns a terrain.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn terrain(&self, id: TerrainId) -> &'a Terrain {
        &self.sim.entities.terrains[self.sim.index_of(id.manager, id.index)]
    }

    /// Names of all bodies, in the order in which sensors and viewers number them: links of all robots and
    /// articulations (`uid/link`, fused links included), objects (`uid`), then bodies and named sites of attached MJCF
    /// files (`uid/body`, `uid/site`).
    pub fn body_names(&self) -> Arc<[String]> {
        self.sim.entities.body_names()
    }

    /// Positions and velocities of all joints of the whole scene in MuJoCo's layout (`qpos`, `qvel`), shapes (N, nq)
    /// and (N, nv). [`state_names`](Self::state_names) names the columns.
    pub fn engine_states(&self) -> [Array2<f64>; 2] {
        let model = self.sim.simulation.batch.model();
        let (n, nq) = (self.sim.num_envs(), model.nq());
        let mut states = Array2::zeros((n, nq + model.nv()));
        if let Some(out) = states.as_slice_mut() {
            self.sim.simulation.batch.read_all(Stage::State, out, |_, env, out| {
                let (qpos, qvel) = out.split_at_mut(nq);
                qpos.copy_from_slice(env.data().qpos());
                qvel.copy_from_slice(env.data().qvel());
            });
        }
        let (qpos, qvel) = states.view().split_at(Axis(1), nq);
        [qpos.to_owned(), qvel.to_owned()]
    }

    /// Column names of the controls of a [rollout](SimulationManager::rollout): movable joints of all robots and
    /// articulations (`uid/joint`), then actuators of all attached MJCF files (`uid/actuator`), each in insertion
    /// order.
    pub fn control_names(&self) -> Vec<String> {
        let parts = self.sim.entities.mjcf_models.iter();
        let actuators = parts.flat_map(|part| part.names().actuators.iter().map(|name| part.scoped_name(name)));
        let drives = self
            .sim
            .entities
            .robots
            .iter()
            .flat_map(|robot| robot.joint_names().iter().map(|joint| format!("{}/{joint}", robot.uid())));
        drives.chain(actuators).collect()
    }

    /// Column names of the states of a [rollout](SimulationManager::rollout): `qpos uid/joint` for each position, then
    /// `qvel uid/joint` for each velocity. A joint with several columns has an index in brackets. The columns of a free
    /// joint are its position \[m\] and quaternion w x y z, its velocity in the environment \[m/s\], and its angular
    /// velocity in the body frame \[rad/s\].
    pub fn state_names(&self) -> Vec<String> {
        let model = self.sim.simulation.batch.model();
        let list = |what: &str, first: &[i32], count: usize| {
            let mut names = Vec::with_capacity(count);
            for joint in 0..model.njnt() {
                let name = model.name(ObjectKind::Joint, joint).unwrap_or_default();
                let end = first.get(joint + 1).map_or(count, |&next| next as usize);
                let width = end - first[joint] as usize;
                let one = |k| if width == 1 { format!("{what} {name}") } else { format!("{what} {name}[{k}]") };
                names.extend((0..width).map(one));
            }
            names
        };
        let mut names = list("qpos", model.jnt_qposadr(), model.nq());
        names.extend(list("qvel", model.jnt_dofadr(), model.nv()));
        names
    }
}
