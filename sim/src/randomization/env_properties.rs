//! Access to properties of environments through the manager.

use super::{Properties, Property, Randomization};
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_mask};
use crate::manager::SimulationManager;
use crate::objects::unique_envs;
use crate::row::StoredRow;
use crate::snapshot::Snapshot;
use kinetoscope_scene::KeyedRng;
use ndarray::Array2;

impl SimulationManager {
    /// Read access to properties of environments: masses, frictions, sizes, gains.
    pub fn properties(&self) -> EnvProperties<'_> {
        EnvProperties::new(self)
    }

    /// Write access to properties of environments: randomizes, sets and resets them.
    pub fn properties_mut(&mut self) -> EnvPropertiesMut<'_> {
        EnvPropertiesMut::new(self)
    }
}

/// Read access to properties of environments: masses, frictions, sizes, gains; see [`SimulationManager::properties`].
///
/// The environments of a simulation share one compiled model. An environment with properties of its own keeps the numbers
/// in which its model differs, the constants that follow from masses included (MuJoCo's `mj_setConst`). A thread writes
/// them to arrays of its own while it works on the environment.
///
/// Random numbers are keyed by the seed of the simulation, the global index of the environment, the number of its
/// previous randomizations (calls that selected it), and the property and name. So they depend neither on the number of
/// environments and processes, nor on other environments, nor on other random quantities.
///
/// Properties stay until they are randomized or set again, gains of drives included.
/// [`reset`](crate::SimulationManager::reset) and [`restore`](crate::SimulationManager::restore) keep them
/// ([`EnvPropertiesMut::restore`] does not), and when entities are added to the scene, they are carried over by name. A
/// randomized gain that is then set at run time is a setting of the drive again, also if it is set to its nominal
/// value.
///
/// Cameras, ray casters and overviews use the sizes, colors and poses of each environment. Computations without MuJoCo
/// use the nominal values: inverse kinematics and dynamics of descriptions, `total_mass` of robots, `nominal_mass` of
/// objects, and the gravity that an `Imu` adds.
#[derive(Clone, Copy, Debug)]
pub struct EnvProperties<'a> {
    sim: &'a SimulationManager,
}

impl<'a> EnvProperties<'a> {
    pub(crate) fn new(sim: &'a SimulationManager) -> Self {
        Self { sim }
    }

    /// Returns a copy of the properties of an environment. Changes to the copy have no effect.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn of(&self, env: EnvId) -> Result<Properties> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let tables = self.sim.simulation.tables();
        let simulation = &self.sim.simulation;
        Ok(simulation.batch.read_row(env.0, |row| simulation.properties_of(tables, env.0, &row)))
    }

    /// Memory of an environment's own properties \[bytes\]: the numbers in which its model differs from the shared one
    /// (with those of the welds that hold), and values that its model does not have, such as joint damping that its
    /// drives apply. The list of places of these numbers, which environments share, counts in equal parts. 0 if all
    /// properties are nominal, whatever welds hold. Gains and limits of drives do not count. In addition, one whole copy
    /// of the model is kept for all environments, and one of the arrays that differ for each thread.
    ///
    /// # Errors
    /// The environment does not exist.
    pub fn bytes(&self, env: EnvId) -> Result<usize> {
        env_mask(Some(&[env]), self.sim.num_envs())?;
        let own = &self.sim.simulation.property_overrides[env.0];
        if own.is_nominal() {
            return Ok(0);
        }
        let patch = |row: StoredRow<'_>| row.patch.as_ref().map_or(0, |patch| patch.bytes());
        Ok(self.sim.simulation.batch.read_row(env.0, patch) + own.bytes())
    }
}

/// Write access to properties of environments: randomizes, sets, resets and restores them; see
/// [`SimulationManager::properties_mut`].
#[derive(Debug)]
pub struct EnvPropertiesMut<'a> {
    sim: &'a mut SimulationManager,
}

impl<'a> EnvPropertiesMut<'a> {
    pub(crate) fn new(sim: &'a mut SimulationManager) -> Self {
        Self { sim }
    }

    /// Randomizes properties of environments (`None` for all environments). Properties without a term stay unchanged. A
    /// forward pass follows, when the environment is read or stepped.
    ///
    /// # Errors
    /// An environment does not exist, a pattern is invalid or matches nothing, two terms of one property match the same
    /// name, the ends of a range are not finite or in the wrong order, or a value is invalid, such as a negative mass;
    /// then nothing changes.
    pub fn randomize(&mut self, randomization: &Randomization, env_ids: Option<&[EnvId]>) -> Result<()> {
        let resolved = randomization.resolve(&self.sim.properties().of(EnvId(0))?)?;
        let keys = self.rng_keys();
        // One buffer for all texts: there is a key for each environment, property and name.
        let mut what = String::new();
        self.randomize_counted(env_ids, |env, properties| {
            resolved.apply(properties, |property, name| {
                what.clear();
                what.extend(["/", property.name(), "/", name]);
                keys(env, &what)
            });
            Ok(())
        })
    }

