//! Options of mesh readers.

/// Options for conventions that a mesh file does not define.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshOptions {
    /// Treatment of `<up_axis>` of COLLADA files.
    pub dae_up_axis: DaeUpAxis,
}

/// The two conventions for `<up_axis>` of COLLADA files in robot descriptions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DaeUpAxis {
    /// Coordinates stay as written, as in RViz: URDF files are made to look right there.
    #[default]
    Ignore,
    /// The scene is rotated so that the up axis becomes +z. By the standard, a file without `<up_axis>` is y up.
    Apply,
}
