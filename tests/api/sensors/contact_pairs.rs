//! Friction and contact points by counterpart, against closed forms.

use crate::sensors::worlds::{G, assert_near, cfg, cube, row};
use kinetoscope::ndarray::{Array1, Array3, Axis};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_row, from_xyz_rpy};
use nalgebra::Vector3;

/// How far forces at rest may be from their closed form, relative. Contacts forget motion with their time constant of 20 ms:
/// after five seconds e^-250 of it is left. What is not exact then is the solver, which stops at its tolerance of 1e-8.
const REST: f64 = 1e-8;
/// How far contact points, which are in the middle of the overlap, may be from the face \[m\]. At rest MuJoCo's contact has
/// `d k r = (1 - d) g` with an impedance d of at least 0.9 and k = 0.9 / (0.95 * 0.02)² = 2490 /s²: r is 0.44 mm at most, half of it 0.22 mm.
const OVERLAP: f64 = 2.2e-4;

fn pairs(bodies: &str, filters: &[&str]) -> ContactSensorCfg {
    ContactSensorCfg {
        filters: filters.iter().map(|filter| filter.to_string()).collect(),
        track_friction_forces: true,
        track_contact_points: true,
        ..ContactSensorCfg::of(bodies)
    }
}

fn vector(array: &Array3<f64>, a: usize, b: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| array[(a, b, k)])
}

/// A plank that leans by `degrees`, a box of 1.5 kg that lies on it, and after five seconds the forces of the plank on the
/// box, normal and friction, its contact points, their number, and the pose of the box.
fn on_a_plank(degrees: f64) -> ([Vector3<f64>; 3], f64, Pose) {
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let lean = from_xyz_rpy([0.0, 0.0, 1.0], [0.0, -degrees.to_radians(), 0.0]);
    let plank = RigidObjectCfg {
        uid: "plank".into(),
        shape: ObjectShape::Box { size: [2.0, 1.0, 0.1] },
        body_type: BodyType::Static,
        init_pose: lean,
        ..Default::default()
    };
    sim.add_rigid_object(plank).unwrap();
    let on_top = lean * Pose::translation(0.3, -0.1, 0.05 + 0.1);
    let box_ = RigidObjectCfg { init_pose: on_top, ..cube("box", 1.5, 0.2, [0.0; 3]) };
    let box_ = sim.add_rigid_object(box_).unwrap();
    let id = sim.add_sensor("contact", pairs("box", &["plank", "ground"])).unwrap();
    sim.update(1000);
    let sensor = sim.sensor(id).unwrap();
    let counts = sensor.contact_count_matrix().unwrap();
    assert_eq!((counts[(0, 0, 1)], counts[(0, 0, 0)]), (0.0, counts[(1, 0, 0)]));
    let told = [sensor.force_matrix_w(), sensor.friction_matrix_w().unwrap(), sensor.contact_point_matrix_w().unwrap()]
        .map(|matrix| {
            let beside = matrix.index_axis(Axis(2), 1);
            assert!(beside.iter().all(|x| *x == 0.0), "the ground, a metre below, has no part in it");
            let plank = matrix.index_axis(Axis(2), 0);
            assert_eq!(plank.index_axis(Axis(0), 0), plank.index_axis(Axis(0), 1), "the same in both environments");
            Vector3::from_fn(|k, _| plank[(0, 0, k)])
        });
    let pose: Array1<f64> = sim.rigid_object(box_).get_pose().row(0).to_owned();
    (told, counts[(0, 0, 0)], from_row(&std::array::from_fn(|k| pose[k])))
}

/// On a slope of 20 degrees the plank holds the box with m g cos along its normal and m g sin up the slope, at the middle
/// of the face that lies on it.
#[test]
fn a_slope_holds_a_box_by_friction_under_its_middle() {
    let ([normal_force, friction, point], count, pose) = on_a_plank(20.0);
    let (sin, cos) = 20.0_f64.to_radians().sin_cos();
    let (normal, up_the_slope) = (Vector3::new(-sin, 0.0, cos), Vector3::new(cos, 0.0, sin));
    let weight = 1.5 * G;
    assert_near(normal_force.iter().copied(), (weight * cos * normal).as_slice(), REST * weight);
    assert_near(friction.iter().copied(), (weight * sin * up_the_slope).as_slice(), REST * weight);
    assert_eq!(count, 4.0, "the corners of the face");
    let face = pose * nalgebra::Point3::new(0.0, 0.0, -0.1);
    assert_near(point.iter().copied(), face.coords.as_slice(), OVERLAP);
    assert!((point - pose.translation.vector).norm() > 0.09, "the control: not the middle of the box");
}

