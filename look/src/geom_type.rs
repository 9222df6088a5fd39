//! Types of MuJoCo's geoms.

/// Shape type of a geom or a site, with MuJoCo's numbers (`mjtGeom`), which are the same in all versions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(i32)]
pub enum GeomType {
    /// A plane, finite or infinite.
    Plane = 0,
    /// A height field.
    HeightField = 1,
    /// A sphere.
    Sphere = 2,
    /// A capsule along z.
    Capsule = 3,
    /// An ellipsoid.
    Ellipsoid = 4,
    /// A cylinder along z.
    Cylinder = 5,
    /// A box.
    Box = 6,
    /// A triangle mesh.
    Mesh = 7,
}

impl GeomType {
    /// Type of one of MuJoCo's numbers; `None` for signed distance fields and decorations.
    pub fn from_id(id: i32) -> Option<Self> {
        Some(match id {
            0 => Self::Plane,
            1 => Self::HeightField,
            2 => Self::Sphere,
            3 => Self::Capsule,
            4 => Self::Ellipsoid,
            5 => Self::Cylinder,
            6 => Self::Box,
            7 => Self::Mesh,
            _ => return None,
        })
    }
}
