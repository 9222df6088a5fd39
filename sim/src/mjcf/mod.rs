//! MJCF: the document as plain data, its writer, and the readers of MJCF files.
//!
//! [`document`] mirrors MJCF as plain data, and `robot` and `scene` fill it. `part` embeds MJCF files in a scene, and
//! [`robot_file`] reads MJCF files of robots. [`write`](mod@write) turns the document into text for one of the two
//! supported MuJoCo versions, and records which line came from which element of the user's file.

pub mod document;
pub mod error;
pub(crate) mod part;
pub(crate) mod robot;
pub mod robot_file;
pub(crate) mod scene;
pub(crate) mod scene_names;
pub mod write;

pub use document::Mjcf;
pub use error::MAX_BODY_DEPTH;
