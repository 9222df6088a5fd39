//! Limits of a robot's joints: positions, speeds and efforts, per joint and per environment.

use crate::drive::gains::Gains;

use crate::drive::table::DriveState;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::objects::robot::{JointRows, Robot, RobotMut};
use crate::objects::robot_data::JointIndex;
use crate::objects::rows::{ArgumentSpec, EnvRows, NumberKind, unique_envs};
use crate::row::RowPart;
use ndarray::{Array2, Array3, ArrayView3, AsArray, Ix2, Ix3};
use std::sync::Arc;

impl Robot<'_> {
    /// Range of position targets \[rad or m\], shape (N, dof, 2): the joint's own limits, narrowed by the limits of
    /// joints that mimic it, or the range of [`set_qpos_limits`](RobotMut::set_qpos_limits); infinite without limits.
    pub fn qpos_limits(&self) -> Array3<f64> {
        self.range_limits(|range| range)
    }

    /// Soft limits \[rad or m\], shape (N, dof, 2): the fraction
    /// [`soft_limit_factor`](crate::RobotCfg::soft_limit_factor) of the range of [`qpos_limits`](Self::qpos_limits),
    /// around its middle. Nothing enforces them: they are for rewards and planners. A range with an infinite end is its
    /// own soft range.
    pub fn soft_qpos_limits(&self) -> Array3<f64> {
        let factor = self.data.cfg().soft_limit_factor;
        self.range_limits(|[low, high]| {
            let (middle, half) = (0.5 * (low + high), 0.5 * (high - low) * factor);
            // A range with an infinite end has the same soft range.
            if half.is_finite() && middle.is_finite() { [middle - half, middle + half] } else { [low, high] }
        })
    }

    /// Speed limits \[rad/s or m/s\], shape (N, dof); infinite without a limit. They are those of the files, unless the
    /// configuration or [`set_qvel_limits`](RobotMut::set_qvel_limits) gives others. Only [`DcMotor`](crate::DcMotor)
    /// uses them; nothing else enforces them.
    pub fn qvel_limits(&self) -> Array2<f64> {
        let mut limits = self
            .gather(RowPart::Inputs, |env, joint| joint.drive.map_or(f64::NAN, |d| env.drives.gains[d].max_velocity));
        for ((_, joint), limit) in limits.indexed_iter_mut().filter(|(_, limit)| limit.is_nan()) {
            *limit = self.data.plans()[joint].max_velocity;
        }
        limits
    }

    /// Effort limits of the drives \[N m or N\], shape (N, dof); infinite without a limit. A passive joint has the
    /// limit of its file or configuration, which bounds the effort of [`set_qf_target`](RobotMut::set_qf_target). A
    /// mimic joint has no limit.
    pub fn qf_limits(&self) -> Array2<f64> {
        let mut limits =
            self.gather(RowPart::Inputs, |env, joint| joint.drive.map_or(f64::NAN, |d| env.drives.gains[d].max_effort));
        for ((_, joint), limit) in limits.indexed_iter_mut().filter(|(_, limit)| limit.is_nan()) {
            let plan = &self.data.plans()[joint];
            *limit = if plan.mimic.is_some() { f64::INFINITY } else { plan.max_effort };
        }
        limits
    }

    /// Computes two numbers from the range of each joint.
    fn range_limits(&self, of: impl Fn([f64; 2]) -> [f64; 2]) -> Array3<f64> {
        let joints = &self.indexing().joints;
        let mut limits = Array3::zeros((self.simulation.batch.num_envs(), joints.len(), 2));
        self.simulation.batch.for_each_row(RowPart::Inputs, |i, env| {
            for (j, (joint, plan)) in joints.iter().zip(self.data.plans()).enumerate() {
                let [low, high] = of(joint.drive.map_or(plan.target_range, |drive| env.drives.ranges[drive]));
                (limits[(i, j, 0)], limits[(i, j, 1)]) = (low, high);
            }
        });
        limits
    }
}

