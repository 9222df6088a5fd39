//! Lens models compared with closed forms, OpenCV's numbers, and their own inverses.

use crate::intrinsics::{Intrinsics, PixelIntrinsics};
use crate::lens::{
    Equidistant, Equisolid, FTheta, Lens, LensRays, OpenCv, OpenCvFisheye, Optics, Orthographic, Panorama,
    Stereographic,
};
use crate::optics_error::OpticsError;
use kinetoscope_scene::pattern::UnknownName;
use kinetoscope_testkit::opencv::opencv;
use std::f64::consts::{FRAC_PI_2, PI};

const PIXELS: PixelIntrinsics = PixelIntrinsics { fx: 610.0, fy: 605.0, cx: 322.0, cy: 243.0 };

/// All twelve coefficients, of a cheap camera.
pub(super) const WARPED: OpenCv = OpenCv {
    k1: -0.28,
    k2: 0.09,
    p1: 0.0007,
    p2: -0.0004,
    k3: -0.012,
    k4: 0.05,
    k5: -0.02,
    k6: 0.003,
    s1: 0.0011,
    s2: -0.0006,
    s3: 0.0009,
    s4: 0.0004,
    max_angle: None,
};

pub(super) const FISHEYE: OpenCvFisheye =
    OpenCvFisheye { k1: 0.03, k2: -0.012, k3: 0.004, k4: -0.0011, max_angle: Some(1.6) };

/// One lens of each kind, and intrinsics for which it fills an image of 64 x 48, or more than fills it.
pub(super) fn all() -> Vec<(Lens, PixelIntrinsics)> {
    let f = |f: f64| PixelIntrinsics { fx: f, fy: 1.1 * f, cx: 30.25, cy: 25.5 };
    let panorama = Panorama::intrinsics(64, 48).to_pixels(64, 48).unwrap();
    let theta = FTheta { polynomial: [0.0, 0.00245, 1e-7, -3e-10, 0.0, 0.0], ..FTheta::default() };
    vec![
        (Lens::default(), f(40.0)),
        (WARPED.into(), f(50.0)),
        (OpenCv { k1: -0.35, k2: 0.2, ..OpenCv::default() }.into(), f(60.0)),
        (FISHEYE.into(), f(20.0)),
        (Equidistant { max_angle: 1.9 }.into(), f(15.0)),
        (Equisolid { max_angle: 2.5 }.into(), f(15.0)),
        (Orthographic::default().into(), f(22.0)),
        (Stereographic { max_angle: 2.0 }.into(), f(9.0)),
        (theta.into(), f(18.0)),
        (Panorama {}.into(), panorama),
    ]
}

/// Rays of a lens, including the color samples.
pub(super) fn rays_of(lens: Lens, pixels: PixelIntrinsics, size: [usize; 2]) -> LensRays {
    LensRays::new(&Optics::new(lens, pixels).unwrap(), size, 4).unwrap()
}

/// Lenses of [`all`] other than the pinhole.
pub(super) fn distorting() -> impl Iterator<Item = (Lens, LensRays)> {
    all()
        .into_iter()
        .filter(|(lens, _)| !lens.is_pinhole())
        .map(|(lens, pixels)| (lens, rays_of(lens, pixels, [64, 48])))
}

fn angle_with([x, y, z]: [f64; 3]) -> f64 {
    x.hypot(y).atan2(z)
}

/// Every pixel with a ray is the projection of that ray, to 1e-10 pixels; all other pixels are outside of the image
/// circle.
#[test]
fn round_trip() {
    for (lens, pixels) in all() {
        let optics = Optics::new(lens, pixels).unwrap();
        let (mut seen, mut blind) = (0, 0);
        for k in 0..4 * 64 * 48 {
            // Four points in each pixel, none at its center.
            let at = [(k % 128) as f64 / 2.0 + 0.13, (k / 128) as f64 / 2.0 + 0.29];
            let radius = ((at[0] - pixels.cx) / pixels.fx).hypot((at[1] - pixels.cy) / pixels.fy);
            let Some(ray) = optics.unproject(at) else {
                assert!(radius >= optics.domain().radius, "{}: {at:?} has no ray", lens.name());
                blind += 1;
                continue;
            };
            assert!((ray.iter().map(|x| x * x).sum::<f64>() - 1.0).abs() < 1e-14);
            assert!(angle_with(ray) <= optics.domain().angle + 1e-9 || optics.domain().folds, "{}", lens.name());
            // Directions of any length.
            let back = optics.project(ray.map(|x| 7.0 * x)).unwrap();
            let off = (back[0] - at[0]).hypot(back[1] - at[1]);
            assert!(off < 1e-10, "{}: {at:?} comes back {off:e} pixels off", lens.name());
            seen += 1;
        }
        assert!(seen > 64 * 48, "{}: {seen} of {}", lens.name(), seen + blind);
        let circle = !matches!(lens, Lens::Pinhole(_) | Lens::OpenCv(_) | Lens::Panorama(_));
        assert_eq!(blind > 0, circle, "{}: {blind} without a ray", lens.name());
    }
}

