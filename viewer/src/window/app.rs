//! State of a simulation window: handles mouse and keyboard input and renders the image, independent of X11.

use super::adaptive_quality::AdaptiveQuality;
use super::key_bindings::{Action, Key, action};
use super::thread_budget::ThreadBudget;
use super::{hud, timeline};
use crate::control::{Command, NOT_STEPPING, SnapshotRequest, Speed};
use crate::scene_view::{
    CameraPanel, Canvas, EnvSelection, MouseSpring, OrbitCamera, Overlays, SceneRenderer, Selection, Snapshot, Trails,
    ViewOptions, required_contacts, selection_text,
};
use kinetoscope_render::View;
use kinetoscope_sim::EnvId;
use nalgebra::Vector3;
use std::collections::HashSet;
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// An input event of a window. Positions are pixels of the rendered image, from the top left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// A key was pressed.
    Press(Key),
    /// A held key repeats.
    Repeat(Key),
    /// A key was released.
    Release(Key),
    /// A mouse button was pressed at a pixel: 1 is left, 2 is middle, 3 is right.
    ButtonPress(u8, [f64; 2], Modifiers),
    /// A mouse button was released at a pixel.
    ButtonRelease(u8, [f64; 2]),
    /// The mouse moved to a pixel.
    Move([f64; 2]),
    /// The wheel was turned by steps at a pixel; positive is away from the user.
    Wheel(f64, [f64; 2]),
    /// The rendered image was resized with the window: pixels per row, rows.
    Resize([usize; 2]),
    /// The window lost the keyboard focus.
    FocusLost,
}

/// Modifier keys held when a mouse button is pressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// The Shift key.
    pub shift: bool,
    /// The Control key.
    pub ctrl: bool,
}

/// Effect of the current mouse drag.
#[derive(Clone, Debug, PartialEq)]
enum DragMode {
    Orbit,
    Pan,
    Turn,
    /// Seeks on the timeline of a recording.
    Timeline,
    /// Moves the slider of a joint, by joint index.
    Slider(usize),
    /// Pulls a body with a spring.
    Spring(MouseSpring),
}

/// A mouse drag, from the press of a button to its release.
#[derive(Clone, Debug, PartialEq)]
struct Drag {
    button: u8,
    grip: DragMode,
    /// Position of the press \[pixels\].
    start: [f64; 2],
    /// Last position of the mouse \[pixels\].
    last: [f64; 2],
}

/// Rate of snapshots that a window requests \[Hz\], the refresh rate of most screens.
const MAX_FPS: f64 = 60.0;
/// Largest mouse motion of a click \[pixels\].
const MAX_CLICK_MOTION: f64 = 3.0;
/// Width of each image of the camera panel \[pixels\].
const PANEL_IMAGE_WIDTH: usize = 160;

/// State of a simulation window.
pub struct App {
    renderer: SceneRenderer,
    panel: CameraPanel,
    /// Image of the camera panel.
    panel_canvas: Canvas,
    trails: Trails,
    snapshot: Option<Arc<Snapshot>>,
    size: [usize; 2],
    camera: Option<OrbitCamera>,
    /// Value of `Viewpoint::revision` that was last applied.
    applied_viewpoint: u64,
    env_selection: EnvSelection,
    /// Environment of the camera panel and the sliders.
    env: usize,
    /// Camera sensor whose view fills the window, as an index into the camera names; `None` for the free camera.
    window_sensor: Option<usize>,
    /// Camera sensor of the panel, as an index into the camera names; `None` while the panel is closed.
    panel_sensor: Option<usize>,
    overlays: Overlays,
    selection: Option<Selection>,
    followed_point: Option<[f64; 3]>,
    drag: Option<Drag>,
    held_keys: HashSet<Key>,
    sliders: Option<usize>,
    help: bool,
    commands: Vec<Command>,
    /// True if the last command could not be sent.
    send_failed: bool,
    frame_times: Vec<Instant>,
    last_flight: Instant,
    thread_budget: ThreadBudget,
    /// Adaptive sample count; `None` always uses four samples per pixel.
    adaptive_quality: Option<AdaptiveQuality>,
    /// Duration of sending the last image to the display.
    send_duration: Duration,
    /// Number of the last rendered snapshot, and its view.
    last_rendered: Option<(u64, View)>,
}

