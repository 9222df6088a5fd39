//! Recordings and replay.

use crate::arguments::{envs, time_limit};
use crate::cfg;
use crate::errors::{Class, Failure};
use crate::shared::{Entity, Shared, detached, guarded, interruptible};
use crate::simulation::Simulation;
use crate::viewer::Window;
use kinetoscope::prelude::Record as _;
use kinetoscope::record::{
    self, FieldSelector, Format, FoxgloveCfg, OverviewCfg, RecorderCfg, RecorderId, Recording, StreamToFoxglove as _,
    TimeSeries,
};
use kinetoscope::sim::{EnvId, SimulationManager};
use kinetoscope::viewer::{Play as _, PlaybackSource};
use numpy::{IntoPyArray, PyArray1};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyMapping, PyString};
use std::path::PathBuf;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

/// Selection of what is recorded.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Clone, Debug)]
pub(crate) struct Topic {
    inner: record::Topic,
}

/// Declares topics with the name of an entity.
macro_rules! named_topics {
    ($($(#[$doc:meta])* $name:ident => $Variant:ident,)*) => {
        #[pymethods]
        impl Topic {
            $($(#[$doc])*
            #[staticmethod]
            fn $name(uid: String) -> Self {
                Self { inner: record::Topic::$Variant(uid) }
            })*
        }
    };
}

named_topics! {
    /// Joint positions, velocities and efforts of a robot or articulation.
    joint_states => JointStates,
    /// Position, velocity and effort targets of a robot or articulation.
    targets => Targets,
    /// Link poses of a robot or articulation.
    link_poses => LinkPoses,
    /// Pose of a rigid object.
    object_pose => ObjectPose,
    /// Positions, velocities and controls of an MJCF part.
    mjcf_state => MjcfState,
    /// Body poses of an MJCF part.
    body_poses => BodyPoses,
    /// All channels of a sensor.
    sensor => Sensor,
}

/// Declares topics without a name.
macro_rules! plain_topics {
    ($($(#[$doc:meta])* $name:ident => $Variant:ident,)*) => {
        #[pymethods]
        impl Topic {
            $($(#[$doc])*
            #[staticmethod]
            fn $name() -> Self {
                Self { inner: record::Topic::$Variant }
            })*
        }
    };
}

plain_topics! {
    /// Everything that the format supports, except engine states. The overview is included only in formats of images,
    /// and only without a camera.
    everything => Everything,
    /// Times, positions and velocities of all joints in MuJoCo's order.
    engine_states => EngineStates,
    /// Rewards and ends of episodes.
    task_results => TaskResults,
    /// Overview image of all environments.
    overview => Overview,
    /// Resets, writes, divergence and notes.
    events => Events,
}

#[pymethods]
impl Topic {
    /// One channel of a camera.
    #[staticmethod]
    fn channel(sensor: String, channel: String) -> Self {
        Self { inner: record::Topic::Channel { sensor, channel } }
    }

    /// Form of the topic in configurations: a text, or a dict with the names.
    #[getter]
    fn value<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let text = guarded(|| Ok(serde_json::to_string(&self.inner)?))?;
        py.import("json")?.call_method1("loads", (text,))
    }

    fn __repr__(&self) -> String {
        format!("Topic({:?})", self.inner)
    }
}

/// A running recording. ``finish`` completes the file; as a context manager, it is finished at the end of the block.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Recorder {
    shared: Arc<Shared>,
    id: RecorderId,
    path: PathBuf,
    /// True after `finish`.
    finished: AtomicBool,
}

/// Summary of a finished recording.
#[pyclass(frozen, get_all, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct RecordingSummary {
    /// File or folder.
    path: PathBuf,
    /// Size [bytes].
    bytes: u64,
    /// Number of rows and events.
    packets: u64,
    /// Number of times that the simulation waited for the writer.
    waits: u64,
    /// Topics and entities that were left out, each with the reason.
    left_out: Vec<String>,
    /// All of this in words.
    text: String,
}

#[pymethods]
impl RecordingSummary {
    fn __repr__(&self) -> &str {
        &self.text
    }
}

impl From<record::RecordingSummary> for RecordingSummary {
    fn from(summary: record::RecordingSummary) -> Self {
        let text = summary.to_string();
        let record::RecordingSummary { path, bytes, packets, waits, left_out, .. } = summary;
        Self { path, bytes, packets, waits, left_out, text }
    }
}

impl Recorder {
    fn finish_once(&self, py: Python<'_>) -> PyResult<RecordingSummary> {
        let summary = self.shared.write(py, |sim| {
            let finished = sim.finish_recording(self.id);
            // Also after an error: the recorder is gone.
            self.finished.store(true, Ordering::Relaxed);
            Ok(finished?)
        })?;
        Ok(summary.into())
    }
}

#[pymethods]
impl Recorder {
    /// Path of the file or folder.
    #[getter]
    fn path(&self) -> &PathBuf {
        &self.path
    }

    /// Completes the file. A second call raises ``RecordingError``.
    fn finish(&self, py: Python<'_>) -> PyResult<RecordingSummary> {
        if self.finished.load(Ordering::Relaxed) {
            let message = format!("{}: the recording is already finished", self.path.display());
            return Err(Failure::new(Class::Recording, message).into());
        }
        self.finish_once(py)
    }

    /// Error that stopped the recording, or None. ``finish`` raises it too.
    #[getter]
    fn failure(&self, py: Python<'_>) -> PyResult<Option<String>> {
        if self.finished.load(Ordering::Relaxed) {
            return Ok(None);
        }
        self.shared.read(py, |sim| Ok(sim.observers().get(self.id)?.failure()))
    }

    /// Writes a text into the recording, about one environment or all.
    #[pyo3(signature = (text, env=None))]
    fn note(&self, py: Python<'_>, text: &str, env: Option<usize>) -> PyResult<()> {
        self.shared.write(py, |sim| Ok(sim.note(self.id, env.map(EnvId), text)?))
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    #[pyo3(signature = (*exception))]
    fn __exit__(&self, py: Python<'_>, exception: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        if self.finished.load(Ordering::Relaxed) {
            return Ok(());
        }
        let finished = self.finish_once(py).map(drop);
        // An error of the recording must not hide the exception of the block.
        let block_failed = exception.iter().any(|part| !part.is_none());
        if block_failed { Ok(()) } else { finished }
    }

    fn __repr__(&self) -> String {
        format!("<Recorder {}>", self.path.display())
    }
}

#[pymethods]
impl Simulation {
    /// Begins a recording; its format follows from the extension of the path. ``path`` is a path, or a ``RecorderCfg``.
    /// Keyword arguments replace its fields, ``env_ids`` the field ``envs``, and the last two those of ``overview``.
    #[pyo3(signature = (path, topics=None, *, format=None, env_ids=None, period_steps=None, stream_periods=None,
        scene=None, task=None, use_videos=None, overwrite=None, overview=None, overview_size=None, overview_fps=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn record(
        &self,
        py: Python<'_>,
        path: &Bound<'_, PyAny>,
        topics: Option<&Bound<'_, PyAny>>,
        format: Option<&str>,
        env_ids: Option<&Bound<'_, PyAny>>,
        period_steps: Option<u64>,
        stream_periods: Option<&Bound<'_, PyAny>>,
        scene: Option<bool>,
        task: Option<String>,
        use_videos: Option<bool>,
        overwrite: Option<bool>,
        overview: Option<&Bound<'_, PyAny>>,
        overview_size: Option<[usize; 2]>,
        overview_fps: Option<f64>,
    ) -> PyResult<Recorder> {
        let base = recorder_cfg(path)?;
        let cfg = RecorderCfg {
            format: format.map(format_of).transpose()?.or(base.format),
            topics: topics.map_or(Ok(base.topics), topics_of)?,
            envs: envs(&self.shared, env_ids)?.or(base.envs),
            period_steps: period_steps.unwrap_or(base.period_steps),
            stream_periods: stream_periods.map_or(Ok(base.stream_periods), periods_of)?,
            scene: scene.unwrap_or(base.scene),
            overview: overview_cfg(base.overview, overview, overview_size, overview_fps)?,
            task: task.unwrap_or(base.task),
            use_videos: use_videos.unwrap_or(base.use_videos),
            overwrite: overwrite.unwrap_or(base.overwrite),
            path: base.path,
            packets: base.packets,
        };
        let path = cfg.path.clone();
        let id = self.shared.write_with_threads(py, |sim| Ok(sim.record(cfg)?))?;
        Ok(Recorder { shared: Arc::clone(&self.shared), id, path, finished: AtomicBool::new(false) })
    }

    /// Replays a recording (``.npz`` or ``.mcap``) in this simulation, built as the recorded one was, and compares the
    /// states bit by bit. Returns a dict: ``identical``, ``steps``, ``values``, and ``difference`` (a text, or None). Ctrl+C ends
    /// the call after the current step.
    fn verify_recording<'py>(&self, py: Python<'py>, path: PathBuf) -> PyResult<Bound<'py, PyDict>> {
        let result = interruptible(py, |stop| {
            self.shared.write_detached(stop, |sim| Ok(record::replay::verify_until(stop, sim, path)?))
        })?;
        let dict = PyDict::new(py);
        dict.set_item("identical", result.is_identical())?;
        dict.set_item("steps", result.steps)?;
        dict.set_item("values", result.values)?;
        dict.set_item("difference", result.difference.map(|difference| format!("{difference:?}")))?;
        Ok(dict)
    }
}

/// Configuration of an argument: a path, a ``RecorderCfg``, or a dict of its fields.
pub(crate) fn recorder_cfg(path: &Bound<'_, PyAny>) -> PyResult<RecorderCfg> {
    match path.extract::<PathBuf>() {
        Ok(path) => Ok(RecorderCfg::new(path)),
        Err(_) => cfg::read("RecorderCfg", Some(path)),
    }
}

/// A live stream to Foxglove. It ends when it is closed, or with the simulation.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct FoxgloveServer {
    shared: Arc<Shared>,
    inner: record::FoxgloveServer,
}

