//! Independent readers: NumPy, the `mcap` package with its ROS 2 decoder, Pillow, PyAV with FFmpeg.

use super::*;
use kinetoscope_render::lens::Lens;
use kinetoscope_render::lens::{OpenCvFisheye, Panorama};

const STEPS: u32 = 4 * IMAGE_EVERY;

/// Intrinsic matrix of a camera in environment 1 for ROS, which measures pixel coordinates from the center of the first
/// pixel.
fn ros_matrix(camera: &Camera) -> Vec<f64> {
    let mut matrix = camera.intrinsic_matrices().index_axis(Axis(0), 1).to_owned();
    matrix[(0, 2)] -= 0.5;
    matrix[(1, 2)] -= 0.5;
    matrix.into_iter().collect()
}

/// Records, and returns the expected last row. ROS messages have ROS's matrix, arrays that of the camera.
fn recorded(path: &Path, finish: bool) -> Value {
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(RecorderCfg::new(path)).unwrap();
    (0..STEPS).for_each(|step| world.step(step));
    let robot = world.sim.robot(world.arm);
    let camera = world.sim.sensor(world.camera).unwrap();
    let imu = world.sim.sensor(world.imu).unwrap();
    let depth = camera.depth().unwrap().index_axis(Axis(0), 1).to_owned();
    let color = camera.color().unwrap().index_axis(Axis(0), 1).to_owned();
    let mask = camera.mask().unwrap().index_axis(Axis(0), 1).to_owned();
    let finite = depth.iter().copied().filter(|x| x.is_finite());
    let range = [finite.clone().fold(f32::INFINITY, f32::min), finite.clone().fold(0.0, f32::max)].map(f64::from);
    let intrinsics = match path.extension().is_some_and(|end| end == "mcap") {
        true => ros_matrix(camera),
        false => camera.intrinsic_matrices().index_axis(Axis(0), 1).iter().copied().collect(),
    };
    let expected = json!({
        "names": robot.joint_names(),
        "position": robot.qpos().row(1).to_vec(),
        "velocity": robot.qvel().row(1).to_vec(),
        "effort": robot.qf().row(1).to_vec(),
        "target": robot.qpos_target().row(1).to_vec(),
        "tip": robot.link_poses().index_axis(Axis(0), 1).outer_iter().last().unwrap().to_vec(),
        "tip_name": format!("env_1/arm/{}", robot.link_names().last().unwrap()),
        "cube": world.sim.rigid_object(world.cube).pose().row(1).to_vec(),
        "acceleration": imu.lin_acc_b().row(1).to_vec(),
        "orientation": imu.quat_w().row(1).to_vec(),
        "intrinsics": intrinsics,
        "camera": camera.pose_w(CameraConvention::Ros).row(1).to_vec(),
        "nanoseconds": nanos(world.sim.time()[1]),
        "depth_shape": depth.shape(),
        "depth_finite": finite.count(),
        "depth_range": range,
        "mask_sum": weighted_sum(&mask, |x| u64::try_from(*x).unwrap()),
        "color_sum": weighted_sum(rgb(&color), u64::from),
        "rows": STEPS + 1,
        "pictures": STEPS / IMAGE_EVERY,
    });
    if finish {
        world.sim.finish_recording(recorder).unwrap();
    }
    bits(expected)
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn files() {
    for (name, script) in [("run.mcap", "read_mcap.py"), ("run.npz", "read_npz.py")] {
        let (_folder, path) = scratch(name);
        let expected = recorded(&path, true);
        assert_eq!(script_output(script, &path), expected, "{name}");
    }
}

/// Recovery of an unfinished recording gives a complete file, with its index and the same messages.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn recovered_file() {
    let (folder, path) = scratch("run.mcap");
    let out = folder.path().join("saved.mcap");
    let expected = recorded(&path, false);
    assert!(!path.exists());
    let recovered = recover_to(&path, &out).unwrap();
    assert!(recovered.damage.is_none() && recovered.messages > 0, "{recovered:?}");
    assert_eq!(script_output("read_mcap.py", &out), expected);
    // The partial file is deleted, and there is nothing left to recover.
    let again = recover_to(&path, folder.path().join("other.mcap")).unwrap_err();
    assert!(again.to_string().contains("run.mcap.part"), "{again}");
}

