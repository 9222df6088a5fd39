//! Readers that nobody here wrote: NumPy, the `mcap` package with its decoder of ROS 2 messages, Pillow, PyAV with FFmpeg.

use ndarray::Axis;
use super::*;
use sensors::camera::Lens;
use sensors::camera::lens::{OpenCvFisheye, Panorama};
use sensors::ray::pattern::Grid;
use std::path::Path;
pub(crate) use testkit::needs::{python_readers as python, read_json};

const STEPS: u32 = 4 * PICTURE_EVERY;

/// The JSON that a script of this folder prints about a file.
pub(crate) fn said(python: &Path, script: &str, file: &Path) -> serde_json::Value {
    read_json(python, &Path::new(env!("CARGO_MANIFEST_DIR")).join("src/tests").join(script), file)
}

/// Numbers with a fraction as texts of their bits, as the scripts give them: nothing is lost between the programs.
pub(crate) fn bits(value: serde_json::Value) -> serde_json::Value {
    use serde_json::Value;
    match value {
        Value::Number(number) if number.is_f64() => number.as_f64().unwrap().to_bits().to_string().into(),
        Value::Array(values) => values.into_iter().map(bits).collect(),
        Value::Object(values) => values.into_iter().map(|(name, value)| (name, bits(value))).collect(),
        other => other,
    }
}

/// The matrix of a camera in environment `env` for ROS, which counts pixels from the centre of the first one.
fn ros_matrix(camera: &Camera, env: usize) -> Vec<f64> {
    let mut matrix = camera.intrinsic_matrices().index_axis(Axis(0), env).to_owned();
    matrix[(0, 2)] -= 0.5;
    matrix[(1, 2)] -= 0.5;
    matrix.into_iter().collect()
}

/// Records, and gives what the last row should be; what is not finished is left as by a process that was killed. Messages of
/// ROS have the matrix of ROS, arrays that of the camera.
fn recorded(path: &Path, finish: bool) -> serde_json::Value {
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(RecorderCfg::new(path)).unwrap();
    (0..STEPS).for_each(|step| world.step(step));
    let robot = world.sim.robot(world.arm);
    let camera = world.sim.sensor(world.camera).unwrap();
    let depth = camera.depth().unwrap().index_axis(Axis(0), 1).to_owned();
    let color = camera.color().unwrap().index_axis(Axis(0), 1).to_owned();
    let mask = camera.mask().unwrap().index_axis(Axis(0), 1).to_owned();
    let finite = depth.iter().copied().filter(|x| x.is_finite());
    let range = [finite.clone().fold(f32::INFINITY, f32::min), finite.fold(0.0, f32::max)].map(f64::from);
    let intrinsics = match path.extension() {
        Some(mcap) if mcap == "mcap" => ros_matrix(camera, 1),
        _ => camera.intrinsic_matrices().index_axis(Axis(0), 1).iter().copied().collect(),
    };
    let expected = serde_json::json!({
        "names": robot.joint_names(),
        "position": robot.get_qpos().row(1).to_vec(),
        "velocity": robot.get_qvel().row(1).to_vec(),
        "effort": robot.get_qf().row(1).to_vec(),
        "target": robot.get_target_qpos().row(1).to_vec(),
        "tip": robot.get_link_poses().index_axis(Axis(0), 1).outer_iter().last().unwrap().to_vec(),
        "tip_name": format!("env_1/arm/{}", robot.link_names().last().unwrap()),
        "cube": world.sim.rigid_object(world.cube).get_pose().row(1).to_vec(),
        "acceleration": world.sim.sensor(world.imu).unwrap().lin_acc_b().row(1).to_vec(),
        "orientation": world.sim.sensor(world.imu).unwrap().quat_w().row(1).to_vec(),
        "intrinsics": intrinsics,
        "camera": camera.pose_w(CameraConvention::Ros).row(1).to_vec(),
        "nanoseconds": (world.sim.time()[1] * 1e9).round() as u64,
        "depth_shape": depth.shape(),
        "depth_finite": depth.iter().filter(|x| x.is_finite()).count(),
        "depth_range": range,
        "mask_sum": mask.iter().zip(1..).map(|(x, k)| i64::from(*x) * k).sum::<i64>(),
        // Without the opacity; each number by its place, so that none may stand for another.
        "color_sum": color.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]]).zip(1..).map(|(x, k)| u64::from(x) * k).sum::<u64>(),
        "rows": STEPS + 1,
        "pictures": STEPS / PICTURE_EVERY,
    });
    if finish {
        world.sim.finish_recording(recorder).unwrap();
    }
    bits(expected)
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn the_mcap_package_reads_every_message() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let expected = recorded(&path, true);
    assert_eq!(said(&python, "read_mcap.py", &path), expected);
}

