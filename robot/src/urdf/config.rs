//! Configuration of a robot that is merged from URDF files.

use kinetoscope_scene::Pose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Robot made of one or several URDF files.
///
/// ```
/// use kinetoscope_robot::urdf::{ComponentCfg, UrdfCfg};
///
/// let cfg = UrdfCfg {
///     components: vec![ComponentCfg::new("arm", "arm.urdf"), ComponentCfg::new("hand", "hand.urdf")],
///     ..Default::default()
/// };
/// assert_eq!(cfg.components[1].name, "hand"); // attached to the tip of "arm" by default
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UrdfCfg {
    /// Components of the robot, one URDF file each, in any order of parents and children. A component with a name
    /// outside the list at [`ComponentCfg::name`] needs a `parent`, unless it is the first.
    pub components: Vec<ComponentCfg>,
    /// Letter case of the link and joint names of the merged robot, set separately; unchanged by default.
    pub name_case: NameCaseCfg,
    /// Folders of `package://` and `model://` packages by name. A package that is listed here is searched in its folder
    /// only, and in `meshdir` of the file. Relative paths start as that of [`asset_root`](Self::asset_root).
    pub packages: BTreeMap<String, PathBuf>,
    /// Folder to search for packages, meshes and textures that are not found from the URDF, like Isaac Gym's
    /// `asset_root`. A relative path starts at the working directory or, in a scene file, at the folder of that file.
    /// `None`, the default, adds no folder.
    pub asset_root: Option<PathBuf>,
    /// Handling of deviations from URDF whose meaning is clear.
    pub strictness: Strictness,
    /// Mass properties of moving bodies without any `<inertial>`, and density for an `<inertial>` without mass and
    /// density. With [`MissingInertia::Minimal`], such an `<inertial>` is ignored.
    pub missing_inertia: MissingInertia,
    /// Name of the robot in its description; by default the robot names of the files, joined by `_`.
    pub name: Option<String>,
    /// Name of the massless root link that is added if several components have no parent, or if the first component
    /// without a parent has a [`transform`](ComponentCfg::transform).
    pub base_link_name: String,
}

impl Default for UrdfCfg {
    fn default() -> Self {
        Self {
            components: Vec::new(),
            name_case: NameCaseCfg::default(),
            packages: BTreeMap::new(),
            asset_root: None,
            strictness: Strictness::default(),
            missing_inertia: MissingInertia::default(),
            name: None,
            base_link_name: "base_link".to_owned(),
        }
    }
}

impl UrdfCfg {
    /// Creates the configuration of a robot from one file, as the component `robot`.
    pub fn single(urdf: impl AsRef<Path>) -> Self {
        Self { components: vec![ComponentCfg::new("robot", urdf)], ..Self::default() }
    }

    /// Creates the configuration of a serial robot: each file is attached to the tip of the previous file, the leaf
    /// link with the most joints above it.
    ///
    /// A single file is named `robot`, two files `arm` and `hand`, more files `part1`, `part2` and so on.
    ///
    /// ```
    /// use kinetoscope_robot::urdf::UrdfCfg;
    ///
    /// let cfg = UrdfCfg::chain(["arm.urdf", "hand.urdf"]);
    /// assert_eq!(cfg.components[1].parent.as_deref(), Some("arm"));
    /// ```
    pub fn chain<P: AsRef<Path>>(urdfs: impl IntoIterator<Item = P>) -> Self {
        let urdfs: Vec<P> = urdfs.into_iter().collect();
        let mut components: Vec<ComponentCfg> = Vec::with_capacity(urdfs.len());
        for (i, urdf) in urdfs.iter().enumerate() {
            let name = match (urdfs.len(), i) {
                (1, _) => "robot".to_owned(),
                (2, 0) => "arm".to_owned(),
                (2, _) => "hand".to_owned(),
                _ => format!("part{}", i + 1),
            };
            let parent = components.last().map(|before| before.name.clone());
            components.push(ComponentCfg { parent, ..ComponentCfg::new(name, urdf) });
        }
        Self { components, ..Self::default() }
    }
}

