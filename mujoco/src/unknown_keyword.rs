//! MJCF names that an old MuJoCo rejects: the version that introduced them, and their position in a file.

use kinetoscope_scene::input_file;
use kinetoscope_scene::source_location::SourceLocation;
use std::path::{Path, PathBuf};

/// A name that the schema of a MuJoCo version does not contain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct UnknownKeyword<'m> {
    /// Name of the element.
    pub(super) element: &'m str,
    /// Attribute of the element, or the value of an attribute; `None` if the element itself is unknown.
    pub(super) keyword: Option<&'m str>,
    /// True if `keyword` is the value of an attribute, false if it is the name of an attribute.
    is_value: bool,
}

/// Elements, attributes and values that 2.2.2 does not have: element (`*` for any), attribute or value, first version.
/// Source: MuJoCo's changelog.
const INTRODUCED_IN: &[(&str, &str, &str)] = &[
    ("*", "gravcomp", "2.3.1"),
    ("*", "actuatorfrcrange", "2.3.7"),
    ("*", "actuatorfrclimited", "2.3.7"),
    ("*", "actuatorgravcomp", "3.1.0"),
    ("option", "implicitfast", "2.3.3"),
    ("option", "sdf_iterations", "3.0.0"),
    ("option", "sdf_initpoints", "3.0.0"),
    ("option", "ls_iterations", "3.0.0"),
    ("option", "ls_tolerance", "3.0.0"),
    ("option", "o_friction", "3.0.0"),
    ("option", "ccd_iterations", "3.2.0"),
    ("option", "ccd_tolerance", "3.2.0"),
    ("option", "actuatorgroupdisable", "3.1.0"),
    ("flag", "nativeccd", "3.2.0"),
    ("flag", "island", "3.0.0"),
    ("flag", "midphase", "2.3.4"),
    ("flag", "eulerdamp", "2.3.3"),
    ("flag", "autoreset", "3.2.0"),
    ("size", "memory", "2.3.0"),
    ("compiler", "assetdir", "2.3.0"),
    ("compiler", "alignfree", "3.2.0"),
    ("compiler", "inertiagrouprange", "3.2.0"),
    ("position", "kv", "3.1.0"),
    ("position", "dampratio", "3.1.6"),
    ("position", "inheritrange", "3.1.0"),
    ("position", "timeconst", "3.1.6"),
    ("intvelocity", "inheritrange", "3.1.0"),
    ("*", "actdim", "2.3.0"),
    ("*", "actearly", "3.0.0"),
    ("general", "filterexact", "3.0.0"),
    ("mesh", "inertia", "3.2.5"),
    ("mesh", "maxhullvert", "3.2.0"),
    ("mesh", "builtin", "3.3.5"),
    ("*", "content_type", "2.3.7"),
    ("texture", "nchannel", "3.2.1"),
    ("texture", "colorspace", "3.3.3"),
    ("material", "metallic", "3.1.5"),
    ("material", "roughness", "3.1.5"),
    ("camera", "resolution", "3.0.0"),
    ("camera", "sensorsize", "3.0.0"),
    ("camera", "focal", "3.0.0"),
    ("camera", "focalpixel", "3.0.0"),
    ("camera", "principal", "3.0.0"),
    ("camera", "principalpixel", "3.0.0"),
    ("light", "type", "3.3.3"),
    ("light", "bulbradius", "3.1.5"),
    ("connect", "site1", "3.2.3"),
    ("connect", "site2", "3.2.3"),
    ("weld", "site1", "3.2.3"),
    ("weld", "site2", "3.2.3"),
    ("hfield", "elevation", "3.1.1"),
    ("extension", "", "2.3.3"),
    ("plugin", "", "2.3.3"),
    ("frame", "", "3.1.0"),
    ("replicate", "", "3.1.5"),
    ("attach", "", "3.2.0"),
    ("model", "", "3.2.0"),
    ("flexcomp", "", "3.0.0"),
    ("deformable", "", "3.0.0"),
    ("flex", "", "3.0.0"),
    ("layer", "", "3.2.5"),
    ("contact", "", "3.3.5"),
    ("distance", "", "3.1.6"),
    ("normal", "", "3.1.6"),
    ("fromto", "", "3.1.6"),
    ("jointactuatorfrc", "", "2.3.7"),
    ("tendonactuatorfrc", "", "3.3.0"),
    ("e_potential", "", "3.3.3"),
    ("e_kinetic", "", "3.3.3"),
    ("camprojection", "", "3.0.0"),
    ("insidesite", "", "3.3.3"),
    ("tactile", "", "3.3.5"),
    ("dcmotor", "", "3.7.0"),
];

