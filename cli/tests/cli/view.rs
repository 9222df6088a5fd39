//! `kinetoscope view` as somebody uses it: a window on a real X server without a screen, a page for browsers, and how it
//! ends.

use super::support::{ARM, LONG, Running, command, said, until, write};
use super::windows::{Display, close, colors, window_of};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::time::Instant;

/// Two bodies in the world, one of them on a ball joint: no robot.
const SCENE: &str = r#"<mujoco><option timestep="0.01"/><worldbody><geom type="plane" size="2 2 0.1"/>
  <body pos="0 0 1"><joint type="ball"/><geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0" mass="1"/></body>
  <body pos="1 0 1"><freejoint/><geom size="0.1" mass="1"/></body></worldbody></mujoco>"#;

/// What a page is served at, of the line that says so.
fn address(line: &str) -> &str {
    line.split("http://").nth(1).and_then(|rest| rest.split('/').next()).unwrap_or_else(|| panic!("{line}"))
}

fn get(address: &str) -> String {
    let mut stream = TcpStream::connect(address).unwrap();
    stream.set_read_timeout(Some(LONG)).unwrap();
    stream.write_all(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n").unwrap();
    let mut page = String::new();
    stream.read_to_string(&mut page).unwrap();
    page
}

#[test]
fn without_a_display_it_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let (out, err, code) = said(&command(&["view", &arm]).output().unwrap());
    assert_eq!((out.as_str(), code), ("", 2));
    for words in ["DISPLAY is not set", "WAYLAND_DISPLAY", "XWayland", "--serve", "kinetoscope render"] {
        assert!(err.contains(words), "{words}: {err}");
    }
}

#[test]
fn it_runs_in_real_time_unless_told_otherwise() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let took = |speed: &str| {
        let start = Instant::now();
        let args = ["view", &arm, "--serve", "127.0.0.1:0", "--steps", "200", "--speed", speed];
        let (out, err, code) = said(&command(&args).output().unwrap());
        assert_eq!(code, 0, "{out}{err}");
        start.elapsed().as_secs_f64()
    };
    // 200 steps of 10 ms, less the block of one step that is not waited for at either end. That a busy machine needs 1.9 s
    // to start a program is not to be thought of.
    let (real, fast) = (took("1"), took("1000"));
    assert!(real > 1.97 && fast < real, "{real} s and {fast} s");
}

#[test]
fn a_browser_gets_a_page_and_ctrl_c_is_a_good_end() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    // So slow that the first step is waited for: 10 s.
    let mut running = Running::start(&mut command(&["view", &arm, "--serve", "127.0.0.1:0", "--speed", "0.001"]));
    let line = running.line();
    assert!(line.contains("arm.urdf") && line.contains("Ctrl+C"), "{line}");
    let page = get(address(&line));
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<title>Kinetoscope</title>"), "{page}");
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
}

#[test]
fn what_is_recorded_is_whole_at_every_good_end() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    // All steps are done: one row for each, and one for the beginning.
    let file = folder.path().join("steps.npz");
    let name = file.to_str().unwrap();
    let args = ["view", &arm, "--serve", "127.0.0.1:0", "--speed", "100", "--steps", "30", "--record", name];
    let (out, err, code) = said(&command(&args).output().unwrap());
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("Recorded to") && out.contains("steps.npz: 31 rows") && file.is_file(), "{out}");
    // What is there is not written over.
    let (_, err, code) = said(&command(&args).output().unwrap());
    assert!(code == 2 && err.contains("--record") && err.contains("steps.npz"), "{err}");
    // Ctrl+C.
    let file = folder.path().join("interrupted.mcap");
    let args = ["view", &arm, "--serve", "127.0.0.1:0", "--record", file.to_str().unwrap()];
    let mut running = Running::start(&mut command(&args));
    running.line();
    assert!(!file.exists(), "it has its name when it is whole");
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    assert!(std::fs::read(file).unwrap().ends_with(b"\x89MCAP0\r\n"), "the end of a whole MCAP file");
}

#[test]
fn an_mjcf_file_that_is_no_robot_is_shown_as_it_is() {
    let folder = tempfile::tempdir().unwrap();
    let scene = write(folder.path(), "scene.xml", SCENE);
    let args = ["view", &scene, "--serve", "127.0.0.1:0", "--steps", "20", "--speed", "100"];
    let (out, err, code) = said(&command(&args).output().unwrap());
    assert_eq!(code, 0, "{out}{err}");
    // The control: as a robot it is refused.
    let (_, err, code) = said(&command(&["bench", &scene, "--seconds", "0.01"]).output().unwrap());
    assert!(code == 2 && err.contains("bodies in its world"), "{err}");
    // What MuJoCo refuses is no scene either.
    let broken = write(folder.path(), "broken.xml", &SCENE.replace("size=\"0.1\"", "size=\"0.1\" no_such=\"1\""));
    let (_, err, code) = said(&command(&["view", &broken, "--serve", "127.0.0.1:0", "--steps", "1"]).output().unwrap());
    assert!(code == 2 && err.contains("no_such"), "{err}");
}

#[test]
fn bad_input_is_refused_with_a_sentence() {
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    for (args, words) in [
        (vec!["view", "no_such.urdf"], "no such file"),
        (vec!["view"], "FILE.urdf|FILE.xml"),
        (vec!["view", &arm, "--speed", "0"], "1 is real time"),
        (vec!["view", &arm, "--speed", "nan"], "--speed"),
        (vec!["view", &arm, "--num-envs", "0"], "num_envs"),
        (vec!["view", &arm, "--serve", "robot:80"], "127.0.0.1:80"),
    ] {
        let (out, err, code) = said(&command(&args).output().unwrap());
        assert_eq!(code, 2, "{args:?}: {out}{err}");
        assert!(err.contains(words), "{args:?}: {err}");
    }
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn a_window_shows_the_model_until_it_is_closed() {
    let mut display = Display::start("1280x800");
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let connection = display.connect();
    assert_eq!(colors(&connection), 1, "nothing is on it yet");
    let mut running = Running::start(command(&["view", &arm, "--num-envs", "4"]).env("DISPLAY", &display.name));
    assert!(running.line().contains("H in it shows its keys"));
    let window = until("a window", || window_of(&connection, "arm.urdf"));
    until("the model is drawn", || (colors(&connection) > 50).then_some(()));
    close(&connection, window);
    assert_eq!(running.ended().code(), Some(0));
    // The display is lost: that is an end, not a good one.
    let mut running = Running::start(command(&["view", &arm]).env("DISPLAY", &display.name));
    running.line();
    until("a window", || window_of(&connection, "arm.urdf"));
    display.server.kill().unwrap();
    assert_eq!(running.ended().code(), Some(2));
}
