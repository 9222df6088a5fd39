//! URDF files: reading, checking, resolving meshes, merging components into one robot, and writing.
//!
//! `parse` checks one file and keeps the location of every element. `resolve` finds mesh files. `merge` turns one or
//! several files into a [`RobotDescription`](crate::description::RobotDescription), and `write` turns a description
//! into a URDF. Tree traversals do not recurse, so neither the depth nor the size of a file can exhaust the stack.

mod components;
mod config;
mod error;
mod file;
mod inertial;
mod joint;
mod link;
mod merge;
mod names;
mod parse;
mod reader;
mod resolve;
mod rotation;
mod shapes;
mod tree;
mod write;
mod xml;

pub use config::{ComponentCfg, MissingInertia, NameCase, NameCaseCfg, Strictness, UrdfCfg};
pub use error::UrdfError;
pub use file::{JointMetadata, LimitMetadata, LinkMetadata, UrdfFile, VisualMetadata};
pub use merge::{MergedRobot, assemble};
pub use parse::{parse_file, parse_file_with, parse_str, parse_str_with};
pub use tree::Tree;
pub use urdf_rs;
pub use write::{write_urdf, write_urdf_with};
