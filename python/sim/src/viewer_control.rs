//! Control of a simulation as a viewer: pause, single steps, speed, targets, springs, recording.

use crate::errors::{Class, Failure};
use crate::robot::Robot;
use crate::shared::{Shared, detached};
use crate::simulation::Simulation;
use kinetoscope::scene::pattern::closest_names;
use kinetoscope::sim::{EnvId, JointIndex};
use kinetoscope::viewer::{self, Command, SnapshotRequest, Speed, ViewerExt as _};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// A viewer that is a program, made by ``SimulationManager.viewer``: it pauses, steps and paces the simulation, while another
/// thread steps it by ``update``, which handles commands after each step. Its pause and speed end with ``close``. While
/// ``Playback.play`` shows a recording, the commands are for the recording.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Viewer {
    shared: Arc<Shared>,
    /// `None` after `close`.
    inner: Mutex<Option<viewer::Viewer>>,
}

#[pymethods]
impl Simulation {
    /// Adds a viewer that pauses, steps and paces the simulation from the program.
    fn viewer(&self, py: Python<'_>) -> PyResult<Viewer> {
        let request =
            SnapshotRequest { contacts: None, markers: false, joints: false, cameras: false, ..Default::default() };
        // Another thread of the program steps the simulation that the viewer controls. A forked process does not have it.
        let inner = self.shared.write_with_threads(py, |sim| Ok(sim.viewer(request)))?;
        Ok(Viewer { shared: Arc::clone(&self.shared), inner: Mutex::new(Some(inner)) })
    }
}

/// A joint of an argument.
#[derive(Debug, FromPyObject)]
enum JointName {
    Name(String),
    Index(usize),
}

#[pymethods]
impl Viewer {
    /// Pauses the simulation: ``update`` waits until any viewer resumes it, or this one is closed.
    fn pause(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, Command::Pause)
    }

    /// Pauses a running simulation and resumes a paused one.
    fn toggle_pause(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, Command::TogglePause)
    }

    /// Resumes the simulation, whichever viewer paused it.
    fn resume(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, Command::Resume)
    }

    /// Runs this many steps inside the calls of ``update``, then pauses.
    #[pyo3(signature = (steps=1))]
    fn step(&self, py: Python<'_>, steps: u32) -> PyResult<()> {
        self.send(py, Command::Step(steps))
    }

    /// Sets the speed: simulated seconds per second, from 0.001 to 1000, or None for no limit.
    fn set_speed(&self, py: Python<'_>, speed: Option<f64>) -> PyResult<()> {
        let speed = speed.map_or(Speed::Unlimited, Speed::Factor);
        check_speed(Some(speed), "set_speed")?;
        self.send(py, Command::SetSpeed(speed))
    }

    /// Resets an environment, or all, after the next step.
    #[pyo3(signature = (env=None))]
    fn reset(&self, py: Python<'_>, env: Option<usize>) -> PyResult<()> {
        let env = env.map(|env| self.env(env)).transpose()?;
        self.send(py, Command::Reset(env))
    }

    /// Shows the frame of a recording at a time [s], while ``Playback.play`` shows it; a time outside shows its first or last
    /// frame.
    fn seek(&self, py: Python<'_>, time: f64) -> PyResult<()> {
        if !time.is_finite() {
            return Err(Failure::argument("seek", format!("{time} is not a finite time in seconds")).into());
        }
        self.send(py, Command::Seek(time))
    }

    /// Sets the position target of a joint's drive, by name or index [rad or m], in one environment or all, between two steps.
    /// It is limited to the range of the joint; joints without a drive ignore it.
    #[pyo3(signature = (robot, joint, value, env=None))]
    fn set_target(
        &self,
        py: Python<'_>,
        robot: &Bound<'_, Robot>,
        joint: JointName,
        value: f64,
        env: Option<usize>,
    ) -> PyResult<()> {
        let robot = robot.get();
        if !Arc::ptr_eq(&robot.shared, &self.shared) {
            let message = "set_target: the robot belongs to another simulation";
            return Err(Failure::new(Class::ForeignHandle, message).into());
        }
        if !value.is_finite() {
            return Err(Failure::argument("set_target", format!("{value} is not a finite position")).into());
        }
        let env = env.map(|env| self.env(env)).transpose()?;
        let joint = self.shared.read(py, |sim| {
            let view = sim.robot(robot.id);
            match joint {
                JointName::Name(name) => Ok(view.joint_id(&name)?),
                JointName::Index(index) if index < view.dof() => Ok(JointIndex(index)),
                JointName::Index(index) => {
                    let message = format!("set_target: joint {index} does not exist; there are {}", view.dof());
                    Err(Failure::new(Class::OutOfRange, message))
                }
            }
        })?;
        self.send(py, Command::SetTarget { robot: robot.id, joint, env, value })
    }

    /// Pulls a body, a name of ``SimulationManager.body_names``, by a spring to ``target`` in the environment [m], until
    /// ``release``, the next ``drag``, ``close``, or the addition of an entity. ``anchor`` is the attachment point in the frame of
    /// the body [m]. A free body follows as a critically damped oscillator.
    #[pyo3(signature = (body, target, env=0, anchor=[0.0; 3]))]
    fn drag(&self, py: Python<'_>, body: &str, target: [f64; 3], env: usize, anchor: [f64; 3]) -> PyResult<()> {
        for (name, point) in [("target", target), ("anchor", anchor)] {
            if !point.iter().all(|x| x.is_finite()) {
                return Err(Failure::argument("drag", format!("{name} {point:?} is not a finite point")).into());
            }
        }
        let env = self.env(env)?;
        let body = self.shared.read(py, |sim| {
            let names = sim.entities().body_names();
            names.iter().position(|name| name == body).ok_or_else(|| {
                let known = closest_names(body, names.iter().map(String::as_str));
                Failure::new(Class::UnknownName, format!("unknown body {body:?}; known names: {}", known.join(", ")))
            })
        })?;
        self.send(py, Command::Drag { env, body, anchor, target })
    }

    /// Ends the ``drag`` of this viewer, if any.
    fn release(&self, py: Python<'_>) -> PyResult<()> {
        self.send(py, Command::Release)
    }

    /// Starts, or with False stops, the recording of the record button: ``SimulationManager.set_record_button``. Without a
    /// button, the command is refused (``state``). A recording that this viewer started ends with ``close``.
    #[pyo3(signature = (on=true))]
    fn record(&self, py: Python<'_>, on: bool) -> PyResult<()> {
        self.send(py, Command::Record(on))
    }

    /// State of the simulation when it last published one, at most 30 times per second: a dict of ``steps`` since the
    /// simulation was created, ``paused``, ``speed`` (None for no limit), ``measured_speed`` (simulated seconds per second, or
    /// None), ``refusal``, the reason of the last refused command, or None, ``recording``, a dict of ``on`` and ``text`` (such as
    /// the name of the file) with a record button, otherwise None, and ``timeline``, a dict of ``time``, ``start`` and ``end`` [s]
    /// while ``Playback.play`` shows a recording, otherwise None. ``steps`` is then the index of the frame.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let newest = detached(py, || match self.lock()?.as_ref() {
            Some(viewer) => Ok(viewer.newest()),
            None => Err(closed()),
        })?;
        let newest = newest.ok_or_else(|| Failure::new(Class::Viewer, "the simulation has published no state yet"))?;
        let dict = PyDict::new(py);
        dict.set_item("steps", newest.run.steps)?;
        dict.set_item("paused", newest.run.paused)?;
        let speed = if let Speed::Factor(factor) = newest.run.speed { Some(factor) } else { None };
        dict.set_item("speed", speed)?;
        dict.set_item("measured_speed", newest.run.measured_speed)?;
        dict.set_item("refusal", &newest.run.last_refusal)?;
        let recording = newest.run.recording.as_ref().map(|recording| {
            let state = PyDict::new(py);
            state.set_item("on", recording.on)?;
            state.set_item("text", &recording.text)?;
            Ok::<_, PyErr>(state)
        });
        dict.set_item("recording", recording.transpose()?)?;
        let timeline = newest.run.timeline.map(|timeline| {
            let times = PyDict::new(py);
            times.set_item("time", timeline.time)?;
            times.set_item("start", timeline.start)?;
            times.set_item("end", timeline.end)?;
            Ok::<_, PyErr>(times)
        });
        dict.set_item("timeline", timeline.transpose()?)?;
        Ok(dict)
    }

    /// Ends the viewer, its pause and its speed. A second call does nothing.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        detached(py, || {
            let viewer = self.lock()?.take();
            drop(viewer);
            Ok(())
        })
    }

    fn __enter__(slf: Bound<'_, Self>) -> Bound<'_, Self> {
        slf
    }

    #[pyo3(signature = (*_exception))]
    fn __exit__(&self, py: Python<'_>, _exception: &Bound<'_, pyo3::types::PyTuple>) -> PyResult<()> {
        self.close(py)
    }

    fn __repr__(&self) -> &'static str {
        match self.lock().map(|viewer| viewer.is_some()) {
            Err(_) => "<Viewer of another process>",
            Ok(true) => "<Viewer>",
            Ok(false) => "<Viewer, closed>",
        }
    }
}

