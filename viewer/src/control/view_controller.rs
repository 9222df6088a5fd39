//! The observer that publishes snapshots to viewers and runs their commands.

mod playback;
mod refusals;

pub use playback::{Play, PlayError, PlaybackSource};

use super::hub::{CollectedCommands, Hub, Viewer};
use super::real_time_clock::RealTimeClock;
use super::recording::{RecordButton, RecordingState};
use super::spring::{self, BodyRef, Spring};
use super::{Command, SnapshotRequest, Speed};
use crate::scene_view::{RunState, SnapshotPool};
use kinetoscope_sim::{EnvId, Observer, SimEvent, SimulationManager};
use ndarray::arr2;
use refusals::{CommandKind, Refusals};
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// Longest wait between two checks for commands and dropped viewers.
const MAX_WAIT: Duration = Duration::from_millis(100);

/// Publishes snapshots of a simulation to all its viewers and runs their commands between steps. See
/// [`ViewerExt`](super::ViewerExt).
///
/// A paused simulation blocks inside [`Observer::on_event`], on the thread that called `update`, until a viewer resumes
/// it or the viewers that paused it are dropped.
#[derive(Debug)]
pub struct ViewController {
    hub: Arc<Hub>,
    pool: SnapshotPool,
    /// Created at the first step with viewers, from the time step of the simulation.
    clock: Option<RealTimeClock>,
    request: SnapshotRequest,
    /// Step at which the simulation pauses, or paused; `None` while running without a step limit.
    pause_at: Option<u64>,
    /// Viewers that paused the simulation. It resumes when the last of them is dropped.
    paused_by: BTreeSet<u64>,
    /// Speeds set by viewers, oldest first. The last entry applies; entries of dropped viewers are removed.
    speeds: Vec<(u64, Speed)>,
    /// Step of the next check for commands.
    next_check: u64,
    /// Time of the last snapshot.
    published_at: Option<Instant>,
    /// True if the state changed since the last published snapshot.
    dirty: bool,
    springs: BTreeMap<u64, Spring>,
    /// Bodies with a spring force in the last step.
    pulled_bodies: Vec<BodyRef>,
    button: Option<RecordButton>,
    /// Last known state of the recording.
    recording: Option<RecordingState>,
    /// Viewer that started the recording; `None` if the program started it.
    recorded_by: Option<u64>,
    refusals: Refusals,
    /// True while the caller of `update` waits for viewers, instead of this observer.
    caller_waits: bool,
    /// True if the caller has to wait before the next step.
    must_wait: bool,
}

impl ViewController {
    pub(super) fn new() -> Self {
        Self {
            hub: Arc::default(),
            pool: SnapshotPool::default(),
            clock: None,
            request: SnapshotRequest::EMPTY,
            pause_at: None,
            paused_by: BTreeSet::new(),
            speeds: Vec::new(),
            next_check: 0,
            published_at: None,
            dirty: true,
            springs: BTreeMap::new(),
            pulled_bodies: Vec::new(),
            button: None,
            recording: None,
            recorded_by: None,
            refusals: Refusals::default(),
            caller_waits: false,
            must_wait: false,
        }
    }

    /// Adds a viewer.
    pub(super) fn add_viewer(&mut self, wants: SnapshotRequest) -> Viewer {
        let viewer = self.hub.add_viewer(wants);
        self.request = self.request.union(wants);
        self.next_check = 0;
        viewer
    }

    /// Replaces the record button and stops the recording of the previous one. An equal button has no effect, and its
    /// recording continues.
    pub(super) fn set_button(&mut self, sim: &mut SimulationManager, button: RecordButton) {
        if self.button.as_ref() == Some(&button) {
            return;
        }
        if let Some(old) = self.button.replace(button) {
            self.refusals.record_refusal(CommandKind::Other, old.set_recording(sim, false).err());
        }
        (self.recording, self.recorded_by) = (None, None);
        if self.hub.viewers() > 0 {
            self.publish(sim);
        }
    }

    /// Starts or stops the recording on behalf of a viewer.
    fn record(&mut self, sim: &mut SimulationManager, viewer: u64, on: bool) -> Result<(), String> {
        let button = self.button.as_ref().ok_or("cannot record: the program has not set a record button")?;
        let was = button.state(sim).is_some_and(|state| state.on);
        if !was {
            self.recorded_by = None;
        }
        if was && !on && self.recorded_by.is_none() {
            return Err("the program started this recording; only the program can stop it".into());
        }
        button.set_recording(sim, on)?;
        if !on {
            self.recorded_by = None;
        } else if !was {
            self.recorded_by = Some(viewer);
        }
        Ok(())
    }

