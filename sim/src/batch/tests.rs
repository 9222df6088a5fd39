//! Tests of batches.

use super::*;
use crate::env::EnvStatus;
use crate::wrenches::Wrench;
use kinetoscope_mujoco as mj;
use nalgebra::{UnitQuaternion, Vector3};

const PENDULUM: &str = r#"<mujoco><worldbody><body><joint name="j" type="hinge" axis="0 1 0"/>
    <geom type="capsule" fromto="0 0 0 1 0 0" size="0.1"/></body></worldbody></mujoco>"#;

fn pendulums(envs: usize, threads: usize) -> Batch {
    let model = mj::compile(PENDULUM, &[]).expect("compiles").into_model();
    let mut batch = Batch::new(&model, &Arc::default(), envs, threads, ThreadPool::new()).expect("small");
    batch.run(|i, env| env.write(|data| data.qvel_mut()[0] = i as f64));
    batch
}

/// A ball joint and a hinge with an activation, a falling box, and sensors of all stages.
const MACHINE: &str = r#"<mujoco><worldbody><geom type="plane" size="5 5 1"/>
    <body pos="0 0 0.5"><joint type="ball"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      <body pos="0.3 0 0"><joint name="hinge" axis="0 1 0" damping="0.01"/><site name="tip" pos="0.1 0 0"/>
        <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0"/></body></body>
    <body pos="1 0 0.105"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body></worldbody>
    <actuator><general joint="hinge" dyntype="filter" dynprm="0.2" gainprm="0.3"/></actuator>
    <sensor><framepos objtype="site" objname="tip"/><gyro site="tip"/><accelerometer site="tip"/></sensor></mujoco>"#;

fn bits(env: &SimEnv) -> Vec<u64> {
    bits_of_data(env.data()).into_iter().chain([env.steps()]).collect()
}

fn bits_of_data(data: &mj::Data) -> Vec<u64> {
    let inputs = [data.ctrl(), data.xfrc_applied()];
    let state = [&[data.time()], data.qpos(), data.qvel(), data.act(), data.qacc_warmstart()];
    let solved = [data.qacc(), data.actuator_force(), data.qfrc_actuator(), data.qfrc_constraint()];
    let computed = [data.sensordata(), data.xpos(), data.xquat(), data.cvel(), data.qfrc_bias(), data.efc_pos()];
    let all = inputs.into_iter().chain(state).chain(solved).chain(computed).flatten().map(|x| x.to_bits());
    all.chain([data.contact().len() as u64]).collect()
}

/// A row that one of few threads takes, with reads in between, continues as an environment with an `mjData` of its
/// own does.
#[test]
fn rows_and_persistent_data() {
    const ENVS: usize = 7;
    let model = mj::compile(MACHINE, &[]).expect("compiles").into_model();
    let model = crate::env::with_small_buffers(&model);
    let start = |i: usize, data: &mut mj::Data| {
        data.qvel_mut().iter_mut().enumerate().for_each(|(k, v)| *v = (1.3 * i as f64 + k as f64).sin());
        data.ctrl_mut()[0] = 0.3 * i as f64;
    };
    // Changes an environment after a block of steps. The others keep the inputs of bodies that they share.
    let change = |block: usize, i: usize, env: &mut SimEnv| match (block, i) {
        (1, 1 | 4) => env.set_wrenches(|wrenches| {
            let axes = Some(UnitQuaternion::from_euler_angles(0.3, 0.0, 0.1 * i as f64));
            let (force, torque) = (Vector3::new(0.0, 0.2, 0.1), Vector3::zeros());
            wrenches.replace(Wrench { owner: (0, 0), body: 2, axes, force, torque });
        }),
        (3, 0 | 2 | 4 | 6) => env.write(|data| data.xfrc_applied_mut()[8] = 0.5),
        (4, 3) => env.write(|data| data.qvel_mut()[1] = f64::NAN),
        (5, 4) => env.set_wrenches(|wrenches| wrenches.list.clear()),
        _ => {}
    };
    for threads in [1, 2] {
        let mut alone: Vec<SimEnv> = (0..ENVS).map(|_| SimEnv::new(&model, &Arc::default()).expect("small")).collect();
        alone.iter_mut().enumerate().for_each(|(i, env)| env.write(|data| start(i, data)));
        let mut batch = Batch::new(&model, &Arc::default(), ENVS, threads, ThreadPool::new()).expect("small");
        batch.run(|i, env| env.write(|data| start(i, data)));
        for (block, count) in [1, 5, 1, 3, 20, 1, 40].into_iter().enumerate() {
            for (i, env) in alone.iter_mut().enumerate() {
                env.step(count);
                change(block, i, env);
            }
            batch.step(count);
            (0..ENVS).for_each(|i| batch.write(i, |env| change(block, i, env)));
            for stage in [Stage::State, Stage::Kinematics, Stage::Forward] {
                batch.for_each_at(stage, |_, _| ());
            }
            batch.for_each(|i, env| {
                assert_eq!(bits(env), bits(&alone[i]), "{threads} threads: environment {i} after block {block}");
                assert_eq!((env.status(), env.warnings()), (alone[i].status(), alone[i].warnings()));
            });
        }
        assert_eq!(alone.iter().filter(|env| *env.status() != EnvStatus::Running).count(), 1);
        assert!(alone[0].data().contact().len() >= 4);
        assert_ne!(bits(&alone[0]), bits(&alone[1]), "environments differ");
        // Control: the last bit of an input is seen.
        let mut other = SimEnv::new(&model, &Arc::default()).expect("small");
        other.write(|data| start(0, data));
        other.write(|data| data.ctrl_mut()[0] = f64::from_bits(1));
        other.step(71);
        assert_ne!(bits(&other), bits(&alone[0]));
    }
}