impl RobotMut<'_> {
    /// Sets the range of position targets \[rad or m\], shape (environments, joints, 2): rows for `env_ids` (`None` for
    /// all environments; a single row applies to all of them), joints as `joint_ids` (`None` for all joints). Current
    /// targets are clamped at once; delayed targets of [`DelayedPd`](crate::DelayedPd) are clamped when they act. The
    /// range may be tighter than the robot's own limits and be widened again, up to those. It stays over a reset.
    /// Entries of mimic joints are accepted and ignored.
    ///
    /// The range limits commands only. The joint stops are in MuJoCo's model and stay unchanged: a load may push a
    /// joint beyond a tighter range. [`compute_ik`](Robot::compute_ik) searches within the limits that the robot was
    /// added with.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, NaN, a lower end above the upper end, or an end beyond
    /// the robot's own limits; a joint without a drive. Then nothing is set.
    pub fn set_qpos_limits<'t>(
        &mut self,
        limits: impl AsArray<'t, f64, Ix3>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let argument = "set_qpos_limits";
        let limits: ArrayView3<'_, f64> = limits.into();
        let joints = self.joint_columns(argument, joint_ids)?;
        let num_envs = self.simulation.batch.num_envs();
        let envs = unique_envs(argument, env_ids, num_envs)?.len();
        let (rows, columns, ends) = limits.dim();
        let fits = [1, envs].contains(&rows) && columns == joints.len() && ends == 2;
        let Some(flat) = limits.to_shape((rows, columns * ends)).ok().filter(|_| fits) else {
            let expected = vec![envs, joints.len(), 2];
            let (found, meaning) = (limits.shape().to_vec(), "environments, joints, lower and upper end");
            return Err(Error::Shape { argument, found, expected, meaning });
        };
        let name = |joint: usize| &self.data.joint_names()[joint];
        let of = |column: usize| {
            let end = ["lower", "upper"][column % 2];
            format!("{end} end of joint {:?}", name(joints[column / 2]))
        };
        let table = ArgumentSpec {
            argument,
            meaning: "environments, lower and upper end of joints",
            columns: 2 * columns,
            column_label: &of,
        };
        let rows = EnvRows::check_numbers(table, NumberKind::RangeEnd, flat.view(), env_ids, num_envs)?;
        let drives = self.drives_of_joints(argument, &joints)?;
        for (row, (_, ends)) in rows.iter().enumerate() {
            for &(k, joint, _) in &drives {
                let [first, last] = self.data.plans()[joint].target_range;
                let refuse = |column: usize, expected: String| {
                    Err(Error::OutOfRange { argument, row, column, item: of(column), value: ends[column], expected })
                };
                let (low, high) = (2 * k, 2 * k + 1);
                if let Some(column) = [low, high].into_iter().find(|&c| !(first..=last).contains(&ends[c])) {
                    return refuse(column, format!("{first} to {last}, the limits that the robot was added with"));
                }
                if ends[low] > ends[high] {
                    return refuse(low, format!("at most the upper end, {}", ends[high]));
                }
                // The range must contain a finite target.
                if ends[low] == f64::INFINITY {
                    return refuse(low, "a number below infinity".into());
                }
                if ends[high] == f64::NEG_INFINITY {
                    return refuse(high, "a number above minus infinity".into());
                }
            }
        }
        for (env, ends) in rows.iter() {
            self.simulation.batch.edit_row(env, |env, _| {
                for &(k, _, drive) in &drives {
                    env.drives.set_range(drive, [ends[2 * k], ends[2 * k + 1]]);
                }
            });
        }
        Ok(())
    }

    /// Sets the speed limits of drives \[rad/s or m/s\], infinite for no limit. Rows and columns as in
    /// [`set_stiffness`](Self::set_stiffness).
    ///
    /// The limits are for planners and rewards, which read them with [`qvel_limits`](Robot::qvel_limits). Neither
    /// MuJoCo nor the drive law enforces them. The actuator model [`DcMotor`](crate::DcMotor) uses the limit as its
    /// no-load speed. A torque-speed line that is too steep for the time step causes no warning here.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, a value that is negative or NaN, or that the actuator
    /// model does not accept; a joint without a drive. Then nothing is set.
    #[doc(alias = "max_velocity")]
    pub fn set_qvel_limits<'t>(
        &mut self,
        limits: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked_numbers("set_qvel_limits", NumberKind::Limit, limits.into(), joint_ids, env_ids)?;
        let drives = self.drives_of_joints("set_qvel_limits", &write.joints)?;
        let change = |gains: Gains, max_velocity| Gains { max_velocity, ..gains };
        self.check_models("set_qvel_limits", &write, &drives, change)?;
        self.change_drives(&write, &drives, |drives, drive, max_velocity| {
            drives.set_limits(drive, |gains| change(gains, max_velocity));
        });
        Ok(())
    }

    /// Sets the effort limits of drives \[N m or N\], infinite for no limit. Rows and columns as in
    /// [`set_stiffness`](Self::set_stiffness). The sum of the drive's effort and the effort of
    /// [`set_qf_target`](Self::set_qf_target) is clamped to them.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, a value that is negative or NaN, or that the actuator
    /// model does not accept ([`DcMotor`](crate::DcMotor) needs a finite limit). A joint without a drive, or with a
    /// drive of [`DriveModel::Actuator`](crate::DriveModel::Actuator). Then nothing is set.
    #[doc(alias = "max_effort")]
    pub fn set_qf_limits<'t>(
        &mut self,
        limits: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let argument = "set_qf_limits";
        let write = self.checked_numbers(argument, NumberKind::Limit, limits.into(), joint_ids, env_ids)?;
        let drives = self.changeable_drives(argument, &write.joints)?;
        self.check_models(argument, &write, &drives, |gains, max_effort| Gains { max_effort, ..gains })?;
        self.change_drives(&write, &drives, DriveState::set_max_effort);
        Ok(())
    }

    /// Checks that the explicit models of `drives` accept the limits that `change` gives them.
    fn check_models(
        &self,
        argument: &'static str,
        write: &JointRows<'_>,
        drives: &[(usize, usize, usize)],
        change: impl Fn(Gains, f64) -> Gains,
    ) -> Result<()> {
        let table = self.simulation.batch.read_row(0, |env| Arc::clone(env.drives.table()));
        for (row, (_, values)) in write.rows.iter().enumerate() {
            for &(column, joint, drive) in drives {
                let Some(explicit) = table.model_of(drive) else { continue };
                let value = values[column];
                explicit.model.law().check(&change(table.drives[drive].initial, value)).map_err(|expected| {
                    let item = format!("joint {:?}", self.data.joint_names()[joint]);
                    let expected = format!("accepted by its drive model: {expected}");
                    Error::OutOfRange { argument, row, column, item, value, expected }
                })?;
            }
        }
        Ok(())
    }
}
