//! What a window does with mouse and keys, and what it draws: everything but the window.

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

/// What happens to a window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// A key was pressed.
    Press(Key),
    /// A key is held, and repeats.
    Repeat(Key),
    /// A key was let go.
    Release(Key),
    /// A button of the mouse was pressed at a pixel: 1 is the left one, 2 the middle one, 3 the right one.
    ButtonPress(u8, [f64; 2], Modifiers),
    /// A button was let go.
    ButtonRelease(u8, [f64; 2]),
    /// The mouse is at a pixel.
    Move([f64; 2]),
    /// The wheel was turned by steps, away from the user, at a pixel.
    Wheel(f64, [f64; 2]),
    /// The window has this many pixels.
    Resize([usize; 2]),
    /// The keyboard is somebody else's now.
    FocusLost,
}

/// Keys that are held while a button is pressed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Modifiers {
    /// Shift.
    pub shift: bool,
    /// Control.
    pub ctrl: bool,
}

/// What the mouse is doing.
#[derive(Clone, Debug, PartialEq)]
enum Grip {
    Orbit,
    Pan,
    Turn,
    /// The time line of a recording.
    Timeline,
    /// A slider of a joint.
    Slider(usize),
    /// A body.
    Spring(Pull),
}

/// What the mouse is doing since a button was pressed, until that button is let go.
#[derive(Clone, Debug, PartialEq)]
struct Held {
    button: u8,
    grip: Grip,
    /// Where it was pressed, and where the mouse was last.
    start: [f64; 2],
    last: [f64; 2],
}

/// Pictures per second, at most: what most screens show.
const RATE: f64 = 60.0;
/// A mouse that moved less than this between press and release clicked \[pixels\].
const CLICK: f64 = 3.0;
/// Width of each of the panel's four pictures \[pixels\].
const PANEL: usize = 160;

/// The state of a window.
pub struct App {
    painter: Painter,
    panel: Panel,
    /// The panel's pictures.
    small: Canvas,
    trails: Trails,
    snapshot: Option<Arc<Snapshot>>,
    size: [usize; 2],
    eye: Option<Eye>,
    /// Number of the program's point of view that was taken over.
    view_changes: u64,
    shown: Shown,
    /// The environment that panels and sliders are of.
    env: usize,
    /// The camera sensor that is looked through.
    through: Option<usize>,
    /// The camera sensor of the panel.
    panel_of: Option<usize>,
    overlays: Overlays,
    picked: Option<Picked>,
    follow: Option<[f64; 3]>,
    grip: Option<Held>,
    held: HashSet<Key>,
    sliders: Option<usize>,
    help: bool,
    commands: Vec<Command>,
    /// The last command came to nobody.
    unheard: bool,
    drawn: Vec<Instant>,
    flown: Instant,
    desks: Desks,
    /// Where pictures may have fewer samples to keep pace.
    fineness: Option<Fineness>,
    /// How long it took to hand the last picture to the display.
    handing: Duration,
    /// What the last picture showed: which snapshot, from where.
    showed: Option<(u64, View)>,
}

