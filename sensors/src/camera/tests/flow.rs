//! Optical flow, against projections at both instants.

use super::super::imperfection::{DepthNoise, Vignetting};
use super::super::{
    Camera, CameraCfg, CameraConvention, CameraPlacement, Channels, Extrinsics, Intrinsics, LensRays, Optics,
    PixelIntrinsics, Placement, RasterCfg, Renderer,
};
use super::harness::{Image, Still, look, pinhole, point, wide};
use super::scenes::{Random, random};
use super::stage::{BALL, GROUND, SIZE, ball, built, cfg, context, state, tip};
use crate::sensor::Sensor;
use kinetoscope_render::frame::Flow;
use kinetoscope_render::lens::Equidistant;
use kinetoscope_render::visibility::{RenderError, View};
use kinetoscope_scene::pose::{from_row, from_xyz_rpy, to_row};
use kinetoscope_scene::{Pose, PoseF32};
use nalgebra::{Matrix3, Point3, Vector3};
use ndarray::{Array2, Axis};

const WANTED: Channels = Channels { flow: true, mask: true, position: true, depth: true, ..Channels::NONE };

/// Pixels by which single precision may be off: coordinates of some metres have 5e-7 m, which are 1e-5 pixels for each pixel
/// of focal length and metre of distance; those of 100 pixels at 0.5 m 1e-4, some of them added.
const ROUNDING: f64 = 1e-3;

/// A random scene in which everything, the camera too, moved by up to 0.1 m and 0.2 rad since the frame before.
fn moving(r: &mut Random, reach: f64, view: impl Fn(View) -> View, size: [usize; 2]) -> Still {
    let (scene, poses) = random(r, 1.2);
    let (eye, target) = (r.pose(reach), r.vector(-0.5, 0.5).map(|x| x as f32));
    let view = view(look(size, 1.0, eye.translation, target));
    let mut nudge =
        |pose: &PoseF32| PoseF32::from(&(wide(pose) * from_xyz_rpy(r.vector(-0.1, 0.1), r.vector(-0.2, 0.2))));
    let before: Vec<PoseF32> = poses.iter().map(&mut nudge).collect();
    let old = View { world_from_camera: nudge(&view.world_from_camera), ..view };
    let cfg = RasterCfg { lod: false, ..RasterCfg::default() };
    Still { channels: WANTED, cfg, before: Some((before, old)), ..Still::new((scene, poses), view) }
}

/// Visibility of a point in the frame before: unknown, not seen, or a pixel and factors of [`ROUNDING`] for both axes.
enum Then {
    Either,
    Unseen,
    At([f64; 2], [f64; 2]),
}

/// Every pixel of an image against its point, moved back with its thing into the frame of the old camera; `seen` says where the
/// point was, given the distance of its point from the origin too. Returns how many were judged, and how many were not seen before.
fn check(what: &str, still: &Still, image: &Image, seen: impl Fn(Point3<f64>, [f64; 2], f64) -> Then) -> [usize; 2] {
    let (before, old) = still.before.as_ref().unwrap();
    let mut counts = [0, 0];
    for (k, id) in image.mask().iter().enumerate() {
        let found = image.flow()[k].map(f64::from);
        let infinite = found == [f64::INFINITY; 2];
        if *id == 0 {
            assert!(infinite, "{what}: nothing is there: {found:?}");
            continue;
        }
        let point = Point3::from(image.position()[k].map(f64::from));
        let thing = still.scene.instances().iter().position(|instance| instance.mask_id == *id).unwrap();
        let then = wide(&before[thing]) * (wide(&still.poses[thing]).inverse() * point);
        let here = [(k % image.width) as f64 + 0.5, (k / image.width) as f64 + 0.5];
        match seen(wide(&old.world_from_camera).inverse() * then, here, point.coords.norm()) {
            Then::Either => {}
            Then::Unseen => {
                assert!(infinite, "{what}: it was not seen: {found:?}");
                counts[1] += 1;
            }
            Then::At(there, factors) => {
                let off = [0, 1].map(|axis| (found[axis] - (here[axis] - there[axis])).abs());
                let close = (0..2).all(|axis| off[axis] < ROUNDING * factors[axis]);
                assert!(close, "{what}, {id}: {found:?} is off by {off:?}");
                counts[0] += 1;
            }
        }
    }
    counts
}

