//! Decomposition of a non-convex mesh into convex pieces.
//!
//! Planes cut the mesh where the hull of a piece is farthest from its surface, until this distance is within a
//! tolerance everywhere. Triangles are cut exactly. The hull of a piece is the hull of its remaining triangles and of
//! the corners of its [cell](super::cell) that are in the solid. It therefore contains the whole intersection of the
//! solid and the cell.

use super::cell::{Cell, winding_number};
use super::{HullCfg, HullError, TriMesh, convex_hull};
use crate::vector::{cross, dot, norm, sub, try_normalize};
use serde::{Deserialize, Serialize};

/// Version of the algorithm. It changes whenever the same input may give other pieces; part of the key of
/// [`super::HullCache`].
pub(super) const ALGORITHM_VERSION: u32 = 2;

/// Largest number of triangles of a mesh: the time for a cut grows with it.
const MAX_TRIANGLES: usize = 50_000;

/// Largest number of vertices of the hull of a piece.
const MAX_VERTICES: usize = 4096;

/// Configuration of the decomposition into convex pieces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ConvexDecompositionCfg {
    /// Largest number of pieces, 1 to 1024.
    pub max_pieces: usize,
    /// Largest distance between the hull of a piece and its surface, above and below the surface \[m\]; above 0.
    /// Exceeded if `max_pieces` does not suffice.
    pub tolerance: f64,
}

impl Default for ConvexDecompositionCfg {
    /// 64 pieces, 1 mm.
    fn default() -> Self {
        Self { max_pieces: 64, tolerance: 1e-3 }
    }
}

/// Result of a decomposition into convex pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct ConvexDecomposition {
    /// Closed convex hulls with outward-facing triangles. Equal inputs give the same order.
    pub hulls: Vec<TriMesh>,
    /// Largest distance between the hull of a piece and its surface \[m\].
    ///
    /// The distance of the hull above the surface is measured at the corners of triangles, the middles of their edges
    /// and their centers. Corners outside of their hull, which has a limited number of vertices, count too. The depth
    /// exceeds the tolerance if the number of pieces does not suffice.
    pub depth: f64,
}

type V3 = [f64; 3];
pub(super) type Triangle = [V3; 3];

/// A part of the surface, its cell and its hull.
struct Piece {
    surface: Vec<Triangle>,
    cell: Cell,
    /// Number of consecutive cuts without an improvement.
    stalled_cuts: u32,
    hull: TriMesh,
    /// Largest distance between the hull and the surface \[m\].
    depth: f64,
    /// Position of the largest distance \[m\].
    at: V3,
    /// Unit normal of the surface or of the hull at that position.
    normal: V3,
}

impl ConvexDecompositionCfg {
    fn check(&self) -> Result<(), HullError> {
        let fault = |field, value, expected| Err(HullError::InvalidDecomposition { field, value, expected });
        if !(1..=1024).contains(&self.max_pieces) {
            return fault("max_pieces", self.max_pieces as f64, "1 to 1024");
        }
        if !(self.tolerance > 0.0 && self.tolerance.is_finite()) {
            return fault("tolerance", self.tolerance, "a length above 0");
        }
        Ok(())
    }
}

