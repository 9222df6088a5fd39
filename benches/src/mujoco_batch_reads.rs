//! Batched stepping with all link poses, joint states and contact forces read after every step, compared with
//! `mujoco.batch` with the same quantities bound.
//!
//! `mujoco.batch` computes poses of the new state with `stage=mjSTAGE_VEL` (a forward pass in each step), and contact
//! forces because the model gets an accelerometer, which needs them. Neither drives nor controls act, so both sides do
//! the same physics; this is checked bit by bit.

use crate::baseline;
use crate::interleave::{Contender, compare};
use crate::models::{Case, HUMANOID, STEPS, arm_and_hand_cfg};
use crate::mujoco_batch::{Baseline, ENVS, Reads, THREADS};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sim::{DriveType, EntityCfg, MjcfId};
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let Some(python) = baseline::python("mujoco.batch with poses and contact forces") else { return Ok(Vec::new()) };
    let mut rows = Vec::new();
    for (name, entity) in entities()? {
        let (sim, ..) = simulation(&entity, 1, 1)?;
        let case = Case::of_simulation(name, &sim)?;
        for (envs, threads) in ENVS.into_iter().flat_map(|envs| THREADS.map(|threads| (envs, threads))) {
            let name = format!("{}, {envs} envs, poses and forces", case.name);
            eprintln!("  {name}");
            let times = compare(
                settings.seconds,
                STEPS,
                || Ours::new(&case, &entity, envs, threads),
                || Baseline::start(&python, &case, (envs, threads), Reads::PosesAndForces),
            )?;
            let rate = |side: usize| times.rate(side, envs);
            rows.push(
                Row::new("mujoco-batch", name, "env-steps/s", threads, rate(0))
                    .against("mujoco.batch", rate(1), times.ratio(0, 1))
                    .with_target_ratio(1.0),
            );
        }
    }
    Ok(rows)
}

/// Debian's humanoid, if it is installed, and the bundled arm and hand without drives.
fn entities() -> BenchResult<Vec<(&'static str, EntityCfg)>> {
    let mut entities = Vec::new();
    if Path::new(HUMANOID).exists() {
        entities.push(("humanoid", MjcfPartCfg::file("humanoid", HUMANOID).into()));
    }
    let drive = DriveCfg { drive_type: DriveType::None, ..DriveCfg::default() };
    let robot = RobotCfg { drive, ..arm_and_hand_cfg(&assets::path("sr5/SR5.urdf")?, "JOINT[1-6]")? };
    entities.push(("SR5 + hand", robot.into()));
    Ok(entities)
}

/// The measured entity of a simulation.
#[derive(Clone, Copy, Debug)]
enum Entity {
    Robot(RobotId),
    Part(MjcfId),
}

fn simulation(
    entity: &EntityCfg,
    envs: usize,
    threads: usize,
) -> BenchResult<(SimulationManager, Entity, SensorId<ContactSensor>)> {
    let cfg = SimulationManagerCfg { num_envs: envs, threads: Some(threads), ..SimulationManagerCfg::default() };
    let mut sim = SimulationManager::new(cfg)?;
    let entity = match entity {
        EntityCfg::Robot(robot) => Entity::Robot(sim.add_robot((**robot).clone())?),
        EntityCfg::Mjcf(part) => Entity::Part(sim.add_mjcf((**part).clone())?),
        other => return Err(format!("no measurement of {other:?}").into()),
    };
    let contacts = sim.add_sensor("contacts", ContactSensorCfg::for_bodies(".*"))?;
    Ok((sim, entity, contacts))
}

/// Our side: a simulation whose robot and contact sensor are read as users read them.
struct Ours<'c> {
    case: &'c Case,
    sim: SimulationManager,
    entity: Entity,
    contacts: SensorId<ContactSensor>,
}

impl<'c> Ours<'c> {
    fn new(case: &'c Case, entity: &EntityCfg, envs: usize, threads: usize) -> BenchResult<Self> {
        let (sim, entity, contacts) = simulation(entity, envs, threads)?;
        Ok(Self { case, sim, entity, contacts })
    }

    fn envs(&self) -> impl Iterator<Item = EnvId> + use<> {
        (0..self.sim.num_envs()).map(EnvId)
    }
}

impl Contender for Ours<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        for env in self.envs() {
            let case = self.case;
            self.sim.scene_mut().with_mujoco(env, |data| {
                data.reset();
                case.state(env.0).write(data);
            })?;
        }
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.sim.update(1);
            match self.entity {
                Entity::Robot(id) => {
                    let robot = self.sim.robot(id);
                    black_box((robot.qpos(), robot.qvel(), robot.link_poses()));
                }
                Entity::Part(id) => {
                    let part = self.sim.mjcf_part(id);
                    black_box((part.qpos(), part.qvel(), part.body_poses()));
                }
            }
            black_box(self.sim.sensor(self.contacts)?.net_forces_w());
        }
        Ok(start.elapsed())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        let mut qpos = Vec::new();
        for env in self.envs() {
            qpos.extend(self.sim.with_mujoco(env, |_, data| data.qpos().to_vec())?);
        }
        Ok(Some(qpos))
    }
}
