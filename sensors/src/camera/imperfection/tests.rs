//! Tests of every imperfection against its closed form.

use super::*;
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_render::RngKey;
use kinetoscope_render::View;
use kinetoscope_render::frame::Frame;
use kinetoscope_render::lens::LensRays;
use kinetoscope_render::lens::{Equidistant, FTheta, OpenCv};
use kinetoscope_render::lens::{Lens, Optics};
use kinetoscope_scene::PoseF32;
use std::f64::consts::FRAC_PI_2;

const SIDE: usize = 200;

fn view(size: [usize; 2], f: f32) -> View {
    let [cx, cy] = size.map(|side| 0.5 * side as f32);
    let world_from_camera = PoseF32::IDENTITY;
    View {
        parallel: false,
        width: size[0],
        height: size[1],
        fx: f,
        fy: f,
        cx,
        cy,
        near: 0.01,
        far: 100.0,
        world_from_camera,
    }
}

fn pinhole<'a>(view: &'a View, rng_key: &'a RngKey) -> ImageContext<'a> {
    ImageContext { view, rays: None, rng_key }
}

fn tone() -> &'static ToneLut {
    ToneLut::for_curve(ToneCurve::Soft)
}

/// Random key of frame `number`.
fn rng_key(number: u64) -> RngKey {
    let mut key = RngKey::new(11, 3, "eye");
    (0..number).for_each(|_| key.advance_scheduled());
    key
}

/// Imperfections with only the fields that `set` changes.
fn only(set: impl FnOnce(&mut Imperfections)) -> Imperfections {
    let mut imperfections = Imperfections::default();
    set(&mut imperfections);
    imperfections
}

/// A gray image with imperfections.
fn with_effects(imperfections: &Imperfections, byte: u8, image: u64) -> Vec<[u8; 4]> {
    let mut frame = Frame::new(SIDE, SIDE, Channels { color: true, ..Channels::default() });
    frame.color = Some([byte, byte, byte, 255].repeat(SIDE * SIDE));
    imperfections.apply(&mut frame.as_mut(), ToneCurve::Soft, pinhole(&view([SIDE; 2], 150.0), &rng_key(image)));
    frame.color.unwrap().as_chunks().0.to_vec()
}

/// Radiance of all pixels and colors of a gray image with imperfections.
fn radiances(imperfections: &Imperfections, byte: u8, image: u64) -> Vec<f64> {
    with_effects(imperfections, byte, image).iter().flat_map(|p| [p[0], p[1], p[2]]).map(|b| tone().decode(b)).collect()
}

/// Mean and variance.
fn moments(numbers: &[f64]) -> [f64; 2] {
    let n = numbers.len() as f64;
    let mean = numbers.iter().sum::<f64>() / n;
    [mean, numbers.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n]
}

/// Mean, variance and count of the radiance of all pixels and colors. The quantization of the bytes adds a twelfth of
/// the squared step to the variance (Sheppard's correction); this is subtracted.
fn photon_transfer(imperfections: &Imperfections, byte: u8) -> [f64; 3] {
    let lights = radiances(imperfections, byte, u64::from(byte));
    let [mean, variance] = moments(&lights);
    let step = 0.5 * (tone().decode(byte + 1) - tone().decode(byte - 1));
    [mean, variance - step * step / 12.0, lights.len() as f64]
}

/// Weighted least-squares line through points (mean, variance): intercept and slope, and their standard deviations.
///
/// The standard deviation of the variance of n numbers is sqrt((2 + 1/N) / n) of the variance. N is the number of
/// electrons, at least a hundred here, which make the distribution less normal. Least squares with these weights give
/// the standard deviations of the line.
fn line(points: &[[f64; 3]]) -> ([f64; 2], [f64; 2]) {
    let mut s = [0.0; 5];
    for [x, y, n] in points {
        let weight = n / (2.01 * y * y);
        [1.0, *x, x * x, *y, x * y].iter().zip(&mut s).for_each(|(term, sum)| *sum += weight * term);
    }
    let [w, x, xx, y, xy] = s;
    let d = w * xx - x * x;
    ([(xx * y - x * xy) / d, (w * xy - x * y) / d], [(xx / d).sqrt(), (w / d).sqrt()])
}

