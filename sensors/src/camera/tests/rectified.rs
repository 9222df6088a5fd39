//! Calibrations of pairs: against OpenCV's numbers, by the definition of R and P, and there and back.

use super::super::lens::{Equisolid, OpenCv, OpenCvFisheye};
use super::super::{
    CalibrationError, CameraCfg, CameraError, CameraInfo, DistortionModel, Intrinsics, Lens, Optics, PixelIntrinsics,
    Rectification, Renderer, StereoCamera, StereoCameraCfg, StereoOrigin,
};
use super::stage::{cfg, context, pose_of, state};
use crate::error::SensorError;
use crate::sensor::{Sensor, SensorCfg};
use nalgebra::{Matrix3, Matrix3x4, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use scene::Pose;

/// What OpenCV says of a pair: rotation and translation that bring points of the left eye to the right one, and what
/// `stereoRectify` makes of them.
struct Known {
    r: [f64; 9],
    t: [f64; 3],
    r1: [f64; 9],
    r2: [f64; 9],
    /// fx, cx, cy of both P, and P\[0\]\[3\] of the right one.
    p: [f64; 4],
    /// Where `projectPoints` has three points of the left eye's frame in its raw picture and in that of the right one.
    seen: [[f64; 6]; 2],
}

const K: [[f64; 4]; 2] = [[610.2, 611.0, 324.1, 238.7], [598.4, 600.3, 317.6, 243.2]];
const D: [[f64; 5]; 2] = [[-0.31, 0.11, 0.0004, -0.0002, 0.01], [-0.28, 0.09, -0.0003, 0.0005, -0.005]];
const POINTS: [[f64; 3]; 3] = [[0.3, -0.2, 1.5], [-0.4, 0.25, 2.0], [0.1, 0.05, 0.8]];

/// OpenCV 5.0.0, `cv2.stereoRectify(K1, D1, K2, D2, (640, 480), R, T, flags=cv2.CALIB_ZERO_DISPARITY, alpha=-1)` with R of the Rodrigues
/// vectors (0.02, -0.05, 0.03) and (0.2, 0.3, -0.4), and `cv2.projectPoints`.
#[rustfmt::skip]
const KNOWN: [Known; 2] = [
    Known {
        r: [0.9983005382651491, -0.030480845296394242, -0.04966843433742315, 0.02948116192295254, 0.9993502058072629, -0.020737098269863537, 0.05026824436148817, 0.019237573209700987, 0.9985504591085095],
        t: [-0.12, 0.004, -0.007],
        r1: [0.9980002520830198, -0.06252936065713702, 0.009250724189969028, 0.06262605437825745, 0.9979811886518528, -0.010560511826928095, -0.008571706670245812, 0.011118729821559255, 0.9999014449894121],
        r2: [0.9977506676249026, -0.03325835558749459, 0.05820212227811782, 0.032624837663473835, 0.999397989492262, 0.011801634050276387, -0.05855958693069134, -0.009876253461734756, 0.9982350596908858],
        p: [605.65, 293.1974868774414, 240.98855590820312, -72.84184552139313],
        seen: [
            [443.96934568154074, 158.69174735603474, 204.09392454863098, 313.8114769428891, 399.91400142649115, 276.66266531505437],
            [361.54303478508035, 156.6474084495061, 133.61545260898998, 302.3004690943109, 271.64289727297177, 273.46526418260106],
        ],
    },
    Known {
        r: [0.8779917826797221, 0.4102270442977377, 0.24666617456316428, -0.35166309998400436, 0.9023934261437777, -0.24903648038416887, -0.3247514336481421, 0.13190859175670216, 0.9365557269934555],
        t: [-0.3, 0.1, 0.08],
        r1: [0.9949533447904497, 0.0682917151098523, 0.07351247062676572, -0.060797387083372324, 0.9931524766531473, -0.09975888853407555, -0.07982179786330872, 0.09478607368740563, 0.9922923363710892],
        r2: [0.9197090092274485, -0.3065696697424834, -0.24525573579398668, 0.3294312553534259, 0.9424380661904408, 0.057319624837293644, 0.21356588290766634, -0.13351228029363757, 0.9677624112707943],
        p: [605.65, 395.8676652908325, 259.47614765167236, -197.557051390225],
        seen: [
            [443.96934568154074, 158.69174735603474, 204.09392454863098, 313.8114769428891, 399.91400142649115, 276.66266531505437],
            [422.3402539487295, 9.396948776476563, 301.9635756811289, 234.17806287358783, 321.7931190012992, 176.71376030943583],
        ],
    },
];

impl Known {
    /// Its calibrations.
    fn infos(&self) -> [CameraInfo; 2] {
        let [f, cx, cy, tx] = self.p;
        let info = |k: usize, r: &[f64; 9], tx: f64| CameraInfo {
            name: ["left", "right"][k].into(),
            width: 640,
            height: 480,
            camera_matrix: Matrix3::new(K[k][0], 0.0, K[k][2], 0.0, K[k][1], K[k][3], 0.0, 0.0, 1.0),
            distortion_model: DistortionModel::PlumbBob,
            distortion_coefficients: D[k].to_vec(),
            rectification_matrix: Matrix3::from_row_slice(r),
            projection_matrix: Matrix3x4::new(f, 0.0, cx, tx, 0.0, f, cy, 0.0, 0.0, 0.0, 1.0, 0.0),
        };
        [info(0, &self.r1, 0.0), info(1, &self.r2, tx)]
    }

    /// Where the right eye is in the frame of the left one: X_right = R X_left + T the other way round.
    fn left_from_right(&self) -> Pose {
        let rotation =
            UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(Matrix3::from_row_slice(&self.r)));
        Pose::from_parts(Translation3::from(self.t), rotation).inverse()
    }
}

