//! A lock that a thread can wait for with a time limit, so that it handles signals in between.

use std::ops::{Deref, DerefMut};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError, TryLockError};
use std::time::{Duration, Instant};

/// A [`Mutex`] with a time limit for waiting. After a panic of the thread that holds it, it stays poisoned.
#[derive(Debug)]
pub(crate) struct TimedLock<T> {
    value: Mutex<T>,
    /// Number of threads that wait. Without one, releasing the lock needs no system call.
    waiting: AtomicUsize,
    /// The condition variable needs a mutex; it guards nothing.
    turn: Mutex<()>,
    released: Condvar,
}

/// The lock is poisoned: a thread panicked while it held the lock.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Poisoned;

/// The value of a lock that this thread holds.
#[derive(Debug)]
pub(crate) struct Locked<'l, T> {
    /// Dropped before `_release`, which wakes a waiting thread.
    guard: MutexGuard<'l, T>,
    _release: Release<'l, T>,
}

/// Wakes a thread that waits for the lock when it is dropped.
#[derive(Debug)]
struct Release<'l, T>(&'l TimedLock<T>);

impl<T> TimedLock<T> {
    pub(crate) fn new(value: T) -> Self {
        Self { value: Mutex::new(value), waiting: AtomicUsize::new(0), turn: Mutex::new(()), released: Condvar::new() }
    }

    /// Waits for the lock, at most `limit`. Returns `None` while another thread holds it.
    pub(crate) fn lock_within(&self, limit: Duration) -> Result<Option<Locked<'_, T>>, Poisoned> {
        if let Some(locked) = self.try_lock()? {
            return Ok(Some(locked));
        }
        if limit.is_zero() {
            return Ok(None);
        }
        self.waiting.fetch_add(1, Ordering::SeqCst);
        let locked = self.wait(limit);
        self.waiting.fetch_sub(1, Ordering::SeqCst);
        locked
    }

    fn wait(&self, limit: Duration) -> Result<Option<Locked<'_, T>>, Poisoned> {
        let started = Instant::now();
        let mut turn = self.turn.lock().unwrap_or_else(PoisonError::into_inner);
        loop {
            if let Some(locked) = self.try_lock()? {
                return Ok(Some(locked));
            }
            let left = limit.saturating_sub(started.elapsed());
            if left.is_zero() {
                return Ok(None);
            }
            // A release between the attempt above and this wait wakes no thread; the limit bounds the delay.
            turn = self.released.wait_timeout(turn, left).unwrap_or_else(PoisonError::into_inner).0;
        }
    }

    fn try_lock(&self) -> Result<Option<Locked<'_, T>>, Poisoned> {
        match self.value.try_lock() {
            Ok(guard) => Ok(Some(Locked { guard, _release: Release(self) })),
            Err(TryLockError::WouldBlock) => Ok(None),
            Err(TryLockError::Poisoned(_)) => Err(Poisoned),
        }
    }

    pub(crate) fn is_poisoned(&self) -> bool {
        self.value.is_poisoned()
    }

    /// Waits for the lock without a limit, also if it is poisoned.
    pub(crate) fn lock_poisoned(&self) -> MutexGuard<'_, T> {
        self.value.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(crate) fn get_mut(&mut self) -> &mut T {
        self.value.get_mut().unwrap_or_else(PoisonError::into_inner)
    }
}

impl<T> Drop for Release<'_, T> {
    fn drop(&mut self) {
        // Without the mutex of the condition variable: a thread that does not exist in a forked process may hold it there.
        if self.0.waiting.load(Ordering::SeqCst) > 0 {
            self.0.released.notify_one();
        }
    }
}

impl<T> Deref for Locked<'_, T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.guard
    }
}

impl<T> DerefMut for Locked<'_, T> {
    fn deref_mut(&mut self) -> &mut T {
        &mut self.guard
    }
}
