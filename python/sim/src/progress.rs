//! Progress of path tracing.

use crate::sensor::Sensor;
use crate::shared::guarded;
use kinetoscope::sensors::camera::Camera;
use pyo3::prelude::*;

/// Progress of the path tracing of a camera, made by ``Sensor.progress``. Another thread can watch and cancel a read of the
/// camera: the values do not wait for the simulation.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct RenderProgress {
    inner: kinetoscope::render::RenderProgress,
}

#[pymethods]
impl Sensor {
    /// Progress of the path tracing of a camera, and a way to cancel it from another thread; of a pair, those of the left camera.
    #[getter]
    fn progress(&self, py: Python<'_>) -> PyResult<RenderProgress> {
        self.of_camera(py, |camera: &Camera| Ok(RenderProgress { inner: camera.progress().clone() }))
    }
}

#[pymethods]
impl RenderProgress {
    /// Number of paths of the images that are traced so far.
    #[getter]
    fn samples(&self) -> u64 {
        self.inner.samples()
    }

    /// Number of paths of the images: pixels times samples.
    #[getter]
    fn total(&self) -> u64 {
        self.inner.total()
    }

    /// Number of rays, for the paths themselves and for shadows.
    #[getter]
    fn rays(&self) -> u64 {
        self.inner.rays()
    }

    /// Finished fraction, 0 to 1; None without any paths.
    #[getter]
    fn fraction(&self) -> Option<f64> {
        self.inner.fraction()
    }

    /// Time since the start of the path tracing [s], also after its end; None before the first.
    #[getter]
    fn elapsed(&self) -> PyResult<Option<f64>> {
        Ok(guarded(|| Ok(self.inner.elapsed().map(|time| time.as_secs_f64())))?)
    }

    /// Estimated time left [s], at the mean speed so far; None before the first path.
    #[getter]
    fn remaining(&self) -> PyResult<Option<f64>> {
        Ok(guarded(|| Ok(self.inner.remaining().map(|time| time.as_secs_f64())))?)
    }

    /// True after ``cancel``, until ``resume``.
    #[getter]
    fn is_canceled(&self) -> bool {
        self.inner.is_canceled()
    }

    /// Cancels the current path tracing, whose read raises ``SensorError``, and any that starts before ``resume``.
    fn cancel(&self) {
        self.inner.cancel();
    }

    /// Allows path tracing again. The camera renders canceled images when they are read again.
    fn resume(&self) {
        self.inner.resume();
    }

    fn __repr__(&self) -> String {
        let (samples, total) = (self.inner.samples(), self.inner.total());
        let canceled = if self.inner.is_canceled() { ", canceled" } else { "" };
        format!("<RenderProgress: {samples} of {total} paths{canceled}>")
    }
}
