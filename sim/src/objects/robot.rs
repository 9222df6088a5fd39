//! Robots: the loaded robot, and its views of a running simulation.

pub use super::robot_cfg::RobotCfg;

use crate::compile::{JointIndexing, RobotIndex, Simulation};
use crate::drive::plan::{JointPlan, plan};
use crate::drive::table::{DriveState, Gains};
use crate::drive::{ActuatorSpec, DriveModel};
use crate::error::{Error, Result};
use crate::manager::EnvId;
use crate::mjcf::document::Integrator;
use crate::mjcf::robot_file::{Loading, RobotFile, RobotFileError};
use crate::named::Named;
use crate::objects::free_body::{FreeBody, FreeBodyMut, body_pose};
use crate::objects::rows::{Numbers, Rows, Table, check_named_once, distinct_envs};
use crate::pattern;
use crate::sensor_list::SensorList;
use crate::simulation_cfg::SimulationManagerCfg;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_mujoco as mj;
use kinetoscope_robot::description::{LinkId, RobotDescription};
use kinetoscope_robot::diagnostic::Diagnostic;
use kinetoscope_robot::mesh_key::MeshKey;
use kinetoscope_robot::shape_inertia::{Hulls, ball, complete};
use kinetoscope_robot::urdf::{Assembly, assemble};
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::pose::to_row;
use ndarray::{Array2, ArrayView2, AsArray, Ix2};
use std::collections::BTreeMap;
use std::sync::Arc;

/// Column of a joint in `get_qpos` and its kin.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct JointIndex(pub usize);

/// A loaded robot: everything about it that does not change while the simulation runs.
#[derive(Clone, Debug)]
pub struct RobotData {
    cfg: RobotCfg,
    description: RobotDescription,
    plans: Vec<JointPlan>,
    joint_names: Vec<String>,
    parts: BTreeMap<String, Vec<usize>>,
    hulls: BTreeMap<MeshKey, TriMesh>,
    /// The MJCF file that it is; `None` where it is made of URDF files.
    file: Option<RobotFile>,
    first_mask_id: i32,
    role: Role,
    /// What is known of the surfaces of some links besides.
    surfaces: Vec<(usize, SurfaceCfg)>,
}

/// What it was added as.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Role {
    /// By `add_robot`.
    Robot,
    /// By `add_articulation`, with its semantic class.
    Articulation(String),
}

impl Role {
    /// How errors call it.
    fn named(&self, uid: &str) -> Named {
        let what = match self {
            Self::Robot => "robot",
            Self::Articulation(_) => "articulation",
        };
        Named { what, uid: uid.into() }
    }
}

