//! The simulation behind all Python objects that refer to it.
//!
//! Lock order: a thread waits for the lock of the simulation only while it does not hold the interpreter. Otherwise a
//! stepping thread that needs the interpreter and a thread that needs the simulation could wait for each other. The wait
//! has short parts, between which signals are handled.

use crate::errors::{Class, Failure};
use crate::timed_lock::{Locked, Poisoned, TimedLock};
use kinetoscope::sim::{MjcfId, RigidObjectGroupId, RigidObjectId, RobotId, SimulationManager, TerrainId, WeldId};
use kinetoscope::tasks::Env;
use pyo3::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// Handle of an entity.
#[derive(Clone, Debug)]
pub(crate) enum Entity {
    Robot(RobotId),
    RigidObject(RigidObjectId),
    Group(RigidObjectGroupId),
    Terrain(TerrainId),
    Mjcf(MjcfId),
    Weld(WeldId),
    Sensor,
}

/// A simulation, alone or as the environments of a task.
#[derive(Debug)]
enum Simulated {
    Alone(Box<SimulationManager>),
    /// A task with its number.
    Task(Box<Env>, u64),
}

impl Simulated {
    fn sim(&self) -> &SimulationManager {
        match self {
            Self::Alone(sim) => sim,
            Self::Task(env, _) => env.sim(),
        }
    }

    fn sim_mut(&mut self) -> &mut SimulationManager {
        match self {
            Self::Alone(sim) => sim,
            Self::Task(env, _) => env.sim_mut(),
        }
    }
}

/// A simulation, its entities by name, and the process that created it.
pub(crate) struct Shared {
    /// `None` after `destroy`.
    manager: TimedLock<Option<Simulated>>,
    entities: Mutex<Vec<(String, Entity)>>,
    num_envs: usize,
    process: Process,
    /// True if the simulation has threads of its own: workers, the writer of a recording, a viewer. A forked process
    /// does not have them, and cannot use it. The flag stays when the threads end.
    has_threads: AtomicBool,
}

impl Shared {
    pub(crate) fn new(manager: SimulationManager) -> Arc<Self> {
        let has_threads = AtomicBool::new(manager.cfg().num_threads() != 1);
        Arc::new(Self {
            num_envs: manager.num_envs(),
            manager: TimedLock::new(Some(Simulated::Alone(Box::new(manager)))),
            entities: Mutex::new(Vec::new()),
            process: Process::current(),
            has_threads,
        })
    }

    /// Process that created the simulation.
    pub(crate) fn process(&self) -> Process {
        self.process
    }

    /// Number of environments, which never changes.
    pub(crate) fn num_envs(&self) -> usize {
        self.num_envs
    }

