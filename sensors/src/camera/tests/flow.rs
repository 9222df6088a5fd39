//! Optical flow, held against projections at both instants.

use super::super::channel::Flow;
use super::super::{
    Before, Camera, CameraCfg, CameraConvention, Channels, Extrinsics, Frame, Intrinsics, LensRays, Optics,
    PixelIntrinsics, RasterCfg, Rasterizer, Renderer, Shot,
};
use super::scenes::{Random, random};
use super::stage::{BALL, GROUND, SIZE, ball, built, cfg, context, state, tip};
use crate::sensor::{Sensor, SensorCfg};
use crate::visibility::{RenderError, View};
use nalgebra::{Matrix3, Point3, Vector3};
use scene::pose::{from_row, to_row};
use scene::{Pose, PoseF32, RenderScene};

const WANTED: Channels = Channels { flow: true, mask: true, position: true, depth: true, ..Channels::NONE };

/// Pixels by which single precision may be off: coordinates of some metres have 5e-7 m, which are 1e-5 pixels for each pixel
/// of focal length and metre of distance; those of 100 pixels at 0.5 m 1e-4, some of them added.
const ROUNDING: f64 = 1e-3;

fn wide(pose: &PoseF32) -> Pose {
    let r = pose.rotation.map(|row| row.map(f64::from));
    let matrix = nalgebra::Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| r[i][j]));
    let rotation = nalgebra::UnitQuaternion::from_rotation_matrix(&matrix);
    Pose::from_parts(Vector3::from(pose.translation.map(f64::from)).into(), rotation)
}

/// Where a point of the environment is in the picture of a view, and its depth.
fn project(view: &View, point: &Point3<f64>) -> ([f64; 2], f64) {
    let p = wide(&view.world_from_camera).inverse() * point;
    let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
    ([fx * p.x / p.z + cx, fy * p.y / p.z + cy], p.z)
}

fn draw(renderer: Renderer, shot: Shot<'_>) -> Frame {
    let mut rasterizer = Rasterizer::new(RasterCfg { lod: false, ..RasterCfg::default() });
    rasterizer.renderer = renderer;
    let mut frame = Frame::new(shot.view.width, shot.view.height, WANTED);
    rasterizer.render_shot(&shot, &mut frame.as_mut()).unwrap();
    frame
}

/// Every pixel of a picture against the points that it shows, moved back with their things: how many were judged.
fn check(frame: &Frame, shot: &Shot<'_>) -> usize {
    let Some(Before { poses: before, view: old }) = shot.before else { panic!() };
    let (flow, mask) = (frame.flow.as_ref().unwrap(), frame.mask.as_ref().unwrap());
    let mut judged = 0;
    for (k, id) in mask.iter().enumerate() {
        let found = [0, 1].map(|axis| f64::from(flow[2 * k + axis]));
        if *id == 0 {
            assert!(found.iter().all(|x| *x == f64::INFINITY), "nothing is there: {found:?}");
            continue;
        }
        let point = Point3::from([0, 1, 2].map(|axis| f64::from(frame.position.as_ref().unwrap()[3 * k + axis])));
        let at = shot.scene.instances().iter().position(|instance| instance.mask_id == *id).unwrap();
        let then = wide(&before[at]) * (wide(&shot.poses[at]).inverse() * point);
        let (there, z) = project(old, &then);
        if z.abs() < 0.05 {
            continue;
        }
        if z < 0.0 {
            assert!(found.iter().all(|x| *x == f64::INFINITY), "it was behind the camera: {found:?}");
            continue;
        }
        judged += 1;
        let here = [(k % shot.view.width) as f64 + 0.5, (k / shot.view.width) as f64 + 0.5];
        for axis in 0..2 {
            let expected = here[axis] - there[axis];
            // Far beside the picture before, digits are lost with the slant; far away, with the distance.
            let scale = (1.0 + expected.abs() / 100.0) * (1.0 + point.coords.norm() / z / 4.0);
            assert!(
                (found[axis] - expected).abs() < ROUNDING * scale,
                "{id}: {found:?} is not {expected} along {axis}"
            );
        }
    }
    judged
}

