//! HDF5 files as robomimic reads them, read by h5py; robomimic itself brings PyTorch, some gigabytes.

use super::episodes::Expected;
use super::readers::{bits, python, said};
use super::*;
use serde_json::{Value, json};
use std::path::Path;

/// A run with a reset of one environment, and what is expected of it.
fn recorded(path: &Path) -> (World, Expected) {
    let mut world = World::new(2, 2);
    let cfg = RecorderCfg { task: "wave at the cube".into(), ..RecorderCfg::new(path) };
    let recorder = world.sim.record(cfg).unwrap();
    let mut expected = Expected::new(&world);
    for step in 0..40 {
        world.step(step);
        expected.stepped(&world);
        if step == 15 {
            world.sim.reset(Some(&[EnvId(1)])).unwrap();
            expected.begin(&world, 1);
        }
    }
    assert!(!path.exists(), "it has its name when it is whole");
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert_eq!(recorded.bytes, std::fs::metadata(path).unwrap().len());
    (world, expected)
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn h5py_reads_every_number_and_every_pixel() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.hdf5");
    let (world, expected) = recorded(&path);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "nothing is left beside it");
    let found = said(&python, "read_hdf5.py", &path);
    let episodes = found["episodes"].as_array().unwrap();
    let wanted = expected.episodes();
    assert_eq!((episodes.len(), wanted.len()), (3, 3));
    for (episode, (env, frames)) in episodes.iter().zip(wanted) {
        assert_eq!((&episode["env"], &episode["frames"]), (&json!(env), &json!(frames.len())));
        let numbers = |path: &str| episode["numbers"][path].clone();
        let all = |of: &dyn Fn(&[&super::episodes::Row; 2]) -> Vec<f64>| bits(frames.iter().map(of).collect());
        for (at, of) in [(0, "obs"), (1, "next_obs")] {
            assert_eq!(numbers(&format!("{of}/joint_pos")), all(&|pair| pair[at].positions.clone()), "{of}");
            assert_eq!(numbers(&format!("{of}/joint_vel")), all(&|pair| pair[at].velocities.clone()), "{of}");
            assert_eq!(numbers(&format!("{of}/joint_effort")), all(&|pair| pair[at].efforts.clone()), "{of}");
            assert_eq!(numbers(&format!("{of}/object")), all(&|pair| pair[at].cube.clone()), "{of}");
            let acceleration = all(&|pair| pair[at].acceleration.clone().unwrap());
            assert_eq!(numbers(&format!("{of}/imu_lin_acc_b")), acceleration, "{of}");
            let pictures: Vec<&str> = frames.iter().map(|pair| pair[at].picture.as_deref().unwrap()).collect();
            assert_eq!(episode["images"][format!("{of}/camera_image")], json!(pictures), "{of}");
        }
        for (k, name) in ["actions", "action_dict/joint_vel", "action_dict/joint_effort"].into_iter().enumerate() {
            assert_eq!(numbers(name), all(&|pair| pair[1].targets[k].clone()), "{name}");
        }
        assert!(frames.iter().all(|[row, next]| row.targets[0] != next.targets[0]), "an earlier action would be seen");
        let dones: Vec<u64> = (1..=frames.len()).map(|frame| u64::from(frame == frames.len())).collect();
        assert_eq!(numbers("dones"), json!(dones));
        // What nobody has told is not made up.
        assert!(episode["numbers"].get("rewards").is_none());
        // An arm with a fixed base and a cube: angles and the pose of a free joint, which MuJoCo has in this order.
        for (state, [row, _]) in numbers("states").as_array().unwrap().iter().zip(&frames) {
            let state: Vec<f64> = state
                .as_array()
                .unwrap()
                .iter()
                .map(|text| f64::from_bits(text.as_str().unwrap().parse().unwrap()))
                .collect();
            let (joints, dof) = (row.positions.len(), row.velocities.len());
            assert_eq!(state.len(), 1 + joints + 7 + dof + 6);
            assert_eq!(state[1..=joints], row.positions);
            assert_eq!(state[1 + joints..4 + joints], row.cube[..3]);
            // The engine makes its quaternions of length 1 once more: a rounding of each number.
            let near = |(a, b): (&f64, &f64)| (a - b).abs() <= 2.0 * f64::EPSILON;
            assert!(state[4 + joints..8 + joints].iter().zip(&row.cube[3..]).all(near), "{state:?} {row:?}");
            assert_eq!(state[8 + joints..8 + joints + dof], row.velocities);
        }
    }
    let about = &found["about"]["env_kwargs"];
    assert_eq!((&about["task"], &about["every"]), (&json!("wave at the cube"), &json!(1)));
    let joints: Vec<Value> =
        world.sim.robot(world.arm).joint_names().iter().map(|name| json!(format!("arm/{name}"))).collect();
    assert_eq!(about["columns"]["joint_pos"], json!(joints));
}

