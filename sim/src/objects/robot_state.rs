//! Names, targets, accelerations, and states of the root and the links of a robot.

use crate::batch::StoredBodies;
use crate::body_pose::{BodyArrays, BodyFrame, body_pose};
use crate::capture::body_velocity;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::indexing::RobotIndexing;
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::robot_data::JointIndex;
use crate::objects::rows::NumberKind;
use crate::pattern::{self, PatternError};
use crate::row::{RowPart, StateArray, StoredRow};
use kinetoscope_robot::description::LinkId;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use nalgebra::Vector3;
use ndarray::{Array1, Array2, Array3, AsArray, Axis, Ix2, concatenate};

/// Names and indices of joints and links.
impl Robot<'_> {
    /// Finds the joints whose names match `patterns` (whole names, case-sensitive): in joint order within a pattern,
    /// patterns one after the other.
    ///
    /// # Errors
    /// An invalid pattern, or a pattern without a match, with the nearest names; a joint that two patterns match.
    pub fn find_joints<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<JointIndex>> {
        let found = pattern::select(patterns, self.joint_names(), "joint").map_err(|error| self.name_error(error))?;
        Ok(found.into_iter().map(JointIndex).collect())
    }

    /// Finds the links whose names match `patterns`, fused links included; otherwise as
    /// [`find_joints`](Self::find_joints). A [`LinkId`] is the index of the link in [`link_names`](Self::link_names)
    /// and on the second axis of [`link_poses`](Self::link_poses).
    ///
    /// # Errors
    /// Same errors as [`find_joints`](Self::find_joints).
    pub fn find_links<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<LinkId>> {
        let found = pattern::select(patterns, &self.link_names(), "link").map_err(|error| self.name_error(error))?;
        Ok(found.into_iter().map(LinkId).collect())
    }

    /// Names of all joints except mimic joints, in joint order.
    pub fn active_joint_names(&self) -> Vec<&str> {
        self.active_joints().map(|joint| self.joint_names()[joint.0].as_str()).collect()
    }

    /// Indices of the mimic joints in [`joint_names`](Self::joint_names). [`mimic_drivers`](Self::mimic_drivers) has
    /// the driver, multiplier and offset of every joint.
    #[doc(alias = "mimic_ids")]
    pub fn mimic_joint_ids(&self) -> Vec<JointIndex> {
        (0..self.dof()).map(JointIndex).filter(|joint| self.data.plans()[joint.0].mimic.is_some()).collect()
    }

    /// Number of joints except mimic joints, passive joints included.
    pub fn active_dof(&self) -> usize {
        self.active_joints().count()
    }

    /// True if a joint has a drive, for which [`set_qpos_target`](crate::RobotMut::set_qpos_target) sets a target.
    /// Passive joints and joints that follow another have no drive. A drive that
    /// [`set_drive_type`](crate::RobotMut::set_drive_type) switched to `None` still counts.
    ///
    /// # Errors
    /// The joint does not exist.
    pub fn is_driven(&self, joint: JointIndex) -> Result<bool> {
        Ok(self.plan(joint)?.actuator.is_some())
    }

    /// Indices of the joints of a control part except mimic joints, in the order of its patterns. `None` selects from
    /// all joints. It is equivalent to EmbodiChain's `get_joint_ids` with `remove_mimic`.
    ///
    /// # Errors
    /// The part does not exist; the error lists the existing parts.
    #[doc(alias = "remove_mimic")]
    #[doc(alias = "get_active_joint_ids")]
    pub fn active_joint_ids<'p>(&self, part: impl Into<Option<&'p str>>) -> Result<Vec<JointIndex>> {
        let mut joints = self.joint_ids(part)?;
        joints.retain(|joint| self.data.plans()[joint.0].mimic.is_none());
        Ok(joints)
    }

    fn active_joints(&self) -> impl Iterator<Item = JointIndex> {
        (0..self.dof()).map(JointIndex).filter(|joint| self.data.plans()[joint.0].mimic.is_none())
    }

    fn name_error(&self, error: PatternError) -> Error {
        Error::RobotNames { robot: self.data.label(), error: Box::new(error) }
    }
}

