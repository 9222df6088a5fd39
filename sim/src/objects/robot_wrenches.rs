//! External forces and torques on links of a robot, and gravity compensation, per environment.

use crate::body_pose::BodyFrame;
use crate::env::Stage;
use crate::error::{Error, Result};
use crate::ids::EnvId;
use crate::objects::robot::{Robot, RobotMut};
use crate::objects::rows::{ArgumentSpec, EnvRows, check_unique_indices, unique_envs};
use crate::row::RowPart;
use crate::wrenches::{Wrench, WrenchFrame};
use kinetoscope_robot::description::LinkId;
use nalgebra::Vector3;
use ndarray::{Array2, Array3, ArrayView3, AsArray, Ix3};

impl Robot<'_> {
    /// Forces and torques of [`set_external_wrench`](RobotMut::set_external_wrench), in world axes at the current poses
    /// of the links \[N, N m\], shape (N, links, 6). Gravity compensation is not included.
    #[doc(alias = "get_external_wrenches")]
    pub fn external_wrenches(&self) -> Array3<f64> {
        let (n, links) = (self.simulation.batch.num_envs(), self.indexing().links.len());
        let mut wrenches = Array3::zeros((n, links, 6));
        if let Some(out) = wrenches.as_slice_mut() {
            self.simulation.batch.read_bodies(out, |_, bodies, out| {
                let mine = |wrench: &&Wrench| wrench.owner.0 == self.index() && wrench.owner.1 < links;
                for wrench in bodies.wrenches().list.iter().filter(mine) {
                    let [force, torque] = wrench.in_world(bodies);
                    let out = &mut out[6 * wrench.owner.1..6 * wrench.owner.1 + 6];
                    out.iter_mut().zip(force.iter().chain(&torque)).for_each(|(to, from)| *to = *from);
                }
            });
        }
        wrenches
    }

    /// True for links with gravity compensation by [`set_gravity_compensation`](RobotMut::set_gravity_compensation),
    /// shape (N, links). Links fused into one body have the same value. `gravcomp` of an MJCF file is not included.
    #[doc(alias = "get_gravity_compensation")]
    pub fn gravity_compensation(&self) -> Array2<bool> {
        let links = &self.indexing().links;
        let mut weightless = Array2::from_elem((self.simulation.batch.num_envs(), links.len()), false);
        self.simulation.batch.for_each_row(RowPart::Inputs, |i, env| {
            for (l, link) in links.iter().enumerate() {
                weightless[(i, l)] = env.wrenches().gravity_compensated.contains(&link.body);
            }
        });
        weightless
    }
}

