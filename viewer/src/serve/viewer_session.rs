//! Rendering and control for each browser: shown environment, camera, overlays, and commands.

use super::ServeCfg;
use super::command::Command;
use super::state;
use super::view_backend::{EncodedImage, ViewBackend, ViewSession};
use crate::control::{self, NOT_STEPPING, SnapshotRequest, Speed, Viewer};
use crate::scene_view::{
    CameraPanel, Canvas, EnvSelection, MouseSpring, Names, OrbitCamera, Overlays, SceneRenderer, Selection, Snapshot,
    Trails, ViewOptions, required_contacts,
};
use image::ExtendedColorType;
use image::codecs::jpeg::JpegEncoder;
use kinetoscope_render::View;
use kinetoscope_sim::EnvId;
use serde_json::{Value, json};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Smallest side of the page's image area, and largest side of an image \[pixels\]. Areas up to four times that side
/// get an image of lower resolution, larger ones are refused.
const SIDE_RANGE: [usize; 2] = [16, 2048];
/// Maximum number of pixels of an image. Larger pages get an image of lower resolution.
const MAX_PIXELS: usize = 1920 * 1080;
/// Minimum interval between two images of a camera sensor.
const PANEL_INTERVAL: Duration = Duration::from_millis(100);
/// Maximum width of each of the four images of a camera sensor \[pixels\].
const PANEL_WIDTH: usize = 320;

/// View backend of a simulation: creates the sessions of browsers.
pub(super) struct ViewerHub {
    /// Viewer that keeps the initial speed set with the server.
    host_viewer: Viewer,
    shared: Arc<SessionShared>,
}

/// State shared by all sessions of a server.
struct SessionShared {
    cfg: ServeCfg,
    /// Viewer that owns the pause and speed of all browsers. These settings stay when a single browser leaves and
    /// returns.
    control_viewer: Mutex<Viewer>,
    /// Held while rendering, so that all sessions together take at most one core from the simulation.
    render_lock: Mutex<()>,
    session_count: AtomicUsize,
}

impl ViewerHub {
    pub(super) fn new(host_viewer: Viewer, cfg: ServeCfg) -> Self {
        if let Some(speed) = cfg.speed {
            host_viewer.send(control::Command::SetSpeed(speed));
        }
        let control_viewer = Mutex::new(host_viewer.add_viewer(SnapshotRequest::EMPTY));
        Self {
            host_viewer,
            shared: Arc::new(SessionShared {
                cfg,
                control_viewer,
                render_lock: Mutex::new(()),
                session_count: AtomicUsize::new(0),
            }),
        }
    }
}

impl ViewBackend for ViewerHub {
    fn open_session(&self) -> Box<dyn ViewSession> {
        self.shared.session_count.fetch_add(1, Ordering::AcqRel);
        let wants = SnapshotRequest { rate: self.shared.cfg.max_fps, ..SnapshotRequest::default() };
        Box::new(ViewerSession::new(self.host_viewer.add_viewer(wants), wants, Arc::clone(&self.shared)))
    }

    fn on_idle(&self) {
        // Dropping the old viewer undoes the settings of browsers; the settings of windows stay.
        *self.shared.control_viewer() = self.host_viewer.add_viewer(SnapshotRequest::EMPTY);
    }
}

