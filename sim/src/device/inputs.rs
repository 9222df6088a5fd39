//! Inputs of the device, and their values in the rows of a batch.

use crate::drive::actuator;
use crate::drive::table::Realization;
use crate::row::StoredRow;

/// Largest effort in single precision, for drives without a limit: products with it stay finite.
const UNLIMITED: f64 = 1e9;

/// Input of the device with a row per environment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Input {
    Positions,
    Velocities,
    Activations,
    WarmStart,
    Controls,
    JointForces,
    BodyForces,
    MocapPositions,
    MocapOrientations,
    Stiffness,
    Damping,
    MaxEffort,
    TargetPosition,
    TargetVelocity,
    Feedforward,
    ViscousDamping,
}

impl Input {
    pub(super) const ALL: [Self; 16] = [
        Self::Positions,
        Self::Velocities,
        Self::Activations,
        Self::WarmStart,
        Self::Controls,
        Self::JointForces,
        Self::BodyForces,
        Self::MocapPositions,
        Self::MocapOrientations,
        Self::Stiffness,
        Self::Damping,
        Self::MaxEffort,
        Self::TargetPosition,
        Self::TargetVelocity,
        Self::Feedforward,
        Self::ViscousDamping,
    ];

    /// Name of the array on the device.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Positions => "qpos",
            Self::Velocities => "qvel",
            Self::Activations => "act",
            Self::WarmStart => "qacc_warmstart",
            Self::Controls => "ctrl",
            Self::JointForces => "qfrc_applied",
            Self::BodyForces => "xfrc_applied",
            Self::MocapPositions => "mocap_pos",
            Self::MocapOrientations => "mocap_quat",
            Self::Stiffness => "stiffness",
            Self::Damping => "damping",
            Self::MaxEffort => "max_effort",
            Self::TargetPosition => "target_position",
            Self::TargetVelocity => "target_velocity",
            Self::Feedforward => "feedforward",
            Self::ViscousDamping => "viscous_damping",
        }
    }

    /// True for the state, which steps of the device change.
    pub(super) fn is_state(self) -> bool {
        matches!(self, Self::Positions | Self::Velocities | Self::Activations | Self::WarmStart)
    }

    /// Appends the values in a row of the batch to `out`.
    pub(super) fn append(self, row: &StoredRow<'_>, rows: &[usize], out: &mut Vec<f32>) {
        let (drives, model) = (&row.row.drives, row.model);
        let mut put = |values: &[f64]| out.extend(values.iter().map(|x| *x as f32));
        match self {
            Self::Positions => put(row.raw_qpos()),
            Self::Velocities => put(row.qvel()),
            Self::Activations => put(row.row.motion.act(model)),
            Self::WarmStart => put(row.qacc_warmstart()),
            Self::JointForces => put(&drives.applied),
            Self::BodyForces => put(row.row.body_inputs.xfrc_applied(model)),
            Self::MocapPositions => put(row.row.body_inputs.mocap(model).0),
            Self::MocapOrientations => put(row.row.body_inputs.mocap(model).1),
            Self::Controls => {
                let first = out.len();
                out.extend(row.ctrl().iter().map(|x| *x as f32));
                for (i, drive) in drives.table().drives.iter().enumerate() {
                    let target = drives.target(i);
                    out[first + drive.ctrl] = match drive.realization {
                        Realization::Actuator => actuator::control(&drives.gains[i], &target),
                        Realization::ConstraintRow | Realization::Explicit { .. } => target.position,
                    } as f32;
                }
            }
            Self::Stiffness => out.extend(rows.iter().map(|&i| drives.gains[i].kp as f32)),
            Self::Damping => out.extend(rows.iter().map(|&i| drives.gains[i].kd as f32)),
            Self::MaxEffort => out.extend(rows.iter().map(|&i| drives.gains[i].max_effort.min(UNLIMITED) as f32)),
            Self::TargetPosition => out.extend(rows.iter().map(|&i| drives.position[i] as f32)),
            Self::TargetVelocity => out.extend(rows.iter().map(|&i| drives.velocity[i] as f32)),
            Self::Feedforward => out.extend(rows.iter().map(|&i| drives.feedforward[i] as f32)),
            Self::ViscousDamping => put(drives.damping()),
        }
    }
}
