//! Pairs of eyes, held against cameras that stand alone and against the geometry of pairs.

use super::super::{
    Camera, CameraCfg, CameraConvention, CameraError, Channels, DepthMiss, Extrinsics, Imperfections, Intrinsics, Lens,
    Placement, Renderer, StereoCamera, StereoCameraCfg, StereoOrigin, look_at_pose,
};
use super::stage::{BALL, GROUND, LENS, RADIUS, SIZE, ball, bits, built, cfg, context, pose_of, state, tip};
use crate::camera::imperfection::{DepthNoise, Holes, ReadNoise};
use crate::camera::lens::OpenCvFisheye;
use crate::error::SensorError;
use crate::noise::NoiseCfg;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use ndarray::array;
use scene::Pose;
use scene::pose::{from_row, to_row};
use std::collections::BTreeMap;

const BASELINE: f64 = 0.2;

/// A pair of small cameras, 20 cm apart.
fn pair() -> StereoCameraCfg {
    StereoCameraCfg { camera: cfg(), left_to_right_pos: [BASELINE, 0.0, 0.0], ..StereoCameraCfg::default() }
}

fn of(cfg: &StereoCameraCfg, context: &SensorContext) -> StereoCamera {
    let mut stereo = cfg.build(context).unwrap();
    let envs: Vec<usize> = (0..context.num_envs).collect();
    stereo.reset(&envs, &state(&vec![0; context.num_envs])).unwrap();
    stereo
}

fn near(a: &Pose, b: &Pose) -> bool {
    (a.translation.vector - b.translation.vector).norm() < 1e-12 && a.rotation.angle_to(&b.rotation) < 1e-7
}

#[test]
fn eyes_are_cameras_that_stand_alone() {
    let context = context(2);
    let turned = UnitQuaternion::from_euler_angles(0.02, -0.1, 0.05);
    let there = look_at_pose([-1.6, 0.0, 0.9], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0]).unwrap();
    let offset = Pose::from_parts([0.2, 0.03, -0.04].into(), turned);
    let half = Pose::translation(-0.1, -0.015, 0.02);
    let right_lens = Intrinsics::Pixels { fx: 60.0, fy: 50.0, cx: 20.0, cy: 15.0 };
    for (origin, left) in [(StereoOrigin::Left, there), (StereoOrigin::Middle, there * half)] {
        let cfg = StereoCameraCfg {
            intrinsics_right: Some(right_lens),
            left_to_right_pos: [0.2, 0.03, -0.04],
            left_to_right_rot: turned,
            origin,
            ..pair()
        };
        let mut stereo = of(&cfg, &context);
        stereo.update(&state(&[3, 4])).unwrap();
        let right = left * offset;
        assert!(near(&pose_of(stereo.left(), 1), &left) && near(&pose_of(stereo.right(), 1), &right), "{origin:?}");
        let origins = stereo.pose_w(CameraConvention::Ros);
        assert!(near(&from_row(&std::array::from_fn(|k| origins[(1, k)])), &there));
        // Each eye is the camera that stands where it stands, in all channels, bit for bit.
        for (eye, pose, intrinsics) in [(stereo.left(), left, LENS), (stereo.right(), right, right_lens)] {
            let placement = Placement::Pose { pos: pose.translation.into(), rotation: pose.rotation };
            let extrinsics = Extrinsics { placement, ..Extrinsics::default() };
            let mut alone = built(&CameraCfg { extrinsics, intrinsics, ..super::stage::cfg() }, &context);
            alone.update(&state(&[3, 4])).unwrap();
            assert_eq!(bits(eye, 0..2), bits(&alone, 0..2), "{origin:?}");
            assert_eq!((eye.stamps(), eye.frame_counts()), (alone.stamps(), alone.frame_counts()));
            assert_eq!(eye.depth().unwrap().dim(), (2, SIZE[1], SIZE[0]));
        }
        // The control: the eyes do not see the same.
        assert_ne!(bits(stereo.left(), 0..2), bits(stereo.right(), 0..2));
    }
}

