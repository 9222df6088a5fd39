//! Native X11 windows: a live view of a simulation, and a window for images.

mod adaptive_quality;
mod app;
mod hud;
mod images;
mod key_bindings;
mod server_scaling;
#[cfg(test)]
mod tests;
mod thread_budget;
mod timeline;
mod watchdog;
mod x11;

pub use app::{App, Input, Modifiers};
pub use images::{ImageWindow, ImageWindowCfg};
pub use key_bindings::Key;

use crate::control::{Command, RecordButton, SnapshotRequest, Speed, Viewer, ViewerExt};
use crate::scene_view::Canvas;
use kinetoscope_sim::SimulationManager;
use serde::{Deserialize, Serialize};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};
use x11::{DisplayError, WindowEvent, XWindow};

/// Settings of a simulation window.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WindowCfg {
    /// Text of the title bar.
    pub title: String,
    /// Initial size: pixels per row, rows.
    pub size: [usize; 2],
    /// X display, such as `:0`. `None` uses the environment variable `DISPLAY`.
    pub display: Option<String>,
    /// Speed of simulated time after the window opens, real time by default; `update` waits to keep it. `None` keeps
    /// the current speed.
    pub speed: Option<Speed>,
    /// Maximum number of rendering threads. `None` uses every core. Half of them, but at least one, render while
    /// physics needs all available time ([`App::new`]).
    pub threads: Option<usize>,
    /// Record button of the simulation. `None` keeps the button that another view has set, if any. Not part of files.
    #[serde(skip)]
    pub record_button: Option<RecordButton>,
}

impl Default for WindowCfg {
    fn default() -> Self {
        let (title, speed) = ("Kinetoscope".into(), Some(Speed::REAL_TIME));
        Self { title, size: [960, 540], display: None, speed, threads: None, record_button: None }
    }
}

/// An error of opening a window.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WindowError {
    /// No X display is set, the connection to it failed, or the display does not respond or has unsupported pixels.
    #[error(
        "no window can be opened: {reason} (DISPLAY is {}, WAYLAND_DISPLAY is {}). Set DISPLAY to an X server, which Wayland \
         desktops provide as XWayland, or run without a window: the examples with --headless, or with --serve for a \
         browser",
        quoted(.display), quoted(.wayland)
    )]
    NoDisplay {
        /// Attempted connection and its error.
        reason: String,
        /// Value of the environment variable `DISPLAY`.
        display: Option<String>,
        /// Value of the environment variable `WAYLAND_DISPLAY`.
        wayland: Option<String>,
    },
    /// The operating system could not start a thread, or the thread ended early.
    #[error("no window can be opened: its thread failed: {0}")]
    Thread(String),
}

fn quoted(variable: &Option<String>) -> String {
    variable.as_ref().map_or_else(|| "not set".into(), |value| format!("{value:?}"))
}

/// Reason for the end of a window.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Closed {
    /// Closed by the user or by [`Window::close`].
    ByUser,
    /// Closed because the simulation was dropped.
    WithSimulation,
    /// The connection to the display was lost, with the reason. The simulation continued.
    DisplayLost(String),
    /// A panic (a bug of this crate) ended the window's thread; the program's standard error has the message. The
    /// simulation continued.
    Crashed,
}

impl Closed {
    /// Returns the description of an unexpected end, or `None` for a regular end.
    pub fn error(&self) -> Option<&str> {
        match self {
            Self::ByUser | Self::WithSimulation => None,
            Self::DisplayLost(reason) => Some(reason),
            Self::Crashed => {
                Some("its thread panicked, which is a bug in Kinetoscope: please report the message above")
            }
        }
    }
}

/// Handle of an open window; clones refer to the same window. Dropping the handle does not close the window. It stays
/// open until the user closes it, the simulation is dropped, or [`close`](Self::close) is called.
#[derive(Clone, Debug)]
pub struct Window {
    shared: Arc<WindowState>,
}

#[derive(Debug, Default)]
struct WindowState {
    close: AtomicBool,
    window_id: AtomicU32,
    frames: AtomicU64,
    closed: Mutex<Option<Closed>>,
    ended: Condvar,
}

