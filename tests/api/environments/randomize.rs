//! Randomized properties per environment: compared with laws of physics, shared between equal environments, addressed
//! by name.

use super::worlds::{ALL, all_bits, all_properties, all_values, arm, cfg, cube, get, set, values, world};
use kinetoscope::mujoco::{BUILD_VERSION, Model, ObjectKind, SupportedVersion};
use kinetoscope::ndarray::{Array2, Array3, array, s};
use kinetoscope::prelude::*;
use kinetoscope::sim::{DriveType, Error, FrictionCone, RandomizationError};
use kinetoscope_testkit::urdf;
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{gains, passive, text_robot};
use std::f64::consts::TAU;

const G: f64 = 9.81;

/// A physical pendulum: T = 2 pi sqrt((I + m d² + armature) / (m g d)). The amplitude a of 0.02 rad prolongs it by a² /
/// 16 = 2.5e-5, the step of 1 ms by (omega h)² / 24 < 2e-6.
#[test]
fn pendulums() {
    let text = r#"<mujoco><worldbody><body name="rod" pos="0 0 2"><joint name="hinge" axis="0 1 0" armature="0.1"/>
        <inertial pos="0 0 -0.5" mass="1" diaginertia="0.02 0.02 0.02"/></body></worldbody></mujoco>"#;
    let settings = SimulationManagerCfg { physics_dt: 0.001, ground: None, ..cfg(6, 2) };
    let mut sim = SimulationManager::new(settings).unwrap();
    let id = sim.add_mjcf(MjcfPartCfg::text("p", text)).unwrap();
    let envs: [(usize, Property, &str, &[f64]); 5] = [
        (1, Property::Gravity, "gravity", &[0.0, 0.0, -3.7]),
        (2, Property::CenterOfMass, "p/rod", &[0.0, 0.0, -0.7]),
        (3, Property::Mass, "p/rod", &[3.0]),
        (4, Property::Inertia, "p/rod", &[0.1, 0.1, 0.1]),
        (5, Property::Armature, "p/hinge", &[0.3]),
    ];
    set(&mut sim, &envs);
    // Mass, moment, distance, gravity, armature. Moments scale with the mass; the armature does not, so the mass
    // matters.
    let laws = [
        (1.0, 0.02, 0.5, G, 0.1),
        (1.0, 0.02, 0.5, 3.7, 0.1),
        (1.0, 0.02, 0.7, G, 0.1),
        (3.0, 0.06, 0.5, G, 0.1),
        (1.0, 0.1, 0.5, G, 0.1),
        (1.0, 0.02, 0.5, G, 0.3),
    ];
    assert_eq!(get(&sim, 3, Property::Inertia, "p/rod"), [0.06; 3]);
    sim.mjcf_part_mut(id).write_qpos(&array![[0.02]], ALL).unwrap();
    let (mut crossings, mut before) = (vec![Vec::new(); 6], sim.mjcf_part(id).qpos());
    for step in 1..=8000 {
        sim.update(1);
        let now = sim.mjcf_part(id).qpos();
        for env in 0..6 {
            let (a, b) = (before[(env, 0)], now[(env, 0)]);
            if a > 0.0 && b <= 0.0 {
                crossings[env].push((f64::from(step) - b / (b - a)) * 0.001);
            }
        }
        before = now;
    }
    let periods = crossings.iter().map(|times| (times[times.len() - 1] - times[0]) / (times.len() - 1) as f64);
    let expected = laws
        .map(|(m, moment, d, g, a): (f64, f64, f64, f64, f64)| TAU * ((moment + m * d * d + a) / (m * g * d)).sqrt());
    for (env, (period, expected)) in periods.zip(expected).enumerate() {
        assert!((period / expected - 1.0).abs() < 4e-5, "environment {env}: {period} instead of {expected}");
    }
    // Control: each property changes the period by much more.
    assert!(expected[1..].iter().all(|period| (period / expected[0] - 1.0).abs() > 0.01), "{expected:?}");
}

