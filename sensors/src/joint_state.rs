//! Joint encoders: positions, velocities and efforts of joints.

use crate::error::SensorError;
use crate::history::History;
use crate::schedule::{Phases, Schedule};
use crate::sensor::{Requires, Sensor, SensorCfg, SensorContext};
use ndarray::{Array1, Array2, ArrayView1, ArrayView2, ArrayView3, Axis};
use scene::SceneState;

/// Configuration of a [`JointState`] sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct JointStateCfg {
    /// Columns of [`SceneState::joint_positions`] to measure, in the order they are reported; `None` is all of them.
    pub joints: Option<Vec<usize>>,
    /// Time between measurements \[s\]; 0 is every physics step.
    pub update_period: f64,
    /// Take the nearest whole number of physics steps where the period is none, instead of an error.
    pub round_period: bool,
    /// Measurements to remember, the newest included.
    pub history_length: usize,
}

/// Positions, velocities and efforts of joints in all environments.
#[derive(Clone, Debug)]
pub struct JointState {
    joints: Vec<usize>,
    num_joints: usize,
    phases: Phases,
    positions: Quantity,
    velocities: Quantity,
    efforts: Quantity,
    stamps: Stamps,
    effort_stamps: Stamps,
    sample_counts: Array1<u64>,
}

/// Current values, shape \[num_envs, joints\], and those of past measurements.
#[derive(Clone, Debug)]
struct Quantity {
    now: Array2<f64>,
    history: History<f64>,
}

/// Time of the current values, shape \[num_envs\], and of past measurements.
#[derive(Clone, Debug)]
struct Stamps {
    now: Array1<f64>,
    history: History<f64>,
}

impl SensorCfg for JointStateCfg {
    type Sensor = JointState;

    fn requires(&self) -> Requires {
        JointState::REQUIRES
    }

    fn build(&self, context: &SensorContext) -> Result<JointState, SensorError> {
        let schedule = Schedule::new(self.update_period, context.dt, self.round_period)?;
        let joints = self.joints.clone().unwrap_or_else(|| (0..context.joints.len()).collect());
        check_indices("joint", &joints, context.joints.len())?;
        let (n, length, width) = (context.num_envs, self.history_length, joints.len());
        let quantity = || Quantity { now: Array2::zeros((n, width)), history: History::new(n, length, width) };
        let stamps = || Stamps { now: Array1::zeros(n), history: History::new(n, length, 1) };
        Ok(JointState {
            joints,
            num_joints: context.joints.len(),
            phases: schedule.phases(n),
            positions: quantity(),
            velocities: quantity(),
            efforts: quantity(),
            stamps: stamps(),
            effort_stamps: stamps(),
            sample_counts: Array1::zeros(n),
        })
    }
}

impl Sensor for JointState {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        let fields = self.fields(state)?;
        for env in 0..state.num_envs() {
            if self.phases.is_due(env, state.step[env]) {
                self.read(env, state, fields);
                for quantity in [&mut self.positions, &mut self.velocities, &mut self.efforts] {
                    quantity.history.push(env, row(&quantity.now, env));
                }
                for stamps in [&mut self.stamps, &mut self.effort_stamps] {
                    stamps.history.push(env, &[stamps.now[env]]);
                }
                self.sample_counts[env] += 1;
            }
        }
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let fields = self.fields(state)?;
        check_indices("environment", env_ids, state.num_envs())?;
        for &env in env_ids {
            self.phases.reset(env, state.step[env]);
            self.read(env, state, fields);
            for quantity in [&mut self.positions, &mut self.velocities, &mut self.efforts] {
                quantity.history.reset(env);
            }
            for stamps in [&mut self.stamps, &mut self.effort_stamps] {
                stamps.history.reset(env);
            }
            self.sample_counts[env] = 0;
        }
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let fields = self.fields(state)?;
        check_indices("environment", env_ids, state.num_envs())?;
        for &env in env_ids {
            self.read(env, state, fields);
        }
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.phases.due_in(step.iter().copied())
    }
}

