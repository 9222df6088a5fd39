//! What was added to a simulation, in the order in which it was added.

use crate::description::JointKind;
use crate::error::{Error, Result};
use crate::objects::mjcf_part::MjcfData;
use crate::objects::rigid_object::RigidObjectData;
use crate::objects::robot::RobotData;
use crate::objects::terrain::Terrain;
use sensors::EngineSensor;
use std::sync::Arc;

/// Robots (and articulations that are none), objects, terrains and MJCF files.
#[derive(Clone, Debug, Default)]
pub(crate) struct Contents {
    pub(crate) robots: Vec<Arc<RobotData>>,
    pub(crate) objects: Vec<Arc<RigidObjectData>>,
    pub(crate) terrains: Vec<Arc<Terrain>>,
    pub(crate) parts: Vec<Arc<MjcfData>>,
}

/// Mask id of the ground; links, objects and terrains come after it.
pub(crate) const GROUND_MASK_ID: i32 = 1;

impl Contents {
    /// Checks that nothing is called `uid` yet.
    pub(crate) fn check_uid(&self, uid: &str) -> Result<()> {
        let objects = self.objects.iter().map(|o| o.uid()).chain(self.terrains.iter().map(|t| t.uid()));
        let objects = objects.chain(self.parts.iter().map(|p| p.uid()));
        let mut taken = self.robots.iter().map(|r| r.uid()).chain(objects);
        if taken.any(|other| other == uid) {
            return Err(Error::DuplicateUid(uid.into()));
        }
        let usable = (1..=64).contains(&uid.chars().count()) && !uid.chars().any(|c| c == '/' || c.is_control());
        if usable { Ok(()) } else { Err(Error::InvalidUid(uid.into())) }
    }

    /// The first mask id that is not used: ids stay what they are when more is added.
    pub(crate) fn next_mask_id(&self) -> i32 {
        let links: usize = self.robots.iter().map(|r| r.description().links.len()).sum();
        let bodies: usize = self.parts.iter().map(|p| p.model().nbody()).sum();
        GROUND_MASK_ID + 1 + (links + self.objects.len() + self.terrains.len() + bodies) as i32
    }

    /// Names of the bodies in the order in which sensors see them: links of all robots (`uid/link`), then objects,
    /// then bodies and sites of parts (`uid/body`).
    pub(crate) fn body_names(&self) -> Arc<[String]> {
        let links = self.robots.iter().flat_map(|r| {
            let links = r.description().links.iter();
            links.map(|l| format!("{}/{}", r.uid(), l.name))
        });
        let frames = self.parts.iter().flat_map(|p| p.frames().iter().map(|frame| frame.name.clone()));
        links.chain(self.objects.iter().map(|o| o.uid().to_string())).chain(frames).collect()
    }

    /// For every body in the order of [`body_names`](Self::body_names), the one that moves it: the first link above it that
    /// no fixed joint holds.
    pub(crate) fn carriers(&self) -> Arc<[usize]> {
        let mut carriers = Vec::new();
        for robot in &self.robots {
            let (description, first) = (robot.description(), carriers.len());
            carriers.extend((0..description.links.len()).map(|mut link| {
                while let Some(joint) = description.links[link].parent_joint.map(|id| description.joint(id))
                    && joint.kind == JointKind::Fixed
                {
                    link = joint.parent.0;
                }
                first + link
            }));
        }
        let first = carriers.len();
        carriers.extend(first..first + self.objects.len());
        for part in &self.parts {
            let first = carriers.len();
            carriers.extend(part.frames().iter().map(|frame| first + frame.carrier));
        }
        carriers.into()
    }

    /// MuJoCo's own sensors of all parts, where their values are among all values.
    pub(crate) fn engine_sensors(&self) -> Arc<[EngineSensor]> {
        let mut first = 0;
        let mut sensors = Vec::new();
        for part in &self.parts {
            sensors.extend(part.sensors().iter().map(|s| EngineSensor { first: first + s.first, ..s.clone() }));
            first += part.sensors().iter().map(|s| s.width).sum::<usize>();
        }
        sensors.into()
    }

    /// Names of the movable joints of all robots, `uid/joint`.
    pub(crate) fn joint_names(&self) -> Arc<[String]> {
        self.robots.iter().flat_map(|r| r.joint_names().iter().map(|j| format!("{}/{j}", r.uid()))).collect()
    }
}
