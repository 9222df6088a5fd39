//! Reader of XML attributes. Numbers must parse, be finite, and have the expected count.

use super::error::UrdfError;
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use crate::urdf::config::Strictness;
use kinetoscope_scene::source_location::{LineStarts, SourceLocation};
use roxmltree::Node;
use std::cell::RefCell;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::sync::Arc;

/// Reader of a document with source locations.
#[derive(Debug)]
pub(super) struct Reader<'i> {
    pub(super) file: Arc<PathBuf>,
    lines: LineStarts,
    /// Namespace of the root element. Elements of this namespace, or without a namespace, belong to URDF.
    namespace: Option<&'i str>,
    strictness: Strictness,
    pub(super) diagnostics: Vec<Diagnostic>,
    /// The first list of numbers with commas, and the number of such lists.
    commas: RefCell<Option<(SourceLocation, String, usize)>>,
}

/// Counts as words, for messages.
const COUNTS: [&str; 7] = ["no", "one", "two", "three", "four", "five", "six"];

impl<'i> Reader<'i> {
    pub(super) fn new(file: Arc<PathBuf>, text: &str, namespace: Option<&'i str>, strictness: Strictness) -> Self {
        let lines = LineStarts::new(text);
        Self { file, lines, namespace, strictness, diagnostics: Vec::new(), commas: RefCell::new(None) }
    }

    /// Location of a byte of the text.
    pub(super) fn source_at(&self, position: usize) -> SourceLocation {
        SourceLocation { file: self.file.clone(), line: self.lines.line(position) }
    }

    /// Location of an element.
    pub(super) fn source(&self, node: Node<'_, '_>) -> SourceLocation {
        self.source_at(node.range().start)
    }

    /// Location of an attribute, or of its element if the attribute is missing.
    pub(super) fn attribute_source(&self, node: Node<'_, '_>, attribute: &str) -> SourceLocation {
        self.source_at(node.attribute_node(attribute).map_or(node.range().start, |a| a.range().start))
    }

    pub(super) fn warn(&mut self, kind: DiagnosticKind, at: SourceLocation, message: String) {
        self.diagnostics.push(Diagnostic::new(kind, at, message));
    }

    /// Reports lists of numbers with commas, with one warning for the file.
    pub(super) fn report_commas(&mut self) {
        if let Some((at, text, count)) = self.commas.take() {
            let others = if count == 1 { String::new() } else { format!(", and in {} other lists", count - 1) };
            let message = format!("the commas in \"{text}\"{others} were ignored; separate numbers by spaces");
            self.warn(DiagnosticKind::CommasIgnored, at, message);
        }
    }

    /// The text with its commas replaced by spaces if that gives `count` numbers (2 or more); `None` otherwise, without
    /// commas, and in strict reading. Commas must stand beside spaces, or the text must have no spaces: `0,5 0 0` has a
    /// decimal comma.
    fn without_commas(&self, node: Node<'_, '_>, attribute: &str, text: &str, count: usize) -> Option<String> {
        let beside_space = |word: &str| word.trim_matches(',').contains(',');
        if self.strictness == Strictness::Strict || !text.contains(',') {
            return None;
        }
        if text.trim().contains(char::is_whitespace) && text.split_whitespace().any(beside_space) {
            return None;
        }
        let spaced = text.replace(',', " ");
        let numbers = spaced.split_whitespace().map(str::parse::<f64>).filter(Result::is_ok).count();
        if numbers != count || count < 2 || spaced.split_whitespace().count() != count {
            return None;
        }
        let mut commas = self.commas.borrow_mut();
        match &mut *commas {
            Some((.., lists)) => *lists += 1,
            None => *commas = Some((self.attribute_source(node, attribute), truncate(text).to_string(), 1)),
        }
        Some(spaced)
    }

    /// Handles a deviation from URDF with a clear meaning. Lenient reading adds a warning with the text of `error` and
    /// the remedy `done`; strict reading returns the error.
    pub(super) fn warn_or_fail(
        &mut self,
        kind: DiagnosticKind,
        at: SourceLocation,
        error: UrdfError,
        done: &str,
    ) -> Result<(), UrdfError> {
        if self.strictness == Strictness::Strict {
            return Err(error);
        }
        let text = error.to_string();
        let text = text.strip_prefix(&format!("{at}: ")).unwrap_or(&text);
        self.warn(kind, at, format!("{text}; {done}"));
        Ok(())
    }

