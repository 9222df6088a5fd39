//! [`StateFields`]: the fields of the scene's state that a sensor needs.

use std::fmt;
use std::ops::{BitOr, BitOrAssign};

/// Set of the fields of a [`SceneState`](crate::SceneState) that a sensor needs.
///
/// Each flag selects one group of arrays, for example [`POSES`](Self::POSES).
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct StateFields(pub(crate) u32);

impl StateFields {
    /// The empty set.
    pub const NONE: Self = Self(0);

    /// Quantities that the engine solves for the start of a step: accelerations, contacts and joint wrenches.
    ///
    /// They are lost when the step is done, so a simulation must know before the step that a sensor needs them.
    pub const FORCE_STAGE: Self = Self::ACCELERATIONS.union(Self::CONTACTS).union(Self::JOINT_WRENCHES);

    /// True if this set contains all flags of `other`; always true for an empty `other`.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Fields that are in both sets.
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Union of both sets.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Returns this set without `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// True if the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// Names of the flags in the set, such as `poses`.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.iter().filter(move |(field, _)| self.contains(*field)).map(|(_, name)| *name)
    }
}

impl BitOr for StateFields {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        self.union(other)
    }
}

impl BitOrAssign for StateFields {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

/// Writes `poses, contacts`, or `nothing` for the empty set.
impl fmt::Display for StateFields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.is_empty() {
            return f.write_str("nothing");
        }
        for (k, name) in self.names().enumerate() {
            f.write_str(if k == 0 { "" } else { ", " })?;
            f.write_str(name)?;
        }
        Ok(())
    }
}

impl fmt::Debug for StateFields {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "StateFields({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SceneState;

    #[test]
    fn requirements() {
        let mut need = StateFields::POSES | StateFields::CONTACTS;
        assert_eq!(need.to_string(), "poses, contacts");
        assert!(need.contains(StateFields::POSES) && !need.contains(StateFields::POSES | StateFields::SENSORDATA));
        need |= StateFields::SENSORDATA;
        assert_eq!(need.without(StateFields::POSES).names().collect::<Vec<_>>(), ["contacts", "sensordata"]);
        assert_eq!(format!("{:?}", StateFields::default()), "StateFields(nothing)");
        assert_eq!(StateFields::present_in(&SceneState::new(2)), StateFields::NONE);
        let all = StateFields::NAMES.iter().fold(StateFields::NONE, |sum, (field, _)| sum | *field);
        assert_eq!(all.names().count(), StateFields::NAMES.len(), "every field has its own bit");
    }
}