    /// [`write`](Self::write) for a call that may start threads.
    pub(crate) fn write_with_threads<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut SimulationManager) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        self.write(py, |sim| {
            self.has_threads.store(true, Ordering::Relaxed);
            act(sim)
        })
    }

    /// Reads the simulation without holding the interpreter. A panic leaves the simulation usable.
    pub(crate) fn read<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&SimulationManager) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        self.with_lock(py, |locked| read(&locked, act))
    }

    /// [`read`](Self::read) for a caller that does not hold the interpreter. Setting `stop` ends the wait for the lock.
    pub(crate) fn read_detached<T>(
        &self,
        stop: &AtomicBool,
        act: impl FnOnce(&SimulationManager) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        read(&*self.lock_until(stop)?, act)
    }

    /// Text of `repr`. Debuggers and notebooks ask for it at any time: it is no error that the simulation is gone, and a
    /// running call of another thread is not waited for.
    pub(crate) fn describe(
        &self,
        py: Python<'_>,
        class: &str,
        act: impl FnOnce(&SimulationManager) -> Result<String, Failure> + Send,
    ) -> PyResult<String> {
        let described = || {
            let state = match self.manager.lock_within(Duration::ZERO) {
                Ok(Some(locked)) => match locked.as_ref() {
                    Some(simulated) => return guarded(|| act(simulated.sim())),
                    None => "destroyed",
                },
                Ok(None) => "in use",
                Err(Poisoned) => "broken",
            };
            Ok(format!("<{class} of a simulation that is {state}>"))
        };
        py.detach(described).map_err(Into::into)
    }

    /// Changes the simulation without holding the interpreter. After a panic, later calls fail.
    pub(crate) fn write<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(&mut SimulationManager) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        self.with_lock(py, |locked| write(locked, act))
    }

    /// [`write`](Self::write) for a caller that does not hold the interpreter. Setting `stop` ends the wait for the lock.
    pub(crate) fn write_detached<T>(
        &self,
        stop: &AtomicBool,
        act: impl FnOnce(&mut SimulationManager) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        write(self.lock_until(stop)?, act)
    }

    /// Starts a task in the environments, and returns its number. `make` gives the simulation back if the task is
    /// invalid.
    pub(crate) fn start_task(
        &self,
        py: Python<'_>,
        make: impl FnOnce(SimulationManager) -> Result<Env, (Failure, Option<Box<SimulationManager>>)> + Send,
    ) -> PyResult<u64> {
        static STARTED: AtomicU64 = AtomicU64::new(0);
        let made = |sim| {
            panic_if_requested();
            make(sim)
        };
        let start = |mut locked: Locked<'_, Option<Simulated>>| match locked.take() {
            None => Err(destroyed()),
            Some(task @ Simulated::Task(..)) => {
                *locked = Some(task);
                Err(Failure::new(Class::Argument, "this simulation already has a task; end it with its method close"))
            }
            Some(Simulated::Alone(sim)) => match made(*sim) {
                Ok(env) => {
                    let number = STARTED.fetch_add(1, Ordering::Relaxed);
                    *locked = Some(Simulated::Task(Box::new(env), number));
                    Ok(number)
                }
                Err((failure, sim)) => {
                    *locked = sim.map(Simulated::Alone);
                    Err(failure)
                }
            },
        };
        self.with_lock(py, |locked| caught(|| start(locked)))
    }

    /// Uses the task with this number without holding the interpreter. After a panic, later calls fail.
    pub(crate) fn task<T: Send>(
        &self,
        py: Python<'_>,
        number: u64,
        act: impl FnOnce(&mut Env) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        self.with_lock(py, |locked| use_task(locked, number, act))
    }

    /// [`task`](Self::task) for a caller that does not hold the interpreter. Setting `stop` ends the wait for the lock.
    pub(crate) fn task_detached<T>(
        &self,
        stop: &AtomicBool,
        number: u64,
        act: impl FnOnce(&mut Env) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        use_task(self.lock_until(stop)?, number, act)
    }

    /// Ends the task with this number, if it has not ended; the simulation goes on alone.
    pub(crate) fn end_task(&self, py: Python<'_>, number: u64) -> PyResult<()> {
        self.with_lock(py, |mut locked| {
            guarded(|| {
                *locked = locked.take().map(|simulated| match simulated {
                    Simulated::Task(env, current) if current == number => Simulated::Alone(Box::new(env.into_sim())),
                    other => other,
                });
                Ok(())
            })
        })
    }

    /// Frees the simulation. Its Python objects raise `DestroyedError` from then on.
    pub(crate) fn destroy(&self, py: Python<'_>) -> PyResult<()> {
        let free = |manager: Option<Simulated>| {
            guarded(|| {
                drop(manager);
                Ok(())
            })
        };
        if self.manager.is_poisoned() {
            return py.detach(|| free(self.manager.lock_poisoned().take())).map_err(Into::into);
        }
        self.with_lock(py, |mut locked| {
            let manager = locked.take();
            // Other threads do not wait for the end of the simulation's own threads.
            drop(locked);
            free(manager)
        })
    }

    /// Calls `act` with the lock, without holding the interpreter. Signals are handled while another thread holds the lock.
    fn with_lock<T: Send>(
        &self,
        py: Python<'_>,
        act: impl FnOnce(Locked<'_, Option<Simulated>>) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        let mut act = Some(act);
        loop {
            let outcome = py.detach(|| {
                let locked = self.lock_within(LOCK_INTERVAL)?;
                Ok::<_, Failure>(locked.and_then(|locked| act.take().map(|act| act(locked))))
            })?;
            if let Some(outcome) = outcome {
                return Ok(outcome?);
            }
            py.check_signals()?;
        }
    }

    /// Waits for the lock until `stop` is set.
    fn lock_until(&self, stop: &AtomicBool) -> Result<Locked<'_, Option<Simulated>>, Failure> {
        while !stop.load(Ordering::Relaxed) {
            if let Some(locked) = self.lock_within(LOCK_INTERVAL)? {
                return Ok(locked);
            }
        }
        Err(Failure::new(Class::Other, "interrupted while another thread used the simulation"))
    }

    /// Waits for the lock, at most `limit`.
    fn lock_within(&self, limit: Duration) -> Result<Option<Locked<'_, Option<Simulated>>>, Failure> {
        let broken = |Poisoned| Failure::broken();
        if self.process.is_current() {
            return self.manager.lock_within(limit).map_err(broken);
        }
        if self.has_threads.load(Ordering::Relaxed) {
            let remedy = "create the simulation in the child process, start children with the method \"spawn\" or \
                          \"forkserver\", or use threads=1 without recordings and viewers";
            return Err(self.process.forked("this simulation", remedy));
        }
        let locked = self.manager.lock_within(Duration::ZERO).map_err(broken)?;
        // Another thread of the parent held the lock at the time of the fork and does not exist here.
        let held = || {
            Failure::new(
                Class::Fork,
                "the process was forked while another thread used this simulation; create the simulation in the child \
                 process",
            )
        };
        locked.map(Some).ok_or_else(held)
    }

    /// Hash of a handle of this simulation, with its numbers.
    pub(crate) fn hash(self: &Arc<Self>, handle: impl Hash) -> u64 {
        let mut hasher = DefaultHasher::new();
        (Arc::as_ptr(self), handle).hash(&mut hasher);
        hasher.finish()
    }

    /// Registers an entity under its name.
    pub(crate) fn register(&self, name: &str, entity: Entity) {
        self.entities().push((name.into(), entity));
    }

    pub(crate) fn keys(&self) -> Vec<String> {
        self.entities().iter().map(|(name, _)| name.clone()).collect()
    }

    /// Finds an entity by name; the names of all entities if there is no such entity.
    pub(crate) fn find(&self, name: &str) -> Result<Entity, Failure> {
        let entities = self.entities();
        let found = entities.iter().find(|(known, _)| known == name);
        found.map(|(_, entity)| entity.clone()).ok_or_else(|| {
            let known: Vec<String> = entities.iter().map(|(name, _)| format!("{name:?}")).collect();
            Failure::new(
                Class::UnknownName,
                match known.len() {
                    0 => format!("unknown entity {name:?}; the simulation has no entities"),
                    _ => format!("unknown entity {name:?}; known names: {}", known.join(", ")),
                },
            )
        })
    }

    /// The list of entities. The lock is never held during a call into the simulation or into Python.
    fn entities(&self) -> MutexGuard<'_, Vec<(String, Entity)>> {
        self.entities.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Declares equality of handles: handles of the same simulation with the same numbers are equal.
