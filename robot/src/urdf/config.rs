//! Which URDF files make a robot, and how they are joined.

use kinetoscope_scene::Pose;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A robot made of one or several URDF files.
///
/// ```
/// use kinetoscope_robot::urdf::{ComponentCfg, UrdfCfg};
///
/// let cfg = UrdfCfg {
///     components: vec![ComponentCfg::new("arm", "arm.urdf"), ComponentCfg::new("hand", "hand.urdf")],
///     ..Default::default()
/// };
/// assert_eq!(cfg.components[1].name, "hand"); // hangs from the tip of "arm" by default
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct UrdfCfg {
    /// The files, in any order.
    pub components: Vec<ComponentCfg>,
    /// Case of the names of the merged robot.
    pub name_case: NameCaseCfg,
    /// Folders of `package://` and `model://` packages by name; these win over every search.
    pub packages: BTreeMap<String, PathBuf>,
    /// Folder in which mesh and texture paths and packages are searched that are not found from the URDF, as Isaac Gym's
    /// `asset_root`.
    pub asset_root: Option<PathBuf>,
    /// Handling of departures from URDF whose meaning is clear.
    pub strictness: Strictness,
    /// Mass properties of links whose file gives none.
    pub missing_inertia: MissingInertia,
    /// Name of the robot; by default the names of the files' robots, joined by `_`.
    pub name: Option<String>,
    /// Name of the massless link added below components where one is needed.
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
    /// A robot of one file, as it is.
    pub fn single(urdf: impl AsRef<Path>) -> Self {
        Self { components: vec![ComponentCfg::new("robot", urdf)], ..Self::default() }
    }

    /// A robot of files of which each hangs from the tip of the one before. A single one is called `robot`, two are `arm`
    /// and `hand`, more are `part1`, `part2` and so on.
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

/// Handling of departures from URDF whose meaning is clear, such as a second `<material>` in one `<visual>`.
///
/// | departure | lenient reading |
/// |---|---|
/// | a second `<material>`, `<inertial>` or `<axis>`, a second element in `<geometry>` | the first is used |
/// | a box, sphere, cylinder or capsule with a size of 0 | the shape is left out |
/// | an XML prefix without `xmlns:` | its elements and attributes are ignored |
/// | xacro elements below the top level | they are ignored |
/// | an XML declaration that is not at the beginning | it is ignored |
/// | an `<inertial>` without `<mass>` or without `<inertia>` | the rest is computed from the shapes of the link |
/// | `<axis/>` without `xyz` on a fixed or floating joint | it is ignored |
/// | one number in the `scale` of a mesh | it holds for all three axes |
/// | `package:///path` | an absolute path, else a package with one slash too many |
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Strictness {
    /// Each is a warning that says what was done.
    #[default]
    Lenient,
    /// Each is an error.
    Strict,
}

/// Mass properties of bodies that move and have no `<inertial>` in any of their links.
///
/// A body is a link with all links that fixed joints join to it. Links without `<inertial>` that are fixed to a link with mass
/// keep no mass of their own: their mass is part of the other's.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum MissingInertia {
    /// Every link of the body has the mass, centre of mass and inertia of its collision shapes filled with this density
    /// \[kg/m³\]; of its visual shapes where it has no collision shapes. Meshes count as their convex hulls; shapes that overlap
    /// count twice. Bodies without shapes are as with [`Minimal`](Self::Minimal).
    Density(f64),
    /// The body has 1e-6 kg and 1e-9 kg m², which are not part of the total mass.
    Minimal,
}

impl Default for MissingInertia {
    fn default() -> Self {
        Self::Density(1000.0)
    }
}

/// Case of the names of a merged robot.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NameCaseCfg {
    /// Joints.
    pub joint: NameCase,
    /// Links.
    pub link: NameCase,
}

/// What becomes of the case of a name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
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
    /// The name in this case.
    pub fn apply(self, name: &str) -> String {
        match self {
            Self::Original => name.to_owned(),
            Self::Upper => name.to_uppercase(),
            Self::Lower => name.to_lowercase(),
        }
    }
}

/// One URDF file of a robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComponentCfg {
    /// What it is: `chassis`, `legs`, `torso`, `head`, `left_arm`, `right_arm`, `left_hand`, `right_hand`, `arm`, `hand`,
    /// which know their usual parent, or any other name.
    pub name: String,
    /// The file.
    pub urdf: PathBuf,
    /// Pose of the root link in the frame of the link it is attached to; for a component without a parent, in the frame
    /// of the robot.
    #[serde(default, with = "kinetoscope_scene::file_format::pose")]
    pub transform: Pose,
    /// The component it is attached to; by default the usual parent, if present.
    pub parent: Option<String>,
    /// The link of the parent component it is attached to, as named in that file; by default the tip.
    pub parent_link: Option<String>,
    /// The link of this component that is attached, as named in its file; must be its root.
    pub child_link: Option<String>,
    /// What its names start with; names that already do, in any case, stay. By default `left_` or `right_` for a
    /// component of such a name in a robot of several, else nothing.
    pub prefix: Option<String>,
}

impl ComponentCfg {
    /// A component with the default parent and no transform.
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
