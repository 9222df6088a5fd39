//! Depth of field compared with the thin lens equation.

use super::super::camera_rays::ThinLens;
use super::*;
use crate::aperture::Aperture;
use crate::intrinsics::Intrinsics;
use crate::lens::Lens;
use crate::lens::optics::Optics;
use crate::lens::rays::LensRays;

const SIZE: usize = 28;
/// Focal length \[pixels\].
const F: f32 = 400.0;

/// A view along x from the origin.
fn ahead() -> View {
    let view = View::look_at([SIZE; 2], 0.5, [0.; 3], [1., 0., 0.], [0., 0., 1.]).unwrap();
    View { fx: F, fy: F, ..view }
}

/// A glowing square of half side `half` at a depth, facing the camera.
fn emitter_at(depth: f32, half: f32) -> (RenderScene, [PoseF32; 1]) {
    let glow = Material { emission: 2.0, ..matt(0.5) };
    let scene = dark(vec![Instance::new(Plane { half: [half; 2] }, glow, 1)]);
    // The columns are its axes: its normal is -x.
    let rotation = [[0., 0., -1.], [1., 0., 0.], [0., -1., 0.]];
    (scene, [PoseF32 { rotation, translation: [depth, 0., 0.] }])
}

/// The light of all pixels.
fn image(scene: &RenderScene, poses: &[PoseF32], aperture: Option<&Aperture>, samples: u32) -> Vec<f64> {
    let studio = TestScene::new(scene, poses, &ahead());
    let mut paths = studio.paths(samples, 0, 1);
    paths.camera_rays.thin_lens = aperture.and_then(ThinLens::from_aperture);
    let mut stack = TraversalStack::default();
    (0..SIZE * SIZE).map(|k| pixel(&paths, [k % SIZE, k / SIZE], &mut stack)).collect()
}

/// Sum, means and variances along both axes.
fn moments(image: &[f64]) -> (f64, [f64; 2], [f64; 2]) {
    let place = |k: usize| [(k % SIZE) as f64 + 0.5, (k / SIZE) as f64 + 0.5];
    let sum: f64 = image.iter().sum();
    let mean = [0, 1].map(|a| image.iter().enumerate().map(|(k, x)| x * place(k)[a]).sum::<f64>() / sum);
    let square = |a: usize| image.iter().enumerate().map(|(k, x)| x * (place(k)[a] - mean[a]).powi(2)).sum::<f64>();
    (sum, mean, [0, 1].map(|a| square(a) / sum))
}

/// Out of focus, a point becomes a disc of diameter c = f A |1 / S1 - 1 / S2|, and a square the sum of such discs. Its
/// variance along an axis is c² / 16 more than its own, side² / 12, and that of a pixel, 1 / 12.
#[test]
fn circle_of_confusion() {
    let half = 0.01f32;
    for (focus, depth, f_number) in
        [(1.5f32, 3.0f32, 0.5), (3.0, 1.5, 0.5), (2.0, 1.6, 0.25), (f32::INFINITY, 2.0, 1.0)]
    {
        let aperture = Aperture { focal_length: 0.05, f_number, focus_distance: focus.into() };
        let c = f64::from(F) * (0.05 / f_number) * (1.0 / f64::from(focus) - 1.0 / f64::from(depth)).abs();
        assert!((aperture.circle_of_confusion(depth.into(), F.into()) - c).abs() < 1e-9 && (8.0..20.0).contains(&c));
        let (scene, poses) = emitter_at(depth, half);
        let blurred = image(&scene, &poses, Some(&aperture), 2048);
        let (sum, mean, var) = moments(&blurred);
        let side = 2.0 * f64::from(half) * f64::from(F) / f64::from(depth);
        let light = 2.0 * albedo(0.5);
        // Number of paths that hit the square; of a disc's points, x² has a standard deviation as large as its mean.
        let paths = 2048.0 * side * side;
        let off = 5.0 / f64::sqrt(paths);
        assert!((sum - light * side * side).abs() < off * sum, "{sum}, not {}", light * side * side);
        for axis in 0..2 {
            assert!((mean[axis] - 0.5 * SIZE as f64).abs() < 0.5 * c * off, "{mean:?}");
            let expected = c * c / 16.0 + side * side / 12.0 + 1.0 / 12.0;
            assert!((var[axis] - expected).abs() < off * expected, "{var:?}, not {expected}");
            // A control: a tenth more aperture is detected.
            assert!((var[axis] - expected - 0.21 * c * c / 16.0).abs() > off * expected);
        }
        // No light falls beyond the disc, and some just inside of it.
        let far = |k: usize| {
            let [x, y] = [k % SIZE, k / SIZE].map(|p| ((p as f64 + 0.5 - 0.5 * SIZE as f64).abs() - 0.5).max(0.0));
            x.hypot(y)
        };
        let edge = 0.5 * c + side / 2.0f64.sqrt();
        assert!(blurred.iter().enumerate().all(|(k, x)| far(k) < edge + 1e-3 || *x == 0.0));
        assert!(blurred.iter().enumerate().any(|(k, x)| far(k) > 0.5 * c - 1.5 && *x > 0.0));
    }
}

