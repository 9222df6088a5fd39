//! Images of a floor and a ball, against closed forms.

use super::{RayCasterCamera, RayCasterCameraCfg};
use crate::SensorError;
use crate::camera::CameraError;
use crate::camera::{CameraConvention, CameraPlacement, DepthMiss, Extrinsics, Placement, PointFrame};
use crate::noise::NoiseCfg;
use crate::sampling::{Sampled, SamplingCfg};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use kinetoscope_render::Intrinsics;
use kinetoscope_render::OpticsError;
use kinetoscope_scene::pose::{from_row, from_xyz_rpy, to_row};
use kinetoscope_scene::shape::{Plane, Sphere};
use kinetoscope_scene::{Instance, Material, Pose, PoseF64, RenderScene, SceneState};
use nalgebra::{Point3, Vector3};
use ndarray::{Array2, Array3, array};
use std::sync::Arc;

const FLOOR: i32 = 4;
const BALL: i32 = 9;

fn context(num_envs: usize) -> SensorContext {
    let instances = vec![
        Instance::new(Plane { half: [3.0, 3.0] }, Material::default(), FLOOR).with_name("floor").into_fixed(),
        Instance::new(Sphere { radius: 0.5 }, Material::default(), BALL).with_name("ball").with_body(0),
    ];
    let scene = Some(Arc::new(RenderScene::new(instances).unwrap()));
    let bodies = ["ball".to_string()].into();
    SensorContext { num_envs, dt: 0.01, bodies, scene, threads: 1, ..SensorContext::default() }
}

/// The ball is a decimeter higher in each further environment.
fn state(steps: &[u64]) -> SceneState {
    let n = steps.len();
    let pose = |env: usize| Pose::translation(0.2, 0.0, 0.5 + 0.1 * env as f64);
    SceneState {
        step: steps.to_vec(),
        time: steps.iter().map(|&s| s as f64 * 0.01).collect(),
        force_time: vec![0.0; n],
        body_poses: Some(Array3::from_shape_fn((n, 1, 7), |(env, _, k)| to_row(&pose(env))[k])),
        instance_poses: Some(Array2::from_shape_fn((n, 2), |(env, k)| {
            if k == 0 { PoseF64::IDENTITY } else { PoseF64::from(&pose(env)) }
        })),
        ..SceneState::default()
    }
}

