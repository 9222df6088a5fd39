//! Equalities of joints: those that a mimic says, and those that only hold.
//!
//! MuJoCo's is `y - y0 = c0 + c1 (x - x0) + c2 (x - x0)² + ...` with the positions y0 and x0 of the file's start.

use super::drives::is_single;
use super::places::Places;
use crate::mjcf::part::PartNames;
use kinetoscope_mujoco::{Model, words};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source::Source;

/// How a joint follows another.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Coupling {
    /// By `ratio * position + offset` of a joint of the file.
    Mimic {
        /// Where it is said.
        source: Source,
        /// The joint that is followed.
        driver: usize,
        /// Ratio.
        multiplier: f64,
        /// Offset \[rad or m\].
        offset: f64,
    },
    /// In another way: along one curve, where there is only one, and it does not lead back.
    Other(Option<Follows>),
}

/// How a joint follows along a curve: `y - y0 = Σ coefficients[k] (x - x0)ᵏ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Follows {
    /// The joint that is followed; `None` where it stays where it is, at c0.
    pub(super) driver: Option<usize>,
    /// Coefficients, the constant first.
    pub(super) coefficients: [f64; 5],
}

/// How each joint of the file follows others; `None` for one that does not.
pub(super) fn of_joints(
    owner: &str,
    model: &Model,
    names: &PartNames,
    places: &Places,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Option<Coupling>> {
    let mut couplings: Vec<Option<Coupling>> = vec![None; model.njnt()];
    for equality in 0..model.neq() {
        if words::equality(model.eq_type()[equality]) != Some("joint") || !model.equality_is_active(equality) {
            continue;
        }
        let Ok(follower) = usize::try_from(model.eq_obj1id()[equality]) else { continue };
        let driver = usize::try_from(model.eq_obj2id()[equality]).ok();
        let width = model.eq_data().len() / model.neq();
        let data = &model.eq_data()[width * equality..width * equality + 5];
        let source = places.get("equality", &names.equalities[equality]);
        let linear = data[2..].iter().all(|c| *c == 0.0);
        let free = couplings[follower].is_none();
        let start = |joint: usize| model.qpos0()[model.jnt_qposadr()[joint] as usize];
        couplings[follower] = match driver {
            Some(driver) if linear && free && is_single(model, driver) && !leads_to(&couplings, driver, follower) => {
                let (multiplier, offset) = (data[1], start(follower) + data[0] - data[1] * start(driver));
                Some(Coupling::Mimic { source, driver, multiplier, offset })
            }
            _ => {
                let message = format!(
                    "{owner}: equality {:?} holds, but no mimic says it; joint {:?} has no drive",
                    names.equalities[equality], names.joints[follower]
                );
                diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, source, message));
                let coefficients = [0, 1, 2, 3, 4].map(|k| if driver.is_some() || k == 0 { data[k] } else { 0.0 });
                let leads_on = driver.is_none_or(|driver| !leads_to(&couplings, driver, follower));
                Some(Coupling::Other((free && leads_on).then_some(Follows { driver, coefficients })))
            }
        };
    }
    couplings
}

/// The joint that `joint` follows in the end, or itself, and the ratio of the chain; `None` where something else holds it.
pub(super) fn followed(couplings: &[Option<Coupling>], mut joint: usize) -> Option<(usize, f64)> {
    let mut ratio = 1.0;
    loop {
        match &couplings[joint] {
            None => return Some((joint, ratio)),
            Some(Coupling::Other(_)) => return None,
            Some(Coupling::Mimic { driver, multiplier, .. }) => {
                joint = *driver;
                ratio *= multiplier;
            }
        }
    }
}

/// Whether following mimics and curves from `joint` ends at `end`, or passes it.
fn leads_to(couplings: &[Option<Coupling>], mut joint: usize, end: usize) -> bool {
    loop {
        if joint == end {
            return true;
        }
        joint = match &couplings[joint] {
            Some(Coupling::Mimic { driver, .. }) => *driver,
            Some(Coupling::Other(Some(Follows { driver: Some(driver), .. }))) => *driver,
            _ => return false,
        };
    }
}
