//! `kinetoscope view` as somebody uses it: a window on a real X server without a screen, a page for browsers, and how it
//! ends.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::time::{Duration, Instant};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{AtomEnum, ClientMessageEvent, ConnectionExt as _, EventMask, ImageFormat, Window};
use x11rb::rust_connection::RustConnection;

/// What is not there by then does not come.
const LONG: Duration = Duration::from_secs(60);

const ARM: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="rod">
    <inertial><origin xyz="0 0 0.5"/><mass value="2"/><inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <visual><origin xyz="0 0 0.5"/><geometry><box size="0.1 0.1 1"/></geometry></visual>
  </link>
  <joint name="hinge" type="revolute">
    <parent link="base"/><child link="rod"/><axis xyz="0 1 0"/>
    <limit lower="-1" upper="1" effort="50" velocity="1"/>
  </joint>
</robot>
"#;

/// Two bodies in the world, one of them on a ball joint: no robot.
const SCENE: &str = r#"<mujoco><option timestep="0.01"/><worldbody><geom type="plane" size="2 2 0.1"/>
  <body pos="0 0 1"><joint type="ball"/><geom type="capsule" size="0.05" fromto="0 0 0 0.3 0 0" mass="1"/></body>
  <body pos="1 0 1"><freejoint/><geom size="0.1" mass="1"/></body></worldbody></mujoco>"#;

/// The command, of which nothing is a terminal, and that knows of no display.
fn command(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_kinetoscope"));
    command.args(args).env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env("NO_COLOR", "1").stdin(Stdio::null());
    command
}

fn said(output: &Output) -> (String, String, i32) {
    let text = |bytes: &[u8]| String::from_utf8(bytes.to_vec()).unwrap();
    (text(&output.stdout), text(&output.stderr), output.status.code().unwrap())
}

fn write(folder: &Path, name: &str, content: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, content).unwrap();
    path.to_str().unwrap().to_owned()
}

fn until<T>(what: &str, mut found: impl FnMut() -> Option<T>) -> T {
    let start = Instant::now();
    loop {
        if let Some(found) = found() {
            return found;
        }
        assert!(start.elapsed() < LONG, "never: {what}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// The command while it runs; it is ended with the test.
struct Running(Child);

impl Running {
    fn start(command: &mut Command) -> Self {
        Self(command.stdout(Stdio::piped()).spawn().unwrap())
    }

    /// What it prints first.
    fn line(&mut self) -> String {
        let mut line = String::new();
        BufReader::new(self.0.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        line
    }

    /// As Ctrl+C in a terminal.
    fn interrupt(&self) {
        assert!(Command::new("kill").args(["-INT", &self.0.id().to_string()]).status().unwrap().success());
    }

    fn ended(&mut self) -> ExitStatus {
        until("it ends", || self.0.try_wait().unwrap())
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

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

/// An X server of its own.
struct Display {
    server: Child,
    name: String,
}

impl Display {
    /// `None` where there is no Xvfb; in CI that is a failure. `cargo xtask test` installs it.
    fn start() -> Option<Self> {
        let args = ["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset"];
        let started = Command::new("Xvfb").args(args).stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let Ok(mut server) = started else {
            assert!(std::env::var_os("CI").is_none(), "Xvfb is not there; cargo xtask test installs it");
            eprintln!("note: without Xvfb no window is opened (cargo xtask test installs it)");
            return None;
        };
        let mut number = String::new();
        BufReader::new(server.stdout.take().unwrap()).read_line(&mut number).unwrap();
        Some(Self { server, name: format!(":{}", number.trim()) })
    }
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

/// The window whose title contains this.
fn window_of(connection: &RustConnection, title: &str) -> Option<Window> {
    let root = connection.setup().roots[0].root;
    let children = connection.query_tree(root).unwrap().reply().unwrap().children;
    children.into_iter().find(|window| {
        let name = connection.get_property(false, *window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 1000).unwrap().reply();
        name.is_ok_and(|name| String::from_utf8_lossy(&name.value).contains(title))
    })
}

/// How many colours the upper left of the display has.
fn colors(connection: &RustConnection) -> usize {
    let root = connection.setup().roots[0].root;
    let image = connection.get_image(ImageFormat::Z_PIXMAP, root, 0, 0, 960, 540, !0).unwrap().reply().unwrap();
    image.data.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect::<BTreeSet<_>>().len()
}

#[test]
fn a_window_shows_the_model_until_it_is_closed() {
    let Some(mut display) = Display::start() else { return };
    let folder = tempfile::tempdir().unwrap();
    let arm = write(folder.path(), "arm.urdf", ARM);
    let (connection, _) = x11rb::connect(Some(&display.name)).unwrap();
    assert_eq!(colors(&connection), 1, "nothing is on it yet");
    let mut running = Running::start(command(&["view", &arm, "--num-envs", "4"]).env("DISPLAY", &display.name));
    assert!(running.line().contains("H in it shows its keys"));
    let window = until("a window", || window_of(&connection, "arm.urdf"));
    until("the model is drawn", || (colors(&connection) > 50).then_some(()));
    // As window managers do it.
    let atom = |name: &[u8]| connection.intern_atom(false, name).unwrap().reply().unwrap().atom;
    let data = [atom(b"WM_DELETE_WINDOW"), 0, 0, 0, 0];
    let event = ClientMessageEvent::new(32, window, atom(b"WM_PROTOCOLS"), data);
    connection.send_event(false, window, EventMask::NO_EVENT, event).unwrap();
    connection.flush().unwrap();
    assert_eq!(running.ended().code(), Some(0));
    // The display is lost: that is an end, not a good one.
    let mut running = Running::start(command(&["view", &arm]).env("DISPLAY", &display.name));
    running.line();
    until("a window", || window_of(&connection, "arm.urdf"));
    display.server.kill().unwrap();
    assert_eq!(running.ended().code(), Some(2));
}