fn cfg() -> RayCasterCameraCfg {
    let placement = Placement::LookAt { eye: [-2.0, 1.0, 2.5], target: [0.5, 0.0, 0.3], up: [0.0, 0.0, 1.0] };
    RayCasterCameraCfg {
        width: 64,
        height: 48,
        intrinsics: Intrinsics::Pixels { fx: 50.0, fy: 60.0, cx: 30.5, cy: 20.25 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        ..RayCasterCameraCfg::default()
    }
}

fn built(cfg: &RayCasterCameraCfg, n: usize) -> RayCasterCamera {
    let mut camera = cfg.build(&context(n)).unwrap();
    camera.reset(&(0..n).collect::<Vec<_>>(), &state(&vec![0; n])).unwrap();
    camera
}

/// The point of every pixel, from its depth and in the point map, lies on the surface of its mask id. The normal is
/// that of the surface. Depths have single precision: 5 m times 6e-8, and as much again along the ray.
#[test]
fn pixels() {
    let camera = built(&cfg(), 2);
    let mut seen = [0; 3];
    for env in 0..2 {
        let pose = from_row(&std::array::from_fn(|k| camera.pose_w(CameraConvention::Ros)[(env, k)]));
        let ball = Point3::new(0.2, 0.0, 0.5 + 0.1 * env as f64);
        let map = camera.point_map(env, PointFrame::World).unwrap();
        let before = seen;
        for (v, u) in (0..48).flat_map(|v| (0..64).map(move |u| (v, u))) {
            let at = (env, v, u);
            let d = Vector3::new((u as f64 + 0.5 - 30.5) / 50.0, (v as f64 + 0.5 - 20.25) / 60.0, 1.0);
            let (depth, distance) = (f64::from(camera.depth()[at]), f64::from(camera.distance()[at]));
            let normal: Vec<f32> = (0..3).map(|k| camera.normal()[(env, v, u, k)]).collect();
            let points = [pose * Point3::from(d * depth), Point3::from([0, 1, 2].map(|k| f64::from(map[(v, u, k)])))];
            let id = camera.mask()[at];
            seen[[0, FLOOR, BALL].iter().position(|known| *known == id).unwrap()] += 1;
            if id == 0 {
                assert!(depth == f64::INFINITY && distance == f64::INFINITY && normal == [0.0; 3]);
                assert!(points[1].iter().all(|x| *x == f64::INFINITY));
                continue;
            }
            assert!((distance - depth * d.norm()).abs() < 2e-6);
            for p in points {
                let off = if id == BALL { (p - ball).norm() - 0.5 } else { p.z };
                assert!(off.abs() < 2e-6, "{at:?}: {off}");
            }
            let n = if id == BALL { (points[0] - ball) / 0.5 } else { Vector3::z() };
            let tolerance = if id == BALL { 1e-5 } else { 0.0 };
            assert!((0..3).all(|k| (n[k] - f64::from(normal[k])).abs() <= tolerance));
        }
        let hits = (1..3).map(|k| seen[k] - before[k]).sum::<usize>();
        assert_eq!(camera.point_cloud(env, PointFrame::World).unwrap().nrows(), hits);
    }
    assert!(seen.iter().all(|n| *n > 200), "misses, floor, ball: {seen:?}");
}

#[test]
fn misses() {
    for (depth_miss, expected) in [(DepthMiss::Inf, f32::INFINITY), (DepthMiss::Far, 30.0), (DepthMiss::Zero, 0.0)] {
        let camera = built(&RayCasterCameraCfg { depth_miss, max_distance: 30.0, ..cfg() }, 1);
        let (mask, depth, distance) = (camera.mask(), camera.depth(), camera.distance());
        let pixels = mask.iter().zip(depth.iter().zip(distance));
        let misses: Vec<_> = pixels.filter(|(id, _)| **id == 0).map(|(_, (a, b))| (*a, *b)).collect();
        assert!(misses.len() > 100 && misses.iter().all(|m| *m == (expected, expected)));
    }
}

/// A camera on a body moves with it, keeps its schedule and can be placed.
#[test]
fn attached() {
    let extrinsics = || Extrinsics { parent: Some("ball".into()), ..cfg().extrinsics };
    let sampling = SamplingCfg::every(0.02);
    let mut camera = built(&RayCasterCameraCfg { extrinsics: extrinsics(), sampling, ..cfg() }, 2);
    assert!(camera.mask().iter().all(|id| *id != BALL), "it does not see its own body");
    let z = |camera: &RayCasterCamera, env| camera.pose_w(CameraConvention::Ros)[(env, 2)];
    assert!((z(&camera, 1) - z(&camera, 0) - 0.1).abs() < 1e-12);
    let down = from_xyz_rpy([0.0, 0.0, 1.0], [std::f64::consts::PI, 0.0, 0.0]);
    camera.set_local_pose(&down, Some(&[1]), CameraConvention::Ros).unwrap();
    let before = camera.depth().to_owned();
    camera.update(&state(&[1, 1])).unwrap();
    assert!(camera.depth() == before && camera.frame_counts() == array![0, 0], "not due yet");
    camera.update(&state(&[2, 2])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()[1]), (array![1, 1].view(), 0.02));
    // One meter above the center of the ball, at 0.6 m, looking straight down at the floor.
    assert!((f64::from(camera.depth()[(1, 20, 30)]) - 1.6).abs() < 1e-6, "{}", camera.depth()[(1, 20, 30)]);

    let mut camera = built(&RayCasterCameraCfg { extrinsics: extrinsics(), ..cfg() }, 2);
    assert!(camera.is_attached());
    let place = from_xyz_rpy([0.3, -0.2, 1.0], [2.0, 0.1, 0.4]);
    camera.set_world_poses(&place, None, CameraConvention::OpenGl).unwrap();
    camera.update(&state(&[1, 1])).unwrap();
    let poses = camera.pose_w(CameraConvention::OpenGl);
    assert!(poses.rows().into_iter().all(|row| (0..7).all(|k| (row[k] - to_row(&place)[k]).abs() < 1e-12)), "{poses}");
    let local = camera.local_pose(CameraConvention::OpenGl);
    assert!((local[(0, 2)] - 0.5).abs() < 1e-12 && (local[(1, 2)] - 0.4).abs() < 1e-12, "{local}");
}

