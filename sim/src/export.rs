//! Export of every stage of the pipeline: URDF, description, MJCF with meshes for both supported MuJoCo versions.

use crate::compile::document;
use crate::drive::actuator::{Scheme, stable_timestep_of};
use crate::drive::plan::JointPlan;
use crate::entity_set::EntitySet;
use crate::error::{Error, Result};
use crate::mjcf::document::{Integrator, Keyframe, MaterialAsset, MeshAsset, MeshContent, Mjcf, TextureAsset};
use crate::mjcf::part::PartDocument;
use crate::mjcf::robot::{MjcfDialect, VisualAssets};
use crate::mjcf::{scene as world, write};
use crate::objects::robot_data::RobotData;
use crate::simulation::Simulation;
use crate::simulation_cfg::SimulationManagerCfg;
use kinetoscope_mujoco::SupportedVersion;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_robot::mesh_key::MeshKey;
use kinetoscope_robot::urdf::write_urdf;
use kinetoscope_scene::mesh::{MeshMaterial, TextureSource, TriMesh};
use kinetoscope_scene::source_location::SourceLocation;
use std::collections::{BTreeMap, BTreeSet};
use std::io::BufWriter;
use std::path::Path;
use std::sync::Arc;

/// Writes all files to `dir`, which is created if missing; existing files are replaced. Returns diagnostics about
/// elements that the exported files lack or that differ from the simulation. `diagnostics` are the earlier ones.
pub(crate) fn dump(
    cfg: &SimulationManagerCfg,
    contents: &EntitySet,
    simulation: &Simulation,
    diagnostics: &[Diagnostic],
    dir: &Path,
) -> Result<Vec<Diagnostic>> {
    let robots = &contents.robots[..];
    let meshes = dir.join("meshes");
    std::fs::create_dir_all(&meshes).map_err(file_error(&meshes))?;
    for robot in robots {
        // A single robot is exported as `robot.*`, several robots under their uids.
        let stem = if robots.len() == 1 { "robot" } else { robot.uid() };
        write_file(&dir.join(format!("{stem}.urdf")), &write_urdf(robot.description()))?;
        write_file(&dir.join(format!("{stem}.description.txt")), &format!("{:#?}\n", robot.description()))?;
        write_file(&dir.join(format!("{stem}.joints.txt")), &format!("{:#?}\n", robot.plans()))?;
    }
    write_file(&dir.join("run.mjcf.xml"), &simulation.xml)?;
    for (index, terrain) in contents.terrains.iter().enumerate() {
        let path = dir.join(world::terrain_file(index));
        std::fs::write(&path, terrain.file()).map_err(file_error(&path))?;
    }
    for file in contents.files() {
        let path = dir.join(&file.name);
        std::fs::write(&path, &file.bytes).map_err(file_error(&path))?;
    }

    let mut empty = Mjcf::new("kinetoscope", cfg.physics_option());
    let mut omitted = Vec::new();
    let assets = export_meshes(contents, &mut empty, dir, &mut omitted)?;
    for (target, file) in [(SupportedVersion::V2, "robot.mjcf2.xml"), (SupportedVersion::V4, "robot.mjcf4.xml")] {
        let purpose = MjcfDialect::Export(&assets);
        let (mut mjcf, _, _) = document(cfg, contents, &simulation.overlap_exclusions, &purpose, empty.clone())?;
        let raised_armature = prepare_for_plain_mujoco(&mut mjcf, robots, target, simulation);
        // Both files have the same entry, so it is reported once.
        omitted.extend(raised_armature.filter(|_| target == SupportedVersion::V2));
        let reduced = unsupported_elements(&mjcf, target, file);
        mjcf.comments.extend(reduced.iter().map(|diagnostic| diagnostic.message.clone()));
        omitted.extend(reduced);
        write_file(&dir.join(file), &write::write(&mjcf, target).xml)?;
    }
    let text: String = diagnostics.iter().chain(&omitted).map(|d| format!("{d}\n")).collect();
    write_file(&dir.join("diagnostics.txt"), &text)?;
    Ok(omitted)
}

