//! The bundled hand as a gripper: fingers down, closing on what is between their tips and the thumb's.

use super::Result;
use kinetoscope::prelude::*;
use kinetoscope::scene::Random;
use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// The hand is tilted by this \[rad\], fingers down: then the thumb's tip and the fingers' tips, closed on a thing of 6 cm,
/// are at the same height, 0.103 m below the palm's frame.
const TILT: f64 = 20f64.to_radians();

/// The palm's frame.
pub(crate) const PALM: &str = "left_hand_base";

/// The frame of a grip in the frame of the palm: x ahead to where straight fingers point, but level; y to the side of the
/// fingers without thumb; z up. `place` is its origin, from the palm's, in those axes \[m\].
pub(crate) fn palm_from_grip(place: [f64; 3]) -> Pose {
    // In the palm's frame fingers are along y, and the palm looks along z.
    let (sin, cos) = TILT.sin_cos();
    let (ahead, side, up) = (Vector3::new(0.0, cos, -sin), Vector3::x(), Vector3::new(0.0, -sin, -cos));
    let axes = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&[ahead, side, up]));
    let rotation = UnitQuaternion::from_rotation_matrix(&axes);
    Pose::from_parts((rotation * Vector3::from(place)).into(), rotation)
}

/// The bundled arm and hand, bent so that the hand can be level in front of it, the thumb opposite the fingers; `hand` are
/// more start positions, `finger_effort` is the largest of each joint at the root of a finger \[N m\].
pub(crate) fn robot_cfg(hand: &[(&str, f64)], finger_effort: f64) -> Result<RobotCfg> {
    let cfg = assets::sr5_with_hand()?;
    // Away from where the axes of JOINT4 and JOINT6 are the same.
    let elbow = [("JOINT2", 0.3), ("JOINT3", -2.2), ("JOINT5", 0.6), ("JOINT6", FRAC_PI_2)];
    let thumb = [("LEFT_HAND_THUMB2", -FRAC_PI_2)];
    let init_qpos = elbow.iter().chain(&thumb).chain(hand).map(|&(joint, q)| (joint.to_string(), q)).collect();
    let max_effort = Some([("LEFT_HAND_(INDEX|MIDDLE|RING|PINKY)", finger_effort)].into());
    Ok(RobotCfg { init_qpos, drive: DriveCfg { max_effort, ..cfg.drive }, ..cfg })
}

/// For each environment numbers in -1..1, the same for any number of environments and processes.
pub(crate) fn scatter<const K: usize>(sim: &SimulationManager, what: &str) -> Vec<[f64; K]> {
    let (seed, first) = (sim.cfg().seed, sim.cfg().first_env());
    let of = |env: usize| {
        let mut random = Random::keyed(seed, (first + env) as u64, what);
        std::array::from_fn(|_| 2.0 * random.uniform() - 1.0)
    };
    (0..sim.num_envs()).map(of).collect()
}
