//! Properties of environments through the manager.

use super::{OwnValues, Properties, Property, Randomization};
use crate::error::Result;
use crate::ids::{EnvId, env_mask};
use crate::manager::SimulationManager;
use crate::snapshot::Snapshot;
use kinetoscope_scene::Random;

impl SimulationManager {
    /// Properties of environments: masses, frictions, sizes, gains.
    pub fn properties(&self) -> EnvProperties<'_> {
        EnvProperties::new(self)
    }

    /// Properties of environments, to draw and to reset.
    pub fn properties_mut(&mut self) -> EnvPropertiesMut<'_> {
        EnvPropertiesMut::new(self)
    }
}

/// Properties of environments: masses, frictions, sizes, gains; see [`SimulationManager::properties`].
///
/// The environments of a simulation share one compiled model. One that has properties of its own gets a shallow copy of the
/// model's struct, in which only the arrays that differ are its own memory; what follows from masses (MuJoCo's
/// `mj_setConst`) is computed for it. Environments that were not touched share everything.
///
/// Random numbers are keyed by the seed of the simulation, the global index of the environment, how often that environment
/// was drawn for, and the property and name they are for. So they depend neither on the number of environments and
/// processes, nor on what other environments do, nor on what else is random.
///
/// Properties stay until they are drawn or set again: [`reset`](crate::SimulationManager::reset) and
/// [`restore`](crate::SimulationManager::restore) leave them alone
/// ([`EnvPropertiesMut::restore`] does not), gains of drives included, and when more is added to the scene they are carried over by
/// name. A gain that was drawn and is then set at run time is that of the drive's setting again; one that is set to its
/// nominal value, too. Cameras, ray casters and overviews see the sizes, colours and places of each
/// environment. What sees the scene without MuJoCo keeps the nominal values: inverse kinematics and dynamics of descriptions,
/// `total_mass` and `mass` of robots and objects, and the gravity that an `Imu` adds.
#[derive(Clone, Copy, Debug)]
pub struct EnvProperties<'a> {
    sim: &'a SimulationManager,
}

impl<'a> EnvProperties<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// The properties of an environment.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn of(&self, env: EnvId) -> Result<Properties> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let tables = self.sim.simulation.tables();
        Ok(self.sim.simulation.batch.edit(env.0, |here| self.sim.simulation.properties_of(tables, env.0, here)))
    }

    /// Memory that an environment's properties take \[bytes\]: the struct and the arrays of the model that it does not share
    /// (with those of the welds that hold in it), and the values as they were set; 0 where all properties are nominal, whatever
    /// welds hold. One whole copy of the model is kept beside, for all.
    ///
    /// # Errors
    /// There is no such environment.
    pub fn bytes(&self, env: EnvId) -> Result<usize> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let Some(own) = &self.sim.simulation.own_values[env.0] else { return Ok(0) };
        let values: usize = own.iter().flatten().map(|values| size_of_val(&**values)).sum();
        let model = self.sim.simulation.batch.read(env.0, |env| env.data().model().own_bytes());
        Ok(model + size_of::<OwnValues>() + values)
    }
}

/// Properties of environments, to draw, reset and restore; see [`SimulationManager::properties_mut`].
#[derive(Debug)]
pub struct EnvPropertiesMut<'a> {
    sim: &'a mut SimulationManager,
}

impl<'a> EnvPropertiesMut<'a> {
    pub(crate) fn new(sim: &'a mut SimulationManager) -> Self {
        Self { sim }
    }

    /// Draws properties for environments, all of them where `env_ids` is `None`. Properties that no term names stay as they
    /// are; a forward pass follows, when the environment is read or stepped.
    ///
    /// # Errors
    /// An environment does not exist, a pattern matches nothing or one name twice, a range is empty, or a value cannot be,
    /// such as a negative mass; then nothing changes.
    pub fn randomize(&mut self, randomization: &Randomization, env_ids: Option<&[EnvId]>) -> Result<()> {
        let resolved = randomization.resolve(&self.sim.properties().of(EnvId(0))?)?;
        let keys = self.keys();
        // One text for all: there is a key for each environment, property and name.
        let mut what = String::new();
        self.draw(env_ids, |env, properties| {
            resolved.draw(properties, |property, name| {
                what.clear();
                what.extend(["/", property.name(), "/", name]);
                keys(env, &what)
            });
            Ok(())
        })
    }

