//! What is in recordings, held against what was read from the simulation meanwhile.

use ndarray::Axis;
use super::*;
use sensors::Sampled;

const STEPS: u32 = 20;

fn nanos(seconds: f64) -> u64 {
    (seconds * 1e9).round() as u64
}

#[test]
fn messages_say_what_the_simulation_says_when_it_says_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    let (mut states, mut targets, mut poses, mut imu, mut depths) = (vec![], vec![], vec![], vec![], vec![]);
    let mut joint_stamps = vec![];
    let read = |world: &World, states: &mut Vec<_>, targets: &mut Vec<_>, poses: &mut Vec<_>| {
        let robot = world.sim.robot(world.arm);
        states.push((world.sim.time()[1], robot.get_qpos(), robot.get_qvel(), robot.get_qf()));
        targets.push(robot.get_target_qpos());
        poses.push(world.sim.rigid_object(world.cube).get_pose());
    };
    read(&world, &mut states, &mut targets, &mut poses);
    for step in 0..STEPS {
        world.step(step);
        read(&world, &mut states, &mut targets, &mut poses);
        let joints = world.sim.sensor(world.joints).unwrap();
        joint_stamps.push((nanos(joints.stamps()[1]), nanos(joints.effort_stamps()[1])));
        if (step + 1) % IMU_EVERY == 0 {
            let seen = world.sim.sensor(world.imu).unwrap();
            imu.push((seen.force_stamps()[1], seen.lin_acc_b().row(1).to_vec()));
        }
        if (step + 1) % PICTURE_EVERY == 0 {
            let camera = world.sim.sensor(world.camera).unwrap();
            depths.push((camera.stamps()[1], camera.depth().unwrap().index_axis(Axis(0), 1).to_owned()));
        }
    }
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert_eq!((recorded.packets, recorded.bytes), (u64::from(STEPS) + 1, path.metadata().unwrap().len()));
    let all = messages(&path);

    let joints = of(&all, "/env_1/arm/joint_states");
    assert_eq!(joints.len(), states.len());
    for (message, (time, qpos, qvel, qf)) in joints.iter().zip(&states) {
        assert_eq!((message.time, message.schema.as_str()), (nanos(*time), "sensor_msgs/msg/JointState"));
        for values in [qpos, qvel, qf] {
            assert!(contains(&message.data, &bytes(values.row(1))), "{message:?}");
        }
        // The control: what another environment does is not in it.
        assert!(*time == 0.0 || !contains(&message.data, &bytes(qpos.row(0))));
    }
    for (message, target) in of(&all, "/env_1/arm/targets").iter().zip(&targets) {
        assert!(contains(&message.data, &bytes(target.row(1))));
    }
    let transforms = of(&all, "/env_1/tf");
    for (time, pose) in states.iter().map(|state| state.0).zip(&poses) {
        let position = bytes(pose.row(1).iter().take(3));
        let found = transforms.iter().filter(|m| m.time == nanos(time) && contains(&m.data, &position));
        assert!(found.count() >= 1, "no transform has the cube at {time} s");
    }
    let accelerations = of(&all, "/env_1/imu");
    assert_eq!(accelerations.len(), imu.len());
    for (message, (time, acceleration)) in accelerations.iter().zip(&imu) {
        assert_eq!(message.time, nanos(*time));
        assert!(contains(&message.data, &bytes(acceleration)));
    }
    let pictures = of(&all, "/env_1/camera/depth");
    assert_eq!(pictures.len(), depths.len());
    for (message, (time, depth)) in pictures.iter().zip(&depths) {
        assert_eq!((message.time, message.schema.as_str()), (nanos(*time), "sensor_msgs/msg/Image"));
        let pixels: Vec<u8> = depth.iter().flat_map(|x| x.to_le_bytes()).collect();
        assert!(message.data.ends_with(&pixels));
    }
    for (topic, count) in [("color", depths.len()), ("mask", depths.len()), ("camera_info", depths.len())] {
        assert_eq!(of(&all, &format!("/env_0/camera/{topic}")).len(), count, "{topic}");
    }
    let times = |topic: &str| of(&all, topic).iter().map(|message| message.time).collect::<Vec<_>>();
    let (positions, efforts): (Vec<_>, Vec<_>) = joint_stamps.into_iter().unzip();
    // Efforts are those of the beginning of the step.
    assert!(positions.iter().zip(&efforts).all(|(position, effort)| effort < position));
    assert_eq!((times("/env_1/joints/positions"), times("/env_1/joints/efforts")), (positions, efforts));
}

