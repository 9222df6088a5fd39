//! Scenes as YAML files.

use kinetoscope::prelude::*;

pub(crate) const QUADRUPED: &str = r#"# As assets/scenes/quadruped.toml begins.
simulation:
  preset: legged
  num_envs: 2
  ground: {color: [0.1, 0.1, 0.1]}
entities:
  robot:
    type: robot
    urdf: ../quadruped/quadruped.urdf
    fix_base: false
    init_pose:
      pos: [0, 0, .6]
    init_qpos: {.*HAA: 0.0, ".*F_HFE": 0.4, .*H_HFE: -0.4, ".*F_KFE": -0.8, ".*H_KFE": 0.8}
    drive: &soft
      stiffness: 80.0
      damping: 5.0
  contact_forces:
    type: contact_sensor
    bodies: ["{ENV_REGEX_NS}/robot/.*_FOOT"]
    sampling.history_length: 6
"#;

#[test]
fn file_names() {
    let folder = tempfile::tempdir().unwrap();
    let text =
        QUADRUPED.replace("    sampling.history_length: 6\n", "    sampling:\n      history_length: 6\n").replace(
            "../quadruped/quadruped.urdf",
            &assets::path("quadruped/quadruped.urdf").unwrap().display().to_string(),
        );
    for name in ["scene.yaml", "scene.YML"] {
        let path = folder.path().join(name);
        std::fs::write(&path, &text).unwrap();
        let mut scene = InteractiveScene::from_file(&path).unwrap();
        assert_eq!((scene.num_envs(), scene.sim().cfg().physics_dt), (2, 0.005));
        scene.update(1);
        assert_eq!(scene.robot("robot").unwrap().get_stiffness()[(0, 0)], 80.0);
    }
    // The same text is no TOML.
    let path = folder.path().join("scene.toml");
    std::fs::write(&path, &text).unwrap();
    assert!(matches!(SceneCfg::from_file(&path), Err(Error::SceneFile { .. })));
}
