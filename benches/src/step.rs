//! Batched stepping with all positions and velocities read back, compared with bare loops of MuJoCo calls on as many
//! threads.
//!
//! Both sides start from the same states and do the same physics; this is checked bit by bit after every round. They
//! are created in both orders, half the time each: ratios are geometric means of the two, rates are means. The loop over
//! rows copies positions and velocities after every step, as our side does; the loop with an `mjData` for each
//! environment does not, because they stay readable there.

use crate::interleave::{Contender, MeasurementCfg, in_both_orders, measure};
use crate::models::{Case, Loop, STEPS};
use crate::row::Row;
use crate::settings::{BenchResult, Settings};
use kinetoscope::mujoco::{Data, IntegrationState, UserInputs};
use kinetoscope::sim::batch::Batch;
use kinetoscope::sim::env::Stage;
use std::time::{Duration, Instant};

const ENVS: [usize; 3] = [64, 1024, 4096];
/// Targets of the ratios to the loop with an `mjData` for each environment and to the loop over rows.
const WANTED: f64 = 1.0;
/// Target of the speed-up by the second thread, relative to that of the bare loop.
const WANTED_SCALING: f64 = 0.97;

/// Our side: a batch, and copies of its state after every step.
pub(crate) struct Ours<'c> {
    case: &'c Case,
    batch: Batch,
    pub(crate) qpos: Vec<f64>,
    qvel: Vec<f64>,
}

impl<'c> Ours<'c> {
    pub(crate) fn new(case: &'c Case, envs: usize, threads: usize) -> BenchResult<Self> {
        let (qpos, qvel) = (vec![0.0; envs * case.model.nq()], vec![0.0; envs * case.model.nv()]);
        Ok(Self { case, batch: case.batch(envs, threads)?, qpos, qvel })
    }
}

impl Contender for Ours<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        self.case.restart(&mut self.batch);
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        for _ in 0..steps {
            let outs = [&mut self.qpos[..], &mut self.qvel[..]];
            self.batch.step_and_read(1, Stage::State, |env| [env.data().qpos(), env.data().qvel()], outs);
        }
        Ok(start.elapsed())
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        Ok(Some(self.qpos.clone()))
    }
}

/// The baseline: every thread steps its share of `mjData` repeatedly, without synchronization and without reads.
struct MujocoLoop<'c> {
    case: &'c Case,
    shares: Vec<Vec<Data>>,
}

impl<'c> MujocoLoop<'c> {
    fn new(case: &'c Case, envs: usize, threads: usize) -> BenchResult<Self> {
        let share = envs.div_ceil(threads);
        let mut shares = Vec::new();
        for first in (0..envs).step_by(share) {
            let datas: Result<Vec<Data>, _> =
                (first..(first + share).min(envs)).map(|_| Data::new(&case.model)).collect();
            shares.push(datas?);
        }
        Ok(Self { case, shares })
    }
}

/// The baseline with rows: every thread has one `mjData`, restores each of its environments into it, steps and saves.
struct RowsLoop<'c> {
    case: &'c Case,
    shares: Vec<RowsShare>,
}

/// Environments of one thread.
struct RowsShare {
    data: Data,
    first: usize,
    rows: Vec<(IntegrationState, UserInputs)>,
    /// Positions with normalized quaternions, and velocities, after the last step, environment by environment.
    qpos: Vec<f64>,
    qvel: Vec<f64>,
}

impl<'c> RowsLoop<'c> {
    fn new(case: &'c Case, envs: usize, threads: usize) -> BenchResult<Self> {
        let share = envs.div_ceil(threads);
        let mut shares = Vec::new();
        for first in (0..envs).step_by(share) {
            let count = share.min(envs - first);
            let (qpos, qvel) = (vec![0.0; count * case.model.nq()], vec![0.0; count * case.model.nv()]);
            let rows = vec![Default::default(); count];
            shares.push(RowsShare { data: Data::new(&case.model)?, first, rows, qpos, qvel });
        }
        let mut rows = Self { case, shares };
        rows.restart()?;
        Ok(rows)
    }
}

impl RowsShare {
    fn step(&mut self) -> bool {
        let Self { data, rows, qpos, qvel, .. } = self;
        let (nq, nv) = (data.model().nq(), data.model().nv());
        let reads = qpos.chunks_exact_mut(nq).zip(qvel.chunks_exact_mut(nv));
        rows.iter_mut().zip(reads).all(|((state, inputs), (qpos, qvel))| {
            state.restore(data);
            inputs.restore(data);
            let done = data.step1().and_then(|()| data.step2()).is_ok();
            state.save(data);
            // As our side returns them; the saved state keeps the quaternions before that.
            data.normalize_quaternions();
            qpos.copy_from_slice(data.qpos());
            qvel.copy_from_slice(data.qvel());
            done
        })
    }
}

