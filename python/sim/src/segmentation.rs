//! Segments of mask images by instance, link and class, their bounding boxes and occlusions.

use crate::arguments::integers;
use crate::cfg;
use crate::errors::{Class, Failure};
use crate::sensor::{Sensor, camera_of, not_a_camera};
use crate::shared::{Shared, detached, guarded};
use crate::simulation::Simulation;
use crate::values::Values;
use kinetoscope::ndarray::{Axis, Ix3};
use kinetoscope::scene::pose::to_row;
use kinetoscope::sensors::SensorError;
use kinetoscope::sensors::camera::{self, Camera, PixelBox, SegmentLevel};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::Arc;

/// Meaning of the mask ids of cameras, made by ``SimulationManager.segmentation``. ``level`` is ``"instance"`` (whole
/// objects and robots), ``"link"`` or ``"semantic"`` (classes).
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Segmentation {
    shared: Arc<Shared>,
    inner: camera::Segmentation,
}

#[pymethods]
impl Simulation {
    /// Segmentation of mask images by instance, link and semantic class. ``labels`` is a dict of classes by pattern of
    /// names, ``{"arm": "manipulator", "cube_.*": "target"}``, or a ``SegmentationCfg``; other entities keep their own class.
    /// Call it again after entities were added.
    #[pyo3(signature = (labels=None))]
    fn segmentation(&self, py: Python<'_>, labels: Option<&Bound<'_, PyAny>>) -> PyResult<Segmentation> {
        let cfg: camera::SegmentationCfg = match labels {
            None => camera::SegmentationCfg::default(),
            Some(cfg) if cfg.hasattr("__dataclass_fields__")? => cfg::read("SegmentationCfg", Some(cfg))?,
            Some(labels) => {
                let fields = PyDict::new(py);
                fields.set_item("labels", labels)?;
                cfg::read("SegmentationCfg", Some(fields.as_any()))?
            }
        };
        let inner = self.shared.write(py, |sim| {
            sim.scene_mut().visual_scene();
            Ok(sim.scene().segmentation(&cfg)?)
        })?;
        Ok(Segmentation { shared: Arc::clone(&self.shared), inner })
    }
}

