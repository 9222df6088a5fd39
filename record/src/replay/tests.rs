use super::*;
use crate::tests::*;
use kinetoscope_robot::description::LinkId;
use kinetoscope_sim::{SimulationManagerCfg, WrenchFrame};
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::worlds::sr5;
use std::fs::File;

const STEPS: u32 = 40;

fn arms() -> SimulationManager {
    let mut sim = simulation(2);
    sim.add_robot(sr5("arm")).unwrap();
    let pusher = r#"<mujoco><worldbody><body name="slider"><joint name="x" type="slide" axis="1 0 0"/>
        <geom size="0.1" pos="3 0 1"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("pusher", pusher)).unwrap();
    sim
}

/// Applies different targets at every step and in each environment, with a reset in between.
fn drive(sim: &mut SimulationManager, mut at_step: impl FnMut(&mut SimulationManager, u32)) {
    let (arm, pusher) = (sim.entities().robot_id("arm").unwrap(), sim.entities().mjcf_id("pusher").unwrap());
    for step in 0..STEPS {
        let targets = ndarray::Array2::from_shape_fn((2, sim.robot(arm).dof()), |(env, joint)| {
            0.3 * (0.1 * f64::from(step) + joint as f64 + env as f64).sin()
        });
        sim.robot_mut(arm).set_qpos_target(&targets, None, None).unwrap();
        sim.mjcf_part_mut(pusher).set_ctrl(&ndarray::array![[f64::from(step)]], None, None).unwrap();
        at_step(sim, step);
        sim.update(1);
        if step == 25 {
            sim.reset(Some(&[EnvId(1)])).unwrap();
        }
    }
}

fn recording(path: &Path, at_step: impl FnMut(&mut SimulationManager, u32)) {
    let mut sim = arms();
    // Not in the initial state.
    sim.update(7);
    let recorder = sim.record(RecorderCfg::new(path)).unwrap();
    drive(&mut sim, at_step);
    sim.finish_recording(recorder).unwrap();
}

#[test]
fn same_bits() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.npz", "run.mcap"] {
        let path = folder.path().join(name);
        recording(&path, |_, _| ());
        let mut sim = arms();
        assert_eq!(num_envs(&path).unwrap(), 2);
        let verdict = verify(&mut sim, &path).unwrap();
        assert!(verdict.is_identical(), "{name}: {verdict}");
        // Each step, the beginning and the reset: positions, velocities, efforts, poses of links, and the pusher's
        // three.
        let arm = sim.robot(sim.entities().robot_id("arm").unwrap());
        let row = 2 * (3 * arm.dof() + 7 * arm.link_names().len() + 3) as u64;
        assert_eq!((verdict.steps, verdict.values), (u64::from(STEPS), row * (u64::from(STEPS) + 2)), "{name}");
    }
}

#[test]
fn interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    recording(&path, |_, _| ());
    let mut sim = arms();
    let stopped = verify_until(&AtomicBool::new(true), &mut sim, &path);
    let is_interrupted = |error: &RecordError| matches!(error, RecordError::Sim(error) if matches!(**error, kinetoscope_sim::Error::Interrupted));
    assert!(stopped.as_ref().is_err_and(is_interrupted), "{stopped:?}");
    // The simulation is usable, and verifies the whole recording.
    assert!(verify_until(&AtomicBool::new(false), &mut sim, &path).unwrap().is_identical());
}

/// A recovered recording is verified as far as it goes.
#[test]
fn recovered_recording() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut sim = arms();
    sim.record(RecorderCfg::new(&path)).unwrap();
    drive(&mut sim, |_, _| ());
    drop(sim);
    crate::recover::recover(&path).unwrap();
    let verdict = verify(&mut arms(), &path).unwrap();
    assert!(verdict.is_identical() && verdict.steps == u64::from(STEPS), "{verdict}");
    // Control: the file without its attachments.
    let whole = std::fs::read(&path).unwrap();
    let other = folder.path().join("other.mcap");
    let mut writer = mcap::Writer::new(File::create(&other).unwrap()).unwrap();
    for message in mcap::MessageStream::new(&whole).unwrap() {
        writer.write(&message.unwrap()).unwrap();
    }
    writer.finish().unwrap();
    let error = verify(&mut arms(), &other).unwrap_err().to_string();
    assert!(error.contains("recording.json"), "{error}");
}

