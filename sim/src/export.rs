//! Every stage of the pipeline as files: URDF, description, MJCF for both MuJoCo lines with real meshes.

use crate::compile::{Simulation, document};
use crate::diagnostic::Diagnostic;
use crate::drive::actuator::stable_timestep_of;
use crate::error::{Error, Result};
use crate::manager::SimulationManagerCfg;
use crate::mj::Target;
use crate::mjcf::document::{Integrator, Keyframe, MaterialAsset, MeshAsset, MeshContent, Mjcf, TextureAsset};
use crate::mjcf::robot::{MeshKey, Purpose, VisualAssets};
use crate::mjcf::write;
use crate::objects::robot::RobotData;
use crate::urdf::write_urdf;
use scene::mesh::{MeshMaterial, TextureSource, TriMesh};
use std::collections::{BTreeMap, BTreeSet};
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

/// Writes everything to `dir`, which is made where it is missing.
pub(crate) fn dump(
    cfg: &SimulationManagerCfg,
    robots: &[Arc<RobotData>],
    simulation: &Simulation,
    diagnostics: &[Diagnostic],
    dir: &Path,
) -> Result<()> {
    let meshes = dir.join("meshes");
    std::fs::create_dir_all(&meshes).map_err(at(&meshes))?;
    for robot in robots {
        // One robot is `robot.*`, several go by their names.
        let stem = if robots.len() == 1 { "robot" } else { robot.uid() };
        write_file(&dir.join(format!("{stem}.urdf")), &write_urdf(robot.description()))?;
        write_file(&dir.join(format!("{stem}.description.txt")), &format!("{:#?}\n", robot.description()))?;
        write_file(&dir.join(format!("{stem}.joints.txt")), &format!("{:#?}\n", robot.plans()))?;
    }
    let diagnostics: String = diagnostics.iter().map(|d| format!("{d}\n")).collect();
    write_file(&dir.join("diagnostics.txt"), &diagnostics)?;
    write_file(&dir.join("run.mjcf.xml"), &simulation.xml)?;

    let mut empty = Mjcf::new("kinetoscope", cfg.physics_option());
    let assets = export_meshes(robots, &mut empty, dir)?;
    for (target, file) in [(Target::V2, "robot.mjcf2.xml"), (Target::V4, "robot.mjcf4.xml")] {
        let purpose = Purpose::Export(&assets);
        let (mut mjcf, _, _) = document(cfg, robots, &simulation.excluded, &purpose, empty.clone())?;
        prepare_for_plain_mujoco(&mut mjcf, robots, target, simulation);
        write_file(&dir.join(file), &write::write(&mjcf, target).xml)?;
    }
    Ok(())
}

fn at(path: &Path) -> impl Fn(std::io::Error) -> Error + '_ {
    move |error| Error::File { path: path.to_path_buf(), error }
}

fn write_file(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(at(path))
}

/// What a viewer without our drives needs to know and to have.
fn prepare_for_plain_mujoco(mjcf: &mut Mjcf, robots: &[Arc<RobotData>], target: Target, simulation: &Simulation) {
    let explicit = robots
        .iter()
        .filter_map(|r| stable_timestep_of(r.description(), r.plans(), !r.cfg().fix_base))
        .fold(f64::INFINITY, f64::min);
    mjcf.comments.push("Written by Kinetoscope. Drives are plain MuJoCo actuators here.".into());
    match target {
        // Measured (and so in docs/decisions/0004): on 2.2.2 the implicit integrator treats saturated actuators as
        // damped, which keeps any gains stable; since 3.5 it does not.
        Target::V2 => {
            mjcf.option.integrator = Integrator::Implicit;
            mjcf.comments.push(
                "MuJoCo 2.2.2: stable at every time step with the implicit integrator; saturated drives are sluggish."
                    .into(),
            );
        }
        Target::V4 => {
            mjcf.option.integrator = Integrator::ImplicitFast;
            mjcf.comments.push(if explicit.is_finite() {
                format!(
                    "MuJoCo 4.x: stable up to a time step of {explicit:.3e} s where drives saturate at their force \
                     limits, at every time step while they do not."
                )
            } else {
                "MuJoCo 4.x: stable at every time step.".into()
            });
        }
    }
    let start = &simulation.start;
    let mut qpos = simulation.batch.model().qpos0().to_vec();
    for &(address, position) in &start.qpos {
        qpos[address] = position;
    }
    if !qpos.is_empty() {
        mjcf.keyframes.push(Keyframe { name: "start".into(), qpos });
    }
}

