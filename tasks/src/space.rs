//! Boxes of numbers that observations and actions are in.

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
    /// Columns with their bounds, lower and upper; infinite for none.
    ///
    /// # Errors
    /// Bounds that hold no number, or two columns of one name.
    pub fn new<N: Into<String>>(columns: impl IntoIterator<Item = (N, [f64; 2])>) -> Result<Self> {
        let mut space = Self { names: Vec::new(), low: Vec::new(), high: Vec::new() };
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

    /// Columns with the same bounds.
    ///
    /// # Errors
    /// As [`new`](Self::new).
    pub fn uniform<N: Into<String>>(names: impl IntoIterator<Item = N>, bounds: [f64; 2]) -> Result<Self> {
        Self::new(names.into_iter().map(|name| (name, bounds)))
    }

    /// Number of columns.
    pub fn len(&self) -> usize {
        self.names.len()
    }

    /// Whether there is no column.
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

    /// Place of the column called `name`.
    ///
    /// # Errors
    /// There is none; the error lists the nearest names.
    pub fn column(&self, name: &str) -> Result<usize> {
        let place = self.names.iter().position(|of| of == name);
        place.ok_or_else(|| EnvError::unknown("column", name, self.names.iter().map(String::as_str)))
    }

    /// Whether a row of numbers is in the space.
    pub fn contains(&self, row: ArrayView1<'_, f64>) -> bool {
        let mut bounds = self.low.iter().zip(&self.high);
        row.len() == self.len() && row.iter().all(|x| bounds.next().is_some_and(|(low, high)| low <= x && x <= high))
    }

    /// The number of a column that is nearest to `value`.
    pub(crate) fn clamp(&self, column: usize, value: f64) -> f64 {
        value.clamp(self.low[column], self.high[column])
    }

    /// Columns of several terms side by side, `term/column`.
    pub(crate) fn joined<'s>(parts: impl Iterator<Item = (&'s str, &'s Self)>) -> Self {
        let mut all = Self { names: Vec::new(), low: Vec::new(), high: Vec::new() };
        for (term, part) in parts {
            all.names.extend(part.names.iter().map(|name| format!("{term}/{name}")));
            all.low.extend(&part.low);
            all.high.extend(&part.high);
        }
        all
    }
}
