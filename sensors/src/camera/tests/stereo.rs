//! Stereo cameras, against single cameras, stereo geometry, and OpenCV's rectification.

use super::super::{
    CalibrationError, Camera, CameraCfg, CameraConvention, CameraError, CameraInfo, CameraPlacement, DepthMiss,
    DistortionModel, Extrinsics, Imperfections, Placement, Rectification, StereoCamera, StereoCameraCfg, StereoOrigin,
    look_at_pose,
};
use super::test_scene::{
    BALL, GROUND, LENS, RADIUS, SIZE, ball, bits, built, cfg, context, pinhole, point, pose_of, state, tip,
};
use crate::camera::imperfection::{DepthNoise, Holes, ReadNoise};
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use kinetoscope_render::OpticsError;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::{Equisolid, OpenCv, OpenCvFisheye};
use kinetoscope_render::lens::{Lens, Optics};
use kinetoscope_render::{Intrinsics, PixelIntrinsics, Renderer};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_testkit::opencv::opencv;
use nalgebra::{Matrix3, Matrix3x4, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use ndarray::{Axis, array};
use std::collections::BTreeMap;

const BASELINE: f64 = 0.2;
/// The same intrinsics as [`LENS`], with the principal point farther to the right.
const SHIFTED: Intrinsics = Intrinsics::Pixels { fx: 40.0, fy: 52.0, cx: 26.5, cy: 17.5 };

/// A stereo camera of two small cameras, 20 cm apart.
fn stereo_cfg() -> StereoCameraCfg {
    StereoCameraCfg { camera: cfg(), left_to_right_pos: [BASELINE, 0.0, 0.0], ..StereoCameraCfg::default() }
}

fn pair_of(camera: CameraCfg) -> StereoCameraCfg {
    StereoCameraCfg { camera, ..stereo_cfg() }
}

fn of(cfg: &StereoCameraCfg, context: &SensorContext) -> StereoCamera {
    let mut stereo = cfg.build(context).unwrap();
    let envs: Vec<usize> = (0..context.num_envs).collect();
    stereo.reset(&envs, &state(&vec![0; context.num_envs])).unwrap();
    stereo
}

fn both_bits(stereo: &StereoCamera, envs: usize) -> [Vec<u32>; 2] {
    [stereo.left(), stereo.right()].map(|eye| bits(eye, 0..envs))
}

/// Distance of two poses \[m\] and the angle between them \[rad\].
fn apart(a: &Pose, b: &Pose) -> [f64; 2] {
    let between = a.inverse() * b;
    [between.translation.vector.norm(), between.rotation.angle()]
}

/// Asserts the poses of the two cameras in an environment.
#[track_caller]
fn assert_camera_poses(stereo: &StereoCamera, env: usize, expected: [Pose; 2]) {
    for (eye, expected) in [stereo.left(), stereo.right()].into_iter().zip(expected) {
        let [moved, turned] = apart(&pose_of(eye, env), &expected);
        assert!(moved < 1e-12 && turned < 1e-7, "{moved} {turned}");
    }
}

#[test]
fn single_cameras() {
    let context = context(2);
    let turned = UnitQuaternion::from_euler_angles(0.02, -0.1, 0.05);
    let there = look_at_pose([-1.6, 0.0, 0.9], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0]).unwrap();
    let offset = Pose::from_parts([0.2, 0.03, -0.04].into(), turned);
    let right_lens = Intrinsics::Pixels { fx: 60.0, fy: 50.0, cx: 20.0, cy: 15.0 };
    for (origin, left) in
        [(StereoOrigin::Left, there), (StereoOrigin::Middle, there * Pose::translation(-0.1, -0.015, 0.02))]
    {
        let intrinsics_right = Some(right_lens);
        let (left_to_right_pos, left_to_right_rot) = ([0.2, 0.03, -0.04], turned);
        let cfg = StereoCameraCfg { intrinsics_right, left_to_right_pos, left_to_right_rot, origin, ..stereo_cfg() };
        let mut stereo = of(&cfg, &context);
        stereo.update(&state(&[3, 4])).unwrap();
        assert_camera_poses(&stereo, 1, [left, left * offset]);
        let origins = stereo.pose_w(CameraConvention::Ros);
        let [moved, turned] = apart(&from_row(&std::array::from_fn(|k| origins[(1, k)])), &there);
        assert!(moved < 1e-12 && turned < 1e-7, "{moved} {turned}");
        // Each camera equals a single camera at the same pose, in all channels, bit for bit.
        for (eye, pose, intrinsics) in [(stereo.left(), left, LENS), (stereo.right(), left * offset, right_lens)] {
            let placement = Placement::Pose { pos: pose.translation.into(), rotation: pose.rotation };
            let extrinsics = Extrinsics { placement, ..Extrinsics::default() };
            let mut alone = built(&CameraCfg { extrinsics, intrinsics, ..super::test_scene::cfg() }, &context);
            alone.update(&state(&[3, 4])).unwrap();
            assert_eq!(bits(eye, 0..2), bits(&alone, 0..2), "{origin:?}");
            assert_eq!((eye.stamps(), eye.frame_counts()), (alone.stamps(), alone.frame_counts()));
            assert_eq!(eye.depth().unwrap().dim(), (2, SIZE[1], SIZE[0]));
        }
        // Control: the two images differ.
        let [left, right] = both_bits(&stereo, 2);
        assert!(left != right);
    }
}

