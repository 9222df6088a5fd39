//! Shapes of MuJoCo's geoms for rendering.

use super::identity::ElementIdentity;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::Model;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::pose::from_row;
use kinetoscope_scene::shape::{Box as Cuboid, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Instance, Material};
use std::collections::HashMap;
use std::sync::Arc;

/// Shapes of a model's geoms. Meshes and height fields are prepared once.
pub(super) struct GeomShapes<'a> {
    model: &'a Model,
    meshes: HashMap<usize, Arc<RenderMesh>>,
    fields: HashMap<usize, Option<HeightField>>,
}

impl<'a> GeomShapes<'a> {
    pub(super) fn of(model: &'a Model) -> Self {
        Self { model, meshes: HashMap::new(), fields: HashMap::new() }
    }

    /// Shape of a geom.
    ///
    /// # Errors
    /// The reason why it cannot be rendered: a signed distance field, a mesh without triangles, a height field with an
    /// elevation that is negative or not finite.
    pub(super) fn get(&mut self, geom: usize) -> Result<Shape, &'static str> {
        let size = &self.model.geom_size()[3 * geom..3 * geom + 3];
        let data = usize::try_from(self.model.geom_dataid()[geom]).ok();
        Ok(match self.model.geom_type()[geom] as u32 {
            mj::mjGEOM_PLANE => Plane { half: [(size[0] as f32).max(0.0), (size[1] as f32).max(0.0)] }.into(),
            mj::mjGEOM_MESH => {
                Mesh { mesh: data.and_then(|data| self.mesh(data)).ok_or("its mesh has no triangles")? }.into()
            }
            mj::mjGEOM_HFIELD => {
                data.and_then(|data| self.height_field(data)).ok_or("its height field cannot be rendered")?.into()
            }
            kind => return shape_from_size(kind, size).ok_or("cameras do not render signed distance fields"),
        })
    }

    fn mesh(&mut self, mesh: usize) -> Option<Arc<RenderMesh>> {
        let model = self.model;
        let mesh = self.meshes.entry(mesh).or_insert_with(|| Arc::new(render_mesh(model, mesh)));
        (!mesh.triangles().is_empty()).then(|| Arc::clone(mesh))
    }

    fn height_field(&mut self, field: usize) -> Option<HeightField> {
        if !self.fields.contains_key(&field) {
            let arrays = self.model.height_field(field);
            // Several assets may use one file.
            let is_same = |known: &&HeightField| {
                let size = (known.size(), known.rows(), known.columns());
                size == (arrays.size, arrays.rows, arrays.columns) && **known.elevation() == *arrays.elevation
            };
            let known = self.fields.values().flatten().find(is_same).cloned();
            let new = || HeightField::new(arrays.size, arrays.rows, arrays.columns, arrays.elevation);
            self.fields.insert(field, known.or_else(new));
        }
        self.fields.get(&field)?.clone()
    }
}

/// Shape of a geom type that its sizes \[m\] define; `None` for other types.
pub(super) fn shape_from_size(kind: u32, size: &[f64]) -> Option<Shape> {
    let [x, y, z] = [0, 1, 2].map(|k| size[k] as f32);
    Some(match kind {
        mj::mjGEOM_SPHERE => Sphere { radius: x }.into(),
        mj::mjGEOM_CAPSULE => Capsule { radius: x, half_length: y }.into(),
        mj::mjGEOM_ELLIPSOID => Ellipsoid { radii: [x, y, z] }.into(),
        mj::mjGEOM_CYLINDER => Cylinder { radius: x, half_length: y }.into(),
        mj::mjGEOM_BOX => Cuboid { half: [x, y, z] }.into(),
        _ => return None,
    })
}

/// Instance of a site; `None` for a type of shape that sites do not have.
pub(super) fn of_site(model: &Model, site: usize, identity: &ElementIdentity, material: Material) -> Option<Instance> {
    let shape = shape_from_size(model.site_type()[site] as u32, &model.site_size()[3 * site..3 * site + 3])?;
    let body = model.site_bodyid()[site] as usize;
    let [x, y, z] = [0, 1, 2].map(|k| model.site_pos()[3 * site + k]);
    let [qw, qx, qy, qz] = [0, 1, 2, 3].map(|k| model.site_quat()[4 * site + k]);
    let frame_from_instance =
        if body > 0 { from_row(&[x, y, z, qw, qx, qy, qz]) } else { kinetoscope_scene::Pose::identity() };
    let ElementIdentity { mask_id, name, body: of } = identity.clone();
    Some(Instance {
        shape,
        material,
        mask_id,
        group: u8::try_from(model.site_group()[site].clamp(0, 31)).unwrap_or(0),
        visible: true,
        name,
        body: of,
        fixed: model.is_fixed(body),
        is_deformable: false,
        frame_from_instance,
    })
}

/// Triangles with a vertex for each combination of position and texture coordinates. Normals are recomputed, smooth up
/// to a crease: MuJoCo 2.2.2 smooths over every edge, which makes machined parts look inflated.
fn render_mesh(model: &Model, mesh: usize) -> RenderMesh {
    let arrays = model.mesh(mesh);
    let mut vertices: HashMap<(i32, i32), u32> = HashMap::new();
    let mut out = TriMesh { uvs: arrays.texcoords.map(|_| Vec::new()), ..TriMesh::default() };
    for (face, corners) in arrays.faces.iter().enumerate() {
        let texture_corners = arrays.face_texcoords.get(face);
        let triangle = [0, 1, 2].map(|k| {
            let (position, texcoord) = (corners[k], texture_corners.map_or(-1, |t| t[k]));
            let texcoord = if out.uvs.is_some() { texcoord } else { -1 };
            *vertices.entry((position, texcoord)).or_insert_with(|| {
                out.positions.push(arrays.positions.get(position as usize).copied().unwrap_or_default());
                if let (Some(uvs), Some(all)) = (&mut out.uvs, arrays.texcoords) {
                    let [u, v] = all.get(texcoord as usize).copied().unwrap_or_default();
                    // MuJoCo's v axis points down the image.
                    uvs.push([u, 1.0 - v]);
                }
                out.positions.len() as u32 - 1
            })
        });
        out.triangles.push(triangle);
    }
    let mut mesh = TriMesh::from_triangles(out.positions, out.triangles);
    mesh.uvs = out.uvs;
    RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)
}
