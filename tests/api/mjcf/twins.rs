//! One file, several parts.

use super::{alone, empty, machine};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, from_xyz_rpy};
use kinetoscope::sim::mj::{Data, ObjectKind};

/// A double pendulum that hangs in the world, and a block that flies: nothing touches.
const SWING: &str = r#"<mujoco><worldbody>
  <body pos="0 0 1"><joint name="a" axis="0 1 0"/><geom type="box" size="0.02 0.02 0.1" pos="0 0 -0.1"/>
    <body pos="0 0 -0.2"><joint name="b" axis="1 0 0"/><geom type="box" size="0.02 0.03 0.1" pos="0.02 0 -0.1"/></body></body>
  <body name="block" pos="0.5 0 1"><freejoint/><geom type="box" size="0.1 0.05 0.02"/></body>
  </worldbody></mujoco>"#;

/// Each moves as it does alone, where its pose says; the turn is about gravity, which it does not change.
#[test]
fn copies_live_side_by_side() {
    let mut sim = empty(1);
    let turn = from_xyz_rpy([3.0, -1.0, 0.4], [0.0, 0.0, 0.7]);
    let first = sim.add_mjcf(MjcfCfg::text("first", SWING)).unwrap();
    let second = sim.add_mjcf(MjcfCfg { init_pose: turn, ..MjcfCfg::text("second", SWING) }).unwrap();
    let model = alone(SWING);
    let mut data = Data::new(&model).unwrap();
    assert_eq!(sim.batch().model().nq(), 2 * model.nq());
    let mut qvel = vec![0.4, -0.9, 0.1, 0.2, 0.3, 1.0, -2.0, 0.5];
    data.qvel_mut().copy_from_slice(&qvel);
    sim.mjcf_part_mut(first).write_qvel(&Array2::from_shape_vec((1, 8), qvel.clone()).unwrap(), None).unwrap();
    // The velocity of the free block is in the world.
    let turned = turn.rotation * nalgebra::Vector3::new(qvel[2], qvel[3], qvel[4]);
    qvel[2..5].copy_from_slice(turned.as_slice());
    sim.mjcf_part_mut(second).write_qvel(&Array2::from_shape_vec((1, 8), qvel).unwrap(), None).unwrap();
    for _ in 0..200 {
        sim.update(1);
        data.step().unwrap();
    }
    let (a, b) = (sim.mjcf_part(first).get_qpos(), sim.mjcf_part(second).get_qpos());
    // Each of 200 steps rounds numbers of about 1 (2e-16). What a pendulum of 0.2 m makes of that grows by sqrt(g / l) = 7 per
    // second at most, in 0.4 s sixteenfold: 6e-13.
    let rounding = 1e-12;
    for k in 0..model.nq() {
        assert!((a[(0, k)] - data.qpos()[k]).abs() < rounding, "{k}: {} is not {}", a[(0, k)], data.qpos()[k]);
    }
    for joint in 0..2 {
        assert!((b[(0, joint)] - data.qpos()[joint]).abs() < rounding);
    }
    let pose = |part, name: &str| {
        let rows = sim.mjcf_part(part).body_pose(name).unwrap();
        from_row(&std::array::from_fn(|k| rows[(0, k)]))
    };
    for body in ["block", "body1", "body2"] {
        let (there, here) = (turn * pose(first, body), pose(second, body));
        assert!((there.translation.vector - here.translation.vector).norm() < rounding, "{body}");
        assert!(there.rotation.angle_to(&here.rotation) < rounding, "{body}");
    }
    assert!((a[(0, 0)] - model.qpos0()[0]).abs() > 0.05, "it swings");
}

