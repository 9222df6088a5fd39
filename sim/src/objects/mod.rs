//! Entities of a simulation, such as robots, objects and terrains: handle, configuration, data, and read and write
//! access.

pub(crate) mod articulation;
mod collision_exclusion;
pub(crate) mod free_body;
pub(crate) mod kinematics;
pub(crate) mod mass_properties;
pub(crate) mod mesh_collision;
pub(crate) mod mjcf_file;
pub(crate) mod mjcf_part;
pub(crate) mod mjcf_part_data;
pub(crate) mod object_group;
pub(crate) mod object_group_data;
mod object_mesh;
pub(crate) mod restitution;
pub(crate) mod rigid_object;
pub(crate) mod rigid_object_data;
mod rigid_object_properties;
pub(crate) mod robot;
pub(crate) mod robot_cfg;
mod robot_clearance;
pub(crate) mod robot_data;
mod robot_drives;
mod robot_full_state;
pub(crate) mod robot_gather;
mod robot_limits;
pub(crate) mod robot_part;
mod robot_passive_joints;
mod robot_state;
mod robot_wrenches;
mod rows;
pub(crate) mod shape;
pub(crate) mod terrain;
mod terrain_file;
pub(crate) mod weld;
pub(crate) mod weld_data;

pub(crate) use rows::unique_envs;
