//! The scene that MJCF files are tested in; the tests of robots from them use it, too.

use kinetoscope::prelude::*;

/// 500 steps a second, nothing in the scene but what is added.
pub(crate) fn empty(num_envs: usize) -> SimulationManager {
    let cfg = SimulationManagerCfg {
        num_envs,
        physics_dt: 0.002,
        threads: Some(2),
        ground: None,
        lights: vec![],
        ..Default::default()
    };
    SimulationManager::new(cfg).unwrap()
}
