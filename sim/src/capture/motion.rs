//! Motion of links from MuJoCo's spatial vectors, whose reference point is the center of mass of the kinematic tree.
//!
//! With c the reference point, r the origin of the link, w and v the angular and linear parts of `cvel`, alpha and a
//! those of `cacc`: the velocity of the origin is `v_r = v + w x (r - c)`. The spatial acceleration at the origin is
//! `a + alpha x (r - c)`. The acceleration of the body point at the origin is the spatial acceleration plus `w x v_r`
//! (Featherstone, Rigid Body Dynamics Algorithms, 2.11). MuJoCo accelerates the world by minus gravity, so gravity is
//! added: the result is 0 at rest and gravity in free fall.

use super::{Plan, Solved};
use crate::body_pose::BodyFrame;
use kinetoscope_mujoco::Data;
use kinetoscope_scene::pose::to_row;
use nalgebra::Vector3;

fn vector(values: &[f64], first: usize) -> Vector3<f64> {
    Vector3::new(values[first], values[first + 1], values[first + 2])
}

/// Reference point of the spatial vectors of a body.
fn reference(data: &Data, body: usize) -> Vector3<f64> {
    vector(data.subtree_com(), 3 * data.model().body_rootid()[body] as usize)
}

/// Velocity of the point of `body` at `point` and angular velocity of the body, in world axes.
pub(crate) fn body_velocity(data: &Data, body: usize, point: &Vector3<f64>) -> [Vector3<f64>; 2] {
    let angular = vector(data.cvel(), 6 * body);
    [vector(data.cvel(), 6 * body + 3) + angular.cross(&(point - reference(data, body))), angular]
}

/// Writes poses, velocities and accelerations of all bodies to `solved`.
pub(super) fn capture(bodies: &[BodyFrame], data: &Data, solved: &mut Solved) {
    let Solved { poses, velocities, accelerations, .. } = solved;
    for values in [&mut *poses, &mut *velocities, &mut *accelerations] {
        values.clear();
    }
    let gravity = Vector3::from(data.model().gravity());
    for link in bodies {
        let (body, pose) = (link.body, link.pose(data));
        let point = pose.translation.vector;
        let [velocity, turning] = body_velocity(data, body, &point);
        let alpha = vector(data.cacc(), 6 * body);
        let spatial = vector(data.cacc(), 6 * body + 3) + alpha.cross(&(point - reference(data, body)));
        let acceleration = spatial + turning.cross(&velocity) + gravity;
        poses.extend(to_row(&pose));
        velocities.extend(velocity.iter().chain(&turning));
        accelerations.extend(acceleration.iter().chain(&alpha));
    }
}

/// Writes the wrench that each link receives from its parent through the joint: force and torque about the origin of
/// the link, in link axes. NaN for a link fused to another.
pub(super) fn capture_wrenches(plan: &Plan, data: &Data, wrenches: &mut Vec<f64>) {
    wrenches.clear();
    for (link, &carries) in plan.bodies.iter().zip(&plan.carries) {
        if !carries {
            wrenches.extend([f64::NAN; 6]);
            continue;
        }
        let (body, pose) = (link.body, link.pose(data));
        let force = vector(data.cfrc_int(), 6 * body + 3);
        let arm = reference(data, body) - pose.translation.vector;
        let torque = vector(data.cfrc_int(), 6 * body) + arm.cross(&force);
        for part in [force, torque] {
            wrenches.extend(&pose.rotation.inverse_transform_vector(&part));
        }
    }
}
