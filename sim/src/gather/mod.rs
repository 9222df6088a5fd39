//! Copies quantities of a batch to the arrays that sensors read; only requested quantities are gathered.

mod contacts;
mod rows;

use self::rows::ChunkRows;
use crate::capture::CaptureRequest;
use crate::env::{EnvStatus, SimEnv, Stage};
use crate::row::{RowPart, StoredRow};
use crate::simulation::Simulation;
use kinetoscope_mujoco as mj;
use kinetoscope_scene::StateFields;
use kinetoscope_scene::{SceneState, StateDims};
use kinetoscope_sensors::Phases;
use std::sync::{Mutex, PoisonError};

/// Fills the rows of one environment in the arrays of a quantity. The index counts from the first environment of the
/// chunk.
type Fill = fn(&Simulation, &SimEnv, usize, &mut ChunkRows<'_>);

/// Takes the flags of all gathered quantities, each with the file that fills its arrays.
macro_rules! gathered {
    ($($FLAG:ident => $file:ident,)*) => {
        $(mod $file;)*

        /// All gathered quantities except contacts, in the order in which they are filled.
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
    ACCELERATIONS => accelerations,
    JOINT_WRENCHES => joint_wrenches,
    VISIBLE => visual_scene,
    INSTANCES => instances,
}

/// Quantities that a sensor may require: the gathered ones, and the markers of other sensors.
pub(crate) const AVAILABLE: StateFields = {
    let (mut all, mut k) = (StateFields::MARKERS.union(StateFields::CONTACTS), 0);
    while k < QUANTITIES.len() {
        all = all.union(QUANTITIES[k].0);
        k += 1;
    }
    all
};

/// Allocates a state with the arrays that `requires` names, without markers, and without those of the visual scene
/// until that scene exists. The body axis has the links of all robots, then objects, then frames of attached MJCF
/// files. The joint axis has the movable joints of all robots, then the joints of attached MJCF files with one degree
/// of freedom. The actuator axis has the drives of all robots, then the actuators of attached MJCF files.
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
    simulation.batch.for_each_row(RowPart::Clock, |i, row| fill_clock(row, i, substeps, state));
}

/// Writes steps and times of environment `i`.
fn fill_clock(row: StoredRow<'_>, i: usize, substeps: u32, state: &mut SceneState) {
    state.step[i] = row.steps() / u64::from(substeps);
    state.time[i] = row.time();
    state.force_time[i] = row.solved_time();
}

/// Writes the physics steps since the last reset of every environment to `clocks`, for the schedules of sensors. A
/// diverged environment gets [`Phases::QUARANTINED`].
pub(crate) fn gather_step_counts(simulation: &Simulation, substeps: u32, clocks: &mut Vec<u64>) {
    clocks.resize(simulation.batch.num_envs(), 0);
    simulation.batch.for_each_row(RowPart::Clock, |i, row| {
        let runs = *row.status() == EnvStatus::Running;
        clocks[i] = if runs { row.steps() / u64::from(substeps) } else { Phases::QUARANTINED };
    });
}

/// Part of a step that the data needs for these quantities.
fn stage_of(simulation: &Simulation, requires: StateFields) -> Stage {
    // MuJoCo's own sensors of the last stage have their values from the last solve.
    let stages = simulation.batch.model().sensor_needstage();
    let is_solved = |&stage: &i32| stage as u32 == mj::sys::mjSTAGE_ACC;
    let of_forward = if stages.iter().all(is_solved) { StateFields::NONE } else { StateFields::SENSORDATA };
    let of_kinematics = StateFields::POSES
        | StateFields::VELOCITIES
        | StateFields::ACCELERATIONS
        | StateFields::VISIBLE
        | StateFields::INSTANCES;
    let has = |of: StateFields| !requires.intersection(of).is_empty();
    if has(of_forward) {
        Stage::Forward
    } else if has(of_kinematics) {
        Stage::Kinematics
    } else {
        Stage::State
    }
}

/// Removes the elements of a list of rows and keeps its memory: the standard library collects in place.
#[expect(clippy::unnecessary_filter_map, reason = "a filter cannot change the lifetime in the element type")]
fn emptied<'b>(mut rows: Vec<Mutex<ChunkRows<'_>>>) -> Vec<Mutex<ChunkRows<'b>>> {
    rows.clear();
    rows.into_iter().filter_map(|_| None).collect()
}

