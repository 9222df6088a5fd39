//! Those who look at a simulation while it runs, and may act on it: windows, browser views, recorders.

use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use std::any::{Any, TypeId};
use std::fmt;
use std::marker::PhantomData;

/// Looks at a simulation between its steps, and may change it: shows it, records it, holds it while somebody presses pause.
///
/// The simulation calls it on the thread that steps, with nothing else running, and goes on when it returns. What takes
/// long belongs on a thread of the observer's own, with copies of what it needs. Adding an observer changes no number: steps
/// are cut where observers are due, and `update(n)` equals n times `update(1)`.
pub trait Observer: Any + Send {
    /// Physics steps from now until it is asked next, at least 1; [`u64::MAX`] for never. Asked before every block of steps.
    fn due_in(&self, sim: &SimulationManager) -> u64;

    /// Something happened. What an observer does to the simulation in here, steps too, the others are told of, and itself not.
    fn observe(&mut self, sim: &mut SimulationManager, moment: &Moment);

    /// Handles an event that another crate publishes ([`ObserversMut::publish`](crate::ObserversMut::publish)), such as a
    /// [`StepResult`](crate::StepResult). An observer ignores events of types that it does not know.
    fn receive(&mut self, sim: &mut SimulationManager, event: &dyn Any) {
        let _ = (sim, event);
    }

    /// True if events of this type are published while this observer is in the simulation: the observer of a task says so of
    /// [`StepResult`](crate::StepResult). See [`Observers::is_published`].
    fn publishes(&self, event: TypeId) -> bool {
        let _ = event;
        false
    }
}

/// What happened.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Moment {
    /// Steps were done, and the observer is due.
    Stepped,
    /// Environments were reset.
    Reset {
        /// Which, in ascending order.
        env_ids: Vec<EnvId>,
    },
    /// Somebody wrote to the state of environments since the last step: joints, poses, welds, properties that were drawn, a
    /// snapshot. Told once, right before the next step, or before an observer comes or goes.
    Written {
        /// Which, in ascending order.
        env_ids: Vec<EnvId>,
    },
    /// Something was added to the simulation: the model and its arrays are other ones.
    Compiled,
}

/// Handle of an observer; valid for the manager that made it.
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

impl<O> fmt::Debug for ObserverId<O> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ObserverId({})", self.number)
    }
}

/// The observers of a simulation.
#[derive(Default)]
pub(crate) struct ObserverSlots {
    seats: Vec<Seat>,
    next: u64,
    /// Physics steps that were done since the simulation was made.
    pub(crate) steps: u64,
}

struct Seat {
    number: u64,
    /// `None` while it is being told.
    observer: Option<Box<dyn Observer>>,
}

impl fmt::Debug for ObserverSlots {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_list().entries(self.seats.iter().map(|seat| seat.number)).finish()
    }
}

impl SimulationManager {
    /// Observers of the simulation.
    pub fn observers(&self) -> Observers<'_> {
        Observers::new(self)
    }

    /// Observers of the simulation, to add and to remove.
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

    /// An observer, to read.
    ///
    /// # Errors
    /// It was taken away, or is the one that is being told right now.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn get<O: Observer>(&self, id: ObserverId<O>) -> Result<&'a O> {
        let seat = &self.sim.observers.seats[self.sim.seat_of(id)?];
        let any: Option<&dyn Any> = seat.observer.as_deref().map(|observer| observer as &dyn Any);
        any.and_then(|any| any.downcast_ref()).ok_or(Error::NoObserver)
    }

    /// The observers of a type, in the order in which they were added; without the one that is being told right now.
    pub fn ids<O: Observer>(&self) -> Vec<ObserverId<O>> {
        let is = |seat: &&Seat| {
            let any: Option<&dyn Any> = seat.observer.as_deref().map(|observer| observer as &dyn Any);
            any.is_some_and(|any| any.is::<O>())
        };
        let id = |seat: &Seat| ObserverId { manager: self.sim.serial, number: seat.number, observer: PhantomData };
        self.sim.observers.seats.iter().filter(is).map(id).collect()
    }

    /// Whether an observer is there: added to this simulation, not taken away, and not the one that is being told right now.
    pub fn contains<O: Observer>(&self, id: ObserverId<O>) -> bool {
        id.manager == self.sim.serial && self.sim.seat_of(id).is_ok()
    }

    /// True if events of a type will be published, by what one of the observers belongs to ([`Observer::publishes`]): recorders
    /// look here when they begin.
    pub fn is_published<E: Any>(&self) -> bool {
        let mut observers = self.sim.observers.seats.iter().filter_map(|seat| seat.observer.as_ref());
        observers.any(|observer| observer.publishes(TypeId::of::<E>()))
    }

    /// Physics steps that [`update`](SimulationManager::update) has done since the simulation was made, whatever was reset meanwhile: what
    /// an observer counts by.
    pub fn steps(&self) -> u64 {
        self.sim.observers.steps
    }
}