#[test]
fn fisheye_radii() {
    type Law = fn(f64) -> f64;
    let laws: [(Lens, Law, f64); 5] = [
        (Equidistant::default().into(), |t| t, PI),
        (Equisolid::default().into(), |t| 2.0 * (t / 2.0).sin(), PI),
        (Orthographic::default().into(), f64::sin, FRAC_PI_2),
        (Stereographic::default().into(), |t| 2.0 * (t / 2.0).tan(), 3.1),
        // Isaac's default: 0.00245 rad per pixel at f = 1 / 0.00245, so r = f theta, up to 100 degrees.
        (FTheta::default().into(), |t| t, 100f64.to_radians()),
    ];
    for (lens, law, end) in laws {
        let optics = Optics::new(lens, PIXELS).unwrap();
        assert!((optics.domain().angle - end).abs() < 1e-15, "{}", lens.name());
        for k in 1..1000 {
            let (angle, around) = (end * f64::from(k) / 1000.0, 0.7 * f64::from(k));
            let (c, s) = (around.cos(), around.sin());
            let direction = [angle.sin() * c, angle.sin() * s, angle.cos()];
            let [u, v] = optics.project(direction).unwrap();
            let expected = [PIXELS.cx + PIXELS.fx * law(angle) * c, PIXELS.cy + PIXELS.fy * law(angle) * s];
            // The largest radius is 40 000 pixels, the last digit of the angle 1e-16 of pi, and the stereographic slope
            // there 1000.
            let off = (u - expected[0]).abs().max((v - expected[1]).abs());
            assert!(off < 1e-9 * law(angle).max(1.0), "{} at {angle}: {off:e}", lens.name());
        }
        let past = end + 1e-6;
        if past < PI {
            assert_eq!(optics.project([past.sin(), 0.0, past.cos()]), None, "{}", lens.name());
        }
    }
    // A control: the laws differ.
    assert!((FRAC_PI_2 - 2.0 * (FRAC_PI_2 / 2.0).sin()).abs() > 0.1);
    // Isaac's image of 200 degrees has a circle of 712.4 pixels: 100 degrees / 0.00245.
    let isaac = Optics::new(FTheta::default().into(), FTheta::ISAAC.to_pixels(1936, 1216).unwrap()).unwrap();
    assert!((isaac.domain().radius * isaac.pixels().fx - 100f64.to_radians() / 0.00245).abs() < 1e-9);
    assert!(isaac.unproject([970.94244 + 712.3, 600.37482]).is_some());
    assert!(isaac.unproject([970.94244 + 712.5, 600.37482]).is_none());
}

#[test]
fn panorama() {
    let optics = Optics::new(Panorama {}.into(), Panorama::intrinsics(360, 180).to_pixels(360, 180).unwrap()).unwrap();
    for (direction, pixel) in [
        ([0.0, 0.0, 1.0], [180.0, 90.0]),
        ([1.0, 0.0, 0.0], [270.0, 90.0]),
        ([-1.0, 0.0, 0.0], [90.0, 90.0]),
        ([0.0, 1.0, 0.0], [180.0, 180.0]),
        ([0.0, -1.0, 0.0], [180.0, 0.0]),
        ([0.0, 1.0, 1.0], [180.0, 135.0]),
        ([1.0, 0.0, -1.0], [315.0, 90.0]),
    ] {
        let [u, v] = optics.project(direction).unwrap();
        assert!((u - pixel[0]).abs() < 1e-12 && (v - pixel[1]).abs() < 1e-12, "{direction:?}: {u}, {v}");
    }
}

#[test]
fn opencv_numbers() {
    let OpenCv { k1, k2, p1, p2, k3, .. } = WARPED;
    let five = OpenCv { k1, k2, p1, p2, k3, ..OpenCv::default() };
    for (lens, name) in [(Lens::from(WARPED), "warped"), (five.into(), "warped five"), (FISHEYE.into(), "fisheye")] {
        let optics = Optics::new(lens, PIXELS).unwrap();
        let mut count = 0;
        for [x, y, z, u, v] in opencv(name) {
            let [a, b] = optics.project([x, y, z]).unwrap();
            // Both are a few dozen operations on numbers below 1000.
            assert!((a - u).abs() < 1e-10 && (b - v).abs() < 1e-10, "{name}: {a}, {b}");
            count += 1;
        }
        assert_eq!(count, 4, "{name}");
    }
}

