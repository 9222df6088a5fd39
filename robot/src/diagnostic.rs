//! Warnings: what was repaired, ignored or unusual in a user's input. Collected, never printed behind the user's back.

use kinetoscope_scene::source::Source;
use std::collections::BTreeMap;
use std::fmt;

/// What kind of thing a [`Diagnostic`] reports. The name is stable: reports count by it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum DiagnosticKind {
    /// An inertia tensor that no rigid body can have was repaired in the MJCF (the description keeps what the file says).
    InertiaRepaired,
    /// A movable body without mass and shapes got minimal values, so that MuJoCo accepts it; they stay out of `total_mass`.
    MasslessLink,
    /// Lower limit above upper limit: the limit is ignored.
    LimitIgnored,
    /// Effort 0 or absent: the joint's effort is not limited.
    EffortUnlimited,
    /// A mimic joint's implied range exceeds its own limits: the driver's usable range is the intersection, or where that is
    /// less than 1 % of the driver's range, the limits of the mimic joint are ignored.
    MimicRangeClipped,
    /// A file named by a visual does not exist: the visual is left out.
    VisualMeshMissing,
    /// A visual mesh could not be read: the visual is left out.
    VisualMeshInvalid,
    /// The own sizes and colours of an environment cannot be drawn: it looks as nominally.
    LookInvalid,
    /// A name was used by two components and got a prefix or suffix.
    NameClash,
    /// A material is referenced but defined nowhere.
    MaterialUndefined,
    /// A texture file does not exist or cannot be read; the colour is used.
    TextureMissing,
    /// An element of the file has no meaning for the simulation and was skipped.
    ElementIgnored,
    /// A transmission, mimic or plugin names something that does not exist.
    ReferenceUnknown,
    /// The native actuator drive is outside the range where it is stable.
    ActuatorUnstable,
    /// Two geoms overlap in the initial pose and were excluded from self-collision.
    InitialOverlap,
    /// A clearance above the ground was asked for of a robot without collision shapes.
    ClearanceIgnored,
    /// The initial position was outside the joint's limits and was moved to the nearest one.
    InitialPositionClamped,
    /// A joint that follows others starts where they put it, beyond its own limits.
    FollowerStartsBeyondLimits,
    /// A position was given for a joint that follows another one elsewhere.
    MimicPositionIgnored,
    /// An element that may be there once is there again: the first is used.
    ElementRepeated,
    /// A shape has a size of 0: it is left out.
    ShapeEmpty,
    /// An XML prefix is bound to no namespace: its elements and attributes are ignored.
    NamespaceUnbound,
    /// A xacro element was left in a URDF: it is ignored.
    XacroLeftover,
    /// An XML declaration is not at the beginning of its file: it is ignored.
    DeclarationMisplaced,
    /// An `<inertial>` lacks its mass or its inertia: the rest is computed from the shapes of the link.
    InertialIncomplete,
    /// Mass properties that the file does not give, or that no body of these shapes has, were computed from the shapes.
    InertiaFromShapes,
    /// An inertia behind a joint is that of a rigid body far larger than the shapes of the link: it is kept.
    InertiaImplausible,
    /// A mesh has one number for its scale: it holds for all three axes.
    ScaleUniform,
    /// The address of a mesh or texture is not a valid one, and what is meant is clear.
    AddressRepaired,
    /// A robot has no visual shape: pictures do not show it.
    NothingToDraw,
    /// A unit axis was expected; the axis was normalised.
    AxisNormalized,
    /// A colour was outside 0..1 and was clamped.
    ColorClamped,
    /// A setting of an MJCF file for its whole model is not the scene's: the scene's holds.
    SettingIgnored,
    /// The surface of an object's mesh is open, encloses nothing, or is inside out in a part: it weighs and turns as its convex
    /// hull; or it is open, and collides in pieces or triangles: they do not hold all that is behind it.
    OpenMesh,
    /// The convex pieces of an object's mesh are farther off its surface than they should be, or some of its triangles are too
    /// thin to collide.
    CoarsePieces,
    /// Something of an MJCF part is left out of an export, because the line of MuJoCo it is for does not know it.
    ExportReduced,
    /// Drives of an export have an armature that the robot has not, so that plain MuJoCo is stable with them.
    ExportHeavier,
}

impl DiagnosticKind {
    /// Stable kebab-case name.
    pub fn name(self) -> &'static str {
        match self {
            Self::InertiaRepaired => "inertia-repaired",
            Self::MasslessLink => "massless-link",
            Self::LimitIgnored => "limit-ignored",
            Self::EffortUnlimited => "effort-unlimited",
            Self::MimicRangeClipped => "mimic-range-clipped",
            Self::VisualMeshMissing => "visual-mesh-missing",
            Self::VisualMeshInvalid => "visual-mesh-invalid",
            Self::LookInvalid => "look-invalid",
            Self::NameClash => "name-clash",
            Self::MaterialUndefined => "material-undefined",
            Self::TextureMissing => "texture-missing",
            Self::ElementIgnored => "element-ignored",
            Self::ReferenceUnknown => "reference-unknown",
            Self::ActuatorUnstable => "actuator-unstable",
            Self::InitialOverlap => "initial-overlap",
            Self::ClearanceIgnored => "clearance-ignored",
            Self::InitialPositionClamped => "initial-position-clamped",
            Self::FollowerStartsBeyondLimits => "follower-starts-beyond-limits",
            Self::MimicPositionIgnored => "mimic-position-ignored",
            Self::ElementRepeated => "element-repeated",
            Self::ShapeEmpty => "shape-empty",
            Self::NamespaceUnbound => "namespace-unbound",
            Self::XacroLeftover => "xacro-leftover",
            Self::DeclarationMisplaced => "declaration-misplaced",
            Self::InertialIncomplete => "inertial-incomplete",
            Self::InertiaFromShapes => "inertia-from-shapes",
            Self::InertiaImplausible => "inertia-implausible",
            Self::ScaleUniform => "scale-uniform",
            Self::AddressRepaired => "address-repaired",
            Self::NothingToDraw => "nothing-to-draw",
            Self::AxisNormalized => "axis-normalized",
            Self::ColorClamped => "color-clamped",
            Self::SettingIgnored => "setting-ignored",
            Self::OpenMesh => "open-mesh",
            Self::CoarsePieces => "coarse-pieces",
            Self::ExportReduced => "export-reduced",
            Self::ExportHeavier => "export-heavier",
        }
    }
}

/// One warning: kind, place, and a sentence that says what was found and what was done.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// What kind of thing this is.
    pub kind: DiagnosticKind,
    /// Where it was found, if in a file.
    pub source: Option<Source>,
    /// A full sentence that names the element: `link "LF_HIP": ...`.
    pub message: String,
}

impl Diagnostic {
    /// A warning at `source`.
    pub fn new(kind: DiagnosticKind, source: impl Into<Option<Source>>, message: impl Into<String>) -> Self {
        Self { kind, source: source.into(), message: message.into() }
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(source) = &self.source {
            write!(f, "{source}: ")?;
        }
        write!(f, "{} [{}]", self.message, self.kind.name())
    }
}

/// Number of diagnostics of each kind, by name.
pub fn count_by_name(diagnostics: &[Diagnostic]) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for d in diagnostics {
        *counts.entry(d.kind.name()).or_insert(0) += 1;
    }
    counts
}
