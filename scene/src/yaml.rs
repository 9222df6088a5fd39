//! YAML parser for calibration and scene files: a tree of values with their lines.

use saphyr_parser::{Event, Parser, ScalarStyle, Tag};
use std::collections::{HashMap, HashSet};
use std::sync::Arc;

/// Largest depth of nested lists and tables.
const MAX_DEPTH: usize = 48;
/// Largest size with all aliases expanded, as a multiple of the text. Aliases of aliases grow exponentially.
const MAX_EXPANSION: usize = 64;
/// Smallest and largest value of that limit \[bytes\].
const EXPANSION_LIMITS: [usize; 2] = [1 << 20, 64 << 20];
/// Size that a value counts for in addition to its text \[bytes\]. In memory it takes about three times as much.
const VALUE_BYTES: usize = 32;

/// Features that a kind of YAML file may use.
#[derive(Clone, Copy, Debug)]
pub struct YamlFeatures {
    /// Name of these files in errors.
    pub files: &'static str,
    /// True if aliases are accepted. Otherwise they are errors.
    pub aliases: bool,
    /// True if tags are ignored. Otherwise, tags other than `!!str` are errors. `!!str` makes a scalar a text in both
    /// cases.
    pub tags: bool,
}

/// A value with its line; for an entry of a table, the line of its key.
#[derive(Clone, Debug, PartialEq)]
pub struct Node {
    /// Line, counted from 1.
    pub line: usize,
    /// The value.
    pub value: Value,
}

/// A value. Aliases share the value of their anchor.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A value that is neither a list nor a table.
    Scalar(Scalar),
    /// A list.
    List(Arc<[Node]>),
    /// Keys and values, in the order of the file. Keys are unique.
    Table(Arc<[(String, Node)]>),
}

/// A word, a number, or a text.
#[derive(Clone, Debug, PartialEq)]
pub struct Scalar {
    /// Text of the value, without quotes and with escapes resolved.
    pub text: String,
    /// Type by YAML 1.2's core schema.
    pub kind: ScalarKind,
}

/// Types of YAML 1.2's core schema.
#[derive(Clone, Debug, PartialEq)]
pub enum ScalarKind {
    /// An empty value, `~` or `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number in TOML's notation: without superfluous zeros and signs, with a digit on both sides of a point. `1e999`
    /// for a number that is too large for `f64`.
    Number(String),
    /// Any other text, and everything in quotes or with the tag `!!str`.
    Text,
}

/// Error in a file, with its position.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}: {message}")]
pub struct YamlError {
    /// Line, counted from 1.
    pub line: usize,
    /// Column, counted from 1.
    pub column: usize,
    /// Cause.
    pub message: String,
}

impl Value {
    /// Describes the value for errors.
    pub fn describe(&self) -> String {
        match self {
            Self::Scalar(scalar) => format!("{:?}", scalar.text),
            Self::List(list) => format!("a list of {}", list.len()),
            Self::Table(_) => "a table".into(),
        }
    }
}

/// A list or table that is not complete yet.
#[derive(Debug)]
struct OpenNode {
    line: usize,
    content: Content,
    /// Number of the anchor; 0 without an anchor.
    anchor: usize,
    /// Size of the file before this value \[bytes\].
    begin: usize,
}

#[derive(Debug)]
enum Content {
    List(Vec<Node>),
    Table {
        entries: Vec<(String, Node)>,
        names: HashSet<String>,
        /// A key whose value is still missing, and its line.
        key: Option<(String, usize)>,
    },
}

/// Parses the only document of a text; `None` for a text without a value.
///
/// # Errors
/// The text is not YAML, has several documents or duplicate keys, uses aliases or tags that `dialect` rejects, or
/// exceeds this parser's limits of depth (48) and size (with all aliases expanded, 64 times the text, but at least 1 MiB and
/// at most 64 MiB).
pub fn parse(text: &str, dialect: &YamlFeatures) -> Result<Option<Node>, YamlError> {
    let max_size = MAX_EXPANSION.saturating_mul(text.len()).clamp(EXPANSION_LIMITS[0], EXPANSION_LIMITS[1]);
    let mut builder = Builder { dialect, open: Vec::new(), root: None, anchors: HashMap::new(), size: 0, max_size };
    let mut parser = Parser::new_from_str(text);
    while let Some(event) = parser.next_event() {
        let (event, span) = event.map_err(|e| {
            let (line, column) = (e.marker().line().max(1), e.marker().col() + 1);
            YamlError { line, column, message: e.info().into() }
        })?;
        let line = span.start.line().max(1);
        builder.event(event, line).map_err(|message| YamlError { line, column: span.start.col() + 1, message })?;
    }
    Ok(builder.root)
}

#[derive(Debug)]
struct Builder<'a> {
    dialect: &'a YamlFeatures,
    open: Vec<OpenNode>,
    root: Option<Node>,
    /// Values of anchors, and their sizes.
    anchors: HashMap<usize, (Value, usize)>,
    /// Approximate size of the file with all aliases expanded \[bytes\].
    size: usize,
    max_size: usize,
}

