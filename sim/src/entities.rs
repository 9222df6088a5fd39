//! Contents of a simulation by name, for code that did not build it: recorders, inspectors, viewers.

use crate::error::{Error, Result};
use crate::ids::{MjcfId, ObjectId, RobotId, TerrainId};
use crate::manager::SimulationManager;
use crate::objects::articulation::ArticulationId;
use crate::objects::robot_data::RobotData;
use crate::objects::terrain::Terrain;
use crate::sensor_list::SensorId;
use kinetoscope_mujoco::ObjectKind;
use kinetoscope_sensors::Sensor;
use ndarray::Array2;
use std::sync::Arc;

impl SimulationManager {
    /// Contents of the simulation, by name.
    pub fn entities(&self) -> Entities<'_> {
        Entities::new(self)
    }
}

/// Contents of a simulation by name; see [`SimulationManager::entities`].
#[derive(Clone, Copy, Debug)]
pub struct Entities<'a> {
    sim: &'a SimulationManager,
}

impl<'a> Entities<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// The robot called `uid`.
    ///
    /// # Errors
    /// The uid is unknown; the error lists those there are.
    pub fn robot_id(&self, uid: &str) -> Result<RobotId> {
        self.sim.find_robot(uid, "robot", RobotData::is_robot)
    }

    /// All robots and articulations with their uids, in the order in which they were added.
    pub fn robot_ids(&self) -> Vec<(&'a str, RobotId)> {
        let robots = self.sim.contents.robots.iter().enumerate();
        robots.map(|(index, robot)| (robot.uid(), RobotId { manager: self.sim.serial, index })).collect()
    }

    /// The rigid object called `uid`.
    ///
    /// # Errors
    /// The uid is unknown; the error lists those there are.
    pub fn rigid_object_id(&self, uid: &str) -> Result<ObjectId> {
        let index = self.sim.contents.objects.iter().position(|o| o.uid() == uid);
        index.map(|index| ObjectId { manager: self.sim.serial, index }).ok_or_else(|| Error::UnknownName {
            what: "rigid object",
            name: uid.into(),
            candidates: self.sim.contents.objects.iter().map(|o| o.uid().to_string()).collect(),
        })
    }

    /// The MJCF file that is a part called `uid`.
    ///
    /// # Errors
    /// The uid is unknown; the error lists those there are.
    pub fn mjcf_id(&self, uid: &str) -> Result<MjcfId> {
        let index = self.sim.contents.parts.iter().position(|p| p.uid() == uid);
        index.map(|index| MjcfId { manager: self.sim.serial, index }).ok_or_else(|| Error::UnknownName {
            what: "MJCF part",
            name: uid.into(),
            candidates: self.sim.contents.parts.iter().map(|p| p.uid().to_string()).collect(),
        })
    }

    /// The articulation called `uid`.
    ///
    /// # Errors
    /// The uid is unknown; the error lists those there are.
    pub fn articulation_id(&self, uid: &str) -> Result<ArticulationId> {
        self.sim.find_robot(uid, "articulation", |robot| !robot.is_robot()).map(ArticulationId)
    }

    /// Names of all robots, then of all passive articulations, each in the order in which they were added.
    pub fn jointed_uids(&self) -> Vec<&'a str> {
        let of = |robots: bool| self.sim.contents.robots.iter().filter(move |data| data.is_robot() == robots);
        of(true).chain(of(false)).map(|data| data.uid()).collect()
    }

    /// The robot, or articulation, called `uid`: reading is the same for both.
    ///
    /// # Errors
    /// The uid is unknown; the error lists those there are.
    pub fn jointed_id(&self, uid: &str) -> Result<RobotId> {
        self.sim.find_robot(uid, "robot or articulation", |_: &RobotData| true)
    }

    /// Names of all rigid objects, in the order in which they were added.
    pub fn rigid_object_uids(&self) -> Vec<&'a str> {
        self.sim.contents.objects.iter().map(|object| object.uid()).collect()
    }

    /// Names of all MJCF parts, in the order in which they were added.
    pub fn mjcf_uids(&self) -> Vec<&'a str> {
        self.sim.contents.parts.iter().map(|part| part.uid()).collect()
    }

    /// Names of all sensors, in the order in which they were added.
    pub fn sensor_uids(&self) -> Vec<&'a str> {
        self.sim.sensors.uids().collect()
    }

    /// The sensor called `uid`, whatever its type: `&dyn Sensor` converts to `&dyn Any`. As with
    /// [`SimulationManager::sensor`], a lazy one measures now what was due.
    ///
    /// # Errors
    /// The uid is unknown, or the sensor failed, in an earlier step or now.
    pub fn sensor_called(&self, uid: &str) -> Result<&'a dyn Sensor> {
        self.sim.sensors.called(uid)
    }

    /// Physics steps until the sensor called `uid` measures next in any environment, at least 1; [`u64::MAX`] where it does
    /// not.
    ///
    /// # Errors
    /// There is no such sensor.
    pub fn sensor_due_in(&self, uid: &str) -> Result<u64> {
        self.sim.sensors.due_in(uid, &self.sim.simulation)
    }

    /// The sensors of a type with their names, in the order in which they were added; without those that failed.
    pub fn sensor_ids<S: Sensor>(&self) -> Vec<(String, SensorId<S>)> {
        self.sim.sensors.ids()
    }

    /// A terrain.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn terrain(&self, id: TerrainId) -> &'a Terrain {
        &self.sim.contents.terrains[self.sim.index_of(id.manager, id.index)]
    }

    /// Names of links (`uid/link`, of all robots), of objects, and of bodies and sites of MJCF files (`uid/body`): the order
    /// in which sensors and viewers number bodies.
    pub fn body_names(&self) -> Arc<[String]> {
        self.sim.contents.body_names()
    }

    /// Positions and velocities of all joints of the scene as MuJoCo has them (`qpos`, `qvel`), one row for each environment: shapes
    /// (N, nq) and (N, nv).
    pub fn engine_states(&self) -> [Array2<f64>; 2] {
        let model = self.sim.simulation.batch.model();
        let mut states =
            [Array2::zeros((self.sim.num_envs(), model.nq())), Array2::zeros((self.sim.num_envs(), model.nv()))];
        self.sim.simulation.batch.for_each(|index, env| {
            let data = env.data();
            for (table, numbers) in states.iter_mut().zip([data.qpos(), data.qvel()]) {
                table.row_mut(index).iter_mut().zip(numbers).for_each(|(to, from)| *to = *from);
            }
        });
        states
    }

    /// Names of the columns of a [rollout](SimulationManager::rollout)'s controls: the movable joints of all robots (`uid/joint`), in the
    /// order in which they were added, then the actuators of all MJCF parts (`uid/actuator`).
    pub fn control_names(&self) -> Vec<String> {
        let parts = self.sim.contents.parts.iter();
        let actuators = parts.flat_map(|part| part.names().actuators.iter().map(|name| part.full(name)));
        let drives = self
            .sim
            .contents
            .robots
            .iter()
            .flat_map(|robot| robot.joint_names().iter().map(|joint| format!("{}/{joint}", robot.uid())));
        drives.chain(actuators).collect()
    }

    /// Names of the columns of a [rollout](SimulationManager::rollout)'s states: `qpos uid/joint` for each position, then
    /// `qvel uid/joint` for each velocity, with a number in brackets where a joint has several: position and quaternion
    /// w x y z of a free joint \[m\], its velocity in the environment \[m/s\] and its angular velocity in the body \[rad/s\].
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
