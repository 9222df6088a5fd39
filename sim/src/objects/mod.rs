//! What is added to a simulation: handle, configuration and data views of each kind in one file.

pub mod articulation;
pub(crate) mod free_body;
pub mod kinematics;
pub mod mjcf_part;
pub mod rigid_object;
pub mod robot;
mod robot_drives;
mod robot_joints;
mod robot_limits;
mod robot_state;
mod robot_wrenches;
mod rows;
pub mod shape;
pub mod terrain;
mod terrain_file;