/// Omits snapshots and images, which are long.
impl fmt::Debug for App {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("App")
            .field("size", &self.size)
            .field("eye", &self.camera)
            .field("shown", &(self.env_selection, self.env))
            .field("cameras", &(self.window_sensor, self.panel_sensor))
            .field("overlays", &self.overlays)
            .field("picked", &(&self.selection, self.followed_point))
            .field("held", &self.held_keys)
            .field("panels", &(self.sliders, self.help))
            .finish_non_exhaustive()
    }
}

impl App {
    /// Creates the state of a window of `size` pixels with at most `threads` rendering threads. Half of the threads
    /// render while physics needs all available time: at unlimited speed, and for 5 s after physics fell behind the
    /// requested speed.
    pub fn new(size: [usize; 2], threads: usize) -> Self {
        Self {
            renderer: SceneRenderer::new(threads),
            panel: CameraPanel::new(threads),
            panel_canvas: Canvas::default(),
            trails: Trails::default(),
            snapshot: None,
            size,
            camera: None,
            applied_viewpoint: 0,
            env_selection: EnvSelection::All,
            env: 0,
            window_sensor: None,
            panel_sensor: None,
            overlays: Overlays::default(),
            selection: None,
            followed_point: None,
            drag: None,
            held_keys: HashSet::new(),
            sliders: None,
            help: false,
            commands: Vec::new(),
            send_failed: false,
            frame_times: Vec::new(),
            last_flight: Instant::now(),
            thread_budget: ThreadBudget::new(threads),
            adaptive_quality: None,
            send_duration: Duration::ZERO,
            last_rendered: None,
        }
    }

    /// Sets the snapshot to render. Moves the free camera to a new view of
    /// [`set_camera_view`](kinetoscope_sim::SceneViewMut::set_camera_view), and with a followed selection.
    pub fn set_snapshot(&mut self, snapshot: Arc<Snapshot>) {
        self.env = self.env.min(snapshot.envs.len().saturating_sub(1));
        let changes = snapshot.viewpoint.map_or(0, |view| view.revision);
        let is_set_anew = changes > self.applied_viewpoint;
        self.applied_viewpoint = changes.max(self.applied_viewpoint);
        if is_set_anew || self.camera.is_none() {
            self.camera = Some(OrbitCamera::overview(&snapshot, self.size));
        }
        self.selection.iter_mut().for_each(|picked| picked.update_body_index(&snapshot.names));
        if let Some(Drag { grip: DragMode::Spring(pull), .. }) = &mut self.drag {
            pull.update_body_index(&snapshot.names);
        }
        if let (Some(last), Some(picked), Some(eye)) = (self.followed_point, &self.selection, &mut self.camera) {
            let now = picked.current_point(&snapshot);
            (0..3).for_each(|k| eye.target[k] += now[k] - last[k]);
            self.followed_point = Some(now);
        }
        self.trails.add(&snapshot, self.visible_envs());
        self.snapshot = Some(snapshot);
        self.queue_spring();
    }

    /// Records the result of sending the last command: `heard` is false if the simulation has ended or its command
    /// queue is full. The image then shows a message.
    pub fn set_send_result(&mut self, heard: bool) {
        self.send_failed = !heard;
    }

    /// Records the duration of sending the last image to the display. The adaptive sample count includes it.
    pub fn set_send_duration(&mut self, took: Duration) {
        self.send_duration = took;
    }

    /// Sets the free camera.
    pub fn set_camera(&mut self, eye: OrbitCamera) {
        self.camera = Some(eye);
    }

