//! Every sample model of MuJoCo can be drawn, and so can every robot at hand.

use kinetoscope::prelude::*;
use kinetoscope::scene::PoseF32;
use kinetoscope::sensors::camera::{Frame, Rasterizer, look_at_pose};
use kinetoscope::sensors::visibility::View;
use kinetoscope::sim::mj;
use std::path::{Path, PathBuf};

/// Draws a still from where MuJoCo's viewers look, and gives the share of pixels that see something.
fn seen(still: &Still) -> f64 {
    let free = still.free_camera();
    let pose = look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0]).unwrap();
    let pixels = Intrinsics::Fovy { radians: free.fovy }.to_pixels(64, 48).unwrap();
    let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
    let [near, far] = free.clip.map(|x| x as f32);
    let world_from_camera = PoseF32::from(&pose);
    let view = View { width: 64, height: 48, fx, fy, cx, cy, near, far, world_from_camera };
    let channels = Channels { color: true, mask: true, ..Channels::default() };
    let mut frame = Frame::new(64, 48, channels);
    let cfg = RasterCfg { ..RasterCfg::default() };
    Rasterizer::new(cfg).render_shot(&still.shot(&view), &mut frame.as_mut()).unwrap();
    let color = frame.color.unwrap();
    assert!(color.as_chunks::<4>().0.iter().any(|c| c != &color[..4]), "a picture of one colour");
    let mask = frame.mask.unwrap();
    mask.iter().filter(|&&m| m != 0).count() as f64 / mask.len() as f64
}

fn xml_files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|e| e.path());
    let mut files = Vec::new();
    for path in entries {
        if path.is_dir() {
            files.extend(xml_files(&path));
        } else if path.extension().is_some_and(|e| e == "xml") {
            files.push(path);
        }
    }
    files.sort();
    files
}

#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn every_sample_model_of_mujoco_is_drawn() {
    let files = xml_files(&testkit::needs::sample_model(""));
    let mut drawn = 0;
    for path in &files {
        let text = std::fs::read_to_string(path).unwrap();
        if text.contains("<mujocoinclude") {
            continue;
        }
        match Still::of_mjcf(path, None) {
            Ok(still) => {
                let share = seen(&still);
                assert!(share > 0.01, "{}: {share} of the picture", path.display());
                drawn += 1;
            }
            // The samples are of 2.2.2; later lines have dropped some elements.
            Err(error) if mj::TARGET == mj::Target::V4 => println!("not on MuJoCo 4: {}: {error}", path.display()),
            Err(error) => panic!("{}: {error}", path.display()),
        }
    }
    assert!(drawn > files.len() / 3, "{drawn} of {} drawn", files.len());
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_robots_are_drawn_with_their_textures() {
    for (file, textures) in [
        ("anymal_c_simple_description/urdf/anymal.urdf", 17),
        ("rokae_description/urdf/SR5.urdf", 0),
        ("inspire_hand/DFQ_left_hand.urdf", 0),
    ] {
        let path = testkit::needs::robot(file);
        let mut sim = SimulationManager::new(SimulationManagerCfg { ground: None, ..Default::default() }).unwrap();
        sim.add_robot(RobotCfg { urdf: UrdfCfg::single(path), ..Default::default() }).unwrap();
        let still = Still::of_env(&mut sim, EnvId(0)).unwrap();
        let scene = still.visible().scene();
        let mut seen_textures: Vec<_> =
            scene.instances().iter().filter_map(|i| i.material.texture.as_ref()).map(std::sync::Arc::as_ptr).collect();
        seen_textures.sort();
        seen_textures.dedup();
        assert_eq!(seen_textures.len(), textures, "{file}");
        assert!(scene.triangle_count() > 5000, "{file}: {} triangles", scene.triangle_count());
        assert!(seen(&still) > 0.005, "{file}");
    }
}

/// Cameras are those of the file in its order, where the file puts them at the positions given: with ROS's axes, MuJoCo's turned
/// by half a turn about x. A hinge at 0.5 rad about z turns what hangs on it.
#[test]
fn cameras_are_those_of_the_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.xml");
    let text = "<mujoco><worldbody><camera name='fixed' pos='1 2 3' fovy='30'/><body pos='0 0 1'><joint axis='0 0 1'/>\
                <geom size='.1'/><camera pos='0.2 0 0'/></body></worldbody></mujoco>";
    std::fs::write(&path, text).unwrap();
    let still = Still::of_mjcf(&path, Some(&[0.5])).unwrap();
    let names: Vec<&str> = still.cameras().iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["fixed", ""]);
    let [fixed, moved] = still.cameras() else { panic!("{:?}", still.cameras()) };
    assert!((fixed.fovy - 30.0_f64.to_radians()).abs() < 1e-9 && (moved.fovy - 45.0_f64.to_radians()).abs() < 1e-9);
    assert_eq!(still.camera("fixed").unwrap().world_from_camera, fixed.world_from_camera);
    let expected = [
        (fixed, Pose::translation(1.0, 2.0, 3.0), 0.0_f64),
        (moved, Pose::translation(0.2 * 0.5_f64.cos(), 0.2 * 0.5_f64.sin(), 1.0), 0.5),
    ];
    for (camera, at, turn) in expected {
        let pose = camera.world_from_camera;
        assert!((pose.translation.vector - at.translation.vector).norm() < 1e-9, "{pose}");
        // Right is x, down is -y; it looks along -z.
        let axes = [[turn.cos(), turn.sin(), 0.0], [turn.sin(), -turn.cos(), 0.0], [0.0, 0.0, -1.0]];
        for (k, axis) in axes.into_iter().enumerate() {
            let found = pose.rotation * nalgebra::Vector3::ith(k, 1.0);
            assert!((found - nalgebra::Vector3::from(axis)).norm() < 1e-9, "{k}: {found}");
        }
    }
}

/// Wrong positions, missing files and unknown cameras say what is wrong.
#[test]
fn mistakes_are_told() {
    let text = |result: Result<Still>| result.unwrap_err().to_string();
    assert!(text(Still::of_mjcf("no/such.xml", None)).contains("no/such.xml"));
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("model.xml");
    std::fs::write(&path, "<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>").unwrap();
    assert!(text(Still::of_mjcf(&path, Some(&[0.0, 0.0]))).contains("[1]"));
    assert!(text(Still::of_mjcf(&path, Some(&[f64::NAN]))).contains("finite"));
    let still = Still::of_mjcf(&path, Some(&[0.5])).unwrap();
    assert!(still.camera("front").unwrap_err().to_string().contains("there are none"));
    std::fs::write(&path, "<mujoco><worldbody><geom size=").unwrap();
    assert!(Still::of_mjcf(&path, None).is_err());
}
