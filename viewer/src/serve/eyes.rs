//! Rendering and control for each browser: shown environment, camera, overlays, and commands.

use super::ServeCfg;
use super::command::Command;
use super::show::{Eyes, Picture, Show};
use super::state;
use crate::control::{self, Speed, TAKES_NONE, Viewer, Wants};
use crate::stage::{
    Canvas, Eye, Look, Names, Overlays, Painter, Panel, Picked, Pull, Shown, Snapshot, Trails, contacts_wanted,
};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use kinetoscope_render::View;
use kinetoscope_sim::EnvId;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Smallest and largest side of an image \[pixels\].
const SIDES: [usize; 2] = [16, 2048];
/// Maximum number of pixels of an image. Larger pages get an image of lower resolution.
const MOST_PIXELS: usize = 1920 * 1080;
/// Minimum interval between two images of a camera sensor.
const PANEL_EVERY: Duration = Duration::from_millis(100);
/// Maximum width of each of the four images of a camera sensor \[pixels\].
const PANEL_WIDTH: usize = 320;

/// View backend of a simulation: creates the sessions of browsers.
pub(super) struct Theatre {
    /// Viewer that keeps the initial speed set with the server.
    usher: Viewer,
    shared: Arc<Shared>,
}

/// State shared by all sessions of a server.
struct Shared {
    cfg: ServeCfg,
    /// Viewer that owns the pause and speed of all browsers. These settings stay when a single browser leaves and
    /// returns.
    hands: Mutex<Viewer>,
    /// Held while rendering, so that all sessions together take at most one core from the simulation.
    brush: Mutex<()>,
    seated: AtomicUsize,
}

impl Theatre {
    pub(super) fn new(usher: Viewer, cfg: ServeCfg) -> Self {
        if let Some(speed) = cfg.speed {
            usher.send(control::Command::SetSpeed(speed));
        }
        let hands = Mutex::new(usher.another(Wants::NOTHING));
        Self { usher, shared: Arc::new(Shared { cfg, hands, brush: Mutex::new(()), seated: AtomicUsize::new(0) }) }
    }
}

impl Show for Theatre {
    fn eyes(&self) -> Box<dyn Eyes> {
        self.shared.seated.fetch_add(1, Ordering::AcqRel);
        let wants = Wants { rate: self.shared.cfg.rate, ..Wants::default() };
        Box::new(OwnEyes::new(self.usher.another(wants), wants, Arc::clone(&self.shared)))
    }

    fn deserted(&self) {
        // Dropping the old viewer undoes the settings of browsers; the settings of windows stay.
        *self.shared.hands() = self.usher.another(Wants::NOTHING);
    }
}

impl Shared {
    fn hands(&self) -> MutexGuard<'_, Viewer> {
        self.hands.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

struct OwnEyes {
    viewer: Viewer,
    wants: Wants,
    shared: Arc<Shared>,
    eye: Option<Eye>,
    /// Value of `Viewpoint::changes` that was last applied.
    view_changes: u64,
    shown: Shown,
    overlays: Overlays,
    trails: Trails,
    size: [usize; 2],
    camera: Option<String>,
    picked: Option<Picked>,
    pull: Option<Pull>,
    painter: Painter,
    panel: Panel,
    canvas: Canvas,
    /// Incremented by each change of the image that does not come from the simulation.
    looks: u64,
    /// Snapshot number and `looks` of the last image.
    drawn: (u64, u64),
    /// Snapshot number and `looks` of the last camera sensor image.
    panel_drawn: (u64, u64),
    /// Time of the last camera sensor image.
    panel_at: Option<Instant>,
    told_names: Option<(Arc<Names>, usize)>,
    told: Option<Value>,
}

impl Drop for OwnEyes {
    fn drop(&mut self) {
        self.shared.seated.fetch_sub(1, Ordering::AcqRel);
    }
}

impl OwnEyes {
    fn new(viewer: Viewer, wants: Wants, shared: Arc<Shared>) -> Self {
        Self {
            viewer,
            wants,
            shared,
            eye: None,
            view_changes: 0,
            shown: Shown::All,
            overlays: Overlays::default(),
            trails: Trails::default(),
            size: [960, 540],
            camera: None,
            picked: None,
            pull: None,
            painter: Painter::new(1),
            panel: Panel::new(1),
            canvas: Canvas::default(),
            looks: 1,
            drawn: (0, 0),
            panel_drawn: (0, 0),
            panel_at: None,
            told_names: None,
            told: None,
        }
    }

