//! Interpolation of normals and texture coordinates in a triangle.

use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::vector::{V3, cross, dot, scale, sub, to_f64};

/// Largest lift of a point, as a fraction of the size of its triangle: that of a ball with eight sides.
const MAX_LIFT: f64 = 0.15;

/// Interpolated attributes at a point of a triangle.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SurfaceAttributes {
    /// Interpolated outward normal, not of unit length.
    pub(crate) normal: V3,
    /// Offset from the flat triangle to the smooth surface that it approximates, as seen from the given side.
    pub(crate) lift: V3,
    /// Texture coordinates, and their number per meter; `None` for a mesh without.
    pub(crate) uv: Option<([f64; 2], f64)>,
    /// Barycentric coordinates.
    pub(crate) shares: [f64; 3],
}

/// Interpolates the attributes of a mesh at a point `at` of a triangle, all in the frame of the mesh. `side` is 1 for a
/// triangle seen from outside, -1 from inside.
pub(crate) fn interpolate_triangle(mesh: &RenderMesh, triangle: usize, at: V3, side: f64) -> SurfaceAttributes {
    let corners = mesh.triangles()[triangle].map(|i| i as usize);
    let ends @ [a, b, c] = corners.map(|i| to_f64(mesh.positions()[i]));
    let (ab, ac, w) = (sub(b, a), sub(c, a), sub(at, a));
    let across = cross(ab, ac);
    let area = dot(across, across).max(f64::MIN_POSITIVE);
    let kb = (dot(cross(w, ac), across) / area).clamp(0.0, 1.0);
    let kc = (dot(cross(ab, w), across) / area).clamp(0.0, 1.0 - kb);
    let share = [1.0 - kb - kc, kb, kc];
    let normals = corners.map(|i| to_f64(mesh.normals()[i]));
    let normal = [0, 1, 2].map(|k| (0..3).map(|n| share[n] * normals[n][k]).sum());
    // Depth of the point below the tangent plane of each corner.
    let below = [0, 1, 2].map(|n| (side * dot(sub(at, ends[n]), normals[n])).min(0.0));
    let lift: V3 = [0, 1, 2].map(|k| (0..3).map(|n| -side * share[n] * below[n] * normals[n][k]).sum());
    let (far, most) = (dot(lift, lift).sqrt(), MAX_LIFT * area.sqrt().sqrt());
    let lift = if far > most { scale(lift, most / far) } else { lift };
    let uv = mesh.uvs().map(|uvs| {
        let t = corners.map(|i| uvs[i].map(f64::from));
        let uv = [0, 1].map(|k| (0..3).map(|n| share[n] * t[n][k]).sum());
        let [p, q] = [1, 2].map(|n| [t[n][0] - t[0][0], t[n][1] - t[0][1]]);
        // Square root of the ratio of areas, in the texture and on the surface.
        (uv, ((p[0] * q[1] - q[0] * p[1]).abs() / area.sqrt()).sqrt())
    });
    SurfaceAttributes { normal, lift, uv, shares: share }
}
