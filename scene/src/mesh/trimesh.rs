//! Operations on meshes.

use super::affine::PreparedAffine;
use super::builder::unit;
use super::{Submesh, TriMesh};
use crate::Pose;
use crate::vector::{cross, dot};

/// A violated invariant of [`TriMesh`].
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum InvalidMesh {
    /// The number of normals or texture coordinates differs from the number of positions.
    #[error("{count} {what} for {positions} positions; expected the same number")]
    Length {
        /// "normals" or "texture coordinates".
        what: &'static str,
        /// Number of normals or texture coordinates.
        count: usize,
        /// Number of positions.
        positions: usize,
    },
    /// A position, normal or texture coordinate is not finite.
    #[error("{what} {index} is not finite")]
    NonFinite {
        /// "position", "normal" or "texture coordinate".
        what: &'static str,
        /// Index of the element in the list that `what` names.
        index: usize,
    },
    /// A triangle refers to a missing vertex.
    #[error("triangle {triangle} refers to vertex {index}, but the mesh has {positions} vertices")]
    Index {
        /// Index of the triangle in the mesh.
        triangle: usize,
        /// Index of the vertex, which is not below `positions`.
        index: u32,
        /// Number of positions.
        positions: usize,
    },
    /// The submeshes do not cover the triangles consecutively.
    #[error(
        "submesh {part} covers triangles {found_start}..{found_end}; submeshes must be contiguous: this one must begin \
         at {expected_start}, and the last one must end at {triangles}"
    )]
    Submeshes {
        /// Index of the submesh (one past the last if triangles are left over).
        part: usize,
        /// First triangle of the submesh.
        found_start: usize,
        /// End of the submesh's triangles, exclusive.
        found_end: usize,
        /// Expected first triangle of the submesh.
        expected_start: usize,
        /// Number of triangles.
        triangles: usize,
    },
    /// A submesh refers to a missing material.
    #[error("submesh {part} uses material {material}, but the mesh has {materials} materials")]
    Material {
        /// Index of the submesh.
        part: usize,
        /// Index of the material in the mesh, which is not below `materials`.
        material: usize,
        /// Number of materials.
        materials: usize,
    },
}

