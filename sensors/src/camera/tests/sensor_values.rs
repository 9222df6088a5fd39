//! What the camera measures, held against closed forms.

use super::super::channel::Depth;
use super::super::{
    Camera, CameraCfg, CameraConvention, Channels, DepthMiss, Extrinsics, Intrinsics, Placement, PointFrame,
    look_at_pose,
};
use super::stage::{BALL, GROUND, LENS, RADIUS, SIZE, ball, bits, built, cfg, context, state, tip};
use crate::sensor::Sensor;
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};
use ndarray::{Array2, Axis, array};
use scene::Pose;
use scene::pose::{from_wxyz, to_row};

const ALL_CONVENTIONS: [CameraConvention; 3] =
    [CameraConvention::Ros, CameraConvention::OpenGl, CameraConvention::World];

/// The direction through the centre of a pixel whose depth is 1, in the optical frame.
fn ray(matrix: &Matrix3<f64>, u: usize, v: usize) -> Vector3<f64> {
    let (x, y) = (u as f64 + 0.5 - matrix[(0, 2)], v as f64 + 0.5 - matrix[(1, 2)]);
    Vector3::new(x / matrix[(0, 0)], y / matrix[(1, 1)], 1.0)
}

/// Depth, normal and mask id of the ground and the ball, by hand; `None` near a silhouette or the horizon.
fn by_hand(pose: &Pose, direction: &Vector3<f64>, center: [f64; 3]) -> Option<(f64, Vector3<f64>, i32)> {
    let (o, d) = (pose.translation.vector, pose.rotation * direction);
    let ground = -o.z / d.z;
    let ground = if d.z < -0.02 {
        ground
    } else if d.z > 0.02 {
        f64::INFINITY
    } else {
        return None;
    };
    let to = Vector3::from(center) - o;
    let (a, b) = (d.norm_squared(), d.dot(&to));
    let discriminant = b * b - a * (to.norm_squared() - RADIUS * RADIUS);
    if discriminant.abs() < 0.02 {
        return None;
    }
    let ball = if discriminant > 0.0 { (b - discriminant.sqrt()) / a } else { f64::INFINITY };
    if ball < ground {
        return Some((ball, (d * ball - to) / RADIUS, BALL));
    }
    Some((ground, Vector3::z(), if ground < 100.0 { GROUND } else { 0 }))
}

/// Every channel of every environment, against the closed forms.
fn check(camera: &Camera, steps: &[u64]) {
    let (poses, lenses) = (camera.pose_w(CameraConvention::Ros), camera.intrinsic_matrices());
    let (mut judged, mut hits) = (0, [0; 2]);
    for (row, &env) in camera.env_ids().iter().enumerate() {
        let numbers: [f64; 7] = std::array::from_fn(|k| poses[(row, k)]);
        let pose = scene::pose::from_row(&numbers);
        let lens = Matrix3::from_fn(|i, j| lenses[(row, i, j)]);
        for (v, u) in (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u))) {
            let direction = ray(&lens, u, v);
            let Some((depth, normal, id)) = by_hand(&pose, &direction, ball(env, steps[env])) else { continue };
            judged += 1;
            let at = (row, v, u);
            assert_eq!(camera.mask().unwrap()[at], id, "{at:?}");
            let found = f64::from(camera.depth().unwrap()[at]);
            let distance = f64::from(camera.distance().unwrap()[at]);
            if id == 0 {
                assert_eq!((found, distance), (f64::INFINITY, f64::INFINITY));
                continue;
            }
            hits[usize::from(id == BALL)] += 1;
            assert!((found - depth).abs() < 2e-5 * depth, "{at:?}: {found} is not {depth}");
            let expected = depth * direction.norm();
            assert!((distance - expected).abs() < 2e-5 * expected, "{at:?}: {distance} is not {expected}");
            let point = pose * Point3::from(direction * depth);
            for axis in 0..3 {
                let found = f64::from(camera.position().unwrap()[(row, v, u, axis)]);
                assert!((found - point[axis]).abs() < 1e-4, "{at:?}: {found} is not {point}");
                for normals in [camera.normal().unwrap(), camera.shading_normal().unwrap()] {
                    let found = f64::from(normals[(row, v, u, axis)]);
                    assert!((found - normal[axis]).abs() < 1e-3, "{at:?}: {found} is not of {normal}");
                }
            }
        }
    }
    assert!(judged > 0 && hits[0] > 100 && hits[1] > 20, "{judged} pixels, {hits:?}");
}

