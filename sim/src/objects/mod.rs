//! What is added to a simulation: handle, configuration and data views of each kind in one file.

mod apart;
pub mod articulation;
pub(crate) mod free_body;
pub mod kinematics;
pub(crate) mod mass_properties;
pub mod mesh_collision;
pub mod mjcf_part;
pub mod object_group;
mod object_mesh;
pub(crate) mod restitution;
pub mod rigid_object;
mod rigid_object_properties;
pub mod robot;
pub mod robot_cfg;
mod robot_drives;
pub mod robot_file;
mod robot_joints;
mod robot_limits;
mod robot_lowest;
pub mod robot_part;
mod robot_state;
mod robot_wrenches;
mod rows;
pub mod shape;
pub mod terrain;
mod terrain_file;
pub mod weld;
