//! Drives that replace the actuators of a file.
//!
//! An actuator on the length `l = g Σ cᵢ qᵢ` (on a joint: c = 1) with the force F along it gives each joint the effort
//! `g cᵢ F`. Joints that follow another joint by `qᵢ = mᵢ q + oᵢ` have no drive of their own. By virtual work the
//! followed joint receives `J F` with `J = g Σ cᵢ mᵢ`, summed over itself and all joints of the length that follow it.
//! A drive of the followed joint with the stiffness `k J²`, the damping `d J²` and the largest effort `|J| Fmax` is
//! equivalent. If a length has several joints that do not follow each other, each gets the drive that is equivalent
//! while the other joints stand still.

use super::actuator::law;
use super::couplings::{Coupling, mimic_root};
use super::error::RobotFileError;
use super::locations::SourceLocations;
use crate::mjcf::part::PartNames;
use kinetoscope_mujoco::Model;
use kinetoscope_mujoco::mjcf_keywords;
use kinetoscope_mujoco::mjcf_keywords::WrapType;
use kinetoscope_robot::description::FileActuation;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use std::collections::BTreeMap;

/// Actuation of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct JointActuation {
    /// Drive that is equivalent to the actuators.
    pub(super) drive: FileActuation,
    /// Largest effort \[N m or N\]; `None` without a limit.
    pub(super) effort: Option<f64>,
}

/// Effect of an actuator on a joint and on the joints that follow it.
#[derive(Clone, Debug, Default)]
struct MomentArm {
    /// Effort per force, J.
    moment_arm: f64,
    /// Sum of the absolute values of the terms of J.
    abs_sum: f64,
    /// Joints of the file, and the ratio by which each follows.
    joints: Vec<(usize, f64)>,
    /// Largest effort within the joints' own limits, with the force at its limit; infinite without limits.
    effort: f64,
}

/// Joints that an actuator acts on.
struct ActuatorTarget {
    /// Joints and their coefficients.
    path: Vec<(usize, f64)>,
    /// Name of the tendon with this path; `None` for an actuator on a joint.
    tendon: Option<String>,
}

/// Finds the actuation of each joint of the file, in its order. Actuators on joints that follow another count for the
/// followed joint. Warns about actuators that are replaced, and about features that no drive reproduces.
pub(super) fn of_joints(
    owner: &str,
    model: &Model,
    names: &PartNames,
    places: &SourceLocations,
    couplings: &[Option<Coupling>],
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Vec<JointActuation>, RobotFileError> {
    let unsaid = if model.nactuator() == 0 { FileActuation::Unspecified } else { FileActuation::Passive };
    let own_limit = |joint: usize| model.joint_actuator_force(joint).map(|[low, high]| low.abs().max(high.abs()));
    let mut acting: Vec<JointActuation> =
        (0..model.njnt()).map(|joint| JointActuation { drive: unsaid, effort: own_limit(joint) }).collect();
    // Actuated joints, by the joint that they follow.
    let mut acted: BTreeMap<usize, BTreeMap<usize, f64>> = BTreeMap::new();
    let mut replaced = Vec::new();
    for actuator in 0..model.nactuator() {
        let name = &names.actuators[actuator];
        let ActuatorTarget { path, tendon } = target(model, names, actuator).map_err(|target| {
            RobotFileError::Actuator { at: places.get("actuator", name), actuator: name.clone(), target }
        })?;
        let gear = model.actuator_gear()[6 * actuator];
        let law = law(model, actuator, gear, &path);
        let quoted = |joint: usize| format!("{:?}", names.joints[joint]);
        let mut notes = law.unsupported;
        let mut arms: BTreeMap<usize, MomentArm> = BTreeMap::new();
        for &(joint, coefficient) in &path {
            let Some((driver, ratio)) = mimic_root(couplings, joint) else {
                notes.push(format!(
                    "it does not act on joint {}, because a joint equality that is not a mimic relation constrains it",
                    quoted(joint)
                ));
                continue;
            };
            if driver != joint {
                notes.push(format!(
                    "{} is a mimic joint of {}, whose drive replaces the actuator",
                    quoted(joint),
                    quoted(driver)
                ));
            }
            let arm = arms.entry(driver).or_default();
            let (own, force) = (own_limit(joint).unwrap_or(f64::INFINITY), law.force.unwrap_or(f64::INFINITY));
            let coefficient = gear * coefficient;
            arm.moment_arm += coefficient * ratio;
            arm.abs_sum += (coefficient * ratio).abs();
            if coefficient * ratio != 0.0 {
                arm.effort += ratio.abs() * own.min(force * coefficient.abs());
                arm.joints.push((joint, ratio));
            }
        }
        // A sum of terms that cancel leaves rounding only.
        arms.retain(|&driver, arm| {
            let acts = arm.moment_arm.abs() > 1e-12 * arm.abs_sum && law.force != Some(0.0);
            if !acts {
                notes.push(format!(
                    "its effort on {} is always zero, so this joint gets no drive from it",
                    quoted(driver)
                ));
            }
            acts
        });
        if arms.len() > 1 {
            let joints: Vec<String> = arms.keys().map(|&joint| quoted(joint)).collect();
            notes.push(format!("it moves the joints {} together, but each gets its own drive", joints.join(", ")));
        }
        for (driver, arm) in arms {
            let force = law.force.map_or(f64::INFINITY, |force| force * arm.moment_arm.abs());
            let (limit, scale) = (arm.effort.min(force), arm.moment_arm * arm.moment_arm);
            let first = !acted.contains_key(&driver);
            add_actuator(&mut acting[driver], first, law.stiffness * scale, law.damping * scale, limit);
            acted.entry(driver).or_default().extend(arm.joints);
        }
        if let Some(tendon) = &tendon {
            notes.insert(0, format!("acts on the tendon {tendon:?}; drives of its joints replace it"));
        } else {
            replaced.push(format!("{name:?}"));
        }
        if !notes.is_empty() {
            let differs = if tendon.is_some() { "" } else { "differs from the drive that replaces it: " };
            let message = format!("{owner}: actuator {name:?} {differs}{}", notes.join("; "));
            diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, places.get("actuator", name), message));
        }
    }
    if !replaced.is_empty() {
        let message = format!("{owner}: joint drives replace the actuators {}", replaced.join(", "));
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, places.file(), message));
    }
    for (driver, joints) in acted {
        let own: f64 =
            joints.iter().map(|(&joint, ratio)| ratio.abs() * own_limit(joint).unwrap_or(f64::INFINITY)).sum();
        let effort = acting[driver].effort.unwrap_or(f64::INFINITY).min(own);
        acting[driver].effort = effort.is_finite().then_some(effort);
    }
    Ok(acting)
}

