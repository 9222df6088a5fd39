//! Properties per environment for robots from MJCF: randomized and set values act like a changed file, and according to
//! laws of physics.

use super::drives::{CHAIN, GRIPPER};
use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::sim::{DriveModel, DriveType, Error};
use kinetoscope_testkit::worlds::gains;

/// A sled on the ground with an arm, a finger that follows the arm, a foot of variable size, and a servo on a tendon
/// over arm and finger. All masses are explicit, so that sizes and geoms do not change them.
const SLED: &str = include_str!("../../data/mjcf/sled.xml");

/// A scene with the moving sled. The ground has almost no friction, because MuJoCo uses the larger friction of two
/// geoms.
fn moving_sled(text: &str, envs: usize) -> (SimulationManager, RobotId) {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg {
        physics_dt: 0.002,
        ..kinetoscope_testkit::worlds::cfg(envs, 1)
    });
    let id = sim.add_robot(RobotCfg { fix_base: false, ..robot("r", text) }).unwrap();
    sim.properties_mut().randomize_with(None, |_, _, p| p.set(Property::Friction, "ground", &[0.01])).unwrap();
    (sim, id)
}

fn slide(sim: &mut SimulationManager, id: RobotId) -> Vec<Vec<f64>> {
    let mut robot = sim.robot_mut(id);
    robot.write_root_velocity(&array![[1.5, 0.2, 0.0, 0.0, 0.0, 0.4]], None).unwrap();
    robot.set_qpos_target(&array![[0.6, 0.0]], None, None).unwrap();
    sim.update(150);
    let robot = sim.robot(id);
    let (pose, joints) = (robot.root_pose(), robot.qpos());
    (0..sim.num_envs()).map(|env| pose.row(env).iter().chain(joints.row(env)).copied().collect()).collect()
}

fn far(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).fold(0.0, |far, (a, b)| far.max((a - b).abs()))
}

