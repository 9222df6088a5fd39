//! Scenes as YAML files: the same words, mistakes with their lines.

use kinetoscope::prelude::*;

const QUADRUPED: &str = r#"# As assets/scenes/quadruped.toml begins.
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

fn error(text: &str) -> String {
    SceneCfg::from_yaml(text, "dir/scene.yaml", &EntityTypes::default()).unwrap_err().to_string()
}

#[test]
fn a_file_is_yaml_by_its_name() {
    let folder = tempfile::tempdir().unwrap();
    let text =
        QUADRUPED.replace("    sampling.history_length: 6\n", "    sampling:\n      history_length: 6\n").replace(
            "../quadruped/quadruped.urdf",
            &kinetoscope::assets::path("quadruped/quadruped.urdf").unwrap().display().to_string(),
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

#[test]
fn a_mistake_is_named_with_its_line() {
    for (text, line, parts) in [
        (QUADRUPED, 20, &["sampling.history_length"][..]),
        ("simulation:\n  num_envs: 2\n  physics_td: 0.01\n", 3, &["physics_td", "physics_dt"]),
        ("\n\nsimulatoin: {}\n", 3, &["simulatoin", "simulation", "entities"]),
        ("entities:\n  cube:\n    type: rigid_object\n    mas: 1.0\n", 4, &["mas", "`mass`", "`density`"]),
        ("entities:\n  c:\n    # first\n    type: camara\n", 4, &["\"c\"", "`camera`", "`ray_caster`"]),
        ("entities:\n  c:\n    width: 2\n", 2, &["\"c\"", "type"]),
        ("simulation:\n  num_envs: two\n", 2, &["two"]),
        ("simulation:\n  num_envs:\n", 2, &["nothing is said"]),
        ("simulation:\n  num_envs: 1\n  num_envs: 2\n", 3, &["duplicate"]),
        ("simulation:\n  physics_dt: 1e999\n", 2, &["beyond"]),
        ("simulation:\n  lights:\n    - {kind: spott}\n", 3, &["`directional`", "`point`", "`spot`"]),
        ("simulation:\n\tnum_envs: 1\n", 2, &[]),
        ("simulation: [1, 2\n", 2, &[]),
    ] {
        let message = error(text);
        let place = format!("dir/scene.yaml:{line}: ");
        assert!(message.starts_with(&place) && parts.iter().all(|part| message.contains(part)), "{text}\n{message}");
    }
}

/// Whatever stands in a file, reading it ends with a scene or an error.
#[test]
fn no_text_ends_the_process() {
    let read = |text: &str| SceneCfg::from_yaml(text, "scene.yaml", &EntityTypes::default());
    let (mut wrong, mut tried) = (0, 0);
    for (at, _) in QUADRUPED.char_indices() {
        let (before, after) = QUADRUPED.split_at(at);
        for text in
            [before.to_owned(), format!("{before}]{after}"), format!("{before}: {after}"), format!("{before}*a{after}")]
        {
            tried += 1;
            match read(&text) {
                Ok(_) => {}
                Err(Error::SceneFile { at, .. }) => {
                    wrong += 1;
                    assert!(at.line >= 1 && at.line as usize <= text.lines().count() + 1, "{at}");
                }
                Err(other) => panic!("{other}"),
            }
        }
    }
    assert!(wrong > tried / 4, "{wrong} of {tried}");
}
