//! YAML as a tree that knows its lines: what calibration files use of it.

use super::CalibrationError;
use saphyr_parser::{Event, Parser, Span};

/// Lists and tables within each other, at most.
const DEPTH: usize = 32;

/// A value and where it begins; in a table, where its key is.
#[derive(Clone, Debug)]
pub(super) struct Node {
    pub(super) line: usize,
    pub(super) value: Value,
}

#[derive(Clone, Debug)]
pub(super) enum Value {
    Scalar(String),
    List(Vec<Node>),
    /// In the order of the file.
    Table(Vec<(String, Node)>),
}

impl Value {
    /// What it is, for errors.
    pub(super) fn kind(&self) -> String {
        match self {
            Self::Scalar(text) => format!("{text:?}"),
            Self::List(list) => format!("a list of {}", list.len()),
            Self::Table(_) => "a table".into(),
        }
    }
}

/// Something that is not complete yet; a table may have a key that waits for its value.
#[derive(Debug)]
enum Open {
    List(usize, Vec<Node>),
    Table(usize, Vec<(String, Node)>, Option<(String, usize)>),
}

/// Whether a word means that there is none.
pub(super) fn is_nothing(text: &str) -> bool {
    ["", "~", "null"].contains(&text)
}

/// A text without byte order mark, and with spaces where tabs stand between a key and its value: YAML allows both, the parser
/// neither. Lines and columns stay.
fn readable(text: &str) -> String {
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

/// The only document of a text.
pub(super) fn parse(text: &str, file: &str) -> Result<Node, CalibrationError> {
    let wrong = |line: usize, column: usize, message: String| CalibrationError::Yaml {
        file: file.into(),
        line,
        column: column + 1,
        message,
    };
    let at = |span: &Span, message: &str| wrong(span.start.line(), span.start.col(), message.into());
    let text = readable(text);
    let mut parser = Parser::new_from_str(&text);
    let (mut open, mut root): (Vec<Open>, Option<Node>) = (Vec::new(), None);
    while let Some(event) = parser.next_event() {
        let (event, span) = event.map_err(|e| wrong(e.marker().line(), e.marker().col(), e.info().into()))?;
        let line = span.start.line();
        let done = match event {
            Event::Scalar(text, ..) => Node { line, value: Value::Scalar(text.into_owned()) },
            Event::SequenceStart(..) | Event::MappingStart(..) if open.len() == DEPTH => {
                return Err(at(&span, "lists and tables are too deep within each other"));
            }
            Event::SequenceStart(..) => {
                open.push(Open::List(line, Vec::new()));
                continue;
            }
            Event::MappingStart(..) => {
                open.push(Open::Table(line, Vec::new(), None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => match open.pop() {
                Some(Open::List(line, list)) => Node { line, value: Value::List(list) },
                Some(Open::Table(line, table, _)) => Node { line, value: Value::Table(table) },
                None => return Err(at(&span, "something ends that did not begin")),
            },
            Event::Alias(_) => return Err(at(&span, "aliases are not for calibration files")),
            Event::DocumentStart(_) if root.is_some() => return Err(at(&span, "a second document begins")),
            _ => continue,
        };
        match open.last_mut() {
            None => root = Some(done),
            Some(Open::List(_, list)) => list.push(done),
            Some(Open::Table(_, table, key)) => match (key.take(), done.value) {
                (None, Value::Scalar(text)) => {
                    if table.iter().any(|(name, _)| *name == text) {
                        return Err(at(&span, &format!("{text:?} is there twice")));
                    }
                    *key = Some((text, done.line));
                }
                (None, _) => return Err(at(&span, "a key is a word")),
                (Some((name, line)), value) => table.push((name, Node { line, value })),
            },
        }
    }
    root.ok_or_else(|| wrong(1, 0, "the file is empty".into()))
}