/// For a box sliding on the ground, the lost momentum is mu times that of the normal force, m (g t + dv_z), with any
/// bounces. MuJoCo's friction creeps slightly instead of being exactly at its limit: 1 %.
#[test]
fn sliding_boxes() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { cone: FrictionCone::Elliptic, ..cfg(3, 2) }).unwrap();
    let id = sim.add_rigid_object(cube("cube", 1.0, [0.0, 0.0, 0.05])).unwrap();
    for (env, mu) in [(1, [0.1]), (2, [0.25])] {
        set(&mut sim, &["cube", "ground"].map(|name| (env, Property::Friction, name, &mu[..])));
    }
    sim.update(100);
    sim.rigid_object_mut(id).write_velocity(&array![[5.0, 0.0, 0.0, 0.0, 0.0, 0.0]], ALL).unwrap();
    sim.update(10);
    let before = sim.rigid_object(id).velocity();
    sim.update(30);
    let after = sim.rigid_object(id).velocity();
    for (env, mu) in [(1, 0.1), (2, 0.25)] {
        let lost = before[(env, 0)] - after[(env, 0)];
        let pressed = G * 0.3 + after[(env, 2)] - before[(env, 2)];
        assert!((lost / (mu * pressed) - 1.0).abs() < 0.01, "environment {env}: {lost} {pressed}");
    }
    let lost = [1, 2].map(|env| before[(env, 0)] - after[(env, 0)]);
    assert!(lost[1] > 1.5 * lost[0], "{lost:?}");
}

/// An undriven wheel about its center.
fn wheel(files: &TempFiles) -> RobotCfg {
    let dynamics = r#"<dynamics damping="0.2" friction="0.05"/>"#;
    let spin = urdf::joint("spin", "continuous", ["post", "disc"], [0.0; 3], "0 1 0", dynamics);
    let disc = urdf::link("disc", 1.0, 0.5, [0.0; 3], "");
    passive(text_robot(files, "wheel", &urdf::robot("wheel", &format!("<link name=\"post\"/>{spin}{disc}"))))
}

/// With damping inside the solve: v' = v - h (B v + f) / (I + A + h B), where f is the dry friction during rotation.
#[test]
fn wheels() {
    let mut sim = SimulationManager::new(cfg(4, 1)).unwrap();
    let id = sim.add_robot(wheel(&TempFiles::default())).unwrap();
    let values: [(usize, Property, &str, &[f64]); 4] = [
        (1, Property::JointDamping, "wheel/spin", &[0.7]),
        (2, Property::DryFriction, "wheel/spin", &[0.11]),
        (3, Property::Armature, "wheel/spin", &[0.4]),
        (3, Property::JointDamping, "wheel/spin", &[0.1]),
    ];
    set(&mut sim, &values);
    sim.robot_mut(id).write_qvel(&array![[10.0]], None, ALL).unwrap();
    let before = 10.0;
    sim.update(1);
    let after = sim.robot(id).qvel();
    let h = 0.01;
    let laws = [(0.2, 0.05, 0.0), (0.7, 0.05, 0.0), (0.2, 0.11, 0.0), (0.1, 0.05, 0.4)];
    for (env, (b, f, a)) in laws.into_iter().enumerate() {
        let (expected, found) = (before - h * (b * before + f) / (0.5 + a + h * b), after[(env, 0)]);
        // MuJoCo's friction rows are exact to 1 in 10⁴ (impedance 0.9999).
        assert!((found - expected).abs() < 1e-6, "environment {env}: {found} instead of {expected}");
    }
}

/// A world without ground, with a bar held horizontally by a drive of 500 N m/rad.
fn lever(num_envs: usize, drive_type: DriveType) -> (SimulationManager, RobotId) {
    let limit = urdf::limit([-3.0, 3.0], 100.0, 10.0);
    let hinge = urdf::joint("hinge", "revolute", ["post", "bar"], [0.0; 3], "0 1 0", &limit);
    let bar = urdf::link("bar", 2.0, 0.01, [0.5, 0.0, 0.0], "");
    let text = urdf::robot("lever", &format!("<link name=\"post\"/>{hinge}{bar}"));
    let drive = DriveCfg { drive_type, ..gains(500.0, 100.0) };
    let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..cfg(num_envs, 1) }).unwrap();
    let id = sim.add_robot(RobotCfg { drive, ..text_robot(&TempFiles::default(), "lever", &text) }).unwrap();
    (sim, id)
}

