//! Frame transformers, against the poses of the links; and handles of sensors.

use super::worlds::{cube, pose_of_row, sim, sr5};
use kinetoscope::ndarray::{ArrayView3, Axis, array};
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::to_wxyz;
use kinetoscope::sensors::{FrameTransformerCfg, JointState, JointStateCfg, TargetFrameCfg};
use kinetoscope_testkit::tolerance::{Tolerance, assert_close};
use nalgebra::UnitQuaternion;

const EXACT: Tolerance = Tolerance::absolute(1e-12, "rounding of a product of a few transforms of size 1");

/// Targets are in the order of the configuration.
#[test]
fn targets_from_the_source() {
    let mut sim = sim(2);
    let arm = sim.add_robot(sr5("arm")).unwrap();
    sim.add_rigid_object(cube("cube", 0.1, 1.0, [0.5, 0.4, 0.05])).unwrap();
    let offset = Pose::from_parts([0.1, -0.2, 0.3].into(), UnitQuaternion::from_euler_angles(0.1, 0.2, 0.3));
    let tool = TargetFrameCfg { name: Some("tool".into()), offset, ..TargetFrameCfg::for_bodies("ee_link") };
    let targets = vec![TargetFrameCfg::for_bodies("cube"), tool, TargetFrameCfg::for_bodies("arm/link[23]")];
    let cfg = FrameTransformerCfg { source_offset: offset, ..FrameTransformerCfg::new("link2", targets.clone()) };
    let id = sim.add_sensor("frames", cfg).unwrap();
    let bare = sim.add_sensor("bare", FrameTransformerCfg::new("link3", targets)).unwrap();
    let qpos = array![[0.3, 0.5, -0.4, 0.2, 0.7, -0.1], [0.0, 0.0, 0.0, 0.0, 0.0, 0.0]];
    sim.robot_mut(arm).set_qpos_target(&qpos, None, None).unwrap();
    sim.update(50);
    let (sensor, bare) = (sim.sensor(id).unwrap(), sim.sensor(bare).unwrap());
    assert_eq!(sensor.target_frame_names(), ["cube", "tool", "arm/link2", "arm/link3"]);
    let text = sensor.to_string();
    assert!(text.contains("arm/link2\n") && text.ends_with("cube, tool, arm/link2, arm/link3"), "{text}");
    let link = |name: &str, env: usize| pose_of_row(&sim.robot(arm).link_pose(name).unwrap(), env);
    for env in 0..2 {
        // Both come from MuJoCo's body quaternion, with one sign.
        let found: Vec<f64> =
            bare.source_pos_w().row(env).into_iter().chain(bare.source_quat_w().row(env)).copied().collect();
        let link3 = sim.robot(arm).link_pose("link3").unwrap();
        assert_close("pose of the source", &found, link3.row(env), EXACT);
        let source = link("link2", env) * offset;
        let at = source.translation.vector;
        assert_close("position of the source", sensor.source_pos_w().row(env), at.as_slice(), EXACT);
        for (m, target) in [(1, link("ee_link", env) * offset), (2, link("link2", env)), (3, link("link3", env))] {
            let seen = source.inverse() * target;
            let check = |view: ArrayView3<'_, f64>, expected: &[f64]| {
                assert_close("target", view.index_axis(Axis(0), env).row(m), expected, EXACT);
            };
            check(sensor.target_pos_w(), target.translation.vector.as_slice());
            check(sensor.target_quat_w(), &to_wxyz(&target.rotation));
            check(sensor.target_pos_source(), seen.translation.vector.as_slice());
            check(sensor.target_quat_source(), &to_wxyz(&seen.rotation));
        }
    }
    assert!(bare.source_quat_w()[(0, 0)] < 0.9999, "it has turned");
    assert_ne!(sensor.target_pos_source().index_axis(Axis(0), 0), sensor.target_pos_source().index_axis(Axis(0), 1));
}

/// A handle of one manager is not valid in another manager, even if a sensor of the same type has the same index there.
#[test]
fn handles_of_another_manager() {
    let [mut sim, mut other] = [sim(1), sim(1)];
    let ids = [&mut sim, &mut other].map(|sim| {
        sim.add_robot(sr5("arm")).unwrap();
        sim.add_sensor("joints", JointStateCfg::default()).unwrap()
    });
    let [id, own] = ids;
    assert!(sim.sensor(id).is_ok() && sim.sensor_mut(id).is_ok() && sim.scene().debug_vis(id).is_ok());
    assert!(other.sensor(own).is_ok(), "the control");
    let uses: [fn(&mut SimulationManager, SensorId<JointState>) -> bool; 4] = [
        |sim, id| sim.sensor(id).is_ok(),
        |sim, id| sim.sensor_mut(id).is_ok(),
        |sim, id| sim.scene().debug_vis(id).is_ok(),
        |sim, id| sim.scene_mut().set_debug_vis(id, true).is_ok(),
    ];
    for act in uses {
        let panic = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| act(&mut other, id))).unwrap_err();
        assert_eq!(*panic.downcast::<&str>().unwrap(), "this handle belongs to another SimulationManager");
    }
}
