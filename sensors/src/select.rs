//! Selection of bodies, joints and other items by name patterns.

use crate::error::SensorError;
use kinetoscope_scene::pattern::{MAX_CANDIDATES, Pattern, PatternError, closest_names, strip_env_prefix};
use ndarray::Array2;

/// Returns the indices of the names that the patterns match, pattern by pattern, in the order of the names within a
/// pattern.
///
/// A pattern is a regular expression (see [`kinetoscope_scene::pattern`]). It must match the whole full name
/// (`uid/link`), or the whole part after the first slash. The prefixes `{ENV}/` and `{ENV_REGEX_NS}/` are ignored.
/// `what` is the kind of item for errors, such as `body`.
///
/// # Errors
///
/// A pattern that is not a regular expression or matches nothing, and a name that two patterns match.
pub(crate) fn select<P: AsRef<str>>(
    patterns: &[P],
    names: &[String],
    what: &'static str,
) -> Result<Vec<usize>, SensorError> {
    let mut taken_by: Vec<Option<&str>> = vec![None; names.len()];
    let mut selected = Vec::new();
    for pattern in patterns {
        let pattern = pattern.as_ref();
        for index in matching(pattern, names, what)? {
            if let Some(first) = taken_by[index].replace(pattern) {
                let (first, second, name) = (first.into(), pattern.into(), names[index].clone());
                return Err(SensorError::Pattern(PatternError::MatchedTwice { what, name, first, second }.to_string()));
            }
            selected.push(index);
        }
    }
    Ok(selected)
}

/// Selects as [`select`]; `None` selects all names.
///
/// # Errors
///
/// Same as [`select`].
pub(crate) fn select_or_all(
    patterns: Option<&[String]>,
    names: &[String],
    what: &'static str,
) -> Result<Vec<usize>, SensorError> {
    patterns.map_or_else(|| Ok((0..names.len()).collect()), |patterns| select(patterns, names, what))
}

/// Writes the numbers of `fields` in environment `env` and these columns to `row`, one field after the other; fields
/// that are `None` are skipped.
pub(crate) fn read_columns(fields: [&Option<Array2<f64>>; 3], columns: &[usize], env: usize, row: &mut [f64]) {
    let numbers =
        fields.into_iter().flatten().flat_map(|field| columns.iter().map(move |&column| field[(env, column)]));
    row.iter_mut().zip(numbers).for_each(|(to, from)| *to = from);
}

/// A configuration field that selects items by name, for errors.
#[derive(Clone, Copy)]
pub(crate) struct Selection {
    /// Kind of sensor in the error text, such as `joint wrench`.
    pub(crate) sensor: &'static str,
    pub(crate) field: &'static str,
    /// Kind of the selected items in the error text, such as `joint`.
    pub(crate) what: &'static str,
}

/// Rejects an empty selection; `count` is the number of selected `names`.
///
/// # Errors
///
/// [`SensorError::EmptySelection`] with the first of the names.
pub(crate) fn at_least_one(count: usize, choice: Selection, names: &[String]) -> Result<(), SensorError> {
    if count > 0 {
        return Ok(());
    }
    let Selection { sensor, field, what } = choice;
    let candidates = names.iter().take(MAX_CANDIDATES).cloned().collect();
    Err(SensorError::EmptySelection { sensor, field, what, candidates })
}

/// Returns the indices of the names that a pattern matches, in ascending order.
///
/// # Errors
///
/// A pattern that is not a regular expression or matches nothing.
pub(crate) fn matching(pattern: &str, names: &[String], what: &'static str) -> Result<Vec<usize>, SensorError> {
    let pattern = strip_env_prefix(pattern);
    let compiled = Pattern::new(pattern).map_err(|error| SensorError::Pattern(error.to_string()))?;
    let matches = |name: &str| compiled.matches(name) || compiled.matches(name_without_prefix(name));
    let found: Vec<usize> = (0..names.len()).filter(|&i| matches(&names[i])).collect();
    if found.is_empty() {
        let candidates = if pattern.contains('/') {
            closest_names(pattern, names.iter().map(String::as_str))
        } else {
            closest_names(pattern, names.iter().map(|name| name_without_prefix(name)))
        };
        let candidates = candidates.into_iter().map(str::to_owned).collect();
        return Err(SensorError::UnknownName { what, name: pattern.into(), candidates });
    }
    Ok(found)
}

/// Returns the part of a name after the first slash, or the whole name.
fn name_without_prefix(name: &str) -> &str {
    name.split_once('/').map_or(name, |(_, rest)| rest)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names() {
        let names = ["a/LF_FOOT", "a/RF_FOOT", "b/LF_FOOT", "cube", "a/x/y"].map(String::from);
        let found = |patterns: &[&str]| select(patterns, &names, "body").unwrap();
        assert_eq!([found(&[".F_FOOT"]), found(&[])], [vec![0, 1, 2], vec![]]);
        assert_eq!([found(&["b/.*", "a/RF_FOOT"]), found(&["cube", "x/y"])], [[2, 1], [3, 4]]);
        assert_eq!(found(&["{ENV}/b/.*", "{ENV_REGEX_NS}/RF_FOOT"]), [2, 1]);
        let wrong = |patterns: &[&str]| select(patterns, &names, "body").unwrap_err().to_string();
        assert!(wrong(&["F_FOOT"]).starts_with("unknown body \"F_FOOT\"; known names: \"LF_FOOT\""));
        assert!(wrong(&["cube", "c.*"]).contains("matched by both"));
        assert!(wrong(&["(cube"]).contains("not a regular expression"));
    }
}