/// Returns the number of compared pixels of the left image, and the number of errors among them: pixels that the right
/// camera does not see at the expected position. Disparities are multiplied by `scale`: 1, or another value as a
/// control.
///
/// A point P seen by the left camera is projected to the right camera. Rows of a rectified stereo pair correspond, so P
/// falls between two pixels of its row, which see Q and R. Both surfaces are convex (a plane, a ball). So the right
/// camera sees P exactly if P is on the near side of its surface and both pixels see that surface. Then P, Q and R are
/// on the curve in which the epipolar plane cuts the surface: a line, or a circle of radius r <= R0. In the image, P is
/// between Q and R, so it is on the arc between them. The distance of the arc from the chord L is at most r - sqrt(r² -
/// L²/4) <= L²/(4 r). Single precision adds some ulps of coordinates below 100 m; only those nearer than 10 m are
/// compared: 1e-4.
fn reproject(stereo: &StereoCamera, steps: &[u64], scale: f64) -> (usize, usize) {
    let (left, right) = (stereo.left(), stereo.right());
    let disparity = stereo.disparity().unwrap();
    let (mut judged, mut wrong) = (0, 0);
    for row in 0..steps.len() {
        let at = |camera: &Camera, v: usize, u: usize| point(camera, [row, v, u]).coords;
        let (eyes, center) = ([pose_of(left, row), pose_of(right, row)], Vector3::from(ball(row, steps[row])));
        let matrices = right.intrinsic_matrices();
        for (v, u) in (0..SIZE[1]).flat_map(|v| (0..SIZE[0]).map(move |u| (v, u))) {
            let id = left.mask().unwrap()[(row, v, u)];
            let d = f64::from(disparity[(row, v, u)]) * scale;
            if id == 0 {
                assert_eq!(d, 0.0, "a miss");
                continue;
            }
            assert!(d > 0.0);
            let point = at(left, v, u);
            let [o, c] = eyes.map(|pose| pose.translation.vector);
            if (point - o).norm() > 10.0 {
                continue;
            }
            let normal = if id == GROUND { Vector3::z() } else { (point - center) / RADIUS };
            if normal.dot(&(c - point)) < 0.02 {
                continue;
            }
            // Expected position in the right image, from the disparity and the difference of the principal points.
            let shift = matrices[(row, 0, 2)] - left.intrinsic_matrices()[(row, 0, 2)];
            let x = u as f64 + 0.5 - d + shift;
            let first = (x - 0.5).floor();
            if first < 0.0 || first + 1.0 >= SIZE[0] as f64 {
                continue;
            }
            let columns = [first as usize, first as usize + 1];
            if columns.iter().any(|&column| right.mask().unwrap()[(row, v, column)] != id) {
                continue;
            }
            judged += 1;
            // Direct projection.
            let projected = pinhole(right, row, eyes[1].inverse() * Point3::from(point));
            let missed = (projected[0] - x).abs().max((projected[1] - (v as f64 + 0.5)).abs());
            let [q, r] = columns.map(|column| at(right, v, column));
            let chord = r - q;
            let along = ((point - q).dot(&chord) / chord.norm_squared()).clamp(0.0, 1.0);
            let off = (point - q - chord * along).norm();
            let sagitta = if id == GROUND {
                0.0
            } else {
                let plane = (c - o).cross(&(point - o)).normalize();
                let away = plane.dot(&(center - o));
                chord.norm_squared() / (4.0 * (RADIUS * RADIUS - away * away).max(1e-12).sqrt())
            };
            // 1e-3 pixels: the disparity is some 10 pixels in single precision, the point some ulps of 10 m at
            // 40 pixels.
            if missed > 1e-3 || off > sagitta + 1e-4 {
                wrong += 1;
            }
        }
    }
    (judged, wrong)
}

/// The disparity leads to the same point of the same surface.
#[test]
fn matching_points() {
    let context = context(2);
    for (renderer, intrinsics_right) in
        [Renderer::Raster, Renderer::FastRayTraced].into_iter().flat_map(|by| [(by, None), (by, Some(SHIFTED))])
    {
        let camera = CameraCfg { renderer, ..cfg() };
        let mut stereo = of(&StereoCameraCfg { intrinsics_right, ..pair_of(camera) }, &context);
        for steps in [[0, 0], [3, 4]] {
            stereo.refresh(&[0, 1], &state(&steps)).unwrap();
            let (judged, wrong) = reproject(&stereo, &steps, 1.0);
            assert!(judged > 1000 && wrong == 0, "{wrong} of {judged} pixels");
            let seen = stereo.left().mask().unwrap().iter().filter(|&&id| id == BALL).count();
            assert!(seen > 100, "{seen} pixels of the ball");
            // Control: an error of one percent is detected at nearly every pixel.
            let (judged, wrong) = reproject(&stereo, &steps, 1.01);
            assert!(10 * wrong > 9 * judged, "{wrong} of {judged} pixels");
        }
    }
}

/// Disparity uses the depth of the left camera including noise, which ends at the far plane; hits there have a
/// disparity too.
#[test]
fn disparity_formula() {
    let misses = [DepthMiss::Inf, DepthMiss::Far, DepthMiss::Zero];
    for (depth_miss, std) in misses.into_iter().flat_map(|miss| [(miss, 0.0), (miss, 0.5)]) {
        let noise = [("depth".to_string(), NoiseCfg::white(std))].into();
        let stereo = of(&pair_of(CameraCfg { depth_miss, noise, far: 4.0, ..cfg() }), &context(2));
        let (disparity, depth) = (stereo.disparity().unwrap(), stereo.left().depth().unwrap());
        let (mut misses, mut last) = (0, 0);
        for ((d, z), id) in disparity.iter().zip(depth).zip(stereo.left().mask().unwrap()) {
            let expected = if *id == 0 { 0.0 } else { (40.0 * BASELINE / f64::from(*z)) as f32 };
            misses += usize::from(*id == 0);
            last += usize::from(*id != 0 && *z >= 4f32.next_down());
            assert!(*d == expected && (*id == 0 || *d > 0.0), "{d}, not {expected}");
        }
        assert!(misses > 100 && (std == 0.0 || last > 20), "the control: noise reaches the far plane, {misses} {last}");
    }
}