/// Observers of a simulation, to add, change and remove; see [`SimulationManager::observers_mut`].
#[derive(Debug)]
pub struct ObserversMut<'a> {
    sim: &'a mut SimulationManager,
}

impl<'a> ObserversMut<'a> {
    pub(crate) fn new(sim: &'a mut SimulationManager) -> Self {
        Self { sim }
    }

    /// Publishes an event of any type to all observers ([`Observer::receive`]). The simulation keeps nothing of it.
    pub fn publish<E: Any>(self, event: &E) {
        self.sim.tell_each(|observer, sim| observer.receive(sim, event));
    }

    /// Adds an observer, which receives the events from now on.
    pub fn add<O: Observer>(&mut self, observer: O) -> ObserverId<O> {
        // Earlier writes are reported to the observers that were there.
        self.sim.tell_written();
        let number = self.sim.observers.next;
        self.sim.observers.next += 1;
        self.sim.observers.seats.push(Seat { number, observer: Some(Box::new(observer)) });
        ObserverId { manager: self.sim.serial, number, observer: PhantomData }
    }

    /// Removes an observer and returns it, after reporting earlier writes to it.
    ///
    /// # Errors
    /// It was taken away before, or is the one that is being told right now.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn remove<O: Observer>(&mut self, id: ObserverId<O>) -> Result<O> {
        self.sim.seat_of(id)?;
        self.sim.tell_written();
        let index = self.sim.seat_of(id)?;
        let seat = self.sim.observers.seats.remove(index);
        let any: Option<Box<dyn Any>> = seat.observer.map(|observer| observer as Box<dyn Any>);
        any.and_then(|any| any.downcast().ok()).map(|observer| *observer).ok_or(Error::NoObserver)
    }

    /// An observer, to change.
    ///
    /// # Errors
    /// As [`Observers::get`].
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn get<O: Observer>(self, id: ObserverId<O>) -> Result<&'a mut O> {
        let index = self.sim.seat_of(id)?;
        let seat = &mut self.sim.observers.seats[index];
        let any: Option<&mut dyn Any> = seat.observer.as_deref_mut().map(|observer| observer as &mut dyn Any);
        any.and_then(|any| any.downcast_mut()).ok_or(Error::NoObserver)
    }
}

impl SimulationManager {
    #[track_caller]
    fn seat_of<O>(&self, id: ObserverId<O>) -> Result<usize> {
        assert!(id.manager == self.serial, "this handle is of another SimulationManager");
        let place = self.observers.seats.iter().position(|seat| seat.number == id.number);
        place.filter(|&i| self.observers.seats[i].observer.is_some()).ok_or(Error::NoObserver)
    }

    /// Steps `steps` times, or fewer until an observer is due, and tells those that are due. Gives the number of steps done.
    pub(crate) fn step_observed(&mut self, steps: u32, mut step: impl FnMut(&mut Self, u32)) -> u32 {
        if self.observers.seats.is_empty() {
            step(self, steps);
            self.observers.steps += u64::from(steps);
            return steps;
        }
        self.tell_written();
        let waits: Vec<(u64, u64)> = self
            .observers
            .seats
            .iter()
            .filter_map(|seat| Some((seat.number, seat.observer.as_ref()?.due_in(self).max(1))))
            .collect();
        let first = waits.iter().map(|(_, wait)| *wait).min().unwrap_or(u64::MAX);
        let block = u32::try_from(first).unwrap_or(u32::MAX).min(steps);
        step(self, block);
        self.observers.steps += u64::from(block);
        for (number, _) in waits.iter().filter(|(_, wait)| *wait <= u64::from(block)) {
            self.tell(*number, |observer, sim| observer.observe(sim, &Moment::Stepped));
        }
        block
    }

    fn tell_written(&mut self) {
        let written = self.sensors.take_written();
        if !written.is_empty() {
            self.tell_all(&Moment::Written { env_ids: written });
        }
    }

    /// Tells all observers of something that happened.
    pub(crate) fn tell_all(&mut self, moment: &Moment) {
        self.tell_each(|observer, sim| observer.observe(sim, moment));
    }

    fn tell_each(&mut self, tell: impl Fn(&mut dyn Observer, &mut Self)) {
        let numbers: Vec<u64> = self.observers.seats.iter().map(|seat| seat.number).collect();
        for number in numbers {
            self.tell(number, &tell);
        }
    }

    fn tell(&mut self, number: u64, tell: impl FnOnce(&mut dyn Observer, &mut Self)) {
        // One that is being told hears of nothing that happens inside.
        let Some(seat) = self.observers.seats.iter_mut().find(|seat| seat.number == number) else { return };
        let Some(mut observer) = seat.observer.take() else { return };
        tell(observer.as_mut(), self);
        // It may have been taken away meanwhile: then it is dropped here.
        if let Some(seat) = self.observers.seats.iter_mut().find(|seat| seat.number == number) {
            seat.observer = Some(observer);
        }
    }
}
