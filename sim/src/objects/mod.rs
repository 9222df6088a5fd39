//! What is added to a simulation: handle, configuration and data views of each kind in one file.

pub mod rigid_object;
pub mod robot;
pub mod shape;
