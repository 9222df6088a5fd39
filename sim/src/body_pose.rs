//! Poses of MuJoCo's bodies.

use kinetoscope_mujoco as mj;
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::from_row;

/// Pose of a MuJoCo body in the environment.
pub(crate) fn body_pose(data: &mj::Data, body: usize) -> Pose {
    let (p, q) = (&data.xpos()[3 * body..3 * body + 3], &data.xquat()[4 * body..4 * body + 4]);
    from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]])
}