macro_rules! equal_handles {
    ($($Class:ident $(: $number:ident)?),*) => {
        $(#[pymethods]
        impl $Class {
            fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
                other.cast::<Self>().is_ok_and(|other| {
                    Arc::ptr_eq(&self.shared, &other.get().shared) $(&& self.$number == other.get().$number)?
                })
            }

            fn __hash__(&self) -> u64 {
                self.shared.hash(($(&self.$number,)?))
            }
        })*
    };
}
pub(crate) use equal_handles;

impl Drop for Shared {
    fn drop(&mut self) {
        // In a forked process, the threads that the manager would wait for do not exist: leave its memory to the end of
        // the process.
        let manager = self.manager.get_mut().take();
        if !self.process.is_current() && *self.has_threads.get_mut() {
            std::mem::forget(manager);
            return;
        }
        // A destructor cannot raise an exception, and a panic must not reach Python.
        let _ = catch_unwind(AssertUnwindSafe(|| drop(manager)));
    }
}

impl std::fmt::Debug for Shared {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Shared").field("process", &self.process).finish_non_exhaustive()
    }
}

/// Process that created an object.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Process(u32);

impl Process {
    pub(crate) fn current() -> Self {
        Self(std::process::id())
    }

    /// False in a forked process.
    pub(crate) fn is_current(self) -> bool {
        std::process::id() == self.0
    }

    /// Failure of a call in a forked process.
    fn forked(self, what: &str, remedy: &str) -> Failure {
        let (parent, child) = (self.0, std::process::id());
        let problem = format!("{what} belongs to process {parent}, and its threads do not exist in the forked process");
        Failure::new(Class::Fork, format!("{problem} {child}; {remedy}"))
    }

    /// Fails in a forked process, for a call of an object with threads, `what`.
    pub(crate) fn check(self, what: &str) -> Result<(), Failure> {
        if self.is_current() {
            return Ok(());
        }
        let remedy = "create it in the child process, or start children with the method \"spawn\" or \"forkserver\"";
        Err(self.forked(what, remedy))
    }
}

/// Reads a simulation. A panic leaves it usable.
fn read<T>(
    simulated: &Option<Simulated>,
    act: impl FnOnce(&SimulationManager) -> Result<T, Failure>,
) -> Result<T, Failure> {
    let sim = simulated.as_ref().ok_or_else(destroyed)?.sim();
    guarded(|| act(sim))
}

