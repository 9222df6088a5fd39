//! Every kind of drive on the wheel, for laws that hold for all drives.

use super::wheel::MOMENT;
use crate::lab::*;
use kinetoscope::sim::drive::JointInfo;
use kinetoscope::sim::{ActuatorModel, DcMotor, DelayedPd, DriveModel, DriveType};

/// Target delay of the delayed models \[steps\].
const DELAY: u32 = 40;

/// Drive mode with its evaluation, or actuator model.
#[derive(Clone, Debug)]
enum Kind {
    Mode(DriveType, DriveModel),
    Actuator(ActuatorModel),
}

/// A kind of drive.
#[derive(Clone, Debug)]
pub(super) struct Variant {
    pub(super) name: String,
    kind: Kind,
}

/// All drive modes, each evaluated implicitly and by MuJoCo's actuators, and all actuator models.
pub(super) fn all() -> Vec<Variant> {
    let of_mode = |mode: DriveType, model: DriveModel| {
        let name = match (mode, model) {
            (DriveType::Force, DriveModel::Implicit) => "implicit".to_string(),
            (DriveType::Force, DriveModel::Actuator) => "actuator".to_string(),
            (mode, DriveModel::Implicit) => mode.mode().name().to_string(),
            (mode, DriveModel::Actuator) => format!("{}, actuator", mode.mode().name()),
        };
        Variant { name, kind: Kind::Mode(mode, model) }
    };
    let modes = DriveType::ALL.iter().filter(|mode| **mode != DriveType::None);
    let modes = modes.flat_map(|&mode| [DriveModel::Implicit, DriveModel::Actuator].map(|model| of_mode(mode, model)));
    let laws = ActuatorModel::examples().into_iter().map(|example| {
        let name = example.law().name().to_string();
        // DC motors whose torque-speed curve does not limit the effort here.
        let model = match example {
            ActuatorModel::DcMotor(_) => DcMotor { saturation_effort: 1e4 }.into(),
            ActuatorModel::DelayedPd(_) => DelayedPd { delay: DELAY, max_delay: DELAY }.into(),
            other => other,
        };
        Variant { name, kind: Kind::Actuator(model) }
    });
    modes.chain(laws).collect()
}

impl Variant {
    /// The drive with these gains at the wheel \[N m/rad, N m s/rad\].
    pub(super) fn drive(&self, stiffness: f64, damping: f64) -> DriveCfg {
        match &self.kind {
            Kind::Mode(mode, model) => {
                let unit = match mode {
                    DriveType::Force => 1.0,
                    // Gains of acceleration drives are per unit of inertia.
                    DriveType::Acceleration => MOMENT,
                    other => other.mode().gain_scale(&JointInfo { effective_inertia: MOMENT }).unwrap(),
                };
                DriveCfg { drive_type: *mode, model: *model, ..implicit(stiffness / unit, damping / unit) }
            }
            Kind::Actuator(law) => {
                let [max_effort, max_velocity] = [Some(1e3.into()), Some(1e3.into())];
                let actuators = vec![(".*".into(), *law)];
                DriveCfg { actuators, max_effort, max_velocity, ..implicit(stiffness, damping) }
            }
        }
    }

    /// Target delay \[steps\].
    pub(super) fn delay(&self) -> u32 {
        match &self.kind {
            Kind::Actuator(ActuatorModel::DelayedPd(model)) => model.delay,
            _ => 0,
        }
    }
}
