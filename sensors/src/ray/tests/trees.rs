//! Trees find what brute force finds.

use super::Dice;
use super::brute_force::{nearest, nearest_watertight, soup};
use crate::lanes::levels;
use crate::ray::Ray;
use crate::ray::bvh::{Builder, Bvh, Stack};
use crate::ray::shape::RayShape;
use crate::ray::shape::mesh::{Mesh, MeshBuilder, MeshTree};
use crate::ray::triangle::{Triangle, normal};
use scene::mesh::TriMesh;
use scene::{RenderMesh, Shape};
use std::sync::Arc;

fn tree(triangles: &[Triangle]) -> Mesh {
    Mesh::of_tree(Arc::new(MeshTree::of_triangles(triangles)))
}

fn distance(mesh: &Mesh, ray: &Ray, limit: f64) -> Option<f64> {
    mesh.touch(ray, limit, &mut Stack::default()).map(|t| t.t)
}

/// Equals brute force on every ray, to the bit.
#[test]
fn brute_force() {
    for (seed, count, at) in [(1, 1, 0.0), (2, 7, 0.0), (3, 300, 0.0), (4, 2000, 0.0), (5, 500, 1000.0), (6, 500, -3e4)]
    {
        let mut dice = Dice(seed);
        let triangles = soup(&mut dice, count, [at; 3]);
        let mesh = tree(&triangles);
        let (mut hits, mut worst) = (0, 0.0f64);
        for k in 0..3000 {
            let mut ray = dice.ray(if k % 3 == 0 { 20.0 } else { 1.5 }, 1.0);
            if k % 5 == 0 {
                // Along an axis, where two of three sides of a box are parallel to the ray.
                ray.direction = [0, 1, 2].map(|a| if a == k % 3 { if k % 2 == 0 { 1.0 } else { -1.0 } } else { 0.0 });
            }
            ray.origin = ray.origin.map(|x| x + at);
            let ours = distance(&mesh, &ray, f64::INFINITY);
            assert_eq!(ours, nearest_watertight(&ray, &triangles), "seed {seed}, ray {k}");
            if let (Some(t), Some(u)) = (ours, nearest(&ray, &triangles, 0.0)) {
                hits += 1;
                worst = worst.max((t - u).abs());
            }
        }
        assert!(hits > 0 || count < 8);
        // Coordinates of 3e4 m have 7e-12 m between doubles, slivers magnify that.
        assert!(worst < 1e-7 * (1.0 + at.abs() / 10.0), "{worst:e}");
    }
}

/// The control: a tree without one of its triangles is found out.
#[test]
fn lost_triangle() {
    let mut dice = Dice(7);
    let triangles = soup(&mut dice, 50, [0.0; 3]);
    let mesh = tree(&triangles[1..]);
    let [a, b, c] = triangles[0].map(|p| p.map(f64::from));
    let middle = [0, 1, 2].map(|k| (a[k] + b[k] + c[k]) / 3.0);
    let n = normal(&triangles[0]).unwrap();
    let ray = Ray { origin: crate::ray::vector::along(middle, 1e-4, n), direction: n.map(|x| -x) };
    assert!(nearest_watertight(&ray, &triangles).is_some_and(|t| (t - 1e-4).abs() < 1e-6));
    assert_ne!(distance(&mesh, &ray, f64::INFINITY), nearest_watertight(&ray, &triangles));
}

#[test]
fn limits() {
    let square = [[[-1., -1., 0.], [1., -1., 0.], [1., 1., 0.]], [[-1., -1., 0.], [1., 1., 0.], [-1., 1., 0.]]];
    let mesh = tree(&square);
    let ray = Ray { origin: [0.25, 0.25, 20.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&mesh, &ray, 20.0), Some(20.0), "on the edge between the two");
    assert_eq!(distance(&mesh, &ray, 20.0f64.next_down()), None);
    let below = Ray { origin: [0.5, 0.25, -3.0], direction: [0.0, 0.0, 1.0] };
    assert_eq!(distance(&mesh, &below, 100.0), Some(3.0), "from behind too");
}

