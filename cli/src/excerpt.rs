//! Errors and warnings with an excerpt of the source line.
//!
//! All errors and diagnostics of the library that refer to a file begin with its location: `arm.urdf:12: ...`.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use kinetoscope::robot::diagnostic::Diagnostic;
use std::io::{IsTerminal, Write};
use std::ops::Range;
use std::path::Path;

/// Maximum size of a file that is read for an excerpt \[bytes\].
const MAX_FILE_SIZE: u64 = 64 << 20;

/// Prints an error.
pub(crate) fn print_error(message: &str) {
    print(&render(Level::ERROR, message, None, colored()));
}

/// Prints diagnostics as warnings. Returns true if there were any.
pub(crate) fn print_warnings(diagnostics: &[Diagnostic]) -> bool {
    let mut any = false;
    for diagnostic in diagnostics {
        let place = diagnostic.source.as_ref().map(|at| format!("{at}: ")).unwrap_or_default();
        let message = format!("{place}{}", diagnostic.message);
        print(&render(Level::WARNING, &message, Some(diagnostic.kind.name()), colored()));
        any = true;
    }
    any
}

fn print(text: &str) {
    // A closed standard error stream is not an error.
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

fn colored() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// Renders a message with an excerpt of its source line, if the line can be read.
fn render(level: Level<'_>, message: &str, kind: Option<&'static str>, colored: bool) -> String {
    let place = parse_location(message);
    let said = place.as_ref().map_or(message, |place| &message[place.prefix_length..]);
    let renderer = if colored { Renderer::styled() } else { Renderer::plain() };
    let mut title = level.primary_title(said);
    if let Some(kind) = kind {
        title = title.id(kind);
    }
    let Some(SourceLocation { path, line, text, .. }) = &place else {
        return renderer.render(&[Group::with_title(title)]);
    };
    let marked = AnnotationKind::Primary.span(marked_range(text, said));
    let snippet = Snippet::source(text.as_str()).line_start(*line).path(*path).annotation(marked);
    renderer.render(&[title.element(snippet)])
}

/// Source location at the beginning of a message.
struct SourceLocation<'m> {
    path: &'m str,
    line: usize,
    /// The line, with spaces for tabs.
    text: String,
    /// Length of the location prefix in the message \[bytes\].
    prefix_length: usize,
}

/// Parses the location prefix `FILE:LINE: ` of a message. Returns `None` if the file or the line does not exist, or if
/// the file is larger than [`MAX_FILE_SIZE`].
fn parse_location(message: &str) -> Option<SourceLocation<'_>> {
    // A path may contain colons.
    let ends = message.match_indices(": ").map(|(at, _)| at);
    ends.take(8).find_map(|end| {
        let (path, line) = message[..end].rsplit_once(':')?;
        let line: usize = line.parse().ok().filter(|&line| line > 0)?;
        let file = Path::new(path);
        std::fs::metadata(file).ok().filter(|about| about.is_file() && about.len() <= MAX_FILE_SIZE)?;
        let bytes = std::fs::read(file).ok()?;
        let text =
            String::from_utf8_lossy(bytes.split(|&b| b == b'\n').nth(line - 1)?).trim_end().replace('\t', "    ");
        Some(SourceLocation { path, line, text, prefix_length: end + 2 })
    })
}

