//! The contact sensor with hand-written contacts.

use super::*;
use crate::error::SensorError;
use crate::sampling::{Sampled, SamplingCfg};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use kinetoscope_scene::SceneState;
use kinetoscope_scene::{Contact, Contacts};
use ndarray::{Array3, array};

const NAMES: [&str; 4] = ["dog/base", "dog/LF_FOOT", "dog/RF_FOOT", "cube"];

fn context(num_envs: usize) -> SensorContext {
    SensorContext { num_envs, dt: 0.5, bodies: NAMES.map(String::from).into(), ..SensorContext::default() }
}

/// A contact with the normal along z: normal force, and friction along x, on the second body.
fn contact(first: Option<u32>, second: Option<u32>, normal_force: f64, friction: f64, x: f64) -> Contact {
    Contact {
        bodies: [first, second],
        point: [x, 0.0, 0.0],
        normal: [0.0, 0.0, 1.0],
        distance: -1e-3,
        force: [friction, 0.0, normal_force],
        normal_force,
    }
}

/// A state with the contacts `list` in environment 0, and none in environment 1.
fn state(step: u64, list: Vec<Contact>) -> SceneState {
    let n = list.len();
    SceneState {
        step: vec![step; 2],
        time: vec![step as f64; 2],
        contacts: Some(Contacts { first: vec![0, n, n], list }),
        body_poses: Some(Array3::from_shape_fn((2, 4, 7), |(e, b, k)| (100 * e + 10 * b + k) as f64)),
        ..SceneState::new(2)
    }
}

/// Two contacts of the left foot with the ground, in both body orders, and a contact of the right foot with the cube.
fn standing() -> Vec<Contact> {
    vec![
        contact(None, Some(1), 10.0, 2.0, 1.0),
        contact(Some(1), None, 6.0, 1.0, 2.0),
        contact(Some(2), Some(3), 4.0, 0.5, 7.0),
    ]
}

fn cfg() -> ContactSensorCfg {
    ContactSensorCfg {
        filters: vec!["ground".into(), "cube".into(), ".*".into()],
        track_contact_points: true,
        track_friction_forces: true,
        track_pose: true,
        track_air_time: true,
        ..ContactSensorCfg::for_bodies(".*_FOOT")
    }
}

#[test]
fn values() {
    let mut sensor = cfg().build(&context(2)).unwrap();
    assert_eq!(sensor.body_names(), ["dog/LF_FOOT", "dog/RF_FOOT"]);
    assert_eq!(sensor.find_bodies("RF_FOOT").unwrap(), [1]);
    assert!(sensor.find_bodies("base").is_err());
    sensor.update(&state(1, standing())).unwrap();
    let zeros = |n: usize| vec![0.0; n];
    let flat = |view: ndarray::ArrayViewD<'_, f64>| view.iter().copied().collect::<Vec<_>>();
    assert_eq!(flat(sensor.net_forces_w().into_dyn()), [&[0.0, 0.0, 4.0, 0.0, 0.0, -4.0][..], &zeros(6)].concat());
    let friction = [&[1.0, 0.0, 0.0, -0.5, 0.0, 0.0][..], &zeros(6)].concat();
    assert_eq!(flat(sensor.friction_forces_w().into_dyn()), friction);
    assert_eq!(sensor.total_forces_w(), &sensor.net_forces_w() + &sensor.friction_forces_w());
    // By the filters ground, cube and any body; left foot, then right foot.
    let left = [0.0, 0.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0];
    let right = [0.0, 0.0, 0.0, 0.0, 0.0, -4.0, 0.0, 0.0, -4.0];
    assert_eq!(flat(sensor.force_matrix_w().into_dyn()), [&left[..], &right, &zeros(18)].concat());
    // Friction of the same pairs: 2 - 1 N from the ground; from the cube, the opposite of the -0.5 N on the right foot.
    let left = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0];
    let right = [0.0, 0.0, 0.0, -0.5, 0.0, 0.0, -0.5, 0.0, 0.0];
    let friction = sensor.friction_matrix_w().unwrap();
    assert_eq!(flat(friction.into_dyn()), [&left[..], &right, &zeros(18)].concat());
    assert_eq!(sensor.friction_matrix_w_history().unwrap().dim(), (2, 0, 2, 3, 3));
    let points = sensor.contact_points_w().unwrap();
    assert_eq!((points[(0, 0, 0)], points[(0, 1, 0)]), (1.5, 7.0));
    assert!(points.index_axis(ndarray::Axis(0), 1).iter().all(|x| *x == 0.0), "0 with a count of 0");
    let points = sensor.contact_point_matrix_w().unwrap().index_axis_move(ndarray::Axis(0), 0);
    assert_eq!(points.index_axis(ndarray::Axis(2), 0), array![[1.5, 0.0, 1.5], [0.0, 7.0, 7.0]]);
    let counts = sensor.contact_count_matrix().unwrap();
    assert_eq!(counts, array![[[2.0, 0.0, 2.0], [0.0, 1.0, 1.0]], [[0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]]);
    assert_eq!(sensor.contact_counts().unwrap(), array![[2.0, 1.0], [0.0, 0.0]]);
    assert_eq!(
        sensor.pos_w().unwrap(),
        array![[[10., 11., 12.], [20., 21., 22.]], [[110., 111., 112.], [120., 121., 122.]]]
    );
    assert_eq!((sensor.quat_w().unwrap().dim(), sensor.quat_w().unwrap()[(1, 1, 3)]), ((2, 2, 4), 126.0));
    assert_eq!(sensor.current_contact_time().unwrap(), array![[0.5, 0.5], [0.0, 0.0]]);
    assert_eq!(sensor.current_air_time().unwrap(), array![[0.0, 0.0], [0.5, 0.5]]);
    assert_eq!(sensor.first_contact().unwrap(), array![[true, true], [false, false]]);
}

