//! The search for MuJoCo, without reading the environment, so that tests can run it. Part of the build script.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The three lines of the error without MuJoCo.
const NOT_FOUND: &str = "MuJoCo was not found: install it (Debian 12: apt-get install libmujoco-dev, version 2.2.2),\n\
                         or set MUJOCO_DIR to a folder with include/mujoco and libmujoco.so* of MuJoCo 2.2.2 or 4.x,\n\
                         or enable the feature `download` of kinetoscope, which gets MuJoCo 4.0.1 from PyPI by pip";

/// Version of MuJoCo that the feature `download` gets.
pub(crate) const DOWNLOADED: &str = "4.0.1";

/// Architecture, platform tag and SHA-256 of a wheel of [`DOWNLOADED`].
pub(crate) type Wheel<'a> = (&'a str, &'a str, &'a str);

/// Headers and library are the same in the wheels of all Python versions, of which these are for 3.11.
pub(crate) const WHEELS: [Wheel<'static>; 2] = [
    ("x86_64", "manylinux_2_28_x86_64", "be28c0c7587347ef996b4de0487264e9da296282082b092bae211a9163e9aed6"),
    ("aarch64", "manylinux_2_28_aarch64", "52d934614a56f7d75dcfc2bd8bb72f058b465ecc19a0583a56df242f9505bdb6"),
];

const SUPPORTED: &str = "supported versions: MuJoCo 2.2.2 (Debian 12: apt-get install libmujoco-dev) and MuJoCo 4.x \
                         (set MUJOCO_DIR to a folder with include/mujoco and libmujoco.so*, for example the unpacked \
                         PyPI wheel mujoco-core)";

/// An error message as lines that Cargo prints as errors of the build.
pub(crate) fn cargo_errors(message: &str) -> String {
    message.lines().map(|line| format!("cargo::error={line}\n")).collect()
}

/// Headers and library of MuJoCo.
#[derive(Debug)]
pub(crate) struct Installation {
    pub(crate) include: PathBuf,
    /// Library file of a given or downloaded folder. `None` for the system's: the linker's default search then finds the
    /// library.
    pub(crate) library: Option<PathBuf>,
    pub(crate) version_header: u32,
}

impl Installation {
    /// Looks in the folder `given`, otherwise downloads if `wanted`, otherwise looks in the include folders `system`.
    ///
    /// # Errors
    /// MuJoCo was not found there, the download failed, or the version is not supported.
    pub(crate) fn find(given: Option<PathBuf>, wanted: Option<Download<'_>>, system: &[&Path]) -> Result<Self, String> {
        let folder = match (given, wanted) {
            (Some(given), _) => Some(given),
            (None, Some(download)) => Some(download.run()?),
            (None, None) => None,
        };
        let (include, library) = match folder {
            Some(dir) => {
                let dir =
                    fs::canonicalize(&dir).map_err(|e| format!("MUJOCO_DIR={}: {e}; {SUPPORTED}", dir.display()))?;
                let library = find_library(&dir).ok_or_else(|| {
                    format!("MUJOCO_DIR={}: no libmujoco.so* in it, nor in its lib/; {SUPPORTED}", dir.display())
                })?;
                (dir.join("include"), Some(library))
            }
            None => {
                let include = system.iter().find(|dir| dir.join("mujoco/mujoco.h").exists()).ok_or(NOT_FOUND)?;
                (include.to_path_buf(), None)
            }
        };
        let header = include.join("mujoco/mujoco.h");
        let text = fs::read_to_string(&header).map_err(|e| format!("{}: {e}; {SUPPORTED}", header.display()))?;
        let version_header = text
            .lines()
            .find_map(|line| line.trim().strip_prefix("#define mjVERSION_HEADER")?.trim().parse().ok())
            .ok_or_else(|| format!("{}: no mjVERSION_HEADER in it; {SUPPORTED}", header.display()))?;
        let found = Self { include, library, version_header };
        if version_header != 222 && found.major() != 4 {
            return Err(format!(
                "{} belongs to MuJoCo {version_header}, which is not supported; {SUPPORTED}",
                header.display()
            ));
        }
        Ok(found)
    }

    /// A header file.
    pub(crate) fn header(&self, name: &str) -> PathBuf {
        self.include.join("mujoco").join(name)
    }

    /// Major version. `mjVERSION_HEADER` is 222 for 2.2.2; since 3.5 it is major * 10^6 + minor * 10^3 + patch.
    pub(crate) fn major(&self) -> u32 {
        if self.version_header < 1000 { self.version_header / 100 } else { self.version_header / 1_000_000 }
    }
}

