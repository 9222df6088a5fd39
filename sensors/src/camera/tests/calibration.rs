//! Calibration files: real files of each model, all supported notations, and errors of broken files.

use super::super::{CalibrationError, CameraCfg, CameraInfo, DistortionModel};
use super::test_scene::{built, cfg, context, point, pose_of};
use kinetoscope_render::lens::{
    Equidistant, Equisolid, FTheta, OpenCv, OpenCvFisheye, Orthographic, Panorama, Stereographic,
};
use kinetoscope_render::lens::{Lens, LensRays, Optics};
use kinetoscope_render::{Intrinsics, PixelIntrinsics, Renderer};
use kinetoscope_testkit::opencv::opencv;
use kinetoscope_testkit::urdf::TempFiles;

/// As `cameracalibrator` writes it, with additions of some drivers.
const FILE: &str = "\
# oST version 5.0 parameters
image_width: 64
image_height: 48
camera_name: narrow_stereo/left
camera_matrix:
  rows: 3
  cols: 3
  data: [ 61.02341,  0.     , 32.41077,
           0.     , 61.10022, 23.87015,
           0.     ,  0.     ,  1.     ]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.312471, 0.118365, 4.13e-4, -0.000218, 0.000000]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1., 0., 0.,
         0., 1., 0.,
         0., 0., 1.]
projection_matrix:
  rows: 3
  cols: 4
  data: [58.01243, 0., 32.30114, 0.,
         0., 59.23112, 23.80009, 0.,
         0., 0., 1., 0.]
binning_x: 0
";

/// The simulated camera of a calibration.
fn simulated_camera(info: &CameraInfo, renderer: Renderer) -> CameraCfg {
    let mut twin = CameraCfg { renderer, ..cfg() };
    info.apply_to(&mut twin);
    twin
}

/// OpenCV and ROS count pixels from the center of the first pixel. The camera sees in pixel (i, j) the point that
/// OpenCV's documented model projects to (i, j) with the numbers of the file. There is no offset of half a pixel.
#[test]
fn real_file() {
    let info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    assert_eq!((info.name.as_str(), info.width, info.height), ("narrow_stereo/left", 64, 48));
    // Both sums are exact.
    let pixels = Intrinsics::Pixels { fx: 61.02341, fy: 61.10022, cx: 32.41077 + 0.5, cy: 23.87015 + 0.5 };
    assert_eq!(info.intrinsics(), pixels);
    let lens = OpenCv { k1: -0.312471, k2: 0.118365, p1: 4.13e-4, p2: -0.000218, ..OpenCv::default() };
    assert_eq!(info.lens(), Lens::from(lens));
    assert_eq!((info.projection_matrix[(0, 2)], info.projection_matrix[(1, 1)]), (32.30114, 59.23112));
    let camera = built(&simulated_camera(&info, Renderer::FastRayTraced), &context(1));
    let (pose, k, d) = (pose_of(&camera, 0), &info.camera_matrix, &info.distortion_coefficients);
    let mut seen = 0;
    for ((_, row, column), _) in camera.depth().unwrap().indexed_iter().filter(|(_, depth)| depth.is_finite()) {
        seen += 1;
        let local = pose.inverse() * point(&camera, [0, row, column]);
        let (x, y) = (local.x / local.z, local.y / local.z);
        let r2 = x * x + y * y;
        let radial = 1.0 + d[0] * r2 + d[1] * r2 * r2;
        let x2 = x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x);
        let y2 = y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y;
        let off = [k[(0, 0)] * x2 + k[(0, 2)] - column as f64, k[(1, 1)] * y2 + k[(1, 2)] - row as f64];
        // Points and rays have 24 bits, for an image of 64 pixels: some 1e-5 of a pixel.
        assert!(off.iter().all(|off| off.abs() < 1e-4), "({column}, {row}): {off:?}");
    }
    assert!(seen > 1000, "{seen}");
    // The camera has the same calibration, up to the rounding of half a pixel there and back.
    let own = camera.camera_info("twin", 0).unwrap();
    assert_eq!(own.distortion_model, info.distortion_model);
    assert_eq!(own.distortion_coefficients, info.distortion_coefficients);
    assert!((own.camera_matrix - info.camera_matrix).amax() < 1e-14);
    // A centered camera of 640 x 480 pixels.
    let pixels = PixelIntrinsics { fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 };
    let centered = CameraInfo::from_intrinsics("", [640, 480], &pixels, &Lens::default()).unwrap();
    assert_eq!([centered.camera_matrix[(0, 2)], centered.camera_matrix[(1, 2)]], [319.5, 239.5]);
    assert_eq!([centered.projection_matrix[(0, 2)], centered.projection_matrix[(1, 2)]], [319.5, 239.5]);
}