impl Window {
    /// True while the window is open.
    pub fn is_open(&self) -> bool {
        self.closed().is_none()
    }

    /// Returns the reason for the end of the window, or `None` while it is open.
    pub fn closed(&self) -> Option<Closed> {
        self.shared.closed.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Returns the X11 window id, for tools that capture windows.
    pub fn id(&self) -> u32 {
        self.shared.window_id.load(Ordering::Acquire)
    }

    /// Returns the number of frames sent to the display since the window was opened, redraws included.
    pub fn frame_count(&self) -> u64 {
        self.shared.frames.load(Ordering::Acquire)
    }

    /// Requests the window to close, without waiting.
    pub fn close(&self) {
        self.shared.close.store(true, Ordering::Release);
    }

    /// Waits up to `timeout` until the window is closed. Returns the reason, or `None` if the window is still open.
    pub fn wait(&self, timeout: Duration) -> Option<Closed> {
        let closed = self.shared.closed.lock().unwrap_or_else(PoisonError::into_inner);
        let open = |closed: &mut Option<Closed>| closed.is_none();
        let waited = self.shared.ended.wait_timeout_while(closed, timeout, open);
        waited.unwrap_or_else(PoisonError::into_inner).0.clone()
    }
}

/// Reports the end of a window's thread to waiting callers. When dropped without a report, it reports a crash.
struct EndGuard(Arc<WindowState>);

impl EndGuard {
    fn report(&self, how: Closed) {
        self.0.closed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(how);
        self.0.ended.notify_all();
    }
}

impl Drop for EndGuard {
    fn drop(&mut self) {
        self.report(Closed::Crashed);
    }
}

/// Windows of a simulation.
pub trait OpenWindow {
    /// Opens a window of 960 by 540 pixels that runs the simulation in real time. See
    /// [`open_window_with`](Self::open_window_with).
    ///
    /// # Errors
    /// The errors of [`open_window_with`](Self::open_window_with).
    fn open_window(&mut self) -> Result<Window, WindowError> {
        self.open_window_with(WindowCfg::default())
    }

    /// Opens a window on its own thread. The window renders while `update` steps. `update` blocks while the user
    /// pauses, and waits while the simulation is ahead of the chosen speed.
    ///
    /// After the window is closed, its display is lost, or the display does not respond for 15 s, the simulation
    /// continues as fast as it can, or at the speed that another viewer has set. Several windows may be open at the
    /// same time.
    ///
    /// # Errors
    /// [`WindowError::NoDisplay`] if no display is available, [`WindowError::Thread`] if no thread can be started.
    fn open_window_with(&mut self, cfg: WindowCfg) -> Result<Window, WindowError>;
}

impl OpenWindow for SimulationManager {
    fn open_window_with(&mut self, mut cfg: WindowCfg) -> Result<Window, WindowError> {
        let button = cfg.record_button.take();
        let (title, size, display) = (cfg.title.clone(), cfg.size, cfg.display.clone());
        let viewer = self.viewer(SnapshotRequest::default());
        let speed = cfg.speed;
        let begin = move |viewer: &Viewer| {
            if let Some(speed) = speed {
                viewer.send(Command::SetSpeed(speed));
            }
        };
        let run =
            move |screen: XWindow, viewer: Viewer, shared: &WindowState| run_window_loop(screen, &viewer, &cfg, shared);
        let window = spawn_window(title, size, display, viewer, begin, run)?;
        button.into_iter().for_each(|button| self.set_record_button(button));
        Ok(window)
    }
}

/// Opens a window and calls `run` with the window and `state` on a new thread. `begin` is called before the handle is
/// returned. `state` is dropped before the handle reports the end of the window.
///
/// # Errors
/// [`WindowError::NoDisplay`] if no display is available or it does not respond; [`WindowError::Thread`] if no thread
/// can be started.
fn spawn_window<T: Send + 'static>(
    title: String,
    size: [usize; 2],
    display: Option<String>,
    state: T,
    begin: impl FnOnce(&T) + Send + 'static,
    run: impl FnOnce(XWindow, T, &WindowState) -> Result<Closed, DisplayError> + Send + 'static,
) -> Result<Window, WindowError> {
    let (opened, result) = mpsc::channel();
    let shared = Arc::new(WindowState::default());
    let window = Window { shared: Arc::clone(&shared) };
    let thread_main = move || {
        let ending = EndGuard(Arc::clone(&shared));
        // Declared after `ending`, so `state` is dropped first if the thread panics.
        let state = state;
        let screen = match XWindow::open(&title, size, display.as_deref()) {
            Ok(screen) => screen,
            Err(failure) => return drop(opened.send(Err(no_display(&failure)))),
        };
        shared.window_id.store(screen.window_id(), Ordering::Release);
        begin(&state);
        // The send fails if the caller stopped waiting because the display took too long.
        if opened.send(Ok(())).is_err() {
            return;
        }
        let closed = run(screen, state, &shared).unwrap_or_else(|failure| {
            let reason = failure.to_string();
            tracing::warn!(target: "kinetoscope_viewer", reason, "the window lost its display");
            Closed::DisplayLost(reason)
        });
        ending.report(closed);
    };
    let thread = std::thread::Builder::new().name("kinetoscope-window".into());
    thread.spawn(thread_main).map_err(|error| WindowError::Thread(error.to_string()))?;
    match result.recv_timeout(watchdog::TIMEOUT) {
        Ok(Ok(())) => Ok(window),
        Ok(Err(error)) => Err(error),
        Err(mpsc::RecvTimeoutError::Timeout) => Err(no_display(&DisplayError::Unresponsive)),
        Err(mpsc::RecvTimeoutError::Disconnected) => {
            Err(WindowError::Thread("it ended before the window was open".into()))
        }
    }
}

