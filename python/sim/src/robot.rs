//! Robots and passive articulations.

use crate::arguments::{Selection, array, envs, patterns};
use crate::cfg;
use crate::errors::Failure;
use crate::shared::{Shared, equal_handles};
use kinetoscope::ndarray::{Array2, Ix2, Ix3};
use kinetoscope::robot::description::{Joint, Link, LinkId};
use kinetoscope::robot::kinematics::{IkCfg, TipFrame};
use kinetoscope::scene::Pose;
use kinetoscope::scene::pose::from_row;
use kinetoscope::sim::{self, DriveType, JointIndex, RobotId, WrenchFrame};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// A robot or a passive articulation in all environments.
///
/// Arrays have the environments on the first axis, and are float64 unless another type is given. Methods that write take
/// one row for each of ``env_ids`` (all environments if omitted), or one row for all of them, and one column for each of
/// ``joint_ids``: indices, the name of a control part, or a list of patterns of joint names.
#[pyclass(frozen, module = "kinetoscope", name = "Robot")]
#[derive(Debug)]
pub(crate) struct Robot {
    pub(crate) shared: Arc<Shared>,
    pub(crate) id: RobotId,
    pub(crate) kind: &'static str,
}

/// Declares read-only properties that return a new array.
macro_rules! arrays {
    ($Class:ident, $view:ident: $($(#[$doc:meta])* $name:ident,)*) => {
        #[pymethods]
        impl $Class {
            $($(#[$doc])*
            #[getter]
            fn $name<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
                let id = self.id;
                Ok(self.shared.read(py, |sim| Ok(sim.$view(id).$name()))?.into_pyarray(py).into_any())
            })*
        }
    };
}
pub(crate) use arrays;

/// Declares methods that write an array per environment.
macro_rules! writers {
    ($Class:ident, $view:ident, $Axes:ty: $($(#[$doc:meta])* $name:ident,)*) => {
        #[pymethods]
        impl $Class {
            $($(#[$doc])*
            #[pyo3(signature = (values, env_ids=None))]
            fn $name(
                &self,
                py: Python<'_>,
                values: &Bound<'_, PyAny>,
                env_ids: Option<&Bound<'_, PyAny>>,
            ) -> PyResult<()> {
                let (values, env_ids, id) = (array::<$Axes>(values, stringify!($name))?, envs(&self.shared, env_ids)?, self.id);
                self.shared.write(py, |sim| Ok(sim.$view(id).$name(&values, env_ids.as_deref())?))
            })*
        }
    };
}
pub(crate) use writers;

/// Declares methods that write an array per environment and joint.
macro_rules! joint_writers {
    ($Axes:ty: $($(#[$doc:meta])* $name:ident,)*) => {
        #[pymethods]
        impl Robot {
            $($(#[$doc])*
            #[pyo3(signature = (values, joint_ids=None, env_ids=None))]
            fn $name(
                &self,
                py: Python<'_>,
                values: &Bound<'_, PyAny>,
                joint_ids: Option<&Bound<'_, PyAny>>,
                env_ids: Option<&Bound<'_, PyAny>>,
            ) -> PyResult<()> {
                let values = array::<$Axes>(values, stringify!($name))?;
                let (joints, env_ids) = (Selection::of(joint_ids, "joint_ids")?, envs(&self.shared, env_ids)?);
                let id = self.id;
                self.shared.write(py, |sim| {
                    let joints = joints.joints(sim, id)?;
                    Ok(sim.robot_mut(id).$name(&values, joints.as_deref(), env_ids.as_deref())?)
                })
            })*
        }
    };
}

arrays! { Robot, robot:
    /// Joint positions [rad or m], shape (num_envs, dof).
    qpos,
    /// Joint velocities [rad/s or m/s], shape (num_envs, dof).
    qvel,
    /// Joint accelerations [rad/s² or m/s²], shape (num_envs, dof).
    qacc,
    /// Joint efforts of the drives in the last step [N m or N], shape (num_envs, dof).
    qf,
    /// Position targets [rad or m], shape (num_envs, dof).
    qpos_target,
    /// Velocity targets [rad/s or m/s], shape (num_envs, dof).
    qvel_target,
    /// Feed-forward efforts [N m or N], shape (num_envs, dof).
    qf_target,
    /// Initial joint positions [rad or m], shape (num_envs, dof).
    default_qpos,
    /// Initial joint velocities [rad/s or m/s], shape (num_envs, dof).
    default_qvel,
    /// Initial poses of the root link, rows x y z qw qx qy qz, shape (num_envs, 7).
    default_root_pose,
    /// Initial poses and velocities of the root link, shape (num_envs, 13).
    default_root_state,
    /// Poses of the root link in the environment, rows x y z qw qx qy qz, shape (num_envs, 7).
    root_pose,
    /// Linear and angular velocities of the root link, world axes, shape (num_envs, 6).
    root_velocity,
    /// Poses and velocities of the root link, shape (num_envs, 13).
    root_state,
    /// Positions of the center of mass of the root link [m], shape (num_envs, 3).
    root_com_position,
    /// Velocities of the center of mass of the root link, shape (num_envs, 6).
    root_com_velocity,
    /// Linear velocity of the root link in its own axes [m/s], shape (num_envs, 3).
    root_lin_vel_b,
    /// Angular velocity of the root link in its own axes [rad/s], shape (num_envs, 3).
    root_ang_vel_b,
    /// Direction of gravity in the axes of the root link, shape (num_envs, 3).
    projected_gravity_b,
    /// Heading of the root link [rad], shape (num_envs,).
    root_heading,
    /// Poses of all links in the environment, shape (num_envs, links, 7).
    link_poses,
    /// Velocities of all links, shape (num_envs, links, 6).
    link_velocities,
    /// Height of the lowest collision point of each link [m], shape (num_envs, links).
    link_lowest_heights,
    /// Height of the lowest collision point of the robot [m], shape (num_envs,).
    lowest_heights,
    /// Position limits [rad or m], shape (num_envs, dof, 2).
    qpos_limits,
    /// Soft position limits [rad or m], shape (num_envs, dof, 2).
    soft_qpos_limits,
    /// Velocity limits [rad/s or m/s], shape (num_envs, dof).
    qvel_limits,
    /// Effort limits [N m or N], shape (num_envs, dof).
    qf_limits,
    /// Stiffness of the drives, shape (num_envs, dof).
    stiffness,
    /// Damping of the drives, shape (num_envs, dof).
    damping,
    /// Delays of the drives [steps], uint32, shape (num_envs, dof).
    delay,
    /// Dry friction of the joints [N m or N], shape (num_envs, dof).
    friction,
    /// Passive damping of the joints, shape (num_envs, dof).
    joint_damping,
    /// Rotor inertia of the joints [kg m² or kg], shape (num_envs, dof).
    armature,
    /// External forces and torques on the links, shape (num_envs, links, 6).
    external_wrenches,
    /// True where gravity of a link is compensated, bool, shape (num_envs, links).
    gravity_compensation,
}

joint_writers! { Ix2:
    /// Sets position targets [rad or m]; they are clamped to the limits.
    set_qpos_target,
    /// Sets velocity targets [rad/s or m/s].
    set_qvel_target,
    /// Sets feed-forward efforts [N m or N].
    set_qf_target,
    /// Writes joint positions [rad or m] to the state.
    write_qpos,
    /// Writes joint velocities [rad/s or m/s] to the state.
    write_qvel,
    /// Writes joint accelerations [rad/s² or m/s²] to the state.
    write_qacc,
    /// Sets the stiffness of the drives.
    set_stiffness,
    /// Sets the damping of the drives.
    set_damping,
    /// Sets velocity limits [rad/s or m/s].
    set_qvel_limits,
    /// Sets effort limits [N m or N].
    set_qf_limits,
    /// Sets the dry friction of joints [N m or N].
    set_friction,
    /// Sets the passive damping of joints.
    set_joint_damping,
    /// Sets the rotor inertia of joints [kg m² or kg].
    set_armature,
}

joint_writers! { Ix3:
    /// Sets position limits [rad or m], shape (num_envs, joints, 2).
    set_qpos_limits,
}

writers! { Robot, robot_mut, Ix2:
    /// Writes poses of the root link, rows x y z qw qx qy qz.
    write_root_pose,
    /// Writes velocities of the root link, shape (num_envs, 6).
    write_root_velocity,
    /// Writes velocities of the center of mass of the root link, shape (num_envs, 6).
    write_root_com_velocity,
    /// Writes poses and velocities of the root link, shape (num_envs, 13).
    write_root_state,
}

#[pymethods]
impl Robot {
    /// Name of the robot.
    #[getter]
    fn uid(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).uid().to_string()))
    }

    /// ``"robot"`` or ``"articulation"``.
    #[getter]
    fn kind(&self) -> &'static str {
        self.kind
    }

    /// Number of movable joints, the columns of joint arrays.
    #[getter]
    fn dof(&self, py: Python<'_>) -> PyResult<usize> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).dof()))
    }

    /// Number of movable joints that follow no other joint.
    #[getter]
    fn active_dof(&self, py: Python<'_>) -> PyResult<usize> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).active_dof()))
    }

    /// Names of the movable joints, in the order of the columns.
    #[getter]
    fn joint_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).joint_names().to_vec()))
    }

    /// Names of the movable joints that follow no other joint.
    #[getter]
    fn active_joint_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(owned(&sim.robot(self.id).active_joint_names())))
    }

    /// Names of all links.
    #[getter]
    fn link_names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(owned(&sim.robot(self.id).link_names())))
    }

    /// Names of the control parts.
    #[getter]
    fn control_parts(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(owned(&sim.robot(self.id).control_parts())))
    }

    /// Mass of all links as in the files [kg].
    #[getter]
    fn total_mass(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).total_mass()))
    }

    /// Indices of the joints that follow another joint.
    #[getter]
    fn mimic_joint_ids(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).mimic_joint_ids().into_iter().map(|joint| joint.0).collect()))
    }

    /// Indices of the joints with a drive, for which ``set_qpos_target`` sets targets. Passive joints and joints that follow
    /// another have none. A drive that ``set_drive_type`` switched to ``"none"`` counts.
    #[getter]
    fn driven_joint_ids(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.shared.read(py, |sim| {
            let robot = sim.robot(self.id);
            let is_driven = |joint: &usize| robot.is_driven(JointIndex(*joint)).unwrap_or(false);
            Ok((0..robot.dof()).filter(is_driven).collect())
        })
    }

    /// Indices of the links that are fixed in the world: the base is fixed, and no joint moves the link. They do not collide with
    /// the ground.
    #[getter]
    fn fixed_link_ids(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.shared.read(py, |sim| {
            let robot = sim.robot(self.id);
            let is_fixed = |link: &usize| robot.is_link_fixed(LinkId(*link)).unwrap_or(false);
            Ok((0..robot.link_names().len()).filter(is_fixed).collect())
        })
    }

    /// For each joint: the joint that drives it, the multiplier and the offset. An independent joint drives itself.
    #[getter]
    fn mimic_drivers(&self, py: Python<'_>) -> PyResult<Vec<(usize, f64, f64)>> {
        self.shared.read(py, |sim| {
            Ok(sim
                .robot(self.id)
                .mimic_drivers()
                .into_iter()
                .map(|(joint, factor, offset)| (joint.0, factor, offset))
                .collect())
        })
    }

    /// Meaning of the gains of each drive, rows of texts, shape (num_envs, dof).
    #[getter]
    fn drive_types(&self, py: Python<'_>) -> PyResult<Vec<Vec<String>>> {
        self.shared.read(py, |sim| {
            let types = sim.robot(self.id).drive_types();
            Ok(types.rows().into_iter().map(|row| row.iter().map(|kind| drive_type_name(*kind)).collect()).collect())
        })
    }

    /// Structure of the robot after merging its files: a dict of ``links`` (dicts with ``name``, ``mass`` [kg], None without
    /// an inertia) and ``joints``, fixed ones included (dicts with ``name``, ``type`` as in URDF, ``parent`` and ``child``,
    /// names of links, and ``axis`` in the frame of the joint).
    #[getter]
    fn description<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let description = self.shared.read(py, |sim| Ok(sim.robot(self.id).description().clone()))?;
        let link = |link: &Link| {
            let dict = PyDict::new(py);
            dict.set_item("name", &link.name)?;
            dict.set_item("mass", link.inertial.as_ref().map(|inertial| inertial.mass))?;
            Ok(dict)
        };
        let name = |link: LinkId| description.links.get(link.0).map(|link| link.name.as_str());
        let joint = |joint: &Joint| {
            let dict = PyDict::new(py);
            dict.set_item("name", &joint.name)?;
            dict.set_item("type", joint.kind.name())?;
            dict.set_item("parent", name(joint.parent))?;
            dict.set_item("child", name(joint.child))?;
            dict.set_item("axis", (joint.axis.x, joint.axis.y, joint.axis.z))?;
            Ok(dict)
        };
        let dict = PyDict::new(py);
        dict.set_item("links", description.links.iter().map(link).collect::<PyResult<Vec<_>>>()?)?;
        dict.set_item("joints", description.joints.iter().map(joint).collect::<PyResult<Vec<_>>>()?)?;
        Ok(dict)
    }

    /// Indices of the joints of a control part, or of all joints.
    #[pyo3(signature = (part=None))]
    fn joint_ids(&self, py: Python<'_>, part: Option<&str>) -> PyResult<Vec<usize>> {
        self.shared.read(py, |sim| Ok(sim.robot(self.id).joint_ids(part)?.into_iter().map(|joint| joint.0).collect()))
    }

    /// Indices of the joints of a control part, or of the robot, that follow no other joint.
    #[pyo3(signature = (part=None))]
    fn active_joint_ids(&self, py: Python<'_>, part: Option<&str>) -> PyResult<Vec<usize>> {
        self.shared
            .read(py, |sim| Ok(sim.robot(self.id).active_joint_ids(part)?.into_iter().map(|joint| joint.0).collect()))
    }

    /// Indices of the joints whose names match a pattern, or one of several, in the order of the joints.
    fn find_joints(&self, py: Python<'_>, patterns: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        let patterns = self::patterns(patterns)?;
        self.shared
            .read(py, |sim| Ok(sim.robot(self.id).find_joints(&patterns)?.into_iter().map(|joint| joint.0).collect()))
    }

    /// Indices of the links whose names match a pattern, or one of several.
    fn find_links(&self, py: Python<'_>, patterns: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        let patterns = self::patterns(patterns)?;
        self.shared
            .read(py, |sim| Ok(sim.robot(self.id).find_links(&patterns)?.into_iter().map(|link| link.0).collect()))
    }

    /// Poses of a link in the environment, rows x y z qw qx qy qz, shape (num_envs, 7).
    fn link_pose<'py>(&self, py: Python<'py>, link: &str) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.shared.read(py, |sim| Ok(sim.robot(self.id).link_pose(link)?))?.into_pyarray(py).into_any())
    }

    /// Velocities of a link, shape (num_envs, 6).
    fn link_velocity<'py>(&self, py: Python<'py>, link: &str) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.shared.read(py, |sim| Ok(sim.robot(self.id).link_velocity(link)?))?.into_pyarray(py).into_any())
    }

    /// Writes joint positions and velocities to the state.
    #[pyo3(signature = (positions, velocities, joint_ids=None, env_ids=None))]
    fn write_joint_state(
        &self,
        py: Python<'_>,
        positions: &Bound<'_, PyAny>,
        velocities: &Bound<'_, PyAny>,
        joint_ids: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let positions = array::<Ix2>(positions, "write_joint_state, positions")?;
        let velocities = array::<Ix2>(velocities, "write_joint_state, velocities")?;
        let (joints, env_ids, id) = (Selection::of(joint_ids, "joint_ids")?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| {
            let joints = joints.joints(sim, id)?;
            let mut robot = sim.robot_mut(id);
            Ok(robot.write_joint_state(&positions, &velocities, joints.as_deref(), env_ids.as_deref())?)
        })
    }

    /// Sets the meaning of the gains: ``"force"``, ``"acceleration"`` or ``"none"`` (passive).
    #[pyo3(signature = (drive_type, joint_ids=None, env_ids=None))]
    fn set_drive_type(
        &self,
        py: Python<'_>,
        drive_type: &str,
        joint_ids: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let kind: DriveType = drive_type.parse().map_err(|error| Failure::argument("drive_type", error))?;
        let (joints, env_ids, id) = (Selection::of(joint_ids, "joint_ids")?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| {
            let joints = joints.joints(sim, id)?;
            Ok(sim.robot_mut(id).set_drive_type(kind, joints.as_deref(), env_ids.as_deref())?)
        })
    }

    /// Sets the delays of drives with the actuator model ``delayed_pd`` [steps].
    #[pyo3(signature = (values, joint_ids=None, env_ids=None))]
    fn set_delay(
        &self,
        py: Python<'_>,
        values: &Bound<'_, PyAny>,
        joint_ids: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let values = array::<Ix2>(values, "set_delay")?;
        let whole = |&x: &f64| x >= 0.0 && x <= f64::from(u32::MAX) && x.fract() == 0.0;
        if let Some(wrong) = values.iter().find(|x| !whole(x)) {
            return Err(Failure::argument("set_delay", format!("{wrong} is not a whole number of steps")).into());
        }
        let values: Array2<u32> = values.mapv(|x| x as u32);
        let (joints, env_ids, id) = (Selection::of(joint_ids, "joint_ids")?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| {
            let joints = joints.joints(sim, id)?;
            Ok(sim.robot_mut(id).set_delay(&values, joints.as_deref(), env_ids.as_deref())?)
        })
    }

    /// Sets forces [N] and torques [N m] that act on links until they are set again or the environment is reset, shape
    /// (num_envs, links, 3). ``frame`` is ``"world"`` or ``"link"``.
    #[pyo3(signature = (forces, torques, frame="world", link_ids=None, env_ids=None))]
    fn set_external_wrench(
        &self,
        py: Python<'_>,
        forces: &Bound<'_, PyAny>,
        torques: &Bound<'_, PyAny>,
        frame: &str,
        link_ids: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let forces = array::<Ix3>(forces, "set_external_wrench, forces")?;
        let torques = array::<Ix3>(torques, "set_external_wrench, torques")?;
        let frame = wrench_frame(frame)?;
        let (links, env_ids, id) = (Selection::of(link_ids, "link_ids")?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| {
            let links = links.links(sim, id)?;
            let mut robot = sim.robot_mut(id);
            Ok(robot.set_external_wrench(&forces, &torques, frame, links.as_deref(), env_ids.as_deref())?)
        })
    }

    /// Compensates gravity of links, or ends the compensation.
    #[pyo3(signature = (on, link_ids=None, env_ids=None))]
    fn set_gravity_compensation(
        &self,
        py: Python<'_>,
        on: bool,
        link_ids: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (links, env_ids, id) = (Selection::of(link_ids, "link_ids")?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| {
            let links = links.links(sim, id)?;
            Ok(sim.robot_mut(id).set_gravity_compensation(on, links.as_deref(), env_ids.as_deref())?)
        })
    }

    /// Poses of a frame at joint positions, rows x y z qw qx qy qz in the environment, shape (num_envs, 7). ``tip`` is a
    /// control part or a link, ``link`` another link of the same joints, ``tcp`` the pose of the tool in that link.
    #[pyo3(signature = (qpos, tip, link=None, tcp=None, env_ids=None))]
    fn compute_fk<'py>(
        &self,
        py: Python<'py>,
        qpos: &Bound<'_, PyAny>,
        tip: &str,
        link: Option<&str>,
        tcp: Option<[f64; 7]>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (qpos, env_ids, tip) =
            (array::<Ix2>(qpos, "compute_fk, qpos")?, envs(&self.shared, env_ids)?, frame(tip, link, tcp)?);
        let poses = self.shared.read(py, |sim| Ok(sim.robot(self.id).compute_fk(&qpos, tip, env_ids.as_deref())?))?;
        Ok(poses.into_pyarray(py).into_any())
    }

    /// Poses of all links at joint positions, shape (num_envs, links, 7).
    #[pyo3(signature = (qpos, env_ids=None))]
    fn compute_link_fk<'py>(
        &self,
        py: Python<'py>,
        qpos: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let (qpos, env_ids) = (array::<Ix2>(qpos, "compute_link_fk, qpos")?, envs(&self.shared, env_ids)?);
        let poses = self.shared.read(py, |sim| Ok(sim.robot(self.id).compute_link_fk(&qpos, env_ids.as_deref())?))?;
        Ok(poses.into_pyarray(py).into_any())
    }

    /// Jacobians of a frame, shape (num_envs, 6, joints); at the current positions without ``qpos``.
    #[pyo3(signature = (tip, qpos=None, link=None, tcp=None, env_ids=None))]
    fn jacobian<'py>(
        &self,
        py: Python<'py>,
        tip: &str,
        qpos: Option<&Bound<'_, PyAny>>,
        link: Option<&str>,
        tcp: Option<[f64; 7]>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        let qpos = qpos.map(|qpos| array::<Ix2>(qpos, "jacobian, qpos")).transpose()?;
        let (env_ids, tip) = (envs(&self.shared, env_ids)?, frame(tip, link, tcp)?);
        let jacobians = self.shared.read(py, |sim| {
            Ok(sim.robot(self.id).jacobian(tip, qpos.as_ref().map(|qpos| qpos.view()), env_ids.as_deref())?)
        })?;
        Ok(jacobians.into_pyarray(py).into_any())
    }

    /// Joint positions at which a frame reaches target poses (rows x y z qw qx qy qz). Settings are those of ``IkCfg``.
    /// A target that cannot be reached is not an error: see ``IkResult.success``.
    #[pyo3(signature = (targets, tip, cfg=None, initial=None, link=None, tcp=None, env_ids=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn compute_ik(
        &self,
        py: Python<'_>,
        targets: &Bound<'_, PyAny>,
        tip: &str,
        cfg: Option<&Bound<'_, PyAny>>,
        initial: Option<&Bound<'_, PyAny>>,
        link: Option<&str>,
        tcp: Option<[f64; 7]>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<IkResult> {
        let targets = array::<Ix2>(targets, "compute_ik, targets")?;
        let initial = initial.map(|initial| array::<Ix2>(initial, "compute_ik, initial")).transpose()?;
        let settings: IkCfg = cfg::read("IkCfg", cfg)?;
        let (env_ids, tip) = (envs(&self.shared, env_ids)?, frame(tip, link, tcp)?);
        let found = self.shared.read(py, |sim| {
            let initial = initial.as_ref().map(|rows| rows.view());
            Ok(sim.robot(self.id).compute_ik(&targets, tip, &settings, initial, env_ids.as_deref())?)
        })?;
        Ok(IkResult::new(py, found))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "Robot", |sim| {
            let robot = sim.robot(self.id);
            let kind = if self.kind == "robot" { "Robot" } else { "Articulation" };
            let parts = robot.control_parts();
            let parts = if parts.is_empty() { String::new() } else { format!(", parts {}", parts.join(", ")) };
            let (dof, links) = (robot.dof(), robot.link_names().len());
            Ok(format!("<{kind} {:?}: {dof} joints, {links} links{parts}, {} envs>", robot.uid(), sim.num_envs()))
        })
    }

    /// Table of the joints and tree of the links, for notebooks.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let html = self.shared.describe(py, "Robot", |sim| Ok(crate::html::robot(&sim.robot(self.id))))?;
        // Of a destroyed simulation, and of one in use, this is a plain text.
        Ok(if html.starts_with("<Robot") { quick_xml::escape::escape(&html).into_owned() } else { html })
    }
}

