//! Data of robots: configuration, description, drives.

use crate::drive::gains::Gains;
use crate::drive::plan::{JointPlan, plan};
use crate::drive::{DriveModel, PdGains};
use crate::entity_label::EntityLabel;
use crate::error::{Error, Result};
use crate::mjcf::document::Integrator;
use crate::mjcf::robot_file::{LoadSettings, MjcfRobotFile, RobotFileError};
use crate::objects::robot_cfg::RobotCfg;
use crate::pattern;
use crate::simulation_cfg::SimulationManagerCfg;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_mujoco as mj;
use kinetoscope_robot::description::RobotDescription;
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_robot::mesh_key::MeshKey;
use kinetoscope_robot::shape_inertia::{HullSet, complete, solid_ball_inertial};
use kinetoscope_robot::urdf::{MergedRobot, assemble};
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::pose::to_row;
use std::collections::BTreeMap;

/// Index of a joint: its column in `qpos` and in similar arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JointIndex(pub usize);

/// Loaded robot or articulation: everything that does not change while the simulation runs.
#[derive(Clone, Debug)]
pub(crate) struct RobotData {
    cfg: RobotCfg,
    pub(super) description: RobotDescription,
    pub(super) plans: Vec<JointPlan>,
    pub(super) joint_names: Vec<String>,
    pub(super) parts: BTreeMap<String, Vec<usize>>,
    hulls: BTreeMap<MeshKey, TriMesh>,
    /// MJCF file of the robot; `None` for a robot from URDF files.
    file: Option<MjcfRobotFile>,
    first_mask_id: i32,
    role: RobotKind,
    /// Surface properties of some links, in addition to those of the files.
    surfaces: Vec<(usize, SurfaceCfg)>,
}

/// Kind of entity that a robot was added as.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum RobotKind {
    /// Added by `add_robot`.
    Robot,
    /// Added by `add_articulation`, with its semantic class.
    Articulation(String),
}

impl RobotKind {
    /// Label of the robot in errors.
    fn label(&self, uid: &str) -> EntityLabel {
        let kind = match self {
            Self::Robot => "robot",
            Self::Articulation(_) => "articulation",
        };
        EntityLabel { kind, uid: uid.into() }
    }
}

