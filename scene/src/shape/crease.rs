//! Normals per corner: smooth across small angles, sharp across creases.

use crate::mesh::TriMesh;
use crate::vector::{cross, dot, sub, try_normalize};
use std::collections::HashMap;

pub(super) fn unit(a: [f32; 3]) -> Option<[f32; 3]> {
    try_normalize(a, 0.0)
}

/// For every vertex, the first vertex at the same position.
pub(super) fn weld(positions: &[[f32; 3]]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(positions.len());
    let key = |p: &[f32; 3]| p.map(|x| (x + 0.0).to_bits());
    positions.iter().enumerate().map(|(i, p)| *first.entry(key(p)).or_insert(i as u32)).collect()
}

/// Unit normals of the triangles; zero for a triangle without an area.
pub(super) fn face_normals(mesh: &TriMesh) -> Vec<[f32; 3]> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        unit(cross(sub(b, a), sub(c, a))).unwrap_or_default()
    };
    mesh.triangles.iter().map(normal).collect()
}

/// Interior angles of a triangle at its corners \[rad\].
pub(super) fn angles(mesh: &TriMesh, t: &[u32; 3]) -> [f32; 3] {
    let p = t.map(|i| mesh.positions[i as usize]);
    let edges = [0, 1, 2].map(|k| unit(sub(p[(k + 1) % 3], p[k])));
    // The other edge of a corner points toward it.
    [0, 1, 2].map(|k| edges[k].zip(edges[(k + 2) % 3]).map_or(0.0, |(a, b)| (-dot(a, b)).clamp(-1.0, 1.0).acos()))
}

/// Normals of the three corners of every triangle; those of the mesh, if it has any.
///
/// Otherwise, a corner normal is the mean, weighted by angle, of the triangles around the corner that are within
/// `crease` \[rad\] of this triangle. `welded` has for each vertex the first vertex at the same position, `faces` the
/// unit normal of each triangle ([`face_normals`]).
pub(super) fn corner_normals(mesh: &TriMesh, welded: &[u32], faces: &[[f32; 3]], crease: f32) -> Vec<[[f32; 3]; 3]> {
    if let Some(normals) = &mesh.normals {
        let of = |(t, face): (&[u32; 3], &[f32; 3])| t.map(|i| unit(normals[i as usize]).unwrap_or(*face));
        return mesh.triangles.iter().zip(faces).map(of).collect();
    }
    let weights: Vec<_> = mesh.triangles.iter().map(|t| angles(mesh, t)).collect();
    let weights = weights.as_flattened();
    let Corners { start, corners } = Corners::new(mesh, welded);
    let limit = crease.cos();
    let mean = |around: &[u32], face: Option<[f32; 3]>| {
        let mut sum = [0.0f32; 3];
        for &corner in around {
            let n = faces[corner as usize / 3];
            if face.is_none_or(|face| dot(n, face) >= limit) {
                let w = weights[corner as usize];
                sum = [0, 1, 2].map(|a| sum[a] + w * n[a]);
            }
        }
        unit(sum)
    };
    let mut normals = vec![[[0.0f32; 3]; 3]; mesh.triangles.len()];
    let flat = normals.as_flattened_mut();
    for v in 1..start.len() {
        let around = &corners[start[v - 1] as usize..start[v] as usize];
        // Without a crease, one sum in the same order is valid for every corner here.
        let smooth = smooth(around, faces, limit).then(|| mean(around, None)).flatten();
        for &corner in around {
            let face = faces[corner as usize / 3];
            let normal = smooth.or_else(|| mean(around, Some(face)));
            flat[corner as usize] = normal.unwrap_or(face);
        }
    }
    normals
}

/// True if every two triangles around a vertex are within the crease angle, whose cosine is `limit`.
fn smooth(around: &[u32], faces: &[[f32; 3]], limit: f32) -> bool {
    around.iter().enumerate().all(|(i, &corner)| {
        let face = faces[corner as usize / 3];
        around[..=i].iter().all(|&other| dot(faces[other as usize / 3], face) >= limit)
    })
}

/// Corners of triangles at each vertex `v`: `corners[start[v]..start[v + 1]]`. Corner c of triangle k has the number
/// `3 * k + c`.
struct Corners {
    start: Vec<u32>,
    corners: Vec<u32>,
}

impl Corners {
    fn new(mesh: &TriMesh, welded: &[u32]) -> Self {
        let mut start = vec![0u32; mesh.positions.len() + 1];
        for t in &mesh.triangles {
            t.iter().for_each(|&i| start[welded[i as usize] as usize + 1] += 1);
        }
        for v in 1..start.len() {
            start[v] += start[v - 1];
        }
        let mut fill = start.clone();
        let mut corners = vec![0u32; mesh.triangles.len() * 3];
        for (corner, &i) in (0..).zip(mesh.triangles.as_flattened()) {
            let slot = &mut fill[welded[i as usize] as usize];
            corners[*slot as usize] = corner;
            *slot += 1;
        }
        Self { start, corners }
    }
}
