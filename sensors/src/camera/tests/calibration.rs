//! Calibration files: what a real one says, and what is wrong with broken ones.

use super::super::lens::{
    Equidistant, Equisolid, FTheta, OpenCv, OpenCvFisheye, Orthographic, Panorama, Stereographic,
};
use super::super::{
    CalibrationError, CameraCfg, CameraInfo, DistortionModel, Intrinsics, Lens, Optics, PixelIntrinsics, Renderer,
};
use super::stage::{built, cfg, context, pose_of};
use nalgebra::Point3;
use ndarray::Axis;

/// As `cameracalibrator` writes it, with what some drivers add.
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

#[test]
fn a_real_file_gives_the_camera() {
    let info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    assert_eq!((info.name.as_str(), info.width, info.height), ("narrow_stereo/left", 64, 48));
    // Both sums are exact.
    let pixels = Intrinsics::Pixels { fx: 61.02341, fy: 61.10022, cx: 32.41077 + 0.5, cy: 23.87015 + 0.5 };
    assert_eq!(info.intrinsics(), pixels);
    let lens = OpenCv { k1: -0.312471, k2: 0.118365, p1: 4.13e-4, p2: -0.000218, ..OpenCv::default() };
    assert_eq!(info.lens(), Lens::from(lens));
    assert_eq!((info.projection_matrix[(0, 2)], info.projection_matrix[(1, 1)]), (32.30114, 59.23112));
    // The camera of it says the same of itself.
    let mut twin = CameraCfg { renderer: Renderer::FastRayTraced, ..cfg() };
    info.apply_to(&mut twin);
    let camera = built(&twin, &context(1));
    assert!(camera.depth().unwrap().iter().any(|depth| depth.is_finite()));
    let said = camera.camera_info("twin", 0).unwrap();
    assert_eq!(said.distortion_model, info.distortion_model);
    assert_eq!(said.distortion_coefficients, info.distortion_coefficients);
}

/// OpenCV and ROS count pixels from the centre of the first one: what the twin sees in pixel (i, j) has to be what the model of
/// OpenCV's documentation brings to (i, j) with the numbers of the file, not to a point half a pixel beside it.
#[test]
fn the_twin_sees_in_a_pixel_what_open_cv_projects_to_it() {
    let info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    let mut twin = CameraCfg { renderer: Renderer::FastRayTraced, ..cfg() };
    info.apply_to(&mut twin);
    let camera = built(&twin, &context(1));
    let pose = pose_of(&camera, 0);
    let points = camera.position().unwrap();
    let (k, d) = (&info.camera_matrix, &info.distortion_coefficients);
    let mut seen = 0;
    for ((row, column), depth) in camera.depth().unwrap().index_axis(Axis(0), 0).indexed_iter() {
        if depth.is_infinite() {
            continue;
        }
        seen += 1;
        let point = Point3::from([0, 1, 2].map(|axis| f64::from(points[(0, row, column, axis)])));
        let local = pose.inverse() * point;
        let (x, y) = (local.x / local.z, local.y / local.z);
        let r2 = x * x + y * y;
        let radial = 1.0 + d[0] * r2 + d[1] * r2 * r2;
        let x2 = x * radial + 2.0 * d[2] * x * y + d[3] * (r2 + 2.0 * x * x);
        let y2 = y * radial + d[2] * (r2 + 2.0 * y * y) + 2.0 * d[3] * x * y;
        let at = [k[(0, 0)] * x2 + k[(0, 2)], k[(1, 1)] * y2 + k[(1, 2)]];
        // Points and rays have 24 bits, of a picture of 64 pixels: some 1e-5 of a pixel.
        let off = [at[0] - column as f64, at[1] - row as f64];
        assert!(off.iter().all(|off| off.abs() < 1e-4), "({column}, {row}): {at:?}");
    }
    assert!(seen > 1000, "{seen}");
    // The camera tells ROS the same, to the rounding of half a pixel there and back.
    let said = camera.camera_info("twin", 0).unwrap();
    assert!((said.camera_matrix - info.camera_matrix).amax() < 1e-14);
    // A centred camera of 640 x 480 pixels.
    let pixels = PixelIntrinsics { fx: 600.0, fy: 600.0, cx: 320.0, cy: 240.0 };
    let centred = CameraInfo::of("", [640, 480], &pixels, &Lens::default()).unwrap();
    assert_eq!([centred.camera_matrix[(0, 2)], centred.camera_matrix[(1, 2)]], [319.5, 239.5]);
    assert_eq!([centred.projection_matrix[(0, 2)], centred.projection_matrix[(1, 2)]], [319.5, 239.5]);
}

