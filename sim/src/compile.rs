//! Compiles the entities to a running simulation: document, MuJoCo model, drives, batch.

use crate::batch::Batch;
use crate::body_pose::BodyFrame;
use crate::capture::BodyAxis;
use crate::drive::gains::Gains;
use crate::drive::table::{Drive, DriveTable, Realization};
use crate::drive::{DriveModel, implicit};
use crate::entity_set::{EntitySet, GROUND_MASK_ID};
use crate::env::{SimEnv, with_small_buffers};
use crate::error::{Error, Result};
use crate::indexing::{
    BodyIndexing, GeomIndexing, JointIndexing, MjcfIndexing, RobotIndexing, WeldIndexing, joint_widths,
};
use crate::mjcf::document::{Mjcf, WeldEquality};
use crate::mjcf::robot::{self, MjcfDialect, RobotLayout};
use crate::mjcf::{scene, write};
use crate::objects::mjcf_part_data::MjcfData;
use crate::objects::rigid_object_data::RigidObjectData;
use crate::objects::weld_data::WeldCfg;
use crate::randomization::StoredOverrides;
use crate::simulation::{InitialState, Simulation};
use crate::simulation_cfg::SimulationManagerCfg;
use crate::snapshot::StateLayout;
use crate::visible::{self, ElementOwner, MaskIdMap};
use kinetoscope_exec::ThreadPool;
use kinetoscope_mujoco as mj;
use kinetoscope_mujoco::ObjectKind;
use kinetoscope_robot::description::Geometry;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use std::collections::BTreeSet;
use std::sync::{Arc, Mutex, OnceLock};

/// Compiles a scene, with all environments in their initial state. Self-collision pairs of robots that overlap in the
/// initial pose are excluded and reported.
pub(crate) fn compile(cfg: &SimulationManagerCfg, contents: &EntitySet, pool: &ThreadPool) -> Result<Simulation> {
    let first = compile_scene(cfg, contents, &[])?;
    if !contents.robots.iter().any(|r| r.cfg().self_collision) {
        return first.into_simulation(cfg, pool, Vec::new());
    }
    let excluded = overlapping_pairs(&first, contents)?;
    if excluded.is_empty() {
        return first.into_simulation(cfg, pool, excluded);
    }
    compile_scene(cfg, contents, &excluded)?.into_simulation(cfg, pool, excluded)
}