#[pymethods]
impl FoxgloveServer {
    /// Address for Foxglove's dialog "Open connection", such as ``"ws://127.0.0.1:8765"``.
    #[getter]
    fn url(&self) -> String {
        self.inner.url().to_string()
    }

    /// Number of connected clients.
    #[getter]
    fn clients(&self) -> usize {
        self.inner.clients()
    }

    /// Error that stopped the stream, or None.
    #[getter]
    fn failure(&self, py: Python<'_>) -> PyResult<Option<String>> {
        self.shared.read(py, |sim| Ok(self.inner.failure(sim)?))
    }

    /// Number of rows that were dropped because the writer thread was too slow.
    #[getter]
    fn dropped_rows(&self, py: Python<'_>) -> PyResult<u64> {
        self.shared.read(py, |sim| Ok(self.inner.dropped_rows(sim)?))
    }

    /// Disconnects all clients and stops listening.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        self.shared.write(py, |sim| Ok(self.inner.close(sim)?))
    }

    fn __repr__(&self) -> String {
        // Without the token, so that a notebook or a log does not give access.
        format!("<FoxgloveServer at {}>", self.inner.address())
    }
}

#[pymethods]
impl Simulation {
    /// Streams topics to Foxglove while the simulation steps. ``address`` is an address, ``"127.0.0.1:8765"`` by default, or
    /// a ``FoxgloveCfg``; port 0 selects a free port. An address such as ``"0.0.0.0:8765"`` lets other machines read, with
    /// the token that is part of ``url``. Keyword arguments are those of ``record``.
    #[pyo3(signature = (address=None, topics=None, *, env_ids=None, period_steps=None, stream_periods=None, overview=None,
        overview_size=None, overview_fps=None))]
    #[expect(clippy::too_many_arguments, reason = "keyword arguments of a Python method")]
    fn stream_to_foxglove(
        &self,
        py: Python<'_>,
        address: Option<&Bound<'_, PyAny>>,
        topics: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
        period_steps: Option<u64>,
        stream_periods: Option<&Bound<'_, PyAny>>,
        overview: Option<&Bound<'_, PyAny>>,
        overview_size: Option<[usize; 2]>,
        overview_fps: Option<f64>,
    ) -> PyResult<FoxgloveServer> {
        let base = match address {
            None => FoxgloveCfg::default(),
            Some(address) => match address.cast::<PyString>() {
                Ok(text) => FoxgloveCfg::at(text.to_str()?).map_err(Failure::from)?,
                Err(_) => cfg::read("FoxgloveCfg", Some(address))?,
            },
        };
        let cfg = FoxgloveCfg {
            topics: topics.map_or(Ok(base.topics), topics_of)?,
            envs: envs(&self.shared, env_ids)?.or(base.envs),
            period_steps: period_steps.unwrap_or(base.period_steps),
            stream_periods: stream_periods.map_or(Ok(base.stream_periods), periods_of)?,
            overview: overview_cfg(base.overview, overview, overview_size, overview_fps)?,
            address: base.address,
            websites: base.websites,
        };
        let inner = self.shared.write_with_threads(py, |sim| Ok(sim.stream_to_foxglove(cfg)?))?;
        Ok(FoxgloveServer { shared: Arc::clone(&self.shared), inner })
    }
}

