//! Warnings about global settings and sensors of a file that the scene does not take over, with their locations in the
//! text.

use super::OmittedElement;
use kinetoscope_mujoco::Model;
use kinetoscope_robot::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::input_file;
use kinetoscope_scene::source_location::{LineStarts, SourceLocation};
use std::path::Path;
use std::sync::Arc;

/// Maximum number of files that are read, the top one included; MuJoCo rejects a file that is included twice.
const MAX_INCLUDED_FILES: usize = 100;

/// Prefix of the element name of a sensor.
const SENSOR: &str = "sensor ";

/// Element at the top of a file, or a sensor.
#[derive(Clone, Debug)]
struct TopLevelElement {
    element: String,
    /// Attributes of the element. Attributes of a nested `<flag>` have that word as prefix.
    attributes: Vec<String>,
    source: SourceLocation,
}

/// Collects the elements at the top of a file and of its included files, and their sensors, in order.
fn collect_top_level(text: &str, file: &Path, folder: &Path, found: &mut Vec<TopLevelElement>, files: &mut usize) {
    *files += 1;
    let Ok(document) = roxmltree::Document::parse(text) else { return };
    let (shared, lines) = (Arc::new(file.to_path_buf()), LineStarts::new(text));
    for node in document.root_element().children().filter(roxmltree::Node::is_element) {
        if node.tag_name().name() == "include" {
            let Some(path) = node.attribute("file").map(|name| folder.join(name)) else { continue };
            if *files < MAX_INCLUDED_FILES
                && let Ok(text) = input_file::read_referenced_text(&path)
            {
                collect_top_level(&text, &path, folder, found, files);
            }
            continue;
        }
        let flags = node.children().filter(|child| child.has_tag_name("flag"));
        let attributes = node.attributes().map(|a| a.name().to_string());
        let attributes =
            attributes.chain(flags.flat_map(|flag| flag.attributes()).map(|a| format!("flag {}", a.name())));
        let source = |node: roxmltree::Node<'_, '_>| {
            let line = lines.line(node.range().start);
            SourceLocation { file: Arc::clone(&shared), line }
        };
        found.push(TopLevelElement {
            element: node.tag_name().name().to_string(),
            attributes: attributes.collect(),
            source: source(node),
        });
        let of_sensors = node.children().filter(|child| child.is_element() && node.has_tag_name("sensor"));
        found.extend(of_sensors.map(|sensor| TopLevelElement {
            element: format!("{SENSOR}{}", sensor.tag_name().name()),
            attributes: Vec::new(),
            source: source(sensor),
        }));
    }
}

/// Warns about everything of a file that the scene does not take over. These are options with other values than in
/// `scene`, visual settings, statistics, custom fields, keyframes, skins, and `sensors_left_out`. `owner` names the
/// part in the messages, such as `MJCF part "arm"`.
pub(crate) fn setting_warnings(
    owner: &str,
    text: &str,
    file: &Path,
    model: &Model,
    scene: &Model,
    sensors_left_out: &[(usize, OmittedElement)],
) -> Vec<Diagnostic> {
    let mut found = Vec::new();
    collect_top_level(text, file, file.parent().unwrap_or(Path::new("")), &mut found, &mut 0);
    let mut diagnostics = Vec::new();
    // Sensors of the model have the order of the file.
    let sensors: Vec<&TopLevelElement> = found.iter().filter(|s| s.element.starts_with(SENSOR)).collect();
    for (index, left_out) in sensors_left_out {
        let at = sensors.get(*index).filter(|_| sensors.len() == model.nsensor()).map(|s| s.source.clone());
        let message = format!("{owner}: {left_out}: not imported; the rest of the file is used");
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, at, message));
    }
    for difference in model.option_differences(scene) {
        let options = found.iter().rev().filter(|s| s.element == "option");
        let at = options.into_iter().find(|s| s.attributes.iter().any(|a| a == difference.name));
        let default = if at.is_some() { "" } else { ", MuJoCo's default" };
        diagnostics.push(Diagnostic::new(
            DiagnosticKind::SettingIgnored,
            at.map(|s| s.source.clone()),
            format!(
                "{owner}: option {} is {}{default}; the scene's value {} is used",
                difference.name, difference.first, difference.second
            ),
        ));
    }
    let left_out = [
        ("visual", "images use the scene's visual settings, unless the scene contains only this file"),
        ("statistic", "MuJoCo computes the statistics of the whole scene"),
        ("custom", "custom fields are not supported in a scene"),
    ];
    for (element, why) in left_out {
        let at = found.iter().find(|s| s.element == element);
        if let Some(stated) = at {
            let message = format!("{owner}: <{element}> is ignored: {why}");
            diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, stated.source.clone(), message));
        }
    }
    let counts = [
        ("keyframe", model.nkey(), "a keyframe holds the state of the file alone, not of the scene"),
        ("skin", model.nskin(), "bodies are rendered with their geoms"),
    ];
    for (element, count, why) in counts {
        if count > 0 {
            let message = format!("{owner}: {count} {element}(s) are ignored: {why}");
            let at = found.iter().find(|s| s.element == element).map(|s| s.source.clone());
            diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, at, message));
        }
    }
    diagnostics
}
