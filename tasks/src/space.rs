//! Spaces of observations and actions.

use crate::error::{EnvError, Result};
use ndarray::ArrayView1;

/// Named columns with bounds, the same for every environment: Gymnasium's `Box` with one axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Space {
    names: Vec<String>,
    low: Vec<f64>,
    high: Vec<f64>,
}

impl Space {
    /// Creates a space from columns and their bounds \[low, high\]; use infinities for no bound.
    ///
    /// # Errors
    /// The bounds of a column contain no finite number, or two columns have the same name.
    pub fn new<N: Into<String>>(columns: impl IntoIterator<Item = (N, [f64; 2])>) -> Result<Self> {
        let mut space = Self::empty();
        for (name, [low, high]) in columns {
            let column = name.into();
            let holds_a_number = low <= high && low < f64::INFINITY && high > f64::NEG_INFINITY;
            if !holds_a_number {
                return Err(EnvError::Bounds { column, low, high });
            }
            if space.names.contains(&column) {
                return Err(EnvError::RepeatedColumn { column });
            }
            space.names.push(column);
            space.low.push(low);
            space.high.push(high);
        }
        Ok(space)
    }

    /// Creates a space whose columns all have the same bounds.
    ///
    /// # Errors
    /// The same as [`new`](Self::new).
    pub fn uniform<N: Into<String>>(names: impl IntoIterator<Item = N>, bounds: [f64; 2]) -> Result<Self> {
        Self::new(names.into_iter().map(|name| (name, bounds)))
    }

    /// A space without columns.
    pub(crate) fn empty() -> Self {
        Self { names: Vec::new(), low: Vec::new(), high: Vec::new() }
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// True if there is no column.
    pub fn is_empty(&self) -> bool {
        self.names.is_empty()
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Lower bounds of the columns.
    pub fn low(&self) -> &[f64] {
        &self.low
    }

    /// Upper bounds of the columns.
    pub fn high(&self) -> &[f64] {
        &self.high
    }

    /// Index of the column called `name`.
    ///
    /// # Errors
    /// There is no such column; the error lists the nearest names.
    pub fn column_index(&self, name: &str) -> Result<usize> {
        let place = self.names.iter().position(|of| of == name);
        place.ok_or_else(|| EnvError::unknown("column", name, self.names.iter().map(String::as_str)))
    }

    /// True if a row has as many numbers as there are columns, and each is within its bounds. NaN is outside of all
    /// bounds.
    pub fn contains(&self, row: ArrayView1<'_, f64>) -> bool {
        let mut bounds = self.low.iter().zip(&self.high);
        row.len() == self.len() && row.iter().all(|x| bounds.next().is_some_and(|(low, high)| low <= x && x <= high))
    }

    /// Clamps `value` to the bounds of a column.
    pub(crate) fn clamp(&self, column: usize, value: f64) -> f64 {
        value.clamp(self.low[column], self.high[column])
    }

    /// Concatenates the columns of several terms, named `term/column`.
    pub(crate) fn concatenate<'s>(spaces: impl Iterator<Item = (&'s str, &'s Self)>) -> Self {
        let mut all = Self::empty();
        for (term, part) in spaces {
            all.names.extend(part.names.iter().map(|name| format!("{term}/{name}")));
            all.low.extend(&part.low);
            all.high.extend(&part.high);
        }
        all
    }
}