impl RobotData {
    /// Reads the files, resolves names, drives and meshes of robot number `index` of a simulation, whose model is `scene` so
    /// far.
    pub(crate) fn load(
        cfg: RobotCfg,
        role: Role,
        manager: &SimulationManagerCfg,
        (index, scene): (usize, &mj::Model),
        first_mask_id: i32,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Self> {
        check_pose("init_pose", &cfg.init_pose)?;
        if let Some(clearance) = cfg.ground_clearance.filter(|clearance| !clearance.is_finite()) {
            let (value, expected) = (clearance.to_string(), "it must be a finite height in metres, such as 0");
            return Err(Error::Config { field: "ground_clearance", value, expected });
        }
        if !(0.0..=1.0).contains(&cfg.soft_limit_factor) {
            let (value, expected) = (cfg.soft_limit_factor.to_string(), "the share of a joint's range must be 0 to 1");
            return Err(Error::Config { field: "soft_limit_factor", value, expected });
        }
        for component in &cfg.urdf.components {
            check_pose("component transform", &component.transform)?;
        }
        let mut hulls = Hulls::new(&cfg.hull);
        let (file, mut description, mut found) =
            described(&cfg, &role.named(&cfg.uid), index, Some(scene), &mut hulls)?;
        load_up(&mut description, &cfg)?;
        let surfaces = surfaces(&description, &cfg, &role)?;
        let joint_names: Vec<String> = description.drivable_joints().map(|(_, j)| j.name.clone()).collect();
        let mut parts = BTreeMap::new();
        for (part, patterns) in &cfg.control_parts {
            let members = pattern::select(patterns, &joint_names, "joint").map_err(|error| Error::ControlPart {
                robot: role.named(&cfg.uid),
                part: part.clone(),
                error: Box::new(error),
            })?;
            if parts.insert(part.clone(), members).is_some() {
                return Err(Error::ControlPartRepeated { robot: role.named(&cfg.uid), part: part.clone() });
            }
        }
        let at_plan = |error| Error::Plan { robot: role.named(&cfg.uid), error: Box::new(error) };
        let (plans, mut planned) =
            plan(&description, &cfg.drive, &parts, &cfg.init_qpos, !cfg.fix_base).map_err(at_plan)?;
        check_integrator(&cfg, &role, &plans, manager.integrator)?;
        found.append(&mut planned);
        let explicit = explicitly_driven(&plans, cfg.drive.model);
        if explicit.iter().any(|plan| plan.actuator.is_some()) {
            let dt = manager.physics_option().timestep;
            found.extend(crate::drive::actuator::warn_if_unstable(&description, &explicit, !cfg.fix_base, dt));
        }
        let hulls = hulls.of_collisions(&description)?;
        diagnostics.append(&mut found);
        Ok(Self { cfg, description, plans, joint_names, parts, hulls, file, first_mask_id, role, surfaces })
    }

    /// Name of the robot.
    pub fn uid(&self) -> &str {
        &self.cfg.uid
    }

    /// The configuration it was added with.
    pub fn cfg(&self) -> &RobotCfg {
        &self.cfg
    }

    /// What is known of the surfaces of some links besides.
    pub(crate) fn surfaces(&self) -> &[(usize, SurfaceCfg)] {
        &self.surfaces
    }

    /// What kind of thing it is, for the table of mask ids.
    pub(crate) fn semantic_class(&self) -> &str {
        match &self.role {
            Role::Robot => "robot",
            Role::Articulation(class) => class,
        }
    }

    /// How errors call it.
    pub(crate) fn named(&self) -> Named {
        self.role.named(self.uid())
    }

    /// Whether it was added as a robot, and not as another articulation.
    pub(crate) fn is_robot(&self) -> bool {
        self.role == Role::Robot
    }

    /// The merged robot as its files describe it, with its payloads.
    pub fn description(&self) -> &RobotDescription {
        &self.description
    }

    /// Limits and drives of its joints.
    pub fn plans(&self) -> &[JointPlan] {
        &self.plans
    }

    /// Names of the movable joints in the order of the merged URDF, or of the MJCF file.
    pub fn joint_names(&self) -> &[String] {
        &self.joint_names
    }

    /// What the mask channel of cameras says of a link.
    pub(crate) fn mask_id(&self, link: usize) -> i32 {
        self.first_mask_id + link as i32
    }

    /// Names of the tendons of its MJCF file. Their numbers in the mask channel follow those of its links.
    pub(crate) fn tendons(&self) -> &[String] {
        self.file.as_ref().map_or(&[], |file| file.tendon_names())
    }

    /// The MJCF file that it is; `None` where it is made of URDF files.
    pub fn file(&self) -> Option<&RobotFile> {
        self.file.as_ref()
    }

    /// Something of its MJCF file is wrong.
    pub(crate) fn file_error(&self, error: RobotFileError) -> Error {
        file_error(&self.cfg, self.named(), error)
    }

    /// Pose of the root link at the start.
    pub(crate) fn root_pose(&self) -> Pose {
        self.file.as_ref().map_or(self.cfg.init_pose, |file| self.cfg.init_pose * file.root_pose())
    }

    /// Moves the start along z \[m\].
    pub(super) fn raise(&mut self, by: f64) {
        self.cfg.init_pose.translation.z += by;
    }

    pub(crate) fn hulls(&self) -> &BTreeMap<MeshKey, TriMesh> {
        &self.hulls
    }
}

fn file_error(cfg: &RobotCfg, robot: Named, error: RobotFileError) -> Error {
    let path = cfg.mjcf.as_ref().map(|file| file.path.display().to_string());
    Error::RobotFile { robot, file: path.unwrap_or_default(), error: Box::new(error) }
}

/// The robot as its files describe it, without payloads, and what is odd in them; where there is a `scene`, also what of the
/// settings of its MJCF file is not the scene's.
pub(crate) fn described(
    cfg: &RobotCfg,
    named: &Named,
    index: usize,
    scene: Option<&mj::Model>,
    hulls: &mut Hulls<'_>,
) -> Result<(Option<RobotFile>, RobotDescription, Vec<Diagnostic>)> {
    let Some(file) = &cfg.mjcf else {
        let Assembly { mut description, mut diagnostics } = assemble(&cfg.urdf)?;
        complete(&mut description, cfg.urdf.missing_inertia, !cfg.fix_base, hulls, &mut diagnostics)?;
        return Ok((None, description, diagnostics));
    };
    if !cfg.urdf.components.is_empty() {
        let expected = "a robot is one MJCF file, or made of URDF files; leave out mjcf or the components of urdf";
        return Err(Error::Config { field: "mjcf", value: format!("{:?}", file.path), expected });
    }
    let mut found = Vec::new();
    let (fix_base, self_collision) = (cfg.fix_base, cfg.self_collision);
    let loading = Loading { uid: &cfg.uid, named, index, fix_base, self_collision, scene };
    let (file, description) =
        RobotFile::load(file, &loading, |error| file_error(cfg, named.clone(), error), &mut found)?;
    Ok((Some(file), description, found))
}

/// The joints with the gains of those drives that are evaluated at the start of a step, and of no others; the damping is the
/// largest that the model of the joint can show.
fn explicitly_driven(plans: &[JointPlan], model: DriveModel) -> Vec<JointPlan> {
    let explicit = |plan: &JointPlan| {
        let spec = plan.actuator?;
        match plan.model {
            Some(law) => {
                let (max_effort, max_velocity) = (plan.max_effort, plan.max_velocity);
                let kd = law.law().damping(&Gains { kp: spec.kp, kd: spec.kd, max_effort, max_velocity });
                Some(ActuatorSpec { kd, ..spec })
            }
            None => Some(spec).filter(|_| model == DriveModel::Actuator),
        }
    };
    plans.iter().map(|plan| JointPlan { actuator: explicit(plan), ..plan.clone() }).collect()
}

/// Adds what links carry.
fn load_up(description: &mut RobotDescription, cfg: &RobotCfg) -> Result<()> {
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
            // A point in the centre of mass: neither the centre nor the inertia about it change.
            Some(inertial) => inertial.mass += payload,
            None => link.inertial = Some(ball(link, payload, 1000.0)),
        }
    }
    Ok(())
}

