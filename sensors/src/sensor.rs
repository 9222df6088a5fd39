//! The contract of every sensor.

use crate::error::SensorError;
use crate::sampling::Sampled;
use crate::schedule::Schedule;
use kinetoscope_exec::ThreadPool;
use kinetoscope_render::geometry::RayAssets;
use kinetoscope_scene::Requires;
use kinetoscope_scene::pattern::{MAX_CANDIDATES, closest, in_every_env};
use kinetoscope_scene::{Marker, OwnScene, Pose, RenderScene, SceneState};
use nalgebra::Vector3;
use std::any::Any;
use std::fmt;
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
    /// sensors with one. The [`Camera`](crate::camera::Camera) keeps and draws by itself.
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
        assert_eq!(error, "body \"base\" may be any of \"left/base\", \"right/base\"; give the full name");
        let error = context.body("tpi").unwrap_err().to_string();
        assert!(error.starts_with("there is no body \"tpi\"; known are \"left/tip\""), "{error}");
    }
}
