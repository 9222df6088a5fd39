//! Application of property values to the model and the drives of an environment.

use super::Property;
use super::error::RandomizationError;
use super::properties::{Properties, PropertyOverrides};
use super::tables::{FrictionLocation, dofs_of, friction_location};
use crate::drive::gains::Gains;
use crate::drive::table::{DriveState, DriveTable};
use crate::error::Result;
use crate::row::EnvRow;
use kinetoscope_mujoco::{DiagonalInertia, Model, ModelEditor, ModelPatch};
use std::sync::Arc;

/// Creator of environment models for one compiled scene.
#[derive(Debug)]
pub(crate) struct ModelPatcher {
    editor: ModelEditor,
    base: Model,
}

/// Model and drive settings that are prepared for an environment.
pub(crate) struct EnvPatch {
    /// New differences from the compiled model; `None` if the environment keeps those that it has.
    model: Option<Option<Arc<ModelPatch>>>,
    /// Proportional gain, derivative gain and effort limit of drives; `None` for values that stay.
    gains: Vec<(usize, [Option<f64>; 3])>,
    /// True if all drives first return to their nominal gains, which are not randomized.
    nominal_gains: bool,
    /// Damping of joints, in the layout of [`DriveState::set_damping`](crate::drive::table::DriveState::set_damping);
    /// empty if it stays.
    damping: Vec<f64>,
    /// Friction rows of the model, in the layout of
    /// [`DriveState::set_rows`](crate::drive::table::DriveState::set_rows); empty if they stay.
    rows: Vec<usize>,
}

impl ModelPatcher {
    /// Creates models for environments of the compiled model `base`.
    pub(crate) fn new(base: &Model) -> Result<Self> {
        Ok(Self { editor: ModelEditor::new(base)?, base: base.clone() })
    }

    /// Prepares environment `index`, whose row is `row`, for these properties. `own` are its own values, from
    /// [`Properties::overrides`].
    pub(crate) fn prepare(
        &mut self,
        properties: &Properties,
        own: &PropertyOverrides,
        index: usize,
        row: &EnvRow,
    ) -> Result<EnvPatch> {
        let drives = row.drives.table();
        properties.check(index)?;
        check_models(properties, &row.drives, index)?;
        let mut damping: Vec<f64> = drives.damped.iter().map(|(_, damping)| *damping).collect();
        let is_nominal = own.iter().all(Option::is_none);
        self.editor.load(&self.base);
        if !is_nominal && self.edit(properties, drives, &mut damping, index)? {
            self.editor.set_constants()?;
        }
        let model = (!is_nominal || row.patch.is_some()).then(|| self.editor.patch());
        let values = |property: Property| &properties.values[property as usize];
        let places = &properties.tables.get(Property::Stiffness).indices;
        let nominal_gains = properties.nominal_gains;
        let gains = places.iter().enumerate().filter_map(|(element, &drive)| {
            let gains = [Property::Stiffness, Property::DriveDamping, Property::MaxEffort];
            let drawn = |of: Property| properties.is_changed(of, element).then(|| values(of)[element]);
            let gains = gains.map(drawn);
            (nominal_gains || gains != [None; 3]).then_some((drive, gains))
        });
        let mut rows = drives.rows(self.editor.dof_frictionloss());
        if row.drives.has_rows(&rows) {
            rows = Vec::new();
        }
        if row.drives.has_damping(&damping) {
            damping = Vec::new();
        }
        Ok(EnvPatch { model, gains: gains.collect(), nominal_gains, damping, rows })
    }

