//! Mass properties, friction and damping of a rigid object in each environment at run time, and external wrenches.
//!
//! An environment whose object differs from the others keeps the numbers in which its model differs: see
//! [`randomization`](crate::randomization), whose properties these are.

use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::objects::rigid_object::{RigidObject, RigidObjectMut};
use crate::objects::rigid_object_data::BodyType;
use crate::objects::rows::{ArgumentSpec, EnvRows, unique_envs};
use crate::randomization::Property;
use crate::row::{RowPart, StoredRow};
use crate::wrenches::{Wrench, WrenchFrame};
use kinetoscope_mujoco::NumberArray;
use nalgebra::{UnitQuaternion, Vector3};
use ndarray::{Array1, Array2, ArrayView2, AsArray, Axis, Ix1, Ix2};

/// Robot index of the wrenches on objects, larger than the number of robots.
const OBJECT_WRENCH_OWNER: usize = 1 << 20;

impl RigidObject<'_> {
    /// Mass in each environment \[kg\], shape (N), as in MuJoCo's model; the configured mass for an object that is not
    /// dynamic.
    #[doc(alias = "get_mass")]
    pub fn mass(&self) -> Array1<f64> {
        self.read_body_values(NumberArray::BODY_MASS, [self.data.mass_properties().mass]).remove_axis(Axis(1))
    }

    /// Center of mass in the object's frame in each environment \[m\], shape (N, 3). An object that is not dynamic has
    /// the configured one.
    #[doc(alias = "get_center_of_mass")]
    pub fn center_of_mass(&self) -> Array2<f64> {
        self.read_body_values(NumberArray::BODY_IPOS, self.data.mass_properties().com.into())
    }

    /// Principal moments of inertia about the center of mass in each environment \[kg m²\], shape (N, 3), along x, y
    /// and z of the object's frame. For a mesh without a configured `inertia`, they are along its principal axes, the
    /// largest first. An object that is not dynamic has the configured moments.
    #[doc(alias = "get_inertia")]
    pub fn inertia(&self) -> Array2<f64> {
        self.read_body_values(NumberArray::BODY_INERTIA, self.data.mass_properties().moments.into())
    }

    /// Sliding friction coefficient, torsional \[m\] and rolling \[m\] in each environment, shape (N, 3).
    #[doc(alias = "get_friction")]
    pub fn friction(&self) -> Array2<f64> {
        let model = self.simulation.batch.model();
        let body = self.simulation.objects[self.index].body;
        // The first geom is the collision shape.
        match usize::try_from(model.body_geomadr()[body]) {
            Ok(geom) => self.read_values(|row| row.model_numbers::<3>(NumberArray::GEOM_FRICTION, 3 * geom)),
            Err(_) => self.read_values(|_| [0.0; 3]),
        }
    }

    /// Linear damping \[N s/m\] and angular damping \[N m s/rad\] in each environment, shape (N, 2); 0 for an object
    /// that is not dynamic.
    #[doc(alias = "get_damping")]
    pub fn damping(&self) -> Array2<f64> {
        let Some((_, dof)) = self.simulation.objects[self.index].free_joint else {
            return self.read_values(|_| [0.0; 2]);
        };
        self.read_values(|row| {
            // Three numbers for translations, then three for rotations.
            let [linear, _, _, angular] = row.model_numbers(NumberArray::DOF_DAMPING, dof);
            [linear, angular]
        })
    }

    /// Forces and torques of [`set_external_wrench`](RigidObjectMut::set_external_wrench), in world axes at the current
    /// pose of the object \[N, N m\], shape (N, 6).
    #[doc(alias = "get_external_wrench")]
    pub fn external_wrench(&self) -> Array2<f64> {
        let owner = (OBJECT_WRENCH_OWNER, self.index);
        self.simulation.batch.body_rows(|bodies| {
            // An object has at most one wrench.
            let wrench = bodies.wrenches().list.iter().find(|wrench| wrench.owner == owner);
            let [f, t] = wrench.map_or([Vector3::zeros(); 2], |wrench| wrench.in_world(bodies));
            [f.x, f.y, f.z, t.x, t.y, t.z]
        })
    }

    /// Reads the `K` numbers of the body in each environment; returns `nominal` for an object that is not dynamic.
    fn read_body_values<const K: usize>(&self, array: NumberArray, nominal: [f64; K]) -> Array2<f64> {
        let body = self.simulation.objects[self.index].body;
        let moves = self.cfg().body_type == BodyType::Dynamic;
        self.read_values(|row| if moves { row.model_numbers(array, K * body) } else { nominal })
    }

    /// Reads `K` numbers of each environment.
    fn read_values<const K: usize>(&self, read: impl Fn(&StoredRow<'_>) -> [f64; K]) -> Array2<f64> {
        let mut values = vec![[0.0; K]; self.simulation.batch.num_envs()];
        self.simulation.batch.for_each_row(RowPart::Inputs, |i, row| values[i] = read(&row));
        values.into()
    }
}

