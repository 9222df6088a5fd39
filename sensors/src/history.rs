//! Histories of measurements per environment, newest first.

use ndarray::{Array3, ArrayView1, ArrayView2, ArrayView3, Axis};

/// Rows of values, newest first, per environment.
///
/// All memory is allocated at construction. Environments measure at their own times, so each has its own fill level;
/// rows that are not filled yet are `T::default()`. Each measurement moves older rows by one, so the whole history is
/// one plain array view. A ring buffer would save the move (a few hundred bytes) but could not be viewed as an array.
#[derive(Clone, Debug)]
pub struct History<T> {
    rows: Array3<T>,
    filled: Vec<usize>,
}

impl<T: Copy + Default> History<T> {
    /// Allocates `length` rows of `width` numbers in each of `num_envs` environments. A length of 0 stores nothing.
    pub fn new(num_envs: usize, length: usize, width: usize) -> Self {
        Self::filled_with(num_envs, length, width, T::default())
    }

    /// Adds the newest row of environment `env`; a full history drops its oldest row.
    ///
    /// # Panics
    ///
    /// If the environment does not exist, or if the length of `row` is not the width of the history.
    #[track_caller]
    pub fn push(&mut self, env: usize, row: &[T]) {
        let (_, length, width) = self.rows.dim();
        assert_eq!(row.len(), width, "a row of the history");
        let mut rows = self.rows.index_axis_mut(Axis(0), env);
        let Some(flat) = rows.as_slice_mut().filter(|_| length > 0) else {
            return;
        };
        flat.copy_within(..(length - 1) * width, width);
        flat[..width].copy_from_slice(row);
        self.filled[env] = length.min(self.filled[env] + 1);
    }

    /// Clears the rows of environment `env`.
    ///
    /// # Panics
    ///
    /// If the environment does not exist.
    #[track_caller]
    pub fn reset(&mut self, env: usize) {
        self.rows.index_axis_mut(Axis(0), env).fill(T::default());
        self.filled[env] = 0;
    }
}

impl<T: Clone> History<T> {
    /// Allocates rows as [`new`](Self::new), filled with `value`.
    pub(crate) fn filled_with(num_envs: usize, length: usize, width: usize, value: T) -> Self {
        Self { rows: Array3::from_elem((num_envs, length, width), value), filled: vec![0; num_envs] }
    }

    /// Returns the newest row of environment `env` for writing. The row holds the values of the dropped row. `None` for
    /// a history of length 0.
    #[track_caller]
    pub(crate) fn push_reused(&mut self, env: usize) -> Option<&mut [T]> {
        let (_, length, width) = self.rows.dim();
        let flat = self.rows.index_axis_mut(Axis(0), env).into_slice().filter(|_| length > 0)?;
        flat.rotate_right(width);
        self.filled[env] = length.min(self.filled[env] + 1);
        Some(&mut flat[..width])
    }

    /// Returns the row of environment `env` that is `age` measurements old, as a slice; `None` if the history is
    /// shorter.
    #[track_caller]
    pub(crate) fn slice(&self, env: usize, age: usize) -> Option<&[T]> {
        let (_, length, width) = self.rows.dim();
        let first = (env * length + age) * width;
        self.rows.as_slice()?.get(first..first + width).filter(|_| age < self.filled[env])
    }

    /// Marks the rows of environment `env` as not filled. [`view`](Self::view) still shows their values until
    /// [`push_reused`](Self::push_reused) overwrites them.
    #[track_caller]
    pub(crate) fn clear(&mut self, env: usize) {
        self.filled[env] = 0;
    }

    /// All rows, newest first, shape \[num_envs, length, width\]. Rows that are not filled yet have the default value.
    pub fn view(&self) -> ArrayView3<'_, T> {
        self.rows.view()
    }

    /// The filled rows of environment `env`, newest first, shape \[filled, width\].
    ///
    /// # Panics
    ///
    /// If the environment does not exist.
    #[track_caller]
    pub fn env(&self, env: usize) -> ArrayView2<'_, T> {
        self.rows.index_axis(Axis(0), env).split_at(Axis(0), self.filled[env]).0
    }

    /// The row of environment `env` that is `age` measurements old (0 is the newest); `None` if that row is not filled
    /// or does not exist.
    ///
    /// # Panics
    ///
    /// If the environment does not exist.
    #[track_caller]
    pub fn row(&self, env: usize, age: usize) -> Option<ArrayView1<'_, T>> {
        (age < self.filled[env]).then(|| self.rows.index_axis(Axis(0), env).index_axis_move(Axis(0), age))
    }

    /// Number of filled rows of environment `env`.
    ///
    /// # Panics
    ///
    /// If the environment does not exist.
    #[track_caller]
    pub fn filled(&self, env: usize) -> usize {
        self.filled[env]
    }

    /// Number of rows per environment.
    pub fn length(&self) -> usize {
        self.rows.dim().1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use ndarray::array;

    /// The newest row comes first and the oldest is dropped. A reset clears one environment. The memory address stays
    /// the same.
    #[test]
    fn rows() {
        let mut h = History::new(2, 3, 2);
        let memory = h.view().as_ptr();
        (1..=4).for_each(|k| h.push(0, &[f64::from(k), -f64::from(k)]));
        h.push(1, &[9.0, 9.0]);
        assert_eq!(h.env(0), array![[4.0, -4.0], [3.0, -3.0], [2.0, -2.0]]);
        assert_eq!(h.env(1), array![[9.0, 9.0]]);
        assert_eq!(h.view().dim(), (2, 3, 2));
        assert_eq!(h.view().index_axis(Axis(0), 1).split_at(Axis(0), 1).1, array![[0.0, 0.0], [0.0, 0.0]]);
        assert_eq!((h.row(0, 2).unwrap(), h.row(1, 1)), (array![2.0, -2.0].view(), None));
        assert_eq!((h.filled(0), h.filled(1), h.length()), (3, 1, 3));
        h.reset(0);
        assert_eq!((h.filled(0), h.filled(1)), (0, 1));
        assert!(h.view().index_axis(Axis(0), 0).iter().all(|x| *x == 0.0) && h.env(1) == array![[9.0, 9.0]]);
        (0..1000).for_each(|k| h.push(0, &[f64::from(k); 2]));
        h.reset(0);
        assert_eq!(h.view().as_ptr(), memory);
    }

    #[test]
    fn empty() {
        let mut h = History::new(2, 0, 3);
        h.push(1, &[1.0, 2.0, 3.0]);
        assert_eq!((h.filled(1), h.env(1).dim()), (0, (0, 3)));
        let mut h = History::new(1, 2, 0);
        h.push(0, &[] as &[f64]);
        assert_eq!(h.view().dim(), (1, 2, 0));
    }
}
