//! Surfaces of revolution, for the tessellation of round shapes.

use crate::mesh::TriMesh;

/// Revolves a profile of (radius, z), from the bottom to the top, about the z axis. A radius of zero is a pole.
pub(crate) fn revolve(profile: &[[f64; 2]], segments: usize) -> TriMesh {
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    let mut rings: Vec<Vec<u32>> = Vec::new();
    for &[radius, z] in profile {
        let count = if radius == 0.0 { 1 } else { segments };
        let ring = (0..count).map(|k| {
            let angle = std::f64::consts::TAU * k as f64 / segments as f64;
            positions.push([(radius * angle.cos()) as f32, (radius * angle.sin()) as f32, z as f32]);
            positions.len() as u32 - 1
        });
        rings.push(ring.collect());
    }
    for pair in rings.windows(2) {
        let at = |ring: &[u32], k: usize| ring[k % ring.len()];
        for k in 0..segments {
            let (a, b) = (at(&pair[0], k), at(&pair[0], k + 1));
            let (c, d) = (at(&pair[1], k), at(&pair[1], k + 1));
            if a != b {
                triangles.push([a, b, d]);
            }
            if c != d {
                triangles.push([a, d, c]);
            }
        }
    }
    TriMesh::from_triangles(positions, triangles)
}

/// Profile of an arc of `radius` \[m\] about the point of the axis at height `z` \[m\]: angles above the horizontal
/// from `from` to `to` \[rad\].
pub(super) fn arc(radius: f64, z: f64, from: f64, to: f64, steps: usize) -> Vec<[f64; 2]> {
    (0..=steps)
        .map(|k| {
            let angle = from + (to - from) * k as f64 / steps as f64;
            let r = radius * angle.cos();
            [if r < 1e-9 * radius { 0.0 } else { r }, z + radius * angle.sin()]
        })
        .collect()
}
