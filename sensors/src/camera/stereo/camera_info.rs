//! Conversion between stereo cameras and pairs of ROS calibrations.

use super::cfg::{StereoCameraCfg, StereoOrigin};
use super::rectify::Rectification;
use super::sensor::StereoCamera;
use crate::camera::calibration::CameraInfo;
use crate::camera::cfg::CameraCfg;
use crate::camera::error::CameraError;
use crate::error::SensorError;
use kinetoscope_render::Renderer;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, UnitQuaternion, Vector3};

/// Tolerance of R from a rotation: files have six digits or more.
const ROTATION_TOLERANCE: f64 = 1e-3;
/// Tolerance of numbers that are equal in both P of a rectified stereo pair \[pixels\]: files round both the same way.
const PIXEL_TOLERANCE: f64 = 1e-3;

impl StereoCameraCfg {
    /// Creates the configuration of a stereo camera from two calibrations: raw images of both cameras, as their drivers
    /// publish them.
    ///
    /// Sizes, intrinsics and lenses are those of K and D, as in [`CameraInfo::apply_to`]. The pose of the right camera
    /// follows from the rectification. The baseline is b = -P\[0\]\[3\] / P\[0\]\[0\] of the right camera. With R of
    /// each camera, a point X of the right optical frame is at `R_leftᵀ (R_right X + (b, 0, 0))` in the left one.
    ///
    /// The extrinsics place the left camera ([`StereoOrigin::Left`]). The renderer is [`Renderer::FastRayTraced`] if a
    /// camera has a lens other than a pinhole, else the default one. All other fields have their defaults.
    ///
    /// Source: ROS, message `sensor_msgs/CameraInfo`.
    ///
    /// ```
    /// use kinetoscope_sensors::camera::{CameraInfo, StereoCameraCfg};
    ///
    /// # let eye = |name: &str, cx: f64, tx: f64| format!("
    /// # image_width: 640
    /// # image_height: 480
    /// # camera_name: {name}
    /// # camera_matrix: {{ rows: 3, cols: 3, data: [610.2, 0, {cx}, 0, 611.0, 238.7, 0, 0, 1] }}
    /// # distortion_model: plumb_bob
    /// # distortion_coefficients: {{ rows: 1, cols: 5, data: [-0.31, 0.11, 0.0004, -0.0002, 0] }}
    /// # rectification_matrix: {{ rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1] }}
    /// # projection_matrix: {{ rows: 3, cols: 4, data: [580.0, 0, 323.0, {tx}, 0, 580.0, 238.0, 0, 0, 0, 1, 0] }}
    /// # ");
    /// # let (left, right) = (eye("left", 324.1, 0.0), eye("right", 319.8, -34.8));
    /// // From files: `CameraInfo::read("left.yaml".as_ref())?`.
    /// let [left, right] = [CameraInfo::parse(&left, "left.yaml")?, CameraInfo::parse(&right, "right.yaml")?];
    /// let mut cfg = StereoCameraCfg::from_camera_infos(&left, &right)?;
    /// cfg.camera.update_period = 1.0 / 30.0;
    /// // P of the right camera has -34.8 = -580 b.
    /// assert!((cfg.left_to_right_pos[0] - 0.06).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`CameraError::NotAStereoPair`] for
    ///
    /// - sizes that differ,
    /// - R that is not a rotation,
    /// - P of the right camera whose fourth column does not place it to the right of the left camera,
    /// - P of the left camera whose fourth column is not 0 (maybe the files are swapped),
    /// - focal lengths or vertical principal points of both P that differ.
    pub fn from_camera_infos(left: &CameraInfo, right: &CameraInfo) -> Result<Self, CameraError> {
        if (left.width, left.height) != (right.width, right.height) {
            let size = |info: &CameraInfo| format!("{} x {}", info.width, info.height);
            let expected = format!("{}, as of the left camera", size(left));
            return Err(CameraError::NotAStereoPair {
                what: "the size of the right image",
                value: size(right),
                expected,
            });
        }
        let baseline = baseline(&left.projection_matrix, &right.projection_matrix)?;
        let from_left = nearest_rotation("R of the left camera", &left.rectification_matrix)?;
        let from_right = nearest_rotation("R of the right camera", &right.rectification_matrix)?;
        let mut camera = CameraCfg::default();
        left.apply_to(&mut camera);
        let lens_right = right.lens();
        if !(camera.lens.is_pinhole() && lens_right.is_pinhole()) {
            camera.renderer = Renderer::FastRayTraced;
        }
        let to_left = from_left.inverse();
        Ok(Self {
            camera,
            intrinsics_right: Some(right.intrinsics()),
            lens_right: Some(lens_right),
            left_to_right_pos: (to_left * Vector3::new(baseline, 0.0, 0.0)).into(),
            left_to_right_rot: to_left * from_right,
            origin: StereoOrigin::Left,
            ..Self::default()
        })
    }
}

