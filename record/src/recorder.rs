//! The recorder: an observer of a simulation.

mod resolve;

use crate::cfg::RecorderCfg;
use crate::clock::RecordingClock;
use crate::error::{RecordError, Result};
use crate::file::{StorageFactory, partial_path_of};
use crate::format::Format;
use crate::packet::{Event, EventKind, Packet};
use crate::scene_update::SceneTracker;
use crate::source::StreamSource;
use crate::stream::StreamSchema;
use crate::topic::Topic;
use crate::writer::{self, FormatWriter, WriteError, WriterFailure};
use kinetoscope_sim::{EnvId, Observer, ObserverId, SimEvent, SimulationManager, StepResult};
#[cfg(feature = "foxglove")]
use resolve::start_time;
use resolve::{create_writer, packed_scene, resolve};
use std::any::Any;
use std::collections::BTreeSet;
use std::fmt;
use std::io;
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, SyncSender, TryRecvError, channel, sync_channel};
use std::sync::{Arc, OnceLock};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Handle of a recorder; valid for the manager that made it.
pub type RecorderId = ObserverId<Recorder>;

/// Extension trait of [`SimulationManager`] that starts, annotates and ends recordings.
pub trait Record {
    /// Starts a recording. The first row is the current state.
    ///
    /// Observers are notified of a step in the order in which they were added. If an earlier observer resets an
    /// environment in a step, the recorder records the state after that reset for this step.
    ///
    /// # Errors
    /// A name is unknown, a number of the configuration is out of range, there is nothing to record, a file exists or
    /// cannot be written, or the format does not support a requested topic.
    fn record(&mut self, cfg: RecorderCfg) -> Result<RecorderId>;

    /// Writes a text about an environment, or about all recorded ones, into the recording, at the last step
    /// ([`Topic::Events`]). Does nothing for an environment that is not recorded.
    ///
    /// # Errors
    /// There is no such environment, the format does not support events, or the recorder was removed.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    fn note(&mut self, recorder: RecorderId, env: Option<EnvId>, text: &str) -> Result<()>;

    /// Ends a recording. The file is complete and has its name when this returns.
    ///
    /// # Errors
    /// The file could not be written, no frame was recorded (animations and datasets), a recorded stream was removed or
    /// changed its shape, a sensor failed, or the recorder was removed before. If the partial file is readable, it
    /// remains as `NAME.part`, and the error contains its path.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    fn finish_recording(&mut self, recorder: RecorderId) -> Result<RecordingSummary>;
}

impl Record for SimulationManager {
    fn record(&mut self, cfg: RecorderCfg) -> Result<RecorderId> {
        let recorder = Recorder::start(self, cfg, &StorageFactory::default())?;
        Ok(self.observers_mut().add(recorder))
    }

    #[track_caller]
    fn note(&mut self, recorder: RecorderId, env: Option<EnvId>, text: &str) -> Result<()> {
        if let Some(EnvId(env)) = env.filter(|env| env.0 >= self.num_envs()) {
            return Err(RecordError::Env { env, count: self.num_envs() });
        }
        let (steps, times) = (self.observers().steps(), self.time());
        self.observers_mut().get_mut(recorder)?.note(steps, &times, env, text)
    }

    #[track_caller]
    fn finish_recording(&mut self, recorder: RecorderId) -> Result<RecordingSummary> {
        self.observers_mut().remove(recorder)?.finish()
    }
}

/// Path, size, counts and omitted content of a recording.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct RecordingSummary {
    /// Output file or folder.
    pub path: PathBuf,
    /// Size of the output \[bytes\]; 0 until the recording is finished.
    pub bytes: u64,
    /// Number of recorded packets: steps at which something was due, and events.
    pub packets: u64,
    /// Number of times that the simulation waited for a free packet.
    pub waits: u64,
    /// Total duration of these waits.
    pub wait_time: Duration,
    /// Parts of [`Topic::Everything`], [`Topic::Sensor`] and the scene that were left out, with the reason. Examples
    /// are sensors whose types do not provide their channels, sensors outside the recorded environments, channels that
    /// the format does not support, and meshes that cannot be read.
    pub left_out: Vec<String>,
}

impl fmt::Display for RecordingSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let size = self.bytes as f64 / 1e6;
        write!(f, "{}: {} rows, {size:.1} MB; ", self.path.display(), self.packets)?;
        match self.waits {
            0 => f.write_str("the simulation never waited for it")?,
            waits => {
                write!(f, "the simulation waited for it {waits} times, {:.2} s in all", self.wait_time.as_secs_f64())?
            }
        }
        if !self.left_out.is_empty() {
            write!(f, "; left out: {}", self.left_out.join(", "))?;
        }
        Ok(())
    }
}

