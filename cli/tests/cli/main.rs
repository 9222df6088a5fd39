//! Integration tests of the command `kinetoscope` and its views.
#![allow(clippy::print_stderr, reason = "modules of the command print")]
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod browser;
mod commands;
mod events;
mod plots;
mod recording_page;
mod replays;
mod serve;
mod shells;
mod support;
mod tutorials;
mod view;

// Modules of the command with unit tests. They run in this binary, so the command needs no second test binary.
#[allow(dead_code, reason = "only its tests are run")]
#[path = "../../src/excerpt.rs"]
mod excerpt;
#[allow(dead_code, reason = "only its tests are run")]
#[path = "../../src/field_names.rs"]
mod field_names;
#[allow(dead_code, reason = "only its tests are run")]
#[path = "../../src/file_kind.rs"]
mod file_kind;
#[allow(dead_code, reason = "only its tests are run")]
#[path = "../../src/progress.rs"]
mod progress;
