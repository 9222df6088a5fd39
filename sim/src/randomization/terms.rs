//! Randomizations as data.

use super::Property;
use super::error::RandomizationError;
use super::properties::Properties;
use crate::pattern;
use kinetoscope_scene::KeyedRng;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// Random operation on a property. Numbers are sampled uniformly from a range `[low, high]` and change the nominal
/// value, not the previous random value. For moments of inertia, the nominal value is scaled to the current mass. For a
/// color, red, green and blue are randomized; the opacity stays nominal.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RandomizationOp {
    /// Multiplies all numbers of the property by one random factor.
    Scale([f64; 2]),
    /// Adds a random summand, in the unit of the property, to each number. Each number has its own summand.
    Add([f64; 2]),
    /// Replaces each number by its own random value, in the unit of the property.
    Set([f64; 2]),
}

impl RandomizationOp {
    fn range(self) -> [f64; 2] {
        match self {
            Self::Scale(range) | Self::Add(range) | Self::Set(range) => range,
        }
    }
}

/// One random operation on one property, for all names that a pattern matches.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RandomizationTerm {
    /// Property to randomize.
    pub property: Property,
    /// Regular expression that matches whole names (see [`Properties`]).
    pub pattern: String,
    /// Random operation. Elements with the same name, such as the shapes of one body, get the same random numbers;
    /// different names get different ones.
    pub draw: RandomizationOp,
}

/// Randomization of the properties of environments.
///
/// ```
/// use kinetoscope_sim::{
///     RandomizationOp, ObjectShape, Property, Randomization, RigidObjectCfg, SimulationManager, SimulationManagerCfg,
/// };
///
/// let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 4, ..Default::default() })?;
/// let shape = ObjectShape::cube(0.1);
/// sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), shape, mass: Some(2.0), ..Default::default() })?;
/// let randomization = Randomization::new()
///     .with(Property::Mass, "cube", RandomizationOp::Scale([0.8, 1.2]))
///     .with(Property::Friction, "cube|ground", RandomizationOp::Set([0.4, 1.0]))
///     .with(Property::Gravity, "gravity", RandomizationOp::Add([-0.1, 0.1]));
/// sim.properties_mut().randomize(&randomization, None)?;
/// let mass = sim.properties().of(kinetoscope_sim::EnvId(3))?.get(Property::Mass, "cube")?[0];
/// assert!((1.6..2.4).contains(&mass));
/// # Ok::<(), kinetoscope_sim::Error>(())
/// ```
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Randomization {
    /// Terms; two terms of one property must not match the same name.
    pub terms: Vec<RandomizationTerm>,
}

impl Randomization {
    /// Creates a randomization without terms.
    pub fn new() -> Self {
        Self::default()
    }

    /// Adds a term.
    #[must_use]
    pub fn with(mut self, property: Property, pattern: impl Into<String>, draw: RandomizationOp) -> Self {
        self.terms.push(RandomizationTerm { property, pattern: pattern.into(), draw });
        self
    }

    /// Resolves the patterns to elements, property by property.
    pub(super) fn resolve(&self, properties: &Properties) -> Result<ResolvedRandomization, RandomizationError> {
        for RandomizationTerm { property, pattern, draw } in &self.terms {
            let [low, high] = draw.range();
            if !(low.is_finite() && high.is_finite() && low <= high) {
                let (property, pattern) = (property.name(), pattern.clone());
                return Err(RandomizationError::Range { property, pattern, low, high });
            }
        }
        let mut resolved = Vec::new();
        for property in Property::ALL {
            let terms = self.terms.iter().filter(|term| term.property == property);
            let entries: Vec<(String, RandomizationOp)> = terms.map(|term| (term.pattern.clone(), term.draw)).collect();
            if entries.is_empty() {
                continue;
            }
            if let Some((name, reason)) = entries.iter().find_map(|(of, _)| properties.unsupported_match(property, of))
            {
                return Err(RandomizationError::NoSizeProperty { name, reason });
            }
            let names = properties.randomizable_names(property);
            let draws = pattern::assign(&entries, &BTreeMap::new(), &names, property.element_description())
                .map_err(|error| RandomizationError::Pattern { property: property.name(), error: Box::new(error) })?;
            let elements_of = |wanted: &str| {
                let all = properties.tables.get(property).names.iter().enumerate();
                all.filter(|(_, name)| *name == wanted).map(|(element, _)| element).collect()
            };
            let chosen = names.iter().zip(draws).filter_map(|(name, draw)| {
                Some(ResolvedOp { name: name.to_string(), elements: elements_of(name), draw: draw? })
            });
            resolved.push((property, chosen.collect()));
        }
        Ok(ResolvedRandomization(resolved))
    }
}

/// Randomization that is resolved for a scene, property by property.
pub(super) struct ResolvedRandomization(Vec<(Property, Vec<ResolvedOp>)>);

/// Random operation for a name: one sample for all elements of that name.
struct ResolvedOp {
    name: String,
    elements: Vec<usize>,
    draw: RandomizationOp,
}

impl ResolvedRandomization {
    /// Samples all terms and writes them to the properties of an environment. `random` returns the generator of a
    /// property and an element name; elements with the same name share one sample.
    pub(super) fn apply(&self, properties: &mut Properties, mut random: impl FnMut(Property, &str) -> KeyedRng) {
        let tables = std::sync::Arc::clone(&properties.tables);
        for (property, draws) in &self.0 {
            let (table, width) = (tables.get(*property), property.width());
            // Opacity is never randomized: a factor of a color does not apply to it.
            let drawn = if *property == Property::Color { 3 } else { width };
            for ResolvedOp { name, elements, draw } in draws {
                let mut random = random(*property, name);
                let [low, high] = draw.range();
                let mut numbers = [0.0; Property::MAX_WIDTH];
                let count = if matches!(draw, RandomizationOp::Scale(_)) { 1 } else { drawn };
                numbers[..count].fill_with(|| random.uniform_range(low, high));
                for &element in elements {
                    let mut value = [0.0; Property::MAX_WIDTH];
                    let value = &mut value[..width];
                    value.copy_from_slice(&table.nominal[element * width..(element + 1) * width]);
                    if *property == Property::Inertia {
                        value.copy_from_slice(&properties.proportional_moments(element));
                    }
                    let (drawn, numbers) = (value[..drawn].iter_mut(), numbers.iter());
                    match draw {
                        RandomizationOp::Scale(_) => drawn.for_each(|number| *number *= numbers.as_slice()[0]),
                        RandomizationOp::Add(_) => drawn.zip(numbers).for_each(|(number, more)| *number += more),
                        RandomizationOp::Set(_) => drawn.zip(numbers).for_each(|(number, new)| *number = *new),
                    }
                    properties.set_element(*property, element, value);
                }
            }
        }
    }
}
