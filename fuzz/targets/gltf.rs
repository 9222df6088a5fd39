//! GLB, and glTF with its buffer as a second file.
#![no_main]

use kinetoscope_fuzz::{files, mesh, write};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    if bytes.starts_with(b"glTF") {
        return mesh("input.glb", bytes);
    }
    let files = files(bytes);
    write("input.bin", files.get(1).copied().unwrap_or_default());
    mesh("input.gltf", files[0]);
});
