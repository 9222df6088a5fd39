//! State shared by the simulation's thread and its viewers.

use super::{Command, SnapshotRequest};
use crate::scene_view::Snapshot;
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Maximum number of queued commands of all viewers. [`Viewer::send`] returns `false` beyond it.
const MAX_QUEUED_COMMANDS: usize = 4096;
/// Reason for a command that could not be [sent](Viewer::send).
pub(crate) const NOT_STEPPING: &str = "the simulation accepts no commands because the program does not step it";

/// Shared command queue and newest snapshot. Locks are held only to move a pointer or a command, never to render or to
/// step.
#[derive(Debug, Default)]
pub(super) struct Hub {
    inbox: Mutex<Inbox>,
    /// Signals a new command, changed requests or a dropped viewer.
    inbox_changed: Condvar,
    newest: Mutex<Option<Arc<Snapshot>>>,
    /// Signals a newer snapshot or the end of the simulation.
    snapshot_published: Condvar,
    /// Number of viewers, readable without a lock.
    viewers: AtomicUsize,
    ended: AtomicBool,
}

#[derive(Debug, Default)]
struct Inbox {
    commands: VecDeque<(u64, Command)>,
    viewers: BTreeMap<u64, SnapshotRequest>,
    next: u64,
}

/// Commands since the last [`Hub::collect`], and the current viewers with their combined requests.
#[derive(Debug)]
pub(super) struct CollectedCommands {
    pub(super) commands: VecDeque<(u64, Command)>,
    pub(super) viewers: Vec<u64>,
    pub(super) wants: SnapshotRequest,
}

/// Locks a mutex. No code panics while holding one of these locks, so poisoning is ignored.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hub {
    pub(super) fn add_viewer(self: &Arc<Self>, wants: SnapshotRequest) -> Viewer {
        let mut inbox = lock(&self.inbox);
        let number = inbox.next;
        inbox.next += 1;
        inbox.viewers.insert(number, wants);
        self.viewers.store(inbox.viewers.len(), Ordering::Release);
        Viewer { hub: Arc::clone(self), number }
    }

    pub(super) fn viewers(&self) -> usize {
        self.viewers.load(Ordering::Acquire)
    }

    /// Takes the queued commands. Also returns the current viewers and their combined requests.
    pub(super) fn collect(&self) -> CollectedCommands {
        let mut inbox = lock(&self.inbox);
        let wants = inbox.viewers.values().fold(SnapshotRequest::EMPTY, |all, one| all.union(*one));
        let viewers = inbox.viewers.keys().copied().collect();
        CollectedCommands { commands: std::mem::take(&mut inbox.commands), viewers, wants }
    }

    /// Waits for a command, a changed request, a dropped viewer, or `timeout`.
    pub(super) fn wait_for_input(&self, timeout: Duration) {
        let inbox = lock(&self.inbox);
        if inbox.commands.is_empty() {
            // Spurious wakeups are harmless: the caller checks its conditions and waits again.
            drop(self.inbox_changed.wait_timeout(inbox, timeout));
        }
    }

    /// Publishes a snapshot. Returns `false` and drops the snapshot if a viewer is reading the current one at this
    /// moment.
    pub(super) fn publish(&self, snapshot: Arc<Snapshot>) -> bool {
        let Ok(mut newest) = self.newest.try_lock() else { return false };
        *newest = Some(snapshot);
        self.snapshot_published.notify_all();
        true
    }

    /// Marks the end of the simulation: no more snapshots will follow.
    pub(super) fn end(&self) {
        self.ended.store(true, Ordering::Release);
        // Holding the lock guarantees that no viewer is between its check and its wait.
        let _newest = lock(&self.newest);
        self.snapshot_published.notify_all();
    }
}

/// Handle of a viewer: receives snapshots and sends commands. It can move to another thread. Dropping it undoes its
/// pause, speed and spring, and stops a recording that it started, at the next step. During playback, its pause and
/// speed stay.
#[derive(Debug)]
pub struct Viewer {
    hub: Arc<Hub>,
    number: u64,
}

impl Viewer {
    /// Creates a viewer of a simulation that has already ended.
    pub(super) fn ended() -> Self {
        let hub = Arc::new(Hub::default());
        hub.end();
        hub.add_viewer(SnapshotRequest::default())
    }

    /// Returns the newest snapshot, or `None` before the first. Snapshots come from a pool: holding more than one
    /// reduces the snapshot rate.
    pub fn newest(&self) -> Option<Arc<Snapshot>> {
        lock(&self.hub.newest).clone()
    }

    /// Waits up to `timeout` for a snapshot with a number above `after` and returns it. Returns `None` after the
    /// timeout or the end of the simulation.
    pub fn wait(&self, after: u64, timeout: Duration) -> Option<Arc<Snapshot>> {
        // Longer timeouts overflow.
        let end = Instant::now() + timeout.min(Duration::from_secs(u32::MAX.into()));
        let mut newest = lock(&self.hub.newest);
        loop {
            if let Some(snapshot) = newest.as_ref().filter(|snapshot| snapshot.number > after) {
                return Some(Arc::clone(snapshot));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() || self.has_ended() {
                return None;
            }
            newest = self.hub.snapshot_published.wait_timeout(newest, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Queues a command for the simulation; it may still be refused
    /// ([`RunState::last_refusal`](crate::RunState::last_refusal)). Returns `false` if the simulation has ended, or if
    /// 4096 commands of all viewers are already queued because `update` is not called.
    pub fn send(&self, command: Command) -> bool {
        let mut inbox = lock(&self.hub.inbox);
        let last = inbox.commands.back_mut().filter(|(from, last)| *from == self.number && command.supersedes(last));
        if let Some((_, last)) = last {
            *last = command;
        } else if inbox.commands.len() < MAX_QUEUED_COMMANDS && !self.has_ended() {
            inbox.commands.push_back((self.number, command));
        } else {
            return false;
        }
        self.hub.inbox_changed.notify_all();
        !self.has_ended()
    }

    /// Replaces the rate and the snapshot contents that this viewer requests.
    pub fn set_request(&self, wants: SnapshotRequest) {
        lock(&self.hub.inbox).viewers.insert(self.number, wants);
        self.hub.inbox_changed.notify_all();
    }

    /// Adds another viewer of the same simulation.
    pub fn add_viewer(&self, wants: SnapshotRequest) -> Self {
        self.hub.add_viewer(wants)
    }

    /// True if the simulation was dropped: no more snapshots will follow.
    pub fn has_ended(&self) -> bool {
        self.hub.ended.load(Ordering::Acquire)
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let mut inbox = lock(&self.hub.inbox);
        inbox.viewers.remove(&self.number);
        self.hub.viewers.store(inbox.viewers.len(), Ordering::Release);
        self.hub.inbox_changed.notify_all();
    }
}
