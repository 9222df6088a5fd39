//! Laws of physics, each against its closed form or a conservation law, through URDF files, manager, robots and objects.
//!
//! One file is one law; its name is the law's, its head has the derivation. To add one, write the file and name it in the
//! `mod.rs` of its group. `cargo test --test physics free_fall` runs one of them.
//!
//! With `KINETOSCOPE_PHYSICS_ROWS` naming a folder, each law also writes what it measured there: `cargo xtask
//! physics-report` makes `docs/physics.md` of it.
#![allow(clippy::unwrap_used, reason = "a test fails by panicking")]

mod bounce;
mod lab;
mod law;
mod rows;
mod urdf;

mod articulated;
mod contacts;
mod drives;
mod numerical;
mod rigid_body;