#[test]
fn mistakes() {
    let error = |cfg: RayCasterCameraCfg| cfg.build(&context(1)).unwrap_err().to_string();
    assert!(error(RayCasterCameraCfg { width: 0, ..cfg() }).contains("0e0 rays"));
    assert!(error(RayCasterCameraCfg { max_distance: f64::NAN, ..cfg() }).contains("max_distance"));
    assert!(error(RayCasterCameraCfg { intrinsics: Intrinsics::Fovy { radians: 4.0 }, ..cfg() }).contains("angle"));
    let on = |parent: &str| RayCasterCameraCfg {
        extrinsics: Extrinsics { parent: Some(parent.into()), ..cfg().extrinsics },
        ..cfg()
    };
    assert!(error(on("bal")).contains("ball"));
    let mut camera = built(&cfg(), 1);
    let two = [Pose::identity(), Pose::identity()];
    assert!(matches!(camera.set_local_pose(&two, None, CameraConvention::Ros), Err(SensorError::Camera(_))));
    assert!(camera.set_local_pose(&two[0], Some(&[1]), CameraConvention::Ros).is_err());
    let twice = camera.set_local_pose(&two[0], Some(&[0, 0]), CameraConvention::Ros);
    assert_eq!(twice, Err(CameraError::DuplicateEnvironment { env: 0 }.into()));
    let z = [[0.0, 0.0, 1.0]];
    assert!(matches!(camera.look_at(&z, &z, &z, None), Err(SensorError::Camera(CameraError::LookAt { .. }))));
    let flat = Intrinsics::Pixels { fx: 0.0, fy: 1.0, cx: 0.0, cy: 0.0 };
    assert!(matches!(
        camera.set_intrinsics(&[flat], None),
        Err(SensorError::Camera(CameraError::Optics(OpticsError::Lens { .. })))
    ));
    assert!(camera.restore(Some(&[1])).is_err() && camera.point_map(1, PointFrame::World).is_err());
    // Before the first capture, the pose of the parent is unknown.
    let mut attached = on("ball").build(&context(1)).unwrap();
    let early = attached.set_world_poses(&two[0], None, CameraConvention::Ros);
    assert_eq!(early, Err(CameraError::NothingCaptured { env: 0 }.into()));
    let noise = [("depth".to_string(), NoiseCfg::white(0.1))].into();
    let sampling = SamplingCfg { noise, ..SamplingCfg::default() };
    assert!(error(RayCasterCameraCfg { sampling, ..cfg() }).contains("\"distances\""));
}

/// Eye, target and up of a camera `z` meters above the point (x, y) that looks straight down, with the top of the image
/// along +y.
fn down(x: f64, y: f64, z: f64) -> [[[f64; 3]; 1]; 3] {
    [[[x, y, z]], [[x, y, 0.0]], [[0.0, 1.0, 0.0]]]
}

const WIDE: (f64, f64, f64, f64) = (40.0, 45.0, 20.0, 30.0);

fn wide() -> Intrinsics {
    let (fx, fy, cx, cy) = WIDE;
    Intrinsics::Pixels { fx, fy, cx, cy }
}

/// Only the floor is a target.
fn floor_only() -> RayCasterCameraCfg {
    RayCasterCameraCfg { targets: crate::ray::HitTargets::StaticOnly, ..cfg() }
}

