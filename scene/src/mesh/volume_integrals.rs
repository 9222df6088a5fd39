//! Volume, center and second moments of closed meshes, exact for their triangles.
//!
//! Every triangle forms a tetrahedron with a common point; the signed tetrahedra add up to the solid. For a tetrahedron
//! with corners 0, a, b, c and `d = a · (b × c)` the volume is `d/6`, the first moment `d/24 (a + b + c)`, and the
//! second moment `d/120 (a aᵀ + b bᵀ + c cᵀ + s sᵀ)` with `s = a + b + c`. Source: Tonon, "Explicit exact formulas for
//! the 3-D tetrahedron inertia tensor in terms of its vertex coordinates", Journal of Mathematics and Statistics 1(1),
//! 2004.

use super::TriMesh;
use nalgebra::{Matrix3, Vector3};
use std::collections::HashMap;

/// Volume, center and second moment of the inside of a closed surface, in the axes of the mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VolumeIntegrals {
    /// Volume \[m³\], positive.
    pub volume: f64,
    /// Center of volume in the frame of the mesh \[m\].
    pub center: Vector3<f64>,
    /// Integral of `r rᵀ` over the volume \[m⁵\], with `r` from the center.
    pub second_moment: Matrix3<f64>,
}

impl TriMesh {
    /// True if the surface has no boundary: every edge is traversed equally often in both directions.
    ///
    /// Vertices at the same position count as one. Edges between two corners at the same position are ignored. A mesh
    /// without edges is not closed.
    pub fn is_closed(&self) -> bool {
        // -0 and 0 are the same position.
        let place = |vertex: u32| self.positions[vertex as usize].map(|x| (x + 0.0).to_bits());
        let mut edges: HashMap<[[u32; 3]; 2], i64> = HashMap::new();
        for triangle in &self.triangles {
            let corners = triangle.map(place);
            for k in 0..3 {
                let (from, to) = (corners[k], corners[(k + 1) % 3]);
                if from < to {
                    *edges.entry([from, to]).or_default() += 1;
                } else if to < from {
                    *edges.entry([to, from]).or_default() -= 1;
                }
            }
        }
        !edges.is_empty() && edges.values().all(|&count| count == 0)
    }

