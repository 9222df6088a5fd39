//! The Python package `kinetoscope`: its wheel, built for the MuJoCo of the wheel `mujoco-core`, and its tests in an
//! environment of its own.

use crate::python;
use crate::python_package::{self, BuildProfile, built_wheel, create, create_empty, maturin, remove_wheels, wheels};
use crate::robots;
use crate::run::{Cmd, Failure, Repo, XtaskResult, in_ci};
use crate::setup::{self, MujocoVersion, Prepared, Requirement, Requirements};
use crate::{test, wheel};
use std::path::{Path, PathBuf};
use std::{env, fs};

/// Folder of the package.
const PACKAGE: &str = "python/sim";

/// Beginning of the names of its wheels.
const PREFIX: &str = "kinetoscope-";

/// Tag of the wheels: Python 3.11 and later, by the feature of PyO3.
const ABI: &str = "cp311-abi3";

/// Robots and meshes for the wheel: a copy of the folder `assets` while it is built.
const ASSETS: &str = "python/sim/kinetoscope/assets";

/// Scripts of other simulators that the compatibility layers run; tests that need them are skipped elsewhere.
const SCRIPTS: &str = "../shared/seeds";

/// Variable that adds torch and [`LEARNING`] to the environment of the tests: a download of several gigabytes. Without them, the
/// tests of tensors and of the libraries are left out by name.
const WANTS_TORCH: &str = "KINETOSCOPE_TORCH";

/// Versions of NumPy with which the package is tested: one that EmbodiChain's `create_sensor` runs on, which calls a method
/// that NumPy 2 does not have, and one that `pip` installs beside the package. Tensors are tested with the first, and the libraries
/// of `kinetoscope.rl` with the second.
const NUMPY: [&str; 2] = ["1.26.4", "2.4.6"];

/// Other packages of the tests.
const PACKAGES: [&str; 8] = [
    "gymnasium==1.4.0",
    "pytest==9.2.0",
    "scipy==1.17.1",
    "matplotlib==3.11.2",
    "opencv-python-headless==4.11.0.86",
    "mypy==2.4.1",
    "pillow==13.0.0",
    "ray==2.60.0",
];

/// Libraries of `kinetoscope.rl` that need torch. `ray[rllib]` would also pin Gymnasium 1.2.2, so its requirements are listed.
const LEARNING: [&str; 11] = [
    "stable-baselines3==2.9.2",
    "rsl-rl-lib==5.5.1",
    "skrl==2.1.1",
    "torchrl==0.14.1",
    "dm-tree==0.1.10",
    "lz4==4.4.5",
    "ormsgpack>=1.7.0",
    "pandas",
    "pyarrow>=17.0.0",
    "pydantic>=2.5.0,<3",
    "tensorboardX>=1.9",
];

/// MuJoCo Warp with all that it needs beside `mujoco-core`, whose version `mujoco` on PyPI does not allow, so they are
/// installed without their own requirements.
const WARP: [&str; 7] =
    ["mujoco-warp==4.0.0", "warp-lang==1.19.0", "absl-py", "etils", "fsspec", "typing_extensions", "zipp"];

/// Tests of the wheels for users, which need no package but pytest and no feature of CI's wheels.
const USER_TESTS: [&str; 3] = ["test_sim_core.py", "test_sim_rust.py", "test_sim_wheel.py"];

/// Builds the wheel and returns its path.
///
/// # Errors
/// MuJoCo or Python cannot be set up, or the package does not compile.
pub(crate) fn build(repo: &Repo, profile: BuildProfile) -> XtaskResult<PathBuf> {
    let ready = prepare(repo)?;
    let (maturin, dir) = (maturin(repo)?, wheels(repo));
    // The library of MuJoCo is not copied into the wheel: the package loads that of `mujoco-core`.
    let build = profile.configure(repo, ready.program(maturin).args(["build", "--auditwheel", "skip"]))?;
    remove_wheels(&dir, PREFIX)?;
    let assets = repo.root.join(ASSETS);
    let fail = |e: std::io::Error| Failure::new(format!("{}: {e}", assets.display()));
    let remove = || if assets.exists() { fs::remove_dir_all(&assets) } else { Ok(()) };
    remove().map_err(fail)?;
    copy(&repo.root.join("assets"), &assets).map_err(fail)?;
    let built = build.arg("--out").arg(&dir).current_dir(repo.root.join(PACKAGE)).run();
    remove().map_err(fail)?;
    built?;
    built_wheel(&dir, PREFIX, ABI)
}