/// What the configuration says of the surfaces of links.
fn surfaces(description: &RobotDescription, cfg: &RobotCfg, role: &Role) -> Result<Vec<(usize, SurfaceCfg)>> {
    cfg.surfaces.iter().try_for_each(|(_, surface)| surface.validate())?;
    let names: Vec<&str> = description.links.iter().map(|link| link.name.as_str()).collect();
    let surfaces = pattern::assign(&cfg.surfaces, &BTreeMap::new(), &names, "link")
        .map_err(|error| Error::Surfaces { of: role.named(&cfg.uid), error: Box::new(error) })?;
    Ok(surfaces.into_iter().enumerate().filter_map(|(link, surface)| Some((link, surface?))).collect())
}

/// There is no such name; the nearest of those there are.
#[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
pub(super) fn unknown<'n>(what: &'static str, name: &str, names: impl IntoIterator<Item = &'n str>) -> Error {
    let candidates = pattern::closest(name, names).into_iter().map(str::to_string).collect();
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

/// Implicit drives need an integrator that adds nothing to the acceleration that the solver found.
fn check_integrator(cfg: &RobotCfg, role: &Role, plans: &[JointPlan], integrator: Integrator) -> Result<()> {
    let allowed = match integrator {
        Integrator::Euler => true,
        Integrator::ImplicitFast => mj::TARGET == mj::Target::V4,
        Integrator::Rk4 | Integrator::Implicit => false,
    };
    // Joints that are passive, follow others or have an explicit model have no row.
    let row = |plan: &JointPlan| plan.actuator.is_some() && plan.model.is_none();
    if cfg.drive.model == DriveModel::Implicit && plans.iter().any(row) && !allowed {
        let also = if mj::TARGET == mj::Target::V4 { " or implicitfast" } else { "" };
        return Err(Error::Integrator { robot: role.named(&cfg.uid), integrator: integrator.name(), also });
    }
    Ok(())
}

