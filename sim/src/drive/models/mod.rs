//! Explicit actuator models: the effort of a motor and its controller, computed at the start of each step.
//!
//! A model sees position, velocity and targets of its joint as they are when the step begins, and its effort acts during the
//! whole step (with RK4, too). It is therefore what a real controller at the rate of the simulation would do, with the same
//! limit of stability: see [`stable_timestep`](super::actuator::stable_timestep), which `add_robot` warns with. It takes the
//! law's stiffness together with its steepest [damping](ActuatorLaw::damping), that of a motor's torque-speed line, too.
//! Only `add_robot` looks: gains, drive types and speed limits that are set while the simulation runs are taken without a
//! warning, stable or not.
//!
//! A model is one file with an [`ActuatorLaw`], and one line in the list below.

mod dc_motor;
mod delayed_pd;
mod ideal_pd;

pub use dc_motor::DcMotor;
pub use delayed_pd::DelayedPd;
pub use ideal_pd::IdealPd;

use super::gains::{Gains, Target};
use serde::{Deserialize, Serialize};

/// What an actuator model sees of its joint, at the start of the step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[rad/s or m/s\].
    pub velocity: f64,
    /// Positions that a target may have now \[rad or m\], lower and upper end. The present target is among them; one that a
    /// model remembers need not be.
    pub range: [f64; 2],
}

/// The law of an actuator model.
pub trait ActuatorLaw: std::fmt::Debug {
    /// Name in configuration files.
    fn name(&self) -> &'static str;

    /// What is wrong with the model's numbers, or with the gains and limits of its joint.
    ///
    /// # Errors
    /// What would be right, as a sentence.
    fn check(&self, gains: &Gains) -> Result<(), String>;

    /// What the model keeps from step to step, in each environment: as it is before the first step.
    fn memory(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Forgets what was before: `target` is what the drive is asked for at the start.
    fn start(&self, _target: &Target, _memory: &mut [f64]) {}

    /// How steeply the effort falls with the speed where that is steepest \[N m s/rad or N s/m\]: the damping that decides
    /// whether the law is stable.
    fn damping(&self, gains: &Gains) -> f64 {
        gains.kd
    }

    /// The effort in a step \[N m or N\].
    fn effort(&self, now: &JointMotion, target: &Target, gains: &Gains, memory: &[f64]) -> f64;

    /// After a step, in which the drive was asked for `target`.
    fn remember(&self, _target: &Target, _memory: &mut [f64]) {}
}

/// The list of actuator models: `Variant(its configuration and law) = one to try`.
macro_rules! actuator_models {
    ($($(#[$doc:meta])* $variant:ident($model:ty) = $example:expr,)*) => {
        /// An explicit actuator model and its numbers.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        pub enum ActuatorModel {
            $($(#[$doc])* $variant($model),)*
        }

        impl ActuatorModel {
            /// One of each kind, to try what holds for all of them; a motor of 1 N m, or 1 N.
            pub fn examples() -> Vec<Self> {
                vec![$(Self::$variant($example),)*]
            }

            /// The model's law.
            pub fn law(&self) -> &dyn ActuatorLaw {
                match self {
                    $(Self::$variant(model) => model,)*
                }
            }
        }

        $(
            impl From<$model> for ActuatorModel {
                fn from(model: $model) -> Self {
                    Self::$variant(model)
                }
            }
        )*
    };
}

actuator_models! {
    /// A controller that gives what its law asks for, up to the effort limit.
    IdealPd(IdealPd) = IdealPd {},
    /// A motor that gives less the faster it turns.
    DcMotor(DcMotor) = DcMotor { saturation_effort: 1.0 },
    /// A controller that hears of its targets some steps later.
    DelayedPd(DelayedPd) = DelayedPd::default(),
}

/// `kp (q* - q) + kd (v* - v) + tau_ff`, not clamped.
fn proportional_derivative(now: &JointMotion, target: &Target, gains: &Gains) -> f64 {
    gains.kp * (target.position - now.position) + gains.kd * (target.velocity - now.velocity) + target.feedforward
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_in_files() {
        let mut names: Vec<&str> = ActuatorModel::examples().iter().map(|model| model.law().name()).collect();
        for (model, name) in ActuatorModel::examples().iter().zip(&names) {
            let text = serde_json::to_string(model).expect("numbers");
            assert!(text.starts_with(&format!("{{\"{name}\":{{")), "{text}");
            let again: ActuatorModel = serde_json::from_str(&text).expect("as written");
            assert_eq!(again, *model);
            // What has a default may be left out; the effort of a motor has none.
            let plain = serde_json::from_str::<ActuatorModel>(&format!("{{\"{name}\":{{}}}}"));
            match model {
                ActuatorModel::IdealPd(_) | ActuatorModel::DelayedPd(_) => assert_eq!(plain.expect("defaults"), *model),
                ActuatorModel::DcMotor(_) => {
                    let message = plain.expect_err("no default").to_string();
                    assert!(message.contains("missing field `saturation_effort`"), "{message}");
                }
            }
            assert!(serde_json::from_str::<ActuatorModel>(&format!("{{\"{name}\":{{\"x\":1}}}}")).is_err());
        }
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), ActuatorModel::examples().len());
    }
}
