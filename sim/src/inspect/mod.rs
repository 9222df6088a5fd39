//! Description of a robot without a simulation ([`describe`]), and a report on it ([`inspect`]): tree, mass properties,
//! dynamics at a position, and warnings.
//!
//! [`inspect`] reads the files as [`SimulationManager::add_robot`](crate::SimulationManager::add_robot) does, meshes
//! and convex hulls included. It finds the same warnings except those about start positions. For an MJCF file, warnings
//! from compiling the scene are missing too. Masses and dynamics are those of the files, computed by
//! [`dynamics`](kinetoscope_robot::dynamics). Missing inertias are completed from shapes if
//! [`MissingInertia`](kinetoscope_robot::urdf::MissingInertia) says so; nothing else is repaired. Only MJCF files need
//! MuJoCo, which compiles them alone.

mod report;
mod text;

pub use report::{JointReport, LinkReport, MimicReport, ReportWarning, RobotReport};

use crate::drive::DriveCfg;
use crate::drive::plan::{coupling_curve, followed_position, plan};
use crate::error::Error;
use crate::objects::mjcf_file::MjcfFile;
use crate::objects::robot::RobotCfg;
use crate::objects::robot_data::describe_robot;
use crate::pattern::{closest_names, format_candidates};
use kinetoscope_robot::body_inertia::{fuse, rigid_bodies};
use kinetoscope_robot::description::{CouplingPolynomial, Geometry, JointId, JointKind, RobotDescription};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_robot::dynamics::{Configuration, Dynamics, DynamicsError};
use kinetoscope_robot::shape_inertia::HullSet;
use kinetoscope_robot::urdf::{MergedRobot, UrdfCfg, assemble};
use kinetoscope_scene::mesh::load;
use kinetoscope_scene::source_location::SourceLocation;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, HashMap};
use std::path::PathBuf;

/// Gravity \[m/s²\].
const GRAVITY: Vector3<f64> = Vector3::new(0.0, 0.0, -9.81);
/// Largest difference between a given position of a mimic joint and the one that its driver implies without a warning
/// \[rad or m\].
const MIMIC_TOLERANCE: f64 = 1e-6;

/// Robot files and position to inspect.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct InspectCfg {
    /// The URDF files; empty if `mjcf` is set.
    pub urdf: UrdfCfg,
    /// The MJCF file of the robot ([`RobotCfg::mjcf`]), instead of URDF files. For a body with several joints, the
    /// report has a massless link between consecutive joints.
    pub mjcf: Option<MjcfFile>,
    /// True for a floating base: its six degrees of freedom are part of the dynamics. Default false: a fixed base.
    pub floating_base: bool,
    /// Positions \[rad or m\] by joint name. Joints without a position are at 0, or at `ref` of an MJCF file. Joints
    /// that follow others (mimic joints, or curves of an MJCF file) have the implied position.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub qpos: Vec<(String, f64)>,
}

/// An error of [`inspect`].
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum InspectError {
    /// The files cannot be loaded.
    #[error(transparent)]
    Load(Box<Error>),
    /// A position is given for a joint that does not exist.
    #[error("qpos: unknown joint {name:?}; {}", format_candidates(.candidates, *.total))]
    JointUnknown {
        /// The name given.
        name: String,
        /// Joints that have a position, closest name first.
        candidates: Vec<String>,
        /// Number of joints that have a position; `candidates` may be fewer.
        total: usize,
    },
    /// A position is given for a joint with no or several degrees of freedom: fixed, floating or planar.
    #[error("{at}: qpos: joint {name:?} is {kind}; only revolute, continuous and prismatic joints have a position")]
    JointUnmovable {
        /// File and line of the joint.
        at: SourceLocation,
        /// Name of the joint.
        name: String,
        /// Type of the joint.
        kind: &'static str,
    },
    /// Two positions are given for one joint.
    #[error("qpos: joint {name:?} has two positions, {first} and {second}; give one")]
    PositionRepeated {
        /// Name of the joint.
        name: String,
        /// First position \[rad or m\].
        first: f64,
        /// Second position \[rad or m\].
        second: f64,
    },
    /// A position is infinite or not a number.
    #[error("qpos: joint {name:?} is at {value}, which is not finite")]
    PositionNotFinite {
        /// Name of the joint.
        name: String,
        /// Position given \[rad or m\]: infinite or NaN.
        value: f64,
    },
    /// Dynamics cannot be computed.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
}

impl InspectCfg {
    /// All files, as given.
    fn files(&self) -> impl Iterator<Item = &PathBuf> {
        self.urdf.components.iter().map(|c| &c.urdf).chain(self.mjcf.iter().map(|file| &file.path))
    }
}