    /// Changes properties by a function, which is called once for each selected environment (all for `None`), in
    /// ascending order. Its arguments are random numbers of the environment, the index of the environment in this
    /// manager, and its properties. The function may ignore the random numbers, and just set properties. Each call
    /// counts as a randomization of these environments.
    ///
    /// # Errors
    /// An environment does not exist, the function fails, or a value is invalid; then nothing changes.
    pub fn randomize_with(
        &mut self,
        env_ids: Option<&[EnvId]>,
        mut change: impl FnMut(&mut KeyedRng, EnvId, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let keys = self.rng_keys();
        self.randomize_counted(env_ids, |env, properties| change(&mut keys(env, ""), EnvId(env), properties))
    }

    /// Sets a property of a link, object or joint: one row of values for each of `env_ids` (all environments for
    /// `None`), or one row for all. Does not count as a randomization.
    ///
    /// # Errors
    /// The shape of `values` does not fit, an environment does not exist or is repeated, no element of this name has the
    /// property, or a value is invalid; then nothing changes.
    pub fn set(
        &mut self,
        property: Property,
        name: &str,
        values: &Array2<f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let envs = unique_envs("env_ids", env_ids, self.sim.num_envs())?;
        let (rows, width) = values.dim();
        if width != property.width() || (rows != 1 && rows != envs.len()) {
            return Err(Error::Shape {
                argument: "properties.set",
                found: vec![rows, width],
                expected: vec![envs.len(), property.width()],
                meaning: "environments, values",
            });
        }
        self.change(env_ids, |env, properties| {
            let row = envs.iter().position(|chosen| *chosen == env).unwrap_or(0);
            let row: Vec<f64> = values.row(row % rows).to_vec();
            properties.set(property, name, &row)
        })
    }

    /// Resets environments to the nominal properties (all environments for `None`), gains and effort limits of drives
    /// included, also those that were set at run time. The environments then share the whole model again. The number of
    /// their randomizations stays.
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

    /// Restores a snapshot like [`SimulationManager::restore`], together with the properties of each environment at the
    /// time of the snapshot.
    ///
    /// The properties are the environment's own values, randomized gains included, and the number of its
    /// randomizations, so that the next randomization gives the values of the one that followed the snapshot.
    /// Properties that were nominal become nominal. The simulation continues bit-identically, also from a file in a
    /// manager that was built alike, whatever was randomized or set in between.
    ///
    /// ```
    /// use kinetoscope_sim::{
    ///     RandomizationOp, EnvId, ObjectShape, Property, Randomization, RigidObjectCfg, SimulationManager,
    ///     SimulationManagerCfg,
    /// };
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 4, ..Default::default() })?;
    /// let shape = ObjectShape::cube(0.1);
    /// sim.add_rigid_object(RigidObjectCfg { uid: "cube".into(), shape, ..Default::default() })?;
    /// let draw = Randomization::new().with(Property::Mass, "cube", RandomizationOp::Scale([0.5, 2.0]));
    /// sim.properties_mut().randomize(&draw, None)?;
    /// let mass = sim.properties().of(EnvId(2))?.get(Property::Mass, "cube")?.to_vec();
    /// let snapshot = sim.snapshot(None)?;
    /// sim.properties_mut().randomize(&draw, None)?;
    /// sim.properties_mut().restore(&snapshot, None)?;
    /// assert_eq!(sim.properties().of(EnvId(2))?.get(Property::Mass, "cube")?, mass);
    /// # Ok::<(), kinetoscope_sim::Error>(())
    /// ```
    ///
    /// # Errors
    /// As [`SimulationManager::restore`]. Also an error if no element of this scene has one of the properties, or if a
    /// value is invalid for it. Then nothing is restored.
    pub fn restore(&mut self, snapshot: &Snapshot, env_ids: Option<&[EnvId]>) -> Result<()> {
        self.sim.restore_with_properties(snapshot, env_ids)
    }

    /// Random numbers of the next randomization, by environment and purpose.
    fn rng_keys(&self) -> impl Fn(usize, &str) -> KeyedRng + use<> {
        let (seed, first, draws) = (self.sim.cfg.seed, self.sim.cfg.first_env(), self.sim.randomization_count.clone());
        move |env, what| KeyedRng::keyed(seed, (first + env) as u64, &format!("properties/{}{what}", draws[env]))
    }

    /// Changes properties with random numbers, and counts the randomization.
    fn randomize_counted(
        &mut self,
        env_ids: Option<&[EnvId]>,
        change: impl FnMut(usize, &mut Properties) -> Result<()>,
    ) -> Result<()> {
        let chosen = env_mask(env_ids, self.sim.num_envs())?;
        self.change(env_ids, change)?;
        let counted = self.sim.randomization_count.iter_mut().zip(chosen);
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