    /// Returns the volume that the surface encloses, with its center and second moment.
    ///
    /// Returns `None` if the surface is not [closed](Self::is_closed), encloses no volume, or gives values that no body
    /// has: a center outside of the bounds, more volume than the bounds, or a negative second moment. A surface that is
    /// inside out gives the same result as one with its front outside. Where parts overlap, the volume counts twice.
    ///
    /// The orientation of each part counts: a part that is inside out, within another part, is a cavity. Beside the
    /// other parts, it subtracts its volume. This is detected if the part is large or far away, but not if it is small.
    pub fn volume_integrals(&self) -> Option<VolumeIntegrals> {
        if !self.is_closed() {
            return None;
        }
        // Relative to the middle of the bounds, so that a small part far from the origin loses no digits.
        let (low, high) = self.bounds()?;
        let middle = Vector3::from_fn(|i, _| (f64::from(low[i]) + f64::from(high[i])) / 2.0);
        let (mut volume, mut first, mut second) = (0.0, Vector3::zeros(), Matrix3::zeros());
        for triangle in &self.triangles {
            let [a, b, c] = triangle.map(|i| Vector3::from(self.positions[i as usize].map(f64::from)) - middle);
            let d = a.dot(&b.cross(&c));
            let sum = a + b + c;
            volume += d / 6.0;
            first += sum * (d / 24.0);
            let squares = a * a.transpose() + b * b.transpose() + c * c.transpose() + sum * sum.transpose();
            second += squares * (d / 120.0);
        }
        let side = volume.signum();
        let (volume, first, second) = (volume * side, first * side, second * side);
        let extent = (Vector3::from(high.map(f64::from)) - Vector3::from(low.map(f64::from))).norm();
        // Smaller than the rounding error of a body of this size in single precision.
        if volume.is_nan() || volume <= 1e-9 * extent.powi(3) {
            return None;
        }
        let center = first / volume;
        let second_moment = second - center * center.transpose() * volume;
        let size = Vector3::from_fn(|i, _| f64::from(high[i]) - f64::from(low[i]));
        // Tolerances for the rounding of sums over all triangles, and for the small moment of a thin body.
        let inside = (0..3).all(|i| center[i].abs() <= size[i] / 2.0 + 1e-6 * extent);
        let fits = volume <= size.product() * (1.0 + 1e-6);
        let possible = second_moment.symmetric_eigenvalues().min() >= -1e-9 * second_moment.norm();
        (inside && fits && possible).then_some(VolumeIntegrals { volume, center: middle + center, second_moment })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::from_xyz_rpy;

    fn corner() -> TriMesh {
        let positions = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        TriMesh::from_triangles(positions, vec![[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    }

    /// A brick as in an STL file: no two triangles share a vertex.
    fn brick([x, y, z]: [f32; 3]) -> TriMesh {
        let corners: [[f32; 3]; 8] =
            std::array::from_fn(|k| [x * (k & 1) as f32, y * (k >> 1 & 1) as f32, z * (k >> 2) as f32]);
        let sides = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let faces = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
        let positions: Vec<[f32; 3]> = faces.flatten().map(|k: usize| corners[k]).collect();
        let triangles = (0..12).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect();
        TriMesh::from_triangles(positions, triangles)
    }

    /// A tetrahedron with unit legs: ∫x² = 1/60, ∫xy = 1/120 about the corner, its center at 1/4 (textbook integrals).
    #[test]
    fn simplex() {
        let solid = corner().volume_integrals().unwrap();
        assert!((solid.volume - 1.0 / 6.0).abs() < 1e-15);
        assert!((solid.center - Vector3::repeat(0.25)).norm() < 1e-15);
        let (diagonal, mixed) = (1.0 / 60.0 - 1.0 / 96.0, 1.0 / 120.0 - 1.0 / 96.0);
        let expected = Matrix3::from_fn(|i, j| if i == j { diagonal } else { mixed });
        assert!((solid.second_moment - expected).norm() < 1e-15, "{}", solid.second_moment);
        // Control: the second moment about the corner differs.
        assert!((solid.second_moment - expected.add_scalar(1.0 / 96.0)).norm() > 1e-3);
    }

    /// The second moment of a brick is V a²/12 along each axis, in any pose and either orientation of its triangles.
    #[test]
    fn bricks() {
        let size = [0.25_f32, 0.5, 1.5];
        let volume: f64 = size.iter().map(|x| f64::from(*x)).product();
        let own = Matrix3::from_diagonal(&Vector3::from(size.map(|x| volume * f64::from(x).powi(2) / 12.0)));
        let middle = Vector3::from(size.map(|x| f64::from(x) / 2.0));
        let solid = brick(size).volume_integrals().unwrap();
        assert!((solid.volume - volume).abs() < 1e-15 && (solid.center - middle).norm() < 1e-15);
        assert!((solid.second_moment - own).norm() < 1e-15);
        // Positions in single precision: 2^-24 of 10 m, on sides of 0.25 m.
        let pose = from_xyz_rpy([7.0, -9.0, 3.0], [0.3, -0.4, 0.5]);
        let turned = pose.rotation.to_rotation_matrix();
        let moved = brick(size)
            .transformed(&pose)
            .volume_integrals()
            .unwrap_or_else(|| panic!("shared corners must have equal bits"));
        assert!((moved.volume / volume - 1.0).abs() < 1e-5, "{}", moved.volume);
        assert!((moved.center - (pose * nalgebra::Point3::from(middle)).coords).norm() < 1e-5);
        let expected = turned.matrix() * own * turned.matrix().transpose();
        assert!((moved.second_moment - expected).norm() < 1e-5 * expected.norm());
        let inside_out = turned_inside_out(brick(size));
        assert!((inside_out.signed_volume() + volume).abs() < 1e-12);
        assert!((inside_out.volume_integrals().unwrap().volume - volume).abs() < 1e-15);
    }

    fn both(mut a: TriMesh, b: &TriMesh) -> TriMesh {
        let first = a.positions.len() as u32;
        a.positions.extend(&b.positions);
        a.triangles.extend(b.triangles.iter().map(|t| t.map(|k| k + first)));
        TriMesh::from_triangles(a.positions, a.triangles)
    }

    fn turned_inside_out(mut mesh: TriMesh) -> TriMesh {
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        mesh
    }

    /// Two closed shells, one of them inside out: no body has the difference of their volumes and moments.
    #[test]
    fn parts() {
        let at = |mesh: TriMesh, x| mesh.transformed(&from_xyz_rpy([x, 0.0, 0.0], [0.0; 3]));
        let (large, small) = (brick([1.0, 1.0, 1.0]), brick([0.5, 0.5, 0.5]));
        for part in [at(large.clone(), 1.5), at(small.clone(), 1.5)] {
            let good = both(large.clone(), &part);
            assert!(
                (good.volume_integrals().unwrap().volume - 1.0 - part.volume_integrals().unwrap().volume).abs() < 1e-6
            );
            let bad = both(large.clone(), &turned_inside_out(part));
            assert!(bad.is_closed() && bad.volume_integrals().is_none());
        }
        // Within the other shell, it is a cavity.
        let hollow = both(large.clone(), &turned_inside_out(at(small, 0.25)));
        assert!((hollow.volume_integrals().unwrap().volume - 0.875).abs() < 1e-6);
        // The same brick twice has more volume than its bounds.
        assert!(both(large.clone(), &large).volume_integrals().is_none());
    }

    #[test]
    fn not_solid() {
        let mut open = brick([1.0, 1.0, 1.0]);
        assert!(open.is_closed());
        open.triangles.pop();
        assert!(!open.is_closed() && open.volume_integrals().is_none());
        // A brick with one flipped triangle is not closed, either.
        let mut turned = brick([1.0, 1.0, 1.0]);
        turned.triangles[3].swap(0, 1);
        assert!(turned.volume_integrals().is_none());
        // Both sides of a sheet are closed, but enclose nothing.
        let positions = vec![[0., 0., 0.], [1., 0., 0.], [0., 1., 0.]];
        let sheet = TriMesh::from_triangles(positions, vec![[0, 1, 2], [0, 2, 1]]);
        assert!(sheet.is_closed() && sheet.volume_integrals().is_none());
        assert!(TriMesh::default().volume_integrals().is_none());
    }
}
