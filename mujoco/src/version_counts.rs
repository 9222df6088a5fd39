//! Counts that differ between MuJoCo 2.2.2 and 4.x: controls, activations, equalities, excluded bodies.

use super::model::Model;
use mujoco_sys::fields::model as fields;
use std::ops::Range;

impl Model {
    /// Number of actuators.
    pub fn nactuator(&self) -> usize {
        #[cfg(mj4)]
        let count = self.header().nactuator;
        #[cfg(not(mj4))]
        let count = self.header().nu;
        count as usize
    }

    /// Index, in `ctrl`, of the first control of an actuator. Actuators of 2.2.2 have one control each.
    ///
    /// # Panics
    /// There is no such actuator.
    pub fn actuator_control(&self, actuator: usize) -> usize {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let first = unsafe { fields::actuator_ctrladr(self.raw()) };
            first[actuator].max(0) as usize
        }
        #[cfg(not(mj4))]
        {
            assert!(actuator < self.nactuator(), "actuator {actuator} of {}", self.nactuator());
            actuator
        }
    }

    /// Range of an actuator's activations in `act`; empty for an actuator without activation.
    ///
    /// # Panics
    /// There is no such actuator.
    pub fn actuator_activation(&self, actuator: usize) -> Range<usize> {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let first = unsafe { fields::actuator_actadr(self.raw()) };
            // SAFETY: as above.
            let count = unsafe { fields::actuator_actnum(self.raw()) };
            let first = first[actuator].max(0) as usize;
            first..first + count[actuator].max(0) as usize
        }
        #[cfg(not(mj4))]
        {
            assert!(actuator < self.nactuator(), "actuator {actuator} of {}", self.nactuator());
            // MuJoCo 2.2.2 places actuators with an activation last.
            let without = self.nactuator() - self.na();
            let first = actuator.saturating_sub(without);
            first..first + usize::from(actuator >= without)
        }
    }

    /// Pairs of bodies whose collisions the MJCF excludes (`<exclude>`), as body indices; 0 is the world.
    pub fn excluded_bodies(&self) -> impl Iterator<Item = [usize; 2]> {
        // The upper half of a signature is the first body, the lower half the second. 2.2.2 counts bodies from 1.
        let first = u32::from(cfg!(not(mj4)));
        let body = move |number: u32| number.saturating_sub(first) as usize;
        let halves = |signature: &i32| (*signature as u32 >> 16, *signature as u32 & 0xffff);
        self.exclude_signature().iter().map(halves).map(move |(one, other)| [body(one), body(other)])
    }

    /// True if an equality constraint is active in the initial state of this model.
    ///
    /// # Panics
    /// There is no such equality.
    pub fn equality_is_active(&self, equality: usize) -> bool {
        #[cfg(mj4)]
        // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
        let active = unsafe { fields::eq_active0(self.raw()) };
        #[cfg(not(mj4))]
        // SAFETY: as above.
        let active = unsafe { fields::eq_active(self.raw()) };
        super::arrays::is_set(active[equality])
    }

    /// True if a connect or weld equality couples sites instead of bodies (4.x); false on 2.2.2.
    ///
    /// # Panics
    /// There is no such equality.
    pub fn equality_is_between_sites(&self, equality: usize) -> bool {
        #[cfg(mj4)]
        {
            // SAFETY: the model is alive as long as `self` and nothing writes to a shared model.
            let kinds = unsafe { fields::eq_objtype(self.raw()) };
            kinds[equality] == mujoco_sys::mjOBJ_SITE as i32
        }
        #[cfg(not(mj4))]
        {
            assert!(equality < self.neq(), "equality {equality} of {}", self.neq());
            false
        }
    }
}
