//! Optical flow compared with projections at both instants.

use super::harness::{Image, TestFrame, look_at_view, to_f64_pose};
use crate::frame::Channels;
use crate::intrinsics::PixelIntrinsics;
use crate::lens::{LensRays, Optics};
use crate::renderer::Renderer;
use crate::request::RasterCfg;
use crate::visibility::{RenderError, View};
use kinetoscope_scene::PoseF32;
use kinetoscope_scene::pose::from_xyz_rpy;
use kinetoscope_testkit::scenes::{TestRng, random_scene};
use nalgebra::{Matrix3, Point3, Vector3};

const WANTED: Channels = Channels { flow: true, mask: true, position: true, depth: true, ..Channels::NONE };

/// Error of single precision \[pixels\]: coordinates of several meters have 5e-7 m, which are 1e-5 pixels per pixel of
/// focal length and meter of distance; those of 100 pixels at 0.5 m 1e-4, some of them added.
const ROUNDING: f64 = 1e-3;

/// A random scene in which all instances and the camera moved by up to 0.1 m and 0.2 rad since the previous frame.
fn moving(r: &mut TestRng, reach: f64, view: impl Fn(View) -> View, size: [usize; 2]) -> TestFrame {
    let (scene, poses) = random_scene(r, 1.2);
    let (eye, target) = (r.pose(reach), r.vector(-0.5, 0.5).map(|x| x as f32));
    let view = view(look_at_view(size, 1.0, eye.translation, target));
    let mut nudge =
        |pose: &PoseF32| PoseF32::from(&(to_f64_pose(pose) * from_xyz_rpy(r.vector(-0.1, 0.1), r.vector(-0.2, 0.2))));
    let before: Vec<PoseF32> = poses.iter().map(&mut nudge).collect();
    let old = View { world_from_camera: nudge(&view.world_from_camera), ..view };
    let cfg = RasterCfg { lod: false, ..RasterCfg::default() };
    TestFrame { channels: WANTED, cfg, previous: Some((before, old)), ..TestFrame::new((scene, poses), view) }
}

/// Visibility of a point in the previous frame: unknown, not visible, or a pixel and factors of [`ROUNDING`] for both
/// axes.
enum PreviousVisibility {
    Either,
    Unseen,
    At([f64; 2], [f64; 2]),
}

