//! Random masses and friction.

use super::check_range;
use crate::episode_rng::{EpisodeRng, env_ids};
use crate::error::{EnvError, Result, TermKind};
use crate::event::{EventMode, EventTerm};
use kinetoscope_scene::pattern;
use kinetoscope_sim::{EnvId, Property, RandomizationOp, SimulationManager};
use std::collections::BTreeMap;

/// Creates an event that sets random masses of links and objects that can move ([`Property::Mass`] \[kg\]), with a
/// random number of its own for each body. Isaac Lab's `randomize_rigid_body_mass` does the same. Moments of inertia
/// change in proportion.
///
/// `patterns` match whole names of bodies, `uid/link` or the uid of an object; links behind fixed joints are part of the
/// link that they are fused to. Operations change the nominal mass, not the present one.
///
/// # Errors
/// A pattern is invalid or matches no body, two patterns match the same body, or the ends of the range are not finite
/// or not in order. The event returns an error for a mass that is not above 0.
pub fn randomize_mass(
    sim: &SimulationManager,
    name: &str,
    mode: EventMode,
    patterns: &[&str],
    op: RandomizationOp,
) -> Result<EventTerm> {
    randomize(sim, name, mode, Property::Mass, patterns, op)
}

/// Creates an event that sets random sliding friction of bodies and of the ground ([`Property::Friction`]), as
/// [`randomize_mass`] sets masses. Isaac Lab's `randomize_rigid_body_material` does the same for its static and dynamic
/// friction.
///
/// In a contact, MuJoCo takes the larger friction of the two surfaces.
///
/// # Errors
/// Those of [`randomize_mass`]. The event returns an error for negative friction.
pub fn randomize_friction(
    sim: &SimulationManager,
    name: &str,
    mode: EventMode,
    patterns: &[&str],
    op: RandomizationOp,
) -> Result<EventTerm> {
    randomize(sim, name, mode, Property::Friction, patterns, op)
}

/// Creates an event that sets a property with one number per body.
fn randomize(
    sim: &SimulationManager,
    name: &str,
    mode: EventMode,
    property: Property,
    patterns: &[&str],
    op: RandomizationOp,
) -> Result<EventTerm> {
    let (RandomizationOp::Scale(range) | RandomizationOp::Add(range) | RandomizationOp::Set(range)) = op;
    check_range(TermKind::Event, name, "op", range)?;
    let nominal = sim.properties().of(EnvId(0))?;
    let names = nominal.names(property);
    let chosen = pattern::select(patterns, &names, "body with this property")
        .map_err(|error| EnvError::pattern(TermKind::Event, name, "bodies", error))?;
    let bodies = chosen.into_iter().map(|k| Ok((names[k].to_string(), nominal.nominal(property, names[k])?[0])));
    let bodies = bodies.collect::<Result<Vec<(String, f64)>>>()?;
    Ok(EventTerm::new(name, mode, move |sim, rngs| {
        let envs = env_ids(rngs);
        let mut rngs: BTreeMap<EnvId, &mut EpisodeRng> = rngs.iter_mut().map(|rng| (rng.env(), rng)).collect();
        sim.properties_mut().randomize_with(Some(&envs), |_, env, properties| {
            let Some(rng) = rngs.get_mut(&env) else { return Ok(()) };
            for (body, nominal) in &bodies {
                let number = rng.uniform_range(range[0], range[1]);
                let value = match op {
                    RandomizationOp::Scale(_) => nominal * number,
                    RandomizationOp::Add(_) => nominal + number,
                    RandomizationOp::Set(_) => number,
                };
                properties.set(property, body, &[value])?;
            }
            Ok(())
        })?;
        Ok(())
    }))
}
