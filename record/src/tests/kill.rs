//! Processes that are killed while they record. Everything recorded more than a second before the kill can be read, if
//! the format is written during the recording.

use super::*;
use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Set in child processes only: the file to record to.
const FILE: &str = "KINETOSCOPE_TEST_RECORD_TO";
/// Number of killed processes: 50 in CI, else few.
const KILLS: &str = "KINETOSCOPE_TEST_KILLS";
/// Number of simultaneous processes, which mostly sleep.
const AT_A_TIME: u32 = 8;

/// Records until it is killed, and prints its completed steps.
#[test]
#[ignore = "runs in a process of its own"]
fn scenario_endless() {
    let Some(path) = std::env::var_os(FILE) else { return };
    let mut world = World::new(2, 1);
    // The process may be killed before there is a file.
    writeln!(std::io::stdout(), "\ndone 0").unwrap();
    world.sim.record(RecorderCfg::new(path)).unwrap();
    for step in 0.. {
        world.step(step);
        let mut out = std::io::stdout().lock();
        writeln!(out, "done {}", step + 1).unwrap();
        out.flush().unwrap();
        std::thread::sleep(Duration::from_millis(4));
    }
}

/// Kills a process `life` after its first step (`begun`), or from a time before there is a file. Returns the number of
/// steps that were done one second before the kill.
fn kill_after(path: &Path, life: Duration, begun: bool) -> u64 {
    let mut child = kinetoscope_testkit::process::command(module_path!(), "scenario_endless")
        .env(FILE, path)
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = BufReader::new(child.stdout.take().unwrap()).lines();
    let (said, heard) = channel();
    let reader = std::thread::spawn(move || {
        for line in lines.map_while(Result::ok) {
            if let Some(steps) = line.strip_prefix("done ").and_then(|steps| steps.parse::<u64>().ok()) {
                said.send((Instant::now(), steps)).unwrap();
            }
        }
    });
    let mut done = vec![heard.recv().unwrap()];
    while begun && done.iter().all(|(_, steps)| *steps == 0) {
        done.push(heard.recv().unwrap());
    }
    // The kill may come at any point, including the first line or the first bytes of the file.
    std::thread::sleep(life);
    let end = Instant::now();
    // SIGKILL, on Unix.
    child.kill().unwrap();
    child.wait().unwrap();
    reader.join().unwrap();
    done.extend(heard.try_iter());
    let old = done.iter().filter(|(time, _)| end.duration_since(*time) >= Duration::from_secs(1));
    old.map(|(_, steps)| *steps).max().unwrap_or(0)
}

#[test]
fn readable_rows() {
    let usual = if std::env::var_os("CI").is_some() { 50 } else { 4 };
    let kills: u32 = std::env::var(KILLS).ok().and_then(|count| count.parse().ok()).unwrap_or(usual);
    let folder = tempfile::tempdir().unwrap();
    let next = AtomicU32::new(0);
    let work = || {
        loop {
            let kill = next.fetch_add(1, Ordering::Relaxed);
            if kill >= kills {
                return;
            }
            kill_once(folder.path(), kill);
        }
    };
    // A panic of a thread is noticed at the end.
    std::thread::scope(|scope| (0..AT_A_TIME.min(kills)).for_each(|_| drop(scope.spawn(work))));
    assert_eq!(next.load(Ordering::Relaxed), kills + AT_A_TIME.min(kills), "each of them was killed");
}

fn kill_once(folder: &Path, kill: u32) {
    let path = folder.join(format!("{kill}.mcap"));
    // A different time in every run, anywhere between two flushes.
    let chance = u64::from(SystemTime::now().duration_since(UNIX_EPOCH).unwrap().subsec_micros());
    // A third of the processes are killed early: while the file is created, and before anything is a second old.
    let short = kill.is_multiple_of(3);
    let life = Duration::from_millis(if short { chance % 1200 } else { 1200 + chance % 1000 });
    let old = kill_after(&path, life, !short);
    assert!(short || old > 0, "it had done nothing a second before the end");
    assert!(!path.exists(), "only a whole file has its name");
    assert!(short || path.with_extension("mcap.part").exists());
    let recovered = match recover(&path) {
        Ok(recovered) => recovered,
        Err(error) => {
            // No data was a second old, and no message was complete: the partial file remains, and no file gets the
            // name.
            let said = error.to_string();
            let begun = ["it has no complete message", "this is not an MCAP file", "entity not found"];
            assert!(old == 0 && begun.iter().any(|what| said.contains(what)), "step {old}: {said}");
            assert!(!path.exists());
            println!("kill {kill} after {life:?}: nothing was written yet");
            return;
        }
    };
    assert_eq!(recovered.damage, None, "a kill tears the end, and damages nothing");
    assert!(!path.with_extension("mcap.part").exists());
    let all = messages(&path);
    assert_eq!(all.len() as u64, recovered.messages);
    for env in 0..2 {
        let steps = steps_of(&all, &format!("/env_{env}/arm/joint_states"));
        assert!(steps.iter().copied().eq(0..steps.len() as u64), "every step, in order");
        let last = steps.last().copied().unwrap_or(0);
        assert!(old == 0 || !steps.is_empty());
        println!("kill {kill} after {life:?}: step {last} is readable, {old} was done a second before");
        assert!(last >= old, "step {old} was done a second before the end; the file ends with {last}");
    }
}