/// A camera of each model with reference numbers of OpenCV, up to the accuracy of OpenCV's iterations.
#[test]
fn opencv_numbers() {
    macro_rules! camera {
        ($name:literal, $model:ident) => {
            ($name, include_str!(concat!("../../../tests/data/calibrations/", $name, ".yaml")), DistortionModel::$model)
        };
    }
    for (file, text, model) in [
        camera!("plumb_bob", PlumbBob),
        camera!("rational_polynomial", RationalPolynomial),
        camera!("equidistant", Equidistant),
        camera!("oak_d", RationalPolynomial),
    ] {
        let info = CameraInfo::parse(text, file).unwrap();
        assert_eq!(info.distortion_model, model, "{file}");
        let pixels = info.intrinsics().to_pixels(info.width, info.height).unwrap();
        let optics = Optics::new(info.lens(), pixels).unwrap();
        let undistorted: Vec<[f64; 4]> = opencv(&format!("{file} undistorted")).collect();
        for &[u, v, x, y] in &undistorted {
            let [a, b, c] = optics.unproject([u + 0.5, v + 0.5]).unwrap();
            // OpenCV's own inverse is off by at most 3e-12 pixels, which the slope multiplies by ten at 77 degrees.
            assert!((a / c - x).hypot(b / c - y) < 1e-13 * (1.0 + x * x + y * y), "{file} ({u}, {v}): {a} {b} {c}");
            let [back_u, back_v] = optics.project([x, y, 1.0]).unwrap();
            assert!((back_u - 0.5 - u).hypot(back_v - 0.5 - v) < 1e-11, "{file} ({u}, {v}): {back_u} {back_v}");
        }
        let mut projected = 0;
        for [x, y, z, u, v] in opencv(&format!("{file} projected")) {
            let [a, b] = optics.project([x, y, z]).unwrap();
            assert!((a - 0.5 - u).hypot(b - 0.5 - v) < 1e-11, "{file} ({x}, {y}, {z}): {a} {b}");
            projected += 1;
        }
        assert!(undistorted.len() == 9 && projected >= 3, "{file}: {projected}");
        // Controls: half a pixel aside, and without the lens.
        let [u, v, x, _] = undistorted[0];
        let [a, _, c] = optics.unproject([u, v]).unwrap();
        assert!((a / c - x).abs() > 5e-4, "{file}");
        assert!(((u + 0.5 - pixels.cx) / pixels.fx - x).abs() > 5e-4, "{file}");
        // The whole image is visible.
        let rays = LensRays::new(&optics, [info.width, info.height], 1).unwrap();
        assert_ne!(rays.direction(0, [info.width - 1, info.height - 1]), [0.0; 3], "{file}");
    }
}