    /// Writes the values that differ from the nominal ones. Returns true if MuJoCo's derived constants must be
    /// recomputed.
    fn edit(
        &mut self,
        properties: &Properties,
        drives: &DriveTable,
        damping: &mut [f64],
        env: usize,
    ) -> Result<bool, RandomizationError> {
        let (editor, base) = (&mut self.editor, &self.base);
        let damped = |dof: usize| drives.damped.iter().position(|(of, _)| *of == dof);
        let mut constants = false;
        // Joint damping comes before armature, which contains a part of it.
        for property in Property::ALL.into_iter().filter(|property| !property.is_gain()) {
            let (table, width) = (properties.tables.get(property), property.width());
            for (element, &place) in table.indices.iter().enumerate() {
                let at = element * width..(element + 1) * width;
                let value = &properties.values[property as usize][at.clone()];
                let dofs = || dofs_of(base, place);
                let with_more_damping = property == Property::Armature
                    && dofs().any(|dof| damped(dof).is_some_and(|k| damping[k] != drives.damped[k].1));
                if *value == table.nominal[at] && !with_more_damping {
                    continue;
                }
                match property {
                    Property::Mass => editor.body_mass_mut()[place] = value[0],
                    Property::CenterOfMass => {
                        let com = [value[0], value[1], value[2]];
                        editor.set_center_of_mass(place, com).map_err(|DiagonalInertia| {
                            RandomizationError::DiagonalInertia { env, name: table.names[element].clone() }
                        })?;
                    }
                    Property::Inertia => editor.body_inertia_mut()[3 * place..3 * place + 3].copy_from_slice(value),
                    Property::Friction => editor.geom_friction_mut()[3 * place] = value[0],
                    Property::TorsionalFriction => editor.geom_friction_mut()[3 * place + 1] = value[0],
                    Property::RollingFriction => editor.geom_friction_mut()[3 * place + 2] = value[0],
                    Property::JointDamping => {
                        for dof in dofs() {
                            match damped(dof) {
                                Some(k) => damping[k] = value[0],
                                None => editor.dof_damping_mut()[dof] = value[0],
                            }
                        }
                    }
                    Property::Armature => {
                        for dof in dofs() {
                            // The part of the implicit damping that the armature contains: see `drive::implicit`.
                            let implicit = damped(dof).map_or(0.0, |k| base.timestep() * damping[k]);
                            editor.dof_armature_mut()[dof] = value[0] + implicit;
                        }
                    }
                    Property::DryFriction => match friction_location(base, drives, place) {
                        Some(FrictionLocation::Tendon(tendon)) => editor.tendon_frictionloss_mut()[tendon] = value[0],
                        Some(FrictionLocation::Joint) => {
                            dofs().for_each(|dof| editor.dof_frictionloss_mut()[dof] = value[0]);
                        }
                        None => {}
                    },
                    Property::Gravity => editor.set_gravity([value[0], value[1], value[2]]),
                    Property::Size => editor.set_geom_size(place, [value[0], value[1], value[2]]),
                    Property::Color => {
                        let color = editor.geom_rgba_mut()[4 * place..4 * place + 4].iter_mut();
                        color.zip(value).for_each(|(to, from)| *to = *from as f32);
                    }
                    Property::Position => editor.body_pos_mut()[3 * place..3 * place + 3].copy_from_slice(value),
                    Property::Rotation => {
                        let length = value.iter().map(|x| x * x).sum::<f64>().sqrt();
                        let quat = editor.body_quat_mut()[4 * place..4 * place + 4].iter_mut();
                        quat.zip(value).for_each(|(to, from)| *to = from / length);
                    }
                    Property::LinearDamping | Property::AngularDamping => {
                        editor.dof_damping_mut()[place..place + 3].fill(value[0]);
                    }
                    Property::Stiffness | Property::DriveDamping | Property::MaxEffort => {}
                }
                constants |= matches!(
                    property,
                    Property::Mass
                        | Property::CenterOfMass
                        | Property::Inertia
                        | Property::Armature
                        | Property::Size
                        | Property::Position
                        | Property::Rotation
                );
            }
        }
        Ok(constants)
    }
}

/// Checks randomized gains and limits, and those that are set, against the explicit models of the drives.
fn check_models(properties: &Properties, drives: &DriveState, env: usize) -> Result<(), RandomizationError> {
    let table = properties.tables.get(Property::MaxEffort);
    for (element, (name, &drive)) in table.names.iter().zip(&table.indices).enumerate() {
        let asked = |of: Property| properties.is_changed(of, element).then(|| properties.values[of as usize][element]);
        let [kp, kd, max_effort] = [Property::Stiffness, Property::DriveDamping, Property::MaxEffort].map(asked);
        let Some(explicit) = drives.table().model_of(drive) else { continue };
        if kp.or(kd).or(max_effort).is_none() {
            continue;
        }
        let now = if properties.nominal_gains { drives.table().drives[drive].initial } else { drives.gains[drive] };
        let gains = Gains {
            kp: kp.unwrap_or(now.kp),
            kd: kd.unwrap_or(now.kd),
            max_effort: max_effort.unwrap_or(now.max_effort),
            max_velocity: now.max_velocity,
        };
        let fault = |expected| RandomizationError::Model { env, name: name.clone(), expected };
        explicit.model.law().check(&gains).map_err(fault)?;
    }
    Ok(())
}

impl EnvPatch {
    /// Differences of the environment's model from the compiled one.
    pub(super) fn model_patch(&self) -> Option<&ModelPatch> {
        self.model.as_ref()?.as_deref()
    }

    /// Memory besides the struct \[bytes\].
    pub(super) fn bytes(&self) -> usize {
        let lists = size_of_val(&*self.gains) + size_of_val(&*self.damping) + size_of_val(&*self.rows);
        self.model_patch().map_or(0, ModelPatch::bytes) + lists
    }

    /// Applies the model and the drive settings to the row of the environment. `model` is the compiled model.
    pub(crate) fn apply(self, row: &mut EnvRow, model: &Model) {
        for (drive, gains) in self.gains {
            if self.nominal_gains {
                row.drives.reset_to_nominal(drive);
            }
            row.drives.override_gains(drive, gains);
        }
        row.drives.set_damping(&self.damping);
        row.drives.set_rows(&self.rows);
        if let Some(patch) = self.model {
            row.set_patch(patch.as_ref(), model);
        }
    }
}
