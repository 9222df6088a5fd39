//! Rows of numbers that a user gives, one for each environment: checked before anything is written.

use crate::error::{Error, Result};
use crate::manager::{EnvId, env_list};
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

/// Refuses lists that choose something twice: which of its columns would hold is nobody's to guess.
pub(super) fn check_distinct(argument: &'static str, chosen: &[usize], of: &dyn Fn(usize) -> String) -> Result<()> {
    let mut columns = vec![None; chosen.iter().max().map_or(0, |most| most + 1)];
    for (second, &index) in chosen.iter().enumerate() {
        if let Some(first) = columns[index].replace(second) {
            return Err(Error::RepeatedColumn { argument, of: of(second), first, second });
        }
    }
    Ok(())
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
        let Table { argument, meaning, columns, of } = table;
        let envs = env_list(env_ids, num_envs)?;
        if values.ncols() != columns || (values.nrows() != envs.len() && values.nrows() != 1) {
            let (found, expected) = (values.shape().to_vec(), vec![envs.len(), columns]);
            return Err(Error::Shape { argument, found, expected, meaning });
        }
        if let Some(((row, column), &value)) = values.indexed_iter().find(|(_, v)| !v.is_finite()) {
            return Err(Error::NotFinite { argument, row, column, of: of(column), value });
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
