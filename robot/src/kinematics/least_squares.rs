//! Damped least squares within joint limits: descent from a start to a minimum of the error.

use super::cfg::IkTask;
use super::chain::Chain;
use kinetoscope_scene::Pose;
use nalgebra::{Matrix6, Vector6};

/// Target and weights of a descent.
#[derive(Clone, Copy, Debug)]
pub(super) struct Problem<'p> {
    pub(super) chain: &'p Chain,
    pub(super) limits: &'p [[f64; 2]],
    /// Target pose of the tip in the base frame of the chain.
    pub(super) target: Pose,
    pub(super) task: IkTask,
    /// Radians that count as much as one meter.
    pub(super) scale: f64,
}

/// Stopping criteria of a descent.
#[derive(Clone, Copy, Debug)]
pub(super) struct StopCriteria {
    /// Position tolerance \[m\].
    pub(super) position: f64,
    /// Rotation tolerance \[rad\].
    pub(super) rotation: f64,
    /// Maximum number of steps, rejected steps included.
    pub(super) iterations: u32,
    /// True to stop when progress is too slow to be worth it.
    pub(super) stop_on_slow_progress: bool,
}

/// Joint positions and the quantities computed from them.
#[derive(Clone, Debug)]
pub(super) struct Iterate {
    pub(super) positions: Vec<f64>,
    /// Columns of the Jacobian, weighted like the error.
    columns: Vec<Vector6<f64>>,
    /// Error to the target: weighted translation, then rotation, in the axes of the base.
    error: Vector6<f64>,
    /// Half the squared length of the error.
    pub(super) cost: f64,
    /// Distance to the target \[m\].
    pub(super) position_error: f64,
    /// Angle to the target \[rad\].
    pub(super) rotation_error: f64,
}

impl Iterate {
    pub(super) fn new(joints: usize) -> Self {
        Self {
            positions: vec![0.0; joints],
            columns: vec![Vector6::zeros(); joints],
            error: Vector6::zeros(),
            cost: f64::INFINITY,
            position_error: f64::INFINITY,
            rotation_error: f64::INFINITY,
        }
    }

    /// Copies all values of a point with the same number of joints.
    pub(super) fn copy_from(&mut self, other: &Self) {
        self.positions.copy_from_slice(&other.positions);
        self.columns.copy_from_slice(&other.columns);
        (self.error, self.cost) = (other.error, other.cost);
        (self.position_error, self.rotation_error) = (other.position_error, other.rotation_error);
    }

    /// Computes all quantities that depend on the positions.
    pub(super) fn evaluate(&mut self, problem: &Problem<'_>) {
        let pose = problem.chain.jacobian(&self.positions, &mut self.columns);
        let way = problem.target.translation.vector - pose.translation.vector;
        let turn = (problem.target.rotation * pose.rotation.inverse()).scaled_axis();
        (self.position_error, self.rotation_error) = (way.norm(), turn.norm());
        let (meter, radian) = match problem.task {
            IkTask::Pose => (problem.scale, 1.0),
            IkTask::Position => (problem.scale, 0.0),
        };
        let weights = Vector6::new(meter, meter, meter, radian, radian, radian);
        for column in &mut self.columns {
            column.component_mul_assign(&weights);
        }
        self.error = Vector6::new(way.x, way.y, way.z, turn.x, turn.y, turn.z).component_mul(&weights);
        self.cost = 0.5 * self.error.norm_squared();
    }

    pub(super) fn is_within(&self, stop: &StopCriteria, task: IkTask) -> bool {
        self.position_error <= stop.position && (task == IkTask::Position || self.rotation_error <= stop.rotation)
    }

    /// Squared distance to other joint positions.
    fn distance_squared(&self, positions: &[f64]) -> f64 {
        self.positions.iter().zip(positions).map(|(a, b)| (a - b) * (a - b)).sum()
    }
}

