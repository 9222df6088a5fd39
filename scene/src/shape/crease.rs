//! Normals per corner: smooth over flat angles, sharp over creases.

use crate::mesh::TriMesh;
use std::collections::HashMap;

pub(super) fn sub(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(super) fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(super) fn cross(a: [f32; 3], b: [f32; 3]) -> [f32; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub(super) fn unit(a: [f32; 3]) -> Option<[f32; 3]> {
    let length = dot(a, a).sqrt();
    (length > 0.0 && length.is_finite()).then(|| a.map(|x| x / length))
}

/// For every vertex the first vertex at the same place.
pub(super) fn weld(positions: &[[f32; 3]]) -> Vec<u32> {
    let mut first = HashMap::with_capacity(positions.len());
    let key = |p: &[f32; 3]| p.map(|x| (x + 0.0).to_bits());
    positions.iter().enumerate().map(|(i, p)| *first.entry(key(p)).or_insert(i as u32)).collect()
}

/// Unit normals of the triangles; zero where a triangle has no area.
pub(super) fn face_normals(mesh: &TriMesh) -> Vec<[f32; 3]> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
        unit(cross(sub(b, a), sub(c, a))).unwrap_or_default()
    };
    mesh.triangles.iter().map(normal).collect()
}

/// The interior angle of a triangle at each corner \[rad\].
fn angles(mesh: &TriMesh, t: &[u32; 3]) -> [f32; 3] {
    let p = t.map(|i| mesh.positions[i as usize]);
    [0, 1, 2].map(|k| {
        let (a, b) = (unit(sub(p[(k + 1) % 3], p[k])), unit(sub(p[(k + 2) % 3], p[k])));
        a.zip(b).map_or(0.0, |(a, b)| dot(a, b).clamp(-1.0, 1.0).acos())
    })
}

/// Normals of the three corners of every triangle: the mean, weighted by angle, over the triangles around the corner that
/// are within `crease` \[rad\] of this one. `welded` has for each vertex the first one at the same place.
pub(super) fn corner_normals(mesh: &TriMesh, welded: &[u32], crease: f32) -> Vec<[[f32; 3]; 3]> {
    let faces = face_normals(mesh);
    if let Some(normals) = &mesh.normals {
        let of = |(t, face): (&[u32; 3], &[f32; 3])| t.map(|i| unit(normals[i as usize]).unwrap_or(*face));
        return mesh.triangles.iter().zip(&faces).map(of).collect();
    }
    let weights: Vec<_> = mesh.triangles.iter().map(|t| angles(mesh, t)).collect();
    // Corners around each vertex, in one array: `corners[start[v]..start[v + 1]]`.
    let mut start = vec![0u32; mesh.positions.len() + 1];
    for t in &mesh.triangles {
        t.iter().for_each(|&i| start[welded[i as usize] as usize + 1] += 1);
    }
    for v in 1..start.len() {
        start[v] += start[v - 1];
    }
    let mut fill = start.clone();
    let mut corners = vec![(0u32, 0u8); mesh.triangles.len() * 3];
    for (k, t) in mesh.triangles.iter().enumerate() {
        for (c, &i) in t.iter().enumerate() {
            let slot = &mut fill[welded[i as usize] as usize];
            corners[*slot as usize] = (k as u32, c as u8);
            *slot += 1;
        }
    }
    let limit = crease.cos();
    let of = |(k, t): (usize, &[u32; 3])| {
        t.map(|i| {
            let v = welded[i as usize] as usize;
            let around = &corners[start[v] as usize..start[v + 1] as usize];
            let mut sum = [0.0f32; 3];
            for &(other, c) in around {
                let n = faces[other as usize];
                if dot(n, faces[k]) >= limit {
                    let w = weights[other as usize][c as usize];
                    sum = [0, 1, 2].map(|a| sum[a] + w * n[a]);
                }
            }
            unit(sum).unwrap_or(faces[k])
        })
    };
    mesh.triangles.iter().enumerate().map(of).collect()
}
