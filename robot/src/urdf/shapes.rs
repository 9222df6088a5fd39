//! Visual and collision shapes of a file, with meshes, textures and materials resolved.

use super::config::UrdfCfg;
use super::error::UrdfError;
use super::file::{UrdfFile, VisualMetadata};
use super::merge::pose_of;
use super::resolve::{Resolved, Resolver};
use crate::description::{Collision, Geometry, Material, Visual};
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::path::PathBuf;

/// Converter of the shapes of one file to those of the description.
#[derive(Debug)]
pub(super) struct ShapeConverter<'f> {
    resolver: Resolver<'f>,
    /// Materials of this file. A name never refers to a material of another component.
    materials: HashMap<&'f str, &'f urdf_rs::Material>,
    /// True after the first warning about `package:///`; the file gets only one.
    warned_about_empty_package: bool,
}

/// True for a URI whose package is empty (`package:///part.stl`), or that is a file alone (`package://part.stl`).
fn has_no_package(uri: &str) -> bool {
    uri.split_once("://").is_some_and(|(_, rest)| rest.starts_with('/') || !rest.contains('/'))
}

impl<'f> ShapeConverter<'f> {
    pub(super) fn new(file: &'f UrdfFile, cfg: &'f UrdfCfg) -> Self {
        let mut materials = HashMap::new();
        for material in &file.robot.materials {
            materials.entry(material.name.as_str()).or_insert(material);
        }
        let resolver = Resolver::new(&file.path, &cfg.packages, file.meshdir.as_deref())
            .with_asset_root(cfg.asset_root.as_deref())
            .with_strictness(cfg.strictness);
        Self { resolver, materials, warned_about_empty_package: false }
    }

    /// Resolves a URI, with a warning about the first `package:///` of the file.
    fn resolve(&mut self, uri: &str, at: &SourceLocation, diagnostics: &mut Vec<Diagnostic>) -> Resolved {
        let resolved = self.resolver.resolve(uri);
        if let Resolved::Found(path) = &resolved
            && ["package:", "model:"].iter().any(|start| uri.trim().to_ascii_lowercase().starts_with(start))
            && has_no_package(uri.trim())
            && !std::mem::replace(&mut self.warned_about_empty_package, true)
        {
            let message = format!(
                "\"{uri}\" has no package and was resolved to {}; write package://name_of_package/.. or file:///path \
                 (further such URIs of this file are resolved in the same way)",
                path.display()
            );
            diagnostics.push(Diagnostic::new(DiagnosticKind::AddressRepaired, at.clone(), message));
        }
        resolved
    }

    /// Converts a visual. A missing mesh is reported and keeps its most likely path.
    pub(super) fn visual(
        &mut self,
        model: &urdf_rs::Visual,
        notes: &VisualMetadata,
        link: &str,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Visual, UrdfError> {
        let geometry = match &model.geometry {
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let path = match self.resolve(filename, &notes.source, diagnostics) {
                    Resolved::Found(path) => path,
                    Resolved::Empty => {
                        return Err(UrdfError::MeshUnnamed { at: notes.source.clone(), link: link.to_owned() });
                    }
                    missing => {
                        let (guess, why) = describe(missing, filename);
                        let message =
                            format!("link \"{link}\": visual mesh \"{filename}\" {why}; the visual is left out");
                        let source = notes.source.clone();
                        diagnostics.push(Diagnostic::new(DiagnosticKind::VisualMeshMissing, source, message));
                        guess
                    }
                };
                mesh(filename, path, *scale)
            }
            primitive => shape(primitive),
        };
        let material = match (&model.material, &notes.material) {
            (Some(model), Some(source)) => Some(self.material(model, source, link, diagnostics)),
            _ => None,
        };
        Ok(Visual { source: notes.source.clone(), link_from_shape: pose_of(&model.origin), geometry, material })
    }

