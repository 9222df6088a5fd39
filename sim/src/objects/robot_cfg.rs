//! Configuration of a robot.

use super::robot_file::MjcfFile;
use crate::drive::DriveCfg;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::HullCfg;
use serde::{Deserialize, Serialize};

/// Configuration of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RobotCfg {
    /// Name of the robot, unique in the simulation; prefix of its names in MuJoCo.
    pub uid: String,
    /// The URDF files.
    #[serde(deserialize_with = "crate::file_format::file_or_table")]
    pub urdf: UrdfCfg,
    /// The MJCF file, for a robot that is described by one: then there are no URDF files.
    ///
    /// MuJoCo itself compiles the file, and what it made of it is in the scene: geoms with their materials and contact
    /// settings, sites, joints with anchors, references, springs and limits, equalities, tendons, sensors. The robot is the
    /// only body in the file's world and what hangs on it.
    ///
    /// - **Links** are its bodies, then its named sites. Where hinges or slides hold the root body in the world, the root link
    ///   is the file's `world`. **Joints** are its hinges and slides. What has no name is called by its kind and its number in
    ///   MuJoCo's order: `joint3`.
    /// - **Drives** take the place of its actuators. Where [`drive`](Self::drive) says nothing of a joint, position and velocity
    ///   actuators of the file give stiffness and damping, force ranges (and control ranges of motors) the largest effort, and
    ///   joints that no actuator of the file acts on stay passive. In a file without any actuator all joints are driven, as in
    ///   a URDF. One number for all joints (`stiffness: 100.0.into()`) names the passive ones too, and drives them.
    /// - An actuator of a joint that **follows** another, or of a **tendon** over joints, is in the drive of the joint that is
    ///   followed: with J, the effort there by the force of the actuator, gains times J² and efforts times |J|. A tendon over
    ///   joints that do not follow each other becomes a drive of each, whose targets do not know of each other. Limits of
    ///   efforts are symmetric, activations (filters, integrators, muscles) are gone, targets are not limited by control
    ///   ranges: [`diagnostics`](crate::SimulationManager::diagnostics) names each actuator of which that is not the whole.
    /// - **Equalities** of two joints by a line are mimics; a joint that another equality of joints moves has no drive,
    ///   and starts where that curve is for the start of the joint that it follows, whatever [`init_qpos`](Self::init_qpos)
    ///   says of itself; kinematics take it for a joint of its own, and [`compute_ik`](crate::Robot::compute_ik) refuses to
    ///   move it or what it follows. Where several equalities are of one joint, or they go in a circle, it starts at its own `ref`.
    /// - **The base** is fixed or free as [`fix_base`](Self::fix_base) says: the file's free joint is left out or made.
    /// - **Contacts**: geoms that collide in the file collide as those of all robots do, whatever their bits, also those that
    ///   collide in pairs with what stands in the file's world alone; friction and softness of such pairs are not kept.
    ///   Other pairs of geoms hold where [`self_collision`](Self::self_collision) is on. What the file excludes from colliding
    ///   with its own world collides with the scene.
    /// - Dry friction of joints with implicit drives is as soft as that of all drives: the file's `solreffriction` and
    ///   `solimpfriction` hold for the others.
    /// - Named sites are links on fixed joints, which the end of a control part
    ///   ([`Tip::of_part`](kinetoscope_robot::kinematics::Tip::of_part)) follows where there is exactly one: to add a site to the last body,
    ///   for a touch sensor say, moves that end. Name the link ([`Tip::at`](kinetoscope_robot::kinematics::Tip::at)) where it matters.
    /// - What stands in the file's world (a floor, lights) is no part of the robot, nor are settings for the whole model and
    ///   keyframes. [`diagnostics`](crate::SimulationManager::diagnostics) names all that is left out.
    ///
    /// ```
    /// use kinetoscope_sim::{RobotCfg, SimulationManager, SimulationManagerCfg};
    /// use kinetoscope_sim::MjcfFile;
    ///
    /// let arm = r#"<mujoco><worldbody><body name="base"><geom size="0.1"/>
    ///     <body name="arm" pos="0 0 0.1"><joint name="elbow" axis="0 1 0" range="-90 90" limited="true"/>
    ///       <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0" mass="1"/><site name="tip" pos="0.3 0 0"/></body>
    ///   </body></worldbody>
    ///   <actuator><position joint="elbow" kp="200"/></actuator></mujoco>"#;
    /// let mut sim = SimulationManager::new(SimulationManagerCfg::default())?;
    /// let robot = sim.add_robot(RobotCfg { mjcf: Some(MjcfFile::text(arm)), ..Default::default() })?;
    /// let robot = sim.robot(robot);
    /// assert_eq!((robot.joint_names(), robot.link_names()), (&["elbow".into()][..], vec!["base", "arm", "tip"]));
    /// assert_eq!(robot.stiffness()[(0, 0)], 200.0);
    /// # Ok::<(), kinetoscope_sim::Error>(())
    /// ```
    #[serde(default, deserialize_with = "crate::file_format::mjcf_file")]
    pub mjcf: Option<MjcfFile>,
    /// Named groups of joints: patterns that each match whole joint names.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub control_parts: Vec<(String, Vec<String>)>,
    /// Drive properties.
    pub drive: DriveCfg,
    /// Whether the root link stands fixed in the environment.
    pub fix_base: bool,
    /// Pose of the root link in the environment; of an MJCF file the pose of the file's world, in which the root link stands
    /// as the file says.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Height of the lowest collision point of the robot above the ground at z = 0 at the start \[m\]; then the z of
    /// [`init_pose`](Self::init_pose) is not used. `None` leaves the robot where `init_pose` puts it.
    pub ground_clearance: Option<f64>,
    /// Start positions by joint pattern or control part \[rad or m\]; where none matches 0, or an MJCF file's `ref`.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub init_qpos: Vec<(String, f64)>,
    /// Masses that links carry besides their own, by link pattern \[kg\]: a point in the link's centre of mass; a ball of
    /// the density of water in the origin of a link without mass.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub payload: Vec<(String, f64)>,
    /// What surfaces of links look like besides their colours, by link pattern. No link may be matched twice.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub surfaces: Vec<(String, SurfaceCfg)>,
    /// Share of the range of each joint that is left between its soft limits, 0 to 1: see
    /// [`Robot::soft_qpos_limits`](crate::Robot::soft_qpos_limits).
    pub soft_limit_factor: f64,
    /// Whether links of this robot collide with each other.
    pub self_collision: bool,
    /// How collision meshes become convex hulls.
    pub hull: HullCfg,
}

impl Default for RobotCfg {
    fn default() -> Self {
        Self {
            uid: "robot".into(),
            urdf: UrdfCfg::default(),
            mjcf: None,
            control_parts: Vec::new(),
            drive: DriveCfg::default(),
            fix_base: true,
            init_pose: Pose::identity(),
            ground_clearance: None,
            init_qpos: Vec::new(),
            payload: Vec::new(),
            surfaces: Vec::new(),
            soft_limit_factor: 1.0,
            self_collision: false,
            hull: HullCfg::default(),
        }
    }
}
