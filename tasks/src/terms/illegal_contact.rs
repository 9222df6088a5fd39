//! Termination by contact forces.

use crate::termination::TerminationTerm;
use kinetoscope_sensors::ContactSensor;
use kinetoscope_sim::SensorId;
use ndarray::{Array1, Axis};

/// Terminates the episodes of environments in which the net normal contact force
/// ([`net_forces_w`](ContactSensor::net_forces_w)) on one of the sensor's bodies exceeds `force` \[N\].
pub fn illegal_contact(name: &str, sensor: SensorId<ContactSensor>, force: f64) -> TerminationTerm {
    TerminationTerm::new(name, move |now| {
        let sensor = now.sim().sensor(sensor)?;
        let forces = sensor.net_forces_w();
        let is_touched = |env: usize| {
            forces
                .index_axis(Axis(0), env)
                .rows()
                .into_iter()
                .any(|one| one.iter().map(|x| x * x).sum::<f64>().sqrt() > force)
        };
        Ok((0..now.num_envs()).map(is_touched).collect::<Array1<bool>>())
    })
}
