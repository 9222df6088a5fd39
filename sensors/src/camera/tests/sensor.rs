//! The camera as a sensor: capture and rendering times, measured values against closed forms, and rejected mistakes.

use super::super::*;
use super::test_scene::{BALL, DT, GROUND, LENS, RADIUS, SIZE, ball, bits, built, cfg, context, pose_of, state, tip};
use crate::error::SensorError;
use crate::sensor::{Sensor, SensorCfg};
use kinetoscope_render::OpticsError;
use kinetoscope_render::RenderError;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::frame::Depth;
use kinetoscope_render::lens::Lens;
use kinetoscope_render::{Intrinsics, Renderer};
use kinetoscope_scene::StateFields;
use kinetoscope_scene::pose::{from_row, from_wxyz, from_xyz_rpy, to_row};
use kinetoscope_scene::{Pose, PoseF32, SceneState};
use nalgebra::{Matrix3, Point3, Quaternion, Rotation3, UnitQuaternion, Vector3};
use ndarray::{Array2, Axis, array};

const CONVENTIONS: [CameraConvention; 3] = [CameraConvention::Ros, CameraConvention::OpenGl, CameraConvention::World];
const ROS: CameraConvention = CameraConvention::Ros;
const UP: [[f64; 3]; 1] = [[0.0, 0.0, 1.0]];

fn on(parent: &str) -> CameraCfg {
    CameraCfg { extrinsics: Extrinsics { parent: Some(parent.into()), ..Default::default() }, ..cfg() }
}

/// A camera renders when it is read, once, and only changed images.
#[test]
fn lazy_draws() {
    let mut camera = built(&cfg(), &context(3));
    assert_eq!(camera.render_count(), 0, "not read yet");
    camera.depth().unwrap();
    camera.color().unwrap();
    camera.point_cloud(1, Default::default()).unwrap();
    assert_eq!(camera.render_count(), 3);
    (1..=5).for_each(|step| camera.update(&state(&[step; 3])).unwrap());
    assert_eq!((camera.render_count(), camera.frame_counts()), (3, array![5, 5, 5].view()));
    camera.color().unwrap();
    assert_eq!(camera.render_count(), 6);
    // A quarantined environment is not rendered again.
    for _ in 0..2 {
        camera.update(&state(&[6, 5, 6])).unwrap();
        camera.color().unwrap();
        assert_eq!((camera.render_count(), camera.frame_counts()), (8, array![6, 5, 6].view()));
    }
    // After a setter, the changed environments are rendered again, at the same instant.
    camera.set_local_pose(&Pose::identity(), Some(&[2]), CameraConvention::World).unwrap();
    camera.set_intrinsics(&[Intrinsics::ISAAC], Some(&[2])).unwrap();
    camera.color().unwrap();
    assert_eq!((camera.render_count(), camera.stamps()), (9, array![6.0 * DT, 5.0 * DT, 6.0 * DT].view()));
    camera.set_intrinsics(&[], Some(&[])).unwrap();
    camera.color().unwrap();
    assert_eq!(camera.render_count(), 9);
}

/// Images show the instant of capture, however late they are read.
#[test]
fn instant_of_capture() {
    let context = context(2);
    let period = CameraCfg { update_period: 0.02, ..cfg() };
    let (mut lazy, mut eager) = (built(&period, &context), built(&CameraCfg { lazy: false, ..period }, &context));
    assert_eq!(eager.render_count(), 2);
    let mut due = Vec::new();
    for step in 1..=11 {
        due.push(lazy.due_in(&[step - 1, step - 1]));
        lazy.update(&state(&[step, step])).unwrap();
        eager.update(&state(&[step, step])).unwrap();
    }
    assert_eq!(due, [4, 3, 2, 1, 4, 3, 2, 1, 4, 3, 2]);
    assert_eq!((lazy.render_count(), eager.render_count()), (0, 6));
    let memory = lazy.color().unwrap().as_ptr();
    assert_eq!(bits(&lazy, 0..2), bits(&eager, 0..2));
    assert_eq!((lazy.render_count(), eager.render_count()), (2, 6));
    assert_eq!((lazy.stamps(), lazy.schedule().period_steps()), (array![8.0 * DT, 8.0 * DT].view(), 4));
    let mut fresh = built(&cfg(), &context);
    fresh.refresh(&[0, 1], &state(&[8, 8])).unwrap();
    assert_eq!(bits(&lazy, 0..2), bits(&fresh, 0..2), "as of step 8");
    lazy.update(&state(&[12, 12])).unwrap();
    assert_eq!(lazy.color().unwrap().as_ptr(), memory, "memory stays where it is");
}