fn rig_of(cfg: &StereoCameraCfg) -> Pose {
    Pose::from_parts(Translation3::from(cfg.left_to_right_pos), cfg.left_to_right_rot)
}

/// How far two poses are apart \[m\] and turned \[rad\].
fn apart(a: &Pose, b: &Pose) -> [f64; 2] {
    let between = a.inverse() * b;
    [between.translation.vector.norm(), between.rotation.angle()]
}

fn pixels(intrinsics: Intrinsics) -> PixelIntrinsics {
    intrinsics.to_pixels(640, 480).unwrap()
}

/// From K, D, R and P to the eyes: they stand as OpenCV was told, and see points where OpenCV projects them to.
#[test]
fn the_twin_of_a_calibrated_pair_sees_what_open_cv_projects() {
    for known in &KNOWN {
        let [left, right] = known.infos();
        let cfg = StereoCameraCfg::of_infos(&left, &right).unwrap();
        let expected = known.left_from_right();
        // Numbers of 16 digits, and OpenCV's own rounding: R's products are of some ulps, and its baseline is the norm of T.
        let [moved, turned] = apart(&rig_of(&cfg), &expected);
        assert!(moved < 1e-14 && turned < 1e-14, "{moved} {turned}");
        assert_eq!((cfg.origin, cfg.camera.renderer), (StereoOrigin::Left, Renderer::FastRayTraced));
        assert_eq!((cfg.camera.width, cfg.camera.height), (640, 480));
        let lens_right = cfg.lens_right.unwrap();
        let eyes = [(cfg.camera.intrinsics, cfg.camera.lens), (cfg.intrinsics_right.unwrap(), lens_right)];
        let [left, right] = eyes.map(|(intrinsics, lens)| Optics::new(lens, pixels(intrinsics)).unwrap());
        for (k, point) in POINTS.into_iter().enumerate() {
            let beside = rig_of(&cfg).inverse() * Point3::from(point);
            for (optics, at, seen) in [(&left, point, known.seen[0]), (&right, beside.into(), known.seen[1])] {
                let found = optics.project(at).unwrap();
                let off = [0, 1].map(|axis| found[axis] - CameraInfo::FIRST_CENTRE - seen[2 * k + axis]);
                assert!(off.iter().all(|off| off.abs() < 1e-10), "{point:?}: {off:?} pixels");
            }
        }
        // The control: a millimetre and a milliradian are seen.
        let moved =
            expected * Pose::from_parts(Translation3::new(1e-3, 0.0, 0.0), UnitQuaternion::new(Vector3::x() * 1e-3));
        assert!(apart(&rig_of(&cfg), &moved).iter().all(|off| *off > 5e-4));
    }
}

