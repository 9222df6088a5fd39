//! Playback of recordings to viewers, with pause, single frames, speed and seek.

use super::{Conductor, Kind, PATIENCE};
use crate::control::hub::Mail;
use crate::control::{Command, Speed};
use crate::stage::{Run, Timeline};
use kinetoscope_sim::SimulationManager;
use std::time::{Duration, Instant};

/// A sequence of simulation states with time stamps, such as a recording.
pub trait Film {
    /// Time stamps of the frames \[s\], in ascending order.
    fn times(&self) -> &[f64];

    /// Writes the state of one frame to the simulation.
    ///
    /// # Errors
    /// Returns the reason as a text if the frame cannot be shown.
    fn show(&mut self, sim: &mut SimulationManager, frame: usize) -> Result<(), String>;
}

/// An error of [`Play::play`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlayError {
    /// The recording has no frames.
    #[error("there is nothing to show: not a single moment was recorded")]
    Empty,
    /// The time stamps are not finite or not in ascending order.
    #[error("there is nothing to show: the times of a film must be finite and in ascending order")]
    Times,
    /// A frame cannot be shown.
    #[error("{0}")]
    Frame(String),
}

/// Playback of a recording in a simulation.
pub trait Play {
    /// Shows a recording to the viewers of this simulation (windows and browsers) instead of stepping, for as long as
    /// `go_on` returns true. `go_on` is called many times a second.
    ///
    /// Playback starts at the first frame and pauses at the last. Viewers can pause, show single frames, change the
    /// speed, and seek ([`Command::Seek`]); a reset returns to the first frame. Frames are not interpolated: the last
    /// frame at or before the current time is shown.
    ///
    /// # Errors
    /// The recording is empty, its times are invalid, or a frame cannot be shown.
    fn play(&mut self, film: &mut dyn Film, go_on: &mut dyn FnMut() -> bool) -> Result<(), PlayError>;
}

impl Play for SimulationManager {
    fn play(&mut self, film: &mut dyn Film, go_on: &mut dyn FnMut() -> bool) -> Result<(), PlayError> {
        let mut head = Playhead::new(film.times())?;
        let known = self.observers().ids::<Conductor>().first().copied();
        // The conductor is removed meanwhile, so that writes of the recording do not notify it.
        let taken = known.and_then(|id| self.observers_mut().remove(id).ok());
        let mut conductor = taken.unwrap_or_else(Conductor::new);
        let result = conductor.play(self, film, &mut head, go_on);
        self.observers_mut().add(conductor);
        result
    }
}

/// Playback position in a recording.
#[derive(Clone, Debug)]
struct Playhead {
    times: Vec<f64>,
    /// Current playback time \[s\].
    now: f64,
    frame: usize,
    plays: bool,
    speed: Speed,
    /// Wall-clock time of the last update of `now`.
    at: Instant,
}

impl Playhead {
    fn new(times: &[f64]) -> Result<Self, PlayError> {
        let first = *times.first().ok_or(PlayError::Empty)?;
        if !(times.is_sorted() && times.iter().all(|time| time.is_finite())) {
            return Err(PlayError::Times);
        }
        Ok(Self { times: times.to_vec(), now: first, frame: 0, plays: true, speed: Speed::REAL, at: Instant::now() })
    }

    fn ends(&self) -> [f64; 2] {
        [self.times[0], self.times[self.times.len() - 1]]
    }

    /// Moves to a time; the frame becomes the last one at or before it.
    fn seek(&mut self, time: f64) {
        let [start, end] = self.ends();
        self.now = time.clamp(start, end);
        self.frame = self.times.partition_point(|frame| *frame <= self.now).saturating_sub(1);
    }

    fn go_to_frame(&mut self, frame: usize) {
        self.frame = frame.min(self.times.len() - 1);
        self.now = self.times[self.frame];
    }

    /// Advances the playback time by the elapsed wall-clock time.
    fn advance(&mut self, now: Instant) {
        let passed = now.saturating_duration_since(self.at).as_secs_f64();
        self.at = now;
        if let (true, Speed::Times(factor)) = (self.plays, self.speed) {
            self.seek(self.now + passed * factor);
        }
        self.stop_at_the_end();
    }

    fn stop_at_the_end(&mut self) {
        self.plays &= self.frame + 1 < self.times.len();
    }

    /// Advances by one frame after a snapshot was published at free speed.
    fn was_shown(&mut self) {
        if self.plays && self.speed == Speed::Free {
            self.go_to_frame(self.frame + 1);
        }
    }

    /// Returns the time until the next frame.
    fn rest(&self) -> Duration {
        match (self.plays, self.speed) {
            (false, _) => PATIENCE,
            (true, Speed::Free) => Duration::ZERO,
            (true, Speed::Times(factor)) => {
                let next = self.times.get(self.frame + 1).copied().unwrap_or(self.now);
                Duration::from_secs_f64(((next - self.now) / factor).clamp(0.0, PATIENCE.as_secs_f64()))
            }
        }
    }

