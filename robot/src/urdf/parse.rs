//! Reader and checker of one URDF file.
//!
//! A pass over the document checks everything and records locations. It writes a normalized form (absent numbers filled
//! in, nothing that `urdf-rs` would misread), from which `urdf-rs` supplies the model values. Reading stops at the
//! first error.

use super::config::Strictness;
use super::error::UrdfError;
use super::file::{JointMetadata, LinkMetadata, UrdfFile};
use super::joint::read_joint;
use super::link::{Materials, read_link};
use super::reader::{Reader, format_element, write_attribute};
use super::tree::{JointEdge, NamedElement, Tree};
use super::xml::{repair, trim_nuls};
use crate::diagnostic::DiagnosticKind;
use kinetoscope_scene::input_file::{self, MAX_TEXT};
use kinetoscope_scene::source_location::SourceLocation;
use roxmltree::{Document, Node};
use std::collections::HashSet;
use std::path::Path;
use std::sync::Arc;

/// Top-level elements without meaning for the simulation, common enough to be skipped without a warning.
const IGNORED_ELEMENTS: [&str; 8] =
    ["gazebo", "plugin", "ros2_control", "drake", "safety_controller", "sensor", "group", "verbose"];

/// Reads a URDF file with the default [`Strictness`], lenient.
///
/// # Errors
/// The file cannot be read, is not well-formed URDF, or its links and joints do not form a tree. Mesh files are not
/// checked.
pub fn parse_file(path: impl AsRef<Path>) -> Result<UrdfFile, UrdfError> {
    parse_file_with(path, Strictness::default())
}

/// Reads a URDF file.
///
/// # Errors
/// Same errors as [`parse_file`]; strict reading also rejects the deviations that [`Strictness`] lists.
pub fn parse_file_with(path: impl AsRef<Path>, strictness: Strictness) -> Result<UrdfFile, UrdfError> {
    let path = path.as_ref();
    let owned = || path.to_path_buf();
    if path.is_dir() {
        return Err(UrdfError::FileIsFolder { path: owned(), urdfs: urdfs_in(path) });
    }
    let bytes = input_file::read_named(path, MAX_TEXT).map_err(|source| match source.kind() {
        std::io::ErrorKind::NotFound => UrdfError::FileMissing { path: owned() },
        std::io::ErrorKind::FileTooLarge => UrdfError::FileTooLarge { path: owned(), limit: MAX_TEXT },
        _ => UrdfError::FileUnreadable { path: owned(), source },
    })?;
    match std::str::from_utf8(&bytes) {
        Ok(text) => parse_str_with(text, path, strictness),
        Err(error) => Err(encoding(&bytes, error.valid_up_to(), path)),
    }
}

fn urdfs_in(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().take(4096).flatten();
    let names = entries.map(|e| e.file_name().to_string_lossy().into_owned());
    let mut names: Vec<String> = names.filter(|n| n.ends_with(".urdf")).collect();
    names.sort();
    names.truncate(3);
    names
}

fn encoding(bytes: &[u8], wrong: usize, path: &Path) -> UrdfError {
    let line = 1 + bytes[..wrong].iter().filter(|&&b| b == b'\n').count();
    let problem = match bytes {
        [0xff, 0xfe, ..] | [0xfe, 0xff, ..] => "the file is UTF-16".to_owned(),
        _ => format!("byte 0x{:02x} is not UTF-8", bytes[wrong]),
    };
    UrdfError::Encoding { at: SourceLocation::new(path, u32::try_from(line).unwrap_or(u32::MAX)), problem }
}

/// Reads a URDF from memory with the default [`Strictness`]. `path` names the file in messages, and relative mesh paths
/// start at its folder.
///
/// # Errors
/// Same errors as [`parse_file`].
pub fn parse_str(text: &str, path: impl AsRef<Path>) -> Result<UrdfFile, UrdfError> {
    parse_str_with(text, path, Strictness::default())
}

