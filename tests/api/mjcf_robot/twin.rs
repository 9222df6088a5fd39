//! The same robot from MJCF and from URDF, with the same numbers, moves alike.

use super::{empty, robot};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use std::fmt::Write;

/// One joint with the link behind it.
struct Axis {
    slides: bool,
    axis: [f64; 3],
    at: [f64; 3],
    mass: f64,
    com: [f64; 3],
    moments: [f64; 3],
    range: [f64; 2],
    damping: f64,
    friction: f64,
    effort: f64,
    stiffness: f64,
    drive_damping: f64,
}

const fn axis(axis: [f64; 3], at: [f64; 3], mass: f64) -> Axis {
    Axis {
        slides: false,
        axis,
        at,
        mass,
        com: [0.05, 0.01, 0.08],
        moments: [0.02, 0.03, 0.015],
        range: [-2.5, 2.5],
        damping: 0.0,
        friction: 0.0,
        effort: 80.0,
        stiffness: 900.0,
        drive_damping: 60.0,
    }
}

/// Six axes, from stiff and weak to soft, one of them a slide, with friction and damping of the joints.
const ARM: [Axis; 6] = [
    Axis { friction: 2.0, ..axis([0.0, 0.0, 1.0], [0.0, 0.0, 0.1], 5.0) },
    Axis { damping: 1.5, ..axis([0.0, 1.0, 0.0], [0.05, 0.0, 0.2], 4.0) },
    axis([0.0, 1.0, 0.0], [0.0, 0.0, 0.4], 3.0),
    Axis { friction: 0.5, damping: 0.3, effort: 30.0, ..axis([0.0, 0.0, 1.0], [0.1, 0.0, 0.3], 1.0) },
    Axis { effort: 20.0, stiffness: 200.0, drive_damping: 4.0, ..axis([0.6, 0.8, 0.0], [0.0, 0.1, 0.1], 0.8) },
    Axis { slides: true, range: [-0.1, 0.2], ..axis([1.0, 0.0, 0.0], [0.0, 0.0, 0.1], 0.5) },
];

fn numbers(values: &[f64]) -> String {
    values.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")
}

/// Friction of joints is as hard as that of robots from URDF files: this file says so.
fn mjcf() -> String {
    let (mut bodies, mut actuators) = (String::new(), String::new());
    for (k, a) in ARM.iter().enumerate() {
        write!(
            bodies,
            r#"<body name="l{k}" pos="{}"><joint name="j{k}" type="{}" axis="{}" range="{}" limited="true" damping="{}"
               frictionloss="{}" armature="0.02"/><inertial pos="{}" mass="{}" diaginertia="{}"/>"#,
            numbers(&a.at),
            if a.slides { "slide" } else { "hinge" },
            numbers(&a.axis),
            numbers(&a.range),
            a.damping,
            a.friction,
            numbers(&a.com),
            a.mass,
            numbers(&a.moments)
        )
        .unwrap();
        write!(
            actuators,
            r#"<general joint="j{k}" gaintype="fixed" biastype="affine" gainprm="{0}" biasprm="0 -{0} -{1}"
               forcelimited="true" forcerange="-{2} {2}"/>"#,
            a.stiffness, a.drive_damping, a.effort
        )
        .unwrap();
    }
    let (ends, base) = ("</body>".repeat(ARM.len()), r#"<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>"#);
    format!(
        r#"<mujoco><compiler angle="radian"/>
           <default><joint solreffriction="0.004 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/></default><worldbody><body name="base">{base}{bodies}{ends}</body></worldbody>
           <actuator>{actuators}</actuator></mujoco>"#
    )
}

fn urdf() -> String {
    let link = |name: String, mass: f64, com: &[f64], [x, y, z]: [f64; 3]| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="{}"/><mass value="{mass}"/>
               <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>"#,
            numbers(com)
        )
    };
    let mut text = link("base".into(), 1.0, &[0.0; 3], [1.0; 3]);
    for (k, a) in ARM.iter().enumerate() {
        text += &link(format!("l{k}"), a.mass, &a.com, a.moments);
        let parent = if k == 0 { "base".into() } else { format!("l{}", k - 1) };
        write!(
            text,
            r#"<joint name="j{k}" type="{}"><parent link="{parent}"/><child link="l{k}"/><origin xyz="{}"/><axis xyz="{}"/>
               <limit lower="{}" upper="{}" effort="{}" velocity="10"/><dynamics damping="{}" friction="{}"/></joint>"#,
            if a.slides { "prismatic" } else { "revolute" },
            numbers(&a.at),
            numbers(&a.axis),
            a.range[0],
            a.range[1],
            a.effort,
            a.damping,
            a.friction
        )
        .unwrap();
    }
    format!(r#"<robot name="arm">{text}</robot>"#)
}

