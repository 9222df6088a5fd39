//! The simulation behind all Python objects that refer to it.
//!
//! Lock order: a thread waits for the lock of the simulation only while it does not hold the interpreter. Otherwise a
//! stepping thread that needs the interpreter and a thread that needs the simulation could wait for each other.

use crate::errors::{Class, Failure};
use kinetoscope::sim::{MjcfId, RigidObjectGroupId, RigidObjectId, RobotId, SimulationManager, TerrainId, WeldId};
use kinetoscope::tasks::Env;
use pyo3::prelude::*;
use std::hash::{DefaultHasher, Hash, Hasher as _};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError};
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
    manager: Mutex<Option<Simulated>>,
    entities: Mutex<Vec<(String, Entity)>>,
    num_envs: usize,
    process: u32,
    /// True if the simulation has threads of its own: workers, the writer of a recording, a viewer. A forked process
    /// does not have them, and cannot use it. The flag stays when the threads end.
    has_threads: AtomicBool,
}

impl Shared {
    pub(crate) fn new(manager: SimulationManager) -> Arc<Self> {
        let has_threads = AtomicBool::new(manager.cfg().num_threads() != 1);
        Arc::new(Self {
            num_envs: manager.num_envs(),
            manager: Mutex::new(Some(Simulated::Alone(Box::new(manager)))),
            entities: Mutex::new(Vec::new()),
            process: std::process::id(),
            has_threads,
        })
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
        py.detach(|| self.read_detached(act)).map_err(Into::into)
    }

    /// [`read`](Self::read) for a caller that does not hold the interpreter.
    pub(crate) fn read_detached<T>(
        &self,
        act: impl FnOnce(&SimulationManager) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let guard = self.lock()?;
        let sim = guard.as_ref().ok_or_else(destroyed)?.sim();
        guarded(|| act(sim))
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
            let state = match self.manager.try_lock() {
                Ok(guard) => match guard.as_ref() {
                    Some(simulated) => return guarded(|| act(simulated.sim())),
                    None => "destroyed",
                },
                Err(TryLockError::WouldBlock) => "in use",
                Err(TryLockError::Poisoned(_)) => "broken",
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
        py.detach(|| self.write_detached(act)).map_err(Into::into)
    }

    /// [`write`](Self::write) for a caller that does not hold the interpreter.
    pub(crate) fn write_detached<T>(
        &self,
        act: impl FnOnce(&mut SimulationManager) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let locked = || {
            let mut guard = self.lock()?;
            // The guard is dropped while the panic unwinds, which poisons the lock.
            panic_if_requested();
            act(guard.as_mut().ok_or_else(destroyed)?.sim_mut())
        };
        caught(locked)
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
        let locked = || {
            let mut guard = self.lock()?;
            match guard.take() {
                None => Err(destroyed()),
                Some(task @ Simulated::Task(..)) => {
                    *guard = Some(task);
                    Err(Failure::new(
                        Class::Argument,
                        "this simulation already has a task; end it with its method close",
                    ))
                }
                Some(Simulated::Alone(sim)) => match made(*sim) {
                    Ok(env) => {
                        let number = STARTED.fetch_add(1, Ordering::Relaxed);
                        *guard = Some(Simulated::Task(Box::new(env), number));
                        Ok(number)
                    }
                    Err((failure, sim)) => {
                        *guard = sim.map(Simulated::Alone);
                        Err(failure)
                    }
                },
            }
        };
        py.detach(|| caught(locked)).map_err(Into::into)
    }

    /// Uses the task with this number without holding the interpreter. After a panic, later calls fail.
    pub(crate) fn task<T: Send>(
        &self,
        py: Python<'_>,
        number: u64,
        act: impl FnOnce(&mut Env) -> Result<T, Failure> + Send,
    ) -> PyResult<T> {
        py.detach(|| self.task_detached(number, act)).map_err(Into::into)
    }

    /// [`task`](Self::task) for a caller that does not hold the interpreter.
    pub(crate) fn task_detached<T>(
        &self,
        number: u64,
        act: impl FnOnce(&mut Env) -> Result<T, Failure>,
    ) -> Result<T, Failure> {
        let locked = || match self.lock()?.as_mut().ok_or_else(destroyed)? {
            Simulated::Task(env, current) if *current == number => {
                // The guard is dropped while the panic unwinds, which poisons the lock.
                panic_if_requested();
                act(env)
            }
            Simulated::Task(..) | Simulated::Alone(_) => Err(Failure::new(Class::Destroyed, "the task was closed")),
        };
        caught(locked)
    }

    /// Ends the task with this number, if it has not ended; the simulation goes on alone.
    pub(crate) fn end_task(&self, py: Python<'_>, number: u64) -> PyResult<()> {
        detached(py, || {
            let mut guard = self.lock()?;
            *guard = guard.take().map(|simulated| match simulated {
                Simulated::Task(env, current) if current == number => Simulated::Alone(Box::new(env.into_sim())),
                other => other,
            });
            Ok(())
        })
    }

    /// Frees the simulation. Its Python objects raise `DestroyedError` from then on.
    pub(crate) fn destroy(&self, py: Python<'_>) -> PyResult<()> {
        detached(py, || {
            let manager = match self.lock() {
                Ok(mut guard) => guard.take(),
                Err(failure) if failure.is_broken() => {
                    self.manager.lock().unwrap_or_else(PoisonError::into_inner).take()
                }
                Err(failure) => return Err(failure),
            };
            drop(manager);
            Ok(())
        })
    }

    fn lock(&self) -> Result<MutexGuard<'_, Option<Simulated>>, Failure> {
        if std::process::id() == self.process {
            return self.manager.lock().map_err(|_| Failure::broken());
        }
        if self.has_threads.load(Ordering::Relaxed) {
            let message = format!(
                "this simulation belongs to process {}, and its threads do not exist in the forked process {}; create \
                 the simulation in the child process, start children with the method \"spawn\" or \"forkserver\", or \
                 use threads=1 without recordings and viewers",
                self.process,
                std::process::id()
            );
            return Err(Failure::new(Class::Fork, message));
        }
        self.manager.try_lock().map_err(|error| match error {
            TryLockError::Poisoned(_) => Failure::broken(),
            // Another thread of the parent held the lock at the time of the fork and does not exist here.
            TryLockError::WouldBlock => Failure::new(
                Class::Fork,
                "the process was forked while another thread used this simulation; create the simulation in the child \
                 process",
            ),
        })
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
        let manager = self.manager.get_mut().unwrap_or_else(PoisonError::into_inner).take();
        if std::process::id() != self.process && *self.has_threads.get_mut() {
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