impl TriMesh {
    /// Creates a mesh of one submesh, without normals, texture coordinates and material.
    pub fn from_triangles(positions: Vec<[f32; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        let submeshes = vec![Submesh { triangles: 0..triangles.len(), material: None }];
        Self { positions, triangles, submeshes, ..Self::default() }
    }

    /// Bounding box in the frame of the mesh: smallest and largest coordinates \[m\]; `None` without vertices.
    pub fn bounds(&self) -> Option<([f32; 3], [f32; 3])> {
        let first = *self.positions.first()?;
        Some(self.positions.iter().fold((first, first), |(lo, hi), p| {
            let pick = |f: fn(f32, f32) -> f32, a: [f32; 3]| std::array::from_fn(|i| f(a[i], p[i]));
            (pick(f32::min, lo), pick(f32::max, hi))
        }))
    }

    /// Enclosed volume \[m³\]: positive if the front of a closed surface is outside, negative if its front is inside,
    /// meaningless for an open surface.
    pub fn signed_volume(&self) -> f64 {
        // Relative to the middle of the bounds, so that a small part far from the origin loses no digits.
        let Some((lo, hi)) = self.bounds() else { return 0.0 };
        let middle: [f64; 3] = std::array::from_fn(|i| (f64::from(lo[i]) + f64::from(hi[i])) / 2.0);
        let six: f64 = self
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| {
                    let p = self.positions[i as usize];
                    std::array::from_fn(|k| f64::from(p[k]) - middle[k])
                });
                dot(a, cross(b, c))
            })
            .sum();
        six / 6.0
    }

    /// Returns the mesh scaled along the axes of its frame, about the origin, as by `scale` of a URDF mesh.
    ///
    /// A negative product of the factors mirrors the mesh. The winding is then reversed, so that the front stays
    /// outside.
    pub fn scaled(&self, scale: [f64; 3]) -> Self {
        let [x, y, z] = scale;
        self.affine(&[[x, 0., 0., 0.], [0., y, 0., 0.], [0., 0., z, 0.]])
    }

    /// Returns the mesh transformed by a pose, in the frame that `pose` maps to.
    pub fn transformed(&self, pose: &Pose) -> Self {
        let m = pose.to_homogeneous();
        self.affine(&[0, 1, 2].map(|i| [m[(i, 0)], m[(i, 1)], m[(i, 2)], m[(i, 3)]]))
    }

    fn affine(&self, matrix: &[[f64; 4]; 3]) -> Self {
        let place = PreparedAffine::new(matrix);
        let mut out = self.clone();
        for p in &mut out.positions {
            *p = place.point(p.map(f64::from)).map(|x| x as f32);
        }
        for n in out.normals.iter_mut().flatten() {
            // A scale of zero has no inverse, so the old normal is kept.
            *n = place.normal(n.map(f64::from)).or_else(|| unit(*n)).unwrap_or(*n);
        }
        if place.mirrored {
            for t in &mut out.triangles {
                t.swap(1, 2);
            }
        }
        out
    }

    /// Checks that the lengths of the arrays agree, that every vertex and material index is in range, that all numbers
    /// are finite, and that the submeshes cover all triangles consecutively. Normals need not have unit length. Meshes
    /// from [`super::load`] pass this check.
    ///
    /// # Errors
    /// The first violation.
    pub fn validate(&self) -> Result<(), InvalidMesh> {
        let positions = self.positions.len();
        let lengths = [
            ("normals", self.normals.as_ref().map(Vec::len)),
            ("texture coordinates", self.uvs.as_ref().map(Vec::len)),
        ];
        for (what, count) in lengths {
            if let Some(count) = count.filter(|&c| c != positions) {
                return Err(InvalidMesh::Length { what, count, positions });
            }
        }
        let bad = |v: &[f32]| v.iter().any(|x| !x.is_finite());
        if let Some(index) = self.positions.iter().position(|p| bad(p)) {
            return Err(InvalidMesh::NonFinite { what: "position", index });
        }
        if let Some(index) = self.normals.iter().flatten().position(|n| bad(n)) {
            return Err(InvalidMesh::NonFinite { what: "normal", index });
        }
        if let Some(index) = self.uvs.iter().flatten().position(|uv| bad(uv)) {
            return Err(InvalidMesh::NonFinite { what: "texture coordinate", index });
        }
        for (triangle, t) in self.triangles.iter().enumerate() {
            if let Some(&index) = t.iter().find(|&&i| i as usize >= positions) {
                return Err(InvalidMesh::Index { triangle, index, positions });
            }
        }
        let (mut expected_start, triangles) = (0, self.triangles.len());
        let fault = |part, range: &std::ops::Range<usize>, expected_start| InvalidMesh::Submeshes {
            part,
            found_start: range.start,
            found_end: range.end,
            expected_start,
            triangles,
        };
        for (part, Submesh { triangles: range, material }) in self.submeshes.iter().enumerate() {
            if range.start != expected_start || range.end < range.start || range.end > triangles {
                return Err(fault(part, range, expected_start));
            }
            expected_start = range.end;
            if let Some(material) = material.filter(|&m| m >= self.materials.len()) {
                return Err(InvalidMesh::Material { part, material, materials: self.materials.len() });
            }
        }
        if expected_start != triangles {
            return Err(fault(self.submeshes.len(), &(expected_start..expected_start), expected_start));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::from_xyz_rpy;

    /// A corner tetrahedron of volume 1/6 with a normal per vertex.
    fn corner() -> TriMesh {
        let positions = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        let mut mesh = TriMesh::from_triangles(positions, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]);
        let s = 3f32.sqrt().recip();
        mesh.normals = Some(vec![[-s, -s, -s], [1., 0., 0.], [0., 1., 0.], [s, s, s]]);
        mesh
    }

    #[test]
    fn mirrors() {
        let mesh = corner();
        assert_eq!(mesh.validate(), Ok(()));
        assert!((mesh.signed_volume() - 1.0 / 6.0).abs() < 1e-12);
        let mirrored = mesh.scaled([-2.0, 1.0, 3.0]);
        assert!((mirrored.signed_volume() - 1.0).abs() < 1e-9);
        assert_eq!(mirrored.bounds(), Some(([-2., 0., 0.], [0., 1., 3.])));
        // The normal of the plane x/-2 + y + z/3 = 1 is (-1/2, 1, 1/3), normalized.
        let n = mirrored.normals.unwrap()[3];
        let length = (0.25f32 + 1.0 + 1.0 / 9.0).sqrt();
        for (found, expected) in n.iter().zip([-0.5 / length, 1.0 / length, 1.0 / 3.0 / length]) {
            assert!((found - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn poses() {
        let pose = from_xyz_rpy([100.0, 0.0, 0.0], [0.0, 0.0, std::f64::consts::FRAC_PI_2]);
        let moved = corner().transformed(&pose);
        assert_eq!(moved.positions[1], [100.0, 1.0, 0.0]);
        let n = moved.normals.as_ref().unwrap()[1];
        assert!((n[1] - 1.0).abs() < 1e-6 && n[0].abs() < 1e-6);
        assert!((moved.signed_volume() - 1.0 / 6.0).abs() < 1e-5);
    }

    #[test]
    fn faults() {
        type Change = fn(&mut TriMesh);
        let rows: [(Change, &str); 5] = [
            (|m| m.triangles[2][1] = 9, "triangle 2 refers to vertex 9, but the mesh has 4 vertices"),
            (|m| m.positions[3][0] = f32::NAN, "position 3 is not finite"),
            (|m| m.uvs = Some(vec![]), "0 texture coordinates for 4 positions; expected the same number"),
            (|m| m.submeshes[0].material = Some(0), "submesh 0 uses material 0, but the mesh has 0 materials"),
            (|m| m.submeshes.clear(), "submesh 0 covers triangles 0..0"),
        ];
        for (change, fault) in rows {
            let mut mesh = corner();
            change(&mut mesh);
            assert!(mesh.validate().unwrap_err().to_string().starts_with(fault), "{fault}");
        }
    }
}
