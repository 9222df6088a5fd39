//! The command in a folder of its own, and helpers for its images.

use kinetoscope_testkit::urdf::TempFiles;
use kinetoscope_testkit::wait;
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use x11rb::connection::Connection;
use x11rb::protocol::xproto::{AtomEnum, ConnectionExt as _};
use x11rb::rust_connection::RustConnection;

pub(crate) const ARM: &str = r#"<robot name="arm">
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

/// A folder in which command lines run. File names in them are relative to the folder.
pub(crate) struct CommandFolder(TempFiles);

impl CommandFolder {
    /// Creates a folder with these files.
    pub(crate) fn with(files: &[(&str, &str)]) -> Self {
        let shell = Self(TempFiles::default());
        files.iter().for_each(|(name, content)| drop(shell.0.write(name, content)));
        shell
    }

    /// Creates a folder with `arm.urdf`.
    pub(crate) fn with_arm() -> Self {
        Self::with(&[("arm.urdf", ARM)])
    }

    pub(crate) fn write(&self, name: &str, content: &str) {
        self.0.write(name, content);
    }

    pub(crate) fn folder(&self) -> &Path {
        self.0.folder()
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.folder().join(name)
    }

    pub(crate) fn image(&self, name: &str) -> image::RgbImage {
        image::open(self.path(name)).unwrap().to_rgb8()
    }

    /// Returns the command `kinetoscope` with these arguments, without a terminal and without a display.
    pub(crate) fn command(&self, line: &str) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_kinetoscope"));
        command.args(line.split_whitespace()).current_dir(self.0.folder()).stdin(Stdio::null());
        command.env_remove("DISPLAY").env_remove("WAYLAND_DISPLAY").env_remove("RUST_LOG").env("NO_COLOR", "1");
        command
    }

    /// Runs a command line. Returns its output, its errors, and its exit code.
    pub(crate) fn run(&self, line: &str) -> (String, String, i32) {
        let Output { stdout, stderr, status } = self.command(line).output().unwrap();
        let text = |bytes| String::from_utf8(bytes).unwrap();
        (text(stdout), text(stderr), status.code().unwrap())
    }

    /// Runs a command line that succeeds without warnings, and returns its output.
    #[track_caller]
    pub(crate) fn run_ok(&self, line: &str) -> String {
        let (out, err, code) = self.run(line);
        assert_eq!((err.as_str(), code), ("", 0), "{line}: {out}");
        out
    }

    /// Runs a command line that is refused and prints only errors, and returns the errors.
    #[track_caller]
    pub(crate) fn run_refused(&self, line: &str) -> String {
        let (out, err, code) = self.run(line);
        assert_eq!((out.as_str(), code), ("", 2), "{line}: {err}");
        err
    }

    /// Asserts that each command line is refused with these words and writes no file.
    #[track_caller]
    pub(crate) fn assert_refused(&self, rows: &[(&str, &str)]) {
        let files = || std::fs::read_dir(self.0.folder()).unwrap().count();
        let before = files();
        for (line, words) in rows {
            let err = self.run_refused(line);
            assert!(err.contains(words), "{line}: {err}");
            assert_eq!(files(), before, "{line}: a file is written");
        }
    }
}

/// A running command. Dropping the value kills the process.
pub(crate) struct RunningCommand(pub(crate) Child);

impl RunningCommand {
    pub(crate) fn start(command: &mut Command) -> Self {
        Self(command.stdout(Stdio::piped()).spawn().unwrap())
    }

    /// Reads the first line of its output.
    pub(crate) fn line(&mut self) -> String {
        let mut line = String::new();
        BufReader::new(self.0.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
        line
    }

    /// Reads the remaining output.
    pub(crate) fn rest(&mut self) -> String {
        let mut rest = String::new();
        self.0.stdout.as_mut().unwrap().read_to_string(&mut rest).unwrap();
        rest
    }

    /// Sends Ctrl+C as a terminal does.
    pub(crate) fn interrupt(&self) {
        assert!(Command::new("kill").args(["-INT", &self.0.id().to_string()]).status().unwrap().success());
    }

    pub(crate) fn ended(&mut self) -> ExitStatus {
        wait::until_some("the end of the command", || self.0.try_wait().unwrap())
    }
}

impl Drop for RunningCommand {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Counts the red pixels and returns their center. Only the red body of a scene is red.
pub(crate) fn red(image: &image::RgbImage) -> (usize, [f64; 2]) {
    let red = image.enumerate_pixels().filter(|(.., p)| p[0] > 60 && f64::from(p[0]) > 2.5 * f64::from(p[1].max(p[2])));
    let sum = |(n, [sx, sy]): (usize, [f64; 2]), (x, y, _)| (n + 1, [sx + f64::from(x) + 0.5, sy + f64::from(y) + 0.5]);
    let (count, sum) = red.fold((0, [0.0; 2]), sum);
    (count, sum.map(|s| s / count.max(1) as f64))
}

/// Counts the different colors.
pub(crate) fn colors(pixels: impl IntoIterator<Item = [u8; 3]>) -> usize {
    pixels.into_iter().collect::<std::collections::BTreeSet<_>>().len()
}

/// Returns the window whose title contains `title`.
pub(crate) fn window_of(connection: &RustConnection, title: &str) -> Option<u32> {
    let children = connection.query_tree(connection.setup().roots[0].root).unwrap().reply().unwrap().children;
    children.into_iter().find(|window| {
        let name = connection.get_property(false, *window, AtomEnum::WM_NAME, AtomEnum::ANY, 0, 1000).unwrap().reply();
        name.is_ok_and(|name| String::from_utf8_lossy(&name.value).contains(title))
    })
}
