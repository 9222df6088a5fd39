//! Collision shapes of objects from mesh files.

use crate::error::{Error, Result};
use crate::objects::rigid_object_data::{BodyType, RigidObjectCfg};
use crate::objects::shape::ObjectShape;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::mesh::{ConvexDecompositionCfg, HullCache, HullCfg, MeshError, TriMesh, prisms};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::Arc;

/// Collision geometry of an object from a mesh file.
///
/// MuJoCo computes contacts between convex shapes only: a mesh that is not convex collides as one, several, or very
/// many convex shapes. Mass and moments do not depend on this choice.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum MeshCollision {
    /// Convex hull of the mesh: other bodies cannot enter its hollows.
    #[default]
    Hull,
    /// Convex pieces that together rise above the surface by at most a tolerance. Each piece is a hull, computed as for
    /// [`ObjectShape::Mesh`], and cached on disk with the hulls. A diagnostic reports that the pieces are too few for
    /// the tolerance. Each piece costs time while another body is near the object. The pieces of a closed mesh contain
    /// everything that the mesh encloses. The pieces of an open mesh, which a diagnostic names, contain its surface.
    Pieces(ConvexDecompositionCfg),
    /// Every triangle exactly as in the file, as the front of a prism. Only static and kinematic objects of up to 2000
    /// triangles support it. If the mesh is thinner than `thickness`, prisms protrude behind it. A body that penetrates
    /// the front by more than `thickness` falls through. Bodies rest at the correct position. Bodies that slide over
    /// edges between triangles are braked, because MuJoCo does not treat the triangles as one surface: a ball of 5 cm
    /// radius that slides along a smooth valley at 0.5 m/s, over an edge every 5 cm on both sides, still has more than
    /// 0.3 m/s after 0.6 m. Triangles too thin for MuJoCo are omitted, with a diagnostic.
    Triangles {
        /// Thickness of the prisms \[m\], 1e-5 to 1e3.
        thickness: f64,
    },
}

impl MeshCollision {
    /// Maximum number of triangles for [`Triangles`](Self::Triangles), not counting those that are too thin. Each
    /// triangle is a MuJoCo geom.
    pub const MAX_TRIANGLES: usize = 2000;

    /// Checks the numbers, and that the object supports this collision geometry.
    pub(crate) fn check(&self, cfg: &RigidObjectCfg) -> Result<()> {
        let fail = |expected| Err(Error::Config { field: "mesh_collision", value: format!("{self:?}"), expected });
        match self {
            Self::Hull => Ok(()),
            _ if !matches!(cfg.shape, ObjectShape::Mesh { .. }) => {
                fail("only an ObjectShape::Mesh supports pieces or triangles; use MeshCollision::Hull for other shapes")
            }
            Self::Pieces(ConvexDecompositionCfg { max_pieces, tolerance }) => {
                let good = (1..=1024).contains(max_pieces) && *tolerance > 0.0 && tolerance.is_finite();
                if good { Ok(()) } else { fail("max_pieces must be 1 to 1024, the tolerance a length above 0 m") }
            }
            Self::Triangles { .. } if cfg.body_type == BodyType::Dynamic => fail(
                "MeshCollision::Triangles requires BodyType::Static or Kinematic; use MeshCollision::Pieces for a \
                 dynamic body",
            ),
            Self::Triangles { thickness } if !(thickness.is_finite() && (1e-5..=1e3).contains(thickness)) => {
                fail("the thickness must be 1e-5 to 1e3 m")
            }
            Self::Triangles { .. } => Ok(()),
        }
    }

    /// Returns the convex collision shapes of the mesh file `path`. `mesh` is the same file, already scaled by `scale`.
    pub(super) fn shapes(
        &self,
        uid: &str,
        path: &Path,
        mesh: &TriMesh,
        scale: [f64; 3],
        hull: &HullCfg,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Vec<Arc<TriMesh>>> {
        let failed = |error: MeshError| Error::ObjectMesh { object: uid.into(), error: Box::new(error) };
        let cache = HullCache::default_location();
        if *self != Self::Hull && !mesh.is_closed() {
            diagnostics.push(Diagnostic::new(
                DiagnosticKind::OpenMesh,
                None,
                format!(
                    "object {uid:?}: {}: the surface is open, so only its front faces (counter-clockwise triangles) \
                     collide and the volume behind it does not; close the mesh, or use MeshCollision::Hull",
                    path.display()
                ),
            ));
        }
        match self {
            Self::Hull => Ok(vec![Arc::new(cache.hull_of_file(path, scale, hull).map_err(failed)?)]),
            Self::Pieces(cfg) => {
                let pieces = cache.decomposition_of_file(path, scale, hull, cfg).map_err(failed)?;
                if pieces.depth > cfg.tolerance {
                    let (count, depth) = (pieces.hulls.len(), pieces.depth);
                    diagnostics.push(Diagnostic::new(
                        DiagnosticKind::CoarsePieces,
                        None,
                        format!(
                            "object {uid:?}: {}: {count} convex pieces deviate up to {depth:.2e} m from the surface; \
                             the tolerance is {:.2e} m",
                            path.display(),
                            cfg.tolerance
                        ),
                    ));
                }
                Ok(pieces.hulls.into_iter().map(Arc::new).collect())
            }
            Self::Triangles { thickness } => {
                let prisms = prisms(mesh, *thickness)
                    .map_err(|source| failed(MeshError::Hull { path: path.to_owned(), source }))?;
                if prisms.is_empty() || prisms.len() > Self::MAX_TRIANGLES {
                    let value = format!("Triangles for a mesh with {} triangles of nonzero area", prisms.len());
                    let expected = "MeshCollision::Triangles supports 1 to 2000 triangles; use MeshCollision::Pieces, \
                                    a terrain, or a coarser mesh";
                    return Err(Error::Config { field: "mesh_collision", value, expected });
                }
                if prisms.len() < mesh.triangles.len() {
                    let (left_out, path) = (mesh.triangles.len() - prisms.len(), path.display());
                    diagnostics.push(Diagnostic::new(
                        DiagnosticKind::CoarsePieces,
                        None,
                        format!(
                            "object {uid:?}: {path}: {left_out} triangles are too thin for collision and are omitted"
                        ),
                    ));
                }
                Ok(prisms.into_iter().map(Arc::new).collect())
            }
        }
    }
}
