//! MCAP recordings: topics, numbers over time, recorded arrays, and recovery of the same bytes as a partial file.
#![no_main]

use kinetoscope_fuzz::{accepted, folder, write};
use kinetoscope_record::{FieldSelector, Recording, recover, replay};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let path = write("run.mcap", bytes);
    if let Some(recording) = accepted(Recording::open(&path)) {
        read(&recording);
        accepted(replay::num_envs(&path));
    }
    write("killed.mcap.part", bytes);
    let whole = folder().join("killed.mcap");
    let _ = std::fs::remove_file(&whole);
    if let Some(recovered) = accepted(recover(&whole)) {
        let recording = Recording::open(&whole).expect("a recovered file is complete");
        let count: u64 = recording.topics().iter().map(|topic| topic.count).sum();
        assert_eq!(count, recovered.messages);
    }
});

fn read(recording: &Recording) {
    let first =
        |topic: &kinetoscope_record::RecordedTopic| Some(FieldSelector::new(&topic.name, topic.fields.first()?));
    let wanted: Vec<FieldSelector> = recording.topics().iter().filter_map(first).collect();
    accepted(recording.time_series(&wanted));
    assert!(recording.env_ids().len() <= recording.topics().len());
}
