//! The tasks of the folder `assets/tasks` run in Rust, too.

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::tasks::{AutoresetMode, EnvBuilder, TaskCfg, TermRegistry};

#[test]
fn ready_made_tasks() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("assets/tasks");
    let mut names = Vec::new();
    for entry in std::fs::read_dir(&folder).unwrap() {
        let folder = entry.unwrap().path();
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let mut scene = SceneCfg::from_file(folder.join("scene.toml")).unwrap();
        (scene.simulation.num_envs, scene.simulation.threads) = (2, Some(1));
        let sim = InteractiveScene::new(scene).unwrap().into_sim();
        let task = TaskCfg::from_toml(&std::fs::read_to_string(folder.join("task.toml")).unwrap()).unwrap();
        let mut env = EnvBuilder::from_cfg(sim, &task, &TermRegistry::default()).unwrap().build().unwrap();
        assert_eq!(env.cfg().autoreset, AutoresetMode::NextStep, "{name}");
        env.reset(None, Some(1)).unwrap();
        let actions = Array2::zeros((2, env.action_space().len()));
        // Robots that do nothing stand for a while: half a second.
        for step in 0..25 {
            let done = env.step(&actions).unwrap();
            assert!(done.observations.iter().chain(&done.rewards).all(|value| value.is_finite()), "{name}, {step}");
            assert!(!done.terminated.iter().any(|end| *end) || name == "balance", "{name}, {step}");
        }
        assert!(env.sim().diverged().is_empty(), "{name}");
        names.push(name);
    }
    names.sort();
    assert_eq!(names, ["balance", "quadruped_velocity", "quadruped_velocity_rough"]);
}