/// Returns the baseline \[m\], from P of both cameras; an error if they are not those of a rectified pair.
fn baseline(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Result<f64, CameraError> {
    let wrong = |what, value: f64, expected: String| {
        Err(CameraError::NotAStereoPair { what, value: value.to_string(), expected })
    };
    let focal = right[(0, 0)];
    if !(focal > 0.0 && focal.is_finite()) {
        return wrong("P[0][0] of the right camera", focal, "a focal length, positive and finite".into());
    }
    if !(right[(0, 3)] < 0.0 && right[(0, 3)].is_finite()) {
        let expected = "negative: minus the focal length times the baseline, as in a stereo calibration";
        return wrong("P[0][3] of the right camera", right[(0, 3)], expected.into());
    }
    let zero = [
        ("P[0][3] of the left camera", left[(0, 3)]),
        ("P[1][3] of the left camera", left[(1, 3)]),
        ("P[2][3] of the left camera", left[(2, 3)]),
        ("P[1][3] of the right camera", right[(1, 3)]),
        ("P[2][3] of the right camera", right[(2, 3)]),
    ];
    if let Some((what, value)) = zero.into_iter().find(|(_, value)| *value != 0.0) {
        return wrong(what, value, "0".into());
    }
    let alike = [
        ("P[0][0] of the right camera", (0, 0)),
        ("P[1][1] of the right camera", (1, 1)),
        ("P[1][2] of the right camera", (1, 2)),
    ];
    for (what, at) in alike {
        let same = (left[at] - right[at]).abs() <= PIXEL_TOLERANCE;
        if !same {
            return wrong(what, right[at], format!("{}, as of the left camera", left[at]));
        }
    }
    Ok(-right[(0, 3)] / focal)
}

/// Returns the rotation nearest to a matrix M. An error if an element of M Mᵀ is off the identity by more than
/// [`ROTATION_TOLERANCE`], or the determinant is not positive; `what` names the matrix in it.
fn nearest_rotation(what: &'static str, matrix: &Matrix3<f64>) -> Result<UnitQuaternion<f64>, CameraError> {
    let off = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    let nearest = matrix.svd(true, true);
    match (nearest.u, nearest.v_t) {
        // The product of the outer factors is orthogonal.
        (Some(u), Some(v_t)) if off <= ROTATION_TOLERANCE && matrix.determinant() > 0.0 => {
            Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_t)))
        }
        _ => {
            let determinant = matrix.determinant();
            let value = format!("a matrix with determinant {determinant:.4}, whose rows are {off:.4} off orthonormal");
            Err(CameraError::NotAStereoPair { what, value, expected: "a rotation".into() })
        }
    }
}

impl StereoCamera {
    /// Returns the calibrations of both cameras in environment `env`, named `name` with `/left` or `/right` added: K
    /// and D of raw images, and R and P of the [rectification](Rectification). ROS nodes read them as a calibrated
    /// stereo pair. [`StereoCameraCfg::from_camera_infos`] is the inverse. Rectified images keep the principal points
    /// and focal lengths of raw images if the cameras are parallel and side by side, with the same fx, fy and cy.
    ///
    /// P projects points of the rectified *left* frame to rectified images. For the right camera it is
    /// `[fx, 0, cx, -fx b; 0, fy, cy, 0; 0, 0, 1, 0]` with the baseline b \[m\]. Source: ROS, message
    /// `sensor_msgs/CameraInfo`.
    ///
    /// # Errors
    ///
    /// Same as [`Camera::camera_info`](crate::camera::Camera::camera_info), and [`CameraError::NotRectifiable`].
    pub fn camera_info(&self, name: &str, env: usize) -> Result<[CameraInfo; 2], SensorError> {
        let left = self.left().camera_info(&format!("{name}/left"), env)?;
        let right = self.right().camera_info(&format!("{name}/right"), env)?;
        let Rectification { rotations, projections } = self.rectification(env)?;
        let mut infos = [left, right];
        for ((info, rotation), projection) in infos.iter_mut().zip(rotations).zip(projections) {
            (info.rectification_matrix, info.projection_matrix) = (rotation, projection);
            (0..2).for_each(|axis| info.projection_matrix[(axis, 2)] -= CameraInfo::FIRST_PIXEL_CENTER);
        }
        Ok(infos)
    }
}
