//! Properties of single environments: masses, friction, gravity, gains, sizes, colors and more, randomized or set.

mod apply;
mod env_properties;
mod error;
mod named;
mod overrides;
mod properties;
mod property;
mod tables;
mod terms;

use apply::EnvPatch;
pub(crate) use apply::ModelPatcher;
pub use env_properties::{EnvProperties, EnvPropertiesMut};
pub use error::RandomizationError;
pub(crate) use named::NamedValue;
pub(crate) use overrides::StoredOverrides;
pub use properties::Properties;
pub(crate) use properties::PropertyOverrides;
pub use property::Property;
pub(crate) use tables::PropertyTables;
use tables::SceneContext;
pub use terms::{Randomization, RandomizationOp, RandomizationTerm};

use crate::available_memory::available_memory;
use crate::env::SimEnv;
use crate::error::Result;
use crate::row::{EnvRow, RowPart};
use crate::simulation::Simulation;
use kinetoscope_mujoco::ModelPatch;
use kinetoscope_scene::{EnvScene, RenderSceneError};
use std::sync::{Arc, PoisonError};

impl Simulation {
    /// Tables of the properties of the scene, created on first use.
    pub(crate) fn tables(&self) -> &Arc<PropertyTables> {
        self.property_tables.get_or_init(|| {
            let drives = self.batch.read_row(0, |row| Arc::clone(row.drives.table()));
            let standing: Vec<usize> =
                self.objects.iter().filter(|object| object.is_static()).map(|o| o.body).collect();
            let beside = SceneContext { proxies: &self.visual_proxies, static_bodies: &standing };
            Arc::new(PropertyTables::of(self.batch.model(), &drives, beside))
        })
    }

    /// Own property values of an environment with this patch.
    fn overrides_in(&self, env: usize, patch: Option<&Arc<ModelPatch>>) -> PropertyOverrides {
        let stored = &self.property_overrides[env];
        if stored.is_nominal() {
            return NO_OVERRIDES;
        }
        stored.all(self.tables(), self.batch.model(), patch.map(|patch| &**patch))
    }

    /// Own property values of an environment.
    fn overrides_of(&self, env: usize) -> PropertyOverrides {
        // Created before an environment is locked: the creation reads an environment.
        self.tables();
        self.batch.read_row(env, |row| self.overrides_in(env, row.patch.as_ref()))
    }

    /// Properties of the environment `env`, whose row is `row`.
    fn properties_of(&self, tables: &Arc<PropertyTables>, env: usize, row: &EnvRow) -> Properties {
        Properties::new(tables, &self.overrides_in(env, row.patch.as_ref()), &row.drives)
    }

    /// Own property values of an environment, `here`, by name.
    pub(crate) fn named_properties(&self, env: usize, here: &SimEnv) -> Vec<NamedValue> {
        self.tables().named_overrides(&self.overrides_in(env, here.patch.as_ref()), &here.drives)
    }

    /// Reads a scalar property (not a gain) of the element `name` in every environment. Does nothing if no such element
    /// has it.
    pub(crate) fn read_property(&self, property: Property, name: &str, mut read: impl FnMut(usize, f64)) {
        let tables = self.tables();
        let table = tables.get(property);
        let Some(element) = table.names.iter().position(|of| of == name) else { return };
        self.batch.for_each_row(RowPart::Inputs, |env, row| {
            let own = self.property_overrides[env].get(property, tables, row.model, row.patch.as_deref());
            read(env, own.map_or(table.nominal[element], |values| values[element]));
        });
    }

    /// True for each name of an element that has the property.
    pub(crate) fn have_property(&self, property: Property, names: &[String]) -> Vec<bool> {
        let table = self.tables().get(property);
        names.iter().map(|name| table.names.contains(name)).collect()
    }

