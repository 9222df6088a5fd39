//! The vendors' meshes, where they are present, against numbers from an independent reader.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

use std::path::PathBuf;

/// A small generator (xorshift64*) so that every run tests the same.
pub(super) struct Random(pub(super) u64);

impl Random {
    pub(super) fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    /// Uniform in 0..1.
    pub(super) fn unit(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// The folder of robot descriptions: `KINETOSCOPE_ROBOTS`, or `shared/robots` in a folder above this crate.
pub(super) fn robots() -> Option<PathBuf> {
    let named = std::env::var_os("KINETOSCOPE_ROBOTS").map(PathBuf::from);
    let above = || {
        let here = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
        here.ancestors().map(|dir| dir.join("shared/robots")).find(|dir| dir.is_dir())
    };
    let found = named.or_else(above).filter(|dir| dir.is_dir());
    if found.is_none() {
        println!("skipped: no robot descriptions; set KINETOSCOPE_ROBOTS to their folder");
    }
    found
}

/// All files below the robots with an extension, sorted.
pub(super) fn files(extension: &str) -> Vec<PathBuf> {
    let mut folders: Vec<PathBuf> = robots().into_iter().collect();
    let mut found = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e.eq_ignore_ascii_case(extension)) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

pub(super) fn stl_files() -> Vec<PathBuf> {
    files("stl")
}