impl Viewer {
    /// The environment of this index.
    fn env(&self, env: usize) -> Result<EnvId, Failure> {
        let count = self.shared.num_envs();
        if env < count {
            return Ok(EnvId(env));
        }
        Err(Failure::new(Class::OutOfRange, format!("environment {env} does not exist; there are {count}")))
    }

    fn send(&self, py: Python<'_>, command: Command) -> PyResult<()> {
        let sent = detached(py, || match self.lock()?.as_ref() {
            Some(viewer) => Ok(viewer.send(command)),
            None => Err(closed()),
        })?;
        if sent {
            return Ok(());
        }
        let message = "the simulation has ended, or 4096 commands wait for a call of update";
        Err(Failure::new(Class::Viewer, message).into())
    }

    /// The viewer. The lock is never held during a step, or while waiting for Python's lock. Fails in a forked process,
    /// which does not have a thread that held it.
    fn lock(&self) -> Result<MutexGuard<'_, Option<viewer::Viewer>>, Failure> {
        self.shared.process().check("this viewer")?;
        Ok(self.inner.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        // The end of a viewer takes a lock that a thread of the parent process may have held.
        if !self.shared.process().is_current() {
            std::mem::forget(self.inner.get_mut().unwrap_or_else(PoisonError::into_inner).take());
        }
    }
}

/// Refuses a speed that viewers would not set.
pub(crate) fn check_speed(speed: Option<Speed>, name: &str) -> PyResult<()> {
    let [least, most] = Speed::FACTOR_RANGE;
    match speed {
        Some(Speed::Factor(speed)) if !(least..=most).contains(&speed) => {
            Err(Failure::argument(name, format!("{speed} is not from {least} to {most}")).into())
        }
        _ => Ok(()),
    }
}

fn closed() -> Failure {
    Failure::new(Class::Viewer, "the viewer is closed")
}
