//! What the actuators of a file say of the drives that take their place.
//!
//! MuJoCo's actuator of a joint with gear g gives the torque `g (gain u + b0 + b1 g q + b2 g v)`, the force in the brackets
//! clamped. A position actuator has `gain = -b1` and `b0 = 0`: its stiffness is `-b1 g²`, its damping `-b2 g²`, whatever the
//! scale of its control. One that follows velocities has no `b1` and `gain = -b2`.

use super::error::RobotFileError;
use super::places::Places;
use crate::description::FileDrive;
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::mj::Model;
use crate::mj::words::{self, PathPoint};
use crate::mjcf::part::PartNames;

/// What acts on a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Acting {
    /// The drive that does the same.
    pub(super) drive: FileDrive,
    /// Largest effort \[N m or N\]; `None` where one of the actuators has no limit.
    pub(super) effort: Option<f64>,
}

/// Row `index` of an array with `count` rows.
fn row_of<T>(values: &[T], count: usize, index: usize) -> &[T] {
    let width = values.len() / count.max(1);
    &values[width * index..width * (index + 1)]
}

/// What acts on each joint of the file. Says which actuators are gone.
pub(super) fn of_joints(
    owner: &str,
    model: &Model,
    names: &PartNames,
    places: &Places,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<Vec<Acting>, RobotFileError> {
    let unsaid = if model.nactuator() == 0 { FileDrive::Unsaid } else { FileDrive::Passive };
    let mut acting = vec![Acting { drive: unsaid, effort: None }; model.njnt()];
    let mut replaced = Vec::new();
    for actuator in 0..model.nactuator() {
        let name = &names.actuators[actuator];
        let at = || places.get("actuator", name);
        let refused = |target: String| RobotFileError::Actuator { at: at(), actuator: name.clone(), target };
        let gear = model.actuator_gear()[6 * actuator];
        let id = usize::try_from(model.actuator_trnid()[2 * actuator]).unwrap_or(0);
        match words::transmission(model.actuator_trntype()[actuator]) {
            Some("joint" | "jointinparent") => {
                if !is_single(model, id) {
                    return Err(refused(format!("the free joint {:?}", names.joints[id])));
                }
                let (stiffness, damping) = gains(model, actuator);
                let limit = force_limit(model, actuator).map(|force| force * gear.abs());
                add(&mut acting[id], stiffness * gear * gear, damping * gear * gear, limit);
                replaced.push(format!("{name:?}"));
            }
            Some("tendon") => {
                let first = model.tendon_adr()[id] as usize;
                let path = first..first + model.tendon_num()[id] as usize;
                let is_joint = |p: usize| words::path_point(model.wrap_type()[p]) == Some(PathPoint::Joint);
                let tendon = &names.tendons[id];
                if !path.clone().all(is_joint) {
                    return Err(refused(format!("the spatial tendon {tendon:?}")));
                }
                let mut driven = Vec::new();
                for point in path {
                    let joint = model.wrap_objid()[point] as usize;
                    let limit = force_limit(model, actuator).map(|f| f * (gear * model.wrap_prm()[point]).abs());
                    add(&mut acting[joint], 0.0, 0.0, limit);
                    driven.push(format!("{:?}", names.joints[joint]));
                }
                let message = format!(
                    "{owner}: actuator {name:?} acts on the tendon {tendon:?}; a drive of each of its joints takes its place: {}",
                    driven.join(", ")
                );
                diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, at(), message));
            }
            other => return Err(refused(format!("a {}", other.unwrap_or("kind of object that has no name")))),
        }
    }
    if !replaced.is_empty() {
        let message = format!("{owner}: drives take the place of the actuators {}", replaced.join(", "));
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, places.file(), message));
    }
    for (joint, acting) in acting.iter_mut().enumerate() {
        if let Some([low, high]) = model.joint_actuator_force(joint) {
            let limit = low.abs().max(high.abs());
            acting.effort = Some(acting.effort.map_or(limit, |effort| effort.min(limit)));
        }
    }
    Ok(acting)
}

/// A hinge or a slide.
pub(super) fn is_single(model: &Model, joint: usize) -> bool {
    matches!(words::joint(model.jnt_type()[joint]), Some("hinge" | "slide"))
}

/// One more actuator of a joint.
fn add(acting: &mut Acting, stiffness: f64, damping: f64, limit: Option<f64>) {
    let first = matches!(acting.drive, FileDrive::Unsaid | FileDrive::Passive);
    acting.effort = match (first, acting.effort, limit) {
        (true, _, limit) => limit,
        (false, Some(old), Some(limit)) => Some(old + limit),
        (false, ..) => None,
    };
    let (old_stiffness, old_damping) = match acting.drive {
        FileDrive::Servo { stiffness, damping } => (stiffness, damping),
        _ => (0.0, 0.0),
    };
    let (stiffness, damping) = (old_stiffness + stiffness, old_damping + damping);
    let follows = stiffness > 0.0 || damping > 0.0;
    acting.drive = if follows { FileDrive::Servo { stiffness, damping } } else { FileDrive::Effort };
}

/// Stiffness and damping of an actuator before its gear; zeros where it follows nothing.
fn gains(model: &Model, actuator: usize) -> (f64, f64) {
    let count = model.nactuator();
    let affine = words::gain(model.actuator_gaintype()[actuator]) == Some("fixed")
        && words::bias(model.actuator_biastype()[actuator]) == Some("affine");
    let gain = row_of(model.actuator_gainprm(), count, actuator)[0];
    let bias = row_of(model.actuator_biasprm(), count, actuator);
    let (stiffness, damping) = (-bias[1], -bias[2]);
    let follows_position = stiffness > 0.0 && gain == stiffness && damping >= 0.0;
    let follows_velocity = bias[1] == 0.0 && damping > 0.0 && gain == damping;
    if affine && bias[0] == 0.0 && (follows_position || follows_velocity) { (stiffness, damping) } else { (0.0, 0.0) }
}

/// The largest force of an actuator before its gear: that of its own range, or that of a motor at the end of its control's.
fn force_limit(model: &Model, actuator: usize) -> Option<f64> {
    let end = |range: &[f64]| range[0].abs().max(range[1].abs());
    if model.actuator_forcelimited(actuator) {
        return Some(end(&model.actuator_forcerange()[2 * actuator..2 * actuator + 2]));
    }
    let control = model.actuator_control(actuator);
    let motor = words::gain(model.actuator_gaintype()[actuator]) == Some("fixed")
        && words::bias(model.actuator_biastype()[actuator]) == Some("none")
        && words::dynamics(model.actuator_dyntype()[actuator]) == Some("none");
    let gain = row_of(model.actuator_gainprm(), model.nactuator(), actuator)[0];
    (motor && model.actuator_ctrllimited(control))
        .then(|| gain.abs() * end(&model.actuator_ctrlrange()[2 * control..2 * control + 2]))
}