equal_handles! { Robot: id }

/// Result of inverse kinematics: one entry for each environment of ``Robot.compute_ik``, or for each target of
/// ``KinematicChain.compute_ik``.
#[pyclass(frozen, get_all, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct IkResult {
    /// Joint positions [rad or m], shape (N, joints); the best ones found where ``success`` is false.
    qpos: Py<PyAny>,
    /// True where the target is reached, shape (N,).
    success: Py<PyAny>,
    /// Distance to the target [m], shape (N,).
    position_error: Py<PyAny>,
    /// Angle to the target [rad], shape (N,).
    rotation_error: Py<PyAny>,
    /// Solver iterations, shape (N,).
    iterations: Py<PyAny>,
    /// Index of the start that led to the result, shape (N,); 0 is the start from the initial positions.
    seed: Py<PyAny>,
}

impl IkResult {
    /// Hands the arrays of a result over to NumPy.
    pub(crate) fn new(py: Python<'_>, found: sim::IkResult) -> Self {
        Self {
            qpos: found.qpos.into_pyarray(py).into_any().unbind(),
            success: found.success.into_pyarray(py).into_any().unbind(),
            position_error: found.position_error.into_pyarray(py).into_any().unbind(),
            rotation_error: found.rotation_error.into_pyarray(py).into_any().unbind(),
            iterations: found.iterations.into_pyarray(py).into_any().unbind(),
            seed: found.seed.into_pyarray(py).into_any().unbind(),
        }
    }
}

