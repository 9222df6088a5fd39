//! Windows, browser views and screenshots.

use crate::arguments::{bytes, time_limit};
use crate::cfg;
use crate::errors::Failure;
use crate::file_recording::FileRecording;
use crate::shared::{Process, SIGNAL_INTERVAL, Shared, detached, guarded};
use crate::simulation::Simulation;
use crate::values::Values;
use crate::viewer_control::check_speed;
use kinetoscope::ndarray::{Array3, ArrayD};
use kinetoscope::prelude::{OpenWindow as _, Screenshot as _, Serve as _};
use kinetoscope::viewer::{
    Canvas, EnvSelection, ImageWindowCfg, OrbitCamera, ScreenshotCfg, ServeCfg, ServerHandle, Speed, WindowCfg,
};
use pyo3::prelude::*;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Instant;

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
    pub(crate) shared: Arc<Shared>,
    pub(crate) inner: kinetoscope::viewer::Window,
}

/// Waits until a window is closed, at most `timeout` seconds, and returns true if it is.
fn wait_until_closed(py: Python<'_>, window: &kinetoscope::viewer::Window, timeout: Option<f64>) -> PyResult<bool> {
    let longest = time_limit(timeout, "timeout")?;
    let started = Instant::now();
    // In short waits, so that Ctrl+C ends the call.
    while let Some(left) = longest.checked_sub(started.elapsed()) {
        if detached(py, || Ok(window.wait(left.min(SIGNAL_INTERVAL))))?.is_some() {
            return Ok(true);
        }
        py.check_signals()?;
    }
    Ok(!window.is_open())
}

/// Error that closed a window.
fn failure(window: &kinetoscope::viewer::Window) -> Option<String> {
    window.closed().and_then(|closed| closed.error().map(String::from))
}

impl Window {
    /// The window. Fails in a forked process, which does not have its thread.
    fn window(&self) -> Result<&kinetoscope::viewer::Window, Failure> {
        self.shared.process().check("this window")?;
        Ok(&self.inner)
    }
}

#[pymethods]
impl Window {
    /// True while the window is open.
    #[getter]
    fn is_open(&self) -> PyResult<bool> {
        Ok(self.window()?.is_open())
    }

    /// Number of frames sent to the display.
    #[getter]
    fn frame_count(&self) -> PyResult<u64> {
        Ok(self.window()?.frame_count())
    }

    /// Waits until the window is closed, at most ``timeout`` seconds, and returns True if it is. The user, a call of
    /// ``close`` or the end of the simulation closes it.
    #[pyo3(signature = (timeout=None))]
    fn wait(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<bool> {
        wait_until_closed(py, self.window()?, timeout)
    }

    /// Error that closed the window, such as a lost display; None if it is open or was closed as intended.
    #[getter]
    fn failure(&self) -> PyResult<Option<String>> {
        Ok(guarded(|| Ok(failure(self.window()?)))?)
    }

    /// Requests the window to close, without waiting.
    fn close(&self) -> PyResult<()> {
        self.window()?.close();
        Ok(())
    }

    fn __repr__(&self) -> &'static str {
        match self.window() {
            Err(_) => "<Window of another process>",
            Ok(window) if window.is_open() => "<Window, open>",
            Ok(_) => "<Window, closed>",
        }
    }
}

/// A window for images that the program computes, such as the channels of a camera. It has a thread of its own, so it stays
/// responsive while the program computes. It closes with ``close``, or when the object is dropped.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct ImageWindow {
    inner: kinetoscope::viewer::ImageWindow,
    process: Process,
}

impl ImageWindow {
    /// The window. Fails in a forked process, which does not have its thread.
    fn images(&self) -> Result<&kinetoscope::viewer::ImageWindow, Failure> {
        self.process.check("this window")?;
        Ok(&self.inner)
    }

    fn window(&self) -> Result<&kinetoscope::viewer::Window, Failure> {
        Ok(self.images()?.window())
    }
}

#[pymethods]
impl ImageWindow {
    /// Opens an empty (black) window. ``size`` is its initial width and height [pixels], ``display`` an X display such as
    /// ``":0"`` in place of the environment variable ``DISPLAY``. Raises ``ViewerError`` without a display.
    #[new]
    #[pyo3(signature = (title=None, size=None, *, display=None))]
    fn new(py: Python<'_>, title: Option<String>, size: Option<[usize; 2]>, display: Option<String>) -> PyResult<Self> {
        let defaults = ImageWindowCfg::default();
        let (title, size) = (title.unwrap_or(defaults.title), size.unwrap_or(defaults.size));
        check_size(size)?;
        let cfg = ImageWindowCfg { title, size, display };
        let inner = detached(py, || Ok(kinetoscope::viewer::ImageWindow::open(cfg)?))?;
        Ok(Self { inner, process: Process::current() })
    }

