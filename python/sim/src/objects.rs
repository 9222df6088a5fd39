//! Rigid objects, groups of them, terrains, attached MJCF files and welds.

use crate::arguments::{array, envs, indices, patterns};
use crate::errors::Failure;
use crate::robot::{arrays, wrench_frame, writers};
use crate::shared::{Shared, equal_handles};
use kinetoscope::ndarray::{Ix1, Ix2, Ix3};
use kinetoscope::sim::{ActuatorIndex, BodyType, MjcfId, RigidObjectGroupId, RigidObjectId, TerrainId, WeldId};
use numpy::IntoPyArray;
use pyo3::prelude::*;
use std::sync::Arc;

equal_handles! { RigidObject: id, RigidObjectGroup: id, Terrain: id, MjcfPart: id, Weld: id }

/// A rigid object in all environments. Arrays are float64 with the environments on the first axis.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct RigidObject {
    pub(crate) shared: Arc<Shared>,
    pub(crate) id: RigidObjectId,
}

arrays! { RigidObject, rigid_object:
    /// Poses in the environment, rows x y z qw qx qy qz, shape (num_envs, 7).
    pose,
    /// Linear and angular velocities, world axes, shape (num_envs, 6).
    velocity,
    /// Masses [kg], shape (num_envs,).
    mass,
    /// Centers of mass in the frame of the object [m], shape (num_envs, 3).
    center_of_mass,
    /// Principal moments of inertia [kg m²], shape (num_envs, 3).
    inertia,
    /// Friction coefficients: sliding, torsional [m], rolling [m], shape (num_envs, 3).
    friction,
    /// Linear [N s/m] and angular damping [N m s/rad], shape (num_envs, 2).
    damping,
    /// External force [N] and torque [N m], world axes, shape (num_envs, 6).
    external_wrench,
}

writers! { RigidObject, rigid_object_mut, Ix2:
    /// Writes poses, rows x y z qw qx qy qz.
    write_pose,
    /// Writes linear and angular velocities, shape (num_envs, 6).
    write_velocity,
    /// Sets centers of mass [m], shape (num_envs, 3).
    set_center_of_mass,
    /// Sets principal moments of inertia [kg m²], shape (num_envs, 3).
    set_inertia,
    /// Sets friction coefficients, shape (num_envs, 3).
    set_friction,
    /// Sets linear and angular damping, shape (num_envs, 2).
    set_damping,
}

writers! { RigidObject, rigid_object_mut, Ix1:
    /// Sets masses [kg], shape (num_envs,).
    set_mass,
}

#[pymethods]
impl RigidObject {
    /// Name of the object.
    #[getter]
    fn uid(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.rigid_object(self.id).uid().to_string()))
    }

    /// Value of the object in the mask channel of cameras.
    #[getter]
    fn mask_id(&self, py: Python<'_>) -> PyResult<i32> {
        self.shared.read(py, |sim| Ok(sim.rigid_object(self.id).mask_id()))
    }

    /// Mass of the configuration [kg].
    #[getter]
    fn nominal_mass(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.read(py, |sim| Ok(sim.rigid_object(self.id).nominal_mass()))
    }

    /// Sets a force [N] and a torque [N m] that act until they are set again or the environment is reset, shape
    /// (num_envs, 3). ``frame`` is ``"world"`` or ``"link"`` (the axes of the object).
    #[pyo3(signature = (force, torque, frame="world", env_ids=None))]
    fn set_external_wrench(
        &self,
        py: Python<'_>,
        force: &Bound<'_, PyAny>,
        torque: &Bound<'_, PyAny>,
        frame: &str,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let force = array::<Ix2>(force, "set_external_wrench, force")?;
        let torque = array::<Ix2>(torque, "set_external_wrench, torque")?;
        let (frame, env_ids, id) = (wrench_frame(frame)?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| {
            Ok(sim.rigid_object_mut(id).set_external_wrench(&force, &torque, frame, env_ids.as_deref())?)
        })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "RigidObject", |sim| {
            let object = sim.rigid_object(self.id);
            let kind = match object.cfg().body_type {
                BodyType::Dynamic => "dynamic",
                BodyType::Kinematic => "kinematic",
                BodyType::Static => "static",
                _ => "other",
            };
            Ok(format!(
                "<RigidObject {:?}: {kind}, {:.4} kg, {} envs>",
                object.uid(),
                object.nominal_mass(),
                sim.num_envs()
            ))
        })
    }
}

/// A group of rigid objects in all environments.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct RigidObjectGroup {
    pub(crate) shared: Arc<Shared>,
    pub(crate) id: RigidObjectGroupId,
}

arrays! { RigidObjectGroup, rigid_object_group:
    /// Poses in the environment, shape (num_envs, objects, 7).
    pose,
    /// Linear and angular velocities, shape (num_envs, objects, 6).
    velocity,
}

writers! { RigidObjectGroup, rigid_object_group_mut, Ix3:
    /// Writes poses, shape (num_envs, objects, 7).
    write_pose,
    /// Writes velocities, shape (num_envs, objects, 6).
    write_velocity,
}

