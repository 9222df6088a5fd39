//! State of a robot in all environments, gathered in one pass over them.

use crate::batch::StoredBodies;
use crate::body_pose::body_pose;
use crate::capture::body_velocity;
use crate::indexing::RobotIndexing;
use crate::objects::free_body::world_velocity;
use crate::objects::robot::Robot;
use crate::objects::robot_state::{direction_of_gravity, heading};
use crate::row::{RowPart, StoredRow};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::{from_row, to_row};
use nalgebra::Vector3;
use ndarray::{Array2, ArrayView1, ArrayView2, s};

/// State of a robot in all environments, filled by [`Robot::gather_state`]. Arrays have one row per environment.
///
/// Gathering everything at once takes about as long as one of the methods of [`Robot`] with the same names, which
/// return new arrays.
#[derive(Clone, Debug)]
pub struct RobotState {
    /// Columns of the root, then those of the joints: positions, velocities, accelerations, efforts.
    values: Array2<f64>,
}

/// Number of columns of the root: pose, velocity, velocities and gravity in the axes of the root, heading.
const ROOT_COLUMNS: usize = 7 + 6 + 3 + 3 + 3 + 1;

impl Default for RobotState {
    /// No environment and no joint.
    fn default() -> Self {
        Self { values: Array2::zeros((0, ROOT_COLUMNS)) }
    }
}

impl RobotState {
    /// Columns from `first` on.
    fn columns(&self, first: usize, count: usize) -> ArrayView2<'_, f64> {
        self.values.slice(s![.., first..first + count])
    }

    /// Columns of a number of each joint.
    fn joint_columns(&self, index: usize) -> ArrayView2<'_, f64> {
        let dof = (self.values.ncols() - ROOT_COLUMNS) / 4;
        self.columns(ROOT_COLUMNS + index * dof, dof)
    }

    /// Pose of the root link in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn root_pose(&self) -> ArrayView2<'_, f64> {
        self.columns(0, 7)
    }

    /// Velocity of the root link's frame, then its angular velocity, in world axes \[m/s, rad/s\], shape (N, 6); 0 for
    /// a fixed base.
    pub fn root_velocity(&self) -> ArrayView2<'_, f64> {
        self.columns(7, 6)
    }

    /// Velocity of the root link's frame in its own axes \[m/s\], shape (N, 3).
    pub fn root_lin_vel_b(&self) -> ArrayView2<'_, f64> {
        self.columns(13, 3)
    }

    /// Angular velocity of the root link in its own axes \[rad/s\], shape (N, 3).
    pub fn root_ang_vel_b(&self) -> ArrayView2<'_, f64> {
        self.columns(16, 3)
    }

    /// Direction of gravity in the axes of the root link, a unit vector, shape (N, 3); 0 without gravity.
    pub fn projected_gravity_b(&self) -> ArrayView2<'_, f64> {
        self.columns(19, 3)
    }

    /// Heading of the root link \[rad\], shape (N,): the angle about the world's z of its x axis, from -π to π.
    pub fn root_heading(&self) -> ArrayView1<'_, f64> {
        self.values.column(22)
    }

    /// Joint positions \[rad or m\], shape (N, dof).
    pub fn qpos(&self) -> ArrayView2<'_, f64> {
        self.joint_columns(0)
    }

    /// Joint velocities \[rad/s or m/s\], shape (N, dof).
    pub fn qvel(&self) -> ArrayView2<'_, f64> {
        self.joint_columns(1)
    }

    /// Joint accelerations of the last MuJoCo step \[rad/s² or m/s²\], shape (N, dof); see [`Robot::qacc`].
    pub fn qacc(&self) -> ArrayView2<'_, f64> {
        self.joint_columns(2)
    }

    /// Efforts of the drives in the last MuJoCo step \[N m or N\], shape (N, dof); see [`Robot::qf`].
    pub fn qf(&self) -> ArrayView2<'_, f64> {
        self.joint_columns(3)
    }
}

