//! Poses of MuJoCo bodies and of frames attached to them.

use kinetoscope_mujoco as mj;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::from_row;

/// A frame attached to a MuJoCo body, such as the frame of a link.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BodyFrame {
    pub(crate) body: usize,
    pub(crate) body_from_frame: Pose,
}

impl BodyFrame {
    /// Frame of the body itself.
    pub(crate) fn of_body(body: usize) -> Self {
        Self { body, body_from_frame: Pose::identity() }
    }

    /// Pose of the frame in the environment.
    pub(crate) fn pose(&self, data: &impl BodyArrays) -> Pose {
        body_pose(data, self.body) * self.body_from_frame
    }
}

/// MuJoCo's arrays of the motion of bodies, in an `mjData` or copied from one.
pub(crate) trait BodyArrays {
    fn xpos(&self) -> &[f64];
    fn xquat(&self) -> &[f64];
    fn xipos(&self) -> &[f64];
    fn cvel(&self) -> &[f64];
    fn subtree_com(&self) -> &[f64];
    fn body_rootid(&self) -> &[i32];
}

impl BodyArrays for mj::Data {
    fn xpos(&self) -> &[f64] {
        self.xpos()
    }

    fn xquat(&self) -> &[f64] {
        self.xquat()
    }

    fn xipos(&self) -> &[f64] {
        self.xipos()
    }

    fn cvel(&self) -> &[f64] {
        self.cvel()
    }

    fn subtree_com(&self) -> &[f64] {
        self.subtree_com()
    }

    fn body_rootid(&self) -> &[i32] {
        self.model().body_rootid()
    }
}

/// Pose of a MuJoCo body in the environment.
pub(crate) fn body_pose(data: &impl BodyArrays, body: usize) -> Pose {
    let (p, q) = (&data.xpos()[3 * body..3 * body + 3], &data.xquat()[4 * body..4 * body + 4]);
    from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]])
}
