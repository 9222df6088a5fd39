//! Time for which an idle worker spins before it sleeps.

/// Number of times an idle worker polls for a job before it sleeps.
///
/// A loop of short jobs finds its workers awake; a caller that paces its jobs leaves its cores to others. A worker that
/// polled in vain polls half as long the next time, and a 64th longer where a job came.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Patience(u32);

impl Patience {
    /// About a millisecond, on processors whose pause instruction takes 140 cycles; less on others.
    pub(crate) const LONGEST: Self = Self(20_000);
    /// The gap between the jobs of one step.
    const SHORTEST: Self = Self(500);

    /// Number of polls.
    pub(crate) fn spins(self) -> u32 {
        self.0
    }

    /// The patience after a wait that ended with a job, or without one.
    pub(crate) fn after(self, job_came: bool) -> Self {
        let next = if job_came { self.0 + self.0 / 64 + 1 } else { self.0 / 2 };
        Self(next.clamp(Self::SHORTEST.0, Self::LONGEST.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follows_the_gaps() {
        let after = |came: &[bool]| came.iter().fold(Patience::LONGEST, |patience, &came| patience.after(came));
        assert_eq!(after(&[true; 100]), Patience::LONGEST);
        for jobs in [0, 1, 3, 8, 32] {
            // Some jobs, then a pause, again and again.
            let paced = [vec![true; jobs], vec![false]].concat().repeat(100);
            assert!(after(&paced).spins() < 2 * Patience::SHORTEST.spins(), "{jobs}: {:?}", after(&paced));
            // Back at full speed.
            assert_eq!(after(&[paced, vec![true; 300]].concat()), Patience::LONGEST);
        }
    }
}