/// The control: where nothing leans, nothing is held by friction, and the expectation above fails.
#[test]
fn a_level_plank_holds_nothing_by_friction() {
    let ([normal_force, friction, _], ..) = on_a_plank(0.0);
    let weight = 1.5 * G;
    assert_near(normal_force.iter().copied(), &[0.0, 0.0, weight], REST * weight);
    assert!(friction.norm() < REST * weight, "{friction}");
}

/// Three boxes on top of each other under a gravity that leans by 10 degrees, every pair at once: what one exerts on another
/// is minus what the other exerts on it, to the last bit, at the same points; and normal force and friction together are
/// what everything above needs to move as it does, by Newton, `m (dv / dt - g)`.
#[test]
fn friction_between_boxes_acts_and_reacts() {
    let (sin, cos) = 10.0_f64.to_radians().sin_cos();
    let gravity = G * Vector3::new(sin, 0.0, -cos);
    let mut sim = SimulationManager::new(SimulationManagerCfg { gravity, ..cfg(1) }).unwrap();
    let (masses, dt) = ([3.0, 2.0, 1.0], sim.cfg().physics_dt);
    let boxes: Vec<ObjectId> = (0..3)
        .map(|k| {
            let at = [0.0, 0.0, 0.1 + 0.2 * k as f64];
            sim.add_rigid_object(cube(&format!("box{k}"), masses[k], 0.2, at)).unwrap()
        })
        .collect();
    let id = sim.add_sensor("contact", pairs("box.", &["box0", "box1", "box2", "ground", "box."])).unwrap();
    sim.update(999);
    let velocities = |sim: &SimulationManager| {
        boxes.iter().map(|id| row(&sim.rigid_object(*id).get_velocity(), 0, 0)).collect::<Vec<Vector3<f64>>>()
    };
    let before = velocities(&sim);
    sim.update(1);
    let after = velocities(&sim);
    let needed: Vec<Vector3<f64>> = (0..3).map(|k| masses[k] * ((after[k] - before[k]) / dt - gravity)).collect();
    let sensor = sim.sensor(id).unwrap();
    let env = |matrix: kinetoscope::ndarray::ArrayView4<'_, f64>| matrix.index_axis_move(Axis(0), 0).to_owned();
    let (force, friction) = (env(sensor.force_matrix_w()), env(sensor.friction_matrix_w().unwrap()));
    let points = env(sensor.contact_point_matrix_w().unwrap());
    let counts = sensor.contact_count_matrix().unwrap().index_axis_move(Axis(0), 0).to_owned();
    for a in 0..3 {
        for b in 0..3 {
            // The same sums of the same contacts, in the same order.
            assert_eq!(vector(&friction, a, b), -vector(&friction, b, a));
            assert_eq!((vector(&points, a, b), counts[(a, b)]), (vector(&points, b, a), counts[(b, a)]));
        }
        let below = if a == 0 { 3 } else { a - 1 };
        let above = needed[a..].iter().sum::<Vector3<f64>>();
        // Rounding of 60 N in some hundred sums, and of velocities of 1e-2 m/s divided by the step of 5 ms: 1e-12.
        assert_near((vector(&force, a, below) + vector(&friction, a, below)).iter().copied(), above.as_slice(), 1e-11);
        // Up the slope, which is -x. The stack still rocks a little: by what moves the boxes, and by the lean of their faces,
        // which turns normal forces, but for a twentieth at most.
        let weight: f64 = masses[a..].iter().sum::<f64>() * G;
        let rocking = (above + weight / G * gravity).x.abs() + force[(a, below, 0)].abs();
        assert!(rocking < 0.05 * weight * sin, "{rocking} of {weight}");
        assert_near([friction[(a, below, 0)]], &[-weight * sin], rocking + 1e-11);
        let place = row(&sim.rigid_object(boxes[a]).get_pose(), 0, 0);
        let at = vector(&points, a, below) - place;
        // What lies on a contact presses it with up to (1/3 + 1/2) * 3 = 2.5 times the acceleration of one box alone.
        assert!((at.z + 0.1).abs() < 2.5 * OVERLAP && at.x.abs() < 0.1 && at.y.abs() < 0.1, "{at}");
        let net = sensor.friction_forces_w();
        let all = vector(&friction, a, 3) + vector(&friction, a, 4);
        assert_near((0..3).map(|k| net[(0, a, k)]), all.as_slice(), 1e-9);
        assert!((net[(0, a, 0)] - friction[(a, below, 0)]).abs() > 1.0 || a == 2, "the control: a pair is not the sum");
    }
    assert_eq!((counts[(0, 2)], counts[(1, 3)], vector(&points, 0, 2)), (0.0, 0.0, Vector3::zeros()));
}