impl Builder<'_> {
    fn event(&mut self, event: Event<'_>, line: usize) -> Result<(), String> {
        match event {
            Event::DocumentStart(_) if self.root.is_some() => return Err("a second document begins".into()),
            Event::Scalar(text, style, anchor, tag) => {
                let is_text = self.is_text(tag.as_deref())?;
                let text = text.into_owned();
                let kind = if is_text || style != ScalarStyle::Plain { ScalarKind::Text } else { scalar_kind(&text) };
                let begin = self.count_bytes(text.len())?;
                self.close(Node { line, value: Value::Scalar(Scalar { text, kind }) }, anchor, begin)?;
            }
            Event::SequenceStart(anchor, tag) => self.begin(line, Content::List(Vec::new()), anchor, tag.as_deref())?,
            Event::MappingStart(anchor, tag) => {
                let table = Content::Table { entries: Vec::new(), names: HashSet::new(), key: None };
                self.begin(line, table, anchor, tag.as_deref())?;
            }
            Event::SequenceEnd | Event::MappingEnd => {
                let Some(OpenNode { line, content, anchor, begin }) = self.open.pop() else {
                    return Err("a list or table ends without a beginning".into());
                };
                let value = match content {
                    Content::List(list) => Value::List(list.into()),
                    Content::Table { entries, .. } => Value::Table(entries.into()),
                };
                self.close(Node { line, value }, anchor, begin)?;
            }
            Event::Alias(_) if !self.dialect.aliases => {
                return Err(format!("{} do not support aliases", self.dialect.files));
            }
            Event::Alias(anchor) => {
                let known = self.anchors.get(&anchor).cloned();
                let (value, size) = known.ok_or("an alias inside its own anchor")?;
                self.count_bytes(size)?;
                self.reject_as_key()?;
                self.place(Node { line, value })?;
            }
            Event::Nothing | Event::StreamStart | Event::StreamEnd | Event::DocumentStart(_) | Event::DocumentEnd => {}
        }
        Ok(())
    }

    /// True for the tag `!!str`. A tag that the dialect rejects is an error.
    fn is_text(&self, tag: Option<&Tag>) -> Result<bool, String> {
        match tag {
            Some(tag) if tag.is_yaml_core_schema() && tag.suffix == "str" => Ok(true),
            Some(tag) if !self.dialect.tags => Err(self.refused(tag)),
            _ => Ok(false),
        }
    }

    fn refused(&self, tag: &Tag) -> String {
        format!("{} do not support the tag {}{}", self.dialect.files, tag.handle, tag.suffix)
    }

    fn begin(&mut self, line: usize, content: Content, anchor: usize, tag: Option<&Tag>) -> Result<(), String> {
        if let Some(tag) = tag.filter(|_| !self.dialect.tags) {
            return Err(self.refused(tag));
        }
        if self.open.len() == MAX_DEPTH {
            return Err(format!("lists and tables nest deeper than {MAX_DEPTH} levels"));
        }
        self.reject_as_key()?;
        let begin = self.count_bytes(0)?;
        self.open.push(OpenNode { line, content, anchor, begin });
        Ok(())
    }

    /// Counts a value of `bytes` bytes, and returns the size before it; an error above the limit in total.
    fn count_bytes(&mut self, bytes: usize) -> Result<usize, String> {
        let begin = self.size;
        self.size += bytes + VALUE_BYTES;
        if self.size > self.max_size {
            let most = self.max_size;
            return Err(format!("with all its aliases the file is larger than {most} bytes; expected fewer aliases"));
        }
        Ok(begin)
    }

    /// Returns an error for a list or table in place of a key.
    fn reject_as_key(&self) -> Result<(), String> {
        match self.open.last() {
            Some(OpenNode { content: Content::Table { key: None, .. }, .. }) => {
                Err("a key must be a scalar, not a list or a table".into())
            }
            _ => Ok(()),
        }
    }

    /// Adds a complete value to the open list or table. A value with an anchor (`anchor` above 0) is stored for
    /// aliases, if the dialect has aliases. `begin` is the document size before the value.
    fn close(&mut self, node: Node, anchor: usize, begin: usize) -> Result<(), String> {
        if anchor > 0 && self.dialect.aliases {
            self.anchors.insert(anchor, (node.value.clone(), self.size - begin));
        }
        self.place(node)
    }

    fn place(&mut self, node: Node) -> Result<(), String> {
        match self.open.last_mut().map(|open| &mut open.content) {
            None => self.root = Some(node),
            Some(Content::List(list)) => list.push(node),
            Some(Content::Table { entries, names, key }) => match (key.take(), node.value) {
                (Some((name, line)), value) => entries.push((name, Node { line, value })),
                (None, Value::Scalar(Scalar { text, .. })) => {
                    if !names.insert(text.clone()) {
                        return Err(format!("duplicate key {text:?}"));
                    }
                    *key = Some((text, node.line));
                }
                // `reject_as_key` has rejected it.
                (None, _) => {}
            },
        }
        Ok(())
    }
}

