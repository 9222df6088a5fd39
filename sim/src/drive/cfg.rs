//! Drive properties as users write them, and their resolution to one set per joint.

use super::models::ActuatorModel;
use super::{DriveModel, DriveType};
use crate::pattern::{self, PatternError};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// One number for all joints, or numbers by name pattern or control part.
#[derive(Clone, Debug, PartialEq)]
pub enum PerJoint {
    /// The same for every joint.
    All(f64),
    /// `(pattern or control part, value)`; joints that no key matches keep the default.
    By(Vec<(String, f64)>),
}

/// Nothing is said: every joint keeps the default.
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

/// Drive properties of a robot. Every field is a number for all joints or `{pattern: value}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DriveCfg {
    /// The meaning of stiffness and damping.
    pub drive_type: DriveType,
    /// Who evaluates the law.
    pub model: DriveModel,
    /// Explicit actuator models by joint pattern or control part; joints that none matches are driven by `model`. They use
    /// the gains and limits below; a joint that the drive type leaves passive has none. Exports have MuJoCo's actuators with
    /// the same gains in their place.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub actuators: Vec<(String, ActuatorModel)>,
    /// Stiffness \[N m/rad or N/m\] (drive type `force`). Where unset, that of the position actuators in the file of an
    /// [MJCF robot](crate::RobotCfg::mjcf) (drive type `force` only), or else 10⁴.
    pub stiffness: PerJoint,
    /// Damping \[N m s/rad or N s/m\] (drive type `force`). Where unset, as for the stiffness, or else 10³.
    pub damping: PerJoint,
    /// Largest effort \[N m or N\]; where unset, the file's.
    pub max_effort: Option<PerJoint>,
    /// Largest speed \[rad/s or m/s\]; where unset, the URDF's. Reported; of the drive laws, only that of [`DcMotor`] knows
    /// it.
    ///
    /// [`DcMotor`]: super::DcMotor
    pub max_velocity: Option<PerJoint>,
    /// Dry friction \[N m or N\]; where unset, the file's. Where anything is given, 0 too, driven joints of the robot can be told
    /// another while they run: [`RobotMut::set_friction`](crate::RobotMut::set_friction).
    pub friction: Option<PerJoint>,
    /// Rotor inertia \[kg m² or kg\]; where unset, that of an MJCF file, or else 0. While they run:
    /// [`RobotMut::set_armature`](crate::RobotMut::set_armature).
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

/// EmbodiChain's default stiffness: what a joint has that neither a pattern nor its file says anything of.
pub(super) const DEFAULT_STIFFNESS: f64 = 1e4;
/// EmbodiChain's default damping.
pub(super) const DEFAULT_DAMPING: f64 = 1e3;

/// Drive properties of one joint, as far as the configuration says them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointGains {
    /// Stiffness, if the configuration sets one.
    pub stiffness: Option<f64>,
    /// Damping, if the configuration sets one.
    pub damping: Option<f64>,
    /// Largest effort, if the configuration sets one.
    pub max_effort: Option<f64>,
    /// Largest speed, if the configuration sets one.
    pub max_velocity: Option<f64>,
    /// Dry friction, if the configuration sets one.
    pub friction: Option<f64>,
    /// Rotor inertia, if the configuration sets one.
    pub armature: Option<f64>,
    /// Explicit actuator model, if the configuration names one.
    pub actuator: Option<ActuatorModel>,
}

/// An error of drive properties.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum DriveCfgError {
    /// A key of a `{pattern: value}` map is wrong.
    #[error("drive property {property}: {error}")]
    Pattern {
        /// Name of the property.
        property: &'static str,
        /// What is wrong with the key.
        #[source]
        error: PatternError,
    },
    /// A value is negative or not finite.
    #[error("drive property {property}: {value} is not a finite number >= 0")]
    Value {
        /// Name of the property.
        property: &'static str,
        /// The value given.
        value: f64,
    },
}

/// One set of drive properties for each of `joints`, in their order.
///
/// # Errors
/// A key that matches no joint, a joint matched by two keys, a negative or non-finite number (an infinite
/// `max_effort` or `max_velocity` means unlimited and is allowed).
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