/// A horizontal link sags by the torque of its weight over the stiffness; a weak drive gives its limit.
#[test]
fn gains_per_environment() {
    let (mut sim, id) = lever(3, DriveType::default());
    let values: [(usize, Property, &str, &[f64]); 3] = [
        (1, Property::Stiffness, "lever/hinge", &[200.0]),
        (1, Property::Mass, "lever/bar", &[3.0]),
        (2, Property::MaxEffort, "lever/hinge", &[4.0]),
    ];
    set(&mut sim, &values);
    assert_eq!(sim.robot(id).qf_limits(), array![[100.0], [100.0], [4.0]]);
    sim.update(1500);
    let (q, effort) = (sim.robot(id).qpos(), sim.robot(id).qf());
    for (env, kp, m) in [(0, 500.0, 2.0), (1, 200.0, 3.0)] {
        let q = q[(env, 0)];
        let weight = m * G * 0.5 * q.cos();
        assert!((kp * q - weight).abs() < 1e-5 * weight, "environment {env}: {} instead of {weight}", kp * q);
    }
    assert!((effort[(2, 0)].abs() - 4.0).abs() < 1e-9, "{effort}");
    // Randomized gains belong to the environment: they persist, and a snapshot does not transfer them.
    let snapshot = sim.snapshot(Some(&[EnvId(2)])).unwrap();
    sim.restore(&snapshot, Some(&[EnvId(0), EnvId(1), EnvId(2)])).unwrap();
    assert_eq!(sim.robot(id).qf_limits(), array![[100.0], [100.0], [4.0]]);
    assert_eq!(sim.robot(id).stiffness(), array![[500.0], [200.0], [500.0]]);
}

/// The usual reset of learning restores a snapshot taken before the randomization. Randomized gains persist and act,
/// and gains set at run time come from the snapshot. For the horizontal bar the drive gives kp q, the torque of the
/// weight.
#[test]
fn randomized_gains_after_restore() {
    for drive_type in [DriveType::Force, DriveType::Acceleration] {
        let (mut sim, id) = lever(3, drive_type);
        sim.robot_mut(id).set_damping(&array![[90.0]], None, ALL).unwrap();
        let start = sim.snapshot(ALL).unwrap();
        let drawn = Randomization::new().with(Property::Stiffness, "lever/hinge", RandomizationOp::Scale([0.3, 0.6]));
        sim.properties_mut().randomize(&drawn, Some(&[EnvId(1), EnvId(2)])).unwrap();
        let kp: Vec<f64> = (0..3).map(|env| get(&sim, env, Property::Stiffness, "lever/hinge")[0]).collect();
        assert!(kp[1] < 0.7 * kp[0] && kp[2] < 0.7 * kp[0] && kp[1] != kp[2], "{kp:?}");
        let asked = sim.robot(id).stiffness();
        sim.robot_mut(id).set_damping(&array![[70.0]], None, ALL).unwrap();
        let later = sim.snapshot(ALL).unwrap();
        sim.update(10);
        for (snapshot, damping) in [(&start, 90.0), (&later, 70.0)] {
            sim.restore(snapshot, ALL).unwrap();
            for (env, kp) in kp.iter().enumerate() {
                assert_eq!(get(&sim, env, Property::Stiffness, "lever/hinge"), [*kp], "environment {env}");
            }
            assert_eq!(sim.robot(id).stiffness(), asked);
            assert_eq!(sim.robot(id).damping(), Array2::from_elem((3, 1), damping));
        }
        // A rollout from the snapshot equals stepping.
        let rollout = sim.rollout(&Array3::<f64>::zeros((1, 1500, 1)), Some(&start), ALL).unwrap();
        sim.restore(&start, ALL).unwrap();
        sim.update(1500);
        let q = sim.robot(id).qpos();
        for (env, kp) in kp.iter().enumerate() {
            let q = q[(env, 0)];
            assert_eq!(rollout.states[(env, 1499, 0)], q, "environment {env}");
            let weight = 2.0 * G * 0.5 * q.cos();
            // As in the test above: the rest of the motion.
            assert!((kp * q - weight).abs() < 1e-5 * weight, "environment {env}: {} instead of {weight}", kp * q);
        }
        // Randomized values do not move to other environments.
        sim.restore(&later, Some(&[EnvId(2), EnvId(0), EnvId(1)])).unwrap();
        assert_eq!(sim.robot(id).stiffness(), asked);
        // A gain that is set overrides the randomized one; a nominal one removes it.
        sim.robot_mut(id).set_stiffness(&array![[333.0]], None, Some(&[EnvId(1)])).unwrap();
        sim.properties_mut().reset(Some(&[EnvId(2)])).unwrap();
        sim.restore(&start, ALL).unwrap();
        assert_eq!(sim.robot(id).stiffness(), Array2::from_elem((3, 1), 500.0));
    }
}

