//! Environments with models of their own, which a row keeps as differences, against whole copies of the model.

use super::*;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::{IntegrationState, ModelEditor, UserInputs, Weld};

/// A tree of joints with a tendon and an actuator, and free bodies on the ground, two of which can be welded. MuJoCo
/// computes the anchor of the connect constraint again when the base moves, and on 2.2.2 it normalizes the quaternion of
/// the active weld again with every change: a release of the other weld lost both.
const SCENE: &str = r#"<mujoco><option timestep="0.003"/><worldbody><geom type="plane" size="5 5 1"/>
    <body pos="0 1 0.5"><joint type="ball" damping="0.01"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      <body pos="0.3 0 0"><joint name="hinge" axis="0 1 0" damping="0.01" armature="0.01" frictionloss="0.01"/>
        <site name="tip" pos="0.1 0 0"/><geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0"/></body></body>
    <body name="a" pos="1 0 0.105"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body>
    <body name="b" pos="1 0 0.32"><freejoint/><geom type="ellipsoid" size="0.1 0.08 0.1"/></body>
    <body name="base" pos="2 0 0"><geom type="box" size="0.3 0.3 0.02"/></body>
    <body pos="2 0 0.2"><freejoint/><geom type="cylinder" size="0.1 0.1"/></body>
    <body name="c" pos="3 0 1"><freejoint/><geom size="0.1"/></body>
    <body name="d" pos="3.3 0 1"><freejoint/><geom size="0.1"/></body></worldbody>
    <tendon><fixed name="t" frictionloss="0.01"><joint joint="hinge" coef="1"/></fixed></tendon>
    <equality><weld body1="a" body2="b" active="false"/><connect body1="base" body2="c" anchor="0.1 0 0"/>
      <weld body1="c" body2="d" relpose="0.3 0 0 0.52 -1 -0.11 0.44"/></equality>
    <actuator><motor joint="hinge" gear="2"/></actuator>
    <sensor><framepos objtype="site" objname="tip"/><accelerometer site="tip"/></sensor></mujoco>"#;

/// Edits of one environment, of all arrays that properties change.
fn edit(editor: &mut ModelEditor, kind: usize, factor: f64) {
    let scale = |values: &mut [f64]| values.iter_mut().for_each(|value| *value *= factor);
    match kind % 8 {
        0 => return,
        1 => {
            scale(editor.body_mass_mut());
            scale(editor.body_inertia_mut());
        }
        2 => scale(editor.geom_friction_mut()),
        3 => {
            scale(editor.body_mass_mut());
            editor.geom_friction_mut()[6] = 0.3 * factor;
            editor.set_gravity([0.1, 0.0, -9.0]);
        }
        4 => editor.set_gravity([0.0, 0.3, -9.81 * factor]),
        5 => {
            editor.set_geom_size(3, [0.1, 0.1 * factor, 0.1]);
            editor.geom_rgba_mut()[7] = 0.5;
            editor.set_center_of_mass(2, [0.11 * factor, 0.01, 0.0]).expect("not diagonal");
        }
        6 => {
            scale(editor.dof_damping_mut());
            scale(editor.dof_armature_mut());
            scale(editor.dof_frictionloss_mut());
            scale(editor.tendon_frictionloss_mut());
        }
        _ => {
            editor.body_pos_mut()[3 * 5 + 2] = 0.05 * factor;
            editor.body_quat_mut()[20..24].copy_from_slice(&[0.8, 0.0, 0.6, 0.0]);
        }
    }
    editor.set_constants().expect("fits");
}

fn bits_of(data: &mj::Data) -> Vec<u64> {
    let state = [&[data.time()], data.qpos(), data.qvel(), data.qacc_warmstart(), data.qacc(), data.qfrc_constraint()];
    let computed = [data.sensordata(), data.xpos(), data.xquat(), data.cvel(), data.qfrc_bias(), data.efc_pos()];
    state.into_iter().chain(computed).flatten().map(|x| x.to_bits()).chain([data.contact().len() as u64]).collect()
}

/// Plain MuJoCo on a whole copy of the model.
fn step(data: &mut mj::Data) {
    data.step1().expect("fits");
    data.step2().expect("fits");
}

/// Bits with a forward pass done, which changes no later step.
fn bits_of_plain(data: &mut mj::Data) -> Vec<u64> {
    let before = data.qpos().to_vec();
    data.step1().expect("fits");
    let bits = bits_of(data);
    data.qpos_mut().copy_from_slice(&before);
    bits
}

/// The same state in the data of another model.
fn moved(data: &mj::Data, model: &Model) -> mj::Data {
    let (mut motion, mut inputs) = (IntegrationState::default(), UserInputs::default());
    motion.save(data);
    inputs.save(data);
    let mut new = mj::Data::new(model).expect("small");
    inputs.restore(&mut new);
    motion.restore(&mut new);
    new
}