/// A download of MuJoCo from PyPI.
#[derive(Debug)]
pub(crate) struct Download<'a> {
    /// Architecture and operating system of the target, in Cargo's words.
    pub(crate) arch: String,
    pub(crate) os: String,
    pub(crate) wheels: &'a [Wheel<'a>],
    /// Folder that keeps the unpacked wheel.
    pub(crate) data: PathBuf,
    /// Folder for temporary files.
    pub(crate) scratch: PathBuf,
    /// Further options of pip, for tests without a network.
    pub(crate) pip_options: Vec<std::ffi::OsString>,
}

impl Download<'_> {
    /// Gets the wheel with MuJoCo by pip, which compares its hash, and unpacks it, unless it was unpacked before.
    fn run(&self) -> Result<PathBuf, String> {
        let Self { arch, os, wheels, data, scratch: out, pip_options } = self;
        let wheel = wheels.iter().find(|(name, ..)| name == arch).filter(|_| os == "linux");
        let Some((_, platform, hash)) = wheel else {
            return Err(format!("the feature `download` has no MuJoCo for {arch} {os}; set MUJOCO_DIR instead"));
        };
        let complete = data.join(format!("mujoco-{DOWNLOADED}-{arch}"));
        let unpacked = complete.join("mujoco");
        let is_complete = || unpacked.join(format!("libmujoco.so.{DOWNLOADED}")).is_file();
        if is_complete() {
            return Ok(unpacked);
        }
        let (requirements, wheels) = (out.join("wheel.txt"), out.join("wheels"));
        // In the folder of the result, so that it can be renamed; other builds may unpack at the same time.
        let scratch = data.join(format!("mujoco-{DOWNLOADED}-{arch}.{}.tmp", std::process::id()));
        for folder in [&wheels, &scratch] {
            remove(folder)?;
        }
        let failed = |path: &Path| {
            let path = path.display().to_string();
            move |error: std::io::Error| format!("{path}: {error}")
        };
        let requirement = format!("mujoco-core=={DOWNLOADED} --hash=sha256:{hash}\n");
        fs::write(&requirements, requirement).map_err(failed(&requirements))?;
        let mut pip = Command::new("python3");
        pip.args(["-m", "pip", "download", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps"])
            .args(["--only-binary=:all:", "--python-version", "3.11", "--platform", platform, "--require-hashes"])
            .arg("--requirement")
            .arg(&requirements)
            .arg("--dest")
            .arg(&wheels)
            .args(pip_options);
        run(&mut pip)?;
        let wheel = fs::read_dir(&wheels).map_err(failed(&wheels))?.flatten().next();
        let wheel = wheel.ok_or("pip downloaded no wheel of mujoco-core")?.path();
        fs::create_dir_all(&scratch).map_err(failed(&scratch))?;
        run(Command::new("python3").args(["-m", "zipfile", "-e"]).arg(&wheel).arg(&scratch))?;
        // Renamed at the end: a folder of that name with the library is complete.
        if fs::rename(&scratch, &complete).is_err() && !is_complete() {
            remove(&complete)?;
            fs::rename(&scratch, &complete).map_err(failed(&complete))?;
        }
        remove(&scratch)?;
        remove(&wheels)?;
        Ok(unpacked)
    }
}

fn remove(folder: &Path) -> Result<(), String> {
    match fs::remove_dir_all(folder) {
        Err(error) if error.kind() != std::io::ErrorKind::NotFound => Err(format!("{}: {error}", folder.display())),
        _ => Ok(()),
    }
}

/// Runs a command; its messages are part of the error.
fn run(command: &mut Command) -> Result<(), String> {
    let name =
        format!("{} -m {}", command.get_program().display(), command.get_args().nth(1).unwrap_or_default().display());
    let output = command.output().map_err(|e| format!("{name}: {e} (the feature `download` needs Python with pip)"))?;
    if output.status.success() {
        return Ok(());
    }
    Err(format!("{name} failed: {}", String::from_utf8_lossy(&output.stderr).trim()))
}

fn find_library(dir: &Path) -> Option<PathBuf> {
    let mut found: Vec<PathBuf> = [dir.to_path_buf(), dir.join("lib")]
        .iter()
        .filter_map(|d| fs::read_dir(d).ok())
        .flatten()
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|p| p.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with("libmujoco.so")))
        .collect();
    found.sort();
    found.into_iter().next()
}