/// A randomized gain counts as randomized even if it equals the underlying gain: it persists when a plain state is
/// restored, before and after it was itself restored. A gain that is set does not count as randomized, even if it is
/// set to the randomized value.
#[test]
fn randomized_equal_to_set() {
    let (mut sim, id) = lever(2, DriveType::default());
    let start = sim.snapshot(ALL).unwrap();
    let [stiffness, damping, effort] = [200.0, 40.0, 30.0];
    let gains = |sim: &SimulationManager, env: usize| {
        let robot = sim.robot(id);
        [robot.stiffness()[(env, 0)], robot.damping()[(env, 0)], robot.qf_limits()[(env, 0)]]
    };
    let set_all = |sim: &mut SimulationManager| {
        let mut robot = sim.robot_mut(id);
        robot.set_stiffness(&array![[stiffness]], None, ALL).unwrap();
        robot.set_damping(&array![[damping]], None, ALL).unwrap();
        robot.set_qf_limits(&array![[effort]], None, ALL).unwrap();
    };
    let draw = |property, value| Randomization::new().with(property, "lever/hinge", RandomizationOp::Set([value; 2]));
    let draw_all = |sim: &mut SimulationManager| {
        let all = [(Property::Stiffness, stiffness), (Property::DriveDamping, damping), (Property::MaxEffort, effort)];
        for (property, value) in all {
            sim.properties_mut().randomize(&draw(property, value), Some(&[EnvId(1)])).unwrap();
        }
    };
    let (nominal, drawn) = ([500.0, 100.0, 100.0], [stiffness, damping, effort]);
    // Set in both environments, then randomized to the same value in one.
    set_all(&mut sim);
    draw_all(&mut sim);
    let both = sim.snapshot(ALL).unwrap();
    sim.restore(&start, ALL).unwrap();
    assert_eq!((gains(&sim, 0), gains(&sim, 1)), (nominal, drawn), "it was drawn");
    // The other order: randomized first, then a state with the same underlying gains is restored.
    sim.properties_mut().reset(ALL).unwrap();
    draw_all(&mut sim);
    sim.restore(&both, ALL).unwrap();
    assert_eq!((gains(&sim, 0), gains(&sim, 1)), (drawn, drawn));
    // Restored with its properties, the gain still counts as randomized.
    sim.properties_mut().reset(ALL).unwrap();
    sim.properties_mut().restore(&both, ALL).unwrap();
    assert_eq!((gains(&sim, 0), gains(&sim, 1)), (drawn, drawn));
    sim.restore(&start, ALL).unwrap();
    assert_eq!((gains(&sim, 0), gains(&sim, 1)), (nominal, drawn), "it was drawn when the snapshot was taken");
    // Control: setting the same value ends the randomization.
    set_all(&mut sim);
    assert_eq!((gains(&sim, 0), gains(&sim, 1)), (drawn, drawn));
    sim.restore(&start, ALL).unwrap();
    assert_eq!((gains(&sim, 0), gains(&sim, 1)), (nominal, nominal));
}

/// Randomization is tracked by a record, not by value: it persists if the value is nominal, and through drive types in
/// which the gain has no effect or another unit.
#[test]
fn randomized_across_drive_types() {
    let (mut sim, id) = lever(2, DriveType::default());
    let start = sim.snapshot(ALL).unwrap();
    sim.robot_mut(id).set_stiffness(&array![[200.0]], None, ALL).unwrap();
    let set = sim.snapshot(ALL).unwrap();
    let draw = |value| Randomization::new().with(Property::Stiffness, "lever/hinge", RandomizationOp::Set([value; 2]));
    let kp = |sim: &SimulationManager| [0, 1].map(|env| get(sim, env, Property::Stiffness, "lever/hinge")[0]);
    // 500 is nominal.
    for value in [500.0, 501.0] {
        sim.properties_mut().randomize(&draw(value), Some(&[EnvId(1)])).unwrap();
        sim.restore(&set, ALL).unwrap();
        assert_eq!(kp(&sim), [200.0, value]);
        assert_eq!(sim.robot(id).stiffness(), array![[200.0], [value]]);
    }
    // The reset also clears a randomized value that is nominal.
    sim.properties_mut().randomize(&draw(500.0), Some(&[EnvId(1)])).unwrap();
    sim.properties_mut().reset(ALL).unwrap();
    sim.restore(&set, ALL).unwrap();
    assert_eq!(kp(&sim), [200.0; 2]);
    sim.properties_mut().randomize(&draw(300.0), Some(&[EnvId(1)])).unwrap();
    for (drive_type, passes) in [(DriveType::None, [0.0; 2]), (DriveType::Force, [200.0, 300.0])] {
        sim.robot_mut(id).set_drive_type(drive_type, None, ALL).unwrap();
        assert_eq!(kp(&sim), passes);
    }
    for drive_type in [DriveType::None, DriveType::Acceleration] {
        sim.robot_mut(id).set_drive_type(drive_type, None, ALL).unwrap();
        assert_ne!(kp(&sim)[0], 200.0, "control: the one that is not drawn changes");
        sim.restore(&start, ALL).unwrap();
        assert_eq!(kp(&sim), [500.0, 300.0], "{drive_type:?}");
        assert_eq!(sim.robot(id).stiffness(), array![[500.0], [300.0]]);
        sim.restore(&set, ALL).unwrap();
    }
}

