//! Distribution of the environments over several processes.

use serde::{Deserialize, Serialize};

/// Rank of this process and number of processes that simulate together. Each process has
/// [`num_envs`](crate::SimulationManagerCfg::num_envs) environments.
///
/// Environments are numbered over all processes: environment `i` of process `rank` has the global index
/// `rank * num_envs + i`. Random numbers of noise and properties are keyed by the global index, so two processes of
/// four environments give, bit for bit, the results of one process of eight. [`EnvId`](crate::EnvId) and `env_origins`
/// count the environments of one process.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shard {
    /// Rank of this process, from 0.
    pub rank: usize,
    /// Number of processes.
    pub world: usize,
}

impl Default for Shard {
    /// A single process: rank 0 of 1.
    fn default() -> Self {
        Self { rank: 0, world: 1 }
    }
}

/// Variables of launchers: rank of the process, number of processes. The innermost launcher comes first: `torchrun` in
/// a Slurm job sets its own variables beside those of the job.
const VARIABLES: [(&str, &str); 3] =
    [("RANK", "WORLD_SIZE"), ("OMPI_COMM_WORLD_RANK", "OMPI_COMM_WORLD_SIZE"), ("SLURM_PROCID", "SLURM_NTASKS")];

/// Variables that `srun` sets for the processes it starts. A shell of `salloc` has the job's number of processes
/// without being one of them, and an `sbatch` script runs once with rank 0.
const STARTED_BY_SRUN: [&str; 2] = ["SLURM_STEP_ID", "SLURM_PROCID"];

/// An error in the launcher's variables.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ShardError {
    /// One variable of a pair is missing.
    #[error("{present} is set, but {missing} is not; set both, or neither")]
    Incomplete {
        /// The variable that is set.
        present: &'static str,
        /// The variable that is missing.
        missing: &'static str,
    },
    /// A variable is not a number.
    #[error("{variable} is {value:?}; it must be a number such as 0 or 8")]
    NotANumber {
        /// Name of the variable.
        variable: &'static str,
        /// Value of the variable.
        value: String,
    },
    /// The rank is not below the number of processes.
    #[error(
        "{rank_variable} is {rank} and {world_variable} is {world}; the rank must be 0 to the number of processes - 1"
    )]
    OutOfRange {
        /// Name of the variable with the rank.
        rank_variable: &'static str,
        /// The rank.
        rank: usize,
        /// Name of the variable with the number of processes.
        world_variable: &'static str,
        /// The number of processes.
        world: usize,
    },
}