#[test]
fn lazy_disparity() {
    let mut stereo = of(&pair_of(CameraCfg { update_period: 0.02, ..cfg() }), &context(2));
    assert_eq!(stereo.left().render_count() + stereo.right().render_count(), 0, "nothing is rendered before a read");
    let address = stereo.disparity().unwrap().as_ptr();
    assert_eq!(
        (stereo.left().render_count(), stereo.right().render_count()),
        (2, 0),
        "disparity needs the left camera only"
    );
    let before = stereo.disparity().unwrap().to_owned();
    let mut due = Vec::new();
    for step in 1..=4 {
        due.push(stereo.due_in(&[step - 1; 2]));
        stereo.update(&state(&[step; 2])).unwrap();
        assert!(step == 4 || stereo.disparity().unwrap() == before, "not due yet");
    }
    assert_eq!((due, stereo.left().render_count()), (vec![4, 3, 2, 1], 2));
    assert_ne!(stereo.disparity().unwrap(), before);
    assert_eq!(stereo.disparity().unwrap().as_ptr(), address, "memory stays where it is");
    assert_eq!((stereo.left().render_count(), stereo.left().frame_counts()), (4, array![1, 1].view()));
    // Other intrinsics change the disparity at the same instant.
    let other = [Intrinsics::Pixels { fx: 20.0, fy: 26.0, cx: 22.25, cy: 17.5 }];
    let before = stereo.disparity().unwrap().to_owned();
    stereo.set_intrinsics(&other, Some(&[1])).unwrap();
    let after = stereo.disparity().unwrap();
    assert_eq!(after.index_axis(Axis(0), 0), before.index_axis(Axis(0), 0));
    assert_ne!(after.index_axis(Axis(0), 1), before.index_axis(Axis(0), 1));
}

/// Two cameras at one pose see the same, bit for bit, but have different random numbers.
#[test]
fn independent_noise() {
    let one_place = |camera: CameraCfg| {
        let stereo = of(&StereoCameraCfg { left_to_right_pos: [0.0; 3], ..pair_of(camera) }, &context(1));
        [stereo.left(), stereo.right()].map(|eye| (eye.depth().unwrap().to_owned(), eye.color().unwrap().to_owned()))
    };
    let [left, right] = one_place(cfg());
    assert!(left == right, "the control: without noise they are the same");
    let noise = [("depth".to_string(), NoiseCfg::white(0.05))].into();
    let [left, right] = one_place(CameraCfg { noise, ..cfg() });
    let hits = left.0.iter().filter(|z| z.is_finite()).count();
    let same = left.0.iter().zip(&right.0).filter(|(a, b)| a.is_finite() && a == b).count();
    assert!(hits > 500 && same < hits / 100, "{same} of {hits}");
    let renderer = Renderer::RayTraced { samples: 2, max_bounces: 2, denoise: false, seed: 3 };
    let [left, right] = one_place(CameraCfg { renderer, ..cfg() });
    assert!(left.0 == right.0 && left.1 != right.1, "path tracing noise affects color, not depth");
}

/// Root cause: the right camera copied the noise and imperfections of the left one for all channels. No stereo camera
/// could be built whose right camera measures fewer channels.
#[test]
fn separate_imperfections() {
    let context = context(1);
    let [colors, both] = [false, true].map(|depth| Channels { color: true, depth, ..Channels::default() });
    let of_light = Imperfections { read_noise: Some(ReadNoise { std: 0.05 }), ..Imperfections::default() };
    let imperfections = Imperfections { depth_noise: Some(DepthNoise::NGUYEN), ..of_light.clone() };
    let noise = |names: &[&str]| names.iter().map(|name| (name.to_string(), NoiseCfg::white(0.5))).collect();
    let all_noise = noise(&["distance_to_image_plane", "rgb"]);
    let camera = CameraCfg { channels: both, imperfections, noise: all_noise, ..cfg() };
    let cfg = StereoCameraCfg { channels_right: Some(colors), ..pair_of(camera.clone()) };
    let stereo = of(&cfg, &context);
    // Reference: a single camera at the pose of the right camera, with its name and all imperfections of color.
    let extrinsics = cfg.camera_cfgs().unwrap()[1].extrinsics.clone();
    let alone = CameraCfg { channels: colors, imperfections: of_light, noise: noise(&["color"]), extrinsics, ..camera };
    let named = SensorContext { name: "/right".into(), ..context.clone() };
    let color = |cfg: &CameraCfg| built(cfg, &named).color().unwrap().to_owned();
    assert_eq!(stereo.right().color().unwrap(), color(&alone));
    assert!(stereo.left().depth().is_ok() && stereo.right().depth().is_err());
    // Controls: noise and imperfections are both visible.
    let quiet = CameraCfg { noise: BTreeMap::new(), ..alone.clone() };
    let clean = CameraCfg { imperfections: Imperfections::default(), ..alone };
    assert!(stereo.right().color().unwrap() != color(&quiet) && stereo.right().color().unwrap() != color(&clean));
    // Imperfections specific to the right camera.
    let (noise_right, imperfections_right) = (Some(BTreeMap::new()), Some(clean.imperfections.clone()));
    let stereo = of(&StereoCameraCfg { noise_right, imperfections_right, ..cfg }, &context);
    assert_eq!(stereo.right().color().unwrap(), color(&CameraCfg { noise: BTreeMap::new(), ..clean }));
}