/// Returns the range of a line to underline: the first quoted text of the message that occurs in the line, else the
/// whole line without indentation. MuJoCo quotes with single quotation marks. Several occurrences are ranked: the value
/// of an attribute named by the message, then a whole value, then the first occurrence.
fn marked_range(text: &str, message: &str) -> Range<usize> {
    let of = |mark: char| message.split(mark).skip(1).step_by(2).filter(|quoted| !quoted.trim().is_empty());
    let mut quoted = of('"').chain(of('\''));
    let words = |word: &str| message.split(|c: char| !c.is_alphanumeric() && c != '_').any(|said| said == word);
    let likely = |quoted: &str, at: usize| {
        let before = text[..at].strip_suffix(['"', '\'']);
        let whole = before.is_some() && text[at + quoted.len()..].starts_with(['"', '\'']);
        let attribute = before.and_then(|before| before.trim_end().strip_suffix('=')).map(str::trim_end);
        let named = attribute.and_then(|before| before.rsplit(char::is_whitespace).next()).is_some_and(words);
        (named, whole)
    };
    let found = quoted.find_map(|quoted| {
        // `max_by_key` returns the last maximum, so reverse iteration gives the first occurrence.
        let places = text.rmatch_indices(quoted).map(|(at, _)| at);
        places.max_by_key(|&at| likely(quoted, at)).map(|at| at..at + quoted.len())
    });
    found.unwrap_or_else(|| text.len() - text.trim_start().len()..text.len())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    /// The line is shown, and the part that the message quotes is underlined, or else the whole line.
    #[test]
    fn excerpts() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, content: &[u8]| {
            let path = folder.path().join(name);
            std::fs::write(&path, content).unwrap();
            path.to_str().unwrap().to_owned()
        };
        let path = file("a:b.urdf", b"<robot>\n\t<joint name=\"hip\" type=\"rotary\"/>\n  <robot/>  \n");
        for (level, kind, line, message, title, under) in [
            (Level::ERROR, None, 2, "joint type \"rotary\" is unknown: x", "error: ", "rotary"),
            (Level::WARNING, Some("empty"), 3, "no links", "warning[empty]: ", "<robot/>"),
        ] {
            let text = render(level, &format!("{path}:{line}: {message}"), kind, false);
            let lines: Vec<&str> = text.lines().collect();
            assert_eq!(lines[0], format!("{title}{message}"));
            assert!(lines[1].contains(&format!("{path}:{line}:")), "{text}");
            let at = lines.iter().position(|shown| shown.starts_with(&format!("{line} |"))).unwrap();
            assert_eq!(lines[at + 1].find('^'), lines[at].find(under), "{text}");
            assert_eq!(text.matches('^').count(), under.len(), "{text}");
        }
        // A location that does not exist stays in the message.
        for message in
            [format!("{path}:9: too far"), "gone.urdf:1: gone".into(), "no place: 1: 2".into(), String::new()]
        {
            assert_eq!(render(Level::ERROR, &message, None, false).trim_end(), format!("error: {message}").trim_end());
        }
        // Lines with arbitrary bytes are shown.
        let path = file("x.urdf", b"\xff\xfe \"\xc3\xa4\"\r\n\n");
        for line in [1, 2, 3] {
            let message = format!("{path}:{line}: \"\u{e4}\" is wrong");
            assert!(render(Level::ERROR, &message, None, false).starts_with("error: "));
        }
    }

    /// Of several equal words, the relevant one is underlined.
    #[test]
    fn underlined_word() {
        let (arms, zeros) = ("<joint name=\"arm\" parent=\"arm\"/>", "<box size=\"0.5 0 0.25\" rgba=\"0\"/>");
        let mujoco = "robot \"arm\": MuJoCo rejected the model: unrecognized attribute: 'sise'; Element 'geom', line 3";
        for (line, message, before) in [
            ("  <geom type=\"box\" sise=\"1\"/>", mujoco, "  <geom type=\"box\" "),
            (arms, "joint \"arm\": no link", "<joint name=\""),
            (arms, "parent \"arm\" is no link", "<joint name=\"arm\" parent=\""),
            // A whole value, not a digit of another.
            (zeros, "\"0\" is no color", "<box size=\"0.5 0 0.25\" rgba=\""),
            ("<a b='0.5'/>", "\"5\": x", "<a b='0."),
        ] {
            let marked = marked_range(line, message);
            assert_eq!(&line[..marked.start], before, "{message}");
            assert!(message.contains(&line[marked]), "{message}");
        }
    }
}