/// Changes a simulation. A panic poisons the lock.
fn write<T>(
    locked: Locked<'_, Option<Simulated>>,
    act: impl FnOnce(&mut SimulationManager) -> Result<T, Failure>,
) -> Result<T, Failure> {
    caught(move || {
        // The lock is released while the panic unwinds, which poisons it.
        let mut locked = locked;
        panic_if_requested();
        act(locked.as_mut().ok_or_else(destroyed)?.sim_mut())
    })
}

/// Uses the task with this number. A panic poisons the lock.
fn use_task<T>(
    locked: Locked<'_, Option<Simulated>>,
    number: u64,
    act: impl FnOnce(&mut Env) -> Result<T, Failure>,
) -> Result<T, Failure> {
    caught(move || {
        // The lock is released while the panic unwinds, which poisons it.
        let mut locked = locked;
        match locked.as_mut().ok_or_else(destroyed)? {
            Simulated::Task(env, current) if *current == number => {
                panic_if_requested();
                act(env)
            }
            Simulated::Task(..) | Simulated::Alone(_) => Err(Failure::new(Class::Destroyed, "the task was closed")),
        }
    })
}

/// Runs a call without holding the interpreter. A panic becomes an `InternalError`.
pub(crate) fn detached<T: Send>(py: Python<'_>, act: impl FnOnce() -> Result<T, Failure> + Send) -> PyResult<T> {
    py.detach(|| guarded(act)).map_err(Into::into)
}

/// Runs a call; a panic becomes an `InternalError`.
pub(crate) fn guarded<T>(act: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    caught(|| {
        panic_if_requested();
        act()
    })
}

/// [`guarded`] for a call that panics itself if a test requests it.
fn caught<T>(act: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(act)).unwrap_or_else(|panic| Err(Failure::panic(&*panic)))
}

/// Runs a call that may take long on another thread, and handles signals meanwhile. If a handler raises an exception, as that
/// of Ctrl+C does, `stop` is set. The exception is raised when the call has returned. Python handles signals on its main thread
/// only: a call of another thread runs on that thread.
pub(crate) fn interruptible<T: Send>(
    py: Python<'_>,
    act: impl FnOnce(&AtomicBool) -> Result<T, Failure> + Send,
) -> PyResult<T> {
    let stop = &AtomicBool::new(false);
    let threading = py.import("threading")?;
    if !threading.call_method0("current_thread")?.is(&threading.call_method0("main_thread")?) {
        return detached(py, || act(stop));
    }
    let (sender, receiver) = sync_channel(1);
    let run = move || {
        // The receiver outlives the thread.
        let _ = sender.send(guarded(|| act(stop)));
    };
    let watch = move || {
        std::thread::scope(|scope| {
            let mut raised = None;
            if let Err(error) = std::thread::Builder::new().spawn_scoped(scope, run) {
                return (Err(Failure::new(Class::Other, format!("a thread cannot be started: {error}"))), raised);
            }
            loop {
                match receiver.recv_timeout(SIGNAL_INTERVAL) {
                    Ok(outcome) => return (outcome, raised),
                    Err(RecvTimeoutError::Timeout) if raised.is_none() => {
                        raised = Python::attach(|py| py.check_signals()).err();
                        stop.store(raised.is_some(), Ordering::Relaxed);
                    }
                    Err(RecvTimeoutError::Timeout) => {}
                    Err(RecvTimeoutError::Disconnected) => {
                        return (Err(Failure::new(Class::Internal, "the thread of the call ended early")), raised);
                    }
                }
            }
        })
    };
    match py.detach(watch) {
        (_, Some(raised)) => Err(raised),
        (outcome, None) => Ok(outcome?),
    }
}

/// Longest wait before signals are handled.
pub(crate) const SIGNAL_INTERVAL: Duration = Duration::from_millis(50);

/// Longest wait for the lock of a simulation before signals are handled.
const LOCK_INTERVAL: Duration = Duration::from_millis(10);

/// True if the next guarded call panics.
static PANICS: AtomicBool = AtomicBool::new(false);

/// Makes the next guarded call panic, or ends such a request. Returns true if there was one. For tests.
pub(crate) fn request_panic(requested: bool) -> bool {
    PANICS.swap(requested, Ordering::Relaxed)
}

fn panic_if_requested() {
    // A swap would write to memory that all threads share.
    assert!(!(PANICS.load(Ordering::Relaxed) && request_panic(false)), "requested by a test");
}

fn destroyed() -> Failure {
    Failure::new(Class::Destroyed, "the simulation was destroyed")
}
