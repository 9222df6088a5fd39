//! Rendering of MuJoCo's sample models and the vendor robots; cameras defined in MJCF files.

use super::view;
use kinetoscope::mujoco as mj;
use kinetoscope::prelude::*;
use kinetoscope::render::ImageRenderer;
use kinetoscope::render::frame::Frame;
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::{OffscreenScene, Result};
use kinetoscope_testkit::test_resources::{files_below, sample_model};
use kinetoscope_testkit::urdf::TempFiles;

/// Renders a scene from the free camera of MuJoCo's viewers; returns the share of pixels with an object.
fn covered_share(still: &OffscreenScene) -> f64 {
    let free = still.free_camera();
    let pose = look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0]).unwrap();
    let view = view([64, 48], free.fovy, &pose, free.clip);
    let mut frame = Frame::new(64, 48, Channels { color: true, mask: true, ..Channels::default() });
    ImageRenderer::new(RasterCfg::default()).render_request(&still.render_request(&view), &mut frame.as_mut()).unwrap();
    let color = frame.color.unwrap();
    assert!(color.as_chunks::<4>().0.iter().any(|c| c != &color[..4]), "an image of one color");
    let mask = frame.mask.unwrap();
    mask.iter().filter(|&&m| m != 0).count() as f64 / mask.len() as f64
}

#[test]
#[ignore = "needs MuJoCo's sample models: cargo xtask test"]
fn sample_models() {
    let files = files_below(&sample_model(""), "xml");
    let mut drawn = 0;
    for path in &files {
        if std::fs::read_to_string(path).unwrap().contains("<mujocoinclude") {
            continue;
        }
        match OffscreenScene::of_mjcf(path, None) {
            Ok(still) => {
                let share = covered_share(&still);
                assert!(share > 0.01, "{}: {share} of the image", path.display());
                drawn += 1;
            }
            // The samples are of 2.2.2; later versions have dropped some elements.
            Err(error) if mj::BUILD_VERSION == mj::SupportedVersion::V4 => {
                println!("not on MuJoCo 4: {}: {error}", path.display())
            }
            Err(error) => panic!("{}: {error}", path.display()),
        }
    }
    assert!(drawn > files.len() / 3, "{drawn} of {} drawn", files.len());
}

#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn vendor_robots() {
    for (file, textures) in [
        ("anymal_c_simple_description/urdf/anymal.urdf", 17),
        ("rokae_description/urdf/SR5.urdf", 0),
        ("inspire_hand/DFQ_left_hand.urdf", 0),
    ] {
        let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { ground: None, ..Default::default() });
        sim.add_robot(kinetoscope_testkit::worlds::urdf_robot(
            "robot",
            kinetoscope_testkit::test_resources::robot(file),
        ))
        .unwrap();
        let still = OffscreenScene::of_env(&mut sim, EnvId(0)).unwrap();
        let scene = still.visible().scene();
        let textures_of = scene.instances().iter().filter_map(|i| i.material.texture.as_ref());
        let distinct: std::collections::BTreeSet<_> = textures_of.map(std::sync::Arc::as_ptr).collect();
        assert_eq!(distinct.len(), textures, "{file}");
        assert!(scene.triangle_count() > 5000, "{file}: {} triangles", scene.triangle_count());
        assert!(covered_share(&still) > 0.005, "{file}");
    }
}

/// Cameras keep the order and the poses of the file at the given joint positions. Their axes follow ROS: MuJoCo's
/// camera axes, rotated by half a turn about x. A hinge at 0.5 rad about z rotates its camera.
#[test]
fn cameras_of_a_file() {
    let files = TempFiles::default();
    let text = "<mujoco><worldbody><camera name='fixed' pos='1 2 3' fovy='30'/><body pos='0 0 1'><joint axis='0 0 1'/>\
                <geom size='.1'/><camera pos='0.2 0 0'/></body></worldbody></mujoco>";
    let still = OffscreenScene::of_mjcf(files.write("model.xml", text), Some(&[0.5])).unwrap();
    let names: Vec<&str> = still.cameras().iter().map(|camera| camera.name.as_str()).collect();
    assert_eq!(names, ["fixed", ""]);
    let [fixed, moved] = still.cameras() else { panic!("{:?}", still.cameras()) };
    assert!((fixed.fovy - 30.0_f64.to_radians()).abs() < 1e-9 && (moved.fovy - 45.0_f64.to_radians()).abs() < 1e-9);
    assert_eq!(still.camera("fixed").unwrap().world_from_camera, fixed.world_from_camera);
    let (sin, cos) = 0.5_f64.sin_cos();
    for (camera, at, turn) in [(fixed, [1.0, 2.0, 3.0], 0.0_f64), (moved, [0.2 * cos, 0.2 * sin, 1.0], 0.5)] {
        let pose = camera.world_from_camera;
        assert!((pose.translation.vector - nalgebra::Vector3::from(at)).norm() < 1e-9, "{pose}");
        // Right is x, down is -y; the camera looks along -z.
        let axes = [[turn.cos(), turn.sin(), 0.0], [turn.sin(), -turn.cos(), 0.0], [0.0, 0.0, -1.0]];
        for (k, axis) in axes.into_iter().enumerate() {
            let found = pose.rotation * nalgebra::Vector3::ith(k, 1.0);
            assert!((found - nalgebra::Vector3::from(axis)).norm() < 1e-9, "{k}: {found}");
        }
    }
}

#[test]
fn refused() {
    let text = |result: Result<OffscreenScene>| result.unwrap_err().to_string();
    assert!(text(OffscreenScene::of_mjcf("no/such.xml", None)).contains("no/such.xml"));
    let files = TempFiles::default();
    let model = "<mujoco><worldbody><body><joint/><geom size='.1'/></body></worldbody></mujoco>";
    let path = files.write("model.xml", model);
    assert!(text(OffscreenScene::of_mjcf(&path, Some(&[0.0, 0.0]))).contains("[1]"));
    assert!(text(OffscreenScene::of_mjcf(&path, Some(&[f64::NAN]))).contains("finite"));
    let still = OffscreenScene::of_mjcf(&path, Some(&[0.5])).unwrap();
    assert!(still.camera("front").unwrap_err().to_string().contains("no names are defined"));
    assert!(OffscreenScene::of_mjcf(files.write("broken.xml", "<mujoco><worldbody><geom size="), None).is_err());
}