#[test]
fn other_actions() {
    let folder = tempfile::tempdir().unwrap();
    for end in ["npz", "mcap"] {
        // A push that is no action, before step 12 of environment 1.
        let path = folder.path().join(format!("pushed.{end}"));
        recording(&path, |sim, step| {
            let arm = sim.entities().robot_id("arm").unwrap();
            let mut force = ndarray::Array3::zeros((1, 1, 3));
            force[(0, 0, 0)] = if step == 12 { 5.0 } else { 0.0 };
            let tip = LinkId(sim.robot(arm).link_names().len() - 1);
            let (torque, env) = (ndarray::Array3::zeros((1, 1, 3)), [EnvId(1)]);
            sim.robot_mut(arm)
                .set_external_wrench(&force, &torque, WrenchFrame::World, Some(&[tip]), Some(&env))
                .unwrap();
        });
        let verdict = verify(&mut arms(), &path).unwrap();
        let difference = verdict.difference.unwrap();
        assert_eq!((difference.step, difference.env, difference.state_written), (13, 1, false), "{difference:?}");

        // A joint that was written before step 20.
        let path = folder.path().join(format!("written.{end}"));
        recording(&path, |sim, step| {
            if step == 20 {
                let arm = sim.entities().robot_id("arm").unwrap();
                let row = sim.robot(arm).qpos().row(0).mapv(|q| q + 0.01);
                let row = row.insert_axis(ndarray::Axis(0));
                sim.robot_mut(arm).write_qpos(&row, None, Some(&[EnvId(0)])).unwrap();
            }
        });
        let difference = verify(&mut arms(), &path).unwrap().difference.unwrap();
        assert_eq!((difference.step, difference.env, difference.state_written), (20, 0, true), "{difference:?}");
    }
}

/// Copies an archive with changed data of some arrays.
fn changed(path: &Path, to: &Path, change: impl Fn(&str, &mut Vec<u8>)) {
    let mut archive = archive::ArchiveWriter::new(File::create(to).unwrap());
    for (name, mut data) in archive::read_all(&std::fs::read(path).unwrap()).unwrap() {
        change(&name, &mut data);
        archive.add(&name, b"", &mut &data[..]).unwrap();
    }
    archive.finish().unwrap();
}

/// Changes the number with this index in an array.
fn change(data: &mut [u8], place: usize, to: impl Fn(f64) -> f64) {
    let at = data.len() - npy::parse(data).unwrap().2.len() + 8 * place;
    let old = f64::from_le_bytes(*data[at..].first_chunk().unwrap());
    data[at..at + 8].copy_from_slice(&to(old).to_le_bytes());
}

#[test]
fn changed_target() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("run.npz"), folder.path().join("other.npz"));
    recording(&path, |_, _| ());
    changed(&path, &other, |name, data| {
        if name == "arm/targets/positions.npy" {
            let shape = npy::parse(data).unwrap().1;
            change(data, 17 * shape[1] * shape[2], |old| old + 1e-9);
        }
    });
    let difference = verify(&mut arms(), &other).unwrap().difference.unwrap();
    // The target of row 17 was applied in step 17.
    assert_eq!((difference.step, difference.env), (17, 0), "{difference:?}");
    assert!(difference.array.starts_with("arm/joint_states/"), "{difference:?}");
}

#[test]
fn lacking_actions_or_steps() {
    let folder = tempfile::tempdir().unwrap();
    let (path, other) = (folder.path().join("run.npz"), folder.path().join("other.npz"));
    for (topic, words) in [
        (Topic::MjcfState("pusher".into()), "no targets of arm"),
        (Topic::Targets("arm".into()), "no controls of pusher"),
    ] {
        let cfg = overwriting(RecorderCfg::new(&path).with_topics([Topic::JointStates("arm".into()), topic]));
        record(&mut arms(), cfg, |sim| sim.update(3));
        assert_error(verify(&mut arms(), &path), "", &[words]);
    }
    std::fs::remove_file(&path).unwrap();
    recording(&path, |_, _| ());
    for (row, step, words) in
        [(0, 1.0, "step 0"), (5, f64::NAN, "every step"), (5, 9.0, "every step"), (5, 1.0, "every step")]
    {
        changed(&path, &other, |name, data| {
            if name.ends_with("/step.npy") && !name.starts_with("events/") {
                change(data, row, |_| step);
            }
        });
        assert_error(verify(&mut arms(), &other), "", &[words]);
    }
}

#[test]
fn other_simulations() {
    let (_folder, path) = scratch("run.npz");
    recording(&path, |_, _| ());
    assert_error(verify(&mut simulation(2), &path), "", &["scene"]);
    let cfg = SimulationManagerCfg { num_envs: 2, physics_dt: 0.002, ..Default::default() };
    assert_error(verify(&mut SimulationManager::new(cfg).unwrap(), &path), "", &["physics_dt"]);
    let bytes = std::fs::read(&path).unwrap();
    std::fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    assert_error(verify(&mut arms(), &path), "", &["damaged"]);
}
