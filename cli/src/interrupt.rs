//! Clean shutdown on Ctrl+C.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Returns a flag that Ctrl+C sets. Ctrl+C also calls `on_interrupt`; another Ctrl+C more than a second after the first
/// exits the program at once.
pub(crate) fn on_ctrl_c(on_interrupt: impl Fn() + Send + 'static) -> Arc<AtomicBool> {
    let interrupted = Arc::new(AtomicBool::new(false));
    let flag = Arc::clone(&interrupted);
    // Some programs send the signal to the process and to its group; both count as one Ctrl+C.
    let mut first: Option<Instant> = None;
    let handler = ctrlc::set_handler(move || {
        flag.store(true, Ordering::SeqCst);
        on_interrupt();
        if first.get_or_insert_with(Instant::now).elapsed() > Duration::from_secs(1) {
            std::process::exit(130);
        }
    });
    if let Err(error) = handler {
        eprintln!("warning: Ctrl+C will end the program at once: {error}");
    }
    interrupted
}
