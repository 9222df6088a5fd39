//! Calibration files that ROS itself loads, in all the ways in which they are written.

use super::super::lens::{OpenCv, OpenCvFisheye};
use super::super::{CalibrationError, CameraInfo, DistortionModel, Lens};

/// Without the end, where the distortion and what some files add stand.
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

/// The model that is named, if one is, and so many numbers: 0.01, 0.02, ..., and zeros from the thirteenth on.
fn distortion(model: Option<&str>, count: usize) -> Result<CameraInfo, CalibrationError> {
    let numbers = (1..=count).map(|k| if k > 12 { "0".into() } else { format!("0.{k:02}") });
    let numbers = numbers.collect::<Vec<_>>().join(", ");
    let model = model.map_or(String::new(), |model| format!("distortion_model: {model}\n"));
    parse(&format!("{model}distortion_coefficients: {{ rows: 1, cols: {count}, data: [{numbers}] }}\n"))
}

fn first(count: usize) -> Lens {
    let all: Vec<f64> = (1..=count.min(12)).map(|k| 0.01 * k as f64).collect();
    let lens = OpenCv::from_coefficients(&all);
    // As the file has them: 0.01 k is not the nearest number of each.
    let near = lens.coefficients().map(|c| (c * 100.0).round() / 100.0);
    OpenCv::from_coefficients(&near).into()
}

/// Root cause: each model had a few counts of its own, and a file without the model was an error. OpenCV takes 4, 5, 8, 12 or 14
/// numbers for the same lens, and ROS hands them to it; for a file without a model it assumes plumb_bob (image_common,
/// `parse_yml.cpp`).
#[test]
fn opencv_s_numbers_may_be_as_many_as_opencv_takes() {
    for count in [4, 5, 8, 12, 14] {
        for model in [Some("plumb_bob"), Some("rational_polynomial"), Some("\"\""), None] {
            let info = distortion(model, count).unwrap();
            assert_eq!(info.lens(), first(count), "{model:?}, {count}");
            assert_eq!(info.distortion_coefficients.len(), count);
            let expected = match model {
                Some("plumb_bob") => DistortionModel::PlumbBob,
                Some("rational_polynomial") => DistortionModel::RationalPolynomial,
                // What ROS's own nodes write for so many.
                _ if count > 5 => DistortionModel::RationalPolynomial,
                _ => DistortionModel::PlumbBob,
            };
            assert_eq!(info.distortion_model, expected, "{model:?}, {count}");
            assert_eq!(CameraInfo::parse(&info.to_yaml(), "again").unwrap(), info);
        }
    }
    for (model, count, said) in [
        (
            Some("plumb_bob"),
            3,
            "wrist.yaml:8: distortion_coefficients has 3 numbers; plumb_bob has 0, 4, 5, 8, 12 or 14",
        ),
        (None, 6, "wrist.yaml:7: distortion_coefficients has 6 numbers; plumb_bob has 0, 4, 5, 8, 12 or 14"),
        (Some("rational_polynomial"), 13, "has 13 numbers; rational_polynomial has 0, 4, 5, 8, 12 or 14"),
        (Some("equidistant"), 8, "has 8 numbers; equidistant has 4"),
        (Some("equidistant"), 0, "has 0 numbers; equidistant has 4"),
    ] {
        let error = distortion(model, count).unwrap_err().to_string();
        assert!(error.contains(said), "{model:?}, {count}: {error}");
    }
    for model in ["plumb_bob", "rational_polynomial"] {
        let data = "0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0.1, 0";
        let text =
            format!("distortion_model: {model}\ndistortion_coefficients: {{ rows: 1, cols: 14, data: [{data}] }}");
        let error = parse(&text).unwrap_err().to_string();
        assert!(
            error.contains("wrist.yaml:8: distortion_coefficients tilts the sensor (tau_x = 0.1, tau_y = 0)"),
            "{error}"
        );
        assert!(error.contains("tilted sensors are not supported"), "{error}");
    }
}

/// As ROS's writer has a camera without distortion: D is empty.
#[test]
fn no_numbers_are_no_distortion() {
    for model in ["distortion_model: plumb_bob\n", "distortion_model: \"\"\n", "distortion_model:\n", ""] {
        let info = parse(&format!("{model}distortion_coefficients:\n  rows: 1\n  cols: 0\n  data: []\n")).unwrap();
        assert!(info.lens().is_pinhole() && info.distortion_model == DistortionModel::PlumbBob, "{model:?}");
        assert_eq!(CameraInfo::parse(&info.to_yaml(), "again").unwrap(), info);
    }
}

