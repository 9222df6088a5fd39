//! Reward of long steps.

use crate::error::{EnvError, Result, TermKind};
use crate::reward::RewardTerm;
use kinetoscope_sensors::ContactSensor;
use kinetoscope_sim::{SensorId, SimulationManager};

/// Smallest commanded speed with a reward \[m/s\], as in Isaac Lab.
const SLOWEST_COMMAND: f64 = 0.1;

/// Sum, over the bodies of a contact sensor that came into contact in this step, of the duration of their last air
/// phase minus `threshold` \[s\]; Isaac Lab's `feet_air_time`. It is 0 if the first two columns of the command term
/// called `command` are slower than 0.1 m/s.
///
/// A body counts if its contact time is above 0 and at most a step of the task. The sensor should measure in every
/// step.
///
/// # Errors
/// The sensor does not track air times ([`track_air_time`](kinetoscope_sensors::ContactSensorCfg::track_air_time)), or
/// `threshold` is not finite.
///
/// # Panics
/// The sensor belongs to another manager.
pub fn feet_air_time(
    sim: &SimulationManager,
    name: &str,
    weight: f64,
    sensor: SensorId<ContactSensor>,
    command: impl Into<String>,
    threshold: f64,
) -> Result<RewardTerm> {
    let wrong = |field: &str, value: String, expected| {
        let field = format!("{field} of the {} term {name:?}", TermKind::Reward);
        Err(EnvError::Config { field, value, expected })
    };
    if sim.sensor(sensor)?.last_air_time().is_none() {
        return wrong("track_air_time of the sensor", "false".into(), "the sensor must track air times");
    }
    if !threshold.is_finite() {
        return wrong("threshold", threshold.to_string(), "it must be finite");
    }
    let command = command.into();
    Ok(RewardTerm::new(name, weight, move |now| {
        let sensor = now.sim().sensor(sensor)?;
        let wanted = now.command(&command)?;
        if wanted.ncols() < 2 {
            let found = wanted.ncols();
            return Err(format!("the command {command:?} has {found} columns; it needs at least two, x and y").into());
        }
        let (Some(contact), Some(air)) = (sensor.current_contact_time(), sensor.last_air_time()) else {
            return Err("the contact sensor no longer tracks air times".into());
        };
        // Times are whole numbers of physics steps, up to rounding.
        const ROUNDING: f64 = 1e-8;
        let longest = now.step_dt() + ROUNDING;
        let of_env = |env: usize| {
            if wanted[(env, 0)].hypot(wanted[(env, 1)]) <= SLOWEST_COMMAND {
                return 0.0;
            }
            let bodies = contact.row(env).into_iter().zip(air.row(env));
            let first = bodies.filter(|(contact, _)| **contact > 0.0 && **contact < longest);
            first.map(|(_, air)| air - threshold).sum()
        };
        Ok((0..now.num_envs()).map(of_env).collect())
    }))
}
