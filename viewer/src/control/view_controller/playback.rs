//! Playback of recordings to viewers, with pause, single frames, speed and seek.

use super::{CommandKind, MAX_WAIT, ViewController};
use crate::control::hub::CollectedCommands;
use crate::control::{Command, Speed};
use crate::scene_view::{RunState, Timeline};
use kinetoscope_sim::SimulationManager;
use std::time::{Duration, Instant};

/// A sequence of simulation states with time stamps, such as a recording.
pub trait PlaybackSource {
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
    #[error("nothing to show: the recording has no frames")]
    NoFrames,
    /// The time stamps are not finite or not in ascending order.
    #[error("nothing to show: the frame times must be finite and in ascending order")]
    InvalidTimes,
    /// A frame cannot be shown.
    #[error("{0}")]
    Frame(String),
}

/// Playback of a recording in a simulation.
pub trait Play {
    /// Shows a recording to the viewers of this simulation (windows and browsers) without stepping, until `go_on`
    /// returns false. `go_on` is called before each frame, and about ten times a second while nothing changes.
    /// Afterwards, the simulation has the state of the last shown frame.
    ///
    /// Playback starts at the first frame in real time and pauses at the last. Viewers can pause, show single frames,
    /// change the speed, and seek ([`Command::Seek`]); a reset returns to the first frame. Frames are not interpolated:
    /// the last frame at or before the current time is shown.
    ///
    /// # Errors
    /// The recording is empty, its times are invalid, or a frame cannot be shown.
    fn play(&mut self, playback: &mut dyn PlaybackSource, go_on: &mut dyn FnMut() -> bool) -> Result<(), PlayError>;
}

impl Play for SimulationManager {
    fn play(&mut self, playback: &mut dyn PlaybackSource, go_on: &mut dyn FnMut() -> bool) -> Result<(), PlayError> {
        let mut head = Playhead::new(playback.times())?;
        let known = self.observers().ids::<ViewController>().first().copied();
        // The view controller is removed meanwhile, so that writes of the recording do not notify it.
        let taken = known.and_then(|id| self.observers_mut().remove(id).ok());
        let mut controller = taken.unwrap_or_else(ViewController::new);
        let result = controller.play(self, playback, &mut head, go_on);
        self.observers_mut().add(controller);
        result
    }
}

/// Playback position in a recording.
#[derive(Clone, Debug)]
struct Playhead {
    times: Vec<f64>,
    /// Current playback time \[s\].
    time: f64,
    frame: usize,
    playing: bool,
    speed: Speed,
    /// Wall-clock time of the last update of `time`.
    updated_at: Instant,
}

impl Playhead {
    fn new(times: &[f64]) -> Result<Self, PlayError> {
        let first = *times.first().ok_or(PlayError::NoFrames)?;
        if !(times.is_sorted() && times.iter().all(|time| time.is_finite())) {
            return Err(PlayError::InvalidTimes);
        }
        Ok(Self {
            times: times.to_vec(),
            time: first,
            frame: 0,
            playing: true,
            speed: Speed::REAL_TIME,
            updated_at: Instant::now(),
        })
    }

    fn time_range(&self) -> [f64; 2] {
        [self.times[0], self.times[self.times.len() - 1]]
    }

    /// Moves to a time; the frame becomes the last one at or before it.
    fn seek(&mut self, time: f64) {
        let [start, end] = self.time_range();
        self.time = time.clamp(start, end);
        self.frame = self.times.partition_point(|frame| *frame <= self.time).saturating_sub(1);
    }

    fn seek_frame(&mut self, frame: usize) {
        self.frame = frame.min(self.times.len() - 1);
        self.time = self.times[self.frame];
    }

    /// Advances the playback time by the elapsed wall-clock time.
    fn advance(&mut self, now: Instant) {
        let passed = now.saturating_duration_since(self.updated_at).as_secs_f64();
        self.updated_at = now;
        if let (true, Speed::Factor(factor)) = (self.playing, self.speed) {
            self.seek(self.time + passed * factor);
        }
        self.stop_at_the_end();
    }

