//! Action of joint position targets.

use super::find_joints;
use crate::action::ActionTerm;
use crate::error::{EnvError, Result, TermKind};
use crate::space::Space;
use kinetoscope_scene::pattern;
use kinetoscope_sim::{PerJoint, RobotId, SimulationManager};
use ndarray::Array2;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Numbers of [`joint_positions`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct JointPositionsCfg {
    /// Change of the target for an action of 1 \[rad or m\]: one number for all joints, or numbers by patterns of joint
    /// names, with 1 for joints that no pattern matches.
    pub scale: PerJoint,
    /// Bounds to which actions are clamped.
    pub bounds: [f64; 2],
}

impl Default for JointPositionsCfg {
    /// A scale of 1, and no bounds.
    fn default() -> Self {
        Self { scale: PerJoint::default(), bounds: [f64::NEG_INFINITY, f64::INFINITY] }
    }
}

/// Joint position targets: the initial position plus the scale times the action. Isaac Lab's `JointPositionAction` with
/// default offsets has the same targets.
///
/// Targets stay within the limits of the joints. There is one column for each joint that matches one of `patterns`
/// (whole names), in the order of [`find_joints`](kinetoscope_sim::Robot::find_joints). Joints without a drive ignore
/// their column.
///
/// # Errors
/// - A pattern is invalid or matches no joint, or two patterns match the same joint; this includes the patterns of
///   scales, which must match one of the joints of the term.
/// - A scale is not finite, or the bounds are not in order.
///
/// # Panics
/// The robot belongs to another manager.
pub fn joint_positions(
    sim: &SimulationManager,
    name: &str,
    robot: RobotId,
    patterns: &[&str],
    cfg: JointPositionsCfg,
) -> Result<ActionTerm> {
    let (names, joints) = find_joints(sim, robot, patterns)?;
    let scales = match &cfg.scale {
        PerJoint::All(scale) => vec![Some(*scale); names.len()],
        PerJoint::By(entries) => pattern::assign(entries, &BTreeMap::new(), &names, "joint of the term")
            .map_err(|error| EnvError::pattern(TermKind::Action, name, "scale", error))?,
    };
    let scales: Vec<f64> = scales.into_iter().map(|scale| scale.unwrap_or(1.0)).collect();
    if let Some((scale, joint)) = scales.iter().zip(&names).find(|(scale, _)| !scale.is_finite()) {
        let field = format!("scale of joint {joint:?} of the action term {name:?}");
        return Err(EnvError::Config { field, value: scale.to_string(), expected: "it must be finite" });
    }
    let starts = sim.robot(robot).default_qpos();
    let starts: Vec<f64> = joints.iter().map(|joint| starts[(0, joint.0)]).collect();
    Ok(ActionTerm::new(name, Space::uniform(names, cfg.bounds)?, move |sim, actions| {
        let targets = Array2::from_shape_fn(actions.dim(), |(env, k)| starts[k] + scales[k] * actions[(env, k)]);
        Ok(sim.robot_mut(robot).set_qpos_target(&targets, Some(&joints), None)?)
    }))
}