/// Reads a URDF from memory. `path` names the file in messages, and relative mesh paths start at its folder.
///
/// # Errors
/// Same errors as [`parse_file_with`].
pub fn parse_str_with(text: &str, path: impl AsRef<Path>, strictness: Strictness) -> Result<UrdfFile, UrdfError> {
    let path = path.as_ref();
    let mut diagnostics = Vec::new();
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let text = if strictness == Strictness::Lenient { trim_nuls(text, path, &mut diagnostics) } else { text };
    if text.trim().is_empty() {
        return Err(UrdfError::FileEmpty { path: path.to_path_buf() });
    }
    let repaired;
    let document = match Document::parse(text) {
        Err(error) if strictness == Strictness::Lenient => {
            repaired = repair(text, error, path, &mut diagnostics).map_err(|e| malformed(e, text, path))?;
            Document::parse(&repaired)
        }
        parsed => parsed,
    };
    let document = document.map_err(|e| malformed(e, text, path))?;
    let root = document.root_element();
    let mut reader =
        Reader::new(Arc::new(path.to_path_buf()), document.input_text(), root.tag_name().namespace(), strictness);
    reader.diagnostics = diagnostics;
    check_root(&mut reader, root)?;

    let mut materials = Materials::default();
    materials.define(&mut reader, root)?;
    let mut pass = DocumentPass::default();
    for node in reader.elements(root) {
        match node.tag_name().name() {
            "link" => pass.link(&mut reader, node, &mut materials)?,
            "joint" => pass.joint(&mut reader, node)?,
            "material" | "transmission" => {}
            "mujoco" => pass.meshdir = pass.meshdir.take().or(meshdir(&reader, node)?),
            skipped if IGNORED_ELEMENTS.contains(&skipped) => {}
            other => {
                let message = format!("<{other}> is not a URDF element and was ignored");
                let at = reader.source(node);
                reader.warn(DiagnosticKind::ElementIgnored, at, message);
            }
        }
    }
    let tree = Tree::build(&reader.source(root), &pass.link_names, &pass.edges)?;
    check_transmissions(&mut reader, root, &pass.edges)?;
    materials.check(&mut reader);
    reader.report_commas();

    let name = reader.text(root, "name")?.unwrap_or_default();
    let mut normalized = String::with_capacity(pass.xml.len() + materials.xml.len() + 64);
    normalized.push_str("<robot");
    write_attribute(&mut normalized, "name", name);
    normalized.push('>');
    normalized.push_str(&pass.xml);
    normalized.push_str(&materials.xml);
    normalized.push_str("</robot>");
    let refused = |source| UrdfError::Model { path: path.to_path_buf(), source };
    let robot = urdf_rs::read_from_string(&normalized).map_err(|e| refused(e.into()))?;
    if !pass.matches_model(&robot) {
        return Err(refused("the links or joints of the parsed model differ from those of the file".into()));
    }
    Ok(UrdfFile {
        path: reader.file,
        robot,
        links: pass.links,
        joints: pass.joints,
        tree,
        meshdir: pass.meshdir,
        diagnostics: reader.diagnostics,
    })
}

/// Results of the pass over the document.
#[derive(Default)]
struct DocumentPass {
    links: Vec<LinkMetadata>,
    joints: Vec<JointMetadata>,
    link_names: Vec<NamedElement>,
    edges: Vec<JointEdge>,
    meshdir: Option<String>,
    /// Normalized links and joints.
    xml: String,
}

impl DocumentPass {
    fn link(
        &mut self,
        reader: &mut Reader<'_>,
        node: Node<'_, '_>,
        materials: &mut Materials,
    ) -> Result<(), UrdfError> {
        let name = reader.required_text(node, "name", "robot", "<link name=\"base\">")?;
        self.links.push(read_link(reader, node, name, materials, &mut self.xml)?);
        self.link_names.push(NamedElement { name: name.to_owned(), source: reader.source(node) });
        Ok(())
    }

    fn joint(&mut self, reader: &mut Reader<'_>, node: Node<'_, '_>) -> Result<(), UrdfError> {
        let name = reader.required_text(node, "name", "robot", "<joint name=\"joint1\" type=\"revolute\">")?;
        let (notes, edge) = read_joint(reader, node, name, &mut self.xml)?;
        self.joints.push(notes);
        self.edges.push(edge);
        Ok(())
    }

    /// True if the model has the names and the numbers of shapes that the pass found.
    fn matches_model(&self, robot: &urdf_rs::Robot) -> bool {
        robot.links.len() == self.links.len()
            && robot.joints.len() == self.joints.len()
            && robot.links.iter().zip(&self.link_names).all(|(a, b)| a.name == b.name)
            && robot.joints.iter().zip(&self.edges).all(|(a, b)| a.name == b.joint.name)
            && robot
                .links
                .iter()
                .zip(&self.links)
                .all(|(a, b)| a.visual.len() == b.visuals.len() && a.collision.len() == b.collisions.len())
    }
}

