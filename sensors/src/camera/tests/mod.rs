//! Pictures held against independent judges.
#![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]

mod albedo;
mod boxes;
mod calibration;
mod calibration_files;
mod calibration_open_cv;
mod degenerate;
mod detail;
mod determinism;
mod floors_and_lamps;
mod flow;
mod golden;
mod late;
mod lens_pictures;
mod lens_poles;
pub(super) mod lenses;
mod metals;
mod noisy;
mod pictures;
mod progress;
mod rectified;
mod reference;
mod robots;
mod rolling_boxes;
mod scenes;
mod sensor;
mod sensor_mistakes;
mod sensor_values;
mod shutter;
mod stage;
mod stereo;
mod traced;
mod watertight;
