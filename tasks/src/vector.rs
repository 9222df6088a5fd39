//! What learning code asks of a batch of environments, however it is made.

use crate::environment::Env;
use crate::error::EnvError;
use crate::space::Space;
use crate::step::{Info, Step};
use ndarray::{Array2, ArrayView2};

/// A batch of environments that learn side by side: Gymnasium's `VectorEnv`.
///
/// [`Env`] is one, of a simulation and terms. Implement it for what is made otherwise (a closed form, another simulator, a layer
/// around an `Env` that filters observations), and write what learns for any of them:
///
/// ```
/// use kinetoscope_tasks::VectorEnv;
/// use ndarray::{Array1, Array2};
///
/// /// Mean reward of `steps` steps with actions in the middle of their bounds.
/// fn idle<E: VectorEnv>(env: &mut E, steps: usize) -> Result<f64, E::Error> {
///     let space = env.action_space();
///     let middle: Array1<f64> = space.low().iter().zip(space.high()).map(|(low, high)| 0.5 * (low + high)).collect();
///     let actions = Array2::from_shape_fn((env.num_envs(), middle.len()), |(_, k)| middle[k]);
///     env.reset(None, Some(0))?;
///     let mut sum = 0.0;
///     for _ in 0..steps {
///         sum += env.step(actions.view())?.rewards.sum();
///     }
///     Ok(sum / (steps * env.num_envs()) as f64)
/// }
/// ```
///
/// What an implementation promises:
///
/// - spaces and the number of environments, N, never change;
/// - [`reset`](Self::reset) comes before the first [`step`](Self::step);
/// - an environment whose episode ends begins the next one in the same step (Gymnasium's `AutoresetMode.SAME_STEP`), with the last
///   observation of the old one in [`Step::final_observations`]; one that somebody else has reset is truncated, and that
///   observation is of the state after the reset ([`EndReason::Reset`](crate::EndReason::Reset) where there are reasons);
/// - what is observed is finite; actions beyond their bounds become the bounds;
/// - environments do not know of each other, and the same seed and actions give the same bits.
///
/// `Box<dyn VectorEnv<Error = E, Info = I>>` is possible: where kinds of environments are only known when the program runs.
pub trait VectorEnv {
    /// What can go wrong.
    type Error: std::error::Error + Send + Sync + 'static;
    /// What a step tells besides: `()` for nothing.
    type Info;

    /// Number of environments, N.
    fn num_envs(&self) -> usize;

    /// Columns of the observations.
    fn observation_space(&self) -> &Space;

    /// Columns of the actions.
    fn action_space(&self) -> &Space;

    /// Begins new episodes where `mask` is true (everywhere where it is `None`), elsewhere nothing happens; with a seed, random
    /// numbers start again there. Gives what is seen in all environments, shape (N, columns of
    /// [`observation_space`](Self::observation_space)).
    ///
    /// # Errors
    /// A mask that has not one value for each environment, or what else the implementation cannot do.
    fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>, Self::Error>;

    /// Does one step in all environments. `actions` has shape (N, columns of [`action_space`](Self::action_space)).
    ///
    /// # Errors
    /// Actions of another shape or that are not finite, an environment that was never reset, or what else the implementation
    /// cannot do.
    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step<Self::Info>, Self::Error>;
}

impl VectorEnv for Env {
    type Error = EnvError;
    type Info = Info;

    fn num_envs(&self) -> usize {
        Self::num_envs(self)
    }

    fn observation_space(&self) -> &Space {
        Self::observation_space(self)
    }

    fn action_space(&self) -> &Space {
        Self::action_space(self)
    }

    fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>, EnvError> {
        Self::reset(self, mask, seed)
    }

    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step, EnvError> {
        Self::step(self, actions)
    }
}
