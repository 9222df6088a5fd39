//! Rows of the environments of a camera.

use super::error::CameraError;
use crate::error::SensorError;

/// Environments of a camera: one row of its arrays for each.
#[derive(Clone, Debug)]
pub struct EnvRows {
    env_ids: Vec<usize>,
    /// Row of each environment of the simulation; the inverse of `env_ids`.
    row_of_env: Vec<Option<usize>>,
}

impl EnvRows {
    /// Creates the rows of the environments `env_ids`, out of `num_envs`; `None` is all environments.
    ///
    /// # Errors
    ///
    /// [`CameraError::NoEnvironments`], an environment that does not exist or that is named twice.
    pub(crate) fn new(env_ids: Option<&[usize]>, num_envs: usize) -> Result<Self, SensorError> {
        let env_ids = env_ids.map_or_else(|| (0..num_envs).collect(), <[usize]>::to_vec);
        if env_ids.is_empty() {
            return Err(CameraError::NoEnvironments.into());
        }
        let mut row_of_env = vec![None; num_envs];
        for (row, &env) in env_ids.iter().enumerate() {
            let Some(known) = row_of_env.get_mut(env) else {
                return Err(SensorError::IndexOutOfRange { what: "environment", index: env, count: num_envs });
            };
            if known.replace(row).is_some() {
                return Err(CameraError::DuplicateEnvironment { env }.into());
            }
        }
        Ok(Self { env_ids, row_of_env })
    }

    /// Creates a row for every environment.
    pub(crate) fn for_all(num_envs: usize) -> Self {
        Self { env_ids: (0..num_envs).collect(), row_of_env: (0..num_envs).map(Some).collect() }
    }

    /// Number of rows.
    pub(crate) fn len(&self) -> usize {
        self.env_ids.len()
    }

    /// Number of environments of the simulation.
    pub(crate) fn num_envs(&self) -> usize {
        self.row_of_env.len()
    }

    /// Environments, row by row.
    pub(crate) fn env_ids(&self) -> &[usize] {
        &self.env_ids
    }

    /// Row of an environment; `None` if the camera does not see the environment.
    pub(crate) fn of(&self, env: usize) -> Option<usize> {
        self.row_of_env.get(env).copied().flatten()
    }

    /// Row of an environment.
    ///
    /// # Errors
    ///
    /// An environment that does not exist or that the camera does not see.
    pub(crate) fn row(&self, env: usize) -> Result<usize, SensorError> {
        self.must_exist(&[env])?;
        Ok(self.of(env).ok_or_else(|| CameraError::NotSeen { env, seen: self.env_ids.clone() })?)
    }

    /// Rows of the given environments, each at most once; `None` is all rows.
    ///
    /// # Errors
    ///
    /// Same as [`row`](Self::row), and [`CameraError::DuplicateEnvironment`].
    pub(crate) fn selected_rows(&self, env_ids: Option<&[usize]>) -> Result<Vec<usize>, SensorError> {
        let Some(env_ids) = env_ids else { return Ok((0..self.len()).collect()) };
        let mut taken = vec![false; self.len()];
        let mut rows = Vec::with_capacity(env_ids.len());
        for &env in env_ids {
            let row = self.row(env)?;
            if std::mem::replace(&mut taken[row], true) {
                return Err(CameraError::DuplicateEnvironment { env }.into());
            }
            rows.push(row);
        }
        Ok(rows)
    }

    /// Rows of the given environments, without those that the camera does not see.
    ///
    /// # Errors
    ///
    /// An environment that does not exist.
    pub(crate) fn visible_rows(&self, env_ids: &[usize]) -> Result<Vec<usize>, SensorError> {
        self.must_exist(env_ids)?;
        Ok(env_ids.iter().filter_map(|&env| self.of(env)).collect())
    }

    fn must_exist(&self, env_ids: &[usize]) -> Result<(), SensorError> {
        let count = self.num_envs();
        match env_ids.iter().find(|&&env| env >= count) {
            Some(&index) => Err(SensorError::IndexOutOfRange { what: "environment", index, count }),
            None => Ok(()),
        }
    }
}
