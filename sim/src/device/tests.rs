//! The mirror against a device that is MuJoCo itself: what it is sent gives the motion that it sends back.

use super::{Device, DeviceError, DeviceMirror, DevicePhysics, UnknownDevice};
use crate::batch::Batch;
use crate::capture::{BodyAxis, CaptureRequest};
use crate::drive::DriveType;
use crate::drive::gains::{DriveSetting, Gains};
use crate::drive::table::{Drive, DriveState, DriveTable, Realization};
use crate::env::{EnvStatus, Stage};
use crate::row::{RowPart, StateArray};
use kinetoscope_exec::ThreadPool;
use kinetoscope_mujoco as mj;
use kinetoscope_scene::StateFields;
use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex};

/// More than the calling thread visits alone.
const NUM_ENVS: usize = 40;

/// A hinge with a drive row above a free box that falls on the ground.
const SCENE: &str = r#"<mujoco><option timestep="0.002"/><worldbody><geom type="plane" size="9 9 1"/>
    <body pos="0 0 1"><joint type="hinge" axis="0 1 0" frictionloss="1"/><geom type="capsule" size="0.02 0.1" mass="1"/></body>
    <body pos="1 0 0.15"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="1"/></body></worldbody>
    <actuator><general joint="" gainprm="0"/></actuator></mujoco>"#;

/// Record of the calls of a [`Reference`].
#[derive(Debug, Default)]
struct Log {
    writes: Vec<(String, Vec<i32>)>,
    reads: Vec<String>,
    fails: bool,
}

/// A device that steps its own batch on the CPU.
#[derive(Debug)]
struct Reference {
    batch: Batch,
    log: Arc<Mutex<Log>>,
    /// Environments that it reports as diverged in the next step.
    diverges: Vec<usize>,
    /// Contacts that it reports, as environments and distances.
    contacts: Vec<(usize, f32)>,
}

impl Reference {
    fn rows(&self, width: usize, read: impl Fn(&crate::env::SimEnv) -> Vec<f64>) -> Vec<f32> {
        let mut values = Vec::new();
        self.batch.for_each_at(Stage::Raw, |_, env| values.extend(read(env).iter().map(|x| *x as f32)));
        assert_eq!(values.len(), NUM_ENVS * width);
        values
    }
}

impl DevicePhysics for Reference {
    fn load(&mut self, _: &Path, _: &str, _: usize) -> Result<(), DeviceError> {
        Ok(())
    }

    fn write(&mut self, array: &str, envs: &[i32], values: &[f32]) -> Result<(), DeviceError> {
        self.log.lock().expect("one thread").writes.push((array.into(), envs.to_vec()));
        let width = values.len() / envs.len();
        for (env, row) in envs.iter().zip(values.chunks_exact(width)) {
            let row: Vec<f64> = row.iter().map(|x| f64::from(*x)).collect();
            self.batch.write_at(*env as usize, Stage::Raw, |env| match array {
                "qpos" => env.write_state(|data| data.qpos_mut().copy_from_slice(&row)),
                "qvel" => env.write_state(|data| data.qvel_mut().copy_from_slice(&row)),
                "qacc_warmstart" => env.write_state(|data| data.qacc_warmstart_mut().copy_from_slice(&row)),
                "target_position" => env.drives.position.copy_from_slice(&row),
                "qfrc_applied" => env.drives.applied.copy_from_slice(&row),
                "xfrc_applied" => env.write_state(|data| data.xfrc_applied_mut().copy_from_slice(&row)),
                _ => {}
            });
        }
        Ok(())
    }

