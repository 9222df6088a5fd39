//! [`Requires`]: the fields of the scene's state that a sensor needs.

use crate::SceneState;
use std::fmt;
use std::ops::{BitOr, BitOrAssign};

/// The fields of a [`SceneState`] that a sensor needs.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Requires(u16);

impl Requires {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// [`SceneState::body_poses`].
    pub const POSES: Self = Self(1);
    /// [`SceneState::body_velocities`].
    pub const VELOCITIES: Self = Self(1 << 1);
    /// [`SceneState::body_accelerations`], [`SceneState::force_poses`] and [`SceneState::force_velocities`]; costs the
    /// engine a pass of its own.
    pub const ACCELERATIONS: Self = Self(1 << 2);
    /// [`SceneState::contacts`].
    pub const CONTACTS: Self = Self(1 << 3);
    /// [`SceneState::joint_efforts`].
    pub const JOINT_EFFORTS: Self = Self(1 << 4);
    /// [`SceneState::joint_positions`] and [`SceneState::joint_velocities`].
    pub const JOINT_STATE: Self = Self(1 << 5);
    /// [`SceneState::sensordata`].
    pub const SENSORDATA: Self = Self(1 << 6);
    /// [`SceneState::visible`], and the [`RenderScene`](crate::RenderScene) that sensors are built for.
    pub const VISIBLE: Self = Self(1 << 7);
    /// [`SceneState::joint_wrenches`]; costs the engine a pass of its own.
    pub const JOINT_WRENCHES: Self = Self(1 << 8);
    /// [`SceneState::instance_poses`], and the [`RenderScene`](crate::RenderScene) that sensors are built for.
    pub const INSTANCES: Self = Self(1 << 9);
    /// [`SceneState::actuator_controls`], [`SceneState::actuator_forces`] and [`SceneState::actuator_activations`].
    pub const ACTUATORS: Self = Self(1 << 10);
    /// [`SceneState::markers`], of all other sensors.
    pub const MARKERS: Self = Self(1 << 11);

    /// What the engine solves for the beginning of a step: it is gone when the step is done, so that the simulation must
    /// know before the step that somebody wants it.
    pub const SOLVED: Self = Self::ACCELERATIONS.union(Self::CONTACTS).union(Self::JOINT_WRENCHES);

    const NAMES: [(Self, &str); 12] = [
        (Self::POSES, "poses"),
        (Self::VELOCITIES, "velocities"),
        (Self::ACCELERATIONS, "accelerations"),
        (Self::CONTACTS, "contacts"),
        (Self::JOINT_EFFORTS, "joint_efforts"),
        (Self::JOINT_STATE, "joint_state"),
        (Self::SENSORDATA, "sensordata"),
        (Self::VISIBLE, "visible"),
        (Self::JOINT_WRENCHES, "joint_wrenches"),
        (Self::INSTANCES, "instances"),
        (Self::ACTUATORS, "actuators"),
        (Self::MARKERS, "markers"),
    ];

