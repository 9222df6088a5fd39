//! HDF5 files for robomimic, read by h5py. robomimic itself requires PyTorch, some gigabytes.

use super::episodes::{Expected, ExpectedRow};
use super::*;

/// Some numbers of a row.
type Values = fn(&ExpectedRow) -> Vec<f64>;

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn frames() {
    let (folder, path) = scratch("run.hdf5");
    let (world, expected, recorded) = Expected::record(&path, 40, 15);
    assert_eq!(recorded.bytes, std::fs::metadata(&path).unwrap().len());
    assert_eq!(names(&folder), ["run.hdf5"]);
    let found = script_output("read_hdf5.py", &path);
    let (episodes, wanted) = (list(&found["episodes"]), expected.episodes());
    assert_eq!((episodes.len(), wanted.len()), (3, 3));
    for (episode, (env, frames)) in episodes.iter().zip(wanted) {
        assert_eq!((&episode["env"], &episode["frames"]), (&json!(env), &json!(frames.len())));
        let table = |path: &str| episode["numbers"][path].clone();
        let all = |of: &dyn Fn(&[&ExpectedRow; 2]) -> Vec<f64>| bits(frames.iter().map(of).collect());
        for (at, of) in [(0, "obs"), (1, "next_obs")] {
            let columns: [(&str, Values); 5] = [
                ("joint_pos", |row| row.positions.clone()),
                ("joint_vel", |row| row.velocities.clone()),
                ("joint_effort", |row| row.efforts.clone()),
                ("object", |row| row.cube.clone()),
                ("imu_lin_acc_b", |row| row.acceleration.clone().unwrap()),
            ];
            for (name, values) in columns {
                assert_eq!(table(&format!("{of}/{name}")), all(&|pair| values(pair[at])), "{of}/{name}");
            }
            let images: Vec<&str> = frames.iter().map(|pair| pair[at].image.as_deref().unwrap()).collect();
            assert_eq!(episode["images"][format!("{of}/camera_image")], json!(images), "{of}");
        }
        for (k, name) in ["actions", "action_dict/joint_vel", "action_dict/joint_effort"].into_iter().enumerate() {
            assert_eq!(table(name), all(&|pair| pair[1].targets[k].clone()), "{name}");
        }
        assert!(frames.iter().all(|[row, next]| row.targets[0] != next.targets[0]), "an earlier action would be seen");
        let dones: Vec<u64> = (1..=frames.len()).map(|frame| u64::from(frame == frames.len())).collect();
        assert_eq!(table("dones"), json!(dones));
        // Without a task there are no rewards.
        assert!(episode["numbers"].get("rewards").is_none());
        // An arm with a fixed base and a cube: joint angles and the pose of a free joint, in MuJoCo's order.
        for (state, [row, _]) in list(&table("states")).iter().zip(&frames) {
            let state = numbers(state);
            let (joints, dof) = (row.positions.len(), row.velocities.len());
            assert_eq!(state.len(), 1 + joints + 7 + dof + 6);
            assert_eq!(state[1..=joints], row.positions);
            assert_eq!(state[1 + joints..4 + joints], row.cube[..3]);
            // The engine normalizes its quaternions once more: one rounding of each number.
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

/// Many episodes are many groups, and long episodes are many blocks.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn many_episodes() {
    const ENVS: usize = 8;
    const RESETS: usize = 40;
    const STEPS: usize = 1500;
    let (_folder, path) = scratch("run.hdf5");
    let cart = r#"<mujoco><worldbody><body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/>
        <geom size="0.1" mass="1"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>"#;
    let mut sim = simulation(ENVS);
    let cart = sim.add_mjcf(MjcfPartCfg::text("cart", cart)).unwrap();
    // All environments are reset every three steps, then no longer.
    let mut positions: Vec<Vec<Vec<f64>>> = Vec::new();
    record(&mut sim, RecorderCfg::new(&path), |sim| {
        for step in 0..3 * RESETS + STEPS {
            if step % 3 == 0 && step < 3 * RESETS {
                if step > 0 {
                    sim.reset(None).unwrap();
                }
                positions.extend((0..ENVS).map(|_| Vec::new()));
            }
            let begun = positions.len() - ENVS;
            let q = sim.mjcf_part(cart).qpos();
            positions[begun..].iter_mut().enumerate().for_each(|(env, rows)| rows.push(q.row(env).to_vec()));
            let force = Array2::from_shape_fn((ENVS, 1), |(env, _)| (env + step) as f64 * 0.01);
            sim.mjcf_part_mut(cart).set_ctrl(&force, None, None).unwrap();
            sim.update(1);
        }
    });
    let found = script_output("read_hdf5.py", &path);
    let episodes = list(&found["episodes"]);
    assert_eq!(episodes.len(), ENVS * RESETS);
    for (k, (episode, rows)) in episodes.iter().zip(&positions).enumerate() {
        assert_eq!(episode["env"], json!(k % ENVS));
        assert_eq!(episode["numbers"]["obs/joint_pos"], bits(json!(rows)), "demo_{k}");
    }
    assert_eq!(episodes.last().unwrap()["frames"], json!(STEPS + 3));
}

#[test]
fn feature() {
    let (folder, path) = scratch("run.hdf5");
    match World::new(1, 1).sim.record(RecorderCfg::new(path)) {
        Ok(_) => assert!(Format::Hdf5.is_built()),
        Err(error) => {
            assert!(matches!(error, RecordError::NotBuilt { feature: "hdf5", .. }), "{error}");
            assert!(!Format::Hdf5.is_built() && error.to_string().contains("--features hdf5"), "{error}");
            assert!(names(&folder).is_empty(), "nothing was begun");
        }
    }
}

/// A run without frames or actions is no dataset.
#[test]
#[cfg_attr(not(feature = "hdf5"), ignore = "needs the feature hdf5")]
fn refusals() {
    let (folder, path) = scratch("run.hdf5");
    let mut world = World::new(1, 1);
    let cfg = RecorderCfg::new(&path).with_topics([Topic::JointStates("arm".into())]);
    let error = world.sim.record(cfg).unwrap_err();
    assert!(matches!(error, RecordError::UnsupportedTopic { .. }) && error.to_string().contains("targets"), "{error}");
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    let error = world.sim.finish_recording(recorder).unwrap_err();
    let RecordError::Aborted { error, partial_file: None, .. } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::NoFrame { .. }), "{error}");
    assert!(names(&folder).is_empty(), "nothing was left");
}

