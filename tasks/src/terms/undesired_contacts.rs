//! Reward of bodies in contact.

use crate::reward::RewardTerm;
use kinetoscope_sensors::ContactSensor;
use kinetoscope_sim::SensorId;
use ndarray::{ArrayView1, Axis};

/// Number of the sensor's bodies whose net normal contact force
/// ([`net_forces_w`](ContactSensor::net_forces_w)) exceeds `force` \[N\] in the current measurement or one of the
/// sensor's history; Isaac Lab's `undesired_contacts`. A penalty needs a negative `weight`.
pub fn undesired_contacts(name: &str, weight: f64, sensor: SensorId<ContactSensor>, force: f64) -> RewardTerm {
    RewardTerm::new(name, weight, move |now| {
        let sensor = now.sim().sensor(sensor)?;
        let (present, history) = (sensor.net_forces_w(), sensor.net_forces_w_history());
        let exceeds = |f: ArrayView1<'_, f64>| f.iter().map(|x| x * x).sum::<f64>().sqrt() > force;
        let touches = |env: usize, body: usize| {
            let (present, earlier) = (present.index_axis(Axis(0), env), history.index_axis(Axis(0), env));
            exceeds(present.row(body)) || earlier.outer_iter().any(|forces| exceeds(forces.row(body)))
        };
        let count = |env: usize| (0..present.len_of(Axis(1))).filter(|body| touches(env, *body)).count() as f64;
        Ok((0..now.num_envs()).map(count).collect())
    })
}