/// Copies due values into packets, which a writer thread writes to a file.
///
/// [`Record::record`] creates a recorder. Dropping it without [`finish`](Self::finish) aborts the recording: no file
/// gets the final name. A partial MCAP file or a partial folder (images, LeRobot datasets) remains as `NAME.part`.
pub struct Recorder {
    cfg: RecorderCfg,
    sources: Vec<StreamSource>,
    clock: RecordingClock,
    filled: Option<SyncSender<Packet>>,
    empty: Receiver<Packet>,
    /// Free packets that were received already.
    empty_packets: Vec<Packet>,
    thread: Option<JoinHandle<Result<u64, WriterFailure>>>,
    failed: Arc<AtomicBool>,
    /// Error of the writer thread.
    reason: Arc<OnceLock<String>>,
    failure: Option<RecordError>,
    summary: RecordingSummary,
    format: Format,
    /// Environments whose divergence was recorded already.
    diverged: Vec<usize>,
    /// Scenes of the environments that were written for viewers; `None` if the file has none.
    scenes: Option<SceneTracker>,
    /// Environments whose appearance may have changed since their last scene message.
    dirty_scenes: BTreeSet<usize>,
    /// True for a live stream, which drops rows instead of waiting for the writer.
    is_live: bool,
    /// True while a live stream has no clients, so that nothing is recorded.
    is_paused: bool,
    dropped_rows: u64,
}

impl fmt::Debug for Recorder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Recorder").field("cfg", &self.cfg).field("recorded", &self.summary).finish_non_exhaustive()
    }
}

/// Largest size of the packets of a pool \[bytes\]: 16 GiB. Mistakes in a configuration are far above this.
const MAX_POOL_BYTES: u64 = 1 << 34;

/// Approximate size of a packet besides its values \[bytes\].
const PACKET_OVERHEAD: u64 = 256;

/// Number of steps after which a paused live stream looks for clients.
const PAUSED_INTERVAL: u64 = 10;

impl Recorder {
    pub(crate) fn start(sim: &mut SimulationManager, cfg: RecorderCfg, disk: &StorageFactory) -> Result<Self> {
        let format = cfg.format.map_or_else(|| Format::of_path(&cfg.path), Ok)?;
        if let Some(feature) = format.missing_feature() {
            return Err(RecordError::NotBuilt { path: cfg.path, format, feature });
        }
        for (field, value, min) in [("period_steps", cfg.period_steps, 1), ("packets", cfg.packets as u64, 2)] {
            if value < min {
                return Err(RecordError::OutOfRange { field, value, min });
            }
        }
        let (sources, left_out) = resolve(sim, &cfg, format)?;
        let streams = checked_streams(&sources, &cfg)?;
        let (scene, not_in_it) = match format {
            Format::Mcap | Format::Npz if cfg.scene => packed_scene(sim),
            _ => (None, Vec::new()),
        };
        let left_out = [left_out, not_in_it].concat();
        let sink = create_writer(sim, &cfg, format, &streams, scene.as_deref(), disk)?;
        Self::start_writer(sim, cfg, format, sources, left_out, sink, false)
    }

    /// Starts a recording to the clients of a server instead of a file. `sink` makes the writer from the streams and the
    /// time at which the recording begins \[s\]. Rows are dropped while all packets wait to be written.
    #[cfg(feature = "foxglove")]
    pub(crate) fn start_live(
        sim: &mut SimulationManager,
        cfg: RecorderCfg,
        sink: impl FnOnce(&SimulationManager, &[StreamSchema], f64) -> std::io::Result<Box<dyn FormatWriter>>,
    ) -> Result<Self> {
        if cfg.period_steps == 0 {
            return Err(RecordError::OutOfRange { field: "period_steps", value: 0, min: 1 });
        }
        let (sources, left_out) = resolve(sim, &cfg, Format::Mcap)?;
        let streams = checked_streams(&sources, &cfg)?;
        let sink = sink(sim, &streams, start_time(sim)).map_err(|error| RecordError::file(&cfg.path, error))?;
        Self::start_writer(sim, cfg, Format::Mcap, sources, left_out, sink, true)
    }

