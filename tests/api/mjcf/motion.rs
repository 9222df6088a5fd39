//! Parts move as their files do alone: two copies in a scene, parts beside robots, and after additions.

use super::*;
use kinetoscope::mujoco::{ObjectKind, compile_file};
use kinetoscope::ndarray::array;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope_testkit::tolerance::{Tolerance, assert_close, assert_number};
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{pose_error, pose_of_row, row, sr5};

/// A double pendulum and a free block without contacts.
const SWING: &str = r#"<mujoco><worldbody>
  <body pos="0 0 1"><joint name="a" axis="0 1 0"/><geom type="box" size="0.02 0.02 0.1" pos="0 0 -0.1"/>
    <body pos="0 0 -0.2"><joint name="b" axis="1 0 0"/><geom type="box" size="0.02 0.03 0.1" pos="0.02 0 -0.1"/></body></body>
  <body name="block" pos="0.5 0 1"><freejoint/><geom type="box" size="0.1 0.05 0.02"/></body>
  </worldbody></mujoco>"#;

/// Two parts of one file each move as the file does alone, relative to their poses; the rotation is about the axis of
/// gravity, which does not change it.
#[test]
fn copies() {
    let (mut sim, first) = with(1, SWING);
    let turn = from_xyz_rpy([3.0, -1.0, 0.4], [0.0, 0.0, 0.7]);
    let second = sim.add_mjcf(MjcfPartCfg { init_pose: turn, ..MjcfPartCfg::text("second", SWING) }).unwrap();
    let model = alone(SWING);
    let mut data = Data::new(&model).unwrap();
    assert_eq!(sim.batch().model().nq(), 2 * model.nq());
    let mut qvel = [0.4, -0.9, 0.1, 0.2, 0.3, 1.0, -2.0, 0.5];
    data.qvel_mut().copy_from_slice(&qvel);
    sim.mjcf_part_mut(first).write_qvel(&row(qvel), None).unwrap();
    // The velocity of the free block is in world axes.
    let turned = turn.rotation * nalgebra::Vector3::new(qvel[2], qvel[3], qvel[4]);
    qvel[2..5].copy_from_slice(turned.as_slice());
    sim.mjcf_part_mut(second).write_qvel(&row(qvel), None).unwrap();
    for _ in 0..200 {
        sim.update(1);
        data.step().unwrap();
    }
    let [a, b] = [first, second].map(|part| sim.mjcf_part(part).qpos().row(0).to_vec());
    // Each of 200 steps rounds numbers of about 1 (2e-16). A pendulum of 0.2 m amplifies errors by at most sqrt(g /
    // l) = 7 per second, in 0.4 s sixteenfold: 6e-13.
    let rounding = Tolerance::absolute(1e-12, "200 roundings that grow sixteenfold in 0.4 s");
    assert_close("first", &a, data.qpos(), rounding);
    assert_close("second", &b[..2], &data.qpos()[..2], rounding);
    for body in ["block", "body1", "body2"] {
        let [first, second] = [first, second].map(|part| pose_of_row(&sim.mjcf_part(part).body_pose(body).unwrap(), 0));
        let (far, angle) = pose_error(&(turn * first), &second);
        assert_close(body, [far, angle], [0.0; 2], rounding);
    }
    assert!((a[0] - model.qpos0()[0]).abs() > 0.05, "it swings");
}