/// Fills the arrays that `requires` names, which must be allocated, and steps and times, for the environments `chosen`.
/// If contacts are required, their list becomes that of the last capture of every environment.
pub(crate) fn gather(
    simulation: &Simulation,
    chosen: &[usize],
    substeps: u32,
    requires: StateFields,
    state: &mut SceneState,
    memory: &mut GatherMemory,
) {
    let filler = Filler::new(simulation, requires, state, memory);
    let all = chosen.len() == simulation.batch.num_envs();
    match filler.stage() {
        Some(stage) if all => simulation.batch.visit(stage, |i, env| filler.fill(i, env)),
        Some(stage) => simulation.batch.visit_in(chosen, stage, |i, env| filler.fill(i, env)),
        None => {}
    }
    filler.finish(memory);
    for &i in chosen {
        simulation.batch.read_row(i, |row| fill_clock(row, i, substeps, state));
    }
    gather_contacts(simulation, requires, state);
}

/// Does `steps` physics steps and captures the quantities of `capture` in the last one. Then fills the arrays that
/// `requires` names, which must be allocated, and steps and times. Each environment is gathered by the thread that
/// stepped it, while its data is in that core's cache.
pub(crate) fn step_and_gather(
    simulation: &Simulation,
    steps: u32,
    substeps: u32,
    capture: Option<&CaptureRequest>,
    requires: StateFields,
    state: &mut SceneState,
    memory: &mut GatherMemory,
) {
    let filler = Filler::new(simulation, requires, state, memory);
    simulation.batch.step_and_visit(steps * substeps, capture, filler.stage(), |i, env| filler.fill(i, env));
    filler.finish(memory);
    gather_steps(simulation, substeps, state);
    gather_contacts(simulation, requires, state);
}

/// Fills the contacts, if `requires` names them, in the order of the environments.
fn gather_contacts(simulation: &Simulation, requires: StateFields, state: &mut SceneState) {
    if requires.contains(StateFields::CONTACTS) {
        simulation.batch.for_each_row(RowPart::Clock, |i, row| contacts::fill(row.row, i, state));
    }
}

/// Memory of a gather that the next one uses again, so that steps allocate nothing.
#[derive(Default)]
pub(crate) struct GatherMemory(Vec<Mutex<ChunkRows<'static>>>);

/// Fills rows of the arrays from several threads.
struct Filler<'a> {
    simulation: &'a Simulation,
    requires: StateFields,
    chunk_size: usize,
    /// Rows of each chunk of environments. One thread at a time works on a chunk, so none waits.
    chunks: Vec<Mutex<ChunkRows<'a>>>,
}

impl<'a> Filler<'a> {
    fn new(
        simulation: &'a Simulation,
        requires: StateFields,
        state: &'a mut SceneState,
        memory: &mut GatherMemory,
    ) -> Self {
        let sees = !requires.intersection(StateFields::VISIBLE | StateFields::INSTANCES).is_empty();
        if sees && state.own_scenes != simulation.env_scenes {
            state.own_scenes.clone_from(&simulation.env_scenes);
        }
        let chunk_size = simulation.batch.chunk_size();
        let mut chunks = emptied(std::mem::take(&mut memory.0));
        ChunkRows::split(state, chunk_size, &mut chunks);
        Self { simulation, requires, chunk_size, chunks }
    }

    /// Ends the borrow of the arrays.
    fn finish(self, memory: &mut GatherMemory) {
        memory.0 = emptied(self.chunks);
    }

    /// Part of a step that the data needs; `None` if no quantity is filled from it.
    fn stage(&self) -> Option<Stage> {
        let fills = QUANTITIES.iter().any(|(quantity, _)| self.requires.contains(*quantity));
        fills.then(|| stage_of(self.simulation, self.requires))
    }

    fn fill(&self, i: usize, env: &SimEnv) {
        if QUANTITIES.iter().any(|(quantity, _)| self.requires.contains(*quantity)) {
            let (chunk, k) = (i / self.chunk_size, i % self.chunk_size);
            let rows = &mut *self.chunks[chunk].lock().unwrap_or_else(PoisonError::into_inner);
            for (_, fill) in QUANTITIES.iter().filter(|(quantity, _)| self.requires.contains(*quantity)) {
                fill(self.simulation, env, k, rows);
            }
        }
    }
}
