use super::*;
use crate::tests::*;
use kinetoscope_sim::{BodyType, RigidObjectCfg, RobotCfg};
use kinetoscope_testkit::worlds::{object, sr5};

const STEPS: usize = 30;

/// A moving arm, an arm with a free base, a falling cube, a kinematic box, and an MJCF part with a ball and a slide
/// joint.
fn busy() -> SimulationManager {
    let mut sim = simulation(2);
    sim.add_robot(sr5("arm")).unwrap();
    let init_pose = Pose::translation(2.0, 0.0, 1.0);
    sim.add_robot(RobotCfg { fix_base: false, init_pose, ..sr5("loose") }).unwrap();
    for (uid, body_type, x) in [("cube", BodyType::Dynamic, 0.0), ("hand", BodyType::Kinematic, 1.0)] {
        let object = object(uid, ObjectShape::cube(0.1), [x, 1.0, 0.8]);
        sim.add_rigid_object(RigidObjectCfg { body_type, ..object }).unwrap();
    }
    let part = r#"<mujoco><worldbody><body name="ball" pos="-1 0 2"><joint name="swing" type="ball"/>
        <geom size="0.1" pos="0.3 0 0"/><body name="tip" pos="0.5 0 0"><joint name="x" type="slide" axis="0 0 1"/>
        <geom size="0.05"/></body></body></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("part", part)).unwrap();
    sim
}

/// Poses of the bodies of the recorded scene, in both environments.
fn poses(sim: &SimulationManager) -> Vec<(String, Array2<f64>)> {
    let mut poses = Vec::new();
    for (uid, robot) in sim.entities().robot_ids() {
        let robot = sim.robot(robot);
        poses.extend(robot.link_names().iter().map(|link| (format!("{uid}/{link}"), robot.link_pose(link).unwrap())));
    }
    for uid in ["cube", "hand"] {
        poses.push((uid.into(), sim.rigid_object(sim.entities().rigid_object_id(uid).unwrap()).pose()));
    }
    let part = sim.mjcf_part(sim.entities().mjcf_id("part").unwrap());
    poses.extend(["ball", "tip"].map(|body| (format!("part/{body}"), part.body_pose(body).unwrap())));
    poses
}

fn recorded(path: &Path, scene: bool) -> Vec<Vec<(String, Array2<f64>)>> {
    let mut sim = busy();
    sim.update(3);
    let recorder = sim.record(RecorderCfg { scene, ..RecorderCfg::new(path) }).unwrap();
    let (arm, hand) = (sim.entities().robot_id("arm").unwrap(), sim.entities().rigid_object_id("hand").unwrap());
    let mut all = Vec::new();
    for step in 0..STEPS {
        let target = |(env, joint)| 0.4 * (0.2 * step as f64 + joint as f64 + env as f64).sin();
        let targets = Array2::from_shape_fn((2, sim.robot(arm).dof()), target);
        sim.robot_mut(arm).set_qpos_target(&targets, None, None).unwrap();
        let row = ndarray::array![[1.0, 1.0 + 0.01 * step as f64, 0.8, 0.6, 0.0, 0.8, 0.0]];
        sim.rigid_object_mut(hand).write_pose(&row, Some(&[EnvId(step % 2)])).unwrap();
        // A write is recorded at the time of the previous step, and is shown at that time.
        all.push(poses(&sim));
        sim.update(1);
    }
    all.push(poses(&sim));
    sim.finish_recording(recorder).unwrap();
    all
}

/// Largest difference of displayed and original positions and quaternions, with the body and the step.
fn largest_difference(
    playback: &mut Playback,
    sim: &mut SimulationManager,
    all: &[Vec<(String, Array2<f64>)>],
) -> (f64, String) {
    let mut largest = (0.0, String::new());
    for (step, expected) in all.iter().enumerate() {
        // The state after a step is the last one recorded at its time. The recording begins at step 3, at 0.03 s.
        let frame = playback.frame_at(0.01 * (step + 3) as f64);
        playback.seek(sim, frame).unwrap();
        let part = sim.mjcf_part(playback.part);
        let mut compared = 0;
        for (name, expected) in expected.iter().filter(|(name, _)| part.body_names().contains(name)) {
            let found = part.body_pose(name).unwrap();
            for (a, b) in found.rows().into_iter().zip(expected.rows()) {
                let place = (0..3).map(|k| (a[k] - b[k]).abs()).fold(0.0, f64::max);
                // A quaternion and its negative are the same rotation.
                let [plus, minus] = [1.0, -1.0].map(|s| (3..7).map(|k| (a[k] - s * b[k]).abs()).fold(0.0, f64::max));
                let off: f64 = place.max(plus.min(minus));
                if off > largest.0 {
                    largest = (off, format!("{name} at step {step}"));
                }
            }
            compared += 1;
        }
        // Seven moving links and the base of the loose arm, six or more of the fixed one, two objects, two bodies.
        assert!(compared >= 17, "{compared}");
    }
    largest
}

