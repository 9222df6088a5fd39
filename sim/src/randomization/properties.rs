//! Properties of one environment, to read and to change.

use super::Property;
use super::error::RandomizationError;
use super::tables::{PropertyTable, PropertyTables};
use crate::drive::table::DriveState;
use crate::error::{Error, Result};
use crate::pattern;
use std::collections::BTreeSet;
use std::sync::Arc;

/// Own property values of an environment, in the order of [`Property::ALL`]; `None` for nominal properties. Gains are
/// stored with the drives instead.
pub(crate) type PropertyOverrides = [Option<Box<[f64]>>; Property::ALL.len()];

/// Properties of one environment, as a copy. Changes act on the environment only inside
/// [`EnvPropertiesMut::randomize_with`](crate::EnvPropertiesMut::randomize_with).
///
/// Names are `uid/link` and `uid/joint` of robots and articulations, `uid/body`, `uid/joint` and, for the world,
/// `uid/geom` of MJCF parts, and the uid of objects and terrains. The names of the ground and of gravity are `ground`
/// and `gravity`. Links behind fixed joints are part of the link they are fused to.
#[derive(Clone, Debug)]
pub struct Properties {
    pub(super) tables: Arc<PropertyTables>,
    /// Values in the order of [`Property::ALL`].
    pub(super) values: [Vec<f64>; Property::ALL.len()],
    /// Gains that this copy has randomized or set, by property and element; empty in a new copy. They count as
    /// randomized even if they have the same value.
    changed_gains: BTreeSet<(Property, usize)>,
    /// True if all gains except those in `changed_gains` become nominal and are no longer randomized.
    pub(super) nominal_gains: bool,
}

impl Properties {
    /// Properties of an environment with these own values and drives.
    pub(super) fn new(tables: &Arc<PropertyTables>, own: &PropertyOverrides, drives: &DriveState) -> Self {
        let mut properties = Self {
            tables: Arc::clone(tables),
            values: [const { Vec::new() }; Property::ALL.len()],
            changed_gains: BTreeSet::new(),
            nominal_gains: false,
        };
        properties.load(own, drives);
        properties
    }

    /// Replaces everything by the properties of an environment with these own values and drives, reusing memory.
    pub(super) fn load(&mut self, own: &PropertyOverrides, drives: &DriveState) {
        for (property, values) in Property::ALL.into_iter().zip(&mut self.values) {
            let table = self.tables.get(property);
            let gain = |place: &usize| {
                let gains = drives.gains[*place];
                match property {
                    Property::Stiffness => gains.kp,
                    Property::DriveDamping => gains.kd,
                    _ => gains.max_effort,
                }
            };
            values.clear();
            match &own[property as usize] {
                _ if property.is_gain() => values.extend(table.indices.iter().map(gain)),
                Some(own) => values.extend_from_slice(own),
                None => values.extend_from_slice(&table.nominal),
            }
        }
        self.changed_gains.clear();
        self.nominal_gains = false;
    }

    /// True if this copy has randomized or set the gain of an element; earlier randomizations do not count.
    pub(super) fn is_changed(&self, gain: Property, element: usize) -> bool {
        self.changed_gains.contains(&(gain, element))
    }

    /// Collects the values that differ from the nominal values, bit by bit.
    pub(super) fn overrides(&self) -> PropertyOverrides {
        Property::ALL.map(|property| {
            let (mine, nominal) = (&self.values[property as usize], &self.tables.get(property).nominal);
            let same = mine.iter().map(|x| x.to_bits()).eq(nominal.iter().map(|x| x.to_bits()));
            (!property.is_gain() && !same).then(|| mine.clone().into())
        })
    }

    /// Names of all elements that have a property, each once.
    pub fn names(&self, property: Property) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for name in &self.tables.get(property).names {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        names
    }

    /// Names of the elements that a randomization of a property changes. For colors, elements with a nominal opacity of
    /// 0 are left out: a randomization keeps opacities, so they stay invisible.
    pub(super) fn randomizable_names(&self, property: Property) -> Vec<&str> {
        let table = self.tables.get(property);
        let is_seen = |name: &str| {
            let opacities = table.nominal.chunks(property.width()).map(|color| color[3]);
            table.names.iter().zip(opacities).any(|(of, opacity)| of == name && opacity > 0.0)
        };
        let mut names = self.names(property);
        names.retain(|name| property != Property::Color || is_seen(name));
        names
    }

    /// First element that a pattern matches and that cannot have the property, with the reason. `None` if the pattern
    /// matches an element that can have it.
    pub(super) fn unsupported_match(&self, property: Property, pattern: &str) -> Option<(String, &'static str)> {
        let without = &self.tables.get(property).unsupported;
        let matched =
            |names: &[&str]| pattern::select(&[pattern], names, property.element_description()).unwrap_or_default();
        if !matched(&self.randomizable_names(property)).is_empty() {
            return None;
        }
        let names: Vec<&str> = without.iter().map(|(name, _)| name.as_str()).collect();
        matched(&names).first().map(|&first| without[first].clone())
    }

    /// Value in this environment; that of the first shape for a body with several.
    ///
    /// # Errors
    /// No element of this name has the property; the error lists the nearest names.
    pub fn get(&self, property: Property, name: &str) -> Result<&[f64]> {
        self.value(property, name, &self.values[property as usize])
    }