impl RobotData {
    /// Reads the files, and resolves names, drives and meshes of robot `index` of a simulation. `scene` is the current
    /// model.
    pub(crate) fn load(
        cfg: RobotCfg,
        role: RobotKind,
        manager: &SimulationManagerCfg,
        index: usize,
        scene: &mj::Model,
        first_mask_id: i32,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Self> {
        check_pose("init_pose", &cfg.init_pose)?;
        if let Some(clearance) = cfg.ground_clearance.filter(|clearance| !clearance.is_finite()) {
            let (value, expected) = (clearance.to_string(), "it must be a finite height in meters, such as 0");
            return Err(Error::Config { field: "ground_clearance", value, expected });
        }
        if !(0.0..=1.0).contains(&cfg.soft_limit_factor) {
            let (value, expected) =
                (cfg.soft_limit_factor.to_string(), "the fraction of a joint's range must be 0 to 1");
            return Err(Error::Config { field: "soft_limit_factor", value, expected });
        }
        for component in &cfg.urdf.components {
            check_pose("component transform", &component.transform)?;
        }
        let mut hulls = HullSet::new(&cfg.hull);
        let (file, mut description, mut found) =
            describe_robot(&cfg, &role.label(&cfg.uid), index, Some(scene), &mut hulls)?;
        add_payloads(&mut description, &cfg)?;
        let link_names: Vec<&str> = description.named_links().iter().map(|link| link.name.as_str()).collect();
        let surfaces = SurfaceCfg::assign(&cfg.surfaces, &link_names, "link", role.label(&cfg.uid))?;
        let joint_names: Vec<String> = description.drivable_joints().map(|(_, j)| j.name.clone()).collect();
        let mut parts = BTreeMap::new();
        for (part, patterns) in &cfg.control_parts {
            let members = pattern::select(patterns, &joint_names, "joint").map_err(|error| Error::ControlPart {
                robot: role.label(&cfg.uid),
                part: part.clone(),
                error: Box::new(error),
            })?;
            if parts.insert(part.clone(), members).is_some() {
                return Err(Error::ControlPartRepeated { robot: role.label(&cfg.uid), part: part.clone() });
            }
        }
        let at_plan = |error| Error::DrivePlan { robot: role.label(&cfg.uid), error: Box::new(error) };
        let (plans, mut planned) =
            plan(&description, &cfg.drive, &parts, &cfg.init_qpos, !cfg.fix_base).map_err(at_plan)?;
        check_integrator(&cfg, &role, &plans, manager.integrator)?;
        found.append(&mut planned);
        let explicit = explicit_drive_plans(&plans, cfg.drive.model);
        if explicit.iter().any(|plan| plan.actuator.is_some()) {
            let dt = manager.physics_option().timestep;
            found.extend(crate::drive::actuator::warn_if_unstable(&description, &explicit, !cfg.fix_base, dt));
        }
        let hulls = hulls.of_collisions(&description)?;
        diagnostics.append(&mut found);
        Ok(Self { cfg, description, plans, joint_names, parts, hulls, file, first_mask_id, role, surfaces })
    }

    /// Name of the robot.
    pub(crate) fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// Configuration that the robot was added with.
    pub(crate) fn cfg(&self) -> &RobotCfg {
        &self.cfg
    }

    /// Surface properties of some links, in addition to those of the files.
    pub(crate) fn surfaces(&self) -> &[(usize, SurfaceCfg)] {
        &self.surfaces
    }

    /// Semantic class in the table of mask ids.
    pub(crate) fn semantic_class(&self) -> &str {
        match &self.role {
            RobotKind::Robot => "robot",
            RobotKind::Articulation(class) => class,
        }
    }

    /// Label of the robot in errors.
    pub(crate) fn label(&self) -> EntityLabel {
        self.role.label(self.uid())
    }

    /// True if it was added as a robot, false for a passive articulation.
    pub(crate) fn is_robot(&self) -> bool {
        self.role == RobotKind::Robot
    }

    /// Description of the robot from its files, with completed inertias and payloads.
    pub(crate) fn description(&self) -> &RobotDescription {
        &self.description
    }

    /// Limits and drives of its joints.
    pub(crate) fn plans(&self) -> &[JointPlan] {
        &self.plans
    }

    /// Names of the movable joints in the order of the merged URDF, or of the MJCF file.
    pub(crate) fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// Value of the mask channel of cameras for a link.
    pub(crate) fn mask_id(&self, link: usize) -> i32 {
        self.first_mask_id + link as i32
    }

    /// Names of the tendons of its MJCF file. Their mask ids follow those of its links.
    pub(crate) fn tendons(&self) -> &[String] {
        self.file.as_ref().map_or(&[], |file| file.tendon_names())
    }

    /// MJCF file of the robot; `None` for a robot from URDF files.
    pub(crate) fn file(&self) -> Option<&MjcfRobotFile> {
        self.file.as_ref()
    }

    /// Wraps an error of the robot's MJCF file, with the robot's label and the path of the file.
    pub(crate) fn file_error(&self, error: RobotFileError) -> Error {
        file_error(&self.cfg, self.label(), error)
    }

    /// Initial pose of the root link in the environment, moved by `ground_clearance`.
    pub(crate) fn root_pose(&self) -> Pose {
        self.file.as_ref().map_or(self.cfg.init_pose, |file| self.cfg.init_pose * file.root_pose())
    }

    /// Moves the initial pose along z \[m\].
    pub(super) fn move_initial_pose_z(&mut self, by: f64) {
        self.cfg.init_pose.translation.z += by;
    }

    pub(crate) fn hulls(&self) -> &BTreeMap<MeshKey, TriMesh> {
        &self.hulls
    }
}

fn file_error(cfg: &RobotCfg, robot: EntityLabel, error: RobotFileError) -> Error {
    let path = cfg.mjcf.as_ref().map(|file| file.path.display().to_string());
    Error::RobotFile { robot, file: path.unwrap_or_default(), error: Box::new(error) }
}

/// Describes a robot from its files, with completed inertias and without payloads. Returns its MJCF file (`None` for a
/// robot from URDF files), the description, and diagnostics about the files. With a `scene`, the diagnostics include
/// settings of its MJCF file that differ from the scene's. `named` and `index` (position in the simulation) identify
/// the robot in messages and file names; `hulls` caches convex hulls.
pub(crate) fn describe_robot(
    cfg: &RobotCfg,
    named: &EntityLabel,
    index: usize,
    scene: Option<&mj::Model>,
    hulls: &mut HullSet<'_>,
) -> Result<(Option<MjcfRobotFile>, RobotDescription, Vec<Diagnostic>)> {
    let Some(file) = &cfg.mjcf else {
        let MergedRobot { mut description, mut diagnostics } = assemble(&cfg.urdf)?;
        complete(&mut description, cfg.urdf.missing_inertia, !cfg.fix_base, hulls, &mut diagnostics)?;
        return Ok((None, description, diagnostics));
    };
    if !cfg.urdf.components.is_empty() {
        let expected = "a robot comes from one MJCF file or from URDF files; remove mjcf or the components of urdf";
        return Err(Error::Config { field: "mjcf", value: format!("{:?}", file.path), expected });
    }
    let mut found = Vec::new();
    let (fix_base, self_collision) = (cfg.fix_base, cfg.self_collision);
    let loading = LoadSettings { uid: &cfg.uid, named, index, fix_base, self_collision, scene };
    let (file, description) =
        MjcfRobotFile::load(file, &loading, |error| file_error(cfg, named.clone(), error), &mut found)?;
    Ok((Some(file), description, found))
}

/// Plans in which only the explicit drives, evaluated at the start of a step, have gains. The damping is the largest
/// that the model of the joint can produce.
fn explicit_drive_plans(plans: &[JointPlan], model: DriveModel) -> Vec<JointPlan> {
    let explicit = |plan: &JointPlan| {
        let spec = plan.actuator?;
        match plan.model {
            Some(law) => {
                let (max_effort, max_velocity) = (plan.max_effort, plan.max_velocity);
                let kd = law.law().damping(&Gains { kp: spec.kp, kd: spec.kd, max_effort, max_velocity });
                Some(PdGains { kd, ..spec })
            }
            None => Some(spec).filter(|_| model == DriveModel::Actuator),
        }
    };
    plans.iter().map(|plan| JointPlan { actuator: explicit(plan), ..plan.clone() }).collect()
}

/// Adds the configured payloads to the links of the description.
fn add_payloads(description: &mut RobotDescription, cfg: &RobotCfg) -> Result<()> {
    if let Some((_, mass)) = cfg.payload.iter().find(|(_, mass)| !(mass.is_finite() && *mass >= 0.0)) {
        let expected = "a payload must be a finite mass >= 0 kg";
        return Err(Error::Config { field: "payload", value: mass.to_string(), expected });
    }
    let names: Vec<&str> = description.named_links().iter().map(|link| link.name.as_str()).collect();
    let payloads = pattern::assign(&cfg.payload, &BTreeMap::new(), &names, "link")
        .map_err(|error| Error::Payload { robot: (&cfg.uid).into(), error: Box::new(error) })?;
    for (link, payload) in description.links.iter_mut().zip(payloads) {
        let Some(payload) = payload.filter(|mass| *mass > 0.0) else { continue };
        match &mut link.inertial {
            // A point at the center of mass changes neither the center of mass nor the inertia about it.
            Some(inertial) => inertial.mass += payload,
            None => link.inertial = Some(solid_ball_inertial(link, payload, 1000.0)),
        }
    }
    Ok(())
}

/// Creates an error about an unknown name, with the nearest existing names.
pub(super) fn unknown_name_error<'n>(
    what: &'static str,
    name: &str,
    names: impl IntoIterator<Item = &'n str>,
) -> Error {
    let candidates = pattern::closest_names(name, names).into_iter().map(str::to_string).collect();
    Error::UnknownName { what, name: name.into(), candidates }
}

