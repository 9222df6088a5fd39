//! The robots that are exported: the bundled ones, and those of vendors where they are present.

use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;
use testkit::needs::robot;

fn arm_and_hand(uid: &str, arm: PathBuf, hand: PathBuf) -> RobotCfg {
    let hand = ComponentCfg {
        transform: from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]),
        ..ComponentCfg::new("hand", hand)
    };
    RobotCfg {
        uid: uid.into(),
        urdf: UrdfCfg { components: vec![ComponentCfg::new("arm", arm), hand], ..Default::default() },
        ..Default::default()
    }
}

/// The bundled arm with the bundled hand.
pub(crate) fn bundled() -> RobotCfg {
    let asset = |name: &str| assets::path(name).unwrap();
    arm_and_hand("sr5", asset("sr5/SR5.urdf"), asset("revo1_left/revo1_left.urdf"))
}

/// The bundled hand alone, on a base that moves.
pub(crate) fn bundled_hand() -> RobotCfg {
    RobotCfg {
        uid: "hand".into(),
        urdf: UrdfCfg::single(assets::path("revo1_left/revo1_left.urdf").unwrap()),
        fix_base: false,
        self_collision: true,
        init_pose: from_xyz_rpy([0.1, 0.2, 0.5], [0.3, 0.2, 0.1]),
        ..Default::default()
    }
}

/// The vendor's arm with the vendor's hand.
pub(crate) fn vendor_arm_and_hand() -> RobotCfg {
    arm_and_hand("inspire", robot("rokae_description/urdf/SR5.urdf"), robot("inspire_hand/DFQ_left_hand.urdf"))
}

/// ANYmal C, free in space.
pub(crate) fn anymal() -> RobotCfg {
    RobotCfg {
        uid: "anymal".into(),
        urdf: UrdfCfg::single(robot("anymal_c_simple_description/urdf/anymal.urdf")),
        fix_base: false,
        init_pose: from_xyz_rpy([0.0, 0.0, 0.6], [0.0; 3]),
        ..Default::default()
    }
}

/// All robots.
pub(crate) fn all() -> Vec<RobotCfg> {
    vec![bundled(), bundled_hand(), vendor_arm_and_hand(), anymal()]
}

/// A simulation of one robot.
pub(crate) fn simulation(robot: RobotCfg) -> (SimulationManager, RobotId) {
    let cfg = SimulationManagerCfg { threads: Some(1), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}
