//! The robots that are exported: the bundled ones, and those of vendors where they are present.

use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use std::f64::consts::FRAC_PI_2;
use std::path::{Path, PathBuf};

/// The folder of vendors' robots: `KINETOSCOPE_ROBOTS`, or `shared/robots` in a folder above this crate.
fn folder() -> Option<PathBuf> {
    let named = std::env::var_os("KINETOSCOPE_ROBOTS").map(PathBuf::from);
    let above = || {
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        here.ancestors().map(|dir| dir.join("shared/robots")).find(|dir| dir.is_dir())
    };
    let found = named.or_else(above).filter(|dir| dir.is_dir());
    if found.is_none() {
        println!("skipped: no robot descriptions; set KINETOSCOPE_ROBOTS to their folder");
    }
    found
}

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
pub(crate) fn vendor_arm_and_hand() -> Option<RobotCfg> {
    let robots = folder()?;
    Some(arm_and_hand(
        "inspire",
        robots.join("rokae_description/urdf/SR5.urdf"),
        robots.join("inspire_hand/DFQ_left_hand.urdf"),
    ))
}

/// ANYmal C, free in space.
pub(crate) fn anymal() -> Option<RobotCfg> {
    let robots = folder()?;
    Some(RobotCfg {
        uid: "anymal".into(),
        urdf: UrdfCfg::single(robots.join("anymal_c_simple_description/urdf/anymal.urdf")),
        fix_base: false,
        init_pose: from_xyz_rpy([0.0, 0.0, 0.6], [0.0; 3]),
        ..Default::default()
    })
}

/// All that are here.
pub(crate) fn all() -> Vec<RobotCfg> {
    [Some(bundled()), Some(bundled_hand()), vendor_arm_and_hand(), anymal()].into_iter().flatten().collect()
}

/// A simulation of one robot.
pub(crate) fn simulation(robot: RobotCfg) -> (SimulationManager, RobotId) {
    let cfg = SimulationManagerCfg { threads: Some(1), ..Default::default() };
    let mut sim = SimulationManager::new(cfg).unwrap();
    let id = sim.add_robot(robot).unwrap();
    (sim, id)
}