impl Shard {
    /// Rank and number of processes from the launcher's variables. Tried in this order: `RANK` and `WORLD_SIZE`
    /// (torchrun), `OMPI_COMM_WORLD_RANK` and `OMPI_COMM_WORLD_SIZE` (mpirun), `SLURM_PROCID` and `SLURM_NTASKS` (srun,
    /// only in a job step, which has `SLURM_STEP_ID`). The first complete pair is used; without any variable, this is
    /// the only process.
    ///
    /// # Errors
    /// A value of the first complete pair is not a number, or its rank is too large. Without a complete pair: one
    /// variable of a pair is set and the other is missing.
    pub fn from_env() -> Result<Self, ShardError> {
        Self::from_variables(|name| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned()))
    }

    fn from_variables(value: impl Fn(&str) -> Option<String>) -> Result<Self, ShardError> {
        let by_srun = STARTED_BY_SRUN.iter().all(|name| value(name).is_some());
        let mut incomplete = None;
        for (rank_variable, world_variable) in VARIABLES {
            if rank_variable == "SLURM_PROCID" && !by_srun {
                continue;
            }
            let number = |variable, value: String| match value.trim().parse::<usize>() {
                Ok(number) => Ok(number),
                Err(_) => Err(ShardError::NotANumber { variable, value }),
            };
            let (present, missing) = match (value(rank_variable), value(world_variable)) {
                (None, None) => continue,
                (Some(rank), Some(world)) => {
                    let (rank, world) = (number(rank_variable, rank)?, number(world_variable, world)?);
                    if rank >= world {
                        return Err(ShardError::OutOfRange { rank_variable, rank, world_variable, world });
                    }
                    return Ok(Self { rank, world });
                }
                (Some(_), None) => (rank_variable, world_variable),
                (None, Some(_)) => (world_variable, rank_variable),
            };
            incomplete = incomplete.or(Some(ShardError::Incomplete { present, missing }));
        }
        incomplete.map_or(Ok(Self::default()), Err)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(variables: &[(&str, &str)]) -> Result<Shard, ShardError> {
        Shard::from_variables(|name| variables.iter().find(|(n, _)| *n == name).map(|(_, value)| value.to_string()))
    }

    #[test]
    fn launchers() {
        type Case<'c> = (&'c str, &'c [(&'c str, &'c str)], [usize; 2]);
        let (mpi_rank, mpi_world) = VARIABLES[1];
        let step = ("SLURM_STEP_ID", "0");
        let srun = [step, ("SLURM_PROCID", "1"), ("SLURM_NTASKS", "2")];
        let torchrun_in_job = [&srun[..], &[("RANK", "5"), ("WORLD_SIZE", "16")]].concat();
        let srun_and_halves = [&[("WORLD_SIZE", "9"), (mpi_rank, "7")], &srun[..]].concat();
        let cases: [Case<'_>; 11] = [
            ("no launcher", &[], [0, 1]),
            ("torchrun", &[("RANK", "3"), ("WORLD_SIZE", "8")], [3, 8]),
            ("mpirun", &[(mpi_rank, "3"), (mpi_world, "8")], [3, 8]),
            ("srun", &[("SLURM_STEP_ID", "0"), ("SLURM_PROCID", "3"), ("SLURM_NTASKS", "8")], [3, 8]),
            ("a shell of salloc", &[("SLURM_JOB_ID", "17"), ("SLURM_NTASKS", "8")], [0, 1]),
            ("the script of sbatch", &[("SLURM_PROCID", "0"), ("SLURM_NTASKS", "8")], [0, 1]),
            ("a step without a process", &[("SLURM_STEP_ID", "0"), ("SLURM_NTASKS", "8")], [0, 1]),
            ("torchrun in a job of two nodes", &torchrun_in_job, [5, 16]),
            ("mpirun in the script of sbatch", &[("SLURM_NTASKS", "8"), (mpi_rank, "1"), (mpi_world, "4")], [1, 4]),
            ("mpirun, and half of another", &[("RANK", "5"), (mpi_rank, "1"), (mpi_world, "4")], [1, 4]),
            ("srun, and halves of two others", &srun_and_halves, [1, 2]),
        ];
        for (who, variables, [rank, world]) in cases {
            assert_eq!(of(variables), Ok(Shard { rank, world }), "{who}");
        }
    }

    #[test]
    fn errors() {
        let step = ("SLURM_STEP_ID", "0");
        for (rank, world) in VARIABLES {
            assert_eq!(of(&[step, (rank, "3")]), Err(ShardError::Incomplete { present: rank, missing: world }));
            if rank != "SLURM_PROCID" {
                assert_eq!(of(&[(world, "3")]), Err(ShardError::Incomplete { present: world, missing: rank }));
            }
            let none = ShardError::NotANumber { variable: rank, value: "-1".into() };
            assert_eq!(of(&[step, (rank, "-1"), (world, "2")]), Err(none));
            for (r, w) in [("2", "2"), ("0", "0")] {
                let error = of(&[step, (rank, r), (world, w)]).expect_err("out of range");
                assert!(matches!(error, ShardError::OutOfRange { .. }), "{error}");
                assert!(error.to_string().contains(rank) && error.to_string().contains(world), "{error}");
            }
        }
        // The first incomplete pair is reported.
        let first = ShardError::Incomplete { present: "RANK", missing: "WORLD_SIZE" };
        assert_eq!(of(&[("OMPI_COMM_WORLD_SIZE", "4"), ("RANK", "3")]), Err(first));
    }
}