#[pymethods]
impl IkResult {
    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!(
            "IkResult(success={}, position_error={})",
            self.success.bind(py).str()?,
            self.position_error.bind(py).str()?
        ))
    }
}

/// Name of a drive type in configurations.
fn drive_type_name(kind: DriveType) -> String {
    let name = toml::Value::try_from(kind).ok();
    name.and_then(|name| name.as_str().map(String::from)).unwrap_or_default()
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(ToString::to_string).collect()
}

/// Reads the frame of a wrench.
pub(crate) fn wrench_frame(name: &str) -> PyResult<WrenchFrame> {
    match name {
        "world" => Ok(WrenchFrame::World),
        "link" => Ok(WrenchFrame::Link),
        other => Err(Failure::argument("frame", format!("unknown frame {other:?}; \"world\" or \"link\"")).into()),
    }
}

/// Reads a pose row x y z qw qx qy qz.
pub(crate) fn pose(row: [f64; 7], name: &str) -> PyResult<Pose> {
    let norm = row[3..].iter().map(|x| x * x).sum::<f64>().sqrt();
    if !(row.iter().all(|x| x.is_finite()) && norm > 1e-9) {
        return Err(Failure::argument(name, format!("{row:?} is not a pose x y z qw qx qy qz")).into());
    }
    Ok(from_row(&row))
}

fn frame<'n>(tip: &'n str, link: Option<&'n str>, tcp: Option<[f64; 7]>) -> PyResult<TipFrame<'n>> {
    let frame = TipFrame { link, ..TipFrame::from(tip) };
    Ok(match tcp {
        None => frame,
        Some(row) => frame.with_tcp(pose(row, "tcp")?),
    })
}
