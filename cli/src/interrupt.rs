//! Ctrl+C as a good end.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Raised by Ctrl+C, which also does `act`; a second Ctrl+C ends the program at once.
pub(crate) fn on_ctrl_c(act: impl Fn() + Send + 'static) -> Arc<AtomicBool> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    // Some programs send the signal to a process and to its group: that is one Ctrl+C.
    let mut first: Option<Instant> = None;
    let handler = ctrlc::set_handler(move || {
        flag.store(true, Ordering::SeqCst);
        act();
        if first.get_or_insert_with(Instant::now).elapsed() > Duration::from_secs(1) {
            std::process::exit(130);
        }
    });
    if let Err(error) = handler {
        eprintln!("warning: Ctrl+C will end the program at once: {error}");
    }
    interrupted
}
