//! Visuals of URDF files and of mesh objects, which are rendered in place of their proxy geoms.

use super::VisualPart;
use crate::objects::rigid_object_data::RigidObjectData;
use crate::objects::robot_data::RobotData;
use kinetoscope_robot::description::{Geometry, Visual};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_robot::mesh_key::MeshKey;
use kinetoscope_scene::mesh::{MeshMaterial, TextureSource, TriMesh};
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::shape::{Box as Cuboid, Capsule, Cylinder, Mesh, Sphere};
use kinetoscope_scene::source_location::SourceLocation;
use kinetoscope_scene::{Material, Texture, TextureKind};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// Parts that are rendered in place of geoms, by geom.
pub(crate) type Replacements = HashMap<usize, Vec<VisualPart>>;

/// Cache of visual meshes and textures: adding a robot reads only new files.
#[derive(Clone, Debug, Default)]
pub(crate) struct VisualCache {
    meshes: BTreeMap<MeshKey, Arc<[MeshPart]>>,
    textures: HashMap<TextureSourceKey, Option<Arc<Texture>>>,
    diagnostics: Vec<Diagnostic>,
}

/// Part of a mesh file, and its material if the file has one.
#[derive(Clone, Debug)]
struct MeshPart {
    shape: kinetoscope_scene::shape::Shape,
    material: Option<Material>,
}

/// Owner of a visual in diagnostics.
struct VisualOwner {
    name: String,
    source: Option<SourceLocation>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum TextureSourceKey {
    File(std::path::PathBuf),
    Embedded(Vec<u8>),
}

impl VisualCache {
    /// Takes the diagnostics since the last call.
    pub(crate) fn take_diagnostics(&mut self) -> Vec<Diagnostic> {
        std::mem::take(&mut self.diagnostics)
    }

    /// Reports that an environment is rendered with nominal sizes and colors.
    pub(crate) fn warn_env_scene(&mut self, env: usize, error: &kinetoscope_scene::RenderSceneError) {
        let message = format!(
            "environment {env} is rendered with nominal sizes and colors, because its randomized scene is invalid: \
             {error}"
        );
        self.diagnostics.push(Diagnostic::new(DiagnosticKind::LookInvalid, None, message));
    }

    /// Warns if a robot from URDF files has no visual shape.
    pub(crate) fn check_robot(&mut self, robot: &RobotData) {
        let description = robot.description();
        if robot.file().is_some() || description.links.iter().any(|link| !link.visuals.is_empty()) {
            return;
        }
        let message = format!(
            "robot {:?} has no <visual> that can be rendered, so images do not show it; give its links visuals, or \
             write their <collision> shapes as <visual> too",
            description.name
        );
        let source = description.link(description.root).source.clone();
        self.diagnostics.push(Diagnostic::new(DiagnosticKind::NothingToDraw, source, message));
    }

    /// Parts that are rendered for a visual; empty for a mesh file that is missing or unreadable.
    pub(crate) fn parts(&mut self, link: &str, visual: &Visual) -> Vec<VisualPart> {
        let of = VisualOwner { name: format!("link {link:?}"), source: Some(visual.source.clone()) };
        let own = visual.material.as_ref().map(|m| {
            let texture = m.texture.as_ref().and_then(|path| self.texture(&TextureSource::File(path.clone()), &of));
            let rgba = m.rgba.map(|c| c.map(|x| x as f32));
            (rgba, texture)
        });
        let plain = || {
            let (rgba, texture) = own.clone().unwrap_or_default();
            let base = Material::default();
            Material { rgba: rgba.unwrap_or(base.rgba), texture, ..base }
        };
        let one = |shape: kinetoscope_scene::shape::Shape| vec![VisualPart { shape, material: plain() }];
        match &visual.geometry {
            Geometry::Box { size } => one(Cuboid { half: [0, 1, 2].map(|i| (size[i] / 2.0) as f32) }.into()),
            Geometry::Cylinder { radius, length } => {
                one(Cylinder { radius: *radius as f32, half_length: (length / 2.0) as f32 }.into())
            }
            Geometry::Capsule { radius, length } => {
                one(Capsule { radius: *radius as f32, half_length: (length / 2.0) as f32 }.into())
            }
            Geometry::Sphere { radius } => one(Sphere { radius: *radius as f32 }.into()),
            Geometry::Mesh { path, scale, .. } => {
                let key = MeshKey::new(path, scale);
                let known = self.meshes.get(&key).cloned();
                let parts = known.unwrap_or_else(|| {
                    let parts: Arc<[MeshPart]> = self.load(&of, path, (*scale).into()).into();
                    self.meshes.insert(key, Arc::clone(&parts));
                    parts
                });
                let mut parts = with_default_material(&parts, &Material::default());
                // A material of the URDF overrides those of the mesh file, as in exports.
                if let Some((rgba, texture)) = own {
                    for part in &mut parts {
                        if let Some(rgba) = rgba {
                            part.material = Material { rgba, ..Material::default() };
                        }
                        if texture.is_some() {
                            part.material.texture.clone_from(&texture);
                        }
                    }
                }
                parts
            }
        }
    }