impl<'m> UnknownKeyword<'m> {
    /// Parses the unknown name in a message of MuJoCo's XML reader; `None` for a message about something else.
    pub(super) fn from_message(message: &'m str) -> Option<Self> {
        let quoted = |text: &'m str| text.split('\'').nth(1);
        let element = quoted(&message[message.find("Element '")?..])?;
        let after = |words: &str| message.find(words).and_then(|at| quoted(&message[at..]));
        if let Some(word) = after("unrecognized attribute") {
            return Some(Self { element, keyword: Some(word), is_value: false });
        }
        if let Some(word) = after("invalid keyword") {
            return Some(Self { element, keyword: Some(word), is_value: true });
        }
        message.contains("unrecognized element").then_some(Self { element, keyword: None, is_value: false })
    }

    /// First MuJoCo version with this name, if it is later than 2.2.2; `None` for other and unknown names.
    pub(super) fn introduced_in(&self) -> Option<&'static str> {
        let word = self.keyword.unwrap_or_default();
        let is_it = |(element, known, _): &&(&str, &str, &str)| {
            *known == word && (*element == self.element || *element == "*" && !word.is_empty())
        };
        INTRODUCED_IN.iter().find(is_it).map(|(.., since)| *since)
    }

    /// First position of this name in a file and the files that it includes; `None` if no readable file contains it.
    pub(super) fn find_in(&self, file: &Path) -> Option<SourceLocation> {
        self.search(file, file.parent().unwrap_or(Path::new("")), &mut Vec::new())
    }

    fn search(&self, file: &Path, folder: &Path, seen: &mut Vec<PathBuf>) -> Option<SourceLocation> {
        if seen.iter().any(|known| known == file) {
            return None;
        }
        seen.push(file.to_path_buf());
        let text = input_file::read_referenced_text(file).ok()?;
        let document = roxmltree::Document::parse(&text).ok()?;
        for node in document.descendants().filter(roxmltree::Node::is_element) {
            let has_word = || match self.keyword {
                None => true,
                Some(word) if self.is_value => node.attributes().any(|attribute| attribute.value() == word),
                Some(word) => node.has_attribute(word),
            };
            if node.has_tag_name(self.element) && has_word() {
                let line = document.text_pos_at(node.range().start).row;
                return Some(SourceLocation::new(file, line));
            }
            if let Some(included) = node.attribute("file").filter(|_| node.has_tag_name("include"))
                && let Some(found) = self.search(&folder.join(included), folder, seen)
            {
                return Some(found);
            }
        }
        None
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    #[test]
    fn messages() {
        for (message, element, word, since) in [
            ("unrecognized attribute: 'gravcomp'\n\nElement 'body', line 3", "body", Some("gravcomp"), Some("2.3.1")),
            ("unrecognized attribute: 'sise'\n\nElement 'geom', line 3", "geom", Some("sise"), None),
            ("unrecognized element\n\nElement 'frame', line 3\n", "frame", None, Some("3.1.0")),
            (
                "invalid keyword: 'implicitfast'\nElement 'option', line 2",
                "option",
                Some("implicitfast"),
                Some("2.3.3"),
            ),
            ("unrecognized attribute: 'kv'\n\nElement 'motor', line 0", "motor", Some("kv"), None),
        ] {
            let unknown = UnknownKeyword::from_message(message).unwrap();
            assert_eq!(
                (unknown.element, unknown.keyword, unknown.introduced_in()),
                (element, word, since),
                "{message}"
            );
        }
        assert_eq!(UnknownKeyword::from_message("Error: mass\nObject name = a, id = 1"), None);
    }

    /// Included files are searched too, and a file that includes itself ends the search.
    #[test]
    fn places() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.xml"), "<mujoco>\n<include file=\"a.xml\"/><include file=\"b.xml\"/></mujoco>").unwrap();
        std::fs::write(
            path("b.xml"),
            "<mujoco>\n<default>\n<joint damping='1'/>\n<joint\n actuatorfrcrange='0 1'/></default></mujoco>",
        )
        .unwrap();
        let found =
            |word, is_value| UnknownKeyword { element: "joint", keyword: Some(word), is_value }.find_in(&path("a.xml"));
        assert_eq!(found("actuatorfrcrange", false), Some(SourceLocation::new(path("b.xml"), 4)));
        assert_eq!(found("1", true), Some(SourceLocation::new(path("b.xml"), 3)));
        assert_eq!(found("gravcomp", false), None);
    }
}
