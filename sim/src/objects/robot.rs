//! Robots in a running simulation: read and write access.

pub use super::robot_cfg::RobotCfg;

use super::robot_data::{JointIndex, RobotData, unknown_name_error};
use crate::drive::plan::JointPlan;
use crate::drive::table::DriveState;
use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::indexing::{JointIndexing, RobotIndexing};
use crate::objects::free_body::{FreeBody, FreeBodyMut};
use crate::objects::rows::{ArgumentSpec, EnvRows, NumberKind, check_unique_indices, unique_envs};
use crate::row::{RowPart, StateArray, StoredRow};
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use kinetoscope_mujoco as mj;
use kinetoscope_robot::description::{LinkId, RobotDescription};
use kinetoscope_scene::pose::to_row;
use ndarray::{Array2, ArrayView2, AsArray, Ix2};
use std::sync::Arc;

/// Read access to a robot. Arrays have one row per environment and one column per joint, in the order of
/// [`joint_names`](Self::joint_names).
#[derive(Clone, Copy, Debug)]
pub struct Robot<'a> {
    pub(super) data: &'a Arc<RobotData>,
    pub(super) simulation: &'a Simulation,
    index: usize,
}

impl<'a> Robot<'a> {
    pub(crate) fn new(data: &'a Arc<RobotData>, simulation: &'a Simulation, index: usize) -> Self {
        Self { data, simulation, index }
    }

    /// Index of the robot in the simulation.
    pub(super) fn index(&self) -> usize {
        self.index
    }