#[test]
fn random_scenes() {
    let mut numbers = Random(21);
    let mut judged = 0;
    for seed in 0..16 {
        let mut still = moving(&mut numbers, 3.0, |view| view, [96, 72]);
        // The lens changes, too.
        let (view, old) = (still.view, &mut still.before.as_mut().unwrap().1);
        (old.fx, old.cx) = (view.fx * 1.1, view.cx + 3.0);
        let old = *old;
        still.view = if seed % 2 == 0 { view } else { old };
        for renderer in [Renderer::Raster, Renderer::FastRayTraced] {
            let [found, _] = check("pinhole", &still, &still.by(renderer), |p, here, distance| {
                if p.z.abs() < 0.05 {
                    return Then::Either;
                } else if p.z < 0.0 {
                    return Then::Unseen;
                }
                let [fx, fy, cx, cy] = [old.fx, old.fy, old.cx, old.cy].map(f64::from);
                let there = [fx * p.x / p.z + cx, fy * p.y / p.z + cy];
                // Far beside the frame before, digits are lost with the slant; far away, with the distance.
                let slant = |axis: usize| 1.0 + (here[axis] - there[axis]).abs() / 100.0;
                Then::At(there, [0, 1].map(|axis| slant(axis) * (1.0 + distance / p.z / 4.0)))
            });
            judged += found;
        }
    }
    assert!(judged > 100_000, "{judged}");
}

/// Behind every lens, things and the camera move and the pixels change: each point is where the lens saw it before, or it was
/// not seen. The lens itself is judged elsewhere.
#[test]
fn lenses() {
    let (mut numbers, mut unseen) = (Random(8), 0);
    for (lens, pixels) in super::lenses::all() {
        let mut judged = 0;
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        let rays = LensRays::new(&Optics::new(lens, pixels).unwrap(), [64, 48], 1).unwrap();
        for _ in 0..6 {
            let still = moving(&mut numbers, 2.0, |view| View { fx, fy, cx, cy, ..view }, [64, 48]);
            for (changed, renderer) in [(false, Renderer::FastRayTraced), (true, Renderer::Hybrid)] {
                let mut still = Still { lens: Some(rays.clone()), renderer, ..still.clone() };
                let mut numbers = pixels;
                if changed {
                    let old = &mut still.before.as_mut().unwrap().1;
                    (old.fx, old.cy) = (0.9 * fx, cy + 2.0);
                    let [fx, fy, cx, cy] = [old.fx, old.fy, old.cx, old.cy].map(f64::from);
                    numbers = PixelIntrinsics { fx, fy, cx, cy };
                }
                let then = Optics::new(lens, numbers).unwrap();
                let [found, missed] = check(lens.name(), &still, &still.draw(), |p, _, _| {
                    let aside = p.x.hypot(p.y).atan2(p.z);
                    // Within 1e-4 rad of the end of the lens a point may be seen or not.
                    if p.coords.norm() < 0.2 || (aside - then.domain().angle).abs() < 1e-4 {
                        return Then::Either;
                    }
                    // Far beside the image a pixel is a small angle.
                    let slope = 1.0 / aside.cos().abs().max(0.02);
                    then.project(p.coords.into()).map_or(Then::Unseen, |there| Then::At(there, [slope; 2]))
                });
                (judged, unseen) = (judged + found, unseen + missed);
            }
        }
        assert!(judged > 5000, "{}: {judged}", lens.name());
    }
    assert!(unseen > 100, "the control: {unseen}");
}

