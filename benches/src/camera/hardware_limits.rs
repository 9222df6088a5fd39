//! Hardware limits of this machine: loops that only copy memory, and loops that only compute.

use crate::interleave::Contender;
use crate::settings::BenchResult;
use std::hint::black_box;
use std::time::{Duration, Instant};

/// Copies a buffer larger than the caches, on several threads.
pub(super) struct CopyLoop(Vec<(Vec<u64>, Vec<u64>)>);

impl CopyLoop {
    /// Bytes written in a step.
    pub(super) const BYTES: usize = 64 << 20;

    pub(super) fn new(threads: usize) -> Self {
        let share = Self::BYTES / threads / size_of::<u64>();
        Self((0..threads).map(|t| (vec![t as u64 + 1; share], vec![0; share])).collect())
    }
}

impl Contender for CopyLoop {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let start = Instant::now();
        std::thread::scope(|scope| {
            for (from, to) in &mut self.0 {
                scope.spawn(move || (0..steps).for_each(|_| to.copy_from_slice(black_box(from))));
            }
        });
        Ok(start.elapsed())
    }
}

/// Computes in registers: a fixed amount of work shared by several threads.
pub(super) struct ComputeLoop(u64);

impl ComputeLoop {
    const ROUNDS: u64 = 60_000_000;

    pub(super) fn new(threads: u64) -> Self {
        Self(threads)
    }
}

impl Contender for ComputeLoop {
    fn restart(&mut self) -> BenchResult<()> {
        Ok(())
    }

    fn block(&mut self, steps: u32) -> BenchResult<Duration> {
        let rounds = u64::from(steps) * Self::ROUNDS / self.0;
        let compute = move || {
            let mut x = black_box(1_u64);
            for _ in 0..rounds {
                x = x.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1);
            }
            black_box(x)
        };
        let start = Instant::now();
        std::thread::scope(|scope| {
            for _ in 1..self.0 {
                scope.spawn(compute);
            }
            compute();
        });
        Ok(start.elapsed())
    }
}
