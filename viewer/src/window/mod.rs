//! A native window onto a simulation that runs.

mod app;
mod desks;
mod enlarge;
mod fineness;
mod hud;
mod images;
mod keys;
#[cfg(test)]
mod tests;
mod timeline;
mod watch;
mod x11;

pub use app::{App, Input, Modifiers};
pub use images::{ImageWindow, ImageWindowCfg};
pub use keys::Key;

use crate::control::{Command, RecordButton, Speed, Viewer, Viewing, Wants};
use crate::stage::Canvas;
use kinetoscope_sim::SimulationManager;
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Condvar, Mutex, PoisonError, mpsc};
use std::time::{Duration, Instant};
use x11::{Failure, Happened, Screened};

/// A window.
#[derive(Clone, Debug, PartialEq)]
pub struct WindowCfg {
    /// What is written over it.
    pub title: String,
    /// Pixels per row, rows.
    pub size: [usize; 2],
    /// The X display, such as `:0`; that of the variable `DISPLAY` where `None`.
    pub display: Option<String>,
    /// How fast simulated time passes once it is open; `None` leaves it as it is.
    pub speed: Option<Speed>,
    /// Threads that draw, at most; as many as the machine has where `None`. Half of them, and at least one, draw where physics
    /// takes all the time that it can get ([`App::new`]).
    pub threads: Option<usize>,
    /// The simulation's record button; where `None`, the one that another view has brought, if any.
    pub recording: Option<RecordButton>,
}

impl Default for WindowCfg {
    fn default() -> Self {
        let (title, speed) = ("Kinetoscope".into(), Some(Speed::REAL));
        Self { title, size: [960, 540], display: None, speed, threads: None, recording: None }
    }
}

/// Why there is no window.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum WindowError {
    /// There is no display, or it cannot be reached.
    #[error(
        "no window can be opened: {reason} (DISPLAY is {}, WAYLAND_DISPLAY is {}). Set DISPLAY to an X server, which Wayland \
         desktops have too (XWayland), or run without a window: the examples with --headless, or with --serve for a \
         browser",
        shown(.display), shown(.wayland)
    )]
    NoDisplay {
        /// What was tried and what came of it.
        reason: String,
        /// The variable `DISPLAY`.
        display: Option<String>,
        /// The variable `WAYLAND_DISPLAY`.
        wayland: Option<String>,
    },
    /// The operating system gives no thread.
    #[error("no window can be opened: no thread for it: {0}")]
    Thread(String),
}

fn shown(variable: &Option<String>) -> String {
    variable.as_ref().map_or_else(|| "not set".into(), |value| format!("{value:?}"))
}

/// How a window ended.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Closed {
    /// The user closed it, or [`Window::close`] did.
    ByUser,
    /// The simulation was dropped.
    WithSimulation,
    /// The display was lost; the simulation went on.
    DisplayLost(String),
    /// A mistake of ours ended its thread; what it was stands in the program's error output. The simulation went on.
    Crashed,
}

impl Closed {
    /// What went wrong, where it was not meant to end.
    pub fn fault(&self) -> Option<&str> {
        match self {
            Self::ByUser | Self::WithSimulation => None,
            Self::DisplayLost(reason) => Some(reason),
            Self::Crashed => {
                Some("its thread panicked, which is a mistake in Kinetoscope: please report what stands above")
            }
        }
    }
}

/// A handle of an open window. Dropping it closes nothing: the window stays until the user closes it, the simulation is
/// dropped, or [`close`](Self::close).
#[derive(Clone, Debug)]
pub struct Window {
    shared: Arc<Shared>,
}

#[derive(Debug, Default)]
struct Shared {
    close: AtomicBool,
    number: AtomicU32,
    pictures: AtomicU64,
    closed: Mutex<Option<Closed>>,
    ended: Condvar,
}

impl Window {
    /// Whether it is open.
    pub fn is_open(&self) -> bool {
        self.closed().is_none()
    }

    /// How it ended; `None` while it is open.
    pub fn closed(&self) -> Option<Closed> {
        self.shared.closed.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// The window's number on its X display, for programs that take pictures of windows.
    pub fn number(&self) -> u32 {
        self.shared.number.load(Ordering::Acquire)
    }

    /// How many pictures it has handed to its display so far.
    pub fn pictures(&self) -> u64 {
        self.shared.pictures.load(Ordering::Acquire)
    }

    /// Asks it to close, and does not wait.
    pub fn close(&self) {
        self.shared.close.store(true, Ordering::Release);
    }

    /// Waits until it is closed, up to `timeout`: how it ended, `None` where it is still open.
    pub fn wait(&self, timeout: Duration) -> Option<Closed> {
        let closed = self.shared.closed.lock().unwrap_or_else(PoisonError::into_inner);
        let open = |closed: &mut Option<Closed>| closed.is_none();
        let waited = self.shared.ended.wait_timeout_while(closed, timeout, open);
        waited.unwrap_or_else(PoisonError::into_inner).0.clone()
    }
}

/// The end of a window's thread: whatever it comes from, whoever waits hears of it.
struct Ending(Arc<Shared>);

impl Ending {
    fn tell(&self, how: Closed) {
        self.0.closed.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(how);
        self.0.ended.notify_all();
    }
}

impl Drop for Ending {
    fn drop(&mut self) {
        self.tell(Closed::Crashed);
    }
}

/// Opens windows onto a simulation.
pub trait OpenWindow {
    /// Opens a window of 960 by 540 pixels in which time passes as it does outside; see
    /// [`open_window_with`](Self::open_window_with).
    ///
    /// # Errors
    /// As [`open_window_with`](Self::open_window_with).
    fn open_window(&mut self) -> Result<Window, WindowError> {
        self.open_window_with(WindowCfg::default())
    }

