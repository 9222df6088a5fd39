//! Lenses of cameras: one of each kind, and their names in files.

use super::super::CameraCfg;
use kinetoscope_render::PixelIntrinsics;
use kinetoscope_render::lens::Lens;
use kinetoscope_render::lens::{
    Equidistant, Equisolid, FTheta, OpenCv, OpenCvFisheye, Orthographic, Panorama, Stereographic,
};

/// A strongly distorting lens with all twelve coefficients, as in a cheap camera.
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

const FISHEYE: OpenCvFisheye = OpenCvFisheye { k1: 0.03, k2: -0.012, k3: 0.004, k4: -0.0011, max_angle: Some(1.6) };

/// One lens of each kind, with intrinsics for a 64 x 48 image that the lens fills, or more than fills.
pub(in crate::camera) fn all() -> Vec<(Lens, PixelIntrinsics)> {
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

/// Notations in scene files: a name, an alias, or a table with numbers; and the way back.
#[test]
fn files() {
    let read = |text: &str| toml::from_str::<CameraCfg>(text).map(|cfg| cfg.lens);
    assert_eq!(read("").unwrap(), Lens::default());
    assert_eq!(read("lens = 'equidistant'").unwrap(), Lens::from(Equidistant::default()));
    assert_eq!(read("lens = 'fisheye_polynomial'").unwrap(), Lens::from(FTheta::default()));
    let distorted = read("lens.opencv = { k1 = -0.28, p2 = 0.001 }").unwrap();
    assert_eq!(distorted, Lens::from(OpenCv { k1: -0.28, p2: 0.001, ..OpenCv::default() }));
    for (lens, _) in all() {
        let cfg = CameraCfg { lens, ..CameraCfg::default() };
        let text = toml::to_string(&cfg).unwrap();
        assert_eq!(toml::from_str::<CameraCfg>(&text).unwrap(), cfg, "{text}");
    }
    for (text, said) in [
        ("lens = 'equidistent'", "unknown lens \"equidistent\"; known names: \"equidistant\""),
        ("lens.opencv.k7 = 1.0", "unknown field `k7`"),
        ("lens = {}", "a lens table needs the name of the lens as its key"),
        ("lens = { opencv = {}, pinhole = {} }", "two lenses are given"),
        ("lens = 3", "the name of a lens, or a table whose only key is the name of a lens"),
    ] {
        let error = read(text).unwrap_err().to_string();
        assert!(error.contains(said), "{text}: {error}");
    }
}
