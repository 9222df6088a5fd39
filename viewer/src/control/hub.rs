//! What the simulation's thread and its viewers share.

use super::{Command, Wants};
use crate::stage::Snapshot;
use std::collections::{BTreeMap, VecDeque};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Commands that wait, at most: a viewer that sends more is told.
const WAITING: usize = 4096;
/// Why a command that was [sent](Viewer::send) is not done.
pub(crate) const TAKES_NONE: &str = "the simulation takes no commands: the program does not step it";

/// The place where they meet. Locks are held to move a pointer or a command, never to draw or to step.
#[derive(Debug, Default)]
pub(super) struct Hub {
    inbox: Mutex<Inbox>,
    /// Something came into the inbox, or a viewer went.
    news: Condvar,
    newest: Mutex<Option<Arc<Snapshot>>>,
    /// There is a newer snapshot, or no more will come.
    fresh: Condvar,
    /// Viewers there are, for those who do not want to lock.
    viewers: AtomicUsize,
    over: AtomicBool,
}

#[derive(Debug, Default)]
struct Inbox {
    commands: VecDeque<(u64, Command)>,
    viewers: BTreeMap<u64, Wants>,
    next: u64,
}

/// What came in.
#[derive(Debug)]
pub(super) struct Mail {
    pub(super) commands: VecDeque<(u64, Command)>,
    pub(super) viewers: Vec<u64>,
    pub(super) wants: Wants,
}

/// Nothing panics while it holds one of ours.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Hub {
    pub(super) fn admit(self: &Arc<Self>, wants: Wants) -> Viewer {
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

    /// Takes what came in.
    pub(super) fn collect(&self) -> Mail {
        let mut inbox = lock(&self.inbox);
        let wants = inbox.viewers.values().fold(Wants::NOTHING, |all, one| all.union(*one));
        let viewers = inbox.viewers.keys().copied().collect();
        Mail { commands: std::mem::take(&mut inbox.commands), viewers, wants }
    }

    /// Waits until something comes in, or a viewer goes, or `timeout` is over.
    pub(super) fn wait_for_news(&self, timeout: Duration) {
        let inbox = lock(&self.inbox);
        if inbox.commands.is_empty() {
            // Woken for nothing, the caller looks and comes again.
            drop(self.news.wait_timeout(inbox, timeout));
        }
    }

    /// Shows a snapshot, unless somebody is just taking the one before: then this one is left out.
    pub(super) fn show(&self, snapshot: Arc<Snapshot>) -> bool {
        let Ok(mut newest) = self.newest.try_lock() else { return false };
        *newest = Some(snapshot);
        self.fresh.notify_all();
        true
    }

    /// There will be no more snapshots.
    pub(super) fn end(&self) {
        self.over.store(true, Ordering::Release);
        // With the lock held nobody is between looking and waiting.
        let _newest = lock(&self.newest);
        self.fresh.notify_all();
    }
}

/// A viewer's end: gives snapshots, takes commands. It may be sent to another thread; dropping it ends what it did to the
/// simulation.
#[derive(Debug)]
pub struct Viewer {
    hub: Arc<Hub>,
    number: u64,
}

impl Viewer {
    /// Of a simulation that is over.
    pub(super) fn of_nothing() -> Self {
        let hub = Arc::new(Hub::default());
        hub.end();
        hub.admit(Wants::default())
    }

    /// The newest snapshot; `None` before the first. Snapshots come from a pool: hold one at a time, or fewer come.
    pub fn newest(&self) -> Option<Arc<Snapshot>> {
        lock(&self.hub.newest).clone()
    }

    /// The first snapshot with a number above `after`, waiting up to `timeout` for it.
    pub fn wait(&self, after: u64, timeout: Duration) -> Option<Arc<Snapshot>> {
        let end = Instant::now() + timeout;
        let mut newest = lock(&self.hub.newest);
        loop {
            if let Some(snapshot) = newest.as_ref().filter(|snapshot| snapshot.number > after) {
                return Some(Arc::clone(snapshot));
            }
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() || self.is_over() {
                return None;
            }
            newest = self.hub.fresh.wait_timeout(newest, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    /// Asks the simulation to do something. `false` where it cannot come to it: it is over, or thousands of commands wait
    /// because nobody calls `update`.
    pub fn send(&self, command: Command) -> bool {
        let mut inbox = lock(&self.hub.inbox);
        let last = inbox.commands.back_mut().filter(|(from, last)| *from == self.number && command.replaces(last));
        if let Some((_, last)) = last {
            *last = command;
        } else if inbox.commands.len() < WAITING && !self.is_over() {
            inbox.commands.push_back((self.number, command));
        } else {
            return false;
        }
        self.hub.news.notify_all();
        !self.is_over()
    }

    /// Changes what it wants to find in snapshots.
    pub fn set_wants(&self, wants: Wants) {
        lock(&self.hub.inbox).viewers.insert(self.number, wants);
        self.hub.news.notify_all();
    }

    /// Another viewer of the same simulation.
    pub fn another(&self, wants: Wants) -> Self {
        self.hub.admit(wants)
    }

    /// Whether the simulation was dropped: there will be no more snapshots.
    pub fn is_over(&self) -> bool {
        self.hub.over.load(Ordering::Acquire)
    }
}

impl Drop for Viewer {
    fn drop(&mut self) {
        let mut inbox = lock(&self.hub.inbox);
        inbox.viewers.remove(&self.number);
        self.hub.viewers.store(inbox.viewers.len(), Ordering::Release);
        self.hub.news.notify_all();
    }
}