fn gains(of: fn(&Axis) -> f64) -> PerJoint {
    PerJoint::By(ARM.iter().enumerate().map(|(k, axis)| (format!("j{k}"), of(axis))).collect())
}

/// The drives of the URDF robot, which has to be told what the MJCF file says.
fn told() -> DriveCfg {
    DriveCfg {
        stiffness: gains(|axis| axis.stiffness),
        damping: gains(|axis| axis.drive_damping),
        armature: 0.02.into(),
        ..Default::default()
    }
}

/// Positions and efforts after each tenth of a second of steps that saturate drives.
fn steps(sim: &mut SimulationManager, id: RobotId) -> Vec<(Array2<f64>, Array2<f64>)> {
    let targets = [[0.5, -0.7, 1.0, 0.8, -1.2, 0.1], [-1.0, 0.4, -0.6, 1.5, 0.3, -0.05]];
    sim.robot_mut(id).set_qpos(&Array2::from_shape_fn((2, 6), |(env, k)| targets[env][k]), None, None).unwrap();
    let mut seen = Vec::new();
    for _ in 0..10 {
        sim.update(50);
        seen.push((sim.robot(id).get_qpos(), sim.robot(id).get_qf()));
    }
    seen
}

/// Both are the same rows on the same inertias, which differ by the rounding of principal axes; the arm is driven, so nothing
/// grows: 1e-9 in positions of 1 rad, and in efforts of 100 N m times the stiffness of that.
#[test]
fn a_step_goes_as_that_of_the_same_robot_from_a_urdf() {
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let mut of_mjcf = empty(2);
        let drive = DriveCfg { model, ..Default::default() };
        let a = of_mjcf.add_robot(RobotCfg { drive, ..robot("arm", &mjcf()) }).unwrap();
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("arm.urdf");
        std::fs::write(&path, urdf()).unwrap();
        let mut of_urdf = empty(2);
        let drive = DriveCfg { model, ..told() };
        let cfg = RobotCfg { uid: "arm".into(), urdf: UrdfCfg::single(path), drive, ..Default::default() };
        let b = of_urdf.add_robot(cfg.clone()).unwrap();
        for (mine, other) in [
            (of_mjcf.robot(a).get_stiffness(), of_urdf.robot(b).get_stiffness()),
            (of_mjcf.robot(a).get_damping(), of_urdf.robot(b).get_damping()),
            (of_mjcf.robot(a).get_armature(), of_urdf.robot(b).get_armature()),
            (of_mjcf.robot(a).get_friction(), of_urdf.robot(b).get_friction()),
            (of_mjcf.robot(a).qf_limits(), of_urdf.robot(b).qf_limits()),
        ] {
            assert_eq!(mine, other);
        }
        assert_eq!(of_mjcf.robot(a).qpos_limits(), of_urdf.robot(b).qpos_limits());
        let (mine, other) = (steps(&mut of_mjcf, a), steps(&mut of_urdf, b));
        for ((qpos, qf), (other_qpos, other_qf)) in mine.iter().zip(&other) {
            let far = (qpos - other_qpos).iter().fold(0.0f64, |far, d| far.max(d.abs()));
            let pushed = (qf - other_qf).iter().fold(0.0f64, |far, d| far.max(d.abs()));
            assert!(far <= 1e-9 && pushed <= 1e-6, "{model:?}: {far} rad, {pushed} N m");
        }
        assert!(mine[0].1.iter().any(|effort| effort.abs() > 79.0), "a drive is at its limit: {}", mine[0].1);
        assert!((mine[9].0[(0, 0)] - 0.5).abs() < 0.05, "{}", mine[9].0);
        // The control: one percent less stiffness of one joint is seen.
        let softer_elbow = ARM.iter().enumerate().map(|(k, axis)| {
            let share = if k == 2 { 0.99 } else { 1.0 };
            (format!("j{k}"), share * axis.stiffness)
        });
        let drive = DriveCfg { stiffness: PerJoint::By(softer_elbow.collect()), ..cfg.drive.clone() };
        let mut softer = empty(2);
        let c = softer.add_robot(RobotCfg { drive, ..cfg }).unwrap();
        let third = steps(&mut softer, c);
        assert!((&third[9].0 - &other[9].0).iter().any(|d| d.abs() > 1e-6), "{model:?}");
    }
}
