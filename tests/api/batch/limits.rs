//! Limits of the system: sizes of files, open files, stacks, threads. Calls beyond a limit return an error that
//! names the file or the thread, no file is damaged, and the simulation goes on with the same bits. The scenarios run in
//! processes of their own, because the limits are those of a process.

use super::support::{all_bits, cfg, sim};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::record::{RecorderCfg, Recording, Topic};
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sim::Snapshot;
use kinetoscope_testkit::process::{command, is_child, text};
use kinetoscope_testkit::wait;
use kinetoscope_testkit::worlds::{camera, sr5};
use std::collections::hash_map::DefaultHasher;
use std::fs::{self, File};
use std::hash::{Hash, Hasher};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Duration;

/// Set in child processes only: the folder of their files.
const FOLDER: &str = "KINETOSCOPE_TEST_FOLDER";

/// Runs a scenario that must succeed, after these commands of a shell. Returns its output.
#[track_caller]
fn limited(limits: &str, scenario: &str, folder: &Path, variables: &[(&str, &str)]) -> String {
    let child = command(module_path!(), scenario);
    let inherited = child.get_envs().filter_map(|(name, value)| Some((name, value?)));
    let output = Command::new("sh")
        .args(["-c", &format!("{limits} && exec \"$0\" \"$@\"")])
        .arg(child.get_program())
        .args(child.get_args())
        .envs(inherited)
        .env(FOLDER, folder)
        .envs(variables.iter().copied())
        .output()
        .unwrap();
    let all = format!("{}\n{}", text(&output.stdout), text(&output.stderr));
    assert!(output.status.success() && all.contains("1 passed"), "{:?}: {all}", output.status);
    all
}

fn folder() -> PathBuf {
    std::env::var_os(FOLDER).unwrap().into()
}

/// Moving arms with a camera.
fn arms(num_envs: usize, threads: usize) -> (SimulationManager, SensorId<Camera>) {
    let mut sim = sim(cfg(num_envs, threads));
    let arm = sim.add_robot(sr5("arm")).unwrap();
    let targets = Array2::from_shape_fn((num_envs, 6), |(env, joint)| 0.3 * (env as f64 - 2.0) + 0.1 * joint as f64);
    sim.robot_mut(arm).set_qpos_target(&targets, None, None).unwrap();
    let channels = Channels { color: true, depth: true, ..Channels::NONE };
    let eye = CameraCfg { update_period: 0.02, ..camera([64, 48], [1.5, 1.0, 1.0], [0.2, 0.0, 0.4], channels) };
    let eye = sim.add_sensor("eye", eye).unwrap();
    (sim, eye)
}

/// Digest of the states and images of eight arms after 50 steps.
fn digest(sim: &SimulationManager, eye: SensorId<Camera>) -> String {
    let mut hasher = DefaultHasher::new();
    all_bits(sim).hash(&mut hasher);
    sim.sensor(eye).unwrap().color().unwrap().iter().for_each(|value| value.hash(&mut hasher));
    format!("digest {:016x}", hasher.finish())
}

/// The digest in a process without limits.
fn expected_digest() -> String {
    let (mut sim, eye) = arms(8, 2);
    sim.update(50);
    let digest = digest(&sim, eye);
    // Control: another step is another state.
    sim.update(1);
    assert_ne!(self::digest(&sim, eye), digest);
    digest
}