/// Writes every visual mesh once, one file per material, and declares them in `mjcf`.
fn export_meshes(robots: &[Arc<RobotData>], mjcf: &mut Mjcf, dir: &Path) -> Result<VisualAssets> {
    let mut assets = VisualAssets::default();
    let mut textures: BTreeMap<TextureKey, String> = BTreeMap::new();
    let mut names = BTreeSet::new();
    for robot in robots {
        for link in &robot.description().links {
            for visual in &link.visuals {
                let crate::description::Geometry::Mesh { path, scale, .. } = &visual.geometry else { continue };
                let key = MeshKey::new(path, scale);
                if assets.parts.contains_key(&key) {
                    continue;
                }
                // Missing and unreadable visuals were reported when the robot was added.
                let Ok(mesh) = scene::mesh::load(path) else {
                    assets.parts.insert(key, Vec::new());
                    continue;
                };
                let mesh = mesh.scaled((*scale).into());
                let parts = export_parts(&mesh, &plain_name(path), &mut names, mjcf, &mut textures, dir)?;
                assets.parts.insert(key, parts);
            }
        }
    }
    Ok(assets)
}

type TextureKey = Vec<u8>;

fn export_parts(
    mesh: &TriMesh,
    stem: &str,
    names: &mut BTreeSet<String>,
    mjcf: &mut Mjcf,
    textures: &mut BTreeMap<TextureKey, String>,
    dir: &Path,
) -> Result<Vec<crate::mjcf::robot::VisualPart>> {
    let mut parts = Vec::new();
    for (i, part) in mesh.parts.iter().enumerate() {
        // MuJoCo builds no mesh from fewer than four vertices.
        if part.triangles.len() < 2 {
            continue;
        }
        let name = if mesh.parts.len() == 1 { stem.to_string() } else { format!("{stem}_{i}") };
        let name = unique_name(&name, names);
        let file = format!("meshes/{name}.obj");
        let path = dir.join(&file);
        let out = BufWriter::new(std::fs::File::create(&path).map_err(at(&path))?);
        scene::mesh::write_obj(mesh, part.triangles.clone(), out).map_err(at(&path))?;
        let material = match part.material.map(|m| &mesh.materials[m]) {
            Some(material) => Some(export_material(material, &name, mjcf, textures, dir)?),
            None => None,
        };
        let asset = MeshAsset { name, content: MeshContent::File(file), visual: true, source: None };
        parts.push(VisualAssets::declare(mjcf, asset, material));
    }
    Ok(parts)
}

fn export_material(
    material: &MeshMaterial,
    name: &str,
    mjcf: &mut Mjcf,
    textures: &mut BTreeMap<TextureKey, String>,
    dir: &Path,
) -> Result<MaterialAsset> {
    let texture = match &material.texture {
        Some(source) => export_texture(source, name, mjcf, textures, dir)?,
        None => None,
    };
    Ok(MaterialAsset { name: format!("{name}_material"), rgba: material.rgba.map(f64::from), texture })
}

/// MuJoCo reads PNG only: other images are converted. A texture that is missing or unreadable leaves the colour.
fn export_texture(
    source: &TextureSource,
    name: &str,
    mjcf: &mut Mjcf,
    textures: &mut BTreeMap<TextureKey, String>,
    dir: &Path,
) -> Result<Option<String>> {
    let bytes = match source {
        TextureSource::File(path) => match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(_) => return Ok(None),
        },
        TextureSource::Embedded(bytes) => bytes.clone(),
    };
    if let Some(known) = textures.get(&bytes) {
        return Ok(Some(known.clone()));
    }
    let Ok(image) = image::load_from_memory(&bytes) else { return Ok(None) };
    let texture = format!("{name}_texture");
    let file = format!("meshes/{texture}.png");
    let path = dir.join(&file);
    image.to_rgb8().save(&path).map_err(|e| Error::Image { path, reason: e.to_string() })?;
    mjcf.textures.push(TextureAsset { name: texture.clone(), file });
    textures.insert(bytes, texture.clone());
    Ok(Some(texture))
}

/// The name of a file in lower-case letters, digits and underscores.
fn plain_name(path: &Path) -> String {
    let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect()
}

/// A name that no other mesh file of the export has.
fn unique_name(plain: &str, names: &mut BTreeSet<String>) -> String {
    let mut name = plain.to_owned();
    let mut count = 1;
    while !names.insert(name.clone()) {
        count += 1;
        name = format!("{plain}_v{count}");
    }
    name
}
