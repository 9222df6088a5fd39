//! What is added to a simulation: handle, configuration and data views of each kind in one file.

pub mod robot;