#[test]
fn ranges() {
    let (mut sim, _) = world(cfg(4, 2));
    sim.properties_mut().randomize(&all_properties(), ALL).unwrap();
    for env in 0..4 {
        let properties = sim.properties().of(EnvId(env)).unwrap();
        let ratio = |p, name| properties.get(p, name).unwrap()[0] / properties.nominal(p, name).unwrap()[0];
        for name in ["arm/link3", "cube", "machine/tip"] {
            assert!((0.8..1.2).contains(&ratio(Property::Mass, name)));
        }
        // The moments of the arm have their own factor on top of that of the mass.
        let own = ratio(Property::Inertia, "arm/link3") / ratio(Property::Mass, "arm/link3");
        assert!((0.9..1.1).contains(&own) && own != 1.0, "{own}");
        assert_eq!(ratio(Property::Inertia, "cube"), ratio(Property::Mass, "cube"));
        let (com, link) = (Property::CenterOfMass, "arm/link2");
        let nominal = properties.nominal(com, link).unwrap();
        let moved: Vec<f64> = properties.get(com, link).unwrap().iter().zip(nominal).map(|(a, b)| a - b).collect();
        assert!(moved.iter().all(|d| d.abs() <= 0.01) && moved[0] != moved[1], "{moved:?}");
        assert!((0.4..1.1).contains(&properties.get(Property::Friction, "ground").unwrap()[0]));
        assert_eq!(ratio(Property::TorsionalFriction, "cube"), 1.0);
        assert_eq!(ratio(Property::Stiffness, "arm/JOINT5"), 1.0);
        assert!((0.5..1.0).contains(&ratio(Property::MaxEffort, "arm/JOINT4")));
        assert_eq!(get(&sim, env, Property::Mass, "pile1"), [0.2]);
        // MuJoCo steps with the randomized values.
        sim.batch().read(env, |env| {
            let model = env.data().model();
            let cube = model.id(ObjectKind::Body, "cube").unwrap();
            assert_eq!(model.body_mass()[cube], properties.get(Property::Mass, "cube").unwrap()[0]);
            assert_eq!(model.gravity()[..], *properties.get(Property::Gravity, "gravity").unwrap());
        });
    }
    // Randomization is relative to the nominal values, so values do not drift. They also differ between calls.
    let first = get(&sim, 1, Property::Mass, "cube");
    for _ in 0..50 {
        sim.properties_mut().randomize(&all_properties(), ALL).unwrap();
    }
    let last = get(&sim, 1, Property::Mass, "cube");
    assert!(last != first && (0.8..1.2).contains(&(last[0] / 0.5)), "{first:?} {last:?}");
    sim.update(200);
    assert!(sim.diverged().is_empty());
}