#[test]
fn files_come_back_as_they_were_written() {
    let mut info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    // Numbers of all sizes, and a name that is none without quotes.
    info.camera_matrix[(0, 2)] = 1.0 / 3.0;
    info.distortion_coefficients = vec![1e-7, -2.5e-300, 1e16, 123_456.789, -0.0];
    info.name = "7: \"wrist\" \\ \u{7} é # no".into();
    let text = info.to_yaml();
    assert!(text.contains("1.0e-7, -2.5e-300, 1.0e+16"), "{text}");
    assert_eq!(CameraInfo::parse(&text, "again").unwrap(), info);
    let pixels = PixelIntrinsics { fx: 300.25, fy: 301.0, cx: 320.0, cy: 240.0 };
    let twelve: Vec<f64> = (1..13).map(|k| 0.001 * f64::from(k)).collect();
    for (lens, model, count) in [
        (Lens::default(), DistortionModel::PlumbBob, 5),
        (OpenCv::from_coefficients(&twelve[..5]).into(), DistortionModel::PlumbBob, 5),
        (OpenCv::from_coefficients(&twelve[..8]).into(), DistortionModel::RationalPolynomial, 8),
        (OpenCv::from_coefficients(&twelve).into(), DistortionModel::RationalPolynomial, 12),
        (OpenCvFisheye { k1: 0.1, k4: -0.01, ..Default::default() }.into(), DistortionModel::Equidistant, 4),
    ] {
        let info = CameraInfo::of("front", [640, 480], &pixels, &lens).unwrap();
        assert_eq!((info.distortion_model, info.distortion_coefficients.len()), (model, count));
        let again = CameraInfo::parse(&info.to_yaml(), "front.yaml").unwrap();
        assert_eq!(again, info);
        // The principal point is a whole number of half pixels.
        assert_eq!(again.intrinsics(), Intrinsics::from(pixels));
        assert!(again.lens() == lens || lens.is_pinhole() && again.lens().is_pinhole());
    }
    let folder = std::env::temp_dir().join(format!("kinetoscope-calibration-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("front.yaml");
    info.write(&path).unwrap();
    assert_eq!(CameraInfo::read(&path).unwrap(), info);
    std::fs::remove_dir_all(&folder).unwrap();
    let error = CameraInfo::read(&path).unwrap_err();
    assert!(matches!(&error, CalibrationError::File { path: p, .. } if *p == path), "{error}");
}

/// Root cause: what `max_angle` says, where pixels are dark, was taken for a part of the mapping, which K and D say in full. So the
/// repair that errors of folding lenses advise took the camera's calibration away.
#[test]
fn lenses_that_end_early_have_their_calibration_too() {
    let pixels = PixelIntrinsics { fx: 300.0, fy: 301.0, cx: 320.0, cy: 240.0 };
    let of = |lens: Lens| CameraInfo::of("front", [640, 480], &pixels, &lens);
    let fisheye = OpenCvFisheye { k1: 0.1, k4: -0.01, ..Default::default() };
    for (short, long) in [
        (
            Lens::from(OpenCv { k1: -0.2, max_angle: Some(0.5), ..OpenCv::default() }),
            OpenCv { k1: -0.2, ..OpenCv::default() }.into(),
        ),
        (OpenCv { max_angle: Some(0.5), ..OpenCv::default() }.into(), Lens::default()),
        (OpenCvFisheye { max_angle: Some(1.4), ..fisheye }.into(), fisheye.into()),
        // r = theta: four zeros, wherever it ends.
        (Equidistant { max_angle: 1.2 }.into(), OpenCvFisheye::default().into()),
    ] {
        assert_eq!(of(short).unwrap(), of(long).unwrap());
        // What is seen with both is seen in the same place.
        let [short, long] = [short, of(short).unwrap().lens()].map(|lens| Optics::new(lens, pixels).unwrap());
        for direction in [[0.0, 0.0, 1.0], [0.3, -0.1, 1.0], [-0.1, 0.4, 0.9]] {
            let [a, b] = [short, long].map(|optics| optics.project(direction).unwrap());
            assert!((a[0] - b[0]).hypot(a[1] - b[1]) < 1e-12, "{a:?} {b:?}");
        }
    }
    let info = of(Equidistant::default().into()).unwrap();
    assert_eq!(
        (info.distortion_model, info.distortion_coefficients.as_slice()),
        (DistortionModel::Equidistant, [0.0; 4].as_slice())
    );
    // The camera itself says so.
    let lens = OpenCv { k1: -0.9, max_angle: Some(0.4), ..OpenCv::default() }.into();
    let camera = built(&CameraCfg { renderer: Renderer::FastRayTraced, lens, ..cfg() }, &context(1));
    assert_eq!(camera.camera_info("dark", 0).unwrap().distortion_coefficients, [-0.9, 0.0, 0.0, 0.0, 0.0]);
    // What ROS has no words for stays refused.
    for lens in [
        Lens::from(Stereographic::default()),
        Equisolid::default().into(),
        Orthographic::default().into(),
        FTheta::default().into(),
        Panorama {}.into(),
    ] {
        let error = of(lens).unwrap_err();
        assert!(matches!(error, CalibrationError::Lens { .. }), "{error}");
        assert!(error.to_string().contains("equidistant (opencv_fisheye, equidistant)"), "{error}");
    }
}

/// Root cause: the default renderer refuses lenses, and `apply_to` left it, so that the twin of every distorted camera began with
/// an error.
#[test]
fn twins_of_distorted_cameras_follow_rays() {
    let info = CameraInfo::parse(FILE, "left.yaml").unwrap();
    let twin = |info: &CameraInfo, renderer| {
        let mut twin = CameraCfg { renderer, ..cfg() };
        info.apply_to(&mut twin);
        twin
    };
    let plain = twin(&info, Renderer::default());
    assert_eq!((Renderer::default(), plain.renderer), (Renderer::Raster, Renderer::FastRayTraced));
    assert!(built(&plain, &context(1)).depth().unwrap().iter().any(|depth| depth.is_finite()));
    // Any other follows them already, and what bends nothing is for all.
    for renderer in [Renderer::FastRayTraced, Renderer::Hybrid, Renderer::RAY_TRACED] {
        assert_eq!(twin(&info, renderer).renderer, renderer);
    }
    let straight = CameraInfo { distortion_coefficients: vec![0.0; 5], ..info };
    assert_eq!(twin(&straight, Renderer::Raster).renderer, Renderer::Raster);
}

/// Every mistake is named with file, line and field.
#[test]
fn broken_files_say_where() {
    let broken = |from: &str, to: &str| {
        assert!(FILE.contains(from), "{from}");
        CameraInfo::parse(&FILE.replacen(from, to, 1), "left.yaml").unwrap_err().to_string()
    };
    for (from, to, said) in [
        ("image_width: 64", "image_width: -64", "left.yaml:2: image_width is \"-64\"; it must be a whole number"),
        ("image_height: 48\n", "", "left.yaml: image_height is missing"),
        ("image_height: 48", "image_height: [48]", "left.yaml:3: image_height is a list of 1, not a word"),
        ("61.02341", "0.", "left.yaml:5: camera_matrix is of no camera: fx of the lens is 0"),
        ("61.02341", "61.02341, 7", "left.yaml:8: camera_matrix.data has 10 numbers, not the 3 x 3"),
        ("61.02341,  0. ", "61.02341,  0.5", "row 0, column 1 is 0.5"),
        ("61.02341", "sixty", "left.yaml:8: camera_matrix.data has \"sixty\"; it must be a finite number"),
        ("61.02341", ".nan", "it must be a finite number"),
        ("plumb_bob", "plum_bob", "left.yaml:11: there is no distortion model \"plum_bob\"; known are plumb_bob"),
        ("plumb_bob", "equidistant", "left.yaml:12: distortion_coefficients has 5 numbers; equidistant has 4"),
        ("  cols: 5\n", "", "distortion_coefficients has no cols"),
        ("data: [1., 0., 0.", "data: [1., 0., 0.5", "rectification_matrix is no rotation"),
        ("data: [58.01243", "data: [0.", "projection_matrix is singular"),
        ("data: [1., 0., 0.,", "data: [1., 0., 0.", "left.yaml:19: rectification_matrix.data has \"0. 0.\""),
        ("image_height: 48", "image_height: 48\nimage_height: 49", "left.yaml:4:1: \"image_height\" is there twice"),
        ("camera_matrix:", "camera_matrix", "left.yaml:"),
        ("image_width: 64", "image_width: &w 64\nextra: *w", "aliases"),
    ] {
        let error = broken(from, to);
        assert!(error.contains(said), "{from:?} -> {to:?}: {error}");
    }
    let error = |text: &str| CameraInfo::parse(text, "f").unwrap_err().to_string();
    assert_eq!(error(""), "f:1:1: the file is empty");
    assert!(error("just words").contains("not a table of fields"));
    assert!(error(&format!("a: {}", "[".repeat(2000))).starts_with("f:1:"));
    assert!(error("a: 1\n---\nb: 2\n").contains("second document"));
}