/// Returns a diagnostic for each element of an MJCF part or robot file that `file` lacks because the `target` MuJoCo
/// does not support it.
fn unsupported_elements(mjcf: &Mjcf, target: SupportedVersion, file: &str) -> Vec<Diagnostic> {
    let version = if target == SupportedVersion::V2 { "2.2.2" } else { "4.x" };
    let of_part = |part: &Arc<PartDocument>| {
        let lines = part.lines(target);
        let message = |left_out| {
            let uid = part.uid();
            format!("MJCF part {uid:?}: {left_out}: left out of {file}, because MuJoCo {version} does not support it")
        };
        let say = |left_out| Diagnostic::new(DiagnosticKind::ExportReduced, lines.source.clone(), message(left_out));
        lines.omitted.iter().map(say).collect::<Vec<_>>()
    };
    mjcf.parts.iter().flat_map(of_part).collect()
}

fn file_error(path: &Path) -> impl Fn(std::io::Error) -> Error + '_ {
    move |error| Error::File { path: path.to_path_buf(), error }
}

fn write_file(path: &Path, text: &str) -> Result<()> {
    std::fs::write(path, text).map_err(file_error(path))
}

/// Largest time step of an export whose drives have additional armature \[s\]: MuJoCo's default.
const ARMATURE_STEP: f64 = 0.002;

/// Adds `h kd` to the armature of the drives of a robot with mimic joints, if plain MuJoCo is otherwise unstable at the
/// time step h (`step`) \[s\]. Joints of MJCF files stay unchanged. An explicit drive is then as stable as a drive with
/// implicit damping, `(M + h kd) a = -kp (q - q*) - kd v`, and MuJoCo solves the couplings with the same inertia.
/// Returns the plans with the new armatures, and the uids of the changed robots.
fn add_armatures(mjcf: &mut Mjcf, robots: &[Arc<RobotData>], step: f64) -> (Vec<Vec<JointPlan>>, Vec<String>) {
    let mut heavier = Vec::new();
    let mut of_robot = |robot: &Arc<RobotData>| {
        let mut plans = robot.plans().to_vec();
        let bound = stable_timestep_of(Scheme::Explicit, robot.description(), &plans, !robot.cfg().fix_base);
        if !plans.iter().any(|plan| plan.mimic.is_some()) || bound.is_none_or(|bound| step <= 0.9 * bound) {
            return plans;
        }
        for plan in &mut plans {
            let Some(actuator) = plan.actuator else { continue };
            let name = format!("{}/{}", robot.uid(), robot.description().joint(plan.joint).name);
            let joints = mjcf.bodies.iter_mut().flat_map(|body| &mut body.joints);
            // Joints of MJCF files are written unchanged.
            let Some(joint) = joints.into_iter().find(|joint| joint.name == name) else { continue };
            joint.armature += step * actuator.kd;
            plan.armature += step * actuator.kd;
            if heavier.last().is_none_or(|last| last != robot.uid()) {
                heavier.push(robot.uid().to_owned());
            }
        }
        plans
    };
    let plans = robots.iter().map(&mut of_robot).collect();
    (plans, heavier)
}