/// Calls that write a file or folder: its name, and the call.
type Writes = [(&'static str, fn(&mut SimulationManager, &Path) -> Result<(), String>); 8];

const WRITES: Writes = [
    ("state.snapshot", |sim, path| message(sim.snapshot(None).unwrap().save(path))),
    ("image.png", |sim, path| message(sim.screenshot(path))),
    ("dump", |sim, path| message(sim.dump(path))),
    ("run.mcap", |sim, path| record(sim, RecorderCfg::new(path))),
    ("run.npz", |sim, path| record(sim, RecorderCfg::new(path))),
    ("images", |sim, path| record(sim, RecorderCfg::new(path).with_topics([Topic::channel("eye", "color")]))),
    ("run.gif", |sim, path| record(sim, animation(path))),
    ("run.mp4", |sim, path| record(sim, animation(path))),
];

fn message<T, E: ToString>(result: Result<T, E>) -> Result<(), String> {
    result.map(drop).map_err(|error| error.to_string())
}

fn animation(path: &Path) -> RecorderCfg {
    let cfg = RecorderCfg { envs: Some(vec![EnvId(0)]), ..RecorderCfg::new(path) };
    cfg.with_topics([Topic::channel("eye", "color")])
}

fn record(sim: &mut SimulationManager, cfg: RecorderCfg) -> Result<(), String> {
    let recorder = sim.record(RecorderCfg { overwrite: true, ..cfg }).map_err(|error| error.to_string())?;
    sim.update(10);
    message(sim.finish_recording(recorder))
}

/// The system refuses every byte of a file, as a full disk does. Files of the same names stay.
#[test]
fn no_room_for_files() {
    let folder = tempfile::tempdir().unwrap();
    let files: Vec<_> = WRITES.iter().map(|(name, _)| *name).filter(|name| name.contains('.')).collect();
    files.iter().for_each(|name| fs::write(folder.path().join(name), "precious").unwrap());
    // A signal would end a program that does not ignore it; such programs get the error.
    let all = limited("trap '' XFSZ && ulimit -f 0", "scenario_no_room", folder.path(), &[]);
    assert!(all.contains(&expected_digest()), "{all}");
    for name in files {
        assert_eq!(fs::read(folder.path().join(name)).unwrap(), b"precious", "{name}");
    }
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_no_room() {
    if !is_child() {
        return;
    }
    let (mut steady, eye) = arms(8, 2);
    let (mut sim, _) = arms(2, 2);
    for (name, write) in WRITES {
        let error = write(&mut sim, &folder().join(name)).unwrap_err();
        assert!(error.contains(name) && error.contains("File too large"), "{name}: {error}");
    }
    steady.update(50);
    println!("{}", digest(&steady, eye));
}

/// Opens files until the system refuses.
fn take_descriptors() -> Vec<File> {
    let held: Vec<File> = std::iter::from_fn(|| File::open("/dev/null").ok()).collect();
    assert!((1..16).contains(&held.len()), "{}", held.len());
    held
}

/// No further file or connection can be opened. Calls return errors that name the file. A recording that has begun is
/// completed, and a browser view serves clients that came in the meantime, as soon as there is room.
#[test]
fn few_descriptors() {
    let folder = tempfile::tempdir().unwrap();
    let all = limited("ulimit -n 16", "scenario_few_descriptors", folder.path(), &[]);
    assert!(all.contains(&expected_digest()), "{all}");
    for name in ["begun.mcap", "later.npz"] {
        assert!(
            Recording::open(folder.path().join(name)).unwrap().topics().iter().any(|topic| topic.name.contains("arm"))
        );
    }
    Snapshot::load(folder.path().join("state.snapshot")).unwrap();
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_few_descriptors() {
    if !is_child() {
        return;
    }
    let (mut sim, eye) = arms(8, 2);
    let served = sim.serve("127.0.0.1:0").unwrap();
    let begun = sim.record(RecorderCfg::new(folder().join("begun.mcap"))).unwrap();
    let mut held = take_descriptors();
    sim.update(25);
    for (name, write) in WRITES {
        let error = write(&mut sim, &folder().join(name)).unwrap_err();
        assert!(error.contains(name) && error.contains("Too many open files"), "{name}: {error}");
    }
    let error = sim.add_robot(sr5("another")).unwrap_err().to_string();
    assert!(error.contains("SR5.urdf") && error.contains("Too many open files"), "{error}");
    let error = message(sim.serve("127.0.0.1:0")).unwrap_err();
    assert!(error.contains("Too many open files"), "{error}");
    // A client takes the only free descriptor, so that the server has none for its side.
    drop(held.pop());
    let mut client = TcpStream::connect(served.address()).unwrap();
    client.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    client.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    assert!(client.read(&mut [0; 16]).is_err(), "the server had a descriptor");
    drop(held);
    client.set_read_timeout(Some(wait::TIMEOUT)).unwrap();
    let mut answer = [0; 12];
    client.read_exact(&mut answer).unwrap();
    assert_eq!(&answer, b"HTTP/1.1 200");
    drop(client);
    let held = take_descriptors();
    // The steps of the recordings that could not begin were not made.
    sim.update(25);
    sim.finish_recording(begun).unwrap();
    println!("{}", digest(&sim, eye));
    drop(held);
    sim.snapshot(None).unwrap().save(folder().join("state.snapshot")).unwrap();
    record(&mut sim, RecorderCfg::new(folder().join("later.npz"))).unwrap();
}

/// A stack that is larger than the address space, so that the system starts no thread of the standard library.
const HUGE_STACK: &str = "1125899906842624";

/// The system starts no thread. A simulation on the thread of the caller has the bits of one with two threads; calls that
/// need a thread return an error.
#[test]
fn refused_threads() {
    let folder = tempfile::tempdir().unwrap();
    let all = limited("true", "scenario_refused_threads", folder.path(), &[("RUST_MIN_STACK", HUGE_STACK)]);
    assert!(all.contains(&expected_digest()), "{all}");
    for entry in fs::read_dir(folder.path()).unwrap() {
        let name = entry.unwrap().file_name();
        assert!(name.to_string_lossy().ends_with(".part"), "{name:?} looks like a complete recording");
    }
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_refused_threads() {
    if !is_child() {
        return;
    }
    assert!(std::thread::Builder::new().spawn(|| ()).is_err(), "control: a thread was started");
    let error = SimulationManager::new(cfg(8, 2)).unwrap_err().to_string();
    assert!(error.contains("cannot start a worker thread"), "{error}");
    let (mut sim, eye) = arms(8, 1);
    for name in ["run.mcap", "run.npz", "images", "run.gif"] {
        let cfg =
            if name == "run.gif" { animation(&folder().join(name)) } else { RecorderCfg::new(folder().join(name)) };
        let error = message(sim.record(cfg)).unwrap_err();
        assert!(error.contains(name) && error.contains("thread"), "{name}: {error}");
    }
    let error = message(sim.serve("127.0.0.1:0")).unwrap_err();
    assert!(error.contains("cannot start a thread"), "{error}");
    sim.update(50);
    println!("{}", digest(&sim, eye));
}

/// Threads with stacks of 256 KiB, an eighth of the usual ones, are enough.
#[test]
fn small_stacks() {
    let folder = tempfile::tempdir().unwrap();
    let all = limited("true", "scenario_small_stacks", folder.path(), &[("RUST_MIN_STACK", "262144")]);
    assert!(all.contains(&expected_digest()), "{all}");
}

#[test]
#[ignore = "runs in a process of its own"]
fn scenario_small_stacks() {
    if !is_child() {
        return;
    }
    // The test itself may run on the main thread, whose stack is not limited here.
    let work = || {
        let (mut sim, eye) = arms(8, 2);
        sim.serve("127.0.0.1:0").unwrap();
        sim.update(50);
        println!("{}", digest(&sim, eye));
        for (name, write) in WRITES {
            write(&mut sim, &folder().join(name)).unwrap();
        }
    };
    std::thread::spawn(work).join().unwrap();
}
