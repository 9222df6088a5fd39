//! Robots without physics: URDF files, the merged description, kinematics, dynamics and mass properties.
//!
//! ```text
//! URDF files -> UrdfFile -> RobotDescription -> kinematics::Chain, dynamics::Dynamics
//!  urdf::parse  urdf::merge  description
//! ```
//!
//! Nothing here needs MuJoCo: a URDF can be read, checked and solved where no engine is installed.
//!
//! | module | content |
//! |---|---|
//! | [`urdf`] | URDF files: strict reading with file and line, components, merging |
//! | [`description`] | the merged robot: links, joints, shapes |
//! | [`kinematics`] | chains, Jacobians, inverse kinematics |
//! | [`dynamics`] | inverse dynamics and mass matrices |
//! | [`inertia`], [`body_inertia`], [`shape_inertia`] | mass properties of links, of rigid bodies, and of shapes |
//! | [`diagnostic`] | warnings about input that is odd but usable |
#![forbid(unsafe_code)]

pub mod body_inertia;
pub mod description;
pub mod diagnostic;
pub mod dynamics;
pub mod inertia;
pub mod kinematics;
pub mod mesh_key;
pub mod shape_inertia;
pub mod urdf;
