//! Calibrations of a pair: the pair of two of them, and those of a pair.

use super::cfg::{StereoCameraCfg, StereoOrigin};
use super::rectify::Rectification;
use super::sensor::StereoCamera;
use crate::camera::calibration::CameraInfo;
use crate::camera::cfg::CameraCfg;
use crate::camera::error::CameraError;
use crate::error::SensorError;
use kinetoscope_render::Renderer;
use nalgebra::{Matrix3, Matrix3x4, Rotation3, UnitQuaternion, Vector3};

/// How far R may be from a rotation: files have six digits or more.
const ROTATION: f64 = 1e-3;
/// How far numbers of both P may be apart that are the same in a rectified pair \[pixels\]: files round both alike.
const ALIKE: f64 = 1e-3;

impl StereoCameraCfg {
    /// The simulated twin of a real, calibrated pair: raw pictures of both eyes, as their drivers publish them.
    ///
    /// Sizes, intrinsics and lenses are those of K and D, as [`CameraInfo::apply_to`] has them. Where the right eye is follows from
    /// what rectifies the pair: with R of each eye, and the baseline b = -P\[0\]\[3\] / P\[0\]\[0\] of the right one, a point at X of its
    /// optical frame is at R_leftᵀ (R_right X + (b, 0, 0)) of the left one's. Extrinsics place the left eye
    /// ([`StereoOrigin::Left`]). The renderer is [`Renderer::FastRayTraced`] where an eye has a lens, else the default one; all
    /// else is as by default.
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
    /// // Of files: `CameraInfo::read("left.yaml".as_ref())?`.
    /// let [left, right] = [CameraInfo::parse(&left, "left.yaml")?, CameraInfo::parse(&right, "right.yaml")?];
    /// let mut cfg = StereoCameraCfg::of_infos(&left, &right)?;
    /// cfg.camera.update_period = 1.0 / 30.0;
    /// // P of the right eye has -34.8 = -580 b.
    /// assert!((cfg.left_to_right_pos[0] - 0.06).abs() < 1e-12);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    ///
    /// [`CameraError::NotAPair`]: sizes that differ, R that is no rotation, P of the right eye whose fourth column does not say that
    /// it is to the right of the left one, P of the left eye whose fourth column is not 0 (are they exchanged?), and focal lengths or
    /// rows of principal points of both P that are not the same.
    pub fn of_infos(left: &CameraInfo, right: &CameraInfo) -> Result<Self, CameraError> {
        if (left.width, left.height) != (right.width, right.height) {
            let size = |info: &CameraInfo| format!("{} x {}", info.width, info.height);
            let expected = format!("the left one's, {}", size(left));
            return Err(CameraError::NotAPair { what: "the size of the right picture", value: size(right), expected });
        }
        let baseline = baseline(&left.projection_matrix, &right.projection_matrix)?;
        let from_left = rotation("R of the left eye", &left.rectification_matrix)?;
        let from_right = rotation("R of the right eye", &right.rectification_matrix)?;
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

/// How far the right eye is to the right \[m\], by P of both.
fn baseline(left: &Matrix3x4<f64>, right: &Matrix3x4<f64>) -> Result<f64, CameraError> {
    let wrong =
        |what, value: f64, expected: String| Err(CameraError::NotAPair { what, value: value.to_string(), expected });
    let focal = right[(0, 0)];
    if !(focal > 0.0 && focal.is_finite()) {
        return wrong("P[0][0] of the right eye", focal, "a focal length, positive and finite".into());
    }
    if !(right[(0, 3)] < 0.0 && right[(0, 3)].is_finite()) {
        let expected =
            "negative, the focal length times minus the distance of the eyes, as of two that were calibrated together";
        return wrong("P[0][3] of the right eye", right[(0, 3)], expected.into());
    }
    let zero = [
        ("P[0][3] of the left eye", left[(0, 3)]),
        ("P[1][3] of the left eye", left[(1, 3)]),
        ("P[2][3] of the left eye", left[(2, 3)]),
        ("P[1][3] of the right eye", right[(1, 3)]),
        ("P[2][3] of the right eye", right[(2, 3)]),
    ];
    if let Some((what, value)) = zero.into_iter().find(|(_, value)| *value != 0.0) {
        return wrong(what, value, "0".into());
    }
    let alike = [
        ("P[0][0] of the right eye", (0, 0)),
        ("P[1][1] of the right eye", (1, 1)),
        ("P[1][2] of the right eye", (1, 2)),
    ];
    for (what, at) in alike {
        let same = (left[at] - right[at]).abs() <= ALIKE;
        if !same {
            return wrong(what, right[at], format!("the left eye's, {}", left[at]));
        }
    }
    Ok(-right[(0, 3)] / focal)
}

/// The rotation that is nearest to a matrix.
fn rotation(what: &'static str, matrix: &Matrix3<f64>) -> Result<UnitQuaternion<f64>, CameraError> {
    let off = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    let nearest = matrix.svd(true, true);
    match (nearest.u, nearest.v_t) {
        // The product of the outer factors, which is orthogonal.
        (Some(u), Some(v_t)) if off <= ROTATION && matrix.determinant() > 0.0 => {
            Ok(UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(u * v_t)))
        }
        _ => {
            let value =
                format!("no rotation: its determinant is {:.4}, its rows are {off:.4} off", matrix.determinant());
            Err(CameraError::NotAPair { what, value, expected: "one".into() })
        }
    }
}

impl StereoCamera {
    /// The calibrations of both eyes in environment `env`, left and right, called `name` and `/left` or `/right`: K and D of raw
    /// pictures, and R and P of what [rectifies](Rectification) them, so that ROS's nodes read the pair as one that was
    /// calibrated. [`StereoCameraCfg::of_infos`] makes the pair of them again. Of eyes that are parallel and side by side, with the
    /// same fx, fy and cy, rectified pictures have the principal points and focal lengths of raw ones.
    ///
    /// P brings points of the rectified frame of the *left* eye into rectified pictures: that of the right eye is
    /// `[fx, 0, cx, -fx b; 0, fy, cy, 0; 0, 0, 1, 0]` with the distance b of the eyes \[m\]. Source: ROS, message
    /// `sensor_msgs/CameraInfo`.
    ///
    /// # Errors
    ///
    /// As [`Camera::camera_info`](crate::camera::Camera::camera_info), and [`CameraError::NotRectifiable`].
    pub fn camera_info(&self, name: &str, env: usize) -> Result<[CameraInfo; 2], SensorError> {
        let left = self.left().camera_info(&format!("{name}/left"), env)?;
        let right = self.right().camera_info(&format!("{name}/right"), env)?;
        let Rectification { rotations, projections } = self.rectification(env)?;
        let mut infos = [left, right];
        for ((info, rotation), projection) in infos.iter_mut().zip(rotations).zip(projections) {
            (info.rectification_matrix, info.projection_matrix) = (rotation, projection);
            (0..2).for_each(|axis| info.projection_matrix[(axis, 2)] -= CameraInfo::FIRST_CENTRE);
        }
        Ok(infos)
    }
}
