//! Terrain in a simulation: what rays measure, what lies on it, what is written, what is refused.

mod contact;
mod dump;
mod refused;
mod seen;

use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;

/// A grid of heights that no two points share, 3 m by 2 m, moved and turned.
fn bumps() -> TerrainCfg {
    let heights = Array2::from_shape_fn((21, 31), |(r, c)| 0.3 * (0.7 * c as f64).sin() * (0.4 * r as f64).cos() - 0.1);
    TerrainCfg {
        uid: "bumps".into(),
        heights,
        size: [3.0, 2.0],
        init_pose: kinetoscope::scene::pose::from_xyz_rpy([0.4, -0.3, 0.2], [0.0, 0.0, 0.5]),
        ..Default::default()
    }
}

/// Two environments with nothing else in them.
fn empty() -> SimulationManager {
    SimulationManager::new(SimulationManagerCfg { num_envs: 2, ground: None, ..Default::default() }).unwrap()
}
