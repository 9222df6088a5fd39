//! Shapes of rigid objects, with their volumes and moments of inertia.

use crate::mjcf::document::Shape;
use kinetoscope_scene::mesh::{HullCfg, TriMesh};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use std::f64::consts::{PI, TAU};
use std::path::PathBuf;

/// Shape of a rigid object. Its frame is in the middle of its extent, and the axis of round shapes is z. The frame of a
/// mesh is that of its file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
#[non_exhaustive]
pub enum ObjectShape {
    /// Box.
    Box {
        /// Edge lengths along x, y and z \[m\].
        size: [f64; 3],
    },
    /// Sphere.
    Sphere {
        /// Radius \[m\].
        radius: f64,
    },
    /// Cylinder with flat ends.
    Cylinder {
        /// Radius \[m\].
        radius: f64,
        /// Length \[m\].
        length: f64,
    },
    /// Capsule: a cylinder with round ends.
    Capsule {
        /// Radius \[m\].
        radius: f64,
        /// Length of the cylindrical part \[m\].
        length: f64,
    },
    /// Cone with its base at -height/2 and its tip at +height/2. MuJoCo has no cones: the shape that collides and is
    /// rendered is an inscribed pyramid with 64 sides, up to 0.12 % of the radius inside the cone. The mass properties
    /// are those of the cone.
    Cone {
        /// Radius of the base \[m\].
        radius: f64,
        /// Height from the base to the tip \[m\].
        height: f64,
    },
    /// A mesh file: STL, OBJ, DAE, GLB or glTF.
    ///
    /// Cameras and ray casters see the triangles of the file. The collision shape is their convex hull, as for links of
    /// a robot, unless [`RigidObjectCfg::mesh_collision`](crate::RigidObjectCfg::mesh_collision) selects convex pieces
    /// or triangles. MuJoCo's contacts are those of convex shapes: nothing can lie in the hollow of a bowl that is one
    /// hull.
    ///
    /// Mass and moments are those of the enclosed volume with uniform density. If the surface is open, encloses no
    /// volume, or has impossible mass properties (a separate part is inside out), they are those of the hull, and a
    /// diagnostic reports it. Overlapping parts count twice where the bounds have room for it. A small separate part
    /// that is inside out is not detected.
    Mesh {
        /// Path of the file.
        path: PathBuf,
        /// Scale factors along the axes of the file; negative factors mirror.
        #[serde(default = "no_scale")]
        scale: [f64; 3],
        /// Simplification of the hull.
        #[serde(default)]
        hull: HullCfg,
    },
}

fn no_scale() -> [f64; 3] {
    [1.0; 3]
}

/// Number of corners of the base of a cone.
const CONE_SIDES: u32 = 64;

impl ObjectShape {
    /// Creates a cube with edges of `size` \[m\].
    pub const fn cube(size: f64) -> Self {
        Self::Box { size: [size; 3] }
    }

    /// Creates the shape of a mesh file with scale 1 and the default hull settings.
    pub fn mesh(path: impl Into<PathBuf>) -> Self {
        Self::Mesh { path: path.into(), scale: no_scale(), hull: HullCfg::default() }
    }

    /// Sizes \[m\], or absolute scale factors of a mesh; all must be positive.
    pub(crate) fn sizes(&self) -> Vec<f64> {
        match *self {
            Self::Box { size } => size.to_vec(),
            Self::Sphere { radius } => vec![radius],
            Self::Cylinder { radius, length } | Self::Capsule { radius, length } => vec![radius, length],
            Self::Cone { radius, height } => vec![radius, height],
            Self::Mesh { scale, .. } => scale.map(f64::abs).to_vec(),
        }
    }

    /// Volume \[m³\]; `None` for a mesh, whose volume depends on its file.
    pub fn volume(&self) -> Option<f64> {
        let ball = |r: f64| 4.0 / 3.0 * PI * r.powi(3);
        let tube = |r: f64, l: f64| PI * r * r * l;
        Some(match *self {
            Self::Box { size: [x, y, z] } => x * y * z,
            Self::Sphere { radius } => ball(radius),
            Self::Cylinder { radius, length } => tube(radius, length),
            Self::Capsule { radius, length } => tube(radius, length) + ball(radius),
            Self::Cone { radius, height } => tube(radius, height) / 3.0,
            Self::Mesh { .. } => return None,
        })
    }

    /// Center of mass for uniform density in the frame of the shape \[m\]: that of a cone is a quarter of its height
    /// above the base. `None` for a mesh.
    pub fn center(&self) -> Option<Vector3<f64>> {
        match *self {
            Self::Cone { height, .. } => Some(Vector3::new(0.0, 0.0, -height / 4.0)),
            Self::Mesh { .. } => None,
            _ => Some(Vector3::zeros()),
        }
    }

    /// Principal moments of inertia for uniform density and a mass of 1 kg, about the center of mass along x, y, z
    /// \[m²\]; `None` for a mesh. Source: the textbook formulas; a capsule is a cylinder and two half balls, whose
    /// centers of mass are 3/8 of the radius from their flat sides.
    pub fn unit_moments(&self) -> Option<Vector3<f64>> {
        Some(match *self {
            Self::Box { size: [x, y, z] } => {
                let [x, y, z] = [x * x, y * y, z * z];
                Vector3::new(y + z, x + z, x + y) / 12.0
            }
            Self::Sphere { radius } => Vector3::repeat(0.4 * radius * radius),
            Self::Cylinder { radius, length } => {
                let across = (3.0 * radius * radius + length * length) / 12.0;
                Vector3::new(across, across, 0.5 * radius * radius)
            }
            Self::Capsule { radius: r, length: l } => {
                let (tube, ball) = (PI * r * r * l, 4.0 / 3.0 * PI * r.powi(3));
                let (tube, ball) = (tube / (tube + ball), ball / (tube + ball));
                let across =
                    tube * (3.0 * r * r + l * l) / 12.0 + ball * (0.4 * r * r + l * l / 4.0 + 3.0 / 8.0 * r * l);
                Vector3::new(across, across, tube * 0.5 * r * r + ball * 0.4 * r * r)
            }
            Self::Cone { radius: r, height: h } => {
                let across = 3.0 / 20.0 * r * r + 3.0 / 80.0 * h * h;
                Vector3::new(across, across, 0.3 * r * r)
            }
            Self::Mesh { .. } => return None,
        })
    }

