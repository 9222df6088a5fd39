//! The observer that shows a simulation to its viewers and does what they ask for.

mod playback;
mod refusals;

pub use playback::{Film, Play, PlayError};

use super::hub::{Hub, Mail, Viewer};
use super::pace::Pace;
use super::recording::{RecordButton, RecordingState};
use super::spring::{self, HeldBody, Spring};
use super::{Command, Speed, Wants};
use crate::stage::{Pool, Run};
use kinetoscope_sim::{EnvId, Moment, Observer, SimulationManager};
use ndarray::arr2;
use refusals::{Kind, Refusals};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// How long is waited before it is looked again whether anybody is still there.
const PATIENCE: Duration = Duration::from_millis(100);

/// Shows a simulation to all its viewers, and does what they ask for, between its steps. See
/// [`Viewing`](super::Viewing).
///
/// While it is paused it holds the thread that called `update`, in [`Observer::observe`]; it lets go when the last viewer
/// is gone.
#[derive(Debug)]
pub struct Conductor {
    hub: Arc<Hub>,
    pool: Pool,
    /// Made with the first viewer, when the length of a step is known.
    pace: Option<Pace>,
    wants: Wants,
    /// The step at which it holds; `None` while it runs.
    hold_at: Option<u64>,
    /// Who wants it held; it runs again when the last of them is gone.
    held_by: BTreeSet<u64>,
    /// How fast each viewer wanted it, the last wish last: that one counts, for as long as its viewer is there.
    speeds: Vec<(u64, Speed)>,
    /// The step at which it looks again.
    look_at: u64,
    /// When the last snapshot was taken.
    shown: Option<Instant>,
    /// Something changed that no snapshot shows.
    dirty: bool,
    springs: BTreeMap<u64, Spring>,
    /// Bodies that springs pulled at last.
    pulled: Vec<HeldBody>,
    button: Option<RecordButton>,
    /// How the recording stood when that was asked last.
    recording: Option<RecordingState>,
    /// Who began what is recorded; `None` where the program did.
    recorded_by: Option<u64>,
    refusals: Refusals,
}

impl Conductor {
    pub(super) fn new() -> Self {
        Self {
            hub: Arc::default(),
            pool: Pool::default(),
            pace: None,
            wants: Wants::NOTHING,
            hold_at: None,
            held_by: BTreeSet::new(),
            speeds: Vec::new(),
            look_at: 0,
            shown: None,
            dirty: true,
            springs: BTreeMap::new(),
            pulled: Vec::new(),
            button: None,
            recording: None,
            recorded_by: None,
            refusals: Refusals::default(),
        }
    }

    /// A new viewer.
    pub(super) fn admit(&mut self, wants: Wants) -> Viewer {
        let viewer = self.hub.admit(wants);
        self.wants = self.wants.union(wants);
        self.look_at = 0;
        viewer
    }

    /// Another record button.
    pub(super) fn set_button(&mut self, sim: &mut SimulationManager, button: RecordButton) {
        if self.button.as_ref() == Some(&button) {
            return;
        }
        if let Some(old) = self.button.replace(button) {
            self.refusals.note(Kind::Other, old.set(sim, false).err());
        }
        (self.recording, self.recorded_by) = (None, None);
        if self.hub.viewers() > 0 {
            self.publish(sim);
        }
    }

    /// Begins to record for a viewer, or ends it.
    fn record(&mut self, sim: &mut SimulationManager, viewer: u64, on: bool) -> Result<(), String> {
        let button = self.button.as_ref().ok_or("there is no record button here: the program has given none")?;
        let was = button.state(sim).is_some_and(|state| state.on);
        if was && !on && self.recorded_by.is_none() {
            return Err("the program itself records this, and ends it".into());
        }
        button.set(sim, on)?;
        if !on {
            self.recorded_by = None;
        } else if !was {
            self.recorded_by = Some(viewer);
        }
        Ok(())
    }

    /// What a viewer has begun to record ends with the viewer.
    fn end_recording_of_gone(&mut self, sim: &mut SimulationManager, viewers: &[u64]) {
        if let Some(viewer) = self.recorded_by.filter(|viewer| !viewers.contains(viewer)) {
            self.dirty = true;
            let ended = self.record(sim, viewer, false);
            self.refusals.note(Kind::Other, ended.err());
        }
    }

