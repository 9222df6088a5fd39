//! Limits of numbers in MJCF, checked before MuJoCo reads them.
//!
//! MuJoCo's loader has no limits of its own: with huge lengths or infinite positions it may not end, because it simulates
//! muscles to find the range of their lengths, and sizes whose product exceeds 32 bits overflow.

use super::error::CompileError;
use kinetoscope_scene::input_file;
use kinetoscope_scene::source_location::SourceLocation;
use std::path::{Path, PathBuf};

/// Largest length, position and factor \[m\]: eight times the diameter of the Earth.
const LARGEST_LENGTH: f64 = 1e8;

/// Most copies of an element by `<replicate>`, `<composite>` and `<flexcomp>`, nested elements included. The time of 2.2.2 grows
/// with their square, to 8 s.
const MOST_COPIES: f64 = 10_000.0;

/// Most cells of a height field, and most pixels of an image of a texture. MuJoCo counts bytes in 32 bits: a cube has 6 images of
/// 3 bytes per pixel.
const MOST_CELLS: f64 = 1e8;

/// Attributes with positions, lengths, axes and orientations.
const GEOMETRY: [&str; 14] = [
    "anchor",
    "axis",
    "axisangle",
    "euler",
    "fromto",
    "pos",
    "quat",
    "refpos",
    "refquat",
    "scale",
    "size",
    "vertex",
    "xyaxes",
    "zaxis",
];

/// Elements that make copies, as many as the product of their `count`.
const COPYING: [&str; 3] = ["composite", "flexcomp", "replicate"];

/// Checks the numbers of MJCF text.
///
/// # Errors
/// A number is not finite or exceeds its limit. The error has the line.
pub(super) fn check_text(text: &str) -> Result<(), CompileError> {
    // MuJoCo reports text that is not XML.
    let Ok(document) = roxmltree::Document::parse(text) else { return Ok(()) };
    match document.descendants().find_map(|node| Some((node, fault(node)?))) {
        Some((node, message)) => Err(error(&document, node, message)),
        None => Ok(()),
    }
}

/// Checks the numbers of an MJCF file and of the files that it includes.
///
/// # Errors
/// As [`check_text`]. The error has the file and the line.
pub(super) fn check_file(file: &Path) -> Result<(), CompileError> {
    let folder = file.parent().unwrap_or(Path::new(""));
    let (mut seen, mut open) = (Vec::new(), vec![file.to_path_buf()]);
    while let Some(file) = open.pop() {
        if seen.contains(&file) {
            continue;
        }
        // MuJoCo reports files that it cannot read.
        if let Ok(text) = input_file::read_referenced_text(&file) {
            check_text(&text).map_err(|error| {
                let source_location = error.line.map(|line| SourceLocation::new(&file, line));
                CompileError { source_location, ..error }
            })?;
            open.extend(included(&text).into_iter().map(|name| folder.join(name)));
        }
        seen.push(file);
    }
    Ok(())
}

/// Names of the files that MJCF text includes.
fn included(text: &str) -> Vec<PathBuf> {
    let Ok(document) = roxmltree::Document::parse(text) else { return Vec::new() };
    let includes = document.descendants().filter(|node| node.has_tag_name("include"));
    includes.filter_map(|node| node.attribute("file")).map(PathBuf::from).collect()
}

fn error(document: &roxmltree::Document<'_>, node: roxmltree::Node<'_, '_>, message: String) -> CompileError {
    let line = document.text_pos_at(node.range().start).row;
    CompileError { message, line: Some(line), source_location: None }
}

/// Returns a message about a number of the element that exceeds its limit; `None` if all are within.
fn fault(node: roxmltree::Node<'_, '_>) -> Option<String> {
    let element = node.tag_name().name();
    let geometry = node.attributes().filter(|attribute| GEOMETRY.contains(&attribute.name()));
    for attribute in geometry {
        if let Some(word) =
            words(attribute.value()).find(|(_, number)| number.is_nan() || number.abs() > LARGEST_LENGTH)
        {
            let (name, word) = (attribute.name(), word.0);
            return Some(format!("`{name}` of <{element}> has {word}: it must be a number from -1e8 to 1e8"));
        }
    }
    let copies = copies(node);
    if COPYING.contains(&element) && copies > MOST_COPIES {
        return Some(format!("<{element}> makes {copies} copies: it must be at most {MOST_COPIES}"));
    }
    let cells = match element {
        "hfield" => product(node, ["nrow", "ncol"]),
        // The images of a cube, the default, are squares: MuJoCo ignores their height.
        "texture" if node.attribute("type") != Some("2d") => product(node, ["width", "width"]),
        "texture" => product(node, ["width", "height"]),
        _ => 0.0,
    };
    (cells > MOST_CELLS).then(|| format!("<{element}> has {cells} cells: it must be at most {MOST_CELLS:e}"))
}

