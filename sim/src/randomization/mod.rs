//! Properties of single environments: masses, friction, gravity, gains, sizes, colors and more, randomized or set.

mod apply;
mod env_properties;
mod error;
mod named;
mod properties;
mod property;
mod tables;
mod terms;

use apply::Made;
pub(crate) use apply::Maker;
pub use env_properties::{EnvProperties, EnvPropertiesMut};
pub use error::RandomizationError;
pub(crate) use named::NamedValue;
pub(crate) use properties::OwnValues;
pub use properties::Properties;
pub use property::Property;
use tables::Beside;
pub(crate) use tables::Tables;
pub use terms::{Draw, Randomization, Term};

use crate::env::Env;
use crate::error::Result;
use crate::simulation::Simulation;
use kinetoscope_scene::{OwnScene, RenderSceneError};
use std::sync::Arc;

impl Simulation {
    /// Tables of the properties of the scene, created on first use.
    pub(crate) fn tables(&self) -> &Arc<Tables> {
        self.tables.get_or_init(|| {
            let drives = self.batch.read(0, |env| Arc::clone(env.drives.table()));
            let standing: Vec<usize> = self.objects.iter().filter(|object| object.stands()).map(|o| o.body).collect();
            let beside = Beside { proxies: &self.proxies, standing: &standing };
            Arc::new(Tables::of(self.batch.model(), &drives, beside))
        })
    }

    fn properties_of(&self, tables: &Arc<Tables>, index: usize, env: &Env) -> Properties {
        let own = self.own_values[index].as_deref().unwrap_or(&NOTHING);
        Properties::new(tables, own, &env.drives)
    }

    /// Own property values of an environment, `here`, by name.
    pub(crate) fn named_properties(&self, env: usize, here: &Env) -> Vec<NamedValue> {
        self.tables().named(self.own_values[env].as_deref().unwrap_or(&NOTHING), &here.drives)
    }

    /// Reads a scalar property (not a gain) of the element `name` in every environment. Does nothing if no such element
    /// has it.
    pub(crate) fn property_of_all(&self, property: Property, name: &str, mut read: impl FnMut(usize, f64)) {
        let table = self.tables().get(property);
        let Some(element) = table.names.iter().position(|of| of == name) else { return };
        for (env, own) in self.own_values.iter().enumerate() {
            let own = own.as_ref().and_then(|own| own[property as usize].as_ref());
            read(env, own.map_or(table.nominal[element], |values| values[element]));
        }
    }

    /// True for each name of an element that has the property.
    pub(crate) fn properties_named(&self, property: Property, names: &[String]) -> Vec<bool> {
        let table = self.tables().get(property);
        names.iter().map(|name| table.names.contains(name)).collect()
    }

    /// Changes the properties of environments. On an error no environment is changed.
    pub(crate) fn change_properties(
        &mut self,
        envs: &[usize],
        mut change: impl FnMut(usize, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let mut maker = match self.maker.take() {
            Some(maker) => maker,
            None => Maker::new(self.batch.model())?,
        };
        // Created before an environment is locked: the creation reads an environment.
        let tables = Arc::clone(self.tables());
        let made: Result<Vec<_>> = envs
            .iter()
            .map(|&index| {
                self.batch.edit(index, |env| {
                    let mut properties = self.properties_of(&tables, index, env);
                    change(index, &mut properties)?;
                    let own = properties.own();
                    let made = maker.make(&properties, &own, index, env)?;
                    Ok((index, own, made))
                })
            })
            .collect();
        self.maker = Some(maker);
        let made = made?;
        let looks_other = |(index, own, _): &&(usize, OwnValues, Made)| {
            let before = self.own_values[*index].as_deref().unwrap_or(&NOTHING);
            [Property::Size, Property::Color].iter().any(|p| before[*p as usize] != own[*p as usize])
        };
        let others: Vec<_> = made.iter().filter(looks_other).map(|(index, own, _)| (*index, own)).collect();
        let mut looks = Vec::with_capacity(others.len());
        for (env, look) in self.looks(&others) {
            looks.push((env, look.map_err(|error| RandomizationError::Look { env, error })?));
        }
        for (index, own, made) in made {
            self.own_values[index] = own.iter().any(Option::is_some).then(|| own.into());
            self.batch.edit(index, |env| made.give(env));
        }
        self.look_so(looks);
        Ok(())
    }

    /// Render scenes of environments with these own values; empty while the scene is not rendered.
    fn looks(&self, envs: &[(usize, &OwnValues)]) -> Vec<(usize, Result<OwnScene, RenderSceneError>)> {
        let of = |own: &&OwnValues, property: Property| own[property as usize].is_some();
        let looks_own = |own: &&OwnValues| of(own, Property::Size) || of(own, Property::Color);
        let Some(visible) = &self.visible else { return Vec::new() };
        if self.own_scenes.is_empty() && !envs.iter().any(|(_, own)| looks_own(own)) {
            return Vec::new();
        }
        let tables = self.tables();
        let scene = |own: &OwnValues| {
            if !looks_own(&own) {
                return Ok(OwnScene(None));
            }
            let [sizes, colors] = [Property::Size, Property::Color].map(|property| {
                let values = own[property as usize].as_deref().unwrap_or(&[]);
                tables.get(property).changes(property.width(), values)
            });
            visible.own_scene(self.batch.model(), &sizes, &colors)
        };
        envs.iter().map(|(env, own)| (*env, scene(own))).collect()
    }

    /// Sets the render scenes of these environments.
    fn look_so(&mut self, looks: Vec<(usize, OwnScene)>) {
        if !looks.is_empty() {
            self.own_scenes.resize(self.own_values.len(), OwnScene(None));
        }
        looks.into_iter().for_each(|(env, look)| self.own_scenes[env] = look);
    }

    /// Builds the render scenes of all environments when rendering starts. An environment whose scene is invalid is
    /// rendered with the nominal scene; its error is returned.
    pub(crate) fn look_anew(&mut self) -> Vec<(usize, RenderSceneError)> {
        let own = self.own_values.iter().map(|own| own.as_deref().unwrap_or(&NOTHING));
        let (mut looks, mut faults) = (Vec::new(), Vec::new());
        for (env, look) in self.looks(&own.enumerate().collect::<Vec<_>>()) {
            match look {
                Ok(look) => looks.push((env, look)),
                Err(error) => faults.push((env, error)),
            }
        }
        self.look_so(looks);
        faults
    }

    /// Carries over the own property values of the environments of `old`, by name.
    pub(crate) fn carry_properties(&mut self, old: &Self) -> Result<()> {
        let envs: Vec<usize> = (0..old.own_values.len()).filter(|&env| old.own_values[env].is_some()).collect();
        if envs.is_empty() {
            return Ok(());
        }
        let tables = Arc::clone(self.tables());
        self.change_properties(&envs, |env, properties| {
            if let Some(own) = &old.own_values[env] {
                let own = Properties::carried_to(own, old.tables(), &tables);
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
const NOTHING: OwnValues = [const { None }; Property::ALL.len()];
