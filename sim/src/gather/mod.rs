//! From a batch of environments to the arrays that sensors read: only what somebody asked for.

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

/// Fills the rows of an environment, with its number, in the arrays of a quantity.
type Fill = fn(&Simulation, &Env, usize, &mut SceneState);

/// All quantities that are gathered, each by a file of its own. Their arrays are listed in [`kinetoscope_scene::state`].
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

/// Quantities that sensors may ask for: those that are gathered, and the markers of other sensors.
pub(crate) const AVAILABLE: Requires = {
    let (mut all, mut k) = (Requires::MARKERS, 0);
    while k < QUANTITIES.len() {
        all = all.union(QUANTITIES[k].0);
        k += 1;
    }
    all
};

/// A state with room for what `requires` names. The body axis has the links of all robots, then objects, then frames of
/// parts; the joint axis the movable joints of all robots, then those of parts with one degree of freedom; the actuator axis
/// the drives of all robots, then the actuators of parts.
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

/// Steps and times of all environments.
pub(crate) fn gather_steps(simulation: &Simulation, substeps: u32, state: &mut SceneState) {
    simulation.batch.for_each(|i, env| {
        state.step[i] = env.steps() / u64::from(substeps);
        state.time[i] = env.data().time();
        state.force_time[i] = env.solved_time();
    });
}

/// The step of every environment, for sensors that say when they are due.
pub(crate) fn gather_clocks(simulation: &Simulation, substeps: u32, clocks: &mut Vec<u64>) {
    clocks.resize(simulation.batch.num_envs(), 0);
    simulation.batch.for_each(|i, env| {
        let runs = *env.status() == EnvStatus::Running;
        clocks[i] = if runs { env.steps() / u64::from(substeps) } else { Phases::STANDS };
    });
}

/// Fills the arrays that `requires` names, which must be there.
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
