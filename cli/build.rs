//! Embeds the folder of the MuJoCo library as an rpath in the binaries of this package: a folder in `MUJOCO_DIR`, or the
//! download of the feature `download`. For a library of the system, the loader's default search path applies.
//!
//! Cargo sets the library search path only for `cargo run` and `cargo test`, and does not pass on linker arguments of
//! `mujoco-sys`.

fn main() {
    println!("cargo::rerun-if-changed=build.rs");
    if let Ok(folder) = std::env::var("DEP_MUJOCO_LIBRARY_DIR") {
        println!("cargo::rustc-link-arg=-Wl,-rpath,{folder}");
    }
}
