//! Errors and warnings with the line of the user's file that they are about.
//!
//! A message that has a place begins with it, `arm.urdf:12: ...`: a rule of all errors and diagnostics of the library.

use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use kinetoscope::sim::Diagnostic;
use std::io::{IsTerminal, Write};
use std::ops::Range;
use std::path::Path;

/// Larger files are not read for the sake of a line.
const LARGEST: u64 = 64 << 20;

/// Prints an error.
pub(crate) fn print_error(message: &str) {
    print(&render(Level::ERROR, message, None, colored()));
}

/// Prints diagnostics as warnings; whether there were any.
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
    // Nobody to read it is no error of ours.
    let _ = writeln!(std::io::stderr().lock(), "{text}");
}

fn colored() -> bool {
    std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none_or(|value| value.is_empty())
}

/// A message, and the line it is about where there is one that can be read.
fn render(level: Level<'_>, message: &str, kind: Option<&'static str>, colored: bool) -> String {
    let place = place(message);
    let said = place.as_ref().map_or(message, |place| &message[place.length..]);
    let renderer = if colored { Renderer::styled() } else { Renderer::plain() };
    let mut title = level.primary_title(said);
    if let Some(kind) = kind {
        title = title.id(kind);
    }
    let Some(Place { path, line, text, .. }) = &place else { return renderer.render(&[Group::with_title(title)]) };
    let marked = AnnotationKind::Primary.span(marked(text, said));
    let snippet = Snippet::source(text.as_str()).line_start(*line).path(*path).annotation(marked);
    renderer.render(&[title.element(snippet)])
}

/// A place that a message begins with.
struct Place<'m> {
    path: &'m str,
    line: usize,
    /// The line itself.
    text: String,
    /// Of the beginning of the message that says it \[bytes\].
    length: usize,
}

/// The place that a message begins with: `FILE:LINE: `, where the file is there and has such a line.
fn place(message: &str) -> Option<Place<'_>> {
    // A path may have colons of its own.
    let ends = message.match_indices(": ").map(|(at, _)| at);
    ends.take(8).find_map(|end| {
        let (path, line) = message[..end].rsplit_once(':')?;
        let line: usize = line.parse().ok().filter(|&line| line > 0)?;
        let file = Path::new(path);
        std::fs::metadata(file).ok().filter(|about| about.is_file() && about.len() <= LARGEST)?;
        let bytes = std::fs::read(file).ok()?;
        let text =
            String::from_utf8_lossy(bytes.split(|&b| b == b'\n').nth(line - 1)?).trim_end().replace('\t', "    ");
        Some(Place { path, line, text, length: end + 2 })
    })
}

/// What of a line is meant: the first thing that the message quotes and that stands there, else all that is written. MuJoCo
/// quotes with single marks. Where it stands there more than once, as the value of an attribute that the message names, else as
/// a whole value, else first.
fn marked(text: &str, message: &str) -> Range<usize> {
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
        // Of equals the last is the largest: from behind, that is the first.
        let places = text.rmatch_indices(quoted).map(|(at, _)| at);
        places.max_by_key(|&at| likely(quoted, at)).map(|at| at..at + quoted.len())
    });
    found.unwrap_or_else(|| text.len() - text.trim_start().len()..text.len())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
mod tests {
    use super::*;

    fn file(content: &str) -> (tempfile::TempDir, String) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a:b.urdf");
        std::fs::write(&path, content).unwrap();
        let path = path.to_str().unwrap().to_owned();
        (folder, path)
    }

    #[test]
    fn the_line_is_shown_and_what_is_quoted_is_underlined() {
        let (_folder, path) = file("<robot>\n\t<joint name=\"hip\" type=\"rotary\"/>\n</robot>\n");
        let text = render(Level::ERROR, &format!("{path}:2: joint type \"rotary\" is unknown: x"), None, false);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines[0], "error: joint type \"rotary\" is unknown: x");
        assert!(lines[1].contains(&format!("{path}:2:")), "{text}");
        let line = lines.iter().position(|line| line.contains("<joint")).unwrap();
        assert!(lines[line].starts_with("2 |"), "{text}");
        let under = lines[line + 1];
        assert_eq!(under.find('^'), lines[line].find("rotary"), "{text}");
        assert_eq!(under.matches('^').count(), "rotary".len(), "{text}");
    }

    #[test]
    fn what_mujoco_quotes_is_underlined() {
        let line = "  <geom type=\"box\" sise=\"1\"/>";
        let said = "robot \"arm\": MuJoCo refuses the model: unrecognized attribute: 'sise'; Element 'geom', line 3";
        assert_eq!(&line[marked(line, said)], "sise");
    }

    #[test]
    fn of_equal_words_the_one_that_is_meant_is_underlined() {
        let at = |line: &str, message: &str| marked(line, message).start;
        let line = "<joint name=\"arm\" parent=\"arm\"/>";
        assert_eq!(at(line, "joint \"arm\": no link"), line.find("arm").unwrap());
        assert_eq!(at(line, "parent \"arm\" is no link"), line.rfind("arm").unwrap());
        let line = "<box size=\"0.5 0 0.25\" rgba=\"0\"/>";
        assert_eq!(at(line, "\"0\" is no colour"), line.rfind('0').unwrap(), "a whole value, not a digit of another");
        assert_eq!(at("<a b='0.5'/>", "\"5\": x"), "<a b='0.".len());
    }

    #[test]
    fn without_a_quoted_word_the_whole_line_is_underlined() {
        let (_folder, path) = file("  <robot/>  \n");
        let text = render(Level::WARNING, &format!("{path}:1: no links"), Some("empty"), false);
        assert!(text.starts_with("warning[empty]: no links"), "{text}");
        assert_eq!(text.matches('^').count(), "<robot/>".len(), "{text}");
    }

    #[test]
    fn a_place_that_is_not_there_stays_in_the_message() {
        let (_folder, path) = file("<robot/>\n");
        for message in
            [format!("{path}:9: too far"), "gone.urdf:1: gone".into(), "no place: 1: 2".into(), String::new()]
        {
            assert_eq!(render(Level::ERROR, &message, None, false).trim_end(), format!("error: {message}").trim_end());
        }
    }

    #[test]
    fn lines_of_any_bytes_are_shown() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.urdf");
        std::fs::write(&path, b"\xff\xfe \"\xc3\xa4\"\r\n\n").unwrap();
        for line in [1, 2, 3] {
            let message = format!("{}:{line}: \"\u{e4}\" is wrong", path.display());
            assert!(render(Level::ERROR, &message, None, false).starts_with("error: "));
        }
    }
}
