//! What resists the joints of a robot beside its drives, while it runs: dry friction, damping and rotor inertia, per joint
//! and per environment.
//!
//! They are in MuJoCo's model: an environment that gets others has these arrays for itself. They are among its
//! [`properties`](crate::SimulationManager::properties), so that random draws and these setters work on the same numbers.

use crate::error::Result;
use crate::ids::EnvId;
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::robot_data::JointIndex;
use crate::objects::rows::Numbers;
use crate::randomization::Property;
use ndarray::{Array2, ArrayView2, AsArray, Ix2};

impl Robot<'_> {
    /// Dry friction of the joints \[N m or N\], shape (N, dof); 0 for joints that have none.
    #[doc(alias = "get_friction")]
    pub fn friction(&self) -> Array2<f64> {
        self.property(Property::DryFriction)
    }

    /// Viscous damping of the joints themselves \[N m s/rad or N s/m\], shape (N, dof); 0 for joints that have none. The
    /// damping of the drives is not part of it: see [`damping`](Self::damping).
    #[doc(alias = "get_joint_damping")]
    pub fn joint_damping(&self) -> Array2<f64> {
        self.property(Property::JointDamping)
    }

    /// Rotor inertia of the joints \[kg m² or kg\], shape (N, dof).
    #[doc(alias = "get_armature")]
    pub fn armature(&self) -> Array2<f64> {
        self.property(Property::Armature)
    }

    /// A property of one number of every joint in every environment.
    fn property(&self, property: Property) -> Array2<f64> {
        let mut values = Array2::zeros((self.simulation.batch.num_envs(), self.dof()));
        for (joint, mut column) in values.columns_mut().into_iter().enumerate() {
            self.simulation.property_of_all(property, &property_name(self, joint), |env, value| column[env] = value);
        }
        values
    }
}

impl RobotMut<'_> {
    /// Sets the dry friction of joints \[N m or N\]. Rows are for `env_ids` (all where `None`; a single row is for all
    /// of them), columns for `joint_ids` (all where `None`). A forward pass follows.
    ///
    /// It is a property of the environment: it stays through a reset, and, unlike
    /// [`set_stiffness`](Self::set_stiffness), when a [snapshot](crate::Snapshot) is restored (but with its properties);
    /// [`reset_properties`](crate::EnvPropertiesMut::reset) gives back what the robot was added with.
    ///
    /// All joints that no implicit drive moves may have some, those of passive articulations too. An implicit drive takes the
    /// place that MuJoCo has for it, so that a joint with one has dry friction only where the model has another place:
    /// where [`DriveCfg::friction`](crate::DriveCfg::friction) is given for the robot, 0 will do, or the file's
    /// `<dynamics friction="..">` is above 0. The others can be told 0, which they have: what
    /// [`friction`](Robot::friction) returns can be set.
    ///
    /// ```
    /// use ndarray::array;
    /// use kinetoscope_sim::{ArticulationCfg, EnvId, SimulationManager, SimulationManagerCfg};
    /// use kinetoscope_robot::urdf::UrdfCfg;
    /// # let urdf = std::env::temp_dir().join(format!("kinetoscope-joints-{}.urdf", std::process::id()));
    /// # std::fs::write(&urdf, "<robot name='r'><link name='a'/><link name='b'><inertial><mass value='1'/>
    /// #   <inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial></link><joint name='slide' type='prismatic'>
    /// #   <parent link='a'/><child link='b'/><axis xyz='1 0 0'/><limit lower='0' upper='1' effort='9' velocity='1'/>
    /// #   <dynamics damping='0' friction='2'/></joint></robot>")?;
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() })?;
    /// let drawer = sim.add_articulation(ArticulationCfg { urdf: UrdfCfg::single(&urdf), ..Default::default() })?;
    /// # std::fs::remove_file(&urdf)?;
    /// sim.articulation_mut(drawer).set_friction(&array![[30.0]], None, Some(&[EnvId(1)]))?;
    /// assert_eq!(sim.articulation(drawer).friction(), array![[2.0], [30.0]]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice; a value that is not finite or negative; more
    /// than 0 for a joint whose model has no place for it. Then nothing is set.
    pub fn set_friction<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_property("set_friction", Property::DryFriction, values.into(), joint_ids, env_ids)
    }

    /// Sets the viscous damping of joints themselves \[N m s/rad or N s/m\]; that of drives stays. Joints that
    /// were added without (the file's `<dynamics damping="..">`) may have some as well. Otherwise as
    /// [`set_friction`](Self::set_friction): it is a property.
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice; a value that is negative or not finite. Then
    /// nothing is set.
    pub fn set_joint_damping<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_property("set_joint_damping", Property::JointDamping, values.into(), joint_ids, env_ids)
    }

    /// Sets the rotor inertia of joints \[kg m² or kg\], also of joints that were added without
    /// ([`DriveCfg::armature`](crate::DriveCfg::armature)). Otherwise as [`set_friction`](Self::set_friction): it is a
    /// property. What was derived from it when the robot was added stays: gains
    /// of drive type `acceleration`, warnings of instability.
    ///
    /// # Errors
    /// Wrong shape, unknown joint or environment, or one that is named twice; a value that is negative or not finite. Then
    /// nothing is set.
    pub fn set_armature<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_property("set_armature", Property::Armature, values.into(), joint_ids, env_ids)
    }

    /// Sets a property of one number of joints, after everything was checked.
    fn set_property(
        &mut self,
        argument: &'static str,
        property: Property,
        values: ArrayView2<'_, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked_numbers(argument, Numbers::Gain, values, joint_ids, env_ids)?;
        let names: Vec<String> = write.joints.iter().map(|&joint| property_name(&self.read(), joint)).collect();
        let known = self.simulation.properties_named(property, &names);
        // Environments come in this order.
        let mut rows = write.rows.iter();
        self.simulation.change_properties(write.rows.envs(), |_, properties| {
            let Some((_, row)) = rows.next() else { return Ok(()) };
            // A joint without the property has 0 of it.
            let mut changes = names.iter().zip(&known).zip(row).filter(|((_, known), value)| **known || **value != 0.0);
            changes.try_for_each(|((name, _), value)| properties.set(property, name, &[*value]))
        })?;
        self.sensors.refresh(write.rows.envs(), self.simulation);
        Ok(())
    }
}

/// What a joint is called among properties.
fn property_name(robot: &Robot<'_>, joint: usize) -> String {
    format!("{}/{}", robot.uid(), robot.joint_names()[joint])
}