impl RigidObjectMut<'_> {
    /// Sets the mass \[kg\] of the object in `env_ids` (`None` for all environments): one number for each, or one for
    /// all of them. The moments of inertia become the configured ones, scaled in proportion as with another density;
    /// moments of [`set_inertia`](Self::set_inertia) are lost. The mass survives resets; a forward pass follows.
    ///
    /// # Errors
    /// The object is not dynamic; wrong shape, an unknown or repeated environment, or a mass that is not finite or
    /// below 1e-15 kg. Then nothing is set.
    pub fn set_mass<'t>(&mut self, masses: impl AsArray<'t, f64, Ix1>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let masses = masses.into().insert_axis(Axis(1));
        self.set("set_mass", "environments, 1", &[Property::Mass], masses, env_ids)
    }

    /// Sets the center of mass in the object's frame \[m\]: rows of 3, as in [`set_mass`](Self::set_mass).
    ///
    /// # Errors
    /// The object is not dynamic; wrong shape, an unknown or repeated environment, or a number that is not finite. Then
    /// nothing is set.
    pub fn set_center_of_mass<'t>(
        &mut self,
        centers: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (argument, meaning) = ("set_center_of_mass", "environments, x y z");
        self.set(argument, meaning, &[Property::CenterOfMass], centers.into(), env_ids)
    }

    /// Sets the principal moments of inertia \[kg m²\], along the axes of [`inertia`](RigidObject::inertia): rows of 3,
    /// as in [`set_mass`](Self::set_mass).
    ///
    /// # Errors
    /// The object is not dynamic; wrong shape, an unknown or repeated environment, or physically impossible moments.
    /// Then nothing is set.
    pub fn set_inertia<'t>(&mut self, moments: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let (argument, meaning) = ("set_inertia", "environments, three moments");
        self.set(argument, meaning, &[Property::Inertia], moments.into(), env_ids)
    }

    /// Sets sliding friction, torsional \[m\] and rolling \[m\], of objects of every type of motion: rows of 3, as in
    /// [`set_mass`](Self::set_mass). In a contact, MuJoCo takes the larger value of the two surfaces: a slippery object
    /// needs a slippery ground, too.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated environment, or a coefficient that is negative or not finite; then nothing
    /// is set.
    pub fn set_friction<'t>(&mut self, frictions: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let properties = [Property::Friction, Property::TorsionalFriction, Property::RollingFriction];
        let meaning = "environments, sliding torsional rolling";
        self.set("set_friction", meaning, &properties, frictions.into(), env_ids)
    }

    /// Sets linear damping \[N s/m\] and angular damping \[N m s/rad\]: rows of 2, as in [`set_mass`](Self::set_mass).
    /// They give a force against the velocity of the object's frame, and a torque against its angular velocity.
    ///
    /// # Errors
    /// The object is not dynamic; wrong shape, an unknown or repeated environment, or a number that is negative or not
    /// finite. Then nothing is set.
    pub fn set_damping<'t>(&mut self, dampings: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let properties = [Property::LinearDamping, Property::AngularDamping];
        self.set("set_damping", "environments, linear angular", &properties, dampings.into(), env_ids)
    }

    /// Sets properties from rows, which hold the values of the properties one after the other.
    fn set(
        &mut self,
        argument: &'static str,
        meaning: &'static str,
        properties: &[Property],
        values: ArrayView2<'_, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        if properties[0] != Property::Friction {
            self.check_dynamic(argument)?;
        }
        let uid = self.data.uid();
        let columns = properties.iter().map(|property| property.width()).sum();
        let rows = self.rows(argument, meaning, columns, values, env_ids)?;
        // Environments are visited in this order.
        let mut given = rows.iter();
        self.simulation.change_properties(rows.envs(), |_, changed| {
            let row = given.next().map_or_else(Vec::new, |(_, row)| row.to_vec());
            let mut rest = &row[..];
            for &property in properties {
                let (mine, others) = rest.split_at(property.width().min(rest.len()));
                changed.set(property, uid, mine)?;
                rest = others;
            }
            Ok(())
        })?;
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// Applies a force \[N\] at the center of mass and a torque \[N m\] in every step until the next call or a reset of
    /// the environment. Zeros remove them. Both have the shape (environments, 3): rows for `env_ids` (`None` for all
    /// environments; a single row applies to all of them). With [`WrenchFrame::World`] both are in world axes and keep
    /// their direction. With [`WrenchFrame::Link`] both are in the axes of the object and turn with it.
    ///
    /// # Errors
    /// The object is not dynamic; wrong shape, an unknown or repeated environment, or a value that is not finite. Then
    /// nothing is set.
    pub fn set_external_wrench<'f, 't>(
        &mut self,
        forces: impl AsArray<'f, f64, Ix2>,
        torques: impl AsArray<'t, f64, Ix2>,
        frame: WrenchFrame,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (argument, meaning) = ("set_external_wrench", "environments, x y z");
        self.check_dynamic(argument)?;
        let forces = self.rows("set_external_wrench (forces)", meaning, 3, forces.into(), env_ids)?;
        let torques = self.rows("set_external_wrench (torques)", meaning, 3, torques.into(), env_ids)?;
        let owner = (OBJECT_WRENCH_OWNER, self.index);
        let body = self.simulation.objects[self.index].body;
        for ((env, force), (_, torque)) in forces.arrays::<3>().zip(torques.arrays::<3>()) {
            let (force, torque) = (Vector3::from(force), Vector3::from(torque));
            let axes = (frame == WrenchFrame::Link).then(UnitQuaternion::identity);
            self.simulation.batch.write_at(env, Stage::Kinematics, |env| {
                env.set_wrenches(|wrenches| {
                    wrenches.replace(Wrench { owner, body, axes, force, torque });
                });
            });
        }
        Ok(())
    }

    fn check_dynamic(&self, argument: &'static str) -> Result<()> {
        if self.data.cfg().body_type == BodyType::Dynamic {
            return Ok(());
        }
        Err(Error::NotDynamic { argument, object: self.data.uid().into() })
    }

    fn rows<'v>(
        &self,
        argument: &'static str,
        meaning: &'static str,
        columns: usize,
        values: ArrayView2<'v, f64>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<EnvRows<'v>> {
        let num_envs = self.simulation.batch.num_envs();
        unique_envs(argument, env_ids, num_envs)?;
        let of = |_| format!("object {:?}", self.data.uid());
        EnvRows::check(ArgumentSpec { argument, meaning, columns, column_label: &of }, values, env_ids, num_envs)
    }
}
