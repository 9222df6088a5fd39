//! Properties of environments in snapshots.

use super::{Snapshot, SnapshotError};
use crate::env::Stage;
use crate::error::Result;
use crate::ids::EnvId;
use crate::manager::SimulationManager;
use crate::randomization::{NamedValue, Property, PropertyTables, RandomizationError};
use crate::simulation::Simulation;
use std::sync::Arc;

/// Own property values of an environment, and the number of its randomizations.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct SavedProperties {
    pub(crate) values: Vec<NamedValue>,
    pub(crate) randomizations: u64,
}

/// Values of properties of an environment, by element.
type ResolvedValues<'s> = Vec<(Property, usize, &'s [f64])>;

impl SavedProperties {
    /// Finds the elements of the values in a scene.
    fn resolve_in<'s>(&'s self, tables: &PropertyTables, env: usize) -> Result<ResolvedValues<'s>> {
        let mut found = Vec::with_capacity(self.values.len());
        for values in self.values.chunk_by(|a, b| a.property == b.property) {
            let elements = tables.elements(values[0].property);
            for NamedValue { property, name, nth, value } in values {
                let element = elements.get(&(name.as_str(), *nth)).copied().ok_or_else(|| {
                    let difference = format!("it has {} of {name:?}, which this scene does not have", property.name());
                    SnapshotError::OtherScene { difference }
                })?;
                let nominal = tables.nominal(*property, element);
                let has_none = |(number, nominal): (&f64, &f64)| *nominal == 0.0 && *number != 0.0;
                let other_shape = *property == Property::Size && value.iter().zip(nominal).any(has_none);
                let other_shape = other_shape.then_some("size components that the shape does not use must be 0");
                if let Some(expected) = property.invalid_reason(value, nominal).or(other_shape) {
                    let (property, name, value) = (property.name(), name.clone(), value.to_vec());
                    return Err(RandomizationError::Value { env, property, name, value, expected }.into());
                }
                found.push((*property, element, &**value));
            }
        }
        Ok(found)
    }
}

impl Simulation {
    /// Properties of an environment as a snapshot stores them.
    pub(crate) fn own_properties(&self, env: usize, randomizations: u64) -> Arc<SavedProperties> {
        // Created before an environment is locked: the creation reads an environment.
        self.tables();
        let values = self.batch.read_at(env, Stage::Raw, |here| self.named_properties(env, here));
        Arc::new(SavedProperties { values, randomizations })
    }
}

impl SimulationManager {
    /// Restores states and properties: [`EnvPropertiesMut::restore`](crate::EnvPropertiesMut::restore).
    pub(crate) fn restore_with_properties(&mut self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<()> {
        let sources = self.sources(snapshot, env_ids)?;
        let chosen: Vec<usize> = (0..sources.len()).filter(|&env| sources[env].is_some()).collect();
        let tables = Arc::clone(self.simulation.tables());
        let entries = Arc::clone(snapshot.entries());
        let own = |env: usize| sources[env].map(|source| &*entries[source].overrides);
        let mut found: Vec<ResolvedValues<'_>> = Vec::with_capacity(chosen.len());
        for &env in &chosen {
            found.push(own(env).map_or_else(|| Ok(Vec::new()), |own| own.resolve_in(&tables, env))?);
        }
        // Environments are visited in this order.
        let mut values = found.iter();
        self.simulation.change_properties(&chosen, |_, properties| {
            properties.reset_to_nominal();
            let all = values.next().into_iter().flatten();
            all.filter(|(property, ..)| property.gain().is_none()).for_each(|(property, element, value)| {
                properties.set_element_only(*property, *element, value);
            });
            Ok(())
        })?;
        for (&env, values) in chosen.iter().zip(&found) {
            let Some(source) = sources[env] else { continue };
            self.randomization_count[env] = entries[source].overrides.randomizations;
            self.simulation.batch.write_at(env, Stage::Raw, |here| {
                here.drives.clear_overrides();
                here.load_state(&entries[source].state);
                for (property, element, value) in values {
                    if let Some(kind) = property.gain() {
                        here.drives.restore_override(tables.index(*property, *element), kind, value[0]);
                    }
                }
            });
        }
        self.sensors.mark_written(&chosen);
        if !self.sensors.is_empty() {
            self.sensors.reset(&chosen, &mut self.simulation);
        }
        Ok(())
    }
}
