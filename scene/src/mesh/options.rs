//! Options of mesh readers.

use serde::{Deserialize, Serialize};

/// Options for conventions that a mesh file does not define.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct MeshOptions {
    /// Treatment of `<up_axis>` of COLLADA files.
    pub dae_up_axis: DaeUpAxis,
}

/// The two conventions for `<up_axis>` of COLLADA files in robot descriptions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DaeUpAxis {
    /// Coordinates stay as written, as in RViz: URDF files are made to look right there.
    #[default]
    Ignore,
    /// The scene is rotated so that the up axis becomes +z. By the standard, a file without `<up_axis>` is y up.
    Apply,
}
