//! Robots without physics: URDF files, the merged description, kinematics, dynamics and mass properties.
//!
//! This crate reads and merges URDF files into one [`RobotDescription`](description::RobotDescription), and computes
//! kinematics, rigid-body dynamics and mass properties from it. It does not need MuJoCo: a URDF can be read, checked
//! and solved on machines without it.
//!
//! ```text
//! URDF files -> UrdfFile -> RobotDescription -> kinematics::Chain, dynamics::Dynamics
//!  urdf::parse  urdf::merge  description
//! ```
//!
//! | module | content |
//! |---|---|
//! | [`urdf`] | URDF files: strict reading with file and line, components, merging |
//! | [`description`] | the merged robot: links, joints, shapes |
//! | [`kinematics`] | chains, Jacobians, inverse kinematics |
//! | [`dynamics`] | inverse dynamics and mass matrices |
//! | [`inertia`], [`body_inertia`], [`shape_inertia`] | mass properties of links, of rigid bodies, and of shapes |
//! | [`position_range`] | position limits of joints, with those of mimic joints |
//! | [`mesh_key`] | keys of mesh files in caches |
//! | [`diagnostic`] | warnings about input that is odd but usable |
//!
//! ```
//! use kinetoscope_robot::dynamics::{Configuration, Dynamics};
//! use kinetoscope_robot::urdf::{UrdfCfg, assemble};
//! use nalgebra::Vector3;
//! # let urdf = std::env::temp_dir().join(format!("kinetoscope-cart-{}.urdf", std::process::id()));
//! # std::fs::write(&urdf, "<robot name='r'><link name='rail'/><link name='cart'><inertial><mass value='2'/>
//! #   <inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>
//! #   <joint name='slide' type='prismatic'>
//! #   <parent link='rail'/><child link='cart'/><axis xyz='0 0 1'/><limit lower='0' upper='2' effort='1' velocity='1'/>
//! #   </joint></robot>")?;
//!
//! // A cart of 2 kg on a vertical rail.
//! let robot = assemble(&UrdfCfg::single(&urdf))?.description;
//! # std::fs::remove_file(&urdf)?;
//! let dynamics = Dynamics::new(&robot, &Configuration::zero(&robot))?;
//! let effort = dynamics.gravity_torque(&Vector3::new(0.0, 0.0, -9.81));
//! assert!((effort[0] - 2.0 * 9.81).abs() < 1e-12);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![forbid(unsafe_code)]

pub mod body_inertia;
pub mod description;
pub mod diagnostic;
pub mod dynamics;
pub mod inertia;
pub mod kinematics;
pub mod mesh_key;
pub mod position_range;
pub mod shape_inertia;
pub mod urdf;
