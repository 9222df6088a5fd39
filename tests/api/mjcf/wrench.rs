//! Force and torque at a site of a file, against closed forms.

use super::empty;
use kinetoscope::ndarray::{Array2, ArrayView3};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use nalgebra::{UnitQuaternion, Vector3};

/// Masses with centres in the frame of the arm: the arm's own, and that of the tool, which is welded to it.
const LOADS: [(f64, [f64; 3]); 2] = [(1.5, [0.2, 0.0, -0.1]), (2.0, [0.35, 0.1, -0.4])];
/// Where the tool, which has its mass in its origin, and in it the palm are.
const TOOL: [f64; 3] = LOADS[1].1;
const PALM: [f64; 3] = [0.05, -0.02, 0.1];

fn crane(turn_of_palm: &UnitQuaternion<f64>) -> String {
    let joined = |v: &[f64]| v.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
    let q = turn_of_palm.quaternion();
    let quat = joined(&[q.w, q.i, q.j, q.k]);
    // Moments that are alike about all axes: turning needs no torque of its own.
    let inertial = |mass: f64, at: &[f64]| {
        format!(r#"<inertial pos="{}" mass="{mass}" diaginertia="0.01 0.01 0.01"/>"#, joined(at))
    };
    format!(
        r#"<mujoco><worldbody><body name="arm" pos="0 0 2"><joint name="turn" axis="0 0 1"/>{}
        <body name="tool" pos="{}">{}<site name="palm" pos="{}" quat="{quat}"/></body></body></worldbody></mujoco>"#,
        inertial(LOADS[0].0, &LOADS[0].1),
        joined(&TOOL),
        inertial(LOADS[1].0, &[0.0; 3]),
        joined(&PALM),
    )
}

/// A crane that stands in one environment and turns freely about the vertical in the other. What its joint exerts carries
/// all that is beyond it and bends its way: `F = sum m (omega x (omega x c) - g)`, and about the palm
/// `T = sum (c - p) x m (omega x (omega x c) - g)`, both turned into the axes of the palm.
#[test]
fn a_site_measures_what_hangs_on_its_joint() {
    let turn = from_xyz_rpy([0.0; 3], [0.4, -0.2, 0.7]).rotation;
    let mut sim = empty(2);
    // The part stands turned about the vertical, which changes nothing in the axes of its bodies.
    let init_pose = from_xyz_rpy([0.3, -0.2, 0.1], [0.0, 0.0, 0.5]);
    let part = sim.add_mjcf(MjcfCfg { init_pose, ..MjcfCfg::text("m", crane(&turn)) }).unwrap();
    let cfg = JointWrenchCfg { links: vec!["m/arm".into()], frames: vec!["m/palm".into()], ..Default::default() };
    let id = sim.add_sensor("wrench", cfg).unwrap();
    let omegas = [0.0, 3.0];
    let speeds = Array2::from_shape_fn((2, 1), |(env, _)| omegas[env]);
    sim.mjcf_part_mut(part).write_qvel(&speeds, None).unwrap();
    let palm = Vector3::from(TOOL) + Vector3::from(PALM);
    let up = Vector3::new(0.0, 0.0, 9.81);
    let wrench_about = |p: Vector3<f64>, omega: f64| {
        LOADS.iter().fold((Vector3::zeros(), Vector3::zeros()), |(force, torque), (mass, com)| {
            let com = Vector3::from(*com);
            let needed = *mass * (up - omega * omega * Vector3::new(com.x, com.y, 0.0));
            (force + needed, torque + (com - p).cross(&needed))
        })
    };
    // Sums of a few numbers of at most 100, with 16 digits, through chains of frames of unit length: 1e-13.
    let near = |found: ArrayView3<'_, f64>, env: usize, b: usize, expected: Vector3<f64>| {
        let found = Vector3::from_fn(|k, _| found[(env, b, k)]);
        assert!((found - expected).norm() < 1e-11, "environment {env}, {b}: {found} is not {expected}");
    };
    for _ in 0..4 {
        let sensor = sim.sensor(id).unwrap();
        assert_eq!(sensor.link_names(), ["m/arm", "m/palm"]);
        for (env, omega) in omegas.into_iter().enumerate() {
            let (force, torque) = wrench_about(Vector3::zeros(), omega);
            near(sensor.forces(), env, 0, force);
            near(sensor.torques(), env, 0, torque);
            let (force, torque) = wrench_about(palm, omega);
            near(sensor.forces(), env, 1, turn.inverse() * force);
            near(sensor.torques(), env, 1, turn.inverse() * torque);
        }
        sim.update(30);
    }
    // The controls: the palm is elsewhere and turned, and turning is felt.
    let (still, turning) = (wrench_about(palm, 0.0), wrench_about(palm, 3.0));
    assert!((still.1 - wrench_about(Vector3::zeros(), 0.0).1).norm() > 1.0 && (turning.0 - still.0).norm() > 1.0);
    assert!((turn.inverse() * still.0 - still.0).norm() > 1.0);
}
