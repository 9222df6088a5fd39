//! Entities of a simulation in insertion order.

use crate::error::{Error, Result};
use crate::mjcf::robot::RobotLayout;
use crate::mjcf::robot_file::MjcfRobotFile;
use crate::objects::mjcf_part_data::MjcfData;
use crate::objects::object_group_data::RigidObjectGroupData;
use crate::objects::rigid_object_data::RigidObjectData;
use crate::objects::robot_data::RobotData;
use crate::objects::terrain::Terrain;
use crate::objects::weld_data::WeldData;
use crate::pattern;
use crate::visible::surface_overrides::SurfaceOverrides;
use kinetoscope_mujoco::Asset;
use kinetoscope_robot::description::JointKind;
use kinetoscope_sensors::EngineSensor;
use std::sync::Arc;

/// All entities of the scene, with their welds and collision exclusions.
#[derive(Clone, Debug, Default)]
pub(crate) struct EntitySet {
    pub(crate) robots: Vec<Arc<RobotData>>,
    pub(crate) objects: Vec<Arc<RigidObjectData>>,
    pub(crate) terrains: Vec<Arc<Terrain>>,
    pub(crate) mjcf_models: Vec<Arc<MjcfData>>,
    pub(crate) groups: Vec<RigidObjectGroupData>,
    pub(crate) welds: Vec<WeldData>,
    /// Pairs of names between which collisions are disabled, as given to
    /// [`SimulationManager::exclude_collision`](crate::SimulationManager::exclude_collision).
    pub(crate) collision_exclusions: Vec<[String; 2]>,
}

/// Checks that a uid can be part of MJCF names, file and folder names, and frame names of recordings. It must have 1 to
/// 64 characters without slashes and control characters, and not be `.` or `..`.
pub(crate) fn check_uid_syntax(uid: &str) -> Result<()> {
    let forbidden = |c: char| c == '/' || c == '\\' || c.is_control();
    let usable = (1..=64).contains(&uid.chars().count()) && !uid.chars().any(forbidden) && uid != "." && uid != "..";
    if usable { Ok(()) } else { Err(Error::InvalidUid(uid.into())) }
}

/// Mask id of the ground; links, objects and terrains have higher ids.
pub(crate) const GROUND_MASK_ID: i32 = 1;

impl EntitySet {
    /// Configured surfaces by instance name, which override the surfaces of the model.
    pub(crate) fn surfaces(&self) -> SurfaceOverrides {
        let links = self.robots.iter().flat_map(|robot| {
            let name = |link: usize| format!("{}/{}", robot.uid(), robot.description().links[link].name);
            robot.surfaces().iter().map(move |(link, surface)| (name(*link), *surface))
        });
        let bodies = self.mjcf_models.iter().flat_map(|part| {
            let name = |body: usize| match body {
                0 => part.uid().to_string(),
                _ => format!("{}/{}", part.uid(), part.names().bodies[body]),
            };
            part.surfaces().iter().map(move |(body, surface)| (name(*body), *surface))
        });
        let objects = self.objects.iter().map(|object| (object.uid().to_string(), object.cfg().surface));
        let terrains = self.terrains.iter().map(|terrain| (terrain.uid().to_string(), terrain.cfg().surface));
        links.chain(bodies).chain(objects).chain(terrains).collect()
    }

    /// Checks the syntax of `uid`, and that no entity, object group or weld has this name. Sensors have their own
    /// namespace.
    pub(crate) fn check_uid_free(&self, uid: &str) -> Result<()> {
        let objects = self.objects.iter().map(|o| o.uid()).chain(self.terrains.iter().map(|t| t.uid()));
        let objects = objects.chain(self.mjcf_models.iter().map(|p| p.uid()));
        let objects = objects.chain(self.welds.iter().map(|w| w.cfg.uid.as_str()));
        let objects = objects.chain(self.groups.iter().map(|g| g.uid.as_str()));
        let mut taken = self.robots.iter().map(|r| r.uid()).chain(objects);
        if taken.any(|other| other == uid) {
            return Err(Error::DuplicateUid(uid.into()));
        }
        check_uid_syntax(uid)
    }

    /// The lowest unused mask id. Ids never change when entities are added.
    pub(crate) fn next_mask_id(&self) -> i32 {
        let links: usize = self.robots.iter().map(|r| r.description().links.len() + r.tendons().len()).sum();
        let bodies: usize = self.mjcf_models.iter().map(|p| p.model().nbody() + p.model().ntendon()).sum();
        GROUND_MASK_ID + 1 + (links + self.objects.len() + self.terrains.len() + bodies) as i32
    }

    /// Names of the bodies in the order of the body axis: links of all robots (`uid/link`), objects (`uid`), then
    /// bodies and named sites of attached MJCF files (`uid/body`, `uid/site`).
    pub(crate) fn body_names(&self) -> Arc<[String]> {
        let links = self.robots.iter().flat_map(|r| {
            let links = r.description().named_links().iter();
            links.map(|l| format!("{}/{}", r.uid(), l.name))
        });
        let frames = self.mjcf_models.iter().flat_map(|p| p.frames().iter().map(|frame| frame.name.clone()));
        links.chain(self.objects.iter().map(|o| o.uid().to_string())).chain(frames).collect()
    }

