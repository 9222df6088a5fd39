//! Calibrations of real cameras of each model, through OpenCV.

use super::super::{CameraInfo, DistortionModel, LensRays, Optics};

/// A camera, and numbers of OpenCV 5.0 from the Python wheel for it. K and D are those of the file; pixels are OpenCV's, whose first
/// one has its centre at (0, 0).
struct Judged {
    file: &'static str,
    text: &'static str,
    model: DistortionModel,
    /// Corners, middles of the edges and the middle, and the points at z = 1 that are seen there:
    /// `cv2.undistortPoints(p, K, D, None, None, None, (3, 100000, 1e-16))`, of the fisheye
    /// `cv2.fisheye.undistortPoints(p, K, D, criteria=(3, 1000, 1e-13))`.
    undistorted: [([f64; 2], [f64; 2]); 9],
    /// Points and where they are seen: `cv2.projectPoints(p, zeros(3), zeros(3), K, D)`, or `cv2.fisheye.projectPoints`.
    projected: &'static [([f64; 3], [f64; 2])],
}

const ALL: [Judged; 4] = [
    Judged {
        file: "plumb_bob.yaml",
        text: include_str!("../../../tests/data/calibrations/plumb_bob.yaml"),
        model: DistortionModel::PlumbBob,
        undistorted: [
            ([0.0, 0.0], [-0.8517981680415618, -0.6333754335002661]),
            ([639.0, 0.0], [0.8204902846072349, -0.6319847509449833]),
            ([0.0, 479.0], [-0.851649057595375, 0.6228324023421907]),
            ([639.0, 479.0], [0.8203719424746683, 0.6214803702637383]),
            ([320.0, 0.0], [-0.01288464285277234, -0.633912096624838]),
            ([320.0, 479.0], [-0.012867315161672528, 0.6233238080274156]),
            ([0.0, 240.0], [-0.8543905977785077, -0.0038764456557415727]),
            ([639.0, 240.0], [0.8233095122382307, -0.003860262477647673]),
            ([320.0, 240.0], [-0.01238821257262244, -0.003730058274257835]),
        ],
        projected: &[
            ([0.31, -0.22, 1.0], [443.89556668400644, 157.0463002526558]),
            ([-0.5, 0.3, 0.9], [113.25667099164474, 368.31153320564476]),
            ([-0.1, -0.4, 0.8], [277.082125177935, 50.51580930747687]),
            ([0.45, 0.35, 1.1], [481.42576082272694, 363.07767974948746]),
        ],
    },
    Judged {
        file: "rational_polynomial.yaml",
        text: include_str!("../../../tests/data/calibrations/rational_polynomial.yaml"),
        model: DistortionModel::RationalPolynomial,
        undistorted: [
            ([0.0, 0.0], [-3.445022199506047, -2.2816294295780875]),
            ([2879.0, 0.0], [3.894998595184851, -2.524458603018761]),
            ([0.0, 1859.0], [-3.270991978338613, 2.1048367006055098]),
            ([2879.0, 1859.0], [3.722469310992609, 2.3450479291352266]),
            ([1440.0, 0.0], [0.012538188638195663, -0.760843694303984]),
            ([1440.0, 1859.0], [0.012380855721688282, 0.729134987729269]),
            ([0.0, 930.0], [-1.6864298380887237, -0.015823464075219944]),
            ([2879.0, 930.0], [1.7993851363791662, -0.016514937953030922]),
            ([1440.0, 930.0], [0.010393834096240173, -0.00900782083265769]),
        ],
        projected: &[
            ([0.31, -0.22, 1.0], [1863.4235791283213, 632.0452732998933]),
            ([-0.5, 0.3, 0.9], [704.2457366529134, 1375.415626956681]),
            ([-0.1, -0.4, 0.8], [1254.5581435327445, 264.11683459982896]),
            ([0.45, 0.35, 1.1], [1979.9082587104585, 1375.3187048108352]),
        ],
    },
    Judged {
        file: "equidistant.yaml",
        text: include_str!("../../../tests/data/calibrations/equidistant.yaml"),
        model: DistortionModel::Equidistant,
        undistorted: [
            ([0.0, 0.0], [-1.9417459016370489, -2.2696840051308134]),
            ([815.0, 0.0], [2.1799861477524543, -2.414066857258121]),
            ([0.0, 959.0], [-2.1593870344593435, 2.6989622209299324]),
            ([815.0, 959.0], [2.4271636729637924, 2.87400777894461]),
            ([408.0, 0.0], [0.03488506866521905, -1.4044284645604728]),
            ([408.0, 959.0], [0.037867646934837906, 1.630127884084666]),
            ([0.0, 480.0], [-1.0500801593284212, 0.043845120137071945]),
            ([815.0, 480.0], [1.1532291882632681, 0.04561807944304428]),
            ([408.0, 480.0], [0.023138599517878302, 0.0332753721988603]),
        ],
        projected: &[
            ([0.31, -0.22, 1.0], [543.435781690153, 359.1609836033628]),
            ([-2.5, 0.3, 0.9], [-197.79393033022393, 534.758243486828]),
            ([0.45, 0.35, 1.1], [583.2622982034587, 608.7122983885422]),
        ],
    },
    Judged {
        file: "oak_d.yaml",
        text: include_str!("../../../tests/data/calibrations/oak_d.yaml"),
        model: DistortionModel::RationalPolynomial,
        undistorted: [
            ([0.0, 0.0], [-0.6446634244191253, -0.6388162554494572]),
            ([249.0, 0.0], [0.6171245557426905, -0.6368813185554578]),
            ([0.0, 249.0], [-0.6441694663317885, 0.6243450943840562]),
            ([249.0, 249.0], [0.6166840909617501, 0.6224636506457204]),
            ([125.0, 0.0], [-0.00974577961844731, -0.629983399472033]),
            ([125.0, 249.0], [-0.009725555733113312, 0.6161543487458303]),
            ([0.0, 125.0], [-0.6359093872657917, -0.004328249434697744]),
            ([249.0, 125.0], [0.6101477346580564, -0.0043128827782925195]),
            ([125.0, 125.0], [-0.009501925643128885, -0.00431481771503715]),
        ],
        projected: &[
            ([0.31, -0.22, 1.0], [188.63760571715335, 82.03720391513797]),
            ([-0.5, 0.3, 0.9], [15.890985877836513, 192.501098291628]),
            ([-0.1, -0.4, 0.8], [101.94066306464208, 25.938593579396198]),
            ([0.45, 0.35, 1.1], [208.7894966563265, 189.533935704226]),
        ],
    },
];