#[test]
fn random_scenes_move_as_their_points_do() {
    let mut numbers = Random(21);
    let mut judged = 0;
    for seed in 0..16 {
        let r = &mut numbers;
        let (scene, poses) = random(r, 1.2);
        let (eye, target) = (r.pose(3.0), r.vector(-0.5, 0.5).map(|x| x as f32));
        let view = View::look_at([96, 72], 1.0, eye.translation, target, [0., 0., 1.]).unwrap();
        // Everything moves by up to 0.1 m and 0.2 rad, the camera too, and its lens changes.
        let mut nudge = |pose: &PoseF32| {
            let by = scene::pose::from_xyz_rpy(r.vector(-0.1, 0.1), r.vector(-0.2, 0.2));
            PoseF32::from(&(wide(pose) * by))
        };
        let before: Vec<PoseF32> = poses.iter().map(&mut nudge).collect();
        let world_from_camera = nudge(&view.world_from_camera);
        let old = View { world_from_camera, fx: view.fx * 1.1, cx: view.cx + 3.0, ..view };
        let shot = Shot {
            scene: &scene,
            poses: &poses,
            view: &view,
            lights: None,
            lens: None,
            before: Some(Before { poses: &before, view: &old }),
        };
        for renderer in [Renderer::Raster, Renderer::FastRayTraced] {
            let shot = Shot { view: if seed % 2 == 0 { &view } else { &old }, ..shot };
            judged += check(&draw(renderer, shot), &shot);
        }
    }
    assert!(judged > 100_000, "{judged}");
}

/// Behind every lens, things and the camera move and the pixels change: each point is where the lens saw it before, or it did
/// not see it. The lens itself is judged elsewhere.
#[test]
fn what_lenses_see_moves_as_its_points_do() {
    let (mut numbers, mut unseen_by_all) = (Random(8), 0);
    for (lens, pixels) in super::lenses::all() {
        let (mut judged, mut unseen) = (0, 0);
        for _ in 0..6 {
            let r = &mut numbers;
            let (scene, poses) = random(r, 1.2);
            let (eye, target) = (r.pose(2.0), r.vector(-0.5, 0.5).map(|x| x as f32));
            let size = [64, 48];
            let numbers = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
            let [fx, fy, cx, cy] = numbers;
            let view =
                View { fx, fy, cx, cy, ..View::look_at(size, 1.0, eye.translation, target, [0., 0., 1.]).unwrap() };
            let mut nudge = |pose: &PoseF32| {
                let by = scene::pose::from_xyz_rpy(r.vector(-0.1, 0.1), r.vector(-0.2, 0.2));
                PoseF32::from(&(wide(pose) * by))
            };
            let before: Vec<PoseF32> = poses.iter().map(&mut nudge).collect();
            let world_from_camera = nudge(&view.world_from_camera);
            for old in
                [View { world_from_camera, ..view }, View { world_from_camera, fx: 0.9 * fx, cy: cy + 2.0, ..view }]
            {
                let optics_of = |view: &View, exact: bool| {
                    let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
                    Optics::new(lens, if exact { pixels } else { PixelIntrinsics { fx, fy, cx, cy } }).unwrap()
                };
                let rays = LensRays::new(&optics_of(&view, true), size, 1).unwrap();
                let then = optics_of(&old, old.fx == view.fx);
                let shot = Shot {
                    scene: &scene,
                    poses: &poses,
                    view: &view,
                    lights: None,
                    lens: Some(&rays),
                    before: Some(Before { poses: &before, view: &old }),
                };
                let renderer = if old.fx == view.fx { Renderer::FastRayTraced } else { Renderer::Hybrid };
                let frame = draw(renderer, shot);
                let (flow, mask) = (frame.flow.as_ref().unwrap(), frame.mask.as_ref().unwrap());
                for (k, id) in mask.iter().enumerate() {
                    let found = [0, 1].map(|axis| f64::from(flow[2 * k + axis]));
                    if *id == 0 {
                        assert!(found.iter().all(|x| *x == f64::INFINITY), "nothing is there: {found:?}");
                        continue;
                    }
                    let place = |k: usize| f64::from(frame.position.as_ref().unwrap()[k]);
                    let at = scene.instances().iter().position(|instance| instance.mask_id == *id).unwrap();
                    let point = Point3::new(place(3 * k), place(3 * k + 1), place(3 * k + 2));
                    let point = wide(&before[at]) * (wide(&poses[at]).inverse() * point);
                    let point = wide(&old.world_from_camera).inverse() * point;
                    if point.coords.norm() < 0.2 {
                        continue;
                    }
                    // What is within 1e-4 rad of the end of the lens may be told either way.
                    let aside = point.x.hypot(point.y).atan2(point.z);
                    if (aside - then.domain().angle).abs() < 1e-4 {
                        continue;
                    }
                    let Some(there) = then.project(point.coords.into()) else {
                        unseen += 1;
                        assert!(found.iter().all(|x| *x == f64::INFINITY), "it was not seen: {found:?}");
                        continue;
                    };
                    judged += 1;
                    let here = [(k % size[0]) as f64 + 0.5, (k / size[0]) as f64 + 0.5];
                    // Far beside the picture a pixel is a small angle.
                    let slope = 1.0 / aside.cos().abs().max(0.02);
                    for axis in 0..2 {
                        let expected = here[axis] - there[axis];
                        let off = (found[axis] - expected).abs();
                        let name = lens.name();
                        assert!(off < ROUNDING * slope, "{name}: {found:?} is not {expected} along {axis}, {off}");
                    }
                }
            }
        }
        println!("{}: {judged} judged, {unseen} not seen before", lens.name());
        assert!(judged > 5000, "{}: {judged}", lens.name());
        unseen_by_all += unseen;
    }
    assert!(unseen_by_all > 100, "the control: {unseen_by_all}");
}