    /// Shows the simulation as it is.
    pub(super) fn publish(&mut self, sim: &mut SimulationManager) {
        if let Some(button) = &self.button {
            self.recording = button.state(sim).or(self.recording.take());
        }
        let run = Run {
            steps: sim.observers().steps(),
            paused: self.hold_at.is_some_and(|step| step <= sim.observers().steps()),
            speed: self.pace.as_ref().map_or(Speed::Free, Pace::speed),
            measured_speed: self.pace.as_ref().and_then(Pace::measured),
            refused: self.refusals.reason(),
            refusals: self.refusals.count(),
            recording: self.recording.clone(),
            timeline: None,
        };
        self.shown = Some(Instant::now());
        // Where every snapshot is in somebody's hands, or the newest is just being taken, the next one will do.
        let taken = self.pool.take(sim, self.hub.viewers() + 2, &self.wants, run);
        self.dirty = !taken.is_some_and(|snapshot| self.hub.show(snapshot));
    }

    /// How long no snapshot is due.
    fn rest(&self) -> Duration {
        let period = Duration::from_secs_f64(1.0 / self.wants.rate.clamp(0.1, 1000.0));
        self.shown.map_or(Duration::ZERO, |shown| period.saturating_sub(shown.elapsed()))
    }

    /// Does what viewers asked for. Says whether there are any.
    fn obey(&mut self, sim: &mut SimulationManager) -> bool {
        let Mail { commands, viewers, wants } = self.hub.collect();
        self.dirty |= wants != self.wants;
        self.wants = wants;
        for (viewer, command) in commands {
            self.dirty = true;
            let done = self.act(sim, viewer, command);
            self.refusals.answer(Kind::of(&command), done);
        }
        let gone: Vec<u64> = self.springs.keys().copied().filter(|viewer| !viewers.contains(viewer)).collect();
        for viewer in gone {
            self.release(sim, viewer);
        }
        self.forget_gone(sim.observers().steps(), &viewers);
        self.end_recording_of_gone(sim, &viewers);
        !viewers.is_empty()
    }

    /// What viewers did to time ends with them, whoever else still watches.
    fn forget_gone(&mut self, steps: u64, viewers: &[u64]) {
        self.held_by.retain(|viewer| viewers.contains(viewer));
        if self.held_by.is_empty() && self.hold_at.is_some() {
            self.hold_at = None;
            self.restart(steps);
            self.dirty = true;
        }
        let wishes = self.speeds.len();
        self.speeds.retain(|(viewer, _)| viewers.contains(viewer));
        if self.speeds.len() < wishes {
            self.dirty = true;
            let speed = self.speeds.last().map_or(Speed::Free, |(_, speed)| *speed);
            if let Some(pace) = self.pace.as_mut().filter(|pace| pace.speed() != speed) {
                pace.set_speed(speed, steps, Instant::now());
            }
        }
    }

    fn act(&mut self, sim: &mut SimulationManager, viewer: u64, command: Command) -> Result<(), String> {
        let steps = sim.observers().steps();
        match command {
            Command::Pause => {
                self.hold_at = self.hold_at.map(|step| step.min(steps)).or(Some(steps));
                self.held_by.insert(viewer);
            }
            Command::TogglePause => {
                let next = if self.hold_at.is_some() { Command::Resume } else { Command::Pause };
                return self.act(sim, viewer, next);
            }
            Command::Resume => {
                self.hold_at = None;
                self.held_by.clear();
                self.restart(steps);
            }
            Command::Step(count) => {
                let from = self.hold_at.map_or(steps, |step| step.max(steps));
                self.hold_at = Some(from.saturating_add(u64::from(count)));
                // Steps in a pause are of those who paused.
                if self.held_by.is_empty() {
                    self.held_by.insert(viewer);
                }
                self.restart(steps);
            }
            Command::SetSpeed(speed) if speed.is_valid() => {
                self.speeds.retain(|(other, _)| *other != viewer);
                self.speeds.push((viewer, speed));
                self.pace.iter_mut().for_each(|pace| pace.set_speed(speed, steps, Instant::now()));
            }
            Command::SetSpeed(speed) => {
                let [slow, fast] = Speed::RANGE;
                return Err(format!("speed {speed:?}: the factor must be {slow} to {fast}"));
            }
            Command::Reset(env) => {
                let envs = env.map(|env| [env]);
                sim.reset(envs.as_ref().map(<[EnvId; 1]>::as_slice)).map_err(|error| error.to_string())?;
            }
            Command::SetTarget { robot, joint, env, value } => {
                if !sim.entities().robot_ids().iter().any(|(_, known)| *known == robot) {
                    return Err("there is no such robot in this simulation".into());
                }
                let envs = env.map(|env| [env]);
                let envs = envs.as_ref().map(<[EnvId; 1]>::as_slice);
                let set = sim.robot_mut(robot).set_qpos_target(&arr2(&[[value]]), Some(&[joint]), envs);
                set.map_err(|error| error.to_string())?;
            }
            Command::Drag { env, body, hold, target } => {
                let spring = Spring { env, body, hold, target };
                if self.springs.get(&viewer).is_some_and(|old| old.held() != spring.held()) {
                    self.release(sim, viewer);
                }
                spring.apply(sim).map_err(|error| error.to_string())?;
                self.springs.insert(viewer, spring);
                self.pull(sim);
            }
            Command::Release => self.release(sim, viewer),
            Command::Record(on) => self.record(sim, viewer, on)?,
            Command::Seek(_) => return Err("this is no recording: only what was recorded has a time line".into()),
        }
        Ok(())
    }

