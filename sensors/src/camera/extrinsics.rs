//! Camera extrinsics: pose, parent body and axis convention.

use super::error::CameraError;
use kinetoscope_scene::pose::to_row;
use kinetoscope_scene::{Pose, PoseF32};
use nalgebra::{Quaternion, Translation3, UnitQuaternion, Vector3};
use ndarray::{Array2, ArrayView2, Axis};
use serde::{Deserialize, Serialize};

/// Axis convention of a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum CameraConvention {
    /// ROS optical frame, also OpenCV's: x right, y down, z forward.
    #[default]
    Ros,
    /// OpenGL and USD, also MuJoCo: x right, y up, z backward. The name `open_gl` is the same.
    #[serde(rename = "opengl", alias = "open_gl")]
    OpenGl,
    /// ROS body frame: x forward, y left, z up.
    World,
}

impl CameraConvention {
    /// Returns the rotation that maps vectors of the optical frame ([`Ros`](Self::Ros)) to this convention.
    pub fn rotation_from_ros(self) -> UnitQuaternion<f64> {
        let q = match self {
            Self::Ros => return UnitQuaternion::identity(),
            // Half a turn about x.
            Self::OpenGl => Quaternion::new(0.0, 1.0, 0.0, 0.0),
            // The matrix [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]: right is -y, down is -z, forward is +x.
            Self::World => Quaternion::new(0.5, -0.5, 0.5, -0.5),
        };
        UnitQuaternion::new_unchecked(q)
    }

    /// Converts the pose of a camera in this convention to the pose of its optical frame ([`Ros`](Self::Ros)).
    pub fn to_optical(self, pose: &Pose) -> Pose {
        pose * self.rotation_from_ros()
    }

    /// Converts the pose of an optical frame to the pose of the camera in this convention.
    pub fn pose_from_optical(self, optical: &Pose) -> Pose {
        optical * self.rotation_from_ros().inverse()
    }
}

/// Pose of a camera relative to a body or to the environment.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Extrinsics {
    /// Body that the camera is attached to: `uid/link`, the link alone if only one body has this name, or the uid of an
    /// object. A link that fixed joints fuse to another link is allowed. `None` is the frame of the environment.
    pub parent: Option<String>,
    /// Pose in the frame of the parent, or of the environment without a parent.
    pub placement: Placement,
    /// Axis convention of [`Placement::Pose`], the same for free and attached cameras; [`Placement::LookAt`] does not
    /// use it.
    pub convention: CameraConvention,
}

/// Pose of a camera in the frame of its parent, or of the environment for free cameras.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Placement {
    /// An explicit pose; the axes are those of [`Extrinsics::convention`].
    Pose {
        /// Position in the frame of the parent, or of the environment for free cameras \[m\].
        #[serde(default)]
        pos: [f64; 3],
        /// Rotation of the camera's axes in that frame.
        #[serde(default, with = "kinetoscope_scene::file_format::rotation")]
        rotation: UnitQuaternion<f64>,
    },
    /// A position and a target, in the frame of the parent, or of the environment for free cameras: see
    /// [`look_at_pose`].
    LookAt {
        /// Position of the camera \[m\].
        eye: [f64; 3],
        /// Point that the optical axis passes through \[m\]. It is in the middle of the image if the principal point
        /// is.
        target: [f64; 3],
        /// Upward direction of the image, in the frame of `eye` and `target`, of any length.
        #[serde(default = "z_axis")]
        up: [f64; 3],
    },
}

/// Default upward direction: +z of the parent or of the environment.
fn z_axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

impl Default for Placement {
    fn default() -> Self {
        Self::Pose { pos: [0.0; 3], rotation: UnitQuaternion::identity() }
    }
}

impl Extrinsics {
    /// Returns the pose of the optical frame ([`CameraConvention::Ros`]) in the frame of the parent.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`] or [`CameraError::LookAt`] for an invalid pose.
    pub fn parent_from_camera(&self) -> Result<Pose, CameraError> {
        match self.placement {
            Placement::Pose { pos, rotation } => {
                let pose = rigid(0, &Pose::from_parts(Translation3::from(Vector3::from(pos)), rotation))?;
                Ok(self.convention.to_optical(&pose))
            }
            Placement::LookAt { eye, target, up } => look_at_pose(eye, target, up),
        }
    }
}

