//! Dynamics of robots in a simulation: inertia, forces, energy, momentum.

use crate::arguments::{array, envs};
use crate::errors::Failure;
use crate::robot::Robot;
use kinetoscope::nalgebra::{DMatrix, DVector};
use kinetoscope::ndarray::{Array1, Array2, Array3, Ix2};
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
        let at = self.joint_arguments("mass_matrix", qpos, None, env_ids)?;
        let matrices: Vec<DMatrix<f64>> = self.shared.read(py, |sim| self.at(sim, &at, |state| state.mass_matrix()))?;
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
        let at = self.joint_arguments("gravity_torque", qpos, None, env_ids)?;
        self.rows(py, &at, |state| state.dynamics.gravity_torque(&state.gravity))
    }

    /// Generalized forces at zero acceleration, c(q, v) + g(q) of the equation of motion [N m or N], ``qfrc_bias`` of MuJoCo,
    /// shape (num_envs, columns), with the columns of ``mass_matrix``. Joint positions and velocities are the current ones by
    /// default; a floating base has its current pose and velocity. Velocities of mimic joints are used as given.
    #[pyo3(signature = (qpos=None, qvel=None, env_ids=None))]
    fn bias_force<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        qvel: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let at = self.joint_arguments("bias_force", qpos, qvel, env_ids)?;
        self.rows(py, &at, |state| state.dynamics.bias_force(&state.velocity, &state.gravity))
    }

    /// Generalized forces M a + c + g that produce accelerations, shape (num_envs, columns), with the columns of
    /// ``mass_matrix`` [N m or N], rotor inertias included. Accelerations are the rates of change of the velocities of these
    /// columns, shape (num_envs, columns) [rad/s² or m/s²]. Damping and friction of joints are not included. Joint positions and
    /// velocities are those of ``bias_force``.
    #[pyo3(signature = (qacc, qpos=None, qvel=None, env_ids=None))]
    fn inverse_dynamics<'py>(
        &self,
        py: Python<'py>,
        qacc: &Bound<'_, PyAny>,
        qpos: Option<&Bound<'_, PyAny>>,
        qvel: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let accelerations = array::<Ix2>(qacc, "inverse_dynamics, qacc")?;
        let at = self.joint_arguments("inverse_dynamics", qpos, qvel, env_ids)?;
        let rows = self.shared.read(py, |sim| {
            let columns = self.first_joint(sim)? + sim.robot(self.id).dof();
            check_rows("inverse_dynamics", "qacc", &accelerations, at.selected(sim)?.len(), columns)?;
            self.at(sim, &at, |state| {
                let acceleration = row_of(&accelerations, state.index);
                let mut forces = state.dynamics.inverse_dynamics(&state.velocity, &acceleration, &state.gravity);
                forces += state.rotor_inertia().component_mul(&acceleration);
                forces
            })
        })?;
        Ok(stacked(&rows).into_pyarray(py).into_any())
    }

    /// Centers of mass of the robot in the environment [m], shape (num_envs, 3), at joint positions, by default the current ones.
    #[pyo3(signature = (qpos=None, env_ids=None))]
    fn center_of_mass<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let at = self.joint_arguments("center_of_mass", qpos, None, env_ids)?;
        let centers = self.shared.read(py, |sim| {
            let massless = || Failure::argument("center_of_mass", "the robot has no mass");
            let centers = self.at(sim, &at, |state| state.dynamics.center_of_mass())?;
            centers.into_iter().map(|center| center.ok_or_else(massless)).collect::<Result<Vec<_>, _>>()
        })?;
        let centers = Array2::from_shape_fn((centers.len(), 3), |(env, axis)| centers[env][axis]);
        Ok(centers.into_pyarray(py).into_any())
    }

    /// Potential energies in the gravity of the simulation [J], zero at the origin of the environment, shape (num_envs,), at joint
    /// positions, by default the current ones.
    #[pyo3(signature = (qpos=None, env_ids=None))]
    fn potential_energy<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let at = self.joint_arguments("potential_energy", qpos, None, env_ids)?;
        self.numbers(py, &at, |state| state.dynamics.potential_energy(&state.gravity))
    }

    /// Kinetic energies [J], rotor inertias included, shape (num_envs,). Joint positions and velocities are those of
    /// ``bias_force``.
    #[pyo3(signature = (qpos=None, qvel=None, env_ids=None))]
    fn kinetic_energy<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        qvel: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let at = self.joint_arguments("kinetic_energy", qpos, qvel, env_ids)?;
        self.numbers(py, &at, |state| {
            let squares = state.velocity.component_mul(&state.velocity);
            state.dynamics.kinetic_energy(&state.velocity) + 0.5 * state.rotor_inertia().dot(&squares)
        })
    }

    /// Momenta of the links in the axes of the environment, shape (num_envs, 6): linear [kg m/s], then angular about the center of
    /// mass [kg m²/s]. Joint positions and velocities are those of ``bias_force``.
    #[pyo3(signature = (qpos=None, qvel=None, env_ids=None))]
    fn momentum<'py>(
        &self,
        py: Python<'py>,
        qpos: Option<&Bound<'_, PyAny>>,
        qvel: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let at = self.joint_arguments("momentum", qpos, qvel, env_ids)?;
        self.rows(py, &at, |state| {
            let momentum = state.dynamics.momentum(&state.velocity);
            DVector::from_iterator(6, momentum.linear.iter().chain(&momentum.angular).copied())
        })
    }
}