impl JointState {
    const REQUIRES: Requires = Requires::JOINT_STATE.union(Requires::JOINT_EFFORTS);

    /// Columns of the scene's joints, in the order of the sensor's own.
    pub fn joints(&self) -> &[usize] {
        &self.joints
    }

    /// When it measures.
    pub fn schedule(&self) -> Schedule {
        self.phases.schedule()
    }

    /// Positions \[rad or m\], shape \[num_envs, joints\]; 0 before the first measurement or reset.
    pub fn positions(&self) -> ArrayView2<'_, f64> {
        self.positions.now.view()
    }

    /// Velocities \[rad/s or m/s\], shape \[num_envs, joints\]; 0 before the first measurement or reset.
    pub fn velocities(&self) -> ArrayView2<'_, f64> {
        self.velocities.now.view()
    }

    /// Efforts \[N m or N\], shape \[num_envs, joints\]; 0 before the first measurement or reset.
    pub fn efforts(&self) -> ArrayView2<'_, f64> {
        self.efforts.now.view()
    }

    /// Time at which positions and velocities were captured \[s\], shape \[num_envs\].
    pub fn stamps(&self) -> ArrayView1<'_, f64> {
        self.stamps.now.view()
    }

    /// Time at which efforts were captured \[s\], shape \[num_envs\]: see [`SceneState::force_time`].
    pub fn effort_stamps(&self) -> ArrayView1<'_, f64> {
        self.effort_stamps.now.view()
    }

    /// Measurements since the last reset, shape \[num_envs\]; the refresh of a reset is none.
    pub fn sample_counts(&self) -> ArrayView1<'_, u64> {
        self.sample_counts.view()
    }

    /// Past positions \[rad or m\], newest first, shape \[num_envs, history_length, joints\]; 0 where not filled yet.
    pub fn position_history(&self) -> ArrayView3<'_, f64> {
        self.positions.history.view()
    }

    /// Past velocities \[rad/s or m/s\], newest first, shape \[num_envs, history_length, joints\]; 0 where not filled yet.
    pub fn velocity_history(&self) -> ArrayView3<'_, f64> {
        self.velocities.history.view()
    }

    /// Past efforts \[N m or N\], newest first, shape \[num_envs, history_length, joints\]; 0 where not filled yet.
    pub fn effort_history(&self) -> ArrayView3<'_, f64> {
        self.efforts.history.view()
    }

    /// Times of [`position_history`](Self::position_history) \[s\], shape \[num_envs, history_length\].
    pub fn stamp_history(&self) -> ArrayView2<'_, f64> {
        self.stamps.history.view().index_axis_move(Axis(2), 0)
    }

    /// Times of [`effort_history`](Self::effort_history) \[s\], shape \[num_envs, history_length\].
    pub fn effort_stamp_history(&self) -> ArrayView2<'_, f64> {
        self.effort_stamps.history.view().index_axis_move(Axis(2), 0)
    }

    /// How many rows of the histories of environment `env` are filled.
    ///
    /// # Panics
    ///
    /// If there is no such environment.
    #[track_caller]
    pub fn history_filled(&self, env: usize) -> usize {
        self.stamps.history.filled(env)
    }

    /// Positions, velocities and efforts of the state, of the shape that the sensor was built for.
    fn fields<'s>(&self, state: &'s SceneState) -> Result<[&'s Array2<f64>; 3], SensorError> {
        let (Some(positions), Some(velocities), Some(efforts)) =
            (&state.joint_positions, &state.joint_velocities, &state.joint_efforts)
        else {
            let missing = Self::REQUIRES.without(Requires::present_in(state));
            return Err(SensorError::MissingFields { sensor: "joint state", missing });
        };
        let fields = [positions, velocities, efforts];
        let num_envs = self.sample_counts.len();
        for found in
            fields.map(|f| f.nrows()).into_iter().chain([state.step.len(), state.time.len(), state.force_time.len()])
        {
            if found != num_envs {
                return Err(SensorError::WrongShape { what: "environments", expected: num_envs, found });
            }
        }
        for found in fields.map(|f| f.ncols()) {
            if found != self.num_joints {
                return Err(SensorError::WrongShape { what: "joints", expected: self.num_joints, found });
            }
        }
        Ok(fields)
    }

    fn read(&mut self, env: usize, state: &SceneState, fields: [&Array2<f64>; 3]) {
        let quantities = [&mut self.positions, &mut self.velocities, &mut self.efforts];
        for (quantity, field) in quantities.into_iter().zip(fields) {
            for (k, &joint) in self.joints.iter().enumerate() {
                quantity.now[(env, k)] = field[(env, joint)];
            }
        }
        self.stamps.now[env] = state.time[env];
        self.effort_stamps.now[env] = state.force_time[env];
    }
}

