//! Shapes of MuJoCo's geoms for rendering.

use crate::{GeomType, VisualModel};
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{Box as Cuboid, Capsule, Cylinder, Ellipsoid, HeightField, Mesh, Plane, Sphere};
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::vector::{cross, sub, try_normalize};
use std::collections::HashMap;
use std::sync::Arc;

/// Shapes of a model's geoms. Meshes and height fields are prepared once.
#[derive(Debug)]
pub struct GeomShapes<M> {
    model: M,
    meshes: HashMap<usize, Arc<RenderMesh>>,
    fields: HashMap<usize, Option<HeightField>>,
    has_model_normals: bool,
}

impl<M: VisualModel> GeomShapes<M> {
    /// Prepares no shape yet.
    pub fn new(model: M) -> Self {
        Self { model, meshes: HashMap::new(), fields: HashMap::new(), has_model_normals: false }
    }

    /// Uses the normals of the model for meshes that have some, as MuJoCo's renderer does.
    #[must_use]
    pub fn with_model_normals(self) -> Self {
        Self { has_model_normals: true, ..self }
    }

    /// Shape of a geom of MuJoCo's type number `kind`, with these sizes \[m\] and the index of its mesh or height field.
    ///
    /// # Errors
    /// The reason why it cannot be rendered: a type that [`GeomType`] lacks (such as a signed distance field), a mesh
    /// without triangles, a height field with an elevation that is negative or not finite.
    ///
    /// # Panics
    /// There is no such mesh or height field, or fewer than three sizes.
    pub fn get(&mut self, kind: i32, size: &[f64], data: i32) -> Result<Shape, &'static str> {
        let data = usize::try_from(data).ok();
        Ok(match GeomType::from_id(kind) {
            Some(GeomType::Plane) => Plane { half: [(size[0] as f32).max(0.0), (size[1] as f32).max(0.0)] }.into(),
            Some(GeomType::Mesh) => {
                Mesh { mesh: data.and_then(|data| self.mesh(data)).ok_or("its mesh has no triangles")? }.into()
            }
            Some(GeomType::HeightField) => {
                data.and_then(|data| self.height_field(data)).ok_or("its height field cannot be rendered")?.into()
            }
            _ => return shape_from_size(kind, size).ok_or("cameras do not render signed distance fields"),
        })
    }

    fn mesh(&mut self, mesh: usize) -> Option<Arc<RenderMesh>> {
        let (model, normals) = (&self.model, self.has_model_normals);
        let mesh = self.meshes.entry(mesh).or_insert_with(|| Arc::new(render_mesh(model, mesh, normals)));
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
///
/// # Panics
/// There are fewer than three sizes.
pub fn shape_from_size(kind: i32, size: &[f64]) -> Option<Shape> {
    let [x, y, z] = [0, 1, 2].map(|k| size[k] as f32);
    Some(match GeomType::from_id(kind)? {
        GeomType::Sphere => Sphere { radius: x }.into(),
        GeomType::Capsule => Capsule { radius: x, half_length: y }.into(),
        GeomType::Ellipsoid => Ellipsoid { radii: [x, y, z] }.into(),
        GeomType::Cylinder => Cylinder { radius: x, half_length: y }.into(),
        GeomType::Box => Cuboid { half: [x, y, z] }.into(),
        GeomType::Plane | GeomType::HeightField | GeomType::Mesh => return None,
    })
}

/// Cosine between the normals of a vertex and a triangle below which the triangle is flat. Source: MuJoCo's classic
/// renderer.
const CREASE: f32 = 0.8;

/// Unit normal of a triangle; up for one without area.
fn face_normal(positions: &[[f32; 3]], corners: [i32; 3]) -> [f32; 3] {
    let [a, b, c] = corners.map(|i| positions.get(i as usize).copied().unwrap_or_default());
    try_normalize(cross(sub(b, a), sub(c, a)), 0.0).unwrap_or([0.0, 0.0, 1.0])
}

/// Triangles with a vertex for each combination of position and texture coordinates. Normals are recomputed, smooth up
/// to a crease: MuJoCo 2.2.2 smooths over every edge, which makes machined parts look inflated. With `has_normals`,
/// they are those of the model, if it has some for each triangle; meshes without texture coordinates then are flat
/// beyond a crease.
fn render_mesh(model: &impl VisualModel, mesh: usize, has_normals: bool) -> RenderMesh {
    let arrays = model.mesh(mesh);
    let has_normals = has_normals && arrays.face_normals.len() == arrays.faces.len() && !arrays.normals.is_empty();
    let mut vertices: HashMap<[i32; 3], u32> = HashMap::new();
    let mut out = TriMesh {
        uvs: arrays.texcoords.map(|_| Vec::new()),
        normals: has_normals.then(Vec::new),
        ..TriMesh::default()
    };
    for (face, corners) in arrays.faces.iter().enumerate() {
        let texture_corners = arrays.face_texcoords.get(face);
        let flat = face_normal(arrays.positions, *corners);
        let triangle = [0, 1, 2].map(|k| {
            let (position, texcoord) = (corners[k], texture_corners.map_or(-1, |t| t[k]));
            let texcoord = if out.uvs.is_some() { texcoord } else { -1 };
            let index = if has_normals { arrays.face_normals[face][k] } else { -1 };
            let normal = arrays.normals.get(index as usize).copied().unwrap_or(flat);
            // In MuJoCo's renderer, triangles without texture coordinates are flat beyond a crease.
            let is_crease = arrays.texcoords.is_none() && (0..3).map(|i| normal[i] * flat[i]).sum::<f32>() < CREASE;
            let (normal, key) = if is_crease { (flat, -2 - face as i32) } else { (normal, index) };
            let key = if has_normals { key } else { -1 };
            *vertices.entry([position, texcoord, key]).or_insert_with(|| {
                out.positions.push(arrays.positions.get(position as usize).copied().unwrap_or_default());
                if let Some(normals) = &mut out.normals {
                    normals.push(normal);
                }
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
    (mesh.uvs, mesh.normals) = (out.uvs, out.normals);
    RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE)
}