/// Every number that MuJoCo compiled from the file is in the scene to the last digits, index by index.
#[test]
fn numbers() {
    let file = alone(MACHINE);
    let (mut sim, _) = with(1, SWING);
    sim.add_mjcf(MjcfPartCfg::text("machine", MACHINE)).unwrap();
    let scene = sim.batch().model();
    let mut compared = 0;
    let same_number = |x: f64, y: f64| (x - y).abs() <= 1e-14 * x.abs().max(1.0);
    let mut same = |kind: ObjectKind, count: usize, what: &str, here: &[f64], there: &[f64], total: usize| {
        let width = here.len() / count.max(1);
        for index in 0..count {
            let named = file.name(kind, index).and_then(|n| scene.id(kind, &format!("machine/{n}")));
            // The part's elements are the last ones in the scene.
            let at = named.unwrap_or(total - count + index);
            let (a, b) = (&here[width * index..width * (index + 1)], &there[width * at..width * (at + 1)]);
            compared += width;
            assert!(a.iter().zip(b).all(|(x, y)| same_number(*x, *y)), "{what} {index}: {a:?} is not {b:?}");
        }
    };
    macro_rules! arrays {
        ($kind:ident $count:ident: $($name:ident),*) => {
            $(same(ObjectKind::$kind, file.$count(), stringify!($name), file.$name(), scene.$name(), scene.$count());)*
        };
    }
    arrays!(Joint njnt: jnt_pos, jnt_axis, jnt_range, jnt_stiffness, jnt_margin, jnt_solref, jnt_solimp);
    arrays!(Geom ngeom: geom_size, geom_pos, geom_quat, geom_friction, geom_solref, geom_solimp, geom_fluid);
    arrays!(Site nsite: site_pos, site_quat, site_size);
    arrays!(Tendon ntendon: tendon_range, tendon_stiffness, tendon_damping, tendon_lengthspring);
    arrays!(Actuator nactuator: actuator_gainprm, actuator_biasprm, actuator_dynprm, actuator_gear, actuator_ctrlrange);
    arrays!(Equality neq: eq_data, eq_solref, eq_solimp);
    arrays!(Sensor nsensor: sensor_cutoff);
    arrays!(Camera ncam: cam_pos, cam_quat, cam_fovy);
    let tail = |here: &[f64], there: &[f64]| {
        here.iter().zip(&there[there.len() - here.len()..]).all(|(x, y)| same_number(*x, *y))
    };
    // Elements in the file's world get an additional body, before all others.
    for (what, here, there) in [
        ("qpos0", file.qpos0(), scene.qpos0()),
        ("qpos_spring", file.qpos_spring(), scene.qpos_spring()),
        ("dof_damping", file.dof_damping(), scene.dof_damping()),
        ("dof_armature", file.dof_armature(), scene.dof_armature()),
        ("dof_frictionloss", file.dof_frictionloss(), scene.dof_frictionloss()),
        ("dof_invweight0", file.dof_invweight0(), scene.dof_invweight0()),
        ("pair_friction", file.pair_friction(), scene.pair_friction()),
        ("body_inertia", &file.body_inertia()[3..], scene.body_inertia()),
        ("body_mass", &file.body_mass()[1..], scene.body_mass()),
    ] {
        assert!(tail(here, there), "{what}: {here:?} {there:?}");
    }
    let excluded: Vec<_> = scene.excluded_bodies().collect();
    let bodies = ["machine/base", "machine/hand"].map(|name| scene.id(ObjectKind::Body, name).unwrap());
    assert_eq!(excluded, [bodies]);
    assert!(sim.scene().mjcf().contains("<exclude body1=\"machine/base\" body2=\"machine/hand\"/>"));
    assert_eq!(file.jnt_limited(0), scene.jnt_limited(scene.id(ObjectKind::Joint, "machine/shoulder").unwrap()));
    assert!(compared > 500 && file.nbody() > 6);
    assert!(!tail(&[file.qpos0()[0] + 1e-9], &[file.qpos0()[0]]), "a control: this comparison sees 1e-9");
}

/// A file with an element of every type moves in a scene as in plain MuJoCo.
#[test]
fn whole_machine() {
    let (mut sim, part) = with(1, MACHINE);
    sim.mjcf_part_mut(part).set_ctrl(&array![[0.4, -0.3, 0.8]], None, None).unwrap();
    sim.update(300);
    let mut data = data_of(&sim, &alone(MACHINE), &[0.4, -0.3, 0.8]);
    (0..300).for_each(|_| data.step().unwrap());
    let (qpos, act) = (sim.mjcf_part(part).qpos(), sim.batch().read(0, |env| env.data().act().to_vec()));
    let rounding = Tolerance::absolute(1e-11, "300 roundings that grow by e^4.2 = 67 in 0.6 s, as for copies: 4e-12");
    assert_close("positions", &qpos, data.qpos(), rounding);
    assert_number("activation", act[0], data.act()[0], rounding);
    assert!(act[0] > 0.1);
}

/// A slanted wedge with a texture, whose origin is far from its center.
const WEDGE: &str = "v 0.1 0.1 0.1\nv 0.5 0.1 0.1\nv 0.1 0.4 0.1\nv 0.1 0.1 0.4\nvt 0.1 0.2\nvt 0.9 0.3\nvt 0.4 0.8\nvt 0.7 0.6\n\
                     f 1/1 3/3 2/2\nf 1/1 2/2 4/4\nf 1/1 4/3 3/2\nf 2/1 3/2 4/4\n";

/// Position and texture coordinate of every corner, triangle by triangle, in the frame of its geom's body.
fn corners(model: &Model) -> Vec<([f64; 3], [f32; 2])> {
    let mesh = model.mesh(0);
    let geom = (0..model.ngeom()).find(|&g| model.geom_dataid()[g] == 0).unwrap();
    let (p, q) = (&model.geom_pos()[3 * geom..], &model.geom_quat()[4 * geom..]);
    let pose = pose_of_row(&row([p[0], p[1], p[2], q[0], q[1], q[2], q[3]]), 0);
    let corner = |(face, texture): (&[i32; 3], &[i32; 3])| {
        [0, 1, 2].map(|k| {
            let at = nalgebra::Point3::from(mesh.positions[face[k] as usize].map(f64::from));
            (pose.transform_point(&at).coords.into(), mesh.texcoords.unwrap()[texture[k] as usize])
        })
    };
    mesh.faces.iter().zip(mesh.face_texcoords).flat_map(corner).collect()
}