/// Root cause: errors of a stereo camera did not state which of the two cameras they belong to.
#[test]
fn errors_name_the_camera() {
    let context = context(1);
    let [colors, depths] = [true, false].map(|color| Channels { color, depth: !color, ..Channels::default() });
    let of_depth = Imperfections { depth_noise: Some(DepthNoise::NGUYEN), ..Imperfections::default() };
    let shadows =
        |baseline| Imperfections { holes: Some(Holes { baseline, ..Holes::default() }), ..Default::default() };
    let camera = CameraCfg { channels: colors, renderer: Renderer::FastRayTraced, ..cfg() };
    let off = "the camera does not measure depth; it measures color";
    let bent = "projector shadows (holes with a baseline other than 0): supported only by pinhole cameras, but this camera has the lens";
    let with_depth_noise = CameraCfg { imperfections: of_depth.clone(), ..camera.clone() };
    let imperfections = shadows(Holes::default().baseline);
    let with_shadows = CameraCfg { channels: depths, imperfections, ..camera.clone() };
    let (channels_right, imperfections_right, lens_right) = (Some(depths), Some(of_depth), Some(fisheye()));
    let left = StereoCameraCfg { channels_right, ..pair_of(with_depth_noise) };
    let right = StereoCameraCfg { imperfections_right, ..pair_of(camera) };
    let lens = StereoCameraCfg { lens_right, ..pair_of(with_shadows) };
    // The left camera has only its own imperfections, whatever the right one measures; those of the right camera are
    // kept.
    for (cfg, expected) in [
        (&left, format!("the left camera: {off}")),
        (&right, format!("the right camera: {off}")),
        (&lens, format!("the right camera: {bent} opencv_fisheye")),
    ] {
        let error = cfg.build(&context).unwrap_err().to_string();
        assert!(error.starts_with(&expected), "{error}");
    }
    // All of them are possible with settings of the right camera.
    assert!(of(&StereoCameraCfg { channels_right, ..right }, &context).right().depth().is_ok());
    let cfg = StereoCameraCfg { imperfections_right: Some(shadows(0.0)), ..lens };
    assert!(of(&cfg, &context).right().depth().is_ok());
    // As in scene files.
    let text = "imperfections_right.holes.baseline = 0.0\nnoise_right.depth.std = 0.01\n[camera]\nchannels = ['depth']";
    let read: StereoCameraCfg = toml::from_str(text).unwrap();
    assert_eq!(read.imperfections_right, cfg.imperfections_right);
    assert_eq!(read.noise_right, Some([("depth".to_string(), NoiseCfg::white(0.01))].into()));
    assert_eq!(toml::from_str::<StereoCameraCfg>(&toml::to_string(&read).unwrap()).unwrap(), read);
    assert_eq!(toml::from_str::<StereoCameraCfg>("").unwrap(), StereoCameraCfg::default());
}

/// A rig is placed completely or not at all.
#[test]
fn placement() {
    let context = context(2);
    let extrinsics = Extrinsics { parent: Some("tip".into()), ..Extrinsics::default() };
    let mut attached = of(&pair_of(CameraCfg { extrinsics, ..cfg() }), &context);
    attached.refresh(&[0, 1], &state(&[3, 2])).unwrap();
    let half = Pose::translation(-0.5 * BASELINE, 0.0, 0.0);
    let eyes = |middle: Pose| [middle * half, middle * half.inverse()];
    assert_camera_poses(&attached, 1, eyes(from_row(&to_row(&tip(1, 2)))));
    let there = look_at_pose([-1.2, 0.4, 0.9], [0.1, 0.0, 0.5], [0.0, 0.0, 1.0]).unwrap();
    for convention in [CameraConvention::Ros, CameraConvention::OpenGl, CameraConvention::World] {
        attached.set_world_poses(&convention.pose_from_optical(&there), Some(&[1]), convention).unwrap();
        assert_camera_poses(&attached, 1, eyes(there));
        let (now, expected) = (attached.pose_w(convention), to_row(&convention.pose_from_optical(&there)));
        assert!(now.row(1).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{now}");
    }
    // The cameras move with the link.
    attached.refresh(&[1], &state(&[3, 9])).unwrap();
    assert_camera_poses(&attached, 1, eyes(tip(1, 9) * tip(1, 2).inverse() * there));

    let mut free = of(&stereo_cfg(), &context);
    free.look_at(&[[-1.2, 0.4, 0.9]], &[[0.1, 0.0, 0.5]], &[[0.0, 0.0, 1.0]], Some(&[0])).unwrap();
    assert_camera_poses(&free, 0, eyes(there));
    let untouched = free.left().local_pose(CameraConvention::Ros);
    let lens = |fx| Intrinsics::Pixels { fx, fy: 44.0, cx: 20.0, cy: 16.0 };
    assert!(free.set_left_right_intrinsics(&[lens(44.0)], &[lens(-1.0)], None).is_err());
    assert!(free.set_left_right_intrinsics(&[lens(44.0)], &[lens(44.0); 3], None).is_err());
    assert_eq!(free.left().intrinsic_matrices()[(0, 0, 0)], 40.0, "the left camera did not change either");
    assert!(free.set_local_pose(&there, Some(&[2]), CameraConvention::Ros).is_err());
    assert!(free.look_at(&[[0.0; 3]], &[[0.0; 3]], &[[0.0; 3]], None).is_err());
    assert_eq!(free.left().local_pose(CameraConvention::Ros), untouched);
    free.restore(None).unwrap();
    assert!(both_bits(&free, 2) == both_bits(&of(&stereo_cfg(), &context), 2));
}

#[test]
fn without_disparity() {
    let context = context(1);
    let lens = |fx, fy, cy| StereoCameraCfg {
        intrinsics_right: Some(Intrinsics::Pixels { fx, fy, cx: 22.25, cy }),
        ..stereo_cfg()
    };
    let moved = |left_to_right_pos| StereoCameraCfg { left_to_right_pos, ..stereo_cfg() };
    let left_to_right_rot = UnitQuaternion::from_euler_angles(0.0, 0.25, 0.0);
    for (cfg, expected) in [
        (lens(41.0, 52.0, 17.5), "fx of the right camera is 41; it must be 40, as of the left camera"),
        (lens(40.0, 51.0, 17.5), "fy of the right camera is 51"),
        (lens(40.0, 52.0, 17.0), "cy of the right camera is 17"),
        (
            StereoCameraCfg { left_to_right_rot, ..stereo_cfg() },
            "the angle between the cameras [rad] is 0.25; it must be 0",
        ),
        (moved([0.1, 0.01, 0.0]), "left_to_right_pos.y [m] is 0.01"),
        (moved([0.1, 0.0, -0.01]), "left_to_right_pos.z [m] is -0.01"),
        (moved([-0.1, 0.0, 0.0]), "left_to_right_pos.x [m] is -0.1"),
        (moved([0.0; 3]), "left_to_right_pos.x [m] is 0; it must be positive"),
    ] {
        let stereo = of(&cfg, &context);
        let error = stereo.disparity().unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
        // All other channels can be read.
        assert!(stereo.right().depth().is_ok());
    }
    let camera = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..cfg() };
    let blind = of(&StereoCameraCfg { channels_right: Some(Channels::ALL), ..pair_of(camera) }, &context);
    let off = blind.disparity().unwrap_err();
    assert!(matches!(off, SensorError::Camera(CameraError::ChannelOff { channel: "depth", .. })), "{off}");
    assert!(blind.right().depth().is_ok(), "each camera has its own channels");
    let nowhere = moved([f64::NAN, 0.0, 0.0]).build(&context);
    assert!(matches!(nowhere, Err(SensorError::Camera(CameraError::Pose { .. }))));
    let error = lens(0.0, 1.0, 1.0).build(&context).unwrap_err();
    assert_eq!(error.to_string(), "the right camera: fx of the lens is 0; it must be positive and finite");
    let SensorError::StereoCamera { side: "right", error } = error else { panic!("{error}") };
    assert!(matches!(*error, SensorError::Camera(CameraError::Optics(OpticsError::Lens { .. }))), "{error}");
}

