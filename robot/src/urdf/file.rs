//! `UrdfFile`: one checked URDF file, with the location of every element and a record of absent values.

use super::tree::Tree;
use crate::description::PartialInertial;
use crate::diagnostic::Diagnostic;
use kinetoscope_scene::source_location::SourceLocation;
use std::path::PathBuf;
use std::sync::Arc;

/// A URDF file that passed every check.
///
/// `robot` holds the values. `links` and `joints` run parallel to `robot.links` and `robot.joints` and hold what the
/// model cannot express: locations, and which values the file gave.
#[derive(Clone, Debug)]
pub struct UrdfFile {
    /// Path as the user gave it; relative mesh paths start at its folder.
    pub path: Arc<PathBuf>,
    /// Typed model of `urdf-rs`. Values that the file does not give have defaults. Shapes of size 0 are left out.
    pub robot: urdf_rs::Robot,
    /// Metadata of each link of `robot`.
    pub links: Vec<LinkMetadata>,
    /// Metadata of each joint of `robot`.
    pub joints: Vec<JointMetadata>,
    /// Tree of links.
    pub tree: Tree,
    /// `meshdir` of `<mujoco><compiler>` as written, the folder in which meshes are searched last; `None` if the file
    /// does not set it.
    pub meshdir: Option<String>,
    /// Warnings about repaired or ignored elements.
    pub diagnostics: Vec<Diagnostic>,
}

/// Metadata of a link that the model cannot express.
#[derive(Clone, Debug)]
pub struct LinkMetadata {
    /// Location of the link element.
    pub source: SourceLocation,
    /// Location of a complete inertial element; otherwise `None`, and the model has mass 0.
    pub inertial: Option<SourceLocation>,
    /// Values of an incomplete inertial element; `inertial` is then `None`.
    pub partial_inertial: Option<PartialInertial>,
    /// Metadata of each visual, in the order of the link's visuals in [`UrdfFile::robot`].
    pub visuals: Vec<VisualMetadata>,
    /// Location of each collision element, in the order of the link's collisions in [`UrdfFile::robot`].
    pub collisions: Vec<SourceLocation>,
}

/// Metadata of a visual that the model cannot express.
#[derive(Clone, Debug)]
pub struct VisualMetadata {
    /// Location of the visual element.
    pub source: SourceLocation,
    /// Location of the material element, if any.
    pub material: Option<SourceLocation>,
}

/// Metadata of a joint that the model cannot express.
#[derive(Clone, Debug)]
pub struct JointMetadata {
    /// Location of the joint element.
    pub source: SourceLocation,
    /// Metadata of the limit element; `None` for a joint without one, whose limits are 0 in the model.
    pub limit: Option<LimitMetadata>,
    /// True if the dynamics element gives damping.
    pub damping: bool,
    /// True if the dynamics element gives friction.
    pub friction: bool,
    /// Location of the mimic element; `None` without a mimic, or if it was ignored because the joint is fixed, floating
    /// or planar.
    pub mimic: Option<SourceLocation>,
}

/// Location of a limit element, and which values it gives.
#[derive(Clone, Debug)]
pub struct LimitMetadata {
    /// Location of the limit element.
    pub source: SourceLocation,
    /// True if `lower` is given and not above `upper` (0 if `upper` is absent).
    pub lower: bool,
    /// True if `upper` is given and not below `lower` (0 if `lower` is absent).
    pub upper: bool,
    /// True if `effort` is given.
    pub effort: bool,
    /// True if `velocity` is given.
    pub velocity: bool,
}