/// A robot, to read. Arrays have one row per environment and one column per joint, in the order of
/// [`joint_names`](Self::joint_names).
#[derive(Clone, Copy, Debug)]
pub struct Robot<'a> {
    pub(super) data: &'a Arc<RobotData>,
    pub(super) simulation: &'a Simulation,
    index: usize,
}

impl<'a> Robot<'a> {
    pub(crate) fn new(data: &'a Arc<RobotData>, simulation: &'a Simulation, index: usize) -> Self {
        Self { data, simulation, index }
    }

    /// Which of the simulation's robots it is.
    pub(super) fn index(&self) -> usize {
        self.index
    }

    pub(super) fn indexing(&self) -> &'a RobotIndex {
        &self.simulation.robots[self.index]
    }

    /// Name of the robot.
    pub fn uid(&self) -> &'a str {
        self.data.uid()
    }

    /// The merged robot as its files describe it, with its payloads.
    pub fn description(&self) -> &'a RobotDescription {
        self.data.description()
    }

    /// Number of movable joints with one degree of freedom, mimic ones included: the columns of `get_qpos`.
    pub fn dof(&self) -> usize {
        self.data.plans.len()
    }

    /// Names of the movable joints in the order of the merged URDF, or of the MJCF file.
    pub fn joint_names(&self) -> &'a [String] {
        &self.data.joint_names
    }

    /// Names of all links, fused ones included, in the order of the merged URDF; of an MJCF file its bodies, then its named
    /// sites.
    pub fn link_names(&self) -> Vec<&'a str> {
        self.data.description.named_links().iter().map(|l| l.name.as_str()).collect()
    }

    /// Names of the control parts.
    pub fn control_parts(&self) -> Vec<&'a str> {
        self.data.parts.keys().map(String::as_str).collect()
    }

    /// Columns of the joints of a control part, mimic joints included, in the order of its patterns; of all joints where
    /// `part` is `None`. Without the mimic joints: [`get_active_joint_ids`](Self::get_active_joint_ids).
    ///
    /// # Errors
    /// There is no such part; the error lists those there are.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn get_joint_ids<'p>(&self, part: impl Into<Option<&'p str>>) -> Result<Vec<JointIndex>> {
        let Some(part) = part.into() else { return Ok((0..self.dof()).map(JointIndex).collect()) };
        let members = self.data.parts.get(part).ok_or_else(|| unknown("control part", part, self.control_parts()))?;
        Ok(members.iter().map(|&i| JointIndex(i)).collect())
    }

    /// Column of the joint called `name`.
    ///
    /// # Errors
    /// There is no such joint; the error lists the nearest names.
    pub fn joint_id(&self, name: &str) -> Result<JointIndex> {
        self.joint_names()
            .iter()
            .position(|n| n == name)
            .map(JointIndex)
            .ok_or_else(|| unknown("joint", name, self.joint_names().iter().map(String::as_str)))
    }

    /// Whether a joint follows another one.
    ///
    /// # Errors
    /// There is no such joint.
    pub fn is_mimic(&self, joint: JointIndex) -> Result<bool> {
        Ok(self.plan(joint)?.mimic.is_some())
    }

    /// What was made of a joint of the description.
    pub(super) fn plan(&self, joint: JointIndex) -> Result<&JointPlan> {
        let (what, index, count) = ("joint", joint.0, self.data.plans.len());
        self.data.plans.get(index).ok_or(Error::UnknownIndex { what, index, count })
    }

    /// For every joint: the joint it follows, ratio and offset; itself, 1 and 0 where it follows none.
    pub fn mimic_drivers(&self) -> Vec<(JointIndex, f64, f64)> {
        (0..self.dof())
            .map(|i| match self.data.plans[i].mimic {
                Some((driver, multiplier, offset)) => {
                    let driver = self.data.plans.iter().position(|p| p.joint == driver).unwrap_or(i);
                    (JointIndex(driver), multiplier, offset)
                }
                None => (JointIndex(i), 1.0, 0.0),
            })
            .collect()
    }

    /// Joint positions \[rad or m\], shape (N, dof).
    pub fn get_qpos(&self) -> Array2<f64> {
        self.gather(|env, joint| env.data().qpos()[joint.qpos])
    }

    /// Joint velocities \[rad/s or m/s\], shape (N, dof).
    pub fn get_qvel(&self) -> Array2<f64> {
        self.gather(|env, joint| env.data().qvel()[joint.dof])
    }

    /// Efforts of the drives in the last step \[N m or N\], shape (N, dof); 0 for joints without a drive.
    pub fn get_qf(&self) -> Array2<f64> {
        self.gather(|env, joint| joint.drive.map_or(0.0, |d| env.drives.effort[d]))
    }

    /// Position targets \[rad or m\], shape (N, dof); for a mimic joint, what its driver's target implies; the present
    /// position for a joint without a drive.
    pub fn get_target_qpos(&self) -> Array2<f64> {
        let mut targets = self.gather(|env, joint| match joint.drive {
            Some(d) => env.drives.position[d],
            None => env.data().qpos()[joint.qpos],
        });
        for (i, (driver, multiplier, offset)) in self.mimic_drivers().into_iter().enumerate() {
            if driver.0 != i {
                for mut row in targets.rows_mut() {
                    row[i] = multiplier * row[driver.0] + offset;
                }
            }
        }
        targets
    }

    /// Sum of the link masses in the files, and of payloads \[kg\]. Masses that were drawn for an environment are not in it:
    /// see [`properties`](crate::SimulationManager::properties).
    pub fn total_mass(&self) -> f64 {
        self.data.description.total_mass()
    }

    /// Joint positions at the start, which [`reset`](crate::SimulationManager::reset) goes back to \[rad or m\], shape
    /// (N, dof).
    #[doc(alias = "default_joint_pos")]
    pub fn get_default_qpos(&self) -> Array2<f64> {
        let n = self.simulation.batch.num_envs();
        Array2::from_shape_fn((n, self.dof()), |(_, joint)| self.data.plans[joint].initial)
    }

    /// Pose of the root link at the start: rows `[x, y, z, qw, qx, qy, qz]` in the environment \[m\], shape (N, 7).
    pub fn get_default_root_pose(&self) -> Array2<f64> {
        let row = to_row(&self.data.root_pose());
        Array2::from_shape_fn((self.simulation.batch.num_envs(), 7), |(_, k)| row[k])
    }

    /// Pose of the root link in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    pub fn get_root_pose(&self) -> Array2<f64> {
        self.root().poses()
    }

    /// Velocity of the root link's frame, then its angular velocity, in world axes \[m/s, rad/s\], shape (N, 6); 0 where
    /// the base is fixed.
    pub fn get_root_velocity(&self) -> Array2<f64> {
        self.root().velocities()
    }

    /// Place of the link called `name` in [`link_names`](Self::link_names), fused ones included.
    ///
    /// # Errors
    /// There is no such link; the error lists the nearest names.
    pub fn link_id(&self, name: &str) -> Result<LinkId> {
        self.data.description.link_id(name).ok_or_else(|| unknown("link", name, self.link_names()))
    }

    pub(super) fn root(&self) -> FreeBody<'a> {
        FreeBody { simulation: self.simulation, index: self.indexing().root }
    }

    /// Pose of a link, fused ones included, in the environment: rows `[x, y, z, qw, qx, qy, qz]`, shape (N, 7).
    ///
    /// # Errors
    /// There is no such link; the error lists the nearest names.
    pub fn link_pose(&self, name: &str) -> Result<Array2<f64>> {
        let link = self.link_id(name)?;
        let (body, body_from_link) = self.indexing().links[link.0];
        Ok(self.simulation.batch.gather_rows(|env| to_row(&(body_pose(env.data(), body) * body_from_link))))
    }

    pub(super) fn gather(&self, read: impl Fn(&crate::env::Env, &JointIndexing) -> f64) -> Array2<f64> {
        self.simulation.batch.gather(&self.indexing().joints, read)
    }
}