impl SessionShared {
    fn control_viewer(&self) -> MutexGuard<'_, Viewer> {
        self.control_viewer.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

struct ViewerSession {
    viewer: Viewer,
    wants: SnapshotRequest,
    shared: Arc<SessionShared>,
    orbit_camera: Option<OrbitCamera>,
    /// Value of `Viewpoint::revision` that was last applied.
    applied_viewpoint: u64,
    env_selection: EnvSelection,
    overlays: Overlays,
    trails: Trails,
    size: [usize; 2],
    camera: Option<String>,
    selection: Option<Selection>,
    mouse_spring: Option<MouseSpring>,
    renderer: SceneRenderer,
    panel: CameraPanel,
    canvas: Canvas,
    /// Incremented by each change of the image that does not come from the simulation.
    view_revision: u64,
    /// Snapshot number and `view_revision` of the last image.
    last_image: (u64, u64),
    /// Snapshot number and `view_revision` of the last camera sensor image.
    last_panel_image: (u64, u64),
    /// Time of the last camera sensor image.
    last_panel_time: Option<Instant>,
    sent_names: Option<(Arc<Names>, usize)>,
    sent_state: Option<Value>,
}

impl Drop for ViewerSession {
    fn drop(&mut self) {
        self.shared.session_count.fetch_sub(1, Ordering::AcqRel);
    }
}

impl ViewerSession {
    fn new(viewer: Viewer, wants: SnapshotRequest, shared: Arc<SessionShared>) -> Self {
        Self {
            viewer,
            wants,
            shared,
            orbit_camera: None,
            applied_viewpoint: 0,
            env_selection: EnvSelection::All,
            overlays: Overlays::default(),
            trails: Trails::default(),
            size: [960, 540],
            camera: None,
            selection: None,
            mouse_spring: None,
            renderer: SceneRenderer::new(1),
            panel: CameraPanel::new(1),
            canvas: Canvas::default(),
            view_revision: 1,
            last_image: (0, 0),
            last_panel_image: (0, 0),
            last_panel_time: None,
            sent_names: None,
            sent_state: None,
        }
    }

    /// Calls `make` with the newest snapshot and releases it afterward: a held snapshot would reduce the snapshot rate.
    fn with_newest<T>(&mut self, make: impl FnOnce(&mut Self, &Snapshot) -> T) -> Option<T> {
        let snapshot = self.viewer.newest()?;
        Some(make(self, &snapshot))
    }

    fn env(&self) -> Option<EnvId> {
        self.env_selection.env()
    }

    fn send(&self, command: control::Command) -> Result<(), String> {
        let sent = self.shared.control_viewer().send(command);
        sent.then_some(()).ok_or_else(|| NOT_STEPPING.into())
    }

    fn initial_camera(&self, snapshot: &Snapshot) -> OrbitCamera {
        match self.env_selection {
            EnvSelection::All => OrbitCamera::overview(snapshot, self.size),
            EnvSelection::One(env) => OrbitCamera::overview(&snapshot.with_single_env(env), self.size),
        }
    }

    fn move_camera(&mut self, by: impl FnOnce(&mut OrbitCamera)) -> Result<(), String> {
        let eye = self.orbit_camera.or_else(|| self.with_newest(|own, snapshot| own.initial_camera(snapshot)));
        self.orbit_camera = eye.map(|mut eye| {
            by(&mut eye);
            eye
        });
        self.view_revision += 1;
        Ok(())
    }

    fn select_env(&mut self, env: Option<usize>) -> Result<(), String> {
        let count = self.with_newest(|_, snapshot| snapshot.envs.len()).unwrap_or(0);
        if let Some(env) = env.filter(|env| *env >= count) {
            let there_are = if count == 1 { "is 1 environment".into() } else { format!("are {count} environments") };
            return Err(format!("environment {env}: there {there_are}, from 0"));
        }
        self.env_selection = env.map_or(EnvSelection::All, EnvSelection::One);
        self.orbit_camera = None;
        self.view_revision += 1;
        self.update_request();
        Ok(())
    }

    fn select_camera(&mut self, name: Option<String>) -> Result<(), String> {
        let known = self.with_newest(|_, snapshot| snapshot.names.cameras.clone()).unwrap_or_default();
        if let Some(name) = name.as_ref().filter(|name| !known.contains(name)) {
            return Err(format!("unknown camera {name:?}; cameras: {known:?}"));
        }
        self.camera = name;
        self.view_revision += 1;
        Ok(())
    }