/// Adds a scene to the MJCF document `mjcf`, for a simulation or an export. `excluded` has pairs of MuJoCo bodies that
/// never collide, in addition to those of `contents`.
pub(crate) fn document(
    cfg: &SimulationManagerCfg,
    contents: &EntitySet,
    excluded: &[(String, String)],
    purpose: &MjcfDialect<'_>,
    mut mjcf: Mjcf,
) -> Result<(Mjcf, Vec<RobotLayout>, Vec<Diagnostic>)> {
    if let Some(ground) = &cfg.ground {
        scene::add_ground(&mut mjcf, ground.half_size, ground.color);
    }
    for (index, light) in cfg.lights.iter().enumerate() {
        scene::add_light(&mut mjcf, index, light);
    }
    let mut diagnostics = Vec::new();
    let mut layouts = Vec::new();
    for (index, data) in contents.robots.iter().enumerate() {
        let dialect = match purpose {
            MjcfDialect::Simulation { .. } => {
                MjcfDialect::Simulation { friction_tendons: data.cfg().drive.model == DriveModel::Implicit }
            }
            export => export.clone(),
        };
        let robot_cfg = robot::RobotMjcfCfg {
            uid: data.uid(),
            contact: scene::robot_contact(index, data.cfg().self_collision),
            fix_base: data.cfg().fix_base,
            base_pose: data.cfg().init_pose,
            plans: data.plans(),
            hulls: data.hulls(),
            reserve_friction_tendons: data.cfg().drive.friction.is_some(),
            dialect,
        };
        let layout = match data.file() {
            None => robot::add(data.description(), &robot_cfg, &mut mjcf, &mut diagnostics)?,
            Some(file) => file
                .add(data.description(), &robot_cfg, data.cfg().self_collision, &mut mjcf, &mut diagnostics)
                .map_err(|error| data.file_error(error.into()))?,
        };
        if data.cfg().self_collision {
            mjcf.excludes.extend(layout.base_contact_exclusions.iter().cloned());
        }
        layouts.push(layout);
    }
    for object in &contents.objects {
        scene::add_object(&mut mjcf, object, purpose);
    }
    for (index, terrain) in contents.terrains.iter().enumerate() {
        scene::add_terrain(&mut mjcf, index, terrain);
    }
    mjcf.parts.extend(contents.mjcf_models.iter().map(|part| Arc::clone(part.document())));
    for pair in excluded {
        if !mjcf.excludes.contains(pair) {
            mjcf.excludes.push(pair.clone());
        }
    }
    let bodies = contents.mujoco_bodies(&layouts);
    let mujoco_body_names = |name: &str| -> Result<Vec<String>> {
        let places = contents.find_bodies(name)?;
        Ok(places.map_or_else(|| vec!["world".into()], |all| all.iter().map(|&k| bodies[k].clone()).collect()))
    };
    for [one, other] in &contents.collision_exclusions {
        for (a, b) in mujoco_body_names(one)?
            .iter()
            .flat_map(|a| mujoco_body_names(other).map(|all| (a.clone(), all)))
            .flat_map(|(a, all)| all.into_iter().map(move |b| (a.clone(), b)))
        {
            let known = |pair: &(String, String)| *pair == (a.clone(), b.clone()) || *pair == (b.clone(), a.clone());
            if a != b && !mjcf.excludes.iter().any(known) {
                mjcf.excludes.push((a, b));
            }
        }
    }
    for weld in &contents.welds {
        let body = |name: &str| -> Result<String> { Ok(mujoco_body_names(name)?.swap_remove(0)) };
        let (first, second) = (body(&weld.cfg.first)?, body(&weld.cfg.second)?);
        // MuJoCo evaluates a weld at the origin of the second body, so the fixed body, which may be far away, comes
        // first.
        let (first, second) = if weld.second_is_fixed { (second, first) } else { (first, second) };
        mjcf.welds.push(WeldEquality { name: weld.cfg.uid.clone(), first, second });
    }
    Ok((mjcf, layouts, diagnostics))
}

struct CompiledScene {
    model: mj::Model,
    table: Arc<DriveTable>,
    robots: Vec<RobotIndexing>,
    objects: Vec<BodyIndexing>,
    parts: Vec<MjcfIndexing>,
    welds: Vec<WeldIndexing>,
    identities: MaskIdMap,
    plan: Arc<BodyAxis>,
    start: Arc<InitialState>,
    xml: String,
    diagnostics: Vec<Diagnostic>,
    proxies: Vec<bool>,
}