    /// Opens a window, on a thread of its own: it is drawn while `update` steps, and `update` waits where the user pauses.
    /// When it is closed, or its display is lost or does not answer for 15 s, the simulation goes on, as fast as it can. There
    /// may be several, one after the other or at the same time.
    ///
    /// # Errors
    /// [`WindowError::NoDisplay`] where there is none.
    fn open_window_with(&mut self, cfg: WindowCfg) -> Result<Window, WindowError>;
}

impl OpenWindow for SimulationManager {
    fn open_window_with(&mut self, mut cfg: WindowCfg) -> Result<Window, WindowError> {
        let button = cfg.recording.take();
        let (title, size, display) = (cfg.title.clone(), cfg.size, cfg.display.clone());
        let viewer = self.viewer(Wants::default());
        let speed = cfg.speed;
        let begin = move |viewer: &Viewer| {
            if let Some(speed) = speed {
                viewer.send(Command::SetSpeed(speed));
            }
        };
        let run = move |screen: Screened, viewer: Viewer, shared: &Shared| show(screen, &viewer, &cfg, shared);
        let window = on_thread(title, size, display, viewer, begin, run)?;
        button.into_iter().for_each(|button| self.record_button(button));
        Ok(window)
    }
}

/// Opens a window and calls `run` with it and with `state` on a thread of its own; `begin` is called before the window's handle
/// is returned. `state` is dropped before the end of the window is seen through the handle.
///
/// # Errors
/// [`WindowError::NoDisplay`] if there is no display or it does not answer.
fn on_thread<T: Send + 'static>(
    title: String,
    size: [usize; 2],
    display: Option<String>,
    state: T,
    begin: impl FnOnce(&T) + Send + 'static,
    run: impl FnOnce(Screened, T, &Shared) -> Result<Closed, Failure> + Send + 'static,
) -> Result<Window, WindowError> {
    let (opened, result) = mpsc::channel();
    let shared = Arc::new(Shared::default());
    let window = Window { shared: Arc::clone(&shared) };
    let thread_main = move || {
        let ending = Ending(Arc::clone(&shared));
        // Declared after the ending, so dropped before it when the thread panics.
        let state = state;
        let screen = match Screened::open(&title, size, display.as_deref()) {
            Ok(screen) => screen,
            Err(failure) => return drop(opened.send(Err(no_display(&failure)))),
        };
        shared.number.store(screen.number(), Ordering::Release);
        begin(&state);
        // The caller has given up if the display took too long.
        if opened.send(Ok(())).is_err() {
            return;
        }
        let closed = run(screen, state, &shared).unwrap_or_else(|failure| Closed::DisplayLost(failure.to_string()));
        ending.tell(closed);
    };
    let thread = std::thread::Builder::new().name("kinetoscope-window".into());
    thread.spawn(thread_main).map_err(|error| WindowError::Thread(error.to_string()))?;
    match result.recv_timeout(watch::PATIENCE) {
        Ok(Ok(())) => Ok(window),
        Ok(Err(error)) => Err(error),
        Err(mpsc::RecvTimeoutError::Timeout) => Err(no_display(&Failure::Frozen)),
        Err(mpsc::RecvTimeoutError::Disconnected) => {
            Err(WindowError::Thread("it ended before the window was there".into()))
        }
    }
}

fn no_display(failure: &Failure) -> WindowError {
    let variable = |name: &str| std::env::var_os(name).map(|value| value.to_string_lossy().into_owned());
    let (display, wayland) = (variable("DISPLAY"), variable("WAYLAND_DISPLAY"));
    WindowError::NoDisplay { reason: failure.to_string(), display, wayland }
}

/// Longest time between two looks at what the user does.
const LOOK: Duration = Duration::from_millis(10);

/// Shows snapshots until something ends it.
fn show(mut screen: Screened, viewer: &Viewer, cfg: &WindowCfg, shared: &Shared) -> Result<Closed, Failure> {
    let cores = std::thread::available_parallelism().map_or(1, std::num::NonZeroUsize::get);
    let mut app = App::new(screen.picture_size(), cfg.threads.unwrap_or(cores));
    app.keep_pace();
    let mut canvas = Canvas::default();
    let (mut last, mut wants) = (0, Wants::default());
    let mut outdated = true;
    // Before the first key, which would do nothing where nothing is shown.
    if let Some(snapshot) = viewer.newest() {
        last = snapshot.number;
        app.show(snapshot);
    }
    loop {
        for happened in screen.poll()? {
            match happened {
                Happened::Input(input) => app.handle(input),
                Happened::Exposed => {}
                Happened::Close => return Ok(Closed::ByUser),
            }
            outdated = true;
        }
        if shared.close.load(Ordering::Acquire) {
            return Ok(Closed::ByUser);
        }
        if viewer.is_over() {
            return Ok(Closed::WithSimulation);
        }
        if app.wants() != wants {
            wants = app.wants();
            viewer.set_wants(wants);
        }
        for command in app.take_commands() {
            app.was_heard(viewer.send(command));
            outdated = true;
        }
        if let Some(snapshot) = viewer.wait(last, LOOK) {
            last = snapshot.number;
            app.show(snapshot);
            outdated = true;
        }
        if outdated || app.moves(Instant::now()) {
            app.draw(&mut canvas, Instant::now());
            let drawn = Instant::now();
            screen.present(&canvas)?;
            app.handed_over(drawn.elapsed());
            shared.pictures.fetch_add(1, Ordering::AcqRel);
            outdated = false;
        }
    }
}