/// What MuJoCo compiled of the file is in the scene to the last digits, index by index; a control differs.
#[test]
fn every_number_of_the_file_is_in_the_scene() {
    let text = machine();
    let file = alone(&text);
    let mut sim = empty(1);
    sim.add_mjcf(MjcfCfg::text("before", SWING)).unwrap();
    sim.add_mjcf(MjcfCfg::text("machine", &text)).unwrap();
    let scene = sim.batch().model();
    let mut compared = 0;
    let mut same = |kind: ObjectKind, count: usize, what: &str, here: &[f64], there: &[f64], total: usize| {
        let width = here.len() / count.max(1);
        for index in 0..count {
            let name = file.name(kind, index);
            // The first part has as many of them before as the scene has more.
            let at = match name.and_then(|n| scene.id(kind, &format!("machine/{n}"))) {
                Some(at) => at,
                None => total - count + index,
            };
            let (a, b) = (&here[width * index..width * (index + 1)], &there[width * at..width * (at + 1)]);
            for (x, y) in a.iter().zip(b) {
                compared += 1;
                assert!((x - y).abs() <= 1e-14 * x.abs().max(1.0), "{what} {index}: {a:?} is not {b:?}");
            }
        }
    };
    macro_rules! arrays {
        ($kind:ident: $($name:ident),*; $count:expr, $total:expr) => {
            $(same(ObjectKind::$kind, $count, stringify!($name), file.$name(), scene.$name(), $total);)*
        };
    }
    arrays!(Joint: jnt_pos, jnt_axis, jnt_range, jnt_stiffness, jnt_margin, jnt_solref, jnt_solimp; file.njnt(), scene.njnt());
    arrays!(Geom: geom_size, geom_pos, geom_quat, geom_friction, geom_solref, geom_solimp, geom_fluid; file.ngeom(), scene.ngeom());
    arrays!(Site: site_pos, site_quat, site_size; file.nsite(), scene.nsite());
    arrays!(Tendon: tendon_range, tendon_stiffness, tendon_damping, tendon_lengthspring; file.ntendon(), scene.ntendon());
    arrays!(Actuator: actuator_gainprm, actuator_biasprm, actuator_dynprm, actuator_gear, actuator_ctrlrange;
        file.nactuator(), scene.nactuator());
    arrays!(Equality: eq_data, eq_solref, eq_solimp; file.neq(), scene.neq());
    arrays!(Sensor: sensor_cutoff; file.nsensor(), scene.nsensor());
    arrays!(Camera: cam_pos, cam_quat, cam_fovy; file.ncam(), scene.ncam());
    let tail = |here: &[f64], there: &[f64]| {
        let there = &there[there.len() - here.len()..];
        here.iter().zip(there).all(|(x, y)| (x - y).abs() <= 1e-14 * x.abs().max(1.0))
    };
    assert!(tail(file.qpos0(), scene.qpos0()) && tail(file.qpos_spring(), scene.qpos_spring()));
    assert!(tail(file.dof_damping(), scene.dof_damping()) && tail(file.dof_armature(), scene.dof_armature()));
    assert!(
        tail(file.dof_frictionloss(), scene.dof_frictionloss()) && tail(file.dof_invweight0(), scene.dof_invweight0())
    );
    assert!(tail(file.pair_friction(), scene.pair_friction()));
    // The body of what stands in the file's world is one more, before all others.
    let bodies = file.nbody() - 1;
    assert!(tail(&file.body_inertia()[3..], scene.body_inertia()) && tail(&file.body_mass()[1..], scene.body_mass()));
    let body = |name: &str| scene.id(ObjectKind::Body, name).unwrap();
    let excluded: Vec<_> = scene.excluded_bodies().collect();
    assert_eq!(excluded, [[body("machine/base"), body("machine/hand")]]);
    assert!(sim.mjcf().contains("<exclude body1=\"machine/base\" body2=\"machine/hand\"/>"));
    assert_eq!(file.jnt_limited(0), scene.jnt_limited(scene.id(ObjectKind::Joint, "machine/shoulder").unwrap()));
    assert!(compared > 500 && bodies > 5);
    assert!(!tail(&[file.qpos0()[0] + 1e-9], &[file.qpos0()[0]]), "a control: this comparison sees 1e-9");
}

/// A file with one of everything moves in a scene as it does alone.
#[test]
fn a_machine_moves_as_it_does_alone() {
    let text = machine();
    let model = alone(&text);
    let mut sim = empty(1);
    let part = sim.add_mjcf(MjcfCfg::text("machine", &text)).unwrap();
    sim.mjcf_part_mut(part).set_ctrl(&kinetoscope::ndarray::array![[0.4, -0.3, 0.8]], None, None).unwrap();
    sim.update(300);
    let buffers = sim.batch().read(0, |env| env.data().model().buffers());
    let mut data = Data::new(&model.with_buffers(buffers)).unwrap();
    data.ctrl_mut().copy_from_slice(&[0.4, -0.3, 0.8]);
    (0..300).for_each(|_| data.step().unwrap());
    let (qpos, act) = (sim.mjcf_part(part).get_qpos(), sim.batch().read(0, |env| env.data().act().to_vec()));
    // As above, for 300 steps: in 0.6 s errors grow by e^4.2 = 67, 300 * 67 * 2e-16 = 4e-12.
    for (k, expected) in data.qpos().iter().enumerate() {
        assert!((qpos[(0, k)] - expected).abs() < 1e-11, "{k}: {} is not {expected}", qpos[(0, k)]);
    }
    assert!((act[0] - data.act()[0]).abs() < 1e-11 && act[0] > 0.1);
}