    /// Returns the first child called `name`; `None` without one. Further ones are ignored with a warning, or are an
    /// error in strict reading.
    pub(super) fn first_child<'a, 'input>(
        &mut self,
        node: Node<'a, 'input>,
        name: &'static str,
        owner: &str,
    ) -> Result<Option<Node<'a, 'input>>, UrdfError> {
        let mut found = self.named(node, name);
        let Some(first) = found.next() else { return Ok(None) };
        for further in found {
            let error = self.repeated(further, first, name, owner);
            self.warn_or_fail(DiagnosticKind::ElementRepeated, self.source(further), error, "the first is used")?;
        }
        Ok(Some(first))
    }

    /// URDF elements directly below `node`.
    pub(super) fn elements<'a, 'input>(
        &self,
        node: Node<'a, 'input>,
    ) -> impl Iterator<Item = Node<'a, 'input>> + use<'a, 'input, 'i> {
        let namespace = self.namespace;
        node.children().filter(move |&n| is_urdf(n, namespace))
    }

    /// URDF elements called `name` directly below `node`.
    pub(super) fn named<'a, 'input>(
        &self,
        node: Node<'a, 'input>,
        name: &'static str,
    ) -> impl Iterator<Item = Node<'a, 'input>> + use<'a, 'input, 'i> {
        self.elements(node).filter(move |n| n.tag_name().name() == name)
    }

    /// Returns the child called `name`, which may occur once; `None` without one.
    pub(super) fn child<'a, 'input>(
        &self,
        node: Node<'a, 'input>,
        name: &str,
        owner: &str,
    ) -> Result<Option<Node<'a, 'input>>, UrdfError> {
        let mut found = self.elements(node).filter(|n| n.tag_name().name() == name);
        let first = found.next();
        match (first, found.next()) {
            (Some(first), Some(second)) => Err(self.repeated(second, first, name, owner)),
            _ => Ok(first),
        }
    }

    fn repeated(&self, second: Node<'_, '_>, first: Node<'_, '_>, name: &str, owner: &str) -> UrdfError {
        UrdfError::ElementRepeated {
            at: self.source(second),
            owner: owner.to_owned(),
            element: name.to_owned(),
            first: self.source(first),
        }
    }

    /// Returns the child called `name`, which must occur once.
    pub(super) fn required_child<'a, 'input>(
        &self,
        node: Node<'a, 'input>,
        name: &'static str,
        owner: &str,
        fix: &'static str,
    ) -> Result<Node<'a, 'input>, UrdfError> {
        self.child(node, name, owner)?.ok_or_else(|| UrdfError::ElementMissing {
            at: self.source(node),
            owner: owner.to_owned(),
            element: node.tag_name().name().to_owned(),
            child: name,
            fix,
        })
    }

    /// Returns the text of an attribute; `None` without it. Xacro expressions and control characters are errors.
    pub(super) fn text<'a>(&self, node: Node<'a, '_>, attribute: &str) -> Result<Option<&'a str>, UrdfError> {
        let Some(text) = node.attribute(attribute) else { return Ok(None) };
        if text.contains("${") || text.contains("$(") {
            let found = format_element(node, Some((attribute, text)));
            return Err(UrdfError::Xacro { at: self.attribute_source(node, attribute), found });
        }
        if text.chars().any(|c| c.is_control() || matches!(c, '\u{fffe}' | '\u{ffff}')) {
            return Err(UrdfError::Value {
                at: self.attribute_source(node, attribute),
                owner: "robot".to_owned(),
                element: format_element(node, Some((attribute, text))),
                problem: format!("{attribute} has a control character; use visible characters only"),
            });
        }
        Ok(Some(text))
    }

    /// Returns the text of an attribute that must exist and not be empty.
    pub(super) fn required_text<'a>(
        &self,
        node: Node<'a, '_>,
        attribute: &'static str,
        owner: &str,
        example: &'static str,
    ) -> Result<&'a str, UrdfError> {
        match self.text(node, attribute)?.filter(|t| !t.trim().is_empty()) {
            Some(text) => Ok(text),
            None => Err(UrdfError::AttributeMissing {
                at: self.source(node),
                owner: owner.to_owned(),
                element: node.tag_name().name().to_owned(),
                attribute,
                example,
            }),
        }
    }

    /// Reads exactly `N` finite numbers; `None` without the attribute.
    pub(super) fn numbers<const N: usize>(
        &self,
        node: Node<'_, '_>,
        attribute: &str,
    ) -> Result<Option<[f64; N]>, UrdfError> {
        let Some(text) = self.text(node, attribute)? else { return Ok(None) };
        let needs = || match N {
            1 => format!("{attribute} needs one number, such as \"0.5\""),
            3 if attribute == "scale" => "scale needs three numbers, such as \"0.001 0.001 0.001\"".to_owned(),
            _ => format!("{attribute} needs {} numbers, such as \"{}0.1\"", COUNTS[N], "0 ".repeat(N - 1)),
        };
        let wrong = |problem: String| UrdfError::Number {
            at: self.attribute_source(node, attribute),
            element: format_element(node, Some((attribute, text))),
            problem,
        };
        let spaced = self.without_commas(node, attribute, text, N);
        let text = spaced.as_deref().unwrap_or(text);
        let mut numbers = [0.0; N];
        let mut count = 0;
        for word in text.split_whitespace() {
            let Ok(number) = word.parse::<f64>() else {
                let comma = if word.contains(',') { " (use a decimal point and spaces)" } else { "" };
                return Err(wrong(format!("\"{}\" is not a number{comma}; {}", truncate(word), needs())));
            };
            if !number.is_finite() {
                return Err(wrong(format!("\"{}\" is not finite; {}", truncate(word), needs())));
            }
            if let Some(slot) = numbers.get_mut(count) {
                *slot = number;
            }
            count += 1;
        }
        if count != N {
            let found = COUNTS.get(count).map_or_else(|| count.to_string(), |c| (*c).to_owned());
            return Err(wrong(format!("there {} {found}; {}", if count == 1 { "is" } else { "are" }, needs())));
        }
        Ok(Some(numbers))
    }

    /// Reads one finite number; `None` without the attribute.
    pub(super) fn number(&self, node: Node<'_, '_>, attribute: &str) -> Result<Option<f64>, UrdfError> {
        Ok(self.numbers::<1>(node, attribute)?.map(|[n]| n))
    }

    /// Reads one finite number, which must exist.
    pub(super) fn required_number(
        &self,
        node: Node<'_, '_>,
        attribute: &'static str,
        owner: &str,
        example: &'static str,
    ) -> Result<f64, UrdfError> {
        self.number(node, attribute)?.ok_or_else(|| UrdfError::AttributeMissing {
            at: self.source(node),
            owner: owner.to_owned(),
            element: node.tag_name().name().to_owned(),
            attribute,
            example,
        })
    }

    /// Reads one finite number that must not be negative; `None` without the attribute.
    pub(super) fn non_negative(
        &self,
        node: Node<'_, '_>,
        attribute: &str,
        owner: &str,
    ) -> Result<Option<f64>, UrdfError> {
        let number = self.number(node, attribute)?;
        match number {
            Some(n) if n < 0.0 => Err(self.value(node, attribute, owner, "must not be negative")),
            _ => Ok(number),
        }
    }

    /// Creates a [`UrdfError::Value`] for an attribute, with the problem `{attribute} {rule}`.
    pub(super) fn value(&self, node: Node<'_, '_>, attribute: &str, owner: &str, rule: &str) -> UrdfError {
        UrdfError::Value {
            at: self.attribute_source(node, attribute),
            owner: owner.to_owned(),
            element: format_element(node, node.attribute(attribute).map(|text| (attribute, text))),
            problem: format!("{attribute} {rule}"),
        }
    }
}