    /// Converts to a shape of MuJoCo; `mesh` is the name of the mesh asset for a cone or a mesh file.
    pub(crate) fn to_mjcf(&self, mesh: String) -> Shape {
        match *self {
            Self::Box { size } => Shape::Box(size.map(|s| s / 2.0)),
            Self::Sphere { radius } => Shape::Sphere(radius),
            Self::Cylinder { radius, length } => Shape::Cylinder(radius, length / 2.0),
            Self::Capsule { radius, length } => Shape::Capsule(radius, length / 2.0),
            Self::Cone { .. } | Self::Mesh { .. } => Shape::Mesh(mesh),
        }
    }
}

/// Pyramid that approximates a cone.
pub(crate) fn cone(radius: f64, height: f64) -> TriMesh {
    let corner = |k: u32| {
        let (sin, cos) = (TAU * f64::from(k) / f64::from(CONE_SIDES)).sin_cos();
        [radius * cos, radius * sin, -height / 2.0].map(|x| x as f32)
    };
    let mut positions: Vec<[f32; 3]> = (0..CONE_SIDES).map(corner).collect();
    let tip = CONE_SIDES;
    positions.push([0.0, 0.0, (height / 2.0) as f32]);
    let sides = (0..CONE_SIDES).map(|k| [k, (k + 1) % CONE_SIDES, tip]);
    let base = (1..CONE_SIDES - 1).map(|k| [0, k + 1, k]);
    TriMesh::from_triangles(positions, sides.chain(base).collect())
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_mujoco as mj;

    /// MuJoCo computes mass and moments of a geom independently.
    #[test]
    fn moments_by_mujoco() {
        let shapes = [
            (ObjectShape::Box { size: [0.2, 0.3, 0.5] }, "type='box' size='0.1 0.15 0.25'"),
            (ObjectShape::Sphere { radius: 0.3 }, "type='sphere' size='0.3'"),
            (ObjectShape::Cylinder { radius: 0.2, length: 0.7 }, "type='cylinder' size='0.2 0.35'"),
            (ObjectShape::Capsule { radius: 0.2, length: 0.7 }, "type='capsule' size='0.2 0.35'"),
        ];
        for (shape, attributes) in shapes {
            let xml = format!(
                "<mujoco><worldbody><body><freejoint/><geom density='1000' {attributes}/></body></worldbody></mujoco>"
            );
            let model = mj::compile(&xml, &[]).expect("compiles").into_model();
            let mass = 1000.0 * shape.volume().expect("no mesh");
            assert!((model.body_mass()[1] / mass - 1.0).abs() < 1e-12, "{shape:?}");
            let mut expected: Vec<f64> = (mass * shape.unit_moments().expect("no mesh")).iter().copied().collect();
            let mut found = model.body_inertia()[3..6].to_vec();
            // MuJoCo sorts principal moments in some versions.
            expected.sort_by(f64::total_cmp);
            found.sort_by(f64::total_cmp);
            for (a, b) in expected.iter().zip(&found) {
                assert!((a / b - 1.0).abs() < 1e-9, "{shape:?}: {expected:?} {found:?}");
            }
        }
    }

    /// The pyramid has the volume of a cone over a polygon: n/2 r² sin(2π/n) h/3. Its moments converge to those of the
    /// cone as the base converges to a circle: with 64 corners by 2π²/(3·64²) = 0.16 % in area, twice that in the
    /// moment about the axis.
    #[test]
    fn pyramid_and_cone() {
        let (radius, height) = (0.3, 0.8);
        let (shape, solid) =
            (ObjectShape::Cone { radius, height }, cone(radius, height).volume_integrals().expect("closed"));
        let polygon = 32.0 * radius * radius * (TAU / 64.0).sin() * height / 3.0;
        // Corners are in single precision.
        assert!((solid.volume / polygon - 1.0).abs() < 1e-6);
        let volume = shape.volume().expect("no mesh");
        assert!((volume - PI * 0.09 * 0.8 / 3.0).abs() < 1e-15);
        assert!((solid.volume / volume - 1.0).abs() < 0.002, "{}", solid.volume);
        assert!((solid.center - shape.center().expect("no mesh")).norm() < 1e-6);
        let tensor = |k: usize| (solid.second_moment.trace() - solid.second_moment[(k, k)]) / solid.volume;
        for (k, moment) in shape.unit_moments().expect("no mesh").iter().enumerate() {
            assert!((tensor(k) / moment - 1.0).abs() < 0.004, "axis {k}: {} {moment}", tensor(k));
        }
        // Control: about the middle of the extent, the transverse moment differs.
        let middle = 3.0 / 20.0 * 0.09 + 3.0 / 80.0 * 0.64 + 0.04;
        assert!((tensor(0) / middle - 1.0).abs() > 0.3);
    }
}