/// Shot noise grows with the signal; read noise does not.
#[test]
fn photon_transfer_curve() {
    let (electrons, std) = (1000.0, 0.01);
    let (shot, read) = (Some(ShotNoise { electrons }), Some(ReadNoise { std }));
    // Far enough from black that nothing is cut off: at byte 100, a radiance of 0.127 is more than eight deviations.
    let levels = [100, 130, 160, 190];
    for (shot_noise, read_noise, slope, intercept) in
        [(shot, read, 1.0 / electrons, std * std), (shot, None, 1.0 / electrons, 0.0), (None, read, 0.0, std * std)]
    {
        let imperfections = Imperfections { shot_noise, read_noise, ..Imperfections::default() };
        let points = levels.map(|byte| photon_transfer(&imperfections, byte));
        for (byte, [mean, variance, n]) in levels.into_iter().zip(points) {
            let (light, bound) = (tone().decode(byte), 6.0 * (variance / n).sqrt());
            // The middle of a byte and the mean of its radiance differ by an eighth of the change of the step: below
            // 1e-5 here.
            assert!((mean - light).abs() < bound + 1e-5, "{byte}: {mean} is not {light}");
        }
        let (found, scatter) = line(&points);
        for (k, expected) in [intercept, slope].into_iter().enumerate() {
            assert!((found[k] - expected).abs() < 6.0 * scatter[k], "{found:?}, not {expected} ± {scatter:?}");
        }
        // Control: a missing shot or read noise would be detected.
        assert!(6.0 * scatter[1] < 0.2 / electrons && 6.0 * scatter[0] < 0.5 * std * std);
    }
}

/// Noise is independent between frames and between colors.
#[test]
fn correlations() {
    let shot = only(|all| all.shot_noise = Some(ShotNoise { electrons: 200.0 }));
    let read = only(|all| all.read_noise = Some(ReadNoise { std: 0.02 }));
    for imperfections in [shot, read] {
        let errors = |image| {
            let lights = radiances(&imperfections, 150, image);
            lights.into_iter().map(|light| light - tone().decode(150)).collect::<Vec<f64>>()
        };
        let (a, b) = (errors(1), errors(2));
        assert_eq!(a, errors(1), "the same frame");
        let correlation = |a: &[f64], b: &[f64]| {
            let sum = |x: &[f64], y: &[f64]| x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>();
            sum(a, b) / (sum(a, a) * sum(b, b)).sqrt()
        };
        let bound = 6.0 / (a.len() as f64).sqrt();
        assert!(correlation(&a, &b).abs() < bound, "frames");
        assert!(correlation(&a[1..], &a[..a.len() - 1]).abs() < bound, "red, green and blue");
        assert!(correlation(&a, &a) > 0.99, "the control");
    }
}

/// Every quantile of the Poisson distribution: mean and variance are equal.
#[test]
fn few_electrons() {
    for electrons in [0.5, 3.0, 20.0] {
        let light = tone().decode(128);
        let shot = ShotNoise { electrons: electrons / light };
        let (view, key) = (view([SIDE; 2], 150.0), rng_key(1));
        let mut counts = Vec::new();
        for pixel in 0..40_000 {
            let mut light = [light; 3];
            shot.apply(&mut light, &PixelContext { image: pinhole(&view, &key), pixel });
            counts.extend(light.map(|light| light * shot.electrons));
        }
        assert!(counts.iter().all(|count| (count - count.round()).abs() < 1e-9), "whole electrons");
        let (n, [mean, variance]) = (counts.len() as f64, moments(&counts));
        // Standard deviation of means: sqrt(N / n); of variances: sqrt((2 + 1 / N) / n) of the variance.
        assert!((mean - electrons).abs() < 6.0 * (electrons / n).sqrt(), "{mean}");
        assert!((variance / electrons - 1.0).abs() < 6.0 * ((2.0 + 1.0 / electrons) / n).sqrt(), "{variance}");
    }
}

