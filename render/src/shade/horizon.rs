//! Haze at the end of an infinite ground, as in MuJoCo's renderer: two cones around the camera that meet in the circle
//! where the ground ends. Colors are mixed in sRGB.
//!
//! The formula was fitted to images of MuJoCo 4 on OSMesa. In a frame where the ground ends at the distance 1 and the
//! camera has the height 1, the lower cone goes from opaque at (1, 0) to clear at (1 - w², -w) for a width w, and the
//! upper one to clear at (1 + w, 1).

use super::tone::BlendSpace;
use crate::simd::{F, M, Simd, V3, max, select, splat, sqrt_or_zero};
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::{Instance, PoseF32, RenderScene};

/// The haze of a frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Horizon {
    /// Index of the ground's instance.
    pub(crate) ground: usize,
    up: [f32; 3],
    /// Distance where the ground ends, in heights of the camera above it.
    radius: f32,
    /// Color, 0..=255.
    color: [f32; 3],
    width: f32,
    blend: BlendSpace,
}

impl Horizon {
    /// The haze seen from a point; `None` if the scene has no haze or no infinite plane, or if the point is below the
    /// plane.
    pub(crate) fn of(
        scene: &RenderScene,
        poses: &[PoseF32],
        eye: [f32; 3],
        shown: impl Fn(&Instance) -> bool,
    ) -> Option<Self> {
        let haze = scene.horizon?;
        let is_ground = |i: &Instance| matches!(&i.shape, Shape::Plane(plane) if plane.half == [0.0; 2]) && shown(i);
        let ground = scene.instances().iter().position(is_ground)?;
        let pose = poses.get(ground)?;
        let up = pose.rotation.map(|row| row[2]);
        let height = (0..3).map(|k| up[k] * (eye[k] - pose.translation[k])).sum::<f32>();
        let radius = haze.radius / height;
        let color = haze.color.map(|c| 255.0 * c.clamp(0.0, 1.0));
        let width = haze.width.clamp(0.0, 1.0);
        let usable = height > 0.0 && radius > 0.0 && radius.is_finite() && width.is_finite();
        let blend = BlendSpace { is_display: scene.opengl.is_some() };
        usable.then_some(Self { ground, up, radius, color, width, blend })
    }

    /// Opacity of the haze in a direction (unit), and the directions beyond the end of the ground.
    #[inline(always)]
    fn opacity<S: Simd>(&self, s: S, view: V3<S>) -> (F<S>, M<S>) {
        let (zero, one) = (splat(s, 0.0), splat(s, 1.0));
        let down = -view.dot(V3::splat(s, self.up));
        // Below the horizon, by p / q times the slope to the end of the ground.
        let (p, q) = (max(down, zero) * self.radius, sqrt_or_zero(s, one - down * down));
        let both = max(q + p * self.width, splat(s, 1e-30));
        let near = max(one - (p - q) / (both * self.width.max(1e-6)), zero);
        let far = p * (1.0 + self.width) / both;
        let beyond = p.simd_lt(q);
        (select(beyond, far, near), beyond)
    }

    #[inline(always)]
    fn mixed<S: Simd>(&self, s: S, color: V3<S>, opacity: F<S>) -> V3<S> {
        let mix = {
            #[inline(always)]
            |color: F<S>, haze: f32| {
                let color = self.blend.to_bytes(s, color);
                self.blend.color_of_bytes(color + (splat(s, haze) - color) * opacity)
            }
        };
        let [r, g, b] = self.color;
        let hazy = V3 { x: mix(color.x, r), y: mix(color.y, g), z: mix(color.z, b) };
        V3::select(opacity.simd_gt(splat(s, 0.0)), hazy, color)
    }

    /// Blends the haze over the sky in a direction (unit).
    #[inline(never)]
    pub(crate) fn over_sky<S: Simd>(&self, s: S, view: V3<S>, sky: V3<S>) -> V3<S> {
        s.vectorize(
            #[inline(always)]
            || {
                let (opacity, _) = self.opacity(s, view);
                self.mixed(s, sky, opacity)
            },
        )
    }

    /// Blends the haze over the ground in a direction (unit). Beyond its end the sky is visible.
    #[inline(always)]
    pub(crate) fn over_ground<S: Simd>(&self, s: S, view: V3<S>, ground: V3<S>, sky: impl Fn() -> V3<S>) -> V3<S> {
        let (opacity, beyond) = self.opacity(s, view);
        let color = if beyond.any_true() { V3::select(beyond, sky(), ground) } else { ground };
        if opacity.simd_gt(splat(s, 0.0)).any_true() { self.mixed(s, color, opacity) } else { color }
    }
}
