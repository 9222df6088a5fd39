//! Sensors: channels by name, stamps, and poses of cameras.

use crate::arguments::{array, env_indices};
use crate::channels::{Instant, names, values};
use crate::errors::Failure;
use crate::shared::{Shared, equal_handles};
use crate::values::{Values, read_into};
use kinetoscope::ndarray::{Array2, ArrayD, ArrayView1, Ix2, IxDyn};
use kinetoscope::prelude::Intrinsics;
use kinetoscope::sensors::camera::{Camera, CameraConvention, CameraPlacement, PointFrame, StereoCamera};
use kinetoscope::sensors::ray::{RayCaster, RayCasterCamera};
use kinetoscope::sensors::{
    ActuatorState, ContactSensor, FrameTransformer, Imu, JointState, JointWrench, MujocoSensor, SensorError,
};
use kinetoscope::sim::{SensorId, SimulationManager};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use std::any::Any;
use std::sync::Arc;

equal_handles! { Sensor: uid }

/// A sensor in all environments. ``sensor["depth"]`` is a channel by name; ``sensor.channels`` lists the names.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Sensor {
    pub(crate) shared: Arc<Shared>,
    pub(crate) uid: String,
}

/// Calls `$act` with the handle of the sensor if it is one of the camera types.
macro_rules! for_camera {
    ($sim:expr, $uid:expr, |$camera:ident| $act:expr) => {{
        if let Some(id) = id_of::<Camera>($sim, $uid) {
            let $camera = $sim.sensor_mut(id)?;
            $act
        } else if let Some(id) = id_of::<StereoCamera>($sim, $uid) {
            let $camera = $sim.sensor_mut(id)?;
            $act
        } else if let Some(id) = id_of::<RayCasterCamera>($sim, $uid) {
            let $camera = $sim.sensor_mut(id)?;
            $act
        } else {
            return Err(not_a_camera($uid));
        }
    }};
}

/// Value of `$act` with the handle of the sensor, whatever its type.
macro_rules! for_sensor {
    ($sim:expr, $uid:expr, |$id:ident| $act:expr) => {
        for_sensor!(
            $sim, $uid, |$id| $act, Camera, StereoCamera, RayCaster, RayCasterCamera, ContactSensor, Imu,
            FrameTransformer, JointState, ActuatorState, JointWrench, MujocoSensor
        )
    };
    ($sim:expr, $uid:expr, |$id:ident| $act:expr, $($Type:ty),*) => {
        $(if let Some($id) = id_of::<$Type>($sim, $uid) {
            $act
        } else)* {
            // The sensor failed, or has a type that this package does not have.
            $sim.entities().sensor_by_uid($uid)?;
            return Err(Failure::argument($uid, "this sensor has no markers"));
        }
    };
}

#[pymethods]
impl Sensor {
    /// Name of the sensor.
    #[getter]
    fn uid(&self) -> &str {
        &self.uid
    }

    /// Type of the sensor in scene files, such as ``"camera"``.
    #[getter]
    fn kind(&self, py: Python<'_>) -> PyResult<&'static str> {
        self.shared.read(py, |sim| Ok(kind(sim.entities().sensor_by_uid(&self.uid)?)))
    }

    /// Names of the channels.
    #[getter]
    fn channels(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(names(sim.entities().sensor_by_uid(&self.uid)?)))
    }

