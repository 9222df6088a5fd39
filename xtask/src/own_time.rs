//! Run time of a program without the load of other programs on the machine.

use std::fs;
use std::time::{Duration, Instant};

/// Ticks per second of the kernel's processor times: `USER_HZ`, which is 100 on every architecture supported here.
const TICKS: f64 = 100.0;

/// Watches a process from its start.
#[derive(Debug)]
pub(crate) struct OwnTime {
    begun: Instant,
    pid: u32,
    /// Processor time of the machine at the start \[s\], and the number of its cores; `None` if the kernel does not
    /// report it.
    machine: Option<(f64, f64)>,
    /// Processor time of the process at the last look \[s\].
    own: f64,
}

impl OwnTime {
    pub(crate) fn of(pid: u32) -> Self {
        let machine = fs::read_to_string("/proc/stat").ok().and_then(|text| machine(&text));
        Self { begun: Instant::now(), pid, machine, own: 0.0 }
    }

    /// Updates the processor time of the process. Call it while the process runs: the kernel discards the counters
    /// afterwards.
    pub(crate) fn update(&mut self) {
        let stat = fs::read_to_string(format!("/proc/{}/stat", self.pid)).ok();
        if let Some(own) = stat.and_then(|text| process(&text)) {
            self.own = self.own.max(own);
        }
    }

    /// Wall time since the start, minus the average time per core used by other programs.
    pub(crate) fn elapsed(&self) -> Duration {
        let clock = self.begun.elapsed();
        let now = fs::read_to_string("/proc/stat").ok().and_then(|text| machine(&text));
        match (self.machine, now) {
            (Some((before, cores)), Some((after, _))) => {
                Duration::from_secs_f64(time_alone(clock.as_secs_f64(), after - before, self.own, cores))
            }
            _ => clock,
        }
    }
}

/// Estimated run time \[s\] of a program alone on the machine. The program ran for `clock` seconds, while the machine's
/// cores worked for `busy` seconds in total, `own` of them for the program.
fn time_alone(clock: f64, busy: f64, own: f64, cores: f64) -> f64 {
    // Lower bound: the program's work spread over all cores.
    (clock - (busy - own).max(0.0) / cores).max(own / cores)
}

/// Processor time of all processes \[s\] and the number of cores, from `/proc/stat` (see proc(5)).
fn machine(text: &str) -> Option<(f64, f64)> {
    let numbers: Vec<f64> =
        text.lines().next()?.strip_prefix("cpu ")?.split_whitespace().map_while(|x| x.parse().ok()).collect();
    // User, nice and system; skipping idle and I/O wait; then interrupts and steal time.
    let busy = |k: &usize| numbers.get(*k).copied().unwrap_or(0.0);
    let all: f64 = [0, 1, 2, 5, 6, 7].iter().map(busy).sum();
    let is_core =
        |line: &&str| line.strip_prefix("cpu").is_some_and(|rest| rest.starts_with(|c: char| c.is_ascii_digit()));
    let cores = text.lines().filter(is_core).count();
    (cores > 0).then_some((all / TICKS, cores as f64))
}

/// User and system processor time of all ended child processes, including their children; zero if the kernel does not
/// report it.
pub(crate) fn of_children() -> Duration {
    let text = fs::read_to_string("/proc/self/stat").unwrap_or_default();
    Duration::from_secs_f64(children(&text).unwrap_or(0.0))
}

/// Processor time of the ended children of a process \[s\], from its `stat`: fields 16 and 17 of proc(5).
fn children(text: &str) -> Option<f64> {
    let numbers: Vec<&str> = text.rsplit_once(") ")?.1.split_whitespace().collect();
    let number = |field: usize| numbers.get(field - 3)?.parse::<f64>().ok();
    Some((number(16)? + number(17)?) / TICKS)
}

/// Processor time of a process \[s\], from its `stat`. The name in parentheses may contain any characters.
fn process(text: &str) -> Option<f64> {
    let numbers: Vec<&str> = text.rsplit_once(") ")?.1.split_whitespace().collect();
    // Fields 14 and 15; the first field after the name is field 3.
    let ticks = |field: usize| numbers.get(field - 3)?.parse::<f64>().ok();
    Some((ticks(14)? + ticks(15)?) / TICKS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_of_other_programs() {
        // Alone, on one core of two and on both.
        assert_eq!([time_alone(10.0, 10.0, 10.0, 2.0), time_alone(10.0, 20.0, 20.0, 2.0)], [10.0, 10.0]);
        // The program waited for others as long as it worked.
        assert_eq!(time_alone(20.0, 40.0, 20.0, 2.0), 10.0);
        // Processor times and wall time are sampled at slightly different times.
        assert_eq!(time_alone(10.0, 19.0, 20.0, 2.0), 10.0);
    }

    #[test]
    fn counts_of_the_kernel() {
        let text = "cpu  100 20 30 9000 500 6 7 8 0 0\ncpu0 1 1 1\ncpu1 1 1 1\nintr 5\n";
        let (busy, cores) = machine(text).unwrap_or_default();
        assert!((busy - 1.71).abs() < 1e-9 && cores == 2.0, "{busy} {cores}");
        assert_eq!(machine("nothing"), None);
        let stat = "17 (a b) c) S 1 17 17 0 -1 4194304 10 0 0 0 250 50 0 0 20 0 3 0 5";
        assert_eq!(process(stat), Some(3.0));
        assert_eq!(process("17 (a) S 1"), None);
    }

    #[test]
    fn this_process_works() {
        let mut watch = OwnTime::of(std::process::id());
        let begun = Instant::now();
        let mut sum = 0_u64;
        while begun.elapsed() < Duration::from_millis(300) {
            sum = sum.wrapping_add(std::hint::black_box(1));
        }
        watch.update();
        assert!(sum > 0 && watch.elapsed() <= begun.elapsed() + Duration::from_millis(50), "{watch:?}");
        assert!(!cfg!(target_os = "linux") || watch.own > 0.0, "{watch:?}");
    }
}
