//! Camera calibrations as YAML, the cameras that they configure, and the text that is written again.
#![no_main]

use kinetoscope_fuzz::accepted;
use kinetoscope_sensors::camera::{CameraCfg, CameraInfo};

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Ok(text) = std::str::from_utf8(bytes) else { return };
    let Some(info) = accepted(CameraInfo::parse(text, "input.yaml")) else { return };
    let mut cfg = CameraCfg::default();
    info.apply_to(&mut cfg);
    let again = CameraInfo::parse(&info.to_yaml(), "written.yaml").expect("a written calibration can be read");
    assert_eq!(again, info);
});
