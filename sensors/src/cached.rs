//! Values computed on first read.

use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};

/// A lazily updated value. The first reader after a change updates the value while other readers wait. Its memory is
/// reused.
#[derive(Debug)]
pub(crate) struct Cached<T> {
    current: OnceLock<T>,
    /// The outdated value; locked while a reader updates it. `None` while a current value exists, before the first
    /// value was made, and after an update that panicked.
    outdated: Mutex<Option<T>>,
}

impl<T> Cached<T> {
    /// Creates an empty cell; the first reader makes the value.
    pub(crate) fn empty() -> Self {
        Self { current: OnceLock::new(), outdated: Mutex::new(None) }
    }

    /// Creates a cell with an up-to-date value.
    pub(crate) fn current(value: T) -> Self {
        Self { current: OnceLock::from(value), outdated: Mutex::new(None) }
    }

    /// Creates a cell with an outdated value; the first reader updates it.
    pub(crate) fn outdated(value: T) -> Self {
        Self { current: OnceLock::new(), outdated: Mutex::new(Some(value)) }
    }

    /// Returns the value if it is up to date, else `None`.
    pub(crate) fn get(&self) -> Option<&T> {
        self.current.get()
    }

    /// Returns the value. A missing value is created by `make`; a new or outdated value is then updated by `update`.
    ///
    /// # Errors
    ///
    /// Errors of `make` and `update`. The value stays outdated, and the next reader tries again.
    pub(crate) fn get_or_update<E>(
        &self,
        make: impl FnOnce() -> Result<T, E>,
        update: impl FnOnce(&mut T) -> Result<(), E>,
    ) -> Result<&T, E> {
        if let Some(value) = self.current.get() {
            return Ok(value);
        }
        let mut outdated = self.lock();
        // Another reader may have updated the value in the meantime.
        if let Some(value) = self.current.get() {
            return Ok(value);
        }
        let mut value = match outdated.take() {
            Some(value) => value,
            None => make()?,
        };
        match update(&mut value) {
            Ok(()) => Ok(self.current.get_or_init(|| value)),
            Err(error) => {
                *outdated = Some(value);
                Err(error)
            }
        }
    }

    /// Marks the value as outdated.
    pub(crate) fn invalidate(&mut self) {
        if let Some(value) = self.current.take() {
            *self.outdated.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(value);
        }
    }

    /// Returns the value, current or outdated; `None` if there is no value.
    pub(crate) fn value_mut(&mut self) -> Option<&mut T> {
        match self.current.get_mut() {
            Some(value) => Some(value),
            None => self.outdated.get_mut().unwrap_or_else(PoisonError::into_inner).as_mut(),
        }
    }

    /// Returns true if there is no value and no reader is making one.
    pub(crate) fn is_empty(&self) -> bool {
        let outdated = match self.outdated.try_lock() {
            Ok(outdated) => outdated,
            Err(std::sync::TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            // A reader is updating the value.
            Err(std::sync::TryLockError::WouldBlock) => return false,
        };
        outdated.is_none() && self.current.get().is_none()
    }

    fn lock(&self) -> MutexGuard<'_, Option<T>> {
        self.outdated.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::{AssertUnwindSafe, catch_unwind};
    use std::sync::atomic::{AtomicUsize, Ordering};

    /// One reader runs the update and the others get its result. Errors are not stored, and the value keeps its memory.
    #[test]
    fn updates() {
        let updates = AtomicUsize::new(0);
        let update = |value: &mut Vec<u32>| {
            value[0] += 1;
            updates.fetch_add(1, Ordering::Relaxed);
            Ok::<(), &str>(())
        };
        let make = || Err("made");
        let mut cached = Cached::outdated(vec![0]);
        let memory = cached.value_mut().map(|value| value.as_ptr());
        std::thread::scope(|scope| {
            (0..3).for_each(|_| drop(scope.spawn(|| assert_eq!(cached.get_or_update(make, update), Ok(&vec![1])))));
        });
        assert_eq!(updates.load(Ordering::Relaxed), 1);
        cached.invalidate();
        assert_eq!((cached.get(), cached.is_empty()), (None, false));
        assert_eq!(cached.get_or_update(make, |_| Err("broken off")), Err("broken off"));
        assert_eq!(cached.get_or_update(make, update), Ok(&vec![2]));
        assert_eq!(cached.get().map(|value| value.as_ptr()), memory);
        cached.invalidate();
        let panics = |_: &mut Vec<u32>| -> Result<(), &str> { panic!("on purpose") };
        assert!(catch_unwind(AssertUnwindSafe(|| cached.get_or_update(make, panics).is_ok())).is_err());
        assert!(cached.is_empty());
        assert_eq!(cached.get_or_update(make, update), Err("made"));
        assert_eq!(cached.get_or_update(|| Ok(vec![7]), update), Ok(&vec![8]));
    }
}
