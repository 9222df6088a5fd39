//! Distortions of real calibrations that OpenCV itself cannot invert everywhere: with poles, and with folds.

use crate::intrinsics::{Intrinsics, PixelIntrinsics};
use crate::lens::{Lens, LensRays, OpenCv, Optics};
use crate::optics_error::OpticsError;
use kinetoscope_testkit::opencv::opencv;

/// Factory calibration of an OAK-D's color camera on a TurtleBot 4, 250 x 250 pixels, rounded to five digits. Its
/// radial factor has a pole at 33.965 degrees and a zero at 33.970.
const OAK_D: [f64; 8] = [-4.8608, 17.282, 0.000204, 0.001025, -25.172, -4.9436, 17.514, -25.291];
const OAK_D_PIXELS: PixelIntrinsics = PixelIntrinsics { fx: 196.5, fy: 196.5, cx: 127.4, cy: 126.3 };
/// Factory calibration of an OAK-D Lite, with pole and zero at 37.00 and 37.07 degrees. Its bridge is the longest.
const OAK_D_LITE: [f64; 8] = [
    -4.0933966636657715,
    9.190781593322754,
    0.0012543922057375312,
    -0.0010304413735866547,
    -8.917245864868164,
    -4.187956809997559,
    9.556831359863281,
    -9.303533554077148,
];
/// The calibration example in the documentation of Basalt's converter for DepthAI. The zero is before the pole, at
/// 44.853 degrees and 44.937.
const ZERO_FIRST: [f64; 8] = [-7.64, 19.10, 0.00068, 0.00112, -12.51, -7.64, 19.06, -12.45];
const UNIT: PixelIntrinsics = PixelIntrinsics { fx: 1.0, fy: 1.0, cx: 0.0, cy: 0.0 };

fn optics(coefficients: &[f64], pixels: PixelIntrinsics) -> Optics {
    Optics::new(OpenCv::from_coefficients(coefficients).into(), pixels).unwrap()
}

/// OpenCV's formula without bridges.
fn formula(d: &[f64; 8], [x, y]: [f64; 2]) -> [f64; 2] {
    let [k1, k2, p1, p2, k3, k4, k5, k6] = *d;
    let r = x * x + y * y;
    let g = (1.0 + k1 * r + k2 * r * r + k3 * r * r * r) / (1.0 + k4 * r + k5 * r * r + k6 * r * r * r);
    [x * g + 2.0 * p1 * x * y + p2 * (r + 2.0 * x * x), y * g + p1 * (r + 2.0 * y * y) + 2.0 * p2 * x * y]
}

/// Root cause: "regular" meant a positive denominator, so directions behind the first pole of the fraction counted as
/// folded back. Newton's method failed there, and continuation from the axis climbed the spike before the pole: 33.92
/// degrees instead of OpenCV's 36.60, without an error.
#[test]
fn cancelled_poles() {
    for (d, name) in [(OAK_D, "oak_d pole"), (ZERO_FIRST, "zero_first pole")] {
        let optics = optics(&d, UNIT);
        // As far as a lens without a pole: up to the fold by p1 and p2, which are a thousandth.
        let domain = optics.domain();
        assert!(domain.angle > 1.56 && domain.radius < 1000.0, "{domain:?}");
        let all: Vec<[f64; 4]> = opencv(name).collect();
        assert_eq!(all.len(), 8, "{name}");
        for [u, v, x, y] in all {
            let point = [u, v];
            let [a, b, c] = optics.unproject(point).unwrap();
            // Both are within 1e-15 in the image, where the slope is not below 0.6.
            assert!((a / c - x).abs() < 1e-14 && (b / c - y).abs() < 1e-14, "{point:?}: {a} {b} {c}");
            let [u, v] = optics.project([x, y, 1.0]).unwrap();
            assert!((u - point[0]).abs() < 1e-14 && (v - point[1]).abs() < 1e-14, "{point:?}: {u} {v}");
        }
    }
    // A control: the other direction of the fourth point, on the spike, is a valid solution of OpenCV's formula.
    let of = |degrees: f64| formula(&OAK_D, [degrees.to_radians().tan(), 0.0])[0];
    assert!(of(33.90) < 0.75 && of(33.92) > 0.75, "{} {}", of(33.90), of(33.92));
}

