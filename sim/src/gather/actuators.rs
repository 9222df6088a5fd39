//! Controls, forces and activations of drives and of the actuators of attached MJCF files.

use super::rows::ChunkRows;
use crate::env::SimEnv;
use crate::simulation::Simulation;

/// Indices, in the drive table, of the drives of all robots, in the order of their joints.
fn drives(simulation: &Simulation) -> impl Iterator<Item = usize> {
    simulation.robots.iter().flat_map(|robot| &robot.joints).filter_map(|joint| joint.drive)
}

/// Number of actuators.
pub(super) fn count(simulation: &Simulation) -> usize {
    drives(simulation).count() + simulation.mjcf_models.iter().map(|part| part.actuators.len()).sum::<usize>()
}

/// Fills the rows of environment `i` of the chunk.
pub(super) fn fill(simulation: &Simulation, env: &SimEnv, i: usize, state: &mut ChunkRows<'_>) {
    let (model, data) = (simulation.batch.model(), env.data());
    let of_drives = drives(simulation).map(|drive| [env.drives.position[drive], env.drives.effort[drive], 0.0]);
    let of_parts = simulation.mjcf_models.iter().flat_map(|part| part.actuators.iter().zip(&part.controls));
    let of_parts = of_parts.map(|(&actuator, &control)| {
        // MuJoCo computes the force from the last of several activations.
        let activation = model.actuator_activation(actuator).next_back().map_or(0.0, |place| data.act()[place]);
        [data.ctrl()[control], data.actuator_force()[actuator], activation]
    });
    let ChunkRows { actuator_controls, actuator_forces, actuator_activations, .. } = state;
    for (k, numbers) in of_drives.chain(of_parts).enumerate() {
        for (array, number) in [&mut *actuator_controls, actuator_forces, actuator_activations].into_iter().zip(numbers)
        {
            if let Some(array) = array {
                array[(i, k)] = number;
            }
        }
    }
}