/// A step ends with the poses of its start: those of its end are computed for reads alone.
#[test]
fn no_poses_without_a_read() {
    let mut batch = pendulums(1, 1);
    let xquat = |batch: &Batch, stage| {
        let read = Mutex::new(Vec::new());
        batch.visit(stage, |_, env| *lock(&read) = env.data().xquat().to_vec());
        read.into_inner().expect("no panic")
    };
    batch.write(0, |env| env.write(|data| data.qvel_mut()[0] = 1.0));
    batch.step(2);
    let start_of_step = xquat(&batch, Stage::Kinematics);
    batch.step(1);
    assert_eq!(xquat(&batch, Stage::Raw), start_of_step);
    assert_ne!(xquat(&batch, Stage::Kinematics), start_of_step);
}

#[test]
fn refused_numbers() {
    let model = mj::compile(PENDULUM, &[]).expect("compiles").into_model();
    let batch = |envs, threads| Batch::new(&model, &Arc::default(), envs, threads, ThreadPool::new());
    assert!(matches!(batch(0, 1), Err(BatchError::NoEnvironments)));
    assert!(matches!(batch(1, 0), Err(BatchError::NoThreads)));
    let most = usize::MAX / 1000;
    assert!(matches!(batch(most, 1), Err(BatchError::OutOfMemory { num_envs, .. }) if num_envs == most));
}

/// A job that panics returns the environment to the batch.
#[test]
fn panic_in_a_read() {
    let batch = pendulums(3, 1);
    let read = || batch.read(1, |_| panic!("expected"));
    assert!(std::panic::catch_unwind(std::panic::AssertUnwindSafe(read)).is_err());
    batch.for_each(|i, env| assert_eq!(env.data().qvel()[0], i as f64));
}

#[test]
fn step_and_read() {
    // Slow down the calling thread, which would otherwise process all chunks alone.
    let caller = std::thread::current().id();
    for (envs, threads) in [(1, 1), (3, 8), (37, 3)] {
        let mut batch = pendulums(envs, threads);
        let (mut qpos, mut qvel) = (vec![f64::NAN; envs], vec![f64::NAN; envs]);
        batch.step_and_read(
            7,
            Stage::State,
            move |env| {
                if std::thread::current().id() == caller {
                    std::thread::sleep(std::time::Duration::from_millis(1));
                }
                [env.data().qpos(), env.data().qvel()]
            },
            [&mut qpos, &mut qvel],
        );
        let mut other = pendulums(envs, 1);
        other.step(7);
        for b in [&batch, &other] {
            b.for_each(|i, env| assert_eq!((env.data().qpos()[0], env.data().qvel()[0]), (qpos[i], qvel[i])));
        }
    }
}