/// How many pixels of the left eye were judged, and how many of them the right eye does not see where they should be.
/// `scale` is what disparities are multiplied by: 1, or something else as a control.
///
/// A point P that the left eye sees is projected to the right eye. Rows of a rectified pair are the same, so that P falls
/// between two pixels of its row, which see Q and R. Both surfaces are convex (a plane, a ball), so that the right eye
/// sees P exactly where it is on the near side of its surface and both pixels see that surface. Then P, Q and R are on the
/// curve in which the epipolar plane cuts the surface: a line, or a circle of radius r <= R0. P is between Q and R in the
/// picture and so on the arc between them, whose distance from the chord L is at most r - sqrt(r² - L²/4) <= L²/(4 r).
/// Single precision adds some ulps of coordinates below 100 m, of which only those nearer than 10 m are judged: 1e-4.
fn reproject(stereo: &StereoCamera, steps: &[u64], scale: f64) -> (usize, usize) {
    let (left, right) = (stereo.left(), stereo.right());
    let disparity = stereo.disparity().unwrap();
    let (mut judged, mut wrong) = (0, 0);
    for row in 0..steps.len() {
        let at = |camera: &Camera, v: usize, u: usize| {
            let p = camera.position().unwrap();
            Vector3::from_fn(|k, _| f64::from(p[(row, v, u, k)]))
        };
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
            // Where the right eye should see it, by the disparity; the principal point may be elsewhere.
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
            // The projection itself.
            let local = eyes[1].inverse() * Point3::from(point);
            let projected = [
                matrices[(row, 0, 0)] * local.x / local.z + matrices[(row, 0, 2)],
                matrices[(row, 1, 1)] * local.y / local.z + matrices[(row, 1, 2)],
            ];
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
            // 1e-3 pixels: the disparity is some 10 pixels in single precision, the point some ulps of 10 m at 40 pixels.
            if missed > 1e-3 || off > sagitta + 1e-4 {
                wrong += 1;
            }
        }
    }
    (judged, wrong)
}

#[test]
fn disparity_leads_to_the_same_point_of_the_same_surface() {
    let context = context(2);
    let shifted = Intrinsics::Pixels { fx: 40.0, fy: 52.0, cx: 26.5, cy: 17.5 };
    for (renderer, intrinsics_right) in [
        (Renderer::Raster, None),
        (Renderer::Raster, Some(shifted)),
        (Renderer::FastRayTraced, None),
        (Renderer::FastRayTraced, Some(shifted)),
    ] {
        let camera = CameraCfg { renderer, ..cfg() };
        let mut stereo = of(&StereoCameraCfg { camera, intrinsics_right, ..pair() }, &context);
        for steps in [[0, 0], [3, 4]] {
            stereo.refresh(&[0, 1], &state(&steps)).unwrap();
            let (judged, wrong) = reproject(&stereo, &steps, 1.0);
            assert!(judged > 1000 && wrong == 0, "{wrong} of {judged} pixels");
            let seen = stereo.left().mask().unwrap().iter().filter(|&&id| id == BALL).count();
            assert!(seen > 100, "{seen} pixels of the ball");
            // Controls: one percent more is seen to be wrong at nearly every pixel.
            let (judged, wrong) = reproject(&stereo, &steps, 1.01);
            assert!(10 * wrong > 9 * judged, "{wrong} of {judged} pixels");
        }
    }
}

/// Of what the left eye measures, noise included, which ends at the far plane: hits have one there too.
#[test]
fn disparity_is_the_closed_form_and_zero_on_a_miss() {
    let context = context(2);
    let misses = [DepthMiss::Inf, DepthMiss::Far, DepthMiss::Zero];
    for (depth_miss, std) in misses.into_iter().flat_map(|miss| [(miss, 0.0), (miss, 0.5)]) {
        let noise = [("depth".to_string(), NoiseCfg::white(std))].into();
        let camera = CameraCfg { depth_miss, noise, far: 4.0, ..cfg() };
        let stereo = of(&StereoCameraCfg { camera, ..pair() }, &context);
        let (disparity, depth) = (stereo.disparity().unwrap(), stereo.left().depth().unwrap());
        let (mut misses, mut last) = (0, 0);
        for ((d, z), id) in disparity.iter().zip(depth).zip(stereo.left().mask().unwrap()) {
            let expected = if *id == 0 { 0.0 } else { (40.0 * BASELINE / f64::from(*z)) as f32 };
            misses += usize::from(*id == 0);
            last += usize::from(*id != 0 && *z >= 4f32.next_down());
            assert_eq!(*d, expected);
            assert!(*id == 0 || *d > 0.0);
        }
        assert!(misses > 100, "{misses}");
        assert!(std == 0.0 || last > 20, "the control: noise reaches the far plane, {last}");
    }
}

