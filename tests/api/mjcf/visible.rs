//! Parts in camera images and contact sensors.

use super::*;
use kinetoscope::mujoco as mj;
use kinetoscope::ndarray::{Array2, Axis};
use kinetoscope::scene::pose::from_wxyz;
use kinetoscope::scene::{Material, Pose};
use kinetoscope::sim::VisualScene;
use kinetoscope_testkit::worlds::{cube, sr5};

/// A textured, lit world with a mesh, a height field and a cube texture.
const TEXTURED_WORLD: &str = include_str!("../../data/mjcf/looks.xml");

/// A part is rendered like the file alone.
#[test]
fn rendered_like_the_file() {
    let file = VisualScene::of_model(&alone(TEXTURED_WORLD));
    let mut sim = empty(1);
    sim.add_mjcf(MjcfPartCfg { semantic_class: Some("toy".into()), ..MjcfPartCfg::text("looks", TEXTURED_WORLD) })
        .unwrap();
    let part = sim.scene_mut().visual_scene();
    assert_eq!(part.omitted(), [""; 0]);
    let (here, there) = (part.scene().instances(), file.scene().instances());
    assert_eq!(here.len(), there.len());
    for (a, b) in here.iter().zip(there) {
        // The same image; MuJoCo averages mip levels in display colors, a simulation in linear light.
        let image = |material: &Material| material.texture.as_ref().map(|image| image.mip_levels()[0].clone());
        assert!(image(&a.material) == image(&b.material), "{}", a.name);
        let untextured = |material: &Material| Material { texture: None, ..material.clone() };
        assert_eq!((untextured(&a.material), a.fixed), (untextured(&b.material), b.fixed));
    }
    assert!(here.iter().filter(|i| i.material.texture.is_some()).count() == 2);
    assert_eq!(part.scene().lights.len(), 1);
    let ids = sim.scene().mask_ids();
    let names: Vec<_> = ids.iter().map(|id| (id.object.as_str(), id.link.as_deref(), id.class.as_str())).collect();
    assert_eq!(names, [("looks", None, "toy"), ("looks", Some("thing"), "toy")]);
    let names: Vec<&str> = here.iter().map(|i| i.name.as_ref()).collect();
    assert_eq!(names, ["looks", "looks", "looks/thing", "looks/thing"]);

    // The plane is 2 m below a camera that looks straight down.
    let placement = Placement::Pose { pos: [-1.0, -1.0, 2.0], rotation: from_wxyz([0.0, 0.0, 1.0, 0.0]) };
    let camera = CameraCfg {
        width: 9,
        height: 9,
        extrinsics: Extrinsics { placement, ..Default::default() },
        channels: Channels::from_names(&["depth", "mask"]).unwrap(),
        ..Default::default()
    };
    let camera = sim.add_sensor("camera", camera).unwrap();
    let seen = sim.sensor(camera).unwrap();
    assert!((f64::from(seen.depth().unwrap()[(0, 4, 4)]) - 2.0).abs() < 1e-6);
    assert_eq!(seen.mask().unwrap()[(0, 4, 4)], sim.scene().mask_ids()[0].id);
}

/// A weight on a tendon from a hook.
const WINCH: &str = r#"<mujoco><worldbody><site name="hook" pos="0 0 1"/>
    <body name="weight" pos="0 0 0.6"><joint name="lift" type="slide" axis="0 0 1"/><geom size="0.05" mass="1"/>
      <site name="eye"/></body></worldbody>
  <tendon><spatial name="string" width="0.01" rgba="1 0 0 1"><site site="hook"/><site site="eye"/></spatial></tendon>
  <actuator><position joint="lift" kp="100"/></actuator></mujoco>"#;

