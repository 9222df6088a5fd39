//! State of a simulation window: handles mouse and keyboard input and renders the image, independent of X11.

use super::desks::Desks;
use super::fineness::Fineness;
use super::keys::{Action, Key, action};
use super::{hud, timeline};
use crate::control::{Command, Speed, TAKES_NONE, Wants};
use crate::stage::{
    Canvas, Eye, Look, Overlays, Painter, Panel, Picked, Pull, Shown, Snapshot, Trails, contacts_wanted, describe,
};
use kinetoscope_render::View;
use kinetoscope_sim::EnvId;
use nalgebra::Vector3;
use std::collections::HashSet;
use std::fmt;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// An input event of a window.
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
    /// The image of the window was resized: pixels per row, rows.
    Resize([usize; 2]),
    /// The window lost the keyboard focus.
    FocusLost,
}

/// Modifier keys held during a button press.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// The Shift key.
    pub shift: bool,
    /// The Control key.
    pub ctrl: bool,
}

/// Effect of the current mouse drag.
#[derive(Clone, Debug, PartialEq)]
enum Grip {
    Orbit,
    Pan,
    Turn,
    /// Seeks on the timeline of a recording.
    Timeline,
    /// Moves the slider of a joint, by joint index.
    Slider(usize),
    /// Pulls a body with a spring.
    Spring(Pull),
}

/// A mouse drag, from the press of a button to its release.
#[derive(Clone, Debug, PartialEq)]
struct Held {
    button: u8,
    grip: Grip,
    /// Position of the press, and last position of the mouse \[pixels\].
    start: [f64; 2],
    last: [f64; 2],
}

/// Maximum frame rate \[Hz\], the refresh rate of most screens.
const RATE: f64 = 60.0;
/// Largest mouse motion of a click \[pixels\].
const CLICK: f64 = 3.0;
/// Width of each image of the camera panel \[pixels\].
const PANEL: usize = 160;

/// State of a simulation window.
pub struct App {
    painter: Painter,
    panel: Panel,
    /// Image of the camera panel.
    small: Canvas,
    trails: Trails,
    snapshot: Option<Arc<Snapshot>>,
    size: [usize; 2],
    eye: Option<Eye>,
    /// Value of `Viewpoint::changes` that was last applied.
    view_changes: u64,
    shown: Shown,
    /// Environment of the camera panel and the sliders.
    env: usize,
    /// Camera sensor whose view fills the window.
    through: Option<usize>,
    /// Camera sensor of the panel.
    panel_of: Option<usize>,
    overlays: Overlays,
    picked: Option<Picked>,
    follow: Option<[f64; 3]>,
    grip: Option<Held>,
    held: HashSet<Key>,
    sliders: Option<usize>,
    help: bool,
    commands: Vec<Command>,
    /// True if the last command could not be sent.
    unheard: bool,
    drawn: Vec<Instant>,
    flown: Instant,
    desks: Desks,
    /// Adaptive sample count; `None` always uses four samples per pixel.
    fineness: Option<Fineness>,
    /// Duration of sending the last image to the display.
    handing: Duration,
    /// Number of the last rendered snapshot, and its view.
    showed: Option<(u64, View)>,
}

/// Omits snapshots and images, which are long.
impl fmt::Debug for App {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("App")
            .field("size", &self.size)
            .field("eye", &self.eye)
            .field("shown", &(self.shown, self.env))
            .field("cameras", &(self.through, self.panel_of))
            .field("overlays", &self.overlays)
            .field("picked", &(&self.picked, self.follow))
            .field("held", &self.held)
            .field("panels", &(self.sliders, self.help))
            .finish_non_exhaustive()
    }
}