/// Resets and refreshes show the state and count nothing; set poses persist over a reset until they are restored.
#[test]
fn resets() {
    let context = context(2);
    let mut camera = built(&CameraCfg { update_period: 0.02, ..cfg() }, &context);
    (1..=6).for_each(|step| camera.update(&state(&[step, step])).unwrap());
    assert_eq!(camera.frame_counts(), array![1, 1]);
    let before = bits(&camera, [0]);
    camera.reset(&[1], &state(&[6, 0])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()), (array![1, 0].view(), array![4.0 * DT, 0.0].view()));
    assert_eq!(bits(&camera, [0]), before);
    assert_eq!(bits(&camera, [1]), bits(&built(&cfg(), &context), [1]), "as at step 0");
    camera.refresh(&[0], &state(&[7, 9])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()), (array![1, 0].view(), array![7.0 * DT, 0.0].view()));
    camera.update(&state(&[8, 2])).unwrap();
    camera.update(&state(&[10, 4])).unwrap();
    assert_eq!((camera.frame_counts(), camera.stamps()), (array![2, 1].view(), array![8.0 * DT, 4.0 * DT].view()));

    let mut camera = built(&cfg(), &context);
    let local = |camera: &Camera| camera.local_pose(CameraConvention::OpenGl);
    let configured = local(&camera);
    let moved = from_xyz_rpy([0.0, 0.0, 3.0], [0.1, 0.2, 0.3]);
    camera.set_local_pose(&[moved, moved], None, CameraConvention::OpenGl).unwrap();
    let there = local(&camera);
    camera.reset(&[0, 1], &state(&[0, 0])).unwrap();
    assert_eq!(local(&camera), there);
    camera.restore(Some(&[1])).unwrap();
    assert_eq!((local(&camera).row(0), local(&camera).row(1)), (there.row(0), configured.row(1)));
}

#[test]
fn some_environments() {
    let context = context(4);
    let mut all = built(&cfg(), &context);
    let mut some = built(&CameraCfg { env_ids: Some(vec![3, 1]), ..cfg() }, &context);
    for camera in [&mut all, &mut some] {
        camera.update(&state(&[1, 2, 3, 4])).unwrap();
        camera.reset(&[0, 1], &state(&[1, 2, 3, 4])).unwrap();
    }
    assert_eq!(bits(&some, 0..2), bits(&all, [3, 1]));
    assert_eq!((some.stamps(), some.frame_counts()), (array![4.0 * DT, 2.0 * DT].view(), array![1, 0].view()));
    assert_eq!((some.render_count(), some.env_ids()), (2, [3, 1].as_slice()));
    for camera in [&mut all, &mut some] {
        camera.set_intrinsics(&[Intrinsics::Fovy { radians: 0.5 }], Some(&[1])).unwrap();
    }
    assert_eq!(bits(&some, 0..2), bits(&all, [3, 1]));
    let alone = built(&CameraCfg { env_ids: Some(vec![2]), ..cfg() }, &context);
    assert_eq!(bits(&alone, [0]), bits(&built(&cfg(), &context), [2]), "alone or among others");
}

/// Readers on several threads share one render.
#[test]
fn concurrent_readers() {
    let camera = built(&cfg(), &context(2));
    std::thread::scope(|scope| {
        let readers = [0; 4].map(|_| scope.spawn(|| camera.depth().unwrap().sum().to_bits()));
        let sums = readers.map(|reader| reader.join().unwrap());
        assert!(sums.iter().all(|sum| *sum == sums[0]));
    });
    assert_eq!(camera.render_count(), 2);
}

#[test]
fn requirements() {
    assert_eq!(
        [cfg().requires(), on("tip").requires()],
        [StateFields::VISIBLE, StateFields::VISIBLE | StateFields::POSES]
    );
    let bare = SceneState { body_poses: None, ..state(&[0]) };
    let mut free = cfg().build(&crate::SensorContext { bodies: Vec::new().into(), ..context(1) }).unwrap();
    free.reset(&[0], &bare).unwrap();
    free.color().unwrap();
}

#[test]
fn hidden_groups() {
    let mut context = context(1);
    let mut instances = context.scene.as_ref().unwrap().instances().to_vec();
    instances[1].group = 3;
    context.scene = Some(kinetoscope_scene::RenderScene::new(instances).unwrap().into());
    let sees_ball = |cfg: &CameraCfg| built(cfg, &context).mask().unwrap().iter().any(|&id| id == BALL);
    let mut everything = cfg();
    everything.raster.groups = u32::MAX;
    assert_eq!([&cfg(), &everything].map(sees_ball), [false, true]);
}