/// A robot, to command and to write. Positions and velocities are its state; accelerations follow from it and from forces,
/// and [writing](Self::write_qacc) them moves nothing.
#[derive(Debug)]
pub struct RobotMut<'a> {
    pub(super) data: &'a Arc<RobotData>,
    pub(super) simulation: &'a mut Simulation,
    pub(super) sensors: &'a mut SensorList,
    pub(super) index: usize,
}

impl<'a> RobotMut<'a> {
    pub(crate) fn new(
        data: &'a Arc<RobotData>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { data, simulation, sensors, index }
    }

    /// The robot, to read.
    pub fn read(&self) -> Robot<'_> {
        Robot::new(self.data, self.simulation, self.index)
    }

    /// Sets position targets \[rad or m\]: rows for `env_ids` (all where `None`; a single row is for all of them), columns
    /// for `joint_ids` (all where `None`). Targets are clamped to the limits; columns of mimic joints are accepted and
    /// ignored.
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice, a value that is not finite; then nothing is
    /// set.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn set_qpos<'t>(
        &mut self,
        targets: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_targets("set_qpos", targets.into(), joint_ids, env_ids, |drives, indexing, _, value| {
            if let Some(drive) = indexing.drive {
                let [low, high] = drives.ranges[drive];
                drives.position[drive] = value.clamp(low, high);
            }
        })
    }

    /// Sets velocity targets \[rad/s or m/s\] of the drives; they stay until changed or reset, and are 0 at first. Rows
    /// and columns as in [`set_qpos`](Self::set_qpos); columns of joints without a drive are accepted and ignored.
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice, a value that is not finite; then nothing is
    /// set.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn set_qvel<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_targets("set_qvel", velocities.into(), joint_ids, env_ids, |drives, indexing, _, value| {
            if let Some(drive) = indexing.drive {
                drives.velocity[drive] = value;
            }
        })
    }

    /// Sets efforts \[N m or N\] that are added to what the drives give, before the sum is clamped to their limits; they
    /// stay until changed or reset, and are 0 at first. A joint without a drive (drive type `None`) gets the effort as it
    /// is, clamped to its own limit. Rows and columns as in [`set_qpos`](Self::set_qpos); columns of mimic joints are
    /// accepted and ignored.
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice, a value that is not finite; then nothing is
    /// set.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn set_qf<'t>(
        &mut self,
        efforts: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_targets("set_qf", efforts.into(), joint_ids, env_ids, |drives, indexing, plan, value| {
            if let Some(drive) = indexing.drive {
                drives.feedforward[drive] = value;
            } else if plan.mimic.is_none() {
                drives.applied[indexing.dof] = value.clamp(-plan.max_effort, plan.max_effort);
            }
        })
    }

    /// Changes what is asked of joints by one number each, after everything was checked.
    fn set_targets(
        &mut self,
        argument: &'static str,
        values: ArrayView2<'_, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
        change: impl Fn(&mut DriveState, &JointIndexing, &JointPlan, f64),
    ) -> Result<()> {
        let write = self.checked(argument, values, joint_ids, env_ids)?;
        let robot = &self.simulation.robots[self.index];
        for (env, row) in write.rows.iter() {
            self.simulation.batch.write(env, |env| {
                for (&joint, &value) in write.joints.iter().zip(row) {
                    change(&mut env.drives, &robot.joints[joint], &self.data.plans[joint], value);
                }
            });
        }
        Ok(())
    }

    /// Writes joint positions \[rad or m\] into the state, clamped to the limits; targets stay. Rows and columns as in
    /// [`set_qpos`](Self::set_qpos); mimic joints are written as given. A forward pass follows, so that everything that
    /// is read afterwards belongs to the new state.
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice, a value that is not finite; then nothing is
    /// written.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_qpos<'t>(
        &mut self,
        positions: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked("write_qpos", positions.into(), joint_ids, env_ids)?;
        let limits: Vec<[f64; 2]> =
            self.data.plans.iter().map(|plan| plan.limit.unwrap_or([f64::MIN, f64::MAX])).collect();
        let addresses = self.addresses(|joint| joint.qpos);
        self.write_joints(&write, |data, joint, value| {
            let [low, high] = limits[joint];
            data.qpos_mut()[addresses[joint]] = value.clamp(low, high);
        });
        Ok(())
    }

    /// Writes joint velocities \[rad/s or m/s\] into the state; targets stay. Rows and columns as in
    /// [`write_qpos`](Self::write_qpos).
    ///
    /// # Errors
    /// As [`write_qpos`](Self::write_qpos).
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_qvel<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked("write_qvel", velocities.into(), joint_ids, env_ids)?;
        let addresses = self.addresses(|joint| joint.dof);
        self.write_joints(&write, |data, joint, value| data.qvel_mut()[addresses[joint]] = value);
        Ok(())
    }

    pub(super) fn addresses(&self, of: impl Fn(&JointIndexing) -> usize) -> Vec<usize> {
        self.simulation.robots[self.index].joints.iter().map(of).collect()
    }

    /// Puts the root link of a robot without a fixed base somewhere: rows `[x, y, z, qw, qx, qy, qz]` in the environment
    /// \[m\] for `env_ids` (all where `None`; a single row is for all of them). Quaternions are normalised; velocities,
    /// which are in world axes, stay. A forward pass follows.
    ///
    /// # Errors
    /// The base is fixed; wrong shape, unknown environment, or one that is named twice, a value that is not finite, a
    /// quaternion of length zero; then nothing is written.
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_root_pose<'t>(&mut self, poses: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.root().write_poses("write_root_pose", poses.into(), env_ids)
    }

    /// Sets the velocity of the root link's frame and its angular velocity, in world axes: rows of 6 \[m/s, rad/s\], as in
    /// [`write_root_pose`](Self::write_root_pose).
    ///
    /// # Errors
    /// As [`write_root_pose`](Self::write_root_pose).
    #[expect(single_use_lifetimes, reason = "anonymous lifetimes in impl Trait are unstable")]
    pub fn write_root_velocity<'t>(
        &mut self,
        velocities: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.root().write_velocities("write_root_velocity", velocities.into(), env_ids)
    }

    pub(super) fn root(&mut self) -> FreeBodyMut<'_> {
        let index = self.simulation.robots[self.index].root;
        FreeBodyMut { simulation: self.simulation, sensors: self.sensors, index, owner: self.data.uid() }
    }

    /// Changes the state of each environment that `write` is for, joint by joint; one forward pass each.
    pub(super) fn write_joints(&mut self, write: &JointRows<'_>, change: impl Fn(&mut mj::Data, usize, f64)) {
        for (env, row) in write.rows.iter() {
            self.simulation.batch.write(env, |env| {
                env.write(|data| write.joints.iter().zip(row).for_each(|(&joint, &value)| change(data, joint, value)));
            });
        }
        self.sensors.refresh(write.rows.envs(), self.simulation);
    }

    /// Checks an argument of a writer before anything is written.
    pub(super) fn checked<'v>(
        &self,
        argument: &'static str,
        values: ArrayView2<'v, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<JointRows<'v>> {
        self.checked_numbers(argument, Numbers::Finite, values, joint_ids, env_ids)
    }

    /// As [`checked`](Self::checked), of numbers of another kind.
    pub(super) fn checked_numbers<'v>(
        &self,
        argument: &'static str,
        numbers: Numbers,
        values: ArrayView2<'v, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<JointRows<'v>> {
        let joints = self.joint_columns(argument, joint_ids)?;
        let of = |column: usize| format!("joint {:?}", self.data.joint_names[joints[column]]);
        let table = Table { argument, meaning: "environments, joints", columns: joints.len(), of: &of };
        let num_envs = self.simulation.batch.num_envs();
        distinct_envs(argument, env_ids, num_envs)?;
        let rows = Rows::check_numbers(table, numbers, values, env_ids, num_envs)?;
        Ok(JointRows { joints, rows })
    }

    /// The joints that are meant, each once, in the order given; all of them where `None`.
    pub(super) fn joint_columns(&self, argument: &'static str, joint_ids: Option<&[JointIndex]>) -> Result<Vec<usize>> {
        let count = self.data.plans.len();
        let exists =
            |index| if index < count { Ok(index) } else { Err(Error::UnknownIndex { what: "joint", index, count }) };
        match joint_ids {
            None => Ok((0..count).collect()),
            Some(ids) => {
                let joints = ids.iter().map(|&JointIndex(index)| exists(index)).collect::<Result<Vec<_>>>()?;
                check_named_once(argument, &joints, &|joint| format!("joint {:?}", self.data.joint_names[joint]))?;
                Ok(joints)
            }
        }
    }
}

/// A checked argument: columns, and one row of values per environment.
pub(super) struct JointRows<'v> {
    pub(super) joints: Vec<usize>,
    pub(super) rows: Rows<'v>,
}
