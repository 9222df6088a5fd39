//! Kinematics of a robot without a simulation, and its merged URDF.

use crate::arguments::array;
use crate::cfg;
use crate::errors::{Class, Failure};
use crate::robot::{IkResult, pose};
use crate::shared::{detached, guarded, interruptible};
use crate::simulation::diagnostics;
use kinetoscope::nalgebra::Vector6;
use kinetoscope::ndarray::{Array1, Array2, Array3, ArrayView1, Ix2};
use kinetoscope::robot::description::{FileActuation, JointId, LinkId, RobotDescription};
use kinetoscope::robot::kinematics::{Chain, IkCfg, IkSolver, KinematicsError, link_poses};
use kinetoscope::robot::position_range::position_ranges;
use kinetoscope::robot::urdf::{UrdfCfg, write_urdf};
use kinetoscope::scene::Pose;
use kinetoscope::scene::pattern::closest_names;
use kinetoscope::scene::pose::to_row;
use kinetoscope::sensors::camera::{CameraError, Poses as _};
use kinetoscope::sim::inspect::describe;
use kinetoscope::sim::{self, EntityCfg, Error, MjcfFile, RobotCfg};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyMapping;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};

/// Merges the URDF files of a robot into one, and returns its text. ``robot`` is a ``UrdfCfg``, a ``RobotCfg`` with URDF
/// files, a dict of the fields of one of them, or the path of a file. Paths of meshes and textures are absolute. Masses
/// and inertias are those of the files. ``inspect`` lists warnings about the files.
#[pyfunction]
pub(crate) fn assemble_urdf(py: Python<'_>, robot: &Bound<'_, PyAny>) -> PyResult<String> {
    let cfg = robot_cfg(robot)?;
    if cfg.mjcf.is_some() {
        let message = "assemble_urdf merges URDF files, and this robot has an MJCF file; SimulationManager.dump exports its \
                       simulation";
        return Err(Failure::new(Class::Config, message).into());
    }
    detached(py, || Ok(write_urdf(&describe(&cfg)?.description)))
}

/// Forward kinematics, Jacobians and inverse kinematics of a robot without a simulation: the chain of joints from the link
/// ``base`` to a frame on the link ``tip``. Poses are rows x y z qw qx qy qz in the frame of ``base``.
///
/// ``robot`` is the path of a URDF file, a ``UrdfCfg``, an ``MjcfFile``, a ``RobotCfg``, or a dict of the fields of a
/// ``UrdfCfg`` or ``RobotCfg``. ``base`` is by default the root link, or the child of the last floating or planar joint above
/// ``tip``. ``tcp`` is the pose of the tool in the link ``tip``, x y z qw qx qy qz.
///
/// The columns of arrays are the joints in ``joint_names``: those that move the tip, in the order of the robot's joints.
/// A mimic joint has no column. It follows its driver, whose column includes the motion of the mimic joint.
///
/// Methods have the names, arguments and results of those of ``Robot``. They take one row of positions for each pose, or a
/// single row. A row gives the same bits in any batch.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct KinematicChain {
    description: RobotDescription,
    /// The chain, with the joints of `columns` as variables.
    chain: Chain,
    /// Columns among the drivable joints of the robot.
    columns: Vec<usize>,
    joint_names: Vec<String>,
    /// Range of each joint [rad or m].
    limits: Vec<[f64; 2]>,
    /// Start of inverse kinematics without initial positions [rad or m].
    start: Vec<f64>,
    /// Links from the base to the tip.
    links: Vec<LinkId>,
    /// Joint that follows another one by a curve, which inverse kinematics does not support.
    coupled: Option<String>,
    diagnostics: Vec<kinetoscope::robot::diagnostic::Diagnostic>,
}

impl KinematicChain {
    fn build(cfg: &RobotCfg, tip: &str, base: Option<&str>, tcp: &Pose) -> Result<Self, Failure> {
        let robot = describe(cfg)?;
        let (description, mut diagnostics) = (robot.description, robot.diagnostics);
        let tip = link_of(&description, tip)?;
        let of_robot = match base {
            None => Chain::new(&description, tip, tcp)?,
            Some(base) => Chain::between(&description, link_of(&description, base)?, tip, tcp)?,
        };
        let joints: Vec<JointId> = description.drivable_joints().map(|(id, _)| id).collect();
        let ranges = position_ranges(&description, &mut diagnostics);
        let columns: Vec<usize> = (0..joints.len()).filter(|&column| of_robot.is_moved_by(column)).collect();
        let chain = of_robot.reduced(&columns, &vec![0.0; joints.len()]);
        let joint = |column: &usize| description.joint(joints[*column]);
        let is_coupled = |column: &&usize| {
            joint(column).defaults.is_some_and(|file| matches!(file.drive, FileActuation::Coupled(_)))
        };
        let parent = |link: &LinkId| {
            description
                .link(*link)
                .parent_joint
                .filter(|_| *link != chain.base())
                .map(|id| description.joint(id).parent)
        };
        let mut links: Vec<LinkId> = std::iter::successors(Some(tip), parent).collect();
        links.reverse();
        // Links that users do not see are frames between the joints of one body.
        links.retain(|link| !description.link(*link).is_auxiliary_frame);
        Ok(Self {
            joint_names: columns.iter().map(|column| joint(column).name.clone()).collect(),
            limits: columns.iter().map(|&column| ranges[column].target_range).collect(),
            start: columns.iter().map(|column| joint(column).defaults.map_or(0.0, |file| file.position)).collect(),
            coupled: columns.iter().find(is_coupled).map(|column| joint(column).name.clone()),
            links,
            chain,
            columns,
            description,
            diagnostics,
        })
    }