#[test]
fn lights_of_environments() {
    let mut state = state(&[0, 0]);
    let visible = state.visible.as_mut().unwrap();
    visible.instance_poses[(1, 1)] = visible.instance_poses[(0, 1)];
    let mut camera = built(&cfg(), &context(2));
    let mut same = |state: &SceneState| {
        camera.refresh(&[0, 1], state).unwrap();
        let color = camera.color().unwrap();
        color.index_axis(Axis(0), 0) == color.index_axis(Axis(0), 1)
    };
    assert!(!same(&state), "the lights differ");
    let visible = state.visible.as_mut().unwrap();
    visible.lights[(1, 0)] = visible.lights[(0, 0)];
    assert!(same(&state));
}

#[test]
fn channel_names() {
    let wanted = Channels { color: true, depth: true, distance: true, mask: true, normal: true, ..Channels::default() };
    let names = ["rgb", "distance_to_image_plane", "distance_to_camera", "semantic_segmentation", "normals"];
    assert_eq!(Channels::from_names(&names).unwrap(), wanted);
    assert_eq!(Channels::from_names(Channels::NAMES).unwrap(), Channels::ALL);
    let owned = ["rgba".to_string(), "instance_segmentation".into()];
    assert_eq!(Channels::from_names(&owned).unwrap().names(), ["color", "mask"]);
    assert_eq!(Channels::from_names::<&str>(&[]).unwrap(), Channels::default());
    let error = Channels::from_names(&["depth", "distance_to_image"]).unwrap_err().to_string();
    assert!(error.starts_with("unknown channel \"distance_to_image\"; known names: \"distance_to_"), "{error}");
    assert!(Channels::from_names(&["RGB"]).unwrap_err().to_string().contains("\"rgb\""));
    assert_eq!(Channels::ALL.bytes_per_pixel(), 4 + 4 + 4 + 4 + 12 + 12 + 12 + 4 + 8);
}

/// The ray through the center of a pixel at depth 1, in the optical frame.
fn ray(matrix: &Matrix3<f64>, u: usize, v: usize) -> Vector3<f64> {
    let (x, y) = (u as f64 + 0.5 - matrix[(0, 2)], v as f64 + 0.5 - matrix[(1, 2)]);
    Vector3::new(x / matrix[(0, 0)], y / matrix[(1, 1)], 1.0)
}

/// Depth, normal and mask id of ground and ball in closed form; `None` near a silhouette or the horizon.
fn closed_form(pose: &Pose, direction: &Vector3<f64>, center: [f64; 3]) -> Option<(f64, Vector3<f64>, i32)> {
    let (o, d) = (pose.translation.vector, pose.rotation * direction);
    let to = Vector3::from(center) - o;
    let (a, b) = (d.norm_squared(), d.dot(&to));
    let discriminant = b * b - a * (to.norm_squared() - RADIUS * RADIUS);
    if d.z.abs() <= 0.02 || discriminant.abs() < 0.02 {
        return None;
    }
    let ground = if d.z < 0.0 { -o.z / d.z } else { f64::INFINITY };
    let ball = if discriminant > 0.0 { (b - discriminant.sqrt()) / a } else { f64::INFINITY };
    if ball < ground {
        return Some((ball, (d * ball - to) / RADIUS, BALL));
    }
    Some((ground, Vector3::z(), if ground < 100.0 { GROUND } else { 0 }))
}

/// Checks every channel of every environment against the closed forms.
fn check(camera: &Camera, steps: &[u64]) {
    let lenses = camera.intrinsic_matrices();
    let (mut judged, mut hits) = (0, [0; 2]);
    for (row, &env) in camera.env_ids().iter().enumerate() {
        let (pose, lens) = (pose_of(camera, row), Matrix3::from_fn(|i, j| lenses[(row, i, j)]));
        for (v, u) in (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u))) {
            let direction = ray(&lens, u, v);
            let Some((depth, normal, id)) = closed_form(&pose, &direction, ball(env, steps[env])) else { continue };
            judged += 1;
            let at = (row, v, u);
            assert_eq!(camera.mask().unwrap()[at], id, "{at:?}");
            let found = [camera.depth().unwrap()[at], camera.distance().unwrap()[at]].map(f64::from);
            if id == 0 {
                assert_eq!(found, [f64::INFINITY; 2]);
                continue;
            }
            hits[usize::from(id == BALL)] += 1;
            for (found, expected) in found.into_iter().zip([depth, depth * direction.norm()]) {
                assert!((found - expected).abs() < 2e-5 * expected, "{at:?}: {found} is not {expected}");
            }
            let point = pose * Point3::from(direction * depth);
            for axis in 0..3 {
                let at = (row, v, u, axis);
                let found = f64::from(camera.position().unwrap()[at]);
                assert!((found - point[axis]).abs() < 1e-4, "{at:?}: {found} is not {point}");
                for normals in [camera.normal().unwrap(), camera.shading_normal().unwrap()] {
                    let found = f64::from(normals[at]);
                    assert!((found - normal[axis]).abs() < 1e-3, "{at:?}: {found} is not of {normal}");
                }
            }
        }
    }
    assert!(judged > 0 && hits[0] > 100 && hits[1] > 20, "{judged} pixels, {hits:?}");
}