    fn stop_at_the_end(&mut self) {
        self.playing &= self.frame + 1 < self.times.len();
    }

    /// Advances by one frame after a snapshot was published, if playing at [`Speed::Unlimited`].
    fn on_frame_published(&mut self) {
        if self.playing && self.speed == Speed::Unlimited {
            self.seek_frame(self.frame + 1);
        }
    }

    /// Returns the time until the next frame, at most [`MAX_WAIT`]; that much while paused.
    fn time_to_next_frame(&self) -> Duration {
        match (self.playing, self.speed) {
            (false, _) => MAX_WAIT,
            (true, Speed::Unlimited) => Duration::ZERO,
            (true, Speed::Factor(factor)) => {
                let next = self.times.get(self.frame + 1).copied().unwrap_or(self.time);
                Duration::from_secs_f64(((next - self.time) / factor).clamp(0.0, MAX_WAIT.as_secs_f64()))
            }
        }
    }

    fn handle_command(&mut self, command: Command) -> Result<(), String> {
        match command {
            Command::Pause => self.playing = false,
            Command::Resume => self.resume(),
            Command::TogglePause if self.playing => self.playing = false,
            Command::TogglePause => self.resume(),
            Command::Step(count) => {
                self.playing = false;
                self.seek_frame(self.frame.saturating_add(count as usize));
            }
            Command::SetSpeed(speed) if speed.is_valid() => self.speed = speed,
            Command::SetSpeed(speed) => {
                let [slow, fast] = Speed::FACTOR_RANGE;
                return Err(format!("speed {speed:?}: the factor must be {slow} to {fast}"));
            }
            Command::Reset(_) => self.seek_frame(0),
            Command::Seek(time) if time.is_finite() => self.seek(time),
            Command::Seek(time) => return Err(format!("cannot seek to {time}: the time must be finite")),
            Command::Release => {}
            Command::SetTarget { .. } | Command::Drag { .. } => {
                return Err("a recording cannot be modified".into());
            }
            Command::Record(_) => return Err("a recording cannot be recorded again".into()),
        }
        Ok(())
    }

    /// Resumes playback; at the last frame it restarts from the first.
    fn resume(&mut self) {
        if self.frame + 1 >= self.times.len() {
            self.seek_frame(0);
        }
        self.playing = true;
    }
}

impl ViewController {
    fn play(
        &mut self,
        sim: &mut SimulationManager,
        playback: &mut dyn PlaybackSource,
        head: &mut Playhead,
        go_on: &mut dyn FnMut() -> bool,
    ) -> Result<(), PlayError> {
        let mut shown = None;
        while go_on() {
            let CollectedCommands { commands, wants, .. } = self.hub.collect();
            self.dirty |= wants != self.request || !commands.is_empty();
            self.request = wants;
            head.advance(Instant::now());
            for (_, command) in commands {
                self.refusals.record_result(CommandKind::of(&command), head.handle_command(command));
            }
            head.stop_at_the_end();
            self.dirty |= shown != Some((head.frame, head.playing));
            let rest = self.time_to_next_snapshot();
            if self.dirty && rest.is_zero() {
                playback.show(sim, head.frame).map_err(PlayError::Frame)?;
                shown = Some((head.frame, head.playing));
                self.publish_frame(sim, head);
                if !self.dirty {
                    head.on_frame_published();
                }
            }
            // If a viewer is just reading the newest snapshot, the next attempt comes soon.
            let wait = if self.dirty {
                self.time_to_next_snapshot().max(Duration::from_millis(2))
            } else {
                head.time_to_next_frame().max(self.time_to_next_snapshot())
            };
            self.hub.wait_for_input(wait.clamp(Duration::from_millis(1), MAX_WAIT));
        }
        Ok(())
    }