#[test]
fn in_focus() {
    let (scene, poses) = emitter_at(2.0, 0.0333);
    let sharp = image(&scene, &poses, None, 64);
    let aperture = |f_number| Aperture { focal_length: 0.05, f_number, focus_distance: 2.0 };
    let wide = image(&scene, &poses, Some(&aperture(0.25)), 64);
    // The same samples hit the square, except for rounding at its edges.
    let different = sharp.iter().zip(&wide).filter(|(a, b)| (*a - *b).abs() > 1e-9).count();
    assert!(different <= 2, "{different} pixels");
    assert!(sharp.iter().sum::<f64>() > 10.0);
    // An aperture without a size equals a pinhole, to the bit.
    assert_eq!(image(&scene, &poses, Some(&aperture(f64::INFINITY)), 64), sharp);
    // A control: at another distance it is blurred.
    let (scene, poses) = emitter_at(1.8, 0.03);
    assert_ne!(image(&scene, &poses, Some(&aperture(0.25)), 64), image(&scene, &poses, None, 64));
}

/// The aperture of a fisheye faces each ray: a ball is in focus, at the center and far off the axis.
#[test]
fn fisheye() {
    let pixels = Intrinsics::Pixels { fx: 10.0, fy: 10.0, cx: 14.0, cy: 14.0 }.to_pixels(SIZE, SIZE).unwrap();
    let optics = Optics::new(Lens::from_name("equidistant").unwrap(), pixels).unwrap();
    let rays = LensRays::new(&optics, [SIZE; 2], 1).unwrap();
    let (scene, poses) = emitter_at(1.0, 0.1);
    let studio = TestScene::new(&scene, &poses, &ahead());
    let thin_lens = ThinLens::from_aperture(&Aperture { focal_length: 0.1, f_number: 1.0, focus_distance: 2.0 });
    let pose = pose_to_f64(&PoseF32::IDENTITY);
    for at in [[14.3, 13.8], [26.0, 14.0], [5.0, 22.5]] {
        let eye = CameraRayGenerator { lens: Some(&rays), thin_lens, ..studio.paths(1, 0, 0).camera_rays };
        let to = scale(optics.unproject(at).unwrap(), 2.0);
        for choice in [[0.0, 0.0], [0.9, 0.2], [1.0, 0.7]] {
            let ray = eye.camera_ray(at, &pose, || choice).unwrap().ray;
            let along_ray = dot(sub(to, ray.origin), ray.direction);
            let off = sub(ray.at(along_ray), to);
            assert!(dot(off, off).sqrt() < 1e-9, "{at:?} {choice:?}");
            // From the aperture, which is perpendicular to the ray through its center.
            let start =
                add_scaled(ray.origin, -eye.camera_ray(at, &pose, || choice).unwrap().near_distance, ray.direction);
            assert!((dot(start, start).sqrt() - 0.05 * choice[0].sqrt()).abs() < 1e-9);
            assert!(dot(start, to).abs() < 1e-9);
        }
    }
}
