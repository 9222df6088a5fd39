//! Content of recordings, compared with values that were read from the simulation meanwhile.

use super::*;

const STEPS: u32 = 20;

#[test]
fn messages_of_a_run() {
    let (_folder, path) = scratch("run.mcap");
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    let (mut states, mut imu, mut depths, mut joint_stamps) = (vec![], vec![], vec![], vec![]);
    let read = |world: &World| {
        let robot = world.sim.robot(world.arm);
        let state = [robot.qpos(), robot.qvel(), robot.qf()];
        (world.sim.time()[1], state, robot.qpos_target(), world.sim.rigid_object(world.cube).pose())
    };
    states.push(read(&world));
    for step in 0..STEPS {
        world.step(step);
        states.push(read(&world));
        let joints = world.sim.sensor(world.joints).unwrap();
        joint_stamps.push((nanos(joints.stamps()[1]), nanos(joints.effort_stamps()[1])));
        if (step + 1) % IMU_EVERY == 0 {
            let seen = world.sim.sensor(world.imu).unwrap();
            imu.push((seen.force_stamps()[1], seen.lin_acc_b().row(1).to_vec()));
        }
        if (step + 1) % IMAGE_EVERY == 0 {
            let camera = world.sim.sensor(world.camera).unwrap();
            depths.push((camera.stamps()[1], camera.depth().unwrap().index_axis(Axis(0), 1).to_owned()));
        }
    }
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert_eq!((recorded.packets, recorded.bytes), (u64::from(STEPS) + 1, path.metadata().unwrap().len()));
    let all = messages(&path);

    let (joints, targets) = (messages_on(&all, "/env_1/arm/joint_states"), messages_on(&all, "/env_1/arm/targets"));
    assert_eq!(joints.len(), states.len());
    let transforms = messages_on(&all, "/env_1/tf");
    for (k, (time, state, target, pose)) in states.iter().enumerate() {
        let message = joints[k];
        assert_eq!((message.time, message.schema.as_str()), (nanos(*time), "sensor_msgs/msg/JointState"));
        for values in state {
            assert!(message.contains(&bytes(values.row(1))), "{message:?}");
        }
        // Control: the message lacks the positions of another environment.
        assert!(*time == 0.0 || !message.contains(&bytes(state[0].row(0))));
        assert!(targets[k].contains(&bytes(target.row(1))));
        let position = bytes(pose.row(1).iter().take(3));
        let found = transforms.iter().filter(|m| m.time == nanos(*time) && m.contains(&position));
        assert!(found.count() >= 1, "no transform has the cube at {time} s");
    }
    let accelerations = messages_on(&all, "/env_1/imu");
    assert_eq!(accelerations.len(), imu.len());
    for (message, (time, acceleration)) in accelerations.iter().zip(&imu) {
        assert!(message.time == nanos(*time) && message.contains(&bytes(acceleration)), "{message:?}");
    }
    let images = messages_on(&all, "/env_1/camera/depth");
    assert_eq!(images.len(), depths.len());
    for (message, (time, depth)) in images.iter().zip(&depths) {
        assert_eq!((message.time, message.schema.as_str()), (nanos(*time), "sensor_msgs/msg/Image"));
        let pixels: Vec<u8> = depth.iter().flat_map(|x| x.to_le_bytes()).collect();
        assert!(message.data.ends_with(&pixels));
    }
    for topic in ["color", "mask", "camera_info"] {
        assert_eq!(messages_on(&all, &format!("/env_0/camera/{topic}")).len(), depths.len(), "{topic}");
    }
    let times = |topic: &str| messages_on(&all, topic).iter().map(|message| message.time).collect::<Vec<_>>();
    let (positions, efforts): (Vec<_>, Vec<_>) = joint_stamps.into_iter().unzip();
    // Efforts are those of the beginning of the step.
    assert!(positions.iter().zip(&efforts).all(|(position, effort)| effort < position));
    assert_eq!((times("/env_1/joints/positions"), times("/env_1/joints/efforts")), (positions, efforts));
}