/// A camera that turns about itself: flow is that of the homography K R K^-1, whatever the distance; where neither things nor
/// the camera move, it is exactly zero.
#[test]
fn homography() {
    let view = look([90, 70], 1.0, [2.5, 0.3, 0.8], [0.0; 3]);
    let turn = from_xyz_rpy([0.0; 3], [0.05, -0.08, 0.11]);
    let now = View { world_from_camera: PoseF32::from(&(wide(&view.world_from_camera) * turn)), ..view };
    let still = Still { channels: WANTED, ..Still::new(random(&mut Random(3), 1.0), view) };
    let still = Still { cfg: RasterCfg { lod: false, ..RasterCfg::default() }, ..still };
    let before = Some((still.poses.clone(), view));
    let image = Still { before: before.clone(), view: now, ..still.clone() }.draw();
    let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
    let k = Matrix3::new(fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0);
    let homography = k * turn.rotation.to_rotation_matrix().matrix() * k.try_inverse().unwrap();
    let (mut hits, mut turned) = (0, 0);
    for (pixel, _) in image.mask().iter().enumerate().filter(|(_, id)| **id != 0) {
        let here = Vector3::new((pixel % 90) as f64 + 0.5, (pixel / 90) as f64 + 0.5, 1.0);
        let there = homography * here;
        let expected = here - there / there.z;
        let found = image.flow()[pixel].map(f64::from);
        let close = (0..2).all(|axis| (found[axis] - expected[axis]).abs() < 2.0 * ROUNDING);
        assert!(close, "{found:?} is not {expected}");
        hits += 1;
        turned += usize::from(expected.norm() > 2.0);
    }
    assert!(hits > 3000 && 2 * turned > hits, "{hits} pixels, of which {turned} moved by more than two");
    let unmoved = Still { before, ..still.clone() }.draw();
    for (flow, id) in unmoved.flow().iter().zip(unmoved.mask()) {
        assert_eq!(*flow, if *id == 0 { [f32::INFINITY; 2] } else { [0.0; 2] });
    }
    assert!(still.draw().flow().iter().flatten().all(|&x| x == f32::INFINITY), "there is no frame before");
}

#[test]
fn refused_frames_before() {
    let still = Still::new(random(&mut Random(4), 1.0), look([20, 16], 1.0, [2.5, 0.3, 0.8], [0.0; 3]));
    let error = |channels, change: fn(&mut Vec<PoseF32>, &mut View)| {
        let (mut poses, mut view) = (still.poses.clone(), still.view);
        change(&mut poses, &mut view);
        Still { channels, before: Some((poses, view)), ..still.clone() }.try_draw().err()
    };
    let expected = still.poses.len();
    let few = |poses: &mut Vec<PoseF32>, _: &mut View| poses.truncate(poses.len() - 1);
    assert_eq!(error(WANTED, few), Some(RenderError::PoseCount { expected, found: expected - 1 }));
    let pose = error(WANTED, |poses, _| poses[2].translation[0] = f32::NAN);
    assert!(matches!(pose, Some(RenderError::InstancePose { instance: 2, .. })), "{pose:?}");
    let flat = error(WANTED, |_, view| view.fx = 0.0);
    assert!(matches!(flat, Some(RenderError::Intrinsics { .. })), "{flat:?}");
    // Other channels do not need it.
    assert_eq!(error(Channels { depth: true, ..Channels::NONE }, few), None);
}

/// The flow of an environment, by pixel.
fn flow_of(camera: &Camera, row: usize) -> Vec<[f32; 2]> {
    let flow = camera.channel::<Flow>().unwrap().index_axis_move(Axis(0), row);
    flow.iter().copied().collect::<Vec<f32>>().as_chunks().0.to_vec()
}

