//! The search for MuJoCo in the build script: what it finds, and what a build without MuJoCo says. No test uses the
//! network.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

#[path = "../installation.rs"]
mod installation;

use installation::{DOWNLOADED, Download, Installation, WHEELS, cargo_errors};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A folder with headers of a version, and a library if it is named.
fn installed(folder: &Path, version: &str, library: Option<&str>) -> PathBuf {
    fs::create_dir_all(folder.join("include/mujoco")).unwrap();
    fs::write(folder.join("include/mujoco/mujoco.h"), format!("#define mjVERSION_HEADER {version}\n")).unwrap();
    if let Some(library) = library {
        fs::create_dir_all(folder.join(library).parent().unwrap()).unwrap();
        fs::write(folder.join(library), "").unwrap();
    }
    folder.into()
}

/// The three lines that `cargo add kinetoscope` leads to on a machine without MuJoCo.
#[test]
fn missing_mujoco() {
    let empty = tempfile::tempdir().unwrap();
    let error = Installation::find(None, None, &[empty.path()]).unwrap_err();
    let printed = cargo_errors(&error);
    let lines: Vec<&str> = printed.lines().collect();
    assert_eq!(lines.len(), 3, "{printed}");
    assert!(lines.iter().all(|line| line.starts_with("cargo::error=")), "{printed}");
    for (line, remedy) in lines.iter().zip(["apt-get install libmujoco-dev", "MUJOCO_DIR", "feature `download`"]) {
        assert!(line.contains(remedy), "{line}");
    }
}

#[test]
fn installations() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let system = installed(&at("system"), "222", None).join("include");
    let debian = Installation::find(None, None, &[&at("none"), &system]).unwrap();
    assert_eq!((debian.major(), debian.library.is_none()), (2, true));
    assert_eq!(debian.header("mujoco.h"), system.join("mujoco/mujoco.h"));
    for (name, library) in [("wheel", "libmujoco.so.4.0.1"), ("release", "lib/libmujoco.so.4.0.1")] {
        let given = installed(&at(name), "4000001", Some(library));
        // The given folder comes before that of the system.
        let found = Installation::find(Some(given.clone()), None, &[&system]).unwrap();
        assert_eq!((found.major(), found.library), (4, Some(fs::canonicalize(given.join(library)).unwrap())));
    }
    installed(&at("old"), "210", Some("libmujoco.so"));
    installed(&at("headers only"), "222", None);
    installed(&at("no version"), "", Some("libmujoco.so"));
    for (name, cause) in [
        ("missing", "No such file"),
        ("old", "belongs to MuJoCo 210, which is not supported"),
        ("headers only", "no libmujoco.so* in it"),
        ("no version", "no mjVERSION_HEADER"),
    ] {
        let error = Installation::find(Some(at(name)), None, &[&system]).unwrap_err();
        assert!(error.contains(name) && error.contains(cause) && error.contains("supported versions"), "{error}");
    }
}

/// A wheel with a library and headers, and its SHA-256. pip takes it from its folder.
fn wheel(folder: &Path) -> String {
    let script = "\
import hashlib, sys, zipfile
path = sys.argv[1] + '/mujoco_core-4.0.1-py3-none-manylinux_2_28_x86_64.whl'
with zipfile.ZipFile(path, 'w') as wheel:
    wheel.writestr('mujoco/libmujoco.so.4.0.1', '')
    wheel.writestr('mujoco/include/mujoco/mujoco.h', '#define mjVERSION_HEADER 4000001')
    about = 'mujoco_core-4.0.1.dist-info/'
    wheel.writestr(about + 'METADATA', 'Metadata-Version: 2.1\\nName: mujoco-core\\nVersion: 4.0.1\\n')
    wheel.writestr(about + 'WHEEL', 'Wheel-Version: 1.0\\nTag: py3-none-manylinux_2_28_x86_64\\n')
    wheel.writestr(about + 'RECORD', '')
print(hashlib.sha256(open(path, 'rb').read()).hexdigest(), end='')
";
    let made = Command::new("python3").args(["-c", script]).arg(folder).output().unwrap();
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    String::from_utf8(made.stdout).unwrap()
}

/// The feature `download` unpacks a wheel with the expected hash, and refuses one with another hash.
#[test]
#[ignore = "needs pip: cargo xtask test"]
fn hash_of_the_download() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("index")).unwrap();
    fs::create_dir(at("out")).unwrap();
    let hash = wheel(&at("index"));
    let other = hash.replace(|c: char| c != '0', "0");
    let find = |hash: &str, data: &str| {
        let pip_options = vec!["--no-index".into(), "--find-links".into(), at("index").into()];
        let (arch, os, wheels) = ("x86_64".into(), "linux".into(), [("x86_64", "manylinux_2_28_x86_64", hash)]);
        let download = Download { arch, os, wheels: &wheels, data: at(data), scratch: at("out"), pip_options };
        Installation::find(None, Some(download), &[])
    };
    let error = find(&other, "refused").unwrap_err();
    assert!(error.starts_with("python3 -m pip failed: ") && error.contains(&hash) && error.contains(&other), "{error}");
    assert!(!at("refused").exists(), "nothing is unpacked");
    let found = find(&hash, "taken").unwrap();
    let library = at("taken").join(format!("mujoco-{DOWNLOADED}-x86_64/mujoco/libmujoco.so.{DOWNLOADED}"));
    assert_eq!((found.major(), found.library), (4, Some(fs::canonicalize(library).unwrap())));
    // An unpacked wheel is used again.
    assert!(find(&other, "taken").is_ok());
}

#[test]
fn other_targets() {
    let folder = tempfile::tempdir().unwrap();
    for (arch, os) in [("riscv64", "linux"), ("x86_64", "windows")] {
        let [data, scratch] = ["data", "out"].map(|name| folder.path().join(name));
        let (arch, os) = (arch.to_owned(), os.to_owned());
        let download = Download { arch, os, wheels: &WHEELS, data, scratch, pip_options: Vec::new() };
        let error = Installation::find(None, Some(download), &[]).unwrap_err();
        assert!(error.contains("the feature `download` has no MuJoCo for") && error.contains("MUJOCO_DIR"), "{error}");
    }
}