#[test]
fn seeds() {
    let draw = |num_envs, threads, seed| {
        let (mut sim, _) = world(SimulationManagerCfg { seed, ..cfg(num_envs, threads) });
        sim.properties_mut().randomize(&all_properties(), ALL).unwrap();
        sim
    };
    let (mut eight, mut three) = (draw(8, 2, 5), draw(3, 1, 5));
    for env in 0..3 {
        assert_eq!(values(&eight, env), values(&three, env));
        assert_ne!(values(&eight, env), values(&eight, env + 1));
    }
    assert_ne!(values(&draw(3, 1, 6), 0), values(&three, 0), "another seed");
    // An environment's second randomization does not depend on those of other environments in between, nor on other
    // properties.
    three.properties_mut().randomize(&all_properties(), Some(&[EnvId(1)])).unwrap();
    eight.properties_mut().randomize(&all_properties(), Some(&[EnvId(0), EnvId(4)])).unwrap();
    assert_ne!(values(&eight, 1), values(&three, 1));
    eight.properties_mut().randomize(&all_properties(), Some(&[EnvId(1)])).unwrap();
    assert_eq!(values(&eight, 1), values(&three, 1));
    let only = Randomization::new().with(Property::Mass, "cube", RandomizationOp::Scale([0.8, 1.2]));
    three.properties_mut().randomize(&only, Some(&[EnvId(0)])).unwrap();
    assert_eq!(get(&three, 0, Property::Mass, "cube"), get(&eight, 0, Property::Mass, "cube"));
    // By a function: one random stream for each environment and call.
    let mut streams = Vec::new();
    for sim in [&mut eight, &mut three] {
        let mut numbers = Vec::new();
        sim.properties_mut()
            .randomize_with(Some(&[EnvId(1)]), |random, env, _| {
                numbers.push((env, random.uniform()));
                Ok(())
            })
            .unwrap();
        streams.push(numbers);
    }
    assert_eq!(streams[0], streams[1]);
}

#[test]
fn memory() {
    let (mut sim, _) = world(cfg(4, 1));
    let masses = Randomization::new().with(Property::Mass, "arm/.*", RandomizationOp::Scale([0.8, 1.2]));
    let random = masses.with(Property::Friction, "ground", RandomizationOp::Set([0.5, 1.5]));
    sim.properties_mut().randomize(&random, Some(&[EnvId(1)])).unwrap();
    let base = sim.batch().model().clone();
    let model = |sim: &SimulationManager, env| sim.batch().read(env, |env| env.data().model().clone());
    for env in [0, 2, 3] {
        assert!(model(&sim, env).unshared_arrays(&base).is_empty() && sim.properties().bytes(EnvId(env)).unwrap() == 0);
    }
    let own = model(&sim, 1);
    let mut apart = own.unshared_arrays(&base);
    assert_eq!(own.own_arrays().map(|(name, _)| name).collect::<Vec<_>>(), apart);
    apart.retain(|name| !["tendon_invweight0", "actuator_acc0", "light_poscom0"].contains(name));
    let (bodies, others) = (
        ["body_inertia", "body_invweight0", "body_mass", "body_subtreemass"],
        ["dof_M0", "dof_invweight0", "geom_friction"],
    );
    assert_eq!(apart, [&bodies[..], &others].concat());
    // Only numbers that differ count, with 8 bytes each. Masses, moments and friction are not stored twice.
    let differing = |of: fn(&Model) -> &[f64]| of(&own).iter().zip(of(&base)).filter(|(a, b)| a != b).count();
    let numbers: [fn(&Model) -> &[f64]; 6] = [
        Model::body_mass,
        Model::body_inertia,
        Model::body_subtreemass,
        Model::body_invweight0,
        Model::dof_invweight0,
        Model::geom_friction,
    ];
    let at_least = 8 * numbers.map(differing).into_iter().sum::<usize>();
    let bytes = sim.properties().bytes(EnvId(1)).unwrap();
    // Further constants: one of each degree of freedom, tendon and actuator, three of each light. The list of places and
    // the structs are small.
    let small = 8 * (base.nv() + base.ntendon() + base.nactuator() + 3 * base.nlight());
    assert!(at_least > 8 * 30 && bytes > at_least && bytes < at_least + small + 1024, "{bytes} {at_least}");
    let whole: usize = own.own_arrays().map(|(_, bytes)| bytes).sum();
    assert!(own.own_bytes() > whole && own.own_bytes() < whole + (16 << 10), "{} for {whole}", own.own_bytes());
    assert!(bytes < base.shared_bytes(), "{bytes} of {}", base.shared_bytes());

    // Nominal again: everything is shared, and the simulation continues as without the randomization.
    sim.properties_mut().reset(ALL).unwrap();
    assert!(model(&sim, 1).unshared_arrays(&base).is_empty() && sim.properties().bytes(EnvId(1)).unwrap() == 0);
    let (mut other, _) = world(cfg(4, 1));
    sim.update(200);
    other.update(200);
    assert!(all_bits(&sim) == all_bits(&other));
}