/// To the last digits that OpenCV's iterations give.
#[test]
fn real_cameras_see_in_their_pixels_what_opencv_says() {
    for Judged { file, text, model, undistorted, projected } in ALL {
        let info = CameraInfo::parse(text, file).unwrap();
        assert_eq!(info.distortion_model, model, "{file}");
        let pixels = info.intrinsics().to_pixels(info.width, info.height).unwrap();
        let optics = Optics::new(info.lens(), pixels).unwrap();
        for ([u, v], [x, y]) in undistorted {
            let [a, b, c] = optics.unproject([u + 0.5, v + 0.5]).unwrap();
            // OpenCV's own way back is 3e-12 pixels off or less, which the slope makes ten times as much at 77 degrees.
            assert!((a / c - x).hypot(b / c - y) < 1e-13 * (1.0 + x * x + y * y), "{file} ({u}, {v}): {a} {b} {c}");
            let [back_u, back_v] = optics.project([x, y, 1.0]).unwrap();
            assert!((back_u - 0.5 - u).hypot(back_v - 0.5 - v) < 1e-11, "{file} ({u}, {v}): {back_u} {back_v}");
        }
        for (point, [u, v]) in projected {
            let [a, b] = optics.project(*point).unwrap();
            assert!((a - 0.5 - u).hypot(b - 0.5 - v) < 1e-11, "{file} {point:?}: {a} {b}");
        }
        // The whole picture is seen.
        let rays = LensRays::new(&optics, [info.width, info.height], 1).unwrap();
        let corner = rays.direction(0, [info.width - 1, info.height - 1]);
        assert_ne!(corner, [0.0; 3], "{file}");
        // A control: half a pixel beside, and without the lens.
        let ([u, v], [x, _]) = undistorted[0];
        let [a, _, c] = optics.unproject([u, v]).unwrap();
        assert!((a / c - x).abs() > 5e-4, "{file}");
        assert!(((u + 0.5 - pixels.cx) / pixels.fx - x).abs() > 5e-4, "{file}");
    }
}