/// A property changed in one environment, its value, and the equivalent edit of the file: old and new text.
type Change = (Property, &'static str, &'static [f64], [&'static str; 2]);

/// The reference is MuJoCo with a changed file. Both are compiled from the same numbers, except for constants computed
/// in another order. They differ by rounding, which 0.3 s of sliding on the same face do not amplify beyond 1e-9.
#[test]
fn as_another_file() {
    let heavy = [r#"mass="0.8" diaginertia="0.002 0.006 0.006""#, r#"mass="1.6" diaginertia="0.004 0.012 0.012""#];
    let changes: [Change; 12] = [
        (Property::Mass, "arm", &[1.6], heavy),
        (Property::CenterOfMass, "arm", &[0.2, 0.01, 0.0], [r#"pos="0.15 0 0" mass"#, r#"pos="0.2 0.01 0" mass"#]),
        (Property::Inertia, "arm", &[0.003, 0.009, 0.008], ["0.002 0.006 0.006", "0.003 0.009 0.008"]),
        (Property::Friction, "sled", &[0.6], [r#"friction="0.3"#, r#"friction="0.6"#]),
        (Property::JointDamping, "lift", &[1.1], [r#"damping="0.3""#, r#"damping="1.1""#]),
        (Property::JointDamping, "bend", &[0.4], [r#"damping="0.02""#, r#"damping="0.4""#]),
        (Property::Armature, "lift", &[0.2], [r#"armature="0.05""#, r#"armature="0.2""#]),
        (Property::Armature, "bend", &[0.05], [r#"armature="0.01""#, r#"armature="0.05""#]),
        (Property::DryFriction, "lift", &[1.5], [r#"frictionloss="0.2""#, r#"frictionloss="1.5""#]),
        // J = 1 + 0.5 · 0.4, so the drive of `lift` has k = 40 J² and F = 25 J.
        (Property::Stiffness, "lift", &[60.0 * 1.44], [r#"kp="40""#, r#"kp="60""#]),
        (Property::MaxEffort, "lift", &[9.0 * 1.2], ["-25 25", "-9 9"]),
        (Property::Size, "sled", &[0.2, 0.15, 0.07], [r#"size="0.2 0.15 0.1""#, r#"size="0.2 0.15 0.07""#]),
    ];
    for (property, name, value, edit) in changes {
        let (mut sim, id) = moving_sled(SLED, 2);
        let of = format!("r/{name}");
        sim.properties_mut().randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(property, &of, value)).unwrap();
        assert_eq!(SLED.matches(edit[0]).count(), 1, "{edit:?}");
        let (mut judge, of_judge) = moving_sled(&SLED.replace(edit[0], edit[1]), 1);
        let (mine, expected) = (slide(&mut sim, id), slide(&mut judge, of_judge));
        let (apart, control) = (far(&mine[1], &expected[0]), far(&mine[0], &mine[1]));
        assert!(apart < 1e-9, "{property:?} of {name}: {apart}");
        assert!(control > 1e-5, "{property:?} of {name} does nothing: {control}");
    }
}

/// The setters of a robot write these properties, also for followers.
#[test]
fn setters() {
    let (mut sim, id) = moving_sled(SLED, 3);
    let env = Some(&[EnvId(2)][..]);
    let mut robot = sim.robot_mut(id);
    robot.set_armature(&array![[0.2, 0.05]], None, env).unwrap();
    robot.set_joint_damping(&array![[1.1, 0.4]], None, env).unwrap();
    let lift = sim.robot(id).joint_id("lift").unwrap();
    sim.robot_mut(id).set_friction(&array![[1.5]], Some(&[lift]), env).unwrap();
    let robot = sim.robot(id);
    assert_eq!(robot.armature(), array![[0.05, 0.01], [0.05, 0.01], [0.2, 0.05]]);
    assert_eq!(robot.joint_damping(), array![[0.3, 0.02], [0.3, 0.02], [1.1, 0.4]]);
    assert_eq!(robot.friction(), array![[0.2, 0.0], [0.2, 0.0], [1.5, 0.0]]);
}

/// A disc about z: dry friction F alone slows it by F / I, so v = v0 - F t / I until it stops; an effort τ accelerates
/// it by (τ - F) / (I + armature). Both are linear in time, so that Euler's steps are exact. MuJoCo's friction is at
/// its limit while the disc rotates faster than the creep allowed by the regularization.
#[test]
fn friction_and_armature() {
    let text = |actuator: &str, friction: &str| {
        format!(
            r#"<mujoco><compiler angle="radian" autolimits="true"/><worldbody><body name="base"><geom size="0.01" mass="1"/>
            <body name="disc"><joint name="spin" axis="0 0 1" {friction}/>
              <inertial pos="0 0 0" mass="1" diaginertia="0.1 0.1 0.2"/></body></body></worldbody>{actuator}</mujoco>"#
        )
    };
    let idle = r#"<actuator><motor joint="spin"/></actuator>"#;
    let weak = |model| DriveCfg { model, ..gains(0.0, 0.0) };
    let with_room = DriveCfg { friction: Some(0.0.into()), ..weak(DriveModel::Implicit) };
    let none = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    for (what, text, drive) in [
        ("passive", text(idle, r#"frictionloss="0.3""#), none),
        ("rows of a file with friction", text(idle, r#"frictionloss="0.3""#), weak(DriveModel::Implicit)),
        ("rows with room for it", text(idle, ""), with_room),
        ("actuators", text(idle, ""), weak(DriveModel::Actuator)),
    ] {
        let (mut sim, id) = with(3, RobotCfg { drive, ..robot("r", &text) });
        let mut disc = sim.robot_mut(id);
        disc.set_friction(&array![[0.3], [0.6], [0.6]], None, None).unwrap();
        disc.set_armature(&array![[0.0], [0.0], [0.3]], None, None).unwrap();
        disc.write_qvel(&array![[5.0]], None, None).unwrap();
        sim.update(500);
        let slower = sim.robot(id).qvel();
        let expected = array![[5.0 - 0.3 / 0.2], [5.0 - 0.6 / 0.2], [5.0 - 0.6 / 0.5]];
        assert!(largest(&(&slower - &expected)) < 1e-9, "{what}: {slower}, not {expected}");
        sim.robot_mut(id).set_qf_target(&array![[1.6]], None, None).unwrap();
        sim.update(500);
        let faster = sim.robot(id).qvel() - &slower;
        let expected = array![[1.3 / 0.2], [1.0 / 0.2], [1.0 / 0.5]];
        assert!(largest(&(&faster - &expected)) < 1e-9, "{what}: {faster}, not {expected}");
        sim.reset(None).unwrap();
        assert_eq!(sim.robot(id).friction(), array![[0.3], [0.6], [0.6]], "{what}: it stays through a reset");
    }
    // An implicit drive without a separate friction row gives an error.
    let (mut sim, id) = with(1, RobotCfg { drive: weak(DriveModel::Implicit), ..robot("r", &text(idle, "")) });
    let error = sim.robot_mut(id).set_friction(&array![[0.3]], None, None).unwrap_err();
    assert!(matches!(&error, Error::UnknownName { name, .. } if name == "r/spin"), "{error}");
}

/// Against a spring of stiffness s a drive of k settles at target · k / (k + s), for actuators of two followers and of
/// a tendon over both fingers.
#[test]
fn coupled_drives() {
    let gripper = GRIPPER
        .replace('%', "1")
        .replace(r#"range="0 0.04""#, r#"range="-0.5 0.5" stiffness="25""#)
        .replace(r#"timestep="0.0001""#, r#"timestep="0.002""#);
    for (text, driver, spring, nominal, target) in
        [(CHAIN, "b", 61.25, 122.5, 0.3), (&gripper, "left", 50.0, 100.0, 0.03)]
    {
        let (mut sim, id) = with(4, robot("r", text));
        let column = sim.robot(id).joint_id(driver).unwrap();
        let name = format!("r/{driver}");
        assert_eq!(sim.robot(id).stiffness().column(column.0), array![nominal, nominal, nominal, nominal]);
        sim.robot_mut(id).set_stiffness(&array![[spring]], Some(&[column]), Some(&[EnvId(1)])).unwrap();
        let stiff = Randomization::new().with(Property::Stiffness, &name, RandomizationOp::Scale([3.0, 3.0]));
        sim.properties_mut().randomize(&stiff, Some(&[EnvId(2)])).unwrap();
        sim.robot_mut(id).set_qf_limits(&array![[0.1 * spring * target]], Some(&[column]), Some(&[EnvId(3)])).unwrap();
        // Joint damping, to settle quickly: a saturated drive has no damping.
        sim.robot_mut(id).set_joint_damping(&array![[20.0]], Some(&[column]), None).unwrap();
        sim.robot_mut(id).set_qpos_target(&row([target]), Some(&[column]), None).unwrap();
        sim.update(4000);
        let qpos = sim.robot(id).qpos();
        let share = |k: f64| k / (k + spring);
        for (env, expected) in [share(nominal), 0.5, share(3.0 * nominal), 0.1].into_iter().enumerate() {
            let found = qpos[(env, column.0)] / target;
            // Couplings carry the springs of followers, and yield by less than a thousandth of the motion.
            assert!((found - expected).abs() < 1e-3, "{driver} in {env}: {found}, not {expected}");
        }
    }
}

/// All properties of such a robot are randomized, are part of snapshots and are carried over after additions.
#[test]
fn draws_in_snapshots() {
    let draw = Randomization::new()
        .with(Property::Mass, "r/.*", RandomizationOp::Scale([0.7, 1.4]))
        .with(Property::Inertia, "r/arm", RandomizationOp::Scale([0.9, 1.1]))
        .with(Property::CenterOfMass, "r/arm", RandomizationOp::Add([-0.01, 0.01]))
        .with(Property::Friction, "r/sled|ground", RandomizationOp::Set([0.1, 0.9]))
        .with(Property::JointDamping, "r/.*", RandomizationOp::Scale([0.5, 2.0]))
        .with(Property::Armature, "r/.*", RandomizationOp::Add([0.0, 0.1]))
        .with(Property::DryFriction, "r/lift", RandomizationOp::Set([0.0, 0.5]))
        .with(Property::Stiffness, "r/lift", RandomizationOp::Scale([0.5, 2.0]))
        .with(Property::DriveDamping, "r/lift", RandomizationOp::Add([0.0, 2.0]))
        .with(Property::MaxEffort, "r/lift", RandomizationOp::Scale([0.5, 1.0]))
        .with(Property::Size, "r/sled", RandomizationOp::Scale([0.8, 1.0]))
        .with(Property::Color, "r/.*", RandomizationOp::Set([0.1, 0.9]));
    let (mut sim, id) = moving_sled(SLED, 3);
    sim.properties_mut().randomize(&draw, Some(&[EnvId(0), EnvId(2)])).unwrap();
    let values = |sim: &SimulationManager| {
        let of = |env| {
            let properties = sim.properties().of(EnvId(env)).unwrap();
            let numbers = |property| {
                let names: Vec<String> = properties.names(property).into_iter().map(String::from).collect();
                let mine = names.into_iter().filter(|name| name.starts_with("r/"));
                mine.flat_map(|name| properties.get(property, &name).unwrap().to_vec()).collect::<Vec<f64>>()
            };
            Property::ALL.into_iter().flat_map(numbers).map(f64::to_bits).collect::<Vec<u64>>()
        };
        [0, 1, 2].map(of)
    };
    let drawn = values(&sim);
    assert!(drawn[0] != drawn[1] && drawn[0] != drawn[2] && drawn[1] != drawn[2]);
    assert!(sim.robot(id).friction().column(0).to_vec() != [0.2; 3]);
    slide(&mut sim, id);
    let snapshot = sim.snapshot(None).unwrap();
    sim.update(100);
    let state = |sim: &SimulationManager| (sim.robot(id).root_pose(), sim.robot(id).qpos(), sim.robot(id).qf());
    let end = state(&sim);
    // Randomized again and moved on, then restored: the same bits.
    sim.properties_mut().randomize(&draw, None).unwrap();
    assert!(values(&sim) != drawn);
    sim.properties_mut().restore(&snapshot, None).unwrap();
    assert!(values(&sim) == drawn);
    sim.update(100);
    assert_eq!(state(&sim), end);
    // After an addition properties persist, by name.
    sim.add_robot(RobotCfg { init_pose: Pose::translation(5.0, 0.0, 0.5), ..robot("second", SLED) }).unwrap();
    assert!(values(&sim) == drawn);
    assert_eq!(state(&sim), end);
    // Control: with nominal properties the motion differs.
    sim.properties_mut().reset(None).unwrap();
    assert!(values(&sim)[0] == drawn[1], "nominal again");
    let (mut plain, plain_id) = moving_sled(SLED, 3);
    plain.restore(&snapshot, None).unwrap();
    plain.update(100);
    assert!(plain.robot(plain_id).qpos().row(0) != end.1.row(0));
}
