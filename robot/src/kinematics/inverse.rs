//! Inverse kinematics: joint positions that bring a frame to a target pose.

use super::cfg::IkCfg;
use super::chain::Chain;
use super::error::KinematicsError;
use super::least_squares::{Iterate, LevenbergMarquardt, Problem, StopCriteria};
use kinetoscope_scene::{KeyedRng, Pose};
use std::f64::consts::{PI, TAU};

/// Inverse-kinematics solver of a [`Chain`]. Solves can be repeated and allocate no memory.
///
/// A solve descends by damped least squares within the limits. It starts from the initial positions, then from random
/// positions, until one start reaches the target. Random starts are uniform within the limits; for a joint whose full
/// turns leave the frame unchanged, at most half a turn from the middle of its limits. A joint with an infinite limit
/// starts within half a turn about its initial position, or, if full turns move the frame, within the chain's
/// [`reach`](Chain::reach) \[rad or m\]. The error is weighted as if that reach were two radians. Among positions that
/// differ by full turns and are within the limits, the result is the one nearest to the posture, or to the initial
/// positions if there is no posture.
///
/// A solve takes at most `num_seeds * max_iterations` steps, then at most 4 to refine a reached target, or at most `8 *
/// max_iterations` for a missed one, and those toward the posture. A target that is not reached uses all starts.
#[derive(Clone, Debug)]
pub struct IkSolver {
    chain: Chain,
    limits: Vec<[f64; 2]>,
    cfg: IkCfg,
    /// Random numbers, uniform in 0..1, one for each joint, start by start.
    random: Vec<f64>,
    least_squares: LevenbergMarquardt,
    best: Iterate,
}

/// Result of [`IkSolver::solve`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct IkSolution<'s> {
    /// Positions of the variables \[rad or m\], within the limits; those with the smallest weighted error if `success`
    /// is false.
    pub positions: &'s [f64],
    /// True if the errors are within the tolerances; for [`IkTask::Position`](super::IkTask::Position), only the
    /// position error counts.
    pub success: bool,
    /// Distance of the frame from the target \[m\].
    pub position_error: f64,
    /// Angle between the frame and the target \[rad\]; also given where only the position had to be reached.
    pub rotation_error: f64,
    /// Number of solver iterations of all starts and of the refinement together.
    pub iterations: u32,
    /// Index of the start that led to the result; 0 is the start from the initial positions.
    pub seed: u32,
}

impl IkSolver {
    /// Creates a solver for `chain`. The solver moves all variables of the chain, each within its `limits` (lower,
    /// upper) \[rad or m\]. Limits may be infinite. [`Chain::reduced`] fixes variables that must not move.
    ///
    /// # Errors
    /// The chain has no variable, or one that does not move its frame. The length of `limits` differs from the number
    /// of variables, no finite position lies within a pair of limits, or `cfg` is invalid.
    pub fn new(chain: Chain, limits: Vec<[f64; 2]>, cfg: IkCfg) -> Result<Self, KinematicsError> {
        let joints = limits.len();
        if chain.variables() > joints {
            return Err(KinematicsError::WrongLength { what: "limits", expected: chain.variables(), found: joints });
        }
        if joints == 0 || (0..joints).any(|variable| !chain.is_moved_by(variable)) {
            let value = match (0..joints).find(|&variable| !chain.is_moved_by(variable)) {
                Some(variable) => format!("not moved by variable {variable}"),
                None => "without joints".into(),
            };
            let expected = "every variable must move the frame: hold the other variables with Chain::reduced";
            return Err(KinematicsError::OutOfRange { field: "the chain", value, expected });
        }
        cfg.validate(joints)?;
        if let Some(limit) = limits.iter().find(|[low, high]| !(low <= high && *low < f64::MAX && *high > f64::MIN)) {
            let expected = "the lower limit must not be above the upper one";
            return Err(KinematicsError::OutOfRange { field: "limits", value: format!("{limit:?}"), expected });
        }
        let mut random = KeyedRng::keyed(cfg.seed, 0, "inverse kinematics");
        let count = (cfg.num_seeds as usize - 1) * joints;
        let random = (0..count).map(|_| random.uniform()).collect();
        Ok(Self {
            chain,
            limits,
            cfg,
            random,
            least_squares: LevenbergMarquardt::new(joints),
            best: Iterate::new(joints),
        })
    }

    /// Chain that the solver moves: its variables, base and tip.
    pub fn chain(&self) -> &Chain {
        &self.chain
    }

    /// Mutable access to the chain, to change its fixed part ([`Chain::reduce_into`]). A new chain must have the same
    /// number of variables, and each must move the frame.
    pub fn chain_mut(&mut self) -> &mut Chain {
        &mut self.chain
    }

