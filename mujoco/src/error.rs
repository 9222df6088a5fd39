//! Errors of MuJoCo.

use super::unknown_keyword::UnknownKeyword;
use super::version::{BUILD_VERSION, SupportedVersion, version_string};
use kinetoscope_scene::source_location::SourceLocation;

/// Error of an engine call (`mju_error`). The data of the call must be reset or dropped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("MuJoCo stopped: {message}")]
pub struct EngineError {
    /// MuJoCo's message.
    pub message: String,
}

impl EngineError {
    /// True if MuJoCo's message mentions the stack, the arena or memory, so that larger buffers may help.
    pub fn is_out_of_memory(&self) -> bool {
        let text = self.message.to_ascii_lowercase();
        ["stack", "arena", "memory"].iter().any(|word| text.contains(word))
    }
}

/// Compilation error: MuJoCo rejected the model, or an asset has an invalid name or content.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct CompileError {
    /// MuJoCo's message on one line. On 2.2.2, a hint about newer versions follows for an unknown keyword.
    pub message: String,
    /// Line of the MJCF that MuJoCo's message names, from 1; `None` if the message names no line.
    pub line: Option<u32>,
    /// Location of the rejected element in the user's file; `None` if unknown.
    pub source_location: Option<SourceLocation>,
}

impl CompileError {
    pub(crate) fn new(message: &str) -> Self {
        // 2.2.2 ends lines with a semicolon and inserts empty lines.
        let lines =
            message.lines().map(|line| line.trim().trim_end_matches(';').trim()).filter(|line| !line.is_empty());
        let lines: Vec<&str> = lines.collect();
        Self {
            line: parse_line_number(message),
            message: lines.join("; ") + &newer_version_hint(message),
            source_location: None,
        }
    }

    /// Returns the error with the position of the name that MuJoCo does not support, in `file` or a file that it
    /// includes. If MuJoCo names a line and `file` includes nothing, the error stays unchanged.
    pub(crate) fn with_location_in(self, file: &std::path::Path) -> Self {
        // MuJoCo does not say whether a line belongs to the file itself or to an included file.
        if self.line.is_some() && !includes(file) {
            return self;
        }
        let source_line = UnknownKeyword::from_message(&self.message).and_then(|unknown| unknown.find_in(file));
        Self { source_location: source_line.or(self.source_location.clone()), ..self }
    }
}

impl std::fmt::Display for CompileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(source) = &self.source_location {
            write!(f, "{source}: ")?;
        }
        write!(f, "MuJoCo rejected the model: {}", self.message)
    }
}

fn includes(file: &std::path::Path) -> bool {
    std::fs::read_to_string(file).is_ok_and(|text| text.contains("<include"))
}

/// Hint for a name that 2.2.2 does not support: a newer MuJoCo may support it. Empty on 4.x and for other messages.
fn newer_version_hint(message: &str) -> String {
    if BUILD_VERSION != SupportedVersion::V2 {
        return String::new();
    }
    let Some(unknown) = UnknownKeyword::from_message(message) else { return String::new() };
    let version = version_string();
    match unknown.introduced_in() {
        Some(since) => format!(
            ". This keyword needs MuJoCo {since} or newer, but this program was built for {version}: build it with \
             MUJOCO_DIR set to the folder of MuJoCo 4"
        ),
        None => format!(
            ". If the keyword is correct, the file needs a newer MuJoCo than {version}, for which this program was \
             built: build it with MUJOCO_DIR set to the folder of MuJoCo 4"
        ),
    }
}

/// Line number in a message; `None` without one. MuJoCo writes `line 12` or `line = 12` (2.2.2 and 4.x, reader and
/// compiler). For text that is not XML, the parser writes `Line number=12`.
fn parse_line_number(message: &str) -> Option<u32> {
    let number_after = |word: &str| {
        let after = &message[message.rfind(word)? + word.len()..];
        let after = after.trim_start_matches([' ', '=', ':']);
        let digits = after.find(|c: char| !c.is_ascii_digit()).map_or(after, |end| &after[..end]);
        // Line 0 means that MuJoCo names no line.
        digits.parse().ok().filter(|&line: &u32| line > 0)
    };
    ["line", "Line number"].into_iter().find_map(number_after)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines() {
        assert_eq!(parse_line_number("XML Error: bad\nElement 'geom', line 7\n"), Some(7));
        assert_eq!(parse_line_number("Error: mass\nObject name = a, id = 1, line = 12, column = 4"), Some(12));
        let broken = "XML parse error 6:\nError=XML_ERROR_PARSING_ELEMENT ErrorID=6 (0x6) Line number=12\n";
        assert_eq!(parse_line_number(broken), Some(12));
        let mismatched = "Error=XML_ERROR_MISMATCHED_ELEMENT ErrorID=14 (0xe) Line number=3: XMLElement name=outline";
        assert_eq!(parse_line_number(mismatched), Some(3));
        assert_eq!(parse_line_number("Error: something else"), None);
        assert_eq!(parse_line_number("Element 'joint', line 0\n"), None);
    }

    /// Regression test: messages of 2.2.2 were shown as `...'actuatorfrcrange'; ; Element 'joint', line 77`.
    #[test]
    fn one_line() {
        let error = CompileError::new("XML Error: Schema violation: 'a'\n\nElement 'joint', line 77\n");
        assert_eq!(error.message, "XML Error: Schema violation: 'a'; Element 'joint', line 77");
        assert_eq!(CompileError::new("a;\n;\n b;").message, "a; b");
        assert_eq!(CompileError::new("").message, "");
    }
}
