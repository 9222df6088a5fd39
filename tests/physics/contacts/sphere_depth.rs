//! A ball in a depth image: number of its pixels, their centroid ([`ball_image`](super::ball_image)), and the
//! depth of the nearest point. That depth is D - R on the optical axis, where D is the distance of the center.
//! Elsewhere the ray (x, y, 1) of a pixel meets the ball at the depth (b - √(b² - a (c² - R²)))/a, with a = x² + y² +
//! 1, b = (x, y, 1)·c.
//!
//! Tolerance of area and centroid: a pixel belongs to the ball if the ray of its center meets the ball, that is, if the
//! root is real. The set of these pixels differs from the ellipse of `ball_image` by the amounts that [`center_moments`]
//! counts with this formula. The image may differ only by that, and by one pixel for each root so close to 0 that
//! single precision decides.
//!
//! Tolerance of depths: depths have single precision. The error is about six roundings of 2⁻²⁴ of b², over 2 √ of the
//! smallest compared root, over a. The nearest pixel is half a pixel off the axis in both directions, where the formula
//! gives slightly more than D - R.

use super::ball_image::{FOCAL, ImageMoments, PRINCIPAL_POINT, SIZE, expected_moments, measured_moments};
use crate::lab::*;
use kinetoscope::ndarray::Axis;
use kinetoscope::sensors::camera::CameraConvention;
use kinetoscope::sensors::ray::RayCasterCameraCfg;
use kinetoscope_testkit::worlds::{fixed, object};

const RADIUS: f64 = 0.3;

/// A ball: center in the optical frame \[m\], and radius \[m\].
type Ball = ([f64; 3], f64);

/// Smallest compared root: near the silhouette the depth changes steeply.
const MIN_ROOT: f64 = 0.01;
/// Rounding error of single precision between a ray and its depth.
const SINGLE: f64 = 6.0 / 16_777_216.0;

/// For the ray of a pixel's center and a ball: a, b, and the radicand.
fn ray([u, v]: [usize; 2], center: [f64; 3], r: f64) -> [f64; 3] {
    let (x, y) = ((u as f64 + 0.5 - PRINCIPAL_POINT[0]) / FOCAL, (v as f64 + 0.5 - PRINCIPAL_POINT[1]) / FOCAL);
    let (a, b) = (x * x + y * y + 1.0, x * center[0] + y * center[1] + center[2]);
    [a, b, b * b - a * (center.iter().map(|c| c * c).sum::<f64>() - r * r)]
}

/// Moments of the pixel centers inside the silhouette, and the number of pixels that single precision may add or
/// remove.
fn center_moments(center: [f64; 3], r: f64) -> (ImageMoments, f64) {
    let (mut area, mut sum, mut either) = (0.0, [0.0; 2], 0.0);
    for pixel in (0..SIZE[0]).flat_map(|u| (0..SIZE[1]).map(move |v| [u, v])) {
        let [_, b, root] = ray(pixel, center, r);
        if root.abs() < SINGLE * b * b {
            either += 1.0;
        }
        if root >= 0.0 {
            area += 1.0;
            sum = [0, 1].map(|k: usize| sum[k] + pixel[k] as f64 + 0.5);
        }
    }
    (ImageMoments { area, centroid: sum.map(|x| x / area) }, either)
}

