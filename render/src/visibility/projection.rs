//! Projection between pixels and rays, for cameras (pinhole) and lights (pinhole or parallel).

use super::View;
use crate::simd::{F, Simd, V3, splat};
use kinetoscope_scene::PoseF32;

/// A view with pinhole or parallel rays.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Projection {
    /// True if rays are parallel; `fx` and `fy` are pixels per meter then.
    pub(crate) parallel: bool,
    /// True for cameras, which see nothing beyond `far`; false for lights.
    pub(crate) is_camera: bool,
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) fx: f32,
    pub(crate) fy: f32,
    pub(crate) cx: f32,
    pub(crate) cy: f32,
    pub(crate) near: f32,
    pub(crate) far: f32,
    pub(crate) world_from_camera: PoseF32,
}

impl From<&View> for Projection {
    fn from(v: &View) -> Self {
        let View { parallel, width, height, fx, fy, cx, cy, near, far, world_from_camera } = *v;
        Self { parallel, is_camera: true, width, height, fx, fy, cx, cy, near, far, world_from_camera }
    }
}

impl Projection {
    /// Nearness of a depth: larger is nearer. 1/z for a pinhole, which is linear in the image.
    #[inline(always)]
    pub(crate) fn nearness(&self, z: f32) -> f32 {
        if self.parallel { 1.0 - z / self.far } else { 1.0 / z }
    }

    /// Nearness of sixteen depths.
    #[inline(always)]
    pub(crate) fn nearness_lanes<S: Simd>(&self, z: F<S>) -> F<S> {
        if self.parallel { 1.0 - z / self.far } else { 1.0 / z }
    }

    /// Surfaces with a nearness up to this are beyond the far plane.
    pub(crate) fn farthest(&self) -> f32 {
        // The next smaller number, so that the far plane itself is visible.
        match (self.parallel, self.is_camera) {
            (true, true) => self.nearness(self.far).next_down(),
            (true, false) => f32::MIN,
            (false, _) => (1.0 / self.far).next_down(),
        }
    }

    /// Largest visible nearness, at the near plane.
    pub(crate) fn nearest(&self) -> f32 {
        self.nearness(self.near)
    }

    /// Rays through the points (u, v) of the image, in the frame of an instance: origin and direction, scaled such that
    /// the parameter is the depth.
    #[inline(always)]
    pub(crate) fn rays<S: Simd>(&self, s: S, camera: &LocalCamera, u: F<S>, v: F<S>) -> (V3<S>, V3<S>) {
        let x = (u - self.cx) * camera.inverse_f[0];
        let y = (v - self.cy) * camera.inverse_f[1];
        let r = &camera.instance_from_camera.rotation;
        let t = camera.instance_from_camera.translation;
        let row = |i: usize| x * r[i][0] + y * r[i][1];
        let across = V3 { x: row(0), y: row(1), z: row(2) };
        let forward = V3::splat(s, [r[0][2], r[1][2], r[2][2]]);
        let origin = V3::splat(s, t);
        if self.parallel { (origin.add(across), forward) } else { (origin, across.add(forward)) }
    }

    /// The camera in the frame of an instance.
    pub(crate) fn local(&self, world_from_instance: &PoseF32) -> LocalCamera {
        LocalCamera {
            instance_from_camera: world_from_instance.inverse_times(&self.world_from_camera),
            inverse_f: [1.0 / self.fx, 1.0 / self.fy],
        }
    }

    /// Rays in the world frame: origins relative to the camera, and directions scaled such that the parameter is the
    /// depth.
    #[inline(always)]
    pub(crate) fn world_rays<S: Simd>(&self, s: S, u: F<S>, v: F<S>) -> (V3<S>, V3<S>) {
        let none = V3::splat(s, [0.0; 3]);
        if !self.parallel {
            return (none, self.world_directions(s, u, v));
        }
        let r = &self.world_from_camera.rotation;
        let across = V3 { x: (u - self.cx) * (1.0 / self.fx), y: (v - self.cy) * (1.0 / self.fy), z: splat(s, 0.0) };
        (across.rotate(r), V3::splat(s, [r[0][2], r[1][2], r[2][2]]))
    }

    /// Directions of the rays of a pinhole in the world frame, scaled such that the parameter is the depth.
    #[inline(always)]
    fn world_directions<S: Simd>(&self, s: S, u: F<S>, v: F<S>) -> V3<S> {
        let c = V3 { x: (u - self.cx) * (1.0 / self.fx), y: (v - self.cy) * (1.0 / self.fy), z: splat(s, 1.0) };
        c.rotate(&self.world_from_camera.rotation)
    }
}

/// The camera in the frame of an instance.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LocalCamera {
    pub(crate) instance_from_camera: PoseF32,
    pub(crate) inverse_f: [f32; 2],
}
