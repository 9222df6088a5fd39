//! Optical flow, against projections at both instants.

use super::super::imperfection::{DepthNoise, Vignetting};
use super::super::{Camera, CameraCfg, CameraConvention, CameraPlacement, Extrinsics, Placement};
use super::test_scene::{BALL, GROUND, SIZE, ball, built, cfg, context, pinhole, point, state, tip};
use crate::sensor::Sensor;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::frame::Flow;
use kinetoscope_render::lens::Equidistant;
use kinetoscope_render::{Intrinsics, Renderer};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::{from_row, from_xyz_rpy, to_row};
use nalgebra::{Point3, Vector3};
use ndarray::{Array2, Axis};

const WANTED: Channels = Channels { flow: true, mask: true, position: true, depth: true, ..Channels::NONE };

/// Tolerance of single precision \[pixels\]. Coordinates of some meters have 5e-7 m, which is 1e-5 pixels for each
/// pixel of focal length and meter of distance. For 100 pixels at 0.5 m this is 1e-4, and several such errors add up.
const ROUNDING: f64 = 1e-3;

/// The flow of an environment, by pixel.
fn flow_of(camera: &Camera, row: usize) -> Vec<[f32; 2]> {
    let flow = camera.channel::<Flow>().unwrap().index_axis_move(Axis(0), row);
    flow.iter().copied().collect::<Vec<f32>>().as_chunks().0.to_vec()
}

/// Compares every pixel of an environment that shows `id` with the pixel that showed its point in the previous frame,
/// if `before` returns it. Returns the compared flows.
fn check_flow(camera: &Camera, row: usize, id: i32, before: impl Fn(Point3<f64>) -> Option<[f64; 2]>) -> Vec<[f32; 2]> {
    let pixels = (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u)));
    let shown = pixels.zip(flow_of(camera, row)).filter(|((v, u), _)| camera.mask().unwrap()[(row, *v, *u)] == id);
    let judged = |((v, u), found): ((usize, usize), [f32; 2])| {
        let there = before(point(camera, [row, v, u]))?;
        let expected = [u as f64 + 0.5 - there[0], v as f64 + 0.5 - there[1]];
        let close = (0..2).all(|axis| (f64::from(found[axis]) - expected[axis]).abs() < ROUNDING);
        assert!(close, "environment {row}: {found:?}, not {expected:?}");
        Some(found)
    };
    shown.filter_map(judged).collect()
}

/// A ball moves along y in front of a fixed camera: in each step, its points move by 0.01 m along y.
#[test]
fn moving_ball() {
    let context = context(2);
    let period = CameraCfg { update_period: 0.02, channels: WANTED, ..cfg() };
    let (mut lazy, mut eager) = (built(&period, &context), built(&CameraCfg { lazy: false, ..period }, &context));
    assert_eq!(lazy.flow().unwrap().dim(), (2, SIZE[1], SIZE[0], 2));
    assert!(lazy.flow().unwrap().iter().all(|&x| x == f32::INFINITY), "the first frame");
    for step in 1..=9 {
        for camera in [&mut lazy, &mut eager] {
            camera.update(&state(&[step, step])).unwrap();
        }
    }
    // Frames are captured at steps 4 and 8.
    let mut balls = 0;
    for row in 0..2 {
        let flow = flow_of(&lazy, row);
        kinetoscope_testkit::bits::assert_same_bits("lazy", flow.as_flattened(), flow_of(&eager, row).as_flattened());
        for (found, id) in flow.iter().zip(lazy.mask().unwrap().index_axis(Axis(0), row)) {
            let expected = if *id == 0 { [f32::INFINITY; 2] } else { [0.0; 2] };
            assert!(*id == BALL || [0, GROUND].contains(id) && *found == expected, "{id}: {found:?}");
        }
        let (y, old) = (ball(row, 8)[1] - ball(row, 4)[1], super::test_scene::pose_of(&lazy, row).inverse());
        let flows = check_flow(&lazy, row, BALL, |p| Some(pinhole(&lazy, row, old * (p - Vector3::y() * y))));
        // +y is to the left of a camera that looks along +x: 0.04 m at about 1.4 m and 40 pixels.
        assert!(flows.iter().all(|flow| flow[0] < -0.8 && flow[0] > -1.6), "{flows:?}");
        balls += flows.len();
    }
    assert!(balls > 100, "{balls}");
}

