//! Observers of a running simulation, which may also change it: windows, browser views, recorders.

use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use std::any::{Any, TypeId};
use std::fmt;
use std::hash::{Hash, Hasher};
use std::marker::PhantomData;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

/// Observes a simulation between its steps and may change it: a viewer, a recorder, a pause control.
///
/// The simulation calls an observer on the stepping thread, with nothing else running, and continues when the call
/// returns. Long work belongs on a thread of the observer, with copies of the data. Adding an observer changes no
/// result: steps are split where observers are due, and `update(n)` equals n calls of `update(1)`.
pub trait Observer: Any + Send {
    /// Number of physics steps until the next [`SimEvent::Stepped`]; 0 counts as 1, and [`u64::MAX`] is never. Called
    /// before every block of steps.
    fn due_in(&self, sim: &SimulationManager) -> u64;

    /// Handles an event. Changes made here, including steps, are reported to the other observers but not to this one. A
    /// panic ends the call that caused the event, after the other observers were notified; the observer stays.
    fn on_event(&mut self, sim: &mut SimulationManager, event: &SimEvent);

    /// Handles an event that another crate publishes ([`ObserversMut::publish`](crate::ObserversMut::publish)), such as
    /// a [`StepResult`](crate::StepResult). Events of unknown types must be ignored.
    fn on_published(&mut self, sim: &mut SimulationManager, event: &dyn Any) {
        let _ = (sim, event);
    }

    /// True if events of this type are published as long as this observer is in the simulation. The observer of a task
    /// returns true for [`StepResult`](crate::StepResult). See [`Observers::is_published`].
    fn publishes(&self, event: TypeId) -> bool {
        let _ = event;
        false
    }
}

/// An event of a simulation.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SimEvent {
    /// Steps were done and the observer is due.
    Stepped,
    /// Environments were reset by [`SimulationManager::reset`].
    Reset {
        /// The environments, in ascending order.
        env_ids: Vec<EnvId>,
    },
    /// The state of environments was written since the last step: joints, poses, welds, randomized properties, a
    /// restored snapshot. Targets, controls and wrenches are not part of the state. Reported once, directly before the
    /// next step or before an observer is added or removed.
    Written {
        /// The environments, in ascending order.
        env_ids: Vec<EnvId>,
    },
    /// The model was compiled again, because an entity or a collision exclusion was added. The model and its arrays are
    /// new.
    Compiled,
}

/// Handle of an observer, valid for the manager that created it.
pub struct ObserverId<O> {
    manager: u64,
    number: u64,
    observer: PhantomData<fn() -> O>,
}

impl<O> Clone for ObserverId<O> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<O> Copy for ObserverId<O> {}

impl<O> PartialEq for ObserverId<O> {
    fn eq(&self, other: &Self) -> bool {
        (self.manager, self.number) == (other.manager, other.number)
    }
}

impl<O> Eq for ObserverId<O> {}

impl<O> Hash for ObserverId<O> {
    fn hash<H: Hasher>(&self, state: &mut H) {
        (self.manager, self.number).hash(state);
    }
}

impl<O> fmt::Debug for ObserverId<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ObserverId({})", self.number)
    }
}

/// The observers of a simulation.
#[derive(Default)]
pub(crate) struct ObserverList {
    slots: Vec<ObserverSlot>,
    next_number: u64,
    /// Number of physics steps since the simulation was created.
    pub(crate) steps: u64,
}

struct ObserverSlot {
    number: u64,
    /// `None` while the observer handles an event.
    observer: Option<Box<dyn Observer>>,
}

impl fmt::Debug for ObserverList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.slots.iter().map(|slot| slot.number)).finish()
    }
}

impl SimulationManager {
    /// Observers of the simulation, for reading.
    pub fn observers(&self) -> Observers<'_> {
        Observers::new(self)
    }

    /// Observers of the simulation, for adding, changing and removing.
    pub fn observers_mut(&mut self) -> ObserversMut<'_> {
        ObserversMut::new(self)
    }
}

