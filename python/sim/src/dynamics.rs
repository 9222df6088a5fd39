//! Mass matrices and gravity torques of robots in a simulation.

use crate::arguments::{array, envs};
use crate::errors::Failure;
use crate::robot::Robot;
use kinetoscope::nalgebra::{DMatrix, DVector};
use kinetoscope::ndarray::{Array2, Array3, Ix2};
use kinetoscope::robot::dynamics::{Configuration, Dynamics, MimicPositions};
use kinetoscope::scene::pose::from_row;
use kinetoscope::sim::{EnvId, Error, SimulationManager};
use numpy::IntoPyArray;
use pyo3::prelude::*;

#[pymethods]
impl Robot {
    /// Joint-space inertia at joint positions, by default the current ones [kg m², kg m or kg], rotor inertias included,
    /// shape (num_envs, columns, columns). Columns are the joints; a floating base comes before them with six: the velocity
    /// of its origin in the axes of the environment, then its angular velocity in its own axes. Masses are those of the
    /// files and payloads, without changes by ``set_property`` or ``randomize``.
    #[pyo3(signature = (qpos=None, env_ids=None))]
    fn mass_matrix<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (qpos, env_ids) = (positions(qpos, "mass_matrix, qpos")?, envs(&self.shared, env_ids)?);
        let matrices = self.shared.read(py, |sim| {
            let armature = sim.robot(self.id).armature();
            self.at_positions(sim, "mass_matrix", qpos.as_ref(), env_ids.as_deref(), |dynamics, env, first| {
                let mut matrix = dynamics.mass_matrix();
                for (joint, inertia) in armature.row(env.0).iter().enumerate() {
                    matrix[(first + joint, first + joint)] += inertia;
                }
                matrix
            })
        })?;
        let side = matrices.first().map_or(0, DMatrix::nrows);
        let stacked =
            Array3::from_shape_fn((matrices.len(), side, side), |(env, row, column)| matrices[env][(row, column)]);
        Ok(stacked.into_pyarray(py).into_any())
    }

    /// Generalized forces that hold the robot still against gravity at joint positions, by default the current ones
    /// [N m or N], shape (num_envs, columns), with the columns of ``mass_matrix``. Gravity itself exerts the negative.
    #[pyo3(signature = (qpos=None, env_ids=None))]
    fn gravity_torque<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (qpos, env_ids) = (positions(qpos, "gravity_torque, qpos")?, envs(&self.shared, env_ids)?);
        let rows = self.shared.read(py, |sim| {
            let gravity = sim.cfg().gravity;
            self.at_positions(sim, "gravity_torque", qpos.as_ref(), env_ids.as_deref(), |dynamics, _, _| {
                dynamics.gravity_torque(&gravity)
            })
        })?;
        let columns = rows.first().map_or(0, DVector::len);
        let stacked = Array2::from_shape_fn((rows.len(), columns), |(env, column)| rows[env][column]);
        Ok(stacked.into_pyarray(py).into_any())
    }
}

impl Robot {
    /// Calls `act` for each selected environment with the dynamics at a row of `qpos`, or at the current positions; with
    /// the environment and the column of the first joint.
    fn at_positions<T>(
        &self,
        sim: &SimulationManager,
        method: &str,
        qpos: Option<&Array2<f64>>,
        env_ids: Option<&[EnvId]>,
        act: impl Fn(&Dynamics<'_>, EnvId, usize) -> T,
    ) -> Result<Vec<T>, Failure> {
        let robot = sim.robot(self.id);
        let selected: Vec<EnvId> = env_ids.map_or_else(|| (0..sim.num_envs()).map(EnvId).collect(), <[EnvId]>::to_vec);
        if let Some(env) = selected.iter().find(|env| env.0 >= sim.num_envs()) {
            return Err(Error::UnknownIndex { what: "environment", index: env.0, count: sim.num_envs() }.into());
        }
        if let Some(qpos) = qpos
            && (qpos.ncols() != robot.dof() || (qpos.nrows() != 1 && qpos.nrows() != selected.len()))
        {
            let (found, rows, columns) = (qpos.shape(), selected.len(), robot.dof());
            let problem = format!("qpos has the shape {found:?}; expected [{rows}, {columns}] or [1, {columns}]");
            return Err(Failure::argument(method, problem));
        }
        let mut at = Configuration::zero(robot.description());
        if !at.free_joint_poses.is_empty() {
            let problem = "the robot has floating or planar joints, whose poses are not among the joint positions";
            return Err(Failure::argument(method, problem));
        }
        at.floating_base = !robot.is_link_fixed(robot.description().root)?;
        // Given positions of mimic joints are ignored, as in `compute_fk`; current ones are those of the state.
        at.mimic = if qpos.is_some() { MimicPositions::FollowDriver } else { MimicPositions::AsGiven };
        let first = if at.floating_base { 6 } else { 0 };
        let (present, roots) = (robot.qpos(), robot.root_pose());
        let calculate = |(index, env): (usize, &EnvId)| {
            let row = match qpos {
                Some(qpos) => qpos.row(index.min(qpos.nrows() - 1)),
                None => present.row(env.0),
            };
            let root_pose = from_row(&std::array::from_fn(|k| roots[(env.0, k)]));
            let at = Configuration { root_pose, joint_positions: row.to_vec(), ..at.clone() };
            Ok(act(&Dynamics::new(robot.description(), &at)?, *env, first))
        };
        selected.iter().enumerate().map(calculate).collect()
    }
}

fn positions(qpos: Option<&Bound<'_, PyAny>>, name: &str) -> PyResult<Option<Array2<f64>>> {
    qpos.map(|qpos| array::<Ix2>(qpos, name)).transpose()
}