#[pymethods]
impl RigidObjectGroup {
    /// Name of the group.
    #[getter]
    fn uid(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.rigid_object_group(self.id).uid().to_string()))
    }

    /// Names of the objects, in the order of the arrays.
    #[getter]
    fn names(&self, py: Python<'_>) -> PyResult<Vec<String>> {
        self.shared.read(py, |sim| Ok(sim.rigid_object_group(self.id).names().into_iter().map(String::from).collect()))
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.shared.read(py, |sim| Ok(sim.rigid_object_group(self.id).len()))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "RigidObjectGroup", |sim| {
            let group = sim.rigid_object_group(self.id);
            Ok(format!("<RigidObjectGroup {:?}: {} objects, {} envs>", group.uid(), group.len(), sim.num_envs()))
        })
    }
}

/// A terrain.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Terrain {
    pub(crate) shared: Arc<Shared>,
    pub(crate) id: TerrainId,
}

#[pymethods]
impl Terrain {
    /// Name of the terrain.
    #[getter]
    fn uid(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.entities().terrain(self.id).uid().to_string()))
    }

    /// Value of the terrain in the mask channel of cameras.
    #[getter]
    fn mask_id(&self, py: Python<'_>) -> PyResult<i32> {
        self.shared.read(py, |sim| Ok(sim.entities().terrain(self.id).mask_id()))
    }

    /// Lowest and highest height above the origin of the terrain [m].
    #[getter]
    fn height_range(&self, py: Python<'_>) -> PyResult<[f64; 2]> {
        self.shared.read(py, |sim| Ok(sim.entities().terrain(self.id).height_range()))
    }

    /// Heights of the points of the grid [m], shape (rows, columns).
    #[getter]
    fn heights<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let heights = self.shared.read(py, |sim| Ok(sim.entities().terrain(self.id).cfg().heights.clone()))?;
        Ok(heights.into_pyarray(py).into_any())
    }

    /// Height at a point of the terrain frame [m]; None outside.
    fn height_at(&self, py: Python<'_>, x: f64, y: f64) -> PyResult<Option<f64>> {
        if x.is_nan() || y.is_nan() {
            return Err(Failure::argument("height_at", format!("({x}, {y}) is not a point")).into());
        }
        self.shared.read(py, |sim| Ok(sim.entities().terrain(self.id).height_at([x, y])))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "Terrain", |sim| {
            let terrain = sim.entities().terrain(self.id);
            let ((rows, columns), [low, high]) = (terrain.cfg().heights.dim(), terrain.height_range());
            Ok(format!("<Terrain {:?}: {rows} x {columns} points, {low:.3} to {high:.3} m>", terrain.uid()))
        })
    }
}

/// An attached MJCF file in all environments. Arrays are float64 with the environments on the first axis.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct MjcfPart {
    pub(crate) shared: Arc<Shared>,
    pub(crate) id: MjcfId,
}

arrays! { MjcfPart, mjcf_part:
    /// Positions of all joints, shape (num_envs, nq).
    qpos,
    /// Velocities of all joints, shape (num_envs, nv).
    qvel,
    /// Controls of the actuators, shape (num_envs, actuators).
    ctrl,
    /// Forces of the actuators, shape (num_envs, actuators).
    actuator_force,
}

writers! { MjcfPart, mjcf_part_mut, Ix2:
    /// Writes positions of all joints, shape (num_envs, nq).
    write_qpos,
    /// Writes velocities of all joints, shape (num_envs, nv).
    write_qvel,
}