/// A fisheye with all lens-specific effects: intrinsics set in one environment between frames, depth noise along the
/// ray, and no light from beyond a right angle. The flow still connects the pixels that show the same point. Control:
/// the same camera without imperfections.
#[test]
fn imperfect_fisheye() {
    let clean = CameraCfg {
        lens: Equidistant { max_angle: 1.9 }.into(),
        intrinsics: Intrinsics::Pixels { fx: 13.0, fy: 13.0, cx: 24.0, cy: 16.0 },
        renderer: Renderer::FastRayTraced,
        channels: Channels { color: true, distance: true, ..WANTED },
        ..cfg()
    };
    let mut imperfect = clean.clone();
    imperfect.imperfections.vignetting = Some(Vignetting::default());
    imperfect.imperfections.depth_noise = Some(DepthNoise { constant: 0.01, quadratic: 0.0, offset: 0.0 });
    let [(camera, before), (imperfect, _)] = [clean, imperfect].map(|cfg| {
        let mut camera = built(&cfg, &context(2));
        camera.update(&state(&[1, 1])).unwrap();
        let before = camera.optics(1).unwrap();
        let other = Intrinsics::Pixels { fx: 14.0, fy: 14.5, cx: 23.0, cy: 17.0 };
        camera.set_intrinsics(&[other], Some(&[1])).unwrap();
        camera.update(&state(&[6, 6])).unwrap();
        (camera, before)
    });
    assert!(before != camera.optics(1).unwrap() && camera.flow().unwrap() == imperfect.flow().unwrap());
    let (mut balls, mut dark, mut noise) = (0, 0, Vec::new());
    for row in 0..2 {
        let now = camera.optics(row).unwrap();
        let then = if row == 1 { before } else { now };
        let camera_from_world = camera.world_from_camera(row).unwrap().inverse();
        let moved = ball(row, 6)[1] - ball(row, 1)[1];
        let there = |p: Point3<f64>| then.project((camera_from_world * (p - Vector3::y() * moved)).coords.into());
        balls += check_flow(&camera, row, BALL, |p| Some(there(p).unwrap())).len();
        for (v, u) in (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u))) {
            let Some(ray) = now.unproject([u as f64 + 0.5, v as f64 + 0.5]) else { continue };
            let light = [&camera, &imperfect].map(|camera| camera.color().unwrap()[(row, v, u, 0)]);
            match ray[2] {
                // A pixel covers 4 degrees. These directions see only ground and sky, so no pixel is black.
                z if z < -0.06 => {
                    assert!(light[0] > 0 && light[1] == 0, "{light:?}");
                    dark += 1;
                }
                z if z > 0.99 => assert!(light[0].abs_diff(light[1]) <= 3, "{light:?}"),
                _ => assert!(light[1] <= light[0]),
            }
            let [clean, noisy] = [&camera, &imperfect].map(|camera| camera.distance().unwrap()[(row, v, u)]);
            let depth = f64::from(imperfect.depth().unwrap()[(row, v, u)]);
            let along = f64::from(noisy) * ray[2];
            assert!(if noisy.is_finite() { (depth - along).abs() < 1e-5 } else { depth == f64::INFINITY }, "{depth}");
            if camera.mask().unwrap()[(row, v, u)] == BALL {
                noise.push(f64::from(noisy - clean));
            }
        }
    }
    let n = noise.len() as f64;
    let deviation = (noise.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
    assert!((deviation / 0.01 - 1.0).abs() < 6.0 / (2.0 * n).sqrt(), "{deviation}");
    assert!(balls > 30 && dark > 50, "{balls} {dark}");
}

