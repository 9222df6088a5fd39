//! Exports: plain MuJoCo, without our drives, is stable on them as far as the comment in the file says.
//!
//! From the keyframe `start` with the targets there, and with targets 0.5 rad away (so that drives saturate). Stable: no
//! MuJoCo warning and, where the targets are those of the start, at rest after 1 s (1 mrad/s); where the named step is too
//! small to wait for that, no joint is faster than the law makes it (5 rad/s for 0.5 rad at kp / kd = 10 / s, times 2).
//! Control: steps far above the one that is named diverge.

use crate::drives::worlds::*;
use kinetoscope::prelude::*;
use kinetoscope::sim::mj;
use std::path::Path;

struct Export {
    _folder: tempfile::TempDir,
    path: std::path::PathBuf,
    xml: String,
    start: Vec<f64>,
    targets: Vec<f64>,
}

fn export(cfg: RobotCfg) -> Export {
    let world = load(cfg, SimulationManagerCfg { threads: Some(1), ..Default::default() });
    let folder = tempfile::tempdir().unwrap();
    world.sim.dump(folder.path()).unwrap();
    let version = if mj::TARGET == mj::Target::V2 { 2 } else { 4 };
    let path = folder.path().join(format!("robot.mjcf{version}.xml"));
    let xml = std::fs::read_to_string(&path).unwrap();
    let numbers = |text: &str| text.split_whitespace().map(|n| n.parse().unwrap()).collect::<Vec<f64>>();
    let start = numbers(between(&xml, "<key name=\"start\" qpos=\"", "\""));
    let ctrl = numbers(between(&xml, "\" ctrl=\"", "\""));
    let targets = world.sim.batch().read(0, |env| env.drives.position.to_vec());
    assert_eq!(ctrl, targets, "the keyframe commands the start");
    Export { _folder: folder, path, xml, start, targets }
}

fn between<'t>(text: &'t str, from: &str, to: &str) -> &'t str {
    let rest = text.split(from).nth(1).unwrap_or_else(|| panic!("no {from:?}"));
    rest.split(to).next().unwrap()
}

impl Export {
    /// Largest speed at the end, or `None` where MuJoCo warned.
    fn run(&self, h: f64, steps: usize, offset: f64) -> Option<f64> {
        let old = between(&self.xml, "timestep=\"", "\"");
        let xml = self.xml.replacen(&format!("timestep=\"{old}\""), &format!("timestep=\"{h:e}\""), 1);
        let path: &Path = &self.path.with_extension(format!("{h:e}.xml"));
        std::fs::write(path, xml).unwrap();
        let model = mj::compile_file(path).unwrap_or_else(|e| panic!("{e}")).into_model();
        let mut data = mj::Data::new(&model).unwrap();
        data.qpos_mut().copy_from_slice(&self.start);
        for (ctrl, target) in data.ctrl_mut().iter_mut().zip(&self.targets) {
            *ctrl = target + offset;
        }
        for _ in 0..steps {
            data.step().unwrap();
            if data.take_warnings().diverged().is_some() {
                return None;
            }
        }
        Some(data.qvel().iter().fold(0.0_f64, |m, v| m.max(v.abs())))
    }
}

fn tutorial() -> RobotCfg {
    let asset = |name| assets::path(name).unwrap();
    let components = vec![
        ComponentCfg::new("arm", asset("sr5/SR5.urdf")),
        ComponentCfg::new("hand", asset("revo1_left/revo1_left.urdf")),
    ];
    RobotCfg {
        urdf: UrdfCfg { components, ..Default::default() },
        drive: DriveCfg {
            stiffness: [("JOINT.*", 1e4), ("LEFT_.*", 1e3)].into(),
            damping: [("JOINT.*", 1e3), ("LEFT_.*", 1e2)].into(),
            ..Default::default()
        },
        init_qpos: vec![("JOINT2".into(), 0.4), ("LEFT_HAND_INDEX".into(), 0.3)],
        ..Default::default()
    }
}

/// The step that the comment names, if it names one.
fn named_step(export: &Export) -> Option<f64> {
    let line = export.xml.lines().find(|l| l.contains("<!-- MuJoCo")).unwrap();
    println!("{line}");
    let after = line.split("stable up to a time step of ").nth(1)?;
    Some(after.split(' ').next().unwrap().parse().unwrap())
}