/// Decomposes a mesh into convex pieces. A mesh that is convex within the tolerance gives one piece: its hull.
///
/// Together, the pieces contain the whole solid except for what their hulls omit: points that stick out by less than
/// [`HullCfg::tolerance`], or by half of the tolerance of the pieces if that is less, and what
/// [`HullCfg::max_vertices`] cuts off, which [`ConvexDecomposition::depth`] includes. The solid is the inside of a
/// [closed](TriMesh::is_closed) mesh, in either orientation of its triangles. The surface of an enclosed cavity is
/// treated like any other, so cavities stay empty.
///
/// The pieces of an open mesh contain its surface and the space that their hulls span behind it. Triangles are
/// counter-clockwise seen from outside. Flat pieces get [`HullCfg::min_thickness`], behind their front.
///
/// # Errors
/// The configuration is out of range, the mesh violates an invariant of [`TriMesh`], it has more than 50000 triangles
/// or no triangle with an area, or [`convex_hull`] fails for the mesh as a whole.
pub fn convex_decomposition(
    mesh: &TriMesh,
    hull: &HullCfg,
    cfg: &ConvexDecompositionCfg,
) -> Result<ConvexDecomposition, HullError> {
    cfg.check()?;
    if hull.max_vertices > MAX_VERTICES {
        let (field, value) = ("max_vertices", hull.max_vertices as f64);
        return Err(HullError::InvalidCfg { field, value, expected: "4 to 4096 for convex decomposition" });
    }
    if mesh.triangles.len() > MAX_TRIANGLES {
        return Err(HullError::TooManyTriangles { found: mesh.triangles.len(), most: MAX_TRIANGLES });
    }
    let surface: Vec<Triangle> = triangles_of(mesh)?.into_iter().filter(|t| unit_normal(t).is_some()).collect();
    if surface.is_empty() {
        return Err(HullError::NoArea { triangles: mesh.triangles.len() });
    }
    let (lo, hi) = mesh.bounds().unwrap_or_default();
    let cell = Cell::bounding(lo.map(f64::from), hi.map(f64::from));
    let diagonal = (0..3).map(|k| f64::from(hi[k] - lo[k]).powi(2)).sum::<f64>().sqrt();
    let tolerance = hull.tolerance.min(0.5 * cfg.tolerance / diagonal);
    let body = SourceSurface { all: mesh.is_closed().then(|| surface.clone()), hull: HullCfg { tolerance, ..*hull } };
    let mut pieces = vec![Piece::of(body.hull_of(surface, cell)?, 0)];
    // Pieces that no plane improves.
    let mut done: Vec<Piece> = Vec::new();
    while pieces.len() + done.len() < cfg.max_pieces {
        let deepest = (0..pieces.len()).filter(|&k| pieces[k].depth > cfg.tolerance);
        let Some(k) = deepest.max_by(|&a, &b| pieces[a].depth.total_cmp(&pieces[b].depth).then(b.cmp(&a))) else {
            break;
        };
        let piece = pieces.remove(k);
        match piece.cut(&body) {
            Some(halves) => pieces.extend(halves),
            None => done.push(piece),
        }
    }
    done.append(&mut pieces);
    let depth = done.iter().map(|piece| piece.depth).fold(0.0, f64::max);
    Ok(ConvexDecomposition { hulls: done.into_iter().map(|piece| piece.hull).collect(), depth })
}

/// Triangles of a mesh; for a closed mesh, counter-clockwise seen from outside. An invalid mesh is an error.
pub(super) fn triangles_of(mesh: &TriMesh) -> Result<Vec<Triangle>, HullError> {
    mesh.validate().map_err(|source| HullError::Mesh { source })?;
    let inside_out = mesh.signed_volume() < 0.0 && mesh.is_closed();
    let corners = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize].map(f64::from));
        if inside_out { [a, c, b] } else { [a, b, c] }
    };
    Ok(mesh.triangles.iter().map(corners).collect())
}

/// The mesh to decompose.
struct SourceSurface {
    /// Whole surface, if it is closed.
    all: Option<Vec<Triangle>>,
    hull: HullCfg,
}

impl SourceSurface {
    /// True if a point is in the solid; false for an open surface.
    fn contains(&self, p: V3) -> bool {
        self.all.as_ref().is_some_and(|all| winding_number(all, p) > 0.5)
    }

    /// Hull of a surface and of the corners of its cell that are in the solid.
    ///
    /// A flat part of an open surface gets its thickness behind its front. A flat part of a solid is an error.
    fn hull_of(&self, surface: Vec<Triangle>, cell: Cell) -> Result<HulledSurface, HullError> {
        let points = distinct_points(surface.iter().flatten().copied().chain(cell.corners_inside()));
        let hull = match (convex_hull(&points, &HullCfg { min_thickness: None, ..self.hull }), self.hull.min_thickness)
        {
            (Err(HullError::Coplanar { .. } | HullError::TooFewPoints { .. }), Some(thickness))
                if self.all.is_none() =>
            {
                let behind = surface.iter().filter_map(|t| Some((t, unit_normal(t)?)));
                let behind = behind.flat_map(|(t, n)| t.map(|p| [0, 1, 2].map(|k| p[k] - thickness * n[k])));
                let points = distinct_points(surface.iter().flatten().copied().chain(behind));
                // A plate may be thinner than the tolerance of its size.
                convex_hull(&points, &HullCfg { min_thickness: None, tolerance: 0.0, ..self.hull })?
            }
            (hull, _) => hull?,
        };
        Ok(HulledSurface { surface, cell, hull })
    }
}

