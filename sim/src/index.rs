//! Places of entities in MuJoCo's arrays.

use crate::body_pose::BodyFrame;
use kinetoscope_mujoco as mj;

/// Places of one robot in MuJoCo's arrays.
#[derive(Clone, Debug)]
pub(crate) struct RobotIndex {
    /// Position and velocity address of each drivable joint.
    pub joints: Vec<JointIndexing>,
    /// Frame of each link.
    pub links: Vec<BodyFrame>,
    /// The body of its root link.
    pub root: FreeIndex,
    /// Its geoms.
    pub geoms: Vec<GeomIndex>,
}

/// A geom of a robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GeomIndex {
    /// Its index in MuJoCo's arrays.
    pub geom: usize,
    /// The link it belongs to.
    pub link: usize,
    /// The link's visual that it stands for; `None` for a collision shape.
    pub visual: Option<usize>,
}

/// Places of a body that may be free in MuJoCo's arrays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct FreeIndex {
    pub body: usize,
    /// First of its seven positions and first of its six velocities; `None` where it is fixed.
    pub joint: Option<(usize, usize)>,
    /// Its number among the bodies that are moved by hand.
    pub mocap: Option<usize>,
}

impl FreeIndex {
    /// True if it neither moves nor is kinematic.
    pub(crate) fn stands(&self) -> bool {
        self.joint.is_none() && self.mocap.is_none()
    }
}

/// Places of one joint.
#[derive(Clone, Copy, Debug)]
pub(crate) struct JointIndexing {
    pub qpos: usize,
    pub dof: usize,
    /// Index in the drive table.
    pub drive: Option<usize>,
}

/// Places of an MJCF part in MuJoCo's arrays.
#[derive(Clone, Debug)]
pub(crate) struct PartIndex {
    /// Each of the file's bodies; the first is the one that what stands in the file's world belongs to.
    pub bodies: Vec<usize>,
    /// Each of the file's geoms.
    pub geoms: Vec<usize>,
    /// Each position of the file.
    pub qpos: Vec<usize>,
    /// Each degree of freedom of the file.
    pub dofs: Vec<usize>,
    /// Each actuator of the file.
    pub actuators: Vec<usize>,
    /// Each joint of the file with one degree of freedom.
    pub joints: Vec<JointIndexing>,
    /// The control of each actuator of the file.
    pub controls: Vec<usize>,
    /// Each activation of the file's actuators.
    pub activations: Vec<usize>,
    /// Bodies of the file that are moved by hand.
    pub mocaps: Vec<usize>,
    /// Bodies and sites as sensors see them.
    pub frames: Vec<BodyFrame>,
}

/// Which equality a weld is, and MuJoCo's bodies that it holds together.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WeldIndex {
    pub(crate) equality: usize,
    pub(crate) bodies: [usize; 2],
}

/// How many positions and degrees of freedom a joint of a type has.
pub(crate) fn joint_widths(kind: i32) -> (usize, usize) {
    match kind as u32 {
        mj::mjJNT_FREE => (7, 6),
        mj::mjJNT_BALL => (4, 3),
        _ => (1, 1),
    }
}
