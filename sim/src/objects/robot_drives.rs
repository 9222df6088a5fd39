//! Drives of a robot at run time: gains and drive types per joint and per environment.
//!
//! Gains are in the memory of each environment, not in MuJoCo's model, so an environment with other gains costs nothing
//! elsewhere. Friction and rotor inertia are in the model: see [`set_friction`](RobotMut::set_friction) and
//! [`set_armature`](RobotMut::set_armature).

use crate::drive::plan::{PlanError, effective_inertias};
use crate::drive::table::{DriveState, ExplicitDrive, Realization};
use crate::drive::{ActuatorModel, DelayedPd, DriveType};
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::objects::robot::{JointRows, Robot, RobotMut};
use crate::objects::robot_data::JointIndex;
use crate::objects::rows::{NumberKind, unique_envs};
use crate::row::RowPart;
use ndarray::{Array2, ArrayView2, AsArray, Ix2};
use std::sync::Arc;

impl Robot<'_> {
    /// Stiffness of the drives, in the unit of each [drive type](DriveType), shape (N, dof); 0 for joints without a
    /// drive. Randomized values are included.
    #[doc(alias = "get_stiffness")]
    pub fn stiffness(&self) -> Array2<f64> {
        self.gather(RowPart::Inputs, |env, joint| joint.drive.map_or(0.0, |drive| env.drives.settings[drive].stiffness))
    }

    /// Damping of the drives, in the unit of each [drive type](DriveType), shape (N, dof); 0 for joints without a
    /// drive. Randomized values are included. The viscous friction of the joint itself is not part of it.
    #[doc(alias = "get_damping")]
    pub fn damping(&self) -> Array2<f64> {
        self.gather(RowPart::Inputs, |env, joint| joint.drive.map_or(0.0, |drive| env.drives.settings[drive].damping))
    }

    /// Drive types, which give stiffness and damping their meaning, shape (N, dof); `None` for joints without a drive.
    #[doc(alias = "get_drive_types")]
    pub fn drive_types(&self) -> Array2<DriveType> {
        self.simulation.batch.gather_stored(RowPart::Inputs, &self.indexing().joints, |env, joint| {
            joint.drive.map_or(DriveType::None, |drive| env.drives.settings[drive].drive_type)
        })
    }

    /// Delays of the drives \[MuJoCo steps\], shape (N, dof); 0 for joints without a [`DelayedPd`] drive.
    #[doc(alias = "get_delay")]
    pub fn delay(&self) -> Array2<u32> {
        let delays = self.gather(RowPart::Inputs, |env, joint| {
            match joint.drive.and_then(|drive| env.drives.table().model_of(drive)) {
                Some(ExplicitDrive { model: ActuatorModel::DelayedPd(_), memory, .. }) => {
                    f64::from(DelayedPd::delay_of(&env.drives.memory[memory.clone()]))
                }
                _ => 0.0,
            }
        });
        delays.mapv(|steps| steps as u32)
    }
}

