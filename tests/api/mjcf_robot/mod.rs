//! MJCF files as robots, compared with MuJoCo and the same file alone, and with the same robot from a URDF.

mod bases;
mod couplings;
mod drives;
mod files;
mod kinematics;
mod motion;
mod properties;
mod refused;
mod scenes;

use crate::mjcf::empty;
use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{Data, Model};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::KeyedRng;
use kinetoscope_testkit::worlds::{mjcf_robot as robot, passive, row};

/// A robot in an empty scene.
fn with(num_envs: usize, cfg: RobotCfg) -> (SimulationManager, RobotId) {
    let mut sim = empty(num_envs);
    let id = sim.add_robot(cfg).unwrap();
    (sim, id)
}

/// The file alone, with the time step of the scene.
fn alone(text: &str) -> Model {
    let text = text.replace("<worldbody>", r#"<option timestep="0.002"/><worldbody>"#);
    mj::compile(&text, &[]).unwrap().into_model()
}

/// `count` rows of positions between the limits of the robot's joints, all of which have limits.
fn random_qpos(sim: &SimulationManager, id: RobotId, count: usize) -> Array2<f64> {
    let limits = sim.robot(id).qpos_limits();
    let mut random = KeyedRng::keyed(7, 0, "positions");
    Array2::from_shape_fn((count, sim.robot(id).dof()), |(_, joint)| {
        let (low, high) = (limits[(0, joint, 0)], limits[(0, joint, 1)]);
        low + (high - low) * random.uniform()
    })
}

/// Largest absolute number.
fn largest<'a>(values: impl IntoIterator<Item = &'a f64>) -> f64 {
    values.into_iter().fold(0.0, |most, x| most.max(x.abs()))
}

/// An arm of seven axes with the features that MJCF has and URDF lacks: two joints in one body, anchors off the origin,
/// start positions, a spring, a body fixed to another, sites, degrees.
const ODD: &str = include_str!("../../data/mjcf/odd.xml");

/// Joints of [`ODD`].
const ODD_JOINTS: [&str; 7] = ["pan", "lift", "elbow", "rail", "roll", "pitch", "yaw"];
