//! Mass properties of rigid objects, from the shape and from values of the configuration.

use super::object_mesh::ObjectMesh;
use super::rigid_object_data::RigidObjectCfg;
use kinetoscope_robot::inertia::RigidInertia;
use nalgebra::{UnitQuaternion, Vector3};

/// Mass properties of an object, in its frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct MassProperties {
    /// Mass \[kg\].
    pub(crate) mass: f64,
    /// Center of mass in the frame of the object \[m\].
    pub(crate) com: Vector3<f64>,
    /// Principal axes, `object_from_principal`.
    pub(crate) axes: UnitQuaternion<f64>,
    /// Principal moments of inertia about the center of mass \[kg m²\].
    pub(crate) moments: Vector3<f64>,
}

impl MassProperties {
    /// Computes the mass properties of a configuration whose numbers are finite: `mass`, `center_of_mass` and `inertia`
    /// of the configuration, else those of the shape or `mesh`.
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
        // Shapes without a mesh have a volume, a center and moments.
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
