//! Small worlds at 200 Hz: objects, and robots of one or two links.

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope_testkit::urdf;
use kinetoscope_testkit::urdf::TempFiles;
pub(crate) use kinetoscope_testkit::urdf::link;
pub(crate) use kinetoscope_testkit::worlds::{ball, cube, fixed, look_at, pose_of_row, sr5};
use nalgebra::Vector3;

pub(crate) const G: f64 = 9.81;

/// `num_envs` environments at 200 Hz.
pub(crate) fn cfg(num_envs: usize) -> SimulationManagerCfg {
    SimulationManagerCfg { num_envs, threads: Some(2), ..SimulationManagerCfg::legged() }
}

pub(crate) fn sim(num_envs: usize) -> SimulationManager {
    kinetoscope_testkit::worlds::sim(cfg(num_envs))
}

/// Adds a robot of these links and joints, with a fixed base and without drives, after applying `change` to its
/// configuration.
pub(crate) fn add_robot(
    sim: &mut SimulationManager,
    uid: &str,
    content: &str,
    change: impl FnOnce(&mut RobotCfg),
) -> RobotId {
    let files = TempFiles::default();
    let mut robot = kinetoscope_testkit::worlds::passive(kinetoscope_testkit::worlds::text_robot(
        &files,
        uid,
        &urdf::robot(uid, content),
    ));
    robot.fix_base = true;
    change(&mut robot);
    sim.add_robot(robot).unwrap()
}

/// A joint between two links.
pub(crate) fn joint(name: &str, kind: &str, links: [&str; 2], at: [f64; 3], axis: &str) -> String {
    urdf::joint(name, kind, links, at, axis, r#"<limit effort="100" velocity="100"/>"#)
}

/// Three numbers of row `env` of a batch.
pub(crate) fn row(values: &Array2<f64>, env: usize, first: usize) -> Vector3<f64> {
    Vector3::from_fn(|k, _| values[(env, first + k)])
}
