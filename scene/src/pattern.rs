//! Name patterns: regular expressions that must match a whole name.
//!
//! The dialect is that of the `regex` crate. Matching is case-sensitive and against the full name, as in Python's
//! `re.fullmatch`. A pattern without a match is an error, and so is a name that is matched twice. A typing error in a
//! pattern is therefore an error, and never silently selects fewer joints.

use regex::Regex;
use std::collections::BTreeMap;
use thiserror::Error;

/// A name that is not in a list of known names.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("unknown {what} {name:?}; {}", format_known(.candidates))]
pub struct UnknownName {
    /// Kind of the name, such as `joint`.
    pub what: &'static str,
    /// The given name.
    pub name: String,
    /// Known names, the most similar first; at most [`MAX_CANDIDATES`].
    pub candidates: Vec<String>,
}

fn format_known(candidates: &[String]) -> String {
    let quoted: Vec<String> = candidates.iter().map(|name| format!("{name:?}")).collect();
    if quoted.is_empty() { "no names are defined".into() } else { format!("known names: {}", quoted.join(", ")) }
}

/// Error in the application of patterns to a list of names.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum PatternError {
    /// The pattern is not a regular expression.
    #[error("pattern \"{pattern}\" is not a regular expression: {reason}")]
    Invalid {
        /// The pattern as written.
        pattern: String,
        /// Reason.
        reason: String,
        /// Error of the regex engine.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The pattern uses look-around or back-references, which this dialect does not support.
    #[error(
        "pattern \"{pattern}\" uses {feature}, which name patterns do not support; list the names instead, such as \
         \"(joint1|joint2)\""
    )]
    Unsupported {
        /// The pattern as written.
        pattern: String,
        /// The unsupported feature.
        feature: &'static str,
        /// Error of the regex engine.
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    /// The pattern matches no name.
    #[error("pattern \"{pattern}\" matches no {what} (the whole name must match, case-sensitively); {}", format_candidates(.candidates, *.total))]
    NoMatch {
        /// The pattern as written.
        pattern: String,
        /// Kind of the names, such as `joint`.
        what: &'static str,
        /// Names, the closest first; at most [`MAX_CANDIDATES`].
        candidates: Vec<String>,
        /// Number of names.
        total: usize,
    },
    /// Two patterns or keys select the same name, or one pattern is listed twice.
    #[error("{what} \"{name}\" is matched by both \"{first}\" and \"{second}\"; make the two disjoint")]
    MatchedTwice {
        /// Kind of the name, such as `joint`.
        what: &'static str,
        /// The name.
        name: String,
        /// The first pattern or key.
        first: String,
        /// The second pattern or key.
        second: String,
    },
}

/// Largest number of candidates in an error.
pub const MAX_CANDIDATES: usize = 12;

/// A compiled name pattern.
#[derive(Clone, Debug)]
pub struct Pattern {
    regex: Regex,
}

impl Pattern {
    /// Compiles `pattern`, which must later match whole names.
    ///
    /// # Errors
    /// [`PatternError::Invalid`] or [`PatternError::Unsupported`].
    pub fn new(pattern: &str) -> Result<Self, PatternError> {
        // The bare pattern is compiled first, because wrapping could make nonsense such as `a)|(b` valid.
        let compiled = Regex::new(pattern).and_then(|_| {
            // A trailing comment of `(?x)` would include the closing parenthesis, hence the second form.
            Regex::new(&format!(r"\A(?:{pattern})\z")).or_else(|_| Regex::new(&format!("\\A(?:{pattern}\n)\\z")))
        });
        match compiled {
            Ok(regex) => Ok(Self { regex }),
            Err(error) => Err(explain(pattern, error)),
        }
    }

    /// True if the whole of `name` matches.
    pub fn matches(&self, name: &str) -> bool {
        self.regex.is_match(name)
    }
}

fn explain(pattern: &str, error: regex::Error) -> PatternError {
    let text = error.to_string();
    let feature = if text.contains("look-around") {
        Some("look-around")
    } else if text.contains("backreferences") {
        Some("back-references")
    } else {
        None
    };
    let pattern = pattern.to_owned();
    match feature {
        Some(feature) => PatternError::Unsupported { pattern, feature, source: error.into() },
        None => {
            let reason = text.lines().last().unwrap_or_default();
            let reason = reason.strip_prefix("error: ").unwrap_or(reason).to_owned();
            PatternError::Invalid { pattern, reason, source: error.into() }
        }
    }
}

/// Returns the indices of the matched names, ordered by pattern, then by their order in `names`.
///
/// `what` is the kind of the names for errors, such as `joint`.
///
/// # Errors
/// A pattern does not compile or matches no name, or two patterns match the same name.
pub fn select<P: AsRef<str>, N: AsRef<str>>(
    patterns: &[P],
    names: &[N],
    what: &'static str,
) -> Result<Vec<usize>, PatternError> {
    let mut matched_by: Vec<Option<&str>> = vec![None; names.len()];
    let mut selected = Vec::new();
    for pattern in patterns {
        let pattern = pattern.as_ref();
        for index in matching(pattern, names, what)? {
            mark_matched(&mut matched_by, index, pattern, names, what)?;
            selected.push(index);
        }
    }
    Ok(selected)
}