#[test]
fn every_channel_is_as_computed_by_hand() {
    let context = context(3);
    let mut camera = built(&cfg(), &context);
    check(&camera, &[0, 0, 0]);
    camera.update(&state(&[4, 5, 6])).unwrap();
    check(&camera, &[4, 5, 6]);
    assert_eq!(camera.image_shape(), (32, 48));
    assert_eq!(camera.color().unwrap().dim(), (3, 32, 48, 4));
    assert_eq!(camera.depth().unwrap().dim(), (3, 32, 48));
    assert_eq!(camera.channel::<Depth>().unwrap(), camera.depth().unwrap());
    assert!(camera.color().unwrap().index_axis(Axis(3), 3).iter().all(|&alpha| alpha == 255));
}

#[test]
fn lenses_and_places_are_of_each_environment() {
    let context = context(3);
    let mut camera = built(&cfg(), &context);
    let narrow = Intrinsics::Pixels { fx: 80.0, fy: 70.0, cx: 30.0, cy: 12.0 };
    camera.set_intrinsics(&[narrow, Intrinsics::Fovy { radians: 0.8 }], Some(&[2, 0])).unwrap();
    let eyes = [[-1.0, 0.7, 1.2], [0.3, -1.5, 0.4]];
    let targets = [[0.1, 0.0, 0.5], [0.2, 0.0, 0.4]];
    camera.look_at(&eyes, &targets, &[[0.0, 0.0, 1.0]], Some(&[1, 2])).unwrap();
    check(&camera, &[0, 0, 0]);
    let lenses = camera.intrinsic_matrices();
    let of = |row| lenses.index_axis(Axis(0), row).to_owned();
    assert_eq!(of(2), array![[80.0, 0.0, 30.0], [0.0, 70.0, 12.0], [0.0, 0.0, 1.0]]);
    assert_eq!(of(1), array![[40.0, 0.0, 22.25], [0.0, 52.0, 17.5], [0.0, 0.0, 1.0]]);
    assert!((of(0)[(1, 1)] - 16.0 / 0.4f64.tan()).abs() < 1e-9);
    camera.restore(None).unwrap();
    assert_eq!(bits(&camera, 0..3), bits(&built(&cfg(), &context), 0..3));
}

#[test]
fn the_ground_from_above_in_all_conventions() {
    let context = context(1);
    // Looks straight down, the picture's right is +x.
    let forward_left_up = [-Vector3::z(), -Vector3::x(), Vector3::y()];
    let world = Rotation3::from_matrix_unchecked(Matrix3::from_columns(&forward_left_up));
    let rotations =
        [from_wxyz([0., 1., 0., 0.]), UnitQuaternion::identity(), UnitQuaternion::from_rotation_matrix(&world)];
    for (convention, rotation) in ALL_CONVENTIONS.into_iter().zip(rotations) {
        let placement = Placement::Pose { pos: [5.0, 0.2, 2.5], rotation };
        let cfg = CameraCfg { extrinsics: Extrinsics { placement, convention, parent: None }, ..cfg() };
        let camera = built(&cfg, &context);
        assert!(camera.depth().unwrap().iter().all(|z| (z - 2.5).abs() < 1e-5), "{convention:?}");
        let corner = camera.position().unwrap().index_axis_move(Axis(0), 0).index_axis_move(Axis(0), 0);
        let (x, y) = (5.0 + (0.5 - 22.25) / 40.0 * 2.5, 0.2 - (0.5 - 17.5) / 52.0 * 2.5);
        assert!((f64::from(corner[(0, 0)]) - x).abs() < 1e-4 && (f64::from(corner[(0, 1)]) - y).abs() < 1e-4);
        let distance = f64::from(camera.distance().unwrap()[(0, 0, 0)]);
        let expected = 2.5 * ray(&LENS.matrix(48, 32).unwrap(), 0, 0).norm();
        assert!((distance - expected).abs() < 1e-5);
        let pose = Pose::from_parts([5.0, 0.2, 2.5].into(), rotation);
        for row in [camera.local_pose(convention), camera.pose_w(convention)] {
            assert!(row.iter().zip(to_row(&pose)).all(|(a, b)| (a - b).abs() < 1e-12), "{row}");
        }
    }
}