/// Radiance falls with the fourth power of the cosine.
#[test]
fn vignetting() {
    let of = |strength| with_effects(&only(|all| all.vignetting = Some(Vignetting { strength })), 200, 1);
    for strength in [0.0, 0.5, 1.0] {
        let mut off = 0;
        for (pixel, found) in of(strength).into_iter().enumerate() {
            let (u, v) = ((pixel % SIDE) as f64 + 0.5, (pixel / SIDE) as f64 + 0.5);
            let angle = ((u - 100.0).hypot(v - 100.0) / 150.0).atan();
            let expected = tone().encode(tone().decode(200) * (1.0 - strength * (1.0 - angle.cos().powi(4))));
            let close = found[..3].iter().all(|byte| byte.abs_diff(expected) <= 1);
            assert!(close && found[3] == 255, "{pixel}: {found:?}, {expected}");
            off += usize::from(found[0] != expected);
        }
        // Differences are only allowed where the two computations round to different sides.
        assert!(off < SIDE, "{off}");
    }
    // Control: at a corner, 43 degrees off the axis, 0.28 of the radiance is left.
    let left = tone().decode(of(Vignetting::default().strength)[0][0]) / tone().decode(200);
    assert!((left - 0.28).abs() < 0.01, "{left}");
}

#[test]
fn zero_imperfections() {
    let light = Imperfections {
        vignetting: Some(Vignetting { strength: 0.0 }),
        exposure: Some(Exposure { stops: 0.0 }),
        read_noise: Some(ReadNoise { std: 0.0 }),
        ..Imperfections::default()
    };
    for byte in 0..=255 {
        assert!(with_effects(&light, byte, 1).iter().all(|pixel| *pixel == [byte, byte, byte, 255]), "{byte}");
    }
}

/// Depths and distances of clip depths (`reaches`), which are distances if not all rays of the lens go forward, else
/// depths.
fn depths_and_distances(reaches: &[f32], image: ImageContext<'_>) -> [Vec<f32>; 2] {
    let of_pixel = |(pixel, reach): (usize, &f32)| {
        let [x, y, z] = image.ray(pixel);
        let cosine = z / (x * x + y * y + z * z).sqrt();
        let aside = image.rays.is_some_and(|rays| rays.optics().lens().name() == "equidistant");
        let reach = f64::from(*reach);
        match reach.is_finite() {
            true if aside => [(reach * cosine) as f32, reach as f32],
            true => [reach as f32, (reach / cosine) as f32],
            false => [f32::INFINITY; 2],
        }
    };
    let pixels: Vec<[f32; 2]> = reaches.iter().enumerate().map(of_pixel).collect();
    [0, 1].map(|k| pixels.iter().map(|pixel| pixel[k]).collect())
}