#[test]
fn growing_buffers() {
    let (mut sim, ids) = world(cfg(3, 2));
    for k in 0..6 {
        sim.add_rigid_object(cube(&format!("more{k}"), 0.2, [1.0, 0.2 * f64::from(k), 0.2])).unwrap();
    }
    sim.properties_mut().randomize(&all_properties(), Some(&[EnvId(0), EnvId(2)])).unwrap();
    let drawn = all_values(&sim);
    let own = |sim: &SimulationManager, env| {
        sim.batch().read(env, |env| env.data().model().own_arrays().map(|(name, _)| name).collect::<Vec<_>>())
    };
    let (arrays, growths) = (own(&sim, 0), sim.warnings().buffer_growths());
    assert!(arrays.len() > 8);
    let gravity = get(&sim, 0, Property::Gravity, "gravity");
    sim.update(150);
    assert!(
        sim.warnings().buffer_growths() > growths || BUILD_VERSION == SupportedVersion::V4,
        "the arena of 4.x is large enough"
    );
    sim.reset(None).unwrap();
    assert_eq!(all_values(&sim), drawn);
    assert_eq!(own(&sim, 0), arrays);
    // The simulation steps with it: one step of free fall.
    let before = sim.rigid_object(ids.cube).velocity();
    sim.update(1);
    let after = sim.rigid_object(ids.cube).velocity();
    for k in 0..3 {
        assert!((after[(0, k)] - before[(0, k)] - 0.01 * gravity[k]).abs() < 1e-12);
    }
    assert!((after[(1, 2)] - before[(1, 2)] + 0.01 * G).abs() < 1e-12);
}

#[test]
fn later_entities() {
    let (mut sim, ids) = world(cfg(3, 1));
    sim.properties_mut().randomize(&all_properties(), Some(&[EnvId(1), EnvId(2)])).unwrap();
    sim.update(100);
    let state = |sim: &SimulationManager| {
        let arm = sim.robot(ids.arm);
        let machine = sim.mjcf_part(ids.machine);
        (arm.qpos(), arm.qvel(), sim.rigid_object(ids.cube).pose(), machine.qpos(), machine.qvel())
    };
    let (before, drawn) = (state(&sim), all_values(&sim));
    sim.add_rigid_object(cube("late", 1.0, [2.0, 2.0, 0.05])).unwrap();
    sim.add_robot(RobotCfg { uid: "second".into(), init_pose: Pose::translation(3.0, 0.0, 0.0), ..arm() }).unwrap();
    assert!(state(&sim) == before, "bit for bit");
    for (env, drawn) in drawn.iter().enumerate() {
        let mut now = values(&sim, env);
        now.retain(|(_, name, _)| !name.starts_with("late") && !name.starts_with("second/"));
        assert_eq!(now, *drawn, "environment {env}");
        assert_eq!(get(&sim, env, Property::Mass, "late"), [1.0]);
    }
    assert_eq!(sim.properties().bytes(EnvId(0)).unwrap(), 0);
    // The same values as with all entities present from the start: names are the keys.
    let (mut other, _) = world(cfg(3, 1));
    other.add_rigid_object(cube("late", 1.0, [2.0, 2.0, 0.05])).unwrap();
    other.properties_mut().randomize(&all_properties(), Some(&[EnvId(1), EnvId(2)])).unwrap();
    assert_eq!(get(&other, 2, Property::Mass, "arm/link4"), get(&sim, 2, Property::Mass, "arm/link4"));
    sim.update(50);
    assert!(sim.diverged().is_empty());
}

#[test]
fn snapshots_and_rollouts() {
    let build = || {
        let (mut sim, ids) = world(cfg(2, 2));
        sim.properties_mut().randomize(&all_properties(), ALL).unwrap();
        (sim, ids)
    };
    let (mut sim, ids) = build();
    sim.update(120);
    let snapshot = sim.snapshot(ALL).unwrap();
    let controls = Array3::from_shape_fn((2, 40, 7), |(n, t, k)| (0.5 * n as f64 + 0.1 * t as f64 + k as f64).sin());
    let rollout = sim.rollout(&controls, None, ALL).unwrap();
    for t in 0..40 {
        sim.robot_mut(ids.arm).set_qpos_target(controls.slice(s![.., t, ..6]), None, None).unwrap();
        sim.mjcf_part_mut(ids.machine).set_ctrl(controls.slice(s![.., t, 6..]), None, None).unwrap();
        sim.update(1);
    }
    let end = all_bits(&sim);
    let (mut fresh, _) = build();
    fresh.restore(&rollout.final_states, ALL).unwrap();
    assert!(all_bits(&fresh) == end);
    fresh.restore(&snapshot, ALL).unwrap();
    let again = fresh.rollout(&controls, None, ALL).unwrap();
    assert!(again.states == rollout.states);
    // Control: nominal properties give other states.
    fresh.properties_mut().reset(ALL).unwrap();
    assert!(fresh.rollout(&controls, Some(&snapshot), ALL).unwrap().states != rollout.states);
}