    /// Replaces the image and returns at once: uint8, shape (height, width, 4) or (height, width, 3). It is scaled to fit into the
    /// window. Without effect after the window was closed.
    fn show(&self, py: Python<'_>, image: &Bound<'_, PyAny>) -> PyResult<()> {
        let pixels = bytes(image, "image")?;
        detached(py, || {
            self.images()?.show(canvas(&pixels)?);
            Ok(())
        })
    }

    /// True while the window is open.
    #[getter]
    fn is_open(&self) -> PyResult<bool> {
        Ok(self.window()?.is_open())
    }

    /// Number of frames sent to the display.
    #[getter]
    fn frame_count(&self) -> PyResult<u64> {
        Ok(self.window()?.frame_count())
    }

    /// Waits until the window is closed, at most ``timeout`` seconds, and returns True if it is.
    #[pyo3(signature = (timeout=None))]
    fn wait(&self, py: Python<'_>, timeout: Option<f64>) -> PyResult<bool> {
        wait_until_closed(py, self.window()?, timeout)
    }

    /// Error that closed the window, such as a lost display; None if it is open or was closed as intended.
    #[getter]
    fn failure(&self) -> PyResult<Option<String>> {
        Ok(guarded(|| Ok(failure(self.window()?)))?)
    }

    /// Requests the window to close, without waiting.
    fn close(&self) -> PyResult<()> {
        self.window()?.close();
        Ok(())
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, _exception: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        self.close()
    }

    fn __repr__(&self) -> &'static str {
        match self.window() {
            Err(_) => "<ImageWindow of another process>",
            Ok(window) if window.is_open() => "<ImageWindow, open>",
            Ok(_) => "<ImageWindow, closed>",
        }
    }
}

/// Refuses a size of a window without pixels.
fn check_size(size: [usize; 2]) -> PyResult<()> {
    if size.contains(&0) {
        return Err(Failure::argument("size", format!("{size:?} has no pixels")).into());
    }
    Ok(())
}

/// Image of an array of RGBA or RGB pixels.
fn canvas(pixels: &ArrayD<u8>) -> Result<Canvas, Failure> {
    let wrong = || {
        let problem = format!("shape {:?}; expected (height, width, 4) or (height, width, 3)", pixels.shape());
        Failure::argument("image", problem)
    };
    let &[height, width, components] = pixels.shape() else { return Err(wrong()) };
    if !matches!(components, 3 | 4) || width == 0 || height == 0 {
        return Err(wrong());
    }
    let mut rgba = vec![255; 4 * width * height];
    for (to, from) in rgba.chunks_exact_mut(4).zip(pixels.rows()) {
        to.iter_mut().zip(from).for_each(|(to, from)| *to = *from);
    }
    Canvas::from_rgba(width, height, &rgba).ok_or_else(wrong)
}