/// Measured moments of a ball, nearest depth, and the largest depth error against the closed form of the second ball,
/// up to a meter. The image is rasterized, or ray-cast if `rays` is true.
fn measure_ball((at, radius): Ball, (center, r): Ball, rays: bool) -> (ImageMoments, f64, f64) {
    let mut lab = Lab::new(weightless());
    // The optical frame (x right, y down, z forward) looks along the world's x.
    let ball = fixed(object("ball", ObjectShape::Sphere { radius }, [at[2], -at[0], -at[1]]));
    let ball = lab.object(ball);
    let id = lab.sim.rigid_object(ball).mask_id();
    let [width, height] = SIZE;
    let intrinsics = Intrinsics::Pixels { fx: FOCAL, fy: FOCAL, cx: PRINCIPAL_POINT[0], cy: PRINCIPAL_POINT[1] };
    let extrinsics = Extrinsics { convention: CameraConvention::World, ..Extrinsics::default() };
    let (mask, depth) = if rays {
        let cfg = RayCasterCameraCfg { width, height, intrinsics, extrinsics, ..RayCasterCameraCfg::default() };
        let camera = lab.sim.add_sensor("rays", cfg).unwrap();
        let camera = lab.sim.sensor(camera).unwrap();
        (camera.mask().to_owned(), camera.depth().to_owned())
    } else {
        let channels = Channels { depth: true, mask: true, ..Channels::default() };
        let cfg = CameraCfg { width, height, intrinsics, extrinsics, channels, ..CameraCfg::default() };
        let camera = lab.sim.add_sensor("camera", cfg).unwrap();
        let camera = lab.sim.sensor(camera).unwrap();
        (camera.mask().unwrap().to_owned(), camera.depth().unwrap().to_owned())
    };
    let (mut nearest, mut worst) = (f64::INFINITY, 0.0_f64);
    for ((v, u), &z) in depth.index_axis(Axis(0), 0).indexed_iter() {
        let [a, b, root] = ray([u, v], center, r);
        if root > MIN_ROOT {
            worst = worst.max((f64::from(z) - (b - root.sqrt()) / a).abs().min(1.0));
        }
        nearest = nearest.min(f64::from(z));
    }
    (measured_moments(&mask.view(), id), nearest, worst)
}

#[test]
fn holds() {
    law(module_path!(), "A = π f² R² √(x² + y² + s)/s^(3/2), s = z² - R²; nearest D - R", |m| {
        for (place, at) in [("on the axis", [0.0, 0.0, 1.5]), ("off the axis", [0.4, -0.25, 1.4])] {
            for (name, rays) in [("rasterizer", false), ("rays", true)] {
                let this = (at, RADIUS);
                let (ball, nearest, worst) = measure_ball(this, this, rays);
                let beside = ([at[0] + 0.03, at[1] + 0.03, at[2]], 1.02 * RADIUS);
                let (other, other_nearest, other_worst) = measure_ball(beside, this, rays);
                let form = expected_moments(at, RADIUS);
                let of = |what: &str| format!("{what} {place}, {name}");
                let (whole, either) = center_moments(at, RADIUS);
                let pixels = "pixel centers along the silhouette";
                // Differences of numbers of this size have rounding errors.
                let edge = (whole.area - form.area).abs() * (1.0 + 1e-12) + either;
                m.row(&of("area"), "pixels", form.area, ball.area, (edge, pixels));
                m.control(&of("area"), "of a ball 2 % larger", other.area);
                for (axis, letter) in ["u", "v"].into_iter().enumerate() {
                    let quantity = of(&format!("{letter} of the middle"));
                    // An additional pixel is at most the radius away from the centroid, and the weight of one of all
                    // pixels.
                    let (is, was) = (form.centroid[axis], whole.centroid[axis]);
                    let edge = (was - is).abs() + either / form.area.sqrt() + 1e-12 * is;
                    m.row(&quantity, "pixels", is, ball.centroid[axis], (edge, pixels));
                    m.control(&quantity, "of a ball beside it", other.centroid[axis]);
                }
                // b²/a is at most the square of the distance.
                let far = at.iter().map(|c| c * c).sum::<f64>();
                let precision = SINGLE * far / (2.0 * MIN_ROOT.sqrt());
                let single = (precision, "single precision, steep near the silhouette");
                m.row(&of("largest error of a depth"), "m", 0.0, worst, single);
                m.control(&of("largest error of a depth"), "of a ball beside it", other_worst);
                if place == "on the axis" {
                    let [a, b, root] = ray([SIZE[0] / 2, SIZE[1] / 2], at, RADIUS);
                    let beside = (b - root.sqrt()) / a - (at[2] - RADIUS) + precision;
                    m.row(&of("nearest"), "m", at[2] - RADIUS, nearest, (beside, "half a pixel beside the axis"));
                    m.control(&of("nearest"), "of a ball beside it", other_nearest);
                }
            }
        }
    });
}
