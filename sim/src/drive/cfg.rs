//! Drive configuration of users, and its resolution to one set of properties per joint.

use super::models::ActuatorModel;
use super::{DriveModel, DriveType};
use crate::pattern::{self, PatternError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One number for all joints, or numbers by joint pattern or control part.
#[derive(Clone, Debug, PartialEq)]
pub enum PerJoint {
    /// Same number for every joint.
    All(f64),
    /// Pairs (pattern or control part, number). Joints without a matching key keep the default; a key without a match,
    /// or two keys for one joint, are an error.
    By(Vec<(String, f64)>),
}

/// Empty: every joint keeps the default.
impl Default for PerJoint {
    fn default() -> Self {
        Self::By(Vec::new())
    }
}

impl From<f64> for PerJoint {
    fn from(value: f64) -> Self {
        Self::All(value)
    }
}

impl<K: Into<String>, const N: usize> From<[(K, f64); N]> for PerJoint {
    fn from(entries: [(K, f64); N]) -> Self {
        Self::By(entries.into_iter().map(|(k, v)| (k.into(), v)).collect())
    }
}

/// Drive properties of a robot. A [`PerJoint`] field is a number for all joints or a map `{pattern: value}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveCfg {
    /// Meaning of stiffness and damping, for all driven joints.
    pub drive_type: DriveType,
    /// Evaluation of the drive law, for joints without an explicit model in `actuators`.
    pub model: DriveModel,
    /// Explicit actuator models by joint pattern or control part; joints without a match are driven by `model`. The
    /// models use the gains and limits below. A joint that the drive type leaves passive has no actuator. Exports
    /// replace the models by MuJoCo actuators with the same gains.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub actuators: Vec<(String, ActuatorModel)>,
    /// Stiffness \[N m/rad or N/m\] for drive type `force`, \[1/s²\] for `acceleration`. If unset, the stiffness of the
    /// position actuators in the file of an [MJCF robot](crate::RobotCfg::mjcf) (drive type `force` only), or else 10⁴.
    pub stiffness: PerJoint,
    /// Damping \[N m s/rad or N s/m\] for drive type `force`, \[1/s\] for `acceleration`. If unset, the damping of the
    /// position and velocity actuators in the file of an MJCF robot (drive type `force` only), or else 10³.
    pub damping: PerJoint,
    /// Effort limit \[N m or N\]; infinite for no limit. If unset, that of the file, where 0 means no limit.
    pub max_effort: Option<PerJoint>,
    /// Velocity limit \[rad/s or m/s\]; infinite for no limit. If unset, that of the URDF, where 0 means no limit.
    /// [`DcMotor`] uses it as the no-load speed; no other drive enforces it.
    ///
    /// [`DcMotor`]: super::DcMotor
    pub max_velocity: Option<PerJoint>,
    /// Dry friction \[N m or N\]; if unset, that of the file. If any value is given, even 0,
    /// [`RobotMut::set_friction`](crate::RobotMut::set_friction) can change the friction of driven joints at run time.
    pub friction: Option<PerJoint>,
    /// Rotor inertia \[kg m² or kg\]; if unset, that of an MJCF file, or else 0.
    /// [`RobotMut::set_armature`](crate::RobotMut::set_armature) changes it at run time.
    pub armature: PerJoint,
}

impl Default for DriveCfg {
    fn default() -> Self {
        Self {
            drive_type: DriveType::Force,
            model: DriveModel::Implicit,
            actuators: Vec::new(),
            stiffness: PerJoint::default(),
            damping: PerJoint::default(),
            max_effort: None,
            max_velocity: None,
            friction: None,
            armature: PerJoint::default(),
        }
    }
}

/// EmbodiChain's default stiffness, for joints without a configured stiffness and without one in their file.
pub(super) const DEFAULT_STIFFNESS: f64 = 1e4;
/// EmbodiChain's default damping, for joints without a configured damping and without one in their file.
pub(super) const DEFAULT_DAMPING: f64 = 1e3;

/// Drive properties of one joint as the configuration sets them; `None` for those that it leaves to the file or the
/// defaults.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointGains {
    /// Stiffness in the unit of the drive type, if the configuration sets one.
    pub stiffness: Option<f64>,
    /// Damping in the unit of the drive type, if the configuration sets one.
    pub damping: Option<f64>,
    /// Effort limit \[N m or N\], if the configuration sets one.
    pub max_effort: Option<f64>,
    /// Velocity limit \[rad/s or m/s\], if the configuration sets one.
    pub max_velocity: Option<f64>,
    /// Dry friction \[N m or N\], if the configuration sets one.
    pub friction: Option<f64>,
    /// Rotor inertia \[kg m² or kg\], if the configuration sets one.
    pub armature: Option<f64>,
    /// Explicit actuator model, if the configuration names one.
    pub actuator: Option<ActuatorModel>,
}

/// An error in drive properties.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriveCfgError {
    /// A key of a `{pattern: value}` map is invalid.
    #[error("drive property {property}: {error}")]
    Pattern {
        /// Name of the property.
        property: &'static str,
        /// Cause.
        #[source]
        error: PatternError,
    },
    /// A value is negative or not finite (limits may be infinite).
    #[error("drive property {property}: {value} is not a finite number >= 0")]
    Value {
        /// Name of the property.
        property: &'static str,
        /// The value given.
        value: f64,
    },
}

/// Resolves the drive properties of each of `joints`, in their order.
///
/// # Errors
/// A key matches no joint, two keys match a joint, or a number is negative or not finite. An infinite `max_effort` or
/// `max_velocity` means unlimited and is allowed.
pub fn resolve(
    cfg: &DriveCfg,
    joints: &[&str],
    parts: &BTreeMap<String, Vec<usize>>,
) -> Result<Vec<JointGains>, DriveCfgError> {
    let each = |property: &'static str, values: &PerJoint| -> Result<Vec<Option<f64>>, DriveCfgError> {
        let assigned = match values {
            PerJoint::All(value) => vec![Some(*value); joints.len()],
            PerJoint::By(entries) => pattern::assign(entries, parts, joints, "joint")
                .map_err(|error| DriveCfgError::Pattern { property, error })?,
        };
        for value in assigned.iter().flatten() {
            let unlimited = property.starts_with("max_") && *value == f64::INFINITY;
            if !(value.is_finite() && *value >= 0.0 || unlimited) {
                return Err(DriveCfgError::Value { property, value: *value });
            }
        }
        Ok(assigned)
    };
    let optional = |property, values: &Option<PerJoint>| match values {
        Some(values) => each(property, values),
        None => Ok(vec![None; joints.len()]),
    };
    let actuators = pattern::assign(&cfg.actuators, parts, joints, "joint")
        .map_err(|error| DriveCfgError::Pattern { property: "actuators", error })?;
    let stiffness = each("stiffness", &cfg.stiffness)?;
    let damping = each("damping", &cfg.damping)?;
    let max_effort = optional("max_effort", &cfg.max_effort)?;
    let max_velocity = optional("max_velocity", &cfg.max_velocity)?;
    let friction = optional("friction", &cfg.friction)?;
    let armature = each("armature", &cfg.armature)?;
    Ok((0..joints.len())
        .map(|i| JointGains {
            stiffness: stiffness[i],
            damping: damping[i],
            max_effort: max_effort[i],
            max_velocity: max_velocity[i],
            friction: friction[i],
            armature: armature[i],
            actuator: actuators[i],
        })
        .collect())
}
