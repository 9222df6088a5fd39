//! MJCF as a part of a scene, and as a robot.
//!
//! MuJoCo reads these files, and promises nothing for huge numbers and counts (SECURITY.md): such files are left out.
#![no_main]

use kinetoscope_fuzz::{accepted, simulation};
use kinetoscope_sim::{MjcfFile, MjcfPartCfg, RobotCfg};

/// Larger numbers run into MuJoCo's own loops and allocations.
const LARGEST: f64 = 1e6;

/// Elements and attributes that multiply the size of a model, or the memory of its simulation.
const MULTIPLY: [&str; 12] = [
    "composite",
    "replicate",
    "count",
    "width",
    "height",
    "nrow",
    "ncol",
    "memory",
    "njmax",
    "nconmax",
    "nstack",
    "nuser",
];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let words = text.split(|c: char| !(c.is_ascii_alphanumeric() || "+-._".contains(c)));
    let is_huge = |word: &str| word.parse::<f64>().is_ok_and(|number| !(number.abs() <= LARGEST));
    if words.into_iter().any(is_huge) || MULTIPLY.iter().any(|word| text.contains(word)) {
        return;
    }
    let mut sim = simulation();
    if accepted(sim.add_mjcf(MjcfPartCfg::text("part", text))).is_some() {
        sim.update(2);
        accepted(sim.add_robot(RobotCfg { mjcf: Some(MjcfFile::text(text)), ..RobotCfg::default() }));
        sim.update(2);
    }
});
