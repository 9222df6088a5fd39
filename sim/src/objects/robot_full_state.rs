//! Complete states of a robot in one call, as in Isaac Lab: root pose with velocity, joint positions with velocities.

use crate::error::Result;
use crate::ids::EnvId;
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::robot_data::JointIndex;
use nalgebra::Vector3;
use ndarray::{Array2, ArrayView2, AsArray, Axis, Ix2};

impl Robot<'_> {
    /// Initial velocities of the joints: zero, shape (N, dof).
    #[doc(alias = "get_default_qvel")]
    pub fn default_qvel(&self) -> Array2<f64> {
        Array2::zeros((self.simulation.batch.num_envs(), self.dof()))
    }
}

impl RobotMut<'_> {
    /// Writes pose and velocity of the root link of a robot without a fixed base: rows of 13 as in
    /// [`root_state`](Robot::root_state), for `env_ids` (`None` for all environments; a single row applies to all of
    /// them). Poses are relative to the environment: `env_origins` are not added.
    ///
    /// # Errors
    /// Same errors as [`write_root_pose`](Self::write_root_pose); then nothing is written.
    pub fn write_root_state<'t>(
        &mut self,
        states: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let states: ArrayView2<'_, f64> = states.into();
        let mut root = self.root();
        root.check_columns(
            "write_root_state",
            13,
            "environments, x y z qw qx qy qz vx vy vz wx wy wz",
            states,
            env_ids,
        )?;
        let (poses, velocities) = states.split_at(Axis(1), 7);
        let poses = root.check_poses("write_root_state", poses, env_ids)?;
        let velocities = root.check_velocities("write_root_state", velocities, env_ids)?;
        root.write_checked_poses(&poses)?;
        root.write_checked_velocities(&velocities, |_| Vector3::zeros());
        root.refresh_sensors(&poses);
        Ok(())
    }

    /// Writes positions and velocities of joints: as [`write_qpos`](Self::write_qpos) and
    /// [`write_qvel`](Self::write_qvel), shape (N, joints) each.
    ///
    /// # Errors
    /// Same errors as [`write_qpos`](Self::write_qpos), for either argument; then nothing is written.
    pub fn write_joint_state<'t, 'v>(
        &mut self,
        positions: impl AsArray<'t, f64, Ix2>,
        velocities: impl AsArray<'v, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (positions, velocities): (ArrayView2<'_, f64>, ArrayView2<'_, f64>) = (positions.into(), velocities.into());
        for (argument, values) in
            [("write_joint_state (positions)", positions), ("write_joint_state (velocities)", velocities)]
        {
            self.checked_rows(argument, values, joint_ids, env_ids)?;
        }
        self.write_qpos(positions, joint_ids, env_ids)?;
        self.write_qvel(velocities, joint_ids, env_ids)
    }
}