    /// As [`randomize`](Self::randomize), by a function that gets random numbers of the environment, its number in this
    /// manager, and its properties to change. To set properties it need not use the random numbers.
    ///
    /// # Errors
    /// An environment does not exist, the function fails, or a value cannot be; then nothing changes.
    pub fn randomize_with(
        &mut self,
        env_ids: Option<&[EnvId]>,
        mut change: impl FnMut(&mut Random, EnvId, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let keys = self.keys();
        self.draw(env_ids, |env, properties| change(&mut keys(env, ""), EnvId(env), properties))
    }

    /// Gives environments the nominal properties again, gains of drives included; they share the whole model then.
    ///
    /// # Errors
    /// An environment does not exist.
    pub fn reset(&mut self, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.change(env_ids, |_, properties| {
            properties.values = Property::ALL.map(|property| properties.tables.get(property).nominal.clone());
            properties.nominal_gains = true;
            Ok(())
        })
    }

    /// As [`SimulationManager::restore`], with the properties of each environment when the snapshot was taken: what it had for
    /// itself, gains that were drawn included, and how often it was drawn for, so that what is drawn next is what was drawn
    /// then. What was nominal becomes nominal. Going on is bit-identical, also from a file in a manager that was built
    /// alike, and whatever was drawn or set in between.
    ///
    /// ```
    /// use kinetoscope_sim::{Draw, ObjectShape, Property, Randomization, RigidObjectCfg, SimulationManager, SimulationManagerCfg};
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 4, ..Default::default() })?;
    /// sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), shape: ObjectShape::cube(0.1), ..Default::default() })?;
    /// let draw = Randomization::new().with(Property::Mass, "cube", Draw::Scale([0.5, 2.0]));
    /// sim.properties_mut().randomize(&draw, None)?;
    /// let (snapshot, mass) = (sim.snapshot(None)?, sim.properties().of(kinetoscope_sim::EnvId(2))?.get(Property::Mass, "cube")?.to_vec());
    /// sim.properties_mut().randomize(&draw, None)?;
    /// sim.properties_mut().restore(&snapshot, None)?;
    /// assert_eq!(sim.properties().of(kinetoscope_sim::EnvId(2))?.get(Property::Mass, "cube")?, mass);
    /// # Ok::<(), kinetoscope_sim::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`SimulationManager::restore`]; and where nothing of this scene has one of the properties, or not such a value. Then
    /// nothing is restored.
    pub fn restore(&mut self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.restore_with_properties(snapshot, env_ids)
    }

    /// The random numbers of the next draw for an environment, and what they are for.
    fn keys(&self) -> impl Fn(usize, &str) -> Random + use<> {
        let (seed, first, draws) = (self.sim.cfg.seed, self.sim.cfg.first_env(), self.sim.draws.clone());
        move |env, what| Random::keyed(seed, (first + env) as u64, &format!("properties/{}{what}", draws[env]))
    }

    /// Changes properties by random numbers: counts the draws.
    fn draw(
        &mut self,
        env_ids: Option<&[EnvId]>,
        change: impl FnMut(usize, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let chosen = env_mask(env_ids, self.sim.num_envs())?;
        self.change(env_ids, change)?;
        let counted = self.sim.draws.iter_mut().zip(chosen);
        counted.for_each(|(draws, chosen)| *draws = draws.wrapping_add(u64::from(chosen)));
        Ok(())
    }

    fn change(
        &mut self,
        env_ids: Option<&[EnvId]>,
        change: impl FnMut(usize, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let chosen = env_mask(env_ids, self.sim.num_envs())?;
        let envs: Vec<usize> = (0..chosen.len()).filter(|&env| chosen[env]).collect();
        self.sim.simulation.change_properties(&envs, change)?;
        self.sim.sensors.refresh(&envs, &mut self.sim.simulation);
        Ok(())
    }
}