/// Joints that an actuator acts on, or a description of a target that drives do not support.
fn target(model: &Model, names: &PartNames, actuator: usize) -> Result<ActuatorTarget, String> {
    let id = usize::try_from(model.actuator_trnid()[2 * actuator]).unwrap_or(0);
    match mjcf_keywords::transmission(model.actuator_trntype()[actuator]) {
        Some("joint" | "jointinparent") if is_single_dof(model, id) => {
            Ok(ActuatorTarget { path: vec![(id, 1.0)], tendon: None })
        }
        Some("joint" | "jointinparent") => Err(format!("the free joint {:?}", names.joints[id])),
        Some("tendon") => {
            let first = model.tendon_adr()[id] as usize;
            let points = first..first + model.tendon_num()[id] as usize;
            let tendon = &names.tendons[id];
            if !points.clone().all(|p| mjcf_keywords::wrap_type(model.wrap_type()[p]) == Some(WrapType::Joint)) {
                return Err(format!("the spatial tendon {tendon:?}"));
            }
            let path = points.map(|p| (model.wrap_objid()[p] as usize, model.wrap_prm()[p])).collect();
            Ok(ActuatorTarget { path, tendon: Some(tendon.clone()) })
        }
        other => Err(format!("a {}", other.unwrap_or("transmission target of an unknown type"))),
    }
}

/// Returns true for a hinge or a slide.
pub(super) fn is_single_dof(model: &Model, joint: usize) -> bool {
    matches!(mjcf_keywords::joint(model.jnt_type()[joint]), Some("hinge" | "slide"))
}

/// Adds an actuator to a joint; its effort `limit` is infinite without a limit. The limit of the `first` actuator
/// replaces the one in `acting`, and those of further actuators are added.
fn add_actuator(acting: &mut JointActuation, first: bool, stiffness: f64, damping: f64, limit: f64) {
    let old = if first { 0.0 } else { acting.effort.unwrap_or(f64::INFINITY) };
    acting.effort = Some(old + limit).filter(|effort| effort.is_finite());
    let (old_stiffness, old_damping) = match acting.drive {
        FileActuation::Servo { stiffness, damping } => (stiffness, damping),
        _ => (0.0, 0.0),
    };
    let (stiffness, damping) = (old_stiffness + stiffness, old_damping + damping);
    let follows = stiffness > 0.0 || damping > 0.0;
    acting.drive = if follows { FileActuation::Servo { stiffness, damping } } else { FileActuation::Effort };
}