fn run(threads: usize, path: &std::path::Path) -> Vec<Message> {
    let mut world = World::new(3, threads);
    let recorder = world.sim.record(RecorderCfg::new(path)).unwrap();
    for step in 0..STEPS {
        world.step(step);
        if step == 7 {
            world.sim.reset(Some(&[EnvId(2)])).unwrap();
        }
    }
    world.sim.finish_recording(recorder).unwrap();
    messages(path)
}

#[test]
fn messages_are_the_same_for_any_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let [one, three] = [1, 3].map(|threads| run(threads, &folder.path().join(format!("{threads}.mcap"))));
    assert!(one.len() > 300, "{}", one.len());
    assert_eq!(one, three);
}

#[test]
fn a_recorder_changes_no_number() {
    let folder = tempfile::tempdir().unwrap();
    let [recorded, alone] = [true, false].map(|recorded| {
        let mut world = World::new(2, 2);
        let cfg = RecorderCfg { every: 3, ..RecorderCfg::new(folder.path().join("run.npz")) };
        let recorder = recorded.then(|| world.sim.record(cfg).unwrap());
        (0..STEPS).for_each(|step| world.step(step));
        if let Some(recorder) = recorder {
            let recorded = world.sim.finish_recording(recorder).unwrap();
            // Steps 0, 3, 6... for states, every step for the sensor of joints.
            assert_eq!(recorded.packets, u64::from(STEPS) + 1);
        }
        let robot = world.sim.robot(world.arm);
        let physics = (robot.get_qpos(), robot.get_qvel(), world.sim.rigid_object(world.cube).get_pose());
        let (imu, joints) = (world.sim.sensor(world.imu).unwrap(), world.sim.sensor(world.joints).unwrap());
        let numbers = (imu.lin_acc_b().to_owned(), imu.sample_counts().to_owned(), joints.efforts().to_owned());
        let camera = world.sim.sensor(world.camera).unwrap();
        let pictures = (camera.color().unwrap().to_owned(), camera.depth().unwrap().to_owned());
        (physics, numbers, pictures)
    });
    assert_eq!(recorded, alone);
}

#[test]
fn time_goes_on_over_a_reset_and_the_reset_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut world = World::new(2, 2);
    let dt = world.sim.cfg().physics_dt;
    let cfg = RecorderCfg::new(&path).with_topics([Topic::JointStates("arm".into())]);
    let recorder = world.sim.record(cfg).unwrap();
    (0..6).for_each(|step| world.step(step));
    world.sim.reset(Some(&[EnvId(1)])).unwrap();
    (6..10).for_each(|step| world.step(step));
    world.sim.finish_recording(recorder).unwrap();
    let all = messages(&path);
    let steps = |env: usize| {
        let of_env = of(&all, &format!("/env_{env}/arm/joint_states"));
        of_env.iter().map(|message| (message.time as f64 / 1e9 / dt).round() as u64).collect::<Vec<_>>()
    };
    assert_eq!(steps(0), (0..=10).collect::<Vec<_>>());
    // The state after the reset has a message of its own.
    assert_eq!(steps(1), [0, 1, 2, 3, 4, 5, 6, 6, 7, 8, 9, 10]);
    let events: Vec<String> =
        of(&all, "/events").iter().map(|message| String::from_utf8_lossy(&message.data).into_owned()).collect();
    assert!(events.iter().any(|event| event.contains("env_1") && event.contains("reset at step 6")), "{events:?}");
    assert!(!events.iter().any(|event| event.contains("env_0") && event.contains("reset")), "{events:?}");
}

#[test]
fn topics_environments_and_rates_are_chosen() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let mut world = World::new(3, 1);
    world.sim.update(3);
    let start = nanos(world.sim.time()[2]);
    let cfg = RecorderCfg {
        envs: Some(vec![EnvId(2)]),
        every: 4,
        topics: vec![Topic::Targets("arm".into()), Topic::channel("camera", "rgb")],
        ..RecorderCfg::new(&path)
    };
    let recorder = world.sim.record(cfg).unwrap();
    (0..STEPS).for_each(|step| world.step(step));
    world.sim.finish_recording(recorder).unwrap();
    let all = messages(&path);
    let mut counts = std::collections::BTreeMap::new();
    all.iter().for_each(|message| *counts.entry(message.topic.as_str()).or_insert(0) += 1);
    assert_eq!(of(&all, "/tf_static")[0].time, start, "known from the beginning, and no earlier");
    // Every fourth step from 0 to 20; nothing happened to the environment.
    let expected = [("/env_2/arm/targets", 6), ("/env_2/camera/color", 4), ("/env_2/scene", 1), ("/tf_static", 1)];
    assert_eq!(counts.into_iter().collect::<Vec<_>>(), expected);
}