/// A mesh of a file keeps its pose and its texture, and falls as alone.
#[test]
fn meshes() {
    let files = TempFiles::default();
    files.write("wedge.obj", WEDGE);
    let file = files.write(
        "wedge.xml",
        r#"<mujoco><asset><mesh name="wedge" file="wedge.obj"/></asset><worldbody><geom type="plane" size="1 1 1"/>
        <body pos="0 0 -0.08"><freejoint/><geom type="mesh" mesh="wedge" density="500"/></body></worldbody></mujoco>"#,
    );
    let alone = compile_file(&file).unwrap().into_model();
    let mut sim = empty(1);
    let part = sim.add_mjcf(MjcfPartCfg::file("part", &file)).unwrap();
    let (here, there) = (corners(sim.batch().model()), corners(&alone));
    assert_eq!((here.len(), there.len()), (12, 12));
    for ((at, texture), (expected_at, expected_texture)) in here.iter().zip(&there) {
        let single = Tolerance::absolute(2e-7, "single precision of 0.5 m, 3e-8: centered by MuJoCo and in the scene");
        assert_close("corner", at, expected_at, single);
        assert_eq!(texture, expected_texture);
    }
    assert!(here.iter().any(|(_, texture)| *texture != here[0].1));
    sim.update(200);
    let mut data = data_of(&sim, &alone, &[]);
    (0..200).for_each(|_| data.step().unwrap());
    let qpos = sim.mjcf_part(part).qpos();
    let corners =
        Tolerance::absolute(1e-5, "it rests on a face and differs by as much as its corners; measured, not derived");
    assert_close("positions", &qpos, data.qpos(), corners);
    assert!((data.qpos()[2] + 0.08).abs() > 1e-3 && !data.contact().is_empty(), "it moved: {:?}", data.qpos());
}

fn far_arm() -> RobotCfg {
    RobotCfg { init_pose: Pose::translation(5.0, 0.0, 0.0), ..sr5("robot") }
}

/// The motion of a robot with implicit drives is independent of parts in the scene: its rows are located among the
/// part's equalities and friction.
#[test]
fn drives_beside_parts() {
    let run = |with_parts: bool| {
        let mut sim = empty(1);
        if with_parts {
            sim.add_mjcf(MjcfPartCfg::text("a", MACHINE)).unwrap();
        }
        let robot = sim.add_robot(far_arm()).unwrap();
        sim.robot_mut(robot).set_qpos_target(&array![[0.1, 0.4, -0.9, 0.2, -0.5, 0.3]], None, None).unwrap();
        if with_parts {
            let init_pose = Pose::translation(0.0, 3.0, 0.0);
            sim.add_mjcf(MjcfPartCfg { init_pose, ..MjcfPartCfg::text("b", MACHINE) }).unwrap();
        }
        sim.update(250);
        assert!(sim.diverged().is_empty());
        (sim.robot(robot).qpos(), sim.robot(robot).qf())
    };
    let ((alone, efforts), (beside, efforts_beside)) = (run(false), run(true));
    // The solver stops at a residual of 1e-8 of the whole scene, which differs.
    assert!((&alone - &beside).iter().all(|d| d.abs() < 1e-6), "{alone} {beside}");
    assert!((&efforts - &efforts_beside).iter().all(|d| d.abs() < 1e-3), "{efforts} {efforts_beside}");
    assert!(efforts.iter().any(|effort| effort.abs() > 1.0) && alone.iter().any(|q| q.abs() > 0.3));
}

/// A moving part has the same bits after additions.
#[test]
fn additions() {
    let (mut sim, part) = with(2, MACHINE);
    sim.mjcf_part_mut(part).set_ctrl(&array![[0.4, -0.3, 0.8], [0.1, 0.2, 0.3]], None, None).unwrap();
    sim.update(50);
    let state = |sim: &SimulationManager| {
        let act: Vec<f64> = (0..2).map(|env| sim.batch().read(env, |env| env.data().act()[0])).collect();
        let part = sim.mjcf_part(part);
        (part.qpos(), part.qvel(), part.ctrl(), sim.time(), act)
    };
    let before = state(&sim);
    assert!(before.4[0] != before.4[1] && before.4[0] > 0.0);
    sim.add_robot(far_arm()).unwrap();
    // On 2.2.2 actuators with an activation follow those of the later part.
    let stateless = r#"<mujoco><worldbody><body pos="9 0 1"><joint name="j"/><geom size="0.1"/></body></worldbody>
        <actuator><motor joint="j"/></actuator></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("late", stateless)).unwrap();
    assert_eq!(state(&sim), before);
    sim.update(10);
    assert!(sim.diverged().is_empty());
    assert_ne!(state(&sim).0, before.0);
}