    /// True if all of `other` is in this set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// The part of `state` that is in the set, with its steps and times.
    pub fn part_of(self, state: &SceneState) -> SceneState {
        fn part<T: Clone>(wanted: bool, field: &Option<T>) -> Option<T> {
            field.as_ref().filter(|_| wanted).cloned()
        }
        let has = |field| self.contains(field);
        SceneState {
            step: state.step.clone(),
            time: state.time.clone(),
            force_time: state.force_time.clone(),
            body_poses: part(has(Self::POSES), &state.body_poses),
            body_velocities: part(has(Self::VELOCITIES), &state.body_velocities),
            body_accelerations: part(has(Self::ACCELERATIONS), &state.body_accelerations),
            force_poses: part(has(Self::ACCELERATIONS), &state.force_poses),
            force_velocities: part(has(Self::ACCELERATIONS), &state.force_velocities),
            joint_wrenches: part(has(Self::JOINT_WRENCHES), &state.joint_wrenches),
            joint_positions: part(has(Self::JOINT_STATE), &state.joint_positions),
            joint_velocities: part(has(Self::JOINT_STATE), &state.joint_velocities),
            joint_efforts: part(has(Self::JOINT_EFFORTS), &state.joint_efforts),
            actuator_controls: part(has(Self::ACTUATORS), &state.actuator_controls),
            actuator_forces: part(has(Self::ACTUATORS), &state.actuator_forces),
            actuator_activations: part(has(Self::ACTUATORS), &state.actuator_activations),
            contacts: part(has(Self::CONTACTS), &state.contacts),
            sensordata: part(has(Self::SENSORDATA), &state.sensordata),
            visible: part(has(Self::VISIBLE), &state.visible),
            instance_poses: part(has(Self::INSTANCES), &state.instance_poses),
            own_scenes: if has(Self::VISIBLE) || has(Self::INSTANCES) { state.own_scenes.clone() } else { Vec::new() },
            markers: part(has(Self::MARKERS), &state.markers),
        }
    }

    /// The fields of both sets.
    pub const fn intersection(self, other: Self) -> Self {
        Self(self.0 & other.0)
    }

    /// Both sets together.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// This set without `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// True if the set is empty.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The fields that `state` has.
    pub fn present_in(state: &SceneState) -> Self {
        let has = |present: bool, field: Self| if present { field } else { Self::NONE };
        has(state.body_poses.is_some(), Self::POSES)
            | has(state.body_velocities.is_some(), Self::VELOCITIES)
            | has(
                state.body_accelerations.is_some() && state.force_poses.is_some() && state.force_velocities.is_some(),
                Self::ACCELERATIONS,
            )
            | has(state.contacts.is_some(), Self::CONTACTS)
            | has(state.joint_efforts.is_some(), Self::JOINT_EFFORTS)
            | has(state.joint_positions.is_some() && state.joint_velocities.is_some(), Self::JOINT_STATE)
            | has(state.sensordata.is_some(), Self::SENSORDATA)
            | has(state.visible.is_some(), Self::VISIBLE)
            | has(state.joint_wrenches.is_some(), Self::JOINT_WRENCHES)
            | has(state.instance_poses.is_some(), Self::INSTANCES)
            | has(
                state.actuator_controls.is_some()
                    && state.actuator_forces.is_some()
                    && state.actuator_activations.is_some(),
                Self::ACTUATORS,
            )
            | has(state.markers.is_some(), Self::MARKERS)
    }

    /// The names of the fields in the set.
    pub fn names(self) -> impl Iterator<Item = &'static str> {
        Self::NAMES.into_iter().filter(move |(field, _)| self.contains(*field)).map(|(_, name)| name)
    }
}

impl BitOr for Requires {
    type Output = Self;

    fn bitor(self, other: Self) -> Self {
        self.union(other)
    }
}

impl BitOrAssign for Requires {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

/// `poses, contacts`; `nothing` for the empty set.
impl fmt::Display for Requires {
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

impl fmt::Debug for Requires {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Requires({self})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requirements() {
        let mut need = Requires::POSES | Requires::CONTACTS;
        assert_eq!(need.to_string(), "poses, contacts");
        assert!(need.contains(Requires::POSES) && !need.contains(Requires::POSES | Requires::SENSORDATA));
        need |= Requires::SENSORDATA;
        assert_eq!(need.without(Requires::POSES).names().collect::<Vec<_>>(), ["contacts", "sensordata"]);
        assert_eq!(format!("{:?}", Requires::default()), "Requires(nothing)");
        assert_eq!(Requires::present_in(&SceneState::new(2)), Requires::NONE);
        let all = Requires::NAMES.iter().fold(Requires::NONE, |sum, (field, _)| sum | *field);
        assert_eq!(all.names().count(), Requires::NAMES.len(), "every field has a bit of its own");
    }
}
