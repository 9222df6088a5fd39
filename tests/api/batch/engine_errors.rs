//! `mju_error` inside a step is a value, in any thread, and never the end of the process.

use super::support::{bits_of, cfg, free_robot, walker};
use kinetoscope::prelude::*;
use kinetoscope::sim::drive::table::DriveTable;
use kinetoscope::sim::env::{Env, EnvStatus};
use kinetoscope::sim::mj::{Data, Model, TARGET, Target, compile};
use std::sync::Arc;

/// Boxes in a heap, with next to no memory for the solver: MuJoCo stops in the middle of a step, with `mju_error`.
fn starved() -> Model {
    let boxes: String = (0..4)
        .map(|i| {
            // In the air at first: the compiler takes a step as well.
            let height = 0.15 + 0.25 * f64::from(i);
            format!(r#"<body pos="0.01 0 {height}"><freejoint/><geom type="box" size=".1 .1 .1"/></body>"#)
        })
        .collect();
    // How little is too little for a step and enough for the compiler differs between versions: looked for.
    for i in 0..200 {
        let size = match TARGET {
            Target::V2 => format!(r#"<size njmax="500" nconmax="100" nstack="{}"/>"#, 1000 + 200 * i),
            Target::V4 => format!(r#"<size memory="{}"/>"#, 4096 + 1024 * i),
        };
        let world = format!(r#"<worldbody><geom type="plane" size="1 1 1"/>{boxes}</worldbody>"#);
        let Ok(compiled) = compile(&format!("<mujoco>{size}{world}</mujoco>"), &[]) else { continue };
        let model = compiled.into_model();
        let Ok(mut data) = Data::new(&model) else { continue };
        if (0..100).any(|_| data.step().is_err()) {
            return model;
        }
    }
    panic!("MuJoCo never stops")
}

/// Steps until MuJoCo stops, and returns what it said.
fn provoke(model: &Model) -> String {
    let mut data = Data::new(model).unwrap();
    for _ in 0..100 {
        if let Err(error) = data.step() {
            // After a reset the data is as new.
            data.reset();
            assert!(data.time() == 0.0);
            return error.to_string();
        }
    }
    panic!("MuJoCo found the memory enough: {:?}", data.take_warnings());
}

#[test]
pub(crate) fn an_engine_error_is_a_value() {
    let model = starved();
    let message = provoke(&model);
    assert!(message.starts_with("MuJoCo stopped: "), "{message}");
}

#[test]
fn engine_errors_stay_in_their_thread() {
    let model = starved();
    let dir = tempfile::tempdir().unwrap();
    let robot = free_robot(dir.path(), "walker", &walker(), 0.3);
    let calm = |robot: RobotCfg| {
        let mut sim = SimulationManager::new(cfg(4, 2)).unwrap();
        sim.add_robot(robot).unwrap();
        sim.update(100);
        sim.batch().read(3, bits_of)
    };
    let alone = calm(robot.clone());
    std::thread::scope(|scope| {
        let stepping = scope.spawn(|| (0..4).map(|_| calm(robot.clone())).collect::<Vec<_>>());
        let failing: Vec<_> =
            (0..4).map(|_| scope.spawn(|| (0..200).map(|_| provoke(&model)).collect::<Vec<_>>())).collect();
        for thread in failing {
            let messages = thread.join().unwrap();
            assert!(messages.iter().all(|m| m.starts_with("MuJoCo stopped: ")), "{messages:?}");
        }
        assert!(stepping.join().unwrap().iter().all(|bits| *bits == alone));
    });
}

/// Whether an environment with this little memory grows or is taken out: it never ends the process, and never shows
/// half a step.
#[test]
fn an_environment_survives_engine_errors() {
    let model = starved();
    let table = Arc::new(DriveTable::default());
    let mut env = Env::new(&model, &table).unwrap();
    env.step(100);
    assert_eq!(*env.status(), EnvStatus::Running);
    assert!(env.growths() > 0);
    let mut roomy = model.buffers();
    (roomy.contacts, roomy.constraints, roomy.arena_bytes) = (1000, 2000, 16 << 20);
    let mut reference = Env::new(&model.with_buffers(roomy), &table).unwrap();
    reference.step(100);
    assert_eq!(bits_of(&env), bits_of(&reference));
}