/// Returns the pose of the optical frame ([`CameraConvention::Ros`]) of a camera at `eye` that looks at `target`.
///
/// The upward direction of the image is as near to `up` as possible. If the camera looks along `up` (straight up or
/// down, for the usual z), the upward direction is +y, or +x if `up` is y. An `up` of zero is replaced by z.
///
/// # Errors
///
/// [`CameraError::LookAt`] if eye and target coincide or a number is not finite.
pub fn look_at_pose(eye: [f64; 3], target: [f64; 3], up: [f64; 3]) -> Result<Pose, CameraError> {
    let error = CameraError::LookAt { eye, target };
    if eye.iter().chain(&target).chain(&up).any(|x| !x.is_finite()) {
        return Err(error);
    }
    let (from, to) = (Vector3::from(eye), Vector3::from(target));
    let z = (to - from).try_normalize(1e-12).ok_or_else(|| error.clone())?;
    let up = Vector3::from(up).try_normalize(1e-12).unwrap_or(Vector3::z());
    let other = if up.y.abs() > 0.9 { Vector3::x() } else { Vector3::y() };
    let x = [up, other].iter().find_map(|up| z.cross(up).try_normalize(1e-6)).ok_or_else(|| error.clone())?;
    let rotation = nalgebra::Rotation3::from_matrix_unchecked(nalgebra::Matrix3::from_columns(&[x, z.cross(&x), z]));
    let pose = Pose::from_parts(from.into(), UnitQuaternion::from_rotation_matrix(&rotation));
    rigid(0, &pose).map_err(|_| error)
}

/// Poses of several cameras, typed or as rows `[x, y, z, qw, qx, qy, qz]` with positions in \[m\].
pub trait Poses {
    /// Converts to poses, each a rigid transform.
    ///
    /// # Errors
    ///
    /// [`CameraError::Pose`] with the first pose that has a number that is not finite or a quaternion of norm 0; other
    /// quaternions are normalized. [`CameraError::PoseColumns`] for rows that do not have seven numbers.
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError>;
}

impl Poses for [Pose] {
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError> {
        self.iter().enumerate().map(|(k, pose)| rigid(k, pose)).collect()
    }
}

impl<const N: usize> Poses for [Pose; N] {
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError> {
        self.as_slice().to_poses()
    }
}

impl Poses for Vec<Pose> {
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError> {
        self.as_slice().to_poses()
    }
}

impl Poses for Pose {
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError> {
        std::slice::from_ref(self).to_poses()
    }
}

impl Poses for ArrayView2<'_, f64> {
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError> {
        if self.ncols() != 7 {
            return Err(CameraError::PoseColumns { columns: self.ncols() });
        }
        let row = |row: usize| rigid_row(row, std::array::from_fn(|column| self[(row, column)]));
        (0..self.len_of(Axis(0))).map(row).collect()
    }
}

impl Poses for Array2<f64> {
    fn to_poses(&self) -> Result<Vec<Pose>, CameraError> {
        self.view().to_poses()
    }
}

/// Checks a pose and normalizes its quaternion.
fn rigid(row: usize, pose: &Pose) -> Result<Pose, CameraError> {
    rigid_row(row, to_row(pose))
}