/// Values, shapes, and intrinsics and poses of single environments.
#[test]
fn channels() {
    let context = context(3);
    let mut camera = built(&cfg(), &context);
    check(&camera, &[0, 0, 0]);
    camera.update(&state(&[4, 5, 6])).unwrap();
    check(&camera, &[4, 5, 6]);
    assert_eq!(camera.image_shape(), (32, 48));
    assert_eq!((camera.color().unwrap().dim(), camera.depth().unwrap().dim()), ((3, 32, 48, 4), (3, 32, 48)));
    assert_eq!(camera.channel::<Depth>().unwrap(), camera.depth().unwrap());
    assert!(camera.color().unwrap().index_axis(Axis(3), 3).iter().all(|&alpha| alpha == 255));

    let mut camera = built(&cfg(), &context);
    let narrow = Intrinsics::Pixels { fx: 80.0, fy: 70.0, cx: 30.0, cy: 12.0 };
    camera.set_intrinsics(&[narrow, Intrinsics::Fovy { radians: 0.8 }], Some(&[2, 0])).unwrap();
    let (eyes, targets) = ([[-1.0, 0.7, 1.2], [0.3, -1.5, 0.4]], [[0.1, 0.0, 0.5], [0.2, 0.0, 0.4]]);
    camera.look_at(&eyes, &targets, &UP, Some(&[1, 2])).unwrap();
    check(&camera, &[0, 0, 0]);
    let lenses = camera.intrinsic_matrices();
    let of = |row| lenses.index_axis(Axis(0), row).to_owned();
    assert_eq!(of(2), array![[80.0, 0.0, 30.0], [0.0, 70.0, 12.0], [0.0, 0.0, 1.0]]);
    assert_eq!(of(1), array![[40.0, 0.0, 22.25], [0.0, 52.0, 17.5], [0.0, 0.0, 1.0]]);
    assert!((of(0)[(1, 1)] - 16.0 / 0.4f64.tan()).abs() < 1e-9);
    camera.restore(None).unwrap();
    assert_eq!(bits(&camera, 0..3), bits(&built(&cfg(), &context), 0..3));
}

/// The ground seen straight from above, in all conventions.
#[test]
fn conventions() {
    // The right of the image is +x.
    let forward_left_up = [-Vector3::z(), -Vector3::x(), Vector3::y()];
    let world = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&forward_left_up));
    let rotations =
        [from_wxyz([0., 1., 0., 0.]), UnitQuaternion::identity(), UnitQuaternion::from_rotation_matrix(&world)];
    for (convention, rotation) in CONVENTIONS.into_iter().zip(rotations) {
        let placement = Placement::Pose { pos: [5.0, 0.2, 2.5], rotation };
        let cfg = CameraCfg { extrinsics: Extrinsics { placement, convention, parent: None }, ..cfg() };
        let camera = built(&cfg, &context(1));
        assert!(camera.depth().unwrap().iter().all(|z| (z - 2.5).abs() < 1e-5), "{convention:?}");
        let corner = [0, 1].map(|k| f64::from(camera.position().unwrap()[(0, 0, 0, k)]));
        let expected = [5.0 + (0.5 - 22.25) / 40.0 * 2.5, 0.2 - (0.5 - 17.5) / 52.0 * 2.5];
        assert!((0..2).all(|k| (corner[k] - expected[k]).abs() < 1e-4), "{convention:?}: {corner:?}");
        let distance = f64::from(camera.distance().unwrap()[(0, 0, 0)]);
        assert!((distance - 2.5 * ray(&LENS.matrix(48, 32).unwrap(), 0, 0).norm()).abs() < 1e-5);
        let pose = Pose::from_parts([5.0, 0.2, 2.5].into(), rotation);
        for row in [camera.local_pose(convention), camera.pose_w(convention)] {
            assert!(row.iter().zip(to_row(&pose)).all(|(a, b)| (a - b).abs() < 1e-12), "{row}");
        }
    }
}

