//! Ranges and effort limits of the file.
//!
//! An effort of 0 or none at all is no limit: one step of the law with a demand of 1e8 N m is still the closed form
//! (1e-9). Targets clamp to the usable range: the joint's own, narrowed by those of its followers; what is clamped is
//! read back, exactly.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;
use kinetoscope::sim::DiagnosticKind;

const H: f64 = 0.01;

#[test]
fn effort_zero_or_absent_is_no_limit() {
    for joint in [Joint::wheel("j", 0.1), Joint::wheel("j", 0.1).effort(0.0)] {
        let mut world = world(&[joint], gains(1e8, 0.0), weightless());
        assert_eq!(world.limits(), [f64::INFINITY]);
        let warned = world.sim.diagnostics().iter().any(|d| d.kind == DiagnosticKind::EffortUnlimited);
        assert!(warned, "{:?}", world.sim.diagnostics());
        world.aim(&[1.0]);
        world.step(1);
        let v = H * 1e8 / (0.1 + H * H * 1e8);
        assert_close(world.v()[0], v, 1e-9, "velocity");
        assert_close(world.effort()[0], 0.1 * v / H, 1e-6, "effort");
    }
}

/// A limit of the configuration goes before the file's; infinity lifts it.
#[test]
fn the_configuration_overrides_the_files_limit() {
    for (limit, expected) in [(0.5, 0.5), (f64::INFINITY, f64::INFINITY)] {
        let drive = DriveCfg { max_effort: Some([("j", limit)].into()), ..gains(1e3, 1e2) };
        let mut world = world(&[Joint::wheel("j", 0.1).effort(3.0)], drive, weightless());
        assert_eq!(world.limits(), [expected]);
        world.aim(&[2.0]);
        world.step(1);
        assert_eq!(world.effort()[0] == 0.5, limit == 0.5, "{:?}", world.effort());
    }
}

#[test]
fn targets_clamp_to_the_range() {
    let mut world = world(&[Joint::wheel("j", 0.1).range(-0.4, 0.7).effort(50.0)], gains(1e3, 1e2), weightless());
    for (aim, expected) in [(2.0, 0.7), (-9.0, -0.4), (0.3, 0.3)] {
        world.aim(&[aim]);
        assert_eq!(world.target(), [expected]);
        world.step(200);
        assert_close(world.q()[0], expected, 1e-6, "position");
    }
}

/// The follower turns 1.5 times as far and may go to 0.6: the driver may go to 0.4, though its own range ends at 2.
#[test]
fn targets_clamp_to_the_range_that_followers_leave() {
    let driver = Joint::wheel("d", 0.1).range(-0.2, 2.0).effort(50.0);
    let follower = Joint::wheel("f", 0.01).range(-1.0, 0.6).effort(0.0);
    let follower = Joint { mimic: Some(("d".into(), 1.5)), ..follower };
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let drive = DriveCfg { model, ..gains(100.0, 10.0) };
        let mut world = world(&[driver.clone(), follower.clone()], drive, weightless());
        let clipped = world.sim.diagnostics().iter().filter(|d| d.kind == DiagnosticKind::MimicRangeClipped);
        assert_eq!(clipped.count(), 1);
        let limits = world.view().qpos_limits();
        assert_close(limits[(0, 0, 0)], -0.2, 1e-15, "lower end of the driver");
        assert_close(limits[(0, 0, 1)], 0.4, 1e-15, "upper end of the driver");
        world.aim(&[2.0, 123.0]);
        assert_close(world.target()[0], 0.4, 1e-15, "target of the driver");
        assert_close(world.target()[1], 0.6, 1e-15, "what it means for the follower");
        world.step(300);
        world.assert_well();
        assert_close(world.q()[0], 0.4, 1e-5, "driver");
        assert_close(world.q()[1], 0.6, 1e-5, "follower");
    }
}