fn compile_scene(
    cfg: &SimulationManagerCfg,
    contents: &EntitySet,
    excluded: &[(String, String)],
) -> Result<CompiledScene> {
    let empty = Mjcf::new("kinetoscope", cfg.physics_option());
    let run = MjcfDialect::Simulation { friction_tendons: true };
    let (mjcf, layouts, diagnostics) = document(cfg, contents, excluded, &run, empty)?;
    let text = write::write(&mjcf, mj::BUILD_VERSION);
    let files: Vec<mj::Asset> = contents
        .terrains
        .iter()
        .enumerate()
        .map(|(index, terrain)| mj::Asset { name: scene::terrain_file(index), bytes: terrain.file() })
        .chain(contents.files().cloned())
        .collect();
    let mut compiled = mj::compile(&text.xml, &files).map_err(|error| match error {
        mj::LoadError::Compile(error) => Error::Compile(text.locate(error)),
        other => other.into(),
    })?;
    let mut objects = index_objects(&compiled, contents)?;
    set_object_damping(&mut compiled, contents, &objects);
    let (model, table, robots, start) = set_up_drives(compiled, contents, &layouts)?;
    objects.iter_mut().for_each(|o| o.mocap = usize::try_from(model.body_mocapid()[o.body]).ok());
    let parts = contents.mjcf_models.iter().map(|part| index_mjcf(&model, part)).collect::<Result<Vec<_>>>()?;
    let welds = contents.welds.iter().map(|weld| index_weld(&model, &weld.cfg)).collect::<Result<Vec<_>>>()?;
    let identities = assign_geom_owners(&model, contents, &robots, &objects, &parts);
    let plan = Arc::new(BodyAxis::new(&model, &robots, &objects, &parts, &contents.moving_bodies()));
    let (table, start) = (Arc::new(table), Arc::new(start));
    let (proxies, xml) = (find_visual_proxies(&model, contents, &robots), text.xml);
    Ok(CompiledScene {
        model,
        table,
        robots,
        objects,
        parts,
        welds,
        identities,
        plan,
        start,
        xml,
        diagnostics,
        proxies,
    })
}

/// Marks the geoms that stand in for visual meshes; they only have a pose.
fn find_visual_proxies(model: &mj::Model, contents: &EntitySet, robots: &[RobotIndexing]) -> Vec<bool> {
    let mut proxies = vec![false; model.ngeom()];
    for (data, index) in contents.robots.iter().zip(robots) {
        for geom in &index.geoms {
            let visuals = &data.description().links[geom.link].visuals;
            let visual = geom.visual.and_then(|visual| visuals.get(visual));
            proxies[geom.geom] = visual.is_some_and(|visual| matches!(visual.geometry, Geometry::Mesh { .. }));
        }
    }
    for object in &contents.objects {
        if let Some(geom) = model.id(ObjectKind::Geom, &format!("{}/visual", object.uid())) {
            proxies[geom] = true;
        }
    }
    proxies
}

fn missing_name_error(what: &'static str, name: &str) -> Error {
    Error::UnknownName { what, name: name.into(), candidates: Vec::new() }
}

/// Finds every rigid object in the compiled model.
fn index_objects(compiled: &mj::Compiled, contents: &EntitySet) -> Result<Vec<BodyIndexing>> {
    let find = |object: &RigidObjectData| {
        let body =
            compiled.id(ObjectKind::Body, object.uid()).ok_or_else(|| missing_name_error("body", object.uid()))?;
        let free_joint = compiled.joint_address(&format!("{}/free", object.uid()));
        Ok(BodyIndexing { body, free_joint, mocap: None })
    };
    contents.objects.iter().map(|object| find(object)).collect()
}

/// Sets linear and angular damping of free joints separately, which MJCF cannot express for a free joint.
fn set_object_damping(compiled: &mut mj::Compiled, contents: &EntitySet, objects: &[BodyIndexing]) {
    for (object, index) in contents.objects.iter().zip(objects) {
        if let Some((_, dof)) = index.free_joint {
            let damping = compiled.dof_damping_mut();
            damping[dof..dof + 3].fill(object.cfg().linear_damping);
            damping[dof + 3..dof + 6].fill(object.cfg().angular_damping);
        }
    }
}

fn index_weld(model: &mj::Model, weld: &WeldCfg) -> Result<WeldIndexing> {
    let equality = model.id(ObjectKind::Equality, &weld.uid).ok_or_else(|| missing_name_error("weld", &weld.uid))?;
    let bodies = [model.eq_obj1id()[equality], model.eq_obj2id()[equality]].map(|body| body.max(0) as usize);
    Ok(WeldIndexing { equality, bodies })
}

