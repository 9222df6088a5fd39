//! The properties of one environment, to read and to change.

use super::Property;
use super::error::RandomizationError;
use super::tables::{Table, Tables};
use crate::drive::table::DriveState;
use crate::error::{Error, Result};
use crate::pattern;
use std::collections::BTreeSet;
use std::sync::Arc;

/// What an environment has for itself, property by property in the order of [`Property::ALL`]; nominal where `None`.
/// Gains are not among it: they are kept with the drives.
pub(crate) type OwnValues = [Option<Box<[f64]>>; Property::ALL.len()];

/// The properties of one environment. Names are `uid/link` and `uid/joint` of robots and MJCF parts, and the uid of objects
/// and terrains; `ground` and `gravity` are called so. Links that fixed joints hold are part of the link they are fused to.
#[derive(Clone, Debug)]
pub struct Properties {
    pub(super) tables: Arc<Tables>,
    /// In the order of [`Property::ALL`].
    pub(super) values: [Vec<f64>; Property::ALL.len()],
    /// Gains that were drawn or set here, by property and element: what is drawn is so also where it is what was before.
    asked: BTreeSet<(Property, usize)>,
    /// Whether gains are to be nominal and drawn no longer, but for those that are asked for.
    pub(super) nominal_gains: bool,
}

impl Properties {
    /// Those of an environment with these own values and drives.
    pub(super) fn new(tables: &Arc<Tables>, own: &OwnValues, drives: &DriveState) -> Self {
        let values = Property::ALL.map(|property| {
            let table = tables.get(property);
            let gain = |place: &usize| {
                let gains = drives.gains[*place];
                match property {
                    Property::Stiffness => gains.kp,
                    Property::DriveDamping => gains.kd,
                    _ => gains.max_effort,
                }
            };
            match &own[property as usize] {
                _ if property.is_gain() => table.places.iter().map(gain).collect(),
                Some(values) => values.to_vec(),
                None => table.nominal.clone(),
            }
        });
        Self { tables: Arc::clone(tables), values, asked: BTreeSet::new(), nominal_gains: false }
    }

    /// Whether a gain was drawn or set here.
    pub(super) fn is_asked(&self, gain: Property, element: usize) -> bool {
        self.asked.contains(&(gain, element))
    }

    /// What differs from the nominal values, bit by bit.
    pub(super) fn own(&self) -> OwnValues {
        Property::ALL.map(|property| {
            let (mine, nominal) = (&self.values[property as usize], &self.tables.get(property).nominal);
            let same = mine.iter().map(|x| x.to_bits()).eq(nominal.iter().map(|x| x.to_bits()));
            (!property.is_gain() && !same).then(|| mine.clone().into())
        })
    }

    /// Names of everything that has a property, each once.
    pub fn names(&self, property: Property) -> Vec<&str> {
        let mut names: Vec<&str> = Vec::new();
        for name in &self.tables.get(property).names {
            if !names.contains(&name.as_str()) {
                names.push(name);
            }
        }
        names
    }

    /// Names of what draws of a property change. A draw leaves opacities as they nominally are, so it changes no colour that
    /// can be seen of what is nominally invisible.
    pub(super) fn names_to_draw(&self, property: Property) -> Vec<&str> {
        let table = self.tables.get(property);
        let is_seen = |name: &str| {
            let opacities = table.nominal.chunks(property.width()).map(|color| color[3]);
            table.names.iter().zip(opacities).any(|(of, opacity)| of == name && opacity > 0.0)
        };
        let mut names = self.names(property);
        names.retain(|name| property != Property::Color || is_seen(name));
        names
    }

    /// The first thing that a pattern matches and that cannot have the property, with the reason, where it matches nothing
    /// that can.
    pub(super) fn only_without(&self, property: Property, pattern: &str) -> Option<(String, &'static str)> {
        let without = &self.tables.get(property).without;
        let matched = |names: &[&str]| pattern::select(&[pattern], names, property.owner()).unwrap_or_default();
        if !matched(&self.names_to_draw(property)).is_empty() {
            return None;
        }
        let names: Vec<&str> = without.iter().map(|(name, _)| name.as_str()).collect();
        matched(&names).first().map(|&first| without[first].clone())
    }

