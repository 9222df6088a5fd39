//! Convex pieces of a mesh that is not convex, and thin convex ones of its triangles.
//!
//! The mesh is cut by planes where the hull of a piece is farthest above its surface, until it nowhere is by more than a
//! tolerance. Triangles are cut exactly; the hull of a piece is that of the triangles that are left, so that no piece is
//! larger than what it stands for but by what its hull spans. Cuts are not closed by faces of their own: in the middle of a
//! solid, where three of them meet, a corner of a piece may be missing, which nothing touches from outside.

use super::builder::{cross, dot, sub};
use super::{HullCfg, HullError, TriMesh, convex_hull};
use serde::{Deserialize, Serialize};

/// Changes whenever the same input may give other pieces; part of the key of [`super::HullCache`].
pub(super) const ALGORITHM: u32 = 1;

/// How a mesh is cut into convex pieces.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct PiecesCfg {
    /// The most pieces, 1 to 1024.
    pub max_pieces: usize,
    /// How far the hull of a piece may be above its surface \[m\], along the surface's normal, above 0.
    pub tolerance: f64,
}

impl Default for PiecesCfg {
    /// Up to 64 pieces, 1 mm.
    fn default() -> Self {
        Self { max_pieces: 64, tolerance: 1e-3 }
    }
}

/// A mesh cut into pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Pieces {
    /// Convex, closed, outside the front; in the order in which they were cut.
    pub hulls: Vec<TriMesh>,
    /// How far the hull of a piece is above its surface at most \[m\], measured at the corners of its triangles, the middles of
    /// their edges and their middles. More than the tolerance where there were not pieces enough.
    pub depth: f64,
}

type V3 = [f64; 3];
type Triangle = [V3; 3];

/// A part of the surface and its hull.
struct Piece {
    surface: Vec<Triangle>,
    hull: TriMesh,
    /// How far the hull is above the surface at most, where, and the normal of the surface there.
    depth: f64,
    at: V3,
    normal: V3,
}

impl PiecesCfg {
    fn check(&self) -> Result<(), HullError> {
        let fault = |field, value, expected| Err(HullError::InvalidPieces { field, value, expected });
        if !(1..=1024).contains(&self.max_pieces) {
            return fault("max_pieces", self.max_pieces as f64, "1 to 1024");
        }
        if !(self.tolerance > 0.0 && self.tolerance.is_finite()) {
            return fault("tolerance", self.tolerance, "a length above 0");
        }
        Ok(())
    }
}

/// Cuts a mesh into convex pieces. One that is convex within the tolerance is one piece: its hull.
///
/// # Errors
/// A configuration out of its range; as [`convex_hull`] for the mesh as a whole.
pub fn convex_pieces(mesh: &TriMesh, hull: &HullCfg, cfg: &PiecesCfg) -> Result<Pieces, HullError> {
    cfg.check()?;
    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize].map(f64::from));
    let surface: Vec<Triangle> = mesh.triangles.iter().map(corners).filter(|t| unit_normal(t).is_some()).collect();
    let whole = convex_hull(&mesh.positions, hull)?;
    let mut pieces = vec![Piece::of(surface, whole)];
    // Pieces that no plane makes better are left as they are.
    let mut done: Vec<Piece> = Vec::new();
    while pieces.len() + done.len() < cfg.max_pieces {
        let deepest = (0..pieces.len()).filter(|&k| pieces[k].depth > cfg.tolerance);
        let Some(k) = deepest.max_by(|&a, &b| pieces[a].depth.total_cmp(&pieces[b].depth).then(b.cmp(&a))) else {
            break;
        };
        let piece = pieces.remove(k);
        match piece.cut(hull) {
            Some(halves) => pieces.extend(halves),
            None => done.push(piece),
        }
    }
    done.append(&mut pieces);
    let depth = done.iter().map(|piece| piece.depth).fold(0.0, f64::max);
    Ok(Pieces { hulls: done.into_iter().map(|piece| piece.hull).collect(), depth })
}

