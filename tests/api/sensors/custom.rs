//! A sensor that another crate defines.

use super::worlds::{ball, sim};
use kinetoscope::prelude::*;
use kinetoscope::scene::SceneState;
use kinetoscope::sensors::{Channel, Requires, Sampler, Sensor, SensorCfg, SensorContext, SensorError};
use serde::{Deserialize, Serialize};
use testkit::tolerance::{Tolerance, assert_close};

/// Speed of a body above a level, with everything that a sampler provides: rate, latency, noise.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SpeedCfg {
    body: String,
    #[serde(default)]
    level: f64,
    #[serde(default)]
    sampling: SamplingCfg,
}

#[derive(Debug)]
pub(crate) struct Speed {
    body: usize,
    level: f64,
    pub(crate) sampler: Sampler,
}

impl SensorCfg for SpeedCfg {
    type Sensor = Speed;

    fn requires(&self) -> Requires {
        Requires::VELOCITIES
    }

    fn build(&self, context: &SensorContext) -> Result<Speed, SensorError> {
        let channels = [Channel::new("speed", 1)];
        let sampler = Sampler::new("speed", self.requires(), context, &self.sampling, &channels)?;
        Ok(Speed { body: context.body(&self.body)?, level: self.level, sampler })
    }
}

fn read(body: usize, level: f64) -> impl Fn(&SceneState, usize, &mut [f64]) {
    move |state, env, row| {
        let velocity = |k| state.body_velocities.as_ref().map_or(0.0, |v| v[(env, body, k)]);
        row[0] = (0..3).map(|k| velocity(k).powi(2)).sum::<f64>().sqrt() - level;
    }
}

impl Sensor for Speed {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        let read = read(self.body, self.level);
        self.sampler.update(state, |env, row| read(state, env, row))
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let read = read(self.body, self.level);
        self.sampler.reset(env_ids, state, |env, row| read(state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let read = read(self.body, self.level);
        self.sampler.refresh(env_ids, state, |env, row| read(state, env, row))
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }
}

/// The speed of a free fall is `g t`, and the reading is 4 steps old.
#[test]
fn sampler() {
    let mut sim = sim(2);
    sim.add_rigid_object(ball("ball", 0.05, 1.0, [0.0, 0.0, 90.0])).unwrap();
    let sampling = SamplingCfg { latency_steps: 4, ..SamplingCfg::every(0.01) };
    let id = sim.add_sensor("speed", SpeedCfg { body: "ball".into(), level: 0.0, sampling }).unwrap();
    sim.update(101);
    // The newest capture that is 4 steps old is that of step 96.
    let limit = Tolerance::absolute(1e-12, "rounding of 96 sums of numbers up to 5");
    assert_close("speed", sim.sensor(id).unwrap().sampler.values("speed"), &[9.81 * 96.0 * 0.005; 2], limit);
}
