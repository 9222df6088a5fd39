//! Articulations that are no robots: drawers, doors, lids, whatever has joints that are moved from outside.

use crate::drive::{DriveCfg, DriveType, PerJoint};
use crate::error::Result;
use crate::ids::RobotId;
use crate::manager::SimulationManager;
use crate::objects::robot::{Robot, RobotCfg, RobotMut};
use crate::objects::robot_data::Role;
use crate::objects::robot_file::MjcfFile;
use crate::surface_cfg::SurfaceCfg;
use kinetoscope_robot::urdf::UrdfCfg;
use kinetoscope_scene::Pose;
use kinetoscope_scene::mesh::HullCfg;
use serde::{Deserialize, Serialize};

/// Configuration of an articulation.
///
/// It is passive unless `drive` says otherwise: its joints have the limits, the damping and the dry friction of the file,
/// and nothing holds or moves them but what touches them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ArticulationCfg {
    /// Name of the articulation, unique in the simulation; prefix of its names in MuJoCo.
    pub uid: String,
    /// The URDF files.
    #[serde(deserialize_with = "crate::file_format::file_or_table")]
    pub urdf: UrdfCfg,
    /// The MJCF file, for an articulation that is described by one, as [`RobotCfg::mjcf`] says: then there are no URDF files.
    /// Its actuators drive nothing where [`drive`](Self::drive) is `None`; its springs, friction and equalities hold.
    #[serde(default, deserialize_with = "crate::file_format::mjcf_file")]
    pub mjcf: Option<MjcfFile>,
    /// Whether the root link stands fixed in the environment. One that stands free can be put elsewhere in each environment.
    pub fix_base: bool,
    /// Pose of the root link in the environment; of an MJCF file that of the file's world.
    #[serde(with = "kinetoscope_scene::file_format::pose")]
    pub init_pose: Pose,
    /// Start positions by joint pattern \[rad or m\]; where none matches 0, or an MJCF file's `ref`.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub init_qpos: Vec<(String, f64)>,
    /// Drives, such as the spring of a door that closes by itself (a stiffness, and a target at 0); `None` is passive. One
    /// that is given has the stiffness and damping of [`DriveCfg::default`], a robot's, where it names no others.
    pub drive: Option<DriveCfg>,
    /// Dry friction \[N m or N\]; where unset, that of `drive`, or else the file's. It leaves joints passive.
    pub friction: Option<PerJoint>,
    /// Rotor inertia \[kg m² or kg\]; where unset, that of `drive`, or else 0 for joints of a URDF and the
    /// MJCF file's own. It leaves joints passive.
    pub armature: Option<PerJoint>,
    /// What surfaces of links look like besides their colours, by link pattern. No link may be matched twice.
    #[serde(with = "kinetoscope_scene::file_format::pairs")]
    pub surfaces: Vec<(String, SurfaceCfg)>,
    /// Whether its links collide with each other.
    pub self_collision: bool,
    /// How collision meshes become convex hulls.
    pub hull: HullCfg,
    /// Semantic class, for the table of mask ids; `articulation` where `None`.
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
    /// The robot that moves like it, and its class.
    pub(crate) fn into_robot(self) -> (RobotCfg, String) {
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

/// Handle of an articulation; valid for the manager that made it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct ArticulationId(pub(crate) RobotId);

/// An articulation, to read: everything that can be read of a robot. It has no control parts.
pub type Articulation<'a> = Robot<'a>;

/// An articulation, to write: everything that can be done with a robot. Joints without a drive have no targets:
/// [`write_qpos`](RobotMut::write_qpos) puts them somewhere, [`set_qf_target`](RobotMut::set_qf_target) pushes them, and
/// [`set_qpos_target`](RobotMut::set_qpos_target) does nothing.
pub type ArticulationMut<'a> = RobotMut<'a>;

impl SimulationManager {
    /// Adds an articulation that is no robot to every environment, such as a cabinet with drawers or a door, compiled as
    /// [`add_robot`](Self::add_robot) does. Sensors and [`properties`](Self::properties) know its links and joints as those
    /// of robots, as `uid/link` and `uid/joint`. There may be 30 robots and articulations.
    ///
    /// # Errors
    /// As [`add_robot`](Self::add_robot).
    pub fn add_articulation(&mut self, cfg: ArticulationCfg) -> Result<ArticulationId> {
        let (cfg, class) = cfg.into_robot();
        self.add_as(cfg, Role::Articulation(class)).map(ArticulationId)
    }

    /// An articulation, to read.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn articulation(&self, id: ArticulationId) -> Articulation<'_> {
        self.robot(id.0)
    }

    /// An articulation, to write.
    ///
    /// # Panics
    /// The handle is of another manager.
    #[track_caller]
    pub fn articulation_mut(&mut self, id: ArticulationId) -> ArticulationMut<'_> {
        self.robot_mut(id.0)
    }
}
