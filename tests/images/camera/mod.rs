//! Cameras in a simulation, held against MuJoCo's own rays and against where things are.

mod markers;
mod models;
mod mujoco_renderer;
mod npy;
mod objects;
mod overview;
mod placement;
mod ply;
mod rays;
mod renderers;
mod schedule;
mod segments;
mod stereo;
mod surfaces;
