//! The drive law as a constraint row, evaluated at the end of the step together with contacts.
//!
//! With `v' = v + h a` and `q' = q + h v'` the law at the end of the step reads
//!
//! ```text
//! tau = kp (q* - q - h v') + kd (v* - v') + tau_ff
//!     = D (aref - a),   D = h (kd + h kp),   aref = (kp (q* - q) + kd v* + tau_ff) / D - v / h
//! ```
//!
//! which is what MuJoCo's solver computes for a friction row with `efc_D = D` and reference acceleration `aref`: force
//! `D (aref - a)`, clamped to `±efc_frictionloss` (Huber cost). The row is made by `dof_frictionloss > 0` and rewritten
//! between `mj_step1` and `mj_step2`, so limit, gains and targets are per environment.
//!
//! The identity needs `v' = v + h a` with the solver's `a`. MuJoCo's implicit joint damping would change `a` after the
//! solve: a damping B on a light link would slow it by `1 + h B / M`. It therefore moves here as well: with the
//! armature raised by `h B` (`mjcf::robot`) and `-B v` applied, `(M + h B) a = tau - B v`, the same implicit damping
//! inside the solve.

use super::gains::{Gains, Target};

use super::table::{Drive, DriveTable};
use kinetoscope_mujoco as mj;

/// A limit that is never reached, for drives without one: MuJoCo's row needs a finite number.
const UNLIMITED: f64 = 1e15;

/// Value of `D` for a drive without gains; its row carries no force.
const IDLE_STIFFNESS: f64 = 1e-6;

/// True if the row applies the drive. Without gains, only the feedforward effort acts, which needs no row.
fn has_gains(gains: &Gains) -> bool {
    gains.kp > 0.0 || gains.kd > 0.0
}

/// Rewrites the friction row of one drive, and sets its control to the position target. `row` counts the friction rows
/// of degrees of freedom from 0. Without gains, the clamped feedforward effort is added to `qfrc_applied` instead.
pub(super) fn apply(drive: &Drive, row: usize, gains: &Gains, target: &Target, data: &mut mj::Data) {
    let h = data.model().timestep();
    let (q, v) = (data.qpos()[drive.qpos], data.qvel()[drive.dof]);
    data.ctrl_mut()[drive.ctrl] = target.position;
    let efc = data.ne() + row;
    debug_assert_eq!(data.efc_type()[efc] as u32, mj::mjCNSTR_FRICTION_DOF);
    debug_assert_eq!(data.efc_id()[efc] as usize, drive.dof);
    let (stiffness, aref, limit) = if has_gains(gains) {
        let stiffness = h * (gains.kd + h * gains.kp);
        let effort = gains.kp * (target.position - q) + gains.kd * target.velocity + target.feedforward;
        (stiffness, effort / stiffness - v / h, gains.max_effort.min(UNLIMITED))
    } else {
        data.qfrc_applied_mut()[drive.dof] += target.feedforward.clamp(-gains.max_effort, gains.max_effort);
        (IDLE_STIFFNESS, 0.0, 0.0)
    };
    data.efc_d_mut()[efc] = stiffness;
    data.efc_r_mut()[efc] = 1.0 / stiffness;
    data.efc_aref_mut()[efc] = aref;
    data.efc_frictionloss_mut()[efc] = limit;
}

/// Effort of the drive in the last `mj_step2` \[N m or N\]: the force of its row, or the clamped feedforward effort of
/// a drive without gains.
pub(super) fn effort(row: usize, gains: &Gains, feedforward: f64, data: &mj::Data) -> f64 {
    if has_gains(gains) {
        data.efc_force()[data.ne() + row]
    } else {
        feedforward.clamp(-gains.max_effort, gains.max_effort)
    }
}

/// Adds the explicit part of the implicit damping, `-B v`, to `qfrc_applied`. The armature contains the other part.
pub(super) fn apply_damping(table: &DriveTable, coefficients: &[f64], data: &mut mj::Data) {
    for (&(dof, _), damping) in table.damped.iter().zip(coefficients) {
        if *damping != 0.0 {
            let v = data.qvel()[dof];
            data.qfrc_applied_mut()[dof] -= damping * v;
        }
    }
}

/// Turns the drives of `dofs`, with the actuators `actuators`, in a compiled model into constraint rows: every degree
/// of freedom in `dofs` gets a friction row, and gain and bias of the actuators become zero (`ctrl` still holds the
/// target).
pub(crate) fn prepare(compiled: &mut mj::Compiled, dofs: &[usize], actuators: &[usize]) {
    for &dof in dofs {
        // Any positive value makes MuJoCo build the row; `apply` writes the limit.
        compiled.dof_frictionloss_mut()[dof] = 1.0;
    }
    compiled.clear_actuator_gains(actuators);
}