    /// Publishes a snapshot of the current frame.
    fn publish_frame(&mut self, sim: &mut SimulationManager, head: &Playhead) {
        let [start, end] = head.time_range();
        let run = RunState {
            steps: head.frame as u64,
            paused: !head.playing,
            speed: head.speed,
            measured_speed: None,
            last_refusal: self.refusals.last_reason(),
            refusal_count: self.refusals.count(),
            recording: None,
            timeline: Some(Timeline { time: head.times[head.frame], start, end }),
        };
        self.published_at = Some(Instant::now());
        let taken = self.pool.capture(sim, self.hub.viewers() + 2, &self.request, run);
        self.dirty = !taken.is_some_and(|snapshot| self.hub.publish(snapshot));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::control::{SnapshotRequest, Viewer, ViewerExt};
    use crate::sample::sample;
    use crate::scene_view::Snapshot;
    use ndarray::array;
    use std::sync::atomic::{AtomicBool, Ordering};

    /// A cube that rises by a meter each second, recorded ten times a second.
    struct Rising(Vec<f64>);

    impl PlaybackSource for Rising {
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
        snapshot.envs[0].snapshot.bodies[cube].translation.z
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
        let viewer = sim.viewer(SnapshotRequest { rate: 200.0, ..SnapshotRequest::default() });
        // The times do not begin at 0, like a recording that was started late.
        let mut playback = Rising((0..=40).map(|k| 3.0 + 0.1 * f64::from(k)).collect());
        let over = AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let _ends = Ends(&over);
                act(&viewer);
            });
            sim.play(&mut playback, &mut || !over.load(Ordering::Acquire)).unwrap();
        });
        assert_eq!(sim.observers().steps(), steps, "nothing was stepped");
        // The view controller is back: the simulation steps as before.
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
            assert!((timeline.time - 5.0).abs() < 1e-9 && (height(&seen) - 5.0).abs() < 1e-9, "{timeline:?}");
            assert!(seen.run.paused && (seen.envs[0].snapshot.time - 5.0).abs() < 1e-9);
            let seen = watched(viewer, &[Command::Step(3)]);
            assert!((height(&seen) - 5.3).abs() < 1e-9 && seen.run.steps == 23);
            for (commands, expected) in [
                (&[Command::Seek(-1e9)][..], 3.0),
                (&[Command::Seek(1e9)], 7.0),
                (&[Command::Seek(3.0)], 3.0),
                // Ten times real time: reaches the end in less than half a second and pauses there.
                (&[Command::SetSpeed(Speed::Factor(10.0)), Command::Resume], 7.0),
                // From the end, playback restarts.
                (&[Command::SetSpeed(Speed::Unlimited), Command::TogglePause], 7.0),
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
                (Command::Seek(f64::NAN), "cannot seek to NaN"),
                (Command::SetSpeed(Speed::Factor(0.0)), "factor"),
                (
                    Command::Drag { env: kinetoscope_sim::EnvId(0), body: 0, anchor: [0.0; 3], target: [0.0; 3] },
                    "recording",
                ),
            ] {
                let refused = watched(viewer, &[Command::Pause, command]).run.last_refusal.unwrap();
                assert!(refused.contains(words), "{refused}");
            }
        });
        assert!(matches!(Playhead::new(&[]), Err(PlayError::NoFrames)));
        for times in [[0.0, f64::NAN], [f64::NEG_INFINITY, 0.0], [1.0, 0.0]] {
            assert!(matches!(Playhead::new(&times), Err(PlayError::InvalidTimes)), "{times:?}");
        }
        let mut sim = sample(1).sim;
        assert_eq!(sim.play(&mut Rising(Vec::new()), &mut || true), Err(PlayError::NoFrames));
        // Control: a running simulation has no timeline.
        let viewer = sim.viewer(SnapshotRequest::default());
        viewer.send(Command::Seek(1.0));
        sim.update(1);
        assert!(viewer.newest().unwrap().run.timeline.is_none());
    }
}
