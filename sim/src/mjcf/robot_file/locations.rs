//! Locations of the named elements of a file and of the files it includes.

use kinetoscope_scene::input_file;
use kinetoscope_scene::source_location::{LineStarts, SourceLocation};
use std::collections::HashMap;
use std::path::Path;
use std::sync::Arc;

/// Maximum number of files that are read; MuJoCo rejects a file that is included twice.
const MAX_INCLUDED_FILES: usize = 100;

/// Locations of the named elements of a file.
pub(super) struct SourceLocations {
    file: SourceLocation,
    /// Locations by kind and name.
    named: HashMap<(String, String), SourceLocation>,
}

impl SourceLocations {
    /// Collects the locations of the named elements in `text`, the content of `file`, and in the files that it
    /// includes, which are read from disk. All other elements get the first line of `file`.
    pub(super) fn of(text: &str, file: &Path) -> Self {
        let mut places = Self { file: SourceLocation::new(file, 1), named: HashMap::new() };
        places.add(text, file, file.parent().unwrap_or(Path::new("")), &mut 0);
        places
    }

    fn add(&mut self, text: &str, file: &Path, folder: &Path, files: &mut usize) {
        *files += 1;
        let Ok(document) = roxmltree::Document::parse(text) else { return };
        let (shared, lines) = (Arc::new(file.to_path_buf()), LineStarts::new(text));
        for node in document.descendants().filter(roxmltree::Node::is_element) {
            let tag = node.tag_name().name();
            if tag == "include"
                && let Some(path) = node.attribute("file").map(|name| folder.join(name))
                && *files < MAX_INCLUDED_FILES
                && let Ok(text) = input_file::read_referenced_text(&path)
            {
                self.add(&text, &path, folder, files);
            }
            let Some(name) = node.attribute("name") else { continue };
            let section = node.parent().map_or("", |parent| parent.tag_name().name());
            // In these sections the kind is the name of the section, elsewhere the name of the element.
            let kind = match section {
                "actuator" | "equality" | "tendon" => section,
                _ if tag == "freejoint" => "joint",
                _ => tag,
            };
            let line = lines.line(node.range().start);
            let key = (kind.to_string(), name.to_string());
            self.named.entry(key).or_insert_with(|| SourceLocation { file: Arc::clone(&shared), line });
        }
    }

    /// Location of the element `name` of the kind `kind`; the first line of the file if no such element was found.
    pub(super) fn get(&self, kind: &str, name: &str) -> SourceLocation {
        self.named.get(&(kind.to_string(), name.to_string())).unwrap_or(&self.file).clone()
    }

    /// Location of the first line of the file.
    pub(super) fn file(&self) -> SourceLocation {
        self.file.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn by_kind_and_name() {
        let dir = tempfile::tempdir().unwrap();
        let part = dir.path().join("part.xml");
        std::fs::write(&part, "<mujocoinclude>\n\n<body name='b'/></mujocoinclude>").unwrap();
        let file = dir.path().join("whole.xml");
        let text = "<mujoco><worldbody>\n<body name='a'><freejoint name='f'/>\n<joint name='a'/></body>\n\
                    <include file='part.xml'/></worldbody>\n<actuator><motor name='a'/></actuator></mujoco>";
        let places = SourceLocations::of(text, &file);
        for (kind, name, expected) in [
            ("body", "a", SourceLocation::new(&file, 2)),
            ("joint", "f", SourceLocation::new(&file, 2)),
            ("joint", "a", SourceLocation::new(&file, 3)),
            ("body", "b", SourceLocation::new(&part, 3)),
            ("actuator", "a", SourceLocation::new(&file, 5)),
            ("joint", "none", SourceLocation::new(&file, 1)),
        ] {
            assert_eq!(places.get(kind, name), expected, "{kind} {name}");
        }
    }
}