#[pymethods]
impl Segmentation {
    /// All segments of a level: dicts with ``id``, ``name``, ``class`` and ``mask_ids``.
    #[pyo3(signature = (level="instance"))]
    fn segments<'py>(&self, py: Python<'py>, level: &str) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let row = |segment: &camera::Segment| {
            let dict = PyDict::new(py);
            dict.set_item("id", segment.id)?;
            dict.set_item("name", &segment.name)?;
            dict.set_item("class", &segment.class)?;
            dict.set_item("mask_ids", &segment.mask_ids)?;
            Ok(dict)
        };
        let level = level_of(level)?;
        guarded(|| Ok(self.inner.segments(level)))?.iter().map(row).collect()
    }

    /// Segment ids of images of the channel ``mask``, int32, in the same shape: 0 where nothing was hit, -1 for mask ids of
    /// entities that were added later.
    #[pyo3(signature = (mask, level="instance"))]
    fn segment<'py>(&self, py: Python<'py>, mask: &Bound<'_, PyAny>, level: &str) -> PyResult<Bound<'py, PyAny>> {
        let (mask, level) = (integers(mask, "mask")?, level_of(level)?);
        let segments = detached(py, || Ok(self.inner.segment(level, mask.view())))?;
        Ok(Values::from(segments).into_python(py))
    }

    /// Colors of the segments of images of the channel ``mask``: RGBA, u8, shape (..., height, width, 4).
    #[pyo3(signature = (mask, level="instance"))]
    fn colorize<'py>(&self, py: Python<'py>, mask: &Bound<'_, PyAny>, level: &str) -> PyResult<Bound<'py, PyAny>> {
        let (mask, level) = (integers(mask, "mask")?, level_of(level)?);
        let is_single = mask.ndim() == 2;
        let wrong = Failure::argument("mask", format!("shape {:?}; expected (num_envs, height, width)", mask.shape()));
        let images = if is_single { mask.insert_axis(Axis(0)) } else { mask };
        let images = images.into_dimensionality::<Ix3>().map_err(|_| wrong)?;
        let colors = detached(py, || Ok(self.inner.colorize(level, images.view())))?;
        let colors = if is_single { colors.index_axis_move(Axis(0), 0).into_dyn() } else { colors.into_dyn() };
        Ok(Values::from(colors).into_python(py))
    }

    /// 2D bounding boxes in the image of a camera with the channel ``mask``: dicts with ``id`` and ``name`` of the segment,
    /// ``tight`` (around its visible pixels) and ``loose`` (around all of it in the view), each (left, upper, right, lower)
    /// edge [pixels] or None, and ``visible_pixels``.
    #[pyo3(signature = (sensor, env=0, level="instance"))]
    fn boxes_2d<'py>(
        &self,
        py: Python<'py>,
        sensor: &Bound<'_, Sensor>,
        env: usize,
        level: &str,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let level = level_of(level)?;
        let boxes = self.with_camera(py, sensor, |camera| self.inner.boxes_2d(level, camera, env))?;
        let edges =
            |found: Option<PixelBox>| found.map(|found| (found.min[0], found.min[1], found.max[0], found.max[1]));
        let row = |found: camera::Box2d| {
            let dict = self.named(py, level, found.id)?;
            dict.set_item("tight", edges(found.tight))?;
            dict.set_item("loose", edges(found.loose))?;
            dict.set_item("visible_pixels", found.visible_pixels)?;
            Ok(dict)
        };
        boxes.into_iter().map(row).collect()
    }

    /// 3D bounding boxes of everything that a camera can render, inside the image or not: dicts with ``id`` and ``name`` of
    /// the segment, ``pose`` of its frame in the environment (x y z qw qx qy qz), and ``min`` and ``max``, the smallest and
    /// largest coordinates in that frame [m].
    #[pyo3(signature = (sensor, env=0, level="instance"))]
    fn boxes_3d<'py>(
        &self,
        py: Python<'py>,
        sensor: &Bound<'_, Sensor>,
        env: usize,
        level: &str,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let level = level_of(level)?;
        let boxes = self.with_camera(py, sensor, |camera| self.inner.boxes_3d(level, camera, env))?;
        let row = |found: camera::Box3d| {
            let dict = self.named(py, level, found.id)?;
            dict.set_item("pose", to_row(&found.pose))?;
            dict.set_item("min", found.min)?;
            dict.set_item("max", found.max)?;
            Ok(dict)
        };
        boxes.into_iter().map(row).collect()
    }

    /// Occlusion of the segments in the image of a camera with the channel ``mask``: dicts with ``id`` and ``name`` of the
    /// segment, ``visible_pixels``, ``unoccluded_pixels`` (without other objects) and ``ratio``, the hidden fraction. Each
    /// segment is rendered once more.
    #[pyo3(signature = (sensor, env=0, level="instance"))]
    fn occlusions<'py>(
        &self,
        py: Python<'py>,
        sensor: &Bound<'_, Sensor>,
        env: usize,
        level: &str,
    ) -> PyResult<Vec<Bound<'py, PyDict>>> {
        let level = level_of(level)?;
        let found = self.with_camera(py, sensor, |camera| self.inner.occlusions(level, camera, env))?;
        let row = |found: camera::Occlusion| {
            let dict = self.named(py, level, found.id)?;
            dict.set_item("visible_pixels", found.visible_pixels)?;
            dict.set_item("unoccluded_pixels", found.unoccluded_pixels)?;
            dict.set_item("ratio", found.ratio())?;
            Ok(dict)
        };
        found.into_iter().map(row).collect()
    }

    fn __repr__(&self) -> String {
        let count = |level| self.inner.segments(level).len();
        format!(
            "<Segmentation: {} instances, {} links, {} classes>",
            count(SegmentLevel::Instance),
            count(SegmentLevel::Link),
            count(SegmentLevel::Semantic)
        )
    }
}

impl Segmentation {
    /// Calls `act` with a camera of the simulation; of a stereo camera, the left one.
    fn with_camera<T: Send>(
        &self,
        py: Python<'_>,
        sensor: &Bound<'_, Sensor>,
        act: impl FnOnce(&Camera) -> Result<T, SensorError> + Send,
    ) -> PyResult<T> {
        let sensor = sensor.get();
        if !Arc::ptr_eq(&self.shared, &sensor.shared) {
            let message = format!("the sensor {:?} belongs to another simulation", sensor.uid);
            return Err(Failure::new(Class::ForeignHandle, message).into());
        }
        self.shared.read(py, |sim| {
            let camera = camera_of(sim.entities().sensor_by_uid(&sensor.uid)?);
            Ok(act(camera.ok_or_else(|| not_a_camera(&sensor.uid))?)?)
        })
    }

    /// A dict with id and name of a segment.
    fn named<'py>(&self, py: Python<'py>, level: SegmentLevel, id: i32) -> PyResult<Bound<'py, PyDict>> {
        let segment = self.inner.segments(level).iter().find(|segment| segment.id == id);
        let dict = PyDict::new(py);
        dict.set_item("id", id)?;
        dict.set_item("name", segment.map(|segment| segment.name.as_str()))?;
        Ok(dict)
    }
}

fn level_of(name: &str) -> PyResult<SegmentLevel> {
    match name {
        "instance" => Ok(SegmentLevel::Instance),
        "link" => Ok(SegmentLevel::Link),
        "semantic" => Ok(SegmentLevel::Semantic),
        other => {
            let message = format!("unknown level {other:?}; \"instance\", \"link\" or \"semantic\"");
            Err(Failure::argument("level", message).into())
        }
    }
}
