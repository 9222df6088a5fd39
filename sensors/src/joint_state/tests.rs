//! Tests of the joint state sensor, and through it of every sensor with a sampler.

use super::*;
use ndarray::{Array2, Axis, array};

const DT: f64 = 0.005;

fn context() -> SensorContext {
    let joints = ["arm/a", "arm/b", "arm/c"].map(String::from);
    SensorContext { num_envs: 2, dt: DT, joints: joints.into(), ..SensorContext::default() }
}

/// A state whose numbers encode their origin: position 100 env + 10 joint + step, velocity its negative, effort 1000
/// more.
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

fn sampling(update_period: f64, history_length: usize) -> SamplingCfg {
    SamplingCfg { update_period, history_length, ..SamplingCfg::default() }
}

fn built(cfg: JointStateCfg) -> JointState {
    cfg.build(&context()).unwrap()
}

#[test]
fn values() {
    let cfg = JointStateCfg { joints: Some(vec!["c".into(), "arm/a".into()]), sampling: sampling(0.01, 2) };
    assert!(cfg.requires().contains(StateFields::JOINT_STATE | StateFields::JOINT_EFFORTS));
    let mut sensor = built(cfg);
    assert_eq!(sensor.joints(), [2, 0]);
    sensor.update(&state([1, 1])).unwrap();
    assert_eq!(sensor.sample_counts(), array![0, 0], "the first sample falls after period / dt steps");
    assert_eq!(sensor.positions(), Array2::<f64>::zeros((2, 2)));
    // The last sample is that of step 6.
    (2..=7).for_each(|step| sensor.update(&state([step, step])).unwrap());
    assert_eq!(sensor.sample_counts(), array![3, 3]);
    assert_eq!(sensor.positions(), array![[26.0, 6.0], [126.0, 106.0]]);
    assert_eq!(sensor.velocities(), array![[-26.0, -6.0], [-126.0, -106.0]]);
    assert_eq!(sensor.efforts(), array![[1026.0, 1006.0], [1126.0, 1106.0]]);
    assert_eq!((sensor.stamps(), sensor.effort_stamps()), (array![0.03, 0.03].view(), array![0.025, 0.025].view()));
    assert_eq!(sensor.position_history(), array![[[26.0, 6.0], [24.0, 4.0]], [[126.0, 106.0], [124.0, 104.0]]]);
    assert_eq!(sensor.velocity_history(), -&sensor.position_history());
    assert_eq!(sensor.effort_history(), &sensor.position_history() + 1000.0);
    assert_eq!(sensor.stamp_history(), array![[0.03, 0.02], [0.03, 0.02]]);
    assert_eq!(sensor.force_stamp_history(), array![[0.025, 0.015], [0.025, 0.015]]);
}

#[test]
fn resets() {
    let mut sensor = built(JointStateCfg { sampling: sampling(0.01, 3), ..Default::default() });
    (1..=5).for_each(|step| sensor.update(&state([step, step])).unwrap());
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

/// A quarantined environment measures nothing; a reset of the sensor alone keeps the steps of the environment.
#[test]
fn phases() {
    let mut sensor = built(JointStateCfg::default());
    (1..=3).for_each(|step| sensor.update(&state([step, 1])).unwrap());
    assert_eq!((sensor.sample_counts(), sensor.position_history().dim()), (array![3, 1].view(), (2, 0, 3)));
    let mut sensor = built(JointStateCfg { sampling: sampling(0.02, 0), ..Default::default() });
    sensor.update(&state([3, 3])).unwrap();
    sensor.reset(&[0], &state([3, 3])).unwrap();
    (4..=7).for_each(|step| sensor.update(&state([step, step])).unwrap());
    assert_eq!(sensor.stamps(), array![0.035, 0.02]);
}

#[test]
fn mistakes() {
    let far = JointStateCfg { joints: Some(vec!["a".into(), "d".into()]), ..Default::default() };
    let error = far.build(&context()).unwrap_err();
    assert_eq!(error.to_string(), "unknown joint \"d\"; known names: \"a\", \"b\", \"c\"");
    let period = JointStateCfg { sampling: sampling(0.007, 0), ..Default::default() };
    assert!(matches!(period.build(&context()), Err(SensorError::PeriodNotMultiple { .. })));
    let rounded =
        JointStateCfg { sampling: SamplingCfg { round_period: true, ..sampling(0.007, 0) }, ..Default::default() };
    assert_eq!(built(rounded).schedule().period_steps(), 1);

    let mut sensor = built(JointStateCfg::default());
    sensor.update(&state([1, 1])).unwrap();
    let before = sensor.positions().to_owned();
    assert!(matches!(sensor.reset(&[0, 2], &state([0, 0])), Err(SensorError::IndexOutOfRange { index: 2, .. })));
    let mut small = state([2, 2]);
    small.joint_efforts = Some(Array2::zeros((2, 2)));
    let wrong = SensorError::WrongShape { what: "joints", expected: 3, found: 2 };
    assert_eq!(sensor.update(&small), Err(wrong));
    let error = sensor.update(&SceneState::new(3)).unwrap_err();
    assert!(matches!(error, SensorError::MissingFields { .. }));
    assert_eq!(error.to_string(), "the state lacks joint_efforts, joint_state, which the joint state sensor requires");
    assert_eq!(sensor.positions(), before);
    // Root cause: an empty list was accepted, which created a sensor without values.
    let nothing = JointStateCfg { joints: Some(vec![]), ..JointStateCfg::default() };
    let error = nothing.build(&context()).unwrap_err();
    assert!(matches!(&error, SensorError::EmptySelection { candidates, .. } if *candidates == *context().joints));
    let without_joints = SensorContext { joints: [].into(), ..context() };
    assert_eq!(JointStateCfg::default().build(&without_joints).unwrap().joint_names(), [""; 0], "all of none");
}
