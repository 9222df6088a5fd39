//! Processes that are killed while they record. Everything recorded more than a second before the kill can be read from an
//! MCAP file. A recording in another format never has its final name, and its name can be used again.

use super::*;
use crate::file::partial_path_of;
use crate::folder::has_file;
use std::io::{BufRead, BufReader, Write};
use std::process::Stdio;
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::mpsc::channel;
use std::time::{Duration, Instant, SystemTime, UNIX_EPOCH};

/// Set in child processes only: the file to record to.
const FILE: &str = "KINETOSCOPE_TEST_RECORD_TO";
/// Number of killed processes of each format: 50 for MCAP and 30 for the others in CI, 200 in all, else few.
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
    world.sim.record(cfg_of(Path::new(&path))).unwrap();
    for step in 0.. {
        world.step(step);
        let mut out = std::io::stdout().lock();
        writeln!(out, "done {}", step + 1).unwrap();
        out.flush().unwrap();
        std::thread::sleep(Duration::from_millis(4));
    }
}

/// Records everything that the format supports.
fn cfg_of(path: &Path) -> RecorderCfg {
    let cfg = RecorderCfg::new(path);
    match Format::of_path(path).unwrap().is_animation() {
        true => RecorderCfg { envs: Some(vec![EnvId(0)]), ..cfg.with_topics([Topic::channel("camera", "color")]) },
        false => cfg,
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

/// Kills a number of processes, some at a time, and returns the number. `in_ci` is the number in CI.
fn kill_many(in_ci: u32, kill_one: impl Fn(&Path, u32) + Sync) -> u32 {
    let usual = if std::env::var_os("CI").is_some() { in_ci } else { 4 };
    let kills: u32 = std::env::var(KILLS).ok().and_then(|count| count.parse().ok()).unwrap_or(usual);
    let folder = tempfile::tempdir().unwrap();
    let next = AtomicU32::new(0);
    let work = || {
        loop {
            let kill = next.fetch_add(1, Ordering::Relaxed);
            if kill >= kills {
                return;
            }
            kill_one(folder.path(), kill);
        }
    };
    // A panic of a thread is noticed at the end.
    std::thread::scope(|scope| (0..AT_A_TIME.min(kills)).for_each(|_| drop(scope.spawn(work))));
    assert_eq!(next.load(Ordering::Relaxed), kills + AT_A_TIME.min(kills), "each of them was killed");
    kills
}

/// A duration below `limit` that differs in every run.
fn chance(limit: u64) -> Duration {
    let micros = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().subsec_micros();
    Duration::from_millis(u64::from(micros) % limit)
}

#[test]
fn readable_rows() {
    kill_many(50, kill_once);
}

#[test]
fn archives() {
    kill_many(30, |folder, kill| kill_other(folder, kill, "run.npz", |_| ()));
}

#[test]
fn gifs() {
    kill_many(30, |folder, kill| kill_other(folder, kill, "run.gif", |_| ()));
}

#[test]
fn videos() {
    kill_many(30, |folder, kill| kill_other(folder, kill, "run.mp4", |_| ()));
}

/// Every image in the partial folder is complete, and is there if `times.csv` lists it.
#[test]
fn image_folders() {
    let images = AtomicU32::new(0);
    let inspect = |part: &Path| {
        for path in kinetoscope_testkit::test_resources::files_below(part, "png") {
            let image = image::open(&path).unwrap();
            assert_eq!((image.width(), image.height()), (32, 24), "{}", path.display());
            images.fetch_add(1, Ordering::Relaxed);
        }
        let times = std::fs::read_to_string(part.join("times.csv")).unwrap_or_default();
        // The process may be killed within the last line.
        let (complete, _) = times.rsplit_once('\n').unwrap_or_default();
        for line in complete.lines().skip(1) {
            let name = line.split('"').nth(1).unwrap();
            assert!(part.join(name).is_file(), "{line}");
        }
    };
    let kills = kill_many(30, |folder, kill| kill_other(folder, kill, "images", inspect));
    // All of a few processes may be killed before the first image.
    assert!(images.into_inner() > 0 || kills < 20, "control: there were images");
}

/// The file that makes a folder a dataset is missing.
#[test]
#[cfg_attr(not(feature = "lerobot"), ignore = "needs the feature lerobot")]
fn datasets() {
    let inspect = |part: &Path| assert!(!part.join("meta/info.json").exists());
    kill_many(30, |folder, kill| kill_other(folder, kill, "run.lerobot", inspect));
}

/// Kills a process at a random time. Its recording does not have its final name. The partial file or folder is inspected,
/// if there is one. Then the same name is recorded again.
fn kill_other(folder: &Path, kill: u32, name: &str, inspect: impl Fn(&Path)) {
    let folder = folder.join(kill.to_string());
    std::fs::create_dir(&folder).unwrap();
    let path = folder.join(name);
    // A third of the processes are killed early: while the file is created.
    let is_short = kill.is_multiple_of(3);
    let life = chance(if is_short { 300 } else { 900 });
    kill_after(&path, life, !is_short);
    assert!(!path.exists(), "only a whole recording has its name");
    let part = partial_path_of(&path);
    let left = names(&folder);
    // A process that is killed while a file is created may leave its temporary folder.
    let is_known = |left: &String| left.starts_with(".tmp") || *left == format!("{name}.part");
    assert!(left.iter().all(is_known) && (is_short || part.exists()), "{left:?}");
    let has_content = match part.is_dir() {
        true => has_file(&part).unwrap(),
        false => part.metadata().is_ok_and(|file| file.len() > 0),
    };
    println!("{name}, kill {kill} after {life:?}: {}", if has_content { "it left data" } else { "it left no data" });
    if part.exists() {
        inspect(&part);
    }
    // Such a recording cannot be recovered, and the attempt deletes nothing.
    let error = recover(&path).unwrap_err().to_string();
    assert!(error.contains(name), "{error}");
    assert_eq!(names(&folder), left);
    // Content is not replaced without permission.
    let mut world = World::new(2, 1);
    if has_content {
        let error = world.sim.record(cfg_of(&path)).unwrap_err();
        assert!(matches!(&error, RecordError::Unfinished { recoverable: false, .. }), "{error}");
        assert_eq!(names(&folder), left);
    }
    let cfg = if has_content { overwriting(cfg_of(&path)) } else { cfg_of(&path) };
    let summary = record_steps(&mut world, cfg, 2 * IMAGE_EVERY);
    assert!(path.exists() && !part.exists() && summary.bytes > 100, "{summary}");
    if name == "run.npz" {
        assert_eq!(numbers_of(&path, "arm/joint_states/step").len(), 2 * IMAGE_EVERY as usize + 1);
    }
}

fn kill_once(folder: &Path, kill: u32) {
    let path = folder.join(format!("{kill}.mcap"));
    // A third of the processes are killed early: while the file is created, and before anything is a second old. The
    // others anywhere between two flushes.
    let short = kill.is_multiple_of(3);
    let life = if short { chance(1200) } else { Duration::from_millis(1200) + chance(1000) };
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