    /// Changes the properties of environments. On an error no environment is changed.
    pub(crate) fn change_properties(
        &mut self,
        envs: &[usize],
        mut change: impl FnMut(usize, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let mut maker = match self.model_patcher.get_mut().unwrap_or_else(PoisonError::into_inner).take() {
            Some(maker) => maker,
            None => ModelPatcher::new(self.batch.model())?,
        };
        // Created before an environment is locked: the creation reads an environment.
        let tables = Arc::clone(self.tables());
        let made = self.prepare_changes(&mut maker, &tables, envs, &mut change);
        *self.model_patcher.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(maker);
        let (made, others) = made?;
        let others: Vec<_> = others.iter().map(|(env, own)| (*env, own)).collect();
        let mut looks = Vec::with_capacity(others.len());
        for (env, look) in self.env_scenes(&others) {
            looks.push((env, look.map_err(|error| RandomizationError::EnvScene { env, error })?));
        }
        for (index, own, made) in made {
            self.property_overrides[index] = own;
            self.batch.edit_row(index, |row, model| made.apply(row, model));
        }
        self.set_env_scenes(looks);
        Ok(())
    }

    /// Prepares a change of the properties of environments. Returns what to store and to apply, and the own values of
    /// environments whose sizes or colors change.
    fn prepare_changes(
        &self,
        maker: &mut ModelPatcher,
        tables: &Arc<PropertyTables>,
        envs: &[usize],
        mut change: impl FnMut(usize, &mut Properties) -> Result<()>,
    ) -> Result<PreparedChanges> {
        let mut properties = self.batch.read_row(0, |row| Properties::new(tables, &NO_OVERRIDES, &row.drives));
        let (mut made, mut others) = (Vec::with_capacity(envs.len()), Vec::new());
        let mut memory = MemoryCheck::default();
        for &index in envs {
            self.batch.read_row(index, |row| -> Result<()> {
                let before = &self.property_overrides[index];
                properties.load(&self.overrides_in(index, row.patch.as_ref()), &row.drives);
                change(index, &mut properties)?;
                let own = properties.overrides();
                self.check_for_device(tables, &own)?;
                let patch = maker.prepare(&properties, &own, index, row.row)?;
                let stored = StoredOverrides::new(&own, tables, row.model, patch.model_patch());
                let looks_other = [Property::Size, Property::Color].into_iter().any(|property| {
                    let mine = &own[property as usize];
                    (before.has(property) || mine.is_some())
                        && before.get(property, tables, row.model, row.patch.as_deref()) != *mine
                });
                if looks_other {
                    others.push((index, own));
                }
                let bytes = size_of::<PreparedChange>() + stored.bytes() + patch.bytes();
                memory.add(envs.len(), bytes, available_memory)?;
                made.push((index, stored, patch));
                Ok(())
            })?;
        }
        Ok((made, others))
    }

    /// Refuses own values that a device cannot give to its environments.
    fn check_for_device(&self, tables: &PropertyTables, own: &PropertyOverrides) -> Result<(), RandomizationError> {
        let own = own[Property::Size as usize].as_deref();
        let Some(sizes) = own.filter(|_| self.batch.is_on_device()) else { return Ok(()) };
        let (table, width) = (tables.get(Property::Size), Property::Size.width());
        let elements = sizes.chunks(width).zip(table.nominal.chunks(width)).zip(&table.names);
        let changed = elements.into_iter().find(|((own, nominal), _)| own != nominal);
        let Some((_, name)) = changed else { return Ok(()) };
        let reason = "a device has one size for all environments; use the device cpu, or a simulation for each size";
        Err(RandomizationError::NoSizeProperty { name: name.clone(), reason })
    }

    /// Render scenes of environments with these own values; empty while the scene is not rendered.
    fn env_scenes(&self, envs: &[(usize, &PropertyOverrides)]) -> Vec<(usize, Result<EnvScene, RenderSceneError>)> {
        let of = |own: &&PropertyOverrides, property: Property| own[property as usize].is_some();
        let looks_own = |own: &&PropertyOverrides| of(own, Property::Size) || of(own, Property::Color);
        let Some(visible) = &self.visual_scene else { return Vec::new() };
        if self.env_scenes.is_empty() && !envs.iter().any(|(_, own)| looks_own(own)) {
            return Vec::new();
        }
        let tables = self.tables();
        let scene = |own: &PropertyOverrides| {
            if !looks_own(&own) {
                return Ok(EnvScene(None));
            }
            let [sizes, colors] = [Property::Size, Property::Color].map(|property| {
                let values = own[property as usize].as_deref().unwrap_or(&[]);
                tables.get(property).changes(property.width(), values)
            });
            visible.env_scene(self.batch.model(), &sizes, &colors)
        };
        envs.iter().map(|(env, own)| (*env, scene(own))).collect()
    }

    /// Sets the render scenes of these environments.
    fn set_env_scenes(&mut self, looks: Vec<(usize, EnvScene)>) {
        if !looks.is_empty() {
            self.env_scenes.resize(self.property_overrides.len(), EnvScene(None));
        }
        looks.into_iter().for_each(|(env, look)| self.env_scenes[env] = look);
    }

    /// Builds the render scenes of all environments when rendering starts. An environment whose scene is invalid is
    /// rendered with the nominal scene; its error is returned.
    pub(crate) fn rebuild_env_scenes(&mut self) -> Vec<(usize, RenderSceneError)> {
        let own: Vec<_> = (0..self.property_overrides.len()).map(|env| self.overrides_of(env)).collect();
        let (mut looks, mut faults) = (Vec::new(), Vec::new());
        for (env, look) in self.env_scenes(&own.iter().enumerate().collect::<Vec<_>>()) {
            match look {
                Ok(look) => looks.push((env, look)),
                Err(error) => faults.push((env, error)),
            }
        }
        self.set_env_scenes(looks);
        faults
    }

    /// Carries over the own property values of the environments of `old`, by name.
    pub(crate) fn carry_properties(&mut self, old: &Self) -> Result<()> {
        let envs: Vec<usize> =
            (0..old.property_overrides.len()).filter(|&env| !old.property_overrides[env].is_nominal()).collect();
        if envs.is_empty() {
            return Ok(());
        }
        let tables = Arc::clone(self.tables());
        self.change_properties(&envs, |env, properties| {
            let own = Properties::transferred(&old.overrides_of(env), old.tables(), &tables);
            for (values, own) in properties.values.iter_mut().zip(own) {
                if let Some(own) = own {
                    *values = own.into();
                }
            }
            Ok(())
        })
    }
}

/// Environment, and its own values and model, which are prepared.
type PreparedChange = (usize, StoredOverrides, EnvPatch);

/// All prepared environments, and the own values of those whose sizes or colors change.
type PreparedChanges = (Vec<PreparedChange>, Vec<(usize, PropertyOverrides)>);

/// Memory of prepared changes, compared with the available memory.
#[derive(Debug, Default)]
struct MemoryCheck {
    /// Sum of all changes so far \[bytes\].
    bytes: usize,
    /// Largest sum that fits. `None` if it is not known, or not read yet.
    limit: Option<usize>,
    is_limit_read: bool,
}

impl MemoryCheck {
    /// Sum that is not checked \[bytes\]. To read the limit takes as long as the changes of several environments.
    const UNCHECKED: usize = 16 << 20;
    /// Header and padding of a block of the allocator, for each list of a change and for its patch.
    const BLOCKS: usize = 16 * 6;