/// Rounds points to single precision, sorts them and removes duplicates; -0 becomes 0.
fn distinct_points(points: impl Iterator<Item = V3>) -> Vec<[f32; 3]> {
    let mut points: Vec<[f32; 3]> = points.map(|p| p.map(|x| x as f32 + 0.0)).collect();
    points.sort_by(|a, b| (0..3).fold(std::cmp::Ordering::Equal, |order, k| order.then(a[k].total_cmp(&b[k]))));
    points.dedup();
    points
}

impl Piece {
    fn of(HulledSurface { surface, cell, hull }: HulledSurface, stalled_cuts: u32) -> Self {
        let faces: Vec<(V3, f64)> = hull
            .triangles
            .iter()
            .filter_map(|t| {
                let corners = t.map(|i| hull.positions[i as usize].map(f64::from));
                unit_normal(&corners).map(|normal| (normal, dot(normal, corners[0])))
            })
            .collect();
        // Distance from a point to the end of the hull, along a normal.
        let above = |p: V3, normal: V3| {
            let faces = faces.iter().map(|&(n, d)| (dot(n, normal), d - dot(n, p)));
            faces.filter(|(slope, _)| *slope > 1e-6).map(|(slope, gap)| gap / slope).fold(f64::INFINITY, f64::min)
        };
        let mut piece = Self { depth: 0.0, at: [0.0; 3], normal: [0.0; 3], surface, hull, cell, stalled_cuts };
        for p in piece.surface.iter().flatten().copied().chain(piece.cell.corners_inside()) {
            for &(normal, distance) in &faces {
                let outside = dot(normal, p) - distance;
                if outside > piece.depth {
                    (piece.depth, piece.at, piece.normal) = (outside, p, normal);
                }
            }
        }
        for triangle in &piece.surface {
            let Some(normal) = unit_normal(triangle) else { continue };
            let [a, b, c] = *triangle;
            let mean =
                |points: &[V3]| [0, 1, 2].map(|k| points.iter().map(|p| p[k]).sum::<f64>() / points.len() as f64);
            for p in [a, b, c, mean(&[a, b]), mean(&[b, c]), mean(&[c, a]), mean(&[a, b, c])] {
                let depth = above(p, normal);
                if depth.is_finite() && depth > piece.depth {
                    (piece.depth, piece.at, piece.normal) = (depth, p, normal);
                }
            }
        }
        piece
    }

    /// Cuts the piece into the two halves with the smallest total hull volume.
    ///
    /// Candidate planes pass through the point where the hull is farthest from the surface, and through the middle of
    /// the piece. Among nearly equal candidates, halves of similar size are preferred: a bowl has to be cut twice
    /// before its hulls become smaller. Returns `None` if no plane gives two useful halves, or after several
    /// consecutive cuts that made the hulls neither smaller nor closer to the surface.
    fn cut(&self, body: &SourceSurface) -> Option<[Self; 2]> {
        /// Weight of the larger half in the cost, added to the sum of both halves.
        const LARGER_HALF_WEIGHT: f64 = 0.05;
        /// Smallest useful half, as a fraction of the whole volume.
        const MIN_VOLUME_RATIO: f64 = 1e-4;
        /// Largest number of consecutive cuts without an improvement.
        const MAX_STALLED_CUTS: u32 = 4;
        if self.stalled_cuts >= MAX_STALLED_CUTS {
            return None;
        }
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (lo, hi) = self.hull.bounds()?;
        let middle = [0, 1, 2].map(|k| (f64::from(lo[k]) + f64::from(hi[k])) / 2.0);
        let here = axes.iter().chain([&self.normal]).map(|&n| (n, dot(n, self.at)));
        let planes = here.chain(axes.iter().map(|&n| (n, dot(n, middle))));
        let mut best: Option<(f64, f64, [HulledSurface; 2])> = None;
        let size = (0..3).map(|k| f64::from(hi[k] - lo[k])).fold(0.0, f64::max);
        let whole = self.hull.signed_volume();
        let inside = |p: V3| body.contains(p);
        for (normal, distance) in planes {
            let [front, back] = split_surface(&self.surface, normal, distance, 1e-6 * size);
            let [ahead, behind] = self.cell.split(normal, distance, &inside);
            let (Ok(front), Ok(back)) = (body.hull_of(front, ahead), body.hull_of(back, behind)) else { continue };
            let volumes = [&front, &back].map(|half| half.hull.signed_volume());
            let both = volumes[0] + volumes[1];
            let cost = both + LARGER_HALF_WEIGHT * volumes[0].max(volumes[1]);
            let halved = volumes.iter().all(|volume| *volume >= MIN_VOLUME_RATIO * whole);
            if halved && best.as_ref().is_none_or(|(lowest, ..)| cost < *lowest) {
                best = Some((cost, both, [front, back]));
            }
        }
        let (_, both, halves) = best?;
        let mut halves = halves.map(|half| Self::of(half, 0));
        let deepest = halves.iter().map(|half| half.depth).fold(0.0, f64::max);
        if both > 0.999 * whole && deepest > 0.99 * self.depth {
            halves.iter_mut().for_each(|half| half.stalled_cuts = self.stalled_cuts + 1);
        }
        Some(halves)
    }
}