/// Adapts an export to plain MuJoCo, which lacks the drives of this crate: integrator, time step, comments, and a
/// keyframe `start` with the initial state. Returns a diagnostic if drives got additional armature.
fn prepare_for_plain_mujoco(
    mjcf: &mut Mjcf,
    robots: &[Arc<RobotData>],
    target: SupportedVersion,
    simulation: &Simulation,
) -> Option<Diagnostic> {
    let followers = robots.iter().flat_map(|r| r.plans()).any(|plan| plan.mimic.is_some());
    let simulated = mjcf.option.timestep;
    let step = simulated.min(ARMATURE_STEP);
    let (plans, heavier) = add_armatures(mjcf, robots, step);
    let bound = |scheme| {
        let each = robots.iter().zip(&plans);
        each.filter_map(|(r, plans)| stable_timestep_of(scheme, r.description(), plans, !r.cfg().fix_base))
            .fold(f64::INFINITY, f64::min)
    };
    let (explicit, implicit) = (bound(Scheme::Explicit), bound(Scheme::ImplicitDamping));
    let limited = plans.iter().flatten().any(|plan| plan.actuator.is_some() && plan.max_effort.is_finite());
    let (version, integrator) = match target {
        SupportedVersion::V2 => ("2.2.2", Integrator::Implicit),
        SupportedVersion::V4 => ("4.x", Integrator::ImplicitFast),
    };
    mjcf.option.integrator = integrator;
    mjcf.comments.push("Written by Kinetoscope. Drives are plain MuJoCo actuators here.".into());
    // Reason and measurement of each bound: docs/decisions/0004.
    let (largest, why) = if followers && explicit.is_finite() {
        // MuJoCo solves couplings before its implicit damping slows the drivers, so followers run away from them. The
        // explicit integrator does not have this problem.
        mjcf.option.integrator = Integrator::Euler;
        (explicit, ": implicit integrators are unstable with stiff drives and mimic joints.")
    } else if target == SupportedVersion::V2 {
        (implicit, "; saturated drives respond slowly.")
    } else if limited {
        (explicit.min(implicit), ", where drives saturate at their force limits.")
    } else {
        (implicit, ".")
    };
    mjcf.comments.push(if largest.is_finite() {
        format!("MuJoCo {version}: stable up to a time step of {largest:.3e} s{why}")
    } else {
        format!("MuJoCo {version}: stable at every time step.")
    });
    if target == SupportedVersion::V4 && limited && !followers && implicit.is_finite() {
        mjcf.comments.push(format!("While no drive saturates, up to {implicit:.3e} s."));
    }
    let warning = (!heavier.is_empty()).then(|| {
        format!(
            "{}: the export adds {step} s times their damping to the armature of the drives, so that plain MuJoCo is stable \
             with mimic joints at a time step of {step} s; a drive at its effort limit therefore accelerates more slowly",
            heavier.join(", ")
        )
    });
    mjcf.comments.extend(warning.clone());
    if !heavier.is_empty() {
        mjcf.option.timestep = step;
    }
    // At this time step the robot holds its start pose in any viewer.
    let holds_up_to = if followers { explicit } else { implicit };
    if mjcf.option.timestep > 0.9 * holds_up_to {
        mjcf.comments.push(format!(
            "The time step is smaller than the simulation's {simulated} s, so that the robot holds its start pose."
        ));
        mjcf.option.timestep = two_digits(0.9 * holds_up_to);
    }
    let (start, model) = (&simulation.initial_state, simulation.batch.model());
    let mut qpos = model.qpos0().to_vec();
    for &(address, position) in &start.qpos {
        qpos[address] = position;
    }
    let mut ctrl = vec![0.0; model.nu()];
    for (robot, index) in robots.iter().zip(&simulation.robots) {
        for (plan, joint) in robot.plans().iter().zip(&index.joints) {
            // Without stiffness, the control is a velocity or an effort, which starts at zero.
            if let (Some(drive), Some(actuator)) = (joint.drive, plan.actuator)
                && actuator.kp > 0.0
            {
                ctrl[simulation.drive_ctrl_index(drive)] = plan.initial;
            }
        }
    }
    if !qpos.is_empty() {
        mjcf.keyframes.push(Keyframe { name: "start".into(), qpos, ctrl });
    }
    warning.map(|message| Diagnostic::new(DiagnosticKind::ExportHeavier, None, message))
}

/// Rounds to two significant digits, at most 5 % off.
fn two_digits(x: f64) -> f64 {
    format!("{x:.1e}").parse().unwrap_or(x)
}

