//! Resolved drive plan of every joint of a robot: limits, drive, friction, start position. The stage between
//! `RobotDescription` and MJCF.

use super::cfg::{DEFAULT_DAMPING, DEFAULT_STIFFNESS, DriveCfg, DriveCfgError, JointGains, resolve};
use super::gains::{DriveSetting, Gains};
use super::models::ActuatorModel;
use super::{DriveType, JointInfo, PdGains};
use crate::pattern::{self, PatternError};
use kinetoscope_robot::description::{CouplingPolynomial, FileActuation, Joint, JointId, RobotDescription};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_robot::dynamics::{Configuration, Dynamics, DynamicsError};
use kinetoscope_robot::position_range::{PositionRange, position_ranges};
use nalgebra::DMatrix;
use std::collections::BTreeMap;

/// Resolved properties of one drivable joint (revolute, continuous, prismatic), mimic and passive joints included.
#[derive(Clone, Debug, PartialEq)]
pub struct JointPlan {
    /// Id of the joint in the description.
    pub joint: JointId,
    /// Gains of its actuator; `None` for passive and mimic joints.
    pub actuator: Option<PdGains>,
    /// Explicit actuator model; `None` for a joint with the robot's drive model, and for passive and mimic joints.
    pub model: Option<ActuatorModel>,
    /// Drive type, stiffness and damping, in the unit of the drive type: from the configuration, else the file, else
    /// defaults. The actuator's gains are computed from them. A joint that an MJCF file couples by a nonlinear
    /// equality, or leaves passive and that has no configured gains or model, has [`DriveType::None`].
    pub setting: DriveSetting,
    /// Effort limit \[N m or N\]; infinite without a limit.
    pub max_effort: f64,
    /// Velocity limit \[rad/s or m/s\]; infinite without a limit. It is the no-load speed of a
    /// [`DcMotor`](crate::DcMotor); other drives do not enforce it.
    pub max_velocity: f64,
    /// Dry friction \[N m or N\]: that of the configuration, else that of the file, else 0.
    pub friction: f64,
    /// Rotor inertia \[kg m² or kg\]: that of the configuration, else that of an MJCF file, else 0.
    pub armature: f64,
    /// Viscous damping of the joint itself, from the file, else 0 \[N m s/rad or N s/m\]. It adds to the damping of the
    /// drive.
    pub damping: f64,
    /// The joint's own position limits \[rad or m\]; `None` without limits. A mimic joint whose limits leave its driver
    /// at most 1 % of the driver's own range has the limits that follow from the driver's range.
    pub limit: Option<[f64; 2]>,
    /// Range of position targets \[rad or m\]: the joint's own limits, narrowed by those of joints that mimic it;
    /// infinite without limits.
    pub target_range: [f64; 2],
    /// Mimic relation (driver, multiplier, offset) with chains resolved: `position = multiplier * position(driver) +
    /// offset`. `None` for a joint that is not a mimic joint.
    pub mimic: Option<(JointId, f64, f64)>,
    /// Start position \[rad or m\].
    pub initial: f64,
}