/// A fisheye lens, which needs a ray tracer.
fn fisheye() -> Lens {
    OpenCvFisheye { k1: 0.05, ..OpenCvFisheye::default() }.into()
}

#[test]
fn own_lenses() {
    let context = context(1);
    let camera = CameraCfg { renderer: Renderer::FastRayTraced, ..cfg() };
    let plain = pair_of(camera.clone());
    let cfg = StereoCameraCfg { lens_right: Some(fisheye()), ..plain.clone() };
    let (stereo, without) = (of(&cfg, &context), of(&plain, &context));
    assert_eq!((stereo.left().lens(), stereo.right().lens()), (Lens::default(), fisheye()));
    let alone = built(&CameraCfg { lens: fisheye(), ..cfg.camera_cfgs().unwrap()[1].clone() }, &context);
    assert!(both_bits(&stereo, 1) == [bits(without.left(), 0..1), bits(&alone, 0..1)]);
    // Control: the image differs from that without the lens.
    assert!(bits(stereo.right(), 0..1) != bits(without.right(), 0..1));
    // Disparity needs two pinholes, whichever camera has another lens.
    assert!(without.has_disparity() && !stereo.has_disparity());
    let swapped = pair_of(CameraCfg { lens: fisheye(), ..camera });
    let swapped = StereoCameraCfg { lens_right: Some(Lens::default()), ..swapped };
    for stereo in [stereo, of(&swapped, &context)] {
        let error = stereo.disparity().unwrap_err();
        assert!(matches!(error, SensorError::Camera(CameraError::PinholeOnly { what: "disparity", .. })), "{error}");
    }
}

/// Images of lenses use ray tables: a failed change keeps those too.
#[test]
fn failed_changes() {
    let camera = CameraCfg { renderer: Renderer::FastRayTraced, lens: fisheye(), ..cfg() };
    let mut stereo = of(&pair_of(camera), &context(2));
    let lens = |fx| Intrinsics::Pixels { fx, fy: 44.0, cx: 20.0, cy: 16.0 };
    // Intrinsics set before are kept, not replaced by the configured ones.
    stereo.set_intrinsics(&[lens(44.0)], Some(&[1])).unwrap();
    let (before, bytes) = (both_bits(&stereo, 2), stereo.left().lens_bytes());
    assert!(stereo.set_left_right_intrinsics(&[lens(30.0)], &[lens(-1.0)], None).is_err());
    stereo.set_local_pose(&stereo.local_pose(CameraConvention::Ros), None, CameraConvention::Ros).unwrap();
    assert!(both_bits(&stereo, 2) == before && stereo.left().lens_bytes() == bytes);
    // Control: a successful change is visible, and unused tables are freed.
    stereo.set_intrinsics(&[lens(30.0)], Some(&[1])).unwrap();
    assert!(bits(stereo.left(), 0..2) != before[0] && stereo.left().lens_bytes() == bytes);
}

/// Definition of P in `sensor_msgs/CameraInfo`: (u, v, w) = P (X, Y, Z, 1) of a point in the left frame. It must match
/// the projection by the right camera at its pose.
#[test]
fn projection_matrices() {
    let stereo = of(&StereoCameraCfg { intrinsics_right: Some(SHIFTED), ..stereo_cfg() }, &context(2));
    let [left, right] = stereo.camera_info("head", 1).unwrap();
    assert_eq!((left.name.as_str(), right.name.as_str()), ("head/left", "head/right"));
    assert_eq!(left.projection_matrix.column(3).amax(), 0.0);
    assert_eq!(right.projection_matrix[(0, 3)], -40.0 * BASELINE);
    let alone = stereo.right().camera_info("head", 1).unwrap();
    for point in [[0.3, -0.2, 1.5], [-0.7, 0.4, 4.0], [0.0, 0.0, 0.5]].map(Point3::from) {
        for (info, eye) in [(&left, stereo.left()), (&right, stereo.right())] {
            let seen = pinhole(eye, 1, pose_of(eye, 1).inverse() * (pose_of(stereo.left(), 1) * point));
            let p = projected(&info.projection_matrix, point.coords);
            // ROS counts from the center of the first pixel. Tolerance: some ulps of 100 pixels, and of poses.
            assert!((0..2).all(|axis| (p[axis] + 0.5 - seen[axis]).abs() < 1e-10), "{p:?} {seen:?}");
        }
        // Control: without the fourth column, the point is 40 * 0.2 / z pixels off, at least 2.
        let off = (alone.projection_matrix - right.projection_matrix) * point.to_homogeneous() / point.z;
        assert!(off.x >= 1.999);
    }
    assert_eq!(CameraInfo::parse(&right.to_yaml(), "right.yaml").unwrap(), right);
    assert!(stereo.camera_info("head", 2).is_err());
}

/// A stereo camera of OpenCV: rotation and translation that map points from the left to the right frame, and the
/// results of `stereoRectify`.
struct OpenCvStereo {
    r: [f64; 9],
    t: [f64; 3],
    r1: [f64; 9],
    r2: [f64; 9],
    /// fx, cx, cy of both P, and P\[0\]\[3\] of the right one.
    p: [f64; 4],
    /// Pixels of `projectPoints` for three points of the left frame, in the raw images of both cameras.
    seen: [[f64; 6]; 2],
}

