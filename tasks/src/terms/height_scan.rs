//! Heights of the ground around a robot.

use crate::error::{EnvError, Result, TermKind};
use crate::observation::ObservationTerm;
use kinetoscope_sensors::ray::RayCaster;
use kinetoscope_sim::{SensorId, SimulationManager};
use ndarray::Array2;

/// Height of the sensor's parent body above the hit point of each ray, minus `offset` \[m\], as in Isaac Lab; columns
/// `0`, `1`, ... in the order of the rays.
///
/// A ray without a hit gives -inf, which is an error unless the term is [clipped](ObservationTerm::clipped).
///
/// # Errors
/// `offset` is not finite.
///
/// # Panics
/// The sensor belongs to another manager.
pub fn height_scan(
    sim: &SimulationManager,
    name: &str,
    scanner: SensorId<RayCaster>,
    offset: f64,
) -> Result<ObservationTerm> {
    if !offset.is_finite() {
        let field = format!("offset of the {} term {name:?}", TermKind::Observation);
        return Err(EnvError::Config { field, value: offset.to_string(), expected: "it must be finite" });
    }
    let sensor = sim.sensor(scanner)?;
    let columns = (0..sensor.num_rays()).map(|ray| ray.to_string());
    Ok(ObservationTerm::new(name, columns, move |now| {
        let sensor = now.sim().sensor(scanner)?;
        let (places, hits) = (sensor.pos_w(), sensor.hits());
        Ok(Array2::from_shape_fn((now.num_envs(), sensor.num_rays()), |(env, ray)| {
            places[(env, 2)] - hits[(env, ray, 2)] - offset
        }))
    }))
}