/// Number of copies of the content of an element: the product of the counts of the element and of its parents.
fn copies(node: roxmltree::Node<'_, '_>) -> f64 {
    let copying = node.ancestors().filter(|parent| COPYING.contains(&parent.tag_name().name()));
    let counts = copying.filter_map(|parent| parent.attribute("count"));
    counts.flat_map(words).map(|(_, count)| count.max(1.0)).product()
}

/// Product of two attributes; one of them without a number counts as 1.
fn product(node: roxmltree::Node<'_, '_>, names: [&str; 2]) -> f64 {
    let numbers = names.iter().filter_map(|name| node.attribute(*name)).flat_map(words);
    numbers.map(|(_, number)| number.max(1.0)).product()
}

/// The numbers of an attribute, each with its text. MuJoCo reports text that is not a number.
fn words(value: &str) -> impl Iterator<Item = (&str, f64)> {
    value.split_ascii_whitespace().filter_map(|word| Some((word, word.parse().ok()?)))
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;
    use crate::{LoadError, compile_file, compile_text};

    /// Root cause: MuJoCo's loader got these numbers.
    #[test]
    fn refused() {
        for (element, expected) in [
            (
                "<body><geom type='ellipsoid' size='0.05 1e12 0.02' fluidshape='ellipsoid'/></body>",
                "`size` of <geom> has 1e12: it must be a number from -1e8 to 1e8",
            ),
            ("<body pos='0 inf 0'/>", "`pos` of <body> has inf"),
            ("<site pos='0 0 nan'/>", "`pos` of <site> has nan"),
            ("<camera pos='-1e26 0 0'/>", "`pos` of <camera> has -1e26"),
            ("<geom type='capsule' fromto='0 0 0 0 0 2e8' size='.1'/>", "`fromto` of <geom> has 2e8"),
            ("<body euler='infinity 0 0'/>", "`euler` of <body> has infinity"),
            ("<body><composite type='grid' count='200 101 1'/></body>", "<composite> makes 20200 copies"),
            (
                "<replicate count='300'><replicate count='100'><geom size='1'/></replicate></replicate>",
                "<replicate> makes 30000 copies: it must be at most 10000",
            ),
        ] {
            let text = format!("<mujoco>\n<worldbody>\n{element}</worldbody></mujoco>");
            let Err(LoadError::Compile(error)) = compile_text(&text) else { panic!("accepted: {element}") };
            assert!(error.message.starts_with(expected), "{element}: {error}");
            assert_eq!(error.line, Some(3), "{element}");
        }
        for (asset, cells) in [
            ("<texture type='2d' builtin='flat' width='40000' height='40000'/>", "<texture> has 1600000000 cells"),
            (
                "<texture type='skybox' builtin='gradient' width='100000' height='1'/>",
                "<texture> has 10000000000 cells",
            ),
            ("<hfield name='h' size='1 1 1 1' nrow='100000' ncol='100000'/>", "<hfield> has 10000000000 cells"),
        ] {
            let text = format!("<mujoco><asset>{asset}</asset></mujoco>");
            let Err(LoadError::Compile(error)) = compile_text(&text) else { panic!("accepted: {asset}") };
            assert_eq!(error.message, format!("{cells}: it must be at most 1e8"));
        }
    }

    /// MuJoCo 2.2.2 looks for the range of the muscle's length without end.
    #[test]
    fn endless_search() {
        let text = "<mujoco><worldbody><site name='a' pos='1 0 1'/><body><joint axis='0 1 0' limited='true' range='-90 90'/>\
                    <geom size='.1'/><site name='b' pos='inf 0 0'/></body></worldbody><tendon><spatial name='t'>\
                    <site site='a'/><site site='b'/></spatial></tendon><actuator><muscle tendon='t'/></actuator></mujoco>";
        let Err(LoadError::Compile(error)) = compile_text(text) else { panic!("accepted") };
        assert!(error.message.starts_with("`pos` of <site> has inf"), "{error}");
        compile_text(&text.replace("inf", "0.2")).unwrap();
    }

    /// Numbers at the limits, and large numbers that are not lengths.
    #[test]
    fn accepted() {
        let text = "<mujoco><worldbody><geom type='plane' size='1e8 0 1' pos='0 0 -1e8'/><body><joint type='hinge' \
                    stiffness='1e9' limited='true' range='-1e10 1e10'/><geom size='1' contype='2147483647'/></body></worldbody></mujoco>";
        compile_text(text).unwrap();
    }

    /// Included files are checked too; a file that includes itself does not end in a loop here.
    #[test]
    fn included_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("a.xml"), "<mujoco>\n<include file=\"a.xml\"/><include file=\"b.xml\"/></mujoco>").unwrap();
        std::fs::write(path("b.xml"), "<mujoco>\n<worldbody>\n<body pos='1e9 0 0'/></worldbody></mujoco>").unwrap();
        let Err(LoadError::Compile(error)) = compile_file(path("a.xml")) else { panic!("accepted") };
        assert_eq!(error.source_location, Some(SourceLocation::new(path("b.xml"), 3)));
        assert!(error.message.starts_with("`pos` of <body> has 1e9"), "{error}");
    }
}
