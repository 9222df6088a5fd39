//! Processor time of other programs during a measurement.

use std::fs;

/// Unit of times below /proc \[s\]: Linux shows them in hundredths of a second on every architecture.
pub(crate) const TICK: f64 = 0.01;

/// Processor time \[s\], of all cores together, used since boot by processes other than this one and the processes
/// `ours`; `None` without /proc, or if one of `ours` has ended.
pub(crate) fn seconds(ours: &[u32]) -> Option<f64> {
    let busy = busy_ticks(&fs::read_to_string("/proc/stat").ok()?)?;
    let mut own = process_ticks(&fs::read_to_string("/proc/self/stat").ok()?)?;
    for pid in ours {
        own += process_ticks(&fs::read_to_string(format!("/proc/{pid}/stat")).ok()?)?;
    }
    Some((busy as f64 - own as f64) * TICK)
}

/// All fields but `idle` and `iowait` in the first line of /proc/stat; `guest` times are already part of `user`.
fn busy_ticks(stat: &str) -> Option<u64> {
    let line = stat.lines().next()?.strip_prefix("cpu ")?;
    let ticks: Vec<u64> = line.split_whitespace().map(str::parse).collect::<Result<_, _>>().ok()?;
    Some(ticks.iter().take(8).enumerate().filter(|(i, _)| *i != 3 && *i != 4).map(|(_, t)| t).sum())
}

/// `utime + stime` of a line such as `12 (a name) S 1 ...`; that of a process includes threads that have ended.
pub(crate) fn process_ticks(stat: &str) -> Option<u64> {
    let mut fields = stat.get(stat.rfind(')')? + 1..)?.split_whitespace().skip(11);
    Some(fields.next()?.parse::<u64>().ok()? + fields.next()?.parse::<u64>().ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn idle_and_guest_times() {
        assert_eq!(busy_ticks("cpu  1 2 4 1000 2000 8 16 32 4000 8000\ncpu0 1"), Some(63));
    }

    #[test]
    fn names_with_blanks() {
        assert_eq!(process_ticks("7 (a) b) S 1 2 3 4 5 6 7 8 9 10 30 12 0 0"), Some(42));
    }

    #[test]
    fn our_own_work_is_not_foreign() {
        let (Some(before), start) = (seconds(&[]), std::time::Instant::now()) else { return };
        let mut x = 1_u64;
        while start.elapsed().as_secs_f64() < 0.3 {
            x = std::hint::black_box(x.wrapping_mul(3));
        }
        let all = seconds(&[]).unwrap_or(f64::NAN) - before;
        // Other programs may run at the same time, on at most all other cores.
        let others = (std::thread::available_parallelism().map_or(1, usize::from) - 1) as f64;
        assert!(all < 0.3 * others + 0.15, "{all}");
    }
}