/// From 2 m and from 1.5 m above the floor, with two intrinsics: depths, distances and points of every pixel in closed
/// form, up to three roundings of single precision, 3 m times 6e-8.
#[test]
fn lenses() {
    let mut camera = built(&floor_only(), 2);
    let views = [((50.0, 60.0, 30.5, 20.25), (0.25, -0.5, 2.0)), (WIDE, (-0.125, 0.5, 1.5))];
    for (env, (_, (x, y, z))) in views.into_iter().enumerate() {
        let [eye, target, up] = down(x, y, z);
        camera.look_at(&eye, &target, &up, Some(&[env])).unwrap();
    }
    camera.set_intrinsics(&[wide()], Some(&[1])).unwrap();
    assert_eq!(camera.intrinsic_matrices()[(1, 0, 0)], 50.0, "of the current image");
    camera.update(&state(&[1, 1])).unwrap();
    let (camera_points, world) = (camera.points(PointFrame::Camera), camera.points(PointFrame::World));
    assert_eq!(world.dim(), (2, 64 * 48, 3));
    for (env, ((fx, fy, cx, cy), (x, y, z))) in views.into_iter().enumerate() {
        let matrix = array![[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]];
        assert_eq!(camera.intrinsic_matrices().index_axis(ndarray::Axis(0), env), matrix);
        for k in 0..64 * 48 {
            let (u, v) = (k % 64, k / 64);
            let (right, below) = ((u as f64 + 0.5 - cx) / fx, (v as f64 + 0.5 - cy) / fy);
            let near =
                |found: f32, expected: f64| assert!((f64::from(found) - expected).abs() < 6e-7, "{found} {expected}");
            near(camera.depth()[(env, v, u)], z);
            near(camera.distance()[(env, v, u)], z * (1.0 + right * right + below * below).sqrt());
            let (own, there) = ([right * z, below * z, z], [x + right * z, y - below * z, 0.0]);
            for axis in 0..3 {
                near(camera_points[(env, k, axis)], own[axis]);
                near(world[(env, k, axis)], there[axis]);
            }
        }
        let map = camera.point_map(env, PointFrame::World).unwrap();
        assert!(map.iter().eq(world.index_axis(ndarray::Axis(0), env).iter()));
        assert_eq!(camera.point_cloud(env, PointFrame::World).unwrap().dim(), (64 * 48, 3));
    }
    assert!(camera.distance()[(0, 0, 0)] != camera.distance()[(1, 0, 0)], "the control: lenses differ");
    camera.restore(None).unwrap();
    camera.update(&state(&[2, 2])).unwrap();
    assert_eq!(camera.depth(), built(&floor_only(), 2).depth(), "as configured");
}

fn noisy(noise: NoiseCfg) -> RayCasterCameraCfg {
    let noise = [("distances".to_string(), noise)].into();
    RayCasterCameraCfg { sampling: SamplingCfg { noise, history_length: 1, ..SamplingCfg::default() }, ..cfg() }
}

/// Noise is along the rays: it affects depth and points, but not normals, masks and misses. The bound of the deviation
/// is five sigma of that of as many normal numbers.
#[test]
fn noise() {
    let (noisy, exact) = (built(&noisy(NoiseCfg::white(0.05)), 1), built(&cfg(), 1));
    assert_eq!((noisy.mask(), noisy.normal()), (exact.mask(), exact.normal()));
    let eye = Vector3::from_fn(|k, _| exact.pose_w(CameraConvention::Ros)[(0, k)]);
    let (a, b) = (noisy.points(PointFrame::World), exact.points(PointFrame::World));
    let (mut sum, mut hits) = (0.0, 0);
    for (k, (at, id)) in exact.mask().indexed_iter().enumerate() {
        let (before, after) = (f64::from(exact.distance()[at]), f64::from(noisy.distance()[at]));
        if *id == 0 {
            assert!(after == f64::INFINITY && noisy.depth()[at] == f32::INFINITY);
            continue;
        }
        hits += 1;
        sum += (after - before).powi(2);
        let ratio = f64::from(noisy.depth()[at]) / f64::from(exact.depth()[at]);
        assert!((ratio - after / before).abs() < 1e-6, "depth and distance are of one measurement");
        let [a, b] = [&a, &b].map(|p| Vector3::from_fn(|axis, _| f64::from(p[(0, k, axis)])) - eye);
        assert!((a - b * (after / before)).norm() < 1e-5, "the point stays on its ray");
    }
    let spread = (sum / f64::from(hits)).sqrt();
    assert!((spread - 0.05).abs() < 5.0 * 0.05 / (2.0 * f64::from(hits)).sqrt(), "{spread} of {hits}");
}