    fn set_overlay(&mut self, name: &str, on: bool) -> Result<(), String> {
        let Some((.., of)) = state::OVERLAYS.iter().find(|(known, ..)| *known == name) else {
            let known: Vec<&str> = state::OVERLAYS.iter().map(|(known, ..)| *known).collect();
            return Err(format!("unknown overlay {name:?}; overlays: {known:?}"));
        };
        *of(&mut self.overlays) = on;
        self.view_revision += 1;
        self.update_request();
        Ok(())
    }

    /// Requests the contacts that are drawn, and no others, because contacts are expensive to compute.
    fn update_request(&mut self) {
        let contacts = required_contacts(self.env_selection, &self.overlays, self.selection.as_ref());
        let wants = SnapshotRequest { contacts, ..self.wants };
        if wants != self.wants {
            self.wants = wants;
            self.viewer.set_request(wants);
        }
    }

    fn resize(&mut self, width: usize, height: usize) -> Result<(), String> {
        let [least, most] = SIDE_RANGE;
        if ![width, height].iter().all(|side| (least..=4 * most).contains(side)) {
            return Err(format!("invalid image size {width} x {height}; sides must be {least} to {} pixels", 4 * most));
        }
        // Larger images are rendered at lower resolution with the same aspect ratio.
        let by_pixels = (MAX_PIXELS as f64 / (width * height) as f64).sqrt();
        let scale = by_pixels.min(most as f64 / width.max(height) as f64).min(1.0);
        self.size = [width, height].map(|side| ((side as f64 * scale) as usize).max(1));
        self.view_revision += 1;
        Ok(())
    }

    fn set_target(&self, robot: &str, joint: &str, value: f64) -> Result<(), String> {
        let snapshot = self.viewer.newest().ok_or("the simulation has no snapshot yet")?;
        let found = state::find_joint(&snapshot.names, robot, joint)?;
        let (robot, joint) = (found.robot, found.joint);
        self.send(control::Command::SetTarget { robot, joint, env: self.env(), value })
    }