/// A tendon is rendered as a vertical bar between its ends in every environment, independent of the other environments.
/// Depth, mask and visible height match the closed form for every renderer, with the same bits for any number of
/// threads and environments. Ray casters pass through tendons.
///
/// Regression: cameras rendered only geoms.
#[test]
fn tendons() {
    let images = |num_envs: usize, threads: usize, renderer: Renderer| {
        let mut sim = sim(SimulationManagerCfg { physics_dt: 0.002, threads: Some(threads), ..empty_cfg(num_envs) });
        let part = sim.add_mjcf(MjcfPartCfg::text("winch", WINCH)).unwrap();
        // The next entity has ids after those of the part's tendon.
        sim.add_rigid_object(cube("cube", 0.1, 1.0, [0.0, 3.0, 0.0])).unwrap();
        let placement = Placement::LookAt { eye: [1.0, 0.0, 0.8], target: [0.0, 0.0, 0.8], up: [0.0, 0.0, 1.0] };
        let camera = CameraCfg {
            width: 81,
            height: 81,
            intrinsics: Intrinsics::Pixels { fx: 80.0, fy: 80.0, cx: 40.5, cy: 40.5 },
            extrinsics: Extrinsics { placement, ..Default::default() },
            channels: Channels::from_names(&["rgb", "depth", "mask"]).unwrap(),
            renderer,
            ..Default::default()
        };
        let camera = sim.add_sensor("camera", camera).unwrap();
        let pattern = kinetoscope::sensors::ray::pattern::Grid {
            resolution: 0.01,
            size: [0.0, 0.0],
            direction: [-1.0, 0.0, 0.0],
            ..Default::default()
        };
        let offset = Pose::translation(1.0, 0.0, 0.8);
        let ray = RayCasterCfg { offset, pattern: pattern.into(), ..RayCasterCfg::default() };
        let ray = sim.add_sensor("ray", ray).unwrap();
        let heights = Array2::from_shape_fn((num_envs, 1), |(env, _)| 0.05 * env as f64);
        sim.mjcf_part_mut(part).write_qpos(&heights, None).unwrap();
        sim.update(1);
        let id = sim.scene().mask_ids().iter().find(|id| id.link.as_deref() == Some("string")).cloned().unwrap();
        assert_eq!((id.name().as_str(), id.class.as_str()), ("winch/string", "mjcf"));
        assert_eq!(
            sim.scene().mask_ids().iter().filter(|other| other.id == id.id).count(),
            1,
            "{:?}",
            sim.scene().mask_ids()
        );
        let lowest: Vec<f64> = (0..num_envs).map(|env| 0.6 + sim.mjcf_part(part).qpos()[(env, 0)]).collect();
        let seen = sim.sensor(camera).unwrap();
        assert!(!sim.sensor(ray).unwrap().hit_mask().iter().any(|hit| *hit), "rays pass");
        let (depth, mask) = (seen.depth().unwrap().to_owned(), seen.mask().unwrap().to_owned());
        (depth, mask, seen.color().unwrap().to_owned(), id.id, lowest)
    };
    for renderer in [Renderer::Raster, Renderer::FastRayTraced] {
        let (depth, mask, color, id, lowest) = images(3, 1, renderer);
        for (env, low) in lowest.iter().enumerate() {
            // The surface is closer by the radius.
            let at = (env, 40, 40);
            assert!((f64::from(depth[at]) - 0.99).abs() < 1e-4 && mask[at] == id, "{renderer:?}: {}", depth[at]);
            // Up to the hook at z = 1, 0.2 above the middle, and down to the ball.
            let rows =
                |wanted: &dyn Fn(i32) -> bool| (0..81).filter(|row| wanted(mask[(env, *row, 40)])).count() as f64;
            // The ball hides the tendon from 0.05 above the site `eye`; its outline is slightly above that.
            let expected = 80.0 * (1.01 - (low + 0.05)) / 0.99;
            let found = rows(&|m| m == id);
            assert!((found - expected).abs() < 2.5, "{renderer:?}, environment {env}: {found} rows, not {expected}");
        }
        // Controls: environments differ; threads and batches do not.
        assert!(mask.index_axis(Axis(0), 0) != mask.index_axis(Axis(0), 2));
        let other = images(3, 3, renderer);
        assert_eq!((&other.0, &other.1, &other.2), (&depth, &mask, &color));
        let two = images(2, 1, renderer);
        assert_eq!(two.2.index_axis(Axis(0), 1), color.index_axis(Axis(0), 1));
    }
}