/// Handling of deviations from URDF whose meaning is clear, such as a second `<material>` in one `<visual>`.
///
/// | deviation | lenient reading |
/// |---|---|
/// | a second `<material>`, `<inertial>`, `<axis>` or `<limit>`, a second element in `<geometry>` | the first is used |
/// | a box, sphere, cylinder or capsule with a size of 0, a `<visual>` without `<geometry>` | it is left out |
/// | an XML prefix without `xmlns:` | its elements and attributes are ignored |
/// | xacro elements below the top level | they are ignored |
/// | an XML declaration that is not at the beginning | it is ignored |
/// | an `<inertial>` without `<mass>` or without `<inertia>` | the rest is computed from the shapes of the link |
/// | an `<inertia>` without `ixy`, `ixz` or `iyz` | they are 0 |
/// | commas between numbers (not decimal commas) | they are ignored |
/// | NUL characters at the end of the file | they are ignored |
/// | `<axis/>` without `xyz` on a fixed or floating joint | it is ignored |
/// | one number in the `scale` of a mesh | it applies to all three axes |
/// | `package:///path` | an absolute path, else a package with one slash too many |
/// | `package://file` | a file in the folder of the URDF or in the asset root |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Strictness {
    /// Each deviation is a warning that describes how the element was read.
    #[default]
    Lenient,
    /// Each deviation is an error.
    Strict,
}

/// Mass properties of moving bodies whose links all lack an `<inertial>`. The density also gives the mass of an
/// `<inertial>` that lacks mass and density.
///
/// A body is a link with all links that fixed joints join to it. A link without `<inertial>` that is fixed to a link
/// with mass gets no mass of its own: the mass of the other link includes it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MissingInertia {
    /// Each link of the body has the mass properties of its collision shapes, filled with this density \[kg/m³\]. A
    /// link without collision shapes uses its visual shapes. Meshes count as their convex hulls; overlapping shapes
    /// count twice. Bodies without shapes are treated as with [`Minimal`](Self::Minimal).
    Density(f64),
    /// In the MJCF, the body has 1e-6 kg and moments of inertia of 1e-9 kg m², which are not part of the total mass. An
    /// `<inertial>` without mass and density is ignored.
    Minimal,
}

impl Default for MissingInertia {
    fn default() -> Self {
        Self::Density(1000.0)
    }
}

/// Letter case of the names of a merged robot, prefixes and added names included.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NameCaseCfg {
    /// Case of joint names.
    pub joint: NameCase,
    /// Case of link names.
    pub link: NameCase,
}

/// Letter case that names are converted to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum NameCase {
    /// As in the file.
    #[default]
    Original,
    /// Upper case.
    Upper,
    /// Lower case.
    Lower,
}

impl NameCase {
    /// Converts a name to this case.
    pub fn apply(self, name: &str) -> String {
        match self {
            Self::Original => name.to_owned(),
            Self::Upper => name.to_uppercase(),
            Self::Lower => name.to_lowercase(),
        }
    }
}

/// One URDF file of a robot and its attachment.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentCfg {
    /// Name of the component, unique in the robot. `chassis`, `legs`, `torso`, `head`, `left_arm`, `right_arm`,
    /// `left_hand`, `right_hand`, `arm` and `hand` have a default [`parent`](Self::parent), or are roots. Any other
    /// name is allowed; unless it is the first component, it needs a `parent`.
    pub name: String,
    /// Path of the URDF file. A relative path starts at the working directory or, in a scene file, at the folder of
    /// that file.
    pub urdf: PathBuf,
    /// Pose of the component's root link in the frame of the parent link or, without a parent, of the added base link.
    #[serde(default, with = "kinetoscope_scene::file_format::pose")]
    pub transform: Pose,
    /// Parent component. The default is the first one present of: `chassis` for `legs`; `legs`, `chassis` for `torso`
    /// (only with a `chassis`); `torso`, `chassis` for `head` and arms; the arm of the same side for hands. Without any
    /// of these, the component is a root. A component with any other name must be the first or have a `parent`.
    pub parent: Option<String>,
    /// Link of the parent component to attach to, as named in its file or after merging. The default is the root of a
    /// `chassis`, else the leaf with the most joints above it; several such leaves are an error.
    pub parent_link: Option<String>,
    /// Link of this component to attach, as named in its file. It must be the root, which is the default.
    pub child_link: Option<String>,
    /// Prefix of the names of this component; names that already start with it, in any case, stay unchanged. The
    /// default is `left_` or `right_` for a component whose name starts with it in a robot of several components, else
    /// no prefix.
    pub prefix: Option<String>,
}

impl ComponentCfg {
    /// Creates a component with defaults: usual parent and links, identity transform, default prefix.
    pub fn new(name: impl Into<String>, urdf: impl AsRef<Path>) -> Self {
        Self {
            name: name.into(),
            urdf: urdf.as_ref().to_path_buf(),
            transform: Pose::identity(),
            parent: None,
            parent_link: None,
            child_link: None,
            prefix: None,
        }
    }
}
