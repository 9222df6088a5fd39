//! MJCF as a part of a scene, and as a robot.
//!
//! Models that ask for large buffers are left out: their memory is what the file asks for.
#![no_main]

use kinetoscope_fuzz::{accepted, simulation};
use kinetoscope_sim::{MjcfFile, MjcfPartCfg, RobotCfg};

/// Attributes that ask for memory.
const MEMORY: [&str; 5] = ["memory", "njmax", "nconmax", "nstack", "nuser"];

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    if MEMORY.iter().any(|word| text.contains(word)) {
        return;
    }
    let mut sim = simulation();
    if accepted(sim.add_mjcf(MjcfPartCfg::text("part", text))).is_some() {
        sim.update(2);
        accepted(sim.add_robot(RobotCfg { mjcf: Some(MjcfFile::text(text)), ..RobotCfg::default() }));
        sim.update(2);
    }
});