/// Joint positions and velocities of a call, by default the current ones, and the selected environments.
#[derive(Debug)]
struct JointArguments {
    method: &'static str,
    qpos: Option<Array2<f64>>,
    qvel: Option<Array2<f64>>,
    env_ids: Option<Vec<EnvId>>,
}

impl JointArguments {
    fn selected(&self, sim: &SimulationManager) -> Result<Vec<EnvId>, Failure> {
        let all = || (0..sim.num_envs()).map(EnvId).collect();
        let selected: Vec<EnvId> = self.env_ids.clone().unwrap_or_else(all);
        match selected.iter().find(|env| env.0 >= sim.num_envs()) {
            Some(env) => Err(Error::UnknownIndex { what: "environment", index: env.0, count: sim.num_envs() }.into()),
            None => Ok(selected),
        }
    }
}

/// A robot in one environment, at joint positions and velocities.
#[derive(Debug)]
struct RobotState<'a> {
    dynamics: Dynamics<'a>,
    /// Generalized velocity [m/s, rad/s].
    velocity: DVector<f64>,
    gravity: kinetoscope::nalgebra::Vector3<f64>,
    /// Rotor inertia of each joint [kg m² or kg].
    armature: Vec<f64>,
    /// Index among the selected environments.
    index: usize,
}

impl RobotState<'_> {
    /// Rotor inertia of each column.
    fn rotor_inertia(&self) -> DVector<f64> {
        let first = self.velocity.len() - self.armature.len();
        DVector::from_fn(
            self.velocity.len(),
            |column, _| if column < first { 0.0 } else { self.armature[column - first] },
        )
    }

    fn mass_matrix(&self) -> DMatrix<f64> {
        let mut matrix = self.dynamics.mass_matrix();
        for (column, inertia) in self.rotor_inertia().iter().enumerate() {
            matrix[(column, column)] += inertia;
        }
        matrix
    }
}

impl Robot {
    fn joint_arguments(
        &self,
        method: &'static str,
        qpos: Option<&Bound<'_, PyAny>>,
        qvel: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<JointArguments> {
        let rows = |given: Option<&Bound<'_, PyAny>>, name: &str| {
            given.map(|given| array::<Ix2>(given, &format!("{method}, {name}"))).transpose()
        };
        let (qpos, qvel) = (rows(qpos, "qpos")?, rows(qvel, "qvel")?);
        Ok(JointArguments { method, qpos, qvel, env_ids: envs(&self.shared, env_ids)? })
    }

    /// Column of the first joint.
    fn first_joint(&self, sim: &SimulationManager) -> Result<usize, Failure> {
        let robot = sim.robot(self.id);
        Ok(if robot.is_link_fixed(robot.description().root)? { 0 } else { 6 })
    }