#[test]
fn resets_and_writes() {
    let context = context(2);
    let mut camera = built(&CameraCfg { channels: WANTED, ..cfg() }, &context);
    camera.update(&state(&[3, 3])).unwrap();
    let moved = |camera: &Camera, row| {
        let mask = camera.mask().unwrap().index_axis_move(Axis(0), row);
        let flows = flow_of(camera, row).into_iter().zip(mask).filter(|(_, id)| **id == BALL);
        let flows: Vec<f32> = flows.map(|(flow, _)| flow[0]).collect();
        flows.iter().sum::<f32>() / flows.len() as f32
    };
    let three = moved(&camera, 0);
    // A write to the state keeps the previous frame.
    camera.refresh(&[0], &state(&[6, 3])).unwrap();
    assert!((moved(&camera, 0) / three - 2.0).abs() < 0.1);
    camera.reset(&[1], &state(&[6, 0])).unwrap();
    assert!(moved(&camera, 1) == f32::INFINITY && moved(&camera, 0).is_finite());
    camera.update(&state(&[7, 1])).unwrap();
    for row in 0..2 {
        assert!((moved(&camera, row) * 3.0 / three - 1.0).abs() < 0.1, "{row}");
    }
    // A camera without the channel returns an error.
    let without = built(&CameraCfg { channels: Channels { depth: true, ..Channels::NONE }, ..cfg() }, &context);
    assert_eq!(without.flow().unwrap_err().to_string(), "the camera does not measure flow; it measures depth");
}

/// A camera on a moving link over a fixed ground: the points of the image, projected by the camera at its previous
/// pose.
#[test]
fn camera_on_link() {
    let rotation = CameraConvention::World.to_optical(&Pose::identity()).rotation;
    let placement = Placement::Pose { pos: [0.05, 0.02, 0.1], rotation };
    let extrinsics = Extrinsics { placement, parent: Some("tip".into()), ..Extrinsics::default() };
    let mut camera = built(&CameraCfg { extrinsics, channels: WANTED, ..cfg() }, &context(2));
    camera.update(&state(&[1, 2])).unwrap();
    let mounted = Pose::from_parts([0.05, 0.02, 0.1].into(), rotation);
    let judged = [0, 1].map(|row| {
        let old = (from_row(&to_row(&tip(row, 0))) * mounted).inverse();
        let before = |p: Point3<f64>| {
            let then = old * p;
            (then.z >= 0.1 && p.coords.norm() <= 10.0).then(|| pinhole(&camera, row, then))
        };
        check_flow(&camera, row, GROUND, before).len()
    });
    assert!(judged[0] + judged[1] > 500, "{judged:?}");
}

/// A program moves a free camera between its frames: before an update, or between an update and a read. Nothing else
/// moves, so a pixel shows the ground given by its position, and flow comes from the projection by the previous camera.
#[test]
fn moved_camera() {
    let mut camera = built(&CameraCfg { channels: WANTED, ..cfg() }, &context(1));
    let place = |k: usize| from_xyz_rpy([0.3, 0.02 * k as f64, 1.2], [std::f64::consts::PI - 0.6, 0.0, 0.1]);
    let put = |camera: &mut Camera, at: usize| {
        let poses = Array2::from_shape_vec((1, 7), to_row(&place(at)).to_vec()).unwrap();
        camera.set_world_poses(&poses, None, CameraConvention::Ros).unwrap();
    };
    let assert_from = |camera: &Camera, old: usize| {
        let old = place(old).inverse();
        let flows = check_flow(camera, 0, GROUND, |p| Some(pinhole(camera, 0, old * p)));
        assert!(flows.iter().filter(|flow| flow[0].abs() > 0.1).count() > 100);
    };
    put(&mut camera, 0);
    camera.reset(&[0], &state(&[0])).unwrap();
    for step in 1..4 {
        put(&mut camera, step);
        camera.update(&state(&[step as u64])).unwrap();
        assert_from(&camera, step - 1);
    }
    // Moved after the capture from place 3: the image is from place 5, and flow from the frame before that capture.
    put(&mut camera, 5);
    assert_from(&camera, 2);
    // The next flow starts at the place of the last capture, whether that frame was read or not.
    camera.update(&state(&[5])).unwrap();
    assert_from(&camera, 3);
}