#[test]
fn thread_counts() {
    let [one, three] = [1, 3].map(|threads| {
        let (_folder, path) = scratch("run.mcap");
        let mut world = World::new(3, threads);
        let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
        for step in 0..STEPS {
            world.step(step);
            if step == 7 {
                world.sim.reset(Some(&[EnvId(2)])).unwrap();
            }
        }
        world.sim.finish_recording(recorder).unwrap();
        messages(&path)
    });
    assert!(one.len() > 300, "{}", one.len());
    assert_eq!(one, three);
}

/// A recorder changes no number of the simulation.
#[test]
fn no_side_effect() {
    let (_folder, path) = scratch("run.npz");
    let [recorded, alone] = [true, false].map(|recorded| {
        let mut world = World::new(2, 2);
        let cfg = RecorderCfg { period_steps: 3, ..RecorderCfg::new(&path) };
        if recorded {
            // Steps 0, 3, 6... for states, every step for the sensor of joints.
            assert_eq!(record_steps(&mut world, cfg, STEPS).packets, u64::from(STEPS) + 1);
        } else {
            (0..STEPS).for_each(|step| world.step(step));
        }
        let robot = world.sim.robot(world.arm);
        let physics = (robot.qpos(), robot.qvel(), world.sim.rigid_object(world.cube).pose());
        let (imu, joints) = (world.sim.sensor(world.imu).unwrap(), world.sim.sensor(world.joints).unwrap());
        let numbers = (imu.lin_acc_b().to_owned(), imu.sample_counts().to_owned(), joints.efforts().to_owned());
        let camera = world.sim.sensor(world.camera).unwrap();
        let images = (camera.color().unwrap().to_owned(), camera.depth().unwrap().to_owned());
        (physics, numbers, images)
    });
    assert_eq!(recorded, alone);
}

/// Recorded time continues over a reset. The state after the reset has a message of its own in its environment.
#[test]
fn reset() {
    let at_each: &[u64] = &[0, 1, 2, 3, 4, 5, 6, 6, 7, 8, 9, 10];
    for (period_steps, undisturbed, reset) in
        [(1, &(0..=10).collect::<Vec<_>>()[..], at_each), (10, &[0, 10], &[0, 6, 10])]
    {
        let (_folder, path) = scratch("run.mcap");
        let mut world = World::new(2, 2);
        let cfg =
            RecorderCfg { period_steps, ..RecorderCfg::new(&path).with_topics([Topic::JointStates("arm".into())]) };
        let recorder = world.sim.record(cfg).unwrap();
        (0..6).for_each(|step| world.step(step));
        world.sim.reset(Some(&[EnvId(1)])).unwrap();
        (6..10).for_each(|step| world.step(step));
        world.sim.finish_recording(recorder).unwrap();
        let all = messages(&path);
        let steps = |env: usize| steps_of(&all, &format!("/env_{env}/arm/joint_states"));
        assert_eq!((&steps(0)[..], &steps(1)[..]), (undisturbed, reset));
        let events = logs(&path);
        assert!(events.iter().any(|event| event.contains("env_1") && event.contains("reset at step 6")), "{events:?}");
        assert!(!events.iter().any(|event| event.contains("env_0") && event.contains("reset")), "{events:?}");
    }
}

/// A configuration selects topics, environments and rates.
#[test]
fn choice() {
    let (_folder, path) = scratch("run.mcap");
    let mut world = World::new(3, 1);
    world.sim.update(3);
    let start = nanos(world.sim.time()[2]);
    let topics = vec![Topic::Targets("arm".into()), Topic::channel("camera", "rgb")];
    record_steps(
        &mut world,
        RecorderCfg { envs: Some(vec![EnvId(2)]), period_steps: 4, topics, ..RecorderCfg::new(&path) },
        STEPS,
    );
    let all = messages(&path);
    let mut counts = std::collections::BTreeMap::new();
    all.iter().for_each(|message| *counts.entry(message.topic.as_str()).or_insert(0) += 1);
    assert_eq!(messages_on(&all, "/tf_static")[0].time, start, "known from the beginning, and no earlier");
    // Every fourth step from 0 to 20; the environment has no events.
    let expected = [("/env_2/arm/targets", 6), ("/env_2/camera/color", 4), ("/env_2/scene", 1), ("/tf_static", 1)];
    assert_eq!(counts.into_iter().collect::<Vec<_>>(), expected);
}
