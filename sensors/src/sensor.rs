//! The contract of every sensor.

use crate::error::SensorError;
use scene::SceneState;
use std::any::Any;
use std::fmt;
use std::ops::{BitOr, BitOrAssign};

/// What a sensor is, before it exists: plain data with public fields and a `Default`.
pub trait SensorCfg {
    /// The sensor that is built from it.
    type Sensor: Sensor;

    /// What the sensor needs to see. The simulation gathers the union over all sensors, and nothing else.
    fn requires(&self) -> Requires;

    /// The sensor, with all its buffers allocated.
    ///
    /// # Errors
    ///
    /// What the user got wrong: a period, an index, a size.
    fn build(&self, context: &SensorContext) -> Result<Self::Sensor, SensorError>;
}

/// A sensor of all environments.
///
/// The owner calls [`update`](Self::update) after every physics step; the sensor knows when it is due. Measurements are
/// read through views borrowed from the sensor, so they cannot change while somebody reads. The trait is object safe,
/// and `&dyn Sensor` converts to `&dyn Any`, from which the owner finds the type back.
pub trait Sensor: Any + fmt::Debug + Send {
    /// Measures in the environments that are due at `state`, which holds at least what the configuration requires.
    ///
    /// # Errors
    ///
    /// [`SensorError::MissingFields`] or [`SensorError::WrongShape`] where the state does not fit; nothing is measured.
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError>;

    /// Starts the environments `env_ids` anew. The current value is refreshed from `state`, taken after the reset, so
    /// that nothing stale is ever read; this is not a measurement: the history is empty, the first measurement falls one
    /// period later.
    ///
    /// # Errors
    ///
    /// As [`update`](Self::update), and [`SensorError::IndexOutOfRange`]; nothing is reset then.
    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError>;
}

/// The scene that a sensor is built for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorContext {
    /// Number of environments.
    pub num_envs: usize,
    /// Physics step \[s\].
    pub dt: f64,
    /// Length of the body axis of [`SceneState`].
    pub num_bodies: usize,
    /// Length of the joint axis of [`SceneState`].
    pub num_joints: usize,
}

/// What a sensor needs of a [`SceneState`]: a set of fields.
#[derive(Clone, Copy, Default, PartialEq, Eq, Hash)]
pub struct Requires(u8);

impl Requires {
    /// Nothing.
    pub const NONE: Self = Self(0);
    /// [`SceneState::body_poses`].
    pub const POSES: Self = Self(1);
    /// [`SceneState::body_velocities`].
    pub const VELOCITIES: Self = Self(1 << 1);
    /// [`SceneState::body_accelerations`]; costs the engine a pass of its own.
    pub const ACCELERATIONS: Self = Self(1 << 2);
    /// [`SceneState::contacts`].
    pub const CONTACTS: Self = Self(1 << 3);
    /// [`SceneState::joint_efforts`].
    pub const JOINT_EFFORTS: Self = Self(1 << 4);
    /// [`SceneState::joint_positions`] and [`SceneState::joint_velocities`].
    pub const JOINT_STATE: Self = Self(1 << 5);
    /// [`SceneState::sensordata`].
    pub const SENSORDATA: Self = Self(1 << 6);

    const NAMES: [(Self, &str); 7] = [
        (Self::POSES, "poses"),
        (Self::VELOCITIES, "velocities"),
        (Self::ACCELERATIONS, "accelerations"),
        (Self::CONTACTS, "contacts"),
        (Self::JOINT_EFFORTS, "joint_efforts"),
        (Self::JOINT_STATE, "joint_state"),
        (Self::SENSORDATA, "sensordata"),
    ];

    /// Whether all of `other` is in this set.
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Both sets together.
    pub const fn union(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// This set without `other`.
    pub const fn without(self, other: Self) -> Self {
        Self(self.0 & !other.0)
    }

    /// Whether the set has nothing in it.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// What `state` has.
    pub fn present_in(state: &SceneState) -> Self {
        let has = |present: bool, field: Self| if present { field } else { Self::NONE };
        has(state.body_poses.is_some(), Self::POSES)
            | has(state.body_velocities.is_some(), Self::VELOCITIES)
            | has(state.body_accelerations.is_some(), Self::ACCELERATIONS)
            | has(state.contacts.is_some(), Self::CONTACTS)
            | has(state.joint_efforts.is_some(), Self::JOINT_EFFORTS)
            | has(state.joint_positions.is_some() && state.joint_velocities.is_some(), Self::JOINT_STATE)
            | has(state.sensordata.is_some(), Self::SENSORDATA)
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
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use crate::joint_state::{JointState, JointStateCfg};

    #[test]
    fn requirements_are_sets() {
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

    #[test]
    fn sensors_live_in_one_list_and_are_found_back() {
        let context = SensorContext { num_envs: 2, dt: 0.005, num_bodies: 0, num_joints: 3 };
        let mut sensors: Vec<Box<dyn Sensor>> = vec![Box::new(JointStateCfg::default().build(&context).unwrap())];
        let error = sensors[0].update(&SceneState::new(2)).unwrap_err();
        assert_eq!(error.to_string(), "the joint state sensor was given a state without joint_efforts, joint_state");
        let any: &dyn Any = sensors[0].as_ref();
        assert_eq!(any.downcast_ref::<JointState>().unwrap().positions().dim(), (2, 3));
    }
}
