//! Warnings about solver parameters of dry friction that implicit drives replace.

use super::couplings::Coupling;
use super::drives::is_single_dof;
use crate::mjcf::part::PartNames;
use kinetoscope_mujoco::Model;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;

/// MuJoCo's default `solref` and `solimp`.
const DEFAULTS: ([f64; 2], [f64; 5]) = ([0.02, 1.0], [0.9, 0.95, 0.001, 0.5, 2.0]);

/// Warns about joints whose own `solreffriction` and `solimpfriction` apply only without an implicit drive.
pub(super) fn warn_solver_params(
    owner: &str,
    model: &Model,
    names: &PartNames,
    couplings: &[Option<Coupling>],
    file: &SourceLocation,
    diagnostics: &mut Vec<Diagnostic>,
) {
    let is_soft = |&joint: &usize| {
        let dof = model.jnt_dofadr()[joint] as usize;
        let (solref, solimp) = (&model.dof_solref()[2 * dof..2 * dof + 2], &model.dof_solimp()[5 * dof..5 * dof + 5]);
        let rubs = model.dof_frictionloss()[dof] > 0.0;
        rubs && (solref != DEFAULTS.0 || solimp != DEFAULTS.1)
    };
    let joints = (0..model.njnt()).filter(|&joint| is_single_dof(model, joint) && couplings[joint].is_none());
    let named: Vec<String> = joints.filter(is_soft).map(|joint| format!("{:?}", names.joints[joint])).collect();
    if !named.is_empty() {
        let message = format!(
            "{owner}: solreffriction and solimpfriction of these joints are used only while they have no implicit \
             drive: {}",
            named.join(", ")
        );
        diagnostics.push(Diagnostic::new(DiagnosticKind::SettingIgnored, file.clone(), message));
    }
}