    pub(super) fn indexing(&self) -> &'a RobotIndexing {
        &self.simulation.robots[self.index]
    }

    /// Name of the robot.
    pub fn uid(&self) -> &'a str {
        self.data.uid()
    }

    /// Description of the robot from its files, with payloads added. Inertias that URDF files lack are completed as
    /// [`UrdfCfg`](kinetoscope_robot::urdf::UrdfCfg) says.
    pub fn description(&self) -> &'a RobotDescription {
        self.data.description()
    }

    /// Number of movable joints with one degree of freedom, mimic joints included: the columns of `qpos`.
    pub fn dof(&self) -> usize {
        self.data.plans.len()
    }

    /// Names of the movable joints with one degree of freedom, mimic joints included, in the order of the merged URDF,
    /// or of the MJCF file. They have no prefix `uid/`.
    pub fn joint_names(&self) -> &'a [String] {
        &self.data.joint_names
    }

    /// Names of all links, fused links included, in the order of the merged URDF; for an MJCF file, its bodies, then
    /// its named sites.
    pub fn link_names(&self) -> Vec<&'a str> {
        self.data.description.named_links().iter().map(|l| l.name.as_str()).collect()
    }

    /// Names of the control parts, in alphabetical order.
    pub fn control_parts(&self) -> Vec<&'a str> {
        self.data.parts.keys().map(String::as_str).collect()
    }

    /// Columns of the joints of a control part, mimic joints included, in the order of its patterns; `None` for all
    /// joints. [`active_joint_ids`](Self::active_joint_ids) leaves out the mimic joints.
    ///
    /// # Errors
    /// The part does not exist; the error lists the existing parts.
    #[doc(alias = "get_joint_ids")]
    pub fn joint_ids<'p>(&self, part: impl Into<Option<&'p str>>) -> Result<Vec<JointIndex>> {
        let Some(part) = part.into() else { return Ok((0..self.dof()).map(JointIndex).collect()) };
        let members =
            self.data.parts.get(part).ok_or_else(|| unknown_name_error("control part", part, self.control_parts()))?;
        Ok(members.iter().map(|&i| JointIndex(i)).collect())
    }

    /// Column of the joint called `name`.
    ///
    /// # Errors
    /// The joint does not exist; the error lists the nearest names.
    pub fn joint_id(&self, name: &str) -> Result<JointIndex> {
        self.joint_names()
            .iter()
            .position(|n| n == name)
            .map(JointIndex)
            .ok_or_else(|| unknown_name_error("joint", name, self.joint_names().iter().map(String::as_str)))
    }

    /// True for a mimic joint: a linear function of another joint. Joints with a nonlinear equality of an MJCF file are
    /// not mimic joints.
    ///
    /// # Errors
    /// The joint does not exist.
    pub fn is_mimic(&self, joint: JointIndex) -> Result<bool> {
        Ok(self.plan(joint)?.mimic.is_some())
    }

    /// Drive plan of the joint in a column; an error if there is no such column.
    pub(super) fn plan(&self, joint: JointIndex) -> Result<&JointPlan> {
        let (what, index, count) = ("joint", joint.0, self.data.plans.len());
        self.data.plans.get(index).ok_or(Error::UnknownIndex { what, index, count })
    }

    /// Driver, multiplier and offset \[rad or m\] of each joint, in the order of [`joint_names`](Self::joint_names):
    /// `position = multiplier * driver + offset`. A joint that is not a mimic joint has itself, 1 and 0. Chains of
    /// mimic joints are resolved; nonlinear equalities of MJCF files are not included.
    pub fn mimic_drivers(&self) -> Vec<(JointIndex, f64, f64)> {
        (0..self.dof())
            .map(|i| match self.data.plans[i].mimic {
                Some((driver, multiplier, offset)) => {
                    let driver = self.data.plans.iter().position(|p| p.joint == driver).unwrap_or(i);
                    (JointIndex(driver), multiplier, offset)
                }
                None => (JointIndex(i), 1.0, 0.0),
            })
            .collect()
    }

    /// Joint positions \[rad or m\], shape (N, dof).
    #[doc(alias = "get_qpos")]
    pub fn qpos(&self) -> Array2<f64> {
        self.joint_states(StateArray::Positions, |joint| joint.qpos)
    }

    /// Joint velocities \[rad/s or m/s\], shape (N, dof).
    #[doc(alias = "get_qvel")]
    pub fn qvel(&self) -> Array2<f64> {
        self.joint_states(StateArray::Velocities, |joint| joint.dof)
    }

    /// Efforts of the drives in the last MuJoCo step, after the effort limit \[N m or N\], shape (N, dof). They include
    /// the efforts of [`set_qf_target`](RobotMut::set_qf_target). 0 for joints without a drive, and after a reset.
    #[doc(alias = "get_qf")]
    pub fn qf(&self) -> Array2<f64> {
        self.gather(RowPart::All, |env, joint| joint.drive.map_or(0.0, |d| env.drives.effort[d]))
    }

    /// Position targets \[rad or m\], shape (N, dof). A mimic joint has the position that its driver's target implies;
    /// a joint without a drive has its current position.
    #[doc(alias = "get_target_qpos")]
    pub fn qpos_target(&self) -> Array2<f64> {
        let is_driven = self.indexing().joints.iter().all(|joint| joint.drive.is_some());
        let part = if is_driven { RowPart::Inputs } else { RowPart::All };
        let mut targets = self.gather(part, |env, joint| match joint.drive {
            Some(d) => env.drives.position[d],
            None => env.raw_qpos()[joint.qpos],
        });
        for (i, (driver, multiplier, offset)) in self.mimic_drivers().into_iter().enumerate() {
            if driver.0 != i {
                for mut row in targets.rows_mut() {
                    row[i] = multiplier * row[driver.0] + offset;
                }
            }
        }
        targets
    }

    /// Sum of the link masses in the files, of those completed from shapes, and of payloads \[kg\]. Randomized masses
    /// of environments are not included: see [`properties`](crate::SimulationManager::properties).
    pub fn total_mass(&self) -> f64 {
        self.data.description.total_mass()
    }

    /// Initial joint positions \[rad or m\], to which [`reset`](crate::SimulationManager::reset) returns, shape (N,
    /// dof): those of the configuration or file, clamped to the limits. All rows are equal.
    #[doc(alias = "default_joint_pos")]
    #[doc(alias = "get_default_qpos")]
    pub fn default_qpos(&self) -> Array2<f64> {
        let n = self.simulation.batch.num_envs();
        Array2::from_shape_fn((n, self.dof()), |(_, joint)| self.data.plans[joint].initial)
    }

    /// Initial pose of the root link, moved by `ground_clearance`: rows `[x, y, z, qw, qx, qy, qz]` in the environment
    /// \[m\], shape (N, 7).
    #[doc(alias = "get_default_root_pose")]
    pub fn default_root_pose(&self) -> Array2<f64> {
        let row = to_row(&self.data.root_pose());
        Array2::from_shape_fn((self.simulation.batch.num_envs(), 7), |(_, k)| row[k])
    }

    /// Pose of the root link in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    #[doc(alias = "get_root_pose")]
    pub fn root_pose(&self) -> Array2<f64> {
        self.root().poses()
    }

    /// Velocity of the root link's frame, then its angular velocity, in world axes \[m/s, rad/s\], shape (N, 6); 0 for
    /// a fixed base.
    #[doc(alias = "get_root_velocity")]
    pub fn root_velocity(&self) -> Array2<f64> {
        self.root().velocities()
    }

    /// Index of the link called `name` in [`link_names`](Self::link_names), fused links included.
    ///
    /// # Errors
    /// The link does not exist; the error lists the nearest names.
    pub fn link_id(&self, name: &str) -> Result<LinkId> {
        self.data.description.link_id(name).ok_or_else(|| unknown_name_error("link", name, self.link_names()))
    }

    pub(super) fn root(&self) -> FreeBody<'a> {
        FreeBody { simulation: self.simulation, index: self.indexing().root }
    }

    /// Pose of a link, fused links included, in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape
    /// (N, 7).
    ///
    /// # Errors
    /// The link does not exist; the error lists the nearest names.
    pub fn link_pose(&self, name: &str) -> Result<Array2<f64>> {
        let link = self.link_id(name)?;
        let frame = self.indexing().links[link.0];
        Ok(self.simulation.batch.body_rows(|bodies| to_row(&frame.pose(bodies))))
    }

    /// Reads a number of each joint, all with one degree of freedom, from the states of all environments.
    pub(super) fn joint_states(
        &self,
        array: StateArray,
        place: impl Fn(&JointIndexing) -> usize + Sync,
    ) -> Array2<f64> {
        self.simulation.batch.gather_state(array, &self.indexing().joints, place)
    }

    /// Reads a number of each joint, all with one degree of freedom, from the rows of all environments.
    pub(super) fn gather(
        &self,
        part: RowPart,
        read: impl Fn(&StoredRow<'_>, &JointIndexing) -> f64 + Sync,
    ) -> Array2<f64> {
        self.simulation.batch.gather_stored(part, &self.indexing().joints, read)
    }
}

