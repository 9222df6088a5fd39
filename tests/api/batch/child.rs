//! Scenarios that run in a process of their own: a test of this binary, started again with a variable set.

use super::support::{arm_and_hand, cfg, free_robot, plate, wheel};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use std::path::Path;
use testkit::process::{is_child, run, text};

#[test]
fn mujoco_writes_no_log_and_says_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let output = run(module_path!(), "scenario_everything_goes_wrong", dir.path(), &[]);
    let (out, err) = (text(&output.stdout), text(&output.stderr));
    assert!(output.status.success(), "{out}\n{err}");
    assert!(out.contains("it all went wrong as it should"), "{out}");
    let left: Vec<_> = std::fs::read_dir(dir.path()).unwrap().map(|e| e.unwrap().file_name()).collect();
    assert!(left.is_empty(), "{left:?}");
    for word in ["WARNING", "ERROR", "Press Enter", "MUJOCO_LOG"] {
        assert!(!out.contains(word) && !err.contains(word), "{word}: {out}\n{err}");
    }
}

/// Divergence, overflow, engine errors, refused models and files.
#[test]
#[ignore = "runs in a process of its own"]
fn scenario_everything_goes_wrong() {
    if !is_child() {
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let mut sim = SimulationManager::new(cfg(4, 2)).unwrap();
    let robot = sim.add_robot(wheel(dir.path())).unwrap();
    sim.add_robot(arm_and_hand()).unwrap();
    sim.add_robot(free_robot(dir.path(), "plate", &plate(14, 0), 0.1)).unwrap();
    sim.update(100);
    sim.robot_mut(robot).write_qpos(&array![[f64::MAX]], None, Some(&[EnvId(1)])).unwrap();
    sim.robot_mut(robot).write_qpos(&array![[9e9]], None, Some(&[EnvId(2)])).unwrap();
    sim.update(10);
    assert_eq!(sim.diverged().len(), 2);
    super::engine_errors::an_engine_error_is_a_value();
    for text in ["", "<mujoco><worldbody><geom size='-1'/></worldbody></mujoco>", "<mujoco><nonsense/></mujoco>"] {
        let _ = kinetoscope::sim::mj::compile(text, &[]).unwrap_err();
    }
    let model = "<mujoco><asset><mesh file='empty.stl'/></asset></mujoco>";
    for name in ["empty.stl", "model.xml", "", &"n".repeat(999), &"n".repeat(1000)] {
        let asset = kinetoscope::sim::mj::Asset { name: name.into(), bytes: Vec::new() };
        let filled = kinetoscope::sim::mj::Asset { bytes: vec![0; 10], ..asset.clone() };
        let _ = kinetoscope::sim::mj::compile(model, &[asset]).unwrap_err();
        let _ = kinetoscope::sim::mj::compile(model, &[filled.clone(), filled]).unwrap_err();
    }
    for path in ["/no/such/file.xml", "", "/", &"p".repeat(5000), "nul\0.xml"] {
        let _ = kinetoscope::sim::mj::compile_file(Path::new(path)).unwrap_err();
    }
    drop(sim);
    println!("it all went wrong as it should");
}