/// An attached camera equals a free camera that moves.
#[test]
fn attached() {
    let context = context(2);
    for (convention, name) in CONVENTIONS.into_iter().flat_map(|c| ["tip", "arm/tip"].map(|name| (c, name))) {
        // Looks along +x of the link.
        let rotation = CameraConvention::World.to_optical(&Pose::identity()).rotation;
        let local = convention.pose_from_optical(&Pose::from_parts([0.05, 0.02, 0.1].into(), rotation));
        let placement = Placement::Pose { pos: local.translation.into(), rotation: local.rotation };
        let extrinsics = Extrinsics { parent: Some(name.into()), placement, convention };
        let mut attached = built(&CameraCfg { extrinsics, ..cfg() }, &context);
        let mut free = built(&cfg(), &context);
        for steps in [[0, 0], [3, 2], [4, 5]] {
            attached.refresh(&[0, 1], &state(&steps)).unwrap();
            free.refresh(&[0, 1], &state(&steps)).unwrap();
            // As in the state: a row, from which the quaternion is normalized.
            let link = |env: usize| from_row(&to_row(&tip(env, steps[env])));
            let composed = [0, 1].map(|env| link(env) * convention.to_optical(&local));
            free.set_local_pose(&composed, None, ROS).unwrap();
            assert_eq!(bits(&attached, 0..2), bits(&free, 0..2), "{convention:?}, {steps:?}");
            assert_eq!(attached.pose_w(ROS), free.pose_w(ROS));
            check(&attached, &steps);
        }
    }
}

/// A world pose places an attached camera; from then on the camera moves with its link.
#[test]
fn world_pose_of_attached() {
    let mut camera = built(&on("tip"), &context(2));
    camera.refresh(&[0, 1], &state(&[3, 2])).unwrap();
    let there = look_at_pose([-1.2, 0.4, 0.9], [0.1, 0.0, 0.5], [0., 0., 1.]).unwrap();
    let close = |found: ndarray::ArrayView1<'_, f64>, row: [f64; 7]| (0..7).all(|k| (found[k] - row[k]).abs() < 1e-12);
    for convention in CONVENTIONS {
        let row = to_row(&convention.pose_from_optical(&there));
        camera.set_world_poses(&Array2::from(vec![row]), None, convention).unwrap();
        let found = camera.pose_w(convention);
        assert!((0..2).all(|env| close(found.row(env), row)), "{found} is not {row:?}");
    }
    check(&camera, &[3, 2]);
    camera.refresh(&[1], &state(&[3, 9])).unwrap();
    let moved = tip(1, 9) * tip(1, 2).inverse() * there;
    let found = camera.pose_w(ROS);
    assert!(close(found.row(1), to_row(&moved)) && close(found.row(0), to_row(&there)));
}

/// Straight up and straight down; the other environments stay unchanged.
#[test]
fn vertical() {
    let mut camera = built(&cfg(), &context(3));
    let before = bits(&camera, [0, 2]);
    camera.look_at(&[[5.0, 0.0, 2.0]], &[[5.0, 0.0, 0.0]], &UP, Some(&[1])).unwrap();
    assert_eq!(bits(&camera, [0, 2]), before);
    assert!(camera.depth().unwrap().index_axis(Axis(0), 1).iter().all(|z| (z - 2.0).abs() < 1e-5));
    // The upward direction of the image is +y.
    let y = |row: usize| camera.position().unwrap()[(1, row, 0, 1)];
    assert!(y(0) > y(31));
    camera.look_at(&[[5.0, 0.0, 2.0]], &[[5.0, 0.0, 9.0]], &UP, Some(&[1])).unwrap();
    assert!(camera.depth().unwrap().index_axis(Axis(0), 1).iter().all(|&z| z == f32::INFINITY));
    assert!(camera.mask().unwrap().index_axis(Axis(0), 1).iter().all(|&id| id == 0));
    assert_eq!(bits(&camera, [0, 2]), before);
}