/// Around the pole the image radius grows with the angle, each direction has a pixel and each pixel a direction.
#[test]
fn bridges() {
    for (d, pole) in [(OAK_D, 33.965), (OAK_D_LITE, 37.0), (ZERO_FIRST, 44.937)] {
        let optics = optics(&d, UNIT);
        let mut off_formula: [f64; 2] = [90.0, 0.0];
        for around in 0..12 {
            let (s, c) = (0.5 * f64::from(around)).sin_cos();
            let mut before = 0.0;
            for k in 1..12000 {
                // Steps of 0.004 degrees: shorter than from pole to zero.
                let angle = 0.004 * f64::from(k);
                let r = angle.to_radians().tan();
                let [u, v] = optics.project([c * r, s * r, 1.0]).unwrap();
                assert!(u.hypot(v) > before, "{angle}: {u}, {v}");
                before = u.hypot(v);
                let [x, y] = formula(&d, [c * r, s * r]);
                if (x - u).abs().max((y - v).abs()) > 1e-12 {
                    off_formula = [off_formula[0].min(angle), off_formula[1].max(angle)];
                }
                let [x, y, z] = optics.unproject([u, v]).unwrap();
                // The slope is never below a tenth of that of the lens, and the tolerance of the point is 1e-13.
                assert!((x / z - c * r).hypot(y / z - s * r) < 1e-11, "{angle}: {x} {y} {z}");
            }
        }
        // Away from the pole, by 2 degrees at most, OpenCV's formula holds.
        let [from, to] = off_formula;
        assert!(from > pole - 2.0 && from < pole && to > pole && to < pole + 2.0, "{off_formula:?}");
        // Pixels in steps of a thousandth of the focal length, as in images of 2000 pixels.
        for k in 0..1000 {
            let at = [0.001 * f64::from(k), -0.0004 * f64::from(k)];
            let [x, y, z] = optics.unproject(at).unwrap();
            let back = optics.project([x, y, z]).unwrap();
            assert!((back[0] - at[0]).hypot(back[1] - at[1]) < 1e-12, "{at:?}: {back:?}");
            // The lens itself bends little: no ray is farther off than the bridge is long.
            assert!((x / z - at[0]).hypot(y / z - at[1]) < 0.06, "{at:?}: {x} {y} {z}");
        }
    }
    // A control: the formula alone diverges before the pole, and returns from the other side.
    let of = |degrees: f64| formula(&OAK_D, [degrees.to_radians().tan(), 0.0])[0];
    assert!(of(33.9648) > 3.0 && of(33.9649) < -3.0, "{} {}", of(33.9648), of(33.9649));
}

/// The whole image of that camera: OpenCV's formula maps the ray of each pixel outside of the bridge to that pixel, and
/// no ray is on the spike, which is up to 46 pixels off.
#[test]
fn oak_d() {
    let optics = optics(&OAK_D, OAK_D_PIXELS);
    let rays = LensRays::new(&optics, [250, 250], 1).unwrap();
    let mut bridged = 0;
    for k in 0..250 * 250 {
        let (column, row) = (k % 250, k / 250);
        let at = [column as f64 + 0.5, row as f64 + 0.5];
        let [x, y, z] = optics.unproject(at).unwrap();
        let direction = [x / z, y / z];
        let [u, v] = formula(&OAK_D, direction);
        let found = [OAK_D_PIXELS.cx + OAK_D_PIXELS.fx * u, OAK_D_PIXELS.cy + OAK_D_PIXELS.fy * v];
        let off = (found[0] - at[0]).hypot(found[1] - at[1]);
        let degrees = direction[0].hypot(direction[1]).atan().to_degrees();
        if (degrees - 33.965).abs() < 0.44 {
            bridged += 1;
        } else {
            assert!(off < 1e-10, "{at:?}: {off}");
        }
        let [a, b] = [(at[0] - OAK_D_PIXELS.cx) / OAK_D_PIXELS.fx, (at[1] - OAK_D_PIXELS.cy) / OAK_D_PIXELS.fy];
        let aside = OAK_D_PIXELS.fx * (direction[0] - a).hypot(direction[1] - b);
        assert!(aside < 4.0, "{at:?} looks {aside} pixels aside");
        assert_ne!(rays.direction(0, [column, row]), [0.0; 3]);
    }
    // A ring of 0.87 degrees that is compressed to 0.74 pixels, and reaches the corners only.
    assert!((50..500).contains(&bridged), "{bridged}");
}