impl RobotMut<'_> {
    /// Sets the stiffness of drives, in the unit of each [drive type](DriveType); all other settings stay. A randomized
    /// stiffness is replaced. The stiffness survives resets. Rows are for `env_ids` (`None` for all environments; a
    /// single row applies to all of them), columns for `joint_ids` (`None` for all joints); columns of mimic joints are
    /// accepted and ignored.
    ///
    /// Drives of [`DriveModel::Implicit`](crate::DriveModel::Implicit) are stable with any gains. Explicit actuator
    /// models are not, and only [`add_robot`](crate::SimulationManager::add_robot) warns about them: gains that are set
    /// here are not checked against the time step.
    ///
    /// ```
    /// use ndarray::array;
    /// use kinetoscope_sim::{EnvId, RobotCfg, SimulationManager, SimulationManagerCfg};
    /// use kinetoscope_robot::urdf::UrdfCfg;
    /// # let urdf = std::env::temp_dir().join(format!("kinetoscope-drives-{}.urdf", std::process::id()));
    /// # let link = |name: &str| format!("<link name='{name}'><inertial><mass value='1'/>
    /// #   <inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial></link>");
    /// # std::fs::write(&urdf, format!("<robot name='r'>{}{}<joint name='knee' type='continuous'><parent link='a'/>
    /// #   <child link='b'/><axis xyz='0 0 1'/></joint></robot>", link("a"), link("b")))?;
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() })?;
    /// let leg = sim.add_robot(RobotCfg { urdf: UrdfCfg::single(&urdf), ..Default::default() })?;
    /// # std::fs::remove_file(&urdf)?;
    /// let knee = sim.robot(leg).joint_id("knee")?;
    /// sim.robot_mut(leg).set_stiffness(&array![[40.0]], Some(&[knee]), Some(&[EnvId(1)]))?;
    /// assert_eq!(sim.robot(leg).stiffness(), array![[1e4], [40.0]]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, or a value that is negative or not finite. A joint
    /// that was added without a drive, or has a drive of [`DriveModel::Actuator`](crate::DriveModel::Actuator). Then
    /// nothing is set.
    pub fn set_stiffness<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_drives("set_stiffness", NumberKind::Gain, values.into(), joint_ids, env_ids, |drives, drive, value| {
            drives.set_stiffness(drive, value);
        })
    }

    /// Sets the damping of drives, in the unit of each [drive type](DriveType); otherwise as
    /// [`set_stiffness`](Self::set_stiffness). Nothing warns about an explicit model that becomes unstable. The viscous
    /// friction of the joint itself stays.
    ///
    /// # Errors
    /// Same errors as [`set_stiffness`](Self::set_stiffness).
    pub fn set_damping<'t>(
        &mut self,
        values: impl AsArray<'t, f64, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        self.set_drives("set_damping", NumberKind::Gain, values.into(), joint_ids, env_ids, |drives, drive, value| {
            drives.set_drive_damping(drive, value);
        })
    }

    /// Sets the drive type, which gives stiffness and damping their meaning, for `joint_ids` (`None` for all joints;
    /// mimic joints are left out) in `env_ids` (`None` for all environments).
    ///
    /// The numbers of the gains and all other settings stay; randomized gains
    /// ([`randomize`](crate::EnvPropertiesMut::randomize)) keep their values in torque units. A drive of type `None`
    /// gives only the effort of [`set_qf_target`](Self::set_qf_target), until it gets another type. `Acceleration`
    /// multiplies the gains by the effective inertia of the joint at the robot's initial positions, with the masses of
    /// the files and payloads; randomized masses do not count. Nothing warns about an explicit model that becomes
    /// unstable: see [`set_stiffness`](Self::set_stiffness).
    ///
    /// # Errors
    /// An unknown or repeated joint or environment; a selected joint that was added without a drive, or has a drive of
    /// [`DriveModel::Actuator`](crate::DriveModel::Actuator). Then nothing is set.
    pub fn set_drive_type(
        &mut self,
        drive_type: DriveType,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let argument = "set_drive_type";
        let drives = self.changeable_drives(argument, &self.joint_columns(argument, joint_ids)?)?;
        let envs = unique_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        let inertias = if drive_type.mode().needs_inertia() { Some(self.initial_effective_inertias()?) } else { None };
        for env in envs {
            self.simulation.batch.edit_row(env, |env, _| {
                for &(_, joint, drive) in &drives {
                    let inertia = inertias.as_ref().map(|inertias| inertias[joint]);
                    env.drives.set_drive_type(drive, drive_type, inertia);
                }
            });
        }
        Ok(())
    }

    /// Sets the delay of joints with a [`DelayedPd`] drive \[MuJoCo steps\]; it survives resets. Rows and columns as in
    /// [`set_stiffness`](Self::set_stiffness).
    ///
    /// Step n uses the targets of step n - delay, with the delay at step n. If the delay grows by k, the last k targets
    /// that were used are used once more, in their order. If it falls by k, the next k targets are skipped.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated joint or environment, a joint with another model, or a delay above the
    /// larger of the model's `delay` and `max_delay`. Then nothing is set.
    pub fn set_delay<'t>(
        &mut self,
        steps: impl AsArray<'t, u32, Ix2>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let argument = "set_delay";
        let steps: ArrayView2<'_, u32> = steps.into();
        let steps = steps.mapv(f64::from);
        let write = self.checked_numbers(argument, NumberKind::Gain, steps.view(), joint_ids, env_ids)?;
        let drives = self.drives_of_joints(argument, &write.joints)?;
        let table = self.simulation.batch.read_row(0, |env| Arc::clone(env.drives.table()));
        let name = |joint: usize| self.data.joint_names()[joint].clone();
        let mut memories = Vec::with_capacity(drives.len());
        for &(column, joint, drive) in &drives {
            let Some(ExplicitDrive { model: ActuatorModel::DelayedPd(model), memory, .. }) = table.model_of(drive)
            else {
                return Err(Error::NoDelay { robot: self.data.label(), joint: name(joint) });
            };
            for (row, (_, steps)) in write.rows.iter().enumerate() {
                let (value, longest) = (steps[column], model.delay_capacity());
                if value > f64::from(longest) {
                    let (item, expected) =
                        (format!("joint {:?}", name(joint)), format!("at most {longest}, its max_delay"));
                    return Err(Error::OutOfRange { argument, row, column, item, value, expected });
                }
            }
            memories.push((column, memory.clone()));
        }
        for (env, row) in write.rows.iter() {
            self.simulation.batch.edit_row(env, |env, _| {
                for (column, memory) in &memories {
                    DelayedPd::set_delay(&mut env.drives.memory[memory.clone()], row[*column] as u32);
                }
            });
        }
        Ok(())
    }

    fn initial_effective_inertias(&self) -> Result<Vec<f64>> {
        let data = self.data;
        effective_inertias(data.description(), data.plans(), !data.cfg().fix_base)
            .map_err(|error| Error::DrivePlan { robot: data.label(), error: Box::new(PlanError::Dynamics(error)) })
    }

    /// Changes drives by one number each, after all checks.
    pub(super) fn set_drives(
        &mut self,
        argument: &'static str,
        numbers: NumberKind,
        values: ArrayView2<'_, f64>,
        joint_ids: Option<&[JointIndex]>,
        env_ids: Option<&[EnvId]>,
        change: impl Fn(&mut DriveState, usize, f64),
    ) -> Result<()> {
        let write = self.checked_numbers(argument, numbers, values, joint_ids, env_ids)?;
        let drives = self.changeable_drives(argument, &write.joints)?;
        self.change_drives(&write, &drives, change);
        Ok(())
    }

    /// Changes `drives`, each by its column of the checked argument.
    pub(super) fn change_drives(
        &mut self,
        write: &JointRows<'_>,
        drives: &[(usize, usize, usize)],
        change: impl Fn(&mut DriveState, usize, f64),
    ) {
        for (env, row) in write.rows.iter() {
            self.simulation.batch.edit_drives(env, |state| {
                drives.iter().for_each(|&(column, _, drive)| change(state, drive, row[column]));
            });
        }
    }

    /// Returns `(column, joint, drive)` for each of `joints` that is not a mimic joint: position in `joints`, index of
    /// the joint, index of its drive. A joint without a drive is an error, and so is a drive whose gains are in
    /// MuJoCo's model.
    pub(super) fn changeable_drives(
        &self,
        argument: &'static str,
        joints: &[usize],
    ) -> Result<Vec<(usize, usize, usize)>> {
        let native = |drive: usize| {
            self.simulation
                .batch
                .read_row(0, |env| env.drives.table().drives[drive].realization == Realization::Actuator)
        };
        let drives = self.drives_of_joints(argument, joints)?;
        match drives.iter().find(|(_, _, drive)| native(*drive)) {
            Some(&(_, joint, _)) => {
                let joint = self.data.joint_names()[joint].clone();
                Err(Error::GainsInModel { argument, robot: self.data.label(), joint })
            }
            None => Ok(drives),
        }
    }

    /// Returns `(column, joint, drive)` for each of `joints` that is not a mimic joint: position in `joints`, index of
    /// the joint, index of its drive.
    ///
    /// # Errors
    /// A joint without a drive.
    pub(super) fn drives_of_joints(
        &self,
        argument: &'static str,
        joints: &[usize],
    ) -> Result<Vec<(usize, usize, usize)>> {
        let mut drives = Vec::with_capacity(joints.len());
        for (column, &joint) in joints.iter().enumerate() {
            if self.data.plans()[joint].mimic.is_some() {
                continue;
            }
            let Some(drive) = self.simulation.robots[self.index].joints[joint].drive else {
                let joint = self.data.joint_names()[joint].clone();
                return Err(Error::NotDriven { argument, robot: self.data.label(), joint });
            };
            drives.push((column, joint, drive));
        }
        Ok(drives)
    }
}
