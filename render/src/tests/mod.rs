//! Images, compared with analytic answers and other renderers.

mod degenerate;
mod determinism;
mod flow;
mod golden;
mod harness;
mod lens_images;
mod lens_poles;
mod lenses;
mod lighting;
mod lod;
mod mirrors;
mod opengl;
mod orthographic;
mod progress;
mod reference;
mod robots;
mod shutter;
mod skies;
mod surfaces;
mod traced;