#[pymethods]
impl Simulation {
    /// Serves the simulation to browsers; port 0 selects a free port. ``cfg`` is a ``ServeCfg``; keyword arguments replace
    /// its fields. ``speed`` is simulated seconds per second. ``allow_local_frames`` lets web pages of this machine show the
    /// view in a frame, as notebooks do. ``record_button`` is the ``file_recording`` that the record button starts and stops.
    #[pyo3(signature = (address="127.0.0.1:0", *, speed=None, max_fps=None, max_viewers=None, jpeg_quality=None,
        allow_local_frames=None, record_button=None, cfg=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn serve(
        &self,
        py: Python<'_>,
        address: &str,
        speed: Option<f64>,
        max_fps: Option<f64>,
        max_viewers: Option<usize>,
        jpeg_quality: Option<u8>,
        allow_local_frames: Option<bool>,
        record_button: Option<&Bound<'_, FileRecording>>,
        cfg: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Server> {
        let button = record_button.map(|button| button.get().button(&self.shared, "serve")).transpose()?;
        let base = match cfg {
            None => ServeCfg::default(),
            Some(cfg) => cfg::of_table("ServeCfg", speed_table("ServeCfg", cfg)?.0)?,
        };
        let cfg = ServeCfg {
            speed: speed.map(Speed::Factor).or(base.speed),
            max_fps: max_fps.unwrap_or(base.max_fps),
            max_viewers: max_viewers.unwrap_or(base.max_viewers),
            jpeg_quality: jpeg_quality.unwrap_or(base.jpeg_quality),
            allow_local_frames: allow_local_frames.unwrap_or(base.allow_local_frames),
            record_button: button,
        };
        check_speed(cfg.speed, "speed")?;
        if !(cfg.max_fps > 0.0 && cfg.max_fps.is_finite()) {
            let problem = format!("{} is not a number of images per second above 0", cfg.max_fps);
            return Err(Failure::argument("max_fps", problem).into());
        }
        if !(1..=100).contains(&cfg.jpeg_quality) {
            return Err(Failure::argument("jpeg_quality", format!("{} is not from 1 to 100", cfg.jpeg_quality)).into());
        }
        let inner = self.shared.write_with_threads(py, |sim| Ok(sim.serve_with(address, cfg)?))?;
        Ok(Server { shared: Arc::clone(&self.shared), inner })
    }

    /// Opens a window that shows the simulation while it steps, in real time unless ``speed`` is another factor, or
    /// None for no limit. ``record_button`` is the ``file_recording`` that the record button starts and stops. ``cfg`` is a
    /// ``WindowCfg``, in place of the arguments before ``record_button``. Raises ``ViewerError`` without a display.
    #[pyo3(signature = (title=None, size=None, *, speed=1.0, display=None, record_button=None, cfg=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn open_window(
        &self,
        py: Python<'_>,
        title: Option<String>,
        size: Option<[usize; 2]>,
        speed: Option<f64>,
        display: Option<String>,
        record_button: Option<&Bound<'_, FileRecording>>,
        cfg: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Window> {
        let button = record_button.map(|button| button.get().button(&self.shared, "open_window")).transpose()?;
        let cfg = if let Some(cfg) = cfg {
            if title.is_some() || size.is_some() || display.is_some() || speed != Some(1.0) {
                return Err(Failure::argument("open_window", "give cfg or the other arguments, not both").into());
            }
            let (table, keeps_speed) = speed_table("WindowCfg", cfg)?;
            let cfg: WindowCfg = cfg::of_table("WindowCfg", table)?;
            if keeps_speed { WindowCfg { speed: None, ..cfg } } else { cfg }
        } else {
            let defaults = WindowCfg::default();
            WindowCfg {
                title: title.unwrap_or(defaults.title),
                size: size.unwrap_or(defaults.size),
                speed: Some(speed.map_or(Speed::Unlimited, Speed::Factor)),
                display,
                ..WindowCfg::default()
            }
        };
        check_speed(cfg.speed, "speed")?;
        check_size(cfg.size)?;
        let cfg = WindowCfg { record_button: button, ..cfg };
        let inner = self.shared.write_with_threads(py, |sim| Ok(sim.open_window_with(cfg)?))?;
        Ok(Window { shared: Arc::clone(&self.shared), inner })
    }

    /// Image of all environments, or of one, RGBA, uint8, shape (height, width, 4). With a path, a PNG file is written
    /// instead. ``eye`` and ``target`` place the camera [m]. ``cfg`` is a ``ScreenshotCfg``; the other arguments replace its
    /// fields.
    #[pyo3(signature = (path=None, *, size=None, env=None, eye=None, target=None, cfg=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn screenshot<'py>(
        &self,
        py: Python<'py>,
        path: Option<PathBuf>,
        size: Option<[usize; 2]>,
        env: Option<usize>,
        eye: Option<[f64; 3]>,
        target: Option<[f64; 3]>,
        cfg: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<Option<Bound<'py, PyAny>>> {
        let base: ScreenshotCfg =
            cfg.map_or(Ok(ScreenshotCfg::default()), |cfg| cfg::read("ScreenshotCfg", Some(cfg)))?;
        let camera = match (eye, target) {
            (None, None) => base.camera,
            (Some(eye), Some(target)) => {
                let camera = OrbitCamera::look_at(eye, target);
                Some(
                    camera
                        .ok_or_else(|| Failure::argument("screenshot", "eye and target must be finite and differ"))?,
                )
            }
            _ => return Err(Failure::argument("screenshot", "give both eye and target, or neither").into()),
        };
        let envs = env.map_or(base.envs, EnvSelection::One);
        let cfg = ScreenshotCfg { size: size.unwrap_or(base.size), camera, envs, ..base };
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
        if width == 0 || height == 0 {
            let problem = format!("width {width} and height {height}; both must be at least 1 pixel");
            return Err(Failure::argument("show", problem).into());
        }
        let server = slf.get().serve(py, "127.0.0.1:0", None, None, None, None, Some(true), None, None)?;
        let frame = py.import("kinetoscope.notebook")?.getattr("Frame")?;
        frame.call1((server, width, height)).map(Bound::unbind)
    }
}

/// Fields of a configuration with a speed, and true if the speed is None, which a table cannot contain.
fn speed_table(class: &str, cfg: &Bound<'_, PyAny>) -> PyResult<(toml::Table, bool)> {
    let mut table = cfg::table(class, Some(cfg), None)?;
    let is_none = table.get("speed").and_then(toml::Value::as_bool) == Some(false);
    if is_none {
        table.remove("speed");
    }
    Ok((table, is_none))
}
