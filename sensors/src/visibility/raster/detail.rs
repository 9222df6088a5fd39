//! How coarse a mesh may be drawn.

use crate::visibility::Projection;
use scene::{Instance, PoseF32, Shape};

/// A surface may be elsewhere by this much at most \[m\].
const DISTANCE: f32 = 1e-3;
/// And by this many pixels (or texels of a shadow map).
const PIXELS: f32 = 0.5;

/// The number of the coarsest level of an instance's mesh that may be drawn instead of it: its surface is nowhere farther
/// from the mesh than [`DISTANCE`], and than [`PIXELS`] anywhere in the picture. 0 is the mesh itself. Depends on the
/// instance, its pose and the projection only.
///
/// Terrain is drawn as it is: cameras stand on it.
pub(crate) fn level(projection: &Projection, instance: &Instance, camera_from_instance: &PoseF32) -> u8 {
    let Shape::Mesh(shape) = &instance.shape else { return 0 };
    let [lo, hi] = shape.mesh.bounds();
    shape.mesh.level_within(tolerance(projection, camera_from_instance, [lo, hi])) as u8
}

/// How far a surface within bounds may be from where it is \[m\]; 0 where the bounds reach behind the near plane.
fn tolerance(projection: &Projection, camera_from_instance: &PoseF32, [lo, hi]: [[f32; 3]; 2]) -> f32 {
    let f = projection.fx.max(projection.fy);
    if projection.parallel {
        return DISTANCE.min(PIXELS / f);
    }
    let middle = camera_from_instance.apply([0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k])));
    let forward = camera_from_instance.rotation[2];
    let reach: f32 = (0..3).map(|k| forward[k].abs() * 0.5 * (hi[k] - lo[k])).sum();
    // Both surfaces are within this.
    let near = 0.999 * (middle[2] - reach) - DISTANCE;
    if near.is_nan() || near < projection.near {
        return 0.0;
    }
    // At depth z, where rays have the slopes p, a displacement d moves a point by f / z (d_xy - p d_z) pixels, which is
    // at most f / z |d| sqrt(1 + p²).
    let slope = |size: usize, c: f32, f: f32| c.abs().max((size as f32 - c).abs()) / f;
    let (x, y) =
        (slope(projection.width, projection.cx, projection.fx), slope(projection.height, projection.cy, projection.fy));
    DISTANCE.min(PIXELS * near / (f * (1.0 + x * x + y * y).sqrt()))
}