/// Many episodes, which are many groups, and long ones, which are many blocks.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn h5py_reads_many_episodes_and_long_ones() {
    const ENVS: usize = 8;
    const RESETS: usize = 40;
    const STEPS: usize = 1500;
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.hdf5");
    let ball = r#"<mujoco><worldbody><body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/>
        <geom size="0.1" mass="1"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>"#;
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: ENVS, ..Default::default() }).unwrap();
    let cart = sim.add_mjcf(MjcfCfg::text("cart", ball)).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    // Three steps from one reset of all environments to the next, then none.
    let mut heights: Vec<Vec<Vec<f64>>> = Vec::new();
    for step in 0..3 * RESETS + STEPS {
        if step % 3 == 0 && step < 3 * RESETS {
            if step > 0 {
                sim.reset(None).unwrap();
            }
            heights.extend((0..ENVS).map(|_| Vec::new()));
        }
        let begun = heights.len() - ENVS;
        let q = sim.mjcf_part(cart).get_qpos();
        heights[begun..].iter_mut().enumerate().for_each(|(env, rows)| rows.push(q.row(env).to_vec()));
        let force = ndarray::Array2::from_shape_fn((ENVS, 1), |(env, _)| (env + step) as f64 * 0.01);
        sim.mjcf_part_mut(cart).set_ctrl(&force, None, None).unwrap();
        sim.update(1);
    }
    sim.finish_recording(recorder).unwrap();
    let found = said(&python, "read_hdf5.py", &path);
    let episodes = found["episodes"].as_array().unwrap();
    assert_eq!(episodes.len(), ENVS * RESETS);
    for (k, (episode, rows)) in episodes.iter().zip(&heights).enumerate() {
        assert_eq!(episode["env"], json!(k % ENVS));
        assert_eq!(episode["numbers"]["obs/joint_pos"], bits(json!(rows)), "demo_{k}");
    }
    assert_eq!(episodes.last().unwrap()["frames"], json!(STEPS + 3));
}

#[test]
fn a_build_without_the_feature_says_which_one() {
    let folder = tempfile::tempdir().unwrap();
    let result = World::new(1, 1).sim.record(RecorderCfg::new(folder.path().join("run.hdf5")));
    match result {
        Ok(_) => assert!(Format::Hdf5.is_built()),
        Err(error) => {
            assert!(matches!(error, RecordError::NotBuilt { feature: "hdf5", .. }), "{error}");
            assert!(!Format::Hdf5.is_built() && error.to_string().contains("--features hdf5"), "{error}");
            assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was begun");
        }
    }
}

#[test]
#[cfg_attr(not(feature = "hdf5"), ignore = "needs the feature hdf5")]
fn a_run_without_frames_or_actions_is_no_dataset() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.hdf5");
    let mut world = World::new(1, 1);
    let cfg = RecorderCfg::new(&path).with_topics([Topic::JointStates("arm".into())]);
    let error = world.sim.record(cfg).unwrap_err();
    assert!(matches!(error, RecordError::NoPlace { .. }) && error.to_string().contains("targets"), "{error}");
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    let error = world.sim.finish_recording(recorder).unwrap_err();
    let RecordError::BrokenOff { error, kept: None, .. } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::NoFrame { .. }), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was left");
}

/// Set in child processes only: the file to record to.
const FILE: &str = "KINETOSCOPE_TEST_HDF5_TO";

/// Records where files may only have some size: to the system, that is as a full disk.
#[test]
#[ignore = "runs in a process of its own"]
fn scenario_records_to_a_full_disk() {
    let Some(path) = std::env::var_os(FILE) else { return };
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(path)).unwrap();
    (0..60).for_each(|step| world.step(step));
    match world.sim.finish_recording(recorder) {
        Ok(recorded) => println!("whole {}", recorded.bytes),
        Err(error) => println!("refused {error}"),
    }
}

#[cfg(unix)]
#[test]
#[cfg_attr(not(feature = "hdf5"), ignore = "needs the feature hdf5")]
fn a_full_disk_leaves_nothing_that_looks_whole() {
    // A limit in blocks of 512 bytes, whose signal is not heard: then writing is an error.
    let said = |blocks: u64| {
        let folder = tempfile::tempdir().unwrap();
        let output = std::process::Command::new("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f \"$1\"; shift; exec \"$@\"", "sh", &blocks.to_string()])
            .arg(std::env::current_exe().unwrap())
            .args(["--exact", "tests::hdf5::scenario_records_to_a_full_disk", "--ignored", "--nocapture", "--test-threads=1"])
            .env(FILE, folder.path().join("run.hdf5"))
            .env("TMPDIR", folder.path())
            .output()
            .unwrap();
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert!(output.status.success(), "{text}{}", String::from_utf8_lossy(&output.stderr));
        let left: Vec<_> = std::fs::read_dir(folder.path()).unwrap().map(|entry| entry.unwrap().file_name()).collect();
        (text, left)
    };
    let (text, left) = said(1 << 20);
    assert_eq!(left, ["run.hdf5"], "{text}");
    let whole = text.split("whole ").nth(1).and_then(|rest| rest.split_whitespace().next()).unwrap();
    let whole: u64 = whole.parse().unwrap();
    // While rows and pictures are put aside, in the file itself, and in what comes last.
    for blocks in [1, whole / 512 / 4, whole / 512 / 2, whole / 512 - 1] {
        let (text, left) = said(blocks);
        assert!(
            text.contains("refused") && text.contains("run.hdf5") && text.contains("too large"),
            "{blocks}: {text}"
        );
        assert!(left.is_empty(), "{blocks}: {left:?}");
    }
}