/// A camera that turns about itself: flow is that of the homography K R K^-1, whatever the distance; what neither moves nor
/// is looked at from elsewhere has exactly none.
#[test]
fn a_camera_that_turns_sees_a_homography() {
    let mut numbers = Random(3);
    let (scene, poses) = random(&mut numbers, 1.0);
    let view = View::look_at([90, 70], 1.0, [2.5, 0.3, 0.8], [0.0; 3], [0., 0., 1.]).unwrap();
    let turn = scene::pose::from_xyz_rpy([0.0; 3], [0.05, -0.08, 0.11]);
    let now = View { world_from_camera: PoseF32::from(&(wide(&view.world_from_camera) * turn)), ..view };
    let shot = |view| Shot { scene: &scene, poses: &poses, view, lights: None, lens: None, before: None };
    let before = Some(Before { poses: &poses, view: &view });
    let frame = draw(Renderer::Raster, Shot { before, ..shot(&now) });
    let k = Matrix3::new(
        f64::from(view.fx),
        0.0,
        f64::from(view.cx),
        0.0,
        f64::from(view.fy),
        f64::from(view.cy),
        0.0,
        0.0,
        1.0,
    );
    let homography = k * turn.rotation.to_rotation_matrix().matrix() * k.try_inverse().unwrap();
    let (mut hits, mut turned) = (0, 0);
    for (pixel, id) in frame.mask.as_ref().unwrap().iter().enumerate().filter(|(_, id)| **id != 0) {
        let here = Vector3::new((pixel % 90) as f64 + 0.5, (pixel / 90) as f64 + 0.5, 1.0);
        let there = homography * here;
        for axis in 0..2 {
            let expected = here[axis] - there[axis] / there.z;
            let found = f64::from(frame.flow.as_ref().unwrap()[2 * pixel + axis]);
            assert!((found - expected).abs() < 2.0 * ROUNDING, "{id}: {found} is not {expected}");
        }
        hits += 1;
        turned += usize::from((here - there / there.z).norm() > 2.0);
    }
    assert!(hits > 3000 && 2 * turned > hits, "{hits} pixels, of which {turned} moved by more than two");
    let still = draw(Renderer::Raster, Shot { before, ..shot(&view) });
    let flows = still.flow.as_ref().unwrap().as_chunks::<2>().0;
    for (flow, id) in flows.iter().zip(still.mask.as_ref().unwrap()) {
        assert!(if *id == 0 { *flow == [f32::INFINITY; 2] } else { *flow == [0.0; 2] }, "{flow:?}");
    }
    assert!(
        draw(Renderer::Raster, shot(&view)).flow.unwrap().iter().all(|&x| x == f32::INFINITY),
        "there is no picture before"
    );
}

