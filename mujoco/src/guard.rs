//! Conversion of MuJoCo's errors to values: the error handler unwinds out of C to [`guarded`].
//!
//! A guarded call must have no C++ landing pads in its C frames: in the 4.x wheel, unwinding through a frame with
//! landing pads crashes. Guarded are the engine functions (step, forward, makeData, ...). The XML and VFS functions
//! report through buffers and are never guarded.

use super::error::EngineError;
use mujoco_sys as mj;
use std::cell::Cell;
use std::ffi::{CStr, c_char};
use std::io::Write as _;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};

thread_local! {
    /// True while a guarded engine call runs on this thread.
    static GUARDED: Cell<bool> = const { Cell::new(false) };
}

/// The payload that carries MuJoCo's message from the handler to [`guarded`].
struct EngineStopped(String);

unsafe extern "C-unwind" fn on_error(message: *const c_char) {
    // SAFETY: MuJoCo passes a NUL-terminated message that lives until this handler ends.
    let text = unsafe { CStr::from_ptr(message) }.to_string_lossy().into_owned();
    if GUARDED.get() {
        resume_unwind(Box::new(EngineStopped(text)));
    }
    // MuJoCo exits the process when a handler returns. Every engine call of this crate is guarded, so a message that
    // arrives here is a bug of this crate. Aborting is safer than unwinding through unknown frames.
    //
    // Without a subscriber, an event is lost, and a subscriber may keep it in a buffer that is not written. A process
    // that ends needs a reason in any case, so the message is also written here. Panics must not unwind from here.
    let _ = writeln!(std::io::stderr(), "kinetoscope: MuJoCo error outside a guarded call: {text}");
    let _ = catch_unwind(|| {
        tracing::error!(target: "kinetoscope_mujoco", "MuJoCo error outside a guarded call: {text}");
    });
    std::process::abort();
}

/// Passes a warning on as an event. The handler keeps MuJoCo from writing to the console and to a log file.
///
/// `mjData.warning` counts warnings. Most of them are handled by the caller, which repeats the step with larger buffers
/// or ends the environment, so the text alone is for debugging.
unsafe extern "C-unwind" fn on_warning(message: *const c_char) {
    // A panic of a subscriber must not unwind into MuJoCo's frames.
    let _ = catch_unwind(|| {
        if tracing::enabled!(target: "kinetoscope_mujoco", tracing::Level::DEBUG) {
            // SAFETY: MuJoCo passes a NUL-terminated message that lives until this handler ends.
            let text = unsafe { CStr::from_ptr(message) }.to_string_lossy();
            tracing::debug!(target: "kinetoscope_mujoco", "{text}");
        }
    });
}

/// Replaces MuJoCo's process-wide error and warning handlers. Called once, from `check_version`.
pub(super) fn install_handlers() {
    // SAFETY: the handler is a plain pointer, written once before any other MuJoCo call of this process.
    unsafe { mj::mju_user_error = Some(on_error) };
    // SAFETY: as above.
    unsafe { mj::mju_user_warning = Some(on_warning) };
}

/// Runs an engine call. An `mju_error` inside it becomes an `Err`.
pub(super) fn guarded<T>(call: impl FnOnce() -> T) -> Result<T, EngineError> {
    let outer = GUARDED.replace(true);
    // AssertUnwindSafe: the caller treats the data it passed as lost when this returns an error.
    let result = catch_unwind(AssertUnwindSafe(call));
    GUARDED.set(outer);
    result.map_err(|payload| match payload.downcast::<EngineStopped>() {
        Ok(stopped) => EngineError { message: stopped.0 },
        Err(other) => resume_unwind(other),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_testkit::process;
    use std::os::unix::process::ExitStatusExt as _;

    const SIGABRT: i32 = 6;

    /// Root cause: the message was an event only, so that a process without a subscriber ended without a reason.
    #[test]
    fn error_outside_a_guarded_call() {
        let output = process::run(module_path!(), "unguarded_scenario", &std::env::temp_dir(), &[]);
        let text = process::text(&output.stderr);
        assert!(text.contains("kinetoscope: MuJoCo error outside a guarded call: too small"), "{text}");
        assert_eq!(output.status.signal(), Some(SIGABRT), "{text}");
    }

    #[test]
    #[ignore = "runs in a process of its own"]
    fn unguarded_scenario() {
        if !process::is_child() {
            return;
        }
        crate::check_version().expect("headers and library belong together");
        // SAFETY: the message is a literal with a NUL at its end and no placeholders.
        unsafe { mj::mju_error(c"too small".as_ptr()) };
    }
}