/// Returns the value of the `{pattern: value}` entry that matches each name; `None` for names without an entry.
///
/// A key that equals the name of a group (a control part) selects the members of that group and is not read as a
/// pattern.
///
/// # Errors
/// A key does not compile or matches no name, or two keys select the same name.
///
/// # Panics
/// If a group holds an index outside of `names`.
pub fn assign<V: Clone, N: AsRef<str>>(
    entries: &[(String, V)],
    groups: &BTreeMap<String, Vec<usize>>,
    names: &[N],
    what: &'static str,
) -> Result<Vec<Option<V>>, PatternError> {
    let mut taken_by: Vec<Option<&str>> = vec![None; names.len()];
    let mut values = vec![None; names.len()];
    for (key, value) in entries {
        let indices = match groups.get(key) {
            Some(members) => members.clone(),
            None => matching(key, names, what)?,
        };
        for index in indices {
            mark_matched(&mut taken_by, index, key, names, what)?;
            values[index] = Some(value.clone());
        }
    }
    Ok(values)
}

fn matching<N: AsRef<str>>(pattern: &str, names: &[N], what: &'static str) -> Result<Vec<usize>, PatternError> {
    let compiled = Pattern::new(pattern)?;
    let found: Vec<usize> = (0..names.len()).filter(|&i| compiled.matches(names[i].as_ref())).collect();
    if found.is_empty() {
        let candidates =
            closest_names(pattern, names.iter().map(AsRef::as_ref)).into_iter().map(str::to_owned).collect();
        return Err(PatternError::NoMatch { pattern: pattern.to_owned(), what, candidates, total: names.len() });
    }
    Ok(found)
}

fn mark_matched<'k, N: AsRef<str>>(
    taken_by: &mut [Option<&'k str>],
    index: usize,
    key: &'k str,
    names: &[N],
    what: &'static str,
) -> Result<(), PatternError> {
    match taken_by[index].replace(key) {
        None => Ok(()),
        Some(first) => Err(PatternError::MatchedTwice {
            what,
            name: names[index].as_ref().to_owned(),
            first: first.to_owned(),
            second: key.to_owned(),
        }),
    }
}

/// Removes a prefix that means "in every environment" from a name or pattern: `{ENV}/`, or Isaac's `{ENV_REGEX_NS}/`.
///
/// Names refer to all environments even without it.
pub fn strip_env_prefix(name: &str) -> &str {
    ["{ENV}/", "{ENV_REGEX_NS}/"].into_iter().find_map(|prefix| name.strip_prefix(prefix)).unwrap_or(name)
}

/// Candidates most similar to `name`, best first, at most [`MAX_CANDIDATES`]. Case has little weight.
pub fn closest_names<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Vec<&'c str> {
    let mut ranked: Vec<(usize, &str)> = candidates.into_iter().map(|c| (edit_distance(name, c), c)).collect();
    ranked.sort_by_key(|&(distance, _)| distance);
    ranked.truncate(MAX_CANDIDATES);
    ranked.into_iter().map(|(_, c)| c).collect()
}

/// The candidate that `name` may be a misspelling of: apart from case, at most a third of its characters, and at most
/// three, differ. `None` without such a candidate.
pub fn similar_name<'c>(name: &str, candidates: impl IntoIterator<Item = &'c str>) -> Option<&'c str> {
    let nearest = candidates.into_iter().map(|c| (edit_distance(name, c), c)).min_by_key(|&(distance, _)| distance);
    let most = 2 * (name.chars().count() / 3).min(3) + 1;
    nearest.filter(|&(distance, _)| distance <= most).map(|(_, candidate)| candidate)
}

/// Twice the edit distance (insertions, deletions, replacements) of the first 64 characters in lower case, plus one if
/// the whole names differ in any way, case included. The limit bounds the cost of malicious names.
fn edit_distance(a: &str, b: &str) -> usize {
    let lower = |s: &str| s.chars().take(64).flat_map(char::to_lowercase).collect::<String>();
    2 * strsim::levenshtein(&lower(a), &lower(b)) + usize::from(a != b)
}

