//! Triangles that share an edge.

use super::super::{Channels, RasterCfg};
use super::harness::{Still, things};
use super::scenes::Random;
use crate::visibility::View;
use scene::mesh::TriMesh;
use scene::shape::Mesh;
use scene::{Material, PoseF32, RenderMesh};
use std::sync::Arc;

/// A crumpled grid of triangles over a square of `half` \[m\], at height 0.
fn grid(cells: usize, half: f32, random: &mut Random) -> TriMesh {
    let step = 2.0 * half / cells as f32;
    let mut positions = Vec::new();
    for (r, c) in (0..=cells).flat_map(|r| (0..=cells).map(move |c| (r, c))) {
        let inner = r % cells != 0 && c % cells != 0;
        let mut by = || if inner { random.within(-0.4, 0.4) as f32 * step } else { 0.0 };
        positions.push([c as f32 * step - half + by(), r as f32 * step - half + by(), 0.0]);
    }
    let at = |r: usize, c: usize| (r * (cells + 1) + c) as u32;
    let cell = |k: usize| {
        let (r, c) = (k / cells, k % cells);
        [[at(r, c), at(r, c + 1), at(r + 1, c + 1)], [at(r, c), at(r + 1, c + 1), at(r + 1, c)]]
    };
    TriMesh::from_triangles(positions, (0..cells * cells).flat_map(cell).collect())
}

/// Every pixel of a crumpled grid is drawn by exactly one triangle.
#[test]
fn watertight_edges() {
    let mut random = Random(3);
    // The last cameras are so low that triangles leave the guard band and reach behind the camera.
    let eyes = [([0., 0., 2.5], 1.0), ([0.3, 0.2, 0.8], 0.4), ([0.02, 0.01, 0.003], 1.0), ([0.1, -0.1, 0.0004], 30.0)];
    for (k, (eye, half)) in eyes.into_iter().enumerate() {
        let mesh = grid(7, half, &mut random);
        let view = View::look_at([120, 90], 1.0, eye, [0.05, 0.02, -0.1], [0., 1., 0.]).unwrap();
        let draw = |triangles: Vec<[u32; 3]>| {
            let mesh = TriMesh::from_triangles(mesh.positions.clone(), triangles);
            let mesh = Arc::new(RenderMesh::new(&mesh, RenderMesh::CREASE));
            let scene = things([(Mesh { mesh }, Material::default(), PoseF32::IDENTITY)]);
            let cfg = RasterCfg { samples: 1, ..RasterCfg::default() };
            let channels = Channels { mask: true, ..Channels::default() };
            let still = Still { cfg, channels, ..Still::new(scene, View { near: 1e-5, far: 1000.0, ..view }) };
            still.draw().mask().to_vec()
        };
        let whole = draw(mesh.triangles.clone());
        let mut count = vec![0; whole.len()];
        for t in &mesh.triangles {
            draw(vec![*t]).iter().zip(&mut count).for_each(|(hit, count)| *count += hit);
        }
        assert_eq!(count, whole, "camera {k}");
        assert!(whole.iter().sum::<i32>() > 2000, "camera {k} sees the grid");
        if k == 1 {
            // The border of the grid is straight, so inside of it nothing may be missing.
            let ends =
                |line: &[i32]| line.iter().position(|&m| m == 1).zip(line.iter().rposition(|&m| m == 1)).unwrap();
            let (first, last) = ends(&whole);
            for line in whole.chunks(120).take(last / 120).skip(first / 120 + 1) {
                let (a, b) = ends(line);
                assert!(line[a..=b].iter().all(|&m| m == 1), "{line:?}");
            }
        }
    }
}