impl Robot<'_> {
    /// Fills `state` with the current state of the robot in all environments, on all threads. The memory of `state` is
    /// reused. The values are those of the methods with the same names, up to rounding of the root's: with a free base,
    /// they are computed from the generalized positions and velocities alone, without forward kinematics.
    pub fn gather_state(&self, state: &mut RobotState) {
        let size = (self.simulation.batch.num_envs(), ROOT_COLUMNS + 4 * self.dof());
        if state.values.dim() != size {
            state.values = Array2::zeros(size);
        }
        let (batch, indexing) = (&self.simulation.batch, self.indexing());
        let Some(values) = state.values.as_slice_mut() else { return };
        match indexing.root.free_joint {
            Some((qpos, dof)) => batch.read_stored(RowPart::All, values, |row, out| {
                let (root, joints) = out.split_at_mut(ROOT_COLUMNS);
                root.copy_from_slice(&free_root_values(row, qpos, dof));
                read_joints(row, indexing, joints);
            }),
            None => batch.read_bodies(values, |_, bodies, out| {
                let (root, joints) = out.split_at_mut(ROOT_COLUMNS);
                root.copy_from_slice(&root_values(bodies, indexing));
                read_joints(bodies, indexing, joints);
            }),
        }
    }
}

/// Reads the columns of the joints.
fn read_joints(row: &StoredRow<'_>, robot: &RobotIndexing, out: &mut [f64]) {
    let dof = robot.joints.len();
    let (qpos, qvel, qacc) = (row.raw_qpos(), row.qvel(), row.qacc_warmstart());
    for (k, joint) in robot.joints.iter().enumerate() {
        let effort = joint.drive.map_or(0.0, |drive| row.drives.effort[drive]);
        for (index, value) in [qpos[joint.qpos], qvel[joint.dof], qacc[joint.dof], effort].into_iter().enumerate() {
            out[index * dof + k] = value;
        }
    }
}

/// Columns of a root with a free joint, from the addresses of its positions and velocities.
fn free_root_values(row: &StoredRow<'_>, qpos: usize, dof: usize) -> [f64; ROOT_COLUMNS] {
    let root = from_row(&std::array::from_fn(|k| row.raw_qpos()[qpos + k]));
    let v = &row.qvel()[dof..dof + 6];
    // MuJoCo stores the angular velocity of a free joint in the axes of the body.
    let (linear, angular_b) = (Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5]));
    let velocity = [linear, root.rotation * angular_b];
    columns_of_root(&root, velocity, root.rotation.inverse_transform_vector(&linear), angular_b, row)
}

/// Columns of a root that cannot be placed.
fn root_values(bodies: &StoredBodies<'_>, robot: &RobotIndexing) -> [f64; ROOT_COLUMNS] {
    let root = body_pose(bodies, robot.root.body);
    let v = world_velocity(bodies, robot.root);
    let in_axes = body_velocity(bodies, robot.root.body, &root.translation.vector)
        .map(|velocity| root.rotation.inverse_transform_vector(&velocity));
    let velocity = [Vector3::new(v[0], v[1], v[2]), Vector3::new(v[3], v[4], v[5])];
    columns_of_root(&root, velocity, in_axes[0], in_axes[1], bodies)
}

/// Columns of a root with this pose, velocity in world axes, and velocities in its own axes.
fn columns_of_root(
    root: &Pose,
    velocity: [Vector3<f64>; 2],
    linear_b: Vector3<f64>,
    angular_b: Vector3<f64>,
    row: &StoredRow<'_>,
) -> [f64; ROOT_COLUMNS] {
    let gravity_b = root.rotation.inverse_transform_vector(&direction_of_gravity(row));
    let mut columns = [0.0; ROOT_COLUMNS];
    columns[..7].copy_from_slice(&to_row(root));
    let vectors = [velocity[0], velocity[1], linear_b, angular_b, gravity_b];
    for (to, vector) in columns[7..22].chunks_exact_mut(3).zip(&vectors) {
        to.copy_from_slice(vector.as_slice());
    }
    columns[22] = heading(root);
    columns
}