    /// Converts a collision. A missing mesh is an error, because the robot would fall through other bodies without it.
    pub(super) fn collision(
        &mut self,
        model: &urdf_rs::Collision,
        source: &SourceLocation,
        link: &str,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Collision, UrdfError> {
        let geometry = match &model.geometry {
            urdf_rs::Geometry::Mesh { filename, scale } => {
                let (at, link, uri) = (source.clone(), link.to_owned(), filename.clone());
                let path = match self.resolve(filename, source, diagnostics) {
                    Resolved::Found(path) => path,
                    Resolved::Empty => return Err(UrdfError::MeshUnnamed { at, link }),
                    Resolved::Missing { tried, hint, .. } => {
                        return Err(UrdfError::MeshMissing { at, link, uri, tried, hint });
                    }
                    Resolved::PackageUnknown { package, tried, .. } => {
                        return Err(UrdfError::PackageUnknown { at, link, uri, package, tried });
                    }
                    Resolved::Unsupported { problem } => {
                        return Err(UrdfError::UriUnsupported { at, link, uri, problem });
                    }
                };
                mesh(filename, path, *scale)
            }
            primitive => shape(primitive),
        };
        Ok(Collision { source: source.clone(), link_from_shape: pose_of(&model.origin), geometry })
    }

    /// Material of a visual: its own values or, without own values, those of the material it names.
    fn material(
        &mut self,
        model: &urdf_rs::Material,
        source: &SourceLocation,
        link: &str,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Material {
        let has_look = model.color.is_some() || model.texture.is_some();
        let named = self.materials.get(model.name.as_str()).copied().filter(|_| !has_look);
        let look = named.unwrap_or(model);
        let mut texture = None;
        if let Some(urdf_rs::Texture { filename }) = &look.texture {
            match self.resolve(filename, source, diagnostics) {
                Resolved::Found(path) => texture = Some(path),
                missing => {
                    let (_, why) = describe(missing, filename);
                    let message = format!("link \"{link}\": texture \"{filename}\" {why}; the color is used instead");
                    diagnostics.push(Diagnostic::new(DiagnosticKind::TextureMissing, source.clone(), message));
                }
            }
        }
        Material {
            name: Some(model.name.clone()).filter(|n| !n.is_empty()),
            rgba: look.color.as_ref().map(|c| c.rgba.0),
            texture,
        }
    }
}

/// Returns the most likely path of a URI, and the end of a sentence about the problem, for example
/// `does not exist; searched a, b`.
fn describe(resolved: Resolved, uri: &str) -> (PathBuf, String) {
    match resolved {
        Resolved::Found(path) => (path, "exists".to_owned()),
        Resolved::Missing { most_likely, tried, hint } => {
            let hint = hint.map(|h| format!(" ({h})")).unwrap_or_default();
            (most_likely, format!("does not exist{hint}; searched {}", format_first(&tried)))
        }
        Resolved::PackageUnknown { package, guess, tried } => {
            (guess, format!("is in package \"{package}\", which was not found; searched {}", format_first(&tried)))
        }
        Resolved::Empty => (PathBuf::new(), "is empty".to_owned()),
        Resolved::Unsupported { problem } => (PathBuf::from(uri), format!("cannot be read: {problem}")),
    }
}

/// Lists the first paths only: a warning need not be complete.
fn format_first(tried: &[String]) -> String {
    let first = tried.iter().take(3).map(String::as_str).collect::<Vec<_>>().join(", ");
    if tried.len() > 3 { format!("{first} and {} more", tried.len() - 3) } else { first }
}

fn mesh(uri: &str, path: PathBuf, scale: Option<urdf_rs::Vec3>) -> Geometry {
    let scale = scale.map_or(Vector3::repeat(1.0), |s| Vector3::from(s.0));
    Geometry::Mesh { uri: uri.to_owned(), path, scale }
}

fn shape(model: &urdf_rs::Geometry) -> Geometry {
    match *model {
        urdf_rs::Geometry::Box { size } => Geometry::Box { size: Vector3::from(size.0) },
        urdf_rs::Geometry::Cylinder { radius, length } => Geometry::Cylinder { radius, length },
        urdf_rs::Geometry::Capsule { radius, length } => Geometry::Capsule { radius, length },
        urdf_rs::Geometry::Sphere { radius } => Geometry::Sphere { radius },
        urdf_rs::Geometry::Mesh { ref filename, scale } => mesh(filename, PathBuf::new(), scale),
    }
}