/// Observers of a simulation; see [`SimulationManager::observers`].
#[derive(Clone, Copy, Debug)]
pub struct Observers<'a> {
    sim: &'a SimulationManager,
}

impl<'a> Observers<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// Returns an observer for reading.
    ///
    /// # Errors
    /// The observer was removed, or is handling an event right now.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn get<O: Observer>(&self, id: ObserverId<O>) -> Result<&'a O> {
        let slot = &self.sim.observers.slots[self.sim.slot_index(id)?];
        let any: Option<&dyn Any> = slot.observer.as_deref().map(|observer| observer as &dyn Any);
        any.and_then(|any| any.downcast_ref()).ok_or(Error::ObserverUnavailable)
    }

    /// Handles of all observers of type `O` in insertion order, without one that is handling an event right now.
    pub fn ids<O: Observer>(&self) -> Vec<ObserverId<O>> {
        let is = |slot: &&ObserverSlot| {
            let any: Option<&dyn Any> = slot.observer.as_deref().map(|observer| observer as &dyn Any);
            any.is_some_and(|any| any.is::<O>())
        };
        let id =
            |slot: &ObserverSlot| ObserverId { manager: self.sim.serial, number: slot.number, observer: PhantomData };
        self.sim.observers.slots.iter().filter(is).map(id).collect()
    }

    /// True if the observer belongs to this simulation, was not removed, and is not handling an event right now.
    pub fn contains<O: Observer>(&self, id: ObserverId<O>) -> bool {
        id.manager == self.sim.serial && self.sim.slot_index(id).is_ok()
    }

    /// True if an observer announces events of type `E` ([`Observer::publishes`]). An observer that is handling an
    /// event right now is not asked. Recorders check this when they start.
    pub fn is_published<E: Any>(&self) -> bool {
        let mut observers = self.sim.observers.slots.iter().filter_map(|slot| slot.observer.as_ref());
        observers.any(|observer| observer.publishes(TypeId::of::<E>()))
    }

    /// Number of physics steps done by [`update`](SimulationManager::update) since the simulation was created. Resets
    /// and restored snapshots do not change it, so observers can schedule by it.
    pub fn steps(&self) -> u64 {
        self.sim.observers.steps
    }
}

/// Observers of a simulation, for adding, changing and removing; see [`SimulationManager::observers_mut`].
#[derive(Debug)]
pub struct ObserversMut<'a> {
    sim: &'a mut SimulationManager,
}

impl<'a> ObserversMut<'a> {
    pub(crate) fn new(sim: &'a mut SimulationManager) -> Self {
        Self { sim }
    }

    /// Publishes an event of any type to all observers ([`Observer::on_published`]), except one that is handling an
    /// event right now. The simulation does not store it.
    pub fn publish<E: Any>(self, event: &E) {
        self.sim.notify_each_with(|observer, sim| observer.on_published(sim, event));
    }

    /// Adds an observer, which receives events from now on. Earlier writes are reported to the existing observers only.
    pub fn add<O: Observer>(&mut self, observer: O) -> ObserverId<O> {
        // Earlier writes are reported to the existing observers only.
        self.sim.notify_written();
        let number = self.sim.observers.next_number;
        self.sim.observers.next_number += 1;
        self.sim.observers.slots.push(ObserverSlot { number, observer: Some(Box::new(observer)) });
        ObserverId { manager: self.sim.serial, number, observer: PhantomData }
    }

    /// Removes an observer and returns it. Earlier writes are reported to all observers first, also to this one.
    ///
    /// # Errors
    /// The observer was removed before, or is handling an event right now.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn remove<O: Observer>(&mut self, id: ObserverId<O>) -> Result<O> {
        self.sim.slot_index(id)?;
        self.sim.notify_written();
        let index = self.sim.slot_index(id)?;
        let slot = self.sim.observers.slots.remove(index);
        let any: Option<Box<dyn Any>> = slot.observer.map(|observer| observer as Box<dyn Any>);
        any.and_then(|any| any.downcast().ok()).map(|observer| *observer).ok_or(Error::ObserverUnavailable)
    }

    /// Returns an observer for changes.
    ///
    /// # Errors
    /// As [`Observers::get`].
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn get_mut<O: Observer>(self, id: ObserverId<O>) -> Result<&'a mut O> {
        let index = self.sim.slot_index(id)?;
        let slot = &mut self.sim.observers.slots[index];
        let any: Option<&mut dyn Any> = slot.observer.as_deref_mut().map(|observer| observer as &mut dyn Any);
        any.and_then(|any| any.downcast_mut()).ok_or(Error::ObserverUnavailable)
    }
}