    /// Value in the model as it was compiled.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub fn nominal(&self, property: Property, name: &str) -> Result<&[f64]> {
        self.value(property, name, &self.tables.get(property).nominal)
    }

    fn value<'v>(&self, property: Property, name: &str, values: &'v [f64]) -> Result<&'v [f64]> {
        let table = self.tables.get(property);
        let element = table.names.iter().position(|known| known == name);
        let element = element.ok_or_else(|| match table.unsupported_reason(name) {
            Some(reason) => RandomizationError::NoSizeProperty { name: name.into(), reason }.into(),
            None => Error::UnknownName {
                what: property.element_description(),
                name: name.into(),
                candidates: pattern::closest_names(name, self.names(property)).into_iter().map(String::from).collect(),
            },
        })?;
        Ok(&values[element * property.width()..(element + 1) * property.width()])
    }

    /// Sets a value, for all shapes of a body with several. Setting a mass also sets the moments of inertia
    /// ([`Property::Mass`]). The value is checked when the change is applied to the environment, not here.
    ///
    /// # Errors
    /// No element of this name has the property, or the number of values is not that of the property.
    pub fn set(&mut self, property: Property, name: &str, value: &[f64]) -> Result<()> {
        self.get(property, name)?;
        let (found, expected) = (value.len(), property.width());
        if found != expected {
            let error = RandomizationError::Width { property: property.name(), name: name.into(), found, expected };
            return Err(error.into());
        }
        let tables = Arc::clone(&self.tables);
        for element in (0..tables.get(property).names.len()).filter(|&e| tables.get(property).names[e] == name) {
            self.set_element(property, element, value);
        }
        Ok(())
    }

    /// Sets the value of one element; a mass changes the moments in proportion.
    pub(super) fn set_element(&mut self, property: Property, element: usize, value: &[f64]) {
        let width = property.width();
        let at = element * width..(element + 1) * width;
        self.values[property as usize][at.clone()].copy_from_slice(value);
        if property.is_gain() {
            self.changed_gains.insert((property, element));
        }
        if property == Property::Size {
            // Sizes that the shape does not have.
            let nominal = &self.tables.get(property).nominal[at.clone()];
            let numbers = self.values[property as usize][at].iter_mut().zip(nominal);
            numbers.filter(|(_, nominal)| **nominal == 0.0).for_each(|(number, _)| *number = 0.0);
        }
        if property == Property::Mass {
            let moments = self.proportional_moments(element);
            self.values[Property::Inertia as usize][3 * element..3 * element + 3].copy_from_slice(&moments);
        }
    }

    /// Resets all properties except gains to their nominal values.
    pub(crate) fn reset_to_nominal(&mut self) {
        for property in Property::ALL.into_iter().filter(|property| !property.is_gain()) {
            self.values[property as usize].clone_from(&self.tables.get(property).nominal);
        }
    }

    /// Sets the value of one element without side effects on other properties.
    pub(crate) fn set_element_only(&mut self, property: Property, element: usize, value: &[f64]) {
        let width = property.width();
        self.values[property as usize][element * width..(element + 1) * width].copy_from_slice(value);
    }

    /// Nominal principal moments of inertia of a body \[kg m²\], scaled by the ratio of its mass to the nominal mass.
    /// Bodies have the same order in the tables of masses and of moments.
    pub(super) fn proportional_moments(&self, element: usize) -> [f64; 3] {
        let nominal: &PropertyTable = self.tables.get(Property::Mass);
        let (mass, before) = (self.values[Property::Mass as usize][element], nominal.nominal[element]);
        let moments = &self.tables.get(Property::Inertia).nominal;
        // A single factor of exactly 1 preserves every bit.
        std::array::from_fn(|k| moments[3 * element + k] * (mass / before))
    }

    /// Checks all values, and reports the first invalid one.
    pub(super) fn check(&self, env: usize) -> Result<(), RandomizationError> {
        for property in Property::ALL {
            let (table, width) = (self.tables.get(property), property.width());
            let values = self.values[property as usize].chunks(width).zip(table.nominal.chunks(width));
            for (name, (value, nominal)) in table.names.iter().zip(values) {
                // Nominal values passed the compiler.
                if value != nominal
                    && let Some(expected) = property.invalid_reason(value, nominal)
                {
                    let (property, name, value) = (property.name(), name.clone(), value.to_vec());
                    return Err(RandomizationError::Value { env, property, name, value, expected });
                }
            }
        }
        Ok(())
    }

    /// Transfers own values to another scene, by name; elements that are new there are nominal. Among shapes of one
    /// name, the k-th takes over from the k-th.
    pub(super) fn transferred(
        own: &PropertyOverrides,
        from: &PropertyTables,
        to: &PropertyTables,
    ) -> PropertyOverrides {
        Property::ALL.map(|property| {
            let values = own[property as usize].as_ref()?;
            let (from, to, width) = (from.get(property), to.get(property), property.width());
            let mut carried = to.nominal.clone();
            let mut seen = std::collections::BTreeMap::<&str, usize>::new();
            for (element, name) in from.names.iter().enumerate() {
                let nth = seen.entry(name).or_default();
                let mut same = (0..to.names.len()).filter(|&e| to.names[e] == *name);
                let old = element * width..(element + 1) * width;
                if let Some(new) = same.nth(*nth)
                    && values[old.clone()] != from.nominal[old.clone()]
                {
                    carried[new * width..(new + 1) * width].copy_from_slice(&values[old]);
                }
                *nth += 1;
            }
            Some(carried.into())
        })
    }
}