const K: [[f64; 4]; 2] = [[610.2, 611.0, 324.1, 238.7], [598.4, 600.3, 317.6, 243.2]];
const D: [[f64; 5]; 2] = [[-0.31, 0.11, 0.0004, -0.0002, 0.01], [-0.28, 0.09, -0.0003, 0.0005, -0.005]];
const POINTS: [[f64; 3]; 3] = [[0.3, -0.2, 1.5], [-0.4, 0.25, 2.0], [0.1, 0.05, 0.8]];

impl OpenCvStereo {
    fn all() -> impl Iterator<Item = Self> {
        opencv::<46>("stereo_rectify").map(|n| {
            let nine = |from: usize| std::array::from_fn(|k| n[from + k]);
            let seen = [34, 40].map(|from| std::array::from_fn(|k| n[from + k]));
            Self {
                r: nine(0),
                t: [n[9], n[10], n[11]],
                r1: nine(12),
                r2: nine(21),
                p: [n[30], n[31], n[32], n[33]],
                seen,
            }
        })
    }

    /// Calibrations of both cameras.
    fn infos(&self) -> [CameraInfo; 2] {
        let [f, cx, cy, tx] = self.p;
        let info = |k: usize, r: &[f64; 9], tx: f64| CameraInfo {
            name: ["left", "right"][k].into(),
            width: 640,
            height: 480,
            camera_matrix: Matrix3::new(K[k][0], 0.0, K[k][2], 0.0, K[k][1], K[k][3], 0.0, 0.0, 1.0),
            distortion_model: DistortionModel::PlumbBob,
            distortion_coefficients: D[k].to_vec(),
            rectification_matrix: Matrix3::from_row_slice(r),
            projection_matrix: Matrix3x4::new(f, 0.0, cx, tx, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0),
        };
        [info(0, &self.r1, 0.0), info(1, &self.r2, tx)]
    }

    /// Pose of the right camera in the left frame: the inverse of X_right = R X_left + T.
    fn left_from_right(&self) -> Pose {
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&self.r)));
        Pose::from_parts(Translation3::from(self.t), rotation).inverse()
    }
}

fn rig_of(cfg: &StereoCameraCfg) -> Pose {
    Pose::from_parts(Translation3::from(cfg.left_to_right_pos), cfg.left_to_right_rot)
}

fn pixels(intrinsics: Intrinsics) -> PixelIntrinsics {
    intrinsics.to_pixels(640, 480).unwrap()
}

/// From K, D, R and P to the cameras: poses equal the input of OpenCV, and points project to the pixels of OpenCV.
#[test]
fn opencv_stereo_cameras() {
    assert_eq!(OpenCvStereo::all().count(), 2);
    for known in OpenCvStereo::all() {
        let [left, right] = known.infos();
        let cfg = StereoCameraCfg::from_camera_infos(&left, &right).unwrap();
        let expected = known.left_from_right();
        // Numbers of 16 digits, and the rounding of OpenCV: some ulps in products of R, and the baseline is the norm of
        // T.
        let [moved, turned] = apart(&rig_of(&cfg), &expected);
        assert!(moved < 1e-14 && turned < 1e-14, "{moved} {turned}");
        assert_eq!((cfg.origin, cfg.camera.renderer), (StereoOrigin::Left, Renderer::FastRayTraced));
        assert_eq!((cfg.camera.width, cfg.camera.height), (640, 480));
        let lens_right = cfg.lens_right.unwrap();
        let eyes = [(cfg.camera.intrinsics, cfg.camera.lens), (cfg.intrinsics_right.unwrap(), lens_right)];
        let [left, right] = eyes.map(|(intrinsics, lens)| Optics::new(lens, pixels(intrinsics)).unwrap());
        for (k, point) in POINTS.into_iter().enumerate() {
            let beside = rig_of(&cfg).inverse() * Point3::from(point);
            for (optics, at, seen) in [(&left, point, known.seen[0]), (&right, beside.into(), known.seen[1])] {
                let found = optics.project(at).unwrap();
                let off = [0, 1].map(|axis| found[axis] - CameraInfo::FIRST_PIXEL_CENTER - seen[2 * k + axis]);
                assert!(off.iter().all(|off| off.abs() < 1e-10), "{point:?}: {off:?} pixels");
            }
        }
        // Control: a millimeter and a milliradian are detected.
        let moved =
            expected * Pose::from_parts(Translation3::new(1e-3, 0.0, 0.0), UnitQuaternion::new(Vector3::x() * 1e-3));
        assert!(apart(&rig_of(&cfg), &moved).iter().all(|off| *off > 5e-4));
        // R and the baseline equal those of OpenCV; f and the principal points are chosen differently, as documented.
        let [left, right] = K.map(|[fx, fy, cx, cy]| PixelIntrinsics { fx, fy, cx, cy });
        let found = Rectification::new(&known.left_from_right(), [left, right]).unwrap();
        for (rotation, expected) in found.rotations.iter().zip([&known.r1, &known.r2]) {
            let off = (rotation - Matrix3::from_row_slice(expected)).amax();
            // OpenCV computes the last angle by an arc cosine, which has some ulps over that angle: 0.03 rad or more
            // here.
            assert!(off < 1e-14, "{off}");
        }
        let baseline = |p: f64, f: f64| -p / f;
        let p = &found.projections[1];
        assert!((baseline(p[(0, 3)], p[(0, 0)]) - baseline(known.p[3], known.p[0])).abs() < 1e-15);
        assert_eq!((p[(0, 0)], p[(1, 1)]), (600.3, 600.3), "the smaller fy");
    }
}

/// A point of a rectified image \[pixels\].
fn projected(p: &Matrix3x4<f64>, point: Vector3<f64>) -> [f64; 2] {
    let at = p * point.push(1.0);
    [at.x / at.z, at.y / at.z]
}

fn of_two(cfg: &StereoCameraCfg) -> StereoCamera {
    of(cfg, &context(2))
}

