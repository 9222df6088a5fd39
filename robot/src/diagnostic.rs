//! Warnings about the user's input: repairs, ignored elements and unusual values. They are collected, never printed.

use kinetoscope_scene::source_location::SourceLocation;
use std::collections::BTreeMap;
use std::fmt;

/// Kind of a [`Diagnostic`]. Its name is stable: reports count diagnostics by name.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[non_exhaustive]
pub enum DiagnosticKind {
    /// The mass properties of a link are physically impossible. In the MJCF, its body has repaired values, or valid
    /// ones after merging with links attached by fixed joints. The description keeps the values of the file.
    InertiaRepaired,
    /// A moving body without mass, which also got no mass from shapes, has minimal mass properties in the MJCF, because
    /// MuJoCo requires a mass. They are not part of `total_mass`.
    MasslessLink,
    /// The lower position limit exceeds the upper one, where an absent one counts as 0: both are ignored.
    LimitIgnored,
    /// The effort limit of a URDF joint is 0 or absent: the joint's effort is not limited.
    EffortUnlimited,
    /// Within the limits of its driver, a mimic joint can exceed its own limits. The target range of the driver is
    /// narrowed so that it cannot. If less than 1 % of the driver's range would remain, the limits of the mimic joint
    /// are ignored instead.
    MimicRangeClipped,
    /// A file named by a visual does not exist: the visual is left out.
    VisualMeshMissing,
    /// A visual mesh could not be read: the visual is left out.
    VisualMeshInvalid,
    /// The sizes and colors of an environment cannot be rendered: it is rendered with the nominal ones.
    LookInvalid,
    /// A name was already in use, in another component or by a body of the same MJCF file, and got a prefix or suffix.
    NameClash,
    /// A material is referenced but defined nowhere.
    MaterialUndefined,
    /// A texture file does not exist or cannot be read; the color is used.
    TextureMissing,
    /// An element of a file is skipped, or a drive replaces it, or only a part of it is reproduced.
    ElementIgnored,
    /// A `<transmission>` names a joint that does not exist: it is ignored.
    ReferenceUnknown,
    /// Explicit drives (`DriveModel::Actuator` or actuator models) are unstable at the time step.
    ActuatorUnstable,
    /// Two bodies of one robot overlap in the initial pose: collisions between them are disabled.
    InitialOverlap,
    /// A ground clearance was requested for a robot without collision shapes: it is ignored.
    ClearanceIgnored,
    /// The initial position was outside the limits of the joint and was moved to the nearest limit.
    InitialPositionClamped,
    /// A mimic or coupled joint starts beyond its own limits: the start position of the joint that it follows implies
    /// this.
    FollowerStartsBeyondLimits,
    /// The position given for a mimic or coupled joint differs from the one that the followed joint implies: it is
    /// ignored.
    MimicPositionIgnored,
    /// An element that may occur once occurs again: the first one is used.
    ElementRepeated,
    /// A shape has a size of 0, or a `<visual>` has no shape: it is left out.
    ShapeEmpty,
    /// An XML prefix has no namespace: its elements and attributes are ignored.
    NamespaceUnbound,
    /// A xacro element below the top level was left in a URDF: it is ignored.
    XacroLeftover,
    /// An XML declaration is not at the beginning of its file: it is ignored.
    DeclarationMisplaced,
    /// Numbers are separated by commas: the commas are ignored.
    CommasIgnored,
    /// An `<inertial>` lacks its mass or its inertia: the rest is computed from the shapes of the link.
    InertialIncomplete,
    /// Mass properties that were missing, or impossible for the shapes, were computed from the shapes. An incomplete
    /// `<inertial>` without shapes got the inertia of a sphere; one for which no mass could be computed was ignored.
    InertiaFromShapes,
    /// The inertia of a jointed link is that of a rigid body far larger than its shapes: it is kept.
    InertiaImplausible,
    /// A mesh scale is a single number: it applies to all three axes.
    ScaleUniform,
    /// The URI of a mesh or texture has no package name (`package:///path`) but was resolved. Only the first one of a
    /// file is reported.
    AddressRepaired,
    /// A robot from URDF files has no visual shape: images do not show it.
    NothingToDraw,
    /// The length of a joint axis differed from 1 by more than 0.001: the axis was normalized.
    AxisNormalized,
    /// A color was outside 0..1 and was clamped.
    ColorClamped,
    /// A global setting of an MJCF file differs from the scene's setting: the scene's setting applies. Also reported
    /// for friction solver parameters of joints, which implicit drives do not use.
    SettingIgnored,
    /// The mesh of an object is open, encloses no volume, or is partly inside out: its mass properties are those of its
    /// convex hull. Also reported for an open mesh that collides as convex pieces or triangles, which do not enclose
    /// the space behind it.
    OpenMesh,
    /// The convex pieces of an object's mesh deviate too far from its surface, or some of its triangles are too thin to
    /// collide.
    CoarsePieces,
    /// An export leaves out an element of an MJCF part that the target MuJoCo version does not support.
    ExportReduced,
    /// An export gives drives an armature that the robot does not have, so that they are stable in plain MuJoCo.
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
            Self::CommasIgnored => "commas-ignored",
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

/// Warning with its kind, its location, and a sentence on the finding and the remedy.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    /// Kind of the warning.
    pub kind: DiagnosticKind,
    /// Location in the file; `None` if the warning has no single location, or if its input is not a file.
    pub source: Option<SourceLocation>,
    /// Full sentence that names the element: `link "LF_HIP": ...`.
    pub message: String,
}

impl Diagnostic {
    /// Creates a warning; `source` is its location, or `None`.
    pub fn new(kind: DiagnosticKind, source: impl Into<Option<SourceLocation>>, message: impl Into<String>) -> Self {
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

/// Number of diagnostics of each kind that occurs, by [name](DiagnosticKind::name).
pub fn count_by_name(diagnostics: &[Diagnostic]) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for d in diagnostics {
        *counts.entry(d.kind.name()).or_insert(0) += 1;
    }
    counts
}