    /// Names of the bodies, joints or other items that the values belong to.
    #[getter]
    fn columns(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| {
            let sampled = sim.entities().sensor_by_uid(&self.uid)?.sampled();
            Ok(sampled.map_or_else(Vec::new, |sampled| sampled.columns().to_vec()))
        })
    }

    /// Names along the third axis of the matrix channels of a contact sensor.
    #[getter]
    fn filters(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| {
            let sampled = sim.entities().sensor_by_uid(&self.uid)?.sampled();
            Ok(sampled.map_or_else(Vec::new, |sampled| sampled.filters().to_vec()))
        })
    }

    /// Units of the numeric channels, by name; empty for numbers without a unit.
    #[getter]
    fn units(&self, py: Python<'_>) -> PyResult<std::collections::BTreeMap<String, String>> {
        self.shared.read(py, |sim| {
            let sampled = sim.entities().sensor_by_uid(&self.uid)?.sampled();
            Ok(sampled.map_or_else(Default::default, |sampled| {
                sampled.sampler().channels().map(|channel| (channel.name.into(), channel.unit.to_string())).collect()
            }))
        })
    }

    /// Current values of a channel, environments on the first axis. A lazy camera renders now.
    fn __getitem__<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyAny>> {
        self.value(py, channel, Instant::Current).map(|values| values.into_python(py))
    }

    /// Current values of a channel, shape (num_envs, ...). With ``out``, they are copied into that array, which is returned:
    /// it has the same shape and element type.
    #[pyo3(signature = (channel, out=None))]
    fn read<'py>(&self, py: Python<'py>, channel: &str, out: Option<Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyAny>> {
        let Some(out) = out else { return self.__getitem__(py, channel) };
        read_into(py, &self.shared, &out, |sim| {
            values(sim.entities().sensor_by_uid(&self.uid)?, channel, Instant::Current)
        })?;
        Ok(out)
    }

    /// Past values of a channel, newest first on the second axis: the shape is (num_envs, history, ...).
    fn history<'py>(&self, py: Python<'py>, channel: &str) -> PyResult<Bound<'py, PyAny>> {
        self.value(py, channel, Instant::History).map(|values| values.into_python(py))
    }

    /// Times of capture of the current values [s], shape (num_envs,).
    #[getter]
    fn stamps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let stamps: Values<'_> = self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            match camera_of(sensor) {
                Some(camera) => Ok(camera.stamps().to_owned().into()),
                None => Ok(sampled(sensor, &self.uid)?.stamps().to_owned().into()),
            }
        })?;
        Ok(stamps.into_python(py))
    }

    /// Number of measurements since the last reset, shape (num_envs,).
    #[getter]
    fn sample_counts<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let counts: Values<'_> = self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            match camera_of(sensor) {
                Some(camera) => Ok(camera.frame_counts().to_owned().into()),
                None => Ok(sampled(sensor, &self.uid)?.sample_counts().to_owned().into()),
            }
        })?;
        Ok(counts.into_python(py))
    }

    /// Intrinsic matrices of a camera [pixels], shape (num_envs, 3, 3).
    #[getter]
    fn intrinsic_matrices<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let matrices: Values<'_> = self.shared.read(py, |sim| {
            let sensor: &dyn Any = sim.entities().sensor_by_uid(&self.uid)?;
            if let Some(camera) = sensor.downcast_ref::<RayCasterCamera>() {
                return Ok(camera.intrinsic_matrices().into());
            }
            let camera =
                sensor.downcast_ref().or_else(|| sensor.downcast_ref::<StereoCamera>().map(StereoCamera::left));
            let camera: &Camera = camera.ok_or_else(|| not_a_camera(&self.uid))?;
            Ok(camera.intrinsic_matrices().into())
        })?;
        Ok(matrices.into_python(py))
    }

    /// Height and width of the images of a camera [pixels].
    #[getter]
    fn image_shape(&self, py: Python<'_>) -> PyResult<(usize, usize)> {
        self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            let any: &dyn Any = sensor;
            let ray = any.downcast_ref::<RayCasterCamera>().map(RayCasterCamera::image_shape);
            ray.or_else(|| camera_of(sensor).map(Camera::image_shape)).ok_or_else(|| not_a_camera(&self.uid))
        })
    }

    /// Poses of a camera in the environment, rows x y z qw qx qy qz, shape (num_envs, 7). ``convention`` is ``"ros"``
    /// (x right, y down, z forward), ``"opengl"`` or ``"world"``.
    #[pyo3(signature = (convention="ros"))]
    fn pose_w<'py>(&self, py: Python<'py>, convention: &str) -> PyResult<Bound<'py, PyAny>> {
        let convention = axes(convention)?;
        let poses: Values<'_> = self.shared.read(py, |sim| {
            let sensor: &dyn Any = sim.entities().sensor_by_uid(&self.uid)?;
            let poses = sensor.downcast_ref::<Camera>().map(|camera| camera.pose_w(convention));
            let poses = poses.or_else(|| Some(sensor.downcast_ref::<StereoCamera>()?.pose_w(convention)));
            let poses = poses.or_else(|| Some(sensor.downcast_ref::<RayCasterCamera>()?.pose_w(convention)));
            poses.map(Values::from).ok_or_else(|| not_a_camera(&self.uid))
        })?;
        Ok(poses.into_python(py))
    }

    /// Poses of a camera in the frame of its parent, shape (num_envs, 7).
    #[pyo3(signature = (convention="ros"))]
    fn local_pose<'py>(&self, py: Python<'py>, convention: &str) -> PyResult<Bound<'py, PyAny>> {
        let convention = axes(convention)?;
        let poses: Array2<f64> =
            self.shared.write(py, |sim| Ok(for_camera!(sim, &self.uid, |camera| camera.local_pose(convention))))?;
        Ok(Values::from(poses).into_python(py))
    }

    /// Sets poses of a camera in the frame of its parent, rows x y z qw qx qy qz.
    #[pyo3(signature = (poses, env_ids=None, convention="ros"))]
    fn set_local_pose(
        &self,
        py: Python<'_>,
        poses: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
        convention: &str,
    ) -> PyResult<()> {
        let (poses, env_ids) = (array::<Ix2>(poses, "set_local_pose")?, env_indices(&self.shared, env_ids)?);
        let convention = axes(convention)?;
        self.shared.write(py, |sim| {
            for_camera!(sim, &self.uid, |camera| camera.set_local_pose(&poses, env_ids.as_deref(), convention)?);
            Ok(())
        })
    }

    /// Sets poses of a camera in the environment, rows x y z qw qx qy qz.
    #[pyo3(signature = (poses, env_ids=None, convention="ros"))]
    fn set_world_poses(
        &self,
        py: Python<'_>,
        poses: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
        convention: &str,
    ) -> PyResult<()> {
        let (poses, env_ids) = (array::<Ix2>(poses, "set_world_poses")?, env_indices(&self.shared, env_ids)?);
        let convention = axes(convention)?;
        self.shared.write(py, |sim| {
            for_camera!(sim, &self.uid, |camera| camera.set_world_poses(&poses, env_ids.as_deref(), convention)?);
            Ok(())
        })
    }

    /// Places a camera at ``eye``, looking at ``target``, in the frame of its parent [m].
    #[pyo3(signature = (eye, target, up=None, env_ids=None))]
    fn look_at(
        &self,
        py: Python<'_>,
        eye: &Bound<'_, PyAny>,
        target: &Bound<'_, PyAny>,
        up: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (eye, target) = (points(eye, "look_at, eye")?, points(target, "look_at, target")?);
        let up = up.map_or(Ok(vec![[0.0, 0.0, 1.0]]), |up| points(up, "look_at, up"))?;
        let env_ids = env_indices(&self.shared, env_ids)?;
        self.shared.write(py, |sim| {
            for_camera!(sim, &self.uid, |camera| camera.look_at(&eye, &target, &up, env_ids.as_deref())?);
            Ok(())
        })
    }

    /// Sets intrinsics: rows fx fy cx cy [pixels].
    #[pyo3(signature = (intrinsics, env_ids=None))]
    fn set_intrinsics(
        &self,
        py: Python<'_>,
        intrinsics: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (rows, env_ids) = (array::<Ix2>(intrinsics, "set_intrinsics")?, env_indices(&self.shared, env_ids)?);
        let rows = intrinsics_of(&rows, "set_intrinsics")?;
        self.shared.write(py, |sim| {
            for_camera!(sim, &self.uid, |camera| camera.set_intrinsics(&rows, env_ids.as_deref())?);
            Ok(())
        })
    }

    /// Restores the configured poses and intrinsics of a camera.
    #[pyo3(signature = (env_ids=None))]
    fn restore(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let env_ids = env_indices(&self.shared, env_ids)?;
        self.shared.write(py, |sim| {
            for_camera!(sim, &self.uid, |camera| camera.restore(env_ids.as_deref())?);
            Ok(())
        })
    }

    /// Environments that a camera sees, one for each row of its channels.
    #[getter]
    fn env_ids(&self, py: Python<'_>) -> PyResult<Vec<usize>> {
        self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            let all = || (0..sim.num_envs()).collect();
            Ok(camera_of(sensor).map_or_else(all, |camera| camera.env_ids().to_vec()))
        })
    }

    /// Points seen by the pixels of a camera with the channel ``depth`` in one environment [m], shape (height, width, 3),
    /// infinite without a hit. ``frame`` is ``"camera"`` or ``"world"`` (the environment).
    #[pyo3(signature = (env=0, frame="world"))]
    fn point_map<'py>(&self, py: Python<'py>, env: usize, frame: &str) -> PyResult<Bound<'py, PyAny>> {
        let frame = point_frame(frame)?;
        let points: Values<'_> = self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            let any: &dyn Any = sensor;
            if let Some(camera) = any.downcast_ref::<RayCasterCamera>() {
                return Ok(camera.point_map(env, frame)?.into());
            }
            let camera = camera_of(sensor).ok_or_else(|| not_a_camera(&self.uid))?;
            Ok(camera.point_map(env, frame)?.into())
        })?;
        Ok(points.into_python(py))
    }

    /// Points seen by a camera with the channel ``depth`` in one environment [m], shape (points, 3). ``frame`` is
    /// ``"camera"`` or ``"world"`` (the environment).
    #[pyo3(signature = (env=0, frame="world"))]
    fn point_cloud<'py>(&self, py: Python<'py>, env: usize, frame: &str) -> PyResult<Bound<'py, PyAny>> {
        let frame = point_frame(frame)?;
        let points: Values<'_> = self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            let any: &dyn Any = sensor;
            if let Some(camera) = any.downcast_ref::<RayCasterCamera>() {
                return Ok(camera.point_cloud(env, frame)?.into());
            }
            let camera = camera_of(sensor).ok_or_else(|| not_a_camera(&self.uid))?;
            Ok(camera.point_cloud(env, frame)?.into())
        })?;
        Ok(points.into_python(py))
    }

    /// Shows or hides the markers of the sensor in views and in images with ``draw_markers``.
    fn set_debug_vis(&self, py: Python<'_>, shown: bool) -> PyResult<()> {
        self.shared.write(py, |sim| {
            for_sensor!(sim, &self.uid, |id| sim.scene_mut().set_debug_vis(id, shown)?);
            Ok(())
        })
    }

    /// True if the markers of the sensor are shown in views and in images with ``draw_markers``.
    #[getter]
    fn debug_vis(&self, py: Python<'_>) -> PyResult<bool> {
        self.shared.read(py, |sim| Ok(for_sensor!(sim, &self.uid, |id| sim.scene().debug_vis(id)?)))
    }

    /// Time between measurements [s], after rounding to whole physics steps.
    #[getter]
    fn update_period(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            match camera_of(sensor) {
                Some(camera) => Ok(camera.update_period()),
                None => Ok(sampled(sensor, &self.uid)?.sampler().period()),
            }
        })
    }

    /// Physics steps until the sensor next measures, delivers a delayed measurement or opens its shutter in any environment, at
    /// least 1; None for a sensor that failed.
    #[getter]
    fn due_in(&self, py: Python<'_>) -> PyResult<Option<u64>> {
        let steps = self.shared.read(py, |sim| Ok(sim.entities().sensor_due_in(&self.uid)?))?;
        Ok(if steps == u64::MAX { None } else { Some(steps) })
    }

    /// True if a camera is attached to a body.
    #[getter]
    fn is_attached(&self, py: Python<'_>) -> PyResult<bool> {
        self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            let any: &dyn Any = sensor;
            let ray = any.downcast_ref::<RayCasterCamera>().map(RayCasterCamera::is_attached);
            ray.or_else(|| camera_of(sensor).map(Camera::is_attached)).ok_or_else(|| not_a_camera(&self.uid))
        })
    }

    /// Times of the current forces, efforts and accelerations of a numeric sensor [s], shape (num_envs,). They are of the
    /// beginning of the last step, and ``stamps`` of its end.
    #[getter]
    fn force_stamps<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let stamps: Values<'_> = self.shared.read(py, |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            Ok(sampled(sensor, &self.uid)?.force_stamps().to_owned().into())
        })?;
        Ok(stamps.into_python(py))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "Sensor", |sim| {
            let sensor = sim.entities().sensor_by_uid(&self.uid)?;
            Ok(format!("<Sensor {:?}: {}, channels {}>", self.uid, kind(sensor), names(sensor).join(", ")))
        })
    }

    /// Summary of the sensor.
    fn __str__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| {
            let sensor: &dyn Any = sim.entities().sensor_by_uid(&self.uid)?;
            macro_rules! text {
                ($($Type:ty),*) => {
                    $(if let Some(sensor) = sensor.downcast_ref::<$Type>() {
                        return Ok(sensor.to_string());
                    })*
                };
            }
            text!(Camera, StereoCamera, RayCaster, RayCasterCamera, ContactSensor, Imu, FrameTransformer, JointState);
            text!(ActuatorState, JointWrench, MujocoSensor);
            Ok(format!("sensor {:?}", self.uid))
        })
    }

    /// The images of the first environments, for notebooks.
    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<Py<PyAny>> {
        let py = slf.py();
        py.import("kinetoscope.notebook")?.getattr("sensor_html")?.call1((slf,)).map(Bound::unbind)
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let names = self.channels(py)?.into_pyobject(py)?;
        Ok(names.into_any().try_iter()?.into_any().unbind())
    }

    fn __contains__(&self, py: Python<'_>, channel: &Bound<'_, PyAny>) -> PyResult<bool> {
        let channel: String = channel.extract().map_err(|_| PyTypeError::new_err("channels are named by texts"))?;
        Ok(self.channels(py)?.contains(&channel))
    }
}