/// Stereo cameras that are not parallel, are rotated, or have other lenses.
fn stereo_cfgs() -> Vec<StereoCameraCfg> {
    let other = |fx, fy, cx, cy| Some(Intrinsics::Pixels { fx, fy, cx, cy });
    let turned = UnitQuaternion::from_euler_angles;
    let barrel = OpenCv { k1: -0.1, k2: 0.01, p1: 1e-3, p2: -2e-3, ..OpenCv::default() };
    let fish = OpenCvFisheye { k1: 0.02, k2: -0.003, ..OpenCvFisheye::default() };
    let pair = |pos, rot, intrinsics_right, lens: Lens, lens_right| StereoCameraCfg {
        camera: CameraCfg { lens, renderer: Renderer::FastRayTraced, ..cfg() },
        left_to_right_pos: pos,
        left_to_right_rot: rot,
        intrinsics_right,
        lens_right,
        origin: StereoOrigin::Left,
        ..StereoCameraCfg::default()
    };
    vec![
        pair([0.1, 0.0, 0.0], turned(0.0, -0.2, 0.0), None, Lens::default(), None),
        pair(
            [0.12, 0.01, -0.02],
            turned(0.03, -0.1, 0.05),
            other(44.0, 50.0, 20.0, 15.0),
            barrel.into(),
            Some(fish.into()),
        ),
        pair([0.3, -0.2, 0.1], turned(-0.2, 0.3, 0.4), other(41.0, 52.0, 23.0, 18.5), fish.into(), Some(barrel.into())),
        // Parallel, with another focal length.
        pair([0.06, 0.0, 0.0], UnitQuaternion::identity(), other(40.5, 52.0, 22.25, 17.5), Lens::default(), None),
        // Almost above each other: images lie on their side.
        pair([0.01, 0.2, 0.0], turned(0.05, 0.0, 0.0), None, barrel.into(), None),
    ]
}

/// Definitions of R and P for cameras at their poses: a point is in the same row of both rectified images, and f b / z
/// farther left in the right one. Undistorting raw pixels gives the same result.
#[test]
fn rectified_rows() {
    for cfg in stereo_cfgs() {
        let stereo = of_two(&cfg);
        let eyes = [stereo.left(), stereo.right()];
        let infos = stereo.camera_info("head", 1).unwrap();
        let ros = CameraInfo::FIRST_PIXEL_CENTER;
        let f = infos[0].projection_matrix[(0, 0)];
        let baseline = Vector3::from(cfg.left_to_right_pos).norm();
        let (mut by_raw, mut skew, mut middle) = (0, 0.0f64, [0.0; 2]);
        for point in [[0.1, 0.0, 1.0], [-0.2, 0.1, 0.8], [0.05, -0.1, 3.0], [0.6, 0.4, 2.0], [-1.0, -0.5, 6.0]] {
            let world = pose_of(eyes[0], 1) * Point3::from(point);
            // Position in the rectified frame of each camera.
            let rectified =
                [0, 1].map(|k| infos[k].rectification_matrix * (pose_of(eyes[k], 1).inverse() * world).coords);
            let z = rectified[0].z;
            assert!(z > 0.1 && (rectified[1] - rectified[0] + Vector3::x() * baseline).norm() < 1e-13);
            // P of both cameras takes points of the left frame.
            let [left, right] = [0, 1].map(|k| projected(&infos[k].projection_matrix, rectified[0]));
            let [shift, drop] = [left[0] - right[0] - f * baseline / z, left[1] - right[1]];
            assert!(shift.abs() < 1e-10 && drop.abs() < 1e-10, "{shift} {drop}");
            for (k, expected) in [left, right].into_iter().enumerate() {
                let optics = eyes[k].optics(1).unwrap();
                let raw = optics.project((pose_of(eyes[k], 1).inverse() * world).coords.into());
                let Some(ray) = raw.and_then(|raw| optics.unproject(raw)) else { continue };
                let mut own = infos[k].projection_matrix;
                // The position in the right frame already contains the fourth column.
                own.set_column(3, &Vector3::zeros());
                let found = projected(&own, infos[k].rectification_matrix * Vector3::from(ray));
                let off = [found[0] - expected[0], found[1] - expected[1]];
                // Distortions are inverted to about 1e-12 of the normalized image.
                assert!(off.iter().all(|off| off.abs() < 1e-8), "{off:?}");
                by_raw += 1;
                // Control: raw rows differ.
                skew = skew.max((raw.unwrap()[1] - ros - expected[1]).abs());
            }
        }
        assert!(by_raw >= 8, "{by_raw}");
        let straight = cfg.left_to_right_rot == UnitQuaternion::identity();
        assert!(straight || skew > 0.5, "{skew}");
        // Common principal points: infinitely far points have no disparity.
        let [left, right] = [0, 1].map(|k| infos[k].projection_matrix.fixed_columns::<3>(0).into_owned());
        assert_eq!(left, right);
        // Both rectified principal points are the mean of the raw ones.
        for (k, info) in infos.iter().enumerate() {
            let ahead = projected(&info.projection_matrix, info.rectification_matrix * Vector3::z() * 1e9);
            let own = [info.camera_matrix[(0, 2)], info.camera_matrix[(1, 2)]];
            (0..2).for_each(|axis| middle[axis] += ahead[axis] - own[axis]);
            assert!((info.rectification_matrix.determinant() - 1.0).abs() < 1e-14, "{k}");
        }
        assert!(middle.iter().all(|sum| sum.abs() < 1e-6), "{middle:?}");
        assert_eq!(infos.each_ref().map(|info| info.name.as_str()), ["head/left", "head/right"]);
    }
}

