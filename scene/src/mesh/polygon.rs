//! Triangulation of the polygons of OBJ and COLLADA files.

use earcut::Earcut;

/// Cuts a polygon into triangles (indices into `points`) with the winding of the polygon. Fewer than three points give
/// no triangle.
///
/// A convex polygon becomes a fan from its first corner. A concave polygon is cut by ear clipping; corners on a straight
/// edge may be left out. A polygon without area is cut as a fan.
pub(super) fn triangulate(points: &[[f64; 3]]) -> Vec<[usize; 3]> {
    let n = points.len();
    if n < 3 {
        return Vec::new();
    }
    let fan = || (1..n - 1).map(|i| [0, i, i + 1]).collect();
    let flat = project_to_plane(points);
    let is_reflex = |i: usize| signed_area_doubled(flat[(i + n - 1) % n], flat[i], flat[(i + 1) % n]) < 0.0;
    if n == 3 || !(0..n).any(is_reflex) {
        return fan();
    }
    let (no_holes, mut corners): ([usize; 0], Vec<usize>) = ([], Vec::new());
    // The projection is counter-clockwise, as are the triangles.
    Earcut::new().earcut(flat, &no_holes, &mut corners);
    if corners.is_empty() { fan() } else { corners.as_chunks::<3>().0.to_vec() }
}

/// Projection of the polygon along the largest component of its normal (Newell's method), counter-clockwise.
fn project_to_plane(points: &[[f64; 3]]) -> Vec<[f64; 2]> {
    let mut normal = [0.0; 3];
    for (i, p) in points.iter().enumerate() {
        let q = points[(i + 1) % points.len()];
        for (axis, n) in normal.iter_mut().enumerate() {
            let (y, z) = ((axis + 1) % 3, (axis + 2) % 3);
            *n += (p[y] - q[y]) * (p[z] + q[z]);
        }
    }
    let axis = (0..3).fold(0, |best, i| if normal[i].abs() > normal[best].abs() { i } else { best });
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let mirror = if normal[axis] < 0.0 { -1.0 } else { 1.0 };
    points.iter().map(|p| [p[u] * mirror, p[v]]).collect()
}

/// Twice the area of the triangle, positive when it is counter-clockwise.
fn signed_area_doubled(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vector::{cross, sub};

    fn area(points: &[[f64; 3]], triangles: &[[usize; 3]]) -> f64 {
        let of = |t: &[usize; 3]| {
            let [a, b, c] = t.map(|i| points[i]);
            cross(sub(b, a), sub(c, a))[2] / 2.0
        };
        triangles.iter().map(of).sum()
    }

    #[test]
    fn concave_polygons() {
        // An L and an arrow whose fan from corner 0 would leave it, both also with reversed winding.
        let l = [[0., 0., 0.], [2., 0., 0.], [2., 1., 0.], [1., 1., 0.], [1., 2., 0.], [0., 2., 0.]];
        let arrow = [[-1., -1., 0.], [0., -0.5, 0.], [1., -1., 0.], [0., 1., 0.]];
        for (points, expected) in [(&l[..], 3.0), (&arrow[..], 1.5)] {
            for shift in 0..points.len() {
                let mut p = points.to_vec();
                p.rotate_left(shift);
                let t = triangulate(&p);
                assert_eq!(t.len(), p.len() - 2);
                assert!((area(&p, &t) - expected).abs() < 1e-12);
                assert!(t.iter().all(|&t| area(&p, &[t]) > 0.0), "{shift}: {t:?}");
                p.reverse();
                let t = triangulate(&p);
                assert!(t.iter().all(|&t| area(&p, &[t]) < 0.0));
                assert!((area(&p, &t) + expected).abs() < 1e-12);
            }
        }
        assert!(triangulate(&[[0.0; 3]; 2]).is_empty(), "less than a triangle");
    }

    /// A comb with 1000 teeth: concave at every second corner.
    #[test]
    fn many_corners() {
        let teeth = 1000;
        let mut comb = vec![[f64::from(teeth), -1.0, 0.0], [f64::from(teeth), 0.0, 0.0]];
        comb.extend((0..teeth).rev().flat_map(|k| [[f64::from(k) + 0.5, 1.0, 0.0], [f64::from(k), 0.0, 0.0]]));
        comb.push([0.0, -1.0, 0.0]);
        let triangles = triangulate(&comb);
        let expected = f64::from(teeth) * 1.5;
        assert!((area(&comb, &triangles) - expected).abs() < 1e-9 * expected);
        assert!(triangles.iter().all(|&t| area(&comb, &[t]) >= 0.0));
        // Control: a fan covers the same area with triangles of both windings.
        assert!((1..comb.len() - 1).any(|i| area(&comb, &[[0, i, i + 1]]) < 0.0));
    }
}
