//! Wavefront OBJ, with its material library as a second file.
#![no_main]

use kinetoscope_fuzz::{files, mesh, write};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let files = files(bytes);
    write("input.mtl", files.get(1).copied().unwrap_or_default());
    mesh("input.obj", files[0]);
});
