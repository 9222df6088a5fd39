//! MJCF parts in a running simulation: read and write access.

use super::mjcf_part_data::{ActuatorIndex, MjcfData, MjcfPartCfg};
use crate::body_pose::BodyFrame;
use crate::env::{SimEnv, Stage};
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::indexing::MjcfIndexing;
use crate::objects::rows::{ArgumentSpec, EnvRows, check_unique_columns, unique_envs};
use crate::pattern;
use crate::row::{RowPart, StateArray};
use crate::sensor_list::SensorList;
use crate::simulation::Simulation;
use kinetoscope_mujoco::{Model, mjcf_keywords};
use kinetoscope_scene::pose::{from_row, to_row};
use ndarray::{Array2, Array3, ArrayView2, AsArray, Ix2};
use std::ops::Range;
use std::sync::Arc;

/// Read access to an MJCF part. Arrays have one row per environment.
#[derive(Clone, Copy, Debug)]
pub struct MjcfPart<'a> {
    data: &'a Arc<MjcfData>,
    simulation: &'a Simulation,
    index: usize,
}

impl<'a> MjcfPart<'a> {
    pub(crate) fn new(data: &'a Arc<MjcfData>, simulation: &'a Simulation, index: usize) -> Self {
        Self { data, simulation, index }
    }

