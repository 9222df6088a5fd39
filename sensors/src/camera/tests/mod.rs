//! Tests of camera sensors, against closed forms and other renderers.

mod boxes;
mod calibration;
mod flow;
mod latency;
mod lens_images;
pub(super) mod lenses;
mod noise;
mod progress;
mod sensor;
mod shutter;
mod stereo;
mod test_scene;
