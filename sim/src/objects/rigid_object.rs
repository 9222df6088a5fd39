//! Rigid objects: props that robots see, push and hold.

use super::shape::ObjectShape;
use crate::compile::Simulation;
use crate::error::{Error, Result};
use crate::manager::EnvId;
use crate::objects::free_body::{FreeBody, FreeBodyMut};
use crate::objects::robot::check_pose;
use crate::sensor_list::SensorList;
use ::scene::Pose;
use nalgebra::Vector3;
use ndarray::{Array2, AsArray, Ix2};
use serde::{Deserialize, Serialize};
use std::sync::Arc;

/// Whether an object moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum BodyType {
    /// Falls, is pushed and held.
    #[default]
    Dynamic,
    /// Stands fixed in the environment and is in the way of others.
    Static,
}

/// Configuration of a rigid object.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RigidObjectCfg {
    /// Name of the object, unique in the simulation.
    pub uid: String,
    /// Its shape.
    pub shape: ObjectShape,
    /// Whether it moves.
    pub body_type: BodyType,
    /// Mass \[kg\]; from `density` where `None`.
    pub mass: Option<f64>,
    /// Density \[kg/m³\].
    pub density: f64,
    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\] (MuJoCo's three); the simulation's where `None`.
    /// MuJoCo takes the larger of the two surfaces that touch.
    pub friction: Option<[f64; 3]>,
    /// Pose at the start, in the environment.
    #[serde(with = "scene::file_format::pose")]
    pub init_pose: Pose,
    /// Colour and opacity, 0..=1.
    pub rgba: [f64; 4],
    /// What kind of thing it is, for the table of mask ids; `object` where `None`.
    pub semantic_class: Option<String>,
}

impl Default for RigidObjectCfg {
    /// A grey cube of 10 cm with the density of water.
    fn default() -> Self {
        Self {
            uid: "object".into(),
            shape: ObjectShape::cube(0.1),
            body_type: BodyType::Dynamic,
            mass: None,
            density: 1000.0,
            friction: None,
            init_pose: Pose::identity(),
            rgba: [0.6, 0.6, 0.6, 1.0],
            semantic_class: None,
        }
    }
}

/// An object that was added: what does not change while the simulation runs.
#[derive(Debug)]
pub struct RigidObjectData {
    cfg: RigidObjectCfg,
    mask_id: i32,
}

impl RigidObjectData {
    /// Checks every number.
    pub(crate) fn new(cfg: RigidObjectCfg, mask_id: i32) -> Result<Self> {
        let fail = |field, value: &dyn std::fmt::Debug, expected| {
            Err(Error::Config { field, value: format!("{value:?}"), expected })
        };
        if !cfg.shape.sizes().iter().all(|s| s.is_finite() && (1e-6..=1e6).contains(s)) {
            return fail("shape", &cfg.shape, "every size must be 1e-6 to 1e6 metres");
        }
        if !(cfg.density.is_finite() && cfg.density > 0.0) {
            return fail("density", &cfg.density, "it must be above 0 kg/m³, such as 1000 for water");
        }
        let (mass, moments) = inertia(&cfg);
        if cfg.body_type == BodyType::Dynamic && !(mass.is_finite() && mass > 1e-12 && moments.min() > 1e-14) {
            return fail(
                "mass",
                &mass,
                "MuJoCo moves nothing lighter than 1e-12 kg or with a moment below 1e-14 kg m²",
            );
        }
        if let Some(friction) = cfg.friction
            && !friction.iter().all(|f| f.is_finite() && *f >= 0.0)
        {
            return fail("friction", &friction, "the three coefficients must be >= 0");
        }
        if !cfg.rgba.iter().all(|c| (0.0..=1.0).contains(c)) {
            return fail("rgba", &cfg.rgba, "each component must be 0 to 1");
        }
        check_pose("init_pose", &cfg.init_pose)?;
        Ok(Self { cfg, mask_id })
    }

