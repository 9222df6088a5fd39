//! Images of textures: PNG and JPEG.
#![no_main]

use kinetoscope_scene::mesh::TextureSource;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match TextureSource::Embedded(bytes.to_vec()).decode() {
        Ok(image) => assert!(image.width() > 0 && image.height() > 0),
        Err(reason) => assert!(!reason.is_empty()),
    }
});
