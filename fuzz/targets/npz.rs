//! NumPy archives: the raw bytes, and archives with correct checksums whose members are the files of the input.
#![no_main]

use kinetoscope_fuzz::{accepted, files, write};
use kinetoscope_record::{FieldSelector, Recording, replay};
use std::io::{Cursor, Write as _};
use zip::write::SimpleFileOptions;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    match bytes.starts_with(b"PK") {
        true => read(bytes),
        false => drop(archive(bytes).map(|archive| read(&archive))),
    }
});

/// Each file of the input starts with a line that is its name in the archive.
fn archive(bytes: &[u8]) -> Option<Vec<u8>> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for file in files(bytes) {
        let line = file.iter().position(|byte| *byte == b'\n')?;
        let name = std::str::from_utf8(&file[..line]).ok()?;
        let options = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        archive.start_file(name, options).ok()?;
        archive.write_all(&file[line + 1..]).ok()?;
    }
    archive.finish().ok().map(Cursor::into_inner)
}

fn read(bytes: &[u8]) {
    let path = write("run.npz", bytes);
    let Some(recording) = accepted(Recording::open(&path)) else { return };
    let first =
        |topic: &kinetoscope_record::RecordedTopic| Some(FieldSelector::new(&topic.name, topic.fields.first()?));
    let wanted: Vec<FieldSelector> = recording.topics().iter().filter_map(first).collect();
    accepted(recording.time_series(&wanted));
    accepted(replay::num_envs(&path));
}