/// Short: snapshots and pictures are long.
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
    /// A window of `size` pixels, drawn on `threads` threads at most, and on half of them where physics takes all the time that
    /// it can get: as fast as can be, and for some seconds after it fell behind the speed that it should have.
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

    /// A newer snapshot.
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

    /// Whether the simulation could be told what the user wants: if not, the picture says so.
    pub fn was_heard(&mut self, heard: bool) {
        self.unheard = !heard;
    }

    /// How long it took to hand the last picture to the display: that, too, is time in which nothing is drawn.
    pub fn handed_over(&mut self, took: Duration) {
        self.handing = took;
    }

    /// Looks from somewhere else.
    pub fn look_from(&mut self, eye: Eye) {
        self.eye = Some(eye);
    }

    /// Where it looks from, where it looks freely.
    pub fn eye(&self) -> Eye {
        self.eye.unwrap_or_default()
    }

    /// What is drawn beside what is there.
    pub fn overlays(&self) -> Overlays {
        self.overlays
    }

    /// What was clicked on last.
    pub fn picked(&self) -> Option<&Picked> {
        self.picked.as_ref()
    }

    /// What it wants to find in snapshots.
    pub fn wants(&self) -> Wants {
        let contacts = contacts_wanted(self.shown_now(), &self.overlays, self.picked.as_ref());
        Wants { rate: RATE, contacts, markers: self.overlays.sensors, ..Wants::default() }
    }

    /// What it asks the simulation for, since this was called last.
    pub fn take_commands(&mut self) -> Vec<Command> {
        std::mem::take(&mut self.commands)
    }

    /// From now on what moves is drawn with one sample per pixel instead of four where those would make fewer than 30 pictures
    /// per second. What rests for a quarter of a second has four.
    pub fn keep_pace(&mut self) {
        self.fineness = Some(Fineness::default());
    }

    /// Whether there is a picture to draw even where nothing happens: keys to fly are held, or what rests was drawn coarsely.
    pub fn moves(&self, now: Instant) -> bool {
        !self.held.is_empty() || self.fineness.is_some_and(|fineness| fineness.wants_better(now))
    }

    /// Which environments are in the picture: where somebody looks through a camera, that of the camera.
    fn shown_now(&self) -> Shown {
        if self.looks_through() { Shown::One(self.env) } else { self.shown }
    }

    /// Whether the picture is a camera sensor's: one is chosen, and it looks at the environment.
    fn looks_through(&self) -> bool {
        self.through_view(1, 1).is_some()
    }

    /// Something happened.
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

    /// Shows one environment; the eye goes along.
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

    /// The camera of the picture.
    fn view(&self) -> View {
        let [width, height] = self.size.map(|n| n.clamp(1, View::MAX_SIDE));
        if let Some(view) = self.through_view(width, height) {
            return view;
        }
        self.eye.unwrap_or_default().view(width, height)
    }

    /// What a camera sensor looks at, its picture as large as fits.
    fn through_view(&self, width: usize, height: usize) -> Option<View> {
        let env = self.snapshot.as_ref()?.envs.get(self.env)?;
        let view = env.views.get(self.through?)?.as_ref()?.view;
        let scale = (width as f32 / view.width as f32).min(height as f32 / view.height as f32);
        let mut pose = view.world_from_camera;
        (0..3).for_each(|k| pose.translation[k] += env.origin[k] as f32);
        // The principal point keeps its place in the sensor's picture, which is in the middle of the window.
        let [left, top] = [width as f32 - scale * view.width as f32, height as f32 - scale * view.height as f32];
        let (cx, cy) = (view.cx * scale + 0.5 * left, view.cy * scale + 0.5 * top);
        Some(View { width, height, fx: view.fx * scale, fy: view.fy * scale, cx, cy, world_from_camera: pose, ..view })
    }

    fn grip(&mut self, button: u8, at: [f64; 2], modifiers: Modifiers) {
        let Some(snapshot) = self.snapshot.clone() else { return };
        match &self.grip {
            // One thing at a time.
            Some(held) if held.button != button => return,
            // That it was let go was not heard.
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

    /// A body to be pulled.
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

    /// Sends the spring as it is.
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

    /// Flies on while keys are held.
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
        // As fast as what is looked at is far.
        eye.fly((way * eye.distance * seconds).into());
    }

    /// Draws the window's picture; black before the first snapshot.
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
        // Held by a pause, a simulation shows another snapshot where somebody moved something, and only there.
        let shows = (snapshot.number, view);
        let changed = self.showed.replace(shows) != Some(shows);
        if let Some(fineness) = &mut self.fineness {
            self.painter.set_samples(fineness.samples(changed, now));
        }
        let start = Instant::now();
        // Views of windows are good ones; one that is not leaves the last picture.
        let _ = self.painter.draw(&snapshot, &view, &look, canvas);
        if let Some(fineness) = &mut self.fineness {
            // This picture is not handed over yet: that will take as long as the last one took.
            fineness.drew(self.painter.samples(), start.elapsed() + self.handing);
        }
        let name = self.caption(&snapshot);
        let refused = if self.unheard { Some(TAKES_NONE) } else { snapshot.run.refused.as_deref() };
        hud::status(canvas, &snapshot, shown, &name, self.drawn.len() as f64, refused);
        if let Some(picked) = &self.picked {
            let mut lines = describe(picked, &snapshot);
            lines.extend(self.follow.map(|_| "followed".into()));
            // The time line is below.
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

    /// What it is looked through.
    fn caption(&self, snapshot: &Snapshot) -> String {
        let Some(name) = self.through.and_then(|camera| snapshot.names.cameras.get(camera)) else {
            return "free view".into();
        };
        let env = self.env;
        let looks = snapshot.envs.get(env).and_then(|env| env.views.get(self.through?)?.as_ref());
        match looks {
            Some(looks) if looks.lens.is_pinhole() => format!("camera {name}, environment {env}"),
            // The rasterizer draws straight lines; the panel follows the rays.
            Some(looks) => {
                format!("camera {name} without its {} lens (I: with it), environment {env}", looks.lens.name())
            }
            None => format!("free view: camera {name} does not look at environment {env}"),
        }
    }

    /// How much of the right side the sliders take \[pixels\].
    fn aside(&self) -> usize {
        if self.sliders.is_some() { hud::SLIDERS as usize } else { 0 }
    }

    /// The camera panel in the lower right corner, beside the sliders.
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

/// Whether what is shown is being recorded.
fn records(snapshot: &Snapshot) -> bool {
    snapshot.run.recording.as_ref().is_some_and(|recording| recording.on)
}
