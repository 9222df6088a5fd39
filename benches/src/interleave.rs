//! Fair timing on a shared machine: the sides take turns in short blocks, and ratios are computed per turn.
//!
//! A round runs one block of every side, then another block of every side in reverse order, so that a changing load
//! affects all sides alike. Results are medians over rounds; rounds in which other programs kept the processor busy are
//! discarded.
//!
//! The order of creation matters too. At 1024 environments the side whose memory was allocated first was up to 1.3
//! times as fast as the other, because it gets the larger pages. Comparisons of many environments are therefore done
//! [in both orders](in_both_orders).

use crate::other_load;
use crate::settings::BenchResult;
use kinetoscope::mujoco::trim_heap;
use std::time::{Duration, Instant};

/// One program of a comparison. All sides do the same work.
pub(crate) trait Contender {
    /// Returns to the start of the work; not timed.
    fn restart(&mut self) -> BenchResult<()>;

    /// Does `steps` steps in every environment; returns the time they took.
    fn block(&mut self, steps: u32) -> BenchResult<Duration>;

    /// The id of the process that does the work, if it is another process.
    fn process(&self) -> Option<u32> {
        None
    }

    /// Positions after the last block, for benchmarks in which all sides must have the same positions.
    fn qpos(&mut self) -> BenchResult<Option<Vec<f64>>> {
        Ok(None)
    }
}

/// Largest share of one core that other programs may take in a valid round.
const MAX_OTHER_LOAD: f64 = 0.05;
/// On a machine that is always busy, the search for quiet rounds ends after this multiple of the planned length. With
/// fewer than [`FEWEST_ROUNDS`] of them, all rounds count.
const PATIENCE: f64 = 4.0;

/// Parameters of a measurement.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MeasurementCfg {
    /// Total length of the rounds without load of other programs \[s\]; at least five such rounds are measured.
    pub(crate) seconds: f64,
    /// The work restarts once a side has done this many steps.
    pub(crate) restart_after: u32,
}

/// Minimum length of a block: a shorter one would be dominated by the start of threads.
const SHORTEST_BLOCK: Duration = Duration::from_millis(50);
/// Minimum number of rounds for a median.
const FEWEST_ROUNDS: usize = 5;

/// Time per step \[s\] of every round: `times[side][round]`.
#[derive(Debug)]
pub(crate) struct Times(Vec<Vec<f64>>);

impl Times {
    /// Median of one side \[s per step\].
    pub(crate) fn per_step(&self, side: usize) -> f64 {
        median(self.0[side].clone())
    }

    /// Median over rounds of a number computed from the times of all sides.
    pub(crate) fn median_of(&self, number: impl Fn(&[f64]) -> f64) -> f64 {
        let rounds = self.0.first().map_or(0, Vec::len);
        let of_round = |round: usize| self.0.iter().map(|side| side[round]).collect::<Vec<f64>>();
        median((0..rounds).map(|round| number(&of_round(round))).collect())
    }

    /// Speed of side `ours` relative to side `baseline`: the median ratio of their times.
    pub(crate) fn ratio(&self, ours: usize, baseline: usize) -> f64 {
        self.median_of(|t| t[baseline] / t[ours])
    }
}

/// Creation order of a pair of sides.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Our side first.
    OursFirst,
    /// The baseline first.
    BaselineFirst,
}

impl Order {
    /// Creates both sides in this order.
    pub(crate) fn create<A, B>(
        self,
        ours: impl FnOnce() -> BenchResult<A>,
        start_baseline: impl FnOnce() -> BenchResult<B>,
    ) -> BenchResult<(A, B)> {
        match self {
            Self::OursFirst => {
                let ours = ours()?;
                Ok((ours, start_baseline()?))
            }
            Self::BaselineFirst => {
                let baseline = start_baseline()?;
                Ok((ours()?, baseline))
            }
        }
    }
}

/// Two measurements of the same sides, created in opposite orders.
#[derive(Debug)]
pub(crate) struct BothOrders([Times; 2]);

/// Runs `measurement` once for each order. `measurement` must create its sides in the given order, and take half of the
/// time. The sides are dropped in between.
pub(crate) fn in_both_orders(mut measurement: impl FnMut(Order) -> BenchResult<Times>) -> BenchResult<BothOrders> {
    let mut one = |order| {
        let times = measurement(order);
        // Returns freed memory to the system, so that both orders start with the same memory.
        trim_heap();
        times
    };
    Ok(BothOrders([one(Order::OursFirst)?, one(Order::BaselineFirst)?]))
}

/// Compares two sides in [both orders](in_both_orders) for `seconds` in all: side 0 is `ours`, side 1 `baseline`. The work
/// restarts once a side has done `restart_after` steps.
pub(crate) fn compare<A: Contender, B: Contender>(
    seconds: f64,
    restart_after: u32,
    ours: impl Fn() -> BenchResult<A>,
    baseline: impl Fn() -> BenchResult<B>,
) -> BenchResult<BothOrders> {
    in_both_orders(|order| {
        let (mut ours, mut baseline) = order.create(&ours, &baseline)?;
        let plan = MeasurementCfg { seconds: seconds / 2.0, restart_after };
        measure(plan, &mut [&mut ours, &mut baseline])
    })
}

impl BothOrders {
    /// Mean rate of one side with `count` items per step \[1/s\].
    pub(crate) fn rate(&self, side: usize, count: usize) -> f64 {
        self.0.iter().map(|times| count as f64 / times.per_step(side)).sum::<f64>() / 2.0
    }

    /// Speed of `ours` relative to `baseline`: the geometric mean over both orders.
    pub(crate) fn ratio(&self, ours: usize, baseline: usize) -> f64 {
        self.mean_of(|t| t[baseline] / t[ours])
    }

