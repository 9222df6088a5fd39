//! Unique names for the links and joints of several files.

use super::config::NameCase;
use crate::diagnostic::{Diagnostic, DiagnosticKind};
use kinetoscope_scene::source_location::SourceLocation;
use std::collections::HashMap;

/// Registry that gives out each name once. Links and joints have separate registries.
#[derive(Debug)]
pub(super) struct NameRegistry {
    /// Kind of the named elements: `link` or `joint`.
    what: &'static str,
    case: NameCase,
    /// Component and location of each name in use.
    used: HashMap<String, (String, SourceLocation)>,
    /// Next number to append to each name, so that a thousand clashes stay cheap.
    next: HashMap<String, usize>,
}

impl NameRegistry {
    pub(super) fn new(what: &'static str, case: NameCase) -> Self {
        Self { what, case, used: HashMap::new(), next: HashMap::new() }
    }

    /// Returns a unique name, in the right case: with the prefix; if that is used, with the component's name instead of
    /// the prefix; if that is used, too, with `_2`, `_3`... at the end. Adds a warning if the first was used.
    pub(super) fn claim(
        &mut self,
        name: &str,
        prefix: &str,
        component: &str,
        source: &SourceLocation,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> String {
        let prefixed = self.case.apply(&with_prefix(name, prefix));
        let mut unique = prefixed.clone();
        if self.used.contains_key(&unique) && !component.is_empty() {
            unique = self.case.apply(&format!("{component}_{name}"));
        }
        if self.used.contains_key(&unique) {
            let stem = unique.clone();
            let next = self.next.entry(stem.clone()).or_insert(2);
            while self.used.contains_key(&unique) {
                unique = format!("{stem}_{next}");
                *next += 1;
            }
        }
        if let Some((of, first)) = self.used.get(&prefixed) {
            let what = self.what;
            let owner = if component.is_empty() { "the added base".to_owned() } else { format!("\"{component}\"") };
            let message = format!(
                "{what} \"{name}\" of {owner} is now \"{unique}\": \"{prefixed}\" is a {what} of \"{of}\" ({first})"
            );
            diagnostics.push(Diagnostic::new(DiagnosticKind::NameClash, source.clone(), message));
        }
        self.used.insert(unique.clone(), (component.to_owned(), source.clone()));
        unique
    }
}

/// Puts the prefix in front of a name, unless the name already starts with it in any case.
fn with_prefix(name: &str, prefix: &str) -> String {
    let starts = name.to_lowercase().starts_with(&prefix.to_lowercase());
    if starts { name.to_owned() } else { format!("{prefix}{name}") }
}
