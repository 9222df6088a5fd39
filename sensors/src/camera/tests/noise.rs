//! Noise of cameras, against its distribution.
//!
//! Standard deviations for n numbers: sigma / sqrt(n) of the mean, sqrt(2 / n) of the variance as a fraction, 1 /
//! sqrt(n) of a correlation. Bounds are six times that, which fails for one of 5e8 seeds; the seeds here are fixed.

use super::super::imperfection::{DepthNoise, Exposure, ReadNoise, ShotNoise};
use super::super::{Camera, CameraCfg, DepthMiss, Extrinsics, Imperfections, Placement, PointFrame};
use super::test_scene::{BALL, DT, GROUND, SIZE, bits, built, cfg, context, state};
use crate::noise::NoiseCfg;
use crate::sensor::{Sensor, SensorContext};
use kinetoscope_render::lens::Lens;
use kinetoscope_render::{RasterCfg, Renderer, ToneCurve};
use kinetoscope_testkit::srgb::{linear, srgb};
use ndarray::Axis;

const PIXELS: f64 = (SIZE[0] * SIZE[1]) as f64;

/// A camera straight above the ground, 2 m away, that sees no ball.
fn down(noise: &[(&str, NoiseCfg)]) -> CameraCfg {
    let placement = Placement::LookAt { eye: [50.0, 0.0, 2.0], target: [50.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    let noise = noise.iter().map(|(name, noise)| (name.to_string(), *noise)).collect();
    CameraCfg { extrinsics: Extrinsics { placement, ..Extrinsics::default() }, noise, ..cfg() }
}

fn depths(camera: &Camera, row: usize) -> Vec<f64> {
    camera.depth().unwrap().index_axis(Axis(0), row).iter().map(|depth| f64::from(*depth) - 2.0).collect()
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len() as f64
}

/// Errors of all pixels at 20 steps.
fn errors(cfg: &CameraCfg, context: &SensorContext, row: usize) -> Vec<f64> {
    let mut camera = built(cfg, context);
    let mut all = Vec::new();
    for step in 1..=20 {
        camera.update(&state(&vec![step; context.num_envs])).unwrap();
        all.extend(depths(&camera, row));
    }
    all
}

#[test]
fn white() {
    let std = 0.05;
    let cfg = down(&[("depth", NoiseCfg::white(std))]);
    let first = errors(&cfg, &context(2), 0);
    let n = first.len() as f64;
    let bound = 6.0 / n.sqrt();
    let alike = |a: &[f64], b: &[f64]| product(a, b) / (std * std);
    let fourth = first.iter().map(|x| (x / std).powi(4)).sum::<f64>() / n;
    assert!(mean(&first).abs() < bound * std, "{}", mean(&first));
    assert!((alike(&first, &first) - 1.0).abs() < bound * 2f64.sqrt(), "variance");
    assert!((fourth - 3.0).abs() < bound * 96f64.sqrt(), "{fourth}");
    // Correlations between neighbors, rows, images, environments, sensors and seeds.
    for apart in [1, SIZE[0], PIXELS as usize] {
        assert!(alike(&first, &first[apart..]).abs() < bound * 1.1, "{apart} numbers apart");
    }
    assert_eq!(first, errors(&cfg, &context(2), 0), "the same again");
    for (what, context, row) in [
        ("environments", context(2), 1),
        ("sensors", SensorContext { name: "other".into(), ..context(2) }, 0),
        ("seeds", SensorContext { seed: 1, ..context(2) }, 0),
    ] {
        assert!(alike(&first, &errors(&cfg, &context, row)).abs() < bound, "{what}");
    }
}

/// The noise and imperfections of an environment do not depend on the process that simulates it.
#[test]
fn first_env() {
    let cfg = down(&[("depth", NoiseCfg::white(0.1))]);
    let part = SensorContext { first_env: 2, ..context(2) };
    assert_eq!(errors(&cfg, &context(4), 3), errors(&cfg, &part, 1));
    assert_ne!(errors(&cfg, &context(4), 1), errors(&cfg, &part, 1), "the control");
    let imperfections = Imperfections {
        shot_noise: Some(ShotNoise { electrons: 500.0 }),
        read_noise: Some(ReadNoise { std: 0.01 }),
        depth_noise: Some(DepthNoise::NGUYEN),
        ..Imperfections::default()
    };
    let cfg = CameraCfg { imperfections, ..down(&[]) };
    // The lights depend on the environment.
    let at = |envs: usize, step: u64| {
        let mut state = state(&vec![step; envs]);
        state.visible.as_mut().unwrap().lights.iter_mut().for_each(|light| light.direction = [0.0, 0.3, -1.0]);
        state
    };
    let seen = |context: &SensorContext, row: usize| {
        let mut camera = built(&cfg, context);
        [1, 2].map(|step| {
            camera.update(&at(context.num_envs, step)).unwrap();
            bits(&camera, [row])
        })
    };
    let whole = context(8);
    let alone = |first_env| seen(&SensorContext { first_env, ..context(1) }, 0);
    assert!(alone(7) == seen(&whole, 7) && alone(6) == seen(&whole, 6));
    let [first, second] = alone(7);
    assert!(alone(6) != seen(&whole, 7) && first != second, "the controls: another environment, another image");
}

#[test]
fn biases() {
    let context = context(1);
    let bias_std = 0.03;
    let mut camera = built(&down(&[("depth", NoiseCfg { bias_std, ..NoiseCfg::default() })]), &context);
    let first = depths(&camera, 0);
    assert!((product(&first, &first) / bias_std.powi(2) - 1.0).abs() < 6.0 * (2.0 / PIXELS).sqrt());
    camera.update(&state(&[1])).unwrap();
    assert_eq!(depths(&camera, 0), first);
    camera.refresh(&[0], &state(&[1])).unwrap();
    assert_eq!(depths(&camera, 0), first);
    camera.reset(&[0], &state(&[0])).unwrap();
    let second = depths(&camera, 0);
    assert!((product(&first, &second) / bias_std.powi(2)).abs() < 6.0 / PIXELS.sqrt());
    // A random walk of 0.2 m per sqrt(s) has the deviation sqrt(t) times that after t seconds; images are 4 steps
    // apart.
    let walk = NoiseCfg { bias_walk: 0.2, ..NoiseCfg::default() };
    let cfg = CameraCfg { update_period: 4.0 * DT, ..down(&[("depth", walk)]) };
    let mut camera = built(&cfg, &context);
    assert!(depths(&camera, 0).iter().all(|error| error.abs() < 1e-5), "it begins where the truth is");
    let mut at = Vec::new();
    for step in 1..=80u64 {
        camera.update(&state(&[step])).unwrap();
        if step == 20 || step == 80 {
            at.push(depths(&camera, 0));
        }
    }
    let [early, late] = [0.1, 0.4].map(|seconds| 0.04 * seconds);
    for (walked, variance) in at.iter().zip([early, late]) {
        let found = product(walked, walked);
        assert!((found / variance - 1.0).abs() < 6.0 * (2.0 / PIXELS).sqrt(), "{found} is not {variance}");
    }
    // The covariance of a walk at two times is the variance at the earlier time.
    let together = product(&at[0], &at[1]);
    assert!((together - early).abs() < 6.0 * ((early * late + early * early) / PIXELS).sqrt(), "{together}");
}

#[test]
fn resolution() {
    let context = context(1);
    let resolution = 0.125;
    let cfg = down(&[("depth", NoiseCfg { std: 1.0, resolution, ..NoiseCfg::default() })]);
    let camera = built(&CameraCfg { near: 0.5, far: 3.0, ..cfg }, &context);
    let mut ends = [0; 2];
    for depth in camera.depth().unwrap() {
        assert_eq!((depth / 0.125).fract(), 0.0);
        assert!((0.5..=3.0).contains(depth));
        [0.5, 3.0].iter().zip(&mut ends).for_each(|(end, count)| *count += usize::from(depth == end));
    }
    assert!(ends.iter().all(|count| *count > 50), "the control: noise reaches both ends, {ends:?}");
}

/// Noise does not turn hits into misses. Root cause: noise saturates at the far plane, whose depth is also the value of
/// [`DepthMiss::Far`], so half of the hits there became misses.
#[test]
fn saturated_hits() {
    let context = context(1);
    let depth_noise = Some(DepthNoise { constant: 0.1, quadratic: 0.0, offset: 0.0 });
    let noisy = Imperfections { depth_noise, ..Imperfections::default() };
    let equidistant = Lens::from_name("equidistant").unwrap();
    for (lens, noise, imperfections) in [
        (Lens::default(), vec![("depth", NoiseCfg::white(0.1))], Imperfections::default()),
        (Lens::default(), vec![], noisy.clone()),
        (equidistant, vec![("distance", NoiseCfg::white(0.1))], Imperfections::default()),
        (equidistant, vec![], noisy),
    ] {
        let renderer = Renderer::FastRayTraced;
        let far = if lens.is_pinhole() { 2.01 } else { 2.2 };
        let cfg = CameraCfg { lens, renderer, imperfections, far, ..down(&noise) };
        let hits = |camera: &Camera| camera.mask().unwrap().iter().filter(|id| **id != 0).count();
        let mut counts = Vec::new();
        for depth_miss in [DepthMiss::Inf, DepthMiss::Far, DepthMiss::Zero] {
            let camera = built(&CameraCfg { depth_miss, ..cfg.clone() }, &context);
            let points = camera.point_cloud(0, PointFrame::Camera).unwrap();
            assert_eq!(points.nrows(), hits(&camera), "{depth_miss:?} {}", lens.name());
            counts.push(points.nrows());
            let reach = if lens.is_pinhole() { camera.depth() } else { camera.distance() };
            let (far, reach) = (cfg.far as f32, reach.unwrap());
            let misses = reach.iter().zip(camera.mask().unwrap()).filter(|(_, id)| **id == 0);
            let missed = |x: f32| match depth_miss {
                DepthMiss::Inf => x == f32::INFINITY,
                DepthMiss::Far => x == far,
                DepthMiss::Zero => x == 0.0,
            };
            assert!(misses.into_iter().all(|(x, _)| missed(*x)));
            // Control: noise reaches the far plane at many pixels.
            let last = reach.iter().filter(|x| x.is_finite() && **x >= far.next_down()).count();
            assert!(depth_miss == DepthMiss::Zero || last > 100, "{last}");
        }
        assert!(counts[0] > 100 && counts.iter().all(|count| *count == counts[0]), "{counts:?}");
        assert!(lens.is_pinhole() || counts[0] < SIZE[0] * SIZE[1]);
    }
}

/// Channels have independent noise, misses stay misses, and channels without noise are exact.
#[test]
fn channels() {
    let context = context(2);
    let noise: [(String, NoiseCfg); 2] =
        [("depth", 0.05), ("distance_to_camera", 0.02)].map(|(name, std)| (name.into(), NoiseCfg::white(std)));
    let (noisy, perfect) = (built(&CameraCfg { noise: noise.into(), ..cfg() }, &context), built(&cfg(), &context));
    let mut errors = [Vec::new(), Vec::new()];
    let mask = perfect.mask().unwrap();
    for (at, id) in mask.indexed_iter() {
        let pairs = [
            (noisy.depth().unwrap()[at], perfect.depth().unwrap()[at]),
            (noisy.distance().unwrap()[at], perfect.distance().unwrap()[at]),
        ];
        for ((found, exact), errors) in pairs.into_iter().zip(&mut errors) {
            match *id {
                0 => assert_eq!(found, f32::INFINITY),
                _ => errors.push(f64::from(found - exact)),
            }
        }
    }
    let n = errors[0].len() as f64;
    for (errors, std) in errors.iter().zip([0.05, 0.02]) {
        assert!(errors.iter().all(|error| error.abs() < 6.9 * std), "numbers of 32 bits reach no farther");
        assert!((product(errors, errors) / (std * std) - 1.0).abs() < 6.0 * (2.0 / n).sqrt());
    }
    assert!((product(&errors[0], &errors[1]) / (0.05 * 0.02)).abs() < 6.0 / n.sqrt(), "channels");
    assert!(mask.iter().any(|id| *id == BALL) && mask.iter().any(|id| *id == GROUND));
    assert_eq!((noisy.mask().unwrap(), noisy.color().unwrap()), (mask, perfect.color().unwrap()));
    assert_eq!((noisy.normal(), noisy.position()), (perfect.normal(), perfect.position()));
}

/// Rounding of bytes adds a twelfth to the variance.
#[test]
fn colors() {
    let context = context(1);
    let std = 4.0;
    let cfg = down(&[("rgb", NoiseCfg::white(std))]);
    let (mut noisy, mut perfect) = (built(&cfg, &context), built(&down(&[]), &context));
    let mut errors: [Vec<f64>; 3] = Default::default();
    for step in 1..=20 {
        noisy.update(&state(&[step])).unwrap();
        perfect.update(&state(&[step])).unwrap();
        let (noisy, perfect) = (noisy.color().unwrap(), perfect.color().unwrap());
        for (at, byte) in perfect.indexed_iter() {
            let found = noisy[at];
            if at.3 == 3 {
                assert_eq!(found, 255, "opacity has none");
            } else {
                assert!((35..=220).contains(byte), "{byte}: nothing saturates");
                errors[at.3].push(f64::from(found) - f64::from(*byte));
            }
        }
    }
    let (n, variance) = (errors[0].len() as f64, std * std + 1.0 / 12.0);
    for (k, errors_of_one) in errors.iter().enumerate() {
        assert!(mean(errors_of_one).abs() < 6.0 * (variance / n).sqrt());
        let found = product(errors_of_one, errors_of_one);
        assert!((found / variance - 1.0).abs() < 6.0 * (2.0 / n).sqrt(), "{found}");
        let next = product(errors_of_one, &errors[(k + 1) % 3]) / variance;
        assert!(next.abs() < 6.0 / n.sqrt(), "red, green and blue: {next}");
    }
    let coarse = NoiseCfg { resolution: 16.0, ..NoiseCfg::white(20.0) };
    let camera = built(&down(&[("color", coarse)]), &context);
    let bytes = camera.color().unwrap();
    assert!(bytes.iter().all(|byte| byte.is_multiple_of(16) || *byte == 255), "whole steps, or the end");
}

/// Noise of zero keeps the bits of the perfect camera.
#[test]
fn zero() {
    let nothing = ["depth", "distance", "color"].map(|name| (name.to_string(), NoiseCfg::white(0.0)));
    let camera = built(&CameraCfg { noise: nothing.into(), ..cfg() }, &context(1));
    assert_eq!(bits(&camera, [0]), bits(&built(&cfg(), &context(1)), [0]));
}

/// The exposure of a camera is that of its renderer: the sky, 0.8 on the screen, is exposed twice as long and half as
/// long.
#[test]
fn camera_exposure() {
    let context = context(1);
    let sky = |stops: Option<f64>| {
        let imperfections = Imperfections { exposure: stops.map(|stops| Exposure { stops }), ..Default::default() };
        let raster = RasterCfg { tone: ToneCurve::Clip, ..RasterCfg::default() };
        let camera = built(&CameraCfg { imperfections, raster, ..cfg() }, &context);
        camera.color().unwrap().iter().copied().collect::<Vec<u8>>()
    };
    let plain = sky(None);
    assert_eq!(sky(Some(0.0)), plain);
    for stops in [-1.0, 1.0] {
        let mut changed = 0;
        for (k, (found, before)) in sky(Some(stops)).into_iter().zip(&plain).enumerate() {
            if k % 4 == 3 {
                assert_eq!(found, 255);
                continue;
            }
            // A byte of the plain image stands for a radiance within half a byte; white may be brighter. 1.5 as in
            // `close`.
            let [low, high] = [-0.5, 0.5].map(|half| {
                let byte = (f64::from(*before) + half).clamp(0.0, 255.0);
                srgb((linear((byte / 255.0) as f32) * f64::exp2(stops)).min(1.0))
            });
            let high = if *before == 255 { 255.0 } else { high };
            assert!((low - 1.5..=high + 1.5).contains(&f64::from(found)), "{before} becomes {found} at {stops}");
            changed += usize::from(found.abs_diff(*before) > 8);
        }
        assert!(changed > plain.len() * 3 / 16, "{changed} of {}", plain.len());
    }
}