/// Settings of an overview image: those of a configuration, replaced by the ones that are given.
fn overview_cfg(
    base: OverviewCfg,
    given: Option<&Bound<'_, PyAny>>,
    size: Option<[usize; 2]>,
    fps: Option<f64>,
) -> PyResult<OverviewCfg> {
    let cfg = given.map_or(Ok(base), |given| cfg::read("OverviewCfg", Some(given)))?;
    Ok(OverviewCfg { size: size.unwrap_or(cfg.size), fps: fps.unwrap_or(cfg.fps), ..cfg })
}

/// Topics of an argument: one, or a sequence of them.
fn topics_of(topics: &Bound<'_, PyAny>) -> PyResult<Vec<record::Topic>> {
    if topics.is_instance_of::<PyString>() || topics.is_instance_of::<Topic>() {
        return Ok(vec![topic_of(topics)?]);
    }
    let items = topics.try_iter().map_err(|_| {
        let found = topics.get_type().name().map_or_else(|_| String::new(), |name| name.to_string());
        Failure::argument("topics", format!("expected a topic or a list of topics, not {found}"))
    })?;
    items.map(|topic| topic_of(&topic?)).collect()
}

/// Periods of single streams, from a dict of steps by stream.
fn periods_of(periods: &Bound<'_, PyAny>) -> PyResult<Vec<(String, u64)>> {
    let periods = periods.cast::<PyMapping>().map_err(|_| {
        Failure::argument("stream_periods", "expected a dict of steps by stream, such as {\"camera/rgb\": 10}")
    })?;
    periods.items()?.iter().map(|item| item.extract()).collect()
}

