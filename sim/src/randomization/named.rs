//! Own property values of environments by name, for snapshots.

use super::Property;
use super::properties::PropertyOverrides;
use super::tables::PropertyTables;
use crate::drive::table::DriveState;
use std::collections::BTreeMap;

/// Own value of a property in an environment.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct NamedValue {
    pub(crate) property: Property,
    /// Name of the element.
    pub(crate) name: String,
    /// Index among the elements of this name: shapes of one body have the same name.
    pub(crate) nth: u32,
    pub(crate) value: Box<[f64]>,
}

/// Elements of a property, by name and index among the elements of that name.
pub(crate) type Elements<'t> = BTreeMap<(&'t str, u32), usize>;

impl PropertyTables {
    /// Indexes the elements of a property.
    pub(crate) fn elements(&self, property: Property) -> Elements<'_> {
        let (mut seen, mut elements) = (BTreeMap::<&str, u32>::new(), Elements::new());
        for (element, name) in self.get(property).names.iter().enumerate() {
            let nth = seen.entry(name).or_default();
            elements.insert((name, *nth), element);
            *nth += 1;
        }
        elements
    }

    /// Collects the values that are not nominal, bit by bit, and the randomized gains.
    pub(crate) fn named_overrides(&self, own: &PropertyOverrides, drives: &DriveState) -> Vec<NamedValue> {
        let mut values = Vec::new();
        for property in Property::ALL {
            let (table, width) = (self.get(property), property.width());
            let of = |element: usize| -> Option<&[f64]> {
                let at = element * width..(element + 1) * width;
                let (mine, nominal) = (own[property as usize].as_ref()?.get(at.clone())?, &table.nominal[at]);
                let same = mine.iter().map(|x| x.to_bits()).eq(nominal.iter().map(|x| x.to_bits()));
                (!same).then_some(mine)
            };
            let gain = |element: usize| property.gain().and_then(|k| drives.override_values(table.indices[element])[k]);
            let has_own = match property.gain() {
                Some(k) => table.indices.iter().any(|&drive| drives.override_values(drive)[k].is_some()),
                None => own[property as usize].is_some(),
            };
            if !has_own {
                continue;
            }
            for ((name, nth), element) in self.elements(property) {
                let value = match gain(element) {
                    Some(gain) => Some([gain][..].into()),
                    None => of(element).map(Box::from),
                };
                values.extend(value.map(|value| NamedValue { property, name: name.into(), nth, value }));
            }
        }
        values
    }
}
