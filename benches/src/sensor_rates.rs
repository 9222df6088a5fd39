//! Steps of standing quadrupeds with a height scanner, contact sensors on their feet and an IMU, each at its rate and
//! read at its rate, compared with the same quadrupeds without sensors. The ratio is the share of the physics.

use crate::interleave::{Contender, compare};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ray::RayCaster;
use kinetoscope::sensors::{ContactSensor, Imu};
use std::hint::black_box;
use std::time::{Duration, Instant};

const ENVS: [usize; 2] = [64, 1024];
const THREADS: usize = 1;
/// The robots stand still, so restarts are not needed.
const STEPS: u32 = 1_000_000;
/// Steps until the robots have settled.
const SETTLING: u32 = 400;
/// Steps between two scans: 50 Hz at 200 steps per second.
const STEPS_PER_SCAN: u32 = 4;

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let mut rows = Vec::new();
    for envs in ENVS {
        let with = || Quadrupeds::new(envs, true);
        let times = compare(settings.seconds, STEPS, with, || Quadrupeds::new(envs, false))?;
        let micros = |side: usize| 1e6 / times.rate(side, envs);
        let name = format!("quadruped, {envs} envs, scanner 50 Hz, contacts and IMU 200 Hz");
        rows.push(Row::new("sensors", name, "us/env-step", THREADS, micros(0)).against(
            "no sensors",
            micros(1),
            times.ratio(0, 1),
        ));
    }
    Ok(rows)
}

/// Quadrupeds of the bundled scene, with or without the sensors.
struct Quadrupeds {
    scene: InteractiveScene,
    has_sensors: bool,
    steps: u32,
}

impl Quadrupeds {
    fn new(envs: usize, has_sensors: bool) -> BenchResult<Self> {
        let mut cfg = SceneCfg::from_file(assets::path("scenes/quadruped.toml")?)?;
        cfg.simulation = SimulationManagerCfg { num_envs: envs, threads: Some(THREADS), ..cfg.simulation };
        cfg.entities.retain(|(name, entity)| {
            !matches!(entity, EntityCfg::Sensor(_))
                || has_sensors && ["height_scanner", "contact_forces"].contains(&&**name)
        });
        if has_sensors {
            cfg.entities.push(("imu".into(), ImuCfg::on("{ENV_REGEX_NS}/robot/base").into()));
        }
        let mut scene = InteractiveScene::new(cfg)?;
        scene.update(SETTLING);
        Ok(Self { scene, has_sensors, steps: 0 })
    }
}

impl Contender for Quadrupeds {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.scene.update(1);
            self.steps += 1;
            if !self.has_sensors {
                continue;
            }
            black_box(self.scene.sensor::<ContactSensor>("contact_forces")?.net_forces_w());
            black_box(self.scene.sensor::<Imu>("imu")?.lin_acc_b());
            if self.steps.is_multiple_of(STEPS_PER_SCAN) {
                black_box(self.scene.sensor::<RayCaster>("height_scanner")?.hits());
            }
        }
        Ok(start.elapsed())
    }
}