#[test]
fn it_is_lazy_as_a_camera_and_computes_only_what_is_new() {
    let context = context(2);
    let camera = CameraCfg { update_period: 0.02, ..cfg() };
    let mut stereo = of(&StereoCameraCfg { camera, ..pair() }, &context);
    assert_eq!(stereo.left().draws() + stereo.right().draws(), 0, "nobody looked");
    let place = stereo.disparity().unwrap().as_ptr();
    assert_eq!((stereo.left().draws(), stereo.right().draws()), (2, 0), "disparity is of the left eye");
    let before = stereo.disparity().unwrap().to_owned();
    let mut due = Vec::new();
    for step in 1..=4 {
        due.push(stereo.due_in(&[step - 1; 2]));
        stereo.update(&state(&[step; 2])).unwrap();
        if step < 4 {
            assert_eq!(stereo.disparity().unwrap(), before, "not due yet");
        }
    }
    assert_eq!((due, stereo.left().draws()), (vec![4, 3, 2, 1], 2));
    assert_ne!(stereo.disparity().unwrap(), before);
    assert_eq!(stereo.disparity().unwrap().as_ptr(), place, "memory stays where it is");
    assert_eq!((stereo.left().draws(), stereo.left().frame_counts()), (4, array![1, 1].view()));
    // A lens that changes changes it, of the same instant.
    let wide = [Intrinsics::Pixels { fx: 20.0, fy: 26.0, cx: 22.25, cy: 17.5 }];
    let before = stereo.disparity().unwrap().to_owned();
    stereo.set_intrinsics(&wide, None, Some(&[1])).unwrap();
    let after = stereo.disparity().unwrap();
    let env = |map: &ndarray::ArrayView3<'_, f32>, k| map.index_axis(ndarray::Axis(0), k).to_owned();
    assert_eq!(env(&after, 0), env(&before.view(), 0));
    assert_ne!(env(&after, 1), env(&before.view(), 1));
}