    /// Names of the MuJoCo bodies in the order of [`body_names`](Self::body_names). Links connected by fixed joints
    /// share one MuJoCo body.
    pub(crate) fn mujoco_bodies(&self, layouts: &[RobotLayout]) -> Vec<String> {
        let links = layouts.iter().flat_map(|layout| layout.links.iter().map(|frame| frame.body.clone()));
        let frames = self.mjcf_models.iter().flat_map(|part| {
            part.frames().iter().map(|frame| match frame.body {
                0 => part.uid().to_string(),
                body => part.scoped_name(&part.names().bodies[body]),
            })
        });
        links.chain(self.objects.iter().map(|o| o.uid().to_string())).chain(frames).collect()
    }

    /// Indices in [`body_names`](Self::body_names) of a body or site, or of all links of a robot or articulation;
    /// `None` for `world`.
    ///
    /// # Errors
    /// The name is unknown.
    pub(crate) fn find_bodies(&self, name: &str) -> Result<Option<Vec<usize>>> {
        let names = self.body_names();
        if name == "world" {
            return Ok(None);
        }
        let links = format!("{name}/");
        let is_robot = self.robots.iter().any(|robot| robot.uid() == name);
        let means = |known: &String| known == name || is_robot && known.starts_with(&links);
        let found: Vec<usize> = (0..names.len()).filter(|&k| means(&names[k])).collect();
        if found.is_empty() {
            let known = names.iter().map(String::as_str).chain(["world"]).chain(self.robots.iter().map(|r| r.uid()));
            let candidates = pattern::closest_names(name, known).into_iter().map(String::from).collect();
            return Err(Error::UnknownName { what: "body", name: name.into(), candidates });
        }
        Ok(Some(found))
    }

    /// For every body in the order of [`body_names`](Self::body_names), the index of the body that moves it. For a
    /// robot, this is the nearest link, the link itself or one above it, that no fixed joint attaches to its parent. An
    /// object is its own. For an attached MJCF file, it is the body that MuJoCo welds the frame to. A frame that never
    /// moves has its own body, or itself for a site of the file's world.
    pub(crate) fn moving_bodies(&self) -> Arc<[usize]> {
        let mut carriers = Vec::new();
        for robot in &self.robots {
            let (description, first) = (robot.description(), carriers.len());
            carriers.extend((0..description.named_links().len()).map(|mut link| {
                // A frame between joints starts a new body.
                while let Some(joint) = description.links[link].parent_joint.map(|id| description.joint(id))
                    && joint.kind == JointKind::Fixed
                    && !description.link(joint.parent).is_auxiliary_frame
                {
                    link = joint.parent.0;
                }
                first + link
            }));
        }
        let first = carriers.len();
        carriers.extend(first..first + self.objects.len());
        for part in &self.mjcf_models {
            let first = carriers.len();
            carriers.extend(part.frames().iter().map(|frame| first + frame.moving_frame));
        }
        carriers.into()
    }

    /// MuJoCo sensors of all robots from MJCF files, then of all attached MJCF files, with their offsets in
    /// `sensordata`.
    pub(crate) fn engine_sensors(&self) -> Arc<[EngineSensor]> {
        let mut first = 0;
        let mut sensors = Vec::new();
        let of_robots = self.robots.iter().filter_map(|robot| robot.file()).map(MjcfRobotFile::sensors);
        for of_file in of_robots.chain(self.mjcf_models.iter().map(|part| part.sensors())) {
            sensors.extend(of_file.iter().map(|s| EngineSensor { first: first + s.first, ..s.clone() }));
            first += of_file.iter().map(|s| s.width).sum::<usize>();
        }
        sensors.into()
    }

    /// Asset files of the document, from MJCF robots and attached MJCF files.
    pub(crate) fn files(&self) -> impl Iterator<Item = &Asset> {
        let of_robots = self.robots.iter().filter_map(|robot| robot.file()).flat_map(MjcfRobotFile::files);
        of_robots.chain(self.mjcf_models.iter().flat_map(|part| part.files()))
    }

    /// Names (`uid/joint`) of the movable joints of all robots, then of the joints of attached MJCF files with one
    /// degree of freedom.
    pub(crate) fn joint_names(&self) -> Arc<[String]> {
        let of_robots = self.robots.iter().flat_map(|r| r.joint_names().iter().map(|j| format!("{}/{j}", r.uid())));
        of_robots.chain(self.mjcf_models.iter().flat_map(|p| p.single_dof_joints().map(|j| p.scoped_name(j)))).collect()
    }

    /// Names of the drives of all robots (`uid/joint`), then of the actuators of attached MJCF files (`uid/actuator`).
    pub(crate) fn actuator_names(&self) -> Arc<[String]> {
        let of_robots = self.robots.iter().flat_map(|r| {
            let driven = r.joint_names().iter().zip(r.plans()).filter(|(_, plan)| plan.actuator.is_some());
            driven.map(|(joint, _)| format!("{}/{joint}", r.uid()))
        });
        of_robots
            .chain(self.mjcf_models.iter().flat_map(|p| p.names().actuators.iter().map(|a| p.scoped_name(a))))
            .collect()
    }
}