impl From<Error> for InspectError {
    fn from(error: Error) -> Self {
        Self::Load(Box::new(error))
    }
}

/// Reads the files of a robot without a simulation, and returns its description with the warnings about the files: URDF
/// files are merged as they are, an MJCF file is compiled by MuJoCo. Mass properties are those of the files, and
/// payloads are not added. [`Chain`](kinetoscope_robot::kinematics::Chain) takes the description.
///
/// ```
/// use kinetoscope_robot::kinematics::Chain;
/// use kinetoscope_sim::inspect::describe;
/// use kinetoscope_sim::{MjcfFile, RobotCfg};
///
/// let slide = r#"<mujoco><worldbody><body name="base"><geom size="0.1"/>
///     <body name="cart" pos="0 0 0.5"><joint name="slide" type="slide" axis="0 0 1"/><geom size="0.1"/></body>
///   </body></worldbody></mujoco>"#;
/// let robot = describe(&RobotCfg { mjcf: Some(MjcfFile::text(slide)), ..Default::default() })?.description;
/// let cart = robot.link_id("cart").ok_or("no cart")?;
/// let chain = Chain::new(&robot, cart, &kinetoscope_scene::Pose::identity())?;
/// assert!((chain.pose(&[0.2]).translation.z - 0.7).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
///
/// # Errors
/// A file or the configuration of the files is invalid.
pub fn describe(cfg: &RobotCfg) -> Result<MergedRobot, Error> {
    if cfg.mjcf.is_none() {
        return Ok(assemble(&cfg.urdf)?);
    }
    let mut hulls = HullSet::new(&cfg.hull);
    let (_, description, diagnostics) = describe_robot(cfg, &(&cfg.uid).into(), 0, None, &mut hulls)?;
    Ok(MergedRobot { description, diagnostics })
}

/// Reads the files and creates the report.
///
/// # Errors
/// The files cannot be loaded as a robot, a position is invalid, or the dynamics cannot be computed.
pub fn inspect(cfg: &InspectCfg) -> Result<RobotReport, InspectError> {
    let robot = RobotCfg {
        urdf: cfg.urdf.clone(),
        mjcf: cfg.mjcf.clone(),
        fix_base: !cfg.floating_base,
        ..RobotCfg::default()
    };
    let mut hulls = HullSet::new(&robot.hull);
    let (file, description, mut diagnostics) = describe_robot(&robot, &(&robot.uid).into(), 0, None, &mut hulls)?;
    let configuration = configuration(&description, cfg, &mut diagnostics)?;
    hulls.of_collisions(&description).map_err(Error::from)?;
    check_visual_meshes(&description, &mut diagnostics);
    // Inertias of an MJCF file have already been checked by MuJoCo.
    if file.is_none() {
        for body in rigid_bodies(&description, cfg.floating_base) {
            fuse(&description, &body, &mut diagnostics);
        }
    }
    diagnostics.extend(joint_diagnostics(&description, cfg.floating_base)?);
    sort_by_location(&mut diagnostics, cfg);
    let kinematics = Dynamics::new(&description, &configuration)?;
    let qpos = configuration.resolved_positions(&description)?;
    Ok(RobotReport::new(cfg, &description, &kinematics, qpos, &GRAVITY, &diagnostics))
}

