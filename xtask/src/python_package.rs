//! The Python package `kinetoscope-render`: its wheel, and its tests with several versions of `mujoco`. Also the parts
//! that it shares with the [package `kinetoscope`](python_simulation): maturin and virtual environments.

use crate::python::{self, OPENGL};
use crate::python_simulation::{self, BuildProfile};
use crate::robots;
use crate::run::{Cmd, Failure, Repo, XtaskResult};
use crate::setup::{self, Requirement};
use crate::wheel;
use std::fs;
use std::path::{Path, PathBuf};

/// Folder of the package.
const PACKAGE: &str = "python/render";

/// Beginning of the names of its wheels.
const PREFIX: &str = "kinetoscope_render-";

/// The program that builds wheels from Rust.
const MATURIN: &str = "maturin==1.16.0";

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
    /// Also write a source distribution
    #[arg(long)]
    sdist: bool,
}

/// `cargo xtask wheel`: builds the wheels of both packages into `wheels` of the target folder and prints their paths.
///
/// # Errors
/// Python cannot be set up, or the package does not compile.
pub(crate) fn run(repo: &Repo, args: &WheelArgs) -> XtaskResult {
    let built = build(repo, BuildProfile::Release)?;
    println!("{}", built.display());
    println!("{}", python_simulation::build(repo, BuildProfile::Release)?.display());
    if args.sdist {
        let maturin = maturin(repo)?;
        let package = repo.root.join(PACKAGE);
        Cmd::new(maturin).args(["sdist", "--out"]).arg(wheels(repo)).current_dir(package).run()?;
    }
    Ok(())
}

/// The stage `python` of CI: builds the wheel, installs it beside each tested `mujoco`, and runs the tests.
///
/// # Errors
/// A step fails; the message names the version of `mujoco`.
pub(crate) fn test(repo: &Repo) -> XtaskResult {
    setup::try_to_have(Requirement::OsMesa);
    let wheel = build(repo, BuildProfile::Test)?;
    let models = models(repo)?;
    for (version, numpy) in TESTED {
        let python = environment(repo, version, numpy)?;
        let install = ["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps"];
        Cmd::new(&python).args(install).arg("--force-reinstall").arg(&wheel).run()?;
        println!("kinetoscope-render with mujoco {version}");
        // No files of Python or pytest are left in the tree.
        let mut tests = Cmd::new(&python).args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "."]);
        if version == wheel::PYTHON_VERSION {
            tests = tests.env(MODELS_VARIABLE, &models);
        }
        if let Some(folder) = robots::local(repo) {
            tests = tests.env(robots::VARIABLE, folder);
        }
        tests
            .current_dir(repo.root.join(PACKAGE).join("tests"))
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
    // Named after its content: another list of packages is another folder.
    let done = folder.join(MODELS.join(" "));
    if !done.exists() {
        setup::try_to_have(Requirement::Pip);
        let pip = wheel::pip().ok_or_else(|| Failure::new("models are downloaded with pip, which is missing"))?;
        let options =
            ["--no-input", "--disable-pip-version-check", "--quiet", "--no-deps", "--only-binary=:all:", "--upgrade"];
        let install = Cmd::new(pip[0]).args(&pip[1..]).arg("install").args(options).arg("--target").arg(&folder);
        install.args(MODELS).run()?;
        fs::write(&done, "").map_err(|e| Failure::new(format!("{}: {e}", done.display())))?;
    }
    Ok(folder)
}

/// Builds the wheel and returns its path.
fn build(repo: &Repo, profile: BuildProfile) -> XtaskResult<PathBuf> {
    let maturin = maturin(repo)?;
    let dir = wheels(repo);
    remove_wheels(&dir, PREFIX)?;
    let package = repo.root.join(PACKAGE);
    let build = Cmd::new(maturin).args(["build", "--locked", "--profile", profile.name(), "--out"]).arg(&dir);
    build.current_dir(package).env("CARGO_TARGET_DIR", &repo.target).run()?;
    built_wheel(&dir, PREFIX)
}

/// The wheel whose name begins with `prefix`.
///
/// # Errors
/// There is no such wheel.
pub(crate) fn built_wheel(dir: &Path, prefix: &str) -> XtaskResult<PathBuf> {
    let message = || Failure::new(format!("maturin built no wheel in {}", dir.display()));
    built_wheels(dir, prefix).into_iter().next().ok_or_else(message)
}

/// Removes wheels of earlier builds whose names begin with `prefix`.
pub(crate) fn remove_wheels(dir: &Path, prefix: &str) -> XtaskResult {
    for old in built_wheels(dir, prefix) {
        fs::remove_file(&old).map_err(|e| Failure::new(format!("{}: {e}", old.display())))?;
    }
    Ok(())
}

/// Folder of built wheels.
pub(crate) fn wheels(repo: &Repo) -> PathBuf {
    repo.target.join("wheels")
}

/// Wheels of a package in a folder that has other wheels too.
fn built_wheels(dir: &Path, prefix: &str) -> Vec<PathBuf> {
    let is_ours = |path: &PathBuf| {
        let name = path.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default();
        name.starts_with(prefix) && name.ends_with(".whl")
    };
    fs::read_dir(dir).into_iter().flatten().flatten().map(|entry| entry.path()).filter(is_ours).collect()
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

/// A Python with a version of `mujoco`, its OpenGL bindings and pytest, below the target folder.
fn environment(repo: &Repo, version: &str, numpy: &str) -> XtaskResult<PathBuf> {
    let venv = repo.target.join(format!("python-mujoco-{version}"));
    let python = venv.join("bin/python");
    let check = format!("import absl, mujoco, numpy, OpenGL, pytest; assert mujoco.__version__ == '{version}'");
    let is_ready = || Cmd::new(&python).args(["-c", &check]).quiet().succeeds();
    if !is_ready() {
        let mujoco = format!("mujoco=={version}");
        let packages = [&[mujoco.as_str(), numpy, "absl-py==2.5.1", "pytest==9.2.0"], OPENGL.packages].concat();
        create(&venv, &packages)?;
    }
    if is_ready() { Ok(python) } else { Err(Failure::new(format!("mujoco {version} cannot be imported"))) }
}

/// Creates a virtual environment with these packages.
pub(crate) fn create(venv: &Path, packages: &[&str]) -> XtaskResult {
    setup::try_to_have(Requirement::Pip);
    setup::try_to_have(Requirement::Venv);
    Cmd::new("python3").args(["-m", "venv", "--clear"]).arg(venv).run()?;
    python::pip_install(&venv.join("bin/python"), packages)
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
        assert_eq!(built_wheels(dir.path(), PREFIX), [dir.path().join("kinetoscope_render-1.whl")]);
        assert!(built_wheels(&dir.path().join("missing"), PREFIX).is_empty());
    }
}
