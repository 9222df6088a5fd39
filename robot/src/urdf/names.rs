//! Unique names for the links and joints of several files.

use super::config::NameCase;
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source::Source;
use std::collections::HashMap;

/// Registry that gives out each name once. Links and joints have separate registries.
#[derive(Debug)]
pub(super) struct Names {
    /// Kind of the named elements: `link` or `joint`.
    what: &'static str,
    case: NameCase,
    /// Component and location of each name in use.
    taken: HashMap<String, (String, Source)>,
    /// Next number to append to each name, so that a thousand clashes stay cheap.
    next: HashMap<String, usize>,
}

impl Names {
    pub(super) fn new(what: &'static str, case: NameCase) -> Self {
        Self { what, case, taken: HashMap::new(), next: HashMap::new() }
    }

    /// Returns a unique name: with the prefix and in the right case, then with the component's name in front, then with
    /// `_2`, `_3`...
    pub(super) fn claim(
        &mut self,
        name: &str,
        prefix: &str,
        component: &str,
        source: &Source,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> String {
        let prefixed = self.case.apply(&with_prefix(name, prefix));
        let mut unique = prefixed.clone();
        if self.taken.contains_key(&unique) && !component.is_empty() {
            unique = self.case.apply(&format!("{component}_{name}"));
        }
        if self.taken.contains_key(&unique) {
            let stem = unique.clone();
            let next = self.next.entry(stem.clone()).or_insert(2);
            while self.taken.contains_key(&unique) {
                unique = format!("{stem}_{next}");
                *next += 1;
            }
        }
        if let Some((of, first)) = self.taken.get(&prefixed) {
            let what = self.what;
            let owner = if component.is_empty() { "the added base".to_owned() } else { format!("\"{component}\"") };
            let message = format!(
                "{what} \"{name}\" of {owner} is now \"{unique}\": \"{prefixed}\" is a {what} of \"{of}\" ({first})"
            );
            diagnostics.push(Diagnostic::new(DiagnosticKind::NameClash, source.clone(), message));
        }
        self.taken.insert(unique.clone(), (component.to_owned(), source.clone()));
        unique
    }
}

/// Puts the prefix in front of a name, unless the name already starts with it in any case.
fn with_prefix(name: &str, prefix: &str) -> String {
    let starts = name.to_lowercase().starts_with(&prefix.to_lowercase());
    if starts { name.to_owned() } else { format!("{prefix}{name}") }
}