/// Regularization added to the squared singular values. A rank-deficient matrix, as of every chain of fewer than six
/// joints, must have a Cholesky factor.
const REGULARIZATION: f64 = 1e-10;
/// Bounds of the damping, in multiples of half the squared error e. Along a singular direction of value s a step is e s
/// / (s² + λ), at most e / (2 √λ) = 1 / √(2 damping) whatever the error is: 2.2 for a damping of 0.1, 71 for the
/// smallest damping. So damping bounds steps far from the target and hardly matters where the error is small. There the
/// gain decides, since a step without gain is rejected. At the largest damping a step is lost in rounding.
const MIN_DAMPING: f64 = 1e-4;
const MAX_DAMPING: f64 = 1e12;
/// A step is slow if it reduces the squared error by less than this fraction.
const MIN_RELATIVE_GAIN: f64 = 0.02;
/// Number of slow steps in a row after which another start is more promising.
const MAX_SLOW_STEPS: u32 = 4;
/// Longest step of a joint towards a posture \[rad or m\]: the free positions form a curved surface.
const MAX_POSTURE_STEP: f64 = 0.3;
/// Fraction of the tolerances that may remain after a step towards a posture, so that the error does not hide the gain.
const POSTURE_ERROR_FRACTION: f64 = 1e-5;
/// A joint nearer to a limit than this \[rad or m\] counts as at the limit.
const LIMIT_TOLERANCE: f64 = 1e-9;
/// A distance to the posture below this \[rad or m\] is not worth a step.
const MIN_POSTURE_STEP: f64 = 1e-6;

/// Working memory of a search.
#[derive(Clone, Debug)]
pub(super) struct LevenbergMarquardt {
    /// Current positions.
    pub(super) current: Iterate,
    trial: Iterate,
    saved: Iterate,
    /// True for joints that may move: a joint at a limit must not move beyond it.
    free: Vec<bool>,
}

impl LevenbergMarquardt {
    pub(super) fn new(joints: usize) -> Self {
        let point = Iterate::new(joints);
        Self { current: point.clone(), trial: point.clone(), saved: point, free: vec![true; joints] }
    }

    /// Descends from the current positions. Returns the number of steps, rejected steps included.
    ///
    /// Levenberg-Marquardt with the step Jᵀ (J Jᵀ + λ)⁻¹ e, whose matrix has six rows whatever the number of joints. λ
    /// is a multiple of the squared error, so that it vanishes at the target and damps steps far from it (T. Sugihara,
    /// "Solvability-unconcerned inverse kinematics by the Levenberg-Marquardt method", IEEE Trans. Robotics 27, 2011).
    /// The multiple follows the ratio of actual to predicted gain of a step, and steps without gain are rejected (H. B.
    /// Nielsen, "Damping parameter in Marquardt's method", report IMM-REP-1999-05). Joints that the error pushes
    /// against their limits are left out, and steps are cut at limits.
    pub(super) fn descend(&mut self, problem: &Problem<'_>, stop: &StopCriteria, damping: f64) -> u32 {
        let (mut damping, mut growth, mut slow) = (damping, 2.0, 0);
        let mut gram = self.gram_of_free(problem);
        for iteration in 0..stop.iterations {
            if self.current.is_within(stop, problem.task) {
                return iteration;
            }
            let lambda = damping * self.current.cost + REGULARIZATION;
            let Some(factor) = (gram + Matrix6::from_diagonal_element(lambda)).cholesky() else { return iteration };
            let y = factor.solve(&self.current.error);
            let (mut left, mut moves) = (self.current.error, false);
            for (i, column) in self.current.columns.iter().enumerate() {
                let ([low, high], position) = (problem.limits[i], self.current.positions[i]);
                let step = if self.free[i] { column.dot(&y) } else { 0.0 };
                let next = (position + step).clamp(low, high);
                self.trial.positions[i] = next;
                left -= column * (next - position);
                moves |= next != position;
            }
            if !moves {
                return iteration;
            }
            self.trial.evaluate(problem);
            let actual_gain = self.current.cost - self.trial.cost;
            if actual_gain > 0.0 {
                let predicted_gain = self.current.cost - 0.5 * left.norm_squared();
                let gain_ratio = if predicted_gain > 0.0 { (actual_gain / predicted_gain).min(1.0) } else { 0.5 };
                let change = (1.0 - (2.0 * gain_ratio - 1.0).powi(3)).max(1.0 / 3.0);
                damping = (damping * change).max(MIN_DAMPING);
                growth = 2.0;
                slow = if actual_gain < MIN_RELATIVE_GAIN * self.current.cost { slow + 1 } else { 0 };
                std::mem::swap(&mut self.current, &mut self.trial);
                if stop.stop_on_slow_progress && slow >= MAX_SLOW_STEPS {
                    return iteration + 1;
                }
                gram = self.gram_of_free(problem);
            } else {
                damping *= growth;
                growth *= 2.0;
                if damping > MAX_DAMPING {
                    return iteration + 1;
                }
            }
        }
        stop.iterations
    }