/// Reaches with imperfections, computed from both channels and from each channel alone: all results must be equal.
fn lens_reach_with_effects(imperfections: &Imperfections, reaches: &[f32], image: ImageContext<'_>) -> Vec<f32> {
    let seen = |(pixel, reach): (usize, &f32)| if image.ray(pixel) == [0.0; 3] { f32::INFINITY } else { *reach };
    let reaches: Vec<f32> = reaches.iter().enumerate().map(seen).collect();
    let [depths, distances] = depths_and_distances(&reaches, image);
    let view = image.view;
    let noisy = |depth: bool, distance: bool| {
        let mut frame = Frame::new(view.width, view.height, Channels { depth, distance, ..Channels::default() });
        (frame.depth, frame.distance) = (depth.then(|| depths.clone()), distance.then(|| distances.clone()));
        imperfections.apply(&mut frame.as_mut(), ToneCurve::Soft, image);
        [frame.depth.take(), frame.distance.take()]
    };
    let [found_depths, found_distances] = noisy(true, true).map(Option::unwrap);
    let alone = [noisy(true, false)[0].clone().unwrap(), noisy(false, true)[1].clone().unwrap()];
    let found = if image.clips_by_distance() { &found_distances } else { &found_depths };
    let expected = depths_and_distances(found, image);
    for (k, all) in [found_depths.clone(), found_distances.clone()].into_iter().enumerate() {
        for pixel in 0..all.len() {
            let (one, expected) = (alone[k][pixel], expected[k][pixel]);
            // Rounded to single precision a few times, 6e-8 each, before and after the imperfections.
            let before = [&depths, &distances][k][pixel];
            let near = |x: f32| x == expected || (x - expected).abs() < 1e-6 * before.abs().max(expected.abs());
            assert!(near(all[pixel]), "{pixel}: {} is not {expected}", all[pixel]);
            assert!(near(one), "{pixel} alone: {one} is not {expected}");
        }
    }
    found.clone()
}

/// Depths of a pinhole, with imperfections.
fn depths_with_effects(imperfections: &Imperfections, depths: &[f32], view: &View) -> Vec<f32> {
    lens_reach_with_effects(imperfections, depths, pinhole(view, &rng_key(1)))
}

/// Holes and noise are consistent between depth and distance, and the same if only one channel is measured.
#[test]
fn distances() {
    let (view, n) = (view([60, 40], 50.0), 60 * 40);
    let reaches: Vec<f32> = (0..n).map(|k| if k % 60 < 30 { 2.0 } else { 1.0 }).collect();
    for rays in lenses(&view) {
        let baseline = if rays.is_none() { 0.075 } else { 0.0 };
        let holes = Some(Holes { baseline, ..Holes::default() });
        let all = Imperfections { depth_noise: Some(DepthNoise::NGUYEN), holes, ..Imperfections::default() };
        let key = rng_key(1);
        let found =
            lens_reach_with_effects(&all, &reaches, ImageContext { rays: rays.as_ref(), ..pinhole(&view, &key) });
        assert!(rays.is_some() || found.iter().any(|reach| reach.is_infinite()), "there are holes");
        let same = found.iter().zip(&reaches).filter(|(found, reach)| found == reach).count();
        assert!(same < 10, "there is noise, but for {same}");
    }
}

/// Standard deviation of the depth \[m\] as a function of the depth \[m\].
type Law = fn(f64) -> f64;

/// Bounds are six standard deviations: sqrt(1 / 2n) of itself for deviations, sigma / sqrt(n) for means.
#[test]
fn depth_noise() {
    let (view, n) = (view([SIDE; 2], 150.0), (SIDE * SIDE) as f64);
    let laws: [(DepthNoise, Law); 2] = [
        (DepthNoise::KHOSHELHAM, |z| 2.85e-5 * 100.0 * z * z * 0.5),
        (DepthNoise::NGUYEN, |z| 0.0012 + 0.0019 * (z - 0.4) * (z - 0.4)),
    ];
    for (depth_noise, law) in laws {
        for z in [0.5, 1.0, 2.0, 5.0] {
            let mut depths = vec![z as f32; SIDE * SIDE];
            depths[7] = f32::INFINITY;
            let found = depths_with_effects(&only(|all| all.depth_noise = Some(depth_noise)), &depths, &view);
            assert_eq!(found[7], f32::INFINITY, "a miss stays a miss");
            let errors: Vec<f64> = found.iter().filter(|z| z.is_finite()).map(|found| f64::from(*found) - z).collect();
            let [mean, variance] = moments(&errors);
            let sigma = variance.sqrt();
            assert!(mean.abs() < 6.0 * sigma / n.sqrt(), "{z} m: {mean}");
            assert!((sigma / law(z) - 1.0).abs() < 6.0 / (2.0 * n).sqrt(), "{z} m: {sigma}");
        }
    }
    // Control: the deviations at 1 m and 2 m differ by a factor of four, not two.
    assert_eq!((laws[0].1)(2.0) / (laws[0].1)(1.0), 4.0);
    let huge = only(|all| all.depth_noise = Some(DepthNoise { constant: 1000.0, quadratic: 0.0, offset: 0.0 }));
    let found = depths_with_effects(&huge, &[50.0; SIDE * SIDE], &view);
    assert!(found.iter().all(|z| (0.01..=100.0).contains(z)), "saturated");
}