impl Sensor {
    pub(crate) fn value(&self, py: Python<'_>, channel: &str, instant: Instant) -> PyResult<Values<'static>> {
        self.shared.read(py, |sim| Ok(values(sim.entities().sensor_by_uid(&self.uid)?, channel, instant)?.into_owned()))
    }
}

/// Intrinsics of rows fx fy cx cy [pixels].
pub(crate) fn intrinsics_of(rows: &Array2<f64>, name: &str) -> PyResult<Vec<Intrinsics>> {
    if rows.ncols() != 4 {
        let problem = format!("shape {:?}; expected rows fx fy cx cy", rows.shape());
        return Err(Failure::argument(name, problem).into());
    }
    let row = |row: ArrayView1<'_, f64>| Intrinsics::Pixels { fx: row[0], fy: row[1], cx: row[2], cy: row[3] };
    Ok(rows.rows().into_iter().map(row).collect())
}

pub(crate) fn id_of<S: kinetoscope::sensors::Sensor>(sim: &SimulationManager, uid: &str) -> Option<SensorId<S>> {
    sim.entities().sensor_ids::<S>().into_iter().find(|(known, _)| known == uid).map(|(_, id)| id)
}

/// The camera that a sensor is, or the left one of a stereo camera.
pub(crate) fn camera_of(sensor: &dyn kinetoscope::sensors::Sensor) -> Option<&Camera> {
    let any: &dyn Any = sensor;
    any.downcast_ref().or_else(|| any.downcast_ref::<StereoCamera>().map(StereoCamera::left))
}

pub(crate) fn sampled<'s>(
    sensor: &'s dyn kinetoscope::sensors::Sensor,
    uid: &str,
) -> Result<&'s dyn kinetoscope::sensors::Sampled, Failure> {
    sensor.sampled().ok_or_else(|| Failure::argument(uid, "this sensor has no numeric channels"))
}

