//! Meshes of rigid objects: collision shapes, visual mesh and mass properties.

use super::rigid_object_data::RigidObjectCfg;
use super::shape::{ObjectShape, cone};
use crate::error::{Error, Result};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_robot::inertia::RigidInertia;
use kinetoscope_scene::mesh::{HullCache, TriMesh, VolumeIntegrals};
use nalgebra::Matrix3;
use std::sync::Arc;

/// Meshes of an object.
#[derive(Clone, Debug)]
pub(crate) struct ObjectMesh {
    /// Convex collision shapes.
    pub(crate) collision: Vec<Arc<TriMesh>>,
    /// Visual mesh: the triangles of a file; `None` for a cone, whose collision shape is visible.
    pub(crate) visual: Option<Arc<TriMesh>>,
    /// Mass properties for a density of 1 kg/m³; `None` for a cone, whose shape gives them.
    pub(crate) inertia: Option<RigidInertia>,
}

impl ObjectMesh {
    /// Creates the meshes of a cone or mesh file; `None` for a primitive shape of MuJoCo.
    pub(crate) fn of(cfg: &RigidObjectCfg, diagnostics: &mut Vec<Diagnostic>) -> Result<Option<Self>> {
        cfg.mesh_collision.check(cfg)?;
        let (uid, collision) = (&cfg.uid, &cfg.mesh_collision);
        let (path, scale, cfg) = match &cfg.shape {
            ObjectShape::Cone { radius, height } => {
                let shapes = vec![Arc::new(cone(*radius, *height))];
                return Ok(Some(Self { collision: shapes, visual: None, inertia: None }));
            }
            ObjectShape::Mesh { path, scale, hull } => (path, *scale, hull),
            _ => return Ok(None),
        };
        let failed = |error| Error::ObjectMesh { object: uid.clone(), error: Box::new(error) };
        let seen = kinetoscope_scene::mesh::load(path).map_err(failed)?.scaled(scale);
        let hull = HullCache::default_location().hull_of_file(path, scale, cfg).map_err(failed)?;
        let shapes = collision.shapes(uid, path, &seen, scale, cfg, diagnostics)?;
        let solid = match seen.volume_integrals() {
            Some(solid) => Some(solid),
            None => {
                diagnostics.push(Diagnostic::new(
                    DiagnosticKind::OpenMesh,
                    None,
                    format!(
                        "object {uid:?}: {}: the surface is open, encloses no volume, or is partly inside out; mass, \
                         center of mass and inertia are computed from its convex hull",
                        path.display()
                    ),
                ));
                hull.volume_integrals()
            }
        };
        // Hulls are closed and have a volume: flat ones were made thicker.
        let inertia = Some(solid.map_or(RigidInertia::ZERO, |solid| inertia(&solid)));
        Ok(Some(Self { collision: shapes, visual: Some(Arc::new(seen)), inertia }))
    }
}

/// Mass properties of a solid of 1 kg/m³: `I = tr(Σ) 1 - Σ`.
fn inertia(solid: &VolumeIntegrals) -> RigidInertia {
    let tensor = Matrix3::identity() * solid.second_moment.trace() - solid.second_moment;
    RigidInertia { mass: solid.volume, com: solid.center, inertia: tensor }
}