    fn name(&self, link: LinkId) -> &str {
        &self.description.link(link).name
    }

    fn tip_link(&self) -> LinkId {
        self.links.last().copied().unwrap_or(self.chain.base())
    }

    /// Positions of an argument, shape (N, joints).
    fn positions(&self, obj: &Bound<'_, PyAny>, argument: &'static str) -> PyResult<Array2<f64>> {
        let rows = array::<Ix2>(obj, argument)?;
        let dof = self.columns.len();
        if rows.ncols() != dof {
            let joints = format!("one column for each of joint_names {:?}", self.joint_names);
            let message = format!("the shape is {:?}; expected (N, {dof}): {joints}", rows.shape());
            return Err(Failure::argument(argument, message).into());
        }
        if let Some(((row, column), &value)) = rows.indexed_iter().find(|(_, value)| !value.is_finite()) {
            let item = format!("joint {:?}", self.joint_names[column]);
            return Err(Failure::from(Error::NotFinite { argument, row, column, item, value }).into());
        }
        Ok(rows)
    }

    fn solve(
        &self,
        targets: &[Pose],
        initial: &Array2<f64>,
        settings: IkCfg,
        stop: &AtomicBool,
    ) -> Result<sim::IkResult, Failure> {
        let link = self.name(self.tip_link()).to_string();
        if let Some(joint) = self.coupled.clone() {
            return Err(KinematicsError::PolynomialCoupling { joint, link }.into());
        }
        if self.columns.is_empty() {
            let of = format!("the chain from link {:?}", self.name(self.chain.base()));
            return Err(KinematicsError::NoMovingJoint { of, link, moving_joints: Vec::new() }.into());
        }
        let mut solver = IkSolver::new(self.chain.clone(), self.limits.clone(), settings)?;
        // One row stands for all: `positions` and `poses_of` have checked the other lengths.
        let count = if targets.len() == 1 { initial.nrows() } else { targets.len() };
        let mut found = sim::IkResult {
            qpos: Array2::zeros((count, self.columns.len())),
            success: Array1::from_elem(count, false),
            position_error: Array1::zeros(count),
            rotation_error: Array1::zeros(count),
            iterations: Array1::zeros(count),
            seed: Array1::zeros(count),
        };
        let mut start = vec![0.0; self.columns.len()];
        for row in 0..count {
            if stop.load(Ordering::Relaxed) {
                return Err(Failure::new(Class::Other, "interrupted"));
            }
            copy_row(initial.row(if initial.nrows() == 1 { 0 } else { row }), &mut start);
            let solution = solver.solve(&targets[if targets.len() == 1 { 0 } else { row }], &start)?;
            found.qpos.row_mut(row).assign(&ArrayView1::from(solution.positions));
            found.success[row] = solution.success;
            found.position_error[row] = solution.position_error;
            found.rotation_error[row] = solution.rotation_error;
            found.iterations[row] = solution.iterations;
            found.seed[row] = solution.seed;
        }
        Ok(found)
    }
}

/// Number of targets above which Ctrl+C ends a call, because a thread is started for the call.
const INTERRUPTIBLE: usize = 16;

#[pymethods]
impl KinematicChain {
    #[new]
    #[pyo3(signature = (robot, tip, base=None, tcp=None))]
    fn new(
        py: Python<'_>,
        robot: &Bound<'_, PyAny>,
        tip: &str,
        base: Option<&str>,
        tcp: Option<[f64; 7]>,
    ) -> PyResult<Self> {
        let (cfg, tcp) = (robot_cfg(robot)?, tcp.map_or(Ok(Pose::identity()), |row| pose(row, "tcp"))?);
        detached(py, || Self::build(&cfg, tip, base, &tcp))
    }

    /// Name of the link in whose frame poses and Jacobians are.
    #[getter]
    fn base(&self) -> &str {
        self.name(self.chain.base())
    }

