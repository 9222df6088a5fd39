//! Build script that adds the library folder of `MUJOCO_DIR` to the run path of the binary.
//!
//! Cargo sets the library path only for `cargo run` and `cargo test`, and ignores the linker arguments of `mujoco-sys`.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    // Without the variable, the system linker finds the library. An invalid folder is reported by `mujoco-sys`.
    let Some(folder) = env::var_os("MUJOCO_DIR").map(PathBuf::from).and_then(|folder| fs::canonicalize(folder).ok())
    else {
        return;
    };
    let library = [folder.clone(), folder.join("lib")].into_iter().find(|folder| has_library(folder));
    if let Some(library) = library {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", library.display());
    }
}

/// True if a folder contains the MuJoCo library.
fn has_library(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("libmujoco.so"))
}