    /// Calls `make` with the newest snapshot and releases it afterward: a held snapshot would reduce the snapshot rate.
    fn with_newest<T>(&mut self, make: impl FnOnce(&mut Self, &Snapshot) -> T) -> Option<T> {
        let snapshot = self.viewer.newest()?;
        Some(make(self, &snapshot))
    }

    fn env(&self) -> Option<EnvId> {
        self.shown.env()
    }

    fn send(&self, command: control::Command) -> Result<(), String> {
        let sent = self.shared.hands().send(command);
        sent.then_some(()).ok_or_else(|| TAKES_NONE.into())
    }

    fn home(&self, snapshot: &Snapshot) -> Eye {
        match self.shown {
            Shown::All => Eye::overview(snapshot, self.size),
            Shown::One(env) => Eye::overview(&snapshot.only(env), self.size),
        }
    }

    fn move_eye(&mut self, by: impl FnOnce(&mut Eye)) -> Result<(), String> {
        let eye = self.eye.or_else(|| self.with_newest(|own, snapshot| own.home(snapshot)));
        self.eye = eye.map(|mut eye| {
            by(&mut eye);
            eye
        });
        self.looks += 1;
        Ok(())
    }

    fn choose(&mut self, env: Option<usize>) -> Result<(), String> {
        let count = self.with_newest(|_, snapshot| snapshot.envs.len()).unwrap_or(0);
        if let Some(env) = env.filter(|env| *env >= count) {
            let there_are = if count == 1 { "is 1 environment".into() } else { format!("are {count} environments") };
            return Err(format!("environment {env}: there {there_are}, from 0"));
        }
        self.shown = env.map_or(Shown::All, Shown::One);
        self.eye = None;
        self.looks += 1;
        self.want();
        Ok(())
    }

    fn choose_camera(&mut self, name: Option<String>) -> Result<(), String> {
        let known = self.with_newest(|_, snapshot| snapshot.names.cameras.clone()).unwrap_or_default();
        if let Some(name) = name.as_ref().filter(|name| !known.contains(name)) {
            return Err(format!("there is no camera {name:?}; there are {known:?}"));
        }
        self.camera = name;
        self.looks += 1;
        Ok(())
    }

    fn set_overlay(&mut self, name: &str, on: bool) -> Result<(), String> {
        let Some((.., of)) = state::OVERLAYS.iter().find(|(known, ..)| *known == name) else {
            let known: Vec<&str> = state::OVERLAYS.iter().map(|(known, ..)| *known).collect();
            return Err(format!("there is no overlay {name:?}; there are {known:?}"));
        };
        *of(&mut self.overlays) = on;
        self.looks += 1;
        self.want();
        Ok(())
    }

    /// Requests the snapshot contents that are drawn, and no others, because contacts are expensive to compute.
    fn want(&mut self) {
        let contacts = contacts_wanted(self.shown, &self.overlays, self.picked.as_ref());
        let wants = Wants { contacts, ..self.wants };
        if wants != self.wants {
            self.wants = wants;
            self.viewer.set_wants(wants);
        }
    }

    fn resize(&mut self, width: usize, height: usize) -> Result<(), String> {
        let [least, most] = SIDES;
        if ![width, height].iter().all(|side| (least..=4 * most).contains(side)) {
            return Err(format!("{width} x {height}: pictures have sides of {least} to {} pixels", 4 * most));
        }
        // Larger images are rendered at lower resolution with the same aspect ratio.
        let by_pixels = (MOST_PIXELS as f64 / (width * height) as f64).sqrt();
        let scale = by_pixels.min(most as f64 / width.max(height) as f64).min(1.0);
        self.size = [width, height].map(|side| ((side as f64 * scale) as usize).max(1));
        self.looks += 1;
        Ok(())
    }

    fn set_target(&self, robot: &str, joint: &str, value: f64) -> Result<(), String> {
        let snapshot = self.viewer.newest().ok_or("nothing is known of the simulation yet")?;
        let found = state::find_joint(&snapshot.names, robot, joint)?;
        let (robot, joint) = (found.robot, found.joint);
        self.send(control::Command::SetTarget { robot, joint, env: self.env(), value })
    }

