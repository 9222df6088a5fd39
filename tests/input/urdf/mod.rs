//! URDF files, good, bad and hostile.

mod assembly;
mod bad_input;
mod robots;
mod robustness;
