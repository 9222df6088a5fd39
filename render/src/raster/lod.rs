//! Level of detail: selection of the mesh level.

use crate::visibility::Projection;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::{Instance, PoseF32, RenderScene};

/// Largest displacement of a surface \[m\].
const DISTANCE: f32 = 1e-3;
/// Largest displacement in the image \[pixels\] (or texels of a shadow map).
const PIXELS: f32 = 0.5;
/// Largest displacement in the image with [`RenderScene::opengl`]: images are compared with those of meshes at full detail.
const OPENGL_PIXELS: f32 = 0.1;

/// Largest displacement in the image of a scene \[pixels\].
pub(crate) fn largest_shift(scene: &RenderScene, projection: &Projection) -> f32 {
    if scene.opengl.is_some() && projection.is_camera { OPENGL_PIXELS } else { PIXELS }
}

/// Selects the coarsest level of an instance's mesh whose surface is nowhere farther from the mesh than [`DISTANCE`],
/// and than `pixels` anywhere in the image. 0 is the mesh itself. The level depends on the instance, its pose and the
/// projection only.
///
/// Terrain has no levels: cameras stand on it.
pub(crate) fn select_level(
    projection: &Projection,
    instance: &Instance,
    camera_from_instance: &PoseF32,
    pixels: f32,
) -> u8 {
    let Shape::Mesh(shape) = &instance.shape else { return 0 };
    let [lo, hi] = shape.mesh.bounds();
    shape.mesh.level_within(tolerance(projection, camera_from_instance, [lo, hi], pixels)) as u8
}

/// Largest allowed displacement of a surface within bounds \[m\]; 0 if the bounds reach behind the near plane.
fn tolerance(projection: &Projection, camera_from_instance: &PoseF32, [lo, hi]: [[f32; 3]; 2], pixels: f32) -> f32 {
    let f = projection.fx.max(projection.fy);
    if projection.parallel {
        return DISTANCE.min(pixels / f);
    }
    let middle = camera_from_instance.apply([0, 1, 2].map(|k| 0.5 * (lo[k] + hi[k])));
    let forward = camera_from_instance.rotation[2];
    let reach: f32 = (0..3).map(|k| forward[k].abs() * 0.5 * (hi[k] - lo[k])).sum();
    // Both surfaces are beyond this depth.
    let near = 0.999 * (middle[2] - reach) - DISTANCE;
    if near.is_nan() || near < projection.near {
        return 0.0;
    }
    // At depth z, for a ray with slopes p, a displacement d moves a point by f / z (d_xy - p d_z) pixels, which is at
    // most f / z |d| sqrt(1 + p²).
    let slope = |size: usize, c: f32, f: f32| c.abs().max((size as f32 - c).abs()) / f;
    let (x, y) =
        (slope(projection.width, projection.cx, projection.fx), slope(projection.height, projection.cy, projection.fy));
    DISTANCE.min(pixels * near / (f * (1.0 + x * x + y * y).sqrt()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::visibility::View;

    #[test]
    fn half_a_pixel() {
        let bounds = [[-0.1, -0.2, -0.3], [0.3, 0.2, 0.1]];
        let view = View {
            parallel: false,
            width: 320,
            height: 200,
            fx: 250.0,
            fy: 310.0,
            cx: 120.0,
            cy: 90.0,
            near: 0.01,
            far: 100.0,
            world_from_camera: PoseF32::IDENTITY,
        };
        let projection = Projection::from(&view);
        let mut closest = 0.0f64;
        for distance in [0.4, 0.45, 0.5, 0.6] {
            let pose = PoseF32::from_translation([0.0, 0.0, distance]);
            let allowed = f64::from(tolerance(&projection, &pose, bounds, PIXELS));
            assert!(allowed > 0.0 && allowed <= f64::from(DISTANCE));
            let z = f64::from(distance) - 0.3;
            let f = [250.0, 310.0];
            let at = |p: [f64; 3]| [f[0] * p[0] / p[2] + 120.0, f[1] * p[1] / p[2] + 90.0];
            // The nearest point visible at the farthest corner of the image, moved in every direction.
            let p = [200.0 / f[0] * z, 110.0 / f[1] * z, z];
            let steps = 64;
            for i in 0..steps * steps {
                let turn = std::f64::consts::TAU / f64::from(steps);
                let (a, b) = (turn * f64::from(i % steps), turn * f64::from(i / steps));
                let d = [a.cos() * b.cos(), a.sin() * b.cos(), b.sin()].map(|x| x * allowed);
                let (from, to) = (at(p), at([p[0] + d[0], p[1] + d[1], p[2] + d[2]]));
                let moved = (to[0] - from[0]).hypot(to[1] - from[1]);
                assert!(moved <= 0.5, "{moved} pixels at {distance} m");
                closest = closest.max(moved);
            }
        }
        // The tolerance is not too strict; it is not reached, because fx differs from fy here.
        assert!(closest > 0.35, "{closest}");
    }

    /// Cameras see scenes in MuJoCo's look at a finer level than other scenes. Lights do not.
    #[test]
    fn limits_of_scenes() {
        let view = View::look_at([64, 64], 0.9, [0.; 3], [0., 0., 1.], [0., 1., 0.]).expect("a good view");
        let camera = Projection::from(&view);
        let light = Projection { is_camera: false, ..camera };
        let plain = RenderScene::empty();
        let rules = kinetoscope_scene::OpenGlRules {
            shadow_clip: 1.0,
            shadow_scale: 1.0,
            culls_backs: false,
            is_additive: false,
            tessellation: None,
        };
        let mut opengl = RenderScene::empty();
        opengl.opengl = Some(rules);
        let limits = [(&plain, &camera), (&plain, &light), (&opengl, &camera), (&opengl, &light)];
        assert_eq!(limits.map(|(scene, projection)| largest_shift(scene, projection)), [0.5, 0.5, 0.1, 0.5]);
    }

    #[test]
    fn partly_behind() {
        let view = View::look_at([64, 64], 0.9, [0.; 3], [0., 0., 1.], [0., 1., 0.]).expect("a good view");
        let projection = Projection::from(&view);
        let bounds = [[-0.1; 3], [0.1; 3]];
        let at = |z: f32| tolerance(&projection, &PoseF32::from_translation([0., 0., z]), bounds, PIXELS);
        assert!(at(0.0) == 0.0 && at(-1.0) == 0.0 && at(0.11) == 0.0 && at(f32::NAN) == 0.0);
        assert!(at(0.12) > 0.0 && at(0.12) < at(0.2) && at(100.0) == DISTANCE);
    }
}
