//! Own property values of environments, as they are stored.

use super::Property;
use super::properties::PropertyOverrides;
use super::tables::PropertyTables;
use kinetoscope_mujoco::{Model, ModelPatch};

/// Own property values of an environment. Values that its model has, such as masses, are not stored twice.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct StoredOverrides {
    /// Bits of the properties that are not nominal, in the order of [`Property::ALL`].
    own: u32,
    /// Bits of those whose values are stored here: the others are in the environment's [`ModelPatch`].
    stored: u32,
    /// Stored values, property by property.
    values: Box<[f64]>,
}

/// Bit of a property.
const fn bit(property: Property) -> u32 {
    1 << property as u32
}

impl StoredOverrides {
    /// Stores own values of an environment with this patch of the compiled model `model`.
    pub(super) fn new(
        own: &PropertyOverrides,
        tables: &PropertyTables,
        model: &Model,
        patch: Option<&ModelPatch>,
    ) -> Self {
        let (mut all, mut stored, mut values) = (0, 0, Vec::new());
        for property in Property::ALL {
            let Some(mine) = &own[property as usize] else { continue };
            all |= bit(property);
            let of_model = values_of_model(property, tables, model, patch);
            let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
            if of_model.is_none_or(|of_model| bits(&of_model) != bits(mine)) {
                stored |= bit(property);
                values.extend_from_slice(mine);
            }
        }
        Self { own: all, stored, values: values.into() }
    }

    /// True if all properties are nominal.
    pub(crate) fn is_nominal(&self) -> bool {
        self.own == 0
    }

    /// True if a property is not nominal.
    pub(super) fn has(&self, property: Property) -> bool {
        self.own & bit(property) != 0
    }

    /// Values of one property; `None` if it is nominal. `patch` is the current one of the environment.
    pub(super) fn get(
        &self,
        property: Property,
        tables: &PropertyTables,
        model: &Model,
        patch: Option<&ModelPatch>,
    ) -> Option<Box<[f64]>> {
        if !self.has(property) {
            return None;
        }
        if self.stored & bit(property) == 0 {
            return values_of_model(property, tables, model, patch).map(Into::into);
        }
        let len = |of: Property| tables.get(of).nominal.len();
        let before = Property::ALL.into_iter().take_while(|of| *of != property);
        let start = before.filter(|of| self.stored & bit(*of) != 0).map(len).sum::<usize>();
        Some(self.values[start..start + len(property)].into())
    }

    /// Values of all properties.
    pub(super) fn all(&self, tables: &PropertyTables, model: &Model, patch: Option<&ModelPatch>) -> PropertyOverrides {
        Property::ALL.map(|property| self.get(property, tables, model, patch))
    }

    /// Memory \[bytes\].
    pub(super) fn bytes(&self) -> usize {
        size_of::<Self>() + size_of_val(&*self.values)
    }
}

/// Values of a property in the arrays of a model that has this patch, element by element; `None` for a property that is
/// not simply the content of an array.
fn values_of_model(
    property: Property,
    tables: &PropertyTables,
    model: &Model,
    patch: Option<&ModelPatch>,
) -> Option<Vec<f64>> {
    if property == Property::Gravity {
        return Some(patch.map_or(model.gravity(), ModelPatch::gravity).into());
    }
    // The array, its width, and the index of the first number of the property.
    let (array, compiled, width, first) = match property {
        Property::Mass => ("body_mass", model.body_mass(), 1, 0),
        Property::CenterOfMass => ("body_ipos", model.body_ipos(), 3, 0),
        Property::Inertia => ("body_inertia", model.body_inertia(), 3, 0),
        Property::Friction => ("geom_friction", model.geom_friction(), 3, 0),
        Property::TorsionalFriction => ("geom_friction", model.geom_friction(), 3, 1),
        Property::RollingFriction => ("geom_friction", model.geom_friction(), 3, 2),
        Property::Size => ("geom_size", model.geom_size(), 3, 0),
        Property::Position => ("body_pos", model.body_pos(), 3, 0),
        _ => return None,
    };
    let mut numbers = compiled.to_vec();
    if let Some(patch) = patch {
        patch.for_each_number(array, |index, number| numbers[index] = number);
    }
    let places = tables.get(property).indices.iter();
    Some(
        places
            .flat_map(|place| (0..property.width()).map(move |k| width * place + first + k))
            .map(|k| numbers[k])
            .collect(),
    )
}