    /// Finds the joints that may move, and returns J Jᵀ of them.
    fn gram_of_free(&mut self, problem: &Problem<'_>) -> Matrix6<f64> {
        for (i, free) in self.free.iter_mut().enumerate() {
            let [low, high] = problem.limits[i];
            let (position, pull) = (self.current.positions[i], self.current.columns[i].dot(&self.current.error));
            *free = !(position <= low && pull < 0.0 || position >= high && pull > 0.0);
        }
        self.gram()
    }

    fn gram(&self) -> Matrix6<f64> {
        let mut gram = Matrix6::zeros();
        for (column, _) in self.current.columns.iter().zip(&self.free).filter(|(_, free)| **free) {
            gram.ger(1.0, column, column, 1.0);
        }
        gram
    }

    /// Moves towards the positions `rest` as far as the target leaves the joints free, starting where the target is
    /// reached. Returns the number of steps.
    ///
    /// Each step is the part of the way to `rest` in the null space of the Jacobian, (1 - J⁺ J) (rest - q) (A.
    /// Liégeois, "Automatic supervisory control of the configuration and behavior of multibody mechanisms", IEEE Trans.
    /// Systems, Man and Cybernetics 7, 1977). Further steps then bring the frame back to the target. A step is rejected
    /// and halved if it does not come nearer to `rest` or its frame does not come back, so the target stays reached.
    /// The search ends without further gain, and near singular positions, where the null space curves too sharply for
    /// steps of a thousandth.
    pub(super) fn approach_posture(
        &mut self,
        problem: &Problem<'_>,
        stop: &StopCriteria,
        rest: &[f64],
        gain: f64,
    ) -> u32 {
        let (mut part, mut used) = (gain, 0);
        for _ in 0..stop.iterations {
            if part < 1e-3 * gain || !self.posture_step(problem, rest, part) {
                break;
            }
            self.saved.copy_from(&self.current);
            std::mem::swap(&mut self.current, &mut self.trial);
            self.current.evaluate(problem);
            let back = StopCriteria {
                iterations: 8,
                position: POSTURE_ERROR_FRACTION * stop.position,
                rotation: POSTURE_ERROR_FRACTION * stop.rotation,
                ..*stop
            };
            used += 1 + self.descend(problem, &back, MIN_DAMPING);
            let nearer = self.current.distance_squared(rest) < self.saved.distance_squared(rest);
            if nearer && self.current.is_within(stop, problem.task) {
                part = gain.min(2.0 * part);
            } else {
                self.current.copy_from(&self.saved);
                part *= 0.5;
            }
        }
        used
    }

    /// Puts `trial` a step nearer to `rest`. Returns `false` if no step is possible, or if the longest step is at most
    /// [`MIN_POSTURE_STEP`].
    fn posture_step(&mut self, problem: &Problem<'_>, rest: &[f64], part: f64) -> bool {
        self.free.fill(true);
        // Every round excludes one joint, or is the last.
        for _ in 0..=rest.len() {
            let wish = |i: usize| part * (rest[i] - self.current.positions[i]);
            let mut seen = Vector6::zeros();
            for i in (0..rest.len()).filter(|&i| self.free[i]) {
                seen += self.current.columns[i] * wish(i);
            }
            let Some(factor) = (self.gram() + Matrix6::from_diagonal_element(REGULARIZATION)).cholesky() else {
                return false;
            };
            let y = factor.solve(&seen);
            let step = |i: usize| if self.free[i] { wish(i) - self.current.columns[i].dot(&y) } else { 0.0 };
            let blocked = (0..rest.len()).find(|&i| {
                let ([low, high], position) = (problem.limits[i], self.current.positions[i]);
                position <= low + LIMIT_TOLERANCE && step(i) < 0.0
                    || position >= high - LIMIT_TOLERANCE && step(i) > 0.0
            });
            if let Some(i) = blocked {
                self.free[i] = false;
                continue;
            }
            let longest = (0..rest.len()).map(|i| step(i).abs()).fold(0.0, f64::max);
            // The step ends at the first limit: beyond it the frame would leave its place.
            let room = |i: usize| {
                let ([low, high], position) = (problem.limits[i], self.current.positions[i]);
                (if step(i) > 0.0 { high - position } else { position - low }) / step(i).abs()
            };
            let shorter = (0..rest.len())
                .filter(|&i| step(i) != 0.0)
                .map(room)
                .fold((MAX_POSTURE_STEP / longest).min(1.0), f64::min);
            for i in 0..rest.len() {
                let [low, high] = problem.limits[i];
                self.trial.positions[i] = (self.current.positions[i] + shorter * step(i)).clamp(low, high);
            }
            return longest > MIN_POSTURE_STEP;
        }
        false
    }
}