    /// Calls `find` with the current view at an image point, given as fractions of width and height.
    fn with_view_at<T>(
        &mut self,
        [x, y]: [f64; 2],
        find: impl FnOnce(&mut SceneRenderer, &Snapshot, &View, &ViewOptions<'_>, [f64; 2]) -> Option<T>,
    ) -> Option<T> {
        let snapshot = self.viewer.newest()?;
        let eye = self.orbit_camera.unwrap_or_else(|| self.initial_camera(&snapshot));
        let [width, height] = self.size;
        let view = eye.view(width, height);
        // A coordinate of 1 selects the last pixel.
        let pixel = [(x, width), (y, height)].map(|(part, side)| (part * side as f64).min(side as f64 - 0.5));
        let look = ViewOptions { envs: self.env_selection, overlays: self.overlays, ..ViewOptions::default() };
        let shared = Arc::clone(&self.shared);
        let _guard = shared.render_lock.lock().unwrap_or_else(PoisonError::into_inner);
        find(&mut self.renderer, &snapshot, &view, &look, pixel)
    }

    fn select(&mut self, picked: Option<Selection>) -> Result<(), String> {
        self.selection = picked;
        self.view_revision += 1;
        self.update_request();
        Ok(())
    }

    fn grab(&mut self, at: [f64; 2]) -> Result<(), String> {
        self.mouse_spring = self.with_view_at(at, MouseSpring::grab);
        let Some(pull) = &self.mouse_spring else {
            // The previously grabbed body is released.
            self.send_as_session(control::Command::Release)?;
            return Err("no body to pull at this point".into());
        };
        let picked = pull.selection().clone();
        self.select(Some(picked))?;
        self.send_pull()
    }

    fn pull_to(&mut self, at: [f64; 2]) -> Result<(), String> {
        // Without a grabbed body, the failed grab was already reported.
        let Some(mut pull) = self.mouse_spring.take() else { return Ok(()) };
        self.mouse_spring = self.with_view_at([0.0; 2], move |_, snapshot, view, _, _| {
            pull.move_to(snapshot, view, [at[0] * view.width as f64, at[1] * view.height as f64]);
            Some(pull)
        });
        self.view_revision += 1;
        self.send_pull()
    }

    /// The spring belongs to the viewer of this session and ends with the session.
    fn send_pull(&self) -> Result<(), String> {
        self.mouse_spring.as_ref().and_then(MouseSpring::command).map_or(Ok(()), |pull| self.send_as_session(pull))
    }

    fn send_as_session(&self, command: control::Command) -> Result<(), String> {
        self.viewer.send(command).then_some(()).ok_or_else(|| NOT_STEPPING.into())
    }

    fn render_scene(&mut self, snapshot: &Snapshot) -> Option<EncodedImage> {
        self.trails.add(snapshot, self.env_selection);
        let key = (snapshot.number, self.view_revision);
        if self.last_image == key {
            return None;
        }
        if snapshot.number != self.last_image.0 {
            self.selection.iter_mut().for_each(|picked| picked.update_body_index(&snapshot.names));
            self.mouse_spring.iter_mut().for_each(|pull| pull.update_body_index(&snapshot.names));
            // Sending fails only after the simulation has ended.
            let _ = self.send_pull();
        }
        self.last_image = key;
        let changes = snapshot.viewpoint.map_or(0, |view| view.revision);
        if changes > self.applied_viewpoint && self.env_selection == EnvSelection::All {
            self.orbit_camera = None;
        }
        self.applied_viewpoint = changes.max(self.applied_viewpoint);
        let eye = self.orbit_camera.unwrap_or_else(|| self.initial_camera(snapshot));
        self.orbit_camera = Some(eye);
        let view = eye.view(self.size[0], self.size[1]);
        let spring = self.mouse_spring.as_ref().map(|pull| pull.ends(snapshot));
        let (overlays, selection, trails) = (self.overlays, self.selection.as_ref(), Some(&self.trails));
        let look = ViewOptions { envs: self.env_selection, overlays, selection, trails, spring };
        let shared = Arc::clone(&self.shared);
        let _guard = shared.render_lock.lock().unwrap_or_else(PoisonError::into_inner);
        self.renderer.draw(snapshot, &view, &look, &mut self.canvas).ok()?;
        let file = self.encode_jpeg()?;
        let description = json!({"shows": "stage", "type": "image/jpeg", "snapshot": snapshot.number});
        Some(EncodedImage { description, file })
    }

    fn render_panel(&mut self, snapshot: &Snapshot) -> Option<EncodedImage> {
        let key = (snapshot.number, self.view_revision);
        let rests = self.last_panel_time.is_some_and(|at| at.elapsed() < PANEL_INTERVAL);
        if self.last_panel_image == key || rests {
            return None;
        }
        let name = self.camera.clone()?;
        (self.last_panel_image, self.last_panel_time) = (key, Some(Instant::now()));
        let camera = snapshot.names.cameras.iter().position(|known| *known == name)?;
        let env = self.env().map_or(0, |env| env.0);
        let shared = Arc::clone(&self.shared);
        let _guard = shared.render_lock.lock().unwrap_or_else(PoisonError::into_inner);
        let drawn = self.panel.draw(snapshot, camera, env, PANEL_WIDTH, &mut self.canvas);
        let description = json!({"shows": "camera", "type": "image/jpeg", "camera": name, "environment": env});
        Some(EncodedImage { description, file: drawn.then(|| self.encode_jpeg()).flatten()? })
    }

    /// Encodes the canvas as a JPEG file.
    fn encode_jpeg(&self) -> Option<Vec<u8>> {
        let [width, height] = self.canvas.dimensions().map(|side| u32::try_from(side).unwrap_or(u32::MAX));
        let rgb: Vec<u8> = self.canvas.bytes().as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
        let mut file = Vec::with_capacity(rgb.len() / 12);
        let mut encoder = JpegEncoder::new_with_quality(&mut file, self.shared.cfg.jpeg_quality.clamp(1, 100));
        encoder.encode(&rgb, width, height, ExtendedColorType::Rgb8).ok()?;
        Some(file)
    }
}

impl ViewSession for ViewerSession {
    fn contents(&mut self) -> Option<Value> {
        self.with_newest(|own, snapshot| {
            let now = (&snapshot.names, snapshot.envs.len());
            if own.sent_names.as_ref().is_some_and(|(names, envs)| Arc::ptr_eq(names, now.0) && *envs == now.1) {
                return None;
            }
            own.sent_names = Some((Arc::clone(now.0), now.1));
            own.sent_state = None;
            Some(state::scene_contents(snapshot, &own.overlays))
        })
        .flatten()
    }

