//! Tables of mistakes: each row is an action that must be refused with a message that helps, and that must change nothing.

use std::fmt::{Debug, Display};

/// One mistake.
pub struct Refusal<S> {
    /// The mistake, in a few words.
    pub what: &'static str,
    /// Makes it, and returns the message of the error.
    pub act: fn(&mut S) -> Result<(), String>,
    /// Parts that the message must contain: names, values, limits, candidates.
    pub message: &'static [&'static str],
}

impl<S> Debug for Refusal<S> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Refusal").field("what", &self.what).field("message", &self.message).finish_non_exhaustive()
    }
}

/// Turns any result into that of a row.
///
/// # Errors
/// The message of the error.
pub fn message<T, E: Display>(result: Result<T, E>) -> Result<(), String> {
    result.map(drop).map_err(|error| error.to_string())
}

/// Makes every mistake of the table and collects what is wrong: accepted mistakes, messages without their parts, and
/// changes of what `fingerprint` returns.
///
/// # Panics
/// If anything is wrong; the message lists all of it.
#[track_caller]
pub fn assert_refused<S, F: PartialEq>(state: &mut S, rows: &[Refusal<S>], fingerprint: impl Fn(&S) -> F) {
    let before = fingerprint(state);
    let mut findings = Vec::new();
    for Refusal { what, act, message } in rows {
        match act(state) {
            Ok(()) => findings.push(format!("{what}: accepted")),
            Err(error) => {
                let missing: Vec<&&str> = message.iter().filter(|part| !error.contains(**part)).collect();
                if !missing.is_empty() {
                    findings.push(format!("{what}: {error:?} does not contain {missing:?}"));
                }
            }
        }
        if fingerprint(state) != before {
            findings.push(format!("{what}: something changed"));
            break;
        }
    }
    assert!(findings.is_empty(), "{} of {} rows:\n  {}", findings.len(), rows.len(), findings.join("\n  "));
}

/// Asserts that a result is an error whose variant and fields, as `Debug` shows them, contain `kind`, and whose message
/// contains each of `parts`.
///
/// # Panics
/// If it is not; the message shows what came instead.
#[track_caller]
pub fn assert_error<T, E: Debug + Display>(result: Result<T, E>, kind: &str, parts: &[&str]) {
    let Err(error) = result else { panic!("accepted, expected {kind} {parts:?}") };
    let (shown, text) = (format!("{error:?}"), error.to_string());
    assert!(shown.contains(kind), "{shown} is not {kind}");
    assert!(parts.iter().all(|part| text.contains(part)), "{text:?} lacks one of {parts:?}");
}
