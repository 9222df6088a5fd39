//! Cast order of rays: neighboring rays share a packet, whatever the order of the pattern.

use kinetoscope_render::geometry::packet::WIDTH;
use kinetoscope_scene::Ray;

/// Weight of a direction difference, in meters of an origin difference: rays of a fan are this far apart at a typical
/// hit distance.
const DIRECTION_WEIGHT: f64 = 10.0;

/// Returns the indices of all rays, ordered so that each [`WIDTH`] of them are neighbors. The rays are halved
/// recursively, each time across the longer side.
pub(super) fn coherent_order(rays: &[Ray]) -> Vec<u32> {
    let mut order: Vec<u32> = (0..rays.len() as u32).collect();
    split(rays, &mut order);
    order
}

/// Returns the origin and the weighted direction of a ray \[m\].
fn coordinates(ray: &Ray) -> [f64; 6] {
    std::array::from_fn(|k| if k < 3 { ray.origin[k] } else { DIRECTION_WEIGHT * ray.direction[k - 3] })
}

fn split(rays: &[Ray], order: &mut [u32]) {
    if order.len() <= WIDTH {
        return;
    }
    let (mut low, mut high) = ([f64::INFINITY; 6], [f64::NEG_INFINITY; 6]);
    for &k in order.iter() {
        for (axis, x) in coordinates(&rays[k as usize]).into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(x), high[axis].max(x));
        }
    }
    let long = |axis: usize| high[axis] - low[axis];
    let axis = (1..6).fold(0, |best, axis| if long(axis) > long(best) { axis } else { best });
    let at = |k: u32| coordinates(&rays[k as usize])[axis];
    // Rays at the same place keep their order.
    order.sort_unstable_by(|&a, &b| at(a).total_cmp(&at(b)).then(a.cmp(&b)));
    // The left half has whole packets.
    let middle = (order.len() / 2).next_multiple_of(WIDTH);
    let (left, right) = order.split_at_mut(middle);
    split(rays, left);
    split(rays, right);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ray::RayPattern;
    use crate::ray::pattern::{Grid, Lidar};

    /// Sum over packets of the side lengths of the boxes around origins and directions.
    fn spread(rays: &[Ray], order: &[u32]) -> f64 {
        let of = |packet: &[u32], axis: usize| {
            let at = |k: &u32| coordinates(&rays[*k as usize])[axis];
            let high = packet.iter().map(at).fold(f64::NEG_INFINITY, f64::max);
            high - packet.iter().map(at).fold(f64::INFINITY, f64::min)
        };
        order.chunks(WIDTH).map(|packet| (0..6).map(|axis| of(packet, axis)).sum::<f64>()).sum()
    }

    #[test]
    fn coherent_packets() {
        let lidar = Lidar { channels: 16, horizontal_resolution_deg: 2.0, ..Lidar::default() };
        for pattern in [RayPattern::from(Grid::default()), lidar.into()] {
            let rays = pattern.rays().expect("a good pattern");
            let order = coherent_order(&rays);
            let mut sorted = order.clone();
            sorted.sort_unstable();
            assert!(sorted.into_iter().eq(0..rays.len() as u32));
            let own: Vec<u32> = (0..rays.len() as u32).collect();
            let (before, after) = (spread(&rays, &own), spread(&rays, &order));
            assert!(after < 0.8 * before, "{}: {after} of {before}", pattern.name());
            assert_eq!(order, coherent_order(&rays), "the same every time");
        }
        assert!(coherent_order(&[]).is_empty());
    }
}
