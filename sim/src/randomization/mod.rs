//! Properties of single environments: masses, friction, gravity, gains, sizes, colors and more, randomized or set.

mod apply;
mod env_properties;
mod error;
mod named;
mod properties;
mod property;
mod tables;
mod terms;

use apply::EnvPatch;
pub(crate) use apply::ModelPatcher;
pub use env_properties::{EnvProperties, EnvPropertiesMut};
pub use error::RandomizationError;
pub(crate) use named::NamedValue;
pub use properties::Properties;
pub(crate) use properties::PropertyOverrides;
pub use property::Property;
pub(crate) use tables::PropertyTables;
use tables::SceneContext;
pub use terms::{Randomization, RandomizationOp, RandomizationTerm};

use crate::env::{SimEnv, Stage};
use crate::error::Result;
use crate::simulation::Simulation;
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

    fn properties_of(&self, tables: &Arc<PropertyTables>, index: usize, env: &SimEnv) -> Properties {
        let own = self.property_overrides[index].as_deref().unwrap_or(&NO_OVERRIDES);
        Properties::new(tables, own, &env.drives)
    }

    /// Own property values of an environment, `here`, by name.
    pub(crate) fn named_properties(&self, env: usize, here: &SimEnv) -> Vec<NamedValue> {
        self.tables().named_overrides(self.property_overrides[env].as_deref().unwrap_or(&NO_OVERRIDES), &here.drives)
    }

    /// Reads a scalar property (not a gain) of the element `name` in every environment. Does nothing if no such element
    /// has it.
    pub(crate) fn read_property(&self, property: Property, name: &str, mut read: impl FnMut(usize, f64)) {
        let table = self.tables().get(property);
        let Some(element) = table.names.iter().position(|of| of == name) else { return };
        for (env, own) in self.property_overrides.iter().enumerate() {
            let own = own.as_ref().and_then(|own| own[property as usize].as_ref());
            read(env, own.map_or(table.nominal[element], |values| values[element]));
        }
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
        let made: Result<Vec<_>> = envs
            .iter()
            .map(|&index| {
                self.batch.read_at(index, Stage::Raw, |env| {
                    let mut properties = self.properties_of(&tables, index, env);
                    change(index, &mut properties)?;
                    let own = properties.overrides();
                    let made = maker.prepare(&properties, &own, index, env)?;
                    Ok((index, own, made))
                })
            })
            .collect();
        *self.model_patcher.get_mut().unwrap_or_else(PoisonError::into_inner) = Some(maker);
        let made = made?;
        let looks_other = |(index, own, _): &&(usize, PropertyOverrides, EnvPatch)| {
            let before = self.property_overrides[*index].as_deref().unwrap_or(&NO_OVERRIDES);
            [Property::Size, Property::Color].iter().any(|p| before[*p as usize] != own[*p as usize])
        };
        let others: Vec<_> = made.iter().filter(looks_other).map(|(index, own, _)| (*index, own)).collect();
        let mut looks = Vec::with_capacity(others.len());
        for (env, look) in self.env_scenes(&others) {
            looks.push((env, look.map_err(|error| RandomizationError::EnvScene { env, error })?));
        }
        for (index, own, made) in made {
            self.property_overrides[index] = own.iter().any(Option::is_some).then(|| own.into());
            self.batch.write_at(index, Stage::Raw, |env| made.apply(env));
        }
        self.set_env_scenes(looks);
        Ok(())
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
        let own = self.property_overrides.iter().map(|own| own.as_deref().unwrap_or(&NO_OVERRIDES));
        let (mut looks, mut faults) = (Vec::new(), Vec::new());
        for (env, look) in self.env_scenes(&own.enumerate().collect::<Vec<_>>()) {
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
            (0..old.property_overrides.len()).filter(|&env| old.property_overrides[env].is_some()).collect();
        if envs.is_empty() {
            return Ok(());
        }
        let tables = Arc::clone(self.tables());
        self.change_properties(&envs, |env, properties| {
            if let Some(own) = &old.property_overrides[env] {
                let own = Properties::transferred(own, old.tables(), &tables);
                for (values, own) in properties.values.iter_mut().zip(own) {
                    if let Some(own) = own {
                        *values = own.into();
                    }
                }
            }
            Ok(())
        })
    }
}

/// Own values of an environment without any.
const NO_OVERRIDES: PropertyOverrides = [const { None }; Property::ALL.len()];