/// Type of a word without quotes.
fn scalar_kind(text: &str) -> ScalarKind {
    let number = |text: String| ScalarKind::Number(text);
    match text {
        "" | "~" | "null" | "Null" | "NULL" => return ScalarKind::Null,
        "true" | "True" | "TRUE" => return ScalarKind::Bool(true),
        "false" | "False" | "FALSE" => return ScalarKind::Bool(false),
        ".nan" | ".NaN" | ".NAN" => return number("nan".into()),
        _ => {}
    }
    let (sign, digits) = match text.as_bytes()[0] {
        b'-' => ("-", &text[1..]),
        b'+' => ("", &text[1..]),
        _ => ("", text),
    };
    if matches!(digits, ".inf" | ".Inf" | ".INF") {
        return number(format!("{sign}inf"));
    }
    let all = |text: &str, radix: u32| !text.is_empty() && text.chars().all(|c| c.is_digit(radix));
    if all(digits, 10) {
        let short = digits.trim_start_matches('0');
        return number(format!("{sign}{}", if short.is_empty() { "0" } else { short }));
    }
    let with_radix = digits.strip_prefix("0x").map(|rest| (rest, 16));
    if let Some((rest, radix)) = with_radix.or_else(|| digits.strip_prefix("0o").map(|rest| (rest, 8)))
        && digits.len() == text.len()
        && all(rest, radix)
    {
        return number(text.into());
    }
    // Rust also parses `inf`, `nan` and `infinity`, which are texts in YAML.
    let is_number = digits.bytes().any(|byte| byte.is_ascii_digit())
        && digits.bytes().all(|byte| byte.is_ascii_digit() || b".eE+-".contains(&byte))
        && !digits.starts_with(['+', '-', 'e', 'E']);
    match digits.parse::<f64>() {
        Ok(value) if is_number && value.is_finite() => number(format!("{sign}{value:?}")),
        // Larger than every finite number, which is an error when the number is used.
        Ok(_) if is_number => number(format!("{sign}1e999")),
        _ => ScalarKind::Text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: YamlFeatures = YamlFeatures { files: "these files", aliases: true, tags: false };

    #[test]
    fn nodes() {
        let root = parse("a:\n  b: 1\n  c:\n    - 2\n    - 'x'\n", &ALL).unwrap().unwrap();
        let scalar = |text: &str, kind| Value::Scalar(Scalar { text: text.into(), kind });
        let number = |text: &str| scalar(text, ScalarKind::Number(text.into()));
        let list = [Node { line: 4, value: number("2") }, Node { line: 5, value: scalar("x", ScalarKind::Text) }];
        let table = [
            ("b".to_owned(), Node { line: 2, value: number("1") }),
            ("c".to_owned(), Node { line: 3, value: Value::List(list.into()) }),
        ];
        let expected = [("a".to_owned(), Node { line: 1, value: Value::Table(table.into()) })];
        assert_eq!(root, Node { line: 1, value: Value::Table(expected.into()) });
        assert_eq!(parse("", &ALL), Ok(None));
    }

    #[test]
    fn dialects() {
        let strict = YamlFeatures { aliases: false, tags: true, ..ALL };
        let error = parse("a: &a 1\nb: *a\n", &strict).unwrap_err();
        assert_eq!(error, YamlError { line: 2, column: 4, message: "these files do not support aliases".into() });
        assert!(parse("a: !cup 1\nb: !!opencv-matrix {rows: 3}\n", &strict).is_ok());
        for (text, tag) in [("a: !cup 1\n", "!cup"), ("b: !!set {rows: 3}\n", "set"), ("b: ! [1]\n", "!")] {
            let error = parse(text, &ALL).unwrap_err();
            assert!(
                error.message.starts_with("these files do not support the tag ") && error.message.ends_with(tag),
                "{error:?}"
            );
        }
        let text = parse("a: !!str 1\n", &ALL).unwrap();
        assert_eq!(text, parse("a: '1'\n", &ALL).unwrap());
    }

    #[test]
    fn refusals() {
        let deep = format!("a: {}1{}", "[".repeat(60), "]".repeat(60));
        let item = |k: usize| if k == 0 { "lol".into() } else { format!("*k{}", k - 1) };
        let bomb: String = (0..40).map(|k| format!("k{k}: &k{k} [{}]\n", vec![item(k); 9].join(", "))).collect();
        for (yaml, line, needle) in [
            ("a: 1\n---\nb: 2\n", 2, "second document"),
            ("a:\n  [1]: 2\n", 2, "a key must be a scalar"),
            ("a: &a b\n*a : 2\n", 2, "a key must be a scalar"),
            ("a: 1\nb: 2\na: 3\n", 3, "duplicate key \"a\""),
            ("a: [1\n", 2, ""),
            ("a: *b\n", 1, ""),
            ("a: &b [*b]\n", 1, "inside its own anchor"),
            (&deep, 1, "nest deeper"),
            (&bomb, 5, "larger than 1048576 bytes"),
        ] {
            let error = parse(yaml, &ALL).unwrap_err();
            assert!(error.message.contains(needle), "{yaml}: {error:?}");
            assert_eq!(error.line, line, "{yaml}: {error:?}");
        }
    }
}