    fn indices(&self) -> &'a MjcfIndexing {
        &self.simulation.mjcf_models[self.index]
    }

    /// Name of the part.
    pub fn uid(&self) -> &'a str {
        self.data.uid()
    }

    /// Configuration that the part was added with.
    pub fn cfg(&self) -> &'a MjcfPartCfg {
        self.data.cfg()
    }

    /// Compiled model of the file alone. Its indices and addresses are not those of the scene.
    pub fn model(&self) -> &'a Model {
        self.data.model()
    }

    /// Names of the part's joints without the prefix `uid/`, in MuJoCo's order. An element without a name is named by
    /// its kind and its index in the file's own [`model`](Self::model): `joint3`, `body2`, `actuator0`.
    pub fn joint_names(&self) -> &'a [String] {
        &self.data.names.joints
    }

    /// Names of the part's bodies without the prefix `uid/`, in MuJoCo's order, without the world.
    pub fn body_names(&self) -> &'a [String] {
        &self.data.names.bodies[1..]
    }

    /// Names of the part's sites without the prefix `uid/`, in MuJoCo's order.
    pub fn site_names(&self) -> &'a [String] {
        &self.data.names.sites
    }

    /// Names of the part's actuators without the prefix `uid/`, in MuJoCo's order: the columns of [`ctrl`](Self::ctrl).
    pub fn actuator_names(&self) -> &'a [String] {
        &self.data.names.actuators
    }

    /// Names of MuJoCo's own sensors in the part without the prefix `uid/`. Sensors that a part cannot have are left
    /// out; a diagnostic names each.
    pub fn sensor_names(&self) -> &'a [String] {
        &self.data.sensor_names
    }

    /// Indices of the actuators that match `patterns` (whole names without `uid/`), in the order of the patterns.
    ///
    /// # Errors
    /// A pattern matches nothing (with the nearest names), or an actuator is matched twice.
    pub fn actuator_ids<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<ActuatorIndex>> {
        let found = self.select(patterns, self.actuator_names(), "actuator")?;
        Ok(found.into_iter().map(ActuatorIndex).collect())
    }

    /// Returns the range of columns of [`qpos`](Self::qpos) for each joint that matches a pattern, in the order of the
    /// patterns. A free joint has 7 columns (x, y, z, qw, qx, qy, qz), a ball joint 4, any other joint 1.
    ///
    /// # Errors
    /// A pattern matches nothing (with the nearest names), or a joint is matched twice.
    pub fn qpos_columns<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<Range<usize>>> {
        self.columns(patterns, self.model().jnt_qposadr(), [7, 4, 1])
    }

    /// Returns the range of columns of [`qvel`](Self::qvel) for each joint that matches a pattern, in the order of the
    /// patterns. A free joint has 6 columns (velocity in the axes of the environment, then angular velocity in the axes
    /// of the body), a ball joint 3, any other joint 1.
    ///
    /// # Errors
    /// Same errors as [`qpos_columns`](Self::qpos_columns).
    pub fn qvel_columns<P: AsRef<str>>(&self, patterns: &[P]) -> Result<Vec<Range<usize>>> {
        self.columns(patterns, self.model().jnt_dofadr(), [6, 3, 1])
    }

    fn columns<P: AsRef<str>>(&self, patterns: &[P], first: &[i32], widths: [usize; 3]) -> Result<Vec<Range<usize>>> {
        let [free, ball, one] = widths;
        let columns = |joint: usize| {
            let first = first[joint] as usize;
            let width = match mjcf_keywords::joint(self.model().jnt_type()[joint]) {
                Some("free") => free,
                Some("ball") => ball,
                _ => one,
            };
            first..first + width
        };
        Ok(self.select(patterns, self.joint_names(), "joint")?.into_iter().map(columns).collect())
    }

    fn select<P: AsRef<str>>(&self, patterns: &[P], names: &[String], what: &'static str) -> Result<Vec<usize>> {
        pattern::select(patterns, names, what)
            .map_err(|error| Error::MjcfNames { uid: self.uid().into(), error: Box::new(error) })
    }

    /// Sum of the masses of its bodies \[kg\] in the file. Randomized masses of environments are not included: see
    /// [`properties`](crate::SimulationManager::properties).
    pub fn total_mass(&self) -> f64 {
        self.model().body_mass().iter().sum()
    }

    /// Positions of its joints in MuJoCo's layout \[m, rad, quaternions w x y z\], in the environment, shape (N, nq).
    #[doc(alias = "get_qpos")]
    pub fn qpos(&self) -> Array2<f64> {
        self.rows(Stage::State, &self.indices().qpos, |env, place| env.data().qpos()[place])
    }

    /// Velocities of its joints in MuJoCo's layout \[m/s, rad/s\], shape (N, nv).
    #[doc(alias = "get_qvel")]
    pub fn qvel(&self) -> Array2<f64> {
        self.simulation.batch.gather_state(StateArray::Velocities, &self.indices().dofs, |place| *place)
    }

    /// Controls of its actuators as set, not clamped, in the units that the file gives them, shape (N, nu).
    #[doc(alias = "get_ctrl")]
    pub fn ctrl(&self) -> Array2<f64> {
        self.simulation.batch.gather_stored(RowPart::Inputs, &self.indices().controls, |row, &place| row.ctrl()[place])
    }

    /// Forces of its actuators as MuJoCo last solved them \[N or N m\], shape (N, nu): those of the last step, also
    /// after a write. [`SceneViewMut::contacts`](crate::SceneViewMut::contacts) solves the current state, so they are
    /// those of the current state after it. After a reset they are 0. If a sensor needs solved quantities, a write or a
    /// reset replaces them by the forces in the new state.
    #[doc(alias = "get_actuator_force")]
    pub fn actuator_force(&self) -> Array2<f64> {
        self.rows(Stage::Raw, &self.indices().actuators, |env, place| env.data().actuator_force()[place])
    }

    fn rows(&self, stage: Stage, places: &[usize], read: impl Fn(&SimEnv, usize) -> f64 + Sync) -> Array2<f64> {
        self.simulation.batch.gather(stage, places, |env, &place| read(env, place))
    }

    /// Pose of a body in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    ///
    /// # Errors
    /// The body does not exist; the error lists the nearest names.
    pub fn body_pose(&self, name: &str) -> Result<Array2<f64>> {
        let body = self.find("body", name, self.body_names())? + 1;
        Ok(self.poses(&BodyFrame::of_body(self.indices().bodies[body])))
    }

    /// Poses of all bodies, in the order of [`body_names`](Self::body_names): rows `[x, y, z, qw, qx, qy, qz]` in the
    /// environment \[m\], shape (N, bodies, 7).
    pub fn body_poses(&self) -> Array3<f64> {
        let frames: Vec<BodyFrame> = self.indices().bodies[1..].iter().map(|&body| BodyFrame::of_body(body)).collect();
        self.simulation.batch.body_rows_of(&frames, |bodies, frame| to_row(&frame.pose(bodies)))
    }

    /// Pose of a site in the environment: rows `[x, y, z, qw, qx, qy, qz]` \[m\], shape (N, 7).
    ///
    /// # Errors
    /// The site does not exist; the error lists the nearest names.
    pub fn site_pose(&self, name: &str) -> Result<Array2<f64>> {
        let site = self.find("site", name, self.site_names())?;
        let (p, q) = (&self.model().site_pos()[3 * site..], &self.model().site_quat()[4 * site..]);
        let body = self.indices().bodies[self.model().site_bodyid()[site] as usize];
        let body_from_frame = from_row(&[p[0], p[1], p[2], q[0], q[1], q[2], q[3]]);
        Ok(self.poses(&BodyFrame { body, body_from_frame }))
    }

    fn find(&self, what: &'static str, name: &str, names: &[String]) -> Result<usize> {
        names.iter().position(|known| known == name).ok_or_else(|| Error::UnknownName {
            what,
            name: name.into(),
            candidates: pattern::closest_names(name, names.iter().map(String::as_str))
                .into_iter()
                .map(String::from)
                .collect(),
        })
    }

    fn poses(&self, frame: &BodyFrame) -> Array2<f64> {
        self.simulation.batch.body_rows(|bodies| to_row(&frame.pose(bodies)))
    }
}