impl App {
    /// Creates the state of a window of `size` pixels with at most `threads` rendering threads. Half of the threads
    /// render while physics needs all available time: at free speed, and for 5 s after physics fell behind the
    /// requested speed.
    pub fn new(size: [usize; 2], threads: usize) -> Self {
        Self {
            painter: Painter::new(threads),
            panel: Panel::new(threads),
            small: Canvas::default(),
            trails: Trails::default(),
            snapshot: None,
            size,
            eye: None,
            view_changes: 0,
            shown: Shown::All,
            env: 0,
            through: None,
            panel_of: None,
            overlays: Overlays::default(),
            picked: None,
            follow: None,
            grip: None,
            held: HashSet::new(),
            sliders: None,
            help: false,
            commands: Vec::new(),
            unheard: false,
            drawn: Vec::new(),
            flown: Instant::now(),
            desks: Desks::new(threads),
            fineness: None,
            handing: Duration::ZERO,
            showed: None,
        }
    }

    /// Sets the snapshot to render.
    pub fn show(&mut self, snapshot: Arc<Snapshot>) {
        self.env = self.env.min(snapshot.envs.len().saturating_sub(1));
        let changes = snapshot.viewpoint.map_or(0, |view| view.changes);
        let is_set_anew = changes > self.view_changes;
        self.view_changes = changes.max(self.view_changes);
        if is_set_anew || self.eye.is_none() {
            self.eye = Some(Eye::overview(&snapshot, self.size));
        }
        self.picked.iter_mut().for_each(|picked| picked.renumber(&snapshot.names));
        if let Some(Held { grip: Grip::Spring(pull), .. }) = &mut self.grip {
            pull.renumber(&snapshot.names);
        }
        if let (Some(last), Some(picked), Some(eye)) = (self.follow, &self.picked, &mut self.eye) {
            let now = picked.point_now(&snapshot);
            (0..3).for_each(|k| eye.target[k] += now[k] - last[k]);
            self.follow = Some(now);
        }
        self.trails.add(&snapshot, self.shown_now());
        self.snapshot = Some(snapshot);
        self.pull();
    }

    /// Records the result of sending the last command. The image shows a message after a failure.
    pub fn was_heard(&mut self, heard: bool) {
        self.unheard = !heard;
    }

    /// Records the duration of sending the last image to the display. The adaptive sample count includes it.
    pub fn handed_over(&mut self, took: Duration) {
        self.handing = took;
    }

    /// Sets the free camera.
    pub fn look_from(&mut self, eye: Eye) {
        self.eye = Some(eye);
    }

    /// Returns the free camera.
    pub fn eye(&self) -> Eye {
        self.eye.unwrap_or_default()
    }

    /// Returns the enabled overlays.
    pub fn overlays(&self) -> Overlays {
        self.overlays
    }

    /// Returns the selected point.
    pub fn picked(&self) -> Option<&Picked> {
        self.picked.as_ref()
    }

    /// Returns the snapshot contents that the window needs.
    pub fn wants(&self) -> Wants {
        let contacts = contacts_wanted(self.shown_now(), &self.overlays, self.picked.as_ref());
        Wants { rate: RATE, contacts, markers: self.overlays.sensors, ..Wants::default() }
    }

