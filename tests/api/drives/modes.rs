//! What gains mean (`DriveType`), and joints without a drive.
//!
//! `Acceleration`: gains are multiplied by I = 1 / (M⁻¹)_ii at the start, so v' = (v + h k (q* - q)) / (1 + h d + h² k)
//! for a single joint whatever its inertia. `None`: v' = v - h g / M. Tolerance 1e-9 as in `law.rs`. Control: with
//! `Force` the two inertias part by more than 10 %.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;

const EXACT: f64 = 1e-9;
const H: f64 = 0.01;

fn run(drive_type: DriveType, model: DriveModel, moment: f64) -> Vec<f64> {
    let drive = DriveCfg { drive_type, model, ..gains(90.0, 15.0) };
    let mut world = world(&[Joint::wheel("j", moment)], drive, weightless());
    world.aim(&[0.4]);
    (0..100)
        .map(|_| {
            world.step(1);
            world.q()[0]
        })
        .collect()
}

#[test]
fn acceleration_gains_move_light_and_heavy_joints_alike() {
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let (light, heavy) = (run(DriveType::Acceleration, model, 0.05), run(DriveType::Acceleration, model, 5.0));
        let (k, d) = (90.0, 15.0);
        let (mut q, mut v) = (0.0, 0.0);
        for (light, heavy) in light.iter().zip(&heavy) {
            v = match model {
                DriveModel::Implicit => (v + H * k * (0.4 - q)) / (1.0 + H * d + H * H * k),
                DriveModel::Actuator => v + H * (k * (0.4 - q) - d * v),
            };
            q += H * v;
            assert_close(*light, q, EXACT, "light");
            assert_close(*heavy, q, EXACT, "heavy");
        }
    }
    let (light, heavy) =
        (run(DriveType::Force, DriveModel::Implicit, 0.05), run(DriveType::Force, DriveModel::Implicit, 5.0));
    assert!((light[9] - heavy[9]).abs() > 0.1 * light[9], "the control: {} {}", light[9], heavy[9]);
}

/// On a chain the inertia is what the joint feels with the others free, rotor inertias included.
#[test]
fn acceleration_gains_use_the_inertia_that_the_joint_feels() {
    let a = Joint::lever("a", 3.0, 0.2, 0.02);
    let b = Joint::lever("b", 1.0, 0.1, 5e-3).after(&a, [0.4, 0.0, 0.0]);
    let drive = DriveCfg { drive_type: DriveType::Acceleration, armature: 0.01.into(), ..gains(90.0, 15.0) };
    let world = world(&[a, b], drive, weightless());
    let (mut mass, _) = world.dynamics(&[0.0; 2], &[0.0; 2], &EARTH);
    mass.fill_diagonal(0.0);
    let (own, _) = world.dynamics(&[0.0; 2], &[0.0; 2], &EARTH);
    for i in 0..2 {
        mass[(i, i)] = own[(i, i)] + 0.01;
    }
    let inverse = mass.try_inverse().unwrap();
    let env = world.env();
    for i in 0..2 {
        assert_close(env.drives.gains[i].kp, 90.0 / inverse[(i, i)], EXACT, "stiffness");
        assert_close(env.drives.gains[i].kd, 15.0 / inverse[(i, i)], EXACT, "damping");
    }
}

#[test]
fn a_joint_without_a_drive_is_free() {
    let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let joint = Joint::lever("j", 0.5, 0.2, 0.01).effort(3.0);
    let moment = 0.01 + 0.5 * 0.2 * 0.2;
    let mut world = world(&[joint], drive, earth());
    // Targets go nowhere; they are read back as the present position.
    world.aim(&[1.0]);
    let (mut q, mut v) = (0.0_f64, 0.0);
    for _ in 0..100 {
        world.step(1);
        v += H * 0.5 * 9.81 * 0.2 * q.cos() / moment;
        q += H * v;
        assert_close(world.q()[0], q, EXACT, "position of a pendulum");
        assert_close(world.v()[0], v, EXACT, "velocity of a pendulum");
    }
    assert_eq!(world.target(), world.q());
    assert_eq!(world.effort(), [0.0]);
    world.assert_well();
}

/// Rotor inertia adds to the joint's own: v' as in `law.rs` with M + armature.
#[test]
fn armature_is_inertia() {
    let drive = DriveCfg { armature: [("j", 0.3)].into(), ..gains(200.0, 10.0) };
    let mut world = world(&[Joint::wheel("j", 0.1)], drive, weightless());
    world.aim(&[0.5]);
    world.step(1);
    assert_close(world.v()[0], H * 200.0 * 0.5 / (0.4 + H * 10.0 + H * H * 200.0), EXACT, "velocity");
}