/// The calibrations of a stereo camera give the same stereo camera, through the text of files too.
#[test]
fn calibration_round_trip() {
    for cfg in stereo_cfgs() {
        let infos = of_two(&cfg).camera_info("head", 0).unwrap();
        let read = infos.each_ref().map(|info| CameraInfo::parse(&info.to_yaml(), &info.name).unwrap());
        assert_eq!(read, infos);
        let again = StereoCameraCfg::from_camera_infos(&read[0], &read[1]).unwrap();
        let [moved, turned] = apart(&rig_of(&again), &rig_of(&cfg));
        // Some ulps of numbers below 1.
        assert!(moved < 1e-14 && turned < 1e-14, "{moved} {turned}");
        let close = |a: Intrinsics, b: Intrinsics| {
            let [a, b] = [a, b].map(pixels);
            // Half a pixel there and back.
            let off = [a.fx - b.fx, a.fy - b.fy, a.cx - b.cx, a.cy - b.cy];
            off.iter().all(|off| off.abs() < 1e-14)
        };
        assert!(close(again.camera.intrinsics, cfg.camera.intrinsics));
        assert!(close(again.intrinsics_right.unwrap(), cfg.intrinsics_right.unwrap_or(cfg.camera.intrinsics)));
        let same = |a: Lens, b: Lens| a == b || a.is_pinhole() && b.is_pinhole();
        assert!(same(again.camera.lens, cfg.camera.lens));
        assert!(same(again.lens_right.unwrap(), cfg.lens_right.unwrap_or(cfg.camera.lens)));
        // The result can be built, and has the same calibrations.
        let own = CameraCfg { channels: cfg.camera.channels, ..again.camera.clone() };
        let said = of_two(&StereoCameraCfg { camera: own, ..again }).camera_info("head", 0).unwrap();
        for (said, info) in said.iter().zip(&infos) {
            assert!((said.rectification_matrix - info.rectification_matrix).amax() < 1e-14);
            assert!((said.projection_matrix - info.projection_matrix).amax() < 1e-11);
        }
    }
}

#[test]
fn not_rectifiable() {
    for (left_to_right_pos, angle, expected) in [
        ([-0.1, 0.0, 0.0], 0.0, "the x offset of the right camera [m] is -0.1; it must be positive"),
        ([0.0; 3], 0.0, "the x offset of the right camera [m] is 0; it must be positive"),
        ([0.01, 0.0, 0.2], 0.0, "the rectifying rotation of the left camera [rad] is 1.52"),
        ([0.3, 0.0, 0.0], 3.0, "it must be at most 1.396 (80 degrees)"),
    ] {
        let left_to_right_rot = UnitQuaternion::from_euler_angles(0.0, angle, 0.0);
        let stereo =
            of_two(&StereoCameraCfg { camera: cfg(), left_to_right_pos, left_to_right_rot, ..Default::default() });
        let error = stereo.camera_info("head", 0).unwrap_err();
        assert!(matches!(error, SensorError::Camera(CameraError::NotRectifiable { .. })), "{error}");
        let said = error.to_string();
        assert!(said.starts_with("this stereo camera cannot be rectified: ") && said.contains(expected), "{said}");
        // Only errors of the disparity mention disparity.
        assert!(!said.contains("disparity") && stereo.disparity().unwrap_err().to_string().contains("disparity"));
    }
    // Lenses without a ROS model are rejected as for a single camera, whatever the poses.
    let camera = CameraCfg { lens: Equisolid::default().into(), renderer: Renderer::FastRayTraced, ..cfg() };
    let stereo = of_two(&StereoCameraCfg { camera, ..stereo_cfgs()[2].clone() });
    let error = stereo.camera_info("head", 0).unwrap_err();
    assert!(matches!(error, SensorError::Calibration(CalibrationError::Lens { lens: "equisolid", .. })), "{error}");
    // Their rectification is still available.
    assert!(stereo.rectification(1).is_ok() && stereo.rectification(2).is_err());
}

#[test]
fn refused_pairs() {
    type Change = fn(&mut CameraInfo, &mut CameraInfo);
    let changes: [(Change, &str); 11] = [
        (|_, r| r.width = 320, "the size of the right image is 320 x 480; it must be 640 x 480, as of the left camera"),
        (|_, r| r.projection_matrix[(0, 3)] = 0.0, "P[0][3] of the right camera is 0; it must be negative"),
        (|l, r| std::mem::swap(l, r), "P[0][3] of the right camera is 0; it must be negative"),
        (|_, r| r.projection_matrix[(0, 3)] = 72.8, "P[0][3] of the right camera is 72.8"),
        (|_, r| r.projection_matrix[(0, 3)] = f64::NAN, "P[0][3] of the right camera is NaN"),
        (|l, _| l.projection_matrix[(0, 3)] = -1.0, "P[0][3] of the left camera is -1; it must be 0"),
        (|_, r| r.projection_matrix[(1, 3)] = 5.0, "P[1][3] of the right camera is 5; it must be 0"),
        (|_, r| r.projection_matrix[(0, 0)] = 0.0, "P[0][0] of the right camera is 0; it must be a focal length"),
        (
            |_, r| r.projection_matrix[(1, 1)] = 605.7,
            "P[1][1] of the right camera is 605.7; it must be 605.65, as of the left camera",
        ),
        (|_, r| r.projection_matrix[(1, 2)] += 1.0, "P[1][2] of the right camera is 241.98"),
        (
            |l, _| l.rectification_matrix *= 1.1,
            "R of the left camera is a matrix with determinant 1.3310, whose rows are ",
        ),
    ];
    for (change, expected) in changes {
        let [mut left, mut right] = OpenCvStereo::all().next().unwrap().infos();
        change(&mut left, &mut right);
        let error = StereoCameraCfg::from_camera_infos(&left, &right).unwrap_err();
        assert!(matches!(error, CameraError::NotAStereoPair { .. }), "{error}");
        let said = error.to_string();
        assert!(
            said.starts_with("the calibrations do not belong to a stereo camera: ") && said.contains(expected),
            "{said}"
        );
    }
    // Files with few digits are accepted: R becomes the nearest rotation.
    let [left, mut right] = OpenCvStereo::all().next().unwrap().infos();
    right.rectification_matrix.iter_mut().for_each(|x| *x = (*x * 1e4).round() / 1e4);
    let cfg = StereoCameraCfg::from_camera_infos(&left, &right).unwrap();
    let [moved, turned] = apart(&rig_of(&cfg), &OpenCvStereo::all().next().unwrap().left_from_right());
    assert!(moved < 1e-14 && turned > 1e-6 && turned < 1e-4, "{moved} {turned}");
}
