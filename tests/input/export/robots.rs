//! Robots for the export tests: the bundled ones, and those of vendors.

use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope_testkit::test_resources::robot;
use kinetoscope_testkit::worlds::urdf_robot;
use std::f64::consts::FRAC_PI_2;
use std::path::PathBuf;

fn arm_and_hand(uid: &str, arm: PathBuf, hand: PathBuf) -> RobotCfg {
    let transform = from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]);
    let hand = ComponentCfg { transform, ..ComponentCfg::new("hand", hand) };
    let urdf = UrdfCfg { components: vec![ComponentCfg::new("arm", arm), hand], ..Default::default() };
    RobotCfg { uid: uid.into(), urdf, ..Default::default() }
}

/// The bundled arm with the bundled hand.
pub(crate) fn bundled() -> RobotCfg {
    let asset = |name: &str| assets::path(name).unwrap();
    arm_and_hand("sr5", asset("sr5/SR5.urdf"), asset("revo1_left/revo1_left.urdf"))
}

/// The vendor's arm with the vendor's hand.
pub(crate) fn vendor_arm_and_hand() -> RobotCfg {
    arm_and_hand("inspire", robot("rokae_description/urdf/SR5.urdf"), robot("inspire_hand/DFQ_left_hand.urdf"))
}

/// ANYmal C with a floating base.
pub(crate) fn anymal() -> RobotCfg {
    let init_pose = from_xyz_rpy([0.0, 0.0, 0.6], [0.0; 3]);
    let urdf = robot("anymal_c_simple_description/urdf/anymal.urdf");
    RobotCfg { fix_base: false, init_pose, ..urdf_robot("anymal", urdf) }
}

/// The bundled arm with the hand, and the hand alone on a floating base.
pub(crate) fn bundled_robots() -> [RobotCfg; 2] {
    let hand = urdf_robot("hand", assets::path("revo1_left/revo1_left.urdf").unwrap());
    let init_pose = from_xyz_rpy([0.1, 0.2, 0.5], [0.3, 0.2, 0.1]);
    [bundled(), RobotCfg { fix_base: false, self_collision: true, init_pose, ..hand }]
}

pub(crate) fn vendors_robots() -> [RobotCfg; 2] {
    [vendor_arm_and_hand(), anymal()]
}

/// A simulation of one robot.
pub(crate) fn simulation(robot: RobotCfg) -> (SimulationManager, RobotId) {
    let mut sim = kinetoscope_testkit::worlds::sim(kinetoscope_testkit::worlds::cfg(1, 1));
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}

/// Writes a dump into a new temporary folder.
pub(crate) fn dump(sim: &SimulationManager) -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    sim.dump(dir.path()).unwrap();
    dir
}
