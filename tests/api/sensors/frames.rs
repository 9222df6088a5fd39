//! Frames seen from frames, against the poses of the links.

use crate::sensors::worlds::{assert_near, cfg, cube};
use kinetoscope::ndarray::{Axis, array};
use kinetoscope::prelude::*;
use nalgebra::UnitQuaternion;

#[test]
fn targets_are_seen_from_the_source_in_the_order_they_were_named() {
    let mut sim = SimulationManager::new(cfg(2)).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let arm = sim.add_robot(RobotCfg { urdf, uid: "arm".into(), ..Default::default() }).unwrap();
    sim.add_rigid_object(cube("cube", 1.0, 0.1, [0.5, 0.4, 0.05])).unwrap();
    let offset = Pose::from_parts([0.1, -0.2, 0.3].into(), UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3));
    let tool = TargetFrameCfg { name: Some("tool".into()), offset, ..TargetFrameCfg::of("ee_link") };
    let targets = vec![TargetFrameCfg::of("cube"), tool, TargetFrameCfg::of("arm/link[23]")];
    let cfg = FrameTransformerCfg { source_offset: offset, ..FrameTransformerCfg::from("link2", targets) };
    let id = sim.add_sensor("frames", cfg).unwrap();
    sim.robot_mut(arm)
        .set_qpos(&array![[0.3, 0.5, -0.4, 0.2, 0.7, -0.1], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]], None, None)
        .unwrap();
    sim.update(50);
    let sensor = sim.sensor(id).unwrap();
    assert_eq!(sensor.target_frame_names(), ["cube", "tool", "arm/link2", "arm/link3"]);
    let text = sensor.to_string();
    assert!(text.contains("arm/link2\n") && text.ends_with("cube, tool, arm/link2, arm/link3"), "{text}");
    let robot = sim.robot(arm);
    let pose = |name: &str, env: usize| {
        let rows = robot.link_pose(name).unwrap();
        kinetoscope::scene::pose::from_row(&std::array::from_fn(|k| rows[(env, k)]))
    };
    for env in 0..2 {
        let source = pose("link2", env) * offset;
        assert_near(sensor.source_pos_w().row(env).to_vec(), source.translation.vector.as_slice(), 1e-12);
        let targets = [(1, pose("ee_link", env) * offset), (2, pose("link2", env)), (3, pose("link3", env))];
        for (m, target) in targets {
            let at = |view: kinetoscope::ndarray::ArrayView3<'_, f64>| {
                view.index_axis(Axis(0), env).index_axis(Axis(0), m).to_vec()
            };
            let seen = source.inverse() * target;
            let wxyz = |q: &UnitQuaternion<f64>| kinetoscope::scene::pose::to_wxyz(q);
            assert_near(at(sensor.target_pos_w()), target.translation.vector.as_slice(), 1e-12);
            assert_near(at(sensor.target_quat_w()), &wxyz(&target.rotation), 1e-12);
            assert_near(at(sensor.target_pos_source()), seen.translation.vector.as_slice(), 1e-12);
            assert_near(at(sensor.target_quat_source()), &wxyz(&seen.rotation), 1e-12);
        }
    }
    assert_ne!(sensor.target_pos_source().index_axis(Axis(0), 0), sensor.target_pos_source().index_axis(Axis(0), 1));
}

#[test]
fn mistakes_name_what_would_be_right() {
    let mut sim = SimulationManager::new(cfg(1)).unwrap();
    sim.add_rigid_object(cube("cube", 1.0, 0.1, [0.0, 0.0, 0.05])).unwrap();
    let mut wrong = |cfg: FrameTransformerCfg| sim.add_sensor("f", cfg).unwrap_err().to_string();
    let text = wrong(FrameTransformerCfg::from("cub", vec![]));
    assert!(text.contains("no body \"cub\"; known are \"cube\""), "{text}");
    let text = wrong(FrameTransformerCfg::from("cube", vec![]));
    assert!(text.contains("measure nothing: targets") && text.contains("\"cube\""), "{text}");
    let text = wrong(FrameTransformerCfg::from("cube", vec![TargetFrameCfg::of("ball")]));
    assert!(text.contains("no body \"ball\"; known are \"cube\""), "{text}");
    let twice = vec![TargetFrameCfg::of("cube"), TargetFrameCfg::of("cube")];
    let text = wrong(FrameTransformerCfg::from("cube", twice));
    assert!(text.contains("two target frames called \"cube\""), "{text}");
}