#[test]
fn round_trip() {
    let mut info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    // Numbers of all magnitudes, and a name that needs quotes.
    info.camera_matrix[(0, 2)] = 1.0 / 3.0;
    info.distortion_coefficients = vec![1e-7, -2.5e-300, 1e16, 123_456.789, -0.0];
    info.name = "7: \"wrist\" \\ \u{7} é # no".into();
    let text = info.to_yaml();
    assert!(text.contains("1.0e-7, -2.5e-300, 1.0e+16"), "{text}");
    assert_eq!(CameraInfo::parse(&text, "again").unwrap(), info);
    // YAML 1.1 reads these words as a boolean and as null.
    for word in ["true", "Yes", "NULL", "n"] {
        let named = CameraInfo { name: word.into(), ..info.clone() };
        assert!(named.to_yaml().contains(&format!("camera_name: \"{word}\"\n")), "{}", named.to_yaml());
        assert_eq!(CameraInfo::parse(&named.to_yaml(), "again").unwrap(), named);
    }
    let pixels = PixelIntrinsics { fx: 300.25, fy: 301.0, cx: 320.0, cy: 240.0 };
    let twelve: Vec<f64> = (1..13).map(|k| 0.001 * f64::from(k)).collect();
    for (lens, model, count) in [
        (Lens::default(), DistortionModel::PlumbBob, 5),
        (OpenCv::from_coefficients(&twelve[..5]).into(), DistortionModel::PlumbBob, 5),
        (OpenCv::from_coefficients(&twelve[..8]).into(), DistortionModel::RationalPolynomial, 8),
        (OpenCv::from_coefficients(&twelve).into(), DistortionModel::RationalPolynomial, 12),
        (OpenCvFisheye { k1: 0.1, k4: -0.01, ..Default::default() }.into(), DistortionModel::Equidistant, 4),
    ] {
        let info = CameraInfo::from_intrinsics("front", [640, 480], &pixels, &lens).unwrap();
        assert_eq!((info.distortion_model, info.distortion_coefficients.len()), (model, count));
        let again = CameraInfo::parse(&info.to_yaml(), "front.yaml").unwrap();
        assert_eq!(again, info);
        // The principal point is a whole number of half pixels.
        assert_eq!(again.intrinsics(), Intrinsics::from(pixels));
        assert!(again.lens() == lens || lens.is_pinhole() && again.lens().is_pinhole());
    }
    let files = TempFiles::default();
    let path = files.folder().join("front.yaml");
    info.write(&path).unwrap();
    assert_eq!(CameraInfo::read(&path).unwrap(), info);
    drop(files);
    let error = CameraInfo::read(&path).unwrap_err();
    assert!(matches!(&error, CalibrationError::File { path: p, .. } if *p == path), "{error}");
}

/// Root cause: `max_angle`, beyond which pixels are dark, was treated as a part of the mapping, which K and D describe
/// completely. So the fix that errors of folding lenses suggest made the calibration unavailable.
#[test]
fn short_lenses() {
    let pixels = PixelIntrinsics { fx: 300.0, fy: 301.0, cx: 320.0, cy: 240.0 };
    let of = |lens: Lens| CameraInfo::from_intrinsics("front", [640, 480], &pixels, &lens);
    let fisheye = OpenCvFisheye { k1: 0.1, k4: -0.01, ..Default::default() };
    let barrel = OpenCv { k1: -0.2, ..OpenCv::default() };
    for (short, long) in [
        (Lens::from(OpenCv { max_angle: Some(0.5), ..barrel }), barrel.into()),
        (OpenCv { max_angle: Some(0.5), ..OpenCv::default() }.into(), Lens::default()),
        (OpenCvFisheye { max_angle: Some(1.4), ..fisheye }.into(), fisheye.into()),
        // r = theta gives four zeros for any `max_angle`.
        (Equidistant { max_angle: 1.2 }.into(), OpenCvFisheye::default().into()),
    ] {
        assert_eq!(of(short).unwrap(), of(long).unwrap());
        // Points visible through both lenses project to the same pixel.
        let [short, long] = [short, of(short).unwrap().lens()].map(|lens| Optics::new(lens, pixels).unwrap());
        for direction in [[0.0, 0.0, 1.0], [0.3, -0.1, 1.0], [-0.1, 0.4, 0.9]] {
            let [a, b] = [short, long].map(|optics| optics.project(direction).unwrap());
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-12, "{a:?} {b:?}");
        }
    }
    let info = of(Equidistant::default().into()).unwrap();
    assert_eq!((info.distortion_model, info.distortion_coefficients), (DistortionModel::Equidistant, vec![0.0; 4]));
    // The calibration of the camera itself.
    let lens = OpenCv { k1: -0.9, max_angle: Some(0.4), ..OpenCv::default() }.into();
    let camera = built(&CameraCfg { renderer: Renderer::FastRayTraced, lens, ..cfg() }, &context(1));
    assert_eq!(camera.camera_info("dark", 0).unwrap().distortion_coefficients, [-0.9, 0.0, 0.0, 0.0, 0.0]);
    // Lenses without a ROS model stay rejected.
    let lenses: [Lens; 5] = [
        Stereographic::default().into(),
        Equisolid::default().into(),
        Orthographic::default().into(),
        FTheta::default().into(),
        Panorama {}.into(),
    ];
    for error in lenses.map(|lens| of(lens).unwrap_err()) {
        assert!(matches!(error, CalibrationError::Lens { .. }), "{error}");
        assert!(error.to_string().contains("equidistant (opencv_fisheye, equidistant)"), "{error}");
    }
}

