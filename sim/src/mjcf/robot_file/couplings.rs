//! Joint equalities of a file: those that a mimic can express, and all others.
//!
//! MuJoCo's equality is `y - y0 = c0 + c1 (x - x0) + c2 (x - x0)² + ...` with the initial positions y0 and x0 of the
//! file.

use super::drives::is_single_dof;
use super::locations::SourceLocations;
use crate::mjcf::part::PartNames;
use kinetoscope_mujoco::{Model, mjcf_keywords};
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;

/// Coupling of a joint to another joint.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Coupling {
    /// Linear coupling, `multiplier * position + offset`, to a joint of the file.
    Mimic {
        /// Location of the equality.
        source: SourceLocation,
        /// Index of the followed joint in the file's model.
        driver: usize,
        /// Factor of the position of the followed joint.
        multiplier: f64,
        /// Offset \[rad or m\].
        offset: f64,
    },
    /// Any other coupling. It has a polynomial if it is the only coupling of the joint and does not close a cycle.
    Nonlinear(Option<PolynomialRelation>),
}

/// Polynomial coupling of a joint: `y - y0 = Σ coefficients[k] (x - x0)ᵏ`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct PolynomialRelation {
    /// Index of the followed joint; `None` for a joint that stays at `y0 + c0`.
    pub(super) driver: Option<usize>,
    /// Coefficients in ascending order, the constant first.
    pub(super) coefficients: [f64; 5],
}

/// Finds the coupling of each joint of the file; `None` for a joint without a coupling.
pub(super) fn of_joints(
    owner: &str,
    model: &Model,
    names: &PartNames,
    places: &SourceLocations,
    diagnostics: &mut Vec<Diagnostic>,
) -> Vec<Option<Coupling>> {
    let mut couplings: Vec<Option<Coupling>> = vec![None; model.njnt()];
    for equality in 0..model.neq() {
        if mjcf_keywords::equality(model.eq_type()[equality]) != Some("joint") || !model.equality_is_active(equality) {
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
            Some(driver)
                if linear && free && is_single_dof(model, driver) && !reaches(&couplings, driver, follower) =>
            {
                let (multiplier, offset) = (data[1], start(follower) + data[0] - data[1] * start(driver));
                Some(Coupling::Mimic { source, driver, multiplier, offset })
            }
            _ => {
                let message = format!(
                    "{owner}: equality {:?} is kept, but is not a linear mimic relation, so joint {:?} has no drive",
                    names.equalities[equality], names.joints[follower]
                );
                diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, source, message));
                let coefficients = [0, 1, 2, 3, 4].map(|k| if driver.is_some() || k == 0 { data[k] } else { 0.0 });
                let leads_on = driver.is_none_or(|driver| !reaches(&couplings, driver, follower));
                Some(Coupling::Nonlinear((free && leads_on).then_some(PolynomialRelation { driver, coefficients })))
            }
        };
    }
    couplings
}

/// Joint at the end of the mimic chain of `joint`, or `joint` itself, and the product of the multipliers of the chain.
/// `None` if a joint of the chain has a coupling that is not a mimic.
pub(super) fn mimic_root(couplings: &[Option<Coupling>], mut joint: usize) -> Option<(usize, f64)> {
    let mut ratio = 1.0;
    loop {
        match &couplings[joint] {
            None => return Some((joint, ratio)),
            Some(Coupling::Nonlinear(_)) => return None,
            Some(Coupling::Mimic { driver, multiplier, .. }) => {
                joint = *driver;
                ratio *= multiplier;
            }
        }
    }
}

/// True if the mimics and polynomial couplings from `joint` reach `end`.
fn reaches(couplings: &[Option<Coupling>], mut joint: usize, end: usize) -> bool {
    loop {
        if joint == end {
            return true;
        }
        joint = match &couplings[joint] {
            Some(Coupling::Mimic { driver, .. }) => *driver,
            Some(Coupling::Nonlinear(Some(PolynomialRelation { driver: Some(driver), .. }))) => *driver,
            _ => return false,
        };
    }
}
