//! Rows of numbers that a user gives, one for each environment: checked before anything is written.

use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list};
use ndarray::{ArrayView1, ArrayView2};

/// What a table of numbers must look like.
#[derive(Clone, Copy)]
pub(super) struct Table<'a> {
    /// The method, as errors call it.
    pub(super) argument: &'static str,
    /// What rows and columns are.
    pub(super) meaning: &'static str,
    /// Number of columns.
    pub(super) columns: usize,
    /// What a column is of, such as `joint "elbow"`.
    pub(super) of: &'a dyn Fn(usize) -> String,
}

/// Which numbers a table may have.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Numbers {
    /// Finite ones.
    Finite,
    /// Those that MuJoCo goes on with as accelerations: its `mjMAXVAL` bounds them.
    Acceleration,
    /// Finite ones that are not negative.
    Gain,
    /// Numbers above or at 0, and infinity for no limit.
    Limit,
    /// All but NaN: infinite where there is no end.
    End,
}

impl Numbers {
    fn allow(self, value: f64) -> bool {
        match self {
            Self::Finite => value.is_finite(),
            Self::Acceleration => value.abs() <= 1e10,
            Self::Gain => value.is_finite() && value >= 0.0,
            Self::Limit => value >= 0.0,
            Self::End => !value.is_nan(),
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::Acceleration => "from -1e10 to 1e10, beyond which an acceleration counts as diverged",
            Self::Gain => "a finite number >= 0",
            Self::Limit => "a number >= 0, or infinite for no limit",
            Self::End => "a number, or infinite for no limit",
        }
    }
}

/// The two places of the first thing that a list of indices has twice.
fn first_repeat(chosen: &[usize]) -> Option<(usize, usize)> {
    let mut places = vec![None; chosen.iter().max().map_or(0, |most| most + 1)];
    chosen.iter().enumerate().find_map(|(second, &index)| places[index].replace(second).map(|first| (first, second)))
}

/// Refuses lists that choose something twice: which of its columns would hold is nobody's to guess.
pub(super) fn check_distinct(argument: &'static str, chosen: &[usize], of: &dyn Fn(usize) -> String) -> Result<()> {
    match first_repeat(chosen) {
        Some((first, second)) => Err(Error::RepeatedColumn { argument, of: of(second), first, second }),
        None => Ok(()),
    }
}

/// Refuses lists of indices, known to exist, that name something twice; `of` says what an index is of.
pub(super) fn check_named_once(argument: &'static str, chosen: &[usize], of: &dyn Fn(usize) -> String) -> Result<()> {
    match first_repeat(chosen) {
        Some((first, second)) => Err(Error::Repeated { argument, of: of(chosen[second]), first, second }),
        None => Ok(()),
    }
}

/// The environments that are meant, each once.
pub(super) fn distinct_envs(argument: &'static str, env_ids: Option<&[EnvId]>, num_envs: usize) -> Result<Vec<usize>> {
    let envs = env_list(env_ids, num_envs)?;
    if env_ids.is_some() {
        check_named_once(argument, &envs, &|env| format!("environment {env}"))?;
    }
    Ok(envs)
}

/// A checked table: every number is finite, every environment exists.
#[derive(Debug)]
pub(super) struct Rows<'v> {
    envs: Vec<usize>,
    values: ArrayView2<'v, f64>,
}

impl<'v> Rows<'v> {
    /// Checks `values`: a row for each of `env_ids` (all `num_envs` where `None`), or one row for all of them.
    pub(super) fn check(
        table: Table<'_>,
        values: ArrayView2<'v, f64>,
        env_ids: Option<&[EnvId]>,
        num_envs: usize,
    ) -> Result<Self> {
        Self::check_numbers(table, Numbers::Finite, values, env_ids, num_envs)
    }

    /// As [`check`](Self::check), of numbers of another kind.
    pub(super) fn check_numbers(
        table: Table<'_>,
        numbers: Numbers,
        values: ArrayView2<'v, f64>,
        env_ids: Option<&[EnvId]>,
        num_envs: usize,
    ) -> Result<Self> {
        let Table { argument, meaning, columns, of } = table;
        let envs = env_list(env_ids, num_envs)?;
        if values.ncols() != columns || (values.nrows() != envs.len() && values.nrows() != 1) {
            let (found, expected) = (values.shape().to_vec(), vec![envs.len(), columns]);
            return Err(Error::Shape { argument, found, expected, meaning });
        }
        if let Some(((row, column), &value)) = values.indexed_iter().find(|(_, v)| !numbers.allow(**v)) {
            let of = of(column);
            return Err(match numbers {
                Numbers::Finite | Numbers::Acceleration if !value.is_finite() => {
                    Error::NotFinite { argument, row, column, of, value }
                }
                _ => Error::OutOfRange { argument, row, column, of, value, expected: numbers.expected().into() },
            });
        }
        Ok(Self { envs, values })
    }

    /// The environments, in the order given.
    pub(super) fn envs(&self) -> &[usize] {
        &self.envs
    }

    /// Each environment with its row.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, ArrayView1<'_, f64>)> {
        let single = self.values.nrows() == 1;
        self.envs.iter().enumerate().map(move |(i, &env)| (env, self.values.row(if single { 0 } else { i })))
    }

    /// Each environment with its row of `K` numbers.
    ///
    /// # Panics
    /// The table has not `K` columns.
    pub(super) fn arrays<const K: usize>(&self) -> impl Iterator<Item = (usize, [f64; K])> {
        self.iter().map(|(env, row)| (env, std::array::from_fn(|k| row[k])))
    }
}