/// x (1 + k1 x²) has its largest value at x² = -1 / (3 k1), 2/3 of x; theta (1 + k1 theta²) likewise.
#[test]
fn folds() {
    let pixels = PixelIntrinsics { fx: 100.0, fy: 100.0, cx: 100.0, cy: 100.0 };
    let tangent = 1.0 / 0.6f64.sqrt();
    for (lens, angle, end) in [
        (Lens::from(OpenCv { k1: -0.2, ..OpenCv::default() }), 1.0 / 0.6f64.sqrt(), true),
        (OpenCvFisheye { k1: -0.2, ..OpenCvFisheye::default() }.into(), tangent, false),
    ] {
        let optics = Optics::new(lens, pixels).unwrap();
        let angle = if end { angle.atan() } else { angle };
        let domain = optics.domain();
        assert!(domain.folds && (domain.angle - angle).abs() < 1e-8, "{}: {domain:?}", lens.name());
        assert!((domain.radius - tangent * 2.0 / 3.0).abs() < 1e-12, "{}: {domain:?}", lens.name());
        // An image that ends before the fold is valid; a larger one is rejected, by the radius.
        let middle = Optics::new(lens, PixelIntrinsics { cx: 50.0, cy: 50.0, ..pixels }).unwrap();
        assert!(LensRays::new(&middle, [100, 100], 1).is_ok());
        let error = LensRays::new(&optics, [200, 200], 1).unwrap_err();
        assert!(matches!(error, OpticsError::LensFolds { radius, .. } if (radius - domain.radius).abs() < 1e-12));
        assert!(error.to_string().contains("at radius 0.8607 of the normalized image"), "{error}");
    }
    // A larger `max_angle` is rejected at once; a smaller one leaves the rest dark.
    let short = |max_angle| Lens::from(OpenCv { k1: -0.2, max_angle: Some(max_angle), ..OpenCv::default() });
    assert!(matches!(short(1.2).domain(), Err(OpticsError::LensFolds { .. })));
    let rays = LensRays::new(&Optics::new(short(0.5), pixels).unwrap(), [200, 200], 1).unwrap();
    assert!(rays.direction(0, [0, 0]) == [0.0; 3] && rays.direction(0, [100, 100]) != [0.0; 3]);
    let theta = FTheta { polynomial: [0.0, 0.00245, 0.0, -3e-9, 0.0, 0.0], ..FTheta::default() };
    // b r + d r³ is largest at r² = b / (-3 d).
    let r = (0.00245f64 / 9e-9).sqrt();
    let Err(OpticsError::LensFolds { angle, radius, .. }) = Lens::from(theta).domain() else { panic!("it folds") };
    assert!((radius * theta.focal_length - r).abs() < 1e-6 && (angle - 0.00245 * r * 2.0 / 3.0).abs() < 1e-12);
    // Distortions without rotational symmetry are checked in all directions: this one folds along +x only.
    let prism = OpenCv { s1: -0.4, ..OpenCv::default() };
    let domain = Lens::from(prism).domain().unwrap();
    // x - 0.4 r² falls with x from x = 1 / 0.8 on.
    assert!(domain.folds && (domain.angle.tan() - 1.25).abs() < 0.01, "{domain:?}");
}

#[test]
fn invalid_lenses() {
    let mut rows: Vec<(Lens, &str)> = vec![
        (OpenCv { k5: f64::NAN, ..OpenCv::default() }.into(), "k5"),
        (OpenCvFisheye { k2: f64::INFINITY, ..OpenCvFisheye::default() }.into(), "k2"),
        (Orthographic { max_angle: 1.6 }.into(), "max_angle"),
        (Stereographic { max_angle: PI }.into(), "max_angle"),
    ];
    for bad in [0.0, -1.0, 4.0, f64::NAN, f64::INFINITY] {
        let opencv = OpenCv { max_angle: Some(bad), ..OpenCv::default() };
        let ftheta = FTheta { max_angle: bad, ..FTheta::default() };
        let all =
            [Equidistant { max_angle: bad }.into(), Equisolid { max_angle: bad }.into(), opencv.into(), ftheta.into()];
        rows.extend(all.map(|lens: Lens| (lens, "max_angle")));
    }
    let theta = |polynomial, focal_length| FTheta { polynomial, focal_length, ..FTheta::default() }.into();
    rows.extend([
        (theta([0.1, 0.1, 0., 0., 0., 0.], 1.0), "a"),
        (theta([0.0, -0.1, 0., 0., 0., 0.], 1.0), "b"),
        (theta([0.0, 0.1, 0., 0., f64::NAN, 0.], 1.0), "e"),
        (theta([0.0, 0.1, 0., 0., 0., 0.], 0.0), "focal_length"),
    ]);
    for (lens, expected) in rows {
        let error = lens.domain();
        assert!(matches!(error, Err(OpticsError::Lens { what, .. }) if what == expected), "{expected}: {error:?}");
    }
    let Err(UnknownName { what, candidates, .. }) = Lens::from_name("equidistent") else { panic!() };
    assert_eq!((what, candidates[0].as_str()), ("lens", "equidistant"));
    for name in Lens::NAMES {
        assert_eq!(Lens::from_name(name).unwrap().name(), *name);
    }
    assert_eq!(Lens::from_name("plumb_bob").unwrap(), Lens::from(OpenCv::default()));
    // The whole image is dark: the circle is far outside of it.
    let beside = Intrinsics::Pixels { fx: 1.0, fy: 1.0, cx: -50.0, cy: 0.0 }.to_pixels(8, 8).unwrap();
    let optics = Optics::new(Orthographic::default().into(), beside).unwrap();
    assert_eq!(LensRays::new(&optics, [8, 8], 1), Err(OpticsError::NoVisiblePixel { lens: "orthographic" }));
}