#[test]
#[should_panic(expected = "5 numbers for 3 x 1")]
fn wrong_size() {
    pendulums(3, 1).step_and_read(1, Stage::State, |env| [env.data().qpos()], [&mut [0.0; 5]]);
}

/// A machine with everything that a row keeps: joints of all kinds, an activation, a mocap body, an equality, MuJoCo's
/// sensors of all stages, and contacts. `INTEGRATOR` and `EXTRA` are replaced.
const COMPLETE: &str = r#"<mujoco><option integrator="INTEGRATOR" timestep="0.003"/><worldbody>
    <geom type="plane" size="5 5 1"/>
    <body name="hand" mocap="true" pos="0 0 1.2"><geom size="0.02" contype="0" conaffinity="0"/></body>
    <body name="carried" pos="0 0 1"><freejoint/><geom type="box" size="0.05 0.04 0.03"/></body>
    <body pos="0 1 0.5"><joint type="ball"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.03"/>
      <body pos="0.3 0 0"><joint name="hinge" axis="0 1 0" damping="0.01"/><site name="tip" pos="0.1 0 0"/>
        <geom type="box" size="0.1 0.02 0.02" pos="0.1 0 0"/></body></body>
    <body name="box" pos="1 0 0.105"><freejoint/><geom type="box" size="0.1 0.1 0.1"/></body></worldbody>
    <equality><weld body1="hand" body2="carried" active="false"/></equality>
    <actuator><general joint="hinge" dyntype="filter" dynprm="0.2" gainprm="0.3"EXTRA/></actuator>
    <sensor><framepos objtype="site" objname="tip"/><gyro site="tip"/><accelerometer site="tip"/></sensor></mujoco>"#;

/// Plain MuJoCo: an environment with an `mjData` of its own, stepped by `mj_step1` and `mj_step2` alone.
struct Plain {
    data: mj::Data,
    rk4: bool,
}

impl Plain {
    fn step(&mut self) {
        self.data.step1().expect("fits");
        if self.rk4 { self.data.step() } else { self.data.step2() }.expect("fits");
    }

    /// Bits with a forward pass done, which changes no later step: 2.2.2 normalizes quaternions in place, and twice would
    /// change the last bit.
    fn bits(&mut self) -> Vec<u64> {
        let before = self.data.qpos().to_vec();
        self.data.step1().expect("fits");
        let bits = bits_of_data(&self.data);
        self.data.qpos_mut().copy_from_slice(&before);
        bits
    }
}

