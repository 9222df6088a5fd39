//! Binaries that are linked to the MuJoCo of `MUJOCO_DIR` find it there when they start.
//!
//! Cargo sets the library path of `cargo run` and `cargo test` alone, and passes no linker arguments of `mujoco-sys` on.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    // Without the variable the library is where the linker of the system looks; a wrong one is an error of mujoco-sys.
    let Some(folder) = env::var_os("MUJOCO_DIR").map(PathBuf::from).and_then(|folder| fs::canonicalize(folder).ok())
    else {
        return;
    };
    let library = [folder.clone(), folder.join("lib")].into_iter().find(|folder| has_library(folder));
    if let Some(library) = library {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{}", library.display());
    }
}

/// True if MuJoCo's library is in a folder.
fn has_library(folder: &Path) -> bool {
    let Ok(entries) = fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| entry.file_name().to_string_lossy().starts_with("libmujoco.so"))
}
