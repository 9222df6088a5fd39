//! Tests of camera sensors, against closed forms and other renderers.

mod boxes;
mod calibration;
mod flow;
mod late;
mod lens_images;
pub(super) mod lenses;
mod noisy;
mod progress;
mod sensor;
mod shutter;
mod stage;
mod stereo;