    /// Name of the link that the frame is fixed to.
    #[getter]
    fn tip(&self) -> &str {
        self.name(self.tip_link())
    }

    /// Number of joints, the columns of joint arrays.
    #[getter]
    fn dof(&self) -> usize {
        self.columns.len()
    }

    /// Sum of the distances from the base over all joints to the frame [m]. With prismatic joints at 0, the frame is never
    /// farther from the base.
    #[getter]
    fn reach(&self) -> f64 {
        self.chain.reach()
    }

    /// Names of the joints that move the tip, in the order of the robot's joints. Mimic joints are left out: they follow
    /// their drivers.
    #[getter]
    fn joint_names(&self) -> Vec<String> {
        self.joint_names.clone()
    }

    /// Names of the links from the base to the tip.
    #[getter]
    fn link_names(&self) -> Vec<String> {
        self.links.iter().map(|&link| self.name(link).to_string()).collect()
    }

    /// Position limits [rad or m], shape (joints, 2): those of the files, narrowed by those of mimic joints that follow;
    /// infinite without limits.
    #[getter]
    fn qpos_limits<'py>(&self, py: Python<'py>) -> Bound<'py, PyAny> {
        Array2::from_shape_fn((self.limits.len(), 2), |(joint, end)| self.limits[joint][end])
            .into_pyarray(py)
            .into_any()
    }

    /// Everything repaired, ignored or unusual in the files: texts with the attributes ``kind``, ``message``, ``file`` and
    /// ``line``.
    #[getter]
    fn diagnostics<'py>(&self, py: Python<'py>) -> PyResult<Vec<Bound<'py, PyAny>>> {
        diagnostics(py, &self.diagnostics)
    }

    /// Poses of the frame at joint positions, rows x y z qw qx qy qz in the frame of the base, shape (N, 7). Positions beyond
    /// the limits are not clamped.
    fn compute_fk<'py>(&self, py: Python<'py>, qpos: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let qpos = self.positions(qpos, "compute_fk, qpos")?;
        let poses = detached(py, || {
            let mut poses = Array2::zeros((qpos.nrows(), 7));
            let mut positions = vec![0.0; self.columns.len()];
            for (row, mut pose) in qpos.rows().into_iter().zip(poses.rows_mut()) {
                copy_row(row, &mut positions);
                pose.assign(&ArrayView1::from(&to_row(&self.chain.pose(&positions))));
            }
            Ok(poses)
        })?;
        Ok(poses.into_pyarray(py).into_any())
    }

    /// Poses of the links in ``link_names`` at joint positions, rows x y z qw qx qy qz in the frame of the base, shape
    /// (N, links, 7).
    fn compute_link_fk<'py>(&self, py: Python<'py>, qpos: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let qpos = self.positions(qpos, "compute_link_fk, qpos")?;
        let poses = detached(py, || {
            let mut poses = Array3::zeros((qpos.nrows(), self.links.len(), 7));
            // Positions of joints outside the chain do not change poses relative to the base.
            let mut positions = vec![0.0; self.description.drivable_joints().count()];
            for (row, mut of_row) in qpos.rows().into_iter().zip(poses.outer_iter_mut()) {
                self.columns.iter().zip(row).for_each(|(&column, &value)| positions[column] = value);
                let of_robot = link_poses(&self.description, &positions, |_| Pose::identity());
                let base = of_robot[self.chain.base().0];
                for (link, mut pose) in self.links.iter().zip(of_row.rows_mut()) {
                    pose.assign(&ArrayView1::from(&to_row(&base.inv_mul(&of_robot[link.0]))));
                }
            }
            Ok(poses)
        })?;
        Ok(poses.into_pyarray(py).into_any())
    }

    /// Jacobians of the frame at joint positions, shape (N, 6, joints): the velocity of its origin, then its angular
    /// velocity, both in the axes of the base, per unit of each joint's velocity.
    fn jacobian<'py>(&self, py: Python<'py>, qpos: &Bound<'_, PyAny>) -> PyResult<Bound<'py, PyAny>> {
        let qpos = self.positions(qpos, "jacobian, qpos")?;
        let jacobians = detached(py, || {
            let dof = self.columns.len();
            let mut jacobians = Array3::zeros((qpos.nrows(), 6, dof));
            let (mut positions, mut columns) = (vec![0.0; dof], vec![Vector6::zeros(); dof]);
            for (row, mut jacobian) in qpos.rows().into_iter().zip(jacobians.outer_iter_mut()) {
                copy_row(row, &mut positions);
                self.chain.jacobian(&positions, &mut columns);
                jacobian.indexed_iter_mut().for_each(|((axis, joint), value)| *value = columns[joint][axis]);
            }
            Ok(jacobians)
        })?;
        Ok(jacobians.into_pyarray(py).into_any())
    }

    /// Joint positions within the limits at which the frame reaches target poses, rows x y z qw qx qy qz in the frame of the
    /// base. Settings are those of ``IkCfg``. The search starts at ``initial``, by default at 0 or at the ``ref`` of an MJCF
    /// file, clamped to the limits. One target stands for all rows of ``initial``, and one row of ``initial`` for all
    /// targets. A target that cannot be reached is not an error: see ``IkResult.success``. Ctrl+C ends a call
    /// with many targets after the current one.
    #[pyo3(signature = (targets, cfg=None, initial=None))]
    fn compute_ik(
        &self,
        py: Python<'_>,
        targets: &Bound<'_, PyAny>,
        cfg: Option<&Bound<'_, PyAny>>,
        initial: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<IkResult> {
        let targets = poses_of(targets)?;
        let settings: IkCfg = cfg::read("IkCfg", cfg)?;
        let initial = match initial {
            Some(initial) => self.positions(initial, "compute_ik, initial")?,
            None => Array2::from_shape_fn((1, self.start.len()), |(_, joint)| self.start[joint]),
        };
        let rows = [targets.len(), initial.nrows()];
        if rows[0] != rows[1] && !rows.contains(&1) {
            let message = format!("there are {} rows; expected one, or one for each of {} targets", rows[1], rows[0]);
            return Err(Failure::argument("compute_ik, initial", message).into());
        }
        let solve = |stop: &AtomicBool| self.solve(&targets, &initial, settings, stop);
        let found = match rows[0].max(rows[1]) > INTERRUPTIBLE {
            true => interruptible(py, solve)?,
            false => detached(py, || solve(&AtomicBool::new(false)))?,
        };
        Ok(IkResult::new(py, found))
    }

    fn __repr__(&self) -> String {
        format!("<KinematicChain from {:?} to {:?}: {} joints>", self.base(), self.tip(), self.columns.len())
    }
}