/// Poles that are not surplus of a fit end the lens: at the radius without pole and zero, if there are directions
/// behind the pole.
#[test]
fn wide_poles() {
    // g = (1 - s / 1.5) / (1 - s): without both it is 1, so the pole is at radius 1. There r - r³ / 1.5 = 1 - r².
    let wide = OpenCv { k1: -1.0 / 1.5, k4: -1.0, ..OpenCv::default() };
    let domain = Lens::from(wide).domain().unwrap();
    let r = domain.angle.tan();
    assert!(domain.folds && (domain.radius - 1.0).abs() < 1e-12, "{domain:?}");
    assert!((r - r * r * r / 1.5 - (1.0 - r * r)).abs() < 1e-12 && (r - 0.7274).abs() < 1e-3, "{r}");
    let pixels = PixelIntrinsics { fx: 100.0, fy: 100.0, cx: 100.0, cy: 100.0 };
    let optics = Optics::new(wide.into(), pixels).unwrap();
    let error = LensRays::new(&optics, [200, 200], 1).unwrap_err();
    assert!(
        matches!(error, OpticsError::LensFolds { angle, radius, .. } if (angle, radius) == (domain.angle, domain.radius))
    );
    assert!(error.to_string().contains("it folds back, or approaches a pole, 36.03 degrees"), "{error}");
    // An image that ends before the pole is valid, and so is a whole image if `max_angle` ends the lens before the
    // pole.
    let middle = PixelIntrinsics { cx: 70.0, cy: 70.0, ..pixels };
    assert!(LensRays::new(&Optics::new(wide.into(), middle).unwrap(), [140, 140], 1).is_ok());
    let short = Optics::new(OpenCv { max_angle: Some(0.78), ..wide }.into(), UNIT).unwrap();
    assert!(!short.domain().folds && short.unproject([3.0, 0.0]).is_some());
    // Without a zero: the lens r / (1 - r²) has a direction for each pixel, r = (sqrt(1 + 4 R²) - 1) / (2 R).
    let endless = Optics::new(OpenCv { k4: -1.0, ..OpenCv::default() }.into(), UNIT).unwrap();
    let domain = endless.domain();
    assert!(domain.folds && domain.radius == f64::INFINITY && (domain.angle - 1f64.atan()).abs() < 1e-12, "{domain:?}");
    for radius in [0.1, 1.0, 10.0, 1000.0] {
        let [x, _, z] = endless.unproject([radius, 0.0]).unwrap();
        let expected = ((1.0 + 4.0 * radius * radius).sqrt() - 1.0) / (2.0 * radius);
        assert!((x / z - expected).abs() < 1e-12, "{radius}: {x} {z}");
    }
    assert_eq!(endless.project([1.01, 0.0, 1.0]), None);
    // Equal numerator and denominator: no distortion, whatever the roots are.
    let same = OpenCv { k1: -2.0, k2: 0.7, k3: 0.1, k4: -2.0, k5: 0.7, k6: 0.1, ..OpenCv::default() };
    let same = Optics::new(same.into(), UNIT).unwrap();
    assert!(!same.domain().folds);
    for k in 0..2000 {
        let x = 0.001 * f64::from(k);
        let [u, ..] = same.unproject([x, 0.0]).map(|[u, v, z]| [u / z, v / z]).unwrap();
        assert!((u - x).abs() < 1e-9, "{x}: {u}");
    }
}

