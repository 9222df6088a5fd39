//! Scenes as YAML files: the file in words of TOML, and which line of it each word is from. What is read of it, and what can be
//! wrong with it, is then the same.

use saphyr_parser::{Event, Parser, ScalarStyle, Span, Tag};
use std::collections::BTreeMap;
use std::fmt::Write as _;

/// Lists and tables within each other, at most.
const DEPTH: usize = 48;
/// Bytes at most: aliases of aliases grow without end.
const LARGEST: usize = 64 << 20;

/// A file in words of TOML.
#[derive(Clone, Debug, Default)]
pub(super) struct Translation {
    pub(super) toml: String,
    /// Where words begin in `toml`, and the lines they have in the file, counted from 1.
    lines: Vec<(usize, u32)>,
}

impl Translation {
    /// The line that a place in the TOML is from.
    pub(super) fn line(&self, at: usize) -> u32 {
        let after = self.lines.partition_point(|(begin, _)| *begin <= at);
        after.checked_sub(1).map_or(1, |last| self.lines[last].1)
    }
}

/// What is wrong with a file, and in which line.
#[derive(Clone, Debug)]
pub(super) struct YamlError {
    pub(super) line: u32,
    pub(super) message: String,
}

/// A list or a table that has not ended.
#[derive(Debug)]
struct Open {
    /// What a table waits for; `None` for a list.
    next: Option<Next>,
    is_empty: bool,
    /// Its anchor, and where it begins.
    anchor: usize,
    begin: usize,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Next {
    Key,
    Value,
}

/// Writes the only document of a text in words of TOML.
///
/// # Errors
/// No YAML, several documents, nothing where a value should be, tags, and what no scene can hold.
pub(super) fn translate(text: &str) -> Result<Translation, YamlError> {
    let mut writer = Writer::default();
    let mut parser = Parser::new_from_str(text);
    while let Some(event) = parser.next_event() {
        let (event, span) =
            event.map_err(|e| YamlError { line: line_of(e.marker().line()), message: e.info().into() })?;
        writer.line = line_of(span.start.line());
        writer.event(event, &span)?;
        if writer.out.toml.len() > LARGEST {
            return Err(writer.wrong("with all its aliases the file is larger than 64 MiB"));
        }
    }
    Ok(writer.out)
}

fn line_of(line: usize) -> u32 {
    u32::try_from(line.max(1)).unwrap_or(u32::MAX)
}

#[derive(Debug, Default)]
struct Writer {
    out: Translation,
    open: Vec<Open>,
    /// What anchors stand for.
    anchors: BTreeMap<usize, String>,
    has_document: bool,
    line: u32,
}

impl Writer {
    fn wrong(&self, message: impl Into<String>) -> YamlError {
        YamlError { line: self.line, message: message.into() }
    }

    fn event(&mut self, event: Event<'_>, span: &Span) -> Result<(), YamlError> {
        match event {
            Event::DocumentStart(_) if self.has_document => return Err(self.wrong("a second document begins")),
            Event::DocumentStart(_) => self.has_document = true,
            Event::Scalar(text, style, anchor, tag) => self.scalar(&text, style, (anchor, tag.as_deref()), span)?,
            Event::SequenceStart(anchor, tag) => self.begin(anchor, tag.as_deref(), None)?,
            Event::MappingStart(anchor, tag) => self.begin(anchor, tag.as_deref(), Some(Next::Key))?,
            Event::SequenceEnd | Event::MappingEnd => self.end(),
            Event::Alias(anchor) => {
                let known = self.anchors.get(&anchor).cloned();
                let text = known.ok_or_else(|| self.wrong("an alias of something that has not ended"))?;
                self.value(&text, 0)?;
            }
            Event::Nothing | Event::StreamStart | Event::StreamEnd | Event::DocumentEnd => {}
        }
        Ok(())
    }

    fn scalar(
        &mut self,
        text: &str,
        style: ScalarStyle,
        (anchor, tag): (usize, Option<&Tag>),
        span: &Span,
    ) -> Result<(), YamlError> {
        let plain = match tag {
            None => style == ScalarStyle::Plain,
            Some(tag) if tag.is_yaml_core_schema() && tag.suffix == "str" => false,
            Some(tag) => return Err(self.wrong(format!("the tag {}{} is not for scene files", tag.handle, tag.suffix))),
        };
        if self.open.is_empty() {
            // An empty file, or one of comments, is a scene without anything.
            if plain && text.is_empty() && span.is_empty() {
                return Ok(());
            }
            return Err(self.wrong(format!("{text:?} is no table of `simulation` and `entities`")));
        }
        if self.open.last().is_some_and(|open| open.next == Some(Next::Key)) {
            return self.key(text);
        }
        let word = if plain { plain_word(text) } else { Some(quoted(text)) };
        let nothing = "nothing is said here; leave it out, or say false where something is not to be";
        let word = word.ok_or_else(|| self.wrong(nothing))?;
        self.value(&word, anchor)
    }