/// 4.x keeps only the diagonal of the inertia matrix of a free body whose center of mass is at its origin, unless the
/// file disables this; the objects of the scene disable it.
#[test]
fn centered_body_of_file() {
    let (mut sim, _) = world(cfg(2, 1));
    let text = r#"<mujoco><worldbody><body name="ball" pos="3 3 1"><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"#;
    sim.add_mjcf(MjcfPartCfg::text("file", text)).unwrap();
    let set = |sim: &mut SimulationManager, name: &str| {
        sim.properties_mut()
            .randomize_with(Some(&[EnvId(1)]), |_, _, p| p.set(Property::CenterOfMass, name, &[0.03, 0.0, 0.0]))
    };
    let moved = set(&mut sim, "file/ball");
    if BUILD_VERSION == SupportedVersion::V4 {
        let Err(Error::Randomization(fault)) = moved else { panic!("{moved:?}") };
        assert!(matches!(&fault, RandomizationError::DiagonalInertia { env: 1, name } if name == "file/ball"));
    } else {
        moved.unwrap();
    }
    set(&mut sim, "cube").unwrap();
}

#[test]
fn centered_object() {
    let (mut sim, ids) = world(cfg(2, 1));
    set(&mut sim, &[(1, Property::CenterOfMass, "cube", &[0.03, 0.0, 0.0])]);
    // Free fall without spin: a force at the center of mass causes no rotation, and the origin rotates about the
    // center.
    sim.rigid_object_mut(ids.cube).write_velocity(&Array2::zeros((1, 6)), ALL).unwrap();
    sim.update(10);
    let fallen = sim.rigid_object(ids.cube).velocity();
    assert!(fallen.row(1).iter().zip(&fallen.row(0)).all(|(a, b)| (a - b).abs() < 1e-12), "{fallen}");
    // With a spin about z the origin is accelerated toward the center: |a| = w² d.
    sim.rigid_object_mut(ids.cube).write_velocity(&array![[0.0, 0.0, 0.0, 0.0, 0.0, 2.0]], ALL).unwrap();
    let before = sim.rigid_object(ids.cube).velocity();
    sim.update(1);
    let change = sim.rigid_object(ids.cube).velocity() - before;
    let sideways = (change[(1, 0)].powi(2) + change[(1, 1)].powi(2)).sqrt() / 0.01;
    assert!((sideways - 4.0 * 0.03).abs() < 2e-3, "{sideways}");
    assert!(change[(0, 0)].abs() + change[(0, 1)].abs() < 1e-9);
}

/// The forward pass after a randomization is delayed until the next read or step; the delay does not change a bit.
#[test]
fn lazy_forward_pass() {
    let masses = Randomization::new().with(Property::Mass, ".*", RandomizationOp::Scale([0.5, 2.0]));
    let drawn = masses.with(Property::Friction, ".*", RandomizationOp::Scale([0.5, 1.5]));
    let run = |draws: bool, read: bool, reset: bool| {
        let (mut sim, ids) = world(cfg(3, 2));
        sim.update(50);
        for envs in [None, Some(&[EnvId(1)][..])] {
            if draws {
                sim.properties_mut().randomize(&drawn, envs).unwrap();
            }
            if read {
                let _ = all_bits(&sim);
            }
        }
        if reset {
            sim.reset(Some(&[EnvId(2)])).unwrap();
        }
        // The read values belong to the new masses: MuJoCo's inertia matrix.
        let of_mass = |env: usize| sim.batch().read(env, |env| env.data().mass_matrix().unwrap());
        let matrices: Vec<Vec<f64>> = (0..3).map(of_mass).collect();
        let masses = sim.rigid_object(ids.cube).mass();
        sim.update(20);
        (matrices, masses, all_bits(&sim))
    };
    for reset in [false, true] {
        let (eager, lazy) = (run(true, true, reset), run(true, false, reset));
        assert_eq!(eager, lazy);
        let nominal = run(false, false, reset);
        assert!(nominal.0 != lazy.0 && nominal.1 != lazy.1 && nominal.2 != lazy.2, "it can be seen");
    }
}