impl SimulationManager {
    #[track_caller]
    fn slot_index<O>(&self, id: ObserverId<O>) -> Result<usize> {
        assert!(id.manager == self.serial, "this handle belongs to another SimulationManager");
        let place = self.observers.slots.iter().position(|slot| slot.number == id.number);
        place.filter(|&i| self.observers.slots[i].observer.is_some()).ok_or(Error::ObserverUnavailable)
    }

    /// Does `steps` steps, or fewer until an observer is due, and notifies the due observers. Returns the number of
    /// steps done.
    pub(crate) fn step_until_due(&mut self, steps: u32, mut step: impl FnMut(&mut Self, u32)) -> u32 {
        if self.observers.slots.is_empty() {
            step(self, steps);
            self.observers.steps += u64::from(steps);
            return steps;
        }
        self.notify_written();
        let waits: Vec<(u64, u64)> = self
            .observers
            .slots
            .iter()
            .filter_map(|slot| Some((slot.number, slot.observer.as_ref()?.due_in(self).max(1))))
            .collect();
        let first = waits.iter().map(|(_, wait)| *wait).min().unwrap_or(u64::MAX);
        let block = u32::try_from(first).unwrap_or(u32::MAX).min(steps);
        step(self, block);
        self.observers.steps += u64::from(block);
        let due = waits.into_iter().filter(|(_, wait)| *wait <= u64::from(block)).map(|(number, _)| number);
        self.notify_listed(due, |observer, sim| observer.on_event(sim, &SimEvent::Stepped));
        block
    }

    fn notify_written(&mut self) {
        let written = self.sensors.take_written();
        if !written.is_empty() {
            self.notify_all(&SimEvent::Written { env_ids: written });
        }
    }

    /// Notifies all observers of an event.
    pub(crate) fn notify_all(&mut self, event: &SimEvent) {
        self.notify_each_with(|observer, sim| observer.on_event(sim, event));
    }

    fn notify_each_with(&mut self, tell: impl Fn(&mut dyn Observer, &mut Self)) {
        let numbers: Vec<u64> = self.observers.slots.iter().map(|slot| slot.number).collect();
        self.notify_listed(numbers, tell);
    }

    /// Notifies the observers with these numbers. An observer that panics stays in the simulation, and the others are
    /// notified before the panic of the first one continues; further panics are dropped.
    fn notify_listed(&mut self, numbers: impl IntoIterator<Item = u64>, tell: impl Fn(&mut dyn Observer, &mut Self)) {
        let mut first_panic = None;
        for number in numbers {
            first_panic = first_panic.or(self.notify(number, &tell).err());
        }
        if let Some(panic) = first_panic {
            resume_unwind(panic);
        }
    }

    /// Notifies one observer. An error is its panic.
    fn notify(&mut self, number: u64, tell: impl FnOnce(&mut dyn Observer, &mut Self)) -> std::thread::Result<()> {
        // An observer that is handling an event receives no event of its own changes.
        let Some(slot) = self.observers.slots.iter_mut().find(|slot| slot.number == number) else { return Ok(()) };
        let Some(mut observer) = slot.observer.take() else { return Ok(()) };
        // The panic continues, so the caller learns that the simulation may be in the middle of the observer's change.
        let told = catch_unwind(AssertUnwindSafe(|| tell(observer.as_mut(), self)));
        // An observer that was removed meanwhile is dropped here.
        if let Some(slot) = self.observers.slots.iter_mut().find(|slot| slot.number == number) {
            slot.observer = Some(observer);
        }
        told
    }
}