fn no_display(failure: &DisplayError) -> WindowError {
    let variable = |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
    let (display, wayland) = (variable("DISPLAY"), variable("WAYLAND_DISPLAY"));
    WindowError::NoDisplay { reason: failure.to_string(), display, wayland }
}

/// Longest wait for a snapshot or an image between two checks for user input.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// Shows snapshots until the window closes.
fn run_window_loop(
    mut screen: XWindow,
    viewer: &Viewer,
    cfg: &WindowCfg,
    shared: &WindowState,
) -> Result<Closed, DisplayError> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let mut app = App::new(screen.image_size(), cfg.threads.unwrap_or(cores));
    app.enable_adaptive_quality();
    let mut canvas = Canvas::default();
    let (mut last, mut wants) = (0, SnapshotRequest::default());
    let mut outdated = true;
    // The first snapshot is shown before the first key, because keys have no effect without a snapshot.
    if let Some(snapshot) = viewer.newest() {
        last = snapshot.number;
        app.set_snapshot(snapshot);
    }
    loop {
        for happened in screen.poll()? {
            match happened {
                WindowEvent::Input(input) => app.handle(input),
                WindowEvent::Exposed => {}
                WindowEvent::Close => return Ok(Closed::ByUser),
            }
            outdated = true;
        }
        if shared.close.load(Ordering::Acquire) {
            return Ok(Closed::ByUser);
        }
        if viewer.has_ended() {
            return Ok(Closed::WithSimulation);
        }
        if app.snapshot_request() != wants {
            wants = app.snapshot_request();
            viewer.set_request(wants);
        }
        for command in app.take_commands() {
            app.set_send_result(viewer.send(command));
            outdated = true;
        }
        if let Some(snapshot) = viewer.wait(last, POLL_INTERVAL) {
            last = snapshot.number;
            app.set_snapshot(snapshot);
            outdated = true;
        }
        if outdated || app.needs_redraw(Instant::now()) {
            app.draw(&mut canvas, Instant::now());
            let drawn = Instant::now();
            screen.present(&canvas)?;
            app.set_send_duration(drawn.elapsed());
            shared.frames.fetch_add(1, Ordering::AcqRel);
            outdated = false;
        }
    }
}
