//! Visuals of URDF files: what is drawn in place of their proxy geoms.

use super::Part;
use crate::description::{Geometry, Visual};
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::mjcf::robot::MeshKey;
use scene::mesh::{MeshMaterial, TextureSource};
use scene::shape::{Box as Cuboid, Capsule, Cylinder, Mesh, Sphere};
use scene::{Material, RenderMesh, Texture, TextureKind};
use std::collections::{BTreeMap, HashMap};
use std::path::Path;
use std::sync::Arc;

/// What is drawn in place of a geom.
pub(crate) type Replacements = HashMap<usize, Vec<Part>>;

/// Visual meshes and textures that were read: adding a robot reads only what is new.
#[derive(Clone, Debug, Default)]
pub(crate) struct VisualCache {
    meshes: BTreeMap<MeshKey, Arc<[Part]>>,
    textures: HashMap<TextureSourceKey, Option<Arc<Texture>>>,
    diagnostics: Vec<Diagnostic>,
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum TextureSourceKey {
    File(std::path::PathBuf),
    Embedded(Vec<u8>),
}

impl VisualCache {
    /// What could not be read since the last call.
    pub(crate) fn take_diagnostics(&mut self) -> Vec<Diagnostic> {
        std::mem::take(&mut self.diagnostics)
    }

    /// What is drawn for a visual.
    pub(crate) fn parts(&mut self, link: &str, visual: &Visual) -> Vec<Part> {
        let own = visual.material.as_ref().map(|m| {
            let texture =
                m.texture.as_ref().and_then(|path| self.texture(&TextureSource::File(path.clone()), link, visual));
            let rgba = m.rgba.map(|c| c.map(|x| x as f32));
            (rgba, texture)
        });
        let plain = || {
            let (rgba, texture) = own.clone().unwrap_or_default();
            let base = Material::default();
            Material { rgba: rgba.unwrap_or(base.rgba), texture, ..base }
        };
        let one = |shape: scene::Shape| vec![Part { shape, material: plain() }];
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
                    let parts: Arc<[Part]> = self.load(link, visual, path, (*scale).into()).into();
                    self.meshes.insert(key, Arc::clone(&parts));
                    parts
                });
                let mut parts = parts.to_vec();
                // A material of the URDF goes over those of the mesh file, as in exports.
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

    /// The parts of a mesh file, one for each material.
    fn load(&mut self, link: &str, visual: &Visual, path: &Path, scale: [f64; 3]) -> Vec<Part> {
        let mesh = match scene::mesh::load(path) {
            Ok(mesh) => mesh.scaled(scale),
            Err(error) => {
                self.diagnostics.push(Diagnostic::new(
                    DiagnosticKind::VisualMeshInvalid,
                    visual.source.clone(),
                    format!("link {link:?}: the visual mesh is not drawn: {error}"),
                ));
                return Vec::new();
            }
        };
        let whole = mesh.parts.len() == 1;
        let parts = mesh.parts.clone();
        parts
            .iter()
            .map(|part| {
                let material = part.material.and_then(|m| mesh.materials.get(m));
                let triangles = if whole {
                    RenderMesh::new(&mesh, RenderMesh::CREASE)
                } else {
                    RenderMesh::of_part(&mesh, part, RenderMesh::CREASE)
                };
                Part {
                    shape: Mesh { mesh: Arc::new(triangles) }.into(),
                    material: self.material(material, link, visual),
                }
            })
            .collect()
    }

    fn material(&mut self, material: Option<&MeshMaterial>, link: &str, visual: &Visual) -> Material {
        let Some(material) = material else { return Material::default() };
        let texture = material.texture.as_ref().and_then(|source| self.texture(source, link, visual));
        Material { rgba: material.rgba, texture, ..Material::default() }
    }

    fn texture(&mut self, source: &TextureSource, link: &str, visual: &Visual) -> Option<Arc<Texture>> {
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
                visual.source.clone(),
                format!("link {link:?}: a texture is not drawn: {reason}"),
            ));
        });
        let texture = texture.ok().map(Arc::new);
        self.textures.insert(key, texture.clone());
        texture
    }
}

fn read_texture(source: &TextureSource) -> Result<Texture, String> {
    let (bytes, name) = match source {
        TextureSource::File(path) => {
            let bytes = std::fs::read(path).map_err(|e| format!("{}: {e}", path.display()))?;
            (std::borrow::Cow::Owned(bytes), path.display().to_string())
        }
        TextureSource::Embedded(bytes) => (std::borrow::Cow::Borrowed(&bytes[..]), "an image in the mesh file".into()),
    };
    let image = image::load_from_memory(&bytes).map_err(|e| format!("{name}: {e}"))?.into_rgb8();
    Texture::new(TextureKind::TwoD, image.width(), image.height(), 3, image.as_raw())
        .map_err(|e| format!("{name}: {e}"))
}