/// A box 1 m away in front of a wall 2 m away: the shadow is fx b (1/1 - 1/2) pixels wide, on the side opposite to the
/// projector.
#[test]
fn projector_shadow() {
    let view = view([100, 8], 100.0);
    let row: Vec<f32> = (0..100).map(|u| if (20..40).contains(&u) { 1.0 } else { 2.0 }).collect();
    let holes_with = |baseline: f64| {
        let holes = Some(Holes { max_angle: FRAC_PI_2, baseline });
        depths_with_effects(&only(|all| all.holes = holes), &row.repeat(8), &view)
    };
    for baseline in [0.075, 0.15, -0.075, -0.15, 0.0] {
        let found = holes_with(baseline);
        let width = 100.0 * f64::abs(baseline) * (1.0 - 0.5);
        for (k, depth) in found.iter().enumerate() {
            let u = (k % 100) as f64;
            // Pixels beside the first pixel of the box, whose own center is lit.
            let shaded = match baseline {
                b if b > 0.0 => u < 20.0 && 20.0 - u <= width,
                b if b < 0.0 => u > 39.0 && u - 39.0 <= width,
                _ => false,
            };
            assert_eq!(depth.is_infinite(), shaded, "{baseline}: {u}");
            assert!(shaded || *depth == row[k % 100]);
        }
    }
    assert_eq!(holes_with(0.15).iter().filter(|depth| depth.is_infinite()).count(), 7 * 8, "the control");
}

/// On tilted planes, the angle between ray and normal is known at every pixel, for any lens.
#[test]
fn grazing_holes() {
    let view = view([80, 60], 60.0);
    let max_angle = 60f64.to_radians();
    let holes = Some(Holes { max_angle, baseline: 0.0 });
    let all = only(|all| all.holes = holes);
    for rays in lenses(&view) {
        let (mut inside, mut outside) = (0, 0);
        for normal in [[0.0, 0.0, -1.0], [0.8, 0.1, -0.6], [0.2, -0.9, -0.5], [-0.7, 0.7, -0.4]] {
            let key = rng_key(1);
            let image = ImageContext { rays: rays.as_ref(), ..pinhole(&view, &key) };
            let ray = |pixel| nalgebra::Vector3::from(image.ray(pixel));
            let normal = nalgebra::Vector3::from(normal).normalize();
            // A plane 2 m from the camera; rays that do not reach the plane are misses.
            let depth = |pixel| -2.0 / normal.dot(&ray(pixel));
            let reached = |depth: f64| depth > 0.0 && depth < 1e3;
            let depths: Vec<f32> =
                (0..80 * 60).map(|k| if reached(depth(k)) { depth(k) as f32 } else { f32::INFINITY }).collect();
            let found = lens_reach_with_effects(&all, &depths, image);
            let hits = found.iter().zip(&depths).enumerate().filter(|(_, (_, depth))| depth.is_finite());
            for (pixel, (found, depth)) in hits {
                let angle = (-normal.dot(&ray(pixel)) / ray(pixel).norm()).acos();
                // Single precision of depths and rays limits the angle: 6e-8 of each, over a pixel of 1/60.
                if (angle - max_angle).abs() > 1e-3 {
                    assert_eq!(found.is_infinite(), angle > max_angle, "{normal:?}, {pixel}: {angle}");
                    *(if angle > max_angle { &mut inside } else { &mut outside }) += 1;
                    assert!(found.is_infinite() || found == depth);
                }
            }
        }
        assert!(inside > 1000 && outside > 1000, "the control: {inside} {outside}");
    }
}

