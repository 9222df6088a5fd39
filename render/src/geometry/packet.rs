//! Packets of rays that are cast together, one ray per lane.

use crate::simd::{D, D3, DOUBLES, Simd, axes, dot_3, load_3};
use kinetoscope_scene::PoseF64;
use kinetoscope_scene::Ray;
use kinetoscope_scene::vector::V3;

/// Number of rays in a packet.
pub const WIDTH: usize = DOUBLES;
/// All lanes, a bit for each.
pub(crate) const ALL: u64 = (1 << WIDTH) - 1;

/// Several rays: one lane is one ray in all arrays. All origins and directions are finite.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Packet {
    origin: [[f64; WIDTH]; 3],
    direction: [[f64; WIDTH]; 3],
    /// Largest distance \[m\]; negative for a lane without a ray.
    limit: [f64; WIDTH],
}

impl Packet {
    /// Packs the first rays of a list, with hits up to `max_distance`. A ray with a non-finite number is left out. Its
    /// lane and the lanes beyond the list copy another ray.
    #[inline(always)]
    pub(crate) fn from_rays(rays: &[Ray], max_distance: f64) -> Self {
        let like = rays.iter().find(|ray| ray.is_finite()).copied();
        let like = like.unwrap_or(Ray { origin: [0.0; 3], direction: [0.0; 3] });
        let mut packet = Self { origin: [[0.0; WIDTH]; 3], direction: [[0.0; WIDTH]; 3], limit: [-1.0; WIDTH] };
        for k in 0..WIDTH {
            let ray = rays.get(k).filter(|ray| ray.is_finite());
            let Ray { origin, direction } = ray.unwrap_or(&like);
            for axis in 0..3 {
                (packet.origin[axis][k], packet.direction[axis][k]) = (origin[axis], direction[axis]);
            }
            if ray.is_some() {
                packet.limit[k] = f64::INFINITY.min(max_distance);
            }
        }
        packet
    }

    /// The ray of a lane.
    #[inline(always)]
    pub(crate) fn ray(&self, k: usize) -> Ray {
        Ray {
            origin: [0, 1, 2].map(|axis| self.origin[axis][k]),
            direction: [0, 1, 2].map(|axis| self.direction[axis][k]),
        }
    }

    /// One ray alone, copied to all lanes; only lane `k` has a ray.
    #[inline(always)]
    pub(super) fn single(&self, k: usize) -> Self {
        let mut limit = [-1.0; WIDTH];
        limit[k] = self.limit[k];
        Self { origin: self.origin.map(|x| [x[k]; WIDTH]), direction: self.direction.map(|x| [x[k]; WIDTH]), limit }
    }

    #[inline(always)]
    pub(crate) fn limit(&self, k: usize) -> f64 {
        self.limit[k]
    }

    /// Lowers the largest distance of a lane.
    #[inline(always)]
    pub(crate) fn limit_to(&mut self, k: usize, limit: f64) {
        self.limit[k] = self.limit[k].min(limit);
    }

    /// True if a lane has a ray.
    #[inline(always)]
    pub(crate) fn is_active(&self, k: usize) -> bool {
        self.limit[k] >= 0.0
    }

    #[inline(always)]
    pub(crate) fn origins<S: Simd>(&self, s: S) -> D3<S> {
        load_3(s, &self.origin)
    }

    #[inline(always)]
    pub(crate) fn directions<S: Simd>(&self, s: S) -> D3<S> {
        load_3(s, &self.direction)
    }

    #[inline(always)]
    pub(crate) fn limits<S: Simd>(&self, s: S) -> D<S> {
        D::load(s, &self.limit)
    }

    /// The rays that may meet a sphere, given in the frame of the rays, before their limits: transformed to the frame
    /// that `pose` maps from. The other lanes have no ray; `None` if no lane has one. All rays meet a sphere of radius
    /// +inf. Each lane equals, to the bit, the transform of its ray alone.
    #[inline(always)]
    pub(super) fn in_local_frame<S: Simd>(&self, s: S, pose: &PoseF64, middle: V3, radius: f64) -> Option<Self> {
        let (origin, direction, limit) = (self.origins(s), self.directions(s), self.limits(s));
        let zero = D::splat(s, 0.0);
        let mut hit = zero.le(limit);
        if radius < f64::INFINITY {
            let to_middle = axes(
                #[inline(always)]
                |k| D::splat(s, middle[k]) - origin[k],
            );
            let t = dot_3(to_middle, direction);
            // Offset from the center at the closest approach; a difference of squares would cancel.
            let beside = axes(
                #[inline(always)]
                |k| to_middle[k] + (-t) * direction[k],
            );
            let r = D::splat(s, radius);
            hit = hit & dot_3(beside, beside).le(r * r) & zero.le(t + r) & (t - r).le(limit);
        }
        if hit.to_bitmask() == 0 {
            return None;
        }
        let from = axes(
            #[inline(always)]
            |k| origin[k] - pose.translation[k],
        );
        Some(Self {
            origin: rotate_inverse(pose, from),
            direction: rotate_inverse(pose, direction),
            limit: hit.select(limit, D::splat(s, -1.0)).array(),
        })
    }
}

/// Packet version of [`PoseF64::rotate_inverse`]: the same bits.
#[inline(always)]
fn rotate_inverse<S: Simd>(pose: &PoseF64, v: D3<S>) -> [[f64; WIDTH]; 3] {
    let r = &pose.rotation;
    axes(
        #[inline(always)]
        |j| (v[0] * r[0][j] + v[1] * r[1][j] + v[2] * r[2][j]).array(),
    )
}