/// Root cause: the default renderer rejects lenses other than a pinhole, and `apply_to` kept it. The simulated camera
/// of every distorted calibration started with an error.
#[test]
fn renderer_of_calibrated_cameras() {
    let info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    let plain = simulated_camera(&info, Renderer::default());
    assert_eq!((Renderer::default(), plain.renderer), (Renderer::Raster, Renderer::FastRayTraced));
    assert!(built(&plain, &context(1)).depth().unwrap().iter().any(|depth| depth.is_finite()));
    // Other renderers trace rays already, and lenses without distortion work with all renderers.
    for renderer in [Renderer::FastRayTraced, Renderer::Hybrid, Renderer::RAY_TRACED] {
        assert_eq!(simulated_camera(&info, renderer).renderer, renderer);
    }
    let straight = CameraInfo { distortion_coefficients: vec![0.0; 5], ..info };
    assert_eq!(simulated_camera(&straight, Renderer::Raster).renderer, Renderer::Raster);
}

/// A file without its end, which contains the distortion and, in some files, additions.
const HEAD: &str = "\
image_width: 640
image_height: 480
camera_name: wrist
camera_matrix: { rows: 3, cols: 3, data: [610.2, 0, 324.1, 0, 611.0, 238.7, 0, 0, 1] }
rectification_matrix: { rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1] }
projection_matrix: { rows: 3, cols: 4, data: [580.1, 0, 323.0, 0, 0, 592.3, 238.0, 0, 0, 0, 1, 0] }
";

fn parse(end: &str) -> Result<CameraInfo, CalibrationError> {
    CameraInfo::parse(&format!("{HEAD}{end}"), "wrist.yaml")
}

/// A file with an optional model and `count` coefficients: 0.01, 0.02, ..., and zeros from the thirteenth on.
fn distortion(model: Option<&str>, count: usize) -> Result<CameraInfo, CalibrationError> {
    let numbers = (1..=count).map(|k| if k > 12 { "0".into() } else { format!("0.{k:02}") });
    let numbers = numbers.collect::<Vec<_>>().join(", ");
    let model = model.map_or(String::new(), |model| format!("distortion_model: {model}\n"));
    parse(&format!("{model}distortion_coefficients: {{ rows: 1, cols: {count}, data: [{numbers}] }}\n"))
}

/// The lens of [`distortion`] with `count` coefficients.
fn first(count: usize) -> Lens {
    let numbers: Vec<f64> = (1..=count.min(12)).map(|k| format!("0.{k:02}").parse().unwrap()).collect();
    OpenCv::from_coefficients(&numbers).into()
}