#[test]
fn with_followers_an_export_is_stable_up_to_the_step_that_it_names() {
    let export = export(tutorial());
    let bound = named_step(&export).unwrap();
    let (hold, reach) = (export.run(0.98 * bound, 4000, 0.0), export.run(0.98 * bound, 4000, 0.5));
    println!("hold {hold:?}, step {reach:?}; far above {:?}", export.run(1e4 * bound, 400, 0.5));
    // Without a limit in the way a drive closes in at kp e / kd: 10 / s x 0.5 rad, a follower 1.05 times as fast.
    assert!(hold.unwrap() < 0.1 && reach.unwrap() < 10.0, "{hold:?} {reach:?}");
    assert!(export.run(1e4 * bound, 400, 0.5).is_none(), "the control: a step far above it diverges");
}

#[test]
fn without_followers_an_export_is_stable_as_it_says() {
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("robot.urdf");
    std::fs::write(&path, urdf(&arm_and_hand())).unwrap();
    let chain = RobotCfg { urdf: UrdfCfg::single(&path), drive: tutorial_gains(), ..Default::default() };
    let export = export(RobotCfg { init_qpos: vec![("a2".into(), 0.4)], ..chain });
    let bound = named_step(&export);
    let bound = bound.expect("drives have limits: both lines name a step");
    match mj::TARGET {
        // Velocity-implicit: up to the named step, whether drives saturate or not.
        mj::Target::V2 => {
            assert!(bound > 0.05, "{bound}");
            for h in [1e-3, 0.01, 0.05] {
                assert!(export.run(h, 1000, 0.0).unwrap() < 1e-3, "{h}");
                assert!(export.run(h, 3000, 0.5).unwrap() < 1e-3, "{h}");
            }
        }
        mj::Target::V4 => {
            for h in [1e-3, 0.01, 0.05] {
                assert!(export.run(h, 1000, 0.0).unwrap() < 1e-3, "{h}");
            }
            let reach = export.run(0.98 * bound, 4000, 0.5).unwrap();
            println!("step {reach:.2e}");
            assert!(reach < 10.0, "{reach}");
            assert!(export.run(0.01, 400, 0.5).is_none(), "the control: saturated drives diverge at 0.01 s");
        }
    }
}

/// Implicit integrators take the damping of an actuator to the end of the step, its stiffness not: with little damping
/// the bound is `h = (kd + sqrt(kd² + 4 M kp)) / kp`, and no drive needs to saturate for it.
#[test]
fn stiff_drives_with_little_damping_are_stable_up_to_the_step_that_is_named() {
    let files = tempfile::tempdir().unwrap();
    let path = files.path().join("robot.urdf");
    let link = r#"<robot name="r"><link name="base"/><link name="tip"><inertial><mass value="0.01"/>
        <inertia ixx="1e-5" ixy="0" ixz="0" iyy="1e-5" iyz="0" izz="1e-5"/></inertial></link>
        <joint name="j" type="continuous"><parent link="base"/><child link="tip"/><axis xyz="0 0 1"/></joint></robot>"#;
    std::fs::write(&path, link).unwrap();
    let (m, kp, kd) = (1e-5, 1e4, 0.1_f64);
    let drive = DriveCfg { stiffness: kp.into(), damping: kd.into(), ..Default::default() };
    let export = export(RobotCfg { urdf: UrdfCfg::single(&path), drive, ..Default::default() });
    let (bound, expected) = (named_step(&export).unwrap(), (kd + (kd * kd + 4.0 * m * kp).sqrt()) / kp);
    assert!((bound / expected - 1.0).abs() < 1e-3, "{bound} {expected}");
    // From 1 mrad beside the target. Below the bound the slowest mode decays by the root of det = M / (M + h kd), 4 % a
    // step; above it, it grows.
    let below = export.run(0.9 * bound, 4000, 1e-3).unwrap();
    assert!(below < 1e-3, "{below}");
    let above = export.run(1.1 * bound, 4000, 1e-3);
    assert!(above.is_none_or(|speed| speed > 1e3), "the control: 10 % above it, it diverges: {above:?}");
}