    fn release(&mut self, sim: &mut SimulationManager, viewer: u64) {
        if self.springs.remove(&viewer).is_some() {
            self.pull(sim);
        }
    }

    /// Springs pull for the next step; those of several viewers at one body, together.
    fn pull(&mut self, sim: &mut SimulationManager) {
        let Self { springs, refusals, pulled, .. } = self;
        let mut forces: Vec<(HeldBody, Vec<_>)> = Vec::new();
        springs.retain(|_, spring| match spring.force_now(sim) {
            Ok(force) => {
                match forces.iter_mut().find(|(held, _)| *held == spring.held()) {
                    Some((_, of_body)) => of_body.extend(force),
                    None => forces.push((spring.held(), force.into_iter().collect())),
                }
                true
            }
            Err(error) => {
                refusals.note(Kind::Spring, Some(error.to_string()));
                false
            }
        });
        for let_go in pulled.drain(..).filter(|held| !forces.iter().any(|(now, _)| now == held)) {
            spring::release(sim, let_go);
        }
        for (held, forces) in forces {
            match sim.scene_mut().pull(held.env, held.body, &forces) {
                Ok(()) => pulled.push(held),
                Err(error) => {
                    refusals.note(Kind::Spring, Some(error.to_string()));
                    springs.retain(|_, spring| spring.held() != held);
                    spring::release(sim, held);
                }
            }
        }
    }

    fn restart(&mut self, steps: u64) {
        self.pace.iter_mut().for_each(|pace| pace.restart(steps, Instant::now()));
    }

    /// Nobody watches: the simulation is on its own again.
    fn let_go(&mut self, sim: &mut SimulationManager) {
        self.springs.clear();
        self.pull(sim);
        (self.hold_at, self.pace) = (None, None);
        self.refusals.forget();
        self.held_by.clear();
        self.speeds.clear();
    }

    /// Steps were done: obeys, shows, waits.
    fn conduct(&mut self, sim: &mut SimulationManager) {
        let steps = sim.observers().steps();
        let dt = sim.cfg().physics_dt;
        let pace = self.pace.get_or_insert_with(|| Pace::new(dt, steps, Instant::now()));
        pace.note(steps, Instant::now());
        self.dirty = true;
        loop {
            if !self.obey(sim) {
                return self.let_go(sim);
            }
            let holds = self.hold_at.is_some_and(|step| step <= steps);
            let ahead = self.pace.as_mut().map_or(Duration::ZERO, |pace| pace.ahead(steps, Instant::now()));
            let (rest, waits) = (self.rest(), holds || !ahead.is_zero());
            if self.dirty && rest.is_zero() {
                self.publish(sim);
            }
            if !waits {
                break;
            }
            let until_shown = if self.dirty { rest.max(Duration::from_millis(1)) } else { PATIENCE };
            let until_stepped = if holds { PATIENCE } else { ahead };
            self.hub.wait_for_news(until_shown.min(until_stepped).min(PATIENCE));
        }
        self.pace.iter_mut().for_each(|pace| pace.waited(steps, Instant::now()));
        self.pull(sim);
        let block = self.pace.as_ref().map_or(1, Pace::block);
        let block = if self.springs.is_empty() { block } else { 1 };
        self.look_at = steps + block;
        self.look_at = self.hold_at.map_or(self.look_at, |step| self.look_at.min(step));
    }
}

impl Observer for Conductor {
    fn due_in(&self, sim: &SimulationManager) -> u64 {
        if self.hub.viewers() == 0 && self.pace.is_none() {
            return u64::MAX;
        }
        self.look_at.saturating_sub(sim.observers().steps()).max(1)
    }

    fn observe(&mut self, sim: &mut SimulationManager, moment: &Moment) {
        match moment {
            Moment::Stepped => self.conduct(sim),
            Moment::Compiled => {
                self.pool.forget_names();
                // Bodies have other numbers now; whoever drags will drag again.
                self.springs.clear();
                self.pulled.clear();
                if self.hub.viewers() > 0 {
                    self.publish(sim);
                }
            }
            _ => {
                self.dirty = true;
                if self.hub.viewers() > 0 && self.rest().is_zero() {
                    self.publish(sim);
                }
            }
        }
    }
}

impl Drop for Conductor {
    fn drop(&mut self) {
        self.hub.end();
    }
}
