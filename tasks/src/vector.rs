//! The interface between learning code and batches of environments: [`VectorEnv`].

use crate::autoreset::AutoresetMode;
use crate::environment::Env;
use crate::error::EnvError;
use crate::space::Space;
use crate::step::{Step, StepInfo};
use ndarray::{Array2, ArrayView2};

/// A batch of environments for learning code: Gymnasium's `VectorEnv`.
///
/// [`Env`] implements it with a simulation and terms. Implement it for other batches: a closed-form system, another
/// simulator, or a wrapper of an `Env` that filters observations. Write learning code for any implementation:
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
/// An implementation keeps this contract, most of which [`check`](fn@crate::check) tests:
///
/// - The spaces and the number of environments, N, never change.
/// - The caller resets all environments before the first [`step`](Self::step).
/// - An environment whose episode ends begins the next one as [`autoreset_mode`](Self::autoreset_mode) says. The last
///   observation of the old episode is in [`Step::final_observations`].
/// - An episode that is reset from outside is truncated. Its final observation is that of the state after the reset
///   ([`EndReason::Reset`](crate::EndReason::Reset) if the implementation reports reasons).
/// - Observations are finite. Actions beyond their bounds are clamped.
/// - Environments do not influence each other. The same seed and actions give the same bits.
///
/// The trait is dyn-compatible: `Box<dyn VectorEnv<Error = E, Info = I>>` holds an implementation chosen at run time.
pub trait VectorEnv {
    /// Error type of resets and steps.
    type Error: std::error::Error + Send + Sync + 'static;
    /// Additional results of a step; `()` for an implementation without any.
    type Info;

    /// Number of environments, N.
    fn num_envs(&self) -> usize;

    /// Columns of the observations.
    fn observation_space(&self) -> &Space;

    /// Columns of the actions.
    fn action_space(&self) -> &Space;

    /// Time at which an environment whose episode ended begins the next one, the same in all steps. The default is
    /// [`AutoresetMode::SameStep`].
    fn autoreset_mode(&self) -> AutoresetMode {
        AutoresetMode::SameStep
    }

    /// Begins new episodes where `mask` is true (everywhere if it is `None`), and returns the observations of all
    /// environments, shape (N, columns of [`observation_space`](Self::observation_space)). With a `seed`, the random
    /// numbers of these environments restart. Other environments are unchanged.
    ///
    /// # Errors
    /// The mask has another length than N, or the implementation fails.
    fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>, Self::Error>;

    /// Does one step in all environments. `actions` has shape (N, columns of [`action_space`](Self::action_space)).
    ///
    /// # Errors
    /// The actions have another shape or are not finite, an environment was never reset, its episode ended and automatic
    /// resets are disabled, or the implementation fails.
    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step<Self::Info>, Self::Error>;
}

impl VectorEnv for Env {
    type Error = EnvError;
    type Info = StepInfo;

    fn num_envs(&self) -> usize {
        Self::num_envs(self)
    }

    fn observation_space(&self) -> &Space {
        Self::observation_space(self)
    }

    fn action_space(&self) -> &Space {
        Self::action_space(self)
    }

    fn autoreset_mode(&self) -> AutoresetMode {
        self.cfg().autoreset
    }

    fn reset(&mut self, mask: Option<&[bool]>, seed: Option<u64>) -> Result<Array2<f64>, EnvError> {
        Self::reset(self, mask, seed)
    }

    fn step(&mut self, actions: ArrayView2<'_, f64>) -> Result<Step, EnvError> {
        Self::step(self, actions)
    }
}
