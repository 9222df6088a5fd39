//! Errors of URDF files, of their meshes and of their assembly.

use kinetoscope_scene::pattern::format_candidates;
use kinetoscope_scene::source_location::SourceLocation;
use std::path::PathBuf;
use thiserror::Error;

/// Error of reading or merging URDF files, or of their collision meshes. Messages name the file and line, or the
/// component, and the remedy if there is one.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum UrdfError {
    /// The file does not exist.
    #[error("{}: there is no such file", path.display())]
    FileMissing {
        /// Path as the user gave it.
        path: PathBuf,
    },
    /// A folder was given where a file is needed.
    #[error("{}: is a folder; give the .urdf file inside it{}", path.display(), one_of(.urdfs))]
    FileIsFolder {
        /// Path of the folder.
        path: PathBuf,
        /// Names of `.urdf` files in the folder, sorted; at most three.
        urdfs: Vec<String>,
    },
    /// The file exists but cannot be read.
    #[error("{}: cannot be read: {source}", path.display())]
    FileUnreadable {
        /// Path of the file.
        path: PathBuf,
        /// Error of the operating system.
        source: std::io::Error,
    },
    /// The file exceeds the size limit.
    #[error("{}: is larger than {limit} bytes; a URDF file contains no mesh data, so check that this is the right file", path.display())]
    FileTooLarge {
        /// Path of the file.
        path: PathBuf,
        /// Size limit \[bytes\].
        limit: u64,
    },
    /// The file has no content or only whitespace.
    #[error("{}: is empty; a URDF starts with <robot name=\"...\">", path.display())]
    FileEmpty {
        /// Path of the file.
        path: PathBuf,
    },
    /// The file is not UTF-8.
    #[error("{at}: {problem}; save the file as UTF-8")]
    Encoding {
        /// Location of the first invalid byte.
        at: SourceLocation,
        /// Description of the problem.
        problem: String,
    },
    /// The file is not well-formed XML.
    #[error("{at}: column {column}: not well-formed XML: {source}")]
    Xml {
        /// Location in the file.
        at: SourceLocation,
        /// Column, counted from 1 in characters.
        column: u32,
        /// Error of the XML parser.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The file has a document type declaration, which could define entities.
    #[error(
        "{at}: <!DOCTYPE> and entities are not allowed: robots do not need them, and they can exhaust memory; delete \
         the declaration"
    )]
    Doctype {
        /// Location in the file.
        at: SourceLocation,
    },
    /// The file is a xacro, not a URDF.
    #[error("{at}: {found} is xacro, not URDF; expand it first: xacro file.xacro > file.urdf")]
    Xacro {
        /// Location in the file.
        at: SourceLocation,
        /// The xacro element or expression.
        found: String,
    },
    /// The root element is not `<robot>`.
    #[error("{at}: the root element is <{found}>, a URDF starts with <robot name=\"...\">; {advice}")]
    WrongRoot {
        /// Location in the file.
        at: SourceLocation,
        /// Name of the root element.
        found: String,
        /// Suggested remedy.
        advice: &'static str,
    },
    /// An attribute has too few or too many numbers, or a number that is unreadable or not finite.
    #[error("{at}: {element}: {problem}")]
    Number {
        /// Location in the file.
        at: SourceLocation,
        /// Element and attribute as written.
        element: String,
        /// Problem and accepted values.
        problem: String,
    },
    /// A number or keyword has an invalid value.
    #[error("{at}: {owner}: {element}: {problem}")]
    Value {
        /// Location in the file.
        at: SourceLocation,
        /// Owner of the element, such as `link "base"`.
        owner: String,
        /// Element and attribute as written.
        element: String,
        /// Problem and accepted values.
        problem: String,
    },
    /// A required attribute is missing or empty.
    #[error("{at}: {owner}: <{element}> has no {attribute}; write {example}")]
    AttributeMissing {
        /// Location in the file.
        at: SourceLocation,
        /// Owner of the element, such as `link "base"`.
        owner: String,
        /// Name of the incomplete element.
        element: String,
        /// Name of the missing attribute.
        attribute: &'static str,
        /// Example of a valid attribute.
        example: &'static str,
    },
    /// A required child element is missing.
    #[error("{at}: {owner}: <{element}> has no <{child}>; {fix}")]
    ElementMissing {
        /// Location in the file.
        at: SourceLocation,
        /// Owner of the element, such as `link "base"`.
        owner: String,
        /// Name of the incomplete element.
        element: String,
        /// Name of the missing child.
        child: &'static str,
        /// Suggested remedy.
        fix: &'static str,
    },
    /// A child element that may occur once occurs twice.
    #[error("{at}: {owner}: a second <{element}>, the first is at {first}; keep one")]
    ElementRepeated {
        /// Location of the second element.
        at: SourceLocation,
        /// Owner of the element, such as `link "base"`.
        owner: String,
        /// Name of the element.
        element: String,
        /// Location of the first element.
        first: SourceLocation,
    },
    /// A `<geometry>` has more than one element.
    #[error(
        "{at}: {owner}: <geometry> must contain one shape, but <{found}> is its second element, the first is at \
         {first}; keep one"
    )]
    GeometryRepeated {
        /// Location of the second element.
        at: SourceLocation,
        /// Link that owns the geometry, such as `link "base"`.
        owner: String,
        /// Name of the second element.
        found: String,
        /// Location of the first element.
        first: SourceLocation,
    },
    /// A revolute or prismatic joint has no `<limit>`.
    #[error(
        "{at}: joint \"{joint}\" is {kind} and has no <limit>; add <limit lower=\"-1.5\" upper=\"1.5\" effort=\"10\" \
         velocity=\"1\"/>{}", if *.kind == "revolute" { " or make it continuous" } else { "" }
    )]
    LimitMissing {
        /// Location of the joint element.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Type of the joint.
        kind: &'static str,
    },
    /// A joint type does not exist in URDF.
    #[error("{at}: joint \"{joint}\": unknown type \"{found}\"; {}", format_candidates(.candidates, .candidates.len()))]
    JointTypeUnknown {
        /// Location of the `type` attribute.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Type as written.
        found: String,
        /// Joint types of URDF, the closest match first.
        candidates: Vec<String>,
    },
    /// A shape does not exist in URDF.
    #[error("{at}: {owner}: unknown shape <{found}>; {}", format_candidates(.candidates, .candidates.len()))]
    ShapeUnknown {
        /// Location of the shape element.
        at: SourceLocation,
        /// Link that owns the shape, such as `link "base"`.
        owner: String,
        /// Name of the element.
        found: String,
        /// Shapes of URDF, the closest match first.
        candidates: Vec<String>,
    },
    /// Two links, two joints or two top-level materials of a file have the same name. Equal materials are allowed.
    #[error("{second}: a second {what} named \"{name}\", the first is at {first}; names must be unique")]
    NameRepeated {
        /// Kind of the element: `link`, `joint` or `material`.
        what: &'static str,
        /// Repeated name.
        name: String,
        /// Location of the first element.
        first: SourceLocation,
        /// Location of the second element.
        second: SourceLocation,
    },
    /// A link is the child of two joints.
    #[error(
        "{second}: joint \"{second_joint}\" has child \"{link}\", which is already the child of joint \
         \"{first_joint}\" at {first}; a link can have only one parent joint"
    )]
    MultipleParents {
        /// Name of the link.
        link: String,
        /// Name of the first joint.
        first_joint: String,
        /// Location of the first joint.
        first: SourceLocation,
        /// Name of the second joint.
        second_joint: String,
        /// Location of the second joint.
        second: SourceLocation,
    },
    /// A joint names a link that does not exist.
    #[error("{at}: joint \"{joint}\": {role} link \"{link}\" does not exist; {}", format_candidates(.candidates, *.total))]
    LinkUnknown {
        /// Location of the parent or child element.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Role of the link: `parent` or `child`.
        role: &'static str,
        /// Name of the missing link.
        link: String,
        /// Most similar existing links, the closest match first; at most 12.
        candidates: Vec<String>,
        /// Number of existing links.
        total: usize,
    },
    /// Joints form a cycle.
    #[error("{at}: joint \"{joint}\" closes a kinematic loop: {}; a URDF must be a tree", chain(.links))]
    Cycle {
        /// Location of the joint of the cycle that comes first in the file.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Links of the cycle, the child of the joint first.
        links: Vec<String>,
    },
    /// Several links have no parent.
    #[error("{}: {} links have no parent joint, only one may: {}; join them with fixed joints", .roots[0].1, .roots.len(), places(.roots))]
    MultipleRoots {
        /// Names and locations of these links.
        roots: Vec<(String, SourceLocation)>,
    },
    /// The robot has no link.
    #[error("{at}: the robot has no <link>; a robot has at least one")]
    NoLinks {
        /// Location of the robot element.
        at: SourceLocation,
    },
    /// A mimic names a joint that does not exist.
    #[error("{at}: joint \"{joint}\" mimics \"{mimicked_joint}\", which does not exist; {}", format_candidates(.candidates, *.total))]
    MimicUnknown {
        /// Location of the mimic element.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Name of the missing joint.
        mimicked_joint: String,
        /// Most similar existing joints, the closest match first; at most 12.
        candidates: Vec<String>,
        /// Number of existing joints.
        total: usize,
    },
    /// Joints mimic each other, or a joint mimics itself.
    #[error("{at}: joint \"{joint}\" mimics itself: {}; one joint of the cycle must not be a mimic joint", chain(.joints))]
    MimicCycle {
        /// Location of the mimic element of the joint.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Joints of the cycle.
        joints: Vec<String>,
    },
    /// A mimic names a joint without a single degree of freedom.
    #[error(
        "{at}: joint \"{joint}\" mimics \"{followed}\", which is {kind}; only revolute, continuous and prismatic joints can be followed"
    )]
    MimicNotDrivable {
        /// Location of the mimic element.
        at: SourceLocation,
        /// Name of the joint.
        joint: String,
        /// Name of the followed joint.
        followed: String,
        /// Type of the followed joint.
        kind: &'static str,
    },
    /// The file name of a mesh is empty.
    #[error("{at}: link \"{link}\": <mesh> has an empty filename; write filename=\"meshes/part.stl\"")]
    MeshUnnamed {
        /// Location of the mesh element.
        at: SourceLocation,
        /// Name of the link.
        link: String,
    },
    /// The mesh file of a collision does not exist.
    #[error("{at}: link \"{link}\": collision mesh \"{uri}\" does not exist{}; searched:{}", remark(.hint), lines(.tried))]
    MeshMissing {
        /// Location of the collision element.
        at: SourceLocation,
        /// Name of the link.
        link: String,
        /// URI as written.
        uri: String,
        /// Every path that was tried.
        tried: Vec<String>,
        /// Additional hint; `None` without one.
        hint: Option<String>,
    },
    /// The package of a collision mesh was not found.
    #[error(
        "{at}: link \"{link}\": package \"{package}\" of \"{uri}\" was not found; set its folder with \
         UrdfCfg::packages or ROS_PACKAGE_PATH; searched:{}", lines(.tried)
    )]
    PackageUnknown {
        /// Location of the collision element.
        at: SourceLocation,
        /// Name of the link.
        link: String,
        /// URI as written.
        uri: String,
        /// Name of the package.
        package: String,
        /// Every folder that was searched.
        tried: Vec<String>,
    },
    /// The URI of a collision mesh has an unsupported form, such as `http://`.
    #[error("{at}: link \"{link}\": \"{uri}\" cannot be read: {problem}")]
    UriUnsupported {
        /// Location of the collision element.
        at: SourceLocation,
        /// Name of the link.
        link: String,
        /// URI as written.
        uri: String,
        /// Problem and accepted forms.
        problem: String,
    },
    /// The assembly has no component.
    #[error("the assembly has no component; give at least one, such as UrdfCfg::single(\"robot.urdf\")")]
    NoComponents,
    /// A component has an invalid name, prefix or transform.
    #[error("component \"{component}\": {problem}")]
    ComponentInvalid {
        /// Name of the component.
        component: String,
        /// Problem and accepted values.
        problem: String,
    },
    /// Two components have the same name.
    #[error("two components are named \"{component}\"; give each its own name and the second an explicit parent")]
    ComponentRepeated {
        /// Repeated name.
        component: String,
    },
    /// A component names a parent component that does not exist.
    #[error("component \"{component}\": parent component \"{parent}\" does not exist; {}", format_candidates(.candidates, .candidates.len()))]
    ComponentUnknown {
        /// Name of the component.
        component: String,
        /// Name of the missing parent.
        parent: String,
        /// Most similar existing components, the closest match first; at most 12.
        candidates: Vec<String>,
    },
    /// A component with a custom name sets no parent, and is not the first component.
    #[error(
        "component \"{component}\" has no default parent; set its parent to another component. {}",
        format_candidates(.candidates, .candidates.len())
    )]
    ComponentParentRequired {
        /// Name of the component.
        component: String,
        /// Most similar existing components, the closest match first; at most 12.
        candidates: Vec<String>,
    },
    /// The parents of components form a cycle.
    #[error("the components form a cycle of parents: {}; one component must have no parent", chain(.components))]
    ComponentCycle {
        /// Components of the cycle.
        components: Vec<String>,
    },
    /// `parent_link` or `child_link` names a link that its component does not have.
    #[error(
        "component \"{component}\": {field} \"{link}\" is not a link of \"{of}\"; {}", format_candidates(.candidates, *.total)
    )]
    AttachLinkUnknown {
        /// Component with this setting.
        component: String,
        /// Name of the setting: `parent_link` or `child_link`.
        field: &'static str,
        /// Name of the missing link.
        link: String,
        /// Component that was searched for the link.
        of: String,
        /// Most similar existing links, the closest match first; at most 12.
        candidates: Vec<String>,
        /// Number of existing links.
        total: usize,
    },
    /// `parent_link` is set on a component without a parent.
    #[error(
        "component \"{component}\": parent_link \"{link}\" is set and there is no parent component; set parent too"
    )]
    ParentLinkWithoutParent {
        /// Name of the component.
        component: String,
        /// Name of the link.
        link: String,
    },
    /// `child_link` is not the root of its component.
    #[error(
        "component \"{component}\": child_link \"{link}\" is not its root link; re-rooting is not supported, \
         use \"{root}\" and put the offset into the transform"
    )]
    ChildLinkNotRoot {
        /// Name of the component.
        component: String,
        /// Name of the link that was given.
        link: String,
        /// Name of the root link.
        root: String,
    },
    /// The parent component has several tips.
    #[error(
        "component \"{component}\": its parent \"{parent}\" has {} tips at the same depth, set parent_link to the \
         right one; {}", .total, format_candidates(.candidates, *.total)
    )]
    TipAmbiguous {
        /// Component to attach.
        component: String,
        /// Parent of the component.
        parent: String,
        /// Deepest leaf links; at most [`MAX_CANDIDATES`](kinetoscope_scene::pattern::MAX_CANDIDATES).
        candidates: Vec<String>,
        /// Number of deepest leaf links.
        total: usize,
    },
    /// The library `urdf-rs` rejected a file that passed all checks: a defect of this program.
    #[error("{}: the URDF library (urdf-rs) rejected the normalized file, which is a defect of this program; please report it: {source}", path.display())]
    Model {
        /// Path of the file.
        path: PathBuf,
        /// Error of the URDF model.
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

fn places(roots: &[(String, SourceLocation)]) -> String {
    let mut text: Vec<String> = roots.iter().take(8).map(|(n, s)| format!("\"{n}\" ({s})")).collect();
    if roots.len() > 8 {
        text.push(format!("... ({} more)", roots.len() - 8));
    }
    text.join(", ")
}