/// A pinhole, a lens whose rays all go forward, and a lens whose rays do not, for images of a view.
fn lenses(view: &View) -> [Option<LensRays>; 3] {
    let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
    let rays = |lens: Lens, by: f64| {
        let pixels = PixelIntrinsics { fx: by * fx, fy: by * fy, cx, cy };
        LensRays::new(&Optics::new(lens, pixels).unwrap(), [view.width, view.height], 1).unwrap()
    };
    let warped = rays(OpenCv { k1: -0.2, k2: 0.03, p1: 0.01, ..OpenCv::default() }.into(), 1.0);
    [None, Some(warped), Some(rays(Equidistant { max_angle: 1.9 }.into(), 0.4))]
}

/// The standard deviation follows the law for lenses too: for depths if all rays go forward, else for distances.
#[test]
fn lens_depth_noise() {
    let (view, law) = (view([120, 90], 60.0), DepthNoise { constant: 1e-3, quadratic: 2e-3, offset: 0.0 });
    let all = only(|all| all.depth_noise = Some(law));
    for rays in lenses(&view) {
        let key = rng_key(1);
        let image = ImageContext { rays: rays.as_ref(), ..pinhole(&view, &key) };
        for z in [0.5f64, 3.0] {
            let errors: Vec<f64> = lens_reach_with_effects(&all, &[z as f32; 120 * 90], image)
                .into_iter()
                .filter(|found| found.is_finite())
                .map(|found| f64::from(found) - z)
                .collect();
            assert!(errors.len() > 5000);
            let (n, sigma) = (errors.len() as f64, 1e-3 + 2e-3 * z * z);
            let found = (errors.iter().map(|e| e * e).sum::<f64>() / n).sqrt();
            assert!((found / sigma - 1.0).abs() < 6.0 / (2.0 * n).sqrt(), "{found} is not {sigma}");
        }
    }
}

/// Radiance of a white image with vignetting, by pixel.
fn remaining_radiance(rays: &LensRays, size: [usize; 2]) -> Vec<f64> {
    let (view, key) = (view(size, 1.0), rng_key(1));
    let image = ImageContext { rays: Some(rays), ..pinhole(&view, &key) };
    let shade = |pixel| {
        let mut light = [1.0; 3];
        Vignetting::default().apply(&mut light, &PixelContext { image, pixel });
        assert!(light[0] == light[1] && light[1] == light[2]);
        light[0]
    };
    (0..size[0] * size[1]).map(shade).collect()
}

