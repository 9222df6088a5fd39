//! MJCF files as robots.
//!
//! MuJoCo compiles the file. The compiled model becomes a description ([`RobotDescription`]), and is written into the
//! scene like an MJCF part (`super::part`), with drives in place of its actuators.
//!
//! The reasons for a part instead of bodies of the document are in docs/decisions/0012.

mod actuator;
mod couplings;
mod drives;
mod error;
mod friction;
mod locations;
mod tree;
mod world;

pub use error::RobotFileError;

use super::document::{Inertial, Integrator, Mjcf};
use super::part::{
    OmittedElement, PartDocument, PartError, PartNames, PartSource, PassiveJointProperties, RobotOverrides,
    RootAttachment, setting_warnings,
};
use super::robot::{
    DampedJoint, GeomOwner, LinkFrame, MjcfDialect, RobotLayout, RobotMjcfCfg, add_drive, unused_joint_name,
};
use crate::entity_label::EntityLabel;
use crate::error::Result;
use crate::mjcf::document::GeomRole;
use crate::objects::mjcf_file::MjcfFile;
use crate::objects::mjcf_part_data::{engine_sensors, read_and_compile};
use kinetoscope_mujoco::{Asset, Model, mjcf_keywords};
use kinetoscope_robot::body_inertia::{RigidBody, fuse};
use kinetoscope_robot::description::{JointId, LinkId, RobotDescription};
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_scene::Pose;
use kinetoscope_scene::source_location::SourceLocation;
use kinetoscope_sensors::EngineSensor;
use locations::SourceLocations;
use std::collections::BTreeMap;
use std::sync::Arc;
use tree::{DescriptionBuilder, FileDescription, Root};

/// MJCF file of a robot, with the model that MuJoCo compiled from the file alone.
#[derive(Clone, Debug)]
pub struct MjcfRobotFile {
    source: SourceLocation,
    model: Model,
    names: PartNames,
    root: Root,
    /// For each named link (body or site): index of its body in the file's model (0 is the world), and pose of the link
    /// in the frame of that body.
    links: Vec<(usize, Pose)>,
    /// Joint of the description for each joint of the file; `None` for a free joint.
    joints: Vec<Option<JointId>>,
    /// Prefix of the names of its asset files.
    stem: String,
    files: Vec<Asset>,
    sensors: Vec<EngineSensor>,
    sensors_left_out: Vec<(usize, OmittedElement)>,
}

/// Settings for loading a file.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LoadSettings<'a> {
    /// Name of the robot.
    pub(crate) uid: &'a str,
    /// Label of the robot in diagnostics.
    pub(crate) named: &'a EntityLabel,
    /// Index of the robot in the simulation.
    pub(crate) index: usize,
    /// True for a fixed base.
    pub(crate) fix_base: bool,
    /// True if the links collide with each other.
    pub(crate) self_collision: bool,
    /// Model of the current scene, if there is a scene.
    pub(crate) scene: Option<&'a Model>,
}