#[test]
fn what_no_picture_before_can_be_is_said() {
    let mut numbers = Random(4);
    let (scene, poses) = random(&mut numbers, 1.0);
    let view = View::look_at([20, 16], 1.0, [2.5, 0.3, 0.8], [0.0; 3], [0., 0., 1.]).unwrap();
    let error = |channels, before| {
        let mut frame = Frame::new(20, 16, channels);
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: Some(before) };
        Rasterizer::default().render_shot(&shot, &mut frame.as_mut()).err()
    };
    let few = Before { poses: &poses[1..], view: &view };
    let expected = poses.len();
    assert_eq!(error(WANTED, few), Some(RenderError::PoseCount { expected, found: expected - 1 }));
    let mut bad = poses.clone();
    bad[2].translation[0] = f32::NAN;
    assert!(matches!(
        error(WANTED, Before { poses: &bad, view: &view }),
        Some(RenderError::InstancePose { instance: 2, .. })
    ));
    let flat = View { fx: 0.0, ..view };
    assert!(matches!(error(WANTED, Before { poses: &poses, view: &flat }), Some(RenderError::Intrinsics { .. })));
    // Nobody looks at it for other channels.
    assert_eq!(error(Channels { depth: true, ..Channels::NONE }, few), None);
}

/// The flow of an environment, by pixel.
fn flow_of(camera: &Camera, row: usize) -> Vec<[f32; 2]> {
    let flow = camera.channel::<Flow>().unwrap().index_axis_move(ndarray::Axis(0), row);
    flow.rows().into_iter().flat_map(|row| row.to_vec()).collect::<Vec<f32>>().as_chunks::<2>().0.to_vec()
}

/// A ball that moves along y before a camera that stands: what its pixels see was 0.01 m less along y for each step.
#[test]
fn a_ball_moves_and_the_ground_does_not() {
    let context = context(2);
    let period = CameraCfg { update_period: 0.02, channels: WANTED, ..cfg() };
    let (mut lazy, mut eager) = (built(&period, &context), built(&CameraCfg { lazy: false, ..period }, &context));
    assert_eq!(lazy.flow().unwrap().dim(), (2, SIZE[1], SIZE[0], 2));
    assert!(lazy.flow().unwrap().iter().all(|&x| x == f32::INFINITY), "the first picture");
    for step in 1..=9 {
        for camera in [&mut lazy, &mut eager] {
            camera.update(&state(&[step, step])).unwrap();
        }
    }
    // Pictures are of steps 4 and 8.
    let (pose, k) = (lazy.pose_w(CameraConvention::Ros), lazy.intrinsic_matrices());
    let mut balls = 0;
    for row in 0..2 {
        let camera_from_world = from_row(&std::array::from_fn(|i| pose[(row, i)])).inverse();
        let flow = flow_of(&lazy, row);
        let bits = |flow: &[[f32; 2]]| flow.iter().map(|f| f.map(f32::to_bits)).collect::<Vec<_>>();
        assert_eq!(bits(&flow), bits(&flow_of(&eager, row)));
        let (mask, position) = (lazy.mask().unwrap(), lazy.position().unwrap());
        for ((v, u), found) in (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u))).zip(flow) {
            match mask[(row, v, u)] {
                0 => assert!(found.iter().all(|&x| x == f32::INFINITY)),
                GROUND => assert_eq!(found, [0.0; 2]),
                id => {
                    assert_eq!(id, BALL);
                    let y = ball(row, 8)[1] - ball(row, 4)[1];
                    let p = Point3::from([0, 1, 2].map(|axis| f64::from(position[(row, v, u, axis)])));
                    let p = camera_from_world * (p - Vector3::y() * y);
                    let here = [u as f64 + 0.5, v as f64 + 0.5];
                    for (axis, x) in [p.x, p.y].into_iter().enumerate() {
                        let expected = here[axis] - (k[(row, axis, axis)] * x / p.z + k[(row, axis, 2)]);
                        assert!((f64::from(found[axis]) - expected).abs() < ROUNDING, "{found:?}, {expected}");
                    }
                    // +y is to the left of a camera that looks along +x: 0.04 m at about 1.4 m and 40 pixels.
                    assert!(found[0] < -0.8 && found[0] > -1.6, "{found:?}");
                    balls += 1;
                }
            }
        }
    }
    assert!(balls > 100, "{balls}");
}

