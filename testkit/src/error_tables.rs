//! Tables of invalid inputs: each row must be rejected with a helpful error, and must change nothing.

use std::fmt::{Debug, Display};

/// Report on one row, if the input was accepted or the error differs from the expected one.
fn finding<T, E: Debug + Display>(result: Result<T, E>, variant: &str, parts: &[&str]) -> Option<String> {
    let Err(error) = result else { return Some(format!("accepted, expected {variant} {parts:?}")) };
    let (shown, text) = (format!("{error:?}"), error.to_string());
    let missing: Vec<&&str> = parts.iter().filter(|part| !text.contains(**part)).collect();
    let is_right = shown.starts_with(variant) && missing.is_empty();
    (!is_right).then(|| format!("{shown} must begin with {variant:?}, and {text:?} must contain {missing:?}"))
}

#[track_caller]
fn assert_none(findings: &[String]) {
    assert!(findings.is_empty(), "{} wrong rows:\n  {}", findings.len(), findings.join("\n  "));
}

/// Asserts that every row `(what, result, variant, parts)` is an error whose `Debug` output begins with `variant`, and
/// whose message contains each of `parts`. Rows may be lazy: they are evaluated in order.
#[track_caller]
pub fn assert_errors<'a, W: Display, T, E: Debug + Display, V: AsRef<str>, P: AsRef<[&'a str]>>(
    rows: impl IntoIterator<Item = (W, Result<T, E>, V, P)>,
) {
    let rows = rows.into_iter().filter_map(|(what, result, variant, parts)| {
        Some(format!("{what}: {}", finding(result, variant.as_ref(), parts.as_ref())?))
    });
    assert_none(&rows.collect::<Vec<_>>());
}

/// Asserts the errors of rows `(what, mistake, variant, parts)` as [`assert_errors`] does. `make` makes each mistake,
/// and the value of `fingerprint` must not change.
#[track_caller]
pub fn assert_errors_unchanged<'a, S, F, W, M, T, E, V, P>(
    state: &mut S,
    fingerprint: impl Fn(&S) -> F,
    rows: impl IntoIterator<Item = (W, M, V, P)>,
    make: impl Fn(&mut S, M) -> Result<T, E>,
) where
    F: PartialEq,
    W: Display,
    E: Debug + Display,
    V: AsRef<str>,
    P: AsRef<[&'a str]>,
{
    let (mut before, mut findings) = (fingerprint(state), Vec::new());
    for (what, mistake, variant, parts) in rows {
        let wrong = finding(make(state, mistake), variant.as_ref(), parts.as_ref());
        findings.extend(wrong.map(|wrong| format!("{what}: {wrong}")));
        let after = fingerprint(state);
        if after != before {
            findings.push(format!("{what}: the rejected call changed the state"));
            before = after;
        }
    }
    assert_none(&findings);
}

/// Asserts that a result is an error whose `Debug` output contains `kind`, and whose message contains each of `parts`.
#[track_caller]
pub fn assert_error<T, E: Debug + Display>(result: Result<T, E>, kind: &str, parts: &[&str]) {
    let Err(error) = result else { panic!("accepted, expected {kind} {parts:?}") };
    let (shown, text) = (format!("{error:?}"), error.to_string());
    assert!(shown.contains(kind), "{shown} is not {kind}");
    assert!(parts.iter().all(|part| text.contains(part)), "{text:?} must contain all of {parts:?}");
}