/// Finds all elements of an attached MJCF file in the compiled model, by name.
fn index_mjcf(model: &mj::Model, part: &MjcfData) -> Result<MjcfIndexing> {
    let (file, names) = (part.model(), part.names());
    let find = |kind, what, name: &str| model.id(kind, name).ok_or_else(|| missing_name_error(what, name));
    let all = |kind, what, names: &[String]| -> Result<Vec<usize>> {
        names.iter().map(|name| find(kind, what, &part.scoped_name(name))).collect()
    };
    let mut bodies = vec![find(ObjectKind::Body, "body", part.uid())?];
    bodies.extend(all(ObjectKind::Body, "body", &names.bodies[1..])?);
    let actuators = all(ObjectKind::Actuator, "actuator", &names.actuators)?;
    let (mut qpos, mut dofs, mut joints) = (Vec::new(), Vec::new(), Vec::new());
    // Joint by joint in the order of the file.
    for (joint, here) in all(ObjectKind::Joint, "joint", &names.joints)?.into_iter().enumerate() {
        let (nq, nv) = joint_widths(file.jnt_type()[joint]);
        if nq == 1 {
            let (qpos, dof) = (model.jnt_qposadr()[here] as usize, model.jnt_dofadr()[here] as usize);
            joints.push(JointIndexing { qpos, dof, drive: None });
        }
        qpos.extend((0..nq).map(|k| model.jnt_qposadr()[here] as usize + k));
        dofs.extend((0..nv).map(|k| model.jnt_dofadr()[here] as usize + k));
    }
    let frames = part.frames().iter();
    let frames =
        frames.map(|frame| BodyFrame { body: bodies[frame.body], body_from_frame: frame.body_from_frame }).collect();
    let mocap_bodies =
        (0..file.nbody()).filter(|&body| file.body_mocapid()[body] >= 0).map(|body| bodies[body]).collect();
    Ok(MjcfIndexing {
        geoms: all(ObjectKind::Geom, "geom", &names.geoms)?,
        qpos,
        dofs,
        joints,
        controls: actuators.iter().map(|&actuator| model.actuator_control(actuator)).collect(),
        activations: actuators.iter().flat_map(|&actuator| model.actuator_activation(actuator)).collect(),
        actuators,
        mocap_bodies,
        frames,
        bodies,
    })
}

/// Returns mask id, name and sensor body of each geom and each visible tendon. Geoms without an owner belong to the
/// ground.
fn assign_geom_owners(
    model: &mj::Model,
    contents: &EntitySet,
    robots: &[RobotIndexing],
    objects: &[BodyIndexing],
    parts: &[MjcfIndexing],
) -> MaskIdMap {
    let ground =
        || ElementOwner { id: GROUND_MASK_ID, object: "ground".into(), link: None, class: "ground".into(), body: None };
    let mut owners: Vec<ElementOwner> = (0..model.ngeom()).map(|_| ground()).collect();
    let mut first = 0;
    for (data, index) in contents.robots.iter().zip(robots) {
        for geom in &index.geoms {
            owners[geom.geom] = ElementOwner {
                id: data.mask_id(geom.link),
                object: data.uid().into(),
                link: Some(data.description().links[geom.link].name.clone()),
                class: data.semantic_class().into(),
                body: Some((first + geom.link) as u32),
            };
        }
        first += index.links.len();
    }
    for (geom, &body) in model.geom_bodyid().iter().enumerate() {
        if let Some(k) = objects.iter().position(|o| o.body == body as usize) {
            let object = &contents.objects[k];
            let body = Some((first + k) as u32);
            let class = object.cfg().semantic_class.clone().unwrap_or_else(|| "object".into());
            owners[geom] = ElementOwner { id: object.mask_id(), object: object.uid().into(), link: None, class, body };
        }
    }
    first += objects.len();
    for (data, index) in contents.mjcf_models.iter().zip(parts) {
        for (geom, &here) in index.geoms.iter().enumerate() {
            let of = data.model().geom_bodyid()[geom] as usize;
            owners[here] = ElementOwner {
                id: data.mask_id(of),
                object: data.uid().into(),
                link: (of > 0).then(|| data.names().bodies[of].clone()),
                class: data.cfg().semantic_class.clone().unwrap_or_else(|| "mjcf".into()),
                // Frames begin with all bodies except the world.
                body: of.checked_sub(1).map(|frame| (first + frame) as u32),
            };
        }
        first += index.frames.len();
    }
    for terrain in &contents.terrains {
        if let Some(geom) = model.id(ObjectKind::Geom, terrain.uid()) {
            let (id, object) = (terrain.mask_id(), terrain.uid().into());
            owners[geom] = ElementOwner { id, object, link: None, class: "terrain".into(), body: None };
        }
    }
    visible::of_simulation(model, &owners, &visible::tendon_owners(model, contents))
}

