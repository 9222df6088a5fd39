//! Repair of XML text that a namespace-aware parser rejects and other readers of URDF accept.

use crate::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;
use roxmltree::{Document, Error};
use std::path::Path;

/// Maximum number of prefixes that are declared for a file; more are not extensions of URDF.
const MAX_PREFIXES: usize = 32;

/// Removes misplaced XML declarations and binds up to [`MAX_PREFIXES`] undeclared prefixes, without changing line
/// numbers. `error` is the parser's first error.
///
/// # Errors
/// The first remaining error of the parser.
pub(super) fn repair(
    text: &str,
    mut error: Error,
    path: &Path,
    diagnostics: &mut Vec<Diagnostic>,
) -> Result<String, Error> {
    let check = |text: &str| Document::parse(text).err();
    let mut repaired = text.to_owned();
    let mut found = Vec::new();
    let prolog = Prolog::of(text);
    for &(start, end) in &prolog.misplaced {
        // Blanks keep the length, so that the offsets of further declarations stay valid.
        let blank = text[start..end].bytes().map(|b| if b == b'\n' { '\n' } else { ' ' }).collect::<String>();
        repaired.replace_range(start..end, &blank);
        let message = "the XML declaration <?xml ..?> is not at the very beginning of the file; it was ignored";
        let at = SourceLocation::new(path, line_of(text, start));
        found.push(Diagnostic::new(DiagnosticKind::DeclarationMisplaced, at, message));
    }
    if !found.is_empty() {
        let Some(next) = check(&repaired) else {
            diagnostics.append(&mut found);
            return Ok(repaired);
        };
        error = next;
    }
    let Some(insert_at) = prolog.end_of_root_name(&repaired) else { return Err(error) };
    for _ in 0..MAX_PREFIXES {
        let Error::UnknownNamespace(prefix, position) = &error else { break };
        let message = format!(
            "the XML prefix \"{prefix}\" has no namespace declaration; its elements and attributes were ignored \
             (declare it with <robot xmlns:{prefix}=\"http://..\">)"
        );
        found.push(Diagnostic::new(DiagnosticKind::NamespaceUnbound, SourceLocation::new(path, position.row), message));
        repaired.insert_str(insert_at, &format!(" xmlns:{prefix}=\"unbound:{prefix}\""));
        let Some(next) = check(&repaired) else {
            diagnostics.append(&mut found);
            return Ok(repaired);
        };
        error = next;
    }
    // Columns of the line with the insertions differ from those of the file.
    let is_shifted = error.pos().row == line_of(&repaired, insert_at);
    Err(if is_shifted { check(text).unwrap_or(error) } else { error })
}

/// Removes NUL characters at the end of the text.
pub(super) fn trim_nuls<'t>(text: &'t str, path: &Path, diagnostics: &mut Vec<Diagnostic>) -> &'t str {
    let without = text.trim_end_matches(|c: char| c == '\0' || c.is_whitespace());
    if !text[without.len()..].contains('\0') {
        return text;
    }
    let at = SourceLocation::new(path, line_of(text, without.len()));
    let message = "the file ends with NUL characters; they were ignored";
    diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, at, message));
    without
}

/// Text before the root element.
struct Prolog {
    /// Byte ranges of XML declarations that are not at the beginning.
    misplaced: Vec<(usize, usize)>,
    /// Length of the text in bytes.
    end: usize,
}

impl Prolog {
    fn of(text: &str) -> Self {
        let mut prolog = Self { misplaced: Vec::new(), end: 0 };
        loop {
            let rest = text[prolog.end..].trim_start();
            let start = text.len() - rest.len();
            prolog.end = start;
            let closing = if rest.starts_with("<!--") {
                "-->"
            } else if rest.starts_with("<?") {
                "?>"
            } else {
                return prolog;
            };
            let Some(length) = rest.find(closing) else { return prolog };
            prolog.end += length + closing.len();
            let is_declaration = rest.strip_prefix("<?xml").is_some_and(|rest| rest.starts_with(char::is_whitespace));
            if is_declaration && start > 0 {
                prolog.misplaced.push((start, prolog.end));
            }
        }
    }

    /// Finds the end of the name in the first tag; `None` in a text without a tag.
    fn end_of_root_name(&self, text: &str) -> Option<usize> {
        let name = text[self.end..].strip_prefix('<')?;
        let length = name.find(|c: char| c.is_whitespace() || matches!(c, '/' | '>'))?;
        (length > 0 && !name.starts_with('!')).then_some(self.end + 1 + length)
    }
}

/// Line of a byte, counted from 1.
fn line_of(text: &str, at: usize) -> u32 {
    u32::try_from(1 + text[..at].bytes().filter(|&b| b == b'\n').count()).unwrap_or(u32::MAX)
}