pub(crate) fn check_pose(field: &'static str, pose: &Pose) -> Result<()> {
    let fail = |expected| Err(Error::Config { field, value: format!("{:?}", to_row(pose)), expected });
    if !to_row(pose).iter().all(|x| x.is_finite()) {
        return fail("every number must be finite");
    }
    if (pose.rotation.norm() - 1.0).abs() > 1e-6 {
        return fail("its rotation must be a unit quaternion (w, x, y, z in the last four numbers)");
    }
    Ok(())
}

/// Checks the integrator: implicit drives need one that adds nothing to the acceleration that the solver found: Euler,
/// or implicitfast on MuJoCo 4.x.
fn check_integrator(cfg: &RobotCfg, role: &RobotKind, plans: &[JointPlan], integrator: Integrator) -> Result<()> {
    let allowed = match integrator {
        Integrator::Euler => true,
        Integrator::ImplicitFast => mj::BUILD_VERSION == mj::SupportedVersion::V4,
        Integrator::Rk4 | Integrator::Implicit => false,
    };
    // Joints that are passive, follow other joints or have an explicit model have no friction row.
    let row = |plan: &JointPlan| plan.actuator.is_some() && plan.model.is_none();
    if cfg.drive.model == DriveModel::Implicit && plans.iter().any(row) && !allowed {
        let also = if mj::BUILD_VERSION == mj::SupportedVersion::V4 { " or implicitfast" } else { "" };
        return Err(Error::Integrator { robot: role.label(&cfg.uid), integrator: integrator.name(), also });
    }
    Ok(())
}
