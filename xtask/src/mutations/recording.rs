//! Mutations of recordings, of their files, and of the reading of recordings.

use super::Mutation;

pub(super) const RECORDING: &[Mutation] = &[
    Mutation::of(
        "kinetoscope-scene",
        "shape of an array of one axis a number",
        "scene/src/npy.rs",
        ["if shape.len() == 1 {", "if shape.len() == 2 {"],
        &["npy::tests::"],
    ),
    Mutation::of(
        "kinetoscope-record",
        "time that an environment is set to ignored",
        "record/src/clock.rs",
        ["self.offsets[env] = now - times[env];", "self.offsets[env] = now;"],
        &["clock::tests::"],
    ),
    Mutation::of(
        "kinetoscope-record",
        "count forgotten where deviations are joined",
        "record/src/lerobot/statistics.rs",
        ["apart * apart * self.count * other.count / count", "apart * apart * other.count / count"],
        &["lerobot::statistics::tests::"],
    ),
    Mutation::of(
        "kinetoscope-record",
        "actions of the row before repeated",
        "record/src/replay.rs",
        ["self.apply_actions(sim, row)?;", "self.apply_actions(sim, row.saturating_sub(1))?;"],
        &["replay::tests::"],
    ),
    Mutation::of(
        "kinetoscope-record",
        "numbers of messages aligned from the header on",
        "record/src/ros/cdr.rs",
        ["(self.0.len() - HEADER.len()).next_multiple_of(size) + HEADER.len()", "self.0.len().next_multiple_of(size)"],
        &["ros::cdr::tests::"],
    ),
    Mutation::of(
        "kinetoscope-record",
        "red and blue of a video exchanged",
        "record/src/animation/h264.rs",
        [
            "fn chroma(&self, sums: [i32; 3]) -> [u8; 2] {",
            "fn chroma(&self, mut sums: [i32; 3]) -> [u8; 2] { sums.reverse();",
        ],
        &["animation::h264::tests::"],
    ),
    Mutation::of(
        "kinetoscope-record",
        "what a damaged recording left behind removed",
        "record/src/recover.rs",
        ["if recovered.damage.is_none() {", "if recovered.messages > 0 {"],
        &["recorder::tests::"],
    ),
];