/// Environments of a batch have the same bits as plain MuJoCo, with fewer threads than environments, for models,
/// inputs, welds and start states that differ between them.
#[test]
fn rows_and_plain_mujoco() {
    const ENVS: usize = 9;
    let mut extras = vec![""];
    if mj::BUILD_VERSION != mj::SupportedVersion::V2 {
        // A delay has a history, which is part of the state on 4.x.
        extras.push(r#" delay="0.01" nsample="5""#);
    }
    let with_mocap = |i| extras.iter().map(move |extra| (i, *extra, true));
    // Without a mocap body, environments share the inputs of bodies that a step leaves alone.
    let cases = ["Euler", "RK4"].into_iter().flat_map(with_mocap).chain([("Euler", "", false), ("RK4", "", false)]);
    for (integrator, extra, mocap) in cases {
        let text = COMPLETE.replace("INTEGRATOR", integrator).replace("EXTRA", extra);
        let text = if mocap { text } else { text.replace(r#" mocap="true""#, "") };
        let model = mj::compile(&text, &[]).expect("compiles").into_model();
        let own_model = |i: usize| {
            let mut editor = mj::ModelEditor::new(&model).expect("small");
            editor.body_mass_mut()[4] *= 1.0 + 0.1 * i as f64;
            editor.set_constants().expect("small");
            editor.model(&model)
        };
        let weld = |i: usize| mj::Weld { equality: 0, pose: [0.0, 0.01 * i as f64, -0.2, 1.0, 0.0, 0.0, 0.0] };
        let start = |i: usize, data: &mut mj::Data| {
            data.qvel_mut().iter_mut().enumerate().for_each(|(k, v)| *v = (1.3 * i as f64 + k as f64).sin());
            data.qpos_mut()[3..7].copy_from_slice(&[0.9, 0.1 * i as f64, 0.2, -0.1]);
            data.ctrl_mut()[0] = 0.3 * i as f64;
            data.act_mut()[0] = 0.1 * i as f64;
        };
        let push = |i: usize, block: usize, data: &mut mj::Data| {
            if mocap {
                data.mocap_pos_mut()[0] = 0.02 * (i + block) as f64;
            }
            if mocap || i % 2 == 1 {
                data.xfrc_applied_mut()[6 * 5 + 2] = (i * block) as f64;
            }
            data.ctrl_mut()[0] = -0.1 * (i + block) as f64;
        };
        let mut plain: Vec<Plain> = (0..ENVS)
            .map(|i| {
                let own = if i % 3 == 1 { own_model(i) } else { model.clone() };
                let own = if i % 2 == 0 { own.with_welds(&[weld(i)]) } else { own };
                let mut data = mj::Data::new(&own).expect("small");
                data.set_equality_active(0, i % 2 == 0);
                start(i, &mut data);
                Plain { data, rk4: integrator == "RK4" }
            })
            .collect();
        let small = crate::env::with_small_buffers(&model);
        let mut batch = Batch::new(&small, &Arc::default(), ENVS, 2, ThreadPool::new()).expect("small");
        for i in 0..ENVS {
            batch.write_at(i, Stage::Raw, |env| {
                if i % 3 == 1 {
                    env.set_patch(own_model(i).patch());
                }
                if i % 2 == 0 {
                    env.set_welds(vec![weld(i)]);
                }
                env.write_state(|data| start(i, data));
            });
        }
        for (block, count) in [1, 4, 1, 17, 2, 60, 1].into_iter().enumerate() {
            for (i, env) in plain.iter_mut().enumerate() {
                push(i, block, &mut env.data);
                (0..count).for_each(|_| env.step());
            }
            // The writing thread seldom has the data that steps the environment.
            for i in (0..ENVS).rev() {
                batch.write_at(i, Stage::Raw, |env| env.write_state(|data| push(i, block, data)));
            }
            batch.step(count);
            // Controls edited in the row alone, and set back.
            batch.edit_row(2, |row, model| row.set_controls(|ctrl| ctrl[0] = -ctrl[0], model));
            batch.edit_row(2, |row, model| row.set_controls(|ctrl| ctrl[0] = -ctrl[0], model));
            batch.visit(Stage::State, |_, _| ());
            batch.for_each(|i, env| {
                assert_eq!(
                    bits_of_data(env.data()),
                    plain[i].bits(),
                    "{integrator}{extra}, mocap {mocap}: {i} after block {block}"
                );
            });
        }
        assert!(batch.read(3, |env| env.data().contact().len()) >= 4);
        let ends: Vec<_> = plain.iter_mut().map(Plain::bits).collect();
        assert!((1..ENVS).all(|i| ends[i] != ends[0]), "environments differ");
    }
}

/// Models whose step depends on more than the row.
#[test]
fn persistent_features() {
    if mj::BUILD_VERSION == mj::SupportedVersion::V2 {
        // 2.2.2 has none of them.
        assert_eq!(mj::compile(PENDULUM, &[]).expect("compiles").into_model().persistent_feature(), None);
        return;
    }
    let sleep = r#"<mujoco><option><flag sleep="enable"/></option><worldbody><body><freejoint/><geom size="1"/></body>
        </worldbody></mujoco>"#;
    let flex = r#"<mujoco><worldbody><flexcomp name="rope" type="grid" count="4 1 1" spacing="0.1 0.1 0.1" dim="1"
        radius="0.01" mass="1"/></worldbody></mujoco>"#;
    for (text, named) in [(sleep, "sleep"), (flex, "flex")] {
        let model = mj::compile(text, &[]).expect("compiles").into_model();
        let refused = Batch::new(&model, &Arc::default(), 2, 1, ThreadPool::new());
        let message = refused.map_err(|error| error.to_string()).err().unwrap_or_default();
        assert!(message.contains(named), "{named}: {message}");
        // An environment of its own steps.
        let mut env = SimEnv::new(&model, &Arc::default()).expect("small");
        env.step(3);
        assert_eq!(env.steps(), 3);
    }
}