    /// Starts the writer thread and records the initial states into `sink`.
    fn start_writer(
        sim: &mut SimulationManager,
        cfg: RecorderCfg,
        format: Format,
        sources: Vec<StreamSource>,
        left_out: Vec<String>,
        sink: Box<dyn FormatWriter>,
        is_live: bool,
    ) -> Result<Self> {
        let streams: Vec<StreamSchema> = sources.iter().map(|source| source.stream.clone()).collect();
        let scenes = (format == Format::Mcap && cfg.scene).then(|| SceneTracker::new(&streams, is_live));
        let (full, filled) = sync_channel(cfg.packets);
        let (empty, free) = channel();
        for _ in 0..cfg.packets {
            // The receiver is in this function, so that sending cannot fail.
            let _ = empty.send(Packet::new(&streams));
        }
        let failed = Arc::new(AtomicBool::new(false));
        let why = Arc::new(OnceLock::new());
        let (flag, reason) = (Arc::clone(&failed), Arc::clone(&why));
        let work = move || writer::run(sink, &streams, &filled, &empty, &flag, &reason);
        let thread = std::thread::Builder::new().name("recording".into()).spawn(work);
        let thread = thread.map_err(|error| {
            let message = format!("cannot start the thread of the recorder: {error}");
            RecordError::file(&cfg.path, io::Error::new(error.kind(), message))
        })?;
        let clock = RecordingClock::new(sim.cfg().physics_dt, sim.observers().steps(), &sim.time());
        let summary = RecordingSummary { path: cfg.path.clone(), left_out, ..RecordingSummary::default() };
        let mut recorder = Self {
            cfg,
            sources,
            clock,
            filled: Some(full),
            empty: free,
            empty_packets: Vec::new(),
            thread: Some(thread),
            failed,
            reason: why,
            failure: None,
            summary,
            format,
            diverged: Vec::new(),
            scenes,
            dirty_scenes: (0..sim.num_envs()).collect(),
            is_live,
            is_paused: false,
            dropped_rows: 0,
        };
        let all: Vec<usize> = (0..sim.num_envs()).collect();
        recorder.record_due(sim, None, &all, None);
        if recorder.failure.is_some() {
            recorder.stop()?;
        }
        Ok(recorder)
    }

    /// Streams that are recorded, with their names, shapes and environments.
    pub fn streams(&self) -> impl Iterator<Item = &StreamSchema> {
        self.sources.iter().map(|source| &source.stream)
    }

    /// Summary so far. [`RecordingSummary::bytes`] is 0.
    pub fn summary(&self) -> &RecordingSummary {
        &self.summary
    }

    /// Error that stopped the recording; `None` while it goes on.
    pub fn failure(&self) -> Option<String> {
        if let Some(failure) = &self.failure {
            return Some(failure.to_string());
        }
        let path = self.cfg.path.display();
        match self.reason.get() {
            Some(why) => Some(format!("{path}: {why}")),
            None => self.has_failed().then(|| format!("{path}: the writer thread has ended")),
        }
    }

    /// True if the recording has stopped because of an error; [`failure`](Self::failure) returns it.
    pub fn has_failed(&self) -> bool {
        // The writer thread ends only with the recorder, or by a panic.
        let ended = self.thread.as_ref().is_none_or(JoinHandle::is_finished);
        self.failure.is_some() || ended || self.failed.load(Ordering::Relaxed)
    }

    /// Stops and resumes a live stream. A paused stream keeps its clock, and resumes with the present state.
    #[cfg(feature = "foxglove")]
    pub(crate) fn set_paused(&mut self, paused: bool) {
        self.is_paused = paused;
    }

    /// Number of rows that a live stream has dropped.
    #[cfg(feature = "foxglove")]
    pub(crate) fn dropped_rows(&self) -> u64 {
        self.dropped_rows
    }

    /// Waits until the writer thread has written everything that was recorded so far, or an error occurs. The data may
    /// still be in a buffer of the writer. [`RecordingSummary::waits`] does not count this wait.
    pub fn wait_until_written(&mut self) {
        while self.empty_packets.len() < self.cfg.packets && !self.has_failed() {
            // The writer thread is gone if this fails.
            let Ok(packet) = self.empty.recv() else { return };
            self.empty_packets.push(packet);
        }
    }

    /// Ends the recording. When this method returns, the file is complete and has its name.
    ///
    /// # Errors
    /// Those of [`Record::finish_recording`], except for a recorder that was removed.
    pub fn finish(mut self) -> Result<RecordingSummary> {
        self.stop()
    }