    /// Parts that are rendered for an object from a mesh file; empty for other objects.
    pub(crate) fn object_parts(&mut self, object: &RigidObjectData) -> Vec<VisualPart> {
        let of = VisualOwner { name: format!("object {:?}", object.uid()), source: None };
        let Some((key, mesh)) = object.mesh_key().zip(object.mesh().and_then(|mesh| mesh.visual.as_ref())) else {
            return Vec::new();
        };
        let known = self.meshes.get(&key).cloned();
        let parts = known.unwrap_or_else(|| {
            let parts: Arc<[MeshPart]> = self.mesh_parts(&of, mesh).into();
            self.meshes.insert(key, Arc::clone(&parts));
            parts
        });
        with_default_material(&parts, &Material::from_rgba(object.cfg().rgba.map(|c| c as f32)))
    }

    /// Reads a mesh file, scaled, as one part per material. An unreadable mesh gives no parts and a diagnostic. A
    /// missing file gives no parts; the URDF reader has already reported it.
    fn load(&mut self, of: &VisualOwner, path: &Path, scale: [f64; 3]) -> Vec<MeshPart> {
        match kinetoscope_scene::mesh::load(path) {
            Ok(mesh) => self.mesh_parts(of, &mesh.scaled(scale)),
            // The reader of the robot already warned about a missing file.
            Err(_) if !path.exists() => Vec::new(),
            Err(error) => {
                self.diagnostics.push(Diagnostic::new(
                    DiagnosticKind::VisualMeshInvalid,
                    of.source.clone(),
                    format!("{}: the visual mesh is not rendered: {error}", of.name),
                ));
                Vec::new()
            }
        }
    }

    fn mesh_parts(&mut self, of: &VisualOwner, mesh: &TriMesh) -> Vec<MeshPart> {
        let whole = mesh.submeshes.len() == 1;
        let part = |part: &kinetoscope_scene::mesh::Submesh| {
            let material = part.material.and_then(|m| mesh.materials.get(m));
            let triangles = if whole {
                RenderMesh::new(mesh, RenderMesh::DEFAULT_CREASE_ANGLE)
            } else {
                RenderMesh::from_submesh(mesh, part, RenderMesh::DEFAULT_CREASE_ANGLE)
            };
            let material = material.map(|material| self.material(material, of));
            MeshPart { shape: Mesh { mesh: Arc::new(triangles) }.into(), material }
        };
        mesh.submeshes.iter().map(part).collect()
    }

    fn material(&mut self, material: &MeshMaterial, of: &VisualOwner) -> Material {
        let texture = material.texture.as_ref().and_then(|source| self.texture(source, of));
        Material { rgba: material.rgba, texture, ..Material::default() }
    }

    fn texture(&mut self, source: &TextureSource, of: &VisualOwner) -> Option<Arc<Texture>> {
        let key = match source {
            TextureSource::File(path) => TextureSourceKey::File(path.clone()),
            TextureSource::Embedded(bytes) => TextureSourceKey::Embedded(bytes.clone()),
        };
        if let Some(known) = self.textures.get(&key) {
            return known.clone();
        }
        let texture = read_texture(source).map_err(|reason| {
            self.diagnostics.push(Diagnostic::new(
                DiagnosticKind::TextureMissing,
                of.source.clone(),
                format!("{}: a texture is not rendered: {reason}", of.name),
            ));
        });
        let texture = texture.ok().map(Arc::new);
        self.textures.insert(key, texture.clone());
        texture
    }
}

/// Parts with their own materials, or with `otherwise`.
fn with_default_material(parts: &[MeshPart], otherwise: &Material) -> Vec<VisualPart> {
    let material = |part: &MeshPart| part.material.clone().unwrap_or_else(|| otherwise.clone());
    parts.iter().map(|part| VisualPart { shape: part.shape.clone(), material: material(part) }).collect()
}

fn read_texture(source: &TextureSource) -> Result<Texture, String> {
    let image = source.decode()?;
    Texture::new(TextureKind::TwoD, image.width(), image.height(), 3, image.as_raw()).map_err(|e| match source {
        TextureSource::File(path) => format!("{}: {e}", path.display()),
        TextureSource::Embedded(_) => format!("an image in the mesh file: {e}"),
    })
}