/// Every pixel of an environment that shows `id`, against the pixel that showed its point before, if that is judged. Returns the
/// flows that were judged.
fn judge(camera: &Camera, row: usize, id: i32, before: impl Fn(Point3<f64>) -> Option<[f64; 2]>) -> Vec<[f32; 2]> {
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

/// A ball that moves along y before a camera that stands: its points were at 0.01 m less along y for each step.
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
    // Frames are of steps 4 and 8.
    let mut balls = 0;
    for row in 0..2 {
        let flow = flow_of(&lazy, row);
        kinetoscope_testkit::bits::assert_same_bits("lazy", flow.as_flattened(), flow_of(&eager, row).as_flattened());
        for (found, id) in flow.iter().zip(lazy.mask().unwrap().index_axis(Axis(0), row)) {
            let expected = if *id == 0 { [f32::INFINITY; 2] } else { [0.0; 2] };
            assert!(*id == BALL || [0, GROUND].contains(id) && *found == expected, "{id}: {found:?}");
        }
        let (y, old) = (ball(row, 8)[1] - ball(row, 4)[1], super::stage::pose_of(&lazy, row).inverse());
        let flows = judge(&lazy, row, BALL, |p| Some(pinhole(&lazy, row, old * (p - Vector3::y() * y))));
        // +y is to the left of a camera that looks along +x: 0.04 m at about 1.4 m and 40 pixels.
        assert!(flows.iter().all(|flow| flow[0] < -0.8 && flow[0] > -1.6), "{flows:?}");
        balls += flows.len();
    }
    assert!(balls > 100, "{balls}");
}

/// A fisheye with everything that lenses have of their own: the ball's points were where the lens sees them now and saw them
/// before, although the intrinsics of one environment were set meanwhile; depths are noisy along the ray; and no light comes
/// from beyond a right angle. The same camera without imperfections is the control.
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
        balls += judge(&camera, row, BALL, |p| Some(there(p).unwrap())).len();
        for (v, u) in (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u))) {
            let Some(ray) = now.unproject([u as f64 + 0.5, v as f64 + 0.5]) else { continue };
            let light = [&camera, &imperfect].map(|camera| camera.color().unwrap()[(row, v, u, 0)]);
            match ray[2] {
                // A pixel sees 4 degrees. Only the ground and the sky are there, and no pixel of theirs is black.
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
    // A write to the state leaves the frame before as it is.
    camera.refresh(&[0], &state(&[6, 3])).unwrap();
    assert!((moved(&camera, 0) / three - 2.0).abs() < 0.1);
    camera.reset(&[1], &state(&[6, 0])).unwrap();
    assert!(moved(&camera, 1) == f32::INFINITY && moved(&camera, 0).is_finite());
    camera.update(&state(&[7, 1])).unwrap();
    for row in 0..2 {
        assert!((moved(&camera, row) * 3.0 / three - 1.0).abs() < 0.1, "{row}");
    }
    // A camera that does not measure it says so.
    let without = built(&CameraCfg { channels: Channels { depth: true, ..Channels::NONE }, ..cfg() }, &context);
    assert_eq!(without.flow().unwrap_err().to_string(), "the camera does not measure flow; it measures depth");
}

/// A camera on a link that moves, over a ground that does not: the points of the image, seen by the camera as it was.
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
        judge(&camera, row, GROUND, before).len()
    });
    assert!(judged[0] + judged[1] > 500, "{judged:?}");
}

/// A free camera that a program moves between its frames: before an update, or between an update and reading. Nothing else
/// moves, so a pixel shows the ground where its own position says, and flow is from where the old camera saw that.
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
        let flows = judge(camera, 0, GROUND, |p| Some(pinhole(camera, 0, old * p)));
        assert!(flows.iter().filter(|flow| flow[0].abs() > 0.1).count() > 100);
    };
    put(&mut camera, 0);
    camera.reset(&[0], &state(&[0])).unwrap();
    for step in 1..4 {
        put(&mut camera, step);
        camera.update(&state(&[step as u64])).unwrap();
        assert_from(&camera, step - 1);
    }
    // Moved after it was captured from place 3: the image from place 5, and flow from the frame before that capture.
    put(&mut camera, 5);
    assert_from(&camera, 2);
    // The next one starts from where the last was captured, read meanwhile or not.
    camera.update(&state(&[5])).unwrap();
    assert_from(&camera, 3);
}