#[test]
fn misses() {
    let context = context(2);
    let camera = built(&cfg(), &context);
    let ids = camera.mask().unwrap();
    assert!(ids.iter().filter(|&&id| id == 0).count() > 100);
    for (depth_miss, value) in [(DepthMiss::Inf, f32::INFINITY), (DepthMiss::Far, 100.0), (DepthMiss::Zero, 0.0)] {
        let other = built(&CameraCfg { depth_miss, ..cfg() }, &context);
        for (there, here) in [(camera.depth(), other.depth()), (camera.distance(), other.distance())] {
            for ((a, b), id) in there.unwrap().iter().zip(here.unwrap()).zip(ids) {
                assert_eq!(*b, if *id == 0 { value } else { *a });
            }
        }
        let cloud = other.point_cloud(0, PointFrame::World).unwrap();
        assert_eq!(cloud, camera.point_cloud(0, PointFrame::World).unwrap());
    }
}

/// Points equal the position channel; in the frame of the camera, z is the depth.
#[test]
fn points() {
    let context = context(3);
    let mut camera = built(&CameraCfg { env_ids: Some(vec![2, 0]), ..cfg() }, &context);
    camera.update(&state(&[4, 5, 6])).unwrap();
    for (row, env) in [(0, 2), (1, 0)] {
        let (position, mask) = (camera.position().unwrap(), camera.mask().unwrap());
        let map = camera.point_map(env, PointFrame::World).unwrap();
        let mut hits = Vec::new();
        for ((v, u), id) in mask.index_axis(Axis(0), row).indexed_iter() {
            let a: [f32; 3] = std::array::from_fn(|k| map[(v, u, k)]);
            if *id == 0 {
                assert_eq!(a, [f32::INFINITY; 3]);
                continue;
            }
            // The distance limits the remaining digits.
            let scale = camera.distance().unwrap()[(row, v, u)].max(1.0);
            for k in 0..3 {
                let b = position[(row, v, u, k)];
                assert!((a[k] - b).abs() < 4.0 * f32::EPSILON * scale, "{a:?} {b:?}");
            }
            hits.push(a);
        }
        assert_eq!(camera.point_cloud(env, PointFrame::World).unwrap(), Array2::from(hits));
        let (own, depth) = (camera.point_map(env, PointFrame::Camera).unwrap(), camera.depth().unwrap());
        assert_eq!(own.index_axis(Axis(2), 2), depth.index_axis(Axis(0), row));
    }
    let without = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..cfg() };
    assert!(built(&without, &context).point_cloud(0, PointFrame::World).is_err());
}

fn refused(cfg: CameraCfg) -> SensorError {
    cfg.build(&context(2)).unwrap_err()
}

