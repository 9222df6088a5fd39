//! A part in motion goes on as if nothing was added.

use super::{empty, machine};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;

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
