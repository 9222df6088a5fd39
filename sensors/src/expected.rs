//! What a sensor expects of a state: that it has what the sensor needs, of the scene that it was built for.

use crate::error::SensorError;
use crate::requires::Requires;
use crate::sensor::SensorContext;
use kinetoscope_scene::SceneState;
use ndarray::{Array2, Array3};

/// What a sensor was built for.
#[derive(Clone, Debug)]
pub struct Expected {
    sensor: &'static str,
    requires: Requires,
    num_envs: usize,
    bodies: usize,
    joints: usize,
    actuators: usize,
    instances: usize,
    engine_values: usize,
}

impl Expected {
    /// States of the scene of `context` that have what the kind of sensor called `sensor` requires.
    pub fn new(sensor: &'static str, requires: Requires, context: &SensorContext) -> Self {
        let (num_envs, bodies, joints) = (context.num_envs, context.bodies.len(), context.joints.len());
        let actuators = context.actuators.len();
        let instances = context.scene.as_ref().map_or(0, |scene| scene.instances().len());
        let engine_values = context.engine_sensors.iter().map(|s| s.first + s.width).max().unwrap_or(0);
        Self { sensor, requires, num_envs, bodies, joints, actuators, instances, engine_values }
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// Checks a state.
    ///
    /// # Errors
    ///
    /// [`SensorError::MissingFields`] or [`SensorError::WrongShape`].
    pub fn check(&self, state: &SceneState) -> Result<(), SensorError> {
        let missing = self.requires.without(Requires::present_in(state));
        if !missing.is_empty() {
            return Err(SensorError::MissingFields { sensor: self.sensor, missing });
        }
        for found in [state.step.len(), state.time.len(), state.force_time.len()] {
            same("environments", self.num_envs, found)?;
        }
        if let Some(contacts) = &state.contacts {
            same("environments", self.num_envs, contacts.first.len().saturating_sub(1))?;
        }
        for (field, array) in [
            (Requires::POSES, &state.body_poses),
            (Requires::VELOCITIES, &state.body_velocities),
            (Requires::ACCELERATIONS, &state.body_accelerations),
            (Requires::ACCELERATIONS, &state.force_poses),
            (Requires::ACCELERATIONS, &state.force_velocities),
            (Requires::JOINT_WRENCHES, &state.joint_wrenches),
        ] {
            self.rows(field, array.as_ref().map(Array3::shape), "bodies", self.bodies)?;
        }
        for (field, array) in [
            (Requires::JOINT_STATE, &state.joint_positions),
            (Requires::JOINT_STATE, &state.joint_velocities),
            (Requires::JOINT_EFFORTS, &state.joint_efforts),
        ] {
            self.rows(field, array.as_ref().map(Array2::shape), "joints", self.joints)?;
        }
        for array in [&state.actuator_controls, &state.actuator_forces, &state.actuator_activations] {
            self.rows(Requires::ACTUATORS, array.as_ref().map(Array2::shape), "actuators", self.actuators)?;
        }
        let sensordata = state.sensordata.as_ref().map(Array2::shape);
        self.rows(Requires::SENSORDATA, sensordata, "values of the engine's sensors", self.engine_values)?;
        self.rows(Requires::INSTANCES, state.instance_poses.as_ref().map(Array2::shape), "instances", self.instances)
    }

    /// Checks that the array of a required field has the axes (environments, `count` of `what`).
    fn rows(
        &self,
        field: Requires,
        shape: Option<&[usize]>,
        what: &'static str,
        count: usize,
    ) -> Result<(), SensorError> {
        match shape {
            Some([envs, found, ..]) if self.requires.contains(field) => {
                same("environments", self.num_envs, *envs)?;
                same(what, count, *found)
            }
            _ => Ok(()),
        }
    }

    /// Checks indices of environments.
    ///
    /// # Errors
    ///
    /// [`SensorError::IndexOutOfRange`].
    pub fn check_envs(&self, env_ids: &[usize]) -> Result<(), SensorError> {
        match env_ids.iter().find(|&&env| env >= self.num_envs) {
            Some(&index) => Err(SensorError::IndexOutOfRange { what: "environment", index, count: self.num_envs }),
            None => Ok(()),
        }
    }
}

fn same(what: &'static str, expected: usize, found: usize) -> Result<(), SensorError> {
    if expected == found { Ok(()) } else { Err(SensorError::WrongShape { what, expected, found }) }
}
