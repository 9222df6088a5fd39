//! The same problem has the same solution, bit by bit, in any environment, batch and order; roots that move are seen.

use crate::kinematics::robots::*;
use kinetoscope::ndarray::{Array2, Axis, array};
use kinetoscope::prelude::*;

#[test]
fn a_solution_does_not_depend_on_the_batch() {
    let (sim, id) = simulation(8, seven_axes());
    let robot = sim.robot(id);
    let targets = robot.compute_fk(&random_qpos(&sim, id, 8, 51), "arm", None).unwrap();
    let cfg = IkCfg { posture: Some(Posture::at([0.1; 7])), ..Default::default() };
    let whole = robot.compute_ik(&targets, "arm", &cfg, None, None).unwrap();
    assert_eq!(whole, robot.compute_ik(&targets, "arm", &cfg, None, None).unwrap());
    let order = [5, 0, 7, 3];
    let ids = order.map(EnvId);
    let some = robot.compute_ik(&targets.select(Axis(0), &order), "arm", &cfg, None, Some(&ids)).unwrap();
    for (k, &env) in order.iter().enumerate() {
        assert_eq!(some.qpos.row(k), whole.qpos.row(env));
        assert_eq!(some.position_error[k].to_bits(), whole.position_error[env].to_bits());
        // Another environment, the only one of its simulation, and a typed pose.
        let (alone, id) = simulation(1, seven_axes());
        let target = [pose(targets.row(env))];
        let one = alone.robot(id).compute_ik(&target, "arm", &cfg, None, None).unwrap();
        assert_eq!(
            (one.qpos.row(0), one.seed[0], one.iterations[0]),
            (whole.qpos.row(env), whole.seed[env], whole.iterations[env])
        );
    }
    // Another seed gives other starts to those that need them.
    let other = robot.compute_ik(&targets, "arm", &IkCfg { seed: 1, ..cfg }, None, None).unwrap();
    let differ = (0..8).filter(|&env| other.qpos.row(env) != whole.qpos.row(env)).count();
    let needed = (0..8).filter(|&env| whole.seed[env] > 0).count();
    assert!(needed > 0 && differ <= needed && differ > 0, "{differ} of {needed}");
}

/// One target for all environments, each of which has its root elsewhere: the hand is at the same place in every one.
#[test]
fn roots_that_moved_are_seen() {
    let (mut sim, id) = simulation(3, RobotCfg { fix_base: false, ..seven_axes() });
    let target =
        sim.robot(id).compute_fk(&array![[0.3, -0.5, 0.2, -2.0, 0.1, 1.7, 0.5]], "arm", Some(&[EnvId(0)])).unwrap();
    let roots = array![
        [0.1, 0.0, 0.05, 1.0, 0.0, 0.0, 0.0],
        [-0.1, 0.1, 0.0, 0.98, 0.0, 0.0, 0.2],
        [0.0, 0.0, -0.1, 0.99, 0.1, 0.0, 0.0]
    ];
    sim.robot_mut(id).write_root_pose(&roots, None).unwrap();
    let found = sim.robot(id).compute_ik(&target, "arm", &IkCfg::default(), None, None).unwrap();
    assert!(found.success.iter().all(|success| *success), "{found:?}");
    assert!(found.qpos.row(0) != found.qpos.row(1));
    sim.robot_mut(id).write_qpos(&found.qpos, None, None).unwrap();
    let all = Array2::from_shape_fn((3, 7), |(_, k)| target[(0, k)]);
    let (far, turned) = apart(&sim.robot(id).link_pose("link8").unwrap(), &all);
    assert!(far <= 1e-4 && turned <= 1e-3, "{far} {turned}");
    // The control: what is right for one root is wrong for another.
    let first = found.qpos.select(Axis(0), &[0, 0, 0]);
    sim.robot_mut(id).write_qpos(&first, None, None).unwrap();
    assert!(apart(&sim.robot(id).link_pose("link8").unwrap(), &all).0 > 0.05);
}

/// The state does not change, whatever is computed.
#[test]
fn nothing_is_written() {
    let (mut sim, id) = simulation(2, sr5());
    sim.update(3);
    let before = (sim.robot(id).get_qpos(), sim.robot(id).get_qvel(), sim.robot(id).get_target_qpos());
    let targets = sim.robot(id).compute_fk(&random_qpos(&sim, id, 2, 6), "arm", None).unwrap();
    assert!(sim.robot(id).compute_ik(&targets, "arm", &IkCfg::default(), None, None).unwrap().success[1]);
    sim.robot(id).jacobian("arm", None, None).unwrap();
    assert_eq!(before, (sim.robot(id).get_qpos(), sim.robot(id).get_qvel(), sim.robot(id).get_target_qpos()));
}
