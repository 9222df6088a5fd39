//! Progress of long work: a line before each part, with a bar on a terminal.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

/// Characters of a bar.
const BAR: usize = 20;

/// Progress over a number of parts.
#[derive(Debug)]
pub(crate) struct Progress {
    parts: usize,
    begun: usize,
    start: Instant,
    terminal: bool,
}

impl Progress {
    /// Starts work with this number of parts.
    pub(crate) fn new(parts: usize) -> Self {
        Self { parts, begun: 0, start: Instant::now(), terminal: std::io::stderr().is_terminal() }
    }

    /// Prints that the next part begins.
    pub(crate) fn begin(&mut self, what: &str) {
        self.begun += 1;
        let bar = if self.terminal { bar(self.begun - 1, self.parts) } else { String::new() };
        eprintln!("{bar}{} of {}, after {}: {what}", self.begun, self.parts, words(self.start.elapsed()));
    }

    /// Prints that all parts are done.
    pub(crate) fn end(&self) {
        eprintln!("{} of {} done in {}", self.begun, self.parts, words(self.start.elapsed()));
    }
}

/// A bar filled in proportion to the finished parts.
fn bar(done: usize, parts: usize) -> String {
    let filled = BAR * done.min(parts) / parts.max(1);
    format!("[{}{}] ", "#".repeat(filled), "-".repeat(BAR - filled))
}

/// A duration in readable units.
fn words(time: Duration) -> String {
    match time.as_secs() {
        seconds @ 0..60 => format!("{seconds} s"),
        seconds @ 60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        seconds => format!("{} h {} min", seconds / 3600, seconds % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_and_times() {
        assert_eq!(bar(0, 4), "[--------------------] ");
        assert_eq!(bar(1, 4), "[#####---------------] ");
        assert_eq!([bar(4, 4), bar(9, 4)], ["[####################] "; 2]);
        assert_eq!(bar(0, 0), "[--------------------] ");
        let of = |seconds| words(Duration::from_secs(seconds));
        assert_eq!(
            [of(0), of(59), of(60), of(3599), of(3660)],
            ["0 s", "59 s", "1 min 0 s", "59 min 59 s", "1 h 1 min"]
        );
    }
}
