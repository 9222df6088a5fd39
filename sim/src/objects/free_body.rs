//! Poses and velocities of bodies that are placed in the world: objects and root links of robots.

use crate::batch::StoredBodies;
use crate::body_pose::body_pose;
use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::indexing::BodyIndexing;
use crate::objects::rows::{ArgumentSpec, EnvRows, unique_envs};
use crate::randomization::Property;
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use kinetoscope_mujoco as mj;
use kinetoscope_scene::pose::{from_row, to_row};
use nalgebra::Vector3;
use ndarray::{Array2, ArrayView2};

/// Read access to one body in all environments.
#[derive(Clone, Copy)]
pub(super) struct FreeBody<'a> {
    pub(super) simulation: &'a Simulation,
    pub(super) index: BodyIndexing,
}

impl FreeBody<'_> {
    /// Poses `[x, y, z, qw, qx, qy, qz]` in the environment \[m\], shape (N, 7).
    pub(super) fn poses(&self) -> Array2<f64> {
        self.rows(|bodies| to_row(&body_pose(bodies, self.index.body)))
    }

    /// Velocities of the frame, then angular velocities, in world axes, shape (N, 6); 0 for a body without a free
    /// joint.
    pub(super) fn velocities(&self) -> Array2<f64> {
        self.rows(|bodies| world_velocity(bodies, self.index))
    }

    fn rows<const K: usize>(&self, read: impl Fn(&StoredBodies<'_>) -> [f64; K] + Sync) -> Array2<f64> {
        self.simulation.batch.body_rows(read)
    }
}

/// Velocity of the frame of a body, then its angular velocity, in world axes; 0 for a body without a free joint.
pub(super) fn world_velocity(bodies: &StoredBodies<'_>, index: BodyIndexing) -> [f64; 6] {
    let Some((_, dof)) = index.free_joint else { return [0.0; 6] };
    let v = &bodies.qvel()[dof..dof + 6];
    // MuJoCo stores the angular velocity of a free joint in the axes of the body.
    let angular = body_pose(bodies, index.body).rotation * Vector3::new(v[3], v[4], v[5]);
    [v[0], v[1], v[2], angular.x, angular.y, angular.z]
}

/// Storage of the pose of a body that can be placed.
#[derive(Clone, Copy)]
enum PoseStorage {
    /// Indices of the first position and the first degree of freedom of its free joint.
    Joint(usize, usize),
    /// Mocap index of the body.
    Mocap(usize),
    /// Model of each environment.
    Model,
}

/// Checked poses with unit quaternions, by environment.
pub(super) struct CheckedPoses {
    place: PoseStorage,
    rows: Vec<(usize, [f64; 7])>,
}

/// Checked velocities of the six degrees of freedom from `dof` on, by environment.
pub(super) struct CheckedVelocities {
    dof: usize,
    rows: Vec<(usize, [f64; 6])>,
}

/// Write access to one body in all environments.
pub(super) struct FreeBodyMut<'a> {
    pub(super) simulation: &'a mut Simulation,
    pub(super) sensors: &'a mut SensorList,
    pub(super) index: BodyIndexing,
    /// Owner of the body in error messages.
    pub(super) owner: &'a str,
}