/// Set in child processes only: the file to record to.
const FILE: &str = "KINETOSCOPE_TEST_HDF5_TO";

/// Records with a limited file size, which acts as a full disk.
#[test]
#[ignore = "runs in a process of its own"]
fn scenario_full_disk() {
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
fn full_disk() {
    // The limit is in blocks of 512 bytes. Its signal is ignored, so that writing returns an error.
    let said = |blocks: u64| {
        let (folder, path) = scratch("run.hdf5");
        let child = kinetoscope_testkit::process::command(module_path!(), "scenario_full_disk");
        let output = std::process::Command::new("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f \"$1\"; shift; exec \"$@\"", "sh", &blocks.to_string()])
            .arg(child.get_program())
            .args(child.get_args())
            .env(FILE, path)
            .env("TMPDIR", folder.path())
            .output()
            .unwrap();
        let [text, error] = [&output.stdout, &output.stderr].map(|bytes| kinetoscope_testkit::process::text(bytes));
        assert!(output.status.success(), "{text}{error}");
        (text, names(&folder))
    };
    let (text, left) = said(1 << 20);
    assert_eq!(left, ["run.hdf5"], "{text}");
    let whole = text.split("whole ").nth(1).and_then(|rest| rest.split_whitespace().next()).unwrap();
    let whole: u64 = whole.parse().unwrap();
    // Full while rows and images are buffered, in the file itself, and at its end.
    for blocks in [1, whole / 512 / 4, whole / 512 / 2, whole / 512 - 1] {
        let (text, left) = said(blocks);
        let parts = ["refused", "run.hdf5", "too large"];
        assert!(parts.iter().all(|part| text.contains(part)) && left.is_empty(), "{blocks}: {text}, {left:?}");
    }
}