/// A recording alone contains the poses of all bodies.
#[test]
fn poses_of_a_recording() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run.npz"] {
        let path = folder.path().join(name);
        let all = recorded(&path, true);
        let (mut playback, mut sim) = Playback::open(&Recording::open(&path).unwrap(), None).unwrap();
        assert_eq!(sim.num_envs(), 2);
        assert!(playback.joints_without_data().is_empty(), "{:?}", playback.joints_without_data());
        assert_eq!(playback.times().len(), STEPS + 1, "{name}: {:?}", playback.times());
        // The same joints and the same engine, with a model that was written with all digits.
        let largest = largest_difference(&mut playback, &mut sim, &all);
        assert!(largest.0 < 1e-9, "{name}: {largest:?}");
        // Seeks forward and backward.
        playback.seek(&mut sim, STEPS).unwrap();
        let end = sim.mjcf_part(playback.part).qpos();
        playback.seek(&mut sim, 0).unwrap();
        assert_ne!(sim.mjcf_part(playback.part).qpos(), end);
        playback.seek(&mut sim, usize::MAX).unwrap();
        assert_eq!(sim.mjcf_part(playback.part).qpos(), end);
        // Control: states of the next step differ.
        assert!(largest_difference(&mut playback, &mut sim, &all[1..]).0 > 1e-4);
    }
}

/// From step 15 on, environment 1 has no finite values, as after a divergence. It stays in its state of step 15,
/// whichever frame was shown before.
#[test]
fn divergence() {
    const LOST: usize = 15;
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run.npz"] {
        let path = folder.path().join(name);
        recorded(&path, true);
        let (mut playback, mut sim) = Playback::open(&Recording::open(&path).unwrap(), None).unwrap();
        let mut at = |playback: &mut Playback, frame: usize| {
            playback.seek(&mut sim, frame).unwrap();
            let part = sim.mjcf_part(playback.part);
            (part.qpos(), part.body_pose("hand").unwrap())
        };
        let (whole, last) = (at(&mut playback, STEPS), at(&mut playback, LOST));
        let lost_at = playback.times[LOST];
        for track in playback.tracks.iter_mut().filter(|track| track.env == 1) {
            let lost = track.samples.times.iter().position(|time| *time > lost_at + 1e-9).unwrap();
            track.samples.values[lost..].fill(f64::NAN);
        }
        for from in [0, 5, LOST, STEPS - 1] {
            at(&mut playback, from);
            let seen = at(&mut playback, STEPS);
            assert_eq!(seen.0.row(1), last.0.row(1), "{name}: from {from}");
            assert_eq!(seen.1.row(1), last.1.row(1), "{name}: from {from}");
            // Control: the other environment continues.
            assert_eq!(seen.0.row(0), whole.0.row(0), "{name}");
            assert_ne!(seen.0.row(0), last.0.row(0), "{name}");
        }
    }
}

#[test]
fn without_a_scene() {
    let (_folder, path) = scratch("run.npz");
    let all = recorded(&path, false);
    let recording = Recording::open(&path).unwrap();
    let error = Playback::open(&recording, None).unwrap_err().to_string();
    assert!(error.contains("does not contain its scene"), "{error}");
    let (mut playback, mut sim) = Playback::open(&recording, Some(&busy())).unwrap();
    let largest = largest_difference(&mut playback, &mut sim, &all);
    assert!(largest.0 < 1e-9, "{largest:?}");
    // A scene without these names.
    let error = Playback::open(&recording, Some(&falling(2))).unwrap_err().to_string();
    assert!(error.contains("no motion of its scene was recorded"), "{error}");
}

/// Joints without recorded values are listed.
#[test]
fn unrecorded_joints() {
    let (_folder, path) = scratch("run.mcap");
    let cfg = RecorderCfg::new(&path).with_topics([Topic::JointStates("arm".into())]);
    record(&mut busy(), cfg, |sim| sim.update(3));
    let (playback, _) = Playback::open(&Recording::open(&path).unwrap(), None).unwrap();
    let unmoved = playback.joints_without_data();
    assert!(unmoved.iter().any(|joint| joint == "cube/free"), "{unmoved:?}");
    assert!(!unmoved.iter().any(|joint| joint.starts_with("arm/")), "{unmoved:?}");
}

#[test]
fn recovered_recording() {
    let (_folder, path) = scratch("run.mcap");
    let mut sim = busy();
    sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(40);
    drop(sim);
    assert!(recover(&path).unwrap().messages > 0);
    let (playback, sim) = Playback::open(&Recording::open(&path).unwrap(), None).unwrap();
    assert!(playback.joints_without_data().is_empty() && sim.num_envs() == 2);
}

#[test]
fn damaged_scenes() {
    let packed = scene_file::pack(&busy()).unwrap().0;
    let path = Path::new("run.mcap");
    assert!(scene_file::unpack(&packed, path).is_ok());
    for end in [0, 10, packed.len() / 2, packed.len() - 1] {
        let error = scene_file::unpack(&packed[..end], path).unwrap_err().to_string();
        assert!(error.contains("damaged"), "{error}");
    }
    // Names that lead out of the folder.
    for name in ["../away.xml", "/away.xml", "a/../../away.xml"] {
        let mut archive = crate::archive::ArchiveWriter::new(std::io::Cursor::new(Vec::new()));
        archive.add(name, b"", &mut &b"x"[..]).unwrap();
        let bytes = archive.finish().unwrap().into_inner();
        let error = scene_file::unpack(&bytes, path).unwrap_err().to_string();
        assert!(error.contains("is not a valid file name"), "{error}");
    }
}