    /// A comma between two things of one table or list; the things at the top stand in lines of their own.
    fn separate(&mut self) {
        let depth = self.open.len();
        if let Some(open) = self.open.last_mut()
            && !std::mem::replace(&mut open.is_empty, false)
            && depth > 1
        {
            self.out.toml.push_str(", ");
        }
    }

    fn mark(&mut self) {
        self.out.lines.push((self.out.toml.len(), self.line));
    }

    fn key(&mut self, name: &str) -> Result<(), YamlError> {
        self.separate();
        self.mark();
        // No word is longer than the file.
        let _ = write!(self.out.toml, "{} = ", quoted(name));
        if let Some(open) = self.open.last_mut() {
            open.next = Some(Next::Value);
        }
        Ok(())
    }

    /// What comes before a value.
    fn before_value(&mut self) -> Result<(), YamlError> {
        match self.open.last().map(|open| open.next) {
            None => return Err(self.wrong("a scene is a table of `simulation` and `entities`")),
            Some(Some(Next::Key)) => return Err(self.wrong("a key is a word, not a list or a table")),
            Some(Some(Next::Value)) => {}
            Some(None) => self.separate(),
        }
        self.mark();
        Ok(())
    }

    fn after_value(&mut self) {
        let at_the_top = self.open.len() == 1;
        if let Some(next) = self.open.last_mut().and_then(|open| open.next.as_mut()) {
            *next = Next::Key;
            if at_the_top {
                self.out.toml.push('\n');
            }
        }
    }

    fn value(&mut self, text: &str, anchor: usize) -> Result<(), YamlError> {
        self.before_value()?;
        self.out.toml.push_str(text);
        if anchor > 0 {
            self.anchors.insert(anchor, text.into());
        }
        self.after_value();
        Ok(())
    }

    fn begin(&mut self, anchor: usize, tag: Option<&Tag>, next: Option<Next>) -> Result<(), YamlError> {
        if let Some(tag) = tag {
            return Err(self.wrong(format!("the tag {}{} is not for scene files", tag.handle, tag.suffix)));
        }
        if self.open.len() == DEPTH {
            return Err(self.wrong(format!("there are more than {DEPTH} lists and tables within each other")));
        }
        let begin = self.out.toml.len();
        if self.open.is_empty() {
            if next.is_none() {
                return Err(self.wrong("a scene is a table of `simulation` and `entities`, not a list"));
            }
        } else {
            self.before_value()?;
            self.out.toml.push(if next.is_some() { '{' } else { '[' });
        }
        self.open.push(Open { next, is_empty: true, anchor, begin });
        Ok(())
    }

