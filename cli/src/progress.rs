//! Progress of long tasks on standard error: a bar on a terminal, otherwise a line every ten seconds.

use indicatif::{ProgressBar, ProgressStyle};
use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Interval between two updates.
const UPDATE_INTERVAL: Duration = Duration::from_millis(100);
/// Interval between two lines.
const LINE_INTERVAL: Duration = Duration::from_secs(10);

/// Runs `work` and reports its progress. `done` returns the completed fraction, 0 to 1, or `None` if unknown.
pub(crate) fn with_progress<T>(what: &str, done: impl Fn() -> Option<f64> + Send, work: impl FnOnce() -> T) -> T {
    let (ended, until_ended) = channel::<()>();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let (start, terminal) = (Instant::now(), std::io::stderr().is_terminal());
            let mut lines = LineSchedule::from(start);
            let bar = ProgressBar::new(1000);
            let style = ProgressStyle::with_template("{msg} {wide_bar} {percent:>3} %");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            bar.set_message(what.to_owned());
            while until_ended.recv_timeout(UPDATE_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                let share = done();
                if terminal {
                    // A task that ends before the first update shows no bar.
                    share.into_iter().for_each(|share| bar.set_position((1000.0 * share) as u64));
                } else if lines.is_due(Instant::now()) {
                    eprintln!("{}", progress_line(what, share, start.elapsed()));
                }
            }
            bar.finish_and_clear();
        });
        let result = work();
        drop(ended);
        result
    })
}

/// Schedule of the progress lines.
#[derive(Debug)]
struct LineSchedule {
    last: Instant,
}

impl LineSchedule {
    fn from(start: Instant) -> Self {
        Self { last: start }
    }

    fn is_due(&mut self, now: Instant) -> bool {
        let due = now.saturating_duration_since(self.last) >= LINE_INTERVAL;
        if due {
            self.last = now;
        }
        due
    }
}

fn progress_line(what: &str, share: Option<f64>, passed: Duration) -> String {
    let share = share.map_or_else(String::new, |share| format!(" {:.0} %,", (100.0 * share).clamp(0.0, 100.0)));
    format!("{what}:{share} after {} s", passed.as_secs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines() {
        let start = Instant::now();
        let mut lines = LineSchedule::from(start);
        let due: Vec<u64> = (0..35).filter(|s| lines.is_due(start + Duration::from_secs(*s))).collect();
        assert_eq!(due, [10, 20, 30]);
        assert_eq!(progress_line("paths", Some(0.254), Duration::from_secs(12)), "paths: 25 %, after 12 s");
        assert_eq!(progress_line("steps", None, Duration::from_secs(40)), "steps: after 40 s");
        assert_eq!(with_progress("work", || None, || 7), 7);
    }
}
