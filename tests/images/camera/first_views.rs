//! Initial camera views: the scene fills the image and nothing is cut off, checked pixel by pixel on the mask channel.

use super::view;
use kinetoscope::prelude::*;
use kinetoscope::render::ImageRenderer;
use kinetoscope::render::View;
use kinetoscope::render::frame::Frame;
use kinetoscope::sensors::camera::look_at_pose;
use kinetoscope::sim::{FreeCamera, OffscreenScene};
use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::worlds::{sr5, text_robot, urdf_robot};

/// The width and height of the bounding box of all objects but the ground, as shares of the image; and true if the box
/// touches the border.
fn bounding_box_share(still: &OffscreenScene, view: &View) -> ([f64; 2], bool) {
    let [width, height] = [view.width, view.height];
    let mut frame = Frame::new(width, height, Channels { mask: true, ..Channels::NONE });
    ImageRenderer::new(RasterCfg::default()).render_request(&still.render_request(view), &mut frame.as_mut()).unwrap();
    let ground = still.mask_ids().iter().find(|id| id.class == "ground").map_or(0, |id| id.id);
    let mask = frame.mask.unwrap();
    let seen =
        mask.iter().enumerate().filter(|(_, id)| **id != 0 && **id != ground).map(|(k, _)| [k % width, k / width]);
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for at in seen {
        (0..2).for_each(|k| (low[k], high[k]) = (low[k].min(at[k]), high[k].max(at[k])));
    }
    if low[0] > high[0] {
        return ([0.0; 2], false);
    }
    let size = [width, height];
    let cut = (0..2).any(|k| low[k] == 0 || high[k] + 1 == size[k]);
    ([0, 1].map(|k| (high[k] + 1 - low[k]) as f64 / size[k] as f64), cut)
}

fn view_of(size: [usize; 2], free: FreeCamera) -> View {
    view(size, free.fovy, &look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0]).unwrap(), free.clip)
}

/// A body with a visual mesh and no collision shape: MuJoCo's model represents it by a ball of a millimeter.
fn mesh_alone(files: &TempFiles) -> RobotCfg {
    files.write("mesh.obj", "v 0 0 0\nv 2 0 0\nv 0 2 0\nv 0 0 2\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
    let text = r#"<robot name="r"><link name="a"><visual><geometry><mesh filename="mesh.obj"/></geometry></visual></link></robot>"#;
    text_robot(files, "robot", text)
}

/// Regression: the first view used MuJoCo's model extent, which ignores a URDF's visual meshes and the aspect ratio of
/// the image. The view of windows was fitted to centers of mass: an arm had a quarter of the height, and robots in
/// front were cut off.
#[test]
fn fill_the_image() {
    let files = TempFiles::default();
    let asset = |file| urdf_robot("robot", assets::path(file).unwrap());
    let robots = [
        ("arm", sr5("robot"), 1),
        ("quadruped", RobotCfg { fix_base: false, ..asset("quadruped/quadruped.urdf") }, 1),
        ("hand", asset("revo1_left/revo1_left.urdf"), 1),
        ("mesh", mesh_alone(&files), 1),
        ("16 arms", sr5("robot"), 16),
    ];
    for (name, robot, num_envs) in robots {
        for ground in [None, Some(GroundCfg::default())] {
            let cfg = SimulationManagerCfg { num_envs, ground, ..Default::default() };
            let mut sim = kinetoscope_testkit::worlds::sim(cfg);
            // Objects below the ground would be hidden.
            sim.add_robot(RobotCfg { ground_clearance: Some(0.0), ..robot.clone() }).unwrap();
            let still = OffscreenScene::overview(&mut sim, None, &[]).unwrap();
            for size in [[320, 180], [120, 160], [200, 50]] {
                let views = [view_of(size, still.first_view(size)), sim.overview_camera(size).view(size[0], size[1])];
                for view in views {
                    let (shares, cut) = bounding_box_share(&still, &view);
                    let share = f64::max(shares[0], shares[1]);
                    assert!((0.6..=0.95).contains(&share) && !cut, "{name} at {size:?}: {shares:?}, cut off: {cut}");
                }
            }
            // Control: at twice the distance the scene is too small.
            let near = still.first_view([320, 180]);
            let eye = [0, 1, 2].map(|k| 2.0 * near.eye[k] - near.target[k]);
            let (shares, _) = bounding_box_share(&still, &view_of([320, 180], FreeCamera { eye, ..near }));
            assert!(f64::max(shares[0], shares[1]) < 0.6, "{name}: {shares:?}");
        }
    }
}

/// The view of an MJCF file keeps the azimuth and elevation of the file, and ignores the floor and the surrounding
/// walls.
#[test]
fn of_mjcf() {
    let files = TempFiles::default();
    let text = r#"<mujoco><visual><global azimuth="30" elevation="-20"/></visual><worldbody>
      <geom type="plane" size="0 0 1"/><geom type="box" size="20 0.1 5" pos="0 30 5"/>
      <geom type="box" size="0.5 0.5 0.2" pos="0 0 0.2"/>
      <body pos="0 0 0.7"><joint axis="0 1 0"/><geom type="box" size="0.5 0.2 0.3" mass="1"/></body></worldbody></mujoco>"#;
    let still = OffscreenScene::of_mjcf(files.write("room.xml", text), None).unwrap();
    let free = still.first_view([160, 120]);
    let way: Vec<f64> = (0..3).map(|k| free.target[k] - free.eye[k]).collect();
    let (azimuth, elevation) = (way[1].atan2(way[0]).to_degrees(), way[2].atan2(way[0].hypot(way[1])).to_degrees());
    assert!((azimuth - 30.0).abs() < 1e-6 && (elevation + 20.0).abs() < 1e-6, "{azimuth} {elevation}");
    let distance = way.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!((1.5..5.0).contains(&distance), "{distance} m from a table of 1 m");
}
