//! Ranges of joint positions: the limits of the files, narrowed by those of mimic joints.

use crate::description::{Joint, JointId, JointKind, RobotDescription};
use crate::diagnostic::{Diagnostic, DiagnosticKind};

/// Position limits of a drivable joint, and the range of its targets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PositionRange {
    /// The joint's own position limits \[rad or m\]; `None` without limits. A mimic joint whose limits leave its driver
    /// at most 1 % of the driver's own range has the limits that follow from the driver's range.
    pub limit: Option<[f64; 2]>,
    /// Range of position targets \[rad or m\]: the joint's own limits, narrowed by those of joints that mimic it;
    /// infinite without limits.
    pub target_range: [f64; 2],
}

/// Position limits of a joint \[rad or m\]; `None` for an unlimited joint. A continuous joint is unlimited, even if the
/// file gives limits. A single missing end is 0, the default of URDF. With both ends missing (or rejected with a
/// warning), the joint is unlimited.
pub fn own_limit(joint: &Joint) -> Option<[f64; 2]> {
    let limit = joint.limit.as_ref().filter(|_| joint.kind != JointKind::Continuous)?;
    (limit.lower.is_some() || limit.upper.is_some()).then(|| [limit.lower.unwrap_or(0.0), limit.upper.unwrap_or(0.0)])
}

/// Tolerance for limits that are written with few digits \[rad or m\].
const LIMIT_TOLERANCE: f64 = 1e-6;

/// Fraction of its own range that a driver keeps at least; limits of a follower that would leave less are ignored.
const MIN_RANGE_FRACTION: f64 = 0.01;

/// No limits.
const UNLIMITED: [f64; 2] = [f64::NEG_INFINITY, f64::INFINITY];

/// Returns the ranges of all [drivable joints](RobotDescription::drivable_joints), in their order. They are the limits
/// of [`IkSolver`](crate::kinematics::IkSolver) for a chain of these joints.
///
/// The range of each driver is narrowed to positions that its followers can reach, with a warning. A follower that leaves
/// at most 1 % of the driver's own range is released: its limits become those of the driver's range.
pub fn position_ranges(description: &RobotDescription, diagnostics: &mut Vec<Diagnostic>) -> Vec<PositionRange> {
    let joints: Vec<(JointId, &Joint)> = description.drivable_joints().collect();
    let range = |joint: &Joint| {
        let limit = own_limit(joint);
        PositionRange { limit, target_range: limit.unwrap_or(UNLIMITED) }
    };
    let mut ranges: Vec<PositionRange> = joints.iter().map(|(_, joint)| range(joint)).collect();
    let mut released = Vec::new();
    for (i, &(id, joint)) in joints.iter().enumerate() {
        let (driver, multiplier, offset) = description.mimic_driver(id);
        let Some(limit) = ranges[i].limit.filter(|_| joint.mimic.is_some() && multiplier != 0.0) else { continue };
        let Some(d) = joints.iter().position(|(id, _)| *id == driver) else { continue };
        let ends = limit.map(|end| (end - offset) / multiplier);
        let (low, high) = (ends[0].min(ends[1]), ends[0].max(ends[1]));
        let [old_low, old_high] = ranges[d].target_range;
        if low <= old_low + LIMIT_TOLERANCE && high >= old_high - LIMIT_TOLERANCE {
            continue;
        }
        let driver_joint = description.joint(driver);
        // Positive zeros: a range from -0 would look like a mistake.
        let narrowed = [old_low.max(low) + 0.0, old_high.min(high) + 0.0];
        let own_extent = ranges[d].limit.map_or(0.0, |[low, high]| high - low);
        let outcome = if narrowed[1] - narrowed[0] > (MIN_RANGE_FRACTION * own_extent).max(LIMIT_TOLERANCE) {
            ranges[d].target_range = narrowed;
            format!("the usable range of {:?} is {:.4} .. {:.4}", driver_joint.name, narrowed[0], narrowed[1])
        } else {
            released.push((i, d, multiplier, offset));
            format!("these limits leave no range for {:?} and were ignored", driver_joint.name)
        };
        diagnostics.push(Diagnostic::new(
            DiagnosticKind::MimicRangeClipped,
            joint.limit.as_ref().map(|l| l.source.clone()),
            format!(
                "joint {:?} mimics {:?} with multiplier {multiplier} beyond its own limits {} .. {}: {outcome}",
                joint.name, driver_joint.name, limit[0], limit[1]
            ),
        ));
    }
    for (i, d, multiplier, offset) in released {
        let ends = ranges[d].target_range.map(|end| multiplier * end + offset);
        let limit = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        let limit = Some(limit).filter(|limit| limit.iter().all(|end| end.is_finite()));
        ranges[i] = PositionRange { limit, target_range: limit.unwrap_or(UNLIMITED) };
    }
    ranges
}
