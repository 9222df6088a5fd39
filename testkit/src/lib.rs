//! Test utilities that all crates share. Only tests depend on this crate.
//!
//! | module | provides |
//! |---|---|
//! | [`bits`] | bit-for-bit comparison of numbers |
//! | [`tolerance`] | comparison within a tolerance that carries its derivation |
//! | [`image_check`] | comparison of images; a failure writes an image of the difference |
//! | [`error_tables`] | tables of invalid inputs and their expected errors |
//! | [`test_resources`] | robots, models and programs that only some machines have |
//! | [`opencv`] | reference values of OpenCV |
//! | [`process`] | tests in their own process |
//! | [`srgb`] | the transfer function of sRGB |
//! | [`svg`] | reading of SVG plots |
//! | [`urdf`] | URDF snippets |
//! | [`wait`] | waiting for other threads or processes |
//! | `events` (feature `events`) | events of the libraries |
//! | `scenes` (feature `scenes`) | scenes to render |
//! | `x_server` (feature `x_server`) | an X server without a screen |
//! | `worlds` (feature `worlds`) | simulations, robots, objects and cameras |
//!
//! Functions panic where a test should fail; the message contains the expected value. Without its features, this crate
//! depends on no other crate of the workspace, so that unit tests of every crate can use it.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
#![forbid(unsafe_code)]

pub mod bits;
pub mod error_tables;
#[cfg(feature = "events")]
pub mod events;
pub mod image_check;
pub mod opencv;
pub mod process;
#[cfg(feature = "scenes")]
pub mod scenes;
pub mod srgb;
pub mod svg;
pub mod test_resources;
pub mod tolerance;
pub mod urdf;
pub mod wait;
#[cfg(feature = "worlds")]
pub mod worlds;
#[cfg(feature = "x_server")]
pub mod x_server;