/// Vignetting of fisheyes follows their formulas, and of lenses without distortion that of a pinhole. All lenses follow
/// their mapping from directions to points, which the falloff does not use. A patch of the sky of solid angle d omega
/// at the angle theta illuminates an area of the image. This area receives cos theta d omega of the light.
#[test]
fn lens_vignetting() {
    let size = [64, 48];
    let law = |name: &str, t: f64| match name {
        "equidistant" => Some(t.cos().max(0.0) * t.sin() / t),
        "equisolid" => Some(t.cos().max(0.0)),
        "orthographic" => Some(1.0),
        "stereographic" => Some(t.cos().max(0.0) * (t / 2.0).cos().powi(4)),
        "pinhole" => Some(t.cos().powi(4)),
        _ => None,
    };
    let (mut by_law, mut by_mapping, mut dark) = (0, 0, 0);
    for (lens, pixels) in crate::camera::tests::lenses::all() {
        if !lens.has_axis() {
            continue;
        }
        let optics = Optics::new(lens, pixels).unwrap();
        let rays = LensRays::new(&optics, size, 1).unwrap();
        for (k, found) in remaining_radiance(&rays, size).into_iter().enumerate() {
            let at = [(k % 64) as f64 + 0.5, (k / 64) as f64 + 0.5];
            let Some(ray) = optics.unproject(at).map(nalgebra::Vector3::from) else {
                assert_eq!(found, 0.0, "{}", lens.name());
                continue;
            };
            let theta = ray.x.hypot(ray.y).atan2(ray.z);
            if theta > FRAC_PI_2 {
                assert_eq!(found, 0.0, "{}", lens.name());
                dark += 1;
                continue;
            }
            if let Some(expected) = law(lens.name(), theta) {
                assert!((found - expected).abs() < 1e-6, "{}: {theta}: {found} is not {expected}", lens.name());
                by_law += 1;
            }
            // Area of the image per solid angle in this direction, and on the axis.
            let area = |ray: nalgebra::Vector3<f64>| {
                let beside = ray.cross(&nalgebra::Vector3::new(0.3, -0.5, 0.2)).normalize();
                let slope = |along: nalgebra::Vector3<f64>| {
                    let [a, b] = [-1e-5, 1e-5].map(|by| optics.project((ray + by * along).into()));
                    Some([0, 1].map(|axis| (b.unwrap_or_default()[axis] - a.unwrap_or_default()[axis]) / 2e-5))
                        .filter(|_| a.is_some() && b.is_some())
                };
                let (a, b) = (slope(beside)?, slope(ray.cross(&beside))?);
                Some((a[0] * b[1] - a[1] * b[0]).abs())
            };
            let Some(here) = area(ray) else { continue };
            let expected = theta.cos() * area(nalgebra::Vector3::z()).unwrap() / here;
            assert!((found - expected).abs() < 1e-6, "{}: {theta}: {found} is not {expected}", lens.name());
            by_mapping += 1;
        }
    }
    assert!(by_law > 5000 && by_mapping > 15_000 && dark > 100, "{by_law} {by_mapping} {dark}");
}

/// A pixel at the edge of the image circle has no neighbors on one side; its brightness still follows the law.
#[test]
fn image_circle_edge() {
    let size = [65, 65];
    for max_angle in [0.5, 1.0, 1.5] {
        // The center of the first pixel of row 32 is 32 pixels from the principal point.
        let f = 32.0 / max_angle;
        let pixels = PixelIntrinsics { fx: f, fy: f, cx: 32.5, cy: 32.5 };
        let rays = LensRays::new(&Optics::new(Equidistant { max_angle }.into(), pixels).unwrap(), size, 1).unwrap();
        let found = remaining_radiance(&rays, size);
        for pixel in [32 * 65, 32 * 65 + 64, 32, 64 * 65 + 32] {
            let expected = max_angle.cos() * max_angle.sin() / max_angle;
            assert!((found[pixel] - expected).abs() < 1e-6, "{max_angle} {pixel}: {} is not {expected}", found[pixel]);
        }
        assert_eq!(found[0], 0.0);
    }
}

/// The normalized image of a lens scales with its focal length; the radiance stays the same.
#[test]
fn focal_length_unit() {
    let size = [64, 48];
    let of = |scale: f64| {
        let pixels = PixelIntrinsics { fx: 20.0 / scale, fy: 20.0 / scale, cx: 32.0, cy: 24.0 };
        let lens = FTheta::default();
        let lens = Lens::from(FTheta { focal_length: lens.focal_length / scale, ..lens });
        remaining_radiance(&LensRays::new(&Optics::new(lens, pixels).unwrap(), size, 1).unwrap(), size)
    };
    let expected = of(1.0);
    for scale in [1e-4, 1e3] {
        for (pixel, (found, expected)) in of(scale).into_iter().zip(&expected).enumerate() {
            assert!((found - expected).abs() < 1e-6, "{scale} {pixel}: {found} is not {expected}");
        }
    }
}

