//! Time for which an idle worker spins before it sleeps.

/// Number of times an idle worker polls for a job before it sleeps.
///
/// A worker stays awake in a loop of short jobs, and frees its core between paced jobs. The number is halved after a
/// wait without a job, and grows by 1/64 after a wait that ended with a job.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct SpinLimit(u32);

impl SpinLimit {
    /// Largest limit: about 1 ms on processors whose pause instruction takes 140 cycles, less on others.
    pub(crate) const MAX: Self = Self(20_000);
    /// Smallest limit: covers the gap between the jobs of one simulation step.
    const MIN: Self = Self(500);

    /// Number of polls.
    pub(crate) fn spins(self) -> u32 {
        self.0
    }

    /// Returns the limit for the next wait. `job_came` is true if the last wait ended with a job.
    pub(crate) fn next(self, job_came: bool) -> Self {
        let next = if job_came { self.0 + self.0 / 64 + 1 } else { self.0 / 2 };
        Self(next.clamp(Self::MIN.0, Self::MAX.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_the_gaps() {
        let after = |came: &[bool]| came.iter().fold(SpinLimit::MAX, |patience, &came| patience.next(came));
        assert_eq!(after(&[true; 100]), SpinLimit::MAX);
        for jobs in [0, 1, 3, 8, 32] {
            // Repeated bursts of jobs, each followed by a pause.
            let paced = [vec![true; jobs], vec![false]].concat().repeat(100);
            assert!(after(&paced).spins() < 2 * SpinLimit::MIN.spins(), "{jobs}: {:?}", after(&paced));
            // A steady stream of jobs restores the longest patience.
            assert_eq!(after(&[paced, vec![true; 300]].concat()), SpinLimit::MAX);
        }
    }
}
