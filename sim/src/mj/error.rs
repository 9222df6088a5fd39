//! What MuJoCo can say no to.

use crate::source::Source;

/// MuJoCo's engine stopped a call (`mju_error`). The data it was called on is to be reset or dropped.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("MuJoCo stopped: {message}")]
pub struct EngineError {
    /// MuJoCo's own words.
    pub message: String,
}

impl EngineError {
    /// More memory would help.
    pub(crate) fn is_out_of_memory(&self) -> bool {
        let text = self.message.to_ascii_lowercase();
        ["stack", "arena", "memory"].iter().any(|word| text.contains(word))
    }
}

/// MuJoCo refused a model.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub struct CompileError {
    /// MuJoCo's own words.
    pub message: String,
    /// Line of the MJCF that MuJoCo names, counted from 1.
    pub line: Option<u32>,
    /// Where that line comes from: the element of the user's file.
    pub source_line: Option<Source>,
}

impl CompileError {
    pub(crate) fn new(message: &str) -> Self {
        Self { line: line_named_in(message), message: message.trim().replace('\n', "; "), source_line: None }
    }
}

impl std::fmt::Display for CompileError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if let Some(source) = &self.source_line {
            write!(f, "{source}: ")?;
        }
        write!(f, "MuJoCo refuses the model: {}", self.message)
    }
}

/// MuJoCo writes `line 12`, `line = 12` (2.2.2 and 4.x, parser and compiler).
fn line_named_in(message: &str) -> Option<u32> {
    let after = &message[message.rfind("line")? + 4..];
    let digits: String = after.trim_start_matches([' ', '=', ':']).chars().take_while(char::is_ascii_digit).collect();
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_line_is_found_in_all_of_mujocos_phrasings() {
        assert_eq!(line_named_in("XML Error: bad\nElement 'geom', line 7\n"), Some(7));
        assert_eq!(line_named_in("Error: mass\nObject name = a, id = 1, line = 12, column = 4"), Some(12));
        assert_eq!(line_named_in("Error: something else"), None);
    }
}
