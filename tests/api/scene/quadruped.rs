//! The scene of the tutorial, from the bundled file and from Rust: bit-identical results, and the numbers that the
//! tutorial prints.

use kinetoscope::prelude::*;
use kinetoscope::sensors::ContactSensor;
use kinetoscope::sensors::camera::{Camera, CameraConvention};
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayAlignment, RayCaster};
use kinetoscope::sim::GroundCfg;
use kinetoscope_testkit::bits::bits;

pub(crate) fn declared() -> SceneCfg {
    let robot = assets::quadruped().unwrap();
    let camera = CameraCfg {
        width: 640,
        height: 480,
        update_period: 0.1,
        channels: Channels::from_names(&["rgb", "distance_to_image_plane"]).unwrap(),
        near: 0.1,
        far: 1e5,
        intrinsics: Intrinsics::ISAAC,
        extrinsics: Extrinsics {
            parent: Some("robot/base".into()),
            placement: Placement::Pose {
                pos: [0.510, 0.0, 0.015],
                rotation: kinetoscope::scene::pose::from_wxyz([0.5, -0.5, 0.5, -0.5]),
            },
            convention: CameraConvention::Ros,
        },
        ..Default::default()
    };
    let scanner = RayCasterCfg {
        parent: Some("robot/base".into()),
        offset: Pose::translation(0.0, 0.0, 20.0),
        alignment: RayAlignment::Yaw,
        pattern: Grid { resolution: 0.1, size: [1.6, 1.0], ..Default::default() }.into(),
        targets: HitTargets::Named(vec!["ground".into()]),
        sampling: SamplingCfg::every(0.02),
        ..Default::default()
    };
    let contacts = ContactSensorCfg {
        sampling: SamplingCfg { history_length: 6, ..Default::default() },
        ..ContactSensorCfg::for_bodies("robot/.*_FOOT")
    };
    let simulation = SimulationManagerCfg {
        lights: vec![LightCfg::dome(1.0, [0.75; 3])],
        num_envs: 2,
        arena_space: 2.0,
        ground: Some(GroundCfg { color: [0.1; 3], ..Default::default() }),
        ..SimulationManagerCfg::legged()
    };
    SceneCfg::new(simulation)
        .with("robot", robot)
        .with("camera", camera)
        .with("height_scanner", scanner)
        .with("contact_forces", contacts)
}

/// Bits of the robot state and of all sensor readings after `steps` steps.
pub(crate) fn state_bits(scene: &mut InteractiveScene, steps: u32) -> Vec<Vec<u64>> {
    // Different starts of the environments, so that a mix-up is detected.
    let mut start = scene.robot("robot").unwrap().qpos();
    start.row_mut(1).iter_mut().for_each(|angle| *angle += 0.05);
    scene.robot_mut("robot").unwrap().write_qpos(&start, None, None).unwrap();
    scene.update(steps);
    let robot = scene.robot("robot").unwrap();
    let state = [robot.qpos(), robot.qvel(), robot.root_pose(), robot.root_velocity()];
    let camera = scene.sensor::<Camera>("camera").unwrap();
    let scanner = scene.sensor::<RayCaster>("height_scanner").unwrap();
    let contacts = scene.sensor::<ContactSensor>("contact_forces").unwrap();
    let images = [bits(camera.depth().unwrap()), bits(camera.color().unwrap())];
    let others = [bits(scanner.distances()), bits(contacts.net_forces_w())];
    state.iter().map(bits).chain(images).chain(others).collect()
}

pub(crate) fn bundled() -> SceneCfg {
    SceneCfg::from_file(assets::path("scenes/quadruped.toml").unwrap()).unwrap()
}

#[test]
fn same_bits() {
    let mut from_file = InteractiveScene::new(bundled()).unwrap();
    let mut from_rust = InteractiveScene::new(declared()).unwrap();
    let expected = state_bits(&mut from_rust, 100);
    assert_eq!(state_bits(&mut from_file, 100), expected);
    // Control: a slightly softer drive changes every number that moves.
    let mut softer = declared();
    let Some((_, EntityCfg::Robot(robot))) = softer.entities.first_mut() else { panic!("the robot is first") };
    robot.drive.stiffness = 79.0.into();
    let found = state_bits(&mut InteractiveScene::new(softer).unwrap(), 100);
    assert!(found.iter().zip(&expected).filter(|(found, expected)| found != expected).count() >= 6);
}

#[test]
fn tutorial() {
    let mut scene = InteractiveScene::new(bundled()).unwrap();
    assert_eq!(scene.keys().collect::<Vec<_>>(), ["robot", "camera", "height_scanner", "contact_forces"]);
    assert_eq!(scene.num_envs(), 2);
    let origins: Vec<Vec<f64>> = scene.env_origins().rows().into_iter().map(|row| row.to_vec()).collect();
    assert_eq!(origins, [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0]]);
    scene.update_for(2.5).unwrap();
    assert!(scene.sim().time().iter().all(|time| (time - 2.5).abs() < 1e-9));
    let camera = scene.sensor::<Camera>("camera").unwrap();
    assert_eq!(camera.color().unwrap().shape(), [2, 480, 640, 4]);
    assert_eq!(camera.depth().unwrap().shape(), [2, 480, 640]);
    let scanner = scene.sensor::<RayCaster>("height_scanner").unwrap();
    assert_eq!(scanner.hits().shape(), [2, 187, 3]);
    let contacts = scene.sensor::<ContactSensor>("contact_forces").unwrap();
    assert_eq!(contacts.net_forces_w().shape(), [2, 4, 3]);
}

#[test]
fn whole_steps() {
    let mut scene = InteractiveScene::new(SceneCfg::default()).unwrap();
    for seconds in [0.005, -0.01, f64::NAN, f64::INFINITY] {
        let message = scene.update_for(seconds).unwrap_err().to_string();
        assert!(message.contains("seconds") && message.contains("physics_dt"), "{message}");
    }
    assert_eq!(scene.sim().time(), [0.0]);
    scene.update_for(0.07).unwrap();
    assert!((scene.sim().time()[0] - 0.07).abs() < 1e-12);
}
