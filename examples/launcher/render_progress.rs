//! Progress of a long rendering, shown at the terminal.

use super::LINE_INTERVAL;
use indicatif::{ProgressBar, ProgressStyle};
use kinetoscope::render::RenderProgress;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

/// Interval between two progress updates.
const UPDATE_INTERVAL: Duration = Duration::from_millis(100);

/// Runs `work`, a path tracing job, and meanwhile shows its progress on the terminal. After `limit` the job is
/// canceled. `on_update` is called every tenth of a second from another thread and may also cancel the job.
pub(crate) fn render_with_progress<T>(
    progress: &RenderProgress,
    limit: Option<Duration>,
    mut on_update: impl FnMut(&RenderProgress) + Send,
    work: impl FnOnce() -> T,
) -> T {
    let (done, until_done) = channel::<()>();
    let start = Instant::now();
    std::thread::scope(|scope| {
        scope.spawn(move || {
            let bar = ProgressBar::new(0);
            let style = ProgressStyle::with_template("{percent:>3} % {wide_bar} {msg}");
            bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
            let mut last_line = start;
            // Ends when the work is done, or when its thread has dropped the sender.
            while until_done.recv_timeout(UPDATE_INTERVAL) == Err(RecvTimeoutError::Timeout) {
                if limit.is_some_and(|limit| start.elapsed() > limit) {
                    progress.cancel();
                }
                on_update(progress);
                if progress.total() == 0 {
                    continue;
                }
                bar.set_length(progress.total());
                bar.set_position(progress.samples());
                bar.set_message(message(progress));
                if bar.is_hidden() && last_line.elapsed() >= LINE_INTERVAL {
                    last_line = Instant::now();
                    let share = progress.fraction().map_or(0.0, |share| 100.0 * share);
                    eprintln!("{share:.0} % of the paths, {}", message(progress));
                }
            }
            bar.finish_and_clear();
        });
        let result = work();
        drop(done);
        result
    })
}

/// Rates, and the remaining time.
fn message(progress: &RenderProgress) -> String {
    let seconds = progress.elapsed().map_or(0.0, |time| time.as_secs_f64());
    let rate = |count: u64| if seconds > 0.0 { count as f64 / seconds / 1e6 } else { 0.0 };
    let left = progress.remaining().map_or_else(String::new, |left| format!(", {} s left", left.as_secs()));
    format!("{:.2} M paths/s, {:.2} M rays/s{left}", rate(progress.samples()), rate(progress.rays()))
}