    fn stop(&mut self) -> Result<RecordingSummary> {
        self.filled = None;
        if let Some(scenes) = self.scenes.take() {
            self.summary.left_out.extend(scenes.left_out());
        }
        let Some(thread) = self.thread.take() else { return Ok(self.summary.clone()) };
        let path = self.cfg.path.clone();
        let written = thread.join().unwrap_or_else(|_| {
            self.failure.get_or_insert(RecordError::Panicked { path: path.clone() });
            // A panic leaves the partial file in place.
            let part = partial_path_of(&path);
            Err(WriterFailure { error: None, partial_path: part.exists().then_some(part) })
        });
        let (failure, WriterFailure { error, partial_path }) = match (self.failure.take(), written) {
            (None, Ok(bytes)) => {
                self.summary.bytes = bytes;
                return Ok(self.summary.clone());
            }
            (Some(failure), Ok(_)) => (failure, WriterFailure { error: None, partial_path: None }),
            (Some(failure), Err(written)) => (failure, written),
            (None, Err(WriterFailure { error, partial_path })) => match error {
                None => {
                    let error = Arc::new(std::io::Error::other("the recording was aborted"));
                    return Err(RecordError::File { path, error, partial_file: partial_path });
                }
                Some(WriteError::Io(error)) => {
                    return Err(RecordError::File { path, error: Arc::new(error), partial_file: partial_path });
                }
                Some(fault) => (fault.into_record_error(&path), WriterFailure { error: None, partial_path }),
            },
        };
        let failure = match failure {
            RecordError::StreamChanged { stream, .. } => RecordError::StreamChanged { path: path.clone(), stream },
            other => other,
        };
        Err(RecordError::Aborted {
            error: Box::new(failure),
            write_error: error.map(|error| error.to_string()),
            partial_file: partial_path,
        })
    }

    /// Records the due streams, the state streams of environments `changed_envs`, and changed scenes. With the `result`
    /// of a step of a task, that result is the only stream.
    fn record_due(
        &mut self,
        sim: &mut SimulationManager,
        event: Option<Event>,
        changed_envs: &[usize],
        result: Option<&StepResult>,
    ) {
        if self.is_paused || self.has_failed() {
            return;
        }
        let Some(mut packet) = self.acquire_packet() else { return };
        let steps = sim.observers().steps();
        let times = sim.time();
        packet.step = self.clock.step(steps);
        packet.event = event;
        let now = self.clock.time(steps);
        if let Some(scenes) = &mut self.scenes {
            match scenes.updates(sim, std::mem::take(&mut self.dirty_scenes), now) {
                Ok(changed) => packet.scenes = changed,
                Err(error) => return self.abort_with_packet(packet, error),
            }
        }
        let mut used = packet.event.is_some() || !packet.scenes.is_empty();
        for (source, block) in self.sources.iter_mut().zip(&mut packet.streams) {
            if source.is_task_result() != result.is_some() {
                continue;
            }
            let due = source.next_step <= steps;
            if !due && (source.sensor.is_some() || source.is_overview() || changed_envs.is_empty()) {
                continue;
            }
            if let Err(error) = source.read(sim, &times, changed_envs, due, result, block) {
                return self.abort_with_packet(packet, error);
            }
            if let Some(every) = source.period_steps.filter(|_| due) {
                source.next_step = steps.saturating_add(every);
            }
            if source.is_overview() {
                // The overview shows several environments, so its time is that of the recording.
                block.recorded_times.push(now);
            } else {
                let (clock, envs) = (&self.clock, &source.stream.env_ids);
                let stamps = |times: &[f64], to: &mut Vec<f64>| {
                    to.extend(envs.iter().zip(times).map(|(env, time)| clock.recorded_time(*env, *time)));
                };
                stamps(&block.times, &mut block.recorded_times);
                stamps(&block.force_times, &mut block.recorded_force_times);
            }
            used |= block.has_content;
        }
        if !used {
            packet.clear();
            self.empty_packets.push(packet);
            return;
        }
        self.summary.packets += 1;
        if let Some(full) = &self.filled {
            // The channel holds all packets, so this never waits. It fails if the writer thread is gone; `stop` then
            // returns the reason.
            let _ = full.send(packet);
        }
    }

    /// Aborts the recording, and returns the packet to the pool, since `wait_until_written` waits for all packets.
    fn abort_with_packet(&mut self, mut packet: Packet, error: RecordError) {
        packet.clear();
        self.empty_packets.push(packet);
        self.fail(error);
    }