/// R of ours are OpenCV's, and so is the baseline; f and the principal points are chosen otherwise, as is said.
#[test]
fn pairs_are_turned_as_open_cv_turns_them() {
    for known in &KNOWN {
        let [left, right] = K.map(|[fx, fy, cx, cy]| PixelIntrinsics { fx, fy, cx, cy });
        let found = Rectification::of(&known.left_from_right(), [left, right]).unwrap();
        for (rotation, expected) in found.rotations.iter().zip([&known.r1, &known.r2]) {
            let off = (rotation - Matrix3::from_row_slice(expected)).amax();
            // OpenCV has the last angle by an arc cosine, which is some ulps over that angle: 0.03 rad or more here.
            assert!(off < 1e-14, "{off}");
        }
        let baseline = |p: f64, f: f64| -p / f;
        let p = &found.projections[1];
        assert!((baseline(p[(0, 3)], p[(0, 0)]) - baseline(known.p[3], known.p[0])).abs() < 1e-15);
        assert_eq!((p[(0, 0)], p[(1, 1)]), (600.3, 600.3), "the smaller fy");
    }
}

/// A point of a rectified picture \[pixels\].
fn projected(p: &Matrix3x4<f64>, point: Vector3<f64>) -> [f64; 2] {
    let at = p * point.push(1.0);
    [at.x / at.z, at.y / at.z]
}

fn built(cfg: &StereoCameraCfg) -> StereoCamera {
    let mut stereo = cfg.build(&context(2)).unwrap();
    stereo.reset(&[0, 1], &state(&[0, 0])).unwrap();
    stereo
}

/// Pairs of eyes that are not parallel, stand askew, or have other lenses.
fn pairs() -> Vec<StereoCameraCfg> {
    let other = |fx, fy, cx, cy| Some(Intrinsics::Pixels { fx, fy, cx, cy });
    let turned = UnitQuaternion::from_euler_angles;
    let barrel = OpenCv { k1: -0.1, k2: 0.01, p1: 1e-3, p2: -2e-3, ..OpenCv::default() };
    let fish = OpenCvFisheye { k1: 0.02, k2: -0.003, ..OpenCvFisheye::default() };
    let pair = |pos, rot, intrinsics_right, lens: Lens, lens_right| StereoCameraCfg {
        camera: CameraCfg { lens, renderer: Renderer::FastRayTraced, ..cfg() },
        left_to_right_pos: pos,
        left_to_right_rot: rot,
        intrinsics_right,
        lens_right,
        origin: StereoOrigin::Left,
        ..StereoCameraCfg::default()
    };
    vec![
        pair([0.1, 0.0, 0.0], turned(0.0, -0.2, 0.0), None, Lens::default(), None),
        pair(
            [0.12, 0.01, -0.02],
            turned(0.03, -0.1, 0.05),
            other(44.0, 50.0, 20.0, 15.0),
            barrel.into(),
            Some(fish.into()),
        ),
        pair([0.3, -0.2, 0.1], turned(-0.2, 0.3, 0.4), other(41.0, 52.0, 23.0, 18.5), fish.into(), Some(barrel.into())),
        // Parallel, with another focal length.
        pair([0.06, 0.0, 0.0], UnitQuaternion::identity(), other(40.5, 52.0, 22.25, 17.5), Lens::default(), None),
        // Above each other, almost: pictures lie on their side.
        pair([0.01, 0.2, 0.0], turned(0.05, 0.0, 0.0), None, barrel.into(), None),
    ]
}

