//! Images, compared with analytic answers and other renderers.

mod boxes;
mod calibration;
mod degenerate;
mod detail;
mod determinism;
mod flow;
mod golden;
mod harness;
mod late;
mod lens_images;
mod lens_poles;
pub(super) mod lenses;
mod light;
mod mirrors;
mod noisy;
mod progress;
mod reference;
mod robots;
mod scenes;
mod sensor;
mod shutter;
mod skies;
mod stage;
mod stereo;
mod surfaces;
mod traced;