fn kind(sensor: &dyn kinetoscope::sensors::Sensor) -> &'static str {
    let any: &dyn Any = sensor;
    macro_rules! kinds {
        ($($Type:ty => $name:literal),* $(,)?) => {
            $(if any.is::<$Type>() {
                return $name;
            })*
        };
    }
    kinds! {
        Camera => "camera",
        StereoCamera => "stereo_camera",
        RayCaster => "ray_caster",
        RayCasterCamera => "ray_caster_camera",
        ContactSensor => "contact_sensor",
        Imu => "imu",
        FrameTransformer => "frame_transformer",
        JointState => "joint_state",
        ActuatorState => "actuator_state",
        JointWrench => "joint_wrench",
        MujocoSensor => "mujoco_sensor",
    }
    "sensor"
}

pub(crate) fn not_a_camera(uid: &str) -> Failure {
    Failure::argument(uid, "this sensor is not a camera")
}

pub(crate) fn axes(name: &str) -> PyResult<CameraConvention> {
    match name {
        "ros" => Ok(CameraConvention::Ros),
        "opengl" | "open_gl" => Ok(CameraConvention::OpenGl),
        "world" => Ok(CameraConvention::World),
        other => {
            let message = format!("unknown convention {other:?}; \"ros\", \"opengl\" or \"world\"");
            Err(Failure::argument("convention", message).into())
        }
    }
}

fn point_frame(name: &str) -> PyResult<PointFrame> {
    match name {
        "camera" => Ok(PointFrame::Camera),
        "world" => Ok(PointFrame::World),
        other => {
            let message = format!("unknown frame {other:?}; \"camera\" or \"world\"");
            Err(Failure::argument("frame", message).into())
        }
    }
}

/// Points of an argument, rows x y z.
fn points(obj: &Bound<'_, PyAny>, name: &str) -> PyResult<Vec<[f64; 3]>> {
    let rows: ArrayD<f64> = array::<IxDyn>(obj, name)?;
    let wrong = || Failure::argument(name, format!("shape {:?}; expected rows x y z", rows.shape()));
    if rows.shape().last() != Some(&3) || rows.ndim() > 2 {
        return Err(wrong().into());
    }
    let numbers: Vec<f64> = rows.iter().copied().collect();
    Ok(numbers.chunks_exact(3).filter_map(|point| point.try_into().ok()).collect())
}

impl From<kinetoscope::sensors::camera::CameraError> for Failure {
    fn from(error: kinetoscope::sensors::camera::CameraError) -> Self {
        SensorError::from(error).into()
    }
}