/// A part of the surface, its cell, and the hull of both.
struct HulledSurface {
    surface: Vec<Triangle>,
    cell: Cell,
    hull: TriMesh,
}

/// Parts of a surface in front of a plane and behind it. Corners closer to the plane than `near` \[m\] are on it.
fn split_surface(surface: &[Triangle], normal: V3, distance: f64, near: f64) -> [Vec<Triangle>; 2] {
    let mut halves = [Vec::new(), Vec::new()];
    for triangle in surface {
        let heights = triangle.map(|p| {
            let height = dot(normal, p) - distance;
            if height.abs() < near { 0.0 } else { height }
        });
        for (half, sign) in halves.iter_mut().zip([1.0, -1.0]) {
            // A triangle in the plane belongs to the half behind its front.
            let flat = heights.iter().all(|h| *h == 0.0);
            let faces = unit_normal(triangle).is_some_and(|n| dot(n, normal) * sign < 0.0);
            if flat && !faces {
                continue;
            }
            let polygon = clip_triangle(triangle, heights.map(|h| h * sign));
            for k in 2..polygon.len() {
                let part = [polygon[0], polygon[k - 1], polygon[k]];
                half.extend(unit_normal(&part).map(|_| part));
            }
        }
    }
    halves
}

/// Part of a triangle where heights are at least 0.
fn clip_triangle(triangle: &Triangle, heights: [f64; 3]) -> Vec<V3> {
    let mut polygon = Vec::with_capacity(4);
    for k in 0..3 {
        let next = (k + 1) % 3;
        let (a, b) = (heights[k], heights[next]);
        if a >= 0.0 {
            polygon.push(triangle[k]);
        }
        if a * b < 0.0 {
            let share = a / (a - b);
            polygon.push([0, 1, 2].map(|i| triangle[k][i] + share * (triangle[next][i] - triangle[k][i])));
        }
    }
    polygon
}

/// Unit normal of a triangle; `None` for a degenerate triangle.
pub(super) fn unit_normal(&[a, b, c]: &Triangle) -> Option<V3> {
    let (u, v) = (sub(b, a), sub(c, a));
    // Twice the area against the longest sides: below this ratio, single precision does not resolve the normal.
    try_normalize(cross(u, v), 1e-10 * (dot(u, u) + dot(v, v)))
}