    fn state(&mut self) -> Option<Value> {
        let viewers = self.shared.session_count.load(Ordering::Acquire);
        self.with_newest(|own, snapshot| {
            let state = state::state(snapshot, own.env_selection, own.selection.as_ref(), viewers);
            let told = own.sent_state.as_ref() == Some(&state);
            own.sent_state = Some(state.clone());
            (!told).then_some(state)
        })
        .flatten()
    }

    fn handle(&mut self, command: Command) -> Result<(), String> {
        let height = self.size[1];
        let pixels = |way: [f64; 2]| way.map(|part| part * height as f64);
        match command {
            Command::Seen { .. } => Ok(()),
            Command::Size { width, height } => self.resize(width, height),
            Command::Orbit { dx, dy } => self.move_camera(|eye| eye.orbit(pixels([dx, dy]), height)),
            Command::Pan { dx, dy } => self.move_camera(|eye| eye.pan(pixels([dx, dy]), height)),
            Command::Zoom { by } => self.move_camera(|eye| eye.zoom(by)),
            Command::Home => {
                (self.orbit_camera, self.view_revision) = (None, self.view_revision + 1);
                Ok(())
            }
            Command::Environment { env } => self.select_env(env),
            Command::Camera { name } => self.select_camera(name),
            Command::Overlay { name, on } => self.set_overlay(&name, on),
            Command::Pause => self.send(control::Command::Pause),
            Command::Play => self.send(control::Command::Resume),
            Command::Step => self.send(control::Command::Step(1)),
            Command::Reset => self.send(control::Command::Reset(self.env())),
            Command::Seek { time } => self.send(control::Command::Seek(time)),
            Command::Speed { factor: None } => self.send(control::Command::SetSpeed(Speed::Unlimited)),
            Command::Speed { factor: Some(factor) } => {
                let [slow, fast] = Speed::FACTOR_RANGE;
                if !(slow..=fast).contains(&factor) {
                    return Err(format!("invalid speed {factor}; use {slow} to {fast}"));
                }
                self.send(control::Command::SetSpeed(Speed::Factor(factor)))
            }
            Command::Select { x, y } => {
                let picked = self.with_view_at([x, y], |renderer, snapshot, view, look, pixel| {
                    renderer.pick(snapshot, view, look, pixel)
                });
                self.select(picked)
            }
            Command::Unselect => self.select(None),
            Command::Grab { x, y } => self.grab([x, y]),
            Command::Pull { x, y } => self.pull_to([x, y]),
            Command::Release => {
                (self.mouse_spring, self.view_revision) = (None, self.view_revision + 1);
                self.send_as_session(control::Command::Release)
            }
            Command::Record { on } => self.send(control::Command::Record(on)),
            Command::Target { robot, joint, value } => self.set_target(&robot, &joint, value),
        }
    }

    fn due_images(&mut self) -> Vec<EncodedImage> {
        let images = self.with_newest(|own, snapshot| {
            let stage = own.render_scene(snapshot);
            stage.into_iter().chain(own.render_panel(snapshot)).collect()
        });
        images.unwrap_or_default()
    }
}