    /// Returns the free camera; before the first snapshot, the default camera.
    pub fn camera(&self) -> OrbitCamera {
        self.camera.unwrap_or_default()
    }

    /// Returns the enabled overlays.
    pub fn overlays(&self) -> Overlays {
        self.overlays
    }

    /// Returns the selected point; `None` without a selection.
    pub fn selection(&self) -> Option<&Selection> {
        self.selection.as_ref()
    }

    /// Returns the rate and contents of the snapshots that the window needs.
    pub fn snapshot_request(&self) -> SnapshotRequest {
        let contacts = required_contacts(self.visible_envs(), &self.overlays, self.selection.as_ref());
        SnapshotRequest { rate: MAX_FPS, contacts, markers: self.overlays.sensors, ..SnapshotRequest::default() }
    }

    /// Takes the commands for the simulation since the last call.
    pub fn take_commands(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.commands)
    }

    /// Enables adaptive sampling. If four samples per pixel would give fewer than 30 frames per second, moving images
    /// use one sample. Images at rest for a quarter of a second use four samples.
    pub fn enable_adaptive_quality(&mut self) {
        self.adaptive_quality = Some(AdaptiveQuality::default());
    }

    /// True if a new image is needed without an event: flight keys are held, or a resting image has only one sample per
    /// pixel.
    pub fn needs_redraw(&self, now: Instant) -> bool {
        !self.held_keys.is_empty() || self.adaptive_quality.is_some_and(|fineness| fineness.needs_refinement(now))
    }

    /// Returns the environments in the image: only the chosen one if the window shows a camera sensor.
    fn visible_envs(&self) -> EnvSelection {
        if self.shows_sensor() { EnvSelection::One(self.env) } else { self.env_selection }
    }

    /// True if the window shows a camera sensor: one is chosen, and it observes the environment.
    fn shows_sensor(&self) -> bool {
        self.sensor_view(1, 1).is_some()
    }

    /// Handles an input event.
    pub fn handle(&mut self, input: Input) {
        match input {
            Input::Press(key) => self.press(key),
            Input::Repeat(key) if action(key).is_some_and(Action::repeats) => self.press(key),
            Input::Repeat(_) => {}
            Input::Release(key) => {
                self.held_keys.remove(&key);
            }
            Input::ButtonPress(button, at, modifiers) => self.begin_drag(button, at, modifiers),
            Input::ButtonRelease(button, at) => self.end_drag(button, at),
            Input::Move(at) => self.continue_drag(at),
            Input::Wheel(steps, at) => self.wheel(steps, at),
            Input::Resize(size) => self.size = size,
            Input::FocusLost => self.held_keys.clear(),
        }
    }

    fn press(&mut self, key: Key) {
        let Some(action) = action(key) else { return };
        if let Action::Fly(_) = action {
            if self.held_keys.is_empty() {
                self.last_flight = Instant::now();
            }
            self.held_keys.insert(key);
            return;
        }
        let Some(snapshot) = self.snapshot.clone() else { return };
        let (run, envs, cameras) = (&snapshot.run, snapshot.envs.len().max(1), snapshot.names.cameras.len());
        let factor = match run.speed {
            Speed::Factor(factor) => factor,
            Speed::Unlimited => run.measured_speed.map_or(1.0, |speed| speed.clamp(0.01, 100.0)),
        };
        let next = |current: Option<usize>| match current {
            None if cameras > 0 => Some(0),
            Some(k) if k + 1 < cameras => Some(k + 1),
            _ => None,
        };
        let o = &mut self.overlays;
        match action {
            Action::Pause => self.commands.push(Command::TogglePause),
            Action::Steps(count) => self.commands.push(Command::Step(count)),
            Action::Slower => {
                self.commands.push(Command::SetSpeed(Speed::Factor((factor / 2.0).max(Speed::FACTOR_RANGE[0]))))
            }
            Action::Faster => {
                self.commands.push(Command::SetSpeed(Speed::Factor((factor * 2.0).min(Speed::FACTOR_RANGE[1]))))
            }
            Action::RealTime => self.commands.push(Command::SetSpeed(Speed::REAL_TIME)),
            Action::FreeSpeed => self.commands.push(Command::SetSpeed(Speed::Unlimited)),
            Action::Reset => self.commands.push(Command::Reset(self.visible_envs().env())),
            Action::Record => self.commands.push(Command::Record(!is_recording(&snapshot))),
            Action::NextEnv => self.show_env((self.env + 1) % envs),
            Action::PreviousEnv => self.show_env((self.env + envs - 1) % envs),
            Action::AllEnvs => self.env_selection = EnvSelection::All,
            Action::NextCamera => self.window_sensor = next(self.window_sensor),
            Action::FreeView => self.window_sensor = None,
            Action::Overview => {
                (self.camera, self.followed_point, self.window_sensor) =
                    (Some(OrbitCamera::overview(&snapshot, self.size)), None, None)
            }
            Action::Follow => {
                let point = self.selection.as_ref().map(|picked| picked.current_point(&snapshot));
                self.followed_point = point.filter(|_| self.followed_point.is_none());
            }
            Action::Sensors => o.sensors = !o.sensors,
            Action::Contacts => o.contacts = !o.contacts,
            Action::Frames => o.frames = !o.frames,
            Action::JointAxes => o.joints = !o.joints,
            Action::CentersOfMass => o.centers_of_mass = !o.centers_of_mass,
            Action::Names => o.names = !o.names,
            Action::Trails => o.trails = !o.trails,
            Action::Collisions => o.collisions = !o.collisions,
            Action::Visuals => o.visuals = !o.visuals,
            Action::Panel => self.panel_sensor = next(self.panel_sensor),
            Action::Sliders => self.sliders = if self.sliders.is_none() { Some(0) } else { None },
            Action::Help => self.help = !self.help,
            Action::ClearSelection => (self.selection, self.followed_point, self.help) = (None, None, false),
            Action::Fly(_) => {}
        }
    }

    /// Shows a single environment. If a single environment was shown before, the camera moves from its origin to the
    /// new one. After the view of all environments, the camera shows an overview of the new one.
    fn show_env(&mut self, env: usize) {
        let Some(snapshot) = &self.snapshot else { return };
        let from = self.env_selection.env().and_then(|EnvId(k)| snapshot.envs.get(k)).map(|env| env.origin);
        let to = snapshot.envs.get(env).map(|env| env.origin);
        if let (Some(to), Some(eye)) = (to, &mut self.camera) {
            match from {
                Some(from) => (0..3).for_each(|k| eye.target[k] += to[k] - from[k]),
                None => *eye = OrbitCamera::overview(&snapshot.with_single_env(env), self.size),
            }
        }
        (self.env, self.env_selection) = (env, EnvSelection::One(env));
    }

    /// Returns the view of the image.
    fn view(&self) -> View {
        let [width, height] = self.size.map(|n| n.clamp(1, View::MAX_SIDE));
        if let Some(view) = self.sensor_view(width, height) {
            return view;
        }
        self.camera.unwrap_or_default().view(width, height)
    }

    /// Returns the view of the chosen camera sensor, scaled to fit the window; `None` without such a view.
    fn sensor_view(&self, width: usize, height: usize) -> Option<View> {
        let env = self.snapshot.as_ref()?.envs.get(self.env)?;
        let view = env.views.get(self.window_sensor?)?.as_ref()?.view;
        let scale = (width as f32 / view.width as f32).min(height as f32 / view.height as f32);
        let mut pose = view.world_from_camera;
        (0..3).for_each(|k| pose.translation[k] += env.origin[k] as f32);
        // The principal point keeps its position relative to the sensor image, which is centered in the window.
        let [left, top] = [width as f32 - scale * view.width as f32, height as f32 - scale * view.height as f32];
        let (cx, cy) = (view.cx * scale + 0.5 * left, view.cy * scale + 0.5 * top);
        Some(View { width, height, fx: view.fx * scale, fy: view.fy * scale, cx, cy, world_from_camera: pose, ..view })
    }

    fn begin_drag(&mut self, button: u8, at: [f64; 2], modifiers: Modifiers) {
        let Some(snapshot) = self.snapshot.clone() else { return };
        match &self.drag {
            // Only one drag at a time.
            Some(held) if held.button != button => return,
            // The release of the same button was lost, so it is made up for.
            Some(_) => self.end_drag(button, at),
            None => {}
        }
        if button == 1
            && snapshot.run.recording.is_some()
            && hud::on_record_button(self.size[0], self.slider_panel_width(), at)
        {
            self.commands.push(Command::Record(!is_recording(&snapshot)));
            return;
        }
        let on_slider = self.sliders.and_then(|first| hud::slider_at(&snapshot, self.env, first, self.size, at));
        let on_timeline = timeline::time_at(&snapshot, self.size, at).filter(|_| button == 1);
        let grip = match button {
            1 if on_timeline.is_some() => {
                self.commands.extend(on_timeline.map(Command::Seek));
                Some(DragMode::Timeline)
            }
            1 if on_slider.is_some() => {
                let Some((joint, value)) = on_slider else { return };
                self.set_target(&snapshot, joint, value);
                Some(DragMode::Slider(joint))
            }
            1 if self.sliders.is_some() && at[0] >= self.size[0] as f64 - f64::from(hud::SLIDER_PANEL_WIDTH) => None,
            1 if modifiers.ctrl => self.begin_spring(&snapshot, at),
            1 if modifiers.shift => Some(DragMode::Pan),
            1 => Some(DragMode::Orbit),
            2 => Some(DragMode::Turn),
            3 => Some(DragMode::Pan),
            _ => None,
        };
        self.drag = grip.map(|grip| Drag { button, grip, start: at, last: at });
    }

    /// Grabs the body at a pixel with a mouse spring.
    fn begin_spring(&mut self, snapshot: &Snapshot, at: [f64; 2]) -> Option<DragMode> {
        let view = self.view();
        let look = ViewOptions { envs: self.visible_envs(), overlays: self.overlays, ..ViewOptions::default() };
        let pull = MouseSpring::grab(&mut self.renderer, snapshot, &view, &look, at)?;
        self.selection = Some(pull.selection().clone());
        Some(DragMode::Spring(pull))
    }

    fn continue_drag(&mut self, at: [f64; 2]) {
        let Some(mut held) = self.drag.take() else { return };
        let by = [at[0] - held.last[0], at[1] - held.last[1]];
        let height = self.size[1];
        let free = !self.shows_sensor();
        match (&held.grip, &mut self.camera) {
            (DragMode::Orbit, Some(eye)) if free => eye.orbit(by, height),
            (DragMode::Pan, Some(eye)) if free => eye.pan(by, height),
            (DragMode::Turn, Some(eye)) if free => eye.look_around(by, height),
            _ => {}
        }
        if let Some(snapshot) = self.snapshot.clone() {
            match &mut held.grip {
                DragMode::Slider(joint) => {
                    let value = hud::slider_value(&snapshot, self.env, *joint, self.size[0], at[0]);
                    value.into_iter().for_each(|value| self.set_target(&snapshot, *joint, value));
                }
                DragMode::Spring(pull) => pull.move_to(&snapshot, &self.view(), at),
                DragMode::Timeline => {
                    let time = timeline::time_at_x(&snapshot, self.size[0], at[0]);
                    self.commands.extend(time.map(Command::Seek));
                }
                DragMode::Orbit | DragMode::Pan | DragMode::Turn => {}
            }
        }
        self.drag = Some(Drag { last: at, ..held });
        self.queue_spring();
    }

    /// Queues a drag command with the current spring, in place of older ones.
    fn queue_spring(&mut self) {
        if let Some(Drag { grip: DragMode::Spring(pull), .. }) = &self.drag
            && let Some(drag) = pull.command()
        {
            self.commands.retain(|command| !matches!(command, Command::Drag { .. }));
            self.commands.push(drag);
        }
    }

    fn end_drag(&mut self, button: u8, at: [f64; 2]) {
        let Some(Drag { grip, start, .. }) = self.drag.take_if(|held| held.button == button) else { return };
        match grip {
            DragMode::Spring(_) => self.commands.push(Command::Release),
            DragMode::Orbit if (at[0] - start[0]).hypot(at[1] - start[1]) < MAX_CLICK_MOTION => self.select(at),
            _ => {}
        }
    }

    fn select(&mut self, at: [f64; 2]) {
        let Some(snapshot) = self.snapshot.clone() else { return };
        let look = ViewOptions { envs: self.visible_envs(), overlays: self.overlays, ..ViewOptions::default() };
        let view = self.view();
        self.selection = self.renderer.pick(&snapshot, &view, &look, at);
        self.followed_point = None;
        if let Some(picked) = self.selection.as_ref().filter(|picked| picked.body.is_some()) {
            self.env = picked.env;
        }
    }

    fn wheel(&mut self, steps: f64, at: [f64; 2]) {
        let count = self.snapshot.as_ref().map_or(0, |snapshot| hud::slider_joints(snapshot).len());
        if let Some(first) = &mut self.sliders
            && at[0] >= self.size[0] as f64 - f64::from(hud::SLIDER_PANEL_WIDTH)
        {
            let moved = first.saturating_add_signed(-(steps as isize));
            *first = moved.min(count.saturating_sub(1));
        } else if !self.shows_sensor()
            && let Some(eye) = &mut self.camera
        {
            eye.zoom(steps);
        }
    }

    fn set_target(&mut self, snapshot: &Snapshot, joint: usize, value: f64) {
        let Some(name) = snapshot.names.joints.get(joint) else { return };
        let (robot, joint, env) = (name.robot, name.joint, Some(EnvId(self.env)));
        self.commands.push(Command::SetTarget { robot, joint, env, value });
    }

    /// Moves the free camera according to the held flight keys.
    fn move_camera(&mut self, now: Instant) {
        let seconds = now.saturating_duration_since(self.last_flight).as_secs_f64().min(0.1);
        self.last_flight = now;
        if self.shows_sensor() {
            return;
        }
        let Some(eye) = &mut self.camera else { return };
        let mut way = Vector3::zeros();
        for key in &self.held_keys {
            if let Some(Action::Fly(direction)) = action(*key) {
                way += Vector3::from(direction.map(f64::from));
            }
        }
        // The speed per second is the distance to the target.
        eye.translate((way * eye.distance * seconds).into());
    }

    /// Renders the image of the window, including overlays and panels. Before the first snapshot, it only resizes
    /// `canvas`.
    pub fn draw(&mut self, canvas: &mut Canvas, now: Instant) {
        let [width, height] = self.size.map(|n| n.clamp(1, View::MAX_SIDE));
        canvas.resize(width, height);
        self.move_camera(now);
        let Some(snapshot) = self.snapshot.clone() else { return };
        self.frame_times.retain(|then| now.saturating_duration_since(*then).as_secs_f64() < 1.0);
        self.frame_times.push(now);
        let view = self.view();
        let spring = match &self.drag {
            Some(Drag { grip: DragMode::Spring(pull), .. }) => Some(pull.ends(&snapshot)),
            _ => None,
        };
        let (envs, overlays, selection) = (self.visible_envs(), self.overlays, self.selection.as_ref());
        let look = ViewOptions { envs, overlays, selection, trails: Some(&self.trails), spring };
        self.renderer.set_max_threads(self.thread_budget.threads(&snapshot.run, now));
        // The snapshot number of a paused simulation changes only if a user changed something.
        let shows = (snapshot.number, view);
        let changed = self.last_rendered.replace(shows) != Some(shows);
        if let Some(fineness) = &mut self.adaptive_quality {
            self.renderer.set_samples(fineness.samples(changed, now));
        }
        let start = Instant::now();
        // The view of a window is always valid. If rendering fails, the canvas keeps its content.
        let _ = self.renderer.draw(&snapshot, &view, &look, canvas);
        if let Some(fineness) = &mut self.adaptive_quality {
            // The current image is not sent yet, so the duration of sending the last image serves as an estimate.
            fineness.record_frame(self.renderer.samples(), start.elapsed() + self.send_duration);
        }
        let name = self.caption(&snapshot);
        let refused = if self.send_failed { Some(NOT_STEPPING) } else { snapshot.run.last_refusal.as_deref() };
        hud::draw_status(canvas, &snapshot, envs, &name, self.frame_times.len() as f64, refused);
        if let Some(picked) = &self.selection {
            let mut lines = selection_text(picked, &snapshot);
            lines.extend(self.followed_point.map(|_| "followed".into()));
            // An empty line leaves space for the timeline below.
            lines.extend(snapshot.run.timeline.map(|_| String::new()));
            hud::draw_note(canvas, &lines);
        }
        self.draw_panel(&snapshot, canvas);
        if let Some(first) = self.sliders {
            hud::draw_sliders(canvas, &snapshot, self.env, first);
        }
        if let Some(recording) = &snapshot.run.recording {
            hud::draw_record_button(canvas, self.slider_panel_width(), recording);
        }
        timeline::draw(canvas, &snapshot);
        if self.help {
            hud::draw_help(canvas);
        }
    }

    /// Returns the description of the view: free camera or camera sensor.
    fn caption(&self, snapshot: &Snapshot) -> String {
        let Some(name) = self.window_sensor.and_then(|camera| snapshot.names.cameras.get(camera)) else {
            return "free view".into();
        };
        let env = self.env;
        let looks = snapshot.envs.get(env).and_then(|env| env.views.get(self.window_sensor?)?.as_ref());
        match looks {
            Some(looks) if looks.lens.is_pinhole() => format!("camera {name}, environment {env}"),
            // The window image is rasterized without the lens; the panel traces the rays of the lens.
            Some(looks) => {
                format!("camera {name} without its {} lens (I: with the lens), environment {env}", looks.lens.name())
            }
            None => format!("free view: camera {name} does not observe environment {env}"),
        }
    }

    /// Returns the width of the slider panel, or 0 if it is closed \[pixels\].
    fn slider_panel_width(&self) -> usize {
        if self.sliders.is_some() { hud::SLIDER_PANEL_WIDTH as usize } else { 0 }
    }

    /// Draws the camera panel in the lower right corner, to the left of the sliders.
    fn draw_panel(&mut self, snapshot: &Snapshot, canvas: &mut Canvas) {
        let Some(camera) = self.panel_sensor else { return };
        if self.panel.draw(snapshot, camera, self.env, PANEL_IMAGE_WIDTH, &mut self.panel_canvas) {
            let [width, height] = self.panel_canvas.dimensions();
            let left = self.size[0].saturating_sub(width + self.slider_panel_width() + 6);
            let top = self.size[1].saturating_sub(height + 6);
            canvas.draw_image(&self.panel_canvas, [left, top]);
            if let Some(name) = snapshot.names.cameras.get(camera) {
                let text = format!("camera {name}, environment {}", self.env);
                hud::draw_caption(canvas, &text, [left + 4, top.saturating_sub(13)]);
            }
        }
    }
}

/// True while a recording is running.
fn is_recording(snapshot: &Snapshot) -> bool {
    snapshot.run.recording.as_ref().is_some_and(|recording| recording.on)
}