    /// Stops a recording whose viewer was dropped.
    fn stop_orphaned_recording(&mut self, sim: &mut SimulationManager, viewers: &[u64]) {
        if let Some(viewer) = self.recorded_by.filter(|viewer| !viewers.contains(viewer)) {
            self.dirty = true;
            let ended = self.record(sim, viewer, false);
            self.refusals.record_refusal(CommandKind::Other, ended.err());
        }
    }

    /// Publishes a snapshot of the current state.
    pub(super) fn publish(&mut self, sim: &mut SimulationManager) {
        if let Some(button) = &self.button {
            self.recording = button.state(sim).or(self.recording.take());
            if self.recording.as_ref().is_some_and(|state| !state.on) {
                // The program stopped the viewer's recording; the next one may be its own.
                self.recorded_by = None;
            }
        }
        let run = RunState {
            steps: sim.observers().steps(),
            paused: self.pause_at.is_some_and(|step| step <= sim.observers().steps()),
            speed: self.clock.as_ref().map_or(Speed::Unlimited, RealTimeClock::speed),
            measured_speed: self.clock.as_ref().and_then(RealTimeClock::measured),
            last_refusal: self.refusals.last_reason(),
            refusal_count: self.refusals.count(),
            recording: self.recording.clone(),
            timeline: None,
        };
        self.published_at = Some(Instant::now());
        // If viewers hold every snapshot, or are reading the newest one right now, the next attempt publishes.
        let taken = self.pool.capture(sim, self.hub.viewers() + 2, &self.request, run);
        self.dirty = !taken.is_some_and(|snapshot| self.hub.publish(snapshot));
    }

    /// Returns the time until the next snapshot is due.
    fn time_to_next_snapshot(&self) -> Duration {
        let period = Duration::from_secs_f64(1.0 / self.request.rate.clamp(0.1, 1000.0));
        self.published_at.map_or(Duration::ZERO, |shown| period.saturating_sub(shown.elapsed()))
    }

    /// Runs the queued commands, and ends the mouse springs, pauses, speeds and recordings of dropped viewers. Returns
    /// `false` if no viewer is left.
    fn handle_commands(&mut self, sim: &mut SimulationManager) -> bool {
        let CollectedCommands { commands, viewers, wants } = self.hub.collect();
        self.dirty |= wants != self.request;
        self.request = wants;
        for (viewer, command) in commands {
            self.dirty = true;
            let done = self.handle_command(sim, viewer, command);
            self.refusals.record_result(CommandKind::of(&command), done);
        }
        let gone: Vec<u64> = self.springs.keys().copied().filter(|viewer| !viewers.contains(viewer)).collect();
        for viewer in gone {
            self.release(sim, viewer);
        }
        self.drop_settings_of_removed(sim.observers().steps(), &viewers);
        self.stop_orphaned_recording(sim, &viewers);
        !viewers.is_empty()
    }

    /// Undoes the pause and speed of dropped viewers; settings of other viewers remain.
    fn drop_settings_of_removed(&mut self, steps: u64, viewers: &[u64]) {
        self.paused_by.retain(|viewer| viewers.contains(viewer));
        if self.paused_by.is_empty() && self.pause_at.is_some() {
            self.pause_at = None;
            self.restart_clock(steps);
            self.dirty = true;
        }
        let wishes = self.speeds.len();
        self.speeds.retain(|(viewer, _)| viewers.contains(viewer));
        if self.speeds.len() < wishes {
            self.dirty = true;
            let speed = self.speeds.last().map_or(Speed::Unlimited, |(_, speed)| *speed);
            if let Some(pace) = self.clock.as_mut().filter(|pace| pace.speed() != speed) {
                pace.set_speed(speed, steps, Instant::now());
            }
        }
    }

