//! The contract of every sensor.

use crate::error::SensorError;
use crate::ray::RayAssets;
use crate::sampling::Sampled;
use crate::schedule::Schedule;
use kinetoscope_exec::ThreadPool;
use kinetoscope_scene::pattern::{MAX_CANDIDATES, closest, in_every_env};
use kinetoscope_scene::{Marker, OwnScene, Pose, RenderScene, SceneState};
use nalgebra::Vector3;
use std::any::Any;
use std::fmt;
use std::ops::{BitOr, BitOrAssign};
use std::sync::Arc;

/// What a sensor is, before it exists: plain data with public fields and a `Default`.
pub trait SensorCfg {
    /// The sensor that is built from it.
    type Sensor: Sensor;

    /// What the sensor needs to see. The simulation gathers the union over all sensors, and nothing else.
    fn requires(&self) -> Requires;

    /// Whether the simulation shows the sensor's [`markers`](Sensor::markers) among its own, until somebody switches that.
    /// Built-in sensors have a field `debug_vis` for it, off by default as in Isaac Lab; a sensor that has no such field shows
    /// what it has.
    fn debug_vis(&self) -> bool {
        true
    }

    /// When a lazy sensor is due, with physics steps of `dt` \[s\]; `None` for an eager one, as by default.
    ///
    /// An eager sensor measures when it is due. Of a lazy one, the owner keeps what the sensor [requires](Self::requires) of
    /// the state then (the last time it was due, for each environment), and the sensor measures that when somebody first reads
    /// it: what is read is the same, and what nobody reads costs no more than the copy. Isaac Lab's lazy sensors measure the
    /// instant at which they are read; here that changes nothing either. Resets, and writes to the state, are seen at once.
    ///
    /// Give a schedule only where a measurement depends on the state at its instant and on nothing before, and where
    /// [`Sensor::update`] counts right with [`Phases::fallen_due`](crate::Phases::fallen_due), as a
    /// [`Sampler`](crate::Sampler) does: [`SamplingCfg::lazy_schedule`](crate::SamplingCfg::lazy_schedule) decides that for
    /// sensors with one. The [`Camera`](crate::Camera) keeps and draws by itself.
    fn lazy(&self, dt: f64) -> Option<Schedule> {
        let _ = dt;
        None
    }

    /// The sensor, with all its buffers allocated.
    ///
    /// # Errors
    ///
    /// What the user got wrong: a period, an index, a size.
    fn build(&self, context: &SensorContext) -> Result<Self::Sensor, SensorError>;
}

/// A sensor of all environments.
///
/// The owner calls [`update`](Self::update) after a physics step at the latest when [`due_in`](Self::due_in) says so (later
/// for a [lazy](SensorCfg::lazy) sensor); the sensor knows which environments are due. Measurements are read through views borrowed from the sensor, so they cannot
/// change while somebody reads. The trait is object safe, and `&dyn Sensor` converts to `&dyn Any`, from which the owner
/// finds the type back.
pub trait Sensor: Any + fmt::Debug + Send + Sync {
    /// Measures in the environments that are due at `state`, which holds at least what the configuration requires. Each
    /// environment is at an instant of its own ([`SceneState::step`]).
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

    /// Refreshes the current value of the environments `env_ids` after somebody wrote to their state, so that nothing
    /// stale is ever read. This is not a measurement: history and schedule go on as if nothing had happened.
    ///
    /// # Errors
    ///
    /// As [`reset`](Self::reset); nothing is refreshed then.
    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError>;

    /// What it shows people of its last measurement in environment `env`: drawn in overviews, never measured. Whether they
    /// are drawn is [`SensorCfg::debug_vis`]. `pose` tells where a body of the body axis is now, which is where an overview
    /// draws it.
    fn markers(&self, env: usize, pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let _ = (env, pose);
        Vec::new()
    }

    /// Physics steps until the next measurement of any environment, at least 1, when the environments are at `step`: the
    /// owner may leave out updates before. The step of one that stands still (it was put aside) is
    /// [`Phases::STANDS`](crate::Phases::STANDS).
    fn due_in(&self, step: &[u64]) -> u64 {
        let _ = step;
        1
    }

    /// Its numbers with their channels, for who knows nothing of its type, such as a recorder; `None` for a sensor without a
    /// [`Sampler`](crate::Sampler).
    fn sampled(&self) -> Option<&dyn Sampled> {
        None
    }
}