    /// Finds positions that bring the frame to `target`, a pose in the frame of the base link of the chain. `initial`
    /// \[rad or m\] has one number for each variable and is clamped to the limits.
    ///
    /// # Errors
    /// `initial` has the wrong length, a number is not finite, or the rotation of the target is not of length 1. A
    /// target that is not reached is not an error: see [`IkSolution::success`].
    pub fn solve(&mut self, target: &Pose, initial: &[f64]) -> Result<IkSolution<'_>, KinematicsError> {
        if initial.len() != self.limits.len() {
            let (expected, found) = (self.limits.len(), initial.len());
            return Err(KinematicsError::WrongLength { what: "the initial positions", expected, found });
        }
        if initial.iter().any(|x| !x.is_finite()) {
            return Err(KinematicsError::NotFinite { what: "the initial positions" });
        }
        if !target.translation.vector.iter().chain(target.rotation.coords.iter()).all(|x| x.is_finite()) {
            return Err(KinematicsError::NotFinite { what: "the target" });
        }
        if (target.rotation.norm() - 1.0).abs() > 1e-6 {
            let value = format!("{:?}", kinetoscope_scene::pose::to_wxyz(&target.rotation));
            let expected = "it must be a unit quaternion w, x, y, z";
            return Err(KinematicsError::OutOfRange { field: "the rotation of the target", value, expected });
        }
        Ok(self.search(target, initial))
    }

    fn search(&mut self, target: &Pose, initial: &[f64]) -> IkSolution<'_> {
        let Self { chain, limits, cfg, random, least_squares, best } = self;
        let reach = Some(chain.reach()).filter(|&reach| reach > 0.0).unwrap_or(1.0);
        let problem = Problem { chain, limits, target: *target, task: cfg.task, scale: 2.0 / reach };
        let (position, rotation) = (cfg.position_tolerance, cfg.rotation_tolerance);
        let near = StopCriteria { position, rotation, iterations: cfg.max_iterations, stop_on_slow_progress: true };

        let (mut seed, mut iterations, mut reached) = (0, 0, false);
        for start in 0..cfg.num_seeds {
            let random = (start as usize).checked_sub(1).map(|row| &random[row * limits.len()..]);
            set_start(&problem, initial, random, reach, &mut least_squares.current.positions);
            least_squares.current.evaluate(&problem);
            iterations += least_squares.descend(&problem, &near, cfg.damping);
            reached = least_squares.current.is_within(&near, cfg.task);
            if reached || start == 0 || least_squares.current.cost < best.cost {
                best.copy_from(&least_squares.current);
                seed = start;
            }
            if reached {
                break;
            }
        }
        least_squares.current.copy_from(best);
        if reached {
            // Convergence is fast near the target: a few more steps remove most of the remaining error.
            let finish = StopCriteria { position: 0.01 * position, rotation: 0.01 * rotation, iterations: 4, ..near };
            iterations += least_squares.descend(&problem, &finish, cfg.damping);
            if !least_squares.current.is_within(&near, cfg.task) {
                least_squares.current.copy_from(best);
            }
        } else {
            let finish =
                StopCriteria { iterations: cfg.max_iterations.saturating_mul(8), stop_on_slow_progress: false, ..near };
            iterations += least_squares.descend(&problem, &finish, cfg.damping);
        }
        let posture = cfg.posture.as_ref();
        remove_full_turns(&problem, posture.map_or(initial, |p| &p.rest), &mut least_squares.current.positions);
        least_squares.current.evaluate(&problem);
        if let Some(posture) = posture.filter(|_| least_squares.current.is_within(&near, cfg.task)) {
            iterations += least_squares.approach_posture(&problem, &near, &posture.rest, posture.gain);
        }
        let at = &least_squares.current;
        IkSolution {
            positions: &at.positions,
            success: at.is_within(&near, cfg.task),
            position_error: at.position_error,
            rotation_error: at.rotation_error,
            iterations,
            seed,
        }
    }
}

/// Sets the positions of a start: the initial ones, or those of `random` (uniform in 0..1).
fn set_start(problem: &Problem<'_>, initial: &[f64], random: Option<&[f64]>, reach: f64, positions: &mut [f64]) {
    for (i, position) in positions.iter_mut().enumerate() {
        let [low, high] = problem.limits[i];
        let chosen = match random {
            None => initial[i],
            Some(random) => {
                let turns = problem.chain.is_full_turn_periodic(i);
                let (middle, half) = match (high - low).is_finite() {
                    true if turns => (0.5 * (low + high), (0.5 * (high - low)).min(PI)),
                    true => (0.5 * (low + high), 0.5 * (high - low)),
                    false => (initial[i], if turns { PI } else { reach }),
                };
                middle + (2.0 * random[i] - 1.0) * half
            }
        };
        *position = chosen.clamp(low, high);
    }
}

/// Removes full turns where a position then is nearer to `reference` and stays within the limits.
fn remove_full_turns(problem: &Problem<'_>, reference: &[f64], positions: &mut [f64]) {
    for (i, position) in positions.iter_mut().enumerate().filter(|(i, _)| problem.chain.is_full_turn_periodic(*i)) {
        let [low, high] = problem.limits[i];
        let (fewest, most) = (((low - *position) / TAU).ceil(), ((high - *position) / TAU).floor());
        let turns = ((reference[i] - *position) / TAU).round();
        if fewest <= most {
            *position = (*position + TAU * turns.clamp(fewest, most)).clamp(low, high);
        }
    }
}