fn topic_of(topic: &Bound<'_, PyAny>) -> PyResult<record::Topic> {
    if let Ok(topic) = topic.cast::<Topic>() {
        return Ok(topic.get().inner.clone());
    }
    let plain = [
        ("everything", record::Topic::Everything),
        ("engine_states", record::Topic::EngineStates),
        ("task_results", record::Topic::TaskResults),
        ("overview", record::Topic::Overview),
        ("events", record::Topic::Events),
    ];
    let name = topic.cast::<PyString>().ok().and_then(|name| name.to_str().ok().map(String::from));
    let found = name.as_ref().and_then(|name| plain.into_iter().find(|(known, _)| known == name));
    found.map(|(_, topic)| topic).ok_or_else(|| {
        let message = format!(
            "{topic} is not a topic; use Topic.joint_states(\"arm\") and the like, or \"everything\", \"engine_states\", \
             \"task_results\", \"overview\", \"events\""
        );
        Failure::argument("topics", message).into()
    })
}

fn format_of(name: &str) -> PyResult<Format> {
    let label = |format: Format| format!("{format:?}").to_lowercase();
    Format::all().map(|(format, _)| format).find(|format| label(*format) == name).ok_or_else(|| {
        let known: Vec<String> = Format::all().map(|(format, _)| label(format)).collect();
        Failure::new(Class::UnknownName, format!("unknown format {name:?}; known names: {}", known.join(", "))).into()
    })
}

