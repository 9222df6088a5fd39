//! Traits of sensors and their configurations, and the scene description that sensors are built from.

use crate::error::SensorError;
use crate::sampling::Sampled;
use crate::schedule::Schedule;
use kinetoscope_exec::ThreadPool;
use kinetoscope_render::geometry::RayAssetCache;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::pattern::{MAX_CANDIDATES, closest_names, strip_env_prefix};
use kinetoscope_scene::{EnvScene, Marker, Pose, RenderScene, SceneState};
use nalgebra::Vector3;
use std::any::Any;
use std::fmt;
use std::sync::Arc;

/// Configuration of a sensor: plain data with public fields.
pub trait SensorCfg {
    /// The sensor built from this configuration.
    type Sensor: Sensor;

    /// Fields of the state that the sensor needs. After a step, the simulation gathers only the fields of the sensors
    /// that are due; after a write or a reset, the fields of all sensors.
    fn requires(&self) -> StateFields;

    /// True if the sensor's [`markers`](Sensor::markers) are shown initially. Built-in sensors have a field `debug_vis`
    /// for it, off by default as in Isaac Lab. A sensor without such a field shows its markers.
    fn debug_vis(&self) -> bool {
        true
    }

    /// Schedule of a lazy sensor, with physics steps of `dt` \[s\]; `None`, the default, for an eager sensor.
    ///
    /// An eager sensor measures when it is due. For a lazy sensor, the owner stores the fields that the sensor
    /// [requires](Self::requires) when it is due, keeping the last such state of each environment. The sensor measures
    /// this stored state at the first read. The values are the same, and unread measurements cost no more than the
    /// copy. In contrast, lazy sensors of Isaac Lab measure the instant of the read. Resets and writes to the state
    /// take effect at once.
    ///
    /// Return a schedule only if a measurement depends on the state at its instant alone. [`Sensor::update`] must also
    /// count correctly with [`Phases::take_due_count`](crate::Phases::take_due_count), as a [`Sampler`](crate::Sampler)
    /// does. For sensors with a sampler, [`SamplingCfg::lazy_schedule`](crate::SamplingCfg::lazy_schedule) decides. The
    /// [`Camera`](crate::camera::Camera) stores and renders its frames itself.
    fn lazy(&self, dt: f64) -> Option<Schedule> {
        let _ = dt;
        None
    }

    /// Builds the sensor, with all its buffers allocated.
    ///
    /// # Errors
    ///
    /// Invalid configurations, such as a period, a name, an index or a size.
    fn build(&self, context: &SensorContext) -> Result<Self::Sensor, SensorError>;
}

/// A sensor that measures in all environments.
///
/// The owner calls [`update`](Self::update) after a physics step, at the latest when [`due_in`](Self::due_in) has
/// elapsed (later for a [lazy](SensorCfg::lazy) sensor). The sensor determines which environments are due. Measurements
/// are read through views that borrow the sensor, so they cannot change while they are read. The trait is object safe,
/// and `&dyn Sensor` converts to `&dyn Any`, from which the owner recovers the concrete type.
pub trait Sensor: Any + fmt::Debug + Send + Sync {
    /// Measures in the environments that are due at `state`, which holds at least the required fields. Each environment
    /// is at its own step ([`SceneState::step`]).
    ///
    /// # Errors
    ///
    /// [`SensorError::MissingFields`] or [`SensorError::WrongShape`] if the state does not fit. Nothing is measured
    /// then.
    ///
    /// # Panics
    ///
    /// If the steps of an environment went backwards without [`reset`](Self::reset).
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError>;

    /// Resets the environments `env_ids`. The current value is refreshed from `state`, taken after the reset, so
    /// outdated values are never read. This is not a measurement: the history is empty, and the first measurement falls
    /// one period later. Rows of other environments in `state` may be those of an earlier time.
    ///
    /// # Errors
    ///
    /// Same as [`update`](Self::update), and [`SensorError::IndexOutOfRange`]. Nothing is reset then.
    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError>;

    /// Refreshes the current value of the environments `env_ids` after a write to their state, so outdated values are
    /// never read. This is not a measurement: history, counts and schedule do not change. Rows of other environments in
    /// `state` may be those of an earlier time.
    ///
    /// # Errors
    ///
    /// Same as [`reset`](Self::reset). Nothing is refreshed then.
    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError>;

    /// Markers that visualize the current value in environment `env`, in the frame of the environment: rendered in
    /// viewers and in the color of cameras with `draw_markers`, and not measured by any other sensor. They are shown
    /// initially if [`SensorCfg::debug_vis`] returns true. `pose` returns the current pose of a body, given its index
    /// on the body axis, where a viewer draws the body.
    fn markers(&self, env: usize, pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let _ = (env, pose);
        Vec::new()
    }

    /// Physics steps until the next measurement of any environment is captured or delivered, or the shutter of a camera
    /// opens; at least 1. `step` contains the steps of the environments. The owner may skip the updates until then. The
    /// step of a quarantined (diverged) environment is [`Phases::QUARANTINED`](crate::Phases::QUARANTINED).
    fn due_in(&self, step: &[u64]) -> u64 {
        let _ = step;
        1
    }

