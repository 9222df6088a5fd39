//! Shadows by rays, for pictures that are shaded without paths.

use crate::lanes::{F, LANES, M, Simd, V3, load, splat};
use crate::ray::Ray;
use crate::ray::bvh::Stack;
use crate::ray::vector::{along, dot, scale, sub};
use crate::visibility::trace::Tracer;
use scene::{Light, LightKind};
use std::cell::RefCell;

/// Rays begin this part of the numbers that their origins are made of above the surface: positions are single precision.
const ABOVE: f32 = 1e-5;

/// What casts shadows, and a thread's scratch memory.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShadowRays<'a> {
    pub(crate) tracer: &'a Tracer,
    pub(crate) stack: &'a RefCell<&'a mut Stack>,
}

impl ShadowRays<'_> {
    /// The part of a lamp's light that reaches each point; 1 where it is not asked for. `toward` is the lamp's direction if
    /// it is parallel, `depth` how far the camera is.
    #[inline(never)]
    pub(crate) fn light<S: Simd>(
        &self,
        s: S,
        light: &Light,
        toward: [f32; 3],
        (position, normal, depth): (V3<S>, V3<S>, F<S>),
        lanes: M<S>,
    ) -> F<S> {
        let points = [position.x.array(), position.y.array(), position.z.array()];
        let normals: [[f32; LANES]; 3] = [normal.x.array(), normal.y.array(), normal.z.array()];
        let depths: [f32; LANES] = depth.array();
        let mut out = [1.0f32; LANES];
        let mut left = lanes.to_bitmask();
        let mut stack = self.stack.borrow_mut();
        while left != 0 {
            let k = left.trailing_zeros() as usize;
            left &= left - 1;
            let at = [0, 1, 2].map(|axis| points[axis][k]);
            let above = ABOVE * (depths[k] + at.iter().map(|x| x.abs()).sum::<f32>());
            let origin = along(at.map(f64::from), f64::from(above), [0, 1, 2].map(|axis| f64::from(normals[axis][k])));
            let (direction, limit) = if light.kind == LightKind::Directional {
                (toward.map(f64::from), f64::INFINITY)
            } else {
                let to = sub(light.position.map(f64::from), origin);
                (to, dot(to, to).sqrt())
            };
            let length = dot(direction, direction).sqrt();
            if length > 0.0 {
                let ray = Ray { origin, direction: scale(direction, 1.0 / length) };
                out[k] = self.tracer.passes(&ray, limit, &mut stack) as f32;
            }
        }
        if out == [1.0; LANES] { splat(s, 1.0) } else { load(s, &out) }
    }
}
