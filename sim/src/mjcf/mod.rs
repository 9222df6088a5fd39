//! From a robot description to the MJCF that MuJoCo compiles.
//!
//! [`document`] mirrors MJCF as plain data, `robot` and `scene` fill it, `part` adds files that are MJCF already, and
//! [`robot_file`] those that are robots;
//! [`write`](mod@write) turns it into text for one of the two MuJoCo lines and remembers which line came from which element
//! of the user's file.

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
