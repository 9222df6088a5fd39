//! Calls of the functions of terms.

use crate::error::{EnvError, Result, TermKind, TermResult};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Calls the function of a term. An error or a panic names the term.
///
/// After a panic the task may be in an inconsistent state, as after an error: its environments then have no episode
/// until they are reset.
pub(crate) fn guard<T>(kind: TermKind, name: &str, act: impl FnOnce() -> TermResult<T>) -> Result<T> {
    match catch_unwind(AssertUnwindSafe(act)) {
        Ok(result) => result.map_err(|error| EnvError::term(kind, name, error)),
        Err(payload) => {
            let text = payload.downcast_ref::<&str>().map(|text| (*text).to_string());
            let message = text.or_else(|| payload.downcast_ref::<String>().cloned());
            let message = message.unwrap_or_else(|| "the panic has no message".into());
            Err(EnvError::TermPanic { kind, name: name.into(), message })
        }
    }
}