/// Recovery of an unfinished recording gives a whole file, with its index and the same messages.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn the_mcap_package_reads_what_was_recovered() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let [path, out] = ["run.mcap", "saved.mcap"].map(|name| folder.path().join(name));
    let expected = recorded(&path, false);
    assert!(!path.exists());
    let recovered = recover_to(&path, &out).unwrap();
    assert!(recovered.damage.is_none() && recovered.messages > 0, "{recovered:?}");
    assert_eq!(said(&python, "read_mcap.py", &out), expected);
    // What was left is gone now, and there is nothing to recover any more.
    let again = recover_to(&path, folder.path().join("other.mcap")).unwrap_err();
    assert!(again.to_string().contains("run.mcap.part"), "{again}");
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn numpy_reads_every_array() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    let expected = recorded(&path, true);
    assert_eq!(said(&python, "read_npz.py", &path), expected);
}

/// A cube that stands, rays from above, a camera: what messages of points, forces and normals should hold.
fn sensed(path: &Path) -> serde_json::Value {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let cube = RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.4),
        mass: Some(2.0),
        init_pose: Pose::translation(0.1, 0.05, 0.2),
        ..Default::default()
    };
    sim.add_rigid_object(cube).unwrap();
    let touch = sim.add_sensor("touch", ContactSensorCfg::of("cube")).unwrap();
    let pattern = Grid { resolution: 0.2, size: [0.6, 0.4], ..Grid::default() };
    let offset = Pose::translation(0.03, 0.0, 2.0);
    // Some rays end before the ground: misses, which are no points.
    let scanner = RayCasterCfg { offset, max_distance: 1.8, pattern: pattern.into(), ..RayCasterCfg::default() };
    let scanner = sim.add_sensor("scanner", scanner).unwrap();
    let placement = Placement::LookAt { eye: [1.5, 0.9, 1.4], target: [0.1, 0.0, 0.2], up: [0.0, 0.0, 1.0] };
    let eye = CameraCfg {
        width: 24,
        height: 16,
        intrinsics: Intrinsics::Fovy { radians: 0.8 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { normal: true, albedo: true, flow: true, ..Channels::NONE },
        ..CameraCfg::default()
    };
    let camera = CameraCfg { channels: Channels { depth: true, color: true, ..Channels::NONE }, ..eye.clone() };
    let pair = StereoCameraCfg { camera, left_to_right_pos: [0.06, 0.0, 0.0], ..Default::default() };
    let pair = sim.add_sensor("pair", pair).unwrap();
    let imu = sim.add_sensor("imu", ImuCfg::on("cube")).unwrap();
    let eye = sim.add_sensor("eye", eye).unwrap();
    // Lenses: one that ROS has words for, and one that it has none for.
    let bent = OpenCvFisheye { k1: 0.02, k2: -0.003, k3: 0.0005, k4: -0.0001, max_angle: None };
    let lenses: [(&str, Lens); 2] = [("fish", bent.into()), ("round", Panorama {}.into())];
    let [fish, _] = lenses.map(|(uid, lens)| {
        let (renderer, channels) = (Renderer::FastRayTraced, Channels { depth: true, ..Channels::NONE });
        let cfg = CameraCfg { width: 16, height: 8, lens, renderer, channels, ..CameraCfg::default() };
        sim.add_sensor(uid, cfg).unwrap()
    });
    let recorder = sim.record(RecorderCfg::new(path)).unwrap();
    sim.update(100);
    let fish = sim.sensor(fish).unwrap();
    let matrix = ros_matrix(fish, 1);
    let scanner = sim.sensor(scanner).unwrap();
    let hits = scanner.hits().index_axis(Axis(0), 1).to_owned();
    let points = hits.rows().into_iter().filter(|p| p.iter().all(|x| x.is_finite()));
    let points: Vec<f64> = points.flat_map(|p| p.to_vec()).map(|x| f64::from(x as f32)).collect();
    assert!(points.len() > 3 && points.len() < 3 * scanner.num_rays(), "hits and misses: {points:?}");
    let forces: Vec<f64> = sim.sensor(touch).unwrap().net_forces_w().index_axis(Axis(0), 1).iter().copied().collect();
    // It stands: what holds it is its weight, to what is left of its settling.
    assert!((forces[2] - 2.0 * 9.81).abs() < 0.01, "{forces:?}");
    let normal = sim.sensor(eye).unwrap().normal().unwrap().index_axis(Axis(0), 1).to_owned();
    let weighed = |numbers: &mut dyn Iterator<Item = u64>| numbers.zip(1..).map(|(x, k)| x * k).sum::<u64>();
    let flow = sim.sensor(eye).unwrap().flow().unwrap().index_axis(Axis(0), 1).to_owned();
    let albedo = sim.sensor(eye).unwrap().albedo().unwrap().index_axis(Axis(0), 1).to_owned();
    assert!(flow.iter().any(|x| *x == 0.0) && albedo.iter().any(|x| ![0, 255].contains(x)), "{flow} {albedo}");
    let disparity = sim.sensor(pair).unwrap().disparity().unwrap().index_axis(Axis(0), 1).to_owned();
    assert!(disparity.iter().any(|x| *x > 0.5), "{disparity}");
    let right = sim.sensor(pair).unwrap().right().color().unwrap().index_axis(Axis(0), 1).to_owned();
    let imu = sim.sensor(imu).unwrap();
    let moves = [imu.lin_vel_b(), imu.ang_vel_b(), imu.lin_acc_b(), imu.ang_acc_b()];
    let moves: Vec<f64> = moves.iter().flat_map(|table| table.row(1).to_vec()).collect();
    let (ids, distances) = (scanner.hit_ids().row(1).to_owned(), scanner.distances().row(1).to_owned());
    let of_hits = |k: usize| distances[k].is_finite();
    let hit_ids: Vec<i32> = (0..ids.len()).filter(|k| of_hits(*k)).map(|k| ids[k]).collect();
    let hit_normals: Vec<f64> = (0..ids.len())
        .filter(|k| of_hits(*k))
        .flat_map(|k| scanner.normals().index_axis(Axis(0), 1).row(k).to_vec())
        .map(|x| f64::from(x as f32))
        .collect();
    let infos = ["eye", "fish", "pair/left", "pair/right"].map(|camera| format!("/env_1/{camera}/camera_info"));
    // P of ROS: of the right eye it brings points of the left one, 6 cm beside it, into the picture.
    let projections = [0.0, 0.06].map(|baseline| {
        let k = sim.sensor(pair).unwrap().left().intrinsic_matrices();
        let [fx, cx, fy, cy] = [k[(1, 0, 0)], k[(1, 0, 2)] - 0.5, k[(1, 1, 1)], k[(1, 1, 2)] - 0.5];
        [fx, 0.0, cx, 0.0 - fx * baseline, 0.0, fy, cy, 0.0, 0.0, 0.0, 1.0, 0.0].map(|x| (x * 1e9).round() / 1e9)
    });
    let scanner_pose = [scanner.pos_w().row(1).to_vec(), scanner.quat_w().row(1).to_vec()].concat();
    let names: std::collections::BTreeMap<String, String> =
        sim.mask_ids().iter().map(|id| (id.id.to_string(), id.name())).collect();
    assert!(names.values().any(|name| name == "cube"), "{names:?}");
    let up = normal.rows().into_iter().flat_map(|row| row.to_vec()).collect::<Vec<f32>>();
    let upward = up.chunks(3).filter(|n| **n == [0.0, 0.0, 1.0]).count();
    let expected = serde_json::json!({
        "points": points,
        "point_time": (sim.time()[1] * 1e9).round() as u64,
        "forces": forces,
        "normal_shape": normal.shape(),
        "normal_sum": normal.iter().zip(1..).map(|(x, k)| u64::from(x.to_bits()) * k).sum::<u64>(),
        "upward": upward,
        "attached": ["recording.json", "scene.zip", "start.snapshot"],
        "flow_sum": weighed(&mut flow.iter().map(|x| u64::from(x.to_bits()))),
        "albedo_sum": weighed(&mut albedo.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]].map(u64::from))),
        "disparity_sum": weighed(&mut disparity.iter().map(|x| u64::from(x.to_bits()))),
        "right_sum": weighed(&mut right.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]].map(u64::from))),
        "moves": moves,
        "distances": distances.iter().map(|x| x.to_bits().to_string()).collect::<Vec<_>>(),
        "hit_ids": hit_ids,
        "hit_normals": hit_normals,
        "scanner": scanner_pose,
        "mask_ids": names,
        "bodies": "cube",
        "fish": ["equidistant", [0.02, -0.003, 0.0005, -0.0001], matrix],
        "infos": infos,
        "projections": projections,
        "round": true,
    });
    assert!(upward > 0 && upward < 24 * 16, "{upward}");
    let left_out = sim.finish_recording(recorder).unwrap().left_out;
    assert!(left_out.iter().any(|what| what.starts_with("round/camera_info")), "{left_out:?}");
    bits(expected)
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn a_foreign_reader_finds_points_forces_and_normals() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mcap");
    let expected = sensed(&path);
    assert_eq!(said(&python, "read_sensors.py", &path), expected);
}
