//! Passive properties of the joints of a robot at run time: dry friction, damping and rotor inertia, per joint and per
//! environment.
//!
//! They are in MuJoCo's model: an environment with other values owns these arrays. They are among its
//! [`properties`](crate::SimulationManager::properties), so randomization and these setters change the same numbers.

use crate::error::Result;
use crate::ids::EnvId;
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::robot_data::JointIndex;
use crate::objects::rows::NumberKind;
use crate::randomization::Property;
use ndarray::{Array2, ArrayView2, AsArray, Ix2};

impl Robot<'_> {
    /// Dry friction of the joints \[N m or N\], shape (N, dof); 0 for joints without friction. Randomized values are
    /// included.
    #[doc(alias = "get_friction")]
    pub fn friction(&self) -> Array2<f64> {
        self.property(Property::DryFriction)
    }

    /// Viscous damping of the joints themselves \[N m s/rad or N s/m\], shape (N, dof); 0 for joints without damping.
    /// The damping of the drives is not part of it: see [`damping`](Self::damping).
    #[doc(alias = "get_joint_damping")]
    pub fn joint_damping(&self) -> Array2<f64> {
        self.property(Property::JointDamping)
    }

    /// Rotor inertia of the joints \[kg m² or kg\], shape (N, dof); 0 for joints without one.
    #[doc(alias = "get_armature")]
    pub fn armature(&self) -> Array2<f64> {
        self.property(Property::Armature)
    }

    /// Reads a scalar property of every joint in every environment.
    fn property(&self, property: Property) -> Array2<f64> {
        let mut values = Array2::zeros((self.simulation.batch.num_envs(), self.dof()));
        for (joint, mut column) in values.columns_mut().into_iter().enumerate() {
            self.simulation.read_property(property, &property_name(self, joint), |env, value| column[env] = value);
        }
        values
    }
}

impl RobotMut<'_> {
    /// Sets the dry friction of joints \[N m or N\]. Rows are for `env_ids` (`None` for all environments; a single row
    /// applies to all of them), columns for `joint_ids` (`None` for all joints). A forward pass follows.
    ///
    /// Dry friction is a property of the environment and survives resets. Unlike
    /// [`set_stiffness`](Self::set_stiffness), it also stays when a [snapshot](crate::Snapshot) is restored without its
    /// properties. [`EnvPropertiesMut::reset`](crate::EnvPropertiesMut::reset) restores the values that the robot was
    /// added with.
    ///
    /// All joints without an implicit drive may have dry friction, those of passive articulations too. An implicit
    /// drive uses MuJoCo's friction constraint of the joint. Such a joint has dry friction only if the model has a
    /// friction tendon for it. The model has one if [`DriveCfg::friction`](crate::DriveCfg::friction) is set for the
    /// robot (0 is enough), or if the file gives the joint friction above 0 (`<dynamics friction="..">`, or
    /// `frictionloss` in MJCF). All other joints accept 0, the value that they have, so the result of
    /// [`friction`](Robot::friction) can always be set.
    ///
    /// ```
    /// use ndarray::array;
    /// use kinetoscope_sim::{ArticulationCfg, EnvId, SimulationManager, SimulationManagerCfg};
    /// use kinetoscope_robot::urdf::UrdfCfg;
    /// # let urdf = std::env::temp_dir().join(format!("kinetoscope-joints-{}.urdf", std::process::id()));
    /// # std::fs::write(&urdf, "<robot name='r'><link name='a'/><link name='b'><inertial><mass value='1'/>
    /// #   <inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial></link>
    /// #   <joint name='slide' type='prismatic'>
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
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is not finite or negative. More than 0
    /// for a joint without a friction constraint of its own in the model. Then nothing is set.
    pub fn set_friction<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_property("set_friction", Property::DryFriction, values.into(), joint_ids, env_ids)
    }

    /// Sets the viscous damping of the joints themselves \[N m s/rad or N s/m\]; the damping of drives stays. Joints
    /// that were added without damping (the file's `<dynamics damping="..">`) may get some as well. It is a property
    /// with the rules of [`set_friction`](Self::set_friction).
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is negative or not finite. Then
    /// nothing is set.
    pub fn set_joint_damping<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_property("set_joint_damping", Property::JointDamping, values.into(), joint_ids, env_ids)
    }

    /// Sets the armature (rotor inertia) of joints \[kg m² or kg\], also of joints that were added without one
    /// ([`DriveCfg::armature`](crate::DriveCfg::armature)). Rows, columns, resets and snapshots are those of
    /// [`set_friction`](Self::set_friction). Drive gains of type `acceleration` and warnings about instability, which
    /// were computed from the armature when the robot was added, do not change.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is negative or not finite. Then
    /// nothing is set.
    pub fn set_armature<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_property("set_armature", Property::Armature, values.into(), joint_ids, env_ids)
    }

    /// Sets a scalar property of joints, after all checks.
    fn set_property(
        &mut self,
        argument: &'static str,
        property: Property,
        values: ArrayView2<'_, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let write = self.checked_numbers(argument, NumberKind::Gain, values, joint_ids, env_ids)?;
        let names: Vec<String> = write.joints.iter().map(|&joint| property_name(&self.read(), joint)).collect();
        let known = self.simulation.have_property(property, &names);
        // Environments are visited in this order.
        let mut rows = write.rows.iter();
        self.simulation.change_properties(write.rows.envs(), |_, properties| {
            let Some((_, row)) = rows.next() else { return Ok(()) };
            // A joint without the property has the value 0.
            let mut changes = names.iter().zip(&known).zip(row).filter(|((_, known), value)| **known || **value != 0.0);
            changes.try_for_each(|((name, _), value)| properties.set(property, name, &[*value]))
        })?;
        self.sensors.refresh(write.rows.envs(), self.simulation);
        Ok(())
    }
}

/// Name of a joint among the properties.
fn property_name(robot: &Robot<'_>, joint: usize) -> String {
    format!("{}/{}", robot.uid(), robot.joint_names()[joint])
}