impl MjcfRobotFile {
    /// Reads and compiles a file, and describes its robot. `wrong` wraps the errors of the file.
    pub(crate) fn load(
        file: &MjcfFile,
        of: &LoadSettings<'_>,
        wrong: impl Fn(RobotFileError) -> crate::error::Error,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<(Self, RobotDescription)> {
        let (text, model) =
            read_and_compile(&file.path, file.text.as_deref(), |error| wrong(RobotFileError::Compile(error)))?;
        let names = PartNames::of_model(&model);
        let places = SourceLocations::of(&text, &file.path);
        let owner = of.named.to_string();
        let root = tree::root(&model, &names, &places, of.fix_base).map_err(&wrong)?;
        world::check(&owner, &model, &names, &places, diagnostics).map_err(&wrong)?;
        world::warn_contacts(&owner, &model, &names, of.self_collision, &places.file(), diagnostics);
        let couplings = couplings::of_joints(&owner, &model, &names, &places, diagnostics);
        let acting = drives::of_joints(&owner, &model, &names, &places, &couplings, diagnostics).map_err(&wrong)?;
        friction::warn_solver_params(&owner, &model, &names, &couplings, &places.file(), diagnostics);
        let describing = DescriptionBuilder {
            uid: of.uid,
            owner: &owner,
            model: &model,
            names: &names,
            places: &places,
            root,
            actuation: &acting,
            couplings: &couplings,
        };
        let FileDescription { description, links, joints } = describing.build(diagnostics);
        let stem = format!("robot{}_", of.index);
        let pose = Pose::identity();
        let part = PartSource { model: &model, names: &names, uid: of.uid, pose: &pose, stem: &stem, rig: None };
        let files = part.check().and_then(|()| part.files()).map_err(|error| wrong(error.into()))?;
        let sensors_left_out = world::sensors(&model, &names);
        diagnostics.extend(setting_warnings(
            &owner,
            &text,
            &file.path,
            &model,
            of.scene.unwrap_or(&model),
            &sensors_left_out,
        ));
        let is_kept = |s: &usize| sensors_left_out.iter().all(|(other, _)| other != s);
        let kept: Vec<usize> = (0..model.nsensor()).filter(is_kept).collect();
        let sensors = engine_sensors(of.uid, &model, &names, &kept);
        let source = places.file();
        let this = Self { source, model, names, root, links, joints, stem, files, sensors, sensors_left_out };
        Ok((this, description))
    }

    /// Compiled model of the file alone.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// Generated asset files (PNG textures, height fields) that the robot's MJCF elements refer to.
    pub(crate) fn files(&self) -> &[Asset] {
        &self.files
    }

    /// MuJoCo's own sensors of the robot in the scene. [`EngineSensor::first`] is relative to the first value of the
    /// robot, not to `sensordata`.
    pub(crate) fn sensors(&self) -> &[EngineSensor] {
        &self.sensors
    }

    /// Initial pose of the root link in the file's world.
    pub(crate) fn root_pose(&self) -> Pose {
        if self.root.is_world { Pose::identity() } else { tree::body_pose(&self.model, self.root.body) }
    }

    /// Adds the robot to `mjcf`. The base pose of `cfg` is the pose of the file's world.
    ///
    /// # Errors
    /// The file has an element that cannot be attached to a scene.
    pub(crate) fn add(
        &self,
        description: &RobotDescription,
        cfg: &RobotMjcfCfg<'_>,
        self_collision: bool,
        mjcf: &mut Mjcf,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<RobotLayout, PartError> {
        let rows = matches!(cfg.dialect, MjcfDialect::Simulation { friction_tendons: true });
        let (joints, damped) = self.passive(cfg, rows, mjcf);
        let contact = match cfg.contact {
            GeomRole::Collision { contype, conaffinity, .. } => [contype, conaffinity],
            GeomRole::Visual => [0, 0],
        };
        let base = match (self.root.free_joint, cfg.fix_base) {
            (Some(joint), true) => RootAttachment::Fixed(joint),
            (None, false) => {
                RootAttachment::Free { body: self.root.body, name: unused_joint_name(description, cfg.uid, "base") }
            }
            _ => RootAttachment::AsFile,
        };
        let free_joint = match &base {
            RootAttachment::Free { name, .. } => Some(name.clone()),
            RootAttachment::Fixed(_) => None,
            RootAttachment::AsFile => {
                self.root.free_joint.map(|joint| self.scoped_name(cfg, &self.names.joints[joint]))
            }
        };
        let inertials = self.overridden_inertials(description, cfg.fix_base, diagnostics);
        let (pairs, colliding) =
            (world::omitted_pairs(&self.model, self_collision), world::pair_only_geoms(&self.model));
        let rig = RobotOverrides { joints, base, contact, pairs, colliding, inertials };
        let (model, names) = (&self.model, &self.names);
        let part = PartSource { model, names, uid: cfg.uid, pose: &cfg.base_pose, stem: &self.stem, rig: Some(&rig) };
        mjcf.parts.push(Arc::new(PartDocument::new(&part, self.sensors_left_out.clone(), &self.source)?));
        for plan in cfg.plans {
            let tendon = rows && (plan.friction > 0.0 || cfg.reserve_friction_tendons);
            add_drive(mjcf, cfg.uid, description.joint(plan.joint), plan, tendon);
        }
        let links =
            self.links.iter().map(|&(body, body_from_link)| LinkFrame { body: self.body(cfg, body), body_from_link });
        let of_body = |body: usize| self.links.iter().position(|(other, _)| *other == body).map(LinkId);
        let geoms = (0..model.ngeom()).filter_map(|geom| {
            let body = usize::try_from(model.geom_bodyid()[geom]).ok().filter(|body| *body > 0)?;
            Some(GeomOwner { geom: self.scoped_name(cfg, &names.geoms[geom]), link: of_body(body)?, visual: None })
        });
        Ok(RobotLayout {
            links: links.collect(),
            free_joint,
            base_contact_exclusions: self.base_pairs(cfg),
            geoms: geoms.collect(),
            damped,
        })
    }

    /// Names of the tendons of the file, without the uid; generated for tendons without a name.
    pub(crate) fn tendon_names(&self) -> &[String] {
        &self.names.tendons
    }

    fn scoped_name(&self, cfg: &RobotMjcfCfg<'_>, name: &str) -> String {
        format!("{}/{name}", cfg.uid)
    }

    /// Name in the document of a body of the file.
    fn body(&self, cfg: &RobotMjcfCfg<'_>, body: usize) -> String {
        if body == 0 { cfg.uid.into() } else { self.scoped_name(cfg, &self.names.bodies[body]) }
    }

    /// Passive properties of all joints as written to the document, and the joints whose damping B is part of the
    /// solve. If drives are constraint rows (`rows`) and the integrator is not RK4, the document has no joint damping.
    /// Instead, the armature of joints with damping is raised by `h B`, with the time step h.
    fn passive(
        &self,
        cfg: &RobotMjcfCfg<'_>,
        rows: bool,
        mjcf: &Mjcf,
    ) -> (Vec<PassiveJointProperties>, Vec<DampedJoint>) {
        let m = &self.model;
        let mut damped = Vec::new();
        let of_joint = |joint: usize| {
            let dof = m.jnt_dofadr()[joint] as usize;
            let mut passive = PassiveJointProperties {
                damping: m.dof_damping()[dof],
                armature: m.dof_armature()[dof],
                frictionloss: m.dof_frictionloss()[dof],
            };
            if let Some(plan) = self.joints[joint].and_then(|id| cfg.plans.iter().find(|plan| plan.joint == id)) {
                let tendon = rows && plan.actuator.is_some();
                let frictionloss = if tendon { 0.0 } else { plan.friction };
                passive = PassiveJointProperties { damping: plan.damping, armature: plan.armature, frictionloss };
            }
            passive
        };
        let mut joints: Vec<PassiveJointProperties> = (0..m.njnt()).map(of_joint).collect();
        // As for robots from URDF files (`mjcf::robot` gives the reason), but only for joints with damping in the file.
        if rows && mjcf.option.integrator != Integrator::Rk4 {
            for (joint, passive) in joints.iter_mut().enumerate() {
                let is_written = !(cfg.fix_base && self.root.free_joint == Some(joint));
                let damping = std::mem::take(&mut passive.damping);
                if damping > 0.0 && is_written {
                    let armature = passive.armature;
                    passive.armature += mjcf.option.timestep * damping;
                    let dofs = if mjcf_keywords::joint(m.jnt_type()[joint]) == Some("free") { 6 } else { 1 };
                    let joint = self.scoped_name(cfg, &self.names.joints[joint]);
                    damped.push(DampedJoint { joint, dofs, damping, armature });
                }
            }
        }
        (joints, damped)
    }

    /// Mass properties of the bodies whose links carry another mass than in the file, and of a massless root body that
    /// the file fixes and `fix_base: false` frees.
    fn overridden_inertials(
        &self,
        description: &RobotDescription,
        fix_base: bool,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> BTreeMap<usize, Inertial> {
        let mut loaded = BTreeMap::new();
        for (body, &still) in self.static_bodies(fix_base).iter().enumerate().skip(1) {
            let of_body = self.links.iter().enumerate().filter(|(_, (other, _))| *other == body);
            let links: Vec<(LinkId, Pose)> = of_body.map(|(link, (_, pose))| (LinkId(link), *pose)).collect();
            let mass = |(link, _): &(LinkId, Pose)| description.link(*link).inertial.as_ref().map_or(0.0, |i| i.mass);
            // The file holds its root body, which may be a massless frame; a free body needs mass, as in a URDF.
            let is_freed = body == self.root.body && !fix_base && self.root.free_joint.is_none() && !self.root.is_world;
            let sum = links.iter().map(mass).sum::<f64>();
            if sum == self.model.body_mass()[body] && !(is_freed && sum == 0.0) {
                continue;
            }
            let rigid = RigidBody { links, moves: !still };
            if let Some(fused) = fuse(description, &rigid, diagnostics) {
                let (mass, com) = (fused.inertia.mass, fused.inertia.com);
                let (moments, axes) = fused.inertia.principal();
                loaded.insert(body, Inertial { mass, com, axes, moments, source: fused.source });
            }
        }
        loaded
    }

    /// Returns true for each body of the file that never moves; false for all but the world with a free base.
    fn static_bodies(&self, fix_base: bool) -> Vec<bool> {
        let m = &self.model;
        let root = if self.root.free_joint.is_some() { self.root.body } else { 0 };
        (0..m.nbody()).map(|body| body == 0 || fix_base && m.body_weldid()[body] as usize == root).collect()
    }

    /// Pairs of a body that never moves and a moving child body, whose contacts MuJoCo does not exclude. Pairs that the
    /// file itself excludes are omitted.
    fn base_pairs(&self, cfg: &RobotMjcfCfg<'_>) -> Vec<(String, String)> {
        let still = self.static_bodies(cfg.fix_base);
        let parent = |body: usize| self.model.body_parentid()[body] as usize;
        (1..still.len())
            .filter(|&body| parent(body) > 0 && still[parent(body)] && !still[body])
            .filter(|&body| {
                let pair = [body, parent(body)];
                self.model.excluded_bodies().all(|[a, b]| [a, b] != pair && [b, a] != pair)
            })
            .map(|body| (self.body(cfg, parent(body)), self.body(cfg, body)))
            .collect()
    }
}