#[test]
fn degenerate() {
    let nothing = tree(&[]);
    let ray = Ray { origin: [0.0, 0.0, 1.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&nothing, &ray, 10.0), None);
    assert_eq!(nothing.bounds(), Some([[0.0; 3]; 2]));
    // Triangles without an area are left out; the others are hit.
    let flat = [[0u32, 0, 1], [0, 1, 1], [0, 1, 2]];
    let mesh = TriMesh::from_triangles(vec![[-1., -1., 0.], [1., -1., 0.], [0., 2., 0.]], flat.to_vec());
    let built = Mesh::of_tree(Arc::new(MeshBuilder::default().build(&RenderMesh::new(&mesh, 0.5))));
    assert_eq!(distance(&built, &ray, 10.0), Some(1.0));
    // All at one place: no plane can cut them.
    let same = vec![[[0.0f32, 0., 0.], [1., 0., 0.], [0., 1., 0.]]; 1000];
    let ray = Ray { origin: [0.2, 0.2, 1.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&tree(&same), &ray, 10.0), Some(1.0));
    // Sizes over forty orders of magnitude: the tree gets deep, not endless.
    let nested: Vec<Triangle> = (0..2000)
        .map(|k| 10f32.powf(k as f32 / 50.0 - 20.0))
        .map(|s| [[s, 0.0, s], [2.0 * s, 0.0, s], [s, s, s]])
        .collect();
    let ray = Ray { origin: [1.2, 0.1, 30.0], direction: [0.0, 0.0, -1.0] };
    assert_eq!(distance(&tree(&nested), &ray, 100.0), nearest_watertight(&ray, &nested));
}

/// The same boxes give the same tree, after other builds and with every instruction set; also where sizes leave the range.
#[test]
fn same_tree() {
    let boxes = |count, scale: f32| -> Vec<_> {
        soup(&mut Dice(9), count, [0.0; 3])
            .iter()
            .map(|t| t.map(|p| p.map(|x| x * scale)))
            .map(|t| [[0, 1, 2].map(|k| t[0][k].min(t[1][k])), [0, 1, 2].map(|k| t[0][k].max(t[1][k]))])
            .collect()
    };
    let all: Vec<Vec<_>> =
        [(500, 1.0), (3, 1.0), (0, 1.0), (3000, 1e-20), (700, 1e37)].map(|(n, s)| boxes(n, s)).into();
    for (known, boxes) in all.iter().enumerate() {
        let (tree, mut order) = Bvh::build(boxes.iter().copied());
        for level in levels() {
            let mut builder = Builder::new(level);
            for before in &all[..known] {
                builder.build(before.iter().copied());
            }
            let again = builder.build(boxes.iter().copied());
            assert_eq!(format!("{:?}", (&tree, &order)), format!("{again:?}"), "{level:?}");
        }
        order.sort_unstable();
        assert!(order.into_iter().eq(0..boxes.len() as u32), "everything once");
    }
}

/// A mesh of a shape is hit where the shape is, up to the flatness of its triangles.
#[test]
fn tessellated_ball() {
    let ball = Shape::from(scene::shape::Sphere { radius: 0.5 }).tessellate(256);
    let mesh = Mesh::of_tree(Arc::new(MeshBuilder::default().build(&RenderMesh::new(&ball, RenderMesh::CREASE))));
    // The sagitta of 1/256 of a turn.
    let flat = 0.5 * (1.0 - (std::f64::consts::PI / 256.0).cos()) * 2.0;
    for k in 0..100 {
        let x = f64::from(k) / 101.0 * 0.4;
        let ray = Ray { origin: [x, 0.1, 20.0], direction: [0.0, 0.0, -1.0] };
        let exact = 20.0 - (0.25 - x * x - 0.01f64).sqrt();
        let t = distance(&mesh, &ray, f64::INFINITY).unwrap();
        assert!(t - exact < 3.0 * flat && t > exact - 1e-6, "{t} {exact}");
    }
}
