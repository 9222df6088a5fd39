//! What can be wrong with a URDF, its meshes or an assembly, by what the user did.

use kinetoscope_scene::pattern::list;
use kinetoscope_scene::source::Source;
use std::path::PathBuf;
use thiserror::Error;

/// Why a URDF could not become a robot. Every variant names the place and what would be right.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// The file does not exist.
    #[error("{}: there is no such file", path.display())]
    FileMissing {
        /// The file as the user named it.
        path: PathBuf,
    },
    /// A folder was given where a file is needed.
    #[error("{}: is a folder; give the .urdf file inside it{}", path.display(), one_of(.urdfs))]
    FileIsFolder {
        /// The folder.
        path: PathBuf,
        /// The .urdf files in it.
        urdfs: Vec<String>,
    },
    /// The file exists and cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    FileUnreadable {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The file is larger than any robot.
    #[error("{}: is larger than {limit} bytes; a URDF holds no mesh data, is this the right file?", path.display())]
    FileTooLarge {
        /// The file.
        path: PathBuf,
        /// The largest size that is read \[bytes\].
        limit: u64,
    },
    /// The file has no content.
    #[error("{}: is empty; a URDF starts with <robot name=\"...\">", path.display())]
    FileEmpty {
        /// The file.
        path: PathBuf,
    },
    /// The file is not UTF-8.
    #[error("{at}: {problem}; save the file as UTF-8")]
    Encoding {
        /// The line of the first wrong byte.
        at: Source,
        /// What was found.
        problem: String,
    },
    /// The file is not well-formed XML.
    #[error("{at}: column {column}: not well-formed XML: {source}")]
    Xml {
        /// Where.
        at: Source,
        /// Column, counted from 1 in characters.
        column: u32,
        /// What the XML parser said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The file has a document type declaration, which could define entities.
    #[error("{at}: <!DOCTYPE> and entities are refused: no robot needs them and they can exhaust memory; delete it")]
    Doctype {
        /// Where.
        at: Source,
    },
    /// The file is a xacro, not a URDF.
    #[error("{at}: {found} is xacro, not URDF; expand it first: xacro file.xacro > file.urdf")]
    Xacro {
        /// Where.
        at: Source,
        /// The xacro element or expression.
        found: String,
    },
    /// The root element is not `<robot>`.
    #[error("{at}: the root element is <{found}>, a URDF starts with <robot name=\"...\">; {advice}")]
    WrongRoot {
        /// Where.
        at: Source,
        /// The element found.
        found: String,
        /// What to use instead.
        advice: &'static str,
    },
    /// A number is missing, superfluous, unreadable or not finite.
    #[error("{at}: {element}: {problem}")]
    Number {
        /// Where.
        at: Source,
        /// The element and attribute as written.
        element: String,
        /// What is wrong and what would be right.
        problem: String,
    },
    /// A number or a word has a value that cannot be.
    #[error("{at}: {owner}: {element}: {problem}")]
    Value {
        /// Where.
        at: Source,
        /// The link or joint.
        owner: String,
        /// The element and attribute as written.
        element: String,
        /// What is wrong and what would be right.
        problem: String,
    },
    /// An attribute is missing.
    #[error("{at}: {owner}: <{element}> has no {attribute}; write {example}")]
    AttributeMissing {
        /// Where.
        at: Source,
        /// The link or joint.
        owner: String,
        /// The element without it.
        element: String,
        /// The attribute that is missing.
        attribute: &'static str,
        /// What would be right.
        example: &'static str,
    },
    /// A child element is missing.
    #[error("{at}: {owner}: <{element}> has no <{child}>; {fix}")]
    ElementMissing {
        /// Where.
        at: Source,
        /// The link or joint.
        owner: String,
        /// The element without it.
        element: String,
        /// The child that is missing.
        child: &'static str,
        /// What would be right.
        fix: &'static str,
    },
    /// A child element that may be there once is there twice.
    #[error("{at}: {owner}: a second <{element}>, the first is at {first}; keep one")]
    ElementRepeated {
        /// The second one.
        at: Source,
        /// The link or joint.
        owner: String,
        /// The element.
        element: String,
        /// The first one.
        first: Source,
    },
    /// A `<geometry>` has more than its shape.
    #[error(
        "{at}: {owner}: <geometry> holds one shape, and <{found}> is its second element, the first is at {first}; keep one"
    )]
    GeometryRepeated {
        /// The second element.
        at: Source,
        /// The link.
        owner: String,
        /// The second element.
        found: String,
        /// The first one.
        first: Source,
    },
    /// A revolute or prismatic joint has no `<limit>`.
    #[error(
        "{at}: joint \"{joint}\" is {kind} and has no <limit>; add <limit lower=\"-1.5\" upper=\"1.5\" effort=\"10\" \
         velocity=\"1\"/>{}", if *.kind == "revolute" { " or make it continuous" } else { "" }
    )]
    LimitMissing {
        /// The joint element.
        at: Source,
        /// Its name.
        joint: String,
        /// Its type.
        kind: &'static str,
    },
    /// A joint type URDF does not have.
    #[error("{at}: joint \"{joint}\": there is no type \"{found}\"; {}", list(.candidates, .candidates.len()))]
    JointTypeUnknown {
        /// The joint element.
        at: Source,
        /// Its name.
        joint: String,
        /// The type as written.
        found: String,
        /// The types there are, the closest first.
        candidates: Vec<String>,
    },
    /// A shape URDF does not have.
    #[error("{at}: {owner}: there is no shape <{found}>; {}", list(.candidates, .candidates.len()))]
    ShapeUnknown {
        /// The shape element.
        at: Source,
        /// The link.
        owner: String,
        /// The element found.
        found: String,
        /// The shapes there are, the closest first.
        candidates: Vec<String>,
    },
    /// Two links, joints or materials have the same name.
    #[error("{second}: a second {what} named \"{name}\", the first is at {first}; names must be unique")]
    NameRepeated {
        /// `link`, `joint` or `material`.
        what: &'static str,
        /// The name.
        name: String,
        /// The first one.
        first: Source,
        /// The second one.
        second: Source,
    },
    /// A link is the child of two joints.
    #[error(
        "{second}: joint \"{second_joint}\" has child \"{link}\", which is already the child of joint \
         \"{first_joint}\" at {first}; a link hangs from one joint"
    )]
    TwoParents {
        /// The link.
        link: String,
        /// The first joint.
        first_joint: String,
        /// Where it is.
        first: Source,
        /// The second joint.
        second_joint: String,
        /// Where it is.
        second: Source,
    },
    /// A joint names a link that does not exist.
    #[error("{at}: joint \"{joint}\": {role} link \"{link}\" does not exist; {}", list(.candidates, *.total))]
    LinkUnknown {
        /// The parent or child element.
        at: Source,
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The name that does not exist.
        link: String,
        /// Links there are, the closest first.
        candidates: Vec<String>,
        /// How many links there are.
        total: usize,
    },
    /// Joints form a circle.
    #[error("{at}: joint \"{joint}\" closes a circle of links: {}; a URDF is a tree", chain(.links))]
    Cycle {
        /// The joint of the circle that comes first in the file.
        at: Source,
        /// Its name.
        joint: String,
        /// The links of the circle, the child of the joint first.
        links: Vec<String>,
    },
    /// More than one link has no parent.
    #[error("{}: {} links have no parent joint, only one may: {}; join them with fixed joints", .roots[0].1, .roots.len(), places(.roots))]
    SeveralRoots {
        /// The links and where they are.
        roots: Vec<(String, Source)>,
    },
    /// The robot has no link.
    #[error("{at}: the robot has no <link>; a robot has at least one")]
    NoLinks {
        /// The robot element.
        at: Source,
    },
    /// A mimic names a joint that does not exist.
    #[error("{at}: joint \"{joint}\" mimics \"{followed}\", which does not exist; {}", list(.candidates, *.total))]
    MimicUnknown {
        /// The mimic element.
        at: Source,
        /// The joint.
        joint: String,
        /// The name that does not exist.
        followed: String,
        /// Joints there are, the closest first.
        candidates: Vec<String>,
        /// How many joints there are.
        total: usize,
    },
    /// Joints mimic each other, or one mimics itself.
    #[error("{at}: joint \"{joint}\" mimics itself: {}; one joint of the circle must be free", chain(.joints))]
    MimicCycle {
        /// The mimic element of the joint.
        at: Source,
        /// The joint.
        joint: String,
        /// The circle.
        joints: Vec<String>,
    },
    /// A mimic names a joint without a single degree of freedom.
    #[error(
        "{at}: joint \"{joint}\" mimics \"{followed}\", which is {kind}; only revolute, continuous and prismatic joints can be followed"
    )]
    MimicUnmovable {
        /// The mimic element.
        at: Source,
        /// The joint.
        joint: String,
        /// The joint it follows.
        followed: String,
        /// The type of that joint.
        kind: &'static str,
    },
    /// The file name of a mesh is empty.
    #[error("{at}: link \"{link}\": <mesh> has an empty filename; write filename=\"meshes/part.stl\"")]
    MeshUnnamed {
        /// The mesh element.
        at: Source,
        /// The link.
        link: String,
    },
    /// The mesh file of a collision does not exist.
    #[error("{at}: link \"{link}\": collision mesh \"{uri}\" does not exist{}; looked at:{}", remark(.hint), lines(.tried))]
    MeshMissing {
        /// The collision.
        at: Source,
        /// The link.
        link: String,
        /// The URI as written.
        uri: String,
        /// Every file that was looked at.
        tried: Vec<String>,
        /// A remark that helps.
        hint: Option<String>,
    },
    /// The package of a collision mesh was found nowhere.
    #[error(
        "{at}: link \"{link}\": package \"{package}\" of \"{uri}\" was found nowhere; give its folder by \
         UrdfCfg::packages or ROS_PACKAGE_PATH; looked at:{}", lines(.tried)
    )]
    PackageUnknown {
        /// The collision.
        at: Source,
        /// The link.
        link: String,
        /// The URI as written.
        uri: String,
        /// The package.
        package: String,
        /// Every folder that was looked at.
        tried: Vec<String>,
    },
    /// The URI of a collision mesh cannot be resolved at all, such as `http://`.
    #[error("{at}: link \"{link}\": \"{uri}\" cannot be read: {problem}")]
    UriUnsupported {
        /// The collision.
        at: Source,
        /// The link.
        link: String,
        /// The URI as written.
        uri: String,
        /// What is wrong and what would be right.
        problem: String,
    },
    /// The assembly has no component.
    #[error("the assembly has no component; give at least one, such as UrdfCfg::single(\"robot.urdf\")")]
    NoComponents,
    /// A component or prefix has a name that cannot be used.
    #[error("component \"{component}\": {problem}")]
    ComponentInvalid {
        /// The component.
        component: String,
        /// What is wrong and what would be right.
        problem: String,
    },
    /// Two components have the same name.
    #[error("two components are named \"{component}\"; give each its own name and the second an explicit parent")]
    ComponentRepeated {
        /// The name.
        component: String,
    },
    /// A component names a parent component that does not exist.
    #[error("component \"{component}\": parent component \"{parent}\" does not exist; {}", list(.candidates, .candidates.len()))]
    ComponentUnknown {
        /// The component.
        component: String,
        /// Its parent.
        parent: String,
        /// The components there are, the closest first.
        candidates: Vec<String>,
    },
    /// A component of a name without a default parent names none.
    #[error(
        "component \"{component}\" has no default parent; set its parent to another component. {}",
        list(.candidates, .candidates.len())
    )]
    ComponentParentRequired {
        /// The component.
        component: String,
        /// The components there are, the closest first.
        candidates: Vec<String>,
    },
    /// Components are each other's parents.
    #[error("components are each other's parents: {}; one must have no parent", chain(.components))]
    ComponentCycle {
        /// The circle.
        components: Vec<String>,
    },
    /// `parent_link` or `child_link` names a link its component does not have.
    #[error(
        "component \"{component}\": {field} \"{link}\" is not a link of \"{of}\"; {}", list(.candidates, *.total)
    )]
    AttachLinkUnknown {
        /// The component whose configuration names it.
        component: String,
        /// `parent_link` or `child_link`.
        field: &'static str,
        /// The name.
        link: String,
        /// The component it was looked for in.
        of: String,
        /// Links there are, the closest first.
        candidates: Vec<String>,
        /// How many links there are.
        total: usize,
    },
    /// `parent_link` is set on a component without a parent.
    #[error(
        "component \"{component}\": parent_link \"{link}\" is set and there is no parent component; set parent too"
    )]
    ParentLinkWithoutParent {
        /// The component.
        component: String,
        /// The link.
        link: String,
    },
    /// `child_link` is not the root of its component.
    #[error(
        "component \"{component}\": child_link \"{link}\" is not its root link; re-rooting is not supported, \
         use \"{root}\" and put the offset into the transform"
    )]
    ChildLinkNotRoot {
        /// The component.
        component: String,
        /// The link named.
        link: String,
        /// The root.
        root: String,
    },
    /// The parent component has several tips.
    #[error(
        "component \"{component}\": its parent \"{parent}\" has {} tips at the same depth, set parent_link to the \
         right one; {}", .total, list(.candidates, *.total)
    )]
    TipAmbiguous {
        /// The component that is attached.
        component: String,
        /// Its parent component.
        parent: String,
        /// The deepest leaf links; at most [`MAX_CANDIDATES`](kinetoscope_scene::pattern::MAX_CANDIDATES).
        candidates: Vec<String>,
        /// How many there are.
        total: usize,
    },
    /// The file passed our checks and the URDF model still refused it.
    #[error("{}: the URDF model refused this file, which is a defect of this program; please report it: {source}", path.display())]
    Model {
        /// The file.
        path: PathBuf,
        /// What the model said.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

fn one_of(names: &[String]) -> String {
    if names.is_empty() { String::new() } else { format!(", such as {}", names.join(", ")) }
}

fn remark(hint: &Option<String>) -> String {
    hint.as_ref().map(|h| format!(" ({h})")).unwrap_or_default()
}

fn lines(tried: &[String]) -> String {
    tried.iter().map(|t| format!("\n  {t}")).collect()
}

fn chain(names: &[String]) -> String {
    let mut text: Vec<String> = names.iter().take(8).map(|n| format!("\"{n}\"")).collect();
    if names.len() > 8 {
        text.push(format!("... ({} more)", names.len() - 8));
    }
    text.extend(names.first().map(|n| format!("\"{n}\"")));
    text.join(" -> ")
}

fn places(roots: &[(String, Source)]) -> String {
    let mut text: Vec<String> = roots.iter().take(8).map(|(n, s)| format!("\"{n}\" ({s})")).collect();
    if roots.len() > 8 {
        text.push(format!("... ({} more)", roots.len() - 8));
    }
    text.join(", ")
}
