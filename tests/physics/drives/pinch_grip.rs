//! Two fingers of 10 g pinch a block of mass m. The drives are at their effort limit F, far below the efforts of their
//! gains. At rest each finger presses with F, and friction carries the block: 2 f = m g, as long as m g < 2 μ F. With
//! less friction it slides with g - 2 μ F/m.
//!
//! Gains of 1e4 N/m and 1e3 N s/m in steps of 10 ms are h d/M = 1000: evaluated at the start of the step, they throw
//! the fingers through the block. That is the control.
//!
//! Exact, up to the solver's tolerance: the forces at rest, and for a sliding block the momentum of all three bodies. A
//! block that slides on soft contacts hops and moves the fingers, so that each finger presses with N = F - M u', where
//! u is its velocity toward the block. Friction is μ N at every step (law `sliding_block`): a + μ M (u₁' + u₂')/m = 2 μ
//! F/m - g for any hops, as long as the drives are at their limit. (This holds for the first 0.1 s: in MuJoCo 2.2.2 a
//! block sliding with 0.7 m/s or more pushes such light fingers off.) A sticking block creeps (law `stick_creep`). A
//! friction row, one at each of the four corners of a face, with f = m g/8, holds with v = (1 - d)/d A f dmax tc/(2
//! impratio), where d is the impedance of a depth under F/4. A is MuJoCo's estimate of the inverse inertia, 1/m plus
//! that of a finger: 1/M in 4.x; in 2.2.2 the mean over three axes, of which the finger moves along one, 1/3M.
//!
//! Tolerance of the solver: it stops when a step gains less than 1e-8 of the mean inertia times the number of degrees
//! of freedom (two fingers, six of the block), none of which has more inertia than m. Accelerations that are off by α
//! cost m α²/2, so that forces are off by at most m α = m √(2 · 8 · 1e-8). The error of the sliding acceleration is
//! that over m; the relative error of the creep is that of f.

use crate::lab::*;
use crate::rigid_body::soft_contact::{MAX_IMPEDANCE, TIME_CONSTANT, depth, impedance};
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use kinetoscope::sim::DriveModel;
use kinetoscope_testkit::worlds::cube;

const LIMIT: f64 = 5.0;
const MASS: f64 = 0.2;
const GRIP: f64 = 0.04;
/// Mass of a finger \[kg\].
const FINGER: f64 = 0.01;

/// Measured quantities of a pinch.
#[derive(Clone, Copy, Debug)]
struct Pinch {
    /// Normal forces of both fingers on the block along x, and the friction that lifts it \[N\].
    left: f64,
    right: f64,
    friction: f64,
    /// Final upward velocity \[m/s\], and mean acceleration in the first 0.1 s without external support \[m/s²\].
    velocity: f64,
    acceleration: f64,
    /// Mean force that accelerated both fingers toward the block in that time \[N\].
    hops: f64,
}