    /// Takes the commands for the simulation since the last call.
    pub fn take_commands(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.commands)
    }

    /// Enables adaptive sampling. If four samples per pixel would give fewer than 30 frames per second, moving images
    /// use one sample. Images at rest for a quarter of a second use four samples.
    pub fn keep_pace(&mut self) {
        self.fineness = Some(Fineness::default());
    }

    /// True if a new image is needed without an event: flight keys are held, or a resting image has only one sample per
    /// pixel.
    pub fn moves(&self, now: Instant) -> bool {
        !self.held.is_empty() || self.fineness.is_some_and(|fineness| fineness.wants_better(now))
    }

    /// Returns the environments in the image. A camera sensor shows its environment alone.
    fn shown_now(&self) -> Shown {
        if self.looks_through() { Shown::One(self.env) } else { self.shown }
    }

    /// True if the window shows a camera sensor: one is chosen, and it observes the environment.
    fn looks_through(&self) -> bool {
        self.through_view(1, 1).is_some()
    }

    /// Handles an input event.
    pub fn handle(&mut self, input: Input) {
        match input {
            Input::Press(key) => self.press(key),
            Input::Repeat(key) if action(key).is_some_and(Action::repeats) => self.press(key),
            Input::Repeat(_) => {}
            Input::Release(key) => {
                self.held.remove(&key);
            }
            Input::ButtonPress(button, at, modifiers) => self.grip(button, at, modifiers),
            Input::ButtonRelease(button, at) => self.release(button, at),
            Input::Move(at) => self.drag(at),
            Input::Wheel(steps, at) => self.wheel(steps, at),
            Input::Resize(size) => self.size = size,
            Input::FocusLost => self.held.clear(),
        }
    }

    fn press(&mut self, key: Key) {
        let Some(action) = action(key) else { return };
        if let Action::Fly(_) = action {
            if self.held.is_empty() {
                self.flown = Instant::now();
            }
            self.held.insert(key);
            return;
        }
        let Some(snapshot) = self.snapshot.clone() else { return };
        let (run, envs, cameras) = (&snapshot.run, snapshot.envs.len().max(1), snapshot.names.cameras.len());
        let factor = match run.speed {
            Speed::Times(factor) => factor,
            Speed::Free => run.measured_speed.map_or(1.0, |speed| speed.clamp(0.01, 100.0)),
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
            Action::Slower => self.commands.push(Command::SetSpeed(Speed::Times((factor / 2.0).max(Speed::RANGE[0])))),
            Action::Faster => self.commands.push(Command::SetSpeed(Speed::Times((factor * 2.0).min(Speed::RANGE[1])))),
            Action::RealTime => self.commands.push(Command::SetSpeed(Speed::REAL)),
            Action::FreeSpeed => self.commands.push(Command::SetSpeed(Speed::Free)),
            Action::Reset => self.commands.push(Command::Reset(self.shown_now().env())),
            Action::Record => self.commands.push(Command::Record(!records(&snapshot))),
            Action::NextEnv => self.show_env((self.env + 1) % envs),
            Action::PreviousEnv => self.show_env((self.env + envs - 1) % envs),
            Action::AllEnvs => self.shown = Shown::All,
            Action::NextCamera => self.through = next(self.through),
            Action::FreeView => self.through = None,
            Action::Overview => {
                (self.eye, self.follow, self.through) = (Some(Eye::overview(&snapshot, self.size)), None, None)
            }
            Action::Follow => {
                let point = self.picked.as_ref().map(|picked| picked.point_now(&snapshot));
                self.follow = point.filter(|_| self.follow.is_none());
            }
            Action::Sensors => o.sensors = !o.sensors,
            Action::Contacts => o.contacts = !o.contacts,
            Action::Frames => o.frames = !o.frames,
            Action::JointAxes => o.joints = !o.joints,
            Action::Masses => o.masses = !o.masses,
            Action::Names => o.names = !o.names,
            Action::Trails => o.trails = !o.trails,
            Action::Collisions => o.collisions = !o.collisions,
            Action::Visuals => o.visuals = !o.visuals,
            Action::Panel => self.panel_of = next(self.panel_of),
            Action::Sliders => self.sliders = if self.sliders.is_none() { Some(0) } else { None },
            Action::Help => self.help = !self.help,
            Action::Unselect => (self.picked, self.follow, self.help) = (None, None, false),
            Action::Fly(_) => {}
        }
    }

    /// Shows a single environment and moves the camera along.
    fn show_env(&mut self, env: usize) {
        let Some(snapshot) = &self.snapshot else { return };
        let from = self.shown.env().and_then(|EnvId(k)| snapshot.envs.get(k)).map(|env| env.origin);
        let to = snapshot.envs.get(env).map(|env| env.origin);
        if let (Some(to), Some(eye)) = (to, &mut self.eye) {
            match from {
                Some(from) => (0..3).for_each(|k| eye.target[k] += to[k] - from[k]),
                None => *eye = Eye::overview(&snapshot.only(env), self.size),
            }
        }
        (self.env, self.shown) = (env, Shown::One(env));
    }

    /// Returns the view of the image.
    fn view(&self) -> View {
        let [width, height] = self.size.map(|n| n.clamp(1, View::MAX_SIDE));
        if let Some(view) = self.through_view(width, height) {
            return view;
        }
        self.eye.unwrap_or_default().view(width, height)
    }

    /// Returns the view of the chosen camera sensor, scaled to fit the window; `None` without such a view.
    fn through_view(&self, width: usize, height: usize) -> Option<View> {
        let env = self.snapshot.as_ref()?.envs.get(self.env)?;
        let view = env.views.get(self.through?)?.as_ref()?.view;
        let scale = (width as f32 / view.width as f32).min(height as f32 / view.height as f32);
        let mut pose = view.world_from_camera;
        (0..3).for_each(|k| pose.translation[k] += env.origin[k] as f32);
        // The principal point keeps its position relative to the sensor image, which is centered in the window.
        let [left, top] = [width as f32 - scale * view.width as f32, height as f32 - scale * view.height as f32];
        let (cx, cy) = (view.cx * scale + 0.5 * left, view.cy * scale + 0.5 * top);
        Some(View { width, height, fx: view.fx * scale, fy: view.fy * scale, cx, cy, world_from_camera: pose, ..view })
    }

    fn grip(&mut self, button: u8, at: [f64; 2], modifiers: Modifiers) {
        let Some(snapshot) = self.snapshot.clone() else { return };
        match &self.grip {
            // Only one drag at a time.
            Some(held) if held.button != button => return,
            // The release of the same button was lost, so it is made up for.
            Some(_) => self.release(button, at),
            None => {}
        }
        if button == 1 && snapshot.run.recording.is_some() && hud::on_record_button(self.size[0], self.aside(), at) {
            self.commands.push(Command::Record(!records(&snapshot)));
            return;
        }
        let on_slider = self.sliders.and_then(|first| hud::slider_at(&snapshot, self.env, first, self.size, at));
        let on_timeline = timeline::time_at(&snapshot, self.size, at).filter(|_| button == 1);
        let grip = match button {
            1 if on_timeline.is_some() => {
                self.commands.extend(on_timeline.map(Command::Seek));
                Some(Grip::Timeline)
            }
            1 if on_slider.is_some() => {
                let Some((joint, value)) = on_slider else { return };
                self.set_target(&snapshot, joint, value);
                Some(Grip::Slider(joint))
            }
            1 if self.sliders.is_some() && at[0] >= self.size[0] as f64 - f64::from(hud::SLIDERS) => None,
            1 if modifiers.ctrl => self.spring(&snapshot, at),
            1 if modifiers.shift => Some(Grip::Pan),
            1 => Some(Grip::Orbit),
            2 => Some(Grip::Turn),
            3 => Some(Grip::Pan),
            _ => None,
        };
        self.grip = grip.map(|grip| Held { button, grip, start: at, last: at });
    }

    /// Grabs the body at a pixel with a mouse spring.
    fn spring(&mut self, snapshot: &Snapshot, at: [f64; 2]) -> Option<Grip> {
        let view = self.view();
        let look = Look { shown: self.shown_now(), overlays: self.overlays, ..Look::default() };
        let pull = Pull::at(&mut self.painter, snapshot, &view, &look, at)?;
        self.picked = Some(pull.picked().clone());
        Some(Grip::Spring(pull))
    }

    fn drag(&mut self, at: [f64; 2]) {
        let Some(mut held) = self.grip.take() else { return };
        let by = [at[0] - held.last[0], at[1] - held.last[1]];
        let height = self.size[1];
        let free = !self.looks_through();
        match (&held.grip, &mut self.eye) {
            (Grip::Orbit, Some(eye)) if free => eye.orbit(by, height),
            (Grip::Pan, Some(eye)) if free => eye.pan(by, height),
            (Grip::Turn, Some(eye)) if free => eye.turn(by, height),
            _ => {}
        }
        if let Some(snapshot) = self.snapshot.clone() {
            match &mut held.grip {
                Grip::Slider(joint) => {
                    let value = hud::slider_value(&snapshot, self.env, *joint, self.size[0], at[0]);
                    value.into_iter().for_each(|value| self.set_target(&snapshot, *joint, value));
                }
                Grip::Spring(pull) => pull.to(&snapshot, &self.view(), at),
                Grip::Timeline => {
                    let time = timeline::time_beside(&snapshot, self.size[0], at[0]);
                    self.commands.extend(time.map(Command::Seek));
                }
                Grip::Orbit | Grip::Pan | Grip::Turn => {}
            }
        }
        self.grip = Some(Held { last: at, ..held });
        self.pull();
    }

    /// Queues a drag command with the current spring, in place of older ones.
    fn pull(&mut self) {
        if let Some(Held { grip: Grip::Spring(pull), .. }) = &self.grip
            && let Some(drag) = pull.command()
        {
            self.commands.retain(|command| !matches!(command, Command::Drag { .. }));
            self.commands.push(drag);
        }
    }

    fn release(&mut self, button: u8, at: [f64; 2]) {
        let Some(Held { grip, start, .. }) = self.grip.take_if(|held| held.button == button) else { return };
        match grip {
            Grip::Spring(_) => self.commands.push(Command::Release),
            Grip::Orbit if (at[0] - start[0]).hypot(at[1] - start[1]) < CLICK => self.select(at),
            _ => {}
        }
    }

    fn select(&mut self, at: [f64; 2]) {
        let Some(snapshot) = self.snapshot.clone() else { return };
        let look = Look { shown: self.shown_now(), overlays: self.overlays, ..Look::default() };
        let view = self.view();
        self.picked = self.painter.pick(&snapshot, &view, &look, at);
        self.follow = None;
        if let Some(picked) = self.picked.as_ref().filter(|picked| picked.body.is_some()) {
            self.env = picked.env;
        }
    }

    fn wheel(&mut self, steps: f64, at: [f64; 2]) {
        let count = self.snapshot.as_ref().map_or(0, |snapshot| hud::driven(snapshot).len());
        if let Some(first) = &mut self.sliders
            && at[0] >= self.size[0] as f64 - f64::from(hud::SLIDERS)
        {
            let moved = first.saturating_add_signed(-(steps as isize));
            *first = moved.min(count.saturating_sub(1));
        } else if !self.looks_through()
            && let Some(eye) = &mut self.eye
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
    fn fly(&mut self, now: Instant) {
        let seconds = now.saturating_duration_since(self.flown).as_secs_f64().min(0.1);
        self.flown = now;
        if self.looks_through() {
            return;
        }
        let Some(eye) = &mut self.eye else { return };
        let mut way = Vector3::zeros();
        for key in &self.held {
            if let Some(Action::Fly(direction)) = action(*key) {
                way += Vector3::from(direction.map(f64::from));
            }
        }
        // The speed per second is the distance to the target.
        eye.fly((way * eye.distance * seconds).into());
    }

    /// Renders the image of the window, including overlays and panels; black before the first snapshot.
    pub fn draw(&mut self, canvas: &mut Canvas, now: Instant) {
        let [width, height] = self.size.map(|n| n.clamp(1, View::MAX_SIDE));
        canvas.resize(width, height);
        self.fly(now);
        let Some(snapshot) = self.snapshot.clone() else { return };
        self.drawn.retain(|then| now.saturating_duration_since(*then).as_secs_f64() < 1.0);
        self.drawn.push(now);
        let view = self.view();
        let spring = match &self.grip {
            Some(Held { grip: Grip::Spring(pull), .. }) => Some(pull.spring(&snapshot)),
            _ => None,
        };
        let (shown, overlays, picked) = (self.shown_now(), self.overlays, self.picked.as_ref());
        let look = Look { shown, overlays, picked, trails: Some(&self.trails), spring };
        self.painter.use_threads(self.desks.now(&snapshot.run, now));
        // The snapshot number of a paused simulation changes only if a user changed something.
        let shows = (snapshot.number, view);
        let changed = self.showed.replace(shows) != Some(shows);
        if let Some(fineness) = &mut self.fineness {
            self.painter.set_samples(fineness.samples(changed, now));
        }
        let start = Instant::now();
        // The view of a window is always valid. If rendering fails, the canvas keeps its content.
        let _ = self.painter.draw(&snapshot, &view, &look, canvas);
        if let Some(fineness) = &mut self.fineness {
            // The current image is not sent yet, so the duration of sending the last image serves as an estimate.
            fineness.drew(self.painter.samples(), start.elapsed() + self.handing);
        }
        let name = self.caption(&snapshot);
        let refused = if self.unheard { Some(TAKES_NONE) } else { snapshot.run.refused.as_deref() };
        hud::status(canvas, &snapshot, shown, &name, self.drawn.len() as f64, refused);
        if let Some(picked) = &self.picked {
            let mut lines = describe(picked, &snapshot);
            lines.extend(self.follow.map(|_| "followed".into()));
            // An empty line leaves space for the timeline below.
            lines.extend(snapshot.run.timeline.map(|_| String::new()));
            hud::note(canvas, &lines);
        }
        self.draw_panel(&snapshot, canvas);
        if let Some(first) = self.sliders {
            hud::sliders(canvas, &snapshot, self.env, first);
        }
        if let Some(recording) = &snapshot.run.recording {
            hud::record_button(canvas, self.aside(), recording);
        }
        timeline::draw(canvas, &snapshot);
        if self.help {
            hud::help(canvas);
        }
    }

    /// Returns the description of the view: free camera or camera sensor.
    fn caption(&self, snapshot: &Snapshot) -> String {
        let Some(name) = self.through.and_then(|camera| snapshot.names.cameras.get(camera)) else {
            return "free view".into();
        };
        let env = self.env;
        let looks = snapshot.envs.get(env).and_then(|env| env.views.get(self.through?)?.as_ref());
        match looks {
            Some(looks) if looks.lens.is_pinhole() => format!("camera {name}, environment {env}"),
            // The window image is rasterized without the lens; the panel traces the rays of the lens.
            Some(looks) => {
                format!("camera {name} without its {} lens (I: with it), environment {env}", looks.lens.name())
            }
            None => format!("free view: camera {name} does not look at environment {env}"),
        }
    }

    /// Returns the width of the slider panel, or 0 if it is closed \[pixels\].
    fn aside(&self) -> usize {
        if self.sliders.is_some() { hud::SLIDERS as usize } else { 0 }
    }

    /// Draws the camera panel in the lower right corner, to the left of the sliders.
    fn draw_panel(&mut self, snapshot: &Snapshot, canvas: &mut Canvas) {
        let Some(camera) = self.panel_of else { return };
        if self.panel.draw(snapshot, camera, self.env, PANEL, &mut self.small) {
            let [width, height] = self.small.dimensions();
            let left = self.size[0].saturating_sub(width + self.aside() + 6);
            let top = self.size[1].saturating_sub(height + 6);
            canvas.paste(&self.small, [left, top]);
            if let Some(name) = snapshot.names.cameras.get(camera) {
                let text = format!("camera {name}, environment {}", self.env);
                hud::caption(canvas, &text, [left + 4, top.saturating_sub(13)]);
            }
        }
    }
}

/// True while a recording is running.
fn records(snapshot: &Snapshot) -> bool {
    snapshot.run.recording.as_ref().is_some_and(|recording| recording.on)
}
