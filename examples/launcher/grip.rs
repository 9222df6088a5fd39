//! The bundled hand as a gripper: fingers pointing down, closing on an object between their tips and the thumb.

use super::Result;
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Tilt of the hand \[rad\], fingers down. With this tilt the tips of thumb and fingers, closed on a 6 cm object, are
/// level, 0.103 m below the frame of the palm.
const TILT: f64 = 20f64.to_radians();

/// Name of the palm's link.
pub(crate) const PALM: &str = "left_hand_base";

/// The grip frame in the frame of the palm: x is level, in the direction of the straight fingers; y points to the
/// fingers' side away from the thumb; z is up. `place` is the origin of the grip frame relative to the palm, in the
/// axes of the grip frame \[m\].
pub(crate) fn palm_from_grip(place: [f64; 3]) -> Pose {
    // In the palm's frame the fingers point along y and the palm faces z.
    let (sin, cos) = TILT.sin_cos();
    let (ahead, side, up) = (Vector3::new(0.0, cos, -sin), Vector3::x(), Vector3::new(0.0, -sin, -cos));
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[ahead, side, up]));
    let rotation = UnitQuaternion::from_rotation_matrix(&axes);
    Pose::from_parts((rotation * Vector3::from(place)).into(), rotation)
}

/// The bundled arm and hand in a start posture with the hand level in front of the arm and the thumb opposite the
/// fingers. `hand` lists further start positions \[rad\]; `finger_effort` is the effort limit of the joint at the root
/// of each finger \[N m\].
pub(crate) fn robot_cfg(hand: &[(&str, f64)], finger_effort: f64) -> Result<RobotCfg> {
    let cfg = assets::sr5_with_hand()?;
    // This posture keeps away from the singularity where the axes of JOINT4 and JOINT6 align.
    let elbow = [("JOINT2", 0.3), ("JOINT3", -2.2), ("JOINT5", 0.6), ("JOINT6", FRAC_PI_2)];
    let thumb = [("LEFT_HAND_THUMB2", -FRAC_PI_2)];
    let init_qpos = elbow.iter().chain(&thumb).chain(hand).map(|&(joint, q)| (joint.to_string(), q)).collect();
    let max_effort = Some([("LEFT_HAND_(INDEX|MIDDLE|RING|PINKY)", finger_effort)].into());
    Ok(RobotCfg { init_qpos, drive: DriveCfg { max_effort, ..cfg.drive }, ..cfg })
}

/// Returns uniform random numbers in -1..1 for each environment, keyed by its global index: the numbers do not depend
/// on the number of environments or processes.
pub(crate) fn uniform_per_env<const K: usize>(sim: &SimulationManager, stream_name: &str) -> Vec<[f64; K]> {
    let (seed, first) = (sim.cfg().seed, sim.cfg().first_env());
    let of = |env: usize| {
        let mut random = KeyedRng::keyed(seed, (first + env) as u64, stream_name);
        std::array::from_fn(|_| 2.0 * random.uniform() - 1.0)
    };
    (0..sim.num_envs()).map(of).collect()
}