/// Models change between blocks of steps, in rows and in working memory, and threads take the environments in turn.
#[test]
fn whole_models() {
    let model = mj::compile(SCENE, &[]).expect("compiles").into_model();
    let mut editor = ModelEditor::new(&model).expect("small");
    let weld = |i: usize| Weld { equality: 0, pose: [0.0, 0.0, 0.21 + 0.001 * i as f64, 1.0, 0.0, 0.0, 0.0] };
    let mut contacts = 0;
    // In the last two batches, every environment stays in the `mjData` that it has.
    for (envs, threads) in [(17, 1), (17, 2), (1, 1), (3, 3)] {
        let mut plain: Vec<mj::Data> = (0..envs).map(|_| mj::Data::new(&model).expect("small")).collect();
        // The same starts and welds with the compiled model.
        let mut nominal: Vec<mj::Data> = (0..envs).map(|_| mj::Data::new(&model).expect("small")).collect();
        let small = crate::env::with_small_buffers(&model);
        let mut batch = Batch::new(&small, &Arc::default(), envs, threads, ThreadPool::new()).expect("small");
        for (i, (plain, nominal)) in plain.iter_mut().zip(&mut nominal).enumerate() {
            let start = |data: &mut mj::Data| {
                data.qvel_mut().iter_mut().enumerate().for_each(|(k, v)| *v = (1.3 * i as f64 + k as f64).sin());
                data.ctrl_mut()[0] = 0.1 * i as f64;
            };
            start(plain);
            start(nominal);
            batch.write_at(i, Stage::Raw, |env| env.write_state(start));
        }
        for (block, count) in [1, 5, 30, 1, 2, 60, 9, 1].into_iter().enumerate() {
            for (i, (plain, nominal)) in plain.iter_mut().zip(&mut nominal).enumerate() {
                editor.load(&model);
                // Some environments keep their model for a while.
                let (kind, is_welded) = (i + block / (1 + i % 2), (i + block) % 3 == 0);
                edit(&mut editor, kind, 1.0 + 0.01 * (kind + i) as f64);
                let whole = editor.to_compiled().expect("small").into_model().with_buffers(model.buffers());
                let welds = if is_welded { vec![weld(i)] } else { Vec::new() };
                for (data, model) in [(&mut *plain, &whole), (&mut *nominal, &model)] {
                    *data = moved(data, &model.with_welds(&welds));
                    data.set_equality_active(0, is_welded);
                }
                let patch = editor.patch();
                batch.write_at(i, Stage::Raw, |env| env.set_welds(welds));
                if i % 4 == 2 {
                    batch.write_at(i, Stage::Forward, |env| env.set_patch(patch.as_ref()));
                } else {
                    batch.edit_row(i, |row, model| row.set_patch(patch.as_ref(), model));
                }
                (0..count).for_each(|_| {
                    step(plain);
                    step(nominal);
                });
            }
            batch.step(count);
            batch.visit(Stage::State, |_, _| ());
            let expected: Vec<_> = plain.iter_mut().map(bits_of_plain).collect();
            batch.for_each(|i, env| {
                contacts = contacts.max(env.data().contact().len());
                assert!(
                    bits_of(env.data()) == expected[i],
                    "environment {i} of {envs} after block {block}, {threads} threads"
                );
            });
        }
        for (i, (plain, nominal)) in plain.iter_mut().zip(&mut nominal).enumerate() {
            assert!(bits_of_plain(plain) != bits_of_plain(nominal), "the own models of environment {i} change nothing");
        }
    }
    assert!(contacts > 4, "more than a box on the ground, which has four: {contacts}");
}

/// A model that a closure sets ends with the closure, also for an environment that stays in working memory.
#[test]
fn model_of_a_closure() {
    let model = mj::compile(SCENE, &[]).expect("compiles").into_model();
    let mut editor = ModelEditor::new(&model).expect("small");
    let mut patch = |factor: f64| {
        editor.load(&model);
        edit(&mut editor, 1, factor);
        editor.patch().expect("differs")
    };
    let (heavy, light) = (patch(2.0), patch(0.5));
    let mut batch = Batch::new(&model, &Arc::default(), 3, 1, ThreadPool::new()).expect("small");
    let mass = |batch: &Batch| batch.read(1, |env| env.data().model().body_mass()[2]);
    let nominal = model.body_mass()[2];
    for (own, expected) in [(None, nominal), (Some(&light), 0.5 * nominal)] {
        batch.edit_row(1, |row, model| row.set_patch(own, model));
        let within = batch.write_at(1, Stage::Raw, |env| {
            env.lend(|data| {
                let other = data.model().clone().patched(&heavy);
                data.set_model(other);
                data.model().body_mass()[2]
            })
        });
        assert_eq!(within, Some(2.0 * nominal));
        assert_eq!(mass(&batch), expected);
    }
}