/// Accelerations and targets of joints.
impl Robot<'_> {
    /// Joint accelerations that MuJoCo's solver found in the last step \[rad/s² or m/s²\] (`qacc`), shape (N, dof); 0
    /// before the first step and after a reset. The solver computes them from positions, velocities and forces. A write
    /// to the state leaves them unchanged until the next step, or until [`write_qacc`](RobotMut::write_qacc).
    ///
    /// With the integrator Euler and [`DriveModel::Implicit`](crate::DriveModel::Implicit) they are the change of the
    /// velocity in the last MuJoCo step of length h, (v' - v) / h. They differ from (v' - v) / h in three cases. With
    /// [`DriveModel::Actuator`](crate::DriveModel::Actuator), MuJoCo integrates viscous joint damping B implicitly: v'
    /// = v + h M a / (M + h B) for a single joint. The integrators implicit and implicitfast add further velocity
    /// terms. With RK4 they are the accelerations of an intermediate stage. In all these cases, compute accelerations
    /// from differences of [`qvel`](Robot::qvel).
    #[doc(alias = "get_qacc")]
    pub fn qacc(&self) -> Array2<f64> {
        // The warm start is the acceleration of the last step, and a new forward pass keeps it.
        self.joint_states(StateArray::Accelerations, |joint| joint.dof)
    }

    /// Velocity targets \[rad/s or m/s\], shape (N, dof); 0 for joints without a drive.
    #[doc(alias = "get_target_qvel")]
    pub fn qvel_target(&self) -> Array2<f64> {
        self.gather(RowPart::Inputs, |env, joint| joint.drive.map_or(0.0, |drive| env.drives.velocity[drive]))
    }

    /// Effort targets of [`set_qf_target`](RobotMut::set_qf_target) as set, not clamped \[N m or N\], shape (N, dof); 0
    /// for mimic joints. Only the effort of a passive joint is clamped to its limit.
    #[doc(alias = "get_target_qf")]
    pub fn qf_target(&self) -> Array2<f64> {
        self.gather(RowPart::Inputs, |env, joint| match joint.drive {
            Some(drive) => env.drives.feedforward[drive],
            None => env.drives.applied[joint.dof],
        })
    }
}

