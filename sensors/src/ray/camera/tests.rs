//! Pictures of a floor and a ball, against closed forms.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use super::{RayCasterCamera, RayCasterCameraCfg};
use crate::SensorError;
use crate::camera::{CameraConvention, DepthMiss, Extrinsics, Intrinsics, Placement};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use ndarray::{Array2, Array3, array};
use scene::pose::{from_row, from_xyz_rpy, to_row};
use scene::shape::{Plane, Sphere};
use scene::{Instance, Material, Pose, PoseF64, RenderScene, SceneState};
use std::sync::Arc;

const FLOOR: i32 = 4;
const BALL: i32 = 9;

fn context(num_envs: usize) -> SensorContext {
    let instances = vec![
        Instance::new(Plane { half: [3.0, 3.0] }, Material::default(), FLOOR).named("floor").fixed(),
        Instance::new(Sphere { radius: 0.5 }, Material::default(), BALL).named("ball").of_body(0),
    ];
    let scene = Some(Arc::new(RenderScene::new(instances).unwrap()));
    SensorContext {
        num_envs,
        dt: 0.01,
        bodies: ["ball".to_string()].into(),
        scene,
        threads: 1,
        ..SensorContext::default()
    }
}

/// The ball is a decimetre higher in every further environment.
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

/// The point of every pixel, from its depth, lies on the surface that its mask names; the normal is that of the surface.
#[test]
fn every_pixel_is_on_the_surface_it_names() {
    let camera = built(&cfg(), 2);
    let mut seen = [0; 3];
    for env in 0..2 {
        let pose = from_row(&std::array::from_fn(|k| camera.pose_w(CameraConvention::Ros)[(env, k)]));
        for v in 0..48 {
            for u in 0..64 {
                let at = (env, v, u);
                let d = nalgebra::Vector3::new((u as f64 + 0.5 - 30.5) / 50.0, (v as f64 + 0.5 - 20.25) / 60.0, 1.0);
                let (depth, distance) = (f64::from(camera.depth()[at]), f64::from(camera.distance()[at]));
                let normal: Vec<f32> = (0..3).map(|k| camera.normal()[(env, v, u, k)]).collect();
                match camera.mask()[at] {
                    0 => {
                        seen[0] += 1;
                        assert!(depth == f64::INFINITY && distance == f64::INFINITY && normal == [0.0; 3]);
                    }
                    id => {
                        let p = pose * nalgebra::Point3::from(d * depth);
                        let ball = nalgebra::Point3::new(0.2, 0.0, 0.5 + 0.1 * env as f64);
                        // Depths are single precision: 5 m times 6e-8, and as much again along the ray.
                        assert!((distance - depth * d.norm()).abs() < 2e-6);
                        if id == BALL {
                            seen[1] += 1;
                            assert!(((p - ball).norm() - 0.5).abs() < 2e-6);
                            let n = (p - ball) / 0.5;
                            assert!((0..3).all(|k| (n[k] - f64::from(normal[k])).abs() < 1e-5));
                        } else {
                            seen[2] += 1;
                            assert!(p.z.abs() < 2e-6 && normal == [0.0, 0.0, 1.0] && id == FLOOR);
                        }
                    }
                }
            }
        }
    }
    assert!(seen.iter().all(|n| *n > 200), "misses, ball, floor: {seen:?}");
}

#[test]
fn misses_are_what_the_configuration_says() {
    for (depth_miss, expected) in [(DepthMiss::Inf, f32::INFINITY), (DepthMiss::Far, 30.0), (DepthMiss::Zero, 0.0)] {
        let camera = built(&RayCasterCameraCfg { depth_miss, max_distance: 30.0, ..cfg() }, 1);
        let (mask, depth, distance) = (camera.mask(), camera.depth(), camera.distance());
        let pixels = mask.iter().zip(depth.iter().zip(distance));
        let misses: Vec<_> = pixels.filter(|(id, _)| **id == 0).map(|(_, (a, b))| (*a, *b)).collect();
        assert!(misses.len() > 100 && misses.iter().all(|m| *m == (expected, expected)));
    }
}

#[test]
fn it_hangs_on_a_body_keeps_its_schedule_and_can_be_moved() {
    let extrinsics = Extrinsics { parent: Some("ball".into()), ..cfg().extrinsics };
    let mut camera = built(&RayCasterCameraCfg { extrinsics, update_period: 0.02, ..cfg() }, 2);
    assert!(camera.mask().iter().all(|id| *id != BALL), "it does not see what it hangs on");
    let z = |camera: &RayCasterCamera, env| camera.pose_w(CameraConvention::Ros)[(env, 2)];
    assert!((z(&camera, 1) - z(&camera, 0) - 0.1).abs() < 1e-12);
    let down = from_xyz_rpy([0.0, 0.0, 1.0], [std::f64::consts::PI, 0.0, 0.0]);
    camera.set_local_pose(&down, Some(&[1]), CameraConvention::Ros).unwrap();
    let before = camera.depth().to_owned();
    camera.update(&state(&[1, 1])).unwrap();
    assert!(camera.depth() == before && camera.frame_counts() == array![0, 0], "not due yet");
    let count = allocation_counter::measure(|| camera.update(&state(&[2, 2])).unwrap()).count_total;
    let of_the_state = allocation_counter::measure(|| drop(state(&[2, 2]))).count_total;
    assert_eq!(count, of_the_state, "nothing of its own");
    assert_eq!((camera.frame_counts().to_owned(), camera.stamps()[1]), (array![1, 1], 0.02));
    // One metre above the ball's middle, at 0.6 m, looking straight down at the floor.
    assert!((f64::from(camera.depth()[(1, 20, 30)]) - 1.6).abs() < 1e-6, "{}", camera.depth()[(1, 20, 30)]);
}

#[test]
fn mistakes_are_typed_errors() {
    let error = |cfg: RayCasterCameraCfg| cfg.build(&context(1)).unwrap_err().to_string();
    assert!(error(RayCasterCameraCfg { width: 0, ..cfg() }).contains("0e0 rays"));
    assert!(error(RayCasterCameraCfg { max_distance: f64::NAN, ..cfg() }).contains("max_distance"));
    assert!(error(RayCasterCameraCfg { intrinsics: Intrinsics::Fovy { radians: 4.0 }, ..cfg() }).contains("angle"));
    let parent = Some("bal".to_string());
    assert!(
        error(RayCasterCameraCfg { extrinsics: Extrinsics { parent, ..cfg().extrinsics }, ..cfg() }).contains("ball")
    );
    let mut camera = built(&cfg(), 1);
    let two = [Pose::identity(), Pose::identity()];
    assert!(matches!(camera.set_local_pose(&two, None, CameraConvention::Ros), Err(SensorError::Camera(_))));
    assert!(camera.set_local_pose(&two[0], Some(&[1]), CameraConvention::Ros).is_err());
}
