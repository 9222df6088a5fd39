//! Articulations: jointed objects without drives of their own, such as drawers, doors and lids.

use crate::drive::{DriveCfg, DriveType, PerJoint};
use crate::error::Result;
use crate::ids::RobotId;
use crate::manager::SimulationManager;
use crate::objects::mjcf_file::MjcfFile;
use crate::objects::robot::{Robot, RobotCfg, RobotMut};
use crate::objects::robot_data::RobotKind;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::HullCfg;
use serde::{Deserialize, Serialize};

/// Configuration of an articulation: a jointed object that is passive by default.
///
/// Without `drive`, its joints have the limits, the damping and the dry friction of the file, and no drive moves or
/// holds them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArticulationCfg {
    /// Name of the articulation, unique in the simulation; prefix of its names in MuJoCo.
    pub uid: String,
    /// URDF files of the articulation; empty if [`mjcf`](Self::mjcf) is set.
    #[serde(deserialize_with = "crate::file_format::file_or_table")]
    pub urdf: UrdfCfg,
    /// MJCF file of the articulation, instead of URDF files; see [`RobotCfg::mjcf`]. If [`drive`](Self::drive) is
    /// `None`, its actuators drive nothing; its springs, friction and equalities apply.
    #[serde(default, deserialize_with = "crate::file_format::mjcf_file")]
    pub mjcf: Option<MjcfFile>,
    /// True (default) if the root link is fixed in the environment. A free root link can be placed in each environment.
    pub fix_base: bool,
    /// Pose of the root link in the environment; for an MJCF file, pose of the file's world.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Initial positions by joint pattern \[rad or m\]. Other joints start at 0, or at the `ref` of an MJCF file. All
    /// initial positions are clamped to the joint limits; a mimic joint starts at the position that its driver implies.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub init_qpos: Vec<(String, f64)>,
    /// Drives, such as the spring of a door closer (a stiffness, and a target at 0); `None` for passive joints. Unset
    /// stiffness and damping are those of the actuators of an MJCF file, or else those of [`DriveCfg::default`], which
    /// suit robots: set both for a light mechanism.
    pub drive: Option<DriveCfg>,
    /// Dry friction \[N m or N\]. If unset, that of `drive`, or else that of the file. Setting it gives no joint a
    /// drive.
    pub friction: Option<PerJoint>,
    /// Rotor inertia \[kg m² or kg\]. If unset, that of `drive`, or else 0 for joints of a URDF and the value of an
    /// MJCF file. Setting it gives no joint a drive.
    pub armature: Option<PerJoint>,
    /// Surface properties of links besides their colors, for rendering only, by link pattern. A link may match only one
    /// pattern.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub surfaces: Vec<(String, SurfaceCfg)>,
    /// True if the links collide with each other; false by default, also for an MJCF file. Links connected by a joint,
    /// and links that overlap in the initial pose, do not collide, unless the MJCF file has a `<pair>` of their geoms.
    pub self_collision: bool,
    /// Settings for the convex hulls of collision meshes of URDF files. No effect on an MJCF file: MuJoCo computes its
    /// hulls.
    pub hull: HullCfg,
    /// Semantic class in the table of mask ids; `None` for `articulation`.
    pub semantic_class: Option<String>,
}

impl Default for ArticulationCfg {
    fn default() -> Self {
        let robot = RobotCfg::default();
        Self {
            uid: "articulation".into(),
            urdf: UrdfCfg::default(),
            mjcf: None,
            fix_base: robot.fix_base,
            init_pose: robot.init_pose,
            init_qpos: robot.init_qpos,
            drive: None,
            friction: None,
            armature: None,
            surfaces: Vec::new(),
            self_collision: robot.self_collision,
            hull: robot.hull,
            semantic_class: None,
        }
    }
}

impl ArticulationCfg {
    /// Converts to the equivalent robot configuration and the semantic class.
    pub(crate) fn into_robot_cfg(self) -> (RobotCfg, String) {
        let passive = || DriveCfg { drive_type: DriveType::None, ..Default::default() };
        let drive = self.drive.unwrap_or_else(passive);
        let (friction, armature) = (self.friction.or(drive.friction), self.armature.unwrap_or(drive.armature));
        let robot = RobotCfg {
            uid: self.uid,
            urdf: self.urdf,
            mjcf: self.mjcf,
            fix_base: self.fix_base,
            init_pose: self.init_pose,
            init_qpos: self.init_qpos,
            drive: DriveCfg { friction, armature, ..drive },
            surfaces: self.surfaces,
            self_collision: self.self_collision,
            hull: self.hull,
            ..RobotCfg::default()
        };
        (robot, self.semantic_class.unwrap_or_else(|| "articulation".into()))
    }
}

/// Handle of an articulation; valid for the manager that created it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ArticulationId(pub(crate) RobotId);

/// Read access to an articulation: all read methods of a robot. It has no control parts.
pub type Articulation<'a> = Robot<'a>;

/// Write access to an articulation: all write methods of a robot.
///
/// Joints without a drive have no targets: [`write_qpos`](RobotMut::write_qpos) sets their state,
/// [`set_qf_target`](RobotMut::set_qf_target) applies efforts, and [`set_qpos_target`](RobotMut::set_qpos_target) has
/// no effect.
pub type ArticulationMut<'a> = RobotMut<'a>;

impl SimulationManager {
    /// Adds an articulation, such as a cabinet with drawers or a door, to every environment. The model is compiled in
    /// this call, as in [`add_robot`](Self::add_robot). Sensors and [`properties`](Self::properties) name its links and
    /// joints like those of robots, `uid/link` and `uid/joint`. A simulation holds up to 30 robots and articulations
    /// together.
    ///
    /// # Errors
    /// Same errors as [`add_robot`](Self::add_robot).
    pub fn add_articulation(&mut self, cfg: ArticulationCfg) -> Result<ArticulationId> {
        let (cfg, class) = cfg.into_robot_cfg();
        self.add_with_role(cfg, RobotKind::Articulation(class)).map(ArticulationId)
    }

    /// Read access to an articulation.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn articulation(&self, id: ArticulationId) -> Articulation<'_> {
        self.robot(id.0)
    }

    /// Write access to an articulation.
    ///
    /// # Panics
    /// The handle belongs to another manager.
    #[track_caller]
    pub fn articulation_mut(&mut self, id: ArticulationId) -> ArticulationMut<'_> {
        self.robot_mut(id.0)
    }
}