/// Playback of a recording: ``seek`` puts the simulation ``sim`` into the state of a recorded frame.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Playback {
    shared: Arc<Shared>,
    sim: Py<Simulation>,
    /// Times of the frames [s], which do not change: reading them needs no lock, which a thread that plays holds.
    times: Vec<f64>,
    joints_without_data: Vec<String>,
    inner: Mutex<record::Playback>,
}

#[pymethods]
impl Playback {
    /// Opens a recording. Without ``sim``, the scene in the file is built; files without a scene need one.
    #[new]
    #[pyo3(signature = (path, sim=None))]
    fn new(py: Python<'_>, path: PathBuf, sim: Option<&Bound<'_, Simulation>>) -> PyResult<Self> {
        let recording = detached(py, || Ok(Recording::open(path)?))?;
        let (inner, manager) = match sim {
            Some(sim) => {
                let scene = &sim.get().shared;
                scene.read(py, |sim| Ok(record::Playback::open(&recording, Some(sim))?))?
            }
            None => detached(py, || Ok(record::Playback::open(&recording, None)?))?,
        };
        let parts = guarded(|| {
            let entities = manager.entities();
            let part = |uid: &str| Ok((uid.to_string(), entities.mjcf_id(uid)?));
            entities.mjcf_uids().into_iter().map(part).collect::<Result<Vec<_>, Failure>>()
        })?;
        let shared = Shared::new(manager);
        parts.into_iter().for_each(|(uid, id)| shared.register(&uid, Entity::Mjcf(id)));
        let sim = Py::new(py, Simulation { shared: Arc::clone(&shared) })?;
        let (times, joints_without_data) = (inner.times().to_vec(), inner.joints_without_data().to_vec());
        Ok(Self { shared, sim, times, joints_without_data, inner: Mutex::new(inner) })
    }

    /// Simulation that shows the recording: the recorded scene as MJCF parts.
    #[getter]
    fn sim(&self, py: Python<'_>) -> Py<Simulation> {
        self.sim.clone_ref(py)
    }

    /// Times of the frames [s], shape (frames,).
    #[getter]
    fn times<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.times)
    }

    /// Names of the joints that the recording has no positions of; they stay where they were.
    #[getter]
    fn joints_without_data(&self) -> Vec<String> {
        self.joints_without_data.clone()
    }

    /// Shows a frame, by its index in ``times``.
    fn seek(&self, py: Python<'_>, frame: usize) -> PyResult<()> {
        let count = self.times.len();
        if frame >= count {
            let message = format!("frame {frame} does not exist; there are {count}");
            return Err(Failure::new(Class::OutOfRange, message).into());
        }
        self.shared.write(py, |sim| Ok(self.lock().seek(sim, frame)?))
    }

    /// Index of the last frame at or before a time [s]; 0 before the first.
    fn frame_at(&self, time: f64) -> PyResult<usize> {
        if time.is_nan() {
            return Err(Failure::argument("time", "nan is not a time in seconds").into());
        }
        Ok(guarded(|| Ok(record::frame_at(&self.times, time)))?)
    }

    /// Shows the recording in the windows and browser views of ``sim``, from the first frame in real time. Viewers pause it, seek,
    /// show single frames and change the speed. Returns when ``window``, a window of ``sim``, is closed, after ``timeout``
    /// seconds, or with ``KeyboardInterrupt`` on Ctrl+C. Other calls of ``sim`` wait meanwhile.
    #[pyo3(signature = (window=None, timeout=None))]
    fn play(&self, py: Python<'_>, window: Option<&Bound<'_, Window>>, timeout: Option<f64>) -> PyResult<()> {
        let (longest, started) = (time_limit(timeout, "timeout")?, Instant::now());
        let window = window.map(|window| window.get());
        if window.is_some_and(|window| !Arc::ptr_eq(&window.shared, &self.shared)) {
            let message = "play: the window shows another simulation; give a window of the attribute sim of this playback, \
                           opened by sim.open_window()";
            return Err(Failure::new(Class::ForeignHandle, message).into());
        }
        let window = window.map(|window| &window.inner);
        interruptible(py, |stop| {
            self.shared.write_detached(stop, |sim| {
                let mut playback = self.lock();
                let mut goes_on = || {
                    let is_open = window.is_none_or(kinetoscope::viewer::Window::is_open);
                    is_open && started.elapsed() < longest && !stop.load(Ordering::Relaxed)
                };
                Ok(sim.play(&mut Frames(&mut playback), &mut goes_on)?)
            })
        })
    }

    fn __len__(&self) -> usize {
        self.times.len()
    }

    fn __repr__(&self) -> String {
        format!("<Playback of {} frames>", self.times.len())
    }
}