#[test]
fn untracked() {
    let sensor = ContactSensorCfg::for_bodies("cube").build(&context(2)).unwrap();
    assert!(sensor.pos_w().is_none() && sensor.quat_w().is_none());
    assert!(sensor.contact_points_w().is_none() && sensor.contact_counts().is_none());
    assert!(sensor.contact_point_matrix_w().is_none() && sensor.contact_count_matrix().is_none());
    assert!(sensor.friction_matrix_w().is_none() && sensor.friction_matrix_w_history().is_none());
    assert!(sensor.current_air_time().is_none() && sensor.first_contact().is_none() && sensor.first_air().is_none());
    assert_eq!(sensor.force_matrix_w().dim(), (2, 1, 0, 3));
    assert_eq!(sensor.net_forces_w_history().dim(), (2, 0, 1, 3));
}

/// With a period of 3 steps, contact is checked in every step: the next measurement reports a contact between two
/// measurements.
#[test]
fn air_times() {
    let sampling = SamplingCfg { history_length: 2, ..SamplingCfg::every(1.5) };
    let mut sensor = ContactSensorCfg { sampling, ..cfg() }.build(&context(2)).unwrap();
    sensor.reset(&[0, 1], &state(0, Vec::new())).unwrap();
    assert_eq!(sensor.due_in(&[0, 0]), 1);
    for step in 1..=6 {
        let touched = step == 2 || step == 6;
        sensor.update(&state(step, if touched { standing() } else { Vec::new() })).unwrap();
        let told = sensor.first_contact().unwrap();
        assert_eq!(told[(0, 0)], step >= 3, "step {step}");
        assert!(!told[(1, 0)]);
    }
    assert_eq!(sensor.sample_counts(), array![2, 2]);
    assert_eq!(sensor.last_air_time().unwrap()[(0, 0)], 1.5, "in the air from step 3 to step 5");
    assert_eq!(sensor.last_contact_time().unwrap()[(0, 0)], 0.5);
    let history = sensor.net_forces_w_history();
    assert_eq!((history[(0, 0, 0, 2)], history[(0, 1, 0, 2)]), (4.0, 0.0), "of steps 6 and 3");
    sensor.reset(&[0], &state(0, standing())).unwrap();
    assert_eq!(sensor.net_forces_w()[(0, 0, 2)], 4.0, "fresh");
    assert!(sensor.net_forces_w_history().iter().all(|&f| f == 0.0));
    assert_eq!(sensor.last_air_time().unwrap()[(0, 0)], 0.0);
}

#[test]
fn mistakes() {
    let wrong = |cfg: ContactSensorCfg| cfg.build(&context(2)).unwrap_err();
    let filtered =
        |filter: &str, of: &str| ContactSensorCfg { filters: vec![filter.into()], ..ContactSensorCfg::for_bodies(of) };
    let friction = ContactSensorCfg { track_friction_forces: true, ..ContactSensorCfg::for_bodies("cube") };
    for (cfg, start, parts) in [
        (ContactSensorCfg::for_bodies("foot"), "unknown body \"foot\"; known names: ", ["LF_FOOT", ""]),
        (ContactSensorCfg::default(), "the contact sensor has no bodies", ["dog/base", ""]),
        (friction, "", ["`filters`", "friction_forces_w"]),
        (filtered("grond", "cube"), "", ["\"ground\"", ""]),
    ] {
        let text = wrong(cfg).to_string();
        assert!(text.starts_with(start) && parts.iter().all(|part| text.contains(part)), "{text}");
    }
    assert!(matches!(wrong(filtered("cu.e", "cube")), SensorError::SelfFilter { .. }));
    assert!(filtered("LF_FOOT", ".*_FOOT").build(&context(2)).is_ok(), "the other foot may touch it");
    for force_threshold in [-1.0, f64::NAN, f64::INFINITY] {
        let cfg = ContactSensorCfg { force_threshold, ..ContactSensorCfg::for_bodies("cube") };
        assert!(matches!(wrong(cfg), SensorError::OutOfRange { .. }));
    }
    let twice = ContactSensorCfg { bodies: vec!["cube".into(), "cube".into()], ..Default::default() };
    assert!(matches!(wrong(twice), SensorError::Pattern(_)));
    let mut sensor = ContactSensorCfg::for_bodies("cube").build(&context(2)).unwrap();
    assert!(matches!(sensor.update(&SceneState::new(2)), Err(SensorError::MissingFields { sensor: "contact", .. })));
    let text = ContactSensorCfg { sampling: SamplingCfg::every(1.0), ..cfg() }.build(&context(2)).unwrap().to_string();
    let parts = ["dog/LF_FOOT, dog/RF_FOOT", "(s)    : 1\n", "ground"];
    assert!(parts.iter().all(|part| text.contains(part)), "{text}");
}