/// Every mistake is reported with file, line and field.
#[test]
fn refusals() {
    for (from, to, expected) in [
        ("image_width: 64", "image_width: -64", "left.yaml:2: image_width is \"-64\"; it must be a whole number"),
        ("image_height: 48\n", "", "left.yaml: image_height is missing"),
        ("image_height: 48", "image_height: [48]", "left.yaml:3: image_height is a list of 1, not a string"),
        ("61.02341", "0.", "left.yaml:5: camera_matrix is not a valid camera matrix: fx of the lens is 0"),
        ("61.02341", "61.02341, 7", "left.yaml:8: camera_matrix.data has 10 numbers, not the 3 x 3"),
        ("61.02341,  0. ", "61.02341,  0.5", "row 0, column 1 is 0.5"),
        ("61.02341", "sixty", "left.yaml:8: camera_matrix.data has \"sixty\"; it must be a finite number"),
        ("61.02341", ".nan", "it must be a finite number"),
        ("plumb_bob", "plum_bob", "left.yaml:11: unknown distortion model \"plum_bob\"; known models: plumb_bob"),
        ("plumb_bob", "equidistant", "left.yaml:12: distortion_coefficients has 5 numbers; equidistant has 4"),
        ("  cols: 5\n", "", "distortion_coefficients has no cols"),
        ("data: [1., 0., 0.", "data: [1., 0., 0.5", "rectification_matrix is not a rotation"),
        ("data: [58.01243", "data: [0.", "projection_matrix is singular"),
        ("data: [1., 0., 0.,", "data: [1., 0., 0.", "left.yaml:19: rectification_matrix.data has \"0. 0.\""),
        ("image_height: 48", "image_height: 48\nimage_height: 49", "left.yaml:4:1: duplicate key \"image_height\""),
        ("camera_matrix:", "camera_matrix", "left.yaml:"),
        ("image_width: 64", "image_width: &w 64\nextra: *w", "calibration files do not support aliases"),
    ] {
        assert!(FILE.contains(from), "{from}");
        let error = CameraInfo::parse(&FILE.replacen(from, to, 1), "left.yaml").unwrap_err().to_string();
        assert!(error.contains(expected), "{from:?} -> {to:?}: {error}");
    }
    let plumb_bob = Some("plumb_bob");
    for (model, count, expected) in [
        (plumb_bob, 3, "wrist.yaml:8: distortion_coefficients has 3 numbers; plumb_bob has 0, 4, 5, 8, 12 or 14"),
        (None, 6, "wrist.yaml:7: distortion_coefficients has 6 numbers; plumb_bob has 0, 4, 5, 8, 12 or 14"),
        (Some("rational_polynomial"), 13, "has 13 numbers; rational_polynomial has 0, 4, 5, 8, 12 or 14"),
        (Some("equidistant"), 8, "has 8 numbers; equidistant has 4"),
        (Some("equidistant"), 0, "has 0 numbers; equidistant has 4"),
        (Some("fish_eye"), 4, "unknown distortion model \"fish_eye\"; known models: fisheye"),
    ] {
        let error = distortion(model, count).unwrap_err().to_string();
        assert!(error.contains(expected), "{model:?}, {count}: {error}");
    }
    for model in ["plumb_bob", "rational_polynomial"] {
        let data = "0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0";
        let text =
            format!("distortion_model: {model}\ndistortion_coefficients: {{ rows: 1, cols: 14, data: [{data}] }}");
        let error = parse(&text).unwrap_err().to_string();
        let tilt = "wrist.yaml:8: distortion_coefficients tilts the sensor (tau_x = 0.1, tau_y = 0)";
        assert!(error.contains(tilt) && error.contains("tilted sensors are not supported"), "{error}");
    }
    // Lenses without a ROS distortion model.
    for name in ["panorama", "stereographic", "ftheta", "fish_eye", "pinhole"] {
        let error = distortion(Some(name), 4).unwrap_err();
        assert!(matches!(&error, CalibrationError::Model { line: 7, model, .. } if model == name), "{error}");
    }
    let error = |text: &str| CameraInfo::parse(text, "f").unwrap_err().to_string();
    assert_eq!(error(""), "f:1:1: the file is empty");
    assert!(error("just words").contains("not a table of fields"));
    assert!(error(&format!("a: {}", "[".repeat(2000))).starts_with("f:1:"));
    assert!(error("a: 1\n---\nb: 2\n").contains("second document"));
}

