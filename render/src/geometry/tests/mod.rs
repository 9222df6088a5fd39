//! Rays compared with closed forms and with brute force.

mod bvhs;
mod columns;
mod packets;
mod shapes;
mod terrain;

use kinetoscope_scene::Ray;
use kinetoscope_scene::shape::Intersection;
use kinetoscope_scene::vector::{V3, normalize};

fn bits(touch: &Option<Intersection>) -> Option<(u64, [u64; 3])> {
    touch.as_ref().map(|touch| (touch.t.to_bits(), touch.normal.map(f64::to_bits)))
}

/// Random numbers that are the same in every run (PCG's 32-bit generator, the upper bits).
pub(crate) struct TestRng(pub(crate) u64);

impl TestRng {
    /// A random number between `low` and `high`.
    pub(crate) fn uniform(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 33) as f64 / f64::from(1u32 << 31)
    }

    pub(crate) fn point(&mut self, size: f64) -> V3 {
        [0; 3].map(|_| self.uniform(-size, size))
    }

    pub(super) fn direction(&mut self) -> V3 {
        loop {
            let p = self.point(1.0);
            if kinetoscope_scene::vector::dot(p, p) < 1.0
                && let Some(d) = normalize(p)
            {
                return d;
            }
        }
    }

    /// A random ray from within `far` of the origin to within `near` of it.
    pub(super) fn ray(&mut self, far: f64, near: f64) -> Ray {
        let (origin, target) = (self.point(far), self.point(near));
        let direction = normalize(kinetoscope_scene::vector::sub(target, origin)).unwrap();
        Ray { origin, direction }
    }
}