#[test]
fn an_attached_camera_is_a_free_one_that_moves() {
    let context = context(2);
    for convention in ALL_CONVENTIONS {
        // Looks along +x of the link.
        let rotation = CameraConvention::World.to_optical(&Pose::identity()).rotation;
        let optical = Pose::from_parts([0.05, 0.02, 0.1].into(), rotation);
        let local = convention.of_optical(&optical);
        let placement = Placement::Pose { pos: local.translation.into(), rotation: local.rotation };
        for name in ["tip", "arm/tip"] {
            let extrinsics = Extrinsics { parent: Some(name.into()), placement, convention };
            let mut attached = built(&CameraCfg { extrinsics, ..cfg() }, &context);
            let mut free = built(&cfg(), &context);
            for steps in [[0, 0], [3, 2], [4, 5]] {
                attached.refresh(&[0, 1], &state(&steps)).unwrap();
                free.refresh(&[0, 1], &state(&steps)).unwrap();
                let mounted = convention.to_optical(&local);
                // As the state has it: in a row, from which it is normalised.
                let link = |env: usize| scene::pose::from_row(&to_row(&tip(env, steps[env])));
                let composed = [link(0) * mounted, link(1) * mounted];
                free.set_local_pose(&composed, None, CameraConvention::Ros).unwrap();
                assert_eq!(bits(&attached, 0..2), bits(&free, 0..2), "{convention:?}, {steps:?}");
                assert_eq!(attached.pose_w(CameraConvention::Ros), free.pose_w(CameraConvention::Ros));
                check(&attached, &steps);
            }
        }
    }
}

#[test]
fn a_world_pose_puts_an_attached_camera_there() {
    let context = context(2);
    let extrinsics = Extrinsics { parent: Some("tip".into()), ..Extrinsics::default() };
    let mut camera = built(&CameraCfg { extrinsics, ..cfg() }, &context);
    camera.refresh(&[0, 1], &state(&[3, 2])).unwrap();
    let there = look_at_pose([-1.2, 0.4, 0.9], [0.1, 0.0, 0.5], [0., 0., 1.]).unwrap();
    for convention in ALL_CONVENTIONS {
        let row = to_row(&convention.of_optical(&there));
        camera.set_world_poses(&Array2::from(vec![row]), None, convention).unwrap();
        let found = camera.pose_w(convention);
        for env in 0..2 {
            assert!((0..7).all(|k| (found[(env, k)] - row[k]).abs() < 1e-12), "{found} is not {row:?}");
        }
    }
    check(&camera, &[3, 2]);
    // From then on it moves with the link.
    camera.refresh(&[1], &state(&[3, 9])).unwrap();
    let moved = tip(1, 9) * tip(1, 2).inverse() * there;
    let found = camera.pose_w(CameraConvention::Ros);
    assert!(to_row(&moved).iter().zip(found.row(1)).all(|(a, b)| (a - b).abs() < 1e-12));
    assert!(to_row(&there).iter().zip(found.row(0)).all(|(a, b)| (a - b).abs() < 1e-12));
}

