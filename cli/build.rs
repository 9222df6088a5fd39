//! Embeds the folder of the MuJoCo library in `MUJOCO_DIR` as an rpath in the binaries of this package.
//!
//! Cargo sets the library search path only for `cargo run` and `cargo test`, and does not pass on linker arguments of
//! `mujoco-sys`.

use std::path::{Path, PathBuf};
use std::{env, fs};

fn main() {
    println!("cargo::rerun-if-env-changed=MUJOCO_DIR");
    println!("cargo::rerun-if-changed=build.rs");
    // Without MUJOCO_DIR, the loader's default search path applies. mujoco-sys reports an invalid MUJOCO_DIR.
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
