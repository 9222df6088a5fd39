//! Convex cells, into which planes cut the space around a solid.
//!
//! The intersection of a solid and a cell has three kinds of corners: surface vertices inside the cell, intersections
//! of the surface with faces and edges of the cell, and cell corners inside the solid. Cutting the triangles of the
//! surface gives the first two kinds. This module gives the third, so that the hull of a piece includes the inside of
//! the solid.

use crate::vector::{cross, dot, sub};

type V3 = [f64; 3];

/// A convex cell: the space behind all its planes. A plane is a unit normal and its distance from the origin.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    planes: Vec<(V3, f64)>,
    corners: Vec<Corner>,
    /// Points that are closer than this count as equal \[m\].
    tolerance: f64,
}

#[derive(Clone, Copy, Debug)]
struct Corner {
    at: V3,
    /// True if the corner is in the solid.
    inside: bool,
}

impl Cell {
    /// A box around a solid with a margin, so that its corners are outside.
    pub(super) fn bounding(lo: V3, hi: V3) -> Self {
        let size = (0..3).map(|k| hi[k] - lo[k]).fold(0.0, f64::max);
        let (lo, hi) = (lo.map(|x| x - 0.01 * size), hi.map(|x| x + 0.01 * size));
        let axis = |k: usize, sign: f64| [0, 1, 2].map(|i| if i == k { sign } else { 0.0 });
        let planes = (0..3).flat_map(|k| [(axis(k, 1.0), hi[k]), (axis(k, -1.0), -lo[k])]).collect();
        let corner = |c: usize| [0, 1, 2].map(|k| if c >> k & 1 == 1 { hi[k] } else { lo[k] });
        let corners = (0..8).map(|c| Corner { at: corner(c), inside: false }).collect();
        Self { planes, corners, tolerance: 1e-9 * size }
    }

    /// Corners that are in the solid.
    pub(super) fn corners_inside(&self) -> impl Iterator<Item = V3> + '_ {
        self.corners.iter().filter(|corner| corner.inside).map(|corner| corner.at)
    }

    /// Splits the cell by a plane into the parts in front of it and behind it. `solid` is true for points in the solid.
    pub(super) fn split(&self, normal: V3, distance: f64, solid: &impl Fn(V3) -> bool) -> [Self; 2] {
        let mut new: Vec<Corner> = Vec::new();
        for (k, &first) in self.planes.iter().enumerate() {
            for &second in &self.planes[..k] {
                let Some(at) = intersect_planes([first, second, (normal, distance)]) else { continue };
                let known = new.iter().any(|corner| (0..3).all(|i| (corner.at[i] - at[i]).abs() <= self.tolerance));
                if !known && self.planes.iter().all(|&(n, d)| dot(n, at) - d <= self.tolerance) {
                    new.push(Corner { at, inside: solid(at) });
                }
            }
        }
        [-1.0, 1.0].map(|sign| {
            let behind = |corner: &&Corner| (dot(normal, corner.at) - distance) * sign < -self.tolerance;
            let corners: Vec<Corner> = self.corners.iter().filter(behind).chain(&new).copied().collect();
            // A plane that only touches the cell does not bound it.
            let bounds = |&&(n, d): &&(V3, f64)| {
                corners.iter().filter(|corner| (dot(n, corner.at) - d).abs() <= 2.0 * self.tolerance).count() >= 3
            };
            let mut planes: Vec<(V3, f64)> = self.planes.iter().filter(bounds).copied().collect();
            planes.push((normal.map(|x| x * sign), distance * sign));
            Self { planes, corners, tolerance: self.tolerance }
        })
    }
}

/// Intersection of three planes (Cramer's rule); `None` if their normals are linearly dependent.
fn intersect_planes([(a, d), (b, e), (c, f)]: [(V3, f64); 3]) -> Option<V3> {
    let (bc, ca, ab) = (cross(b, c), cross(c, a), cross(a, b));
    let volume = dot(a, bc);
    (volume.abs() > 1e-9).then(|| [0, 1, 2].map(|k| (d * bc[k] + e * ca[k] + f * ab[k]) / volume))
}

/// Winding number of closed triangles around a point: 1 inside, 0 outside. It is the sum of their solid angles over 4π.
/// Source: van Oosterom and Strackee, "The solid angle of a plane triangle", IEEE Transactions on Biomedical
/// Engineering 30(2), 1983.
pub(super) fn winding_number(triangles: &[[V3; 3]], p: V3) -> f64 {
    let half: f64 = triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|corner| sub(corner, p));
            let [x, y, z] = [a, b, c].map(|v| dot(v, v).sqrt());
            dot(a, cross(b, c)).atan2(x * y * z + dot(a, b) * z + dot(b, c) * x + dot(c, a) * y)
        })
        .sum();
    half / std::f64::consts::TAU
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Cuts of a box give cells with the expected corners and planes.
    #[test]
    fn halves() {
        let all = |_| true;
        let cube = Cell::bounding([0.0; 3], [1.0; 3]);
        let s = 0.5f64.sqrt();
        let [front, back] = cube.split([s, s, 0.0], s, &all);
        // A cut through two opposite edges of 1.02 m: a prism on each side, whose four corners on the plane are inside.
        for half in [&front, &back] {
            assert_eq!((half.corners.len(), half.planes.len(), half.corners_inside().count()), (6, 5, 4));
        }
        let [right, left] = back.split([1.0, 0.0, 0.0], 0.25, &all);
        assert_eq!((left.corners.len(), left.planes.len()), (8, 6));
        assert_eq!((right.corners.len(), right.planes.len()), (6, 5));
        let highest = left.corners_inside().map(|p| p[1]).fold(f64::MIN, f64::max);
        assert!((highest - 1.01).abs() < 1e-12, "the edge of the first plane: {highest}");
    }

    #[test]
    fn winding_numbers() {
        let p = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let faces = [[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]].map(|t: [usize; 3]| t.map(|i| p[i]));
        assert!((winding_number(&faces, [0.1, 0.2, 0.3]) - 1.0).abs() < 1e-12);
        assert!(winding_number(&faces, [0.4, 0.4, 0.4]).abs() < 1e-12);
        assert!((winding_number(&faces.map(|[a, b, c]| [a, c, b]), [0.1, 0.2, 0.3]) + 1.0).abs() < 1e-12, "inside out");
    }
}