/// Robot of an argument: the path of a URDF file, an `MjcfFile`, a `RobotCfg`, a `UrdfCfg`, or a dict of the fields of one of
/// the last two.
fn robot_cfg(obj: &Bound<'_, PyAny>) -> PyResult<RobotCfg> {
    if let Ok(path) = obj.extract::<PathBuf>() {
        return Ok(RobotCfg { urdf: UrdfCfg::single(path), ..RobotCfg::default() });
    }
    let has = |field: &str| obj.cast::<PyMapping>().is_ok_and(|fields| fields.contains(field).unwrap_or(false));
    if cfg::type_of(obj)?.is_some() || has("urdf") || has("mjcf") {
        let mut fields = cfg::table("robot", Some(obj), None)?;
        if fields.get("type").is_some_and(|of| of.as_str() == Some("robot")) {
            fields.remove("type");
        }
        return match cfg::entity("robot", None, fields)? {
            (_, EntityCfg::Robot(cfg)) => Ok(*cfg),
            _ => Err(Failure::new(Class::Internal, "a robot of another type").into()),
        };
    }
    if obj.get_type().name()? == "MjcfFile" {
        let file: MjcfFile = cfg::read("MjcfFile", Some(obj))?;
        return Ok(RobotCfg { mjcf: Some(file), ..RobotCfg::default() });
    }
    Ok(RobotCfg { urdf: cfg::read("UrdfCfg", Some(obj))?, ..RobotCfg::default() })
}

/// Finds a link by name.
fn link_of(description: &RobotDescription, name: &str) -> Result<LinkId, Failure> {
    description.link_id(name).ok_or_else(|| {
        let names = description.named_links().iter().map(|link| link.name.as_str());
        let candidates = closest_names(name, names).into_iter().map(str::to_string).collect();
        Error::UnknownName { what: "link", name: name.into(), candidates }.into()
    })
}

/// Target poses of an argument. Quaternions are normalized.
fn poses_of(targets: &Bound<'_, PyAny>) -> PyResult<Vec<Pose>> {
    let argument = "compute_ik, targets";
    let rows = array::<Ix2>(targets, argument)?;
    let poses = guarded(|| {
        rows.to_poses().map_err(|error| {
            let problem = match error {
                CameraError::PoseColumns { columns } => {
                    format!("the shape is ({}, {columns}); expected (N, 7): x y z qw qx qy qz", rows.nrows())
                }
                CameraError::Pose { row, pose } => format!("row {row}, {pose:?}, is not a pose x y z qw qx qy qz"),
                other => other.to_string(),
            };
            Failure::argument(argument, problem)
        })
    })?;
    Ok(poses)
}

fn copy_row(row: ArrayView1<'_, f64>, positions: &mut [f64]) {
    positions.iter_mut().zip(row).for_each(|(position, &value)| *position = value);
}