fn rigid_row(row: usize, numbers: [f64; 7]) -> Result<Pose, CameraError> {
    let [x, y, z, qw, qx, qy, qz] = numbers;
    let q = Quaternion::new(qw, qx, qy, qz);
    // A unit quaternion, up to the rounding of a few products, keeps its bits.
    let unit = (q.norm_squared() - 1.0).abs() < 1e-13;
    let rotation = if unit { Some(UnitQuaternion::new_unchecked(q)) } else { UnitQuaternion::try_new(q, 1e-12) };
    rotation
        .map(|rotation| Pose::from_parts(Translation3::new(x, y, z), rotation))
        .filter(|pose| PoseF32::from(pose).is_rigid())
        .ok_or(CameraError::Pose { row, pose: numbers })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::pose::{from_row, from_wxyz};
    use ndarray::array;

    fn same_rotation(a: &UnitQuaternion<f64>, b: &UnitQuaternion<f64>) -> bool {
        a.angle_to(b) < 1e-6
    }

    /// The camera of Isaac Lab's own tests: at (2.5, 2.5, 2.5), looking at the origin.
    #[test]
    fn conventions() {
        let ros = from_wxyz([-0.17591989, 0.33985114, 0.82047325, -0.42470819]);
        let open_gl = from_wxyz([0.33985113, 0.17591988, 0.42470818, 0.82047324]);
        let world = from_wxyz([-0.3647052, -0.27984815, -0.1159169, 0.88047623]);
        let at = Translation3::new(2.5, 2.5, 2.5);
        let optical = Pose::from_parts(at, ros);
        use CameraConvention::{OpenGl, Ros, World};
        for (convention, rotation) in [(Ros, ros), (OpenGl, open_gl), (World, world)] {
            let pose = convention.pose_from_optical(&optical);
            assert!(same_rotation(&pose.rotation, &rotation), "{convention:?}: {:?}", pose.rotation);
            assert_eq!(pose.translation, at);
            assert!(same_rotation(&convention.to_optical(&Pose::from_parts(at, rotation)).rotation, &ros));
        }
        let looking = look_at_pose([2.5; 3], [0.0; 3], [0.0, 0.0, 1.0]).unwrap();
        assert!(same_rotation(&looking.rotation, &ros));
        let (right, down, forward) = (Vector3::x(), Vector3::y(), Vector3::z());
        let axes = |c: CameraConvention| [right, down, forward].map(|v| c.rotation_from_ros() * v);
        assert_eq!(axes(OpenGl), [right, -down, -forward]);
        assert_eq!(axes(World), [-down, -forward, right]);
    }

    #[test]
    fn look_at() {
        let pictured_up = |target: [f64; 3], up: [f64; 3]| {
            let pose = look_at_pose([0.0; 3], target, up).unwrap();
            let forward = pose.rotation * Vector3::z();
            assert!((forward - Vector3::from(target).normalize()).norm() < 1e-12);
            pose.rotation * -Vector3::y()
        };
        let z = [0.0, 0.0, 1.0];
        for target in [[0.0, 0.0, 2.0], [0.0, 0.0, -2.0], [1e-9, 0.0, -1.0]] {
            assert!((pictured_up(target, z) - Vector3::y()).norm() < 1e-8);
        }
        assert!((pictured_up([0.0, -1.0, 0.0], [0.0, 1.0, 0.0]) - Vector3::x()).norm() < 1e-12);
        assert!((pictured_up([1.0, 0.0, 0.0], [0.0; 3]) - Vector3::z()).norm() < 1e-12);
        for (eye, target) in [([1.0; 3], [1.0; 3]), ([f64::NAN, 0.0, 0.0], [1.0; 3]), ([1e300; 3], [0.0; 3])] {
            assert!(matches!(look_at_pose(eye, target, z), Err(CameraError::LookAt { .. })));
        }
    }

    #[test]
    fn rows() {
        let rows = array![[1.0, 2.0, 3.0, 2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 0.0, -3.0, 0.0, 4.0]];
        let poses = rows.to_poses().unwrap();
        assert_eq!(to_row(&poses[0]), [1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0]);
        assert!((to_row(&poses[1])[4] + 0.6).abs() < 1e-15);
        for (column, value) in [(0, f64::NAN), (2, f64::INFINITY), (3, 0.0), (5, f64::NAN), (1, 1e300)] {
            let mut bad = rows.clone();
            bad[(0, column)] = value;
            assert!(matches!(bad.to_poses(), Err(CameraError::Pose { row: 0, .. })), "{column}");
        }
        assert_eq!(array![[1.0, 2.0, 3.0]].to_poses(), Err(CameraError::PoseColumns { columns: 3 }));
        let pose = from_row(&[1.0, 2.0, 3.0, 0.1, 0.7, -0.3, 0.2]);
        assert_eq!(pose.to_poses().unwrap(), [pose], "a rotation keeps its bits");
        let broken = Pose::from_parts(pose.translation, UnitQuaternion::new_unchecked(Quaternion::new(0., 0., 0., 0.)));
        assert!([pose, broken].to_poses().is_err_and(|e| matches!(e, CameraError::Pose { row: 1, .. })));
    }
}
