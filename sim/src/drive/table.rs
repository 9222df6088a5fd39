//! The drives of a compiled model: which joint, which row or actuator; and their targets in one environment.

use super::{actuator, implicit};
use crate::mj;
use std::sync::Arc;

/// How one drive acts in MuJoCo.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Realization {
    /// A friction row: its index among the friction rows (degrees of freedom first, in order).
    Row {
        /// Index among the friction rows.
        row: usize,
    },
    /// MuJoCo's actuator.
    Actuator,
}

/// One drive of a model.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Address of the joint's position in `qpos`.
    pub qpos: usize,
    /// Address of the joint's velocity in `qvel`.
    pub dof: usize,
    /// Index of the control input that holds the target.
    pub ctrl: usize,
    /// How it acts.
    pub realization: Realization,
    /// The gains and limit the model starts with.
    pub initial: Gains,
}

/// Gains and effort limit of one drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains {
    /// Proportional gain \[N m/rad or N/m\].
    pub kp: f64,
    /// Derivative gain \[N m s/rad or N s/m\].
    pub kd: f64,
    /// Largest effort \[N m or N\]; infinite where there is no limit.
    pub max_effort: f64,
}

/// All drives of a model, and the joints whose damping is integrated with them. Shared by all environments.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct DriveTable {
    /// The drives, in the order in which they were added.
    pub drives: Vec<Drive>,
    /// Degrees of freedom whose viscous damping moved from the model to [`implicit`], with its coefficient.
    pub damped: Vec<(usize, f64)>,
}

/// Targets and gains of the drives in one environment, and the effort they last gave.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveState {
    table: Arc<DriveTable>,
    /// Gains, one per drive.
    pub gains: Vec<Gains>,
    /// Position targets \[rad or m\].
    pub position: Vec<f64>,
    /// Velocity targets \[rad/s or m/s\].
    pub velocity: Vec<f64>,
    /// Feed-forward efforts \[N m or N\]; they stay until changed.
    pub feedforward: Vec<f64>,
    /// Effort each drive gave in the last step \[N m or N\].
    pub effort: Vec<f64>,
    /// Generalised forces that a user applies, by degree of freedom; the implicit damping adds to them.
    pub applied: Vec<f64>,
}

impl DriveState {
    /// Drives at rest at the model's initial positions.
    pub fn new(table: &Arc<DriveTable>, model: &mj::Model) -> Self {
        let n = table.drives.len();
        Self {
            table: Arc::clone(table),
            gains: table.drives.iter().map(|d| d.initial).collect(),
            position: table.drives.iter().map(|d| model.qpos0()[d.qpos]).collect(),
            velocity: vec![0.0; n],
            feedforward: vec![0.0; n],
            effort: vec![0.0; n],
            applied: vec![0.0; model.nv()],
        }
    }

    /// Takes gains, targets and effort of drive `from` of `other` for drive `to`.
    pub(crate) fn copy_from(&mut self, other: &Self, from: usize, to: usize) {
        self.gains[to] = other.gains[from];
        self.position[to] = other.position[from];
        self.velocity[to] = other.velocity[from];
        self.feedforward[to] = other.feedforward[from];
        self.effort[to] = other.effort[from];
    }

    /// The model's drives.
    pub fn table(&self) -> &Arc<DriveTable> {
        &self.table
    }

    /// Between `mj_step1` and `mj_step2`: makes every drive act on this step.
    pub fn apply(&self, data: &mut mj::Data) {
        let table = &*self.table;
        data.qfrc_applied_mut().copy_from_slice(&self.applied);
        implicit::apply_damping(table, data);
        for (i, drive) in table.drives.iter().enumerate() {
            let target =
                Target { position: self.position[i], velocity: self.velocity[i], feedforward: self.feedforward[i] };
            match drive.realization {
                Realization::Row { row } => implicit::apply(drive, row, &self.gains[i], &target, data),
                Realization::Actuator => actuator::apply(drive, &self.gains[i], &target, data),
            }
        }
    }

    /// After `mj_step2`: the effort every drive gave.
    pub fn read_efforts(&self, data: &mj::Data, efforts: &mut Vec<f64>) {
        efforts.clear();
        efforts.extend(self.table.drives.iter().enumerate().map(|(i, drive)| match drive.realization {
            Realization::Row { row } => implicit::effort(row, &self.gains[i], self.feedforward[i], data),
            Realization::Actuator => data.actuator_force()[drive.ctrl],
        }));
    }
}

/// What one drive is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Position target \[rad or m\].
    pub position: f64,
    /// Velocity target \[rad/s or m/s\].
    pub velocity: f64,
    /// Feed-forward effort \[N m or N\].
    pub feedforward: f64,
}