/// Root cause: each model accepted only a few coefficient counts, and a file without a model was an error. OpenCV takes
/// 4, 5, 8, 12 or 14 numbers for the same lens, and ROS passes them on; for a file without a model, ROS assumes
/// plumb_bob (image_common, `parse_yml.cpp`). Other tools use other names; `equidistant` of ROS is OpenCV's fisheye,
/// not the lens of that name.
#[test]
fn models() {
    let (plumb_bob, rational) = (DistortionModel::PlumbBob, DistortionModel::RationalPolynomial);
    for count in [4, 5, 8, 12, 14] {
        // ROS nodes write the rational model for more than 5 coefficients.
        let by_count = if count > 5 { rational } else { plumb_bob };
        for (model, expected) in [
            (Some("plumb_bob"), plumb_bob),
            (Some("rational_polynomial"), rational),
            (Some("\"\""), by_count),
            (None, by_count),
        ] {
            let info = distortion(model, count).unwrap();
            assert_eq!((info.lens(), info.distortion_model), (first(count), expected), "{model:?}, {count}");
            assert_eq!(info.distortion_coefficients.len(), count);
            assert_eq!(CameraInfo::parse(&info.to_yaml(), "again").unwrap(), info);
        }
    }
    // The ROS writer leaves D empty for a camera without distortion.
    for model in ["distortion_model: plumb_bob\n", "distortion_model: \"\"\n", "distortion_model:\n", ""] {
        let info = parse(&format!("{model}distortion_coefficients:\n  rows: 1\n  cols: 0\n  data: []\n")).unwrap();
        assert!(info.lens().is_pinhole() && info.distortion_model == plumb_bob, "{model:?}");
        assert_eq!(CameraInfo::parse(&info.to_yaml(), "again").unwrap(), info);
    }
    for name in ["radtan", "brown_conrady", "opencv_pinhole", "opencv"] {
        assert_eq!(distortion(Some(name), 4).unwrap().distortion_model, plumb_bob, "{name}");
        let long = distortion(Some(name), 8).unwrap();
        assert_eq!((long.distortion_model, long.lens()), (rational, first(8)), "{name}");
        assert!(long.to_yaml().contains("distortion_model: rational_polynomial"));
    }
    let fisheye = OpenCvFisheye { k1: 0.01, k2: 0.02, k3: 0.03, k4: 0.04, max_angle: None };
    for name in ["equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "opencv_fisheye"] {
        let info = distortion(Some(name), 4).unwrap();
        assert_eq!((info.distortion_model, info.lens()), (DistortionModel::Equidistant, fisheye.into()), "{name}");
        // These are lens names in scene files too, except for the first.
        assert_eq!(Lens::from_name(name).unwrap().name() == "opencv_fisheye", name != "equidistant");
    }
    assert_eq!(Lens::from_name("radtan").unwrap(), OpenCv::default().into());
}

