//! Copies quantities of a batch to the arrays that sensors read; only requested quantities are gathered.

mod accelerations;
mod actuators;
mod contacts;
mod instances;
mod joint_efforts;
mod joint_state;
mod joint_wrenches;
mod poses;
mod rows;
mod sensordata;
mod velocities;
mod visible;

use crate::env::{Env, EnvStatus};
use crate::simulation::Simulation;
use kinetoscope_scene::Requires;
use kinetoscope_scene::{Lengths, SceneState};
use kinetoscope_sensors::Phases;

/// Fills the rows of one environment, given by index, in the arrays of a quantity.
type Fill = fn(&Simulation, &Env, usize, &mut SceneState);

/// All gathered quantities, each in a file of its own. [`kinetoscope_scene::state`] lists their arrays.
const QUANTITIES: [(Requires, Fill); 11] = [
    (Requires::POSES, poses::fill),
    (Requires::VELOCITIES, velocities::fill),
    (Requires::JOINT_STATE, joint_state::fill),
    (Requires::JOINT_EFFORTS, joint_efforts::fill),
    (Requires::ACTUATORS, actuators::fill),
    (Requires::SENSORDATA, sensordata::fill),
    (Requires::CONTACTS, contacts::fill),
    (Requires::ACCELERATIONS, accelerations::fill),
    (Requires::JOINT_WRENCHES, joint_wrenches::fill),
    (Requires::VISIBLE, visible::fill),
    (Requires::INSTANCES, instances::fill),
];

/// Quantities that a sensor may require: the gathered ones, and the markers of other sensors.
pub(crate) const AVAILABLE: Requires = {
    let (mut all, mut k) = (Requires::MARKERS, 0);
    while k < QUANTITIES.len() {
        all = all.union(QUANTITIES[k].0);
        k += 1;
    }
    all
};

/// Allocates a state with the arrays that `requires` names. The body axis has the links of all robots, then objects,
/// then frames of attached MJCF files. The joint axis has the movable joints of all robots, then the joints of attached
/// MJCF files with one degree of freedom. The actuator axis has the drives of all robots, then the actuators of
/// attached MJCF files.
pub(crate) fn allocate(simulation: &Simulation, requires: Requires) -> SceneState {
    let seen = simulation.visible.as_ref();
    let lengths = Lengths {
        num_envs: simulation.batch.num_envs(),
        bodies: simulation.plan.bodies().len(),
        joints: rows::all_joints(simulation).count(),
        actuators: actuators::count(simulation),
        engine_values: simulation.batch.model().nsensordata(),
        instances: seen.map_or(0, |visible| visible.scene().instances().len()),
    };
    let elsewhere = if seen.is_none() { Requires::VISIBLE | Requires::INSTANCES } else { Requires::NONE };
    let mut state = SceneState::with_room(requires.without(elsewhere | Requires::MARKERS), &lengths);
    if let (Some(room), Some(visible)) = (&mut state.visible, seen) {
        *room = visible::room(visible, lengths.num_envs);
    }
    state
}

/// Writes steps and times of all environments to `state`.
pub(crate) fn gather_steps(simulation: &Simulation, substeps: u32, state: &mut SceneState) {
    simulation.batch.for_each(|i, env| {
        state.step[i] = env.steps() / u64::from(substeps);
        state.time[i] = env.data().time();
        state.force_time[i] = env.solved_time();
    });
}

/// Writes the step count of every environment to `clocks`, for the schedules of sensors.
pub(crate) fn gather_clocks(simulation: &Simulation, substeps: u32, clocks: &mut Vec<u64>) {
    clocks.resize(simulation.batch.num_envs(), 0);
    simulation.batch.for_each(|i, env| {
        let runs = *env.status() == EnvStatus::Running;
        clocks[i] = if runs { env.steps() / u64::from(substeps) } else { Phases::STANDS };
    });
}

/// Fills the arrays that `requires` names, which must be allocated.
pub(crate) fn gather(simulation: &Simulation, substeps: u32, requires: Requires, state: &mut SceneState) {
    gather_steps(simulation, substeps, state);
    if requires.is_empty() {
        return;
    }
    let sees = !requires.intersection(Requires::VISIBLE | Requires::INSTANCES).is_empty();
    if sees && state.own_scenes != simulation.own_scenes {
        state.own_scenes.clone_from(&simulation.own_scenes);
    }
    simulation.batch.for_each(|i, env| {
        for (_, fill) in QUANTITIES.iter().filter(|(quantity, _)| requires.contains(*quantity)) {
            fill(simulation, env, i, state);
        }
    });
}
