//! What a simulation holds, by name, for those who know nothing of how it was built: recorders, inspectors.

use crate::error::Result;
use crate::ids::RobotId;
use crate::manager::SimulationManager;
use crate::objects::robot_data::RobotData;
use kinetoscope_sensors::Sensor;

impl SimulationManager {
    /// Names of all robots, then of all articulations that are none, each in the order in which they were added.
    pub fn jointed_uids(&self) -> Vec<&str> {
        let of = |robots: bool| self.contents.robots.iter().filter(move |data| data.is_robot() == robots);
        of(true).chain(of(false)).map(|data| data.uid()).collect()
    }

    /// The robot, or articulation, called `uid`: reading is the same for both.
    ///
    /// # Errors
    /// There is none; the error lists those there are.
    pub fn jointed_id(&self, uid: &str) -> Result<RobotId> {
        self.find_robot(uid, "robot or articulation", |_: &RobotData| true)
    }

    /// Names of all rigid objects, in the order in which they were added.
    pub fn rigid_object_uids(&self) -> Vec<&str> {
        self.contents.objects.iter().map(|object| object.uid()).collect()
    }

    /// Names of all MJCF parts, in the order in which they were added.
    pub fn mjcf_uids(&self) -> Vec<&str> {
        self.contents.parts.iter().map(|part| part.uid()).collect()
    }

    /// Names of all sensors, in the order in which they were added.
    pub fn sensor_uids(&self) -> Vec<&str> {
        self.sensors.uids().collect()
    }

    /// The sensor called `uid`, whatever its type: `&dyn Sensor` converts to `&dyn Any`. As with
    /// [`sensor`](Self::sensor), a lazy one measures now what was due.
    ///
    /// # Errors
    /// There is none, or it failed, in an earlier step or now.
    pub fn sensor_called(&self, uid: &str) -> Result<&dyn Sensor> {
        self.sensors.called(uid)
    }

    /// Physics steps until the sensor called `uid` measures next in any environment, at least 1; [`u64::MAX`] where it does
    /// not.
    ///
    /// # Errors
    /// There is no such sensor.
    pub fn sensor_due_in(&self, uid: &str) -> Result<u64> {
        self.sensors.due_in(uid, &self.simulation)
    }
}