    /// Calls `find` with the current view at an image point, given as fractions of width and height.
    fn with_seen<T>(
        &mut self,
        [x, y]: [f64; 2],
        find: impl FnOnce(&mut Painter, &Snapshot, &View, &Look<'_>, [f64; 2]) -> Option<T>,
    ) -> Option<T> {
        let snapshot = self.viewer.newest()?;
        let eye = self.eye.unwrap_or_else(|| self.home(&snapshot));
        let [width, height] = self.size;
        let view = eye.view(width, height);
        // A coordinate of 1 selects the last pixel.
        let pixel = [(x, width), (y, height)].map(|(part, side)| (part * side as f64).min(side as f64 - 0.5));
        let look = Look { shown: self.shown, overlays: self.overlays, ..Look::default() };
        let shared = Arc::clone(&self.shared);
        let _brush = shared.brush.lock().unwrap_or_else(PoisonError::into_inner);
        find(&mut self.painter, &snapshot, &view, &look, pixel)
    }

    fn select(&mut self, picked: Option<Picked>) -> Result<(), String> {
        self.picked = picked;
        self.looks += 1;
        self.want();
        Ok(())
    }

    fn grab(&mut self, at: [f64; 2]) -> Result<(), String> {
        self.pull = self.with_seen(at, Pull::at);
        let Some(pull) = &self.pull else {
            // The previously grabbed body is released.
            self.send_own(control::Command::Release)?;
            return Err("there is nothing here that can be pulled at".into());
        };
        let picked = pull.picked().clone();
        self.select(Some(picked))?;
        self.send_pull()
    }

    fn pull_to(&mut self, at: [f64; 2]) -> Result<(), String> {
        // Without a grabbed body, the failed grab was already reported.
        let Some(mut pull) = self.pull.take() else { return Ok(()) };
        self.pull = self.with_seen([0.0; 2], move |_, snapshot, view, _, _| {
            pull.to(snapshot, view, [at[0] * view.width as f64, at[1] * view.height as f64]);
            Some(pull)
        });
        self.looks += 1;
        self.send_pull()
    }

    /// The spring belongs to the viewer of this session and ends with the session.
    fn send_pull(&self) -> Result<(), String> {
        self.pull.as_ref().and_then(Pull::command).map_or(Ok(()), |pull| self.send_own(pull))
    }

    fn send_own(&self, command: control::Command) -> Result<(), String> {
        self.viewer.send(command).then_some(()).ok_or_else(|| TAKES_NONE.into())
    }

    fn draw_stage(&mut self, snapshot: &Snapshot) -> Option<Picture> {
        self.trails.add(snapshot, self.shown);
        let key = (snapshot.number, self.looks);
        if self.drawn == key {
            return None;
        }
        if snapshot.number != self.drawn.0 {
            self.picked.iter_mut().for_each(|picked| picked.renumber(&snapshot.names));
            self.pull.iter_mut().for_each(|pull| pull.renumber(&snapshot.names));
            // Sending fails only after the simulation has ended.
            let _ = self.send_pull();
        }
        self.drawn = key;
        let changes = snapshot.viewpoint.map_or(0, |view| view.changes);
        if changes > self.view_changes && self.shown == Shown::All {
            self.eye = None;
        }
        self.view_changes = changes.max(self.view_changes);
        let eye = self.eye.unwrap_or_else(|| self.home(snapshot));
        self.eye = Some(eye);
        let view = eye.view(self.size[0], self.size[1]);
        let spring = self.pull.as_ref().map(|pull| pull.spring(snapshot));
        let (overlays, picked, trails) = (self.overlays, self.picked.as_ref(), Some(&self.trails));
        let look = Look { shown: self.shown, overlays, picked, trails, spring };
        let shared = Arc::clone(&self.shared);
        let _brush = shared.brush.lock().unwrap_or_else(PoisonError::into_inner);
        self.painter.draw(snapshot, &view, &look, &mut self.canvas).ok()?;
        let file = self.jpeg()?;
        let about = json!({"shows": "stage", "type": "image/jpeg", "snapshot": snapshot.number});
        Some(Picture { about, file })
    }

    fn draw_panel(&mut self, snapshot: &Snapshot) -> Option<Picture> {
        let key = (snapshot.number, self.looks);
        let rests = self.panel_at.is_some_and(|at| at.elapsed() < PANEL_EVERY);
        if self.panel_drawn == key || rests {
            return None;
        }
        let name = self.camera.clone()?;
        (self.panel_drawn, self.panel_at) = (key, Some(Instant::now()));
        let camera = snapshot.names.cameras.iter().position(|known| *known == name)?;
        let env = self.env().map_or(0, |env| env.0);
        let shared = Arc::clone(&self.shared);
        let _brush = shared.brush.lock().unwrap_or_else(PoisonError::into_inner);
        let drawn = self.panel.draw(snapshot, camera, env, PANEL_WIDTH, &mut self.canvas);
        let about = json!({"shows": "camera", "type": "image/jpeg", "camera": name, "environment": env});
        Some(Picture { about, file: drawn.then(|| self.jpeg()).flatten()? })
    }

    /// Encodes the canvas as a JPEG file.
    fn jpeg(&self) -> Option<Vec<u8>> {
        let [width, height] = self.canvas.dimensions().map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let rgb: Vec<u8> = self.canvas.bytes().as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
        let mut file = Vec::with_capacity(rgb.len() / 12);
        let mut encoder = JpegEncoder::new_with_quality(&mut file, self.shared.cfg.quality.clamp(1, 100));
        encoder.encode(&rgb, width, height, ExtendedColorType::Rgb8).ok()?;
        Some(file)
    }
}

impl Eyes for OwnEyes {
    fn contents(&mut self) -> Option<Value> {
        self.with_newest(|own, snapshot| {
            let now = (&snapshot.names, snapshot.envs.len());
            if own.told_names.as_ref().is_some_and(|(names, envs)| Arc::ptr_eq(names, now.0) && *envs == now.1) {
                return None;
            }
            own.told_names = Some((Arc::clone(now.0), now.1));
            own.told = None;
            Some(state::contents(snapshot, &own.overlays))
        })
        .flatten()
    }