    /// Returns an empty packet, after a wait if necessary; `None` if the writer thread has ended, or for a live stream
    /// without an empty packet.
    fn acquire_packet(&mut self) -> Option<Packet> {
        if let Some(packet) = self.empty_packets.pop() {
            return Some(packet);
        }
        match self.empty.try_recv() {
            Ok(packet) => Some(packet),
            Err(TryRecvError::Disconnected) => None,
            Err(TryRecvError::Empty) if self.is_live => {
                self.dropped_rows += 1;
                self.report_drop();
                None
            }
            Err(TryRecvError::Empty) => {
                let start = Instant::now();
                let packet = self.empty.recv().ok();
                self.summary.waits += 1;
                self.summary.wait_time += start.elapsed();
                self.report_wait();
                packet
            }
        }
    }

    /// Emits an event about the first wait, the second, the fourth and so on: a slow disk makes every step wait.
    fn report_wait(&self) {
        let (waits, seconds) = (self.summary.waits, self.summary.wait_time.as_secs_f64());
        if waits.is_power_of_two() {
            tracing::warn!(
                target: "kinetoscope_record",
                path = %self.cfg.path.display(),
                waits,
                seconds,
                "the simulation waits for the recorder"
            );
        }
    }

    /// Emits an event about the first dropped row, the second, the fourth and so on.
    fn report_drop(&self) {
        let dropped_rows = self.dropped_rows;
        if dropped_rows.is_power_of_two() {
            let path = self.cfg.path.display();
            tracing::warn!(target: "kinetoscope_record", %path, dropped_rows, "a live stream drops rows: its writer is too slow");
        }
    }

    /// Handles resets and writes of environments.
    fn handle_state_change(&mut self, sim: &mut SimulationManager, kind: EventKind, env_ids: &[EnvId]) {
        let envs: Vec<usize> = env_ids.iter().map(|env| env.0).collect();
        let (steps, times) = (sim.observers().steps(), sim.time());
        self.clock.resync(&envs, &times, steps);
        self.resync_counts(sim, &envs);
        let of: Vec<usize> = envs.into_iter().filter(|env| self.is_recorded(*env)).collect();
        if of.is_empty() {
            return;
        }
        let times = of.iter().map(|env| times[*env]).collect();
        let (step, recorded_time) = (self.clock.step(steps), self.clock.time(steps));
        let text = String::new();
        self.dirty_scenes.extend(&of);
        self.record_due(sim, Some(Event { kind, env_ids: of.clone(), times, step, recorded_time, text }), &of, None);
    }

    fn is_recorded(&self, env: usize) -> bool {
        self.cfg.envs.as_ref().is_none_or(|wanted| wanted.contains(&EnvId(env)))
    }

    /// Records the environments that have diverged since the last call, if the format contains events.
    fn record_divergence(&mut self, sim: &SimulationManager) {
        if !self.format.supports_events() {
            return;
        }
        let diverged: Vec<(usize, String)> = sim
            .diverged()
            .iter()
            .map(|one| (one.env.0, one.to_string()))
            .filter(|(env, _)| self.is_recorded(*env))
            .collect();
        if !diverged.is_empty() {
            let (steps, times) = (sim.observers().steps(), sim.time());
            let known = std::mem::take(&mut self.diverged);
            for (env, why) in diverged.iter().filter(|(env, _)| !known.contains(env)) {
                self.record_event(EventKind::Diverged, vec![*env], why.clone(), steps, &times);
            }
        }
        self.diverged = diverged.into_iter().map(|(env, _)| env).collect();
    }

    /// Records a text about an environment, or about all recorded ones for `None`.
    fn note(&mut self, steps: u64, times: &[f64], env: Option<EnvId>, text: &str) -> Result<()> {
        if !self.format.supports_events() {
            let (path, topic) = (self.cfg.path.clone(), format!("{:?}", Topic::Events));
            return Err(RecordError::UnsupportedTopic { path, format: self.format, topic });
        }
        let of = |one: &usize| env.is_none_or(|env| env.0 == *one) && self.is_recorded(*one);
        let envs: Vec<usize> = (0..times.len()).filter(of).collect();
        if !envs.is_empty() {
            self.record_event(EventKind::Note, envs, text.into(), steps, times);
        }
        Ok(())
    }

