//! Scene files as TOML and, if the text starts with `---`, as YAML. Small ones are built and run a step.
#![no_main]

use kinetoscope_fuzz::{accepted, folder};
use kinetoscope_sim::{EntityTypes, InteractiveScene, SceneCfg};

/// Longest written scene that is read again \[bytes\].
const LONGEST: usize = 1 << 16;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let (file, types) = (folder().join("scene"), EntityTypes::default());
    let read = |text: &str| SceneCfg::from_toml(text, &file, &types);
    let scene = if text.starts_with("---") { SceneCfg::from_yaml(text, &file, &types) } else { read(text) };
    let Some(scene) = accepted(scene) else { return };
    // Generated terrains are written as their heights.
    if let Some(written) = accepted(scene.to_toml(&types)).filter(|written| written.len() < LONGEST) {
        read(&written).expect("a written scene can be read");
    }
    // What a scene may ask for is on the page SECURITY.md: millions of environments and points, images of any size.
    let is_small = scene.simulation.num_envs <= 4 && scene.keys().count() <= 3 && !text.contains("camera");
    if is_small && scene.simulation.threads.is_some_and(|threads| threads <= 4) {
        if let Some(mut scene) = accepted(InteractiveScene::new(scene)) {
            scene.update(1);
        }
    }
});
