//! The observer that publishes snapshots to viewers and runs their commands.

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

/// Longest wait between two checks for commands and dropped viewers.
const PATIENCE: Duration = Duration::from_millis(100);

/// Publishes snapshots of a simulation to all its viewers and runs their commands between steps. See
/// [`Viewing`](super::Viewing).
///
/// A paused simulation blocks inside [`Observer::observe`], on the thread that called `update`. It continues when the
/// last viewer is dropped.
#[derive(Debug)]
pub struct Conductor {
    hub: Arc<Hub>,
    pool: Pool,
    /// Created at the first step with viewers, from the time step of the simulation.
    pace: Option<Pace>,
    wants: Wants,
    /// Step at which the simulation is paused; `None` while running.
    hold_at: Option<u64>,
    /// Viewers that paused the simulation. It resumes when the last of them is dropped.
    held_by: BTreeSet<u64>,
    /// Speeds set by viewers, oldest first. The last entry applies; entries of dropped viewers are removed.
    speeds: Vec<(u64, Speed)>,
    /// Step of the next check for commands.
    look_at: u64,
    /// Time of the last snapshot.
    shown: Option<Instant>,
    /// True if the state changed since the last published snapshot.
    dirty: bool,
    springs: BTreeMap<u64, Spring>,
    /// Bodies with a spring force in the last step.
    pulled: Vec<HeldBody>,
    button: Option<RecordButton>,
    /// Last known state of the recording.
    recording: Option<RecordingState>,
    /// Viewer that started the recording; `None` if the program started it.
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

    /// Adds a viewer.
    pub(super) fn admit(&mut self, wants: Wants) -> Viewer {
        let viewer = self.hub.admit(wants);
        self.wants = self.wants.union(wants);
        self.look_at = 0;
        viewer
    }

    /// Replaces the record button and stops the recording of the previous button.
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

    /// Starts or stops the recording on behalf of a viewer.
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

    /// Stops a recording whose viewer was dropped.
    fn end_recording_of_gone(&mut self, sim: &mut SimulationManager, viewers: &[u64]) {
        if let Some(viewer) = self.recorded_by.filter(|viewer| !viewers.contains(viewer)) {
            self.dirty = true;
            let ended = self.record(sim, viewer, false);
            self.refusals.note(Kind::Other, ended.err());
        }
    }

    /// Publishes a snapshot of the current state.
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
        // If viewers hold every snapshot, or are reading the newest one right now, the next attempt publishes.
        let taken = self.pool.take(sim, self.hub.viewers() + 2, &self.wants, run);
        self.dirty = !taken.is_some_and(|snapshot| self.hub.show(snapshot));
    }

    /// Returns the time until the next snapshot is due.
    fn rest(&self) -> Duration {
        let period = Duration::from_secs_f64(1.0 / self.wants.rate.clamp(0.1, 1000.0));
        self.shown.map_or(Duration::ZERO, |shown| period.saturating_sub(shown.elapsed()))
    }

    /// Runs the queued commands. Returns `false` if no viewer is left.
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

    /// Undoes the pause and speed of dropped viewers; settings of other viewers remain.
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
                // During a pause, a step command does not make its viewer a holder of the pause.
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

    /// Applies the spring forces to the next step. Springs of several viewers on one body are added.
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

    /// Undoes all viewer settings after the last viewer was dropped.
    fn let_go(&mut self, sim: &mut SimulationManager) {
        self.springs.clear();
        self.pull(sim);
        (self.hold_at, self.pace) = (None, None);
        self.refusals.forget();
        self.held_by.clear();
        self.speeds.clear();
    }

    /// Handles completed steps: runs commands, publishes a snapshot, and waits while paused or ahead of schedule.
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
                // Body indices have changed, so active drags end. The mouse creates them again.
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