/// Noisy distances stay between zero and the maximum. Root cause: the sum of distance and noise was not clamped. A near
/// wall came out behind the camera, a far wall beyond `max_distance`, and large noise made infinite depths of hits.
#[test]
fn saturation() {
    let near = |cfg| RayCasterCameraCfg { max_distance: 3.0, ..cfg };
    let exact = built(&near(cfg()), 1);
    for (std, resolution) in [(2.0, 0.0), (2.0, 0.7), (1e100, 0.0), (2.0, 1e-320)] {
        let mut camera = built(&near(noisy(NoiseCfg { std, resolution, bias_std: std, bias_walk: std })), 1);
        camera.update(&state(&[1])).unwrap();
        assert_eq!(camera.mask(), exact.mask(), "misses stay misses, hits stay hits");
        let (mut at_zero, mut at_most, mut between) = (0, 0, 0);
        for (k, (at, id)) in camera.mask().indexed_iter().enumerate() {
            let (depth, distance) = (camera.depth()[at], camera.distance()[at]);
            let kept = camera.distance_history()[(0, 0, k)];
            if *id == 0 {
                assert!([depth, distance] == [f32::INFINITY; 2] && kept == f64::INFINITY);
                continue;
            }
            assert!((0.0..=3.0).contains(&distance) && (0.0..=distance).contains(&depth), "{depth} {distance}");
            assert!((0.0..=3.0).contains(&kept), "{kept}");
            at_zero += usize::from(distance == 0.0);
            at_most += usize::from(distance == 3.0);
            between += usize::from(distance > 0.0 && distance < 3.0);
        }
        // Control: noise as large as the distances reaches both ends.
        assert!(at_zero > 50 && at_most > 50, "{at_zero} {at_most}");
        assert!(between > 50 || std > 2.0, "{between}");
    }
}

/// A late image keeps its stamp, its pose and its intrinsics.
#[test]
fn latency() {
    let sampling = SamplingCfg { history_length: 2, latency_steps: 2, ..SamplingCfg::every(0.01) };
    let mut camera = built(&RayCasterCameraCfg { sampling, ..floor_only() }, 1);
    let first = camera.depth().to_owned();
    let [eye, target, up] = down(0.0, 0.0, 2.0);
    camera.update(&state(&[1])).unwrap();
    camera.look_at(&eye, &target, &up, None).unwrap();
    camera.set_intrinsics(&[wide()], None).unwrap();
    let mut read = Vec::new();
    for step in 2..=4 {
        camera.update(&state(&[step])).unwrap();
        read.push((camera.stamps()[0], camera.frame_counts()[0], camera.intrinsic_matrices()[(0, 0, 0)]));
        // Points are always on the floor: depths, pose and intrinsics belong together.
        let points = camera.point_cloud(0, PointFrame::World).unwrap();
        assert!(points.nrows() > 1000 && points.column(2).iter().all(|z| z.abs() < 2e-6), "step {step}");
        assert_eq!(camera.depth() == first, step < 4, "step {step}");
    }
    assert_eq!(read, [(0.0, 0, 50.0), (0.01, 1, 50.0), (0.02, 2, 40.0)]);
    assert_eq!(camera.distance_history().dim(), (1, 2, 64 * 48));
    assert_eq!(camera.due_in(&[4]), 1);
}

/// One ray per pixel in 3 environments of 3072 rays: enough for two threads.
#[test]
fn threads() {
    let taken = |threads| {
        let mut camera = cfg().build(&SensorContext { threads, ..context(3) }).unwrap();
        let lens = |k: f64| Intrinsics::Pixels { fx: 50.0 + k, fy: 60.0, cx: 30.0, cy: 20.0 };
        camera.set_intrinsics(&[0.0, 1.0, 2.0].map(lens), None).unwrap();
        camera.reset(&[0, 1, 2], &state(&[0; 3])).unwrap();
        (1..5).for_each(|step| camera.update(&state(&[step; 3])).unwrap());
        let depth: Vec<u32> = camera.depth().iter().map(|x| x.to_bits()).collect();
        (depth, camera.normal().to_owned(), camera.mask().to_owned())
    };
    let one = taken(1);
    assert!([2, 4].map(taken).iter().all(|several| *several == one));
}
