//! Copies quantities of a batch to the arrays that sensors read; only requested quantities are gathered.

mod rows;

use crate::env::{EnvStatus, SimEnv};
use crate::simulation::Simulation;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{SceneState, StateDims};
use kinetoscope_sensors::Phases;

/// Fills the rows of one environment, given by index, in the arrays of a quantity.
type Fill = fn(&Simulation, &SimEnv, usize, &mut SceneState);

/// Takes the flags of all gathered quantities, each with the file that fills its arrays.
macro_rules! gathered {
    ($($FLAG:ident => $file:ident,)*) => {
        $(mod $file;)*

        /// All gathered quantities, in the order in which they are filled.
        const QUANTITIES: &[(StateFields, Fill)] = &[$((StateFields::$FLAG, $file::fill),)*];
    };
}

// A quantity is one line here, one file, and its arrays in `kinetoscope_scene::state`.
gathered! {
    POSES => poses,
    VELOCITIES => velocities,
    JOINT_STATE => joint_state,
    JOINT_EFFORTS => joint_efforts,
    ACTUATORS => actuators,
    SENSORDATA => sensordata,
    CONTACTS => contacts,
    ACCELERATIONS => accelerations,
    JOINT_WRENCHES => joint_wrenches,
    VISIBLE => visual_scene,
    INSTANCES => instances,
}

/// Quantities that a sensor may require: the gathered ones, and the markers of other sensors.
pub(crate) const AVAILABLE: StateFields = {
    let (mut all, mut k) = (StateFields::MARKERS, 0);
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
pub(crate) fn allocate(simulation: &Simulation, requires: StateFields) -> SceneState {
    let visual_scene = simulation.visual_scene.as_ref();
    let lengths = StateDims {
        num_envs: simulation.batch.num_envs(),
        bodies: simulation.body_axis.bodies().len(),
        joints: rows::all_joints(simulation).count(),
        actuators: actuators::count(simulation),
        engine_values: simulation.batch.model().nsensordata(),
        instances: visual_scene.map_or(0, |visible| visible.scene().instances().len()),
    };
    let unavailable =
        if visual_scene.is_none() { StateFields::VISIBLE | StateFields::INSTANCES } else { StateFields::NONE };
    let mut state = SceneState::with_room(requires.without(unavailable | StateFields::MARKERS), &lengths);
    if let (Some(room), Some(visible)) = (&mut state.visible, visual_scene) {
        *room = visual_scene::allocate(visible, lengths.num_envs);
    }
    state
}

/// Writes physics steps since the last reset and times of all environments to `state`.
pub(crate) fn gather_steps(simulation: &Simulation, substeps: u32, state: &mut SceneState) {
    simulation.batch.for_each(|i, env| {
        state.step[i] = env.steps() / u64::from(substeps);
        state.time[i] = env.data().time();
        state.force_time[i] = env.solved_time();
    });
}

/// Writes the physics steps since the last reset of every environment to `clocks`, for the schedules of sensors. A
/// diverged environment gets [`Phases::QUARANTINED`].
pub(crate) fn gather_step_counts(simulation: &Simulation, substeps: u32, clocks: &mut Vec<u64>) {
    clocks.resize(simulation.batch.num_envs(), 0);
    simulation.batch.for_each(|i, env| {
        let runs = *env.status() == EnvStatus::Running;
        clocks[i] = if runs { env.steps() / u64::from(substeps) } else { Phases::QUARANTINED };
    });
}

/// Fills the arrays that `requires` names, which must be allocated, and steps and times.
pub(crate) fn gather(simulation: &Simulation, substeps: u32, requires: StateFields, state: &mut SceneState) {
    gather_steps(simulation, substeps, state);
    if requires.is_empty() {
        return;
    }
    let sees = !requires.intersection(StateFields::VISIBLE | StateFields::INSTANCES).is_empty();
    if sees && state.own_scenes != simulation.env_scenes {
        state.own_scenes.clone_from(&simulation.env_scenes);
    }
    simulation.batch.for_each(|i, env| {
        for (_, fill) in QUANTITIES.iter().filter(|(quantity, _)| requires.contains(*quantity)) {
            fill(simulation, env, i, state);
        }
    });
}
