//! Real robots for the tests: `../shared/robots` if it exists, otherwise the robots of the PyPI package
//! `example-robot-data`.

use crate::run::{Cmd, Failure, Repo, XtaskResult};
use crate::wheel;
use std::fs;
use std::path::{Path, PathBuf};

/// Environment variable with the folder of robots for the tests.
pub(crate) const VARIABLE: &str = "KINETOSCOPE_ROBOTS";
/// Robots next to the repository.
const LOCAL_FOLDER: &str = "../shared/robots";
/// BSD-licensed descriptions of some fifty robots. It is installed without dependencies, because the package brings a
/// loader for Pinocchio.
const PACKAGE: &str = "example-robot-data==6.0.0";
/// The folder inside the package whose `robots` has the robots. It keeps its name: the URDFs have addresses of meshes such as
/// `package://example-robot-data/robots/ur_description/meshes/base.dae`.
const INSIDE: &str = "cmeel.prefix/share/example-robot-data";

/// Source of the robots.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Robots {
    /// All robots of the tests.
    Complete,
    /// Only the robots of PyPI, in this folder; tests named `vendor...` need others.
    FromPyPi(PathBuf),
}

/// Finds real robots, or downloads them once into the target folder.
///
/// # Errors
/// If no robots are found and the download fails.
pub(crate) fn obtain(repo: &Repo) -> XtaskResult<Robots> {
    if std::env::var_os(VARIABLE).is_some() || repo.root.join(LOCAL_FOLDER).is_dir() {
        return Ok(Robots::Complete);
    }
    let folder = repo.target.join("example-robot-data");
    if !folder.is_dir() {
        download(&repo.target, &folder)?;
    }
    Ok(Robots::FromPyPi(folder.join("robots")))
}

/// The folder of robots that the environment variable names, or else the one next to the repository; `None` if it does
/// not exist.
pub(crate) fn local(repo: &Repo) -> Option<PathBuf> {
    let named = std::env::var_os(VARIABLE).map(PathBuf::from);
    named.or_else(|| Some(repo.root.join(LOCAL_FOLDER))).filter(|folder| folder.is_dir())
}

/// Downloads into a scratch folder and renames it once it is complete.
fn download(target: &Path, folder: &Path) -> XtaskResult {
    let pip = wheel::pip().ok_or_else(|| Failure::new("real robots are downloaded with pip, which is missing"))?;
    let scratch = target.join(format!("robots-{}", std::process::id()));
    let fail = |e: std::io::Error| Failure::new(format!("{}: {e}", scratch.display()));
    fs::create_dir_all(&scratch).map_err(fail)?;
    let result = Cmd::new(pip[0])
        .args(&pip[1..])
        .args(["download", "--no-input", "--disable-pip-version-check", "--quiet", "--no-deps", "--dest"])
        .arg(&scratch)
        .arg(PACKAGE)
        .run()
        .and_then(|()| {
            let is_wheel = |path: &PathBuf| path.extension().is_some_and(|end| end == "whl");
            let mut files = fs::read_dir(&scratch).map_err(fail)?.flatten().map(|entry| entry.path());
            let wheel = files.find(is_wheel).ok_or_else(|| Failure::new(format!("{PACKAGE} is not a wheel")))?;
            Cmd::new("python3").args(["-m", "zipfile", "-e"]).args([&wheel, &scratch]).output()?;
            fs::rename(scratch.join(INSIDE), folder).map_err(fail)
        });
    fs::remove_dir_all(&scratch).map_err(fail)?;
    result
}
