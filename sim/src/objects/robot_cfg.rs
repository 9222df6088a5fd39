//! Configuration of a robot.

use super::mjcf_file::MjcfFile;
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
    /// URDF files of the robot; empty if [`mjcf`](Self::mjcf) is set.
    #[serde(deserialize_with = "crate::file_format::file_or_table")]
    pub urdf: UrdfCfg,
    /// MJCF file of the robot, instead of URDF files.
    ///
    /// MuJoCo compiles the file, and its compiled elements are in the scene: geoms with their materials and contact
    /// settings, sites, joints with anchors, references, springs and limits, equalities, tendons, sensors. The robot is
    /// the only child body of the file's world, with everything below it.
    ///
    /// - **Links** are its bodies, then its named sites. If hinges or slides attach the root body to the world, the
    ///   root link is the file's `world`. **Joints** are its hinges and slides. An element without a name gets its kind
    ///   and its index in MuJoCo's order as its name: `joint3`.
    /// - **Drives** replace its actuators. For joints that [`drive`](Self::drive) does not configure, position and
    ///   velocity actuators of the file give stiffness and damping. Force ranges (and control ranges of motors) give
    ///   the largest effort, and joints without an actuator stay passive. In a file without any actuator all joints are
    ///   driven, as in a URDF. One number for all joints (`stiffness: 100.0.into()`) configures the passive joints too,
    ///   and drives them.
    /// - An actuator on a joint that **follows** another, or on a **tendon** over joints, becomes part of the drive of
    ///   the followed joint. J is the effort on the followed joint per unit of actuator force: gains are multiplied by
    ///   J², effort limits by |J|. A tendon over joints that do not follow each other becomes one drive for each joint,
    ///   with independent targets. Effort limits are symmetric, activations (filters, integrators, muscles) are
    ///   dropped, and control ranges do not limit targets. [`diagnostics`](crate::SimulationManager::diagnostics) names
    ///   each actuator that its drive does not fully reproduce.
    /// - **Equalities** that couple two joints linearly are mimics. A joint with any other joint equality has no drive.
    ///   Its initial position is the value of the equality's polynomial at the initial position of the followed joint;
    ///   [`init_qpos`](Self::init_qpos) does not apply to it. Kinematics treat it as an independent joint, and
    ///   [`compute_ik`](crate::Robot::compute_ik) refuses to move it or the joint that it follows. A joint with several
    ///   equalities, or in a cycle of equalities, is not moved by them at the start: `init_qpos` or its own `ref`
    ///   applies.
    /// - **The base** is fixed or free according to [`fix_base`](Self::fix_base): the file's free joint is left out, or
    ///   a free joint is added.
    /// - **Contacts**: geoms that collide in the file collide like the geoms of every robot; their `contype` and
    ///   `conaffinity` are replaced. This includes geoms that collide only in pairs with geoms of the file's world;
    ///   friction and softness of such pairs are dropped. Other pairs of geoms apply if
    ///   [`self_collision`](Self::self_collision) is on. Bodies that the file excludes from collisions with its own
    ///   world collide with the scene.
    /// - The file's `solreffriction` and `solimpfriction` apply only to joints without an implicit drive; the dry
    ///   friction of joints with implicit drives has the softness of the drives.
    /// - Named sites are links on fixed joints. The end of a control part
    ///   ([`TipFrame::of_part`](kinetoscope_robot::kinematics::TipFrame::of_part)) follows such a joint if there is
    ///   exactly one. A site that is added to the last body, for example for a touch sensor, therefore moves that end.
    ///   Name the link ([`TipFrame::at`](kinetoscope_robot::kinematics::TipFrame::at)) where this matters.
    /// - Elements of the file's world (a floor, lights), global settings and keyframes are not part of the robot.
    ///   [`diagnostics`](crate::SimulationManager::diagnostics) names everything that is left out.
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
    /// Named groups of joints: a list of patterns for each name. A pattern matches whole joint names, and must match at
    /// least one; no joint may match two patterns of a part. Parts may share joints.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub control_parts: Vec<(String, Vec<String>)>,
    /// Drive properties.
    pub drive: DriveCfg,
    /// True (default) if the root link is fixed in the environment, false for a free base. A free joint of an MJCF file
    /// is left out or added accordingly.
    pub fix_base: bool,
    /// Pose of the root link in the environment; for an MJCF file, pose of the file's world, in which the root link is
    /// placed as in the file.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Initial height of the lowest collision point of the robot in its initial position above the plane z = 0 \[m\],
    /// instead of the z of [`init_pose`](Self::init_pose). `None` leaves the robot at `init_pose`.
    pub ground_clearance: Option<f64>,
    /// Initial positions by joint pattern or control part \[rad or m\]. Other joints start at 0, or at the `ref` of an
    /// MJCF file. All initial positions are clamped to the joint limits; a mimic joint starts at the position that its
    /// driver implies.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub init_qpos: Vec<(String, f64)>,
    /// Payloads by link pattern \[kg\], each added to every matching link: a point mass at the link's center of mass,
    /// or a ball with the density of water at the origin of a link without mass.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub payload: Vec<(String, f64)>,
    /// Surface properties of links besides their colors, for rendering only, by link pattern. A link may match only one
    /// pattern.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub surfaces: Vec<(String, SurfaceCfg)>,
    /// Fraction of the range of each joint between its soft limits, 0 to 1: see
    /// [`Robot::soft_qpos_limits`](crate::Robot::soft_qpos_limits).
    pub soft_limit_factor: f64,
    /// True if the links of this robot collide with each other; false by default, also for an MJCF file. Links
    /// connected by a joint, and links that overlap in the initial pose, do not collide, unless the MJCF file has a
    /// `<pair>` of their geoms.
    pub self_collision: bool,
    /// Settings for the convex hulls of collision meshes of URDF files. No effect on an MJCF file: MuJoCo computes its
    /// hulls.
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