/// State of the root link.
impl Robot<'_> {
    /// Initial pose, velocity and angular velocity of the root link in the layout of [`root_state`](Self::root_state),
    /// shape (N, 13): the pose of [`default_root_pose`](Self::default_root_pose), at rest.
    #[doc(alias = "get_default_root_state")]
    pub fn default_root_state(&self) -> Array2<f64> {
        let pose = to_row(&self.data.root_pose());
        let n = self.simulation.batch.num_envs();
        Array2::from_shape_fn((n, 13), |(_, k)| pose.get(k).copied().unwrap_or(0.0))
    }

    /// Pose of the root link in the environment, then the velocity of its frame and its angular velocity in world axes:
    /// rows `[x, y, z, qw, qx, qy, qz, vx, vy, vz, wx, wy, wz]` \[m, m/s, rad/s\], shape (N, 13).
    #[doc(alias = "get_root_state")]
    pub fn root_state(&self) -> Array2<f64> {
        // Both arrays have one row for each environment.
        concatenate(Axis(1), &[self.root_pose().view(), self.root_velocity().view()]).unwrap_or_default()
    }

    /// Center of mass of the root link and of the links fixed to it, in the environment \[m\], shape (N, 3).
    #[doc(alias = "get_root_com_position")]
    pub fn root_com_position(&self) -> Array2<f64> {
        self.rows(|bodies, robot| root_center_of_mass(bodies, robot).into())
    }

    /// Velocity of the center of mass of the root link and of the links fixed to it, then its angular velocity, in
    /// world axes \[m/s, rad/s\], shape (N, 6); 0 for a fixed base. [`root_velocity`](Self::root_velocity) is the
    /// velocity of the link's frame.
    #[doc(alias = "get_root_com_velocity")]
    pub fn root_com_velocity(&self) -> Array2<f64> {
        self.rows(|bodies, robot| {
            let [v, w] = body_velocity(bodies, robot.root.body, &root_center_of_mass(bodies, robot));
            [v.x, v.y, v.z, w.x, w.y, w.z]
        })
    }

    /// Velocity of the root link's frame in its own axes \[m/s\], shape (N, 3), as an ideal velocity sensor on the root
    /// would measure it.
    #[doc(alias = "get_root_lin_vel_b")]
    pub fn root_lin_vel_b(&self) -> Array2<f64> {
        self.in_root_axes(|bodies, robot, root| body_velocity(bodies, robot.root.body, &root.translation.vector)[0])
    }

    /// Angular velocity of the root link in its own axes \[rad/s\], shape (N, 3), as an ideal gyroscope would measure
    /// it.
    #[doc(alias = "get_root_ang_vel_b")]
    pub fn root_ang_vel_b(&self) -> Array2<f64> {
        self.in_root_axes(|bodies, robot, root| body_velocity(bodies, robot.root.body, &root.translation.vector)[1])
    }

    /// Direction of gravity in the axes of the root link, a unit vector, shape (N, 3): (0, 0, -1) for an upright root;
    /// 0 without gravity.
    #[doc(alias = "get_projected_gravity_b")]
    pub fn projected_gravity_b(&self) -> Array2<f64> {
        self.in_root_axes(|bodies, _, _| direction_of_gravity(bodies))
    }

    /// Heading of the root link \[rad\], shape (N,): the angle about the world's z of its x axis, from -π to π.
    #[doc(alias = "get_root_heading")]
    pub fn root_heading(&self) -> Array1<f64> {
        let headings = self.rows(|bodies, robot| [heading(&body_pose(bodies, robot.root.body))]);
        headings.index_axis(Axis(1), 0).to_owned()
    }

    fn in_root_axes(
        &self,
        of: impl Fn(&StoredBodies<'_>, &RobotIndexing, &Pose) -> Vector3<f64> + Sync,
    ) -> Array2<f64> {
        self.rows(|bodies, robot| {
            let root = body_pose(bodies, robot.root.body);
            root.rotation.inverse_transform_vector(&of(bodies, robot, &root)).into()
        })
    }

    fn rows<const K: usize>(&self, read: impl Fn(&StoredBodies<'_>, &RobotIndexing) -> [f64; K] + Sync) -> Array2<f64> {
        let robot = self.indexing();
        self.simulation.batch.body_rows(|bodies| read(bodies, robot))
    }
}

/// States of links.
impl Robot<'_> {
    /// Poses of all links, fused links included, in the order of [`link_names`](Self::link_names): rows `[x, y, z, qw,
    /// qx, qy, qz]` in the environment \[m\], shape (N, links, 7).
    #[doc(alias = "get_link_poses")]
    pub fn link_poses(&self) -> Array3<f64> {
        self.of_links(|bodies, link| to_row(&link.pose(bodies)))
    }

    /// Linear velocities of the origins of all link frames, then angular velocities, in world axes \[m/s, rad/s\],
    /// shape (N, links, 6). Fused links are included.
    #[doc(alias = "get_link_velocities")]
    pub fn link_velocities(&self) -> Array3<f64> {
        self.of_links(link_velocity)
    }

    /// Linear velocity of the origin of a link frame, then angular velocity, in world axes \[m/s, rad/s\], shape (N,
    /// 6). Fused links are supported.
    ///
    /// # Errors
    /// The link does not exist; the error lists the nearest names.
    pub fn link_velocity(&self, name: &str) -> Result<Array2<f64>> {
        let link = self.link_id(name)?;
        Ok(self.rows(|bodies, robot| link_velocity(bodies, &robot.links[link.0])))
    }

    fn of_links<const K: usize>(&self, read: impl Fn(&StoredBodies<'_>, &BodyFrame) -> [f64; K] + Sync) -> Array3<f64> {
        self.simulation.batch.body_rows_of(&self.indexing().links, read)
    }
}

fn link_velocity(bodies: &StoredBodies<'_>, link: &BodyFrame) -> [f64; 6] {
    let [v, w] = body_velocity(bodies, link.body, &link.pose(bodies).translation.vector);
    [v.x, v.y, v.z, w.x, w.y, w.z]
}

/// Direction of gravity in world axes, a unit vector; 0 without gravity.
pub(super) fn direction_of_gravity(row: &StoredRow<'_>) -> Vector3<f64> {
    Vector3::from(row.gravity()).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
}

/// Angle about the world's z of the x axis of a frame \[rad\].
pub(super) fn heading(frame: &Pose) -> f64 {
    let forward = frame.rotation * Vector3::x();
    forward.y.atan2(forward.x)
}

fn root_center_of_mass(bodies: &StoredBodies<'_>, robot: &RobotIndexing) -> Vector3<f64> {
    Vector3::from_column_slice(&bodies.xipos()[3 * robot.root.body..3 * robot.root.body + 3])
}

impl RobotMut<'_> {
    /// Writes the accelerations that [`qacc`](Robot::qacc) reads \[rad/s² or m/s²\], from which MuJoCo's solver starts
    /// in the next step (its warm start, and `qacc`). Rows and columns as in [`write_qpos`](Self::write_qpos).
    ///
    /// Accelerations are a result, not a state: each step computes its own from positions, velocities and forces,
    /// within the solver's tolerance from any start, and replaces these. To push a joint, use
    /// [`set_qf_target`](Self::set_qf_target).
    ///
    /// Written together with the positions and velocities of a robot in another simulation, they let this robot
    /// continue bit-identically to that robot. This holds for a fixed base, without contact to other moving bodies, and
    /// for equal targets. In all other cases, use [`snapshot`](crate::SimulationManager::snapshot).
    ///
    /// # Errors
    /// Same errors as [`write_qpos`](Self::write_qpos); an acceleration beyond ±1e10, which MuJoCo treats as
    /// divergence.
    pub fn write_qacc<'t>(
        &mut self,
        accelerations: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (argument, numbers) = ("write_qacc", NumberKind::Acceleration);
        let write = self.checked_numbers(argument, numbers, accelerations.into(), joint_ids, env_ids)?;
        let addresses = self.addresses(|joint| joint.dof);
        self.write_joints(&write, |data, joint, value| {
            data.qacc_mut()[addresses[joint]] = value;
            data.qacc_warmstart_mut()[addresses[joint]] = value;
        });
        Ok(())
    }

    /// Sets the velocity of the center of mass of the root link and of the links fixed to it, and its angular velocity,
    /// in world axes: rows of 6 \[m/s, rad/s\], as in [`write_root_velocity`](Self::write_root_velocity), which takes
    /// the velocity of the link's frame.
    ///
    /// # Errors
    /// Same errors as [`write_root_velocity`](Self::write_root_velocity).
    pub fn write_root_com_velocity<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let body = self.simulation.robots[self.index].root.body;
        // The origin of the frame is at `arm` from the center of mass: v_frame = v_com + w x arm.
        self.root().write_velocities_of("write_root_com_velocity", velocities.into(), env_ids, |data| {
            let com = Vector3::from_column_slice(&data.xipos()[3 * body..3 * body + 3]);
            body_pose(data, body).translation.vector - com
        })
    }
}
