//! Which part of the environments this process has, where several processes simulate together.

use serde::{Deserialize, Serialize};

/// One of several processes that simulate together, each with as many environments as
/// [`num_envs`](crate::SimulationManagerCfg::num_envs) says.
///
/// Environments are counted over all processes: environment `i` of process `rank` is number `rank * num_envs + i`, its global
/// index. Random numbers, of noise and of properties, are keyed by that, so that two processes of four environments
/// give, bit for bit, what one of eight gives. [`EnvId`](crate::EnvId) counts the environments of one process, and so do
/// `env_origins` and everything else.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shard {
    /// Number of this process, from 0.
    pub rank: usize,
    /// Number of processes.
    pub world: usize,
}

impl Default for Shard {
    /// The only process.
    fn default() -> Self {
        Self { rank: 0, world: 1 }
    }
}

/// Environment variables that launchers set: number of the process, number of processes. What launches the innermost
/// process comes first: `torchrun` inside of a Slurm job sets its own beside those of the job.
const VARIABLES: [(&str, &str); 3] =
    [("RANK", "WORLD_SIZE"), ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("SLURM_PROCID", "SLURM_NTASKS")];

/// The variables of a launcher say nothing sensible.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShardError {
    /// One variable of a pair is missing.
    #[error("{present} is set, but {missing} is not; set both, or neither")]
    Incomplete {
        /// The one that is set.
        present: &'static str,
        /// The one that is not.
        missing: &'static str,
    },
    /// A variable is not a number.
    #[error("{variable} is {value:?}; it must be a number such as 0 or 8")]
    NotANumber {
        /// The variable.
        variable: &'static str,
        /// Its value.
        value: String,
    },
    /// The number of the process is not below the number of processes.
    #[error(
        "{rank_variable} is {rank} and {world_variable} is {world}; the rank must be 0 to the number of processes - 1"
    )]
    OutOfRange {
        /// The variable of the rank.
        rank_variable: &'static str,
        /// The rank.
        rank: usize,
        /// The variable of the number of processes.
        world_variable: &'static str,
        /// The number of processes.
        world: usize,
    },
}

impl Shard {
    /// What the launcher of this process says: `RANK` and `WORLD_SIZE` (torchrun), else `OMPI_COMM_WORLD_RANK` and
    /// `OMPI_COMM_WORLD_SIZE` (mpirun), else `SLURM_PROCID` and `SLURM_NTASKS` (srun); the only process where none is set.
    ///
    /// # Errors
    /// Of the first pair of which one is set: the other is missing, one is not a number, or the rank is too large.
    pub fn from_env() -> Result<Self, ShardError> {
        Self::from_variables(|name| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned()))
    }

    fn from_variables(value: impl Fn(&str) -> Option<String>) -> Result<Self, ShardError> {
        for (rank_variable, world_variable) in VARIABLES {
            let number = |variable, value: String| match value.trim().parse::<usize>() {
                Ok(number) => Ok(number),
                Err(_) => Err(ShardError::NotANumber { variable, value }),
            };
            let (rank, world) = match (value(rank_variable), value(world_variable)) {
                (None, None) => continue,
                (Some(rank), Some(world)) => (number(rank_variable, rank)?, number(world_variable, world)?),
                (Some(_), None) => {
                    return Err(ShardError::Incomplete { present: rank_variable, missing: world_variable });
                }
                (None, Some(_)) => {
                    return Err(ShardError::Incomplete { present: world_variable, missing: rank_variable });
                }
            };
            if rank >= world {
                return Err(ShardError::OutOfRange { rank_variable, rank, world_variable, world });
            }
            return Ok(Self { rank, world });
        }
        Ok(Self::default())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(variables: &[(&str, &str)]) -> Result<Shard, ShardError> {
        Shard::from_variables(|name| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| value.to_string()))
    }

    #[test]
    fn every_launcher_is_understood() {
        assert_eq!(of(&[]), Ok(Shard { rank: 0, world: 1 }));
        for (rank, world) in VARIABLES {
            assert_eq!(of(&[(rank, "3"), (world, "8")]), Ok(Shard { rank: 3, world: 8 }));
        }
        // torchrun in a job of two nodes.
        let nested = [("SLURM_PROCID", "1"), ("SLURM_NTASKS", "2"), ("RANK", "5"), ("WORLD_SIZE", "16")];
        assert_eq!(of(&nested), Ok(Shard { rank: 5, world: 16 }));
    }

    #[test]
    fn what_does_not_fit_together_is_named() {
        for (rank, world) in VARIABLES {
            assert_eq!(of(&[(rank, "3")]), Err(ShardError::Incomplete { present: rank, missing: world }));
            assert_eq!(of(&[(world, "3")]), Err(ShardError::Incomplete { present: world, missing: rank }));
            let none = ShardError::NotANumber { variable: rank, value: "-1".into() };
            assert_eq!(of(&[(rank, "-1"), (world, "2")]), Err(none));
            for (r, w) in [("2", "2"), ("0", "0")] {
                let error = of(&[(rank, r), (world, w)]).expect_err("out of range");
                assert!(matches!(error, ShardError::OutOfRange { .. }), "{error}");
                assert!(error.to_string().contains(rank) && error.to_string().contains(world), "{error}");
            }
        }
    }
}