impl Contender for RowsLoop<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        for RowsShare { data, first, rows, .. } in &mut self.shares {
            for (k, (state, inputs)) in rows.iter_mut().enumerate() {
                data.reset();
                self.case.write(*first + k, data);
                state.save(data);
                inputs.save(data);
            }
        }
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        let run = move |share: &mut RowsShare| (0..steps).all(|_| share.step());
        let ok = on_threads(&mut self.shares, run);
        let time = start.elapsed();
        if ok { Ok(time) } else { Err("MuJoCo stopped in a loop over rows".into()) }
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        Ok(Some(self.shares.iter().flat_map(|share| &share.qpos).copied().collect()))
    }
}

/// Runs `run` for every share, each on a thread of its own. The calling thread takes part, as in our side.
fn on_threads<S: Send>(shares: &mut [S], run: impl Fn(&mut S) -> bool + Copy + Send) -> bool {
    let Some((share, others)) = shares.split_first_mut() else { return true };
    if others.is_empty() {
        return run(share);
    }
    std::thread::scope(|scope| {
        let others: Vec<_> = others.iter_mut().map(|share| scope.spawn(move || run(share))).collect();
        let mine = run(share);
        others.into_iter().all(|thread| thread.join().unwrap_or(false)) && mine
    })
}

fn mujoco_step(data: &mut Data, what: Loop) -> bool {
    match what {
        Loop::Step => data.step().is_ok(),
        Loop::Step21 => data.step2().and_then(|()| data.step1()).is_ok(),
    }
}

impl Contender for MujocoLoop<'_> {
    fn restart(&mut self) -> BenchResult<()> {
        for (i, data) in self.shares.iter_mut().flatten().enumerate() {
            data.reset();
            self.case.write(i, data);
            if self.case.bare == Loop::Step21 {
                data.step1()?;
            }
        }
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let what = self.case.bare;
        let start = Instant::now();
        let run = move |share: &mut Vec<Data>| (0..steps).all(|_| share.iter_mut().all(|data| mujoco_step(data, what)));
        let ok = on_threads(&mut self.shares, run);
        let time = start.elapsed();
        if ok { Ok(time) } else { Err("MuJoCo stopped in a bare loop".into()) }
    }

    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        let mut qpos = Vec::new();
        for data in self.shares.iter_mut().flatten() {
            // 2.2.2 normalizes quaternions in place at the start of a step, and our side has begun the next step.
            // Normalizing twice would change the last bit, so this is undone.
            let before = data.qpos().to_vec();
            if self.case.bare == Loop::Step {
                data.step1()?;
            }
            qpos.extend_from_slice(data.qpos());
            data.qpos_mut().copy_from_slice(&before);
        }
        Ok(Some(qpos))
    }
}

pub(crate) fn run(settings: &Settings) -> BenchResult<Vec<Row>> {
    let (mut rows, mut scaling) = (Vec::new(), Vec::new());
    for case in Case::humanoid()?.into_iter().chain([Case::sr5()?]) {
        for envs in ENVS {
            let name = format!("{}, {envs} envs", case.name);
            eprintln!("  {name}");
            // All four sides run in one measurement: half of the time for each thread count, and half of that for each
            // order.
            let plan = MeasurementCfg { seconds: settings.seconds, restart_after: STEPS };
            let times = in_both_orders(|order| {
                let both = |threads| -> BenchResult<_> {
                    Ok((MujocoLoop::new(&case, envs, threads)?, RowsLoop::new(&case, envs, threads)?))
                };
                let pair = |threads| order.create(|| Ours::new(&case, envs, threads), || both(threads));
                let ((mut ours1, (mut bare1, mut rows1)), (mut ours2, (mut bare2, mut rows2))) = (pair(1)?, pair(2)?);
                measure(plan, &mut [&mut ours1, &mut bare1, &mut ours2, &mut bare2, &mut rows1, &mut rows2])
            })?;
            for (threads, side, in_rows) in [(1, 0, 4), (2, 2, 5)] {
                let rate = |side: usize| times.rate(side, envs);
                for (baseline, other) in [("bare loop", side + 1), ("rows loop", in_rows)] {
                    rows.push(
                        Row::new("step", &name, "env-steps/s", threads, rate(side))
                            .against(baseline, rate(other), times.ratio(side, other))
                            .with_target_ratio(WANTED),
                    );
                }
            }
            scaling.push(
                Row::new("scaling", &name, "speed-up", 2, times.mean_of(|t| t[0] / t[2]))
                    .against(
                        "bare loop",
                        times.mean_of(|t| t[1] / t[3]),
                        times.mean_of(|t| (t[0] / t[2]) / (t[1] / t[3])),
                    )
                    .with_target_ratio(WANTED_SCALING),
            );
        }
    }
    rows.append(&mut scaling);
    Ok(rows)
}
