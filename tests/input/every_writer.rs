//! Every writer of robots, objects and MJCF parts, with every kind of invalid array and index: each gives a typed error
//! that names the mistake, and leaves the state unchanged. Each writer is also called with valid input, which must
//! change the state.

use super::support::{LIMIT, bits, chain, robot};
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::prelude::*;
use kinetoscope::sim::{Error, MjcfId, Result, RigidObjectId, RobotMut, WrenchFrame};

const ENVS: usize = 3;
const POSE: &[f64] = &[0.1, 0.2, 1.0, 0.0, 0.0, 0.6, 0.8];
const HALF: &[f64] = &[0.5; 6];
const STATE: &[f64] = &[0.3, 0.2, 1.0, 0.0, 0.0, 0.6, 0.8, 0.25, 0.5, 0.5, 0.5, 0.5, 0.5];

#[derive(Clone, Copy)]
struct Ids {
    robot: RobotId,
    object: RigidObjectId,
    part: MjcfId,
}

const PART: &str = r#"<mujoco><worldbody><body name="hand" mocap="true"><geom size="0.05" contype="0" conaffinity="0"/></body>
    <body name="arm" pos="5 0 2"><joint name="hinge" axis="0 1 0"/><geom size="0.1" pos="0.2 0 0"/></body></worldbody>
    <actuator><motor name="motor" joint="hinge"/></actuator></mujoco>"#;

fn world() -> (SimulationManager, Ids) {
    let dir = tempfile::tempdir().unwrap();
    let urdf = chain(4, "revolute", &format!("{LIMIT}<dynamics damping=\"0.1\" friction=\"0.1\"/>"));
    let mut sim = super::support::sim(ENVS);
    let init_pose = Pose::translation(0.0, 0.0, 3.0);
    let base = RobotCfg { fix_base: false, init_pose, ..robot(dir.path(), "r", &urdf) };
    let cube = kinetoscope_testkit::worlds::object("o", ObjectShape::cube(0.1), [0.0; 3]);
    let ids = Ids {
        robot: sim.add_robot(base).unwrap(),
        object: sim.add_rigid_object(cube).unwrap(),
        part: sim.add_mjcf(MjcfPartCfg::text("m", PART)).unwrap(),
    };
    (sim, ids)
}

/// All state that these writers can change, as text.
fn written_state(sim: &SimulationManager, ids: Ids) -> String {
    let view = sim.robot(ids.robot);
    let drives = [view.stiffness(), view.damping(), view.qf_limits(), view.qvel_limits()];
    let joints = [view.friction(), view.joint_damping(), view.armature()];
    let targets = [view.qpos_target(), view.qvel_target(), view.qf_target()];
    let mut text = format!("{:?} {drives:?} {joints:?} {targets:?}", bits(sim));
    for env in 0..ENVS {
        let properties = sim.properties().of(EnvId(env)).unwrap();
        for property in
            [Property::Mass, Property::Inertia, Property::CenterOfMass, Property::Friction, Property::LinearDamping]
        {
            text += &format!("{:?}", properties.get(property, "o").unwrap());
        }
        sim.batch().read(env, |env| {
            let data = env.data();
            text += &format!("{:?} {:?} {:?}", data.ctrl(), data.xfrc_applied(), [data.mocap_pos(), data.mocap_quat()]);
        });
    }
    text
}

type Values<'a> = &'a Array2<f64>;
type Envs<'a> = Option<&'a [EnvId]>;
type Joints<'a> = Option<&'a [JointIndex]>;