/// A prism for each triangle that has an area: its front is the triangle, its back is `thickness` \[m\] behind it. Together they
/// have the surface of the mesh, exactly, seen from outside; where the mesh is thinner than that, they reach out behind.
pub fn prisms(mesh: &TriMesh, thickness: f64) -> Vec<TriMesh> {
    let corners = |t: &[u32; 3]| t.map(|i| mesh.positions[i as usize].map(f64::from));
    let prism = |triangle: Triangle| {
        let normal = unit_normal(&triangle)?;
        let back = triangle.map(|p| [0, 1, 2].map(|k| p[k] - thickness * normal[k]));
        let positions = triangle.iter().chain(&back).map(|p| p.map(|x| x as f32)).collect();
        let sides = [[0, 3, 4], [0, 4, 1], [1, 4, 5], [1, 5, 2], [2, 5, 3], [2, 3, 0]];
        let faces = [[0, 1, 2], [3, 5, 4]].into_iter().chain(sides).collect();
        Some(TriMesh::from_triangles(positions, faces))
    };
    mesh.triangles.iter().map(corners).filter_map(prism).collect()
}

impl Piece {
    fn of(surface: Vec<Triangle>, hull: TriMesh) -> Self {
        let faces: Vec<(V3, f64)> = hull
            .triangles
            .iter()
            .filter_map(|t| {
                let corners = t.map(|i| hull.positions[i as usize].map(f64::from));
                unit_normal(&corners).map(|normal| (normal, dot(normal, corners[0])))
            })
            .collect();
        // The way from a point to where the hull ends.
        let above = |p: V3, normal: V3| {
            let faces = faces.iter().map(|&(n, d)| (dot(n, normal), d - dot(n, p)));
            faces.filter(|(slope, _)| *slope > 1e-6).map(|(slope, gap)| gap / slope).fold(f64::INFINITY, f64::min)
        };
        let mut piece = Self { depth: 0.0, at: [0.0; 3], normal: [0.0; 3], surface, hull };
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

    /// The two halves whose hulls are smallest together, of planes through where the hull is farthest from the surface and
    /// through the middle of the piece; of those that are nearly the same, halves that are as large as each other: a bowl has
    /// to be cut twice before its hulls become smaller. `None` where no plane makes two halves that are worth it.
    fn cut(&self, cfg: &HullCfg) -> Option<[Self; 2]> {
        /// What the larger half counts beside both.
        const LARGER: f64 = 0.05;
        /// A half that is less than this of the whole is none.
        const LEAST: f64 = 1e-4;
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let (lo, hi) = self.hull.bounds()?;
        let middle = [0, 1, 2].map(|k| (f64::from(lo[k]) + f64::from(hi[k])) / 2.0);
        let here = axes.iter().chain([&self.normal]).map(|&n| (n, dot(n, self.at)));
        let planes = here.chain(axes.iter().map(|&n| (n, dot(n, middle))));
        let mut best: Option<(f64, [Hulled; 2])> = None;
        let size = (0..3).map(|k| f64::from(hi[k] - lo[k])).fold(0.0, f64::max);
        let least = LEAST * self.hull.signed_volume();
        for (normal, distance) in planes {
            let [front, back] = halves(&self.surface, normal, distance, 1e-6 * size);
            let (Some(front), Some(back)) = (hull_of(front, cfg), hull_of(back, cfg)) else { continue };
            let volumes = [front.1.signed_volume(), back.1.signed_volume()];
            let cost = volumes[0] + volumes[1] + LARGER * volumes[0].max(volumes[1]);
            if volumes.iter().all(|volume| *volume >= least) && best.as_ref().is_none_or(|(lowest, _)| cost < *lowest) {
                best = Some((cost, [front, back]));
            }
        }
        best.map(|(_, halves)| halves.map(|(surface, hull)| Self::of(surface, hull)))
    }
}

/// A surface and its hull.
type Hulled = (Vec<Triangle>, TriMesh);

/// A surface with its hull, where it has one.
fn hull_of(surface: Vec<Triangle>, cfg: &HullCfg) -> Option<Hulled> {
    let points: Vec<[f32; 3]> = surface.iter().flatten().map(|p| p.map(|x| x as f32)).collect();
    let hull = convex_hull(&points, cfg).ok()?;
    Some((surface, hull))
}

/// What is in front of a plane, and what is behind it. Corners nearer to it than `near` \[m\] are on it.
fn halves(surface: &[Triangle], normal: V3, distance: f64, near: f64) -> [Vec<Triangle>; 2] {
    let mut halves = [Vec::new(), Vec::new()];
    for triangle in surface {
        let heights = triangle.map(|p| {
            let height = dot(normal, p) - distance;
            if height.abs() < near { 0.0 } else { height }
        });
        for (half, sign) in halves.iter_mut().zip([1.0, -1.0]) {
            // One that lies in the plane belongs to what is behind its front.
            let flat = heights.iter().all(|h| *h == 0.0);
            let faces = unit_normal(triangle).is_some_and(|n| dot(n, normal) * sign < 0.0);
            if flat && !faces {
                continue;
            }
            let polygon = clipped(triangle, heights.map(|h| h * sign));
            for k in 2..polygon.len() {
                let part = [polygon[0], polygon[k - 1], polygon[k]];
                half.extend(unit_normal(&part).map(|_| part));
            }
        }
    }
    halves
}

/// The part of a triangle where heights are not below 0.
fn clipped(triangle: &Triangle, heights: [f64; 3]) -> Vec<V3> {
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

/// The unit normal of a triangle; `None` where it is only an edge.
fn unit_normal(&[a, b, c]: &Triangle) -> Option<V3> {
    let (u, v) = (sub(b, a), sub(c, a));
    let normal = cross(u, v);
    let length = dot(normal, normal).sqrt();
    // Twice the area against the longest sides: below this single precision knows no side.
    (length > 1e-10 * (dot(u, u) + dot(v, v))).then(|| normal.map(|x| x / length))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "a failed unwrap is a failed test")]
    use super::*;

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

