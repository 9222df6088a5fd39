//! Forward kinematics, Jacobians and inverse kinematics of robots in a simulation.

use crate::env::{SimEnv, Stage};
use crate::error::{Error, Result};
use crate::ids::{EnvId, env_list};
use crate::objects::robot::Robot;
use crate::objects::robot_data::{check_pose, unknown_name_error};
use crate::objects::rows::{ArgumentSpec, EnvRows};
use kinetoscope_robot::description::{FileActuation, JointId, JointKind, LinkId};
use kinetoscope_robot::kinematics::{
    Chain, IkCfg, IkSolver, KinematicsError, NullSpacePosture, TipFrame, TipSelector, link_poses,
};
use kinetoscope_scene::Pose;
use kinetoscope_scene::pose::to_row;
use kinetoscope_sensors::camera::{CameraError, Poses};
use nalgebra::Vector6;
use ndarray::{Array1, Array2, Array3, ArrayView1, ArrayView2, AsArray, Ix2};

/// Result of [`Robot::compute_ik`], with one entry per selected environment.
#[derive(Clone, Debug, PartialEq)]
pub struct IkResult {
    /// Positions of the joints \[rad or m\], shape (N, joints): columns as in [`compute_fk`](Robot::compute_fk). Joints
    /// that do not move the frame keep their initial positions; mimic joints follow. Where `success` is false, these
    /// are the best positions found.
    pub qpos: Array2<f64>,
    /// True where the frame is within the tolerances of its target, shape (N,).
    pub success: Array1<bool>,
    /// Distance between the frame and its target \[m\], shape (N,).
    pub position_error: Array1<f64>,
    /// Angle between the frame and its target \[rad\], shape (N,); also given where only the position had to be
    /// reached.
    pub rotation_error: Array1<f64>,
    /// Total number of solver iterations of all starts, the refinement and the null-space posture, shape (N,).
    pub iterations: Array1<u32>,
    /// Index of the start that led to the result, shape (N,): 0 is the start from the initial positions, others are
    /// random.
    pub seed: Array1<u32>,
}

/// [`TipFrame`] that is resolved for a robot.
struct ResolvedTip {
    chain: Chain,
    /// Columns of `qpos` of the selected joints, which are the columns of all arrays.
    columns: Vec<usize>,
    /// Owner of the joints in error messages.
    of: String,
    link: LinkId,
}