    /// Geometric mean of [`Times::median_of`] over both orders, for ratios.
    pub(crate) fn mean_of(&self, number: impl Fn(&[f64]) -> f64) -> f64 {
        self.0.iter().map(|times| times.median_of(&number)).product::<f64>().sqrt()
    }
}

/// Measures all sides. After every round, outside of the timed part, their states must agree.
pub(crate) fn measure(plan: MeasurementCfg, sides: &mut [&mut dyn Contender]) -> BenchResult<Times> {
    let mut times = vec![Vec::new(); sides.len()];
    restart_all(sides)?;
    // The first round warms up and determines the number of steps per block.
    let mut steps = 1_u32;
    loop {
        let mut shortest = Duration::MAX;
        for side in sides.iter_mut() {
            shortest = shortest.min(side.block(steps)?);
        }
        if shortest >= SHORTEST_BLOCK || steps * 4 + 2 > plan.restart_after {
            break;
        }
        steps *= 2;
    }
    restart_all(sides)?;
    let processes: Vec<u32> = sides.iter().filter_map(|side| side.process()).collect();
    let start = Instant::now();
    let per_round = 2 * (steps + 1);
    let (mut done, mut quiet, mut measured) = (0, Vec::new(), 0.0);
    while quiet.iter().filter(|&&q| q).count() < FEWEST_ROUNDS || measured < plan.seconds {
        if start.elapsed().as_secs_f64() > PATIENCE * plan.seconds && quiet.len() >= FEWEST_ROUNDS {
            break;
        }
        let (begin, foreign_before) = (Instant::now(), other_load::seconds(&processes));
        let mut round = vec![Duration::ZERO; sides.len()];
        for (i, side) in sides.iter_mut().enumerate() {
            round[i] += warm_block(*side, steps)?;
        }
        for (i, side) in sides.iter_mut().enumerate().rev() {
            round[i] += warm_block(*side, steps)?;
        }
        for (side, time) in times.iter_mut().zip(round) {
            side.push(time.as_secs_f64() / f64::from(2 * steps));
        }
        let length = begin.elapsed().as_secs_f64();
        let foreign = other_load::seconds(&processes).zip(foreign_before).map_or(0.0, |(after, before)| after - before);
        quiet.push(foreign <= MAX_OTHER_LOAD * length);
        measured += if foreign <= MAX_OTHER_LOAD * length { length } else { 0.0 };
        done += per_round;
        same_physics(sides)?;
        if done + per_round > plan.restart_after {
            restart_all(sides)?;
            done = 0;
        }
    }
    let calm = quiet.iter().filter(|&&q| q).count();
    if calm >= FEWEST_ROUNDS {
        for side in &mut times {
            let mut counts = quiet.iter();
            side.retain(|_| counts.next() == Some(&true));
        }
    } else {
        eprintln!(
            "  note: the machine was busy in {} of {} rounds; all of them count",
            quiet.len() - calm,
            quiet.len()
        );
    }
    Ok(Times(times))
}

/// Runs a block after one untimed step. The step reloads the caches and wakes the threads, because the previous sides
/// have filled the caches with their data.
fn warm_block(side: &mut dyn Contender, steps: u32) -> BenchResult<Duration> {
    side.block(1)?;
    side.block(steps)
}

fn restart_all(sides: &mut [&mut dyn Contender]) -> BenchResult<()> {
    sides.iter_mut().try_for_each(|side| side.restart())
}

/// Checks that all sides are in the same state, bit by bit: they have done the same steps from the same starts.
fn same_physics(sides: &mut [&mut dyn Contender]) -> BenchResult<()> {
    let mut states = Vec::new();
    for side in sides.iter_mut() {
        states.extend(side.qpos()?);
    }
    if states.windows(2).all(|pair| pair[0] == pair[1]) {
        return Ok(());
    }
    Err("Kinetoscope and the baseline are in different states: they did different work".into())
}

/// Median; NaN for an empty list.
pub(crate) fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Sleeper(u64);

    impl Contender for Sleeper {
        fn restart(&mut self) -> BenchResult<()> {
            Ok(())
        }

        fn block(&mut self, steps: u32) -> BenchResult<Duration> {
            Ok(Duration::from_millis(self.0 * u64::from(steps)))
        }
    }

    #[test]
    fn ratio_of_times() {
        let (mut ours, mut baseline) = (Sleeper(20), Sleeper(10));
        let plan = MeasurementCfg { seconds: 0.0, restart_after: 100 };
        let times = measure(plan, &mut [&mut ours, &mut baseline]).expect("sleeps");
        assert!((times.ratio(0, 1) - 0.5).abs() < 1e-12);
        assert!((times.per_step(0) - 0.02).abs() < 1e-12);
    }

    #[test]
    fn creation_order_cancels_out() {
        // The side that is created first is twice as fast.
        let both = in_both_orders(|order| {
            let created = std::cell::Cell::new(0);
            let next = || {
                created.set(created.get() + 50);
                Ok(Sleeper(created.get()))
            };
            let (mut ours, mut baseline) = order.create(next, next)?;
            measure(MeasurementCfg { seconds: 0.0, restart_after: 100 }, &mut [&mut ours, &mut baseline])
        })
        .expect("sleeps");
        assert!((both.ratio(0, 1) - 1.0).abs() < 1e-12);
        assert!((both.rate(0, 3) - 3.0 * (20.0 + 10.0) / 2.0).abs() < 1e-9);
    }

    #[test]
    fn medians() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median(Vec::new()).is_nan());
    }
}
