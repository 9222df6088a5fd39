//! Calibration of cameras: ROS's `camera_info`, its files, and the rectification of stereo cameras.

use crate::arguments::{array, env_indices};
use crate::channels::Instant;
use crate::errors::{Class, Failure};
use crate::sensor::{Sensor, axes, camera_of, id_of, intrinsics_of, not_a_camera, sampled};
use crate::shared::{detached, guarded};
use crate::values::Values;
use kinetoscope::ndarray::{Array1, Array2, Array3, Ix2};
use kinetoscope::sensors::camera::{CalibrationError, Camera, CameraCfg, CameraInfo, StereoCamera};
use kinetoscope::sensors::{Sensor as AnySensor, SensorError};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::any::Any;
use std::path::PathBuf;

#[pymethods]
impl Sensor {
    /// Calibration of a camera in one environment, in the form of ROS's ``camera_info``: a dict of ``name``, ``width``,
    /// ``height``, ``distortion_model``, ``distortion_coefficients``, and the float64 matrices ``camera_matrix`` (3, 3),
    /// ``rectification_matrix`` (3, 3) and ``projection_matrix`` (3, 4). The center of the first pixel is at (0, 0). ``side``
    /// is the camera of a pair, ``"left"`` or ``"right"``.
    #[pyo3(signature = (env=0, side=None))]
    fn camera_info<'py>(&self, py: Python<'py>, env: usize, side: Option<&str>) -> PyResult<Bound<'py, PyDict>> {
        let info = self.info(py, env, side)?;
        let dict = PyDict::new(py);
        dict.set_item("name", &info.name)?;
        dict.set_item("width", info.width)?;
        dict.set_item("height", info.height)?;
        dict.set_item("distortion_model", info.distortion_model.name())?;
        let coefficients = Array1::from(info.distortion_coefficients.clone());
        dict.set_item("distortion_coefficients", Values::from(coefficients).into_python(py))?;
        let square = |matrix: kinetoscope::nalgebra::Matrix3<f64>| {
            Values::from(Array2::from_shape_fn((3, 3), |at| matrix[at])).into_python(py)
        };
        dict.set_item("camera_matrix", square(info.camera_matrix))?;
        dict.set_item("rectification_matrix", square(info.rectification_matrix))?;
        let projection = Array2::from_shape_fn((3, 4), |at| info.projection_matrix[at]);
        dict.set_item("projection_matrix", Values::from(projection).into_python(py))?;
        Ok(dict)
    }

    /// Writes the calibration of a camera to a YAML file of ROS, which ``read_calibration`` and ROS's tools read. An existing
    /// file is replaced. ``side`` is the camera of a pair, ``"left"`` or ``"right"``.
    #[pyo3(signature = (path, env=0, side=None))]
    fn write_calibration(&self, py: Python<'_>, path: PathBuf, env: usize, side: Option<&str>) -> PyResult<()> {
        let info = self.info(py, env, side)?;
        detached(py, || Ok(info.write(path)?))
    }

    /// Rectification of the images of a stereo camera in one environment: a dict of ``rotations``, shape (2, 3, 3), from the
    /// frames of the left and the right camera to their rectified frames, and ``projections``, shape (2, 3, 4), from the
    /// rectified left frame to the pixels of the rectified images, with the center of the first pixel at (0.5, 0.5).
    #[pyo3(signature = (env=0))]
    fn rectification<'py>(&self, py: Python<'py>, env: usize) -> PyResult<Bound<'py, PyDict>> {
        let found = self.shared.read(py, |sim| {
            let sensor: &dyn Any = sim.entities().sensor_by_uid(&self.uid)?;
            Ok(sensor.downcast_ref::<StereoCamera>().ok_or_else(|| self.not_a_pair())?.rectification(env)?)
        })?;
        let dict = PyDict::new(py);
        let rotations = Array3::from_shape_fn((2, 3, 3), |(side, row, column)| found.rotations[side][(row, column)]);
        let projections =
            Array3::from_shape_fn((2, 3, 4), |(side, row, column)| found.projections[side][(row, column)]);
        dict.set_item("rotations", Values::from(rotations).into_python(py))?;
        dict.set_item("projections", Values::from(projections).into_python(py))?;
        Ok(dict)
    }

    /// Sets different intrinsics for the cameras of a pair: rows fx fy cx cy [pixels] of the left and of the right camera.
    #[pyo3(signature = (left, right, env_ids=None))]
    fn set_left_right_intrinsics(
        &self,
        py: Python<'_>,
        left: &Bound<'_, PyAny>,
        right: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let name = "set_left_right_intrinsics";
        let left = intrinsics_of(&array::<Ix2>(left, "set_left_right_intrinsics, left")?, name)?;
        let right = intrinsics_of(&array::<Ix2>(right, "set_left_right_intrinsics, right")?, name)?;
        let env_ids = env_indices(&self.shared, env_ids)?;
        self.shared.write(py, |sim| {
            let id = id_of::<StereoCamera>(sim, &self.uid).ok_or_else(|| self.not_a_pair())?;
            Ok(sim.sensor_mut(id)?.set_left_right_intrinsics(&left, &right, env_ids.as_deref())?)
        })
    }

    /// Latest delivered images of a channel of a camera, shape (num_envs, ...). With a latency and after a write to the state,
    /// they are older than the current ones, which show the state at once.
    fn latest_delivered<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyAny>> {
        self.value(py, channel, Instant::Delivered).map(|values| values.into_python(py))
    }

    /// Capture times of the latest delivered images of a camera [s], shape (num_envs,).
    #[getter]
    fn latest_delivered_stamps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let stamps: Values<'_> = self.of_camera(py, |camera| Ok(camera.latest_delivered_stamps().into()))?;
        Ok(stamps.into_python(py))
    }

    /// Poses of a camera in the environment at the latest delivered images, as ``pose_w``, shape (num_envs, 7): the pose of the
    /// parent at the capture, and the local pose at the delivery. Without a latency, they equal ``pose_w``.
    #[pyo3(signature = (convention="ros"))]
    fn latest_delivered_pose_w<'py>(&self, py: Python<'py>, convention: &str) -> PyResult<Bound<'py, PyAny>> {
        let convention = axes(convention)?;
        let poses: Values<'_> = self.of_camera(py, |camera| Ok(camera.latest_delivered_pose_w(convention).into()))?;
        Ok(poses.into_python(py))
    }

    /// Intrinsic matrices of a camera at the delivery of the latest delivered images [pixels], shape (num_envs, 3, 3). Without a
    /// latency, they equal ``intrinsic_matrices``.
    #[getter]
    fn latest_delivered_intrinsic_matrices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let matrices: Values<'_> =
            self.of_camera(py, |camera| Ok(camera.latest_delivered_intrinsic_matrices().into()))?;
        Ok(matrices.into_python(py))
    }

    /// Capture times of the measurements in the history [s], newest first, shape (num_envs, history); 0 for entries that are
    /// not filled yet.
    #[getter]
    fn stamp_history<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let stamps: Values<'_> = self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            Ok(match camera_of(sensor) {
                Some(camera) => camera.stamp_history().to_owned().into(),
                None => sampled(sensor, &self.uid)?.stamp_history().to_owned().into(),
            })
        })?;
        Ok(stamps.into_python(py))
    }
}