impl RobotMut<'_> {
    /// Applies forces \[N\] and torques \[N m\] to links in every step until the next call for the same link or a reset
    /// of the environment. Zeros remove them. Both have the shape (environments, links, 3): rows for `env_ids` (`None`
    /// for all environments; a single row applies to all of them), links as `link_ids` (`None` for all links). Other
    /// links keep their wrenches.
    ///
    /// A force acts at the center of mass of the link's body: of the link and of all links fixed to it. Wrenches on
    /// links that are fused into one body add up. To push at a point at the offset `r` from there, add `r x F` to the
    /// torque. With [`WrenchFrame::World`] both are in world axes and keep their direction. With [`WrenchFrame::Link`]
    /// both are in the axes of the link and turn with it.
    ///
    /// ```
    /// use ndarray::array;
    /// use kinetoscope_sim::{RobotCfg, SimulationManager, SimulationManagerCfg, WrenchFrame};
    /// use kinetoscope_robot::urdf::UrdfCfg;
    /// # let urdf = std::env::temp_dir().join(format!("kinetoscope-wrench-{}.urdf", std::process::id()));
    /// # std::fs::write(&urdf, "<robot name='r'><link name='puck'><inertial><mass value='2'/>
    /// #   <inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial></link></robot>")?;
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg { gravity: [0.0; 3].into(), ..Default::default() })?;
    /// let id = sim.add_robot(RobotCfg { urdf: UrdfCfg::single(&urdf), fix_base: false, ..Default::default() })?;
    /// # std::fs::remove_file(&urdf)?;
    /// let puck = sim.robot(id).link_id("puck")?;
    /// let (force, torque) = (array![[[3.0, 0.0, 0.0]]], array![[[0.0, 0.0, 0.0]]]);
    /// sim.robot_mut(id).set_external_wrench(&force, &torque, WrenchFrame::World, Some(&[puck]), None)?;
    /// sim.update(100);
    /// // 3 N on 2 kg for a second.
    /// assert!((sim.robot(id).root_velocity()[(0, 0)] - 1.5).abs() < 1e-9);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Wrong shape, an unknown or repeated link or environment, or a value that is not finite; then nothing is set.
    pub fn set_external_wrench<'f, 't>(
        &mut self,
        forces: impl AsArray<'f, f64, Ix3>,
        torques: impl AsArray<'t, f64, Ix3>,
        frame: WrenchFrame,
        link_ids: Option<&[LinkId]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let argument = "set_external_wrench";
        let links = self.links(argument, link_ids)?;
        let envs = unique_envs(argument, env_ids, self.simulation.batch.num_envs())?;
        let forces = self.vectors("set_external_wrench (forces)", forces.into(), &links, env_ids)?;
        let torques = self.vectors("set_external_wrench (torques)", torques.into(), &links, env_ids)?;
        let robot = self.index;
        let frames = &self.simulation.robots[robot].links;
        let vector = |row: &[f64], k: usize| Vector3::new(row[3 * k], row[3 * k + 1], row[3 * k + 2]);
        for (i, env) in envs.into_iter().enumerate() {
            // A single row applies to all environments.
            let [force_row, torque_row] = [&forces, &torques].map(|rows| &rows[i.min(rows.len() - 1)]);
            self.simulation.batch.write_at(env, Stage::Kinematics, |env| {
                env.set_wrenches(|wrenches| {
                    for (k, &link) in links.iter().enumerate() {
                        let BodyFrame { body, body_from_frame } = frames[link];
                        let axes = (frame == WrenchFrame::Link).then_some(body_from_frame.rotation);
                        let (force, torque) = (vector(force_row, k), vector(torque_row, k));
                        wrenches.replace(Wrench { owner: (robot, link), body, axes, force, torque });
                    }
                });
            });
        }
        Ok(())
    }

    /// Switches gravity compensation of links on or off, for `link_ids` (`None` for all links) in `env_ids` (`None` for
    /// all environments); off by default. The setting survives resets.
    ///
    /// The force `-m g` at its center of mass holds a compensated link. Drives do not carry its weight; its inertia
    /// stays. For a link that is fused with others, the setting applies to their whole body. Gravity still acts on
    /// objects and on loads that the robot holds.
    ///
    /// # Errors
    /// An unknown or repeated link or environment; then nothing is changed.
    pub fn set_gravity_compensation(
        &mut self,
        on: bool,
        link_ids: Option<&[LinkId]>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<()> {
        let argument = "set_gravity_compensation";
        let links = self.links(argument, link_ids)?;
        let mut bodies: Vec<usize> =
            links.iter().map(|&link| self.simulation.robots[self.index].links[link].body).collect();
        bodies.sort_unstable();
        bodies.dedup();
        for env in unique_envs(argument, env_ids, self.simulation.batch.num_envs())? {
            self.simulation.batch.write_at(env, Stage::Kinematics, |env| {
                env.set_wrenches(|wrenches| wrenches.set_gravity_compensation(&bodies, on));
            });
        }
        Ok(())
    }

    /// Indices of the selected links in the given order, each once; all links for `None`.
    fn links(&self, argument: &'static str, link_ids: Option<&[LinkId]>) -> Result<Vec<usize>> {
        let known = self.data.description().named_links();
        let count = known.len();
        let exists =
            |index| if index < count { Ok(index) } else { Err(Error::UnknownIndex { what: "link", index, count }) };
        match link_ids {
            None => Ok((0..count).collect()),
            Some(ids) => {
                let links = ids.iter().map(|&LinkId(index)| exists(index)).collect::<Result<Vec<_>>>()?;
                check_unique_indices(argument, &links, &|link| format!("link {:?}", known[link].name))?;
                Ok(links)
            }
        }
    }

    /// Checks vectors, and returns one row of them per environment, or one row for all.
    fn vectors(
        &self,
        argument: &'static str,
        vectors: ArrayView3<'_, f64>,
        links: &[usize],
        env_ids: Option<&[EnvId]>,
    ) -> Result<Vec<Vec<f64>>> {
        let meaning = "environments, links, x y z";
        let num_envs = self.simulation.batch.num_envs();
        let envs = env_ids.map_or(num_envs, <[EnvId]>::len);
        let (rows, columns, axes) = vectors.dim();
        let fits = [1, envs].contains(&rows) && columns == links.len() && axes == 3;
        let Some(flat) = vectors.to_shape((rows, columns * axes)).ok().filter(|_| fits) else {
            let (found, expected) = (vectors.shape().to_vec(), vec![envs, links.len(), 3]);
            return Err(Error::Shape { argument, found, expected, meaning });
        };
        let name = |link: usize| &self.data.description().links[link].name;
        let of = |column: usize| format!("{} of link {:?}", ["x", "y", "z"][column % 3], name(links[column / 3]));
        EnvRows::check(
            ArgumentSpec { argument, meaning, columns: 3 * columns, column_label: &of },
            flat.view(),
            env_ids,
            num_envs,
        )?;
        Ok(flat.rows().into_iter().map(|row| row.to_vec()).collect())
    }
}