    /// The value in this environment; of the first shape where a body has several.
    ///
    /// # Errors
    /// Nothing of this name has the property; the error lists the nearest names.
    pub fn get(&self, property: Property, name: &str) -> Result<&[f64]> {
        self.value(property, name, &self.values[property as usize])
    }

    /// The value in the model as it was compiled.
    ///
    /// # Errors
    /// As [`get`](Self::get).
    pub fn nominal(&self, property: Property, name: &str) -> Result<&[f64]> {
        self.value(property, name, &self.tables.get(property).nominal)
    }

    fn value<'v>(&self, property: Property, name: &str, values: &'v [f64]) -> Result<&'v [f64]> {
        let table = self.tables.get(property);
        let element = table.names.iter().position(|known| known == name);
        let element = element.ok_or_else(|| match table.why_not(name) {
            Some(reason) => RandomizationError::Unsized { name: name.into(), reason }.into(),
            None => Error::UnknownName {
                what: property.owner(),
                name: name.into(),
                candidates: pattern::closest(name, self.names(property)).into_iter().map(String::from).collect(),
            },
        })?;
        Ok(&values[element * property.width()..(element + 1) * property.width()])
    }

    /// Sets a value, of all shapes where a body has several. Whether MuJoCo can have it is said when the environment takes
    /// it over.
    ///
    /// # Errors
    /// Nothing of this name has the property, or another number of numbers.
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

    /// Sets the value of one element, and with a mass the moments that go with it.
    pub(super) fn set_element(&mut self, property: Property, element: usize, value: &[f64]) {
        let width = property.width();
        let at = element * width..(element + 1) * width;
        self.values[property as usize][at.clone()].copy_from_slice(value);
        if property.is_gain() {
            self.asked.insert((property, element));
        }
        if property == Property::Size {
            // Numbers that the shape does not have.
            let nominal = &self.tables.get(property).nominal[at.clone()];
            let numbers = self.values[property as usize][at].iter_mut().zip(nominal);
            numbers.filter(|(_, nominal)| **nominal == 0.0).for_each(|(number, _)| *number = 0.0);
        }
        if property == Property::Mass {
            let moments = self.proportional_moments(element);
            self.values[Property::Inertia as usize][3 * element..3 * element + 3].copy_from_slice(&moments);
        }
    }

    /// Everything nominal but gains.
    pub(crate) fn become_nominal(&mut self) {
        for property in Property::ALL.into_iter().filter(|property| !property.is_gain()) {
            self.values[property as usize].clone_from(&self.tables.get(property).nominal);
        }
    }

    /// Sets the value of one element and nothing that goes with it.
    pub(crate) fn put(&mut self, property: Property, element: usize, value: &[f64]) {
        let width = property.width();
        self.values[property as usize][element * width..(element + 1) * width].copy_from_slice(value);
    }

    /// Nominal moments of a body in the proportion of its mass to the nominal one. Bodies stand in the tables of masses and
    /// of moments in the same order.
    pub(super) fn proportional_moments(&self, element: usize) -> [f64; 3] {
        let nominal: &Table = self.tables.get(Property::Mass);
        let (mass, before) = (self.values[Property::Mass as usize][element], nominal.nominal[element]);
        let moments = &self.tables.get(Property::Inertia).nominal;
        // One factor of exactly 1 leaves every bit.
        std::array::from_fn(|k| moments[3 * element + k] * (mass / before))
    }

    /// The first value that cannot be.
    pub(super) fn check(&self, env: usize) -> Result<(), RandomizationError> {
        for property in Property::ALL {
            let (table, width) = (self.tables.get(property), property.width());
            let values = self.values[property as usize].chunks(width).zip(table.nominal.chunks(width));
            for (name, (value, nominal)) in table.names.iter().zip(values) {
                // What the compiler took is good.
                if value != nominal
                    && let Some(expected) = property.fault(value, nominal)
                {
                    let (property, name, value) = (property.name(), name.clone(), value.to_vec());
                    return Err(RandomizationError::Value { env, property, name, value, expected });
                }
            }
        }
        Ok(())
    }

    /// The same values, by name, of another scene; what is new there is nominal. Of shapes of one name, the k-th takes over
    /// from the k-th.
    pub(super) fn carried_to(own: &OwnValues, from: &Tables, to: &Tables) -> OwnValues {
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