/// Finds every joint and link in the compiled model, replaces actuators of implicit drives by constraint rows, and
/// makes those of explicit models effort sources. Returns the model, its drives, the indices of all robots, and the
/// initial state.
fn set_up_drives(
    mut compiled: mj::Compiled,
    contents: &EntitySet,
    layouts: &[RobotLayout],
) -> Result<(mj::Model, DriveTable, Vec<RobotIndexing>, InitialState)> {
    let mut table = DriveTable::default();
    let mut indices = Vec::new();
    let mut start = InitialState::default();
    let mut row_drives: Vec<(usize, usize)> = Vec::new();
    let (mut row_actuators, mut native_actuators, mut effort_sources) = (Vec::new(), Vec::new(), Vec::new());
    for (data, layout) in contents.robots.iter().zip(layouts) {
        let implicit = data.cfg().drive.model == DriveModel::Implicit;
        let mut joints = Vec::new();
        for plan in data.plans() {
            let name = format!("{}/{}", data.uid(), data.description().joint(plan.joint).name);
            let (qpos, dof) = compiled.joint_address(&name).ok_or_else(|| missing_name_error("joint", &name))?;
            start.qpos.push((qpos, plan.initial));
            let mut drive = None;
            if let Some(actuator) = plan.actuator {
                let ctrl =
                    compiled.id(ObjectKind::Actuator, &name).ok_or_else(|| missing_name_error("actuator", &name))?;
                let (max_effort, max_velocity) = (plan.max_effort, plan.max_velocity);
                let initial = Gains { kp: actuator.kp, kd: actuator.kd, max_effort, max_velocity };
                let (realization, setting, range) = (Realization::Actuator, plan.setting, plan.target_range);
                let index = table.drives.len();
                table.drives.push(Drive { qpos, dof, ctrl, realization, initial, setting, range });
                start.targets.push((index, plan.initial));
                drive = Some(index);
                if let Some(model) = plan.model {
                    table.push_model(index, model);
                    effort_sources.push(ctrl);
                } else if implicit {
                    row_drives.push((dof, index));
                    row_actuators.push(ctrl);
                } else {
                    native_actuators.push(ctrl);
                }
            }
            joints.push(JointIndexing { qpos, dof, drive });
        }
        for damped in &layout.damped {
            let (_, dof) =
                compiled.joint_address(&damped.joint).ok_or_else(|| missing_name_error("joint", &damped.joint))?;
            table.damped.extend((dof..dof + damped.dofs).map(|dof| (dof, damped.damping)));
            table.undamped_armature.extend(std::iter::repeat_n(damped.armature, damped.dofs));
        }
        let links = layout
            .links
            .iter()
            .map(|frame| {
                let body = compiled
                    .id(ObjectKind::Body, &frame.body)
                    .ok_or_else(|| missing_name_error("body", &frame.body))?;
                Ok(BodyFrame { body, body_from_frame: frame.body_from_link })
            })
            .collect::<Result<Vec<_>>>()?;
        let geoms = layout
            .geoms
            .iter()
            .map(|owner| {
                let geom = compiled
                    .id(ObjectKind::Geom, &owner.geom)
                    .ok_or_else(|| missing_name_error("geom", &owner.geom))?;
                Ok(GeomIndexing { geom, link: owner.link.0, visual: owner.visual })
            })
            .collect::<Result<_>>()?;
        let root = BodyIndexing {
            body: links[data.description().root.0].body,
            free_joint: layout.free_joint.as_ref().and_then(|joint| compiled.joint_address(joint)),
            mocap: None,
        };
        indices.push(RobotIndexing { joints, links, root, geoms });
    }
    let dofs: Vec<usize> = row_drives.iter().map(|&(dof, _)| dof).collect();
    implicit::prepare(&mut compiled, &dofs, &row_actuators);
    compiled.unlimit_controls(&native_actuators);
    compiled.make_effort_sources(&effort_sources);
    compiled.prepare_for_stepping(!row_drives.is_empty());
    let model = compiled.into_model();
    for (dof, index) in row_drives {
        if model.dof_frictionloss()[dof] <= 0.0 {
            return Err(missing_name_error("friction row", &format!("{dof}")));
        }
        table.drives[index].realization = Realization::ConstraintRow;
    }
    Ok((model, table, indices, start))
}