/// Camera fits leave pairs of either order, up to three of them: in all cases, a pixel with a ray maps back to itself.
#[test]
fn random_pairs() {
    let mut bridged = 0;
    for k in 0..400 {
        let part = |n: u32| f64::from((k * 7919 + n * 104_729) % 1009) / 1009.0;
        let pair = |n: u32| {
            let pole = 0.2 + 2.0 * part(n);
            [pole * (1.0 + 0.02 * (part(n + 1) - 0.5).powi(3)), pole]
        };
        let pairs = [pair(1), pair(3)];
        // (1 - s / z1) (1 - s / z2) (1 + 0.1 s), and the same for the poles.
        let of = |which: usize| {
            let [a, b, c] = [-1.0 / pairs[0][which], -1.0 / pairs[1][which], 0.1 * (which == 0) as u8 as f64];
            [a + b + c, a * b + a * c + b * c, a * b * c]
        };
        let ([k1, k2, k3], [k4, k5, k6]) = (of(0), of(1));
        let d = [k1, k2, 1e-4, -2e-4, k3, k4, k5, k6];
        let optics = optics(&d, UNIT);
        let domain = optics.domain();
        bridged += usize::from(domain.radius > 2.0);
        let mut last = 0.0;
        for step in 1..400 {
            let at = [0.002 * f64::from(step), 0.0015 * f64::from(step)];
            let Some([x, y, z]) = optics.unproject(at) else {
                assert!(
                    domain.folds && at[0].hypot(at[1]) > 0.99 * domain.radius,
                    "{k}: {at:?} has no ray: {domain:?}"
                );
                continue;
            };
            let back = optics.project([x, y, z]).unwrap();
            assert!((back[0] - at[0]).hypot(back[1] - at[1]) < 1e-11, "{k}: {at:?} comes back {back:?}");
            let r = (x / z).hypot(y / z);
            assert!(r > last, "{k}: {at:?} is at {r}, after {last}");
            last = r;
        }
    }
    assert!(bridged > 250, "{bridged}");
}

/// Two directions per pixel of a lens that dips between 28.05 and 33 degrees: the ones before the dip, from
/// `cv2.projectPoints(p, zeros(3), zeros(3), eye(3), d)`.
///
/// Root cause: Newton's method from the point itself found the direction behind the dip, which is outside of the lens's
/// domain. Continuation from the axis was used only if Newton's method failed. So whole cameras were rejected, or had
/// dark pixels within `max_angle`.
#[test]
fn rays_before_folds() {
    let d = [4.16224, -63.47165, -0.0002, -0.0007, 168.96335, 3.79104, -65.55826, 164.80506];
    let lens = OpenCv::from_coefficients(&d);
    let pixels: Vec<[f64; 4]> = opencv("dip").collect();
    assert_eq!(pixels.len(), 6);
    for max_angle in [None, Some(28f64.to_radians())] {
        let optics = Optics::new(OpenCv { max_angle, ..lens }.into(), UNIT).unwrap();
        assert!(optics.domain().folds == max_angle.is_none() && optics.domain().angle.to_degrees() < 28.06);
        for &[a, b, u, v] in &pixels {
            let (point, pixel) = ([a, b], [u, v]);
            let [x, y, z] = optics.unproject(pixel).unwrap();
            // The slope is not below 0.3 here, the tolerance of the point 1e-13.
            assert!((x / z - point[0]).hypot(y / z - point[1]) < 1e-12, "{pixel:?}: {x} {y} {z}");
        }
    }
    // A control: the other direction of the first pixel, which OpenCV itself finds: 35.74 degrees.
    let [u, v] = formula(&d, [0.7196107881897857, 4.643358733776809e-5]);
    assert!((u - pixels[0][2]).hypot(v - pixels[0][3]) < 1e-14);
    // An image up to the fold is valid, and an image with `max_angle` has no dark pixel within it.
    let fx = 100.0;
    let inside = Intrinsics::Pixels { fx, fy: fx, cx: 62.0, cy: 62.0 }.to_pixels(124, 124).unwrap();
    let rays = LensRays::new(&Optics::new(lens.into(), inside).unwrap(), [124, 124], 4);
    assert!(rays.is_ok(), "{rays:?}");
}
