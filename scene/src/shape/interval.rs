//! Intervals of a ray inside a convex body.

use crate::vector::{V3, add_scaled, dot};

/// Distances at which a ray enters and leaves a convex body, in multiples of the length of its direction. The interval
/// is empty if `leave` is less than `enter`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Interval {
    pub(super) enter: f64,
    pub(super) leave: f64,
}

impl Interval {
    pub(super) const EMPTY: Self = Self { enter: f64::INFINITY, leave: f64::NEG_INFINITY };
    pub(super) const ALL: Self = Self { enter: f64::NEG_INFINITY, leave: f64::INFINITY };

    #[inline(always)]
    pub(super) fn is_empty(self) -> bool {
        self.enter > self.leave
    }

    /// Intersection of both intervals.
    #[inline(always)]
    pub(super) fn intersection(self, other: Self) -> Self {
        Self { enter: self.enter.max(other.enter), leave: self.leave.min(other.leave) }
    }

    /// Smallest interval that contains both, for two parts of one convex body.
    #[inline(always)]
    pub(super) fn hull(self, other: Self) -> Self {
        Self { enter: self.enter.min(other.enter), leave: self.leave.max(other.leave) }
    }

    /// First end at a distance from 0 to `limit`: the entry, or the exit of a ray that begins inside; `None` if neither
    /// is in this range.
    #[inline(always)]
    pub(super) fn first(self, limit: f64) -> Option<f64> {
        let t = if self.enter >= 0.0 { self.enter } else { self.leave };
        // Infinite and NaN ends belong to rays along the surface.
        (self.enter <= self.leave && t >= 0.0 && t <= limit && t < f64::INFINITY).then_some(t)
    }
}

/// Interval in a sphere about the origin, for directions of any length.
///
/// The distance from the center is computed at the nearest point, not by the discriminant, which cancels for small
/// spheres far away. Source: Haines et al., Precision improvements for ray/sphere intersection, Ray Tracing Gems, 2019.
#[inline(always)]
pub(super) fn sphere_interval(o: V3, d: V3, radius: f64) -> Interval {
    let dd = dot(d, d);
    let middle = -dot(o, d) / dd;
    let p = add_scaled(o, middle, d);
    symmetric_interval(middle, radius * radius - dot(p, p), dd)
}

/// Interval in an infinite cylinder about z.
#[inline(always)]
pub(super) fn cylinder_interval(o: V3, d: V3, radius: f64) -> Interval {
    let dd = d[0] * d[0] + d[1] * d[1];
    if dd < 1e-30 {
        let inside = o[0] * o[0] + o[1] * o[1] <= radius * radius;
        return if inside { Interval::ALL } else { Interval::EMPTY };
    }
    let middle = -(o[0] * d[0] + o[1] * d[1]) / dd;
    let (x, y) = (o[0] + middle * d[0], o[1] + middle * d[1]);
    symmetric_interval(middle, radius * radius - (x * x + y * y), dd)
}

#[inline(always)]
fn symmetric_interval(middle: f64, rest: f64, dd: f64) -> Interval {
    if rest >= 0.0 {
        let half = (rest / dd).sqrt();
        Interval { enter: middle - half, leave: middle + half }
    } else {
        Interval::EMPTY
    }
}

/// Interval between -h and h along one axis.
#[inline(always)]
pub(super) fn slab_interval(o: f64, d: f64, h: f64) -> Interval {
    if d == 0.0 {
        return if o.abs() <= h { Interval::ALL } else { Interval::EMPTY };
    }
    let (a, b) = ((-h - o) / d, (h - o) / d);
    Interval { enter: a.min(b), leave: a.max(b) }
}
