//! YAML parser of calibration files.

use super::CalibrationError;
use kinetoscope_scene::yaml::{self, Node, YamlFeatures};

const DIALECT: YamlFeatures = YamlFeatures { files: "calibration files", aliases: false, tags: true };

/// Returns true if a scalar means null.
pub(super) fn is_null(text: &str) -> bool {
    ["", "~", "null"].contains(&text)
}

/// Removes the byte order mark, and replaces tabs between a key and its value by spaces. YAML allows both, but the
/// parser rejects them. Lines and columns stay the same.
fn normalize_whitespace(text: &str) -> String {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let spaced = |line: &str| {
        let rest = line.trim_start_matches(' ').trim_start_matches(|c: char| c.is_ascii_alphanumeric() || c == '_');
        let value = rest.strip_prefix(':')?;
        let blanks = value.len() - value.trim_start_matches([' ', '\t']).len();
        let (key, value) = line.split_at(line.len() - value.len());
        Some(format!("{key}{}{}", " ".repeat(blanks), &value[blanks..]))
    };
    text.split_inclusive('\n').map(|line| spaced(line).unwrap_or_else(|| line.into())).collect()
}

/// Parses a text with a single document.
pub(super) fn parse(text: &str, file: &str) -> Result<Node, CalibrationError> {
    let wrong = |line, column, message: String| CalibrationError::Yaml { file: file.into(), line, column, message };
    let root = yaml::parse(&normalize_whitespace(text), &DIALECT).map_err(|e| wrong(e.line, e.column, e.message))?;
    root.ok_or_else(|| wrong(1, 1, "the file is empty".into()))
}