impl Playback {
    /// The playback. Its lock is held while a frame is shown. Only callers that hold the simulation wait for it, so no other
    /// thread plays then.
    fn lock(&self) -> MutexGuard<'_, record::Playback> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Frames of a recording, for viewers.
struct Frames<'p>(&'p mut record::Playback);

impl PlaybackSource for Frames<'_> {
    fn times(&self) -> &[f64] {
        self.0.times()
    }

    fn show(&mut self, sim: &mut SimulationManager, frame: usize) -> Result<(), String> {
        self.0.seek(sim, frame).map_err(|error| error.to_string())
    }
}

/// Times [s] and values of a number in a recording, shape (rows,) each. Of a list of fields, a list of such pairs, read in one
/// pass.
#[pyfunction]
#[pyo3(signature = (path, topic, field, env=None))]
pub(crate) fn read_series<'py>(
    py: Python<'py>,
    path: PathBuf,
    topic: &str,
    field: &Bound<'py, PyAny>,
    env: Option<usize>,
) -> PyResult<Bound<'py, PyAny>> {
    let single = field.is_instance_of::<PyString>();
    let fields: Vec<String> = if single { vec![field.extract()?] } else { field.extract()? };
    let series = detached(py, || {
        let recording = Recording::open(path)?;
        let topic = recording.topic(topic, env)?.name.clone();
        let selectors: Vec<_> = fields.iter().map(|field| FieldSelector::new(topic.clone(), field)).collect();
        Ok(recording.time_series(&selectors)?)
    })?;
    let pair = |series: TimeSeries| [series.times.into_pyarray(py), series.values.into_pyarray(py)];
    if single {
        let first = series.into_iter().next().unwrap_or_default();
        return Ok(pair(first).into_pyobject(py)?.into_any());
    }
    Ok(series.into_iter().map(pair).collect::<Vec<_>>().into_pyobject(py)?.into_any())
}

/// Makes a complete MCAP file from the partial file of a recording that was killed. ``path`` is the intended path of the
/// recording, without ``.part``; the new file is ``to``, by default ``path``. Returns the number of messages, and damage of the
/// partial file other than an incomplete end, or None.
#[pyfunction]
#[pyo3(signature = (path, to=None))]
pub(crate) fn recover(py: Python<'_>, path: PathBuf, to: Option<PathBuf>) -> PyResult<(u64, Option<String>)> {
    let recovered = detached(py, || Ok(record::recover_to(&path, to.as_ref().unwrap_or(&path))?))?;
    Ok((recovered.messages, recovered.damage))
}

/// Names of the topics of a recording, each with the names of its numbers.
#[pyfunction]
pub(crate) fn recording_topics(py: Python<'_>, path: PathBuf) -> PyResult<Vec<(String, Vec<String>)>> {
    let recording = detached(py, || Ok(Recording::open(path)?))?;
    Ok(recording.topics().iter().map(|topic| (topic.name.clone(), topic.fields.clone())).collect())
}
