//! Exported models: plain MuJoCo, without our drives, is stable up to the time step named in the comment of the file.
//!
//! Each run starts from the keyframe `start`, with its targets and with targets 0.5 rad away (so that drives saturate).
//! Stable means: no MuJoCo warning and, with the targets of the start, at rest after 1 s (1 mrad/s). If the named step
//! is too small to wait for that, no joint may be faster than the law allows (5 rad/s for 0.5 rad at kp / kd = 10 / s,
//! times 2). Control: steps far above the named one diverge.

use crate::drives::worlds::*;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds;

struct Export {
    files: TempFiles,
    xml: String,
    start: Vec<f64>,
    targets: Vec<f64>,
    /// The largest step named in the comment, if any.
    bound: Option<f64>,
}

fn between<'t>(text: &'t str, from: &str, to: &str) -> &'t str {
    let rest = text.split(from).nth(1).unwrap_or_else(|| panic!("no {from:?}"));
    rest.split(to).next().unwrap()
}

fn export(cfg: RobotCfg) -> Export {
    let (world, files) = (load(cfg, worlds::cfg(1, 1)), TempFiles::default());
    world.sim.dump(files.folder()).unwrap();
    let version = if mj::BUILD_VERSION == mj::SupportedVersion::V2 { 2 } else { 4 };
    let xml = std::fs::read_to_string(files.folder().join(format!("robot.mjcf{version}.xml"))).unwrap();
    let numbers = |text: &str| text.split_whitespace().map(|n| n.parse().unwrap()).collect::<Vec<f64>>();
    let start = numbers(between(&xml, "<key name=\"start\" qpos=\"", "\""));
    let targets = world.sim.batch().read(0, |env| env.drives.position.to_vec());
    assert_eq!(numbers(between(&xml, "\" ctrl=\"", "\"")), targets, "the keyframe commands the start");
    let line = xml.lines().find(|l| l.contains("<!-- MuJoCo")).unwrap();
    let named = line.split("stable up to a time step of ").nth(1);
    let bound = named.map(|after| after.split(' ').next().unwrap().parse().unwrap());
    Export { files, xml, start, targets, bound }
}

