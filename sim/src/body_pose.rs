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
    pub(crate) fn pose(&self, data: &mj::Data) -> Pose {
        body_pose(data, self.body) * self.body_from_frame
    }
}

/// Pose of a MuJoCo body in the environment.
pub(crate) fn body_pose(data: &mj::Data, body: usize) -> Pose {
    let (p, q) = (&data.xpos()[3 * body..3 * body + 3], &data.xquat()[4 * body..4 * body + 4]);
    from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]])
}