/// Supports the block for 1.2 s, in which the fingers come to rest on it, and releases it for 0.3 s.
fn pinch(drive: DriveCfg, limit: f64, friction: f64) -> Pinch {
    let cfg = SimulationManagerCfg { friction: [friction, 0.0, 0.0], ground: None, ..slope(0.0, friction) };
    let mut lab = Lab::new(with_dt(0.01, cfg));
    let finger = |name: &str| Link::brick(name, FINGER, [0.02, 0.06, 1.2]);
    let slide = |name: &str, link: &str, x: f64| {
        let axis = [-x.signum(), 0.0, 0.0];
        Joint::slide(name, ["base", link], axis).at([x, 0.0, 0.0]).limit(-0.1, 0.1, limit)
    };
    // A gap of a millimeter on each side.
    let x = GRIP / 2.0 + 0.01 + 1e-3;
    let joints = [slide("left_joint", "left", -x), slide("right_joint", "right", x)];
    let hand = RobotCfg { uid: "hand".into(), drive, ..RobotCfg::default() };
    let hand = lab.robot(&urdf(&[base(), finger("left"), finger("right")], &joints), hand);
    let block = lab.object(cube("block", GRIP, MASS, [0.0; 3]));
    let filters = vec!["hand/left".into(), "hand/right".into()];
    let touch =
        lab.sim.add_sensor("touch", ContactSensorCfg { filters, ..ContactSensorCfg::for_bodies("block") }).unwrap();
    lab.sim.robot_mut(hand).set_qpos_target(&row(&[0.02, 0.02]), None, None).unwrap();
    lab.set_object_wrench(block, Vector3::new(0.0, 0.0, MASS * G), Vector3::zeros());
    lab.sim.update(120);
    lab.set_object_wrench(block, Vector3::zeros(), Vector3::zeros());
    let (before, fingers) = (lab.body(block).velocity.z, lab.v(hand));
    lab.sim.update(10);
    let acceleration = (lab.body(block).velocity.z - before) / 0.1;
    let hops = lab.v(hand).iter().zip(&fingers).map(|(after, before)| FINGER * (after - before) / 0.1).sum();
    lab.sim.update(20);
    let velocity = lab.body(block).velocity.z;
    let sensor = lab.sim.sensor(touch).unwrap();
    let normal = sensor.force_matrix_w();
    Pinch {
        left: normal[(0, 0, 0, 0)],
        right: -normal[(0, 0, 1, 0)],
        friction: sensor.friction_forces_w()[(0, 0, 2)],
        velocity,
        acceleration,
        hops,
    }
}

#[test]
fn holds() {
    law(module_path!(), "N = F, 2 f = m g; or a = g - 2 μ F/m", |m| {
        let stiff = implicit(1e4, 1e3);
        let held = pinch(stiff.clone(), LIMIT, 1.0);
        let solver = (2.0 * 8.0 * 1e-8_f64).sqrt();
        let rest = (MASS * solver, "tolerance of the solver");
        m.row("force of the left finger", "N", LIMIT, held.left, rest);
        m.row("force of the right finger", "N", LIMIT, held.right, rest);
        m.row("friction of both", "N", MASS * G, held.friction, rest);
        let of_finger = if BUILD_VERSION == SupportedVersion::V4 { 1.0 / FINGER } else { 1.0 / (3.0 * FINGER) };
        let inverse = 1.0 / MASS + of_finger;
        let (d, carried) = (impedance(depth(inverse * LIMIT / 4.0)), MASS * G / 8.0);
        let creep = (1.0 - d) / d * inverse * carried * MAX_IMPEDANCE * TIME_CONSTANT / (2.0 * IMPRATIO);
        let share = (creep * MASS * solver / carried, "tolerance of the solver");
        m.row("velocity of the block", "m/s", -creep, held.velocity, share);
        m.versions_differ_in(
            "velocity of the block",
            "creep goes with MuJoCo's estimate of a finger's inverse inertia: 1/M in 4.x, 1/3M in 2.2.2",
        );
        let explicit = pinch(DriveCfg { model: DriveModel::Actuator, ..stiff.clone() }, LIMIT, 1.0);
        m.control("force of the left finger", "with drives of the start of the step", explicit.left);
        m.control("force of the right finger", "with drives of the start of the step", explicit.right);
        let slips = pinch(stiff.clone(), LIMIT, 0.1);
        m.control("friction of both", "with a tenth of the friction", slips.friction);
        m.control("velocity of the block", "with a tenth of the friction", slips.velocity);
        let quantity = "a + μ M (u₁' + u₂')/m with a tenth of the friction";
        let slide = 2.0 * 0.1 * LIMIT / MASS - G;
        let with_hops = |p: &Pinch| p.acceleration + 0.1 * p.hops / MASS;
        m.row(quantity, "m/s²", slide, with_hops(&slips), (solver, "tolerance of the solver"));
        let loose = pinch(stiff, 0.5 * LIMIT, 0.1);
        m.control(quantity, "with half of the limit", with_hops(&loose));
    });
}