impl Robot<'_> {
    /// Forward kinematics of a frame: poses at joint positions `qpos` \[rad or m\], rows `[x, y, z, qw, qx, qy, qz]` in
    /// the environment \[m\], shape (N, 7). They include the pose of the robot's root in each environment.
    ///
    /// `qpos` has a row for each of `env_ids` (`None` for all environments), or one for all of them. It has a column
    /// for each joint of the control part that `tip` names ([`joint_ids`](Self::joint_ids)), or for each joint of the
    /// robot. Other joints keep their current positions in the environment. Mimic joints follow their drivers; their
    /// own columns are accepted and ignored. Positions beyond the limits are not clamped. The state does not change.
    ///
    /// # Errors
    /// Unknown part, link or environment; wrong shape; a number that is not finite; a part that ends in several links.
    pub fn compute_fk<'t, 'n>(
        &self,
        qpos: impl AsArray<'t, f64, Ix2>,
        tip: impl Into<TipFrame<'n>>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Array2<f64>> {
        let resolved = self.resolve(&tip.into())?;
        let rows = self.part_rows("compute_fk", qpos.into(), &resolved.columns, env_ids)?;
        let mut poses = Array2::zeros((rows.envs().len(), 7));
        let mut positions = vec![0.0; self.dof()];
        for (i, (env, row)) in rows.iter().enumerate() {
            let env_from_base = self.read_positions(env, resolved.chain.base(), &mut positions);
            scatter(&resolved.columns, row, &mut positions);
            let pose = env_from_base * resolved.chain.pose(&positions);
            poses.row_mut(i).assign(&ArrayView1::from(&to_row(&pose)));
        }
        Ok(poses)
    }

    /// Forward kinematics of all links, fused links included, in the order of [`link_names`](Self::link_names): poses
    /// at positions `qpos` of all joints \[rad or m\], rows `[x, y, z, qw, qx, qy, qz]` in the environment \[m\], shape
    /// (N, links, 7). [`compute_fk`](Self::compute_fk) explains rows and mimic joints.
    ///
    /// # Errors
    /// Unknown environment; wrong shape; a number that is not finite.
    pub fn compute_link_fk<'t>(
        &self,
        qpos: impl AsArray<'t, f64, Ix2>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Array3<f64>> {
        let columns: Vec<usize> = (0..self.dof()).collect();
        let rows = self.part_rows("compute_link_fk", qpos.into(), &columns, env_ids)?;
        let description = self.description();
        let links = description.named_links().len();
        let mut poses = Array3::zeros((rows.envs().len(), links, 7));
        let mut positions = vec![0.0; self.dof()];
        for (i, (env, row)) in rows.iter().enumerate() {
            scatter(&columns, row, &mut positions);
            let standing = |link| self.simulation.batch.read_at(env, Stage::Kinematics, |env| self.link_in(env, link));
            for (link, pose) in link_poses(description, &positions, standing).iter().take(links).enumerate() {
                for (k, value) in to_row(pose).into_iter().enumerate() {
                    poses[(i, link, k)] = value;
                }
            }
        }
        Ok(poses)
    }

    /// Jacobians of a frame, shape (N, 6, columns): velocity of its origin, then its angular velocity, both in the axes
    /// of the environment, per unit of each joint's velocity, with a fixed root.
    ///
    /// They are evaluated at joint positions `qpos` \[rad or m\], or at the current positions if `qpos` is `None`. Rows
    /// and columns are those of [`compute_fk`](Self::compute_fk). The column of a mimic joint is 0: its motion is part
    /// of the column of its driver.
    ///
    /// # Errors
    /// Same errors as [`compute_fk`](Self::compute_fk).
    pub fn jacobian<'n>(
        &self,
        tip: impl Into<TipFrame<'n>>,
        qpos: Option<ArrayView2<'_, f64>>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<Array3<f64>> {
        let ResolvedTip { chain, columns, .. } = self.resolve(&tip.into())?;
        let present = self.qpos();
        let rows = qpos.map(|qpos| self.part_rows("jacobian", qpos, &columns, env_ids)).transpose()?;
        let envs = env_list(env_ids, self.simulation.batch.num_envs())?;
        let mut jacobians = Array3::zeros((envs.len(), 6, columns.len()));
        let mut positions = vec![0.0; self.dof()];
        let mut of_joint = vec![Vector6::zeros(); self.dof()];
        let mut given = rows.as_ref().map(EnvRows::iter);
        for (i, &env) in envs.iter().enumerate() {
            let env_from_base = self.read_positions(env, chain.base(), &mut positions);
            match given.as_mut().and_then(Iterator::next) {
                Some((_, row)) => scatter(&columns, row, &mut positions),
                None => positions.iter_mut().zip(present.row(env)).for_each(|(position, now)| *position = *now),
            }
            chain.jacobian(&positions, &mut of_joint);
            for (k, &column) in columns.iter().enumerate() {
                let in_base = of_joint[column];
                let linear = env_from_base.rotation * in_base.fixed_rows::<3>(0);
                let angular = env_from_base.rotation * in_base.fixed_rows::<3>(3);
                for axis in 0..3 {
                    jacobians[(i, axis, k)] = linear[axis];
                    jacobians[(i, 3 + axis, k)] = angular[axis];
                }
            }
        }
        Ok(jacobians)
    }

    /// Inverse kinematics: joint positions that bring a frame to `targets`.
    ///
    /// `targets` are poses in the environment, typed or as rows `[x, y, z, qw, qx, qy, qz]` \[m\], one for each of
    /// `env_ids` (`None` for all environments), or one for all of them. Quaternions are normalized.
    ///
    /// The search covers the joints of the control part that `tip` names, or all joints of the robot, within the limits
    /// at the time the robot was added: those of each joint, narrowed by the limits of its mimic followers. Tighter
    /// limits of [`set_qpos_limits`](crate::RobotMut::set_qpos_limits) are ignored: a solution may be outside of
    /// [`qpos_limits`](Self::qpos_limits), and `set_qpos_target` would clamp it. Other joints keep their current
    /// positions in the environment. The search starts from `initial` \[rad or m\], with rows and columns as in
    /// [`compute_fk`](Self::compute_fk), or from the current positions. [`IkSolver`] runs on the calling thread.
    /// Contacts are not considered, and the state does not change: pass the result to
    /// [`set_qpos_target`](crate::RobotMut::set_qpos_target) where [`success`](IkResult::success) is true.
    ///
    /// Randomized properties have no effect here: no [`Property`](crate::Property) moves a joint or a link's frame, and
    /// masses and sizes are not used.
    ///
    /// Nearby targets may have distant solutions. Near a singularity (a stretched arm, two collinear axes, or parallel
    /// axes beside another pair), a small step along a path may need a quarter turn of a joint. A nearby solution may
    /// also not exist: it may be beyond a limit, or need the arm to bend to the other side. A random start may then
    /// lead to another posture of the arm. To follow a path, solve in small steps from the previous positions and
    /// compare the results with them. With one start ([`num_seeds`](IkCfg::num_seeds) 1) no other posture is tried.
    ///
    /// For equal target poses in the root frame, equal initial positions, and equal positions of the other joints,
    /// results are bit-identical in any environment and any batch. A different root pose changes only the rounding of
    /// the target pose in the root frame.
    ///
    /// ```
    /// use ndarray::array;
    /// use kinetoscope_robot::kinematics::{IkCfg, TipFrame};
    /// use kinetoscope_sim::{RobotCfg, SimulationManager, SimulationManagerCfg};
    /// use kinetoscope_robot::urdf::UrdfCfg;
    /// # let urdf = std::env::temp_dir().join(format!("kinetoscope-arm-{}.urdf", std::process::id()));
    /// # let link = |name: &str| format!("<link name='{name}'><inertial><mass value='1'/>
    /// #   <inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial></link>");
    /// # let joint = |name: &str, a: &str, b: &str, x: f64| format!(
    /// #   "<joint name='{name}' type='continuous'><parent link='{a}'/>
    /// #   <child link='{b}'/><origin xyz='{x} 0 0'/><axis xyz='0 0 1'/></joint>");
    /// # std::fs::write(&urdf, format!("<robot name='r'>{}{}{}{}{}</robot>", link("foot"), link("upper"),
    /// #   link("lower"),
    /// #   joint("shoulder", "foot", "upper", 0.0), joint("elbow", "upper", "lower", 0.5)))?;
    ///
    /// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
    /// let arm = sim.add_robot(RobotCfg {
    ///     urdf: UrdfCfg::single(&urdf),
    ///     control_parts: vec![("arm".into(), vec!["shoulder".into(), "elbow".into()])],
    ///     ..Default::default()
    /// })?;
    /// # std::fs::remove_file(&urdf)?;
    /// let hand = TipFrame::of_part("arm").with_tcp(kinetoscope_scene::Pose::translation(0.3, 0.0, 0.0));
    /// let robot = sim.robot(arm);
    /// let targets = robot.compute_fk(&array![[0.4, 0.9]], hand, None)?;
    /// let found = robot.compute_ik(&targets, hand, &IkCfg::default(), None, None)?;
    /// assert!(found.success[0] && found.position_error[0] < 1e-4);
    /// assert!((found.qpos[(0, 0)] - 0.4).abs() < 1e-3 && (found.qpos[(0, 1)] - 0.9).abs() < 1e-3);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Unknown part, link or environment; wrong shape; a number that is not finite, or out of its range; a quaternion
    /// of length zero. A part that ends in several links, or without a joint that moves the frame. A joint with a
    /// polynomial coupling of an MJCF file, if it would have to move with the searched joints. A target that cannot be
    /// reached is not an error.
    pub fn compute_ik<'n>(
        &self,
        targets: &(impl Poses + ?Sized),
        tip: impl Into<TipFrame<'n>>,
        cfg: &IkCfg,
        initial: Option<ArrayView2<'_, f64>>,
        env_ids: Option<&[EnvId]>,
    ) -> Result<IkResult> {
        let ResolvedTip { chain, columns, of, link } = self.resolve(&tip.into())?;
        let envs = env_list(env_ids, self.simulation.batch.num_envs())?;
        let targets = targets.to_poses().map_err(|error| target_error(error, envs.len()))?;
        if targets.len() != envs.len() && targets.len() != 1 {
            let (found, expected) = (vec![targets.len(), 7], vec![envs.len(), 7]);
            return Err(Error::Shape {
                argument: "compute_ik",
                found,
                expected,
                meaning: "environments, x y z qw qx qy qz",
            });
        }
        let rows = initial.map(|rows| self.part_rows("compute_ik, initial", rows, &columns, env_ids)).transpose()?;
        cfg.validate(columns.len()).map_err(|error| self.kinematics_error(error))?;

        // Entries of `columns` to solve for.
        let free: Vec<usize> = (0..columns.len())
            .filter(|&k| self.data.plans()[columns[k]].mimic.is_none() && chain.is_moved_by(columns[k]))
            .collect();
        if free.is_empty() {
            return Err(self.no_moving_joint(&chain, of, link));
        }
        if let Some(column) = self.polynomial_follower(&chain, &free.iter().map(|&k| columns[k]).collect::<Vec<_>>()) {
            let (joint, link) = (self.joint_names()[column].clone(), self.description().link(link).name.clone());
            return Err(self.kinematics_error(KinematicsError::PolynomialCoupling { joint, link }));
        }
        let mut variable_of = vec![None; self.dof()];
        free.iter().enumerate().for_each(|(variable, &k)| variable_of[columns[k]] = Some(variable));
        let limits = free.iter().map(|&k| self.data.plans()[columns[k]].target_range).collect();
        let posture = cfg.posture.as_ref().map(|posture| NullSpacePosture {
            rest: free.iter().map(|&k| posture.rest[k]).collect(),
            ..posture.clone()
        });
        let cfg = IkCfg { posture, ..cfg.clone() };
        let bound = chain.reduced(&free.iter().map(|&k| columns[k]).collect::<Vec<_>>(), &vec![0.0; self.dof()]);
        let mut solver = IkSolver::new(bound, limits, cfg).map_err(|error| self.kinematics_error(error))?;

        let mut result = IkResult {
            qpos: Array2::zeros((envs.len(), columns.len())),
            success: Array1::from_elem(envs.len(), false),
            position_error: Array1::zeros(envs.len()),
            rotation_error: Array1::zeros(envs.len()),
            iterations: Array1::zeros(envs.len()),
            seed: Array1::zeros(envs.len()),
        };
        let followers = self.mimic_drivers();
        let (mut positions, mut start) = (vec![0.0; self.dof()], vec![0.0; free.len()]);
        let mut given = rows.as_ref().map(EnvRows::iter);
        for (i, &env) in envs.iter().enumerate() {
            let env_from_base = self.read_positions(env, chain.base(), &mut positions);
            if let Some((_, row)) = given.as_mut().and_then(Iterator::next) {
                scatter(&columns, row, &mut positions);
            }
            chain.reduce_into(&variable_of, &positions, solver.chain_mut());
            start.iter_mut().zip(&free).for_each(|(start, &k)| *start = positions[columns[k]]);
            let target = env_from_base.inv_mul(&targets[if targets.len() == 1 { 0 } else { i }]);
            let found = solver.solve(&target, &start).map_err(|error| self.kinematics_error(error))?;
            free.iter().zip(found.positions).for_each(|(&k, &position)| positions[columns[k]] = position);
            for (k, &column) in columns.iter().enumerate() {
                let (driver, ratio, offset) = followers[column];
                result.qpos[(i, k)] =
                    if driver.0 == column { positions[column] } else { ratio * positions[driver.0] + offset };
            }
            result.success[i] = found.success;
            result.position_error[i] = found.position_error;
            result.rotation_error[i] = found.rotation_error;
            result.iterations[i] = found.iterations;
            result.seed[i] = found.seed;
        }
        Ok(result)
    }

    /// Resolves the link and the joints that `tip` names.
    fn resolve(&self, tip: &TipFrame<'_>) -> Result<ResolvedTip> {
        check_pose("tcp", &tip.tcp)?;
        let part = match tip.name {
            TipSelector::Part(part) => Some(part),
            TipSelector::Link(_) => None,
            TipSelector::PartOrLink(name) if self.control_parts().contains(&name) => Some(name),
            TipSelector::PartOrLink(name) if self.description().link_id(name).is_some() => None,
            TipSelector::PartOrLink(name) => {
                let names = self.control_parts().into_iter().chain(self.link_names());
                return Err(unknown_name_error("control part or link", name, names));
            }
        };
        let (columns, of): (Vec<usize>, String) = match part {
            Some(part) => {
                let ids = self.joint_ids(part)?;
                (ids.iter().map(|id| id.0).collect(), format!("control part {part:?}"))
            }
            None => ((0..self.dof()).collect(), "the robot".into()),
        };
        let link = match (tip.link, tip.name) {
            (Some(link), _) | (None, TipSelector::Link(link)) => self.link_id(link)?,
            (None, TipSelector::Part(name) | TipSelector::PartOrLink(name)) => match part {
                Some(part) => self.end_of(part, &columns)?,
                None => self.link_id(name)?,
            },
        };
        let chain = Chain::new(self.description(), link, &tip.tcp).map_err(|error| self.kinematics_error(error))?;
        Ok(ResolvedTip { chain, columns, of, link })
    }

    /// Link at the end of a part: see [`TipFrame::of_part`].
    fn end_of(&self, part: &str, columns: &[usize]) -> Result<LinkId> {
        let description = self.description();
        let child = |column: usize| description.joint(self.data.plans()[column].joint).child;
        let above = |link: LinkId| {
            let parent =
                move |link: &LinkId| description.link(*link).parent_joint.map(|id| description.joint(id).parent);
            std::iter::successors(parent(&link), parent)
        };
        // Ends of branches: links without another joint of the part below them.
        let moved: Vec<LinkId> = columns.iter().map(|&column| child(column)).collect();
        let ends: Vec<LinkId> =
            moved.iter().copied().filter(|end| !moved.iter().any(|&other| above(other).any(|l| l == *end))).collect();
        let [mut end] = ends[..] else {
            let error = match ends.is_empty() {
                true => KinematicsError::NoMovingJoint {
                    of: format!("control part {part:?}, which is empty,"),
                    link: description.link(description.root).name.clone(),
                    moving_joints: Vec::new(),
                },
                false => KinematicsError::AmbiguousTip {
                    part: part.into(),
                    links: ends.iter().map(|&l| description.link(l).name.clone()).collect(),
                },
            };
            return Err(self.kinematics_error(error));
        };
        loop {
            let link = description.link(end);
            let fixed = |id: &&JointId| {
                let joint = description.joint(**id);
                joint.kind == JointKind::Fixed && description.link(joint.child).component == link.component
            };
            let mut behind = link.child_joints.iter().filter(fixed);
            match (behind.next(), behind.next()) {
                (Some(&id), None) => end = description.joint(id).child,
                _ => return Ok(end),
            }
        }
    }

    /// Finds the column of a joint with a polynomial coupling that moves the end of the chain, and that is in `free` or
    /// follows a joint in `free`. `None` without such a joint.
    fn polynomial_follower(&self, chain: &Chain, free: &[usize]) -> Option<usize> {
        let (description, plans) = (self.description(), self.data.plans());
        let column_of = |joint: JointId| plans.iter().position(|plan| plan.joint == joint);
        (0..plans.len()).filter(|&column| chain.is_moved_by(column)).find(|&column| {
            let Some(defaults) = description.joint(plans[column].joint).defaults else { return false };
            let FileActuation::Coupled(curve) = defaults.drive else { return false };
            let driver = curve.and_then(|curve| curve.joint).map(|joint| description.mimic_driver(joint).0);
            free.contains(&column) || driver.and_then(column_of).is_some_and(|driver| free.contains(&driver))
        })
    }

    fn no_moving_joint(&self, chain: &Chain, of: String, link: LinkId) -> Error {
        let movers = (0..self.dof()).filter(|&column| chain.is_moved_by(column));
        self.kinematics_error(KinematicsError::NoMovingJoint {
            of,
            link: self.description().link(link).name.clone(),
            moving_joints: movers.map(|column| self.joint_names()[column].clone()).collect(),
        })
    }

    fn kinematics_error(&self, error: KinematicsError) -> Error {
        Error::Kinematics { robot: self.data.label(), error: Box::new(error) }
    }

    /// Writes the current positions of all joints in environment `env`, in the order of `qpos`, to `positions` \[rad or
    /// m\]. Returns the pose of the link `base` in the environment.
    fn read_positions(&self, env: usize, base: LinkId, positions: &mut [f64]) -> Pose {
        self.simulation.batch.read_at(env, Stage::Kinematics, |env| {
            for (position, joint) in positions.iter_mut().zip(&self.indexing().joints) {
                *position = env.data().qpos()[joint.qpos];
            }
            self.link_in(env, base)
        })
    }

    fn link_in(&self, env: &SimEnv, link: LinkId) -> Pose {
        self.indexing().links[link.0].pose(env.data())
    }

    /// Checks the shape and the numbers of positions of the joints `columns`. Repeated environments are allowed.
    fn part_rows<'v>(
        &self,
        argument: &'static str,
        values: ArrayView2<'v, f64>,
        columns: &[usize],
        env_ids: Option<&[EnvId]>,
    ) -> Result<EnvRows<'v>> {
        let of = |column: usize| format!("joint {:?}", self.joint_names()[columns[column]]);
        let table =
            ArgumentSpec { argument, meaning: "environments, joints", columns: columns.len(), column_label: &of };
        EnvRows::check(table, values, env_ids, self.simulation.batch.num_envs())
    }
}

fn scatter(columns: &[usize], row: ArrayView1<'_, f64>, positions: &mut [f64]) {
    for (&column, &value) in columns.iter().zip(row) {
        positions[column] = value;
    }
}

/// Converts an error of target poses to an error of this crate.
fn target_error(error: CameraError, envs: usize) -> Error {
    let argument = "compute_ik";
    match error {
        CameraError::PoseColumns { columns } => {
            let (found, expected) = (vec![envs, columns], vec![envs, 7]);
            Error::Shape { argument, found, expected, meaning: "environments, x y z qw qx qy qz" }
        }
        CameraError::Pose { row, pose } => match pose.iter().position(|x| !x.is_finite()) {
            Some(column) => Error::NotFinite { argument, row, column, item: "target".into(), value: pose[column] },
            None => Error::Config {
                field: "target of compute_ik",
                value: format!("{pose:?} in row {row}"),
                expected: "the last four numbers must be a quaternion w, x, y, z of a length that is not zero",
            },
        },
        other => Error::Config {
            field: "target of compute_ik",
            value: other.to_string(),
            expected: "expected an array with 7 columns: x, y, z, qw, qx, qy, qz",
        },
    }
}