/// A robot collides with a part's body according to MuJoCo's default bits: a ball falls on the arm, and a ball without
/// the lowest bit falls past the arm. The arm's own bit is the second one.
#[test]
fn collisions_with_robots() {
    for (contype, expected) in [(1, true), (2, false)] {
        let mut sim = sim(SimulationManagerCfg { physics_dt: 0.002, ..Default::default() });
        let robot = sim.add_robot(sr5("sr5")).unwrap();
        let tip = sim.robot(robot).link_pose("ee_link").unwrap();
        let [x, y, z] = [0, 1, 2].map(|k| tip[(0, k)]);
        let ball = format!(
            r#"<mujoco><worldbody><body name="ball" pos="{x} {y} {}"><freejoint/>
            <geom size="0.1" contype="{contype}" mass="0.1"/></body></worldbody></mujoco>"#,
            z + 0.4
        );
        sim.add_mjcf(MjcfPartCfg::text("part", ball)).unwrap();
        let cfg =
            ContactSensorCfg { bodies: vec!["part/ball".into()], filters: vec!["sr5/.*".into()], ..Default::default() };
        let id = sim.add_sensor("contact", cfg).unwrap();
        let mut touched = false;
        for _ in 0..400 {
            sim.update(1);
            touched |= sim.sensor(id).unwrap().force_matrix_w().iter().any(|f| *f > 0.0);
        }
        assert_eq!(touched, expected, "contype {contype}");
    }
}

/// A contact sensor on a part's body reads the weight of a block, on the part's world and on the scene's ground. The
/// block of 2 kg carries 1 kg: the forces of ground and cube sum to the block's weight.
#[test]
fn contacts() {
    let block = r#"<mujoco><worldbody><body name="block" pos="0 0 0.1"><freejoint/>
        <geom type="box" size="0.1 0.1 0.1" mass="2"/></body></worldbody></mujoco>"#;
    let with_floor = block.replace("<worldbody>", "<worldbody><geom type=\"plane\" size=\"1 1 1\"/>");
    for (text, ground) in [(block.to_string(), Some(GroundCfg::default())), (with_floor, None)] {
        let mut sim = sim(SimulationManagerCfg { ground, physics_dt: 0.002, ..Default::default() });
        sim.add_mjcf(MjcfPartCfg::text("part", &text)).unwrap();
        sim.add_rigid_object(cube("cube", 0.1, 1.0, [0.0, 0.0, 0.25])).unwrap();
        let id = sim.add_sensor("contact", ContactSensorCfg::for_bodies("part/block")).unwrap();
        sim.update(1000);
        let force = sim.sensor(id).unwrap().net_forces_w();
        assert!((force[(0, 0, 2)] - 2.0 * 9.81).abs() < 1e-3, "{force}");
    }
}

/// MuJoCo 4 supports metallic materials: they are rendered, and survive the writing of the part into the scene. 2.2.2
/// does not support them.
#[test]
fn metals() {
    let textured = |more: &str| {
        let text = format!(
            r#"<mujoco><asset><material name="steel" rgba="0.6 0.6 0.6 1" {more}/></asset><worldbody>
               <body name="ball"><freejoint/><geom size="0.1" material="steel"/></body></worldbody></mujoco>"#
        );
        let mut sim = empty(1);
        sim.add_mjcf(MjcfPartCfg::text("ball", text)).map(|_| {
            let material = sim.scene_mut().visual_scene().scene().instances()[0].material.clone();
            (material.metallic, material.roughness)
        })
    };
    assert_eq!(textured("").unwrap(), (0.0, None));
    match textured(r#"metallic="0.75" roughness="0.25""#) {
        Ok(metal) => assert_eq!(metal, (0.75, Some(0.25))),
        Err(error) => {
            assert!(mj::version_string().starts_with("2.") && error.to_string().contains("metallic"), "{error}")
        }
    }
}