/// By what R and P mean, with the eyes where they say they stand: a point is in the same row of both rectified pictures, and f b / z
/// farther left in the right one; and the way there by raw pixels, whose distortion is undone, is the same.
#[test]
fn rows_of_rectified_pictures_show_the_same() {
    for cfg in pairs() {
        let stereo = built(&cfg);
        let eyes = [stereo.left(), stereo.right()];
        let infos = stereo.camera_info("head", 1).unwrap();
        let ros = CameraInfo::FIRST_CENTRE;
        let f = infos[0].projection_matrix[(0, 0)];
        let baseline = Vector3::from(cfg.left_to_right_pos).norm();
        let (mut by_raw, mut skew, mut middle) = (0, 0.0f64, [0.0; 2]);
        for point in [[0.1, 0.0, 1.0], [-0.2, 0.1, 0.8], [0.05, -0.1, 3.0], [0.6, 0.4, 2.0], [-1.0, -0.5, 6.0]] {
            let world = pose_of(eyes[0], 1) * Point3::from(point);
            // Of each eye: where it is in its rectified frame.
            let rectified =
                [0, 1].map(|k| infos[k].rectification_matrix * (pose_of(eyes[k], 1).inverse() * world).coords);
            let z = rectified[0].z;
            assert!(z > 0.1 && (rectified[1] - rectified[0] + Vector3::x() * baseline).norm() < 1e-13);
            // P of both is of points of the left eye.
            let [left, right] = [0, 1].map(|k| projected(&infos[k].projection_matrix, rectified[0]));
            let [shift, drop] = [left[0] - right[0] - f * baseline / z, left[1] - right[1]];
            assert!(shift.abs() < 1e-10 && drop.abs() < 1e-10, "{shift} {drop}");
            for (k, expected) in [left, right].into_iter().enumerate() {
                let optics = eyes[k].optics(1).unwrap();
                let raw = optics.project((pose_of(eyes[k], 1).inverse() * world).coords.into());
                let Some(ray) = raw.and_then(|raw| optics.unproject(raw)) else { continue };
                let mut own = infos[k].projection_matrix;
                // What lies in the fourth column is in the eye's own place already.
                own.set_column(3, &Vector3::zeros());
                let found = projected(&own, infos[k].rectification_matrix * Vector3::from(ray));
                let off = [found[0] - expected[0], found[1] - expected[1]];
                // Distortions are undone to 1e-12 of the normalised picture or so.
                assert!(off.iter().all(|off| off.abs() < 1e-8), "{off:?}");
                by_raw += 1;
                // The control: raw rows are not the same.
                skew = skew.max((raw.unwrap()[1] - ros - expected[1]).abs());
            }
        }
        assert!(by_raw >= 8, "{by_raw}");
        let straight = cfg.left_to_right_rot == UnitQuaternion::identity();
        assert!(straight || skew > 0.5, "{skew}");
        // Common principal points, so that what is far away has no disparity.
        let [left, right] = [0, 1].map(|k| infos[k].projection_matrix.fixed_columns::<3>(0).into_owned());
        assert_eq!(left, right);
        // What raw pictures have at their principal points is there on the mean of both.
        for (k, info) in infos.iter().enumerate() {
            let ahead = projected(&info.projection_matrix, info.rectification_matrix * Vector3::z() * 1e9);
            let own = [info.camera_matrix[(0, 2)], info.camera_matrix[(1, 2)]];
            (0..2).for_each(|axis| middle[axis] += ahead[axis] - own[axis]);
            assert!((info.rectification_matrix.determinant() - 1.0).abs() < 1e-14, "{k}");
        }
        assert!(middle.iter().all(|sum| sum.abs() < 1e-6), "{middle:?}");
        assert_eq!(infos.each_ref().map(|info| info.name.as_str()), ["head/left", "head/right"]);
    }
}

/// The pair of the calibrations of a pair is that pair, through the text of files too.
#[test]
fn a_pair_comes_back_from_its_calibrations() {
    for cfg in pairs() {
        let infos = built(&cfg).camera_info("head", 0).unwrap();
        let read = infos.each_ref().map(|info| CameraInfo::parse(&info.to_yaml(), &info.name).unwrap());
        assert_eq!(read, infos);
        let again = StereoCameraCfg::of_infos(&read[0], &read[1]).unwrap();
        let [moved, turned] = apart(&rig_of(&again), &rig_of(&cfg));
        // Some ulps of numbers below 1.
        assert!(moved < 1e-14 && turned < 1e-14, "{moved} {turned}");
        let close = |a: Intrinsics, b: Intrinsics| {
            let [a, b] = [a, b].map(pixels);
            // Half a pixel there and back.
            let off = [a.fx - b.fx, a.fy - b.fy, a.cx - b.cx, a.cy - b.cy];
            off.iter().all(|off| off.abs() < 1e-14)
        };
        assert!(close(again.camera.intrinsics, cfg.camera.intrinsics));
        assert!(close(again.intrinsics_right.unwrap(), cfg.intrinsics_right.unwrap_or(cfg.camera.intrinsics)));
        let same = |a: Lens, b: Lens| a == b || a.is_pinhole() && b.is_pinhole();
        assert!(same(again.camera.lens, cfg.camera.lens));
        assert!(same(again.lens_right.unwrap(), cfg.lens_right.unwrap_or(cfg.camera.lens)));
        // It can be built, and says the same of itself.
        let own = CameraCfg { channels: cfg.camera.channels, ..again.camera.clone() };
        let said = built(&StereoCameraCfg { camera: own, ..again }).camera_info("head", 0).unwrap();
        for (said, info) in said.iter().zip(&infos) {
            assert!((said.rectification_matrix - info.rectification_matrix).amax() < 1e-14);
            assert!((said.projection_matrix - info.projection_matrix).amax() < 1e-11);
        }
    }
}

