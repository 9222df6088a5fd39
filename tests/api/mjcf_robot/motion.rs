//! A robot moves as MuJoCo with the file alone, and as the same robot from a URDF.

use super::*;
use kinetoscope::mujoco::ObjectKind;
use kinetoscope::ndarray::{Axis, array};
use kinetoscope::sim::{DriveModel, PerJoint};
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{gains, text_robot, urdf_robot};

/// Names, masses, limits and the start are those of the file.
#[test]
fn names_and_numbers() {
    let (sim, id) = with(1, robot("odd", ODD));
    let (robot, model) = (sim.robot(id), alone(ODD));
    assert_eq!((robot.dof(), robot.joint_names()), (7, &ODD_JOINTS.map(String::from)[..]));
    let links = ["base", "shoulder", "fore", "carriage", "plate", "hand", "shoulder_site", "tip"];
    assert_eq!(robot.link_names(), links, "bodies, then named sites");
    let mass: f64 = model.body_mass().iter().sum();
    assert!((robot.total_mass() - mass).abs() < 1e-14 * mass && (mass - 7.2).abs() < 1e-12);
    let limits = robot.qpos_limits();
    assert_eq!(limits.as_slice().unwrap(), model.jnt_range());
    assert!((limits[(0, 0, 1)] - 150f64.to_radians()).abs() < 1e-15 && limits[(0, 3, 1)] == 0.15);
    let start = robot.default_qpos();
    assert_eq!(start.as_slice().unwrap(), model.qpos0());
    assert!((start[(0, 0)] - 20f64.to_radians()).abs() < 1e-15);
    assert_eq!(robot.armature().as_slice().unwrap(), model.dof_armature());
    assert_eq!(robot.joint_damping()[(0, 2)], 0.2);
    assert_eq!(robot.qpos(), start);
}

/// Gravity, centrifugal and Coriolis forces and the mass matrix at random states. Both sides are computed by MuJoCo,
/// from numbers that were written and read once. Forces are about 10 N m, so 1e-12 is a few hundred rounding errors.
#[test]
fn bias_and_mass_matrix() {
    let (mut sim, id) = with(1, passive(robot("odd", ODD)));
    let mut data = Data::new(&alone(ODD)).unwrap();
    let mut random = KeyedRng::keyed(3, 0, "velocities");
    let mut most = 0.0f64;
    for qpos in random_qpos(&sim, id, 50).axis_iter(Axis(0)) {
        let qvel = Array2::from_shape_fn((1, 7), |_| 4.0 * random.uniform() - 2.0);
        let qpos = qpos.insert_axis(Axis(0)).to_owned();
        sim.robot_mut(id).write_qpos(&qpos, None, None).unwrap();
        sim.robot_mut(id).write_qvel(&qvel, None, None).unwrap();
        data.qpos_mut().copy_from_slice(qpos.as_slice().unwrap());
        data.qvel_mut().copy_from_slice(qvel.as_slice().unwrap());
        data.forward().unwrap();
        sim.batch().read(0, |env| {
            let (mut ours, theirs) = (env.data().mass_matrix().unwrap(), data.mass_matrix().unwrap());
            // The scene's matrix includes the damping that is integrated with the drives: h B of the elbow.
            ours[2 * 7 + 2] -= 0.002 * 0.2;
            let bias = env.data().qfrc_bias().iter().zip(data.qfrc_bias());
            for (ours, theirs) in bias.chain(ours.iter().zip(&theirs)) {
                assert!((ours - theirs).abs() < 1e-12, "{ours} {theirs}");
            }
        });
        most = most.max(largest(data.qfrc_bias()));
    }
    assert!(most > 10.0, "{most}");
}