    fn end(&mut self) {
        let Some(Open { next, anchor, begin, .. }) = self.open.pop() else { return };
        if self.open.is_empty() {
            return;
        }
        self.out.toml.push(if next.is_some() { '}' } else { ']' });
        if anchor > 0 {
            // From its bracket on: what separates it stands before.
            let text = self.out.toml[begin..].trim_start_matches(", ").to_string();
            self.anchors.insert(anchor, text);
        }
        self.after_value();
    }
}

/// A word without quotes by YAML 1.2's core schema; `None` where it says nothing.
fn plain_word(text: &str) -> Option<String> {
    match text {
        "" | "~" | "null" | "Null" | "NULL" => return None,
        "true" | "True" | "TRUE" => return Some("true".into()),
        "false" | "False" | "FALSE" => return Some("false".into()),
        ".nan" | ".NaN" | ".NAN" => return Some("nan".into()),
        _ => {}
    }
    let (sign, digits) = match text.as_bytes()[0] {
        b'-' => ("-", &text[1..]),
        b'+' => ("", &text[1..]),
        _ => ("", text),
    };
    if matches!(digits, ".inf" | ".Inf" | ".INF") {
        return Some(format!("{sign}inf"));
    }
    let all = |text: &str, radix: u32| !text.is_empty() && text.chars().all(|c| c.is_digit(radix));
    if all(digits, 10) {
        let short = digits.trim_start_matches('0');
        return Some(format!("{sign}{}", if short.is_empty() { "0" } else { short }));
    }
    let with_radix = digits.strip_prefix("0x").map(|rest| (rest, 16));
    if let Some((rest, radix)) = with_radix.or_else(|| digits.strip_prefix("0o").map(|rest| (rest, 8)))
        && digits.len() == text.len()
        && all(rest, radix)
    {
        return Some(text.into());
    }
    // What YAML takes for a number, and not what else Rust does: `inf`, `nan`, `infinity`.
    let is_number = digits.bytes().any(|byte| byte.is_ascii_digit())
        && digits.bytes().all(|byte| byte.is_ascii_digit() || b".eE+-".contains(&byte))
        && !digits.starts_with(['+', '-', 'e', 'E']);
    match digits.parse::<f64>() {
        Ok(number) if is_number && number.is_finite() => Some(format!("{sign}{number:?}")),
        // More than there is: said when it is read.
        Ok(_) if is_number => Some(format!("{sign}1e999")),
        _ => Some(quoted(text)),
    }
}

/// A string of TOML.
fn quoted(text: &str) -> String {
    let mut out = String::with_capacity(text.len() + 2);
    out.push('"');
    for c in text.chars() {
        match c {
            '"' | '\\' => out.extend(['\\', c]),
            c if c.is_control() => {
                // A string takes all that is written.
                let _ = write!(out, "\\u{:04X}", u32::from(c));
            }
            c => out.push(c),
        }
    }
    out.push('"');
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(yaml: &str) -> toml::Table {
        let translation = translate(yaml).unwrap();
        toml::from_str(&translation.toml).unwrap_or_else(|error| panic!("{error}: {}", translation.toml))
    }

    #[test]
    fn core_schema() {
        let yaml = "a: 1\nb: -007\nc: 1.5\nd: .5\ne: 1.\nf: 1e3\ng: .inf\nh: -.INF\ni: yes\nj: True\nk: '1'\nl: 0x1F\nm: 0o17\n\
                    n: !!str 5\no: 1_000\np: inf\nq: \"tab\\tquote\\\"\"\nr: +3\ns: nan\nt: 12e03\nu: 0.1\n\"v w\": [1, [2, x], {}]\n";
        let expected = "a = 1\nb = -7\nc = 1.5\nd = 0.5\ne = 1.0\nf = 1000.0\ng = inf\nh = -inf\ni = \"yes\"\nj = true\nk = \"1\"\n\
                        l = 31\nm = 15\nn = \"5\"\no = \"1_000\"\np = \"inf\"\nq = \"tab\\tquote\\\"\"\nr = 3\ns = \"nan\"\n\
                        t = 12000.0\nu = 0.1\n\"v w\" = [1, [2, \"x\"], {}]\n";
        assert_eq!(read(yaml), toml::from_str(expected).unwrap());
        assert!(matches!(read("x: .nan")["x"], toml::Value::Float(x) if x.is_nan()));
        assert_eq!(read("# nothing\n"), toml::Table::new());
    }

    #[test]
    fn nesting_and_aliases() {
        let yaml = "one: &one\n  list:\n    - 1\n    - &two {a: b, c: [d]}\n    - *two\nagain: *one\ntext: |\n  two\n  lines\n";
        let table = "{ list = [1, { a = \"b\", c = [\"d\"] }, { a = \"b\", c = [\"d\"] }] }";
        let expected = format!("one = {table}\nagain = {table}\ntext = \"two\\nlines\\n\"\n");
        assert_eq!(read(yaml), toml::from_str(&expected).unwrap());
    }

    #[test]
    fn lines() {
        let translation = translate("a:\n  b: 1\n  c:\n    - 2\n    - x\n").unwrap();
        for (word, line) in [("\"a\"", 1), ("\"b\"", 2), ("1", 2), ("\"c\"", 3), ("2", 4), ("\"x\"", 5)] {
            assert_eq!(translation.line(translation.toml.find(word).unwrap()), line, "{word}");
        }
        assert_eq!(Translation::default().line(7), 1);
    }

    #[test]
    fn refusals() {
        let deep = format!("a: {}1{}", "[".repeat(60), "]".repeat(60));
        let item = |k: usize| if k == 0 { "lol".into() } else { format!("*k{}", k - 1) };
        let bomb: String = (0..40).map(|k| format!("k{k}: &k{k} [{}]\n", vec![item(k); 9].join(", "))).collect();
        for (yaml, line, needle) in [
            ("a: 1\nb:\n", 2, "nothing is said here"),
            ("a: 1\nb: ~\n", 2, "nothing is said here"),
            ("- 1\n", 1, "not a list"),
            ("word\n", 1, "no table"),
            ("a: 1\n---\nb: 2\n", 2, "second document"),
            ("a: !cup 5\n", 1, "tag"),
            ("a:\n  [1]: 2\n", 2, "a key is a word"),
            ("a: [1\n", 2, ""),
            ("a: *b\n", 1, ""),
            (&deep, 1, "within each other"),
            (&bomb, 8, "64 MiB"),
        ] {
            let error = translate(yaml).unwrap_err();
            assert!(error.message.contains(needle), "{yaml}: {error:?}");
            assert_eq!(error.line, line, "{yaml}: {error:?}");
        }
    }
}