impl Sensor {
    /// Reads from the camera; of a pair, the left one.
    pub(crate) fn of_camera<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&Camera) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        self.shared.read(py, |sim| {
            let sensor: &dyn AnySensor = sim.entities().sensor_by_uid(&self.uid)?;
            act(camera_of(sensor).ok_or_else(|| not_a_camera(&self.uid))?)
        })
    }

    /// Calibration of the camera, or of one of a pair.
    fn info(&self, py: Python<'_>, env: usize, side: Option<&str>) -> PyResult<CameraInfo> {
        self.shared.read(py, |sim| {
            let sensor: &dyn Any = sim.entities().sensor_by_uid(&self.uid)?;
            if let Some(pair) = sensor.downcast_ref::<StereoCamera>() {
                let [left, right] = pair.camera_info(&self.uid, env)?;
                return match side {
                    None | Some("left") => Ok(left),
                    Some("right") => Ok(right),
                    Some(other) => {
                        Err(Failure::argument("side", format!("unknown side {other:?}; \"left\" or \"right\"")))
                    }
                };
            }
            let camera = sensor.downcast_ref::<Camera>().ok_or_else(|| not_a_camera(&self.uid))?;
            if side.is_some() {
                return Err(Failure::argument("side", "this camera is not a pair"));
            }
            Ok(camera.camera_info(&self.uid, env)?)
        })
    }

    fn not_a_pair(&self) -> Failure {
        Failure::argument(&self.uid, "this sensor is not a stereo camera")
    }
}

/// Fields of a ``CameraCfg`` from a calibration file of ROS: width, height, intrinsics, lens, and a renderer that supports the
/// lens, for ``CameraCfg(**read_calibration("wrist.yaml"))``.
#[pyfunction]
pub(crate) fn read_calibration(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyDict>> {
    let cfg = detached(py, || {
        let mut cfg = CameraCfg::default();
        CameraInfo::read(path)?.apply_to(&mut cfg);
        Ok(cfg)
    })?;
    let text = guarded(|| Ok(serde_json::to_string(&cfg)?))?;
    let fields = py.import("json")?.call_method1("loads", (text,))?;
    let dict = PyDict::new(py);
    for name in ["width", "height", "intrinsics", "lens", "renderer"] {
        dict.set_item(name, fields.get_item(name)?)?;
    }
    Ok(dict)
}

impl From<CalibrationError> for Failure {
    fn from(error: CalibrationError) -> Self {
        match error {
            CalibrationError::File { .. } => Self::caused(Class::File, &error),
            other => SensorError::from(other).into(),
        }
    }
}