    /// Records an event that changed no state.
    fn record_event(&mut self, kind: EventKind, env_ids: Vec<usize>, text: String, steps: u64, times: &[f64]) {
        if self.is_paused || self.has_failed() {
            return;
        }
        let Some(mut packet) = self.acquire_packet() else { return };
        let times = env_ids.iter().map(|env| times[*env]).collect();
        let (step, recorded_time) = (self.clock.step(steps), self.clock.time(steps));
        packet.step = step;
        packet.event = Some(Event { kind, env_ids, times, step, recorded_time, text });
        self.summary.packets += 1;
        if let Some(full) = &self.filled {
            let _ = full.send(packet);
        }
    }

    fn resync_counts(&mut self, sim: &SimulationManager, envs: &[usize]) {
        for source in &mut self.sources {
            if let Err(error) = source.resync_counts(sim, envs) {
                return self.fail(error);
            }
        }
    }

    /// Aborts the recording. The first error is reported.
    fn fail(&mut self, error: RecordError) {
        self.failure.get_or_insert(error);
        self.failed.store(true, Ordering::Relaxed);
    }

    /// Checks after a compilation of the scene that all recorded streams still exist.
    fn check_streams(&mut self, sim: &mut SimulationManager) {
        let format = self.cfg.format.map_or_else(|| Format::of_path(&self.cfg.path), Ok);
        match format.and_then(|format| resolve(sim, &self.cfg, format)) {
            Ok((now, _)) => {
                let gone = self.sources.iter().find(|was| !now.iter().any(|now| now.stream == was.stream));
                if let Some(gone) = gone {
                    let (path, stream) = (self.cfg.path.clone(), gone.stream.name.clone());
                    return self.fail(RecordError::StreamChanged { path, stream });
                }
            }
            Err(error) => return self.fail(error),
        }
        self.resync_counts(sim, &(0..sim.num_envs()).collect::<Vec<_>>());
        if self.scenes.is_some() {
            self.dirty_scenes = (0..sim.num_envs()).collect();
            // Only scene messages are due: the states were recorded after the last step.
            self.record_due(sim, None, &[], None);
        }
    }
}

/// The streams of sources. Checks that the pool of packets is not larger than the limit.
fn checked_streams(sources: &[StreamSource], cfg: &RecorderCfg) -> Result<Vec<StreamSchema>> {
    let streams: Vec<StreamSchema> = sources.iter().map(|source| source.stream.clone()).collect();
    let bytes = streams.iter().map(Packet::max_bytes).fold(PACKET_OVERHEAD, u64::saturating_add);
    if bytes.saturating_mul(cfg.packets as u64) > MAX_POOL_BYTES {
        return Err(RecordError::PoolTooLarge { packets: cfg.packets, bytes, max_bytes: MAX_POOL_BYTES });
    }
    Ok(streams)
}

impl Drop for Recorder {
    fn drop(&mut self) {
        // Only a finished recording gets its final name. Errors cannot be reported from here.
        self.failed.store(true, Ordering::Relaxed);
        let _ = self.stop();
    }
}

impl Observer for Recorder {
    fn due_in(&self, sim: &SimulationManager) -> u64 {
        if self.has_failed() {
            return u64::MAX;
        }
        let now = sim.observers().steps();
        if self.is_paused {
            // Counted from the steps of the simulation, since each call of `update` asks again.
            return PAUSED_INTERVAL - now % PAUSED_INTERVAL;
        }
        let wait = |source: &StreamSource| match (&source.sensor, source.period_steps) {
            (Some(uid), None) => sim.entities().sensor_due_in(uid).unwrap_or(u64::MAX),
            _ => source.next_step.saturating_sub(now).max(1),
        };
        // A recording of events alone checks for divergence every `period_steps` steps.
        self.sources.iter().map(wait).min().unwrap_or(self.cfg.period_steps)
    }

    fn on_event(&mut self, sim: &mut SimulationManager, moment: &SimEvent) {
        match moment {
            SimEvent::Stepped => {
                self.record_divergence(sim);
                self.record_due(sim, None, &[], None);
            }
            SimEvent::Reset { env_ids } => self.handle_state_change(sim, EventKind::Reset, env_ids),
            SimEvent::Written { env_ids } => self.handle_state_change(sim, EventKind::Written, env_ids),
            SimEvent::Compiled => self.check_streams(sim),
            _ => {}
        }
    }

    fn on_published(&mut self, sim: &mut SimulationManager, event: &dyn Any) {
        if let Some(result) = event.downcast_ref::<StepResult>()
            && self.sources.iter().any(StreamSource::is_task_result)
        {
            let all: Vec<usize> = (0..sim.num_envs()).collect();
            self.record_due(sim, None, &all, Some(result));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
pub(crate) mod tests;