/// Under a uniformly bright sky, a lens with the half field of view theta collects the irradiance pi sin² theta. This
/// holds for any mapping, up to a right angle. The irradiance is the sum over all pixels times the area of a pixel.
#[test]
fn light_of_sky() {
    use kinetoscope_render::lens::{Equisolid, Orthographic, Stereographic};
    use std::f64::consts::PI;
    let (size, f) = ([300, 300], 50.0);
    let pixels = PixelIntrinsics { fx: f, fy: f, cx: 150.0, cy: 150.0 };
    let all: [(Lens, f64); 6] = [
        (Equidistant { max_angle: 1.0 }.into(), 1.0),
        (Equidistant { max_angle: 2.5 }.into(), FRAC_PI_2),
        (Equisolid { max_angle: 2.8 }.into(), FRAC_PI_2),
        (Orthographic { max_angle: 1.2 }.into(), 1.2),
        (Stereographic { max_angle: 1.9 }.into(), FRAC_PI_2),
        (OpenCv { k1: -0.1, max_angle: Some(0.9), ..OpenCv::default() }.into(), 0.9),
    ];
    for (lens, most) in all {
        let rays = LensRays::new(&Optics::new(lens, pixels).unwrap(), size, 1).unwrap();
        let found = remaining_radiance(&rays, size).iter().sum::<f64>() / (f * f);
        let expected = PI * most.sin().powi(2);
        // At a sharp edge at radius r, only the 2 pi r edge pixels can be counted wrong, randomly and by half a pixel
        // each. The bound is six times the square root.
        let edge = (2.0 * PI * rays.optics().domain().radius * f).sqrt() * 0.5 * 6.0 / (f * f);
        assert!((found - expected).abs() < edge.min(0.01 * expected), "{}: {found} is not {expected}", lens.name());
    }
}

#[test]
fn refusals() {
    let color = Channels { color: true, ..Channels::default() };
    let depth = Channels { depth: true, ..Channels::default() };
    let mut bad = vec![
        only(|all| all.read_noise = Some(ReadNoise { std: -1.0 })),
        only(|all| all.read_noise = Some(ReadNoise { std: f64::INFINITY })),
    ];
    for value in [-0.1, 1.1, f64::NAN] {
        bad.push(only(|all| all.vignetting = Some(Vignetting { strength: value })));
        bad.push(only(|all| all.shot_noise = Some(ShotNoise { electrons: value - 1.0 })));
        bad.push(only(|all| all.exposure = Some(Exposure { stops: 30.0 * value.signum() })));
    }
    for imperfections in &bad {
        let error = imperfections.check(color).unwrap_err();
        assert!(matches!(error, SensorError::OutOfRange { .. }), "{error}");
    }
    let holes = |max_angle, baseline| only(|all| all.holes = Some(Holes { max_angle, baseline })).check(depth);
    assert!(holes(1.0, 0.1).is_ok() && holes(2.0, 0.1).is_err() && holes(1.0, f64::NAN).is_err());
    let noise = only(|all| all.depth_noise = Some(DepthNoise { quadratic: -1.0, ..DepthNoise::default() }));
    let error = noise.check(depth).unwrap_err().to_string();
    assert_eq!(error, "quadratic of the depth noise is -1; it must be 0 to 1000");
    // Imperfections of channels that are not measured are rejected.
    let shot = only(|all| all.shot_noise = Some(ShotNoise::default()));
    assert_eq!(shot.check(depth).unwrap_err().to_string(), "the camera does not measure color; it measures depth");
    let holes = only(|all| all.holes = Some(Holes::default()));
    assert!(holes.check(color).is_err() && holes.check(depth).is_ok());
    assert!(Imperfections::default().check(Channels::default()).is_ok());
}