/// A row of an array that the sensor allocated itself, in C order.
fn row(array: &Array2<f64>, env: usize) -> &[f64] {
    let width = array.ncols();
    array.as_slice().map_or(&[], |flat| &flat[env * width..(env + 1) * width])
}

fn check_indices(what: &'static str, indices: &[usize], count: usize) -> Result<(), SensorError> {
    match indices.iter().find(|&&i| i >= count) {
        Some(&index) => Err(SensorError::IndexOutOfRange { what, index, count }),
        None => Ok(()),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a test fails by panicking")]
mod tests {
    use super::*;
    use ndarray::array;

    const DT: f64 = 0.005;
    fn context() -> SensorContext {
        let joints = ["arm/a", "arm/b", "arm/c"].map(String::from);
        SensorContext { num_envs: 2, dt: DT, joints: joints.into(), ..SensorContext::default() }
    }

    /// A state whose numbers tell where they come from: position 100 env + 10 joint + step, velocity negative, effort
    /// a thousand more.
    fn state(steps: [u64; 2]) -> SceneState {
        let position = Array2::from_shape_fn((2, 3), |(e, j)| (100 * e + 10 * j) as f64 + steps[e] as f64);
        SceneState {
            step: steps.to_vec(),
            time: steps.map(|s| s as f64 * DT).to_vec(),
            force_time: steps.map(|s| s.saturating_sub(1) as f64 * DT).to_vec(),
            joint_velocities: Some(-&position),
            joint_efforts: Some(&position + 1000.0),
            joint_positions: Some(position),
            ..SceneState::new(2)
        }
    }

    fn built(cfg: JointStateCfg) -> JointState {
        cfg.build(&context()).unwrap()
    }

    #[test]
    fn values_and_stamps_are_those_of_the_step_of_capture() {
        let cfg =
            JointStateCfg { joints: Some(vec![2, 0]), update_period: 0.01, history_length: 2, ..Default::default() };
        assert!(cfg.requires().contains(Requires::JOINT_STATE | Requires::JOINT_EFFORTS));
        let mut sensor = built(cfg);
        assert_eq!(sensor.joints(), [2, 0]);
        sensor.update(&state([1, 1])).unwrap();
        assert_eq!(sensor.sample_counts(), array![0, 0], "the first sample falls after period / dt steps");
        assert_eq!(sensor.positions(), Array2::<f64>::zeros((2, 2)));
        for step in 2..=7 {
            sensor.update(&state([step, step])).unwrap();
        }
        // The last sample is that of step 6.
        assert_eq!(sensor.sample_counts(), array![3, 3]);
        assert_eq!(sensor.positions(), array![[26.0, 6.0], [126.0, 106.0]]);
        assert_eq!(sensor.velocities(), array![[-26.0, -6.0], [-126.0, -106.0]]);
        assert_eq!(sensor.efforts(), array![[1026.0, 1006.0], [1126.0, 1106.0]]);
        assert_eq!(sensor.stamps(), array![0.03, 0.03]);
        assert_eq!(sensor.effort_stamps(), array![0.025, 0.025]);
        assert_eq!(sensor.position_history(), array![[[26.0, 6.0], [24.0, 4.0]], [[126.0, 106.0], [124.0, 104.0]]]);
        assert_eq!(sensor.velocity_history(), -&sensor.position_history());
        assert_eq!(sensor.effort_history(), &sensor.position_history() + 1000.0);
        assert_eq!(sensor.stamp_history(), array![[0.03, 0.02], [0.03, 0.02]]);
        assert_eq!(sensor.effort_stamp_history(), array![[0.025, 0.015], [0.025, 0.015]]);
    }

    #[test]
    fn reset_refreshes_one_environment_and_restarts_its_phase() {
        let mut sensor = built(JointStateCfg { update_period: 0.01, history_length: 3, ..Default::default() });
        for step in 1..=5 {
            sensor.update(&state([step, step])).unwrap();
        }
        sensor.reset(&[1], &state([5, 0])).unwrap();
        assert_eq!(sensor.sample_counts(), array![2, 0]);
        assert_eq!(sensor.positions(), array![[4.0, 14.0, 24.0], [100.0, 110.0, 120.0]], "fresh, and only there");
        assert_eq!(sensor.stamps(), array![0.02, 0.0]);
        assert_eq!((sensor.history_filled(0), sensor.history_filled(1)), (2, 0));
        assert!(sensor.position_history().index_axis(Axis(0), 1).iter().all(|&x| x == 0.0));
        sensor.update(&state([6, 1])).unwrap();
        assert_eq!(sensor.sample_counts(), array![3, 0]);
        sensor.update(&state([7, 2])).unwrap();
        assert_eq!(sensor.sample_counts(), array![3, 1]);
        assert_eq!(sensor.stamp_history(), array![[0.03, 0.02, 0.01], [0.01, 0.0, 0.0]]);
    }

    #[test]
    fn an_environment_that_stands_still_measures_nothing() {
        let mut sensor = built(JointStateCfg::default());
        for step in [1, 2, 3] {
            sensor.update(&state([step, 1])).unwrap();
        }
        assert_eq!(sensor.sample_counts(), array![3, 1]);
        assert_eq!(sensor.position_history().dim(), (2, 0, 3));
    }

    #[test]
    fn a_reset_alone_keeps_the_steps_of_the_environment() {
        let mut sensor = built(JointStateCfg { update_period: 0.02, ..Default::default() });
        sensor.update(&state([3, 3])).unwrap();
        sensor.reset(&[0], &state([3, 3])).unwrap();
        for step in 4..=7 {
            sensor.update(&state([step, step])).unwrap();
        }
        assert_eq!(sensor.stamps(), array![0.035, 0.02]);
    }

    #[test]
    fn mistakes_are_typed_errors_and_change_nothing() {
        let far = JointStateCfg { joints: Some(vec![0, 3]), ..Default::default() };
        let error = far.build(&context()).unwrap_err();
        assert_eq!(error.to_string(), "there is no joint 3: there are 3, counted from 0");
        let period = JointStateCfg { update_period: 0.007, ..Default::default() };
        assert!(matches!(period.build(&context()), Err(SensorError::PeriodNotMultiple { .. })));
        let rounded = JointStateCfg { update_period: 0.007, round_period: true, ..Default::default() };
        assert_eq!(built(rounded).schedule().period_steps(), 1);

        let mut sensor = built(JointStateCfg::default());
        sensor.update(&state([1, 1])).unwrap();
        let before = sensor.positions().to_owned();
        assert!(matches!(sensor.reset(&[0, 2], &state([0, 0])), Err(SensorError::IndexOutOfRange { index: 2, .. })));
        let mut small = state([2, 2]);
        small.joint_efforts = Some(Array2::zeros((2, 2)));
        let wrong = SensorError::WrongShape { what: "joints", expected: 3, found: 2 };
        assert_eq!(sensor.update(&small), Err(wrong));
        assert!(matches!(sensor.update(&SceneState::new(3)), Err(SensorError::MissingFields { .. })));
        assert_eq!(sensor.positions(), before);
    }
}
