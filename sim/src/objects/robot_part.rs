//! Control part of a robot, commanded by its name.

use super::robot::RobotMut;
use super::robot_data::JointIndex;
use crate::error::Result;
use crate::ids::EnvId;
use ndarray::{AsArray, Ix2};

/// Write access to a control part of a robot, like [`RobotMut`] with the `joint_ids` of the part. The columns of all
/// values are the part's joints, mimic joints included, in the order of [`joint_ids`](Self::joint_ids).
#[derive(Debug)]
pub struct RobotPartMut<'a> {
    robot: RobotMut<'a>,
    joints: Vec<JointIndex>,
}

impl<'a> RobotMut<'a> {
    /// Selects the control part `name`.
    ///
    /// # Errors
    /// The part does not exist; the error lists the existing parts.
    pub fn into_part(self, name: &str) -> Result<RobotPartMut<'a>> {
        let joints = self.read().joint_ids(name)?;
        Ok(RobotPartMut { robot: self, joints })
    }
}

impl RobotPartMut<'_> {
    /// Columns of the part's joints among those of the robot.
    pub fn joint_ids(&self) -> &[JointIndex] {
        &self.joints
    }

    /// Sets position targets \[rad or m\], clamped to [`qpos_limits`](crate::Robot::qpos_limits): rows for `env_ids`
    /// (`None` for all environments; a single row applies to all of them), a column for each joint of the part. Columns
    /// of joints without a drive (passive and mimic joints) are accepted and ignored.
    ///
    /// # Errors
    /// Same errors as [`RobotMut::set_qpos_target`]; then nothing is set.
    #[doc(alias = "set_qpos")]
    pub fn set_qpos_target<'t>(
        &mut self,
        targets: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.robot.set_qpos_target(targets, Some(&self.joints), env_ids)
    }

    /// Sets velocity targets \[rad/s or m/s\], which stay until changed or reset; rows and columns as in
    /// [`set_qpos_target`](Self::set_qpos_target).
    ///
    /// # Errors
    /// Same errors as [`RobotMut::set_qvel_target`]; then nothing is set.
    #[doc(alias = "set_qvel")]
    pub fn set_qvel_target<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.robot.set_qvel_target(velocities, Some(&self.joints), env_ids)
    }

    /// Sets efforts \[N m or N\] that are added to the efforts of the drives. They stay until changed or reset. Rows
    /// and columns as in [`set_qpos_target`](Self::set_qpos_target).
    ///
    /// # Errors
    /// Same errors as [`RobotMut::set_qf_target`]; then nothing is set.
    #[doc(alias = "set_qf")]
    pub fn set_qf_target<'t>(&mut self, efforts: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.robot.set_qf_target(efforts, Some(&self.joints), env_ids)
    }
}