/// True if the element belongs to URDF and not to another namespace.
fn is_urdf(node: Node<'_, '_>, namespace: Option<&str>) -> bool {
    node.is_element() && (node.tag_name().namespace().is_none() || node.tag_name().namespace() == namespace)
}

/// Formats an element for messages: `<origin xyz="1 x 2">`.
pub(super) fn format_element(node: Node<'_, '_>, attribute: Option<(&str, &str)>) -> String {
    match attribute {
        Some((name, text)) => format!("<{} {name}=\"{}\">", node.tag_name().name(), truncate(text)),
        None => format!("<{}>", node.tag_name().name()),
    }
}

/// Shortens a text to its first 60 characters, followed by `...` if there are more, on one line.
fn truncate(text: &str) -> String {
    let mut short: String = text.chars().take(60).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(60).is_some() {
        short.push_str("...");
    }
    short
}

/// Formats a number with the fewest digits that read back to the same value.
pub(super) fn format_number(number: f64) -> String {
    let text = format!("{number:?}");
    text.strip_suffix(".0").map_or(text.clone(), str::to_owned)
}

/// Formats numbers with the fewest digits, separated by spaces.
pub(super) fn format_numbers(numbers: &[f64]) -> String {
    numbers.iter().map(|&n| format_number(n)).collect::<Vec<_>>().join(" ")
}

/// Appends ` name="text"` with the special characters of XML escaped.
pub(super) fn write_attribute(out: &mut String, name: &str, text: &str) {
    let _ = write!(out, " {name}=\"{}\"", quick_xml::escape::escape(text));
}
