//! `UrdfFile`: one URDF file, checked, with the place of everything and what was absent.

use super::tree::Tree;
use crate::description::PartialInertial;
use crate::diagnostic::Diagnostic;
use kinetoscope_scene::source::Source;
use std::path::PathBuf;
use std::sync::Arc;

/// A URDF file that passed every check.
///
/// `robot` holds the values, `links` and `joints` run parallel to `robot.links` and `robot.joints` and hold what the
/// model cannot tell: places, and which values the file gave.
#[derive(Clone, Debug)]
pub struct UrdfFile {
    /// The file as the user named it.
    pub path: Arc<PathBuf>,
    /// The typed model. Values that the file does not give are filled in.
    pub robot: urdf_rs::Robot,
    /// One per link of `robot`.
    pub links: Vec<LinkNotes>,
    /// One per joint of `robot`.
    pub joints: Vec<JointNotes>,
    /// The tree of links.
    pub tree: Tree,
    /// `meshdir` of `<mujoco><compiler>`, where MuJoCo users keep meshes.
    pub meshdir: Option<String>,
    /// What was repaired or ignored.
    pub diagnostics: Vec<Diagnostic>,
}

/// What the model cannot tell about a link.
#[derive(Clone, Debug)]
pub struct LinkNotes {
    /// The link element.
    pub source: Source,
    /// The inertial element; `None` where the file has none (the model then says mass 0).
    pub inertial: Option<Source>,
    /// The values of an incomplete inertial element; `inertial` is `None` then.
    pub partial_inertial: Option<PartialInertial>,
    /// One per visual.
    pub visuals: Vec<VisualNotes>,
    /// One per collision.
    pub collisions: Vec<Source>,
}

/// What the model cannot tell about a visual.
#[derive(Clone, Debug)]
pub struct VisualNotes {
    /// The visual element.
    pub source: Source,
    /// The material element, if any.
    pub material: Option<Source>,
}

/// What the model cannot tell about a joint.
#[derive(Clone, Debug)]
pub struct JointNotes {
    /// The joint element.
    pub source: Source,
    /// What the limit element gives; `None` where the file has no such element (the model then says 0).
    pub limit: Option<LimitNotes>,
    /// The dynamics element gives damping.
    pub damping: bool,
    /// The dynamics element gives friction.
    pub friction: bool,
    /// The mimic element; `None` where there is none or where it has no meaning (a fixed joint).
    pub mimic: Option<Source>,
}

/// Which values a limit element gives.
#[derive(Clone, Debug)]
pub struct LimitNotes {
    /// The limit element.
    pub source: Source,
    /// `lower` is given and usable.
    pub lower: bool,
    /// `upper` is given and usable.
    pub upper: bool,
    /// `effort` is given.
    pub effort: bool,
    /// `velocity` is given.
    pub velocity: bool,
}