/// Write access to a robot: commands and state. The state consists of positions and velocities. MuJoCo computes
/// accelerations from state and forces in every step, so [`write_qacc`](Self::write_qacc) does not move the robot.
#[derive(Debug)]
pub struct RobotMut<'a> {
    pub(super) data: &'a Arc<RobotData>,
    pub(super) simulation: &'a mut Simulation,
    pub(super) sensors: &'a mut SensorList,
    pub(super) index: usize,
}

impl<'a> RobotMut<'a> {
    pub(crate) fn new(
        data: &'a Arc<RobotData>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { data, simulation, sensors, index }
    }

    /// Read access to the robot.
    pub fn read(&self) -> Robot<'_> {
        Robot::new(self.data, self.simulation, self.index)
    }

    /// Sets position targets \[rad or m\]: rows for `env_ids` (`None` for all environments; a single row applies to all
    /// of them), columns for `joint_ids` (`None` for all joints). Targets are clamped to
    /// [`qpos_limits`](Robot::qpos_limits). Columns of joints without a drive (passive and mimic joints) are accepted
    /// and ignored.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is not finite; then nothing is set.
    #[doc(alias = "set_qpos")]
    pub fn set_qpos_target<'t>(
        &mut self,
        targets: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_targets("set_qpos_target", targets.into(), joint_ids, env_ids, |drives, indexing, _, value| {
            if let Some(drive) = indexing.drive {
                let [low, high] = drives.ranges[drive];
                drives.position[drive] = value.clamp(low, high);
            }
        })
    }

    /// Sets velocity targets \[rad/s or m/s\] of the drives. Targets are initially 0 and stay until they are changed or
    /// reset. They are not clamped. Rows and columns are as in [`set_qpos_target`](Self::set_qpos_target); columns of
    /// joints without a drive are accepted and ignored.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is not finite; then nothing is set.
    #[doc(alias = "set_qvel")]
    pub fn set_qvel_target<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_targets("set_qvel_target", velocities.into(), joint_ids, env_ids, |drives, indexing, _, value| {
            if let Some(drive) = indexing.drive {
                drives.velocity[drive] = value;
            }
        })
    }

    /// Sets efforts \[N m or N\] that are added to the efforts of the drives, before the sum is clamped to their
    /// limits. Efforts are initially 0 and stay until they are changed or reset. A passive joint gets the effort
    /// itself, clamped to its limit ([`qf_limits`](Robot::qf_limits)). Rows and columns as in
    /// [`set_qpos_target`](Self::set_qpos_target); columns of mimic joints are accepted and ignored.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is not finite; then nothing is set.
    #[doc(alias = "set_qf")]
    pub fn set_qf_target<'t>(
        &mut self,
        efforts: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_targets("set_qf_target", efforts.into(), joint_ids, env_ids, |drives, indexing, plan, value| {
            if let Some(drive) = indexing.drive {
                drives.feedforward[drive] = value;
            } else if plan.mimic.is_none() {
                drives.applied[indexing.dof] = value.clamp(-plan.max_effort, plan.max_effort);
            }
        })
    }

    /// Changes the commands of joints by one number each, after all checks.
    fn set_targets(
        &mut self,
        argument: &'static str,
        values: ArrayView2<'_, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
        change: impl Fn(&mut DriveState, &JointIndexing, &JointPlan, f64),
    ) -> Result<()> {
        let write = self.checked_rows(argument, values, joint_ids, env_ids)?;
        let robot = &self.simulation.robots[self.index];
        for (env, row) in write.rows.iter() {
            self.simulation.batch.edit_drives(env, |drives| {
                for (&joint, &value) in write.joints.iter().zip(row) {
                    change(drives, &robot.joints[joint], &self.data.plans[joint], value);
                }
            });
        }
        Ok(())
    }

    /// Writes joint positions \[rad or m\] into the state, clamped to the joints' own limits, not to the range of
    /// [`set_qpos_limits`](Self::set_qpos_limits); targets stay. Rows and columns as in
    /// [`set_qpos_target`](Self::set_qpos_target); mimic joints are written as given. A forward pass follows, so that
    /// later reads belong to the new state.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is not finite; then nothing is
    /// written.
    pub fn write_qpos<'t>(
        &mut self,
        positions: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked_rows("write_qpos", positions.into(), joint_ids, env_ids)?;
        let limits: Vec<[f64; 2]> =
            self.data.plans.iter().map(|plan| plan.limit.unwrap_or([f64::MIN, f64::MAX])).collect();
        let addresses = self.addresses(|joint| joint.qpos);
        self.write_joints(&write, |data, joint, value| {
            let [low, high] = limits[joint];
            data.qpos_mut()[addresses[joint]] = value.clamp(low, high);
        });
        Ok(())
    }

    /// Writes joint velocities \[rad/s or m/s\] into the state, not clamped; targets stay. A forward pass follows. Rows
    /// and columns as in [`write_qpos`](Self::write_qpos).
    ///
    /// # Errors
    /// Same errors as [`write_qpos`](Self::write_qpos).
    pub fn write_qvel<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked_rows("write_qvel", velocities.into(), joint_ids, env_ids)?;
        let addresses = self.addresses(|joint| joint.dof);
        self.write_joints(&write, |data, joint, value| data.qvel_mut()[addresses[joint]] = value);
        Ok(())
    }

    pub(super) fn addresses(&self, of: impl Fn(&JointIndexing) -> usize) -> Vec<usize> {
        self.simulation.robots[self.index].joints.iter().map(of).collect()
    }

    /// Sets the pose of the root link of a robot without a fixed base: rows `[x, y, z, qw, qx, qy, qz]` in the
    /// environment \[m\] for `env_ids` (`None` for all environments; a single row applies to all of them). Quaternions
    /// are normalized; velocities, which are in world axes, are preserved. A forward pass follows.
    ///
    /// # Errors
    /// The base is fixed; wrong shape, an unknown or repeated environment, a value that is not finite, or a quaternion
    /// of length zero. Then nothing is written.
    pub fn write_root_pose<'t>(&mut self, poses: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.root().write_poses("write_root_pose", poses.into(), env_ids)
    }

    /// Sets the velocity of the root link's frame and its angular velocity, in world axes: rows of 6 \[m/s, rad/s\], as
    /// in [`write_root_pose`](Self::write_root_pose).
    ///
    /// # Errors
    /// The base is fixed; wrong shape, an unknown or repeated environment, or a value that is not finite. Then nothing
    /// is written.
    pub fn write_root_velocity<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.root().write_velocities("write_root_velocity", velocities.into(), env_ids)
    }

    pub(super) fn root(&mut self) -> FreeBodyMut<'_> {
        let index = self.simulation.robots[self.index].root;
        FreeBodyMut { simulation: self.simulation, sensors: self.sensors, index, owner: self.data.uid() }
    }

    /// Changes the state of each selected environment joint by joint, in one write each, and refreshes the sensors.
    /// `change` gets the index of the joint in the robot.
    pub(super) fn write_joints(&mut self, write: &JointRows<'_>, change: impl Fn(&mut mj::Data, usize, f64)) {
        for (env, row) in write.rows.iter() {
            self.simulation.batch.write_at(env, Stage::Raw, |env| {
                env.write_state(|data| {
                    write.joints.iter().zip(row).for_each(|(&joint, &value)| change(data, joint, value))
                });
            });
        }
        self.sensors.refresh(write.rows.envs(), self.simulation);
    }

    /// Checks the joints, the environments and the shape of an argument, and that its numbers are finite. Nothing is
    /// written.
    pub(super) fn checked_rows<'v>(
        &self,
        argument: &'static str,
        values: ArrayView2<'v, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<JointRows<'v>> {
        self.checked_numbers(argument, NumberKind::Finite, values, joint_ids, env_ids)
    }

    /// Checks an argument like [`checked_rows`](Self::checked_rows), for numbers of another kind.
    pub(super) fn checked_numbers<'v>(
        &self,
        argument: &'static str,
        numbers: NumberKind,
        values: ArrayView2<'v, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<JointRows<'v>> {
        let joints = self.joint_columns(argument, joint_ids)?;
        let of = |column: usize| format!("joint {:?}", self.data.joint_names[joints[column]]);
        let table =
            ArgumentSpec { argument, meaning: "environments, joints", columns: joints.len(), column_label: &of };
        let num_envs = self.simulation.batch.num_envs();
        unique_envs(argument, env_ids, num_envs)?;
        let rows = EnvRows::check_numbers(table, numbers, values, env_ids, num_envs)?;
        Ok(JointRows { joints, rows })
    }

    /// Columns of the selected joints in the given order, each once; all columns for `None`.
    pub(super) fn joint_columns(&self, argument: &'static str, joint_ids: Option<&[JointIndex]>) -> Result<Vec<usize>> {
        let count = self.data.plans.len();
        let exists =
            |index| if index < count { Ok(index) } else { Err(Error::UnknownIndex { what: "joint", index, count }) };
        match joint_ids {
            None => Ok((0..count).collect()),
            Some(ids) => {
                let joints = ids.iter().map(|&JointIndex(index)| exists(index)).collect::<Result<Vec<_>>>()?;
                check_unique_indices(argument, &joints, &|joint| format!("joint {:?}", self.data.joint_names[joint]))?;
                Ok(joints)
            }
        }
    }
}

/// Checked argument: joint columns, and one row of values per environment.
pub(super) struct JointRows<'v> {
    pub(super) joints: Vec<usize>,
    pub(super) rows: EnvRows<'v>,
}
