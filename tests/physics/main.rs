//! Laws of physics, each compared with its closed form or a conservation law, through URDF files, manager, robots and
//! objects.
//!
//! One file is one law: the file name is the law's name, and the module comment has the derivation. To add a law, write
//! the file and list it in the `mod.rs` of its group. `cargo test --test physics free_fall` runs one law.
//!
//! If `KINETOSCOPE_PHYSICS_ROWS` names a folder, each law also writes its results there; `cargo xtask physics-report`
//! converts them to `docs/physics.md`.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bounce;
mod lab;
mod law;
mod rows;
mod tolerance;
mod urdf;

mod articulated;
mod contacts;
mod drives;
mod numerical;
mod rigid_body;
