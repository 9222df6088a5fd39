//! Renders the window images of the documentation:
//!
//! ```sh
//! cargo run --release -p kinetoscope-viewer --example screenshots docs/pictures
//! ```
#![allow(clippy::unwrap_used, reason = "a program for the maintainers")]

use kinetoscope_render::Intrinsics;
use kinetoscope_render::frame::Channels;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::Pose;
use kinetoscope_sensors::camera::{CameraCfg, Extrinsics, Placement};
use kinetoscope_sim::{DriveCfg, ObjectShape, RigidObjectCfg, RobotCfg, SimulationManager, SimulationManagerCfg};
use kinetoscope_viewer::window::{App, Input, Key, Modifiers};
use kinetoscope_viewer::{Canvas, EnvSelection, OrbitCamera, SnapshotRequest, ViewerExt};
use std::path::{Path, PathBuf};
use std::time::Instant;

const SIZE: [usize; 2] = [960, 540];

/// Sixteen arms after 1.5 s of motion to a bent pose, each beside a cube and with a camera.
fn arms() -> SimulationManager {
    let cfg = SimulationManagerCfg { num_envs: 16, physics_dt: 0.01, arena_space: 2.0, ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let urdf = Path::new(env!("CARGO_MANIFEST_DIR")).join("../assets/sr5/SR5.urdf");
    let drive = DriveCfg { stiffness: [(".*", 1e4)].into(), damping: [(".*", 1e3)].into(), ..Default::default() };
    let robot = RobotCfg { uid: "arm".into(), urdf: UrdfCfg::single(urdf), drive, ..Default::default() };
    let robot = sim.add_robot(robot).unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.15),
        init_pose: Pose::translation(0.55, 0.25, 0.075),
        rgba: [0.8, 0.2, 0.15, 1.0],
        ..Default::default()
    })
    .unwrap();
    let camera = CameraCfg {
        width: 320,
        height: 240,
        intrinsics: Intrinsics::Fovy { radians: 0.9 },
        extrinsics: Extrinsics {
            placement: Placement::LookAt { eye: [1.1, -0.5, 0.7], target: [0.45, 0.15, 0.2], up: [0.0, 0.0, 1.0] },
            ..Extrinsics::default()
        },
        channels: Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() },
        ..CameraCfg::default()
    };
    sim.add_sensor("camera", camera).unwrap();
    let target = ndarray::arr2(&[[0.3, 0.5, -1.4, 0.3, -0.5, 0.0]]);
    sim.robot_mut(robot).set_qpos_target(&target, None, None).unwrap();
    sim.update(150);
    sim
}

fn main() {
    let folder = PathBuf::from(std::env::args_os().nth(1).expect("a folder for the images"));
    let mut sim = arms();
    let viewer = sim.viewer(SnapshotRequest { contacts: Some(EnvSelection::All), ..SnapshotRequest::default() });
    let snapshot = viewer.newest().unwrap();
    let near = OrbitCamera::look_at([1.5, -1.0, 1.0], [0.2, 0.1, 0.4]).unwrap();
    let draw_with = |name: &str, keys: &[Key], eye: Option<OrbitCamera>, click: Option<[f64; 2]>| {
        let mut app = App::new(SIZE, 2);
        app.set_snapshot(std::sync::Arc::clone(&snapshot));
        keys.iter().for_each(|key| app.handle(Input::Press(*key)));
        if let Some(eye) = eye {
            let origin = snapshot.envs[0].origin;
            app.set_camera(OrbitCamera { target: [0, 1, 2].map(|k| eye.target[k] + origin[k]), ..eye });
        }
        if let Some(at) = click {
            app.handle(Input::ButtonPress(1, at, Modifiers::default()));
            app.handle(Input::ButtonRelease(1, at));
            assert!(app.selection().is_some_and(|picked| picked.name.contains("arm")), "{:?}", app.selection());
        }
        let mut canvas = Canvas::default();
        app.draw(&mut canvas, Instant::now());
        std::fs::write(folder.join(name), canvas.to_png().unwrap()).unwrap();
    };
    let draw = |name: &str, keys: &[Key], eye: Option<OrbitCamera>| draw_with(name, keys, eye, None);
    // Page down and page up select the first environment alone.
    let one = [Key::PageDown, Key::PageUp];
    let with = |more: &[Key]| [&one[..], more].concat();
    draw("window_grid.png", &[], None);
    draw("window_one.png", &one, Some(near));
    draw_with("window.png", &one, Some(near), Some([410.0, 245.0]));
    draw("window_overlays.png", &with(&['c', 'f', 'j', 'm', 't'].map(Key::Char)), Some(near));
    draw("window_sliders.png", &with(&[Key::Tab]), Some(near));
    draw("window_help.png", &[Key::F1], None);
    draw("window_panel.png", &with(&[Key::Char('i')]), Some(near));
}
