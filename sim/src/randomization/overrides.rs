//! Own property values of environments, as they are stored.

use super::Property;
use super::properties::PropertyOverrides;
use super::tables::PropertyTables;
use kinetoscope_mujoco::{Model, ModelPatch, NumberArray};

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
            let is_of_model = values_of_model(property, tables, model, patch)
                .is_some_and(|of_model| of_model.iter().map(|x| x.to_bits()).eq(mine.iter().map(|x| x.to_bits())));
            if !is_of_model {
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
    let (array, width, first) = match property {
        Property::Mass => (NumberArray::BODY_MASS, 1, 0),
        Property::CenterOfMass => (NumberArray::BODY_IPOS, 3, 0),
        Property::Inertia => (NumberArray::BODY_INERTIA, 3, 0),
        Property::Friction => (NumberArray::GEOM_FRICTION, 3, 0),
        Property::TorsionalFriction => (NumberArray::GEOM_FRICTION, 3, 1),
        Property::RollingFriction => (NumberArray::GEOM_FRICTION, 3, 2),
        Property::Size => (NumberArray::GEOM_SIZE, 3, 0),
        Property::Position => (NumberArray::BODY_POS, 3, 0),
        _ => return None,
    };
    let numbers = array.all(model, patch);
    let places = tables.get(property).indices.iter();
    Some(
        places
            .flat_map(|place| (0..property.width()).map(move |k| width * place + first + k))
            .map(|k| numbers[k])
            .collect(),
    )
}