#[test]
fn bad_configurations() {
    use SensorError::Camera;
    for (width, height) in [(0, 32), (48, 0), (usize::MAX, 2), (10_000, 10_000), (1 << 40, 1 << 40)] {
        let error = refused(CameraCfg { width, height, ..cfg() });
        assert!(matches!(error, Camera(CameraError::View(RenderError::Size { .. }))), "{error}");
    }
    for (near, far) in
        [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (1.0, 1.0), (f64::NAN, 1.0), (0.1, f64::INFINITY), (0.1, 1e300)]
    {
        let error = refused(CameraCfg { near, far, ..cfg() });
        assert!(matches!(error, Camera(CameraError::View(RenderError::Range { .. }))), "{error}");
    }
    let lens = |fx| CameraCfg { intrinsics: Intrinsics::Pixels { fx, fy: 1.0, cx: 0.0, cy: 0.0 }, ..cfg() };
    for fx in [0.0, -5.0, f64::NAN, f64::INFINITY] {
        let error = refused(lens(fx));
        assert!(matches!(error, Camera(CameraError::Optics(OpticsError::Lens { what: "fx", .. }))), "{error}");
    }
    assert!(matches!(refused(lens(1e30)), Camera(CameraError::View(_))));
    let mut samples = cfg();
    samples.raster.samples = 3;
    assert!(matches!(refused(samples), Camera(CameraError::View(RenderError::Samples { samples: 3 }))));

    let place = |placement| CameraCfg { extrinsics: Extrinsics { placement, ..Default::default() }, ..cfg() };
    let nan = Placement::Pose { pos: [0.0, f64::NAN, 0.0], rotation: UnitQuaternion::identity() };
    let zero = UnitQuaternion::new_unchecked(Quaternion::new(0.0, 0.0, 0.0, 0.0));
    for placement in [nan, Placement::Pose { pos: [0.0; 3], rotation: zero }] {
        assert!(matches!(refused(place(placement)), Camera(CameraError::Pose { .. })));
    }
    let same = Placement::LookAt { eye: [1.0; 3], target: [1.0; 3], up: [0.0, 0.0, 1.0] };
    assert!(matches!(refused(place(same)), Camera(CameraError::LookAt { .. })));
    let error = refused(on("tpi")).to_string();
    assert!(error.starts_with("unknown body \"tpi\"; known names: \"arm/tip\""), "{error}");

    let flow = CameraCfg { channels: Channels { flow: true, ..Channels::NONE }, ..cfg() };
    let rays = |lens, imperfections| CameraCfg {
        lens: Lens::from_name(lens).unwrap(),
        renderer: Renderer::FastRayTraced,
        channels: Channels { color: true, depth: true, ..Channels::NONE },
        imperfections,
        ..cfg()
    };
    let vignetting = Imperfections { vignetting: Some(Default::default()), ..Default::default() };
    let holes = Imperfections { holes: Some(Default::default()), ..Default::default() };
    let what = "projector shadows (holes with a baseline other than 0)";
    let some = |env_ids: &[usize]| CameraCfg { env_ids: Some(env_ids.to_vec()), ..cfg() };
    for (cfg, expected) in [
        (CameraCfg { channels: Channels::default(), ..cfg() }, CameraError::NoChannels.into()),
        (CameraCfg { latency_steps: 1, ..flow.clone() }, CameraError::FlowWithLatency.into()),
        (CameraCfg { history_length: 1, ..flow.clone() }, CameraError::FlowWithLatency.into()),
        (CameraCfg { dropout: 0.1, ..flow }, CameraError::FlowWithLatency.into()),
        (rays("panorama", vignetting), CameraError::NoAxis { what: "vignetting", lens: "panorama" }.into()),
        (rays("equidistant", holes), CameraError::PinholeOnly { what, lens: "equidistant" }.into()),
        (some(&[]), CameraError::NoEnvironments.into()),
        (some(&[1, 1]), CameraError::DuplicateEnvironment { env: 1 }.into()),
        (some(&[0, 2]), SensorError::IndexOutOfRange { what: "environment", index: 2, count: 2 }),
    ] {
        assert_eq!(refused(cfg), expected);
    }
    let odd = CameraCfg { update_period: 0.007, ..cfg() };
    assert!(matches!(refused(odd.clone()), SensorError::PeriodNotMultiple { .. }));
    assert!(CameraCfg { round_period: true, ..odd }.build(&context(2)).is_ok());
    let nothing = crate::SensorContext { scene: None, ..context(2) };
    assert_eq!(cfg().build(&nothing).unwrap_err(), CameraError::NoScene.into());
    // Path tracing keeps 64 bytes per pixel: its result and the input of the denoiser.
    for (renderer, paths) in [(cfg().renderer, ""), (Renderer::RAY_TRACED, ", with 4096000000 bytes for path tracing,")]
    {
        let huge = CameraCfg { width: 8000, height: 8000, renderer, ..cfg() };
        let error = huge.build(&context(100)).unwrap_err().to_string();
        let text = format!("images of 100 environments with 8000 x 8000 pixels of 56 bytes{paths} do");
        assert!(error.starts_with(&text), "{error}");
        assert!(!paths.is_empty() || error.starts_with(&(text + " not fit into memory")), "{error}");
    }
}

#[test]
fn bad_readings() {
    let channels = Channels { depth: true, mask: true, ..Default::default() };
    let mut camera = CameraCfg { channels, ..cfg() }.build(&context(2)).unwrap();
    assert_eq!(camera.depth().unwrap_err(), CameraError::NothingCaptured { env: 0 }.into());
    camera.reset(&[0], &state(&[0, 0])).unwrap();
    let error = camera.depth().unwrap_err().to_string();
    assert_eq!(error, "the camera has not captured environment 1 yet; reset or update it first");
    camera.reset(&[1], &state(&[0, 0])).unwrap();
    camera.depth().unwrap();
    assert_eq!(camera.color().unwrap_err().to_string(), "the camera does not measure color; it measures depth, mask");
    assert_eq!(camera.render_count(), 2, "the mistake rendered nothing");
    assert!(matches!(camera.point_cloud(2, Default::default()), Err(SensorError::IndexOutOfRange { index: 2, .. })));
}

