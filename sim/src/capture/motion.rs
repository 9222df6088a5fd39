//! Motion of links from MuJoCo's spatial vectors, whose reference point is the center of mass of the kinematic tree.
//!
//! With c the reference point, r the origin of the link, w and v the angular and linear parts of `cvel`, alpha and a
//! those of `cacc`: the velocity of the origin is `v_r = v + w x (r - c)`. The spatial acceleration at the origin is
//! `a + alpha x (r - c)`. The acceleration of the body point at the origin is the spatial acceleration plus `w x v_r`
//! (Featherstone, Rigid Body Dynamics Algorithms, 2.11). MuJoCo accelerates the world by minus gravity, so gravity is
//! added: the result is 0 at rest and gravity in free fall.

use super::{BodyAxis, CapturedStep};
use crate::body_pose::{BodyArrays, BodyFrame};
use kinetoscope_mujoco::Data;
use kinetoscope_scene::pose::to_row;
use nalgebra::Vector3;

/// MuJoCo's arrays of the motion and the solved forces of bodies.
pub(crate) trait SolvedBodies: BodyArrays {
    fn cacc(&self) -> &[f64];
    fn cfrc_int(&self) -> &[f64];
}

impl SolvedBodies for Data {
    fn cacc(&self) -> &[f64] {
        self.cacc()
    }

    fn cfrc_int(&self) -> &[f64] {
        self.cfrc_int()
    }
}

fn vector_at(values: &[f64], first: usize) -> Vector3<f64> {
    Vector3::new(values[first], values[first + 1], values[first + 2])
}

/// Reference point of the spatial vectors of a body, in the environment \[m\].
fn reference_point(data: &impl BodyArrays, body: usize) -> Vector3<f64> {
    vector_at(data.subtree_com(), 3 * data.body_rootid()[body] as usize)
}

/// Velocity of the point of `body` at `point` (in the environment \[m\]) and angular velocity of the body, in world
/// axes.
pub(crate) fn body_velocity(data: &impl BodyArrays, body: usize, point: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let angular = vector_at(data.cvel(), 6 * body);
    [vector_at(data.cvel(), 6 * body + 3) + angular.cross(&(point - reference_point(data, body))), angular]
}

/// Replaces the poses, velocities and accelerations in `solved` by those of all `bodies`. `gravity` is that of the
/// environment, in world axes \[m/s²\].
pub(super) fn capture(bodies: &[BodyFrame], data: &impl SolvedBodies, gravity: [f64; 3], solved: &mut CapturedStep) {
    let CapturedStep { poses, velocities, accelerations, .. } = solved;
    for values in [&mut *poses, &mut *velocities, &mut *accelerations] {
        values.clear();
    }
    let gravity = Vector3::from(gravity);
    for link in bodies {
        let (body, pose) = (link.body, link.pose(data));
        let point = pose.translation.vector;
        let [velocity, angular] = body_velocity(data, body, &point);
        let alpha = vector_at(data.cacc(), 6 * body);
        let spatial = vector_at(data.cacc(), 6 * body + 3) + alpha.cross(&(point - reference_point(data, body)));
        let acceleration = spatial + angular.cross(&velocity) + gravity;
        poses.extend(to_row(&pose));
        velocities.extend(velocity.iter().chain(&angular));
        accelerations.extend(acceleration.iter().chain(&alpha));
    }
}

/// Replaces `wrenches` by the wrench that each body of the body axis receives from its parent through the joint: force
/// \[N\], then torque \[N m\] about the origin of the body, in body axes, 6 numbers each. NaN for a body fused to
/// another.
pub(super) fn capture_wrenches(plan: &BodyAxis, data: &impl SolvedBodies, wrenches: &mut Vec<f64>) {
    wrenches.clear();
    for (link, &carries) in plan.bodies.iter().zip(&plan.is_moving_body) {
        if !carries {
            wrenches.extend([f64::NAN; 6]);
            continue;
        }
        let (body, pose) = (link.body, link.pose(data));
        let force = vector_at(data.cfrc_int(), 6 * body + 3);
        let arm = reference_point(data, body) - pose.translation.vector;
        let torque = vector_at(data.cfrc_int(), 6 * body) + arm.cross(&force);
        for part in [force, torque] {
            wrenches.extend(&pose.rotation.inverse_transform_vector(&part));
        }
    }
}