/// A fisheye with everything that lenses have of their own: the ball's points were where the lens sees them now and saw them
/// before, although the intrinsics of one environment were set meanwhile; depths are noisy along the ray; and no light comes
/// from beyond a right angle. The same camera without imperfections is the control.
#[test]
fn cameras_have_all_of_it_behind_a_lens() {
    use super::super::imperfection::{DepthNoise, Vignetting};
    let clean = CameraCfg {
        lens: super::super::lens::Equidistant { max_angle: 1.9 }.into(),
        intrinsics: Intrinsics::Pixels { fx: 13.0, fy: 13.0, cx: 24.0, cy: 16.0 },
        renderer: Renderer::FastRayTraced,
        channels: Channels { color: true, distance: true, ..WANTED },
        ..cfg()
    };
    let mut imperfect = clean.clone();
    imperfect.imperfections.vignetting = Some(Vignetting::default());
    imperfect.imperfections.depth_noise = Some(DepthNoise { constant: 0.01, quadratic: 0.0, offset: 0.0 });
    let [clean, imperfect] = [clean, imperfect].map(|cfg| {
        let mut camera = built(&cfg, &context(2));
        let other = Intrinsics::Pixels { fx: 14.0, fy: 14.5, cx: 23.0, cy: 17.0 };
        camera.update(&state(&[1, 1])).unwrap();
        let before = camera.optics(1).unwrap();
        camera.set_intrinsics(&[other], Some(&[1])).unwrap();
        camera.update(&state(&[6, 6])).unwrap();
        (camera, before)
    });
    let (before, camera) = (clean.1, &clean.0);
    assert!(before != camera.optics(1).unwrap() && camera.flow().unwrap() == imperfect.0.flow().unwrap());
    let (mut balls, mut dark, mut noise) = (0, 0, Vec::new());
    for row in 0..2 {
        let now = camera.optics(row).unwrap();
        let then = if row == 1 { before } else { now };
        let camera_from_world = camera.world_from_camera(row).unwrap().inverse();
        for (k, found) in flow_of(camera, row).into_iter().enumerate() {
            let [u, v] = [k % SIZE[0], k / SIZE[0]];
            let here = [u as f64 + 0.5, v as f64 + 0.5];
            let Some(ray) = now.unproject(here) else { continue };
            let light = [camera, &imperfect.0].map(|camera| camera.color().unwrap()[(row, v, u, 0)]);
            match ray[2] {
                // A pixel sees 4 degrees. Only the ground and the sky are there, and no pixel of theirs is black.
                z if z < -0.06 => {
                    assert!(light[0] > 0 && light[1] == 0, "{light:?}");
                    dark += 1;
                }
                z if z > 0.99 => assert!(light[0].abs_diff(light[1]) <= 3, "{light:?}"),
                _ => assert!(light[1] <= light[0]),
            }
            let [clean, noisy] = [camera, &imperfect.0].map(|camera| camera.distance().unwrap()[(row, v, u)]);
            let depth = f64::from(imperfect.0.depth().unwrap()[(row, v, u)]);
            let along = f64::from(noisy) * ray[2];
            assert!(if noisy.is_finite() { (depth - along).abs() < 1e-5 } else { depth == f64::INFINITY }, "{depth}");
            if camera.mask().unwrap()[(row, v, u)] == BALL {
                noise.push(f64::from(noisy - clean));
                let moved = ball(row, 6)[1] - ball(row, 1)[1];
                let position = camera.position().unwrap();
                let p = Point3::from([0, 1, 2].map(|axis| f64::from(position[(row, v, u, axis)])));
                let there = then.project((camera_from_world * (p - Vector3::y() * moved)).coords.into()).unwrap();
                for axis in 0..2 {
                    let expected = here[axis] - there[axis];
                    assert!((f64::from(found[axis]) - expected).abs() < ROUNDING, "{found:?}, {expected}");
                }
                balls += 1;
            }
        }
    }
    let n = noise.len() as f64;
    let deviation = (noise.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
    assert!((deviation / 0.01 - 1.0).abs() < 6.0 / (2.0 * n).sqrt(), "{deviation}");
    assert!(balls > 30 && dark > 50, "{balls} {dark}");
}

#[test]
fn resets_begin_anew_and_writes_do_not_count() {
    let context = context(2);
    let mut camera = built(&CameraCfg { channels: WANTED, ..cfg() }, &context);
    camera.update(&state(&[3, 3])).unwrap();
    let moved = |camera: &Camera, row| {
        let mask = camera.mask().unwrap().index_axis_move(ndarray::Axis(0), row);
        let flows = flow_of(camera, row);
        let of_ball: Vec<[f32; 2]> =
            flows.into_iter().zip(mask).filter(|(_, id)| **id == BALL).map(|(f, _)| f).collect();
        of_ball.iter().map(|f| f[0]).sum::<f32>() / of_ball.len() as f32
    };
    let three = moved(&camera, 0);
    // Somebody writes to the state: the same picture before.
    camera.refresh(&[0], &state(&[6, 3])).unwrap();
    let six = moved(&camera, 0);
    assert!((six / three - 2.0).abs() < 0.1, "{three} {six}");
    camera.reset(&[1], &state(&[6, 0])).unwrap();
    assert!(moved(&camera, 1) == f32::INFINITY && moved(&camera, 0).is_finite());
    camera.update(&state(&[7, 1])).unwrap();
    let (one, from_six) = (moved(&camera, 1), moved(&camera, 0));
    assert!((one * 3.0 / three - 1.0).abs() < 0.1 && (from_six * 3.0 / three - 1.0).abs() < 0.1, "{one} {from_six}");
    // A camera that does not measure it says so.
    let without = built(&CameraCfg { channels: Channels { depth: true, ..Channels::NONE }, ..cfg() }, &context);
    assert_eq!(without.flow().unwrap_err().to_string(), "the camera does not measure flow; it measures depth");
}

/// A camera on a link that moves, over a ground that does not: the points of the picture, seen by the camera as it was.
#[test]
fn cameras_on_links_see_the_ground_move() {
    let context = context(2);
    let extrinsics = Extrinsics { parent: Some("tip".into()), ..Extrinsics::default() };
    let rotation = CameraConvention::World.to_optical(&Pose::identity()).rotation;
    let placement = super::super::Placement::Pose { pos: [0.05, 0.02, 0.1], rotation };
    let extrinsics = Extrinsics { placement, ..extrinsics };
    let mut camera = CameraCfg { extrinsics, channels: WANTED, ..cfg() }.build(&context).unwrap();
    camera.reset(&[0, 1], &state(&[0, 0])).unwrap();
    camera.update(&state(&[1, 2])).unwrap();
    let k = camera.intrinsic_matrices();
    let mut judged = 0;
    for (row, step) in [(0, 1u64), (1, 2)] {
        let mounted = Pose::from_parts([0.05, 0.02, 0.1].into(), rotation);
        let old = (from_row(&to_row(&tip(row, 0))) * mounted).inverse();
        let (mask, position) = (camera.mask().unwrap(), camera.position().unwrap());
        for (index, found) in flow_of(&camera, row).into_iter().enumerate() {
            let (v, u) = (index / SIZE[0], index % SIZE[0]);
            if mask[(row, v, u)] != GROUND {
                continue;
            }
            let p = Point3::from([0, 1, 2].map(|axis| f64::from(position[(row, v, u, axis)])));
            let (far, p) = (p.coords.norm(), old * p);
            if p.z < 0.1 || far > 10.0 {
                continue;
            }
            let here = [u as f64 + 0.5, v as f64 + 0.5];
            for (axis, x) in [p.x, p.y].into_iter().enumerate() {
                let expected = here[axis] - (k[(row, axis, axis)] * x / p.z + k[(row, axis, 2)]);
                assert!((f64::from(found[axis]) - expected).abs() < ROUNDING, "step {step}: {found:?}, {expected}");
            }
            judged += 1;
        }
    }
    assert!(judged > 500, "{judged}");
}

/// The list of scenes is not empty for its own sake: a scene without things has no flow.
#[test]
fn an_empty_scene_has_none() {
    let scene = RenderScene::empty();
    let view = View::look_at([16, 12], 1.0, [2.5, 0.3, 0.8], [0.0; 3], [0., 0., 1.]).unwrap();
    let before = Some(Before { poses: &[], view: &view });
    let frame =
        draw(Renderer::Raster, Shot { scene: &scene, poses: &[], view: &view, lights: None, lens: None, before });
    assert!(frame.flow.unwrap().iter().all(|&x| x == f32::INFINITY));
}

/// A free camera that a program moves between its pictures: before an update, or between an update and reading. Nothing else
/// moves, so a pixel shows the ground where its own position says, and flow is how far the old camera saw that elsewhere.
#[test]
fn cameras_that_are_moved_see_the_ground_move() {
    let mut camera = built(&CameraCfg { channels: WANTED, ..cfg() }, &context(1));
    let k = camera.intrinsic_matrices();
    let place =
        |k: usize| scene::pose::from_xyz_rpy([0.3, 0.02 * k as f64, 1.2], [std::f64::consts::PI - 0.6, 0.0, 0.1]);
    let poses = |k: usize| ndarray::Array2::from_shape_vec((1, 7), to_row(&place(k)).to_vec()).unwrap();
    let put = |camera: &mut Camera, at: usize| {
        camera.set_world_poses(&poses(at), None, CameraConvention::Ros).unwrap();
    };
    let judge = |camera: &Camera, old: usize| {
        let old = place(old).inverse();
        let (mask, position) = (camera.mask().unwrap(), camera.position().unwrap());
        let mut judged = 0;
        for (index, found) in flow_of(camera, 0).into_iter().enumerate() {
            let (v, u) = (index / SIZE[0], index % SIZE[0]);
            if mask[(0, v, u)] != GROUND {
                continue;
            }
            let p = old * Point3::from([0, 1, 2].map(|axis| f64::from(position[(0, v, u, axis)])));
            let here = [u as f64 + 0.5, v as f64 + 0.5];
            for (axis, x) in [p.x, p.y].into_iter().enumerate() {
                let expected = here[axis] - (k[(0, axis, axis)] * x / p.z + k[(0, axis, 2)]);
                assert!((f64::from(found[axis]) - expected).abs() < ROUNDING, "{found:?}, {expected}");
            }
            judged += usize::from(found[0].abs() > 0.1);
        }
        assert!(judged > 100, "{judged}");
    };
    put(&mut camera, 0);
    camera.reset(&[0], &state(&[0])).unwrap();
    for step in 1..4 {
        put(&mut camera, step);
        camera.update(&state(&[step as u64])).unwrap();
        judge(&camera, step - 1);
    }
    // Moved after it was captured from place 3: the picture of place 5, and flow from the picture before that capture.
    put(&mut camera, 5);
    judge(&camera, 2);
    // The next one starts from where the last was captured, whether somebody looked meanwhile or not.
    camera.update(&state(&[5])).unwrap();
    judge(&camera, 3);
}