/// Words of other tools for the same models; ROS's `equidistant` is OpenCV's fisheye, not the lens of that name.
#[test]
fn models_have_other_names() {
    for name in ["radtan", "brown_conrady", "opencv_pinhole", "opencv"] {
        assert_eq!(distortion(Some(name), 4).unwrap().distortion_model, DistortionModel::PlumbBob, "{name}");
        let long = distortion(Some(name), 8).unwrap();
        assert_eq!((long.distortion_model, long.lens()), (DistortionModel::RationalPolynomial, first(8)), "{name}");
        assert!(long.to_yaml().contains("distortion_model: rational_polynomial"));
    }
    let fisheye = OpenCvFisheye { k1: 0.01, k2: 0.02, k3: 0.03, k4: 0.04, max_angle: None };
    for name in ["equidistant", "fisheye", "kannala_brandt", "kannala_brandt4", "opencv_fisheye"] {
        let info = distortion(Some(name), 4).unwrap();
        assert_eq!((info.distortion_model, info.lens()), (DistortionModel::Equidistant, fisheye.into()), "{name}");
        // They are lenses of scene files too, but for the first.
        assert_eq!(Lens::from_name(name).unwrap().name() == "opencv_fisheye", name != "equidistant");
    }
    assert_eq!(Lens::from_name("radtan").unwrap(), OpenCv::default().into());
    // Lenses that are no distortion of ROS's.
    for name in ["panorama", "stereographic", "ftheta", "fish_eye", "pinhole"] {
        let error = distortion(Some(name), 4).unwrap_err();
        assert!(matches!(&error, CalibrationError::Model { line: 7, model, .. } if model == name), "{error}");
    }
    let error = distortion(Some("fish_eye"), 4).unwrap_err().to_string();
    assert!(error.contains("there is no distortion model \"fish_eye\"; known are fisheye"), "{error}");
}

/// Root cause: fields that newer files of ROS 2 have were left unread, so that the twin of a camera that delivers a part of the
/// calibrated picture had the size and centre of the whole.
#[test]
fn parts_of_pictures_and_binned_ones_are_refused() {
    let with = |text: &str| {
        parse(&format!(
            "distortion_model: plumb_bob\ndistortion_coefficients: {{ rows: 1, cols: 0, data: [] }}\n{text}"
        ))
    };
    let roi = |x: u32, y: u32, height: u32, width: u32| {
        with(&format!(
            "roi:\n  x_offset: {x}\n  y_offset: {y}\n  height: {height}\n  width: {width}\n  do_rectify: true\n"
        ))
    };
    // All of it, in every way in which that is said (REP 104).
    for good in ["", "binning_x: 0\nbinning_y: 0\n", "binning_x: 1\nbinning_y: 1\n", "roi: {}\n"] {
        assert_eq!(with(good).unwrap().width, 640, "{good:?}");
    }
    for [height, width] in [[0, 0], [480, 640], [0, 640], [480, 0]] {
        assert_eq!(roi(0, 0, height, width).unwrap().height, 480);
    }
    for (error, said) in [
        (with("binning_x: 2\nbinning_y: 2\n"), "wrist.yaml:9: binning_x is 2: several pixels in one are not supported"),
        (with("binning_x: 1\nbinning_y: 4\n"), "wrist.yaml:10: binning_y is 4"),
        (with("binning_x: -1\n"), "wrist.yaml:9: binning_x is \"-1\"; it must be a whole number"),
        (
            with("roi: whole\n"),
            "wrist.yaml:9: roi is \"whole\", not a table of x_offset, y_offset, height, width and do_rectify",
        ),
        (
            roi(320, 200, 200, 300),
            "wrist.yaml:9: roi is 300 x 200 at (320, 200), a part of 640 x 480, which is not supported",
        ),
        (roi(320, 200, 200, 300), "image_width: 300, image_height: 200, cx less by 320, cy less by 200"),
        (roi(0, 0, 479, 640), "roi is 640 x 479 at (0, 0), a part"),
        (roi(1, 0, 0, 0), "roi is 639 x 480 at (1, 0), a part"),
    ] {
        let error = error.unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
}

/// Ends of lines of Windows, a byte order mark, tabs between tokens, comments, lists and tables of both kinds, quotes, numbers of
/// all kinds: the same camera.
#[test]
fn the_same_file_is_written_in_many_ways() {
    let plain = format!(
        "{HEAD}distortion_model: plumb_bob\ndistortion_coefficients: {{ rows: 1, cols: 5, data: [-0.5, 0.25, 1e-3, 2, 0] }}\n"
    );
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
    // Tabs that indent are no YAML, for ROS neither; the place is named.
    let tabs =
        plain.replace("camera_matrix: { rows: 3, cols: 3, data:", "camera_matrix:\n\trows: 3\n\tcols: 3\n\tdata:");
    let error = CameraInfo::parse(&tabs.replace("0, 0, 1] }\nrect", "0, 0, 1]\nrect"), "tabs").unwrap_err();
    assert!(matches!(error, CalibrationError::Yaml { line: 4 | 5, .. }), "{error}");
    // Lines are counted as they are, whatever they end with.
    let error = CameraInfo::parse(&crlf.replace("611.0", "x"), "crlf").unwrap_err().to_string();
    assert!(error.starts_with("crlf:4: camera_matrix.data has \"x\""), "{error}");
}
