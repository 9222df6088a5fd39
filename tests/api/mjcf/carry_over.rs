//! A part in motion goes on as if nothing was added.

use super::{empty, machine};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;

/// A robot with implicit drives moves beside a part as it does alone: its rows are found among the part's equalities and
/// friction.
#[test]
fn drives_of_robots_act_beside_parts() {
    let run = |with_part: bool| {
        let mut sim = empty(1);
        let part = with_part.then(|| sim.add_mjcf(MjcfCfg::text("a", machine())).unwrap());
        let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
        let far = Pose::translation(5.0, 0.0, 0.0);
        let robot = sim.add_robot(RobotCfg { urdf, init_pose: far, ..Default::default() }).unwrap();
        sim.robot_mut(robot).set_qpos(&array![[0.1, 0.4, -0.9, 0.2, -0.5, 0.3]], None, None).unwrap();
        if with_part {
            sim.add_mjcf(MjcfCfg { init_pose: Pose::translation(0.0, 3.0, 0.0), ..MjcfCfg::text("b", machine()) })
                .unwrap();
        }
        sim.update(250);
        assert!(sim.diverged().is_empty());
        let read = sim.robot(robot);
        (read.get_qpos(), read.get_qf(), part.map(|part| sim.mjcf_part(part).get_qpos()))
    };
    let ((alone, efforts, _), (beside, efforts_beside, _)) = (run(false), run(true));
    // The solver stops at a residual of 1e-8 of the whole scene, which is another one.
    assert!((&alone - &beside).iter().all(|d| d.abs() < 1e-6), "{alone} {beside}");
    assert!((&efforts - &efforts_beside).iter().all(|d| d.abs() < 1e-3), "{efforts} {efforts_beside}");
    assert!(efforts.iter().any(|effort| effort.abs() > 1.0) && alone.iter().any(|q| q.abs() > 0.3));
}

#[test]
fn a_part_in_motion_is_bit_equal_after_more_was_added() {
    let mut sim = empty(2);
    let part = sim.add_mjcf(MjcfCfg::text("m", machine())).unwrap();
    sim.mjcf_part_mut(part).set_ctrl(&array![[0.4, -0.3, 0.8], [0.1, 0.2, 0.3]], None, None).unwrap();
    sim.update(50);
    let act = |sim: &SimulationManager| -> Vec<f64> {
        (0..2).map(|env| sim.batch().read(env, |env| env.data().act()[0])).collect()
    };
    let state = |sim: &SimulationManager| {
        let part = sim.mjcf_part(part);
        (part.get_qpos(), part.get_qvel(), part.get_ctrl(), sim.time())
    };
    let (before, activations) = (state(&sim), act(&sim));
    assert!(activations[0] != activations[1] && activations[0] > 0.0);
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    let far = Pose::translation(5.0, 0.0, 0.0);
    sim.add_robot(RobotCfg { urdf, init_pose: far, ..Default::default() }).unwrap();
    let stateless = r#"<mujoco><worldbody><body pos="9 0 1"><joint name="j"/><geom size="0.1"/></body></worldbody>
        <actuator><motor joint="j"/></actuator></mujoco>"#;
    sim.add_mjcf(MjcfCfg::text("late", stateless)).unwrap();
    assert_eq!(state(&sim), before);
    // On 2.2.2 actuators with an activation stand behind those of the later part.
    assert_eq!(act(&sim), activations);
    sim.update(10);
    assert!(sim.diverged().is_empty());
    assert_ne!(state(&sim).0, before.0);
}