/// An error of the drive settings of a robot, from [`add_robot`](crate::SimulationManager::add_robot).
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A drive property is invalid.
    #[error(transparent)]
    Drive(#[from] DriveCfgError),
    /// A key of the start positions is invalid.
    #[error("init_qpos: {0}")]
    InitialPattern(#[source] PatternError),
    /// A start position is not finite, given or derived.
    #[error("init_qpos of joint {joint:?} is {value}, not a finite number")]
    InitialValue {
        /// The joint.
        joint: String,
        /// The position given or derived \[rad or m\].
        value: f64,
    },
    /// An actuator model does not fit its joint.
    #[error("drive.actuators: {model} of joint {joint:?}: {reason}")]
    ActuatorModel {
        /// The joint.
        joint: String,
        /// Name of the model.
        model: &'static str,
        /// The problem and the fix.
        reason: String,
    },
    /// The drive type needs the dynamics of the description, which cannot be computed.
    #[error(transparent)]
    Dynamics(#[from] DynamicsError),
}

/// Resolves all drivable joints of `description`, in its order.
///
/// # Errors
/// A pattern or a value of the configuration is invalid, an actuator model does not fit its joint, or the drive type
/// needs dynamics that cannot be computed.
pub fn plan(
    description: &RobotDescription,
    drive: &DriveCfg,
    parts: &BTreeMap<String, Vec<usize>>,
    init_qpos: &[(String, f64)],
    floating_base: bool,
) -> Result<(Vec<JointPlan>, Vec<Diagnostic>), PlanError> {
    let joints: Vec<(JointId, &Joint)> = description.drivable_joints().collect();
    let names: Vec<&str> = joints.iter().map(|(_, j)| j.name.as_str()).collect();
    let gains = resolve(drive, &names, parts)?;
    let initial = pattern::assign(init_qpos, parts, &names, "joint").map_err(PlanError::InitialPattern)?;

    let mut diagnostics = Vec::new();
    let ranges = position_ranges(description, &mut diagnostics);
    let mut plans: Vec<JointPlan> = joints
        .iter()
        .zip(&gains)
        .zip(ranges)
        .map(|((&(id, joint), gains), PositionRange { limit, target_range })| {
            let effort = joint.limit.as_ref().and_then(|l| l.effort).filter(|&e| e > 0.0);
            let velocity = joint.limit.as_ref().and_then(|l| l.velocity).filter(|&v| v > 0.0);
            JointPlan {
                joint: id,
                actuator: None,
                model: gains.actuator,
                setting: drive_setting(joint, drive.drive_type, gains),
                max_effort: gains.max_effort.or(effort).unwrap_or(f64::INFINITY),
                max_velocity: gains.max_velocity.or(velocity).unwrap_or(f64::INFINITY),
                friction: gains.friction.or(joint.friction).unwrap_or(0.0),
                armature: gains.armature.or(joint.defaults.map(|file| file.armature)).unwrap_or(0.0),
                damping: joint.damping.unwrap_or(0.0),
                limit,
                target_range,
                mimic: joint.mimic.as_ref().map(|_| description.mimic_driver(id)),
                initial: 0.0,
            }
        })
        .collect();
    set_initial_positions(description, &mut plans, &initial, &mut diagnostics)?;

    if drive.drive_type.mode().needs_inertia() {
        let inertias = effective_inertias(description, &plans, floating_base)?;
        for (plan, inertia) in plans.iter_mut().zip(inertias) {
            plan.setting.inertia = Some(inertia);
        }
    }
    for plan in plans.iter_mut().filter(|plan| plan.mimic.is_none()) {
        plan.actuator = plan.setting.torque_gains();
    }
    for plan in &mut plans {
        let (Some(actuator), Some(model)) = (plan.actuator, plan.model) else {
            plan.model = None;
            continue;
        };
        let (max_effort, max_velocity) = (plan.max_effort, plan.max_velocity);
        let gains = Gains { kp: actuator.kp, kd: actuator.kd, max_effort, max_velocity };
        model.law().check(&gains).map_err(|reason| PlanError::ActuatorModel {
            joint: description.joint(plan.joint).name.clone(),
            model: model.law().name(),
            reason,
        })?;
    }
    Ok((plans, diagnostics))
}

/// Returns the setting of a joint's drive: from the configuration, else the file, else EmbodiChain's defaults. A joint
/// that is passive in its file is driven only if the configuration sets its stiffness, damping or actuator model. A
/// joint that a coupling moves is never driven.
fn drive_setting(joint: &Joint, drive_type: DriveType, gains: &JointGains) -> DriveSetting {
    let of_file = joint.defaults.map_or(FileActuation::Unspecified, |file| file.drive);
    // The file's gains are in torque units. For a unit that needs the inertia, they cannot be converted here.
    let mode = drive_type.mode();
    let unit = mode.gain_scale(&JointInfo { effective_inertia: f64::NAN }).filter(|_| !mode.needs_inertia());
    let (stiffness, damping) = match (of_file, unit) {
        (FileActuation::Servo { stiffness, damping }, Some(unit)) => (Some(stiffness / unit), Some(damping / unit)),
        _ => (None, None),
    };
    let named = gains.stiffness.is_some() || gains.damping.is_some() || gains.actuator.is_some();
    let driven = match of_file {
        FileActuation::Coupled(_) => false,
        FileActuation::Passive => named,
        FileActuation::Unspecified | FileActuation::Effort | FileActuation::Servo { .. } => true,
    };
    DriveSetting {
        drive_type: if driven { drive_type } else { DriveType::None },
        stiffness: gains.stiffness.or(stiffness).unwrap_or(DEFAULT_STIFFNESS),
        damping: gains.damping.or(damping).unwrap_or(DEFAULT_DAMPING),
        inertia: None,
    }
}

/// Tolerance for limits that are written with few digits \[rad or m\].
const LIMIT_TOLERANCE: f64 = 1e-6;

fn set_initial_positions(
    description: &RobotDescription,
    plans: &mut [JointPlan],
    initial: &[Option<f64>],
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<(), PlanError> {
    let follows = |plan: &JointPlan| plan.mimic.is_some() || coupling_curve(description.joint(plan.joint)).is_some();
    for (plan, value) in plans.iter_mut().zip(initial) {
        let joint = description.joint(plan.joint);
        let wanted = value.or(joint.defaults.map(|file| file.position)).unwrap_or(0.0);
        if !wanted.is_finite() {
            return Err(PlanError::InitialValue { joint: joint.name.clone(), value: wanted });
        }
        plan.initial = wanted.clamp(plan.target_range[0], plan.target_range[1]);
        if !follows(plan) && plan.initial != wanted {
            diagnostics.push(Diagnostic::new(
                DiagnosticKind::InitialPositionClamped,
                joint.source.clone(),
                format!(
                    "joint {:?}: the start position {wanted} is outside of {:.4} .. {:.4}; it starts at {:.4}",
                    joint.name, plan.target_range[0], plan.target_range[1], plan.initial
                ),
            ));
        }
    }
    for i in (0..plans.len()).filter(|&i| follows(&plans[i])).collect::<Vec<_>>() {
        let of_plan = |joint| plans.iter().find(|plan| plan.joint == joint).map_or(0.0, |plan| plan.initial);
        let (joint, initial) =
            (description.joint(plans[i].joint), followed_position(description, &of_plan, plans[i].joint));
        if !initial.is_finite() {
            return Err(PlanError::InitialValue { joint: joint.name.clone(), value: initial });
        }
        plans[i].initial = initial;
        let Some([low, high]) = plans[i].limit else { continue };
        if initial < low - LIMIT_TOLERANCE || initial > high + LIMIT_TOLERANCE {
            diagnostics.push(Diagnostic::new(
                DiagnosticKind::FollowerStartsBeyondLimits,
                joint.source.clone(),
                format!(
                    "joint {:?}: it starts at {initial:.4}, implied by the joint that it follows, outside of {low:.4} .. {high:.4}",
                    joint.name
                ),
            ));
        }
    }
    Ok(())
}

/// Coupling curve of a joint that follows another one in an MJCF file; `None` for any other joint, and for a coupling
/// without a curve.
pub(crate) fn coupling_curve(joint: &Joint) -> Option<CouplingPolynomial> {
    match joint.defaults?.drive {
        FileActuation::Coupled(curve) => curve,
        _ => None,
    }
}

/// Position of a joint \[rad or m\], with mimic couplings and coupling curves resolved. Couplings must be acyclic.
/// `free_position` gives the positions of joints that follow no other.
pub(crate) fn followed_position(
    description: &RobotDescription,
    free_position: &dyn Fn(JointId) -> f64,
    joint: JointId,
) -> f64 {
    let (driver, multiplier, offset) = description.mimic_driver(joint);
    let at_driver = match coupling_curve(description.joint(driver)) {
        Some(curve) => curve.position(
            curve.joint.map_or(curve.driver_start, |joint| followed_position(description, free_position, joint)),
        ),
        None => free_position(driver),
    };
    if driver == joint { at_driver } else { multiplier * at_driver + offset }
}

/// The joint-space inertia of a robot at its start positions.
#[derive(Clone, Debug, PartialEq)]
pub struct StartInertia {
    /// The matrix with rotor inertias \[kg m², kg m or kg\]; a floating base has the first six columns.
    pub matrix: DMatrix<f64>,
    /// Column of each drivable joint.
    pub columns: Vec<usize>,
}

/// Computes the joint-space inertia at the start positions.
///
/// # Errors
/// The dynamics of the description cannot be computed.
pub(crate) fn mass_matrix_at_start(
    description: &RobotDescription,
    plans: &[JointPlan],
    floating_base: bool,
) -> Result<StartInertia, DynamicsError> {
    let mut configuration = Configuration::zero(description);
    configuration.floating_base = floating_base;
    configuration.joint_positions = plans.iter().map(|p| p.initial).collect();
    let kinematics = Dynamics::new(description, &configuration)?;
    let mut matrix = kinematics.mass_matrix();
    let columns: Vec<usize> = plans.iter().map(|p| kinematics.dof_range(p.joint).start).collect();
    for (plan, &column) in plans.iter().zip(&columns) {
        matrix[(column, column)] += plan.armature;
    }
    Ok(StartInertia { matrix, columns })
}

/// Computes the inertia that each drivable joint feels at the start positions, `1 / (M⁻¹)_ii` \[kg m² or kg\]; the
/// plain diagonal for a singular matrix.
///
/// # Errors
/// The dynamics of the description cannot be computed.
pub fn effective_inertias(
    description: &RobotDescription,
    plans: &[JointPlan],
    floating_base: bool,
) -> Result<Vec<f64>, DynamicsError> {
    let start = mass_matrix_at_start(description, plans, floating_base)?;
    let inverse = start.matrix.clone().cholesky().map(|factor| factor.inverse());
    let felt = |&i: &usize| inverse.as_ref().map_or(start.matrix[(i, i)], |inverse| 1.0 / inverse[(i, i)]);
    Ok(start.columns.iter().map(felt).collect())
}