/// Formats `candidates: "a", "b"`, or `closest of 240: "a", "b"` if `total` is larger than the list. A `total` of 0
/// gives `no names are defined`.
pub fn format_candidates(candidates: &[String], total: usize) -> String {
    let quoted = candidates.iter().map(|c| format!("\"{c}\"")).collect::<Vec<_>>().join(", ");
    match total {
        0 => "no names are defined".to_owned(),
        _ if total > candidates.len() => format!("closest of {total}: {quoted}"),
        _ => format!("candidates: {quoted}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const JOINTS: [&str; 8] = ["joint1", "joint2", "JOINT3", "LEFT_THUMB", "LEFT_INDEX", "a+b", "élbow", "joint10"];

    #[test]
    fn whole_names() {
        for (pattern, expected) in [
            ("joint[1-6]", vec![0, 1]),
            ("joint.*", vec![0, 1, 7]),
            ("joint1", vec![0]),
            ("LEFT_.*", vec![3, 4]),
            ("(?i)joint[1-6]", vec![0, 1, 2]),
            ("joint1|joint10", vec![0, 7]),
            (r"a\+b", vec![5]),
            (".lbow", vec![6]),
            ("(?x) joint1 # the first", vec![0]),
        ] {
            assert_eq!(select(&[pattern], &JOINTS, "joint").unwrap(), expected, "{pattern}");
        }
        // In the order of the patterns, then of the names.
        assert_eq!(select(&["LEFT_.*", "joint[12]"], &JOINTS, "joint").unwrap(), [3, 4, 0, 1]);
        assert_eq!(select::<&str, _>(&[], &JOINTS, "joint").unwrap(), [0usize; 0]);
    }

    #[test]
    fn errors() {
        let names: Vec<String> = (0..100).map(|i| format!("joint_{i}")).collect();
        for (error, parts) in [
            (select(&["JOINT1"], &JOINTS, "joint"), &["\"JOINT1\" matches no joint", "candidates: \"joint1\""][..]),
            (select(&["joint"], &JOINTS, "joint"), &["the whole name must match, case-sensitively"]),
            (
                select(&["joint[12]", "joint2"], &JOINTS, "joint"),
                &["joint \"joint2\" is matched by both \"joint[12]\" and \"joint2\""],
            ),
            (select::<_, &str>(&["a"], &[], "joint"), &["no names are defined"]),
            // Long lists are cut.
            (select(&["Joint_42"], &names, "joint"), &["closest of 100: \"joint_42\""]),
        ] {
            let text = error.unwrap_err().to_string();
            assert!(parts.iter().all(|part| text.contains(part)), "{text}");
        }
        for (pattern, feature) in
            [("(?!a).*", "look-around"), ("(?<=a)b", "look-around"), (r"(a)\1", "back-references")]
        {
            let e = select(&[pattern], &JOINTS, "joint").unwrap_err();
            assert!(matches!(&e, PatternError::Unsupported { feature: f, .. } if *f == feature), "{e:?}");
        }
        for pattern in ["(", "a)|(b", "[", "*", "a{1000000000}"] {
            let e = select(&[pattern], &JOINTS, "joint").unwrap_err();
            assert!(matches!(e, PatternError::Invalid { .. }), "{pattern}: {e:?}");
        }
    }

    #[test]
    fn assignment() {
        let groups = BTreeMap::from([("hand".to_owned(), vec![3, 4])]);
        let entries = |list: &[(&str, f64)]| list.iter().map(|(k, v)| ((*k).to_owned(), *v)).collect::<Vec<_>>();
        let values = assign(&entries(&[("joint[12]", 1.0), ("hand", 2.0)]), &groups, &JOINTS, "joint").unwrap();
        assert_eq!(values, [Some(1.0), Some(1.0), None, Some(2.0), Some(2.0), None, None, None]);
        let e = assign(&entries(&[("hand", 1.0), ("LEFT_T.*", 2.0)]), &groups, &JOINTS, "joint").unwrap_err();
        let text = e.to_string();
        assert!(matches!(e, PatternError::MatchedTwice { .. }));
        assert!(text.contains("LEFT_THUMB") && text.contains("\"hand\"") && text.contains("\"LEFT_T.*\""), "{text}");
        let foot = assign(&entries(&[("foot", 1.0)]), &groups, &JOINTS, "joint");
        assert!(matches!(foot, Err(PatternError::NoMatch { .. })));
    }

    #[test]
    fn similar_names() {
        let known = ["inertial", "visual", "collision"];
        assert_eq!(similar_name("colision", known), Some("collision"));
        assert_eq!(similar_name("Visual", known), Some("visual"));
        assert_eq!(similar_name("gravity", known), None);
        assert_eq!(similar_name("contact", known), None);
    }

    #[test]
    fn closest_name_order() {
        assert_eq!(closest_names("Base", ["bass", "BASE", "base", "other"])[..2], ["BASE", "base"]);
        assert_eq!(closest_names("base", ["bass", "BASE", "base"])[0], "base");
    }

    #[test]
    fn names_in_every_environment() {
        for (name, expected) in [
            ("{ENV}/robot", "robot"),
            ("{ENV_REGEX_NS}/robot/.*_FOOT", "robot/.*_FOOT"),
            ("robot", "robot"),
            ("{ENV}", "{ENV}"),
            ("a/{ENV}/robot", "a/{ENV}/robot"),
            // Only one prefix is removed; the rest is a name.
            ("{ENV}/{ENV}/robot", "{ENV}/robot"),
        ] {
            assert_eq!(strip_env_prefix(name), expected);
        }
    }
}