/// Declares lists of names.
macro_rules! names {
    ($($(#[$doc:meta])* $name:ident,)*) => {
        #[pymethods]
        impl MjcfPart {
            $($(#[$doc])*
            #[getter]
            fn $name(&self, py: Python<'_>) -> PyResult<Vec<String>> {
                self.shared.read(py, |sim| Ok(sim.mjcf_part(self.id).$name().to_vec()))
            })*
        }
    };
}

names! {
    /// Names of the joints.
    joint_names,
    /// Names of the bodies.
    body_names,
    /// Names of the sites.
    site_names,
    /// Names of the actuators.
    actuator_names,
    /// Names of the sensors of the file.
    sensor_names,
}

#[pymethods]
impl MjcfPart {
    /// Name of the attached file.
    #[getter]
    fn uid(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.mjcf_part(self.id).uid().to_string()))
    }

    /// Mass of all bodies [kg].
    #[getter]
    fn total_mass(&self, py: Python<'_>) -> PyResult<f64> {
        self.shared.read(py, |sim| Ok(sim.mjcf_part(self.id).total_mass()))
    }

    /// Indices of the actuators whose names match a pattern, or one of several.
    fn actuator_ids(&self, py: Python<'_>, patterns: &Bound<'_, PyAny>) -> PyResult<Vec<usize>> {
        let patterns = self::patterns(patterns)?;
        self.shared.read(py, |sim| {
            Ok(sim.mjcf_part(self.id).actuator_ids(&patterns)?.into_iter().map(|actuator| actuator.0).collect())
        })
    }

    /// Columns of ``qpos`` of the joints that match a pattern, or one of several, as (first, end) of each joint.
    fn qpos_columns(&self, py: Python<'_>, patterns: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, usize)>> {
        let patterns = self::patterns(patterns)?;
        self.shared.read(py, |sim| {
            Ok(sim
                .mjcf_part(self.id)
                .qpos_columns(&patterns)?
                .into_iter()
                .map(|range| (range.start, range.end))
                .collect())
        })
    }

    /// Columns of ``qvel`` of the joints that match a pattern, or one of several, as (first, end) of each joint.
    fn qvel_columns(&self, py: Python<'_>, patterns: &Bound<'_, PyAny>) -> PyResult<Vec<(usize, usize)>> {
        let patterns = self::patterns(patterns)?;
        self.shared.read(py, |sim| {
            Ok(sim
                .mjcf_part(self.id)
                .qvel_columns(&patterns)?
                .into_iter()
                .map(|range| (range.start, range.end))
                .collect())
        })
    }

    /// Poses of all bodies in the environment, in the order of ``body_names``, shape (num_envs, bodies, 7).
    #[getter]
    fn body_poses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.shared.read(py, |sim| Ok(sim.mjcf_part(self.id).body_poses()))?.into_pyarray(py).into_any())
    }

    /// Poses of a body in the environment, shape (num_envs, 7).
    fn body_pose<'py>(&self, py: Python<'py>, body: &str) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.shared.read(py, |sim| Ok(sim.mjcf_part(self.id).body_pose(body)?))?.into_pyarray(py).into_any())
    }

    /// Poses of a site in the environment, shape (num_envs, 7).
    fn site_pose<'py>(&self, py: Python<'py>, site: &str) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.shared.read(py, |sim| Ok(sim.mjcf_part(self.id).site_pose(site)?))?.into_pyarray(py).into_any())
    }

    /// Sets controls of actuators, shape (num_envs, actuators).
    #[pyo3(signature = (values, actuators=None, env_ids=None))]
    fn set_ctrl(
        &self,
        py: Python<'_>,
        values: &Bound<'_, PyAny>,
        actuators: Option<&Bound<'_, PyAny>>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (values, env_ids, id) = (array::<Ix2>(values, "set_ctrl")?, envs(&self.shared, env_ids)?, self.id);
        let actuators = actuators.map(|actuators| indices(actuators, "actuators")).transpose()?;
        self.shared.write(py, |sim| {
            let count = sim.mjcf_part(id).actuator_names().len();
            let actuators = actuators.map(|actuators| actuators.resolve("actuators", count)).transpose()?;
            let actuators: Option<Vec<ActuatorIndex>> =
                actuators.map(|actuators| actuators.into_iter().map(ActuatorIndex).collect());
            Ok(sim.mjcf_part_mut(id).set_ctrl(&values, actuators.as_deref(), env_ids.as_deref())?)
        })
    }

    /// Writes poses of a mocap body, rows x y z qw qx qy qz.
    #[pyo3(signature = (body, values, env_ids=None))]
    fn write_mocap_pose(
        &self,
        py: Python<'_>,
        body: &str,
        values: &Bound<'_, PyAny>,
        env_ids: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let (values, env_ids, id) = (array::<Ix2>(values, "write_mocap_pose")?, envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| Ok(sim.mjcf_part_mut(id).write_mocap_pose(body, &values, env_ids.as_deref())?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "MjcfPart", |sim| {
            let part = sim.mjcf_part(self.id);
            let (joints, bodies) = (part.joint_names().len(), part.body_names().len());
            Ok(format!("<MjcfPart {:?}: {bodies} bodies, {joints} joints, {} envs>", part.uid(), sim.num_envs()))
        })
    }
}

/// A weld between two bodies, attached and released in single environments.
#[pyclass(frozen, module = "kinetoscope")]
#[derive(Debug)]
pub(crate) struct Weld {
    pub(crate) shared: Arc<Shared>,
    pub(crate) id: WeldId,
}

arrays! { Weld, weld:
    /// True where the weld holds, bool, shape (num_envs,).
    is_attached,
}

#[pymethods]
impl Weld {
    /// Name of the weld.
    #[getter]
    fn uid(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.read(py, |sim| Ok(sim.weld(self.id).cfg().uid.clone()))
    }

    /// Welds the bodies in their current relative pose.
    #[pyo3(signature = (env_ids=None))]
    fn attach(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let (env_ids, id) = (envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| Ok(sim.weld_mut(id).attach(env_ids.as_deref())?))
    }

    /// Releases the bodies.
    #[pyo3(signature = (env_ids=None))]
    fn release(&self, py: Python<'_>, env_ids: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let (env_ids, id) = (envs(&self.shared, env_ids)?, self.id);
        self.shared.write(py, |sim| Ok(sim.weld_mut(id).release(env_ids.as_deref())?))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        self.shared.describe(py, "Weld", |sim| {
            let cfg = sim.weld(self.id).cfg();
            Ok(format!("<Weld {:?}: {} to {}>", cfg.uid, cfg.first, cfg.second))
        })
    }
}
