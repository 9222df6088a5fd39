//! Repair of XML text that a namespace-aware parser rejects and other readers of URDF accept.

use crate::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;
use roxmltree::{Document, Error};
use std::borrow::Cow;
use std::ops::Range;
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

/// Replaces commas between the numbers of attributes by blanks, such as in `rgba="1, 0, 0, 1"`, and removes NUL
/// characters at the end of the text. All positions stay.
pub(super) fn blank_commas_and_nuls<'t>(text: &'t str, path: &Path, diagnostics: &mut Vec<Diagnostic>) -> Cow<'t, str> {
    let mut text = text;
    let without_nuls = text.trim_end_matches(|c: char| c == '\0' || c.is_whitespace());
    if text[without_nuls.len()..].contains('\0') {
        let at = SourceLocation::new(path, line_of(text, without_nuls.len()));
        let message = "the file ends with NUL characters; they were ignored";
        diagnostics.push(Diagnostic::new(DiagnosticKind::ElementIgnored, at, message));
        text = without_nuls;
    }
    let mut blanked = Cow::Borrowed(text);
    for value in numbers_with_commas(text) {
        let number_list = &text[value.clone()];
        let message = format!("the commas in \"{number_list}\" were ignored; separate numbers by blanks");
        let at = SourceLocation::new(path, line_of(text, value.start));
        diagnostics.push(Diagnostic::new(DiagnosticKind::CommasIgnored, at, message));
        blanked.to_mut().replace_range(value, &number_list.replace(',', " "));
    }
    blanked
}

/// Byte ranges of attribute values outside of comments that are two or more numbers, some with a comma and white space
/// behind them. A comma without white space behind it may be a decimal comma.
fn numbers_with_commas(text: &str) -> Vec<Range<usize>> {
    let is_number = |word: &str| word.strip_suffix(',').unwrap_or(word).parse::<f64>().is_ok();
    let is_list = |value: &str| {
        value.contains(',') && value.split_whitespace().count() > 1 && value.split_whitespace().all(is_number)
    };
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(start) = text[at..].find('<') {
        at += start;
        if text[at..].starts_with("<!--") {
            let Some(end) = text[at..].find("-->") else { break };
            at += end;
            continue;
        }
        // The quoted values of a tag; the parser reports a tag without an end.
        at += 1;
        while let Some(next) = text[at..].find(['"', '\'', '>']) {
            let quote = char::from(text.as_bytes()[at + next]);
            at += next + 1;
            if quote == '>' {
                break;
            }
            let Some(length) = text[at..].find(quote) else { return found };
            if is_list(&text[at..at + length]) {
                found.push(at..at + length);
            }
            at += length + 1;
        }
    }
    found
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
