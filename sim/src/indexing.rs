//! Indices of entities in MuJoCo's arrays.

use crate::body_pose::BodyFrame;
use kinetoscope_mujoco as mj;

/// Indices of one robot in MuJoCo's arrays.
#[derive(Clone, Debug)]
pub(crate) struct RobotIndexing {
    /// Addresses of each joint with one degree of freedom, mimic joints and joints without a drive included, in the
    /// order of `joint_names`.
    pub joints: Vec<JointIndexing>,
    /// Frame of each link, in the order of `link_names`.
    pub links: Vec<BodyFrame>,
    /// The body of the root link.
    pub root: BodyIndexing,
    /// All geoms of the robot, for collision and for visuals.
    pub geoms: Vec<GeomIndexing>,
}

/// A geom of a robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GeomIndexing {
    /// Index in MuJoCo's geom arrays.
    pub geom: usize,
    /// Index, in the robot's list of links, of the link that owns the geom.
    pub link: usize,
    /// Index of the visual that the geom represents; `None` for a collision geom, and for every geom of an MJCF robot.
    pub visual: Option<usize>,
}

/// Indices of a free, mocap or fixed body in MuJoCo's arrays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyIndexing {
    pub body: usize,
    /// Address of its seven positions and of its six velocities; `None` without a free joint.
    pub free_joint: Option<(usize, usize)>,
    /// Mocap index; `None` for a body without mocap pose.
    pub mocap: Option<usize>,
}

impl BodyIndexing {
    /// True if the body has neither a free joint nor a mocap pose.
    pub(crate) fn is_static(&self) -> bool {
        self.free_joint.is_none() && self.mocap.is_none()
    }
}

/// Addresses of one joint with a single degree of freedom.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointIndexing {
    pub qpos: usize,
    pub dof: usize,
    /// Index in the drive table; `None` without a drive.
    pub drive: Option<usize>,
}

/// Indices of an attached MJCF file in MuJoCo's arrays.
#[derive(Clone, Debug)]
pub(crate) struct MjcfIndexing {
    /// Bodies of the file; the first is the body that holds the content of the file's world.
    pub bodies: Vec<usize>,
    /// Geoms of the file, those of its world included.
    pub geoms: Vec<usize>,
    /// Addresses in `qpos` of all positions of the file.
    pub qpos: Vec<usize>,
    /// Degrees of freedom of the file.
    pub dofs: Vec<usize>,
    /// Actuators of the file.
    pub actuators: Vec<usize>,
    /// Addresses of the file's hinge and slide joints, in file order. `drive` is `None`.
    pub joints: Vec<JointIndexing>,
    /// Indices in `ctrl` of the file's actuators.
    pub controls: Vec<usize>,
    /// Indices in `act` of the file's actuators that have an activation.
    pub activations: Vec<usize>,
    /// Mocap bodies of the file.
    pub mocap_bodies: Vec<usize>,
    /// Frames of bodies and sites, for sensors.
    pub frames: Vec<BodyFrame>,
}

/// Equality constraint of a weld and the two MuJoCo bodies that it connects.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeldIndexing {
    pub(crate) equality: usize,
    pub(crate) bodies: [usize; 2],
}

/// Number of positions and of degrees of freedom of a MuJoCo joint type.
pub(crate) fn joint_widths(kind: i32) -> (usize, usize) {
    match kind as u32 {
        mj::mjJNT_FREE => (7, 6),
        mj::mjJNT_BALL => (4, 3),
        _ => (1, 1),
    }
}