impl FreeBodyMut<'_> {
    /// Writes poses, rows `[x, y, z, qw, qx, qy, qz]`. Quaternions are normalized; velocities in world axes are
    /// preserved.
    pub(super) fn write_poses(
        &mut self,
        argument: &'static str,
        poses: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let poses = self.check_poses(argument, poses, env_ids)?;
        self.write_checked_poses(&poses)?;
        let envs: Vec<usize> = poses.rows.iter().map(|(env, _)| *env).collect();
        self.sensors.refresh(&envs, self.simulation);
        Ok(())
    }

    /// Checks poses before they are written.
    pub(super) fn check_poses(
        &self,
        argument: &'static str,
        poses: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<CheckedPoses> {
        let place = self.pose_storage()?;
        let rows = self.check(argument, 7, "environments, x y z qw qx qy qz", poses, env_ids)?;
        for (row, (_, pose)) in rows.arrays::<7>().enumerate() {
            let norm = pose[3..].iter().map(|q| q * q).sum::<f64>().sqrt();
            if !(norm > 1e-9 && norm.is_finite()) {
                return Err(Error::Config {
                    field: argument,
                    value: format!("{:?} in row {row}", &pose[3..]),
                    expected: "the last four numbers must be a quaternion w, x, y, z with a finite length above 0",
                });
            }
        }
        Ok(CheckedPoses {
            place,
            rows: rows.arrays::<7>().map(|(env, pose)| (env, to_row(&from_row(&pose)))).collect(),
        })
    }

    /// Writes checked poses; the caller refreshes the sensors. MuJoCo may still reject the poses of a static object;
    /// then no pose is written.
    pub(super) fn write_checked_poses(&mut self, poses: &CheckedPoses) -> Result<()> {
        let (place, body) = (poses.place, self.index.body);
        if matches!(place, PoseStorage::Model) {
            let envs: Vec<usize> = poses.rows.iter().map(|(env, _)| *env).collect();
            // Environments are visited in this order.
            let mut rows = poses.rows.iter();
            return self.simulation.change_properties(&envs, |_, properties| {
                let Some((_, row)) = rows.next() else { return Ok(()) };
                properties.set(Property::Position, self.owner, &row[..3])?;
                properties.set(Property::Rotation, self.owner, &row[3..])
            });
        }
        for &(env, row) in &poses.rows {
            self.simulation.batch.write_at(env, Stage::Kinematics, |env| {
                env.write_state(|data| match place {
                    PoseStorage::Joint(qpos, dof) => {
                        // The angular velocity is preserved in world axes, as it is read; MuJoCo stores it in the axes
                        // of the body.
                        let before = body_pose(data, body).rotation;
                        let turned = from_row(&row).rotation.inverse() * before;
                        let v = &mut data.qvel_mut()[dof + 3..dof + 6];
                        let angular = turned * Vector3::new(v[0], v[1], v[2]);
                        if before.coords != from_row(&row).rotation.coords {
                            v.copy_from_slice(angular.as_slice());
                        }
                        data.qpos_mut()[qpos..qpos + 7].copy_from_slice(&row);
                    }
                    PoseStorage::Mocap(mocap) => {
                        data.mocap_pos_mut()[3 * mocap..3 * mocap + 3].copy_from_slice(&row[..3]);
                        data.mocap_quat_mut()[4 * mocap..4 * mocap + 4].copy_from_slice(&row[3..]);
                    }
                    PoseStorage::Model => {}
                });
            });
        }
        Ok(())
    }

    /// Writes velocities of the frame, then angular velocities, in world axes.
    pub(super) fn write_velocities(
        &mut self,
        argument: &'static str,
        velocities: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.write_velocities_of(argument, velocities, env_ids, |_| Vector3::zeros())
    }

    /// Writes the velocities of a point of the body. `arm` is the vector from the point to the frame \[m\], in world
    /// axes.
    pub(super) fn write_velocities_of(
        &mut self,
        argument: &'static str,
        velocities: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
        arm: impl Fn(&mj::Data) -> Vector3<f64>,
    ) -> Result<()> {
        let velocities = self.check_velocities(argument, velocities, env_ids)?;
        self.write_checked_velocities(&velocities, arm);
        let envs: Vec<usize> = velocities.rows.iter().map(|(env, _)| *env).collect();
        self.sensors.refresh(&envs, self.simulation);
        Ok(())
    }

    /// Checks velocities before they are written.
    pub(super) fn check_velocities(
        &self,
        argument: &'static str,
        velocities: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<CheckedVelocities> {
        let dof = match self.pose_storage()? {
            PoseStorage::Joint(_, dof) => dof,
            PoseStorage::Mocap(_) => return Err(Error::NotDynamic { argument, object: self.owner.into() }),
            PoseStorage::Model => return Err(Error::FixedBody(self.owner.into())),
        };
        let rows = self.check(argument, 6, "environments, vx vy vz wx wy wz", velocities, env_ids)?;
        Ok(CheckedVelocities { dof, rows: rows.arrays::<6>().collect() })
    }

    /// Writes checked velocities as [`write_velocities_of`](Self::write_velocities_of) does; the caller refreshes the
    /// sensors.
    pub(super) fn write_checked_velocities(
        &mut self,
        velocities: &CheckedVelocities,
        arm: impl Fn(&mj::Data) -> Vector3<f64>,
    ) {
        let (dof, body) = (velocities.dof, self.index.body);
        for &(env, v) in &velocities.rows {
            self.simulation.batch.write_at(env, Stage::Kinematics, |env| {
                env.write_state(|data| {
                    let rotation = body_pose(data, body).rotation;
                    let turning = Vector3::new(v[3], v[4], v[5]);
                    let angular = rotation.inverse() * turning;
                    let [x, y, z] = (Vector3::new(v[0], v[1], v[2]) + turning.cross(&arm(data))).into();
                    data.qvel_mut()[dof..dof + 6].copy_from_slice(&[x, y, z, angular.x, angular.y, angular.z]);
                });
            });
        }
    }

    fn pose_storage(&self) -> Result<PoseStorage> {
        let BodyIndexing { free_joint, mocap, .. } = self.index;
        let joint = free_joint.map(|(qpos, dof)| PoseStorage::Joint(qpos, dof));
        // Among fixed bodies, only objects can be moved: the base of a robot is where its description says.
        let is_static =
            self.simulation.objects.iter().any(|object| object.is_static() && object.body == self.index.body);
        let place = joint.or(mocap.map(PoseStorage::Mocap)).or(is_static.then_some(PoseStorage::Model));
        place.ok_or_else(|| Error::FixedBody(self.owner.into()))
    }

    /// Checks the environments (each once), the shape and the numbers of an argument.
    pub(super) fn check_columns(
        &self,
        argument: &'static str,
        columns: usize,
        meaning: &'static str,
        values: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.check(argument, columns, meaning, values, env_ids).map(drop)
    }

    /// Refreshes the sensors in the environments of written poses.
    pub(super) fn refresh_sensors(&mut self, poses: &CheckedPoses) {
        let envs: Vec<usize> = poses.rows.iter().map(|(env, _)| *env).collect();
        self.sensors.refresh(&envs, self.simulation);
    }

    fn check<'v>(
        &self,
        argument: &'static str,
        columns: usize,
        meaning: &'static str,
        values: ArrayView2<'v, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<EnvRows<'v>> {
        let of = |_| format!("{:?}", self.owner);
        unique_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        EnvRows::check(
            ArgumentSpec { argument, meaning, columns, column_label: &of },
            values,
            env_ids,
            self.simulation.batch.num_envs(),
        )
    }
}