/// The scene that a sensor is built for.
#[derive(Clone, Debug, Default)]
pub struct SensorContext {
    /// Number of environments.
    pub num_envs: usize,
    /// Physics step \[s\].
    pub dt: f64,
    /// Gravity \[m/s²\], in world axes.
    pub gravity: Vector3<f64>,
    /// Name of the sensor: part of the key of its random numbers.
    pub name: Arc<str>,
    /// Seed of random numbers.
    pub seed: u64,
    /// Index of environment 0 among the environments of all processes: part of the key of random numbers.
    pub first_env: usize,
    /// Names of the bodies in the order of the body axis of [`SceneState`]: `uid/link`, the uid of an object, `uid/body` or
    /// `uid/site` of an MJCF file.
    pub bodies: Arc<[String]>,
    /// For every body, the body that moves it: itself where it moves by a joint of its own or not at all, else the one that
    /// fixed joints fuse it to. As long as `bodies`, or empty where nobody knows.
    pub carriers: Arc<[usize]>,
    /// Names of the joints in the order of the joint axis of [`SceneState`]: `uid/joint`.
    pub joints: Arc<[String]>,
    /// Names of the actuators in the order of the actuator axis of [`SceneState`]: `uid/joint` for the drive of a robot's
    /// joint, `uid/actuator` for those of an MJCF file.
    pub actuators: Arc<[String]>,
    /// The physics engine's own sensors, in the order of their values in [`SceneState::sensordata`].
    pub engine_sensors: Arc<[EngineSensor]>,
    /// What can be seen; there for sensors that require [`Requires::VISIBLE`] or [`Requires::INSTANCES`].
    pub scene: Option<Arc<RenderScene>>,
    /// What environments see whose looks are their own, where there are any; there for the same sensors.
    pub own_scenes: Vec<OwnScene>,
    /// Whether the sensor was there before and is built again for a scene that has changed: what it could only be refused for
    /// when it was added is no error then.
    pub rebuilt: bool,
    /// What ray casters have built for the assets of the scene, shared by all of them.
    pub ray_assets: RayAssets,
    /// How many threads a sensor may use; 0 counts as 1.
    pub threads: usize,
    /// The threads that sensors share.
    pub pool: ThreadPool,
}

impl SensorContext {
    /// Index of a body on the body axis, by its full name (`uid/link`), or by the part behind the first slash where only
    /// one body is called so. `{ENV}/` and `{ENV_REGEX_NS}/` before it change nothing.
    ///
    /// # Errors
    ///
    /// [`SensorError::UnknownName`] with the nearest names, [`SensorError::AmbiguousName`] with those that it may mean.
    pub fn body(&self, name: &str) -> Result<usize, SensorError> {
        let name = in_every_env(name);
        if let Some(index) = self.bodies.iter().position(|b| b == name) {
            return Ok(index);
        }
        let matches =
            || (0..).zip(&*self.bodies).filter(|(_, b)| b.split_once('/').is_some_and(|(_, link)| link == name));
        match matches().count() {
            0 => Err(SensorError::UnknownName {
                what: "body",
                name: name.into(),
                candidates: nearest_bodies(name, &self.bodies),
            }),
            1 => Ok(matches().next().map_or(0, |(index, _)| index)),
            _ => Err(SensorError::AmbiguousName {
                what: "body",
                name: name.into(),
                candidates: matches().map(|(_, b)| b.clone()).collect(),
            }),
        }
    }
}

/// The bodies whose bare or full name is most like `name`, the nearest first.
fn nearest_bodies(name: &str, bodies: &[String]) -> Vec<String> {
    let bare: Vec<&str> = bodies.iter().map(|b| b.split_once('/').map_or(b.as_str(), |(_, link)| link)).collect();
    let wanted = if name.contains('/') { bodies.iter().map(String::as_str).collect() } else { bare.clone() };
    let mut found = Vec::new();
    for candidate in closest(name, wanted) {
        found.extend((0..bodies.len()).filter(|&i| bodies[i] == candidate || bare[i] == candidate).map(|i| &bodies[i]));
    }
    found.dedup();
    found.into_iter().take(MAX_CANDIDATES).cloned().collect()
}

/// A sensor that the physics engine evaluates itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EngineSensor {
    /// `uid/sensor`.
    pub name: String,
    /// The engine's word for its type.
    pub kind: Arc<str>,
    /// Unit of its values; `None` where nobody knows.
    pub unit: Option<Arc<str>>,
    /// Its first value in [`SceneState::sensordata`].
    pub first: usize,
    /// Number of its values.
    pub width: usize,
    /// Whether it measures what the engine solves for (accelerations, forces), at [`SceneState::force_time`]; else it measures
    /// positions and velocities, at [`SceneState::time`].
    pub solved: bool,
    /// Whether its values are a quaternion, w x y z.
    pub quaternion: bool,
}

/// What a sensor needs of a [`SceneState`]: a set of fields.
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
    /// [`SceneState::visible`], and [`SensorContext::scene`].
    pub const VISIBLE: Self = Self(1 << 7);
    /// [`SceneState::joint_wrenches`]; costs the engine a pass of its own.
    pub const JOINT_WRENCHES: Self = Self(1 << 8);
    /// [`SceneState::instance_poses`], and [`SensorContext::scene`].
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

    /// Whether all of `other` is in this set.
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

    /// What is in both sets.
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

    /// Whether the set has nothing in it.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// What `state` has.
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

    #[test]
    fn body_names() {
        let bodies = ["left/base", "left/tip", "right/base", "cube"].map(String::from);
        let context = SensorContext { bodies: bodies.into(), ..SensorContext::default() };
        assert_eq!([context.body("right/base"), context.body("tip"), context.body("cube")], [Ok(2), Ok(1), Ok(3)]);
        assert_eq!([context.body("{ENV}/tip"), context.body("{ENV_REGEX_NS}/right/base")], [Ok(1), Ok(2)]);
        assert!(context.body("{ENVS}/tip").is_err());
        let error = context.body("base").unwrap_err().to_string();
        assert_eq!(error, "body \"base\" may be any of \"left/base\", \"right/base\"; give the full name");
        let error = context.body("tpi").unwrap_err().to_string();
        assert!(error.starts_with("there is no body \"tpi\"; known are \"left/tip\""), "{error}");
    }
}