    fn step(&mut self, steps: u32, _: &[&str]) -> Result<String, DeviceError> {
        if self.log.lock().expect("one thread").fails {
            return Err(DeviceError::Failed("the cable was pulled".into()));
        }
        self.batch.step(steps);
        let diverged: Vec<String> = self.diverges.drain(..).map(|env| format!("[{env}, 0, \"qvel\"]")).collect();
        Ok(format!(r#"{{"diverged": [{}], "grown": [[32, 16]], "warnings": {{}}}}"#, diverged.join(", ")))
    }

    fn read(&mut self, array: &str) -> Result<Vec<f32>, DeviceError> {
        let mut log = self.log.lock().expect("one thread");
        log.reads.push(array.into());
        if log.fails {
            return Err(DeviceError::Failed("the cable was pulled".into()));
        }
        drop(log);
        let model = self.batch.model().clone();
        Ok(match array {
            "contacts" => self.contacts.iter().flat_map(|(env, distance)| contact(*env, *distance)).collect(),
            "qpos" => self.rows(model.nq(), |env| env.data().qpos().to_vec()),
            "qvel" => self.rows(model.nv(), |env| env.data().qvel().to_vec()),
            "qacc_warmstart" => self.rows(model.nv(), |env| env.data().qacc_warmstart().to_vec()),
            "qacc" => self.rows(model.nv(), |env| env.data().qacc().to_vec()),
            "effort" => self.rows(1, |env| env.drives.effort.to_vec()),
            "actuator_force" => self.rows(model.nu(), |env| env.data().actuator_force().to_vec()),
            _ => vec![0.0; NUM_ENVS * model.nv()],
        })
    }

    fn as_any(&self) -> &dyn std::any::Any {
        self
    }
}

/// A contact of the box of environment `env` with the ground, as the device has it.
fn contact(env: usize, distance: f32) -> [f32; 19] {
    let mut numbers = [0.0; 19];
    (numbers[0], numbers[2], numbers[3], numbers[16]) = (env as f32, 2.0, distance, 9.81);
    numbers
}

fn batch() -> Batch {
    batch_on(2)
}

/// A batch on this number of threads.
fn batch_on(threads: usize) -> Batch {
    let text = SCENE.replace("joint=\"\"", "joint=\"hinge\"").replace("<joint type", "<joint name=\"hinge\" type");
    let model = mj::compile(&text, &[]).expect("compiles").into_model();
    let gains = Gains { kp: 30.0, kd: 3.0, max_effort: 5.0, max_velocity: f64::INFINITY };
    let setting = DriveSetting { drive_type: DriveType::Force, stiffness: 30.0, damping: 3.0, inertia: None };
    let realization = Realization::ConstraintRow;
    let drive = Drive { qpos: 0, dof: 0, ctrl: 0, realization, initial: gains, setting, range: [-3.0, 3.0] };
    let table = Arc::new(DriveTable { drives: vec![drive], ..Default::default() });
    Batch::new(&model, &table, NUM_ENVS, threads, ThreadPool::new()).expect("small")
}

/// A batch on a [`Reference`], and the record of its calls.
fn on_device(diverges: Vec<usize>) -> (Batch, Arc<Mutex<Log>>) {
    on_device_with(diverges, 2, Vec::new())
}

/// A batch on this number of threads and on a [`Reference`] with these contacts, and the record of its calls.
fn on_device_with(diverges: Vec<usize>, threads: usize, contacts: Vec<(usize, f32)>) -> (Batch, Arc<Mutex<Log>>) {
    let log = Arc::new(Mutex::new(Log::default()));
    let mut batch = batch_on(threads);
    let reference = Reference { batch: self::batch(), log: Arc::clone(&log), diverges, contacts };
    let table = batch.read_row(0, |row| Arc::clone(row.drives.table()));
    let mut mirror = DeviceMirror::new(Box::new(reference));
    mirror.reset_for(&table, NUM_ENVS);
    batch.set_device(mirror);
    (batch, log)
}

/// Positions, velocities, efforts, times and steps.
fn state(batch: &Batch) -> Vec<f64> {
    let mut values = Vec::new();
    batch.for_each_row(RowPart::All, |_, row| {
        values.extend_from_slice(row.raw_qpos());
        values.extend_from_slice(row.qvel());
        values.extend_from_slice(&row.drives.effort);
        values.extend([row.time(), row.steps() as f64]);
    });
    values
}

fn command(batch: &mut Batch) {
    for env in 0..NUM_ENVS {
        batch.edit_row(env, |row, _| row.drives.position[0] = 0.25 * (env % 5) as f64 - 0.5);
    }
    batch.write_at(3, Stage::Raw, |env| env.write_state(|data| data.qvel_mut()[1] = 0.5));
    batch.edit_row(4, |row, _| row.drives.applied[6] = 0.125);
}

/// Sends only what changed, and equals the CPU up to the rounding of states to single precision in each call.
#[test]
fn motion() {
    let (mut device, log) = on_device(Vec::new());
    let mut cpu = batch();
    command(&mut device);
    command(&mut cpu);
    for _ in 0..20 {
        device.step(5);
        cpu.step(5);
    }
    let error = state(&device).iter().zip(state(&cpu)).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    // 20 roundings of numbers below 8, each at most 8 * 2^-24, in a motion that amplifies no error 10 times.
    assert!(error < 20.0 * 10.0 * 8.0 * 2.0_f64.powi(-24), "{error}");
    assert!(state(&cpu).iter().any(|x| x.abs() > 0.3), "it moves");
    let mut counts = BTreeMap::new();
    for (name, envs) in &log.lock().expect("one thread").writes {
        *counts.entry(name.clone()).or_insert(0) += envs.len();
    }
    // Everything once, nothing again.
    assert!(counts.values().all(|count| *count == NUM_ENVS), "{counts:?}");
    assert_eq!(device.buffer_growths(), 20);
}

/// An environment that diverges keeps its state until it is written, and is then sent again.
#[test]
fn divergence() {
    let (mut device, log) = on_device(vec![2]);
    device.step(3);
    let status = device.read_row(2, |row| row.status().clone());
    assert!(matches!(status, EnvStatus::Diverged { step: 0, .. }), "{status:?}");
    let before = device.read_row(2, |row| row.raw_qpos().to_vec());
    device.step(3);
    assert_eq!(device.read_row(2, |row| (row.raw_qpos().to_vec(), row.steps())), (before, 0));
    assert_eq!(device.read_row(1, |row| row.steps()), 6);
    log.lock().expect("one thread").writes.clear();
    // Back in the very state that the device has: it must be sent, so that the device lets the environment run.
    let there = device.with_device(|physics| {
        let reference = physics.as_any().downcast_ref::<Reference>().expect("this device");
        reference.batch.read_at(2, Stage::Raw, |env| env.state_arrays())
    });
    let there = there.expect("on a device");
    device.run_in(&[2], |_, env| {
        env.reset(|data, _| {
            data.qpos_mut().copy_from_slice(&there.qpos);
            data.qvel_mut().copy_from_slice(&there.qvel);
            data.qacc_warmstart_mut().copy_from_slice(&there.warmstart);
        });
    });
    device.step(1);
    let writes = std::mem::take(&mut log.lock().expect("one thread").writes);
    let states = ["qacc_warmstart", "qpos", "qvel"].map(|name| (name.to_string(), vec![2]));
    let mut written: Vec<_> = writes.into_iter().filter(|(name, _)| name.starts_with('q')).collect();
    written.sort();
    assert_eq!(written, states);
    assert_eq!(device.read_row(2, |row| row.steps()), 1);
}

/// After an error of the device, all environments are frozen, and the error is kept.
#[test]
fn failure() {
    let (mut device, log) = on_device(Vec::new());
    device.step(2);
    log.lock().expect("one thread").fails = true;
    let before = state(&device);
    device.step(2);
    assert_eq!(state(&device), before);
    device.for_each_row(RowPart::Clock, |env, row| assert!(row.diverged.is_some(), "environment {env}"));
    let error = device.device_failure().expect("failed").to_string();
    assert_eq!(error, "the physics on the device failed: the cable was pulled");
}

/// A wrench in link axes is computed again for every step, one in world axes once for a call.
#[test]
fn wrenches() {
    let (mut device, log) = on_device(Vec::new());
    let mut cpu = batch();
    for batch in [&mut device, &mut cpu] {
        batch.write_at(1, Stage::Kinematics, |env| {
            env.set_wrenches(|wrenches| {
                wrenches.replace(crate::wrenches::Wrench {
                    owner: (0, 0),
                    body: 1,
                    axes: Some(nalgebra::UnitQuaternion::identity()),
                    force: nalgebra::Vector3::zeros(),
                    torque: nalgebra::Vector3::new(0.0, 0.2, 0.1),
                });
            });
        });
        batch.step(50);
    }
    let error = state(&device).iter().zip(state(&cpu)).map(|(one, other)| (one - other).abs()).fold(0.0, f64::max);
    // 50 roundings of states and wrenches.
    assert!(error < 2.0 * 50.0 * 10.0 * 8.0 * 2.0_f64.powi(-24), "{error}");
    let writes = &log.lock().expect("one thread").writes;
    assert_eq!(writes.iter().filter(|(name, envs)| name == "xfrc_applied" && envs.contains(&1)).count(), 50);
}

/// Removes the names of the arrays that were read, from the record.
fn taken_reads(log: &Mutex<Log>) -> Vec<String> {
    std::mem::take(&mut log.lock().expect("one thread").reads)
}

/// Removes the writes from the record.
fn taken_writes(log: &Mutex<Log>) -> Vec<(String, Vec<i32>)> {
    std::mem::take(&mut log.lock().expect("one thread").writes)
}

/// A step reads nothing; a reader reads the arrays that it needs, once for all environments.
#[test]
fn reads() {
    const STATE: [&str; 3] = ["qpos", "qvel", "qacc_warmstart"];
    const RESULTS: [&str; 5] = ["qacc", "qfrc_actuator", "qfrc_constraint", "actuator_force", "effort"];
    type Act = fn(&mut Batch);
    let of_row: Act = |batch| {
        for env in 0..NUM_ENVS {
            batch.read_row(env, |row| assert_eq!(row.steps(), 4));
        }
    };
    let nested: Act = |batch| batch.read_data(1, |_| assert_eq!(state(batch).len(), NUM_ENVS * 18));
    let accelerations: Act = |batch| drop(batch.gather_state(StateArray::Accelerations, &[0_usize], |place| *place));
    let cases: [(&str, Act, &[&[&str]]); 9] = [
        ("one array", accelerations, &[&["qacc_warmstart"]]),
        ("nothing", |_| {}, &[]),
        ("time", |batch| batch.for_each_row(RowPart::Clock, |_, row| assert_eq!(row.steps(), 4)), &[]),
        ("targets", |batch| command_drives(batch), &[]),
        ("rows", of_row, &[&STATE, &RESULTS]),
        ("a read in a read", nested, &[&STATE, &RESULTS]),
        ("bodies", |batch| drop(batch.body_rows(|bodies| [bodies.steps() as f64])), &[&STATE, &RESULTS]),
        ("a write", |batch| batch.write_at(0, Stage::Raw, |_| ()), &[&STATE, &RESULTS]),
        ("another batch", |batch| drop(batch.take_device()), &[&STATE, &RESULTS]),
    ];
    for (name, act, arrays) in cases {
        let (mut batch, log) = on_device(Vec::new());
        batch.step(3);
        batch.step(1);
        act(&mut batch);
        assert_eq!(taken_reads(&log), arrays.concat(), "{name}");
        if batch.is_on_device() {
            act(&mut batch);
            assert_eq!(taken_reads(&log), [""; 0], "{name}, again");
        }
    }
}

fn command_drives(batch: &mut Batch) {
    for env in 0..NUM_ENVS {
        batch.edit_drives(env, |drives| drives.position[0] += 0.125);
    }
}

/// Rows that are read after every step, and rows that are read at the end, are the same, and so is what is sent; for any
/// number of threads.
#[test]
fn threads_and_reads() {
    let contacts = vec![(7, 0.5), (0, 1.5), (39, 2.5), (7, 3.5), (40, 4.5), (0, 5.5), (7, 6.5)];
    let model = batch().model().clone();
    let carriers: Vec<usize> = (0..model.nbody()).collect();
    let capture = CaptureRequest {
        body_axis: Arc::new(BodyAxis::new(&model, &[], &[], &[], &carriers)),
        fields: StateFields::CONTACTS,
    };
    let run = |threads: usize, is_read: bool| {
        let (mut batch, log) = on_device_with(vec![11], threads, contacts.clone());
        command(&mut batch);
        let mut values = Vec::new();
        for k in 0..6 {
            batch.step_and_visit(1 + k % 2, (k > 3).then_some(&capture), None, |_, _| ());
            if is_read {
                state(&batch);
            }
            let dofs: Vec<usize> = (0..7).collect();
            values.extend(batch.gather_state(StateArray::Velocities, &dofs, |dof| *dof).mapv(f64::to_bits));
            if k % 2 == 0 {
                command_drives(&mut batch);
            }
            // Before the reset, a diverged environment is read.
            if k == 3 {
                batch.run_in(&[5, 11, 30], |_, env| env.reset(|data, _| data.qvel_mut()[0] = 0.25));
            }
        }
        values.extend(state(&batch).iter().map(|x| x.to_bits()));
        let mut lists = Vec::new();
        batch.for_each_row(RowPart::Clock, |_, row| {
            lists.push(row.captured().contacts.iter().map(|contact| contact.distance).collect::<Vec<_>>());
        });
        (values, lists, taken_writes(&log))
    };
    let expected = run(1, true);
    let lists = &expected.1;
    assert_eq!([&lists[0], &lists[7], &lists[39]], [&vec![1.5, 5.5], &vec![0.5, 3.5, 6.5], &vec![2.5]]);
    assert_eq!(lists.concat().len(), 6, "environment 40 does not exist");
    for (threads, is_read) in [(1, false), (2, true), (2, false), (3, true), (3, false)] {
        assert_eq!(run(threads, is_read), expected, "{threads} threads, read after every step: {is_read}");
    }
}

/// An array that environments share is sent once; each change of an own array is sent, also one in place.
#[test]
fn shared_arrays() {
    let (mut batch, log) = on_device(Vec::new());
    batch.step(1);
    taken_writes(&log);
    let sent = |batch: &mut Batch, env: usize, act: &dyn Fn(&mut DriveState)| {
        batch.edit_row(env, |row, _| act(&mut row.drives));
        batch.step(1);
        taken_writes(&log)
    };
    let of = |names: &[&str]| names.iter().map(|name| (name.to_string(), vec![3])).collect::<Vec<_>>();
    assert_eq!(sent(&mut batch, 3, &|_| ()), []);
    for value in [1.0, 2.0, 3.0] {
        assert_eq!(sent(&mut batch, 3, &|drives| drives.velocity[0] = value), of(&["target_velocity"]), "{value}");
        assert_eq!(sent(&mut batch, 3, &|drives| drives.applied[1] = value), of(&["qfrc_applied"]), "{value}");
        assert_eq!(sent(&mut batch, 3, &|drives| drives.gains[0].kp = value), of(&["stiffness"]), "{value}");
    }
    assert_eq!(sent(&mut batch, 3, &|drives| drives.velocity[0] = 3.0), []);
    let before = batch.read_row(3, |row| row.drives.velocity.as_ptr());
    assert_eq!(sent(&mut batch, 3, &|drives| drives.velocity[0] = 4.0), of(&["target_velocity"]));
    let after = batch.read_row(3, |row| row.drives.velocity.as_ptr());
    assert_eq!(before, after, "an own array is not copied in a write");
    // The shared arrays again, with the values from before.
    assert_eq!(sent(&mut batch, 3, &|drives| drives.reset()), of(&["qfrc_applied", "target_velocity"]));
}

/// If the device fails before rows are read, they keep the last state that was copied.
#[test]
fn failure_of_unread_rows() {
    let (mut device, log) = on_device(Vec::new());
    device.step(2);
    let before = state(&device);
    device.step(2);
    log.lock().expect("one thread").fails = true;
    device.step(2);
    assert_eq!(state(&device), before);
    device.for_each_row(RowPart::Clock, |env, row| {
        assert!(matches!(row.status(), EnvStatus::Diverged { step: 2, .. }), "environment {env}");
    });
}

/// A read in which the device fails: all environments freeze in the state before, with its time, also where the time of
/// later steps was read.
#[test]
fn failed_reads() {
    let reads: [fn(&mut Batch); 4] = [
        |batch| drop(state(batch)),
        |batch| drop(batch.gather_state(StateArray::Velocities, &[0], |place| *place)),
        |batch| batch.read_row(3, |row| assert_eq!(row.steps(), 2)),
        |batch| drop(batch.take_device()),
    ];
    for (k, read) in reads.into_iter().enumerate() {
        let (mut device, log) = on_device(Vec::new());
        device.step(2);
        let before = state(&device);
        device.step(3);
        device.for_each_row(RowPart::Clock, |_, row| assert_eq!(row.steps(), 5));
        log.lock().expect("one thread").fails = true;
        read(&mut device);
        assert_eq!(state(&device), before, "read {k}");
        device.for_each_row(RowPart::Clock, |env, row| {
            assert!(matches!(row.status(), EnvStatus::Diverged { step: 2, .. }), "read {k}, environment {env}");
        });
        if device.is_on_device() {
            assert_eq!(device.device_failure(), Some(DeviceError::Failed("the cable was pulled".into())));
            device.step(1);
            assert_eq!(state(&device), before, "read {k}");
        }
    }
}

#[test]
fn names() {
    for (text, device) in
        [("cpu", Device::Cpu), ("cuda:0", Device::Cuda(0)), ("cuda:7", Device::Cuda(7)), ("warp-cpu", Device::WarpCpu)]
    {
        assert_eq!((text.parse(), device.to_string().as_str()), (Ok(device), text));
    }
    assert_eq!("cuda".parse(), Ok(Device::Cuda(0)));
    for wrong in ["", "gpu", "cuda:", "cuda:-1", "cuda:x", "CPU"] {
        assert_eq!(wrong.parse::<Device>(), Err(UnknownDevice(wrong.into())));
    }
}