    /// Name of the object.
    pub fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// The configuration it was added with.
    pub fn cfg(&self) -> &RigidObjectCfg {
        &self.cfg
    }

    /// What the mask channel of cameras says of it.
    pub fn mask_id(&self) -> i32 {
        self.mask_id
    }

    /// Mass \[kg\] and principal moments along x, y, z \[kg m²\].
    pub(crate) fn inertia(&self) -> (f64, Vector3<f64>) {
        inertia(&self.cfg)
    }
}

fn inertia(cfg: &RigidObjectCfg) -> (f64, Vector3<f64>) {
    let mass = cfg.mass.unwrap_or(cfg.density * cfg.shape.volume());
    (mass, mass * cfg.shape.unit_moments())
}

/// A rigid object, to read. Arrays have one row per environment.
#[derive(Clone, Copy, Debug)]
pub struct RigidObject<'a> {
    data: &'a Arc<RigidObjectData>,
    simulation: &'a Simulation,
    index: usize,
}

impl<'a> RigidObject<'a> {
    pub(crate) fn new(data: &'a Arc<RigidObjectData>, simulation: &'a Simulation, index: usize) -> Self {
        Self { data, simulation, index }
    }

    fn body(&self) -> FreeBody<'a> {
        FreeBody { simulation: self.simulation, index: self.simulation.objects[self.index] }
    }

    /// Name of the object.
    pub fn uid(&self) -> &'a str {
        self.data.uid()
    }

    /// The configuration it was added with.
    pub fn cfg(&self) -> &'a RigidObjectCfg {
        self.data.cfg()
    }

    /// What the mask channel of cameras says of it, the same in every environment.
    pub fn mask_id(&self) -> i32 {
        self.data.mask_id
    }

    /// Mass \[kg\], as configured. A mass that was drawn for an environment is not here: see
    /// [`properties`](crate::SimulationManager::properties).
    pub fn mass(&self) -> f64 {
        self.data.inertia().0
    }

    /// Pose of its frame in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn get_pose(&self) -> Array2<f64> {
        self.body().poses()
    }

    /// Velocity of its frame, then angular velocity, in world axes \[m/s, rad/s\], shape (N, 6); 0 where it is static.
    pub fn get_velocity(&self) -> Array2<f64> {
        self.body().velocities()
    }
}

/// A rigid object, to write.
#[derive(Debug)]
pub struct RigidObjectMut<'a> {
    data: &'a Arc<RigidObjectData>,
    simulation: &'a mut Simulation,
    sensors: &'a mut SensorList,
    index: usize,
}

impl<'a> RigidObjectMut<'a> {
    pub(crate) fn new(
        data: &'a Arc<RigidObjectData>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { data, simulation, sensors, index }
    }

    /// The object, to read.
    pub fn read(&self) -> RigidObject<'_> {
        RigidObject::new(self.data, self.simulation, self.index)
    }

    /// Puts the object somewhere: rows `[x, y, z, qw, qx, qy, qz]` in the environment \[m\] for `env_ids` (all where `None`;
    /// a single row is for all of them). Quaternions are normalised; velocities, which are in world axes, stay. A forward
    /// pass follows, so that everything that is read afterwards belongs to the new state.
    ///
    /// # Errors
    /// The object is static; wrong shape, unknown environment, a value that is not finite, a quaternion of length zero;
    /// then nothing is written.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_pose<'t>(&mut self, poses: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.body().write_poses("write_pose", poses.into(), env_ids)
    }

    /// Sets the velocity of the object's frame and its angular velocity, in world axes: rows of 6 \[m/s, rad/s\], as in
    /// [`write_pose`](Self::write_pose).
    ///
    /// # Errors
    /// As [`write_pose`](Self::write_pose).
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_velocity<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.body().write_velocities("write_velocity", velocities.into(), env_ids)
    }

    fn body(&mut self) -> FreeBodyMut<'_> {
        let index = self.simulation.objects[self.index];
        FreeBodyMut { simulation: self.simulation, sensors: self.sensors, index, owner: self.data.uid() }
    }
}
