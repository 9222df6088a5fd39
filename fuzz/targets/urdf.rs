//! URDF: one file, or a second one attached to the first; then inspection, compilation and ten steps.
#![no_main]

use kinetoscope_fuzz::{accepted, files, simulation, write};
use kinetoscope_robot::urdf::{Strictness, UrdfCfg, assemble, parse_str_with};
use kinetoscope_sim::RobotCfg;
use kinetoscope_sim::inspect::{InspectCfg, inspect};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let mut paths = Vec::new();
    for (file, name) in files(bytes).into_iter().zip(["input.urdf", "attached.urdf"]) {
        if let Ok(text) = std::str::from_utf8(file) {
            accepted(parse_str_with(text, name, Strictness::Strict));
        }
        paths.push(write(name, file));
    }
    let urdf = UrdfCfg::chain(paths);
    if accepted(assemble(&urdf)).is_none() {
        return;
    }
    accepted(inspect(&InspectCfg { urdf: urdf.clone(), ..InspectCfg::default() }));
    let mut sim = simulation();
    if let Some(robot) =
        accepted(sim.add_robot(RobotCfg { urdf, fix_base: bytes.len() % 2 == 0, ..RobotCfg::default() }))
    {
        sim.update(10);
        let positions = sim.robot(robot).qpos();
        assert!(positions.iter().all(|position| position.is_finite()) || !sim.diverged().is_empty());
    }
});
