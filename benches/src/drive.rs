//! Cost of drives: arm and hand between two poses, compared with the same model stepped from the same states without
//! drives. The sides are created in both orders, half the time each: the ratio is the geometric mean of the two, times
//! are those of mean rates.

use crate::interleave::{Contender, MeasurementCfg, in_both_orders, measure};
use crate::models::{State, drive_sr5, sr5};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::exec::ThreadPool;
use kinetoscope::prelude::*;
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::drive::table::DriveTable;
use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

const ENVS: usize = 64;
/// Target: a step with drives takes at most 1.3 times a step without.
const TARGET_RATIO: f64 = 1.0 / 1.3;
/// Steps between restarts, few enough that the undriven arm has hardly fallen.
const STEPS: u32 = 16;
/// Steps between changes of the targets.
const PHASE: u32 = 200;

type States = Rc<RefCell<Vec<State>>>;

/// The side with drives. It continues from its state and shares that state with the other side.
struct Driven {
    sim: SimulationManager,
    robot: RobotId,
    states: States,
    steps: u32,
    closed: bool,
    qpos: Vec<f64>,
    qvel: Vec<f64>,
}

impl Contender for Driven {
    fn restart(&mut self) -> BenchResult<()> {
        if self.steps >= PHASE {
            self.steps = 0;
            self.closed = !self.closed;
            drive_sr5(&mut self.sim, self.robot, self.closed)?;
        }
        let mut states = self.states.borrow_mut();
        states.clear();
        self.sim.batch().for_each(|_, env| states.push(State::of(env.data())));
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        self.steps += steps;
        let start = Instant::now();
        for _ in 0..steps {
            self.sim.update(1);
            read_back(self.sim.batch(), &mut self.qpos, &mut self.qvel);
        }
        Ok(start.elapsed())
    }
}

/// The side without drives. It restarts from the state of the driven side.
struct Undriven {
    batch: Batch,
    states: States,
    qpos: Vec<f64>,
    qvel: Vec<f64>,
}

impl Contender for Undriven {
    fn restart(&mut self) -> BenchResult<()> {
        for (i, state) in self.states.borrow().iter().enumerate() {
            self.batch.write(i, |env| env.write(|data| state.write(data)));
        }
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            self.batch.step(1);
            read_back(&self.batch, &mut self.qpos, &mut self.qvel);
        }
        Ok(start.elapsed())
    }
}

/// Copies positions and velocities of all environments to two arrays.
fn read_back(batch: &Batch, qpos: &mut [f64], qvel: &mut [f64]) {
    let (nq, nv) = (batch.model().nq(), batch.model().nv());
    batch.for_each(|i, env| {
        qpos[i * nq..(i + 1) * nq].copy_from_slice(env.data().qpos());
        qvel[i * nv..(i + 1) * nv].copy_from_slice(env.data().qvel());
    });
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let model = sr5(1, 1)?.0.batch().model().clone();
    let (qpos, qvel) = (vec![0.0; ENVS * model.nq()], vec![0.0; ENVS * model.nv()]);
    let times = in_both_orders(|order| {
        let states = States::default();
        let driven = || {
            let (mut sim, robot) = sr5(ENVS, 1)?;
            drive_sr5(&mut sim, robot, false)?;
            let (states, qpos, qvel) = (Rc::clone(&states), qpos.clone(), qvel.clone());
            Ok(Driven { sim, robot, states, steps: 0, closed: false, qpos, qvel })
        };
        let undriven = || {
            let batch = Batch::new(&model, &Arc::new(DriveTable::default()), ENVS, 1, ThreadPool::new())?;
            Ok(Undriven { batch, states: Rc::clone(&states), qpos: qpos.clone(), qvel: qvel.clone() })
        };
        let (mut driven, mut undriven) = order.create(driven, undriven)?;
        let plan = MeasurementCfg { seconds: 0.5 * settings.seconds, restart_after: STEPS };
        measure(plan, &mut [&mut driven, &mut undriven])
    })?;
    let micros = |side: usize| 1e6 / times.rate(side, ENVS);
    Ok(vec![
        Row::new("drive", format!("SR5 + hand, {ENVS} envs"), "us/env-step", 1, micros(0))
            .against("same model, no drives", micros(1), times.ratio(0, 1))
            .with_target_ratio(TARGET_RATIO),
    ])
}
