//! Windows, browser views and screenshots.

use crate::errors::Failure;
use crate::shared::Shared;
use crate::simulation::Simulation;
use crate::values::Values;
use kinetoscope::ndarray::Array3;
use kinetoscope::prelude::{OpenWindow as _, Screenshot as _, Serve as _};
use kinetoscope::viewer::{EnvSelection, OrbitCamera, ScreenshotCfg, ServeCfg, ServerHandle, Speed, WindowCfg};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;

/// A browser view of a simulation.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Server {
    shared: Arc<Shared>,
    inner: ServerHandle,
}

#[pymethods]
impl Server {
    /// Address to open in a browser.
    #[getter]
    fn url(&self) -> &str {
        self.inner.url()
    }

    /// Number of connected browsers.
    #[getter]
    fn viewers(&self) -> usize {
        self.inner.viewers()
    }

    /// Disconnects all browsers and stops listening.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.write(py, |sim| Ok(self.inner.close(sim)?))
    }

    fn __repr__(&self) -> String {
        // Without the token, so that a notebook or a log does not give access.
        format!("<Server at {}>", self.inner.address())
    }
}

/// A window of a simulation.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Window {
    inner: kinetoscope::viewer::Window,
}

#[pymethods]
impl Window {
    /// True while the window is open.
    #[getter]
    fn is_open(&self) -> bool {
        self.inner.is_open()
    }

    /// Number of frames sent to the display.
    #[getter]
    fn frame_count(&self) -> u64 {
        self.inner.frame_count()
    }

    /// Requests the window to close, without waiting.
    fn close(&self) {
        self.inner.close();
    }

    fn __repr__(&self) -> &'static str {
        if self.inner.is_open() { "<Window, open>" } else { "<Window, closed>" }
    }
}

#[pymethods]
impl Simulation {
    /// Serves the simulation to browsers; port 0 selects a free port. ``speed`` is simulated seconds per second, or
    /// None for no limit. ``allow_local_frames`` lets web pages of this machine show the view in a frame, as notebooks do.
    #[pyo3(signature = (address="127.0.0.1:0", *, speed=None, max_fps=None, max_viewers=None, jpeg_quality=None,
        allow_local_frames=false))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn serve(
        &self,
        py: Python<'_>,
        address: &str,
        speed: Option<f64>,
        max_fps: Option<f64>,
        max_viewers: Option<usize>,
        jpeg_quality: Option<u8>,
        allow_local_frames: bool,
    ) -> PyResult<Server> {
        let defaults = ServeCfg::default();
        let cfg = ServeCfg {
            speed: speed.map(Speed::Factor),
            max_fps: max_fps.unwrap_or(defaults.max_fps),
            max_viewers: max_viewers.unwrap_or(defaults.max_viewers),
            jpeg_quality: jpeg_quality.unwrap_or(defaults.jpeg_quality),
            allow_local_frames,
            ..defaults
        };
        let inner = self.shared.write_with_threads(py, |sim| Ok(sim.serve_with(address, cfg)?))?;
        Ok(Server { shared: Arc::clone(&self.shared), inner })
    }

    /// Opens a window that shows the simulation while it steps, in real time unless ``speed`` is another factor, or
    /// None for no limit. Raises ``ViewerError`` without a display.
    #[pyo3(signature = (title=None, size=None, *, speed=1.0, display=None))]
    fn open_window(
        &self,
        py: Python<'_>,
        title: Option<String>,
        size: Option<[usize; 2]>,
        speed: Option<f64>,
        display: Option<String>,
    ) -> PyResult<Window> {
        let defaults = WindowCfg::default();
        let cfg = WindowCfg {
            title: title.unwrap_or(defaults.title),
            size: size.unwrap_or(defaults.size),
            speed: Some(speed.map_or(Speed::Unlimited, Speed::Factor)),
            display,
            ..WindowCfg::default()
        };
        let inner = self.shared.write_with_threads(py, |sim| Ok(sim.open_window_with(cfg)?))?;
        Ok(Window { inner })
    }

    /// Image of all environments, or of one, RGBA, shape (height, width, 4). With a path, a PNG file is written
    /// instead. ``eye`` and ``target`` place the camera [m].
    #[pyo3(signature = (path=None, *, size=[960, 540], env=None, eye=None, target=None))]
    fn screenshot<'py>(
        &self,
        py: Python<'py>,
        path: Option<PathBuf>,
        size: [usize; 2],
        env: Option<usize>,
        eye: Option<[f64; 3]>,
        target: Option<[f64; 3]>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let camera = match (eye, target) {
            (None, None) => None,
            (Some(eye), Some(target)) => {
                let camera = OrbitCamera::look_at(eye, target);
                Some(
                    camera
                        .ok_or_else(|| Failure::argument("screenshot", "eye and target must be finite and differ"))?,
                )
            }
            _ => return Err(Failure::argument("screenshot", "give both eye and target, or neither").into()),
        };
        let envs = env.map_or(EnvSelection::All, EnvSelection::One);
        let cfg = ScreenshotCfg { size, camera, envs, ..ScreenshotCfg::default() };
        let image = self.shared.write(py, |sim| {
            if let Some(path) = &path {
                sim.screenshot_with(path, &cfg)?;
                return Ok(None);
            }
            let canvas = sim.render_image(&cfg)?;
            let [width, height] = canvas.dimensions();
            let bytes = canvas.bytes().to_vec();
            Ok(Array3::from_shape_vec((height, width, 4), bytes).ok())
        })?;
        Ok(image.map(|image| Values::from(image).into_python(py)))
    }

    /// Browser view in a frame, for notebooks whose browser runs on this machine. The view stays open while the
    /// simulation exists.
    #[pyo3(signature = (width=960, height=540))]
    fn show(slf: &Bound<'_, Self>, width: u32, height: u32) -> PyResult<Py<PyAny>> {
        let py = slf.py();
        let server = slf.get().serve(py, "127.0.0.1:0", None, None, None, None, true)?;
        let frame = py.import("kinetoscope.notebook")?.getattr("Frame")?;
        frame.call1((server, width, height)).map(Bound::unbind)
    }
}
