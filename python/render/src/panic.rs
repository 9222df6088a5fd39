//! Panics become Python exceptions of type `RuntimeError`. The exception of pyo3 for panics is not a subclass of
//! `Exception`, so that programs that report errors and continue would end.

use pyo3::exceptions::PyRuntimeError;
use pyo3::{PyErr, PyResult};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// Calls `work`. A panic becomes a `RuntimeError` with its message.
///
/// Data that a panic left half written is overwritten by the next call: frames and scratch memory are filled anew.
pub(crate) fn catch<T>(work: impl FnOnce() -> PyResult<T>) -> PyResult<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| {
        let message = panic.downcast_ref::<String>().map(String::as_str);
        let message = message.or_else(|| panic.downcast_ref::<&str>().copied()).unwrap_or("no message");
        Err(error(message))
    })
}

fn error(message: &str) -> PyErr {
    PyRuntimeError::new_err(format!("internal error of kinetoscope_render, please report it: {message}"))
}
