//! Options of mesh readers.

/// Options that a file does not settle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MeshOptions {
    /// Treatment of `<up_axis>` of COLLADA files.
    pub dae_up_axis: DaeUpAxis,
}

/// The two conventions for `<up_axis>` of COLLADA files in robot descriptions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum DaeUpAxis {
    /// Coordinates stay as written: RViz, hence every URDF that looks right there.
    #[default]
    Ignore,
    /// The scene turns so that the axis named up becomes +z (a file that names none is y up, says the standard).
    Apply,
}