    /// Whether a point is in a convex mesh, or at most `near` outside of it.
    fn within(hull: &TriMesh, p: V3, near: f64) -> bool {
        hull.triangles.iter().all(|t| {
            let corners = t.map(|i| hull.positions[i as usize].map(f64::from));
            unit_normal(&corners).is_none_or(|n| dot(n, sub(p, corners[0])) <= near)
        })
    }

    /// An L is two boxes, whichever way it lies; the hull of it as a whole is a good deal more.
    #[test]
    fn an_ell_is_two_boxes() {
        let volume = 0.5 * (0.25 + 0.75 * 0.25);
        let whole = convex_hull(&ell().positions, &HullCfg::default()).unwrap();
        assert!(whole.signed_volume() > 1.4 * volume, "the control: {}", whole.signed_volume());
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, 0.5, -0.9).cast::<f32>();
        let turned = |mesh: &TriMesh| {
            let turn = |p: &[f32; 3]| (turn * nalgebra::Vector3::from(*p)).into();
            TriMesh::from_triangles(mesh.positions.iter().map(turn).collect(), mesh.triangles.clone())
        };
        for mesh in [ell(), turned(&ell())] {
            let pieces = convex_pieces(&mesh, &HullCfg::default(), &PiecesCfg::default()).unwrap();
            let volumes: Vec<f64> = pieces.hulls.iter().map(TriMesh::signed_volume).collect();
            assert_eq!(volumes.len(), 2, "{volumes:?}");
            // Corners are in single precision.
            assert!((volumes.iter().sum::<f64>() - volume).abs() < 1e-6 && pieces.depth < 1e-6, "{volumes:?}");
        }
    }

    /// A tube along y with an outer radius of 1 and an inner one of 0.8, of 32 sides.
    fn tube() -> TriMesh {
        let ring = |r: f32, y: f32| {
            (0..32).map(move |k| {
                let (sin, cos) = (std::f32::consts::TAU * k as f32 / 32.0).sin_cos();
                [r * cos, y, r * sin]
            })
        };
        let positions: Vec<[f32; 3]> =
            ring(1.0, 0.0).chain(ring(1.0, 1.0)).chain(ring(0.8, 0.0)).chain(ring(0.8, 1.0)).collect();
        let faces = (0..32u32).flat_map(|k| {
            let n = (k + 1) % 32;
            let quad = |a: u32, b: u32, c: u32, d: u32| [[a, b, c], [a, c, d]];
            let (o, i) = ([k, n, n + 32, k + 32], [k + 64, n + 64, n + 96, k + 96]);
            let outer = quad(o[3], o[2], o[1], o[0]);
            let inner = quad(i[0], i[1], i[2], i[3]);
            let first = quad(o[0], o[1], i[1], i[0]);
            let last = quad(o[3], i[3], i[2], o[2]);
            [outer, inner, first, last].concat()
        });
        TriMesh::from_triangles(positions, faces.collect())
    }

    /// Every point of the surface is in a piece, and many pieces leave the hollow free.
    #[test]
    fn pieces_cover_the_surface_and_leave_the_hollow() {
        // So many vertices that no hull is simplified by them.
        let (mesh, all) = (tube(), HullCfg { max_vertices: 1000, ..HullCfg::default() });
        assert!(mesh.is_closed() && mesh.signed_volume() > 0.0);
        let mut before = f64::INFINITY;
        for (max_pieces, tolerance) in [(4, 1e-6), (16, 1e-6), (64, 0.05)] {
            let pieces = convex_pieces(&mesh, &all, &PiecesCfg { max_pieces, tolerance }).unwrap();
            assert!(
                pieces.hulls.len() <= max_pieces && pieces.depth < before,
                "{} {}",
                pieces.hulls.len(),
                pieces.depth
            );
            assert!(pieces.depth <= tolerance || pieces.hulls.len() == max_pieces);
            before = if max_pieces == 16 { f64::INFINITY } else { pieces.depth };
            for triangle in &mesh.triangles {
                let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].map(f64::from));
                let middle = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
                // Hulls leave out what sticks out by less than 1e-4 of their size.
                assert!(pieces.hulls.iter().any(|hull| within(hull, middle, 4e-4)), "{middle:?}");
            }
            if max_pieces < 64 {
                continue;
            }
            // On a ring in the hollow that is farther above the inner surface than that, nothing is. The depth is that of
            // some points of each triangle; hulls bulge by a little more between them.
            let free = 0.8 * (std::f64::consts::PI / 32.0).cos() - 1.5 * pieces.depth - 1e-3;
            for k in 0..200 {
                let (sin, cos) = (0.1 + 0.0314 * f64::from(k)).sin_cos();
                let p = [free * cos, 0.5, free * sin];
                assert!(!pieces.hulls.iter().any(|hull| within(hull, p, 0.0)), "{max_pieces} pieces: {p:?}");
            }
        }
        // The control: the hull fills the hollow.
        let whole = convex_hull(&mesh.positions, &all).unwrap();
        assert!(within(&whole, [0.0, 0.5, 0.0], 0.0));
        // What is convex stays whole.
        let one = convex_pieces(&whole, &all, &PiecesCfg::default()).unwrap();
        assert_eq!((one.hulls.len(), one.depth < 1e-3), (1, true), "{}", one.depth);
    }

    #[test]
    fn prisms_have_the_triangles_for_fronts() {
        let mesh = ell();
        let prisms = prisms(&mesh, 0.01);
        assert_eq!(prisms.len(), mesh.triangles.len());
        for (prism, triangle) in prisms.iter().zip(&mesh.triangles) {
            assert!(prism.is_closed());
            assert_eq!(prism.positions[..3], triangle.map(|i| mesh.positions[i as usize]));
            let [a, b, c] = triangle.map(|i| mesh.positions[i as usize].map(f64::from));
            let normal = cross(sub(b, a), sub(c, a));
            let volume = 0.01 * dot(normal, normal).sqrt() / 2.0;
            // Outside the front: positive.
            assert!((prism.signed_volume() / volume - 1.0).abs() < 1e-4, "{} {volume}", prism.signed_volume());
        }
        let edge = TriMesh::from_triangles(vec![[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0]], vec![[0, 1, 2]]);
        assert!(super::prisms(&edge, 0.01).is_empty(), "an edge has no side");
    }

    #[test]
    fn configurations_that_cannot_be_are_named() {
        let base = PiecesCfg::default();
        for (cfg, field) in [
            (PiecesCfg { max_pieces: 0, ..base }, "max_pieces"),
            (PiecesCfg { max_pieces: 5000, ..base }, "max_pieces"),
            (PiecesCfg { tolerance: 0.0, ..base }, "tolerance"),
            (PiecesCfg { tolerance: f64::NAN, ..base }, "tolerance"),
        ] {
            let error = convex_pieces(&ell(), &HullCfg::default(), &cfg).unwrap_err().to_string();
            assert!(error.contains(field), "{error}");
        }
    }
}