    fn handle_command(&mut self, sim: &mut SimulationManager, viewer: u64, command: Command) -> Result<(), String> {
        let steps = sim.observers().steps();
        match command {
            Command::Pause => {
                self.pause_at = self.pause_at.map(|step| step.min(steps)).or(Some(steps));
                self.paused_by.insert(viewer);
            }
            Command::TogglePause => {
                let next = if self.pause_at.is_some() { Command::Resume } else { Command::Pause };
                return self.handle_command(sim, viewer, next);
            }
            Command::Resume => {
                self.pause_at = None;
                self.paused_by.clear();
                self.restart_clock(steps);
            }
            Command::Step(count) => {
                let from = self.pause_at.map_or(steps, |step| step.max(steps));
                self.pause_at = Some(from.saturating_add(u64::from(count)));
                // During a pause, a step command does not make its viewer a holder of the pause.
                if self.paused_by.is_empty() {
                    self.paused_by.insert(viewer);
                }
                self.restart_clock(steps);
            }
            Command::SetSpeed(speed) if speed.is_valid() => {
                self.speeds.retain(|(other, _)| *other != viewer);
                self.speeds.push((viewer, speed));
                self.clock.iter_mut().for_each(|pace| pace.set_speed(speed, steps, Instant::now()));
            }
            Command::SetSpeed(speed) => {
                let [slow, fast] = Speed::FACTOR_RANGE;
                return Err(format!("speed {speed:?}: the factor must be {slow} to {fast}"));
            }
            Command::Reset(env) => {
                let envs = env.map(|env| [env]);
                sim.reset(envs.as_ref().map(<[EnvId; 1]>::as_slice)).map_err(|error| error.to_string())?;
            }
            Command::SetTarget { robot, joint, env, value } => {
                if !sim.entities().robot_ids().iter().any(|(_, known)| *known == robot) {
                    return Err("the robot does not belong to this simulation".into());
                }
                let envs = env.map(|env| [env]);
                let envs = envs.as_ref().map(<[EnvId; 1]>::as_slice);
                let set = sim.robot_mut(robot).set_qpos_target(&arr2(&[[value]]), Some(&[joint]), envs);
                set.map_err(|error| error.to_string())?;
            }
            Command::Drag { env, body, anchor, target } => {
                let spring = Spring { env, body, anchor, target };
                spring.apply(sim).map_err(|error| error.to_string())?;
                self.springs.insert(viewer, spring);
                self.apply_springs(sim);
            }
            Command::Release => self.release(sim, viewer),
            Command::Record(on) => self.record(sim, viewer, on)?,
            Command::Seek(_) => return Err("seeking needs a recording; a running simulation has no timeline".into()),
        }
        Ok(())
    }

    fn release(&mut self, sim: &mut SimulationManager, viewer: u64) {
        if self.springs.remove(&viewer).is_some() {
            self.apply_springs(sim);
        }
    }

    /// Applies the spring forces to the next step. Springs of several viewers on one body are added.
    fn apply_springs(&mut self, sim: &mut SimulationManager) {
        let Self { springs, refusals, pulled_bodies, .. } = self;
        let mut forces: Vec<(BodyRef, Vec<_>)> = Vec::new();
        springs.retain(|_, spring| match spring.current_force(sim) {
            Ok(force) => {
                match forces.iter_mut().find(|(held, _)| *held == spring.body_ref()) {
                    Some((_, of_body)) => of_body.extend(force),
                    None => forces.push((spring.body_ref(), force.into_iter().collect())),
                }
                true
            }
            Err(error) => {
                refusals.record_refusal(CommandKind::Spring, Some(error.to_string()));
                false
            }
        });
        for let_go in pulled_bodies.drain(..).filter(|held| !forces.iter().any(|(now, _)| now == held)) {
            spring::release(sim, let_go);
        }
        for (held, forces) in forces {
            match sim.scene_mut().set_point_forces(held.env, held.body, &forces) {
                Ok(()) => pulled_bodies.push(held),
                Err(error) => {
                    refusals.record_refusal(CommandKind::Spring, Some(error.to_string()));
                    springs.retain(|_, spring| spring.body_ref() != held);
                    spring::release(sim, held);
                }
            }
        }
    }

    fn restart_clock(&mut self, steps: u64) {
        self.clock.iter_mut().for_each(|pace| pace.restart(steps, Instant::now()));
    }

    /// Undoes all viewer settings after the last viewer was dropped.
    fn reset_viewer_settings(&mut self, sim: &mut SimulationManager) {
        self.springs.clear();
        self.apply_springs(sim);
        (self.pause_at, self.clock) = (None, None);
        self.refusals.clear();
        self.paused_by.clear();
        self.speeds.clear();
    }