/// Both eyes at one place see the same, bit for bit; what is random is not the same in both.
#[test]
fn noise_is_not_the_same_in_both_eyes() {
    let one_place = |camera: CameraCfg| {
        let stereo = of(&StereoCameraCfg { camera, left_to_right_pos: [0.0; 3], ..pair() }, &context(1));
        let all = |eye: &Camera| -> (Vec<f32>, Vec<u8>) {
            (eye.depth().unwrap().iter().copied().collect(), eye.color().unwrap().iter().copied().collect())
        };
        [all(stereo.left()), all(stereo.right())]
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
    assert_eq!(left.0, right.0, "depth has no noise of paths");
    assert_ne!(left.1, right.1);
}

/// Root cause: the right eye took over the left one's noise and imperfections whatever it measures, so that no pair could be built
/// whose right eye measures less.
#[test]
fn an_eye_has_the_faults_of_what_it_measures() {
    let context = context(1);
    let [colors, both] = [false, true].map(|depth| Channels { color: true, depth, ..Channels::default() });
    let of_light = Imperfections { read_noise: Some(ReadNoise { std: 0.05 }), ..Imperfections::default() };
    let imperfections = Imperfections { depth_noise: Some(DepthNoise::NGUYEN), ..of_light.clone() };
    let noise = |names: &[&str]| names.iter().map(|name| (name.to_string(), NoiseCfg::white(0.5))).collect();
    let all_noise = noise(&["distance_to_image_plane", "rgb"]);
    let camera = CameraCfg { channels: both, imperfections, noise: all_noise, ..cfg() };
    let cfg = StereoCameraCfg { camera: camera.clone(), channels_right: Some(colors), ..pair() };
    let stereo = of(&cfg, &context);
    // The judge is a camera that stands alone where the right eye is, under its name, and has what faults of colours there are.
    let extrinsics = cfg.eyes().unwrap()[1].extrinsics.clone();
    let alone = CameraCfg { channels: colors, imperfections: of_light, noise: noise(&["color"]), extrinsics, ..camera };
    let named = SensorContext { name: "/right".into(), ..context.clone() };
    let color = |cfg: &CameraCfg| built(cfg, &named).color().unwrap().to_owned();
    assert_eq!(stereo.right().color().unwrap(), color(&alone));
    assert!(stereo.left().depth().is_ok() && stereo.right().depth().is_err());
    // The controls: either fault is seen.
    let quiet = CameraCfg { noise: BTreeMap::new(), ..alone.clone() };
    let clean = CameraCfg { imperfections: Imperfections::default(), ..alone };
    assert!(stereo.right().color().unwrap() != color(&quiet) && stereo.right().color().unwrap() != color(&clean));
    // Faults of its own.
    let (noise_right, imperfections_right) = (Some(BTreeMap::new()), Some(clean.imperfections.clone()));
    let stereo = of(&StereoCameraCfg { noise_right, imperfections_right, ..cfg }, &context);
    assert_eq!(stereo.right().color().unwrap(), color(&CameraCfg { noise: BTreeMap::new(), ..clean }));
}

/// Root cause: what was wrong with an eye was said of a camera, whichever of the two it was.
#[test]
fn what_is_wrong_with_an_eye_says_which() {
    let context = context(1);
    let [colors, depths] = [true, false].map(|color| Channels { color, depth: !color, ..Channels::default() });
    let of_depth = Imperfections { depth_noise: Some(DepthNoise::NGUYEN), ..Imperfections::default() };
    let shadows = Imperfections { holes: Some(Holes::default()), ..Imperfections::default() };
    let camera = CameraCfg { channels: colors, renderer: Renderer::FastRayTraced, ..cfg() };
    let off = "the camera does not measure depth; it measures color";
    let bent = "shadows of a projector (holes with a baseline other than 0): only of a pinhole camera, and this one has the lens";
    let with_shadows = CameraCfg { channels: depths, imperfections: shadows.clone(), ..camera.clone() };
    let lens_right = Some(fisheye());
    for (cfg, expected) in [
        // The left eye has its own faults only, whatever the right one measures.
        (
            StereoCameraCfg {
                camera: CameraCfg { imperfections: of_depth.clone(), ..camera.clone() },
                channels_right: Some(depths),
                ..pair()
            },
            format!("the left eye: {off}"),
        ),
        // What is asked for is not left out.
        (
            StereoCameraCfg { camera: camera.clone(), imperfections_right: Some(of_depth.clone()), ..pair() },
            format!("the right eye: {off}"),
        ),
        (
            StereoCameraCfg { camera: with_shadows.clone(), lens_right, ..pair() },
            format!("the right eye: {bent} opencv_fisheye"),
        ),
    ] {
        let error = cfg.build(&context).unwrap_err().to_string();
        assert!(error.starts_with(&expected), "{error}");
    }
    // All of them can be had by what is of the right eye.
    let (channels_right, imperfections_right) = (Some(depths), Some(of_depth));
    let cfg = StereoCameraCfg { camera, channels_right, imperfections_right, ..pair() };
    assert!(of(&cfg, &context).right().depth().is_ok());
    let imperfections_right =
        Some(Imperfections { holes: Some(Holes { baseline: 0.0, ..Holes::default() }), ..shadows });
    let cfg = StereoCameraCfg { camera: with_shadows, lens_right, imperfections_right, ..pair() };
    assert!(of(&cfg, &context).right().depth().is_ok());
    // As scene files have them.
    let text = "imperfections_right.holes.baseline = 0.0\nnoise_right.depth.std = 0.01\n[camera]\nchannels = ['depth']";
    let read: StereoCameraCfg = toml::from_str(text).unwrap();
    assert_eq!(read.imperfections_right, cfg.imperfections_right);
    assert_eq!(read.noise_right, Some([("depth".to_string(), NoiseCfg::white(0.01))].into()));
    assert_eq!(toml::from_str::<StereoCameraCfg>(&toml::to_string(&read).unwrap()).unwrap(), read);
    assert_eq!(toml::from_str::<StereoCameraCfg>("").unwrap(), StereoCameraCfg::default());
}

#[test]
fn rigs_are_placed_as_a_whole_or_not_at_all() {
    let context = context(2);
    let parent = Extrinsics { parent: Some("tip".into()), ..Extrinsics::default() };
    let camera = CameraCfg { extrinsics: parent, ..cfg() };
    let mut attached = of(&StereoCameraCfg { camera, ..pair() }, &context);
    attached.refresh(&[0, 1], &state(&[3, 2])).unwrap();
    let half = Pose::translation(-0.5 * BASELINE, 0.0, 0.0);
    let link = from_row(&to_row(&tip(1, 2)));
    assert!(near(&pose_of(attached.left(), 1), &(link * half)));
    assert!(near(&pose_of(attached.right(), 1), &(link * half.inverse())));
    let there = look_at_pose([-1.2, 0.4, 0.9], [0.1, 0.0, 0.5], [0.0, 0.0, 1.0]).unwrap();
    for convention in [CameraConvention::Ros, CameraConvention::OpenGl, CameraConvention::World] {
        attached.set_world_poses(&convention.of_optical(&there), Some(&[1]), convention).unwrap();
        let eyes = [pose_of(attached.left(), 1), pose_of(attached.right(), 1)];
        assert!(near(&eyes[0], &(there * half)) && near(&eyes[1], &(there * half.inverse())), "{convention:?}");
        let now = attached.pose_w(convention);
        let expected = to_row(&convention.of_optical(&there));
        assert!(now.row(1).iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{now}");
    }
    // They move with the link.
    attached.refresh(&[1], &state(&[3, 9])).unwrap();
    let moved = tip(1, 9) * tip(1, 2).inverse() * there;
    assert!(near(&pose_of(attached.right(), 1), &(moved * half.inverse())));

    let mut free = of(&pair(), &context);
    free.look_at(&[[-1.2, 0.4, 0.9]], &[[0.1, 0.0, 0.5]], &[[0.0, 0.0, 1.0]], Some(&[0])).unwrap();
    assert!(
        near(&pose_of(free.left(), 0), &(there * half)) && near(&pose_of(free.right(), 0), &(there * half.inverse()))
    );
    let untouched = free.left().local_pose(CameraConvention::Ros);
    let lens = Intrinsics::Pixels { fx: 44.0, fy: 44.0, cx: 20.0, cy: 16.0 };
    let bad = Intrinsics::Pixels { fx: -1.0, fy: 44.0, cx: 20.0, cy: 16.0 };
    assert!(free.set_intrinsics(&[lens], Some(&[bad]), None).is_err());
    assert!(free.set_intrinsics(&[lens], Some(&[lens; 3]), None).is_err());
    assert_eq!(free.left().intrinsic_matrices()[(0, 0, 0)], 40.0, "the left eye was not changed either");
    assert!(free.set_local_pose(&there, Some(&[2]), CameraConvention::Ros).is_err());
    assert!(free.look_at(&[[0.0; 3]], &[[0.0; 3]], &[[0.0; 3]], None).is_err());
    assert_eq!(free.left().local_pose(CameraConvention::Ros), untouched);
    free.restore(None).unwrap();
    assert_eq!(bits(free.right(), 0..2), bits(of(&pair(), &context).right(), 0..2));
}

#[test]
fn what_has_no_disparity_is_said() {
    let context = context(1);
    let error = |cfg: &StereoCameraCfg| of(cfg, &context).disparity().unwrap_err().to_string();
    let lens = |fx, fy, cy| Some(Intrinsics::Pixels { fx, fy, cx: 22.25, cy });
    for (cfg, expected) in [
        (
            StereoCameraCfg { intrinsics_right: lens(41.0, 52.0, 17.5), ..pair() },
            "fx of the right eye is 41, it must be the left eye's, 40",
        ),
        (StereoCameraCfg { intrinsics_right: lens(40.0, 51.0, 17.5), ..pair() }, "fy of the right eye is 51"),
        (StereoCameraCfg { intrinsics_right: lens(40.0, 52.0, 17.0), ..pair() }, "cy of the right eye is 17"),
        (
            StereoCameraCfg { left_to_right_rot: UnitQuaternion::from_euler_angles(0.0, 0.25, 0.0), ..pair() },
            "the angle between the eyes [rad] is 0.25, it must be 0",
        ),
        (StereoCameraCfg { left_to_right_pos: [0.1, 0.01, 0.0], ..pair() }, "left_to_right_pos.y [m] is 0.01"),
        (StereoCameraCfg { left_to_right_pos: [0.1, 0.0, -0.01], ..pair() }, "left_to_right_pos.z [m] is -0.01"),
        (StereoCameraCfg { left_to_right_pos: [-0.1, 0.0, 0.0], ..pair() }, "left_to_right_pos.x [m] is -0.1"),
        (
            StereoCameraCfg { left_to_right_pos: [0.0; 3], ..pair() },
            "left_to_right_pos.x [m] is 0, it must be positive",
        ),
    ] {
        let said = error(&cfg);
        assert!(said.contains(expected), "{said}");
        // Everything else can be read.
        assert!(of(&cfg, &context).right().depth().is_ok());
    }
    let camera = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..cfg() };
    let blind = of(&StereoCameraCfg { camera, channels_right: Some(Channels::ALL), ..pair() }, &context);
    let off = blind.disparity().unwrap_err();
    assert!(matches!(off, SensorError::Camera(CameraError::ChannelOff { channel: "depth", .. })), "{off}");
    assert!(blind.right().depth().is_ok(), "channels are of each eye");
    let bad = StereoCameraCfg { left_to_right_pos: [f64::NAN, 0.0, 0.0], ..pair() };
    assert!(matches!(bad.build(&context), Err(SensorError::Camera(CameraError::Pose { .. }))));
    let bad = StereoCameraCfg { intrinsics_right: lens(0.0, 1.0, 1.0), ..pair() };
    let error = bad.build(&context).unwrap_err();
    assert_eq!(error.to_string(), "the right eye: fx of the lens is 0; it must be positive and finite");
    let SensorError::Eye { eye: "right", error } = error else { panic!("{error}") };
    assert!(matches!(*error, SensorError::Camera(CameraError::Lens { .. })), "{error}");
}

/// A fisheye lens, which needs rays.
fn fisheye() -> Lens {
    OpenCvFisheye { k1: 0.05, ..OpenCvFisheye::default() }.into()
}

#[test]
fn eyes_have_lenses_of_their_own() {
    let context = context(1);
    let camera = CameraCfg { renderer: Renderer::FastRayTraced, ..cfg() };
    let plain = StereoCameraCfg { camera: camera.clone(), ..pair() };
    let cfg = StereoCameraCfg { lens_right: Some(fisheye()), ..plain.clone() };
    let stereo = of(&cfg, &context);
    assert_eq!((stereo.left().lens(), stereo.right().lens()), (Lens::default(), fisheye()));
    let alone = built(&CameraCfg { lens: fisheye(), ..cfg.eyes().unwrap()[1].clone() }, &context);
    assert_eq!(bits(stereo.right(), 0..1), bits(&alone, 0..1));
    // The control: another picture than without it; the left eye's is the same.
    let without = of(&plain, &context);
    assert_ne!(bits(stereo.right(), 0..1), bits(without.right(), 0..1));
    assert_eq!(bits(stereo.left(), 0..1), bits(without.left(), 0..1));
    // Disparity is of two pinholes, whichever eye is none.
    assert!(without.has_disparity() && !stereo.has_disparity());
    let swapped = CameraCfg { lens: fisheye(), ..camera };
    let swapped = StereoCameraCfg { camera: swapped, lens_right: Some(Lens::default()), ..pair() };
    for stereo in [stereo, of(&swapped, &context)] {
        let error = stereo.disparity().unwrap_err();
        assert!(matches!(error, SensorError::Camera(CameraError::PinholeOnly { what: "disparity", .. })), "{error}");
    }
}

/// Pictures through lenses are of tables of rays: a change that fails leaves those too.
#[test]
fn changes_that_fail_leave_the_rays_of_lenses() {
    let context = context(2);
    let camera = CameraCfg { renderer: Renderer::FastRayTraced, lens: fisheye(), ..cfg() };
    let mut stereo = of(&StereoCameraCfg { camera, ..pair() }, &context);
    let lens = |fx| Intrinsics::Pixels { fx, fy: 44.0, cx: 20.0, cy: 16.0 };
    // What was set before is what stays, not what was configured.
    stereo.set_intrinsics(&[lens(44.0)], None, Some(&[1])).unwrap();
    let before = [bits(stereo.left(), 0..2), bits(stereo.right(), 0..2)];
    let bytes = stereo.left().lens_bytes();
    assert!(stereo.set_intrinsics(&[lens(30.0)], Some(&[lens(-1.0)]), None).is_err());
    stereo.set_local_pose(&stereo.local_pose(CameraConvention::Ros), None, CameraConvention::Ros).unwrap();
    // Not assert_eq: pictures are long.
    assert!(
        [bits(stereo.left(), 0..2), bits(stereo.right(), 0..2)] == before,
        "another picture after a change that failed"
    );
    assert_eq!(stereo.left().lens_bytes(), bytes);
    // The control: one that does not fail is seen, and tables that nobody needs are freed.
    stereo.set_intrinsics(&[lens(30.0)], None, Some(&[1])).unwrap();
    assert_ne!(bits(stereo.left(), 0..2), before[0]);
    assert_eq!(stereo.left().lens_bytes(), bytes);
}

/// By the definition of P in ROS's `sensor_msgs/CameraInfo`: (u, v, w) = P (X, Y, Z, 1) of a point in the frame of the left eye,
/// against where the right eye sees it from where it stands.
#[test]
fn calibrations_of_a_pair_project_points_of_the_left_eye() {
    let context = context(2);
    let shifted = Intrinsics::Pixels { fx: 40.0, fy: 52.0, cx: 26.5, cy: 17.5 };
    let stereo = of(&StereoCameraCfg { intrinsics_right: Some(shifted), ..pair() }, &context);
    let [left, right] = stereo.camera_info("head", 1).unwrap();
    assert_eq!((left.name.as_str(), right.name.as_str()), ("head/left", "head/right"));
    assert_eq!(left.projection_matrix.column(3).amax(), 0.0);
    assert_eq!(right.projection_matrix[(0, 3)], -40.0 * BASELINE);
    let eyes = [pose_of(stereo.left(), 1), pose_of(stereo.right(), 1)];
    let (lefts, rights) = (stereo.left().intrinsic_matrices(), stereo.right().intrinsic_matrices());
    for point in [Point3::new(0.3, -0.2, 1.5), Point3::new(-0.7, 0.4, 4.0), Point3::new(0.0, 0.0, 0.5)] {
        for (info, pose, k) in [(&left, eyes[0], &lefts), (&right, eyes[1], &rights)] {
            let local = pose.inverse() * (eyes[0] * point);
            let seen = [0, 1].map(|i| k[(1, i, i)] * local[i] / local.z + k[(1, i, 2)]);
            let p = info.projection_matrix * point.to_homogeneous();
            // ROS counts from the centre of the first pixel.
            let p = [p.x / p.z + 0.5, p.y / p.z + 0.5];
            // Some ulps of 100 pixels, and of poses.
            assert!((p[0] - seen[0]).abs() < 1e-10 && (p[1] - seen[1]).abs() < 1e-10, "{p:?} {seen:?}");
        }
        // The control: without the fourth column it is 40 * 0.2 / z pixels off, at least 2.
        let alone = stereo.right().camera_info("head", 1).unwrap();
        let apart = (alone.projection_matrix - right.projection_matrix) * point.to_homogeneous() / point.z;
        assert!(apart.x >= 1.999);
    }
    let again = crate::camera::CameraInfo::parse(&right.to_yaml(), "right.yaml").unwrap();
    assert_eq!(again, right);
    assert!(stereo.camera_info("head", 2).is_err());
}