impl CompiledScene {
    fn into_simulation(
        self,
        cfg: &SimulationManagerCfg,
        pool: &ThreadPool,
        overlap_exclusions: Vec<(String, String)>,
    ) -> Result<Simulation> {
        let mut diagnostics = self.diagnostics;
        for (a, b) in &overlap_exclusions {
            diagnostics.push(Diagnostic::new(
                DiagnosticKind::InitialOverlap,
                None,
                format!("{a:?} and {b:?} overlap in the initial pose; collisions between them are disabled"),
            ));
        }
        let threads = cfg.num_threads();
        let batch = Batch::new(&with_small_buffers(&self.model), &self.table, cfg.num_envs, threads, pool.clone())?;
        let mut simulation = Simulation {
            batch,
            robots: self.robots,
            objects: self.objects,
            mjcf_models: self.parts,
            welds: self.welds,
            identities: self.identities,
            body_axis: self.plan,
            visual_scene: None,
            xml: self.xml,
            diagnostics,
            initial_state: self.start,
            layout: Arc::new(StateLayout::of(&self.model, &self.table, cfg.substeps)),
            property_tables: OnceLock::new(),
            model_patcher: Mutex::new(None),
            property_overrides: vec![StoredOverrides::default(); cfg.num_envs],
            env_scenes: Vec::new(),
            visual_proxies: self.proxies,
            overlap_exclusions,
        };
        simulation.reset(&vec![true; cfg.num_envs]);
        Ok(simulation)
    }
}

/// Pairs of MuJoCo bodies of one robot that penetrate each other in the initial pose.
fn overlapping_pairs(built: &CompiledScene, contents: &EntitySet) -> Result<Vec<(String, String)>> {
    // Uses an environment because its buffers grow until all contacts fit.
    let mut env = SimEnv::new(&with_small_buffers(&built.model), &built.table)?;
    env.write(|data| {
        for &(address, position) in &built.start.qpos {
            data.qpos_mut()[address] = position;
        }
    });
    let data = env.data();
    let model = &built.model;
    let mut pairs = BTreeSet::new();
    for contact in data.contact() {
        let body = |geom: i32| {
            usize::try_from(geom).ok().and_then(|g| {
                let body = model.geom_bodyid()[g] as usize;
                model.name(ObjectKind::Body, body)
            })
        };
        let (Some(a), Some(b)) = (body(contact.geom1), body(contact.geom2)) else { continue };
        let of_one_robot = contents.robots.iter().any(|r| {
            let prefix = format!("{}/", r.uid());
            a.starts_with(&prefix) && b.starts_with(&prefix)
        });
        if of_one_robot && contact.dist < 0.0 {
            pairs.insert(if a < b { (a, b) } else { (b, a) });
        }
    }
    Ok(pairs.into_iter().collect())
}
