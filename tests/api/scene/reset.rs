//! Resets of a scene: `reset` as in Isaac Lab, which clears buffers and keeps written state, and `reset_to_default`.

use super::quadruped::bundled;
use kinetoscope::ndarray::{Array2, Array3};
use kinetoscope::prelude::*;
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sensors::ray::RayCaster;
use kinetoscope::sim::WrenchFrame;

/// Regression: `scene.reset()` discarded written state, so the tutorial's noise on joint positions was lost.
#[test]
fn written_state_stays() {
    let mut scene = InteractiveScene::new(bundled()).unwrap();
    scene.update(20);
    let mut robot = scene.robot_mut("robot").unwrap();
    let (mut root, mut joints) = (robot.read().default_root_state(), robot.read().default_qpos());
    root.row_mut(1)[2] += 0.25;
    root.row_mut(1)[7] = 0.5;
    joints.iter_mut().enumerate().for_each(|(k, q)| *q += 0.004 * k as f64);
    let speeds = Array2::from_elem(joints.dim(), 0.1);
    robot.write_root_state(&root, None).unwrap();
    robot.write_joint_state(&joints, &speeds, None, None).unwrap();
    let base = [robot.read().link_id("base").unwrap()];
    let forces = Array3::from_elem((2, 1, 3), 3.0);
    robot.set_external_wrench(&forces, &Array3::zeros((2, 1, 3)), WrenchFrame::World, Some(&base), None).unwrap();
    scene.reset(Some(&[EnvId(1)])).unwrap();

    let robot = scene.robot("robot").unwrap();
    let same = |found: &Array2<f64>, written: &Array2<f64>| (found - written).iter().all(|off| off.abs() < 1e-15);
    assert!(same(&robot.qpos(), &joints) && same(&robot.qvel(), &speeds));
    assert!(same(&robot.root_state(), &root), "{:?}", robot.root_state());
    // Only the buffers of the named environment are cleared; its sensors measure the written state: 0.25 m higher.
    let pushed: Vec<f64> = (0..2).map(|env| robot.external_wrenches()[(env, 0, 0)]).collect();
    assert_eq!(pushed, [3.0, 0.0]);
    let counts =
        |scene: &InteractiveScene| scene.sensor::<ContactSensor>("contact_forces").unwrap().sample_counts().to_vec();
    assert!(counts(&scene)[0] > counts(&scene)[1], "{:?}", counts(&scene));
    let scanner = scene.sensor::<RayCaster>("height_scanner").unwrap();
    let height = |env: usize| scanner.pos_w()[(env, 2)];
    assert!((height(1) - height(0) - 0.25).abs() < 1e-12, "{} {}", height(0), height(1));
    assert!(scene.sim().time().iter().all(|time| *time > 0.0), "the time is not reset");

    // `reset_to_default` restores everything.
    scene.reset_to_default(None).unwrap();
    let robot = scene.robot("robot").unwrap();
    assert!(same(&robot.qpos(), &robot.default_qpos()) && same(&robot.root_state(), &robot.default_root_state()));
    assert_eq!(scene.sim().time(), [0.0; 2]);
    assert!(scene.reset(Some(&[EnvId(2)])).is_err() && scene.reset_to_default(Some(&[EnvId(2)])).is_err());
}
