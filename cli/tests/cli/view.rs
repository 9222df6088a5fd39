//! `kinetoscope view`: a window on Xvfb, a page for browsers, and how the command ends.

use super::serve::test_client::exchange;
use super::support::{CommandFolder, RunningCommand, colors, window_of};
use kinetoscope_testkit::wait;
use kinetoscope_testkit::x_server::{Display, close, screenshot};
use std::time::Instant;

/// Two bodies in the world, one of them on a ball joint: not a robot.
pub(crate) const SCENE: &str = r#"<mujoco><option timestep="0.01"/><worldbody><geom type="plane" size="2 2 0.1"/>
  <body pos="0 0 1"><joint type="ball"/><geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0" mass="1"/></body>
  <body pos="1 0 1"><freejoint/><geom size="0.1" mass="1"/></body></worldbody></mujoco>"#;

#[test]
fn no_display() {
    let err = CommandFolder::with_arm().run_refused("view arm.urdf");
    for words in ["DISPLAY is not set", "WAYLAND_DISPLAY", "XWayland", "--serve", "kinetoscope render"] {
        assert!(err.contains(words), "{words}: {err}");
    }
}

#[test]
fn real_time() {
    let shell = CommandFolder::with_arm();
    let took = |speed: &str| {
        let start = Instant::now();
        let (out, err, code) = shell.run(&format!("view arm.urdf --serve 127.0.0.1:0 --steps 200 --speed {speed}"));
        assert_eq!(code, 0, "{out}{err}");
        start.elapsed().as_secs_f64()
    };
    // 200 steps of 10 ms, less a block of one unthrottled step at both ends. A machine that needs 1.9 s to start a
    // program is too busy for this test.
    let (real, fast) = (took("1"), took("1000"));
    assert!(real > 1.97 && fast < real, "{real} s and {fast} s");
}

#[test]
fn page_and_ctrl_c() {
    let shell = CommandFolder::with_arm();
    // So slow that the first step takes 10 s.
    let mut running = RunningCommand::start(&mut shell.command("view arm.urdf --serve 127.0.0.1:0 --speed 0.001"));
    let line = running.line();
    assert!(line.contains("arm.urdf") && line.contains("Ctrl+C"), "{line}");
    let address = line.split("http://").nth(1).and_then(|rest| rest.split('/').next()).unwrap();
    let page = exchange(address.parse().unwrap(), b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n");
    assert!(page.starts_with("HTTP/1.1 200") && page.contains("<title>Kinetoscope</title>"), "{page}");
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
}

/// The stream to Foxglove has a server beside the view. Its messages are tested in the crate `record`.
#[cfg(feature = "foxglove")]
#[test]
fn foxglove() {
    let shell = CommandFolder::with_arm();
    let mut running = RunningCommand::start(&mut shell.command("view arm.urdf --serve 127.0.0.1:0 --foxglove 0"));
    let line = running.line();
    let address = line.split("ws://").nth(1).and_then(|rest| rest.split(' ').next()).unwrap();
    assert!(std::net::TcpStream::connect(address).is_ok(), "{line}");
    let err = shell.run_refused(&format!("view arm.urdf --serve 127.0.0.1:0 --foxglove {address}"));
    assert!(err.contains("--foxglove: cannot serve at") && err.contains(address), "{err}");
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    let err = shell.run_refused("view arm.urdf --serve 127.0.0.1:0 --foxglove robot");
    assert!(err.contains("--foxglove: cannot serve at \"robot\""), "{err}");
}

#[cfg(not(feature = "foxglove"))]
#[test]
fn foxglove() {
    let err = CommandFolder::with_arm().run_refused("view arm.urdf --serve 127.0.0.1:0 --foxglove");
    assert!(err.contains("--features foxglove"), "{err}");
}

/// A recording is complete at every regular end.
#[test]
fn recording() {
    let shell = CommandFolder::with_arm();
    // After all steps: one row per step, and one for the initial state.
    let line = "view arm.urdf --serve 127.0.0.1:0 --speed 100 --steps 30 --record steps.npz";
    let (out, err, code) = shell.run(line);
    assert_eq!(code, 0, "{out}{err}");
    assert!(out.contains("Recorded to") && out.contains("steps.npz: 31 rows"), "{out}");
    assert!(shell.path("steps.npz").is_file());
    // An existing file is not overwritten.
    let (_, err, code) = shell.run(line);
    assert!(code == 2 && err.contains("--record") && err.contains("steps.npz"), "{err}");
    // Ctrl+C.
    let file = shell.path("interrupted.mcap");
    let mut running =
        RunningCommand::start(&mut shell.command("view arm.urdf --serve 127.0.0.1:0 --record interrupted.mcap"));
    running.line();
    assert!(!file.exists(), "it has its name when it is whole");
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    assert!(std::fs::read(file).unwrap().ends_with(b"\x89MCAP0\r\n"), "the end of a whole MCAP file");
}

/// An MJCF file that is not a robot is shown as a scene.
#[test]
fn mjcf_scene() {
    let broken = SCENE.replace("size=\"0.1\"", "size=\"0.1\" no_such=\"1\"");
    let shell = CommandFolder::with(&[("scene.xml", SCENE), ("broken.xml", &broken)]);
    let (out, err, code) = shell.run("view scene.xml --serve 127.0.0.1:0 --steps 20 --speed 100");
    assert_eq!(code, 0, "{out}{err}");
    // Controls: a file that MuJoCo rejects is not a scene either, and robot flags are refused.
    for (line, words) in [
        ("view scene.xml --floating-base --serve 127.0.0.1:0 --steps 1", "is a scene, not one robot"),
        ("view broken.xml --serve 127.0.0.1:0 --steps 1", "no_such"),
    ] {
        let (_, err, code) = shell.run(line);
        assert!(code == 2 && err.contains(words), "{line}: {err}");
    }
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn window() {
    let mut display = Display::start("1280x800");
    let (shell, connection) = (CommandFolder::with_arm(), display.connect());
    let shown = || colors(screenshot(&connection, [0, 0], [960, 540]));
    assert_eq!(shown(), 1, "the screen is empty before");
    let start = |line: &str| {
        let mut running = RunningCommand::start(shell.command(line).env("DISPLAY", &display.name));
        let line = running.line();
        (running, line, wait::until_some("a window", || window_of(&connection, "arm.urdf")))
    };
    let (mut running, line, window) = start("view arm.urdf --num-envs 4");
    assert!(line.contains("H in it shows its keys"), "{line}");
    wait::until("the model is drawn", || shown() > 50);
    close(&connection, window);
    assert_eq!(running.ended().code(), Some(0));
    // A lost display ends the command with an error.
    let (mut running, ..) = start("view arm.urdf");
    display.server.kill().unwrap();
    assert_eq!(running.ended().code(), Some(2));
}