    /// Numbers and channels of the sensor for generic users such as recorders; `None` for a sensor without a
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
    /// Time step of the simulation \[s\], the unit of [`SceneState::step`]. With substeps, it spans several steps of
    /// the physics engine.
    pub dt: f64,
    /// Gravity \[m/s²\], in world axes, such as (0, 0, -9.81).
    pub gravity: Vector3<f64>,
    /// Name of the sensor, part of the key of its random numbers.
    pub name: Arc<str>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Index of environment 0 among the environments of all processes, part of the key of random numbers.
    pub first_env: usize,
    /// Names of the bodies in the order of the body axis of [`SceneState`]: `uid/link`, the uid of an object,
    /// `uid/body` or `uid/site` of an MJCF file.
    pub bodies: Arc<[String]>,
    /// For every body, the index of the body that moves it. For a robot, this is the nearest link, the link itself or
    /// one above it, that no fixed joint attaches to its parent. For a body or site of an MJCF file, it is the body
    /// that MuJoCo welds it to; a body or site welded to the world has its own index. An object has its own index. The
    /// list is as long as that of `bodies`, or empty if unknown.
    pub moving_bodies: Arc<[usize]>,
    /// Names of the joints in the order of the joint axis of [`SceneState`], `uid/joint`: the movable joints of robots
    /// and articulations, and the hinge and slide joints of MJCF files.
    pub joints: Arc<[String]>,
    /// Names of the actuators in the order of the actuator axis of [`SceneState`]: `uid/joint` for the drive of a joint
    /// of a robot or articulation, `uid/actuator` for an actuator of an MJCF file.
    pub actuators: Arc<[String]>,
    /// The physics engine's own sensors, in the order of their values in [`SceneState::sensordata`].
    pub engine_sensors: Arc<[EngineSensor]>,
    /// Scene of the visual geometry; present for sensors that require [`StateFields::VISIBLE`] or
    /// [`StateFields::INSTANCES`].
    pub scene: Option<Arc<RenderScene>>,
    /// Render scene of each environment with its own sizes or colors, shape \[num_envs\]; empty if all environments use
    /// `scene`, or if `scene` is `None`.
    pub own_scenes: Vec<EnvScene>,
    /// True if an existing sensor is rebuilt after a scene change; checks made only at creation are skipped.
    pub rebuilt: bool,
    /// BVHs and other ray-casting data of the assets of the scene, shared by all ray casters.
    pub ray_assets: RayAssetCache,
    /// Number of threads that a sensor may use; 0 counts as 1.
    pub threads: usize,
    /// Thread pool shared by all sensors.
    pub pool: ThreadPool,
}

impl SensorContext {
    /// Returns the index of a body on the body axis. `name` is not a pattern: it is the full name (`uid/link`, or the
    /// uid of an object), or the part after the first slash if only one body has it. The prefixes `{ENV}/` and
    /// `{ENV_REGEX_NS}/` are ignored.
    ///
    /// # Errors
    ///
    /// [`SensorError::UnknownName`] with the nearest names, [`SensorError::AmbiguousName`] with all matching names.
    pub fn body(&self, name: &str) -> Result<usize, SensorError> {
        let name = strip_env_prefix(name);
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

/// Returns the bodies whose full or short name is most similar to `name`, nearest first, at most 12.
fn nearest_bodies(name: &str, bodies: &[String]) -> Vec<String> {
    let bare: Vec<&str> = bodies.iter().map(|b| b.split_once('/').map_or(b.as_str(), |(_, link)| link)).collect();
    let wanted = if name.contains('/') { bodies.iter().map(String::as_str).collect() } else { bare.clone() };
    let mut found = Vec::new();
    for candidate in closest_names(name, wanted) {
        found.extend((0..bodies.len()).filter(|&i| bodies[i] == candidate || bare[i] == candidate).map(|i| &bodies[i]));
    }
    found.dedup();
    found.into_iter().take(MAX_CANDIDATES).cloned().collect()
}

/// A sensor that the physics engine evaluates itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct EngineSensor {
    /// Full name, `uid/sensor`.
    pub name: String,
    /// Type of the sensor, such as `framepos`: the name of its MJCF element.
    pub kind: Arc<str>,
    /// Unit of the values, `1` for numbers without a unit; `None` if unknown.
    pub unit: Option<Arc<str>>,
    /// Index of the first value in [`SceneState::sensordata`].
    pub first: usize,
    /// Number of values.
    pub width: usize,
    /// True if the engine computes the values with accelerations and forces, for the instant
    /// [`SceneState::force_time`]. False for positions and velocities, at [`SceneState::time`].
    pub force_stage: bool,
    /// True if the values are a quaternion, w x y z.
    pub is_quaternion: bool,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn body_names() {
        let bodies = ["left/base", "left/tip", "right/base", "cube"].map(String::from);
        let context = SensorContext { bodies: bodies.into(), ..SensorContext::default() };
        assert_eq!([context.body("right/base"), context.body("tip"), context.body("cube")], [Ok(2), Ok(1), Ok(3)]);
        assert_eq!([context.body("{ENV}/tip"), context.body("{ENV_REGEX_NS}/right/base")], [Ok(1), Ok(2)]);
        assert!(context.body("{ENVS}/tip").is_err());
        let error = context.body("base").unwrap_err().to_string();
        assert_eq!(
            error,
            "body \"base\" is ambiguous: it may be any of \"left/base\", \"right/base\"; give the full name"
        );
        let error = context.body("tpi").unwrap_err().to_string();
        assert!(error.starts_with("unknown body \"tpi\"; known names: \"left/tip\""), "{error}");
    }
}