/// The stage `python-sim` of CI: builds the wheel and that of the renderer, installs both in an environment, and runs the
/// tests there.
///
/// # Errors
/// A step fails.
pub(crate) fn test(repo: &Repo) -> XtaskResult {
    let ready = prepare(repo)?;
    setup::try_to_have(Requirement::Xvfb);
    let wheels = [python_package::build(repo, BuildProfile::Test)?, build(repo, BuildProfile::Test)?];
    build_command(&ready)?;
    for numpy in NUMPY {
        let python = environment(repo, numpy)?;
        install(&python, &wheels)?;
        println!("kinetoscope with NumPy {numpy}");
        run_tests(repo, &ready, &python)
            .map_err(|failure| Failure::new(format!("NumPy {numpy}: {}", failure.message)))?;
    }
    Ok(())
}

/// Builds the command `kinetoscope`, the judge of the tests that compare with Rust.
fn build_command(ready: &Prepared) -> XtaskResult {
    let all = ["--workspace"];
    ready.cargo().arg("build").args(all).args(test::features(&all)).args(["--bin", "kinetoscope"]).run()
}

/// Runs the tests in an environment with the installed wheels.
fn run_tests(repo: &Repo, ready: &Prepared, python: &Path) -> XtaskResult {
    let with_warp = has_warp(python);
    if !with_warp {
        // The requirements of the wheels are those that are installed. MuJoCo Warp names another `mujoco`.
        Cmd::new(python).args(["-m", "pip", "--disable-pip-version-check", "check"]).run()?;
    }
    let mut tests = Cmd::new(python).args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "."]);
    if !is_with_torch(python) {
        println!(
            "note: the tests of tensors are left out; {WANTS_TORCH}=1 installs torch beside NumPy {}, for EmbodiChain",
            NUMPY[0]
        );
        tests = tests.env("KINETOSCOPE_TESTS_WITHOUT_TORCH", "1");
    }
    let mut left_out = Vec::new();
    if !with_warp {
        println!("note: the tests of MuJoCo Warp run with NumPy {}", NUMPY[1]);
        left_out.push("not needs_warp");
    }
    if !has_learning(python) {
        println!("note: the tests of the libraries of kinetoscope.rl are left out; {WANTS_TORCH}=1 installs them");
        left_out.push("not needs_learning");
    }
    let scripts = repo.root.join(SCRIPTS);
    if scripts.is_dir() {
        tests = tests.env("KINETOSCOPE_SEEDS", scripts);
    } else {
        println!("note: without the scripts of other simulators ({SCRIPTS}), their tests are left out");
        left_out.push("not needs_seeds");
    }
    if let Some(robots) = robots::local(repo) {
        tests = tests.env(robots::VARIABLE, robots);
    } else {
        println!("note: without the robots of {}, their tests are left out", robots::VARIABLE);
        left_out.push("not needs_robots");
    }
    tests
        .args(["-m", &left_out.join(" and ")])
        .current_dir(repo.root.join("python/tests"))
        .env("KINETOSCOPE_CLI", ready.binary("kinetoscope"))
        // Compiled kernels of MuJoCo Warp.
        .env("WARP_CACHE_PATH", repo.target.join("warp-cache"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .run()
}

/// True if tensors can be tested: torch is installed, but not beside the libraries of [`LEARNING`], which need a NumPy that
/// `create_sensor` does not run on.
fn is_with_torch(python: &Path) -> bool {
    Cmd::new(python).args(["-c", "import torch"]).quiet().succeeds() && !has_learning(python)
}

/// True if MuJoCo Warp is installed.
fn has_warp(python: &Path) -> bool {
    Cmd::new(python).args(["-c", "import importlib.util as u; assert u.find_spec('mujoco_warp')"]).quiet().succeeds()
}

/// True if the libraries of [`LEARNING`] are installed.
fn has_learning(python: &Path) -> bool {
    let imports = "import ray.rllib, rsl_rl, skrl, stable_baselines3, torchrl";
    Cmd::new(python).args(["-c", imports]).quiet().succeeds()
}

/// Installs the wheels of both packages into a new virtual environment as users do: pip gets their requirements from the
/// package index. Then runs the demo with these packages alone, and [`USER_TESTS`].
///
/// # Errors
/// A step fails.
pub(crate) fn install_as_users_do(repo: &Repo, wheels: &[PathBuf]) -> XtaskResult {
    let python = create_empty(&repo.target.join("wheel-venv"))?;
    let pip = || Cmd::new(&python).args(["-m", "pip", "--no-input", "--disable-pip-version-check"]);
    pip().arg("install").args(wheels).run()?;
    pip().arg("check").run()?;
    // Outside of the sources.
    let folder = repo.target.join("wheel-venv/demo");
    fs::create_dir_all(&folder).map_err(|e| Failure::new(format!("{}: {e}", folder.display())))?;
    let demo = ["-m", "kinetoscope", "demo", "--headless", "--steps", "50", "--out", "demo.png"];
    Cmd::new(&python).args(demo).current_dir(&folder).run()?;
    let ready = prepare(repo)?;
    build_command(&ready)?;
    python::pip_install(&python, &["pytest==9.2.0"])?;
    Cmd::new(&python)
        .args(["-m", "pytest", "-q", "-p", "no:cacheprovider"])
        .args(USER_TESTS)
        .current_dir(repo.root.join("python/tests"))
        .env("KINETOSCOPE_CLI", ready.binary("kinetoscope"))
        .env("PYTHONDONTWRITEBYTECODE", "1")
        .run()
}

/// A Python with the wheels for users, for benchmarks, below the target folder.
///
/// # Errors
/// A wheel cannot be built or installed.
pub(crate) fn bench_environment(repo: &Repo) -> XtaskResult<PathBuf> {
    let wheels = [python_package::build(repo, BuildProfile::Release)?, build(repo, BuildProfile::Release)?];
    let venv = repo.target.join("python-bench-venv");
    let python = venv.join("bin/python");
    if !Cmd::new(&python).args(["-c", "import mujoco, numpy"]).quiet().succeeds() {
        create(&venv, &[&format!("mujoco-core=={}", wheel::VERSION), "numpy==2.4.6"])?;
    }
    install(&python, &wheels)?;
    Ok(python)
}

/// Installs wheels without their requirements, which the environment has.
fn install(python: &Path, wheels: &[PathBuf]) -> XtaskResult {
    let install = ["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps"];
    Cmd::new(python).args(install).arg("--force-reinstall").args(wheels).run()
}

fn prepare(repo: &Repo) -> XtaskResult<Prepared> {
    setup::prepare(repo, Requirements { version: Some(MujocoVersion::Wheel), extras: &[] })
}

/// The environment of the tests with a version of NumPy, below the target folder. CI makes a new one, a developer's machine
/// keeps it.
fn environment(repo: &Repo, numpy: &str) -> XtaskResult<PathBuf> {
    let venv = repo.target.join(format!("python-sim-numpy-{numpy}"));
    let python = venv.join("bin/python");
    let check = format!(
        "import cv2, gymnasium, matplotlib, mypy, numpy, pytest, ray, scipy, PIL; assert numpy.__version__ == '{numpy}'"
    );
    let is_ready = || Cmd::new(&python).args(["-c", &check]).quiet().succeeds();
    // An environment of earlier tests could have packages that the wheels do not require.
    if in_ci() || !is_ready() {
        let core = format!("mujoco-core=={}", wheel::VERSION);
        create(&venv, &[&[core.as_str(), &format!("numpy=={numpy}")][..], &PACKAGES].concat())?;
    }
    if numpy == NUMPY[1] && !has_warp(&python) {
        let install = ["-m", "pip", "install", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps"];
        Cmd::new(&python).args(install).args(WARP).run()?;
    }
    if env::var_os(WANTS_TORCH).is_some() {
        let torch = ["torch==2.15.0"];
        let is_first = numpy == NUMPY[0];
        let pinned = format!("numpy=={numpy}");
        let packages = if is_first { torch.to_vec() } else { [&torch[..], &LEARNING, &[pinned.as_str()]].concat() };
        let imports = || if is_first { is_with_torch(&python) } else { has_learning(&python) };
        if !imports() {
            python::pip_install(&python, &packages)?;
        }
        if !imports() {
            return Err(Failure::new(format!("{packages:?} cannot be imported")));
        }
    }
    if is_ready() { Ok(python) } else { Err(Failure::new("the packages of the tests cannot be imported")) }
}

/// Copies a folder.
fn copy(from: &Path, to: &Path) -> std::io::Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            copy(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn copied_folders() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let [from, to] = ["from", "to"].map(|name| dir.path().join(name));
        fs::create_dir_all(from.join("a/b")).expect("writable");
        fs::write(from.join("a/b/c.stl"), "solid").expect("writable");
        copy(&from, &to).expect("copied");
        assert_eq!(fs::read_to_string(to.join("a/b/c.stl")).expect("a file"), "solid");
    }

    #[test]
    fn tests_for_users_need_no_other_package() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../python/tests");
        for file in USER_TESTS {
            let text = fs::read_to_string(folder.join(file)).expect("a file of tests");
            for name in ["cv2", "gymnasium", "matplotlib", "mypy", "ray", "scipy", "PIL", "_panic_next"] {
                let uses = [format!("import {name}"), format!("from {name}"), format!("_sim.{name}")];
                assert!(uses.iter().all(|used| !text.contains(used.as_str())), "{file}: {name}");
            }
        }
    }
}