    fn obey(&mut self, command: Command) -> Result<(), String> {
        match command {
            Command::Pause => self.plays = false,
            Command::Resume => self.resume(),
            Command::TogglePause if self.plays => self.plays = false,
            Command::TogglePause => self.resume(),
            Command::Step(count) => {
                self.plays = false;
                self.go_to_frame(self.frame.saturating_add(count as usize));
            }
            Command::SetSpeed(speed) if speed.is_valid() => self.speed = speed,
            Command::SetSpeed(speed) => {
                let [slow, fast] = Speed::RANGE;
                return Err(format!("speed {speed:?}: the factor must be {slow} to {fast}"));
            }
            Command::Reset(_) => self.go_to_frame(0),
            Command::Seek(time) if time.is_finite() => self.seek(time),
            Command::Seek(time) => return Err(format!("{time} is no time to go to")),
            Command::Release => {}
            Command::SetTarget { .. } | Command::Drag { .. } => {
                return Err("this is a recording: nothing in it can be moved".into());
            }
            Command::Record(_) => return Err("this is a recording: its file is there already".into()),
        }
        Ok(())
    }

    /// Resumes playback; at the last frame it restarts from the first.
    fn resume(&mut self) {
        if self.frame + 1 >= self.times.len() {
            self.go_to_frame(0);
        }
        self.plays = true;
    }
}

impl Conductor {
    fn play(
        &mut self,
        sim: &mut SimulationManager,
        film: &mut dyn Film,
        head: &mut Playhead,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), PlayError> {
        let mut shown = None;
        while go_on() {
            let Mail { commands, wants, .. } = self.hub.collect();
            self.dirty |= wants != self.wants || !commands.is_empty();
            self.wants = wants;
            head.advance(Instant::now());
            for (_, command) in commands {
                self.refusals.answer(Kind::of(&command), head.obey(command));
            }
            head.stop_at_the_end();
            self.dirty |= shown != Some((head.frame, head.plays));
            let rest = self.rest();
            if self.dirty && rest.is_zero() {
                film.show(sim, head.frame).map_err(PlayError::Frame)?;
                shown = Some((head.frame, head.plays));
                self.present(sim, head);
                if !self.dirty {
                    head.was_shown();
                }
            }
            // If a viewer is just reading the newest snapshot, the next attempt comes soon.
            let wait =
                if self.dirty { self.rest().max(Duration::from_millis(2)) } else { head.rest().max(self.rest()) };
            self.hub.wait_for_news(wait.clamp(Duration::from_millis(1), PATIENCE));
        }
        Ok(())
    }