    /// Handles completed steps: runs commands, publishes a snapshot, and waits while paused or ahead of schedule,
    /// unless the caller waits instead.
    fn on_steps(&mut self, sim: &mut SimulationManager) {
        let steps = sim.observers().steps();
        let dt = sim.cfg().physics_dt;
        let pace = self.clock.get_or_insert_with(|| RealTimeClock::new(dt, steps, Instant::now()));
        pace.record_steps(steps, Instant::now());
        self.dirty = true;
        loop {
            let Some(wait) = self.turn(sim, steps) else { return };
            if wait.is_zero() {
                break;
            }
            if self.caller_waits {
                self.must_wait = true;
                self.next_check = steps + 1;
                return;
            }
            self.hub.wait_for_input(wait);
        }
        self.end_wait(sim, steps);
    }

    /// Runs commands and publishes a snapshot. Returns the time until the next turn, zero if the simulation can step,
    /// or `None` after the last viewer was dropped.
    fn turn(&mut self, sim: &mut SimulationManager, steps: u64) -> Option<Duration> {
        if !self.handle_commands(sim) {
            self.reset_viewer_settings(sim);
            return None;
        }
        let holds = self.pause_at.is_some_and(|step| step <= steps);
        let ahead = self.clock.as_mut().map_or(Duration::ZERO, |pace| pace.time_ahead(steps, Instant::now()));
        let (rest, waits) = (self.time_to_next_snapshot(), holds || !ahead.is_zero());
        if self.dirty && rest.is_zero() {
            self.publish(sim);
        }
        if !waits {
            return Some(Duration::ZERO);
        }
        let until_shown = if self.dirty { rest.max(Duration::from_millis(1)) } else { MAX_WAIT };
        let until_stepped = if holds { MAX_WAIT } else { ahead };
        Some(until_shown.min(until_stepped).min(MAX_WAIT))
    }

    /// [`turn`](Self::turn) for a caller that waits: the time until the next turn, zero if the simulation can step.
    pub(super) fn turn_of_caller(&mut self, sim: &mut SimulationManager) -> Duration {
        if !self.must_wait {
            return Duration::ZERO;
        }
        let steps = sim.observers().steps();
        let wait = self.turn(sim, steps);
        self.must_wait = wait.is_some_and(|wait| !wait.is_zero());
        if wait == Some(Duration::ZERO) {
            self.end_wait(sim, steps);
        }
        wait.unwrap_or_default()
    }

    /// Chooses who waits for viewers: the caller of `update`, or this observer.
    pub(super) fn set_caller_waits(&mut self, caller_waits: bool) {
        self.caller_waits = caller_waits;
    }

    fn end_wait(&mut self, sim: &mut SimulationManager, steps: u64) {
        self.must_wait = false;
        self.clock.iter_mut().for_each(|pace| pace.end_wait(steps, Instant::now()));
        self.apply_springs(sim);
        let block = self.clock.as_ref().map_or(1, RealTimeClock::steps_until_check);
        let block = if self.springs.is_empty() { block } else { 1 };
        self.next_check = steps + block;
        self.next_check = self.pause_at.map_or(self.next_check, |step| self.next_check.min(step));
    }
}

impl Observer for ViewController {
    fn due_in(&self, sim: &SimulationManager) -> u64 {
        if self.hub.viewers() == 0 && self.clock.is_none() {
            return u64::MAX;
        }
        self.next_check.saturating_sub(sim.observers().steps()).max(1)
    }

    fn on_event(&mut self, sim: &mut SimulationManager, moment: &SimEvent) {
        match moment {
            SimEvent::Stepped => self.on_steps(sim),
            SimEvent::Compiled => {
                self.pool.invalidate_names();
                // Body indices have changed, so active drags end. The mouse creates them again.
                self.springs.clear();
                self.pulled_bodies.clear();
                if self.hub.viewers() > 0 {
                    self.publish(sim);
                }
            }
            _ => {
                self.dirty = true;
                if self.hub.viewers() > 0 && self.time_to_next_snapshot().is_zero() {
                    self.publish(sim);
                }
            }
        }
    }
}

impl Drop for ViewController {
    fn drop(&mut self) {
        self.hub.end();
    }
}