/// A writer of joint values: its name, true if infinity is valid, and its call.
type JointWriter = (&'static str, bool, fn(&mut RobotMut<'_>, Values<'_>, Joints<'_>, Envs<'_>) -> Result<()>);

const JOINT_WRITERS: &[JointWriter] = &[
    ("set_qpos_target", false, |r, v, j, e| r.set_qpos_target(v, j, e)),
    ("set_qvel_target", false, |r, v, j, e| r.set_qvel_target(v, j, e)),
    ("set_qf_target", false, |r, v, j, e| r.set_qf_target(v, j, e)),
    ("write_qpos", false, |r, v, j, e| r.write_qpos(v, j, e)),
    ("write_qvel", false, |r, v, j, e| r.write_qvel(v, j, e)),
    ("write_joint_state", false, |r, v, j, e| r.write_joint_state(&v.mapv(|x| 0.5 * x), v, j, e)),
    ("write_qacc", false, |r, v, j, e| r.write_qacc(v, j, e)),
    ("set_stiffness", false, |r, v, j, e| r.set_stiffness(v, j, e)),
    ("set_damping", false, |r, v, j, e| r.set_damping(v, j, e)),
    ("set_friction", false, |r, v, j, e| r.set_friction(v, j, e)),
    ("set_joint_damping", false, |r, v, j, e| r.set_joint_damping(v, j, e)),
    ("set_armature", false, |r, v, j, e| r.set_armature(v, j, e)),
    ("set_qf_limits", true, |r, v, j, e| r.set_qf_limits(v, j, e)),
    ("set_qvel_limits", true, |r, v, j, e| r.set_qvel_limits(v, j, e)),
];

/// A writer of rows: its name, a valid row, and its call.
type RowWriter = (&'static str, &'static [f64], fn(&mut SimulationManager, Ids, Values<'_>, Envs<'_>) -> Result<()>);

const ROW_WRITERS: &[RowWriter] = &[
    ("write_root_pose", POSE, |s, i, v, e| s.robot_mut(i.robot).write_root_pose(v, e)),
    ("write_root_velocity", HALF, |s, i, v, e| s.robot_mut(i.robot).write_root_velocity(v, e)),
    ("write_root_state", STATE, |s, i, v, e| s.robot_mut(i.robot).write_root_state(v, e)),
    ("write_root_com_velocity", &[0.25; 6], |s, i, v, e| s.robot_mut(i.robot).write_root_com_velocity(v, e)),
    ("write_pose", POSE, |s, i, v, e| s.rigid_object_mut(i.object).write_pose(v, e)),
    ("write_velocity", HALF, |s, i, v, e| s.rigid_object_mut(i.object).write_velocity(v, e)),
    ("set_mass", &[0.5], |s, i, v, e| s.rigid_object_mut(i.object).set_mass(v.index_axis(Axis(1), 0), e)),
    ("set_friction", &[0.5; 3], |s, i, v, e| s.rigid_object_mut(i.object).set_friction(v, e)),
    ("set_inertia", &[0.5; 3], |s, i, v, e| s.rigid_object_mut(i.object).set_inertia(v, e)),
    ("set_center_of_mass", &[0.02; 3], |s, i, v, e| s.rigid_object_mut(i.object).set_center_of_mass(v, e)),
    ("set_damping", &[0.5; 2], |s, i, v, e| s.rigid_object_mut(i.object).set_damping(v, e)),
    ("set_external_wrench", &[0.5; 3], |s, i, v, e| {
        s.rigid_object_mut(i.object).set_external_wrench(v, v, WrenchFrame::World, e)
    }),
    ("set_ctrl", &[0.5], |s, i, v, e| s.mjcf_part_mut(i.part).set_ctrl(v, None, e)),
    ("write_qpos", &[0.5], |s, i, v, e| s.mjcf_part_mut(i.part).write_qpos(v, e)),
    ("write_qvel", &[0.5], |s, i, v, e| s.mjcf_part_mut(i.part).write_qvel(v, e)),
    ("write_mocap_pose", POSE, |s, i, v, e| s.mjcf_part_mut(i.part).write_mocap_pose("hand", v, e)),
];

/// The expected error of a mistake.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Shape,
    Number,
    Unknown(&'static str, usize),
    Twice,
}

#[track_caller]
fn assert_refused(result: Result<()>, name: &str, kind: Kind) {
    let error = result.expect_err(name);
    let right = match (&error, kind) {
        (Error::Shape { argument, .. }, Kind::Shape)
        | (Error::NotFinite { argument, .. } | Error::OutOfRange { argument, .. }, Kind::Number)
        | (Error::RepeatedItem { argument, .. }, Kind::Twice) => argument.starts_with(name),
        (Error::UnknownIndex { what, index, .. }, Kind::Unknown(of, which)) => *what == of && *index == which,
        _ => false,
    };
    assert!(right, "{name}: {kind:?} gave {error:?}");
}

/// A table of `rows` rows equal to `good`.
fn table(good: &[f64], rows: usize) -> Array2<f64> {
    Array2::from_shape_fn((rows, good.len()), |(_, k)| good[k])
}

fn with_last(mut values: Array2<f64>, value: f64) -> Array2<f64> {
    let last = (values.nrows() - 1, values.ncols() - 1);
    values[last] = value;
    values
}

/// Tables and environment ids that are invalid for every writer of such rows.
fn mistakes(good: &[f64], infinity_is_fine: bool) -> Vec<(Array2<f64>, Option<Vec<EnvId>>, Kind)> {
    let some = |ids: &[usize]| Some(ids.iter().map(|&id| EnvId(id)).collect());
    let mut mistakes = vec![
        (table(good, 2), None, Kind::Shape),
        (table(good, 4), None, Kind::Shape),
        (table(good, 0), None, Kind::Shape),
        (table(good, 3), some(&[0, 1]), Kind::Shape),
        (with_last(table(good, 3), f64::NAN), None, Kind::Number),
        (table(good, 1), some(&[ENVS]), Kind::Unknown("environment", ENVS)),
        (table(good, 2), some(&[0, usize::MAX]), Kind::Unknown("environment", usize::MAX)),
        (table(good, 3), some(&[1, 2, 1]), Kind::Twice),
        (table(good, 1), some(&[1, 1]), Kind::Twice),
    ];
    if good.len() > 1 {
        mistakes.push((table(&[good, &[0.5]].concat(), 3), None, Kind::Shape));
        mistakes.push((table(&good[1..], 3), None, Kind::Shape));
    }
    if !infinity_is_fine {
        mistakes.push((with_last(table(good, 3), f64::INFINITY), None, Kind::Number));
        mistakes.push((with_last(table(good, 1), f64::NEG_INFINITY), some(&[2]), Kind::Number));
    }
    mistakes
}

#[test]
fn joint_writers() {
    let (mut sim, ids) = world();
    sim.update(3);
    for (name, infinity_is_fine, call) in JOINT_WRITERS {
        let before = written_state(&sim, ids);
        let good: &[f64] = &HALF[..3];
        for (values, envs, kind) in mistakes(good, *infinity_is_fine) {
            assert_refused(call(&mut sim.robot_mut(ids.robot), &values, None, envs.as_deref()), name, kind);
            assert_eq!(written_state(&sim, ids), before, "{name}: {kind:?}");
        }
        let twice = [JointIndex(2), JointIndex(0), JointIndex(2)];
        let beyond = [JointIndex(0), JointIndex(3), JointIndex(1)];
        let far = [JointIndex(usize::MAX)];
        let joints: [(&[JointIndex], usize, Kind); 5] = [
            (&twice, 3, Kind::Twice),
            (&beyond, 3, Kind::Unknown("joint", 3)),
            (&far, 1, Kind::Unknown("joint", usize::MAX)),
            (&twice[..2], 3, Kind::Shape),
            (&[], 3, Kind::Shape),
        ];
        for (joints, columns, kind) in joints {
            let values = table(&HALF[..columns], ENVS);
            assert_refused(call(&mut sim.robot_mut(ids.robot), &values, Some(joints), None), name, kind);
            assert_eq!(written_state(&sim, ids), before, "{name}: {kind:?}");
        }
        // Empty lists of environments or joints are valid.
        let mut robot = sim.robot_mut(ids.robot);
        call(&mut robot, &table(good, 0), None, Some(&[])).unwrap();
        call(&mut robot, &Array2::zeros((ENVS, 0)), Some(&[]), None).unwrap();
        assert_eq!(written_state(&sim, ids), before, "{name}: an empty selection changes nothing");
        call(&mut sim.robot_mut(ids.robot), &table(&good[..1], 1), Some(&[JointIndex(1)]), Some(&[EnvId(2)])).unwrap();
        assert_ne!(written_state(&sim, ids), before, "{name}: the control");
    }
}

#[test]
fn row_writers() {
    let (mut sim, ids) = world();
    sim.update(3);
    for (name, good, call) in ROW_WRITERS {
        let before = written_state(&sim, ids);
        for (values, envs, kind) in mistakes(good, false) {
            assert_refused(call(&mut sim, ids, &values, envs.as_deref()), name, kind);
            assert_eq!(written_state(&sim, ids), before, "{name}: {kind:?}");
        }
        call(&mut sim, ids, &table(good, 0), Some(&[])).unwrap();
        assert_eq!(written_state(&sim, ids), before, "{name}: no environment");
        call(&mut sim, ids, &table(good, 1), Some(&[EnvId(2)])).unwrap();
        assert_ne!(written_state(&sim, ids), before, "{name}: the control");
    }
    // A quaternion of length zero is not a rotation.
    let zero_pose = table(&[0.0; 7], 1);
    for (name, _, call) in ROW_WRITERS.iter().filter(|(name, ..)| name.ends_with("pose")) {
        let before = written_state(&sim, ids);
        let error = call(&mut sim, ids, &zero_pose, None).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains("quaternion"), "{error}");
        assert_eq!(written_state(&sim, ids), before);
    }
}