/// Falling and swinging without drives, inside of all limits. Damping moves into the solve, which is equivalent if
/// nothing else is solved: `(M + h B) a = f - B v` both here and in MuJoCo's implicit damping. 0.1 s are too short for
/// chaos: 1e-9 is far above amplified rounding.
#[test]
fn passive_fall() {
    let speeds = [0.3, -0.2, 0.5, 0.05, 1.0, -0.4, 0.7];
    let falls = |text: &str| {
        let (mut sim, id) = with(1, passive(robot("odd", text)));
        sim.robot_mut(id).write_qvel(&row(speeds), None, None).unwrap();
        sim.update(50);
        sim.robot(id).qpos()
    };
    let mut data = Data::new(&alone(ODD)).unwrap();
    data.qvel_mut().copy_from_slice(&speeds);
    (0..50).for_each(|_| data.step().unwrap());
    let expected = Array2::from_shape_vec((1, 7), data.qpos().to_vec()).unwrap();
    let ours = falls(ODD);
    assert!(data.qpos().iter().zip(data.model().qpos0()).any(|(a, b)| (a - b).abs() > 0.05), "it moved");
    assert!(largest(&(&ours - &expected)) < 1e-9, "{ours} {expected}");
    // Control: without the spring it falls differently.
    assert!((falls(&ODD.replace(r#"stiffness="1.5""#, ""))[(0, 2)] - expected[(0, 2)]).abs() > 1e-4);
}

/// Payloads are added to the file's masses. The center of mass of the forearm stays; that of the hand moves to (0.3 c +
/// 0.25 s) / 0.55 with the site s.
#[test]
fn payloads() {
    let payload = vec![("fore".into(), 0.5), ("tip".into(), 0.25)];
    let (sim, id) = with(1, RobotCfg { payload, ..passive(robot("odd", ODD)) });
    let (model, loaded) = (alone(ODD), sim.batch().model().clone());
    let com = |model: &Model, body: usize| [0, 1, 2].map(|k| model.body_ipos()[3 * body + k]);
    let hand = [(0.3 * 0.05 + 0.25 * 0.1) / 0.55, 0.0, 0.25 * 0.01 / 0.55];
    for (name, payload, center) in [("fore", 0.5, None), ("hand", 0.25, Some(hand)), ("base", 0.0, None)] {
        let here = loaded.id(ObjectKind::Body, &format!("odd/{name}")).unwrap();
        let there = model.id(ObjectKind::Body, name).unwrap();
        let added = loaded.body_mass()[here] - model.body_mass()[there];
        assert!((added - payload).abs() < 1e-15, "{name}: {added}");
        let (found, expected) = (com(&loaded, here), center.unwrap_or(com(&model, there)));
        assert!((0..3).all(|k| (found[k] - expected[k]).abs() < 1e-12), "{name}: {found:?} {expected:?}");
    }
    assert!((sim.robot(id).total_mass() - 7.2 - 0.75).abs() < 1e-12);
}

/// Six axes from stiff to soft, one of them a slide, with friction and damping of the joints. Columns: axis, position,
/// mass of the child link, limits, damping and friction of the joint, effort, stiffness and damping of the drive.
const ARM: [[&str; 10]; 6] = [
    ["0 0 1", "0 0 0.1", "5", "-2.5", "2.5", "0", "2", "80", "900", "60"],
    ["0 1 0", "0.05 0 0.2", "4", "-2.5", "2.5", "1.5", "0", "80", "900", "60"],
    ["0 1 0", "0 0 0.4", "3", "-2.5", "2.5", "0", "0", "80", "900", "60"],
    ["0 0 1", "0.1 0 0.3", "1", "-2.5", "2.5", "0.3", "0.5", "30", "900", "60"],
    ["0.6 0.8 0", "0 0.1 0.1", "0.8", "-2.5", "2.5", "0", "0", "20", "200", "4"],
    ["1 0 0", "0 0 0.1", "0.5", "-0.1", "0.2", "0", "0", "80", "900", "60"],
];

/// The arm as MJCF and as URDF. The MJCF sets the hardness of joint friction to that of robots from URDF files.
fn arm() -> [String; 2] {
    let (mut bodies, mut actuators, mut urdf) = (String::new(), String::new(), String::new());
    let link = |name: &str, mass: &str, com: &str, [x, y, z]: [&str; 3]| {
        format!(
            r#"<link name="{name}"><inertial><origin xyz="{com}"/><mass value="{mass}"/>
               <inertia ixx="{x}" iyy="{y}" izz="{z}" ixy="0" ixz="0" iyz="0"/></inertial></link>"#
        )
    };
    urdf += &link("l", "1", "0 0 0", ["1"; 3]);
    for (k, [axis, at, mass, low, high, damping, friction, effort, stiffness, drive_damping]) in ARM.iter().enumerate()
    {
        let (parent, child) = (format!("l{}", "0".repeat(k)), format!("l{}", "0".repeat(k + 1)));
        let [of_mjcf, of_urdf] = if k == 5 { ["slide", "prismatic"] } else { ["hinge", "revolute"] };
        bodies += &format!(
            r#"<body name="{child}" pos="{at}"><joint name="j{k}" type="{of_mjcf}" axis="{axis}" range="{low} {high}"
               limited="true" damping="{damping}" frictionloss="{friction}" armature="0.02"/>
               <inertial pos="0.05 0.01 0.08" mass="{mass}" diaginertia="0.02 0.03 0.015"/>"#
        );
        actuators += &format!(
            r#"<general joint="j{k}" gaintype="fixed" biastype="affine" gainprm="{stiffness}"
               biasprm="0 -{stiffness} -{drive_damping}" forcelimited="true" forcerange="-{effort} {effort}"/>"#
        );
        urdf += &link(&child, mass, "0.05 0.01 0.08", ["0.02", "0.03", "0.015"]);
        urdf += &format!(
            r#"<joint name="j{k}" type="{of_urdf}"><parent link="{parent}"/><child link="{child}"/><origin xyz="{at}"/>
               <axis xyz="{axis}"/><limit lower="{low}" upper="{high}" effort="{effort}" velocity="10"/>
               <dynamics damping="{damping}" friction="{friction}"/></joint>"#
        );
    }
    let (ends, base) = ("</body>".repeat(ARM.len()), r#"<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>"#);
    let mjcf = format!(
        r#"<mujoco><compiler angle="radian"/>
           <default><joint solreffriction="0.004 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"/></default>
           <worldbody><body name="l">{base}{bodies}{ends}</body></worldbody><actuator>{actuators}</actuator></mujoco>"#
    );
    [mjcf, kinetoscope_testkit::urdf::robot("arm", &urdf)]
}

/// Positions and efforts.
type Sample = (Array2<f64>, Array2<f64>);

/// [`Sample`]s after each tenth of a second of a motion with saturated drives.
fn steps(cfg: RobotCfg) -> (SimulationManager, RobotId, Vec<Sample>) {
    let (mut sim, id) = with(2, cfg);
    let targets = array![[0.5, -0.7, 1.0, 0.8, -1.2, 0.1], [-1.0, 0.4, -0.6, 1.5, 0.3, -0.05]];
    sim.robot_mut(id).set_qpos_target(&targets, None, None).unwrap();
    let mut seen = Vec::new();
    for _ in 0..10 {
        sim.update(50);
        seen.push((sim.robot(id).qpos(), sim.robot(id).qf()));
    }
    (sim, id, seen)
}

/// Both robots have the same rows and inertias up to rounding of the principal axes. The arm is driven, so differences
/// do not grow: 1e-9 in positions of 1 rad, and in efforts of 100 N m that times the stiffness.
#[test]
fn same_as_urdf() {
    let files = TempFiles::default();
    let [mjcf, urdf] = arm();
    for model in [DriveModel::Implicit, DriveModel::Actuator] {
        let of_mjcf = RobotCfg { drive: DriveCfg { model, ..Default::default() }, ..robot("arm", &mjcf) };
        // The drives of the URDF robot get the gains of the MJCF file.
        let of_urdf = |elbow: f64| {
            let gain = |column: usize, elbow: f64| {
                let of = |k: usize| ARM[k][column].parse::<f64>().unwrap() * if k == 2 { elbow } else { 1.0 };
                PerJoint::By((0..6).map(|k| (format!("j{k}"), of(k))).collect())
            };
            let (stiffness, damping) = (gain(8, elbow), gain(9, 1.0));
            let drive = DriveCfg { model, stiffness, damping, armature: 0.02.into(), ..Default::default() };
            RobotCfg { drive, ..text_robot(&files, "arm", &urdf) }
        };
        let ((a, xml, mine), (b, urdf, other)) = (steps(of_mjcf), steps(of_urdf(1.0)));
        let (xml, urdf) = (a.robot(xml), b.robot(urdf));
        for (mine, other) in [
            (xml.stiffness(), urdf.stiffness()),
            (xml.damping(), urdf.damping()),
            (xml.armature(), urdf.armature()),
            (xml.friction(), urdf.friction()),
            (xml.qf_limits(), urdf.qf_limits()),
        ] {
            assert_eq!(mine, other);
        }
        assert_eq!(xml.qpos_limits(), urdf.qpos_limits());
        for ((qpos, qf), (other_qpos, other_qf)) in mine.iter().zip(&other) {
            let (far, pushed) = (largest(&(qpos - other_qpos)), largest(&(qf - other_qf)));
            assert!(far <= 1e-9 && pushed <= 1e-6, "{model:?}: {far} rad, {pushed} N m");
        }
        assert!(largest(&mine[0].1) > 79.0, "a drive is at its limit: {}", mine[0].1);
        assert!((mine[9].0[(0, 0)] - 0.5).abs() < 0.05, "{}", mine[9].0);
        // Control: one percent less stiffness of one joint is detected.
        assert!(largest(&(&steps(of_urdf(0.99)).2[9].0 - &other[9].0)) > 1e-6, "{model:?}");
    }
}

/// The bundled quadruped from URDF and from MJCF, in its posture.
fn quadrupeds() -> [(SimulationManager, RobotId); 2] {
    let file = |name: &str| assets::path(name).unwrap();
    let of_urdf = urdf_robot("robot", file("quadruped/quadruped.urdf"));
    let of_urdf = RobotCfg { init_pose: Pose::translation(0.0, 0.0, 0.6), ..of_urdf };
    let mjcf = Some(MjcfFile::new(file("quadruped/quadruped.xml")));
    [of_urdf, RobotCfg { mjcf, ..Default::default() }].map(|cfg| {
        let mut sim =
            kinetoscope_testkit::worlds::sim(SimulationManagerCfg { num_envs: 1, ..SimulationManagerCfg::legged() });
        let posture = [(".*HAA", 0.0), (".*F_HFE", 0.4), (".*H_HFE", -0.4), (".*F_KFE", -0.8), (".*H_KFE", 0.8)];
        let init_qpos = posture.map(|(joints, angle)| (joints.to_string(), angle)).to_vec();
        let id = sim.add_robot(RobotCfg { fix_base: false, init_qpos, drive: gains(80.0, 5.0), ..cfg }).unwrap();
        (sim, id)
    })
}

/// Joints, masses, limits and frames are the same. Degrees with six digits are accurate to 1e-6 rad; lengths and masses
/// are equal numbers, and principal axes are rounded.
#[test]
fn quadruped() {
    let [(a, urdf), (b, xml)] = quadrupeds();
    let (urdf, xml) = (a.robot(urdf), b.robot(xml));
    assert_eq!(urdf.joint_names(), xml.joint_names());
    assert!((urdf.total_mass() - xml.total_mass()).abs() < 1e-12 && (xml.total_mass() - 52.135).abs() < 1e-3);
    assert!(largest(&(urdf.qpos_limits() - xml.qpos_limits())) < 1e-5);
    assert_eq!((urdf.qf_limits(), urdf.default_qpos()), (xml.qf_limits(), xml.default_qpos()));
    let poses = xml.link_poses();
    for (link, name) in xml.link_names().into_iter().enumerate() {
        let (there, here) = (urdf.link_pose(name).unwrap(), poses.index_axis(Axis(1), link));
        assert!(largest(&(&there - &here)) < 1e-9, "{name}: {there} {here}");
    }
    assert_eq!(urdf.link_names().len(), xml.link_names().len() + 1, "all but a frame of a frame");
    let [there, here] = [&a, &b].map(|sim| sim.batch().read(0, |env| env.data().qfrc_bias().to_vec()));
    assert!(there.iter().zip(&here).all(|(a, b)| (a - b).abs() < 1e-8) && there[2] > 500.0, "{there:?} {here:?}");
}

/// Both quadrupeds stand on four feet, which carry the weight.
#[test]
fn quadruped_stands() {
    for (mut sim, id) in quadrupeds() {
        let feet = sim.add_sensor("feet", ContactSensorCfg::for_bodies(".*_FOOT")).unwrap();
        sim.update((2.0 / sim.cfg().physics_dt).round() as u32);
        assert!(sim.diverged().is_empty());
        let weight: f64 = sim.sensor(feet).unwrap().net_forces_w().index_axis(Axis(2), 2).row(0).iter().sum();
        // The mass has three decimals: 5e-4 kg are 5e-3 N; the same again for a remaining acceleration of 1e-4 m/s².
        assert!((weight - 52.135 * 9.81).abs() < 1e-2, "{weight} N");
        assert_eq!(sim.batch().read(0, |env| env.data().contact().len()), 4);
        assert!(sim.robot(id).root_pose()[(0, 2)] > 0.4);
    }
}