/// Writes every visual mesh of robots and objects to `dir` once, one OBJ file per material, and declares the assets in
/// `mjcf`. Unreadable meshes and textures are reported in `left_out`.
fn export_meshes(
    contents: &EntitySet,
    mjcf: &mut Mjcf,
    dir: &Path,
    left_out: &mut Vec<Diagnostic>,
) -> Result<VisualAssets> {
    let mut assets = VisualAssets::default();
    let mut textures: BTreeMap<TextureKey, String> = BTreeMap::new();
    let mut names = BTreeSet::new();
    let mut export = |key: MeshKey, of: &str, source: Option<&SourceLocation>| -> Result<()> {
        if assets.parts.contains_key(&key) {
            return Ok(());
        }
        let mut say = |kind, message: String| left_out.push(Diagnostic::new(kind, source.cloned(), message));
        let mesh = match kinetoscope_scene::mesh::load(&key.path) {
            Ok(mesh) => mesh,
            Err(error) => {
                assets.parts.insert(key, Vec::new());
                let message = format!("{of}: the visual mesh is left out of the export: {error}");
                say(DiagnosticKind::VisualMeshInvalid, message);
                return Ok(());
            }
        };
        for texture in unreadable_textures(&mesh) {
            let message = format!("{of}: a texture is left out of the export: {texture}");
            say(DiagnosticKind::TextureMissing, message);
        }
        let mesh = mesh.scaled(key.scale());
        let parts = export_parts(&mesh, &asset_stem(&key.path), &mut names, mjcf, &mut textures, dir)?;
        assets.parts.insert(key, parts);
        Ok(())
    };
    for robot in &contents.robots {
        for link in &robot.description().links {
            for visual in &link.visuals {
                if let kinetoscope_robot::description::Geometry::Mesh { path, scale, .. } = &visual.geometry {
                    let of = format!("link {:?}", link.name);
                    export(MeshKey::new(path, scale), &of, Some(&visual.source))?;
                }
            }
        }
    }
    for object in &contents.objects {
        if let Some(key) = object.mesh_key() {
            export(key, &format!("object {:?}", object.uid()), None)?;
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
) -> Result<Vec<crate::mjcf::robot::VisualSubmesh>> {
    let mut parts = Vec::new();
    for (i, part) in mesh.submeshes.iter().enumerate() {
        // MuJoCo rejects meshes with fewer than four vertices.
        if part.triangles.len() < 2 {
            continue;
        }
        let wanted = if mesh.submeshes.len() == 1 { stem.to_string() } else { format!("{stem}_{i}") };
        let name = unique_name(wanted, names);
        let file = format!("meshes/{name}.obj");
        let path = dir.join(&file);
        let out = BufWriter::new(std::fs::File::create(&path).map_err(file_error(&path))?);
        kinetoscope_scene::mesh::write_obj(mesh, part.triangles.clone(), out).map_err(file_error(&path))?;
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

/// Error messages for the unreadable textures of a mesh.
fn unreadable_textures(mesh: &TriMesh) -> Vec<String> {
    let sources = mesh.materials.iter().filter_map(|m| m.texture.as_ref());
    sources.filter_map(|source| source.decode().err()).collect()
}

/// Writes a texture as PNG, the only image format that MuJoCo reads. Returns the name of the texture asset; `None` if
/// the texture is missing or unreadable, in which case the material has only its color.
fn export_texture(
    source: &TextureSource,
    name: &str,
    mjcf: &mut Mjcf,
    textures: &mut BTreeMap<TextureKey, String>,
    dir: &Path,
) -> Result<Option<String>> {
    let Ok(bytes) = source.bytes() else { return Ok(None) };
    if let Some(known) = textures.get(&*bytes) {
        return Ok(Some(known.clone()));
    }
    let Ok(image) = source.decode_from(&bytes) else { return Ok(None) };
    let texture = format!("{name}_texture");
    let file = format!("meshes/{texture}.png");
    let path = dir.join(&file);
    image.save(&path).map_err(|e| Error::Image { path, reason: e.to_string() })?;
    mjcf.textures.push(TextureAsset { name: texture.clone(), file });
    textures.insert(bytes.into_owned(), texture.clone());
    Ok(Some(texture))
}

/// Asset name from lower-case letters, digits and underscores. The prefix keeps it apart from hulls of collision
/// meshes.
fn asset_stem(path: &Path) -> String {
    let stem = path.file_stem().map(|s| s.to_string_lossy().to_lowercase()).unwrap_or_default();
    let plain: String = stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '_' }).collect();
    format!("visual_{plain}")
}

/// Returns `wanted`, with a numeric suffix if that name is taken.
fn unique_name(wanted: String, names: &mut BTreeSet<String>) -> String {
    let mut name = wanted.clone();
    let mut count = 1;
    while !names.insert(name.clone()) {
        count += 1;
        name = format!("{wanted}_v{count}");
    }
    name
}
