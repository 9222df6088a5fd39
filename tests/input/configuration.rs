//! Validation of the configuration by `SimulationManager::new`.

use super::support::{ball, cfg, hinge, robot};
use kinetoscope::prelude::*;
use kinetoscope::sim::{DriveModel, GroundCfg, Integrator, LightCfg};
use kinetoscope_testkit::error_tables::assert_errors;

type Change = fn(&mut SimulationManagerCfg);

/// A change of the default configuration, and parts of the error message.
const REFUSED: &[(Change, &[&str])] = &[
    (|c| c.num_envs = 0, &["num_envs is 0", "at least 1"]),
    (|c| c.num_envs = 1 << 40, &["num_envs is 1099511627776", "at most"]),
    (|c| c.num_envs = usize::MAX, &["num_envs is", "at most"]),
    (|c| c.physics_dt = 0.0, &["physics_dt is 0", "above 0"]),
    (|c| c.physics_dt = -0.01, &["physics_dt is -0.01"]),
    (|c| c.physics_dt = f64::NAN, &["physics_dt is NaN"]),
    (|c| c.physics_dt = f64::INFINITY, &["physics_dt is inf"]),
    (|c| c.physics_dt = 2.0, &["physics_dt is 2", "at most 1 second"]),
    (|c| c.physics_dt = 1e-300, &["physics_dt"]),
    (|c| (c.physics_dt, c.substeps) = (1e-6, 10_000), &["physics_dt / substeps"]),
    (|c| c.substeps = 0, &["substeps is 0"]),
    (|c| c.substeps = u32::MAX, &["substeps is 4294967295"]),
    (|c| c.threads = Some(0), &["threads is 0", "1 to 1024", "every core"]),
    (|c| c.threads = Some(usize::MAX), &["threads is"]),
    (|c| c.gravity.x = f64::NAN, &["gravity is [NaN, 0.0, -9.81]"]),
    (|c| c.gravity.z = f64::NEG_INFINITY, &["gravity"]),
    (|c| c.impratio = 0.0, &["impratio is 0"]),
    (|c| c.impratio = f64::NAN, &["impratio is NaN"]),
    (|c| c.solver_iterations = 0, &["solver_iterations is 0"]),
    (|c| c.solver_iterations = u32::MAX, &["solver_iterations"]),
    (|c| c.friction = [-1.0, 0.0, 0.0], &["friction"]),
    (|c| c.friction[2] = f64::NAN, &["friction"]),
    (|c| c.arena_space = -1.0, &["arena_space is -1"]),
    (|c| c.arena_space = f64::NAN, &["arena_space is NaN"]),
    (|c| c.ground = Some(GroundCfg { half_size: 0.0, ..Default::default() }), &["ground.half_size is 0"]),
    (|c| c.ground = Some(GroundCfg { half_size: f64::NAN, ..Default::default() }), &["ground.half_size is NaN"]),
    (|c| c.lights[0].direction.fill(0.0), &["lights.direction"]),
    (|c| c.lights[0].direction.x = f64::NAN, &["lights.direction is [NaN, 0.4, -1.0]"]),
    (|c| c.lights[0].color[1] = 1.5, &["lights.color"]),
    (|c| c.lights[0].color[1] = f64::NAN, &["lights.color"]),
];

#[test]
fn out_of_range() {
    let made = |change: &Change| {
        let mut cfg = cfg(1);
        change(&mut cfg);
        SimulationManager::new(cfg)
    };
    assert_errors(REFUSED.iter().map(|(change, parts)| (parts[0], made(change), "", parts)));
}

/// Extreme but valid numbers: the simulation works, and diverged environments are reported.
const ACCEPTED: &[Change] = &[
    |c| c.physics_dt = 1.0,
    |c| (c.physics_dt, c.substeps) = (1e-5, 10_000),
    |c| c.threads = Some(64),
    |c| c.gravity.fill(0.0),
    |c| c.gravity.z = -1e300,
    |c| c.impratio = 1e-300,
    |c| c.impratio = 1e300,
    |c| c.friction = [0.0; 3],
    |c| c.friction = [1e300; 3],
    |c| c.solver_iterations = 1,
    |c| c.ground = None,
    |c| c.ground = Some(GroundCfg { half_size: 1e-300, ..Default::default() }),
    |c| c.ground = Some(GroundCfg { half_size: 1e300, ..Default::default() }),
    |c| c.lights = Vec::new(),
    |c| c.lights = vec![LightCfg::default(); 200],
    |c| c.lights[0].direction.fill(1e-100),
    |c| c.arena_space = 1e300,
    |c| c.cone = kinetoscope::sim::FrictionCone::Elliptic,
    |c| *c = SimulationManagerCfg { threads: Some(1), ..SimulationManagerCfg::manipulation() },
    |c| *c = SimulationManagerCfg { threads: Some(1), ..SimulationManagerCfg::legged() },
];

#[test]
fn extreme_numbers() {
    let dir = tempfile::tempdir().unwrap();
    for (i, change) in ACCEPTED.iter().enumerate() {
        let mut cfg = cfg(3);
        change(&mut cfg);
        let mut sim = SimulationManager::new(cfg).unwrap_or_else(|e| panic!("row {i}: {e}"));
        let robot = RobotCfg { fix_base: false, ..robot(dir.path(), "ball", &ball()) };
        let ball = sim.add_robot(robot).unwrap_or_else(|e| panic!("row {i}: {e}"));
        sim.update(20);
        assert!(sim.robot(ball).link_pose("ball").unwrap().iter().all(|x| x.is_finite()), "row {i}");
        assert!(sim.cfg().env_origins().iter().all(|x| !x.is_nan()), "row {i}");
    }
}

/// More threads than environments are accepted, because they render; environments limit those that step.
#[test]
fn threads() {
    for (threads, num_envs, stepping) in [(64, 3, 3), (1024, 1, 1), (2, 3, 2)] {
        let sim = SimulationManager::new(SimulationManagerCfg { threads: Some(threads), ..cfg(num_envs) }).unwrap();
        assert_eq!(sim.threads(), stepping, "{threads} threads for {num_envs} environments");
    }
}

#[test]
fn integrators() {
    let dir = tempfile::tempdir().unwrap();
    let robot = robot(dir.path(), "r", &hinge());
    for integrator in [Integrator::Rk4, Integrator::Implicit] {
        let mut sim = SimulationManager::new(SimulationManagerCfg { integrator, ..cfg(1) }).unwrap();
        let message = sim.add_robot(robot.clone()).unwrap_err().to_string();
        assert!(message.contains(integrator.name()) && message.contains("Euler"), "{message}");
        let drive = DriveCfg { model: DriveModel::Actuator, ..Default::default() };
        sim.add_robot(RobotCfg { drive, ..robot.clone() }).unwrap();
        sim.update(3);
    }
    if kinetoscope::mujoco::BUILD_VERSION == kinetoscope::mujoco::SupportedVersion::V2 {
        let cfg = SimulationManagerCfg { integrator: Integrator::ImplicitFast, ..cfg(1) };
        let message = SimulationManager::new(cfg).unwrap_err().to_string();
        assert!(message.contains("implicitfast") && message.contains("2.2.2"), "{message}");
    }
}