#[test]
fn straight_up_and_down_and_its_neighbours_stay() {
    let context = context(3);
    let mut camera = built(&cfg(), &context);
    let before = bits(&camera, [0, 2]);
    let (down, up) = ([[5.0, 0.0, 0.0]], [[5.0, 0.0, 9.0]]);
    camera.look_at(&[[5.0, 0.0, 2.0]], &down, &[[0.0, 0.0, 1.0]], Some(&[1])).unwrap();
    assert_eq!(bits(&camera, [0, 2]), before);
    let depth = camera.depth().unwrap();
    assert!(depth.index_axis(Axis(0), 1).iter().all(|z| (z - 2.0).abs() < 1e-5));
    // The picture's upward direction is +y.
    let y = |row: usize| camera.position().unwrap()[(1, row, 0, 1)];
    assert!(y(0) > y(31));
    camera.look_at(&[[5.0, 0.0, 2.0]], &up, &[[0.0, 0.0, 1.0]], Some(&[1])).unwrap();
    assert!(camera.depth().unwrap().index_axis(Axis(0), 1).iter().all(|&z| z == f32::INFINITY));
    assert!(camera.mask().unwrap().index_axis(Axis(0), 1).iter().all(|&id| id == 0));
    assert_eq!(bits(&camera, [0, 2]), before);
}

#[test]
fn what_a_miss_says_is_chosen() {
    let context = context(2);
    let camera = built(&cfg(), &context);
    let misses = camera.mask().unwrap().iter().filter(|&&id| id == 0).count();
    assert!(misses > 100);
    for (depth_miss, value) in [(DepthMiss::Inf, f32::INFINITY), (DepthMiss::Far, 100.0), (DepthMiss::Zero, 0.0)] {
        let other = built(&CameraCfg { depth_miss, ..cfg() }, &context);
        for (there, here) in [(camera.depth(), other.depth()), (camera.distance(), other.distance())] {
            let (there, here) = (there.unwrap(), here.unwrap());
            let ids = camera.mask().unwrap();
            for ((a, b), id) in there.iter().zip(here.iter()).zip(ids.iter()) {
                assert_eq!(*b, if *id == 0 { value } else { *a });
            }
        }
        let map = other.point_cloud(0, PointFrame::World).unwrap();
        assert_eq!(map, camera.point_cloud(0, PointFrame::World).unwrap());
    }
}

#[test]
fn points_are_those_of_the_position_channel() {
    let context = context(3);
    let mut camera = built(&CameraCfg { env_ids: Some(vec![2, 0]), ..cfg() }, &context);
    camera.update(&state(&[4, 5, 6])).unwrap();
    for (row, env) in [(0, 2), (1, 0)] {
        let position = camera.position().unwrap().index_axis_move(Axis(0), row);
        let mask = camera.mask().unwrap().index_axis_move(Axis(0), row);
        let map = camera.point_map(env, PointFrame::World).unwrap();
        let mut hits = Vec::new();
        for ((v, u), id) in mask.indexed_iter() {
            let (a, b): ([f32; 3], [f32; 3]) =
                (std::array::from_fn(|k| map[(v, u, k)]), std::array::from_fn(|k| position[(v, u, k)]));
            if *id == 0 {
                assert_eq!(a, [f32::INFINITY; 3]);
                continue;
            }
            // The distance sets how much of the digits is left.
            let scale = camera.distance().unwrap()[(row, v, u)].max(1.0);
            for k in 0..3 {
                assert!((a[k] - b[k]).abs() < 4.0 * f32::EPSILON * scale, "{a:?} {b:?}");
            }
            hits.push(a);
        }
        let cloud = camera.point_cloud(env, PointFrame::World).unwrap();
        assert_eq!(cloud, Array2::from(hits));
        // In the camera's own frame, z is the depth.
        let (own, depth) = (camera.point_map(env, PointFrame::Camera).unwrap(), camera.depth().unwrap());
        assert_eq!(own.index_axis(Axis(2), 2), depth.index_axis(Axis(0), row));
    }
    let without = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..cfg() };
    assert!(built(&without, &context).point_cloud(0, PointFrame::World).is_err());
}
