//! What a rigid object weighs and how it turns: from its shape, and what the user says instead.

use super::object_mesh::ObjectMesh;
use super::rigid_object_data::RigidObjectCfg;
use kinetoscope_robot::inertia::RigidInertia;
use nalgebra::{UnitQuaternion, Vector3};

/// Mass properties of an object, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MassProperties {
    /// Mass \[kg\].
    pub(crate) mass: f64,
    /// Centre of mass \[m\].
    pub(crate) com: Vector3<f64>,
    /// Principal axes.
    pub(crate) axes: UnitQuaternion<f64>,
    /// Moments about the centre of mass along them \[kg m²\].
    pub(crate) moments: Vector3<f64>,
}

impl MassProperties {
    /// Those of a configuration whose numbers are finite.
    pub(crate) fn of(cfg: &RigidObjectCfg, mesh: Option<&ObjectMesh>) -> Self {
        let mut found = match mesh.and_then(|mesh| mesh.inertia) {
            Some(unit) => Self::of_mesh(cfg, &unit),
            None => Self::of_shape(cfg),
        };
        if let Some(com) = cfg.center_of_mass {
            found.com = com.into();
        }
        if let Some(moments) = cfg.inertia {
            (found.moments, found.axes) = (moments.into(), UnitQuaternion::identity());
        }
        found
    }

    fn of_shape(cfg: &RigidObjectCfg) -> Self {
        // Shapes without a mesh have all three.
        let volume = cfg.shape.volume().unwrap_or(0.0);
        let mass = cfg.mass.unwrap_or(cfg.density * volume);
        Self {
            mass,
            com: cfg.shape.center().unwrap_or_default(),
            axes: UnitQuaternion::identity(),
            moments: mass * cfg.shape.unit_moments().unwrap_or_default(),
        }
    }

    fn of_mesh(cfg: &RigidObjectCfg, unit: &RigidInertia) -> Self {
        let mass = cfg.mass.unwrap_or(cfg.density * unit.mass);
        let (moments, axes) = RigidInertia { inertia: unit.inertia * (mass / unit.mass), ..*unit }.principal();
        Self { mass, com: unit.com, axes, moments }
    }
}