#[test]
fn bad_states() {
    let mut camera = built(&on("tip"), &context(2));
    let before = bits(&camera, 0..2);
    let good = || state(&[1, 1]);
    let mut no_lights = good();
    no_lights.visible.as_mut().unwrap().lights = Default::default();
    for (bad, text) in [
        (SceneState { body_poses: None, ..good() }, "the state lacks poses, which the camera sensor requires"),
        (SceneState { visible: None, ..good() }, "the state lacks visible, which the camera sensor requires"),
        (state(&[1, 1, 1]), "the state has 3 environments, but the sensor was built for 2"),
        (no_lights, "the state has 0 environments with lights, but the sensor was built for 2"),
        (
            SceneState { body_poses: Some(ndarray::Array3::zeros((2, 1, 7))), ..good() },
            "the state has 1 bodies, but the sensor was built for 3",
        ),
    ] {
        assert_eq!(camera.update(&bad).unwrap_err().to_string(), text);
    }
    assert!(matches!(camera.reset(&[0, 5], &state(&[0, 0])), Err(SensorError::IndexOutOfRange { index: 5, .. })));
    assert!(matches!(camera.refresh(&[5], &state(&[0, 0])), Err(SensorError::IndexOutOfRange { index: 5, .. })));
    assert_eq!((bits(&camera, 0..2), camera.frame_counts().sum()), (before, 0));

    // An environment that cannot be rendered is an error until it can be.
    let context = context(3);
    let mut camera = built(&CameraCfg { lazy: false, ..cfg() }, &context);
    let mut bad = state(&[1, 1, 1]);
    bad.visible.as_mut().unwrap().instance_poses[(1, 1)] = PoseF32::from_translation([f32::NAN; 3]);
    camera.update(&bad).unwrap();
    for error in [camera.depth().unwrap_err(), camera.color().unwrap_err()] {
        assert!(matches!(error, SensorError::Camera(CameraError::Render { env: 1, .. })), "{error}");
    }
    let mut good = built(&cfg(), &context);
    for camera in [&mut camera, &mut good] {
        camera.update(&state(&[1, 2, 1])).unwrap();
    }
    assert_eq!(bits(&camera, 0..3), bits(&good, 0..3));
}

/// Setters change all values or none.
#[test]
fn bad_setters() {
    let context = context(3);
    let mut camera = built(&CameraCfg { env_ids: Some(vec![2, 0]), ..cfg() }, &context);
    let before = bits(&camera, 0..2);
    let (good, broken) = (Pose::translation(0.0, 0.0, 1.0), Pose::translation(f64::NAN, 0.0, 0.0));
    let thin = Intrinsics::Pixels { fx: 1e-9, fy: 1.0, cx: 0.0, cy: 0.0 };
    let mistakes: Vec<Result<(), SensorError>> = vec![
        camera.set_local_pose(&[good, broken], None, ROS),
        camera.set_world_poses(&[good, broken], None, ROS),
        camera.set_local_pose(&[good; 3], None, ROS),
        camera.set_local_pose(&[good; 2], Some(&[0]), ROS),
        camera.set_local_pose(&good, Some(&[0, 1]), ROS),
        camera.set_local_pose(&good, Some(&[0, 3]), ROS),
        camera.set_local_pose(&good, Some(&[0, 0]), ROS),
        camera.set_local_pose(&array![[0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]], None, ROS),
        camera.set_local_pose(&array![[0.0, 0.0, 1.0]], None, ROS),
        camera.look_at(&[[1.0; 3]], &[[0.0; 3], [1.0; 3]], &UP, None),
        camera.look_at(&[[1.0; 3]], &[], &UP, None),
        camera.set_intrinsics(&[Intrinsics::ISAAC, Intrinsics::Fovy { radians: 4.0 }], None),
        camera.set_intrinsics(&[thin], None),
        camera.set_intrinsics(&[Intrinsics::ISAAC; 3], None),
        camera.restore(Some(&[1])),
    ];
    let kinds: Vec<_> = mistakes.into_iter().map(Result::unwrap_err).collect();
    assert_eq!(kinds[2], CameraError::Count { what: "poses", expected: 2, found: 3 }.into());
    assert_eq!(kinds[4], CameraError::NotSeen { env: 1, seen: vec![2, 0] }.into());
    assert_eq!(kinds[5], SensorError::IndexOutOfRange { what: "environment", index: 3, count: 3 });
    assert_eq!(kinds[6], CameraError::DuplicateEnvironment { env: 0 }.into());
    assert_eq!(kinds[4].to_string(), "the camera does not see environment 1; it sees 2, 0");
    assert_eq!((bits(&camera, 0..2), camera.render_count()), (before, 2), "not rendered again");

    let mut unborn = on("ball").build(&context).unwrap();
    assert_eq!(unborn.set_world_poses(&good, None, ROS), Err(CameraError::NothingCaptured { env: 0 }.into()));
    assert!(unborn.pose_w(ROS).iter().all(|x| x.is_nan()));
    unborn.set_local_pose(&good, None, ROS).unwrap();
}

#[test]
fn levels_of_detail() {
    assert!(CameraCfg::default().raster.lod, "levels are the default");
}