/// Write access to an MJCF part.
#[derive(Debug)]
pub struct MjcfPartMut<'a> {
    data: &'a Arc<MjcfData>,
    simulation: &'a mut Simulation,
    sensors: &'a mut SensorList,
    index: usize,
}

impl<'a> MjcfPartMut<'a> {
    pub(crate) fn new(
        data: &'a Arc<MjcfData>,
        simulation: &'a mut Simulation,
        sensors: &'a mut SensorList,
        index: usize,
    ) -> Self {
        Self { data, simulation, sensors, index }
    }

    /// Read access to the part.
    pub fn read(&self) -> MjcfPart<'_> {
        MjcfPart::new(self.data, self.simulation, self.index)
    }

    /// Sets controls, which stay until changed or reset, and are 0 at first.
    ///
    /// Rows are for `env_ids` (`None` for all environments; a single row applies to all of them), columns for
    /// `actuators` (`None` for all). MuJoCo clamps controls to the ranges of the file.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated actuator or environment, or a value that is not finite; then nothing is set.
    pub fn set_ctrl<'t>(
        &mut self,
        controls: impl AsArray<'t, f64, Ix2>,
        actuators: Option<&[ActuatorIndex]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let all = &self.simulation.mjcf_models[self.index].controls;
        let count = all.len();
        let exists = |&ActuatorIndex(index): &ActuatorIndex| {
            if index < count { Ok(index) } else { Err(Error::UnknownIndex { what: "actuator", index, count }) }
        };
        let chosen: Vec<usize> = match actuators {
            None => (0..count).collect(),
            Some(chosen) => chosen.iter().map(exists).collect::<Result<_>>()?,
        };
        let places: Vec<usize> = chosen.iter().map(|&index| all[index]).collect();
        let of = |column: usize| format!("actuator {:?}", self.data.names.actuators[chosen[column]]);
        check_unique_columns("set_ctrl", &chosen, &of)?;
        unique_envs("set_ctrl", env_ids, self.simulation.batch.num_envs())?;
        let table = ArgumentSpec {
            argument: "set_ctrl",
            meaning: "environments, actuators",
            columns: chosen.len(),
            column_label: &of,
        };
        let rows = EnvRows::check(table, controls.into(), env_ids, self.simulation.batch.num_envs())?;
        for (env, row) in rows.iter() {
            self.simulation.batch.edit_row(env, |env, model| {
                let set = |controls: &mut [f64]| {
                    places.iter().zip(row).for_each(|(&place, &value)| controls[place] = value);
                };
                env.set_controls(set, model);
            });
        }
        Ok(())
    }

    /// Writes positions of all joints into the state, in the layout of [`qpos`](MjcfPart::qpos): rows of nq numbers for
    /// `env_ids` (`None` for all environments; a single row applies to all of them). Positions are not clamped to joint
    /// ranges. Quaternions are normalized. A forward pass follows, so that later reads of positions and velocities
    /// belong to the new state.
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated environment, a value that is not finite, or a quaternion of length zero;
    /// then nothing is written.
    pub fn write_qpos<'t>(&mut self, positions: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let places = self.simulation.mjcf_models[self.index].qpos.clone();
        let rows = self.checked_rows("write_qpos", positions.into(), &places, env_ids)?;
        let quaternions = self.quaternions();
        let normalized: Vec<(usize, Vec<f64>)> = rows
            .iter()
            .map(|(env, row)| {
                let mut row = row.to_vec();
                quaternions.iter().try_for_each(|&first| normalize_quaternion("write_qpos", &mut row, first))?;
                Ok((env, row))
            })
            .collect::<Result<_>>()?;
        for (env, row) in normalized {
            self.simulation.batch.write_at(env, Stage::Raw, |env| {
                env.write_state(|data| {
                    let qpos = data.qpos_mut();
                    places.iter().zip(&row).for_each(|(&place, &value)| qpos[place] = value);
                });
            });
        }
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// Writes velocities of all joints into the state, in the layout of [`qvel`](MjcfPart::qvel): rows of nv numbers,
    /// for environments as in [`write_qpos`](Self::write_qpos).
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated environment, or a value that is not finite; then nothing is written.
    pub fn write_qvel<'t>(&mut self, velocities: impl AsArray<'t, f64, Ix2>, env_ids: Option<&[EnvId]>) -> Result<()> {
        let places = self.simulation.mjcf_models[self.index].dofs.clone();
        let rows = self.checked_rows("write_qvel", velocities.into(), &places, env_ids)?;
        for (env, row) in rows.iter() {
            self.simulation.batch.write_at(env, Stage::Raw, |env| {
                env.write_state(|data| {
                    let qvel = data.qvel_mut();
                    places.iter().zip(row).for_each(|(&place, &value)| qvel[place] = value);
                });
            });
        }
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// Sets the pose of a mocap body (`mocap="true"` in the file): rows `[x, y, z, qw, qx, qy, qz]` in the environment
    /// \[m\] for `env_ids` (`None` for all environments; a single row applies to all of them). The body stays there
    /// until the next write or reset. Quaternions are normalized. A forward pass follows.
    ///
    /// # Errors
    /// The body does not exist or is not a mocap body (the error lists mocap bodies); wrong shape, an unknown or
    /// repeated environment, a value that is not finite, or a quaternion of length zero. Then nothing is written.
    pub fn write_mocap_pose<'t>(
        &mut self,
        body: &str,
        poses: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let (file, names) = (&self.data.model, &self.data.names.bodies);
        let by_hand: Vec<usize> = (1..file.nbody()).filter(|&b| file.body_mocapid()[b] >= 0).collect();
        let found = by_hand.iter().find(|&&b| names[b] == body).ok_or_else(|| Error::UnknownName {
            what: "mocap body",
            name: body.into(),
            candidates: pattern::closest_names(body, by_hand.iter().map(|&b| names[b].as_str()))
                .into_iter()
                .map(String::from)
                .collect(),
        })?;
        let here = self.simulation.mjcf_models[self.index].bodies[*found];
        let mocap = self.simulation.batch.model().body_mocapid()[here];
        let of = |_| format!("body {body:?}");
        let table = ArgumentSpec {
            argument: "write_mocap_pose",
            meaning: "environments, x y z qw qx qy qz",
            columns: 7,
            column_label: &of,
        };
        unique_envs(table.argument, env_ids, self.simulation.batch.num_envs())?;
        let rows = EnvRows::check(table, poses.into(), env_ids, self.simulation.batch.num_envs())?;
        let mut places: Vec<(usize, [f64; 7])> = rows.arrays::<7>().collect();
        places.iter_mut().try_for_each(|(_, pose)| normalize_quaternion("write_mocap_pose", pose, 3))?;
        let mocap = usize::try_from(mocap).map_err(|_| Error::FixedBody(body.into()))?;
        for (env, [x, y, z, quaternion @ ..]) in places {
            self.simulation.batch.write_at(env, Stage::Raw, |env| {
                env.write_state(|data| {
                    data.mocap_pos_mut()[3 * mocap..3 * mocap + 3].copy_from_slice(&[x, y, z]);
                    data.mocap_quat_mut()[4 * mocap..4 * mocap + 4].copy_from_slice(&quaternion);
                });
            });
        }
        self.sensors.refresh(rows.envs(), self.simulation);
        Ok(())
    }

    /// First column of each quaternion in `qpos` (free and ball joints).
    fn quaternions(&self) -> Vec<usize> {
        let model = &self.data.model;
        let first = |joint: usize| {
            let first = model.jnt_qposadr()[joint] as usize;
            match mjcf_keywords::joint(model.jnt_type()[joint]) {
                Some("free") => Some(first + 3),
                Some("ball") => Some(first),
                _ => None,
            }
        };
        (0..model.njnt()).filter_map(first).collect()
    }

    fn checked_rows<'v>(
        &self,
        argument: &'static str,
        values: ArrayView2<'v, f64>,
        places: &[usize],
        env_ids: Option<&[EnvId]>,
    ) -> Result<EnvRows<'v>> {
        let of = |_| format!("MJCF part {:?}", self.data.uid());
        let table = ArgumentSpec {
            argument,
            meaning: "environments, joint positions or velocities",
            columns: places.len(),
            column_label: &of,
        };
        unique_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        EnvRows::check(table, values, env_ids, self.simulation.batch.num_envs())
    }
}

/// Normalizes the quaternion at `first` in a row.
fn normalize_quaternion(argument: &'static str, row: &mut [f64], first: usize) -> Result<()> {
    let quaternion = &mut row[first..first + 4];
    let norm = quaternion.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !(norm > 1e-9 && norm.is_finite()) {
        return Err(Error::Config {
            field: argument,
            value: format!("{quaternion:?} in columns {first} to {}", first + 3),
            expected: "a quaternion w, x, y, z must have a finite length above 0",
        });
    }
    quaternion.iter_mut().for_each(|q| *q /= norm);
    Ok(())
}