    /// Calls `act` with the state of the robot in each selected environment.
    fn at<T>(
        &self,
        sim: &SimulationManager,
        at: &JointArguments,
        act: impl Fn(&RobotState<'_>) -> T,
    ) -> Result<Vec<T>, Failure> {
        let robot = sim.robot(self.id);
        let selected = at.selected(sim)?;
        for (name, given) in [("qpos", &at.qpos), ("qvel", &at.qvel)] {
            if let Some(given) = given {
                check_rows(at.method, name, given, selected.len(), robot.dof())?;
            }
        }
        let mut place = Configuration::zero(robot.description());
        if !place.free_joint_poses.is_empty() {
            let problem = "the robot has floating or planar joints, whose poses are not among the joint positions";
            return Err(Failure::argument(at.method, problem));
        }
        let first = self.first_joint(sim)?;
        place.floating_base = first > 0;
        // Given positions of mimic joints are ignored, as in `compute_fk`; current ones are those of the state.
        place.mimic = if at.qpos.is_some() { MimicPositions::FollowDriver } else { MimicPositions::AsGiven };
        let (positions, velocities, armature) = (robot.qpos(), robot.qvel(), robot.armature());
        let (roots, root_velocities, turns) = (robot.root_pose(), robot.root_velocity(), robot.root_ang_vel_b());
        let calculate = |(index, env): (usize, &EnvId)| {
            let joints = |given: &Option<Array2<f64>>, present: &Array2<f64>| match given {
                Some(given) => row_of(given, index),
                None => row_of(present, env.0),
            };
            let base = |column: usize| match column {
                0..3 => root_velocities[(env.0, column)],
                _ => turns[(env.0, column - 3)],
            };
            let joint_velocities = joints(&at.qvel, &velocities);
            let velocity = DVector::from_fn(first + robot.dof(), |column, _| {
                if column < first { base(column) } else { joint_velocities[column - first] }
            });
            let root_pose = from_row(&std::array::from_fn(|k| roots[(env.0, k)]));
            let joint_positions = joints(&at.qpos, &positions).iter().copied().collect();
            let place = Configuration { root_pose, joint_positions, ..place.clone() };
            let dynamics = Dynamics::new(robot.description(), &place)?;
            let armature = armature.row(env.0).to_vec();
            Ok(act(&RobotState { dynamics, velocity, gravity: sim.cfg().gravity, armature, index }))
        };
        selected.iter().enumerate().map(calculate).collect()
    }

    /// A row of numbers for each selected environment.
    fn rows<'py>(
        &self,
        py: Python<'py>,
        at: &JointArguments,
        act: impl Fn(&RobotState<'_>) -> DVector<f64> + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let rows = self.shared.read(py, |sim| self.at(sim, at, act))?;
        Ok(stacked(&rows).into_pyarray(py).into_any())
    }

    /// A number for each selected environment.
    fn numbers<'py>(
        &self,
        py: Python<'py>,
        at: &JointArguments,
        act: impl Fn(&RobotState<'_>) -> f64 + Send,
    ) -> PyResult<Bound<'py, PyAny>> {
        let numbers = self.shared.read(py, |sim| self.at(sim, at, act))?;
        Ok(Array1::from_vec(numbers).into_pyarray(py).into_any())
    }
}

/// Refuses an array that has neither one row nor one for each selected environment, or numbers that are not finite.
fn check_rows(method: &str, name: &str, given: &Array2<f64>, rows: usize, columns: usize) -> Result<(), Failure> {
    if given.ncols() != columns || (given.nrows() != 1 && given.nrows() != rows) {
        let found = given.shape();
        let problem = format!("{name} has the shape {found:?}; expected [{rows}, {columns}] or [1, {columns}]");
        return Err(Failure::argument(method, problem));
    }
    if !given.iter().all(|number| number.is_finite()) {
        return Err(Failure::argument(method, format!("{name} must not contain NaN or infinity")));
    }
    Ok(())
}

/// The row of an environment; the only row stands for all.
fn row_of(rows: &Array2<f64>, index: usize) -> DVector<f64> {
    let index = index.min(rows.nrows() - 1);
    DVector::from_iterator(rows.ncols(), rows.row(index).iter().copied())
}

fn stacked(rows: &[DVector<f64>]) -> Array2<f64> {
    let columns = rows.first().map_or(0, DVector::len);
    Array2::from_shape_fn((rows.len(), columns), |(env, column)| rows[env][column])
}