    fn state(&mut self) -> Option<Value> {
        let viewers = self.shared.seated.load(Ordering::Acquire);
        self.with_newest(|own, snapshot| {
            let state = state::state(snapshot, own.shown, own.picked.as_ref(), viewers);
            let told = own.told.as_ref() == Some(&state);
            own.told = Some(state.clone());
            (!told).then_some(state)
        })
        .flatten()
    }

    fn obey(&mut self, command: Command) -> Result<(), String> {
        let height = self.size[1];
        let pixels = |way: [f64; 2]| way.map(|part| part * height as f64);
        match command {
            Command::Seen { .. } => Ok(()),
            Command::Size { width, height } => self.resize(width, height),
            Command::Orbit { dx, dy } => self.move_eye(|eye| eye.orbit(pixels([dx, dy]), height)),
            Command::Pan { dx, dy } => self.move_eye(|eye| eye.pan(pixels([dx, dy]), height)),
            Command::Zoom { by } => self.move_eye(|eye| eye.zoom(by)),
            Command::Home => {
                (self.eye, self.looks) = (None, self.looks + 1);
                Ok(())
            }
            Command::Environment { env } => self.choose(env),
            Command::Camera { name } => self.choose_camera(name),
            Command::Overlay { name, on } => self.set_overlay(&name, on),
            Command::Pause => self.send(control::Command::Pause),
            Command::Play => self.send(control::Command::Resume),
            Command::Step => self.send(control::Command::Step(1)),
            Command::Reset => self.send(control::Command::Reset(self.env())),
            Command::Seek { time } => self.send(control::Command::Seek(time)),
            Command::Speed { factor: None } => self.send(control::Command::SetSpeed(Speed::Free)),
            Command::Speed { factor: Some(factor) } => {
                let [slow, fast] = Speed::RANGE;
                if !(slow..=fast).contains(&factor) {
                    return Err(format!("speed {factor}: {slow} to {fast} would do"));
                }
                self.send(control::Command::SetSpeed(Speed::Times(factor)))
            }
            Command::Select { x, y } => {
                let picked = self.with_seen([x, y], |painter, snapshot, view, look, pixel| {
                    painter.pick(snapshot, view, look, pixel)
                });
                self.select(picked)
            }
            Command::Unselect => self.select(None),
            Command::Grab { x, y } => self.grab([x, y]),
            Command::Pull { x, y } => self.pull_to([x, y]),
            Command::Release => {
                (self.pull, self.looks) = (None, self.looks + 1);
                self.send_own(control::Command::Release)
            }
            Command::Record { on } => self.send(control::Command::Record(on)),
            Command::Target { robot, joint, value } => self.set_target(&robot, &joint, value),
        }
    }

    fn pictures(&mut self) -> Vec<Picture> {
        let pictures = self.with_newest(|own, snapshot| {
            let stage = own.draw_stage(snapshot);
            stage.into_iter().chain(own.draw_panel(snapshot)).collect()
        });
        pictures.unwrap_or_default()
    }
}