/// Compares every pixel of an image with its point, moved back with its instance into the frame of the previous camera.
/// `seen` gives the previous visibility of a point, from its position there, the pixel, and the distance of the point
/// from the origin. Returns the number of compared pixels, and of pixels that were not visible before.
fn check(
    what: &str,
    still: &TestFrame,
    image: &Image,
    seen: impl Fn(Point3<f64>, [f64; 2], f64) -> PreviousVisibility,
) -> [usize; 2] {
    let (before, old) = still.previous.as_ref().unwrap();
    let mut counts = [0, 0];
    for (k, id) in image.mask().iter().enumerate() {
        let found = image.flow()[k].map(f64::from);
        let infinite = found == [f64::INFINITY; 2];
        if *id == 0 {
            assert!(infinite, "{what}: a pixel without a surface has finite flow: {found:?}");
            continue;
        }
        let point = Point3::from(image.position()[k].map(f64::from));
        let thing = still.scene.instances().iter().position(|instance| instance.mask_id == *id).unwrap();
        let then = to_f64_pose(&before[thing]) * (to_f64_pose(&still.poses[thing]).inverse() * point);
        let here = [(k % image.width) as f64 + 0.5, (k / image.width) as f64 + 0.5];
        match seen(to_f64_pose(&old.world_from_camera).inverse() * then, here, point.coords.norm()) {
            PreviousVisibility::Either => {}
            PreviousVisibility::Unseen => {
                assert!(infinite, "{what}: a point that was not visible before has finite flow: {found:?}");
                counts[1] += 1;
            }
            PreviousVisibility::At(there, factors) => {
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
    let mut numbers = TestRng(21);
    let mut judged = 0;
    for seed in 0..16 {
        let mut still = moving(&mut numbers, 3.0, |view| view, [96, 72]);
        // The intrinsics change, too.
        let (view, old) = (still.view, &mut still.previous.as_mut().unwrap().1);
        (old.fx, old.cx) = (view.fx * 1.1, view.cx + 3.0);
        let old = *old;
        still.view = if seed % 2 == 0 { view } else { old };
        for renderer in [Renderer::Raster, Renderer::FastRayTraced] {
            let [found, _] = check("pinhole", &still, &still.with_renderer(renderer), |p, here, distance| {
                if p.z.abs() < 0.05 {
                    return PreviousVisibility::Either;
                } else if p.z < 0.0 {
                    return PreviousVisibility::Unseen;
                }
                let [fx, fy, cx, cy] = [old.fx, old.fy, old.cx, old.cy].map(f64::from);
                let there = [fx * p.x / p.z + cx, fy * p.y / p.z + cy];
                // Far outside of the previous image, digits are lost with the slant; far away, with the distance.
                let slant = |axis: usize| 1.0 + (here[axis] - there[axis]).abs() / 100.0;
                PreviousVisibility::At(there, [0, 1].map(|axis| slant(axis) * (1.0 + distance / p.z / 4.0)))
            });
            judged += found;
        }
    }
    assert!(judged > 100_000, "{judged}");
}

/// Through every lens, with moving instances, a moving camera and changing intrinsics: each point is where the lens
/// projected it in the previous frame, or was not visible. Other tests check the lenses.
#[test]
fn lenses() {
    let (mut numbers, mut unseen) = (TestRng(8), 0);
    for (lens, pixels) in super::lenses::all() {
        let mut judged = 0;
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        let rays = LensRays::new(&Optics::new(lens, pixels).unwrap(), [64, 48], 1).unwrap();
        for _ in 0..6 {
            let still = moving(&mut numbers, 2.0, |view| View { fx, fy, cx, cy, ..view }, [64, 48]);
            for (changed, renderer) in [(false, Renderer::FastRayTraced), (true, Renderer::Hybrid)] {
                let mut still = TestFrame { lens: Some(rays.clone()), renderer, ..still.clone() };
                let mut numbers = pixels;
                if changed {
                    let old = &mut still.previous.as_mut().unwrap().1;
                    (old.fx, old.cy) = (0.9 * fx, cy + 2.0);
                    let [fx, fy, cx, cy] = [old.fx, old.fy, old.cx, old.cy].map(f64::from);
                    numbers = PixelIntrinsics { fx, fy, cx, cy };
                }
                let then = Optics::new(lens, numbers).unwrap();
                let [found, missed] = check(lens.name(), &still, &still.draw(), |p, _, _| {
                    let aside = p.x.hypot(p.y).atan2(p.z);
                    // Within 1e-4 rad of the end of the lens, the point may be visible or not.
                    if p.coords.norm() < 0.2 || (aside - then.domain().angle).abs() < 1e-4 {
                        return PreviousVisibility::Either;
                    }
                    // Far outside of the image a pixel is a small angle.
                    let slope = 1.0 / aside.cos().abs().max(0.02);
                    then.project(p.coords.into())
                        .map_or(PreviousVisibility::Unseen, |there| PreviousVisibility::At(there, [slope; 2]))
                });
                (judged, unseen) = (judged + found, unseen + missed);
            }
        }
        assert!(judged > 5000, "{}: {judged}", lens.name());
    }
    assert!(unseen > 100, "the control: {unseen}");
}

/// A camera that rotates about its center: flow is that of the homography K R K^-1, at any distance. Without any
/// motion, it is exactly zero.
#[test]
fn homography() {
    let view = look_at_view([90, 70], 1.0, [2.5, 0.3, 0.8], [0.0; 3]);
    let turn = from_xyz_rpy([0.0; 3], [0.05, -0.08, 0.11]);
    let now = View { world_from_camera: PoseF32::from(&(to_f64_pose(&view.world_from_camera) * turn)), ..view };
    let still = TestFrame { channels: WANTED, ..TestFrame::new(random_scene(&mut TestRng(3), 1.0), view) };
    let still = TestFrame { cfg: RasterCfg { lod: false, ..RasterCfg::default() }, ..still };
    let previous = Some((still.poses.clone(), view));
    let image = TestFrame { previous: previous.clone(), view: now, ..still.clone() }.draw();
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
    let unmoved = TestFrame { previous, ..still.clone() }.draw();
    for (flow, id) in unmoved.flow().iter().zip(unmoved.mask()) {
        assert_eq!(*flow, if *id == 0 { [f32::INFINITY; 2] } else { [0.0; 2] });
    }
    assert!(
        still.draw().flow().iter().flatten().all(|&x| x == f32::INFINITY),
        "without a previous frame, flow is infinite"
    );
}

#[test]
fn invalid_previous_frames() {
    let still =
        TestFrame::new(random_scene(&mut TestRng(4), 1.0), look_at_view([20, 16], 1.0, [2.5, 0.3, 0.8], [0.0; 3]));
    let error = |channels, change: fn(&mut Vec<PoseF32>, &mut View)| {
        let (mut poses, mut view) = (still.poses.clone(), still.view);
        change(&mut poses, &mut view);
        TestFrame { channels, previous: Some((poses, view)), ..still.clone() }.try_draw().err()
    };
    let expected = still.poses.len();
    let few = |poses: &mut Vec<PoseF32>, _: &mut View| poses.truncate(poses.len() - 1);
    assert_eq!(error(WANTED, few), Some(RenderError::PoseCount { expected, found: expected - 1 }));
    let pose = error(WANTED, |poses, _| poses[2].translation[0] = f32::NAN);
    assert!(matches!(pose, Some(RenderError::InstancePose { instance: 2, .. })), "{pose:?}");
    let flat = error(WANTED, |_, view| view.fx = 0.0);
    assert!(matches!(flat, Some(RenderError::Intrinsics { .. })), "{flat:?}");
    // Other channels do not use the previous frame.
    assert_eq!(error(Channels { depth: true, ..Channels::NONE }, few), None);
}