/// Root cause: fields of newer ROS 2 files were ignored. A camera that delivers a part of the calibrated image was
/// simulated with the size and center of the whole image.
#[test]
fn binning_and_roi() {
    let with = |text: &str| {
        let model = "distortion_model: plumb_bob\ndistortion_coefficients: { rows: 1, cols: 0, data: [] }\n";
        parse(&format!("{model}{text}"))
    };
    let roi = |x: u32, y: u32, height: u32, width: u32| {
        format!("roi:\n  x_offset: {x}\n  y_offset: {y}\n  height: {height}\n  width: {width}\n  do_rectify: true\n")
    };
    // The whole image, in all notations (REP 104).
    let whole = ["", "binning_x: 0\nbinning_y: 0\n", "binning_x: 1\nbinning_y: 1\n", "roi: {}\n"].map(String::from);
    let sizes = [[0, 0], [480, 640], [0, 640], [480, 0]].map(|[height, width]| roi(0, 0, height, width));
    for good in whole.iter().chain(&sizes) {
        let info = with(good).unwrap();
        assert_eq!((info.width, info.height), (640, 480), "{good:?}");
    }
    let part = roi(320, 200, 200, 300);
    for (text, expected) in [
        ("binning_x: 2\nbinning_y: 2\n", "wrist.yaml:9: binning_x is 2: binning is not supported"),
        ("binning_x: 1\nbinning_y: 4\n", "wrist.yaml:10: binning_y is 4"),
        ("binning_x: -1\n", "wrist.yaml:9: binning_x is \"-1\"; it must be a whole number"),
        (
            "roi: whole\n",
            "wrist.yaml:9: roi is \"whole\", not a table of x_offset, y_offset, height, width and do_rectify",
        ),
        (&part, "wrist.yaml:9: roi is 300 x 200 at (320, 200), a region of 640 x 480, which is not supported"),
        (&part, "image_width: 300, image_height: 200, cx minus 320, cy minus 200"),
        (&roi(0, 0, 479, 640), "roi is 640 x 479 at (0, 0), a region"),
        (&roi(1, 0, 0, 0), "roi is 639 x 480 at (1, 0), a region"),
    ] {
        let error = with(text).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}

/// Windows line endings, a byte order mark, tabs between tokens, comments, flow and block lists and tables, quotes, and
/// numbers of all kinds give the same camera.
#[test]
fn notations() {
    let distortion = "distortion_coefficients: { rows: 1, cols: 5, data: [-0.5, 0.25, 1e-3, 2, 0] }";
    let plain = format!("{HEAD}distortion_model: plumb_bob\n{distortion}\n");
    let expected = CameraInfo::parse(&plain, "plain").unwrap();
    let blocks = "\
%YAML 1.1
---
# Of a calibration.
\"camera_name\": 'wrist'   # in quotes
image_width:\t640
image_height: +480
camera_matrix:
    rows: 3
    cols: 3
    dt: d
    data:
    - 610.2
    - 0.
    - 324.1
    - 0
    - 6.11e2
    - 238.7
    - 0.0
    - +0
    - 1
distortion_model: \"plumb_bob\"
distortion_coefficients: !!opencv-matrix
   cols: 1
   rows: 5
   data:
       - -.5
       - .25
       - 1.0E-03
       - 2.
       - -0.0e0
rectification_matrix:
  rows: 3
  cols: 3
  data: [ 1.,\t0., 0.,
    \t  0., 1., 0.,\t# the second
          0., 0., 1.,
        ]
projection_matrix:
  rows: 3
  data: [580.1, 0, 323.0, 0, 0, 592.3, 238.0, 0, 0, 0, 1, 0]
  cols: 4
...
";
    let crlf = plain.replace('\n', "\r\n");
    let marked = format!("\u{feff}{plain}");
    let marked_crlf = format!("\u{feff}{}", blocks.replace('\n', "\r\n"));
    let no_end = plain.trim_end().to_owned();
    for text in [blocks, &crlf, &marked, &marked_crlf, &no_end] {
        let info = CameraInfo::parse(text, "other").unwrap_or_else(|error| panic!("{error}\n{text:?}"));
        assert_eq!(info, expected, "{text:?}");
    }
    // Tabs as indentation are invalid YAML, in ROS too; the error has the position.
    let tabs =
        plain.replace("camera_matrix: { rows: 3, cols: 3, data:", "camera_matrix:\n\trows: 3\n\tcols: 3\n\tdata:");
    let error = CameraInfo::parse(&tabs.replace("0, 0, 1] }\nrect", "0, 0, 1]\nrect"), "tabs").unwrap_err();
    assert!(matches!(error, CalibrationError::Yaml { line: 4 | 5, .. }), "{error}");
    // Lines are counted correctly with any line ending.
    let error = CameraInfo::parse(&crlf.replace("611.0", "x"), "crlf").unwrap_err().to_string();
    assert!(error.starts_with("crlf:4: camera_matrix.data has \"x\""), "{error}");
}