/// Area of a triangle \[m²\].
pub(super) fn area(&[a, b, c]: &Triangle) -> f64 {
    norm(cross(sub(b, a), sub(c, a))) / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::prisms;
    use crate::shape::{HeightField, Shape, revolve};

    /// A prism over an outline in x and z, counter-clockwise, which `cut` divides into triangles.
    fn along_y(outline: &[[f32; 2]], cut: &[[u32; 3]], length: f32) -> TriMesh {
        let n = outline.len() as u32;
        let end = |y: f32| outline.iter().map(move |&[x, z]| [x, y, z]);
        let back = cut.iter().map(|&[a, b, c]| [a + n, c + n, b + n]);
        let rim = (0..n).flat_map(|k| {
            let next = (k + 1) % n;
            [[k, k + n, next + n], [k, next + n, next]]
        });
        let positions = end(0.0).chain(end(length)).collect();
        TriMesh::from_triangles(positions, cut.iter().copied().chain(back).chain(rim).collect())
    }

    fn ell() -> TriMesh {
        let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.25], [0.25, 0.25], [0.25, 1.0], [0.0, 1.0]];
        along_y(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 0.5)
    }

    /// True if a point is at most `near` \[m\] in front of every face plane of a convex mesh.
    fn within(hull: &TriMesh, p: V3, near: f64) -> bool {
        hull.triangles.iter().all(|t| {
            let corners = t.map(|i| hull.positions[i as usize].map(f64::from));
            unit_normal(&corners).is_none_or(|n| dot(n, sub(p, corners[0])) <= near)
        })
    }

    /// An L gives two boxes in any orientation; its hull as a whole is much larger.
    #[test]
    fn two_boxes() {
        let volume = 0.5 * (0.25 + 0.75 * 0.25);
        let whole = convex_hull(&ell().positions, &HullCfg::default()).unwrap();
        assert!(whole.signed_volume() > 1.4 * volume, "the control: {}", whole.signed_volume());
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.5, -0.9).cast::<f32>();
        let turned = |mesh: &TriMesh| {
            let turn = |p: &[f32; 3]| (turn * nalgebra::Vector3::from(*p)).into();
            TriMesh::from_triangles(mesh.positions.iter().map(turn).collect(), mesh.triangles.clone())
        };
        for mesh in [ell(), turned(&ell())] {
            let pieces = convex_decomposition(&mesh, &HullCfg::default(), &ConvexDecompositionCfg::default()).unwrap();
            let volumes: Vec<f64> = pieces.hulls.iter().map(TriMesh::signed_volume).collect();
            assert_eq!(volumes.len(), 2, "{volumes:?}");
            // Corners are in single precision.
            assert!((volumes.iter().sum::<f64>() - volume).abs() < 1e-6 && pieces.depth < 1e-6, "{volumes:?}");
        }
    }

    /// A tube along z with an outer radius of 1 and an inner one of 0.8, of 32 sides.
    fn tube() -> TriMesh {
        revolve(&[[0.8, 0.0], [1.0, 0.0], [1.0, 1.0], [0.8, 1.0], [0.8, 0.0]], 32)
    }

    /// Every point of the surface is in a piece, and many pieces leave the cavity free.
    #[test]
    fn surface_and_hollow() {
        // With this limit of vertices, no hull is simplified.
        let (mesh, all) = (tube(), HullCfg { max_vertices: 1000, ..HullCfg::default() });
        assert!(mesh.is_closed() && mesh.signed_volume() > 0.0);
        let mut before = f64::INFINITY;
        for (max_pieces, tolerance) in [(4, 1e-6), (16, 1e-6), (64, 0.05)] {
            let pieces = convex_decomposition(&mesh, &all, &ConvexDecompositionCfg { max_pieces, tolerance }).unwrap();
            let count = pieces.hulls.len();
            assert!(count <= max_pieces && pieces.depth < before, "{count} {}", pieces.depth);
            assert!(pieces.depth <= tolerance || count == max_pieces);
            before = if max_pieces == 16 { f64::INFINITY } else { pieces.depth };
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].map(f64::from));
                let middle = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
                // Hulls omit points that stick out by less than 1e-4 of their size.
                assert!(pieces.hulls.iter().any(|hull| within(hull, middle, 4e-4)), "{middle:?}");
            }
            if max_pieces < 64 {
                continue;
            }
            // A ring in the cavity that is farther above the inner surface than the depth is free. The depth is
            // measured at some points of each triangle; hulls bulge by a little more between them.
            let free = 0.8 * (std::f64::consts::PI / 32.0).cos() - 1.5 * pieces.depth - 1e-3;
            for k in 0..200 {
                let (sin, cos) = (0.1 + 0.0314 * f64::from(k)).sin_cos();
                let p = [free * cos, free * sin, 0.5];
                assert!(!pieces.hulls.iter().any(|hull| within(hull, p, 0.0)), "{max_pieces} pieces: {p:?}");
            }
        }
        // Control: the hull fills the cavity.
        let whole = convex_hull(&mesh.positions, &all).unwrap();
        assert!(within(&whole, [0.0, 0.0, 0.5], 0.0));
        // A convex mesh stays whole.
        let one = convex_decomposition(&whole, &all, &ConvexDecompositionCfg::default()).unwrap();
        assert_eq!((one.hulls.len(), one.depth < 1e-3), (1, true), "{}", one.depth);
    }

    /// A block of 1 x 1 x 0.2 m whose top is an egg carton of 5 mm.
    fn carton() -> TriMesh {
        let wave = |k: usize| (std::f32::consts::TAU * 2.0 * k as f32 / 16.0).cos();
        let elevation: Vec<f32> = (0..17 * 17).map(|k| 0.5 + 0.5 * wave(k % 17) * wave(k / 17)).collect();
        let field = HeightField::new([0.5, 0.5, 0.01, 0.195], 17, 17, &elevation).unwrap();
        Shape::from(field).tessellate(0)
    }

    fn inside_out(mut mesh: TriMesh) -> TriMesh {
        mesh.triangles.iter_mut().for_each(|t| t.swap(0, 1));
        mesh
    }

    /// A solid stays solid: points all over its inside are in a piece, however often it was cut.
    #[test]
    fn inside() {
        let mesh = carton();
        assert!(mesh.is_closed() && (mesh.signed_volume() - 0.2).abs() < 1e-3, "{}", mesh.signed_volume());
        // Hulls omit points that stick out by less than half the tolerance, or by 1e-4 of their size if that is less.
        let near = 2e-4;
        let covered = |hulls: &[TriMesh]| {
            let points = (0..19 * 19 * 11).map(|k| (k % 19, k / 19 % 19, k / 361));
            let share = |i: i32, n: i32| (f64::from(i) + 0.5) / f64::from(n);
            let at = |(i, j, k)| [share(i, 19) - 0.5, share(j, 19) - 0.5, 0.19 * share(k, 11) - 0.195];
            let all: Vec<V3> = points.map(at).collect();
            let inside = all.iter().filter(|p| hulls.iter().any(|hull| within(hull, **p, near))).count();
            (inside, all.len())
        };
        for max_pieces in [24, 64] {
            let cfg = ConvexDecompositionCfg { max_pieces, tolerance: 1e-3 };
            for mesh in [mesh.clone(), inside_out(mesh.clone())] {
                let pieces = convex_decomposition(&mesh, &HullCfg::default(), &cfg).unwrap();
                assert!(pieces.hulls.len() >= 8, "{}", pieces.hulls.len());
                let (inside, all) = covered(&pieces.hulls);
                assert_eq!(inside, all, "{} pieces", pieces.hulls.len());
                // The pieces exceed the volume of the solid by at most their depth or the tolerance on its top.
                let volume: f64 = pieces.hulls.iter().map(TriMesh::signed_volume).sum();
                assert!(volume < 0.2 + pieces.depth.max(1e-3), "{volume} {}", pieces.depth);
            }
        }
        // Control: without one of the pieces there is a hole.
        let pieces = convex_decomposition(&mesh, &HullCfg::default(), &ConvexDecompositionCfg::default()).unwrap();
        let (inside, all) = covered(&pieces.hulls[1..]);
        assert!(inside < all);
    }

    /// A cube is one piece in either orientation of its triangles, and prisms are within it.
    #[test]
    fn inside_out_cube() {
        let corners: [[f32; 3]; 8] = std::array::from_fn(|k| [k & 1, k >> 1 & 1, k >> 2].map(|x| x as f32));
        let cube = convex_hull(&corners, &HullCfg::default()).unwrap();
        for mesh in [cube.clone(), inside_out(cube)] {
            let pieces = convex_decomposition(&mesh, &HullCfg::default(), &ConvexDecompositionCfg::default()).unwrap();
            assert_eq!((pieces.hulls.len(), pieces.depth < 1e-6), (1, true), "{}", pieces.depth);
            for prism in prisms(&mesh, 0.01).unwrap() {
                assert!(prism.signed_volume() > 0.0);
                assert!(prism.positions.iter().flatten().all(|x| (0.0..=1.0).contains(x)), "{:?}", prism.positions);
            }
        }
    }

    /// A flat sheet is one piece whose front is the sheet; its thickness is added behind.
    #[test]
    fn sheet() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [1.0, 1.0, 0.0], [0.0, 1.0, 0.0]];
        let sheet = TriMesh::from_triangles(corners, vec![[0, 1, 2], [0, 2, 3]]);
        let cfg = ConvexDecompositionCfg { tolerance: 1e-4, ..ConvexDecompositionCfg::default() };
        let pieces = convex_decomposition(&sheet, &HullCfg::default(), &cfg).unwrap();
        assert_eq!(pieces.hulls.len(), 1);
        let (lo, hi) = pieces.hulls[0].bounds().unwrap();
        assert!(hi[2] == 0.0 && (lo[2] + 1e-3).abs() < 1e-9 && pieces.depth < 1e-9, "{lo:?} {hi:?} {}", pieces.depth);
        let error = convex_decomposition(&sheet, &HullCfg { min_thickness: None, ..HullCfg::default() }, &cfg);
        assert!(matches!(error, Err(HullError::Coplanar { .. })), "{error:?}");
    }

    /// With few vertices, points of a ball are outside of its hull, and the depth includes this distance.
    #[test]
    fn depth() {
        let points: Vec<[f32; 3]> = (0..600u16)
            .map(|k| {
                let z = 1.0 - (2.0 * f32::from(k) + 1.0) / 600.0;
                let (sin, cos) = (2.399_963 * f32::from(k)).sin_cos();
                let r = (1.0 - z * z).sqrt();
                [r * cos, r * sin, z]
            })
            .collect();
        let ball = convex_hull(&points, &HullCfg { max_vertices: 600, ..HullCfg::default() }).unwrap();
        let of = |max_vertices, max_pieces| {
            let hull = HullCfg { max_vertices, ..HullCfg::default() };
            convex_decomposition(&ball, &hull, &ConvexDecompositionCfg { max_pieces, tolerance: 1e-3 }).unwrap()
        };
        let (few, all) = (of(16, 1).depth, of(600, 1).depth);
        // Sixteen points leave caps of 4π/16, 1 - cos θ = 1/8 each, if they are distributed evenly.
        assert!(few > 0.1 && all < 1e-3, "{few} {all}");
        assert!(of(16, 8).depth < few);
    }

    #[test]
    fn refusals() {
        let corners = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let wrong = TriMesh::from_triangles(corners.clone(), vec![[0, 1, 9]]);
        let flat = TriMesh::from_triangles(corners.clone(), vec![[0, 1, 1]]);
        let many = TriMesh::from_triangles(corners, vec![[0, 1, 2]; MAX_TRIANGLES + 1]);
        let (hull, cfg) = (HullCfg::default(), ConvexDecompositionCfg::default());
        for (mesh, says) in [(&wrong, "vertex 9"), (&flat, "area"), (&many, "50001")] {
            let error = convex_decomposition(mesh, &hull, &cfg).unwrap_err().to_string();
            assert!(error.contains(says), "{error}");
        }
        for (cfg, field) in [
            (ConvexDecompositionCfg { max_pieces: 0, ..cfg }, "max_pieces"),
            (ConvexDecompositionCfg { max_pieces: 5000, ..cfg }, "max_pieces"),
            (ConvexDecompositionCfg { tolerance: 0.0, ..cfg }, "tolerance"),
            (ConvexDecompositionCfg { tolerance: f64::NAN, ..cfg }, "tolerance"),
        ] {
            let error = convex_decomposition(&ell(), &hull, &cfg).unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
        let fine = HullCfg { max_vertices: 5000, ..hull };
        assert!(convex_decomposition(&ell(), &fine, &cfg).unwrap_err().to_string().contains("max_vertices"));
        assert!(prisms(&wrong, 0.01).unwrap_err().to_string().contains("vertex 9"));
        for thickness in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(prisms(&ell(), thickness).unwrap_err().to_string().contains("thickness"));
        }
        // 1 mm long and 2e-10 m high: 1e-15 m³, below MuJoCo's smallest volume.
        let sliver = vec![[0.0; 3], [1e-3, 0.0, 0.0], [5e-4, 2e-10, 0.0]];
        assert!(prisms(&TriMesh::from_triangles(sliver, vec![[0, 1, 2]]), 0.01).unwrap().is_empty());
    }

    #[test]
    fn prism_fronts() {
        let mesh = ell();
        let prisms = prisms(&mesh, 0.01).unwrap();
        assert_eq!(prisms.len(), mesh.triangles.len());
        for (prism, triangle) in prisms.iter().zip(&mesh.triangles) {
            assert!(prism.is_closed());
            assert_eq!(prism.positions[..3], triangle.map(|i| mesh.positions[i as usize]));
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].map(f64::from));
            let normal = cross(sub(b, a), sub(c, a));
            let volume = 0.01 * dot(normal, normal).sqrt() / 2.0;
            // Outward-facing triangles give a positive volume.
            assert!((prism.signed_volume() / volume - 1.0).abs() < 1e-4, "{} {volume}", prism.signed_volume());
        }
        let edge = TriMesh::from_triangles(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], vec![[0, 1, 2]]);
        assert!(crate::mesh::prisms(&edge, 0.01).unwrap().is_empty(), "an edge has no prism");
    }
}