#[test]
fn what_cannot_be_rectified_is_said() {
    let turned = UnitQuaternion::from_euler_angles;
    for (left_to_right_pos, left_to_right_rot, expected) in [
        (
            [-0.1, 0.0, 0.0],
            turned(0.0, 0.0, 0.0),
            "how far the right eye is to the right of the left one [m] is -0.1, it must be positive",
        ),
        ([0.0; 3], turned(0.0, 0.0, 0.0), "of the left one [m] is 0, it must be positive"),
        (
            [0.01, 0.0, 0.2],
            turned(0.0, 0.0, 0.0),
            "the angle by which the left eye turns to be rectified [rad] is 1.52",
        ),
        ([0.3, 0.0, 0.0], turned(0.0, 3.0, 0.0), "it must be at most 1.396 (80 degrees)"),
    ] {
        let stereo =
            built(&StereoCameraCfg { camera: cfg(), left_to_right_pos, left_to_right_rot, ..Default::default() });
        let error = stereo.camera_info("head", 0).unwrap_err();
        assert!(matches!(error, SensorError::Camera(CameraError::NotRectifiable { .. })), "{error}");
        let said = error.to_string();
        assert!(
            said.starts_with("the pictures of these eyes cannot be rectified: ") && said.contains(expected),
            "{said}"
        );
        // Nobody asked for a disparity; who does is told of that.
        assert!(!said.contains("disparity") && stereo.disparity().unwrap_err().to_string().contains("disparity"));
    }
    // What ROS has no words for is said as of a camera alone, whatever the eyes' places.
    let camera = CameraCfg { lens: Equisolid::default().into(), renderer: Renderer::FastRayTraced, ..cfg() };
    let stereo = built(&StereoCameraCfg { camera, ..pairs()[2].clone() });
    let error = stereo.camera_info("head", 0).unwrap_err();
    assert!(matches!(error, SensorError::Calibration(CalibrationError::Lens { lens: "equisolid", .. })), "{error}");
    // How they are rectified is known all the same.
    assert!(stereo.rectification(1).is_ok() && stereo.rectification(2).is_err());
}

#[test]
fn calibrations_of_no_pair_are_refused() {
    type Change = fn(&mut CameraInfo, &mut CameraInfo);
    let changes: [(Change, &str); 11] = [
        (|_, r| r.width = 320, "the size of the right picture is 320 x 480; it must be the left one's, 640 x 480"),
        (|_, r| r.projection_matrix[(0, 3)] = 0.0, "P[0][3] of the right eye is 0; it must be negative"),
        (|l, r| std::mem::swap(l, r), "P[0][3] of the right eye is 0; it must be negative"),
        (|_, r| r.projection_matrix[(0, 3)] = 72.8, "P[0][3] of the right eye is 72.8"),
        (|_, r| r.projection_matrix[(0, 3)] = f64::NAN, "P[0][3] of the right eye is NaN"),
        (|l, _| l.projection_matrix[(0, 3)] = -1.0, "P[0][3] of the left eye is -1; it must be 0"),
        (|_, r| r.projection_matrix[(1, 3)] = 5.0, "P[1][3] of the right eye is 5; it must be 0"),
        (|_, r| r.projection_matrix[(0, 0)] = 0.0, "P[0][0] of the right eye is 0; it must be a focal length"),
        (
            |_, r| r.projection_matrix[(1, 1)] = 605.7,
            "P[1][1] of the right eye is 605.7; it must be the left eye's, 605.65",
        ),
        (|_, r| r.projection_matrix[(1, 2)] += 1.0, "P[1][2] of the right eye is 241.98"),
        (|l, _| l.rectification_matrix *= 1.1, "R of the left eye is no rotation: its determinant is 1.3310"),
    ];
    for (change, expected) in changes {
        let [mut left, mut right] = KNOWN[0].infos();
        change(&mut left, &mut right);
        let error = StereoCameraCfg::of_infos(&left, &right).unwrap_err();
        assert!(matches!(error, CameraError::NotAPair { .. }), "{error}");
        let said = error.to_string();
        assert!(
            said.starts_with("these are no calibrations of a left and a right eye: ") && said.contains(expected),
            "{said}"
        );
    }
    // Files of few digits are read: R is the rotation that is nearest.
    let [left, mut right] = KNOWN[0].infos();
    right.rectification_matrix.iter_mut().for_each(|x| *x = (*x * 1e4).round() / 1e4);
    let cfg = StereoCameraCfg::of_infos(&left, &right).unwrap();
    let [moved, turned] = apart(&rig_of(&cfg), &KNOWN[0].left_from_right());
    assert!(moved < 1e-14 && turned > 1e-6 && turned < 1e-4, "{moved} {turned}");
}