impl Export {
    /// Largest speed at the end, or `None` if MuJoCo warned.
    fn run(&self, h: f64, steps: usize, offset: f64) -> Option<f64> {
        let old = between(&self.xml, "timestep=\"", "\"");
        let xml = self.xml.replacen(&format!("timestep=\"{old}\""), &format!("timestep=\"{h:e}\""), 1);
        let path = self.files.write(&format!("{h:e}.xml"), xml);
        let model = mj::compile_file(&path).unwrap_or_else(|e| panic!("{e}")).into_model();
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

/// Regression: couplings are solved before implicit damping slows the drivers, so exports were explicit, at time steps
/// of 1e-7 s and less for fingers of some grams.
#[test]
fn with_followers() {
    let init_qpos = vec![("JOINT2".into(), 0.4), ("LEFT_HAND_INDEX".into(), 0.3)];
    let export =
        export(RobotCfg { drive: tutorial_gains("JOINT.*", "LEFT_.*"), init_qpos, ..worlds::arm_and_hand("robot") });
    let bound = export.bound.unwrap();
    let step: f64 = between(&export.xml, "timestep=\"", "\"").parse().unwrap();
    assert!(step >= 1e-3 && step < bound, "a step of {step} s, and {bound} s is stable");
    assert!(export.xml.contains("accelerates more slowly"), "the diagnostics name the approximation");
    for h in [step, 0.5 * step, 0.1 * step] {
        let [hold, reach] = [0.0, 0.5].map(|offset| export.run(h, (2.0 / h) as usize, offset).unwrap());
        // Without a limit a drive approaches its target at kp e / kd: 10 / s x 0.5 rad; a follower is 1.05 times as
        // fast.
        assert!(hold < 1e-3 && reach < 10.0, "{h}: {hold} {reach}");
    }
    assert!(export.run(1e4 * bound, 400, 0.5).is_none(), "the control: a step far above it diverges");
}

/// Root cause: the comment on a second reduction of the time step, for the light wheel of another robot, was written
/// from the step that was already reduced for followers, not from that of the simulation.
#[test]
fn two_reductions() {
    let (files, out, cfg) = (TempFiles::default(), TempFiles::default(), worlds::cfg(1, 1));
    let hand = worlds::urdf_robot("hand", assets::path("revo1_left/revo1_left.urdf").unwrap());
    let wheel = worlds::text_robot(&files, "wheel", &urdf(&[Joint::wheel("j", 1e-5)]));
    let mut sim = worlds::sim(cfg.clone());
    sim.add_robot(RobotCfg { drive: gains(100.0, 10.0), ..hand }).unwrap();
    sim.add_robot(RobotCfg { drive: gains(1e4, 0.1), ..wheel }).unwrap();
    sim.dump(out.folder()).unwrap();
    for name in ["robot.mjcf2.xml", "robot.mjcf4.xml"] {
        let xml = std::fs::read_to_string(out.folder().join(name)).unwrap();
        // Armatures are added for a step of 2 ms. The explicit drive of the wheel is stable up to 54 µs.
        let added: f64 = between(&xml, "mimic joints at a time step of ", " s").parse().unwrap();
        let step: f64 = between(&xml, "timestep=\"", "\"").parse().unwrap();
        assert!(step < added && added < cfg.physics_dt, "{name}: {step} {added}");
        let named: f64 = between(&xml, "smaller than the simulation's ", " s").parse().unwrap();
        assert_eq!(named, cfg.physics_dt, "{name}");
    }
}

/// Followers of an export stay at the positions given by their moving drivers.
#[test]
fn followers_track() {
    let export = export(RobotCfg {
        drive: gains(100.0, 10.0),
        ..worlds::urdf_robot("robot", assets::path("revo1_left/revo1_left.urdf").unwrap())
    });
    let model =
        mj::compile_file(export.files.write("tracked.xml", &export.xml)).unwrap_or_else(|e| panic!("{e}")).into_model();
    let mut data = mj::Data::new(&model).unwrap();
    data.ctrl_mut().iter_mut().for_each(|ctrl| *ctrl = 0.5);
    let equalities: Vec<([usize; 2], [f64; 2])> = (0..model.neq())
        .map(|eq| {
            let width = model.eq_data().len() / model.neq();
            let [a, b] = [model.eq_obj1id()[eq], model.eq_obj2id()[eq]].map(|joint| joint as usize);
            ([a, b], [model.eq_data()[width * eq], model.eq_data()[width * eq + 1]])
        })
        .collect();
    assert!(equalities.len() >= 4, "{} followers", equalities.len());
    let (mut far, mut moved) = (0.0_f64, 0.0_f64);
    for _ in 0..(2.0 / model.timestep()) as usize {
        data.step().unwrap();
        assert!(data.take_warnings().diverged().is_none());
        for ([follower, driver], [offset, slope]) in &equalities {
            let at = |joint: usize| data.qpos()[model.jnt_qposadr()[joint] as usize];
            far = far.max((at(*follower) - offset - slope * at(*driver)).abs());
            moved = moved.max(at(*driver).abs());
        }
    }
    // Control: drivers move much farther than the error of the followers.
    assert!(far < 5e-3 && moved > 0.3, "{far} rad off, {moved} rad moved");
}

#[test]
fn without_followers() {
    let (files, drive) = (TempFiles::default(), tutorial_gains("a.*", "h.*"));
    let chain = worlds::text_robot(&files, "robot", &urdf(&arm_and_hand()));
    let export = export(RobotCfg { drive, init_qpos: vec![("a2".into(), 0.4)], ..chain });
    let bound = export.bound.expect("drives have limits: both MuJoCo versions give a largest step");
    for h in [1e-3, 0.01, 0.05] {
        assert!(export.run(h, 1000, 0.0).unwrap() < 1e-3, "{h}");
        // On 2.2.2, velocity-implicit: stable up to the named step, with and without saturation.
        assert!(mj::BUILD_VERSION != mj::SupportedVersion::V2 || export.run(h, 3000, 0.5).unwrap() < 1e-3, "{h}");
    }
    match mj::BUILD_VERSION {
        mj::SupportedVersion::V2 => assert!(bound > 0.05, "{bound}"),
        mj::SupportedVersion::V4 => {
            let reach = export.run(0.98 * bound, 4000, 0.5).unwrap();
            assert!(reach < 10.0, "{reach}");
            assert!(export.run(0.01, 400, 0.5).is_none(), "the control: saturated drives diverge at 0.01 s");
        }
    }
}

/// Implicit integrators evaluate the damping of an actuator at the end of the step, but not its stiffness: with little
/// damping the bound is `h = (kd + sqrt(kd² + 4 M kp)) / kp`, also without saturation.
#[test]
fn little_damping() {
    let (m, kp, kd) = (1e-5, 1e4, 0.1_f64);
    let (files, joint) = (TempFiles::default(), Joint { axis: [0.0, 0.0, 1.0], ..Joint::wheel("j", m) });
    let robot = worlds::text_robot(&files, "robot", &urdf(&[joint]));
    let export = export(RobotCfg { drive: gains(kp, kd), ..robot });
    let (bound, expected) = (export.bound.unwrap(), (kd + (kd * kd + 4.0 * m * kp).sqrt()) / kp);
    assert!((bound / expected - 1.0).abs() < 1e-3, "{bound} {expected}");
    // From 1 mrad off the target. Below the bound the slowest mode decays by the root of det = M / (M + h kd), 4 % a
    // step; above it, it grows.
    let below = export.run(0.9 * bound, 4000, 1e-3).unwrap();
    assert!(below < 1e-3, "{below}");
    let above = export.run(1.1 * bound, 4000, 1e-3);
    assert!(above.is_none_or(|speed| speed > 1e3), "the control: 10 % above it, it diverges: {above:?}");
}
