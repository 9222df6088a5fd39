//! Cost of a contact sensor: standing quadrupeds with a sensor on their feet, compared with the same quadrupeds
//! without. The sensor measures in every step and keeps six measurements. The sides are created in both orders, half
//! the time each.

use crate::interleave::{Contender, compare};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ContactSensor;
use std::time::{Duration, Instant};

const ENVS: usize = 64;
/// Target: the sensor takes at most 3 % of a step.
const TARGET_RATIO: f64 = 1.0 / 1.03;
/// The robots stand still, so restarts are not needed.
const STEPS: u32 = 1_000_000;
/// Steps until the robots have settled.
const SETTLING: u32 = 400;

struct Quadrupeds {
    sim: SimulationManager,
    feet: Option<SensorId<ContactSensor>>,
}

impl Quadrupeds {
    fn new(sensor: bool) -> BenchResult<Self> {
        let cfg = SimulationManagerCfg { num_envs: ENVS, threads: Some(1), ..SimulationManagerCfg::legged() };
        let mut sim = SimulationManager::new(cfg)?;
        let pose = [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
        sim.add_robot(RobotCfg {
            urdf: UrdfCfg::single(assets::path("quadruped/quadruped.urdf")?),
            fix_base: false,
            init_pose: Pose::translation(0.0, 0.0, 0.6),
            init_qpos: pose.map(|(joints, angle)| (joints.to_string(), angle)).to_vec(),
            drive: DriveCfg { stiffness: 80.0.into(), damping: 5.0.into(), ..Default::default() },
            ..Default::default()
        })?;
        sim.update(SETTLING);
        let sampling = SamplingCfg { history_length: 6, ..Default::default() };
        let cfg = ContactSensorCfg { sampling, ..ContactSensorCfg::for_bodies(".*_FOOT") };
        let feet = if sensor { Some(sim.add_sensor("feet", cfg)?) } else { None };
        Ok(Self { sim, feet })
    }
}

impl Contender for Quadrupeds {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.sim.update(1);
        }
        let took = start.elapsed();
        if let Some(feet) = self.feet {
            let forces = self.sim.sensor(feet)?.net_forces_w();
            if !(0..ENVS).all(|env| (0..4).any(|foot| forces[(env, foot, 2)] > 1.0)) {
                return Err("a quadruped has no foot contact".into());
            }
        }
        Ok(took)
    }
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let times = compare(settings.seconds, STEPS, || Quadrupeds::new(true), || Quadrupeds::new(false))?;
    let micros = |side: usize| 1e6 / times.rate(side, ENVS);
    Ok(vec![
        Row::new("contacts", format!("quadruped, {ENVS} envs"), "us/env-step", 1, micros(0))
            .against("no sensor", micros(1), times.ratio(0, 1))
            .with_target_ratio(TARGET_RATIO),
    ])
}