/// Expected messages of points, forces and normals: a standing cube, rays from above, cameras.
fn sensed(path: &Path) -> Value {
    let mut sim = simulation(2);
    sim.add_rigid_object(kinetoscope_testkit::worlds::cube("cube", 0.4, 2.0, [0.1, 0.05, 0.2])).unwrap();
    let touch = sim.add_sensor("touch", ContactSensorCfg::for_bodies("cube")).unwrap();
    let pattern = Grid { resolution: 0.2, size: [0.6, 0.4], ..Grid::default() };
    let offset = Pose::translation(0.03, 0.0, 2.0);
    // Some rays end before the ground. These misses are no points.
    let scanner = RayCasterCfg { offset, max_distance: 1.8, pattern: pattern.into(), ..RayCasterCfg::default() };
    let scanner = sim.add_sensor("scanner", scanner).unwrap();
    let eye = CameraCfg {
        width: 24,
        height: 16,
        intrinsics: Intrinsics::Fovy { radians: 0.8 },
        extrinsics: look_at([1.5, 0.9, 1.4], [0.1, 0.0, 0.2]),
        channels: Channels { normal: true, albedo: true, flow: true, ..Channels::NONE },
        ..CameraCfg::default()
    };
    let camera = CameraCfg { channels: Channels { depth: true, color: true, ..Channels::NONE }, ..eye.clone() };
    let pair = StereoCameraCfg { camera, left_to_right_pos: [0.06, 0.0, 0.0], ..Default::default() };
    let pair = sim.add_sensor("pair", pair).unwrap();
    let imu = sim.add_sensor("imu", ImuCfg::on("cube")).unwrap();
    let eye = sim.add_sensor("eye", eye).unwrap();
    // A lens with a distortion model of ROS, and a lens without one.
    let bent = OpenCvFisheye { k1: 0.02, k2: -0.003, k3: 0.0005, k4: -0.0001, max_angle: None };
    let lenses: [(&str, Lens); 2] = [("fish", bent.into()), ("round", Panorama {}.into())];
    let [fish, _] = lenses.map(|(uid, lens)| {
        let (renderer, channels) = (Renderer::FastRayTraced, Channels { depth: true, ..Channels::NONE });
        let cfg = CameraCfg { width: 16, height: 8, lens, renderer, channels, ..CameraCfg::default() };
        sim.add_sensor(uid, cfg).unwrap()
    });
    let recorder = sim.record(RecorderCfg::new(path)).unwrap();
    sim.update(100);
    let scanner = sim.sensor(scanner).unwrap();
    let (ids, distances) = (scanner.hit_ids().row(1).to_owned(), scanner.distances().row(1).to_owned());
    let hits: Vec<usize> = (0..ids.len()).filter(|k| distances[*k].is_finite()).collect();
    assert!(hits.len() > 1 && hits.len() < scanner.num_rays(), "hits and misses: {distances}");
    let of_hits = |vectors: ndarray::ArrayView2<'_, f64>| -> Vec<f64> {
        hits.iter().flat_map(|k| vectors.row(*k).to_vec()).map(|x| f64::from(x as f32)).collect()
    };
    let points = of_hits(scanner.hits().index_axis(Axis(0), 1));
    let forces: Vec<f64> = sim.sensor(touch).unwrap().net_forces_w().index_axis(Axis(0), 1).iter().copied().collect();
    // The contact force equals the weight, up to the remaining motion.
    assert!((forces[2] - 2.0 * 9.81).abs() < 0.01, "{forces:?}");
    let (eye, pair) = (sim.sensor(eye).unwrap(), sim.sensor(pair).unwrap());
    let normal = eye.normal().unwrap().index_axis(Axis(0), 1).to_owned();
    let flow = eye.flow().unwrap().index_axis(Axis(0), 1).to_owned();
    let albedo = eye.albedo().unwrap().index_axis(Axis(0), 1).to_owned();
    assert!(flow.iter().any(|x| *x == 0.0) && albedo.iter().any(|x| ![0, 255].contains(x)), "{flow} {albedo}");
    let disparity = pair.disparity().unwrap().index_axis(Axis(0), 1).to_owned();
    assert!(disparity.iter().any(|x| *x > 0.5), "{disparity}");
    let right = pair.right().color().unwrap().index_axis(Axis(0), 1).to_owned();
    let imu = sim.sensor(imu).unwrap();
    let moves = [imu.lin_vel_b(), imu.ang_vel_b(), imu.lin_acc_b(), imu.ang_acc_b()];
    // ROS's P of the right camera projects points of the left camera's frame, 6 cm beside it, into the right image.
    let projections = [0.0, 0.06].map(|baseline| {
        let k = pair.left().intrinsic_matrices();
        let [fx, cx, fy, cy] = [k[(1, 0, 0)], k[(1, 0, 2)] - 0.5, k[(1, 1, 1)], k[(1, 1, 2)] - 0.5];
        [fx, 0.0, cx, 0.0 - fx * baseline, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0].map(|x| (x * 1e9).round() / 1e9)
    });
    let names: std::collections::BTreeMap<String, String> =
        sim.scene().mask_ids().iter().map(|id| (id.id.to_string(), id.name())).collect();
    assert!(names.values().any(|name| name == "cube"), "{names:?}");
    let upward = normal.rows().into_iter().filter(|n| n.to_vec() == [0.0, 0.0, 1.0]).count();
    assert!(upward > 0 && upward < 24 * 16, "{upward}");
    let of_f32 = |x: &f32| u64::from(x.to_bits());
    let expected = json!({
        "points": points,
        "point_time": nanos(sim.time()[1]),
        "forces": forces,
        "normal_shape": normal.shape(),
        "normal_sum": weighted_sum(&normal, of_f32),
        "upward": upward,
        "attached": ["recording.json", "scene.zip", "start.snapshot"],
        "flow_sum": weighted_sum(&flow, of_f32),
        "albedo_sum": weighted_sum(rgb(&albedo), u64::from),
        "disparity_sum": weighted_sum(&disparity, of_f32),
        "right_sum": weighted_sum(rgb(&right), u64::from),
        "moves": moves.iter().flat_map(|table| table.row(1).to_vec()).collect::<Vec<_>>(),
        "distances": distances.iter().map(|x| x.to_bits().to_string()).collect::<Vec<_>>(),
        "hit_ids": hits.iter().map(|k| ids[*k]).collect::<Vec<i32>>(),
        "hit_normals": of_hits(scanner.normals().index_axis(Axis(0), 1)),
        "scanner": ([scanner.pos_w().row(1).to_vec(), scanner.quat_w().row(1).to_vec()].concat()),
        "mask_ids": names,
        "bodies": "cube",
        "fish": ["equidistant", [0.02, -0.003, 0.0005, -0.0001], ros_matrix(sim.sensor(fish).unwrap())],
        "infos": (["eye", "fish", "pair/left", "pair/right"].map(|camera| format!("/env_1/{camera}/camera_info"))),
        "projections": projections,
        "round": true,
    });
    let left_out = sim.finish_recording(recorder).unwrap().left_out;
    assert!(left_out.iter().any(|what| what.starts_with("round/camera_info")), "{left_out:?}");
    bits(expected)
}

/// Points, forces, normals and calibrations.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn sensors() {
    let (_folder, path) = scratch("run.mcap");
    let expected = sensed(&path);
    assert_eq!(script_output("read_sensors.py", &path), expected);
}
