//! Explicit actuator models: the effort of a motor and its controller, computed at the start of each step.
//!
//! A model reads position, velocity and targets of its joint at the start of a step, and its effort acts during the
//! whole step, with RK4 as well. It therefore acts like a real controller at the rate of the simulation, with the same
//! limit of stability. `add_robot` warns by [`stable_timestep`](super::actuator::stable_timestep), which takes the
//! stiffness of the law and its steepest [damping](ActuatorLaw::damping), the torque-speed line of a motor included.
//! Only `add_robot` checks: gains, drive types and velocity limits set at run time are accepted without a warning.
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

/// State of a joint at the start of a MuJoCo step, the input of an actuator model.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointMotion {
    /// Position \[rad or m\].
    pub position: f64,
    /// Velocity \[rad/s or m/s\].
    pub velocity: f64,
    /// Range of position targets at this time \[rad or m\], lower and upper end. The current target is in this range;
    /// targets in the memory of a model may be outside.
    pub range: [f64; 2],
}

/// The law of an actuator model.
pub trait ActuatorLaw: std::fmt::Debug {
    /// Name in configuration files.
    fn name(&self) -> &'static str;

    /// Checks the parameters of the model against the gains and limits of its joint.
    ///
    /// # Errors
    /// The problem and the fix, as a sentence.
    fn check(&self, gains: &Gains) -> Result<(), String>;

    /// Initial memory of the model in each environment; its length is the size of the memory.
    fn initial_memory(&self) -> Vec<f64> {
        Vec::new()
    }

    /// Resets the memory, after a reset of the environment; `target` has the current targets of the drive.
    fn reset_memory(&self, _target: &Target, _memory: &mut [f64]) {}

    /// Largest decrease of the effort per speed \[N m s/rad or N s/m\]: the damping that decides on stability.
    fn damping(&self, gains: &Gains) -> f64 {
        gains.kd
    }

    /// Effort that acts during the step, after the limits of the model \[N m or N\].
    fn effort(&self, now: &JointMotion, target: &Target, gains: &Gains, memory: &[f64]) -> f64;

    /// Updates the memory after a step with the target `target`.
    fn update_memory(&self, _target: &Target, _memory: &mut [f64]) {}
}

/// List of actuator models: `Variant(configuration and law) = example`.
macro_rules! actuator_models {
    ($($(#[$doc:meta])* $variant:ident($model:ty) = $example:expr,)*) => {
        /// An explicit actuator model with its parameters.
        #[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
        #[serde(rename_all = "snake_case")]
        #[non_exhaustive]
        pub enum ActuatorModel {
            $($(#[$doc])* $variant($model),)*
        }

        impl ActuatorModel {
            /// One example of each model, for tests of all models; the motor has 1 N m or 1 N.
            pub fn examples() -> Vec<Self> {
                vec![$(Self::$variant($example),)*]
            }

            /// Returns the law of the model.
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
    /// Ideal PD controller with an effort limit.
    IdealPd(IdealPd) = IdealPd {},
    /// DC motor, with an effort limit that falls with the speed.
    DcMotor(DcMotor) = DcMotor { saturation_effort: 1.0 },
    /// PD controller with delayed targets.
    DelayedPd(DelayedPd) = DelayedPd::default(),
}

/// PD effort `kp (q* - q) + kd (v* - v) + tau_ff` before the effort limit \[N m or N\].
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
            // Fields with a default may be left out; the stall effort of a motor has no default.
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
