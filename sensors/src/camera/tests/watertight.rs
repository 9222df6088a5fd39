//! Triangles that share an edge: no pixel twice, none left out.

use super::super::{Channels, Frame, RasterCfg, Rasterizer};
use super::scenes::Random;
use crate::visibility::View;
use scene::mesh::TriMesh;
use scene::shape::Mesh;
use scene::{Instance, Material, PoseF32, RenderMesh, RenderScene};
use std::sync::Arc;

/// A crumpled grid of triangles over a square of `half` \[m\], at height 0.
fn grid(cells: usize, half: f32, random: &mut Random) -> TriMesh {
    let step = 2.0 * half / cells as f32;
    let mut positions = Vec::new();
    for r in 0..=cells {
        for c in 0..=cells {
            let inner = r % cells != 0 && c % cells != 0;
            let mut by = || if inner { random.within(-0.4, 0.4) as f32 * step } else { 0.0 };
            positions.push([c as f32 * step - half + by(), r as f32 * step - half + by(), 0.0]);
        }
    }
    let at = |r: usize, c: usize| (r * (cells + 1) + c) as u32;
    let cell = |k: usize| {
        let (r, c) = (k / cells, k % cells);
        [[at(r, c), at(r, c + 1), at(r + 1, c + 1)], [at(r, c), at(r + 1, c + 1), at(r + 1, c)]]
    };
    TriMesh::from_triangles(positions, (0..cells * cells).flat_map(cell).collect())
}

#[test]
fn every_pixel_of_a_crumpled_grid_is_drawn_by_exactly_one_triangle() {
    let mut random = Random(3);
    // The last cameras are so low that triangles leave the guard band and reach behind the camera.
    let eyes = [([0., 0., 2.5], 1.0), ([0.3, 0.2, 0.8], 0.4), ([0.02, 0.01, 0.003], 1.0), ([0.1, -0.1, 0.0004], 30.0)];
    for (k, (eye, half)) in eyes.into_iter().enumerate() {
        let mesh = grid(7, half, &mut random);
        let mut view = View::look_at([120, 90], 1.0, eye, [0.05, 0.02, -0.1], [0., 1., 0.]).unwrap();
        (view.near, view.far) = (1e-5, 1000.0);
        let mut rasterizer = Rasterizer::new(RasterCfg { samples: 1, ..RasterCfg::default() });
        let mut draw = |triangles: Vec<[u32; 3]>| {
            let mesh = TriMesh::from_triangles(mesh.positions.clone(), triangles);
            let mesh = Arc::new(RenderMesh::new(&mesh, RenderMesh::CREASE));
            let scene = RenderScene::new(vec![Instance::new(Mesh { mesh }, Material::default(), 1)]).unwrap();
            let mut frame = Frame::new(120, 90, Channels { mask: true, ..Channels::default() });
            rasterizer.render(&scene, &[PoseF32::IDENTITY], &view, &mut frame).unwrap();
            frame.mask.unwrap()
        };
        let whole = draw(mesh.triangles.clone());
        let mut count = vec![0; whole.len()];
        for t in &mesh.triangles {
            draw(vec![*t]).iter().zip(&mut count).for_each(|(hit, count)| *count += hit);
        }
        assert_eq!(count, whole, "camera {k}");
        let hits = whole.iter().sum::<i32>();
        assert!(hits > 2000, "camera {k} sees the grid: {hits}");
        if k == 1 {
            // The border of the grid is straight, so inside of it nothing may be missing.
            let (first, last) =
                (whole.iter().position(|&m| m == 1).unwrap(), whole.iter().rposition(|&m| m == 1).unwrap());
            for row in first / 120 + 1..last / 120 {
                let line = &whole[row * 120..(row + 1) * 120];
                let (a, b) = (line.iter().position(|&m| m == 1), line.iter().rposition(|&m| m == 1));
                assert!(line[a.unwrap()..=b.unwrap()].iter().all(|&m| m == 1), "row {row}");
            }
        }
    }
}