    /// Publishes a snapshot of the current frame.
    fn present(&mut self, sim: &mut SimulationManager, head: &Playhead) {
        let [start, end] = head.ends();
        let run = Run {
            steps: head.frame as u64,
            paused: !head.plays,
            speed: head.speed,
            measured_speed: None,
            refused: self.refusals.reason(),
            refusals: self.refusals.count(),
            recording: None,
            timeline: Some(Timeline { now: head.times[head.frame], start, end }),
        };
        self.shown = Some(Instant::now());
        let taken = self.pool.take(sim, self.hub.viewers() + 2, &self.wants, run);
        self.dirty = !taken.is_some_and(|snapshot| self.hub.show(snapshot));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::{Viewer, Viewing, Wants};
    use crate::sample::sample;
    use crate::stage::Snapshot;
    use ndarray::array;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// A cube that rises by a meter each second, recorded ten times a second.
    struct Rising(Vec<f64>);

    impl Film for Rising {
        fn times(&self) -> &[f64] {
            &self.0
        }

        fn show(&mut self, sim: &mut SimulationManager, frame: usize) -> Result<(), String> {
            let cube = sim.entities().rigid_object_id("cube").map_err(|error| error.to_string())?;
            let row = array![[0.0, 0.0, self.0[frame], 1.0, 0.0, 0.0, 0.0]];
            sim.rigid_object_mut(cube).write_pose(&row, None).map_err(|error| error.to_string())
        }
    }

    fn height(snapshot: &Snapshot) -> f64 {
        let cube = snapshot.names.bodies.iter().position(|name| name == "cube").unwrap();
        snapshot.envs[0].look.bodies[cube].translation.z
    }

    /// Returns the snapshot after commands, once playback rests. Returns a copy, because held snapshots block the pool.
    fn watched(viewer: &Viewer, commands: &[Command]) -> Snapshot {
        let before = viewer.newest().unwrap().number;
        commands.iter().for_each(|command| assert!(viewer.send(*command)));
        let mut newest = viewer.wait(before, Duration::from_secs(20)).unwrap();
        while let Some(newer) = viewer.wait(newest.number, Duration::from_millis(400)) {
            newest = newer;
        }
        Snapshot::clone(&newest)
    }

    fn playing(act: impl FnOnce(&Viewer) + Send) {
        /// Stops the playback in every case, including a panic.
        struct Ends<'a>(&'a AtomicBool);
        impl Drop for Ends<'_> {
            fn drop(&mut self) {
                self.0.store(true, Ordering::Release);
            }
        }
        let mut sim = sample(1).sim;
        let steps = sim.observers().steps();
        let viewer = sim.viewer(Wants { rate: 200.0, ..Wants::default() });
        // The times do not begin at 0, like a recording that was started late.
        let mut film = Rising((0..=40).map(|k| 3.0 + 0.1 * f64::from(k)).collect());
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let _ends = Ends(&over);
                act(&viewer);
            });
            sim.play(&mut film, &mut || !over.load(Ordering::Acquire)).unwrap();
        });
        assert_eq!(sim.observers().steps(), steps, "nothing was stepped");
        // The conductor is back: the simulation steps as before.
        drop(viewer);
        sim.update(1);
        assert_eq!(sim.observers().steps(), steps + 1);
    }

    #[test]
    fn seek_step_and_play() {
        playing(|viewer| {
            let seen = watched(viewer, &[Command::Pause, Command::Seek(5.05)]);
            let timeline = seen.run.timeline.unwrap();
            assert_eq!([timeline.start, timeline.end], [3.0, 7.0]);
            // The last frame at or before the requested time.
            assert!((timeline.now - 5.0).abs() < 1e-9 && (height(&seen) - 5.0).abs() < 1e-9, "{timeline:?}");
            assert!(seen.run.paused && (seen.envs[0].look.time - 5.0).abs() < 1e-9);
            let seen = watched(viewer, &[Command::Step(3)]);
            assert!((height(&seen) - 5.3).abs() < 1e-9 && seen.run.steps == 23);
            for (commands, expected) in [
                (&[Command::Seek(-1e9)][..], 3.0),
                (&[Command::Seek(1e9)], 7.0),
                (&[Command::Seek(3.0)], 3.0),
                // Ten times real time: reaches the end in less than half a second and pauses there.
                (&[Command::SetSpeed(Speed::Times(10.0)), Command::Resume], 7.0),
                // From the end, playback restarts.
                (&[Command::SetSpeed(Speed::Free), Command::TogglePause], 7.0),
                (&[Command::Reset(None)], 3.0),
            ] {
                let seen = watched(viewer, commands);
                assert!((height(&seen) - expected).abs() < 1e-9, "{commands:?}");
                assert!(seen.run.paused || matches!(commands, [Command::Reset(_)]), "{:?}", seen.run);
            }
        });
    }

    #[test]
    fn real_time() {
        playing(|viewer| {
            let begun = watched(viewer, &[Command::Pause, Command::Seek(3.0)]);
            assert!((height(&begun) - 3.0).abs() < 1e-9);
            let start = Instant::now();
            viewer.send(Command::Resume);
            std::thread::sleep(Duration::from_millis(1000));
            let seen = watched(viewer, &[Command::Pause]);
            let passed = start.elapsed().as_secs_f64();
            // A frame lasts 0.1 s; commands run within PATIENCE; `watched` waits at least 0.4 s.
            let moved = height(&seen) - 3.0;
            assert!(moved > 0.75 && moved < passed + 0.01, "{moved} m in {passed} s");
        });
    }

    #[test]
    fn refusals() {
        playing(|viewer| {
            for (command, words) in [
                (Command::Seek(f64::NAN), "no time"),
                (Command::SetSpeed(Speed::Times(0.0)), "factor"),
                (
                    Command::Drag { env: kinetoscope_sim::EnvId(0), body: 0, hold: [0.0; 3], target: [0.0; 3] },
                    "recording",
                ),
            ] {
                let refused = watched(viewer, &[Command::Pause, command]).run.refused.unwrap();
                assert!(refused.contains(words), "{refused}");
            }
        });
        assert!(matches!(Playhead::new(&[]), Err(PlayError::Empty)));
        for times in [[0.0, f64::NAN], [f64::NEG_INFINITY, 0.0], [1.0, 0.0]] {
            assert!(matches!(Playhead::new(&times), Err(PlayError::Times)), "{times:?}");
        }
        let mut sim = sample(1).sim;
        assert_eq!(sim.play(&mut Rising(Vec::new()), &mut || true), Err(PlayError::Empty));
        // Control: a running simulation has no timeline.
        let viewer = sim.viewer(Wants::default());
        viewer.send(Command::Seek(1.0));
        sim.update(1);
        assert!(viewer.newest().unwrap().run.timeline.is_none());
    }
}