/// Returns the configuration with the positions of `cfg.qpos`; other joints have the start position of the MJCF file,
/// else 0. Adds a warning for a given position of a joint that an equality or mimic relation puts elsewhere.
fn configuration(
    description: &RobotDescription,
    cfg: &InspectCfg,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Configuration, InspectError> {
    let drivable: Vec<JointId> = description.drivable_joints().map(|(id, _)| id).collect();
    let mut given: Vec<Option<f64>> = vec![None; drivable.len()];
    for (name, value) in &cfg.qpos {
        let Some(id) = description.joint_id(name) else {
            let names = drivable.iter().map(|&id| description.joint(id).name.as_str());
            let candidates = closest_names(name, names).into_iter().map(str::to_owned).collect();
            return Err(InspectError::JointUnknown { name: name.clone(), candidates, total: drivable.len() });
        };
        let joint = description.joint(id);
        let Some(column) = drivable.iter().position(|&d| d == id) else {
            let (at, name, kind) = (joint.source.clone(), name.clone(), joint.kind.name());
            return Err(InspectError::JointUnmovable { at, name, kind });
        };
        if !value.is_finite() {
            return Err(InspectError::PositionNotFinite { name: name.clone(), value: *value });
        }
        if let Some(first) = given[column].replace(*value) {
            return Err(InspectError::PositionRepeated { name: name.clone(), first, second: *value });
        }
    }
    let mut configuration = Configuration::zero(description);
    configuration.floating_base = cfg.floating_base;
    let start = |id: JointId| description.joint(id).defaults.map_or(0.0, |file| file.position);
    let free_position = |id: JointId| {
        let column = drivable.iter().position(|&d| d == id);
        column.and_then(|column| given[column]).unwrap_or_else(|| start(id))
    };
    configuration.joint_positions =
        drivable.iter().map(|&id| followed_position(description, &free_position, id)).collect();
    let resolved = configuration.resolved_positions(description)?;
    for ((id, given), followed) in drivable.into_iter().zip(given).zip(resolved) {
        let joint = description.joint(id);
        let Some(given) = given.filter(|given| (given - followed).abs() > MIMIC_TOLERANCE) else { continue };
        let (source, relation) = match (&joint.mimic, coupling_curve(joint)) {
            (Some(mimic), _) => {
                let driver = &description.joint(description.mimic_driver(id).0).name;
                (&mimic.source, format!("follows {driver:?} to"))
            }
            (None, Some(CouplingPolynomial { joint: Some(driver), .. })) => {
                (&joint.source, format!("follows {:?} to", description.joint(driver).name))
            }
            (None, Some(CouplingPolynomial { joint: None, .. })) => (&joint.source, "is held at".to_owned()),
            (None, None) => continue,
        };
        let message =
            format!("joint {:?} {relation} {followed}; the position {given} given for it was ignored", joint.name);
        diagnostics.push(Diagnostic::new(DiagnosticKind::MimicPositionIgnored, source.clone(), message));
    }
    Ok(configuration)
}

/// Adds a warning for every visual mesh that exists but cannot be read. Missing meshes already have a warning.
fn check_visual_meshes(description: &RobotDescription, diagnostics: &mut Vec<Diagnostic>) {
    let mut faults: HashMap<&std::path::Path, Option<String>> = HashMap::new();
    for link in &description.links {
        for visual in &link.visuals {
            let Geometry::Mesh { uri, path, .. } = &visual.geometry else { continue };
            if !path.is_file() {
                continue;
            }
            let fault = faults.entry(path).or_insert_with(|| load(path).err().map(|e| e.to_string()));
            if let Some(fault) = fault {
                let message = format!(
                    "link {:?}: visual mesh {uri:?} cannot be used: {fault}; the visual is left out",
                    link.name
                );
                diagnostics.push(Diagnostic::new(DiagnosticKind::VisualMeshInvalid, visual.source.clone(), message));
            }
        }
    }
}

/// Warnings about joint limits, such as ranges of mimic joints.
fn joint_diagnostics(description: &RobotDescription, floating_base: bool) -> Result<Vec<Diagnostic>, InspectError> {
    let planned = plan(description, &DriveCfg::default(), &BTreeMap::new(), &[], floating_base);
    let (_, mut diagnostics) =
        planned.map_err(|error| Error::DrivePlan { robot: (&description.name).into(), error: Box::new(error) })?;
    // Start positions belong to a simulation, not to the files.
    let of_start = [DiagnosticKind::InitialPositionClamped, DiagnosticKind::FollowerStartsBeyondLimits];
    diagnostics.retain(|d| !of_start.contains(&d.kind));
    Ok(diagnostics)
}

/// Sorts by file in the given order, then by line. Diagnostics without a location come first, other files last.
fn sort_by_location(diagnostics: &mut [Diagnostic], cfg: &InspectCfg) {
    let files: Vec<_> = cfg.files().collect();
    diagnostics.sort_by_key(|d| {
        d.source.as_ref().map(|s| (files.iter().position(|f| **f == *s.file).unwrap_or(usize::MAX), s.line))
    });
}

/// Names of the generalized velocities of floating and planar joints, which follow those of the base and of the
/// drivable joints.
fn free_joint_columns(description: &RobotDescription) -> Vec<String> {
    let mut columns = Vec::new();
    for joint in &description.joints {
        let parts: &[&str] = match joint.kind {
            JointKind::Floating => &FREE_COLUMNS,
            JointKind::Planar => &["vx", "vy", "wz"],
            _ => &[],
        };
        columns.extend(parts.iter().map(|part| format!("{}.{part}", joint.name)));
    }
    columns
}

/// Components of a free velocity: of the origin along x, y, z, then angular about x, y, z.
const FREE_COLUMNS: [&str; 6] = ["vx", "vy", "vz", "wx", "wy", "wz"];
