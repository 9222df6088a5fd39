//! MJCF files as parts of a scene, compared with MuJoCo and the same file alone.

mod files;
mod handle;
mod motion;
mod samples;
mod sensors;
mod visible;

use kinetoscope::mujoco as mj;
use kinetoscope::mujoco::{Data, Model};
use kinetoscope::prelude::*;
use kinetoscope::sim::MjcfId;
use kinetoscope_testkit::worlds::{empty_cfg, sim};

/// An empty scene with 500 steps per second.
pub(crate) fn empty(num_envs: usize) -> SimulationManager {
    sim(SimulationManagerCfg { physics_dt: 0.002, ..empty_cfg(num_envs) })
}

/// [`empty`] with a part `m`.
fn with(num_envs: usize, text: impl Into<String>) -> (SimulationManager, MjcfId) {
    let mut sim = empty(num_envs);
    let part = sim.add_mjcf(MjcfPartCfg::text("m", text.into())).unwrap();
    (sim, part)
}

/// A text compiled by MuJoCo alone.
fn alone(text: &str) -> Model {
    mj::compile(text, &[]).unwrap().into_model()
}

/// Data of a model with the buffer sizes of the simulation, because plain MuJoCo drops contacts that exceed its
/// buffers.
fn data_of(sim: &SimulationManager, model: &Model, ctrl: &[f64]) -> Data {
    let buffers = sim.batch().read(0, |env| env.data().model().buffers());
    let mut data = Data::new(&model.with_buffers(buffers)).unwrap();
    data.ctrl_mut().copy_from_slice(ctrl);
    data
}

/// Every kind of element of both supported MuJoCo versions, in one small file with degrees, classes and rotated frames.
const MACHINE: &str = include_str!("../../data/mjcf/machine.xml");
