//! Arguments with one row of numbers per environment, which are checked before anything is written.

use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list};
use ndarray::{ArrayView1, ArrayView2};

/// Expected layout of a table of numbers.
#[derive(Clone, Copy)]
pub(super) struct ArgumentSpec<'a> {
    /// Name of the method in errors.
    pub(super) argument: &'static str,
    /// Meaning of rows and columns, for errors.
    pub(super) meaning: &'static str,
    /// Number of columns.
    pub(super) columns: usize,
    /// Description of a column, such as `joint "elbow"`.
    pub(super) column_label: &'a dyn Fn(usize) -> String,
}

/// Kind of numbers that a table may contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum NumberKind {
    /// Finite numbers.
    Finite,
    /// Accelerations that MuJoCo accepts: its `mjMAXVAL` bounds them.
    Acceleration,
    /// Finite numbers that are not negative.
    Gain,
    /// Limits: numbers of at least 0, and infinity for no limit.
    Limit,
    /// Ends of a range: all numbers except NaN, infinite for no limit.
    RangeEnd,
}

impl NumberKind {
    fn allow(self, value: f64) -> bool {
        match self {
            Self::Finite => value.is_finite(),
            Self::Acceleration => value.abs() <= 1e10,
            Self::Gain => value.is_finite() && value >= 0.0,
            Self::Limit => value >= 0.0,
            Self::RangeEnd => !value.is_nan(),
        }
    }

    fn expected(self) -> &'static str {
        match self {
            Self::Finite => "finite",
            Self::Acceleration => "from -1e10 to 1e10, beyond which an acceleration counts as diverged",
            Self::Gain => "a finite number >= 0",
            Self::Limit => "a number >= 0, or infinite for no limit",
            Self::RangeEnd => "a number, or infinite for no limit",
        }
    }
}

/// Positions of the first repeated index in a list: first occurrence and repetition; `None` without a repetition.
fn first_repeat(chosen: &[usize]) -> Option<(usize, usize)> {
    let mut places = vec![None; chosen.iter().max().map_or(0, |most| most + 1)];
    chosen.iter().enumerate().find_map(|(second, &index)| places[index].replace(second).map(|first| (first, second)))
}

/// Rejects columns that are selected twice: it would be ambiguous which of them applies. `of` describes the item of a
/// column.
pub(super) fn check_unique_columns(
    argument: &'static str,
    chosen: &[usize],
    of: &dyn Fn(usize) -> String,
) -> Result<()> {
    match first_repeat(chosen) {
        Some((first, second)) => Err(Error::RepeatedColumn { argument, item: of(second), first, second }),
        None => Ok(()),
    }
}

/// Rejects repeated indices in a list of valid indices. `of` describes an index.
pub(super) fn check_unique_indices(
    argument: &'static str,
    chosen: &[usize],
    of: &dyn Fn(usize) -> String,
) -> Result<()> {
    match first_repeat(chosen) {
        Some((first, second)) => Err(Error::RepeatedItem { argument, item: of(chosen[second]), first, second }),
        None => Ok(()),
    }
}

/// Selected environments in the given order; all for `None`. A repeated environment is an error.
pub(crate) fn unique_envs(argument: &'static str, env_ids: Option<&[EnvId]>, num_envs: usize) -> Result<Vec<usize>> {
    let envs = env_list(env_ids, num_envs)?;
    if env_ids.is_some() {
        check_unique_indices(argument, &envs, &|env| format!("environment {env}"))?;
    }
    Ok(envs)
}

/// Checked table: every number is valid, every environment exists. Environments may repeat.
#[derive(Debug)]
pub(super) struct EnvRows<'v> {
    envs: Vec<usize>,
    values: ArrayView2<'v, f64>,
}

impl<'v> EnvRows<'v> {
    /// Checks finite `values`: a row for each of `env_ids` (`None` for all `num_envs` environments), or one row for all
    /// of them.
    pub(super) fn check(
        table: ArgumentSpec<'_>,
        values: ArrayView2<'v, f64>,
        env_ids: Option<&[EnvId]>,
        num_envs: usize,
    ) -> Result<Self> {
        Self::check_numbers(table, NumberKind::Finite, values, env_ids, num_envs)
    }

    /// Checks values like [`check`](Self::check), for numbers of another kind.
    pub(super) fn check_numbers(
        table: ArgumentSpec<'_>,
        numbers: NumberKind,
        values: ArrayView2<'v, f64>,
        env_ids: Option<&[EnvId]>,
        num_envs: usize,
    ) -> Result<Self> {
        let ArgumentSpec { argument, meaning, columns, column_label } = table;
        let envs = env_list(env_ids, num_envs)?;
        if values.ncols() != columns || (values.nrows() != envs.len() && values.nrows() != 1) {
            let (found, expected) = (values.shape().to_vec(), vec![envs.len(), columns]);
            return Err(Error::Shape { argument, found, expected, meaning });
        }
        if let Some(((row, column), &value)) = values.indexed_iter().find(|(_, v)| !numbers.allow(**v)) {
            let item = column_label(column);
            return Err(match numbers {
                NumberKind::Finite | NumberKind::Acceleration if !value.is_finite() => {
                    Error::NotFinite { argument, row, column, item, value }
                }
                _ => Error::OutOfRange { argument, row, column, item, value, expected: numbers.expected().into() },
            });
        }
        Ok(Self { envs, values })
    }

    /// Selected environments, in the given order.
    pub(super) fn envs(&self) -> &[usize] {
        &self.envs
    }

    /// Iterates over the environments with their rows.
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, ArrayView1<'_, f64>)> {
        let single = self.values.nrows() == 1;
        self.envs.iter().enumerate().map(move |(i, &env)| (env, self.values.row(if single { 0 } else { i })))
    }

    /// Iterates over the environments with their rows as arrays of `K` numbers.
    ///
    /// # Panics
    /// The table has fewer than `K` columns.
    pub(super) fn arrays<const K: usize>(&self) -> impl Iterator<Item = (usize, [f64; K])> {
        self.iter().map(|(env, row)| (env, std::array::from_fn(|k| row[k])))
    }
}