fn malformed(error: roxmltree::Error, text: &str, path: &Path) -> UrdfError {
    let position = error.pos();
    let at = SourceLocation::new(path, position.row);
    match &error {
        roxmltree::Error::DtdDetected => {
            let before = text.split("<!DOCTYPE").next().unwrap_or_default();
            let line = 1 + before.bytes().filter(|&b| b == b'\n').count();
            UrdfError::Doctype { at: SourceLocation::new(path, u32::try_from(line).unwrap_or(u32::MAX)) }
        }
        roxmltree::Error::UnknownNamespace(prefix, _) if prefix == "xacro" => {
            UrdfError::Xacro { at, found: "an element with prefix xacro:".to_owned() }
        }
        // The library reports the start of the root element; the user must look at the end of the file.
        roxmltree::Error::UnclosedRootNode => {
            let line = text.lines().count();
            let column = text.lines().last().map_or(1, |l| l.chars().count() + 1);
            let at = SourceLocation::new(path, u32::try_from(line).unwrap_or(u32::MAX));
            UrdfError::Xml { at, column: u32::try_from(column).unwrap_or(u32::MAX), source: error.into() }
        }
        _ => UrdfError::Xml { at, column: position.col, source: error.into() },
    }
}

fn check_root(reader: &mut Reader<'_>, root: Node<'_, '_>) -> Result<(), UrdfError> {
    let found = root.tag_name().name();
    if found != "robot" {
        let advice = match found {
            "mujoco" => "this is MJCF, load it as MJCF",
            "sdf" => "this is SDF, export the model as URDF",
            "mujocoinclude" | "include" => "this is a part of another file",
            "COLLADA" => "this is a mesh, a URDF names it in <mesh filename=\"...\"/>",
            "robots" | "model" | "world" => "export one robot as URDF",
            _ => "check that this is the right file",
        };
        return Err(UrdfError::WrongRoot { at: reader.source(root), found: found.to_owned(), advice });
    }
    let is_xacro = |n: &Node<'_, '_>| n.tag_name().namespace().is_some_and(|s| s.contains("xacro"));
    for node in root.descendants().filter(Node::is_element).filter(is_xacro) {
        let Some(parent) = node.parent_element() else { continue };
        // Elements inside another xacro element are ignored with it.
        if is_xacro(&parent) {
            continue;
        }
        let (at, found) = (reader.source(node), format!("<xacro:{}>", node.tag_name().name()));
        let error = UrdfError::Xacro { at: at.clone(), found };
        // At the top level a xacro element may expand to links and joints.
        if parent == root {
            return Err(error);
        }
        let done = format!("here it is inside <{}> and was ignored", parent.tag_name().name());
        reader.warn_or_fail(DiagnosticKind::XacroLeftover, at, error, &done)?;
    }
    Ok(())
}

/// Returns the first `meshdir` of the `<compiler>` elements in a `<mujoco>` element; `None` if it is missing or empty.
fn meshdir(reader: &Reader<'_>, node: Node<'_, '_>) -> Result<Option<String>, UrdfError> {
    for compiler in reader.named(node, "compiler") {
        if let Some(folder) = reader.text(compiler, "meshdir")? {
            return Ok(Some(folder.to_owned()).filter(|f| !f.is_empty()));
        }
    }
    Ok(None)
}

/// Warns about transmissions that name an unknown joint. Transmissions have no meaning for the simulation, but an
/// unknown joint indicates a broken file.
fn check_transmissions(reader: &mut Reader<'_>, root: Node<'_, '_>, edges: &[JointEdge]) -> Result<(), UrdfError> {
    let joints: HashSet<&str> = edges.iter().map(|e| e.joint.name.as_str()).collect();
    for transmission in reader.named(root, "transmission") {
        for joint in reader.named(transmission, "joint") {
            let name = reader.text(joint, "name")?.unwrap_or_default();
            if !joints.contains(name) {
                let transmission = format_element(transmission, transmission.attribute("name").map(|n| ("name", n)));
                let message = format!("{transmission} names joint \"{name}\", which does not exist; it was ignored");
                let at = reader.source(joint);
                reader.warn(DiagnosticKind::ReferenceUnknown, at, message);
            }
        }
    }
    Ok(())
}