    /// Adds a change of `bytes` to those that are in memory already, of `envs` environments in all. `available` returns
    /// the memory that is still available, `None` if it is not known; it is called at most once.
    fn add(
        &mut self,
        envs: usize,
        bytes: usize,
        available: impl FnOnce() -> Option<usize>,
    ) -> Result<(), RandomizationError> {
        self.bytes = self.bytes.saturating_add(bytes + Self::BLOCKS);
        if self.bytes > Self::UNCHECKED && !self.is_limit_read {
            self.is_limit_read = true;
            self.limit = available().map(|available| self.bytes.saturating_add(available));
        }
        match self.limit {
            Some(limit) if self.bytes > limit => Err(RandomizationError::OutOfMemory { envs, bytes: self.bytes }),
            _ => Ok(()),
        }
    }
}

/// Own values of an environment without any.
const NO_OVERRIDES: PropertyOverrides = [const { None }; Property::ALL.len()];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory() {
        const MIB: usize = 1 << 20;
        let change = |mib: usize| mib * MIB - MemoryCheck::BLOCKS;
        // Environments differ: the sum counts, not the first one.
        let mut check = MemoryCheck::default();
        for mib in [1, 15] {
            check.add(4, change(mib), || panic!("little memory is not checked")).expect("little");
        }
        // 17 MiB in use, 10 MiB available.
        check.add(4, change(1), || Some(10 * MIB)).expect("fits");
        check.add(4, change(10), || panic!("the limit is read once")).expect("fits exactly");
        let refused = check.add(4, 0, || None).expect_err("96 bytes do not fit").to_string();
        assert!(refused.contains("4 environments need more than 27 MiB"), "{refused}");
        let mut unknown = MemoryCheck::default();
        (0..3).for_each(|_| unknown.add(1 << 20, usize::MAX / 2, || None).expect("nothing is known"));
    }
}
