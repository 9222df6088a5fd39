//! The rasterizer compared at every pixel with rays in double precision: textbook formulas for shapes, Möller-Trumbore
//! for triangles; and watertight edges.

use super::harness::{TestFrame, look_at_view};
use crate::frame::Channels;
use crate::request::RasterCfg;
use crate::visibility::View;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::Mesh;
use kinetoscope_scene::shape::{RenderMesh, Shape};
use kinetoscope_scene::{Material, PoseF32, RenderScene};
use kinetoscope_testkit::scenes::{TestRng, every_shape, instances, random_scene};
use nalgebra::{Matrix3, Vector3};
use std::cell::Cell;
use std::f64::consts::FRAC_PI_8;
use std::sync::Arc;

type V = Vector3<f64>;

/// A hit: depth, normal facing the camera (world), instance.
#[derive(Clone, Copy, Debug)]
struct Hit {
    t: f64,
    normal: V,
    instance: usize,
}

struct Caster<'a> {
    scene: &'a RenderScene,
    poses: Vec<(Matrix3<f64>, V)>,
    meshes: Vec<Option<Vec<Block>>>,
    view: View,
}

impl<'a> Caster<'a> {
    fn new(TestFrame { scene, poses, view, .. }: &'a TestFrame) -> Self {
        let wide = |p: &PoseF32| {
            let r = p.rotation.map(|r| r.map(f64::from));
            let rows = Matrix3::from_row_slice(&[r[0], r[1], r[2]].concat());
            (rows, V::from(p.translation.map(f64::from)))
        };
        let mesh = |s: &Shape| matches!(s, Shape::Mesh(_) | Shape::HeightField(_)).then(|| blocks(&s.tessellate(0)));
        let meshes = scene.instances().iter().map(|i| mesh(&i.shape)).collect();
        Self { scene, poses: poses.iter().map(wide).collect(), meshes, view: *view }
    }

    /// The nearest hit of the ray through a point of the image.
    fn cast(&self, u: f64, v: f64) -> Option<Hit> {
        let w = &self.view;
        let c = V::new((u - f64::from(w.cx)) / f64::from(w.fx), (v - f64::from(w.cy)) / f64::from(w.fy), 1.0);
        let r = w.world_from_camera.rotation.map(|r| V::from(r.map(f64::from)));
        let d = V::new(r[0].dot(&c), r[1].dot(&c), r[2].dot(&c));
        let o = V::from(w.world_from_camera.translation.map(f64::from));
        let (near, far) = (f64::from(w.near), f64::from(w.far));
        let best: Cell<Option<Hit>> = Cell::new(None);
        for (k, instance) in self.scene.instances().iter().enumerate() {
            let (rotation, translation) = &self.poses[k];
            let (lo, ld) = (rotation.tr_mul(&(o - translation)), rotation.tr_mul(&d));
            let mut offer = |t: f64, n: V| {
                if t >= near && t <= far && best.get().is_none_or(|b| t < b.t) {
                    let n = rotation * n.normalize();
                    let normal = if n.dot(&d) > 0.0 { -n } else { n };
                    best.set(Some(Hit { t, normal, instance: k }));
                }
            };
            let Some(blocks) = &self.meshes[k] else {
                shape(&instance.shape, lo, ld, &mut offer);
                continue;
            };
            for block in blocks {
                if block.enters(lo, ld) <= best.get().map_or(far, |b| b.t) {
                    block.triangles(lo, ld, &mut offer);
                }
            }
        }
        best.get()
    }
}

/// Both solutions of a t² + 2 b t + c = 0, NaN without a real solution.
fn quadratic(a: f64, b: f64, c: f64) -> [f64; 2] {
    let root = (b * b - a * c).sqrt();
    if a == 0.0 { [f64::NAN; 2] } else { [(-b - root) / a, (-b + root) / a] }
}

fn shape(shape: &Shape, o: V, d: V, offer: &mut dyn FnMut(f64, V)) {
    match shape {
        Shape::Plane(plane) => {
            let t = -o.z / d.z;
            let p = o + d * t;
            let within = |x: f64, h: f32| h == 0.0 || x.abs() <= f64::from(h);
            if d.z < 0.0 && within(p.x, plane.half[0]) && within(p.y, plane.half[1]) {
                offer(t, V::z());
            }
        }
        Shape::Sphere(s) => ball(o, d, f64::from(s.radius), &mut |t, p| offer(t, p)),
        Shape::Ellipsoid(e) => {
            let r = V::from(e.radii.map(f64::from));
            let by = |v: V| v.component_div(&r);
            ball(by(o), by(d), 1.0, &mut |t, p| offer(t, by(p)));
        }
        Shape::Capsule(c) => {
            let (r, h) = (f64::from(c.radius), f64::from(c.half_length));
            side(o, d, r, h, offer);
            for end in [h, -h] {
                let middle = V::new(0., 0., end);
                ball(o - middle, d, r, &mut |t, p| {
                    if p.z * end.signum() >= 0.0 {
                        offer(t, p);
                    }
                });
            }
        }
        Shape::Cylinder(c) => {
            let (r, h) = (f64::from(c.radius), f64::from(c.half_length));
            side(o, d, r, h, offer);
            for end in [h, -h] {
                let t = (end - o.z) / d.z;
                let p = o + d * t;
                if p.x.hypot(p.y) <= r {
                    offer(t, V::z());
                }
            }
        }
        Shape::Box(b) => {
            for axis in 0..3 {
                for sign in [-1.0, 1.0] {
                    let t = (sign * f64::from(b.half[axis]) - o[axis]) / d[axis];
                    let p = o + d * t;
                    if (0..3).all(|k| k == axis || p[k].abs() <= f64::from(b.half[k])) {
                        offer(t, V::ith(axis, 1.0));
                    }
                }
            }
        }
        other => panic!("{} has no closed form", other.name()),
    }
}

fn ball(o: V, d: V, r: f64, offer: &mut dyn FnMut(f64, V)) {
    for t in quadratic(d.dot(&d), o.dot(&d), o.dot(&o) - r * r) {
        offer(t, o + d * t);
    }
}

fn side(o: V, d: V, r: f64, h: f64, offer: &mut dyn FnMut(f64, V)) {
    for t in quadratic(d.x * d.x + d.y * d.y, o.x * d.x + o.y * d.y, o.x * o.x + o.y * o.y - r * r) {
        let p = o + d * t;
        if p.z.abs() <= h {
            offer(t, V::new(p.x, p.y, 0.0));
        }
    }
}

/// Several triangles of a mesh: a corner and the edges from it, and their bounding box.
struct Block {
    low: V,
    high: V,
    triangles: Vec<[V; 3]>,
}

/// The triangles of a mesh, in order.
fn blocks(mesh: &TriMesh) -> Vec<Block> {
    let block = |triangles: &[[u32; 3]]| {
        let corner = |i: u32| V::from(mesh.positions[i as usize].map(f64::from));
        let corners = triangles.as_flattened().iter().map(|&i| corner(i));
        let (low, high) =
            (corners.clone().reduce(|a, b| a.inf(&b)).unwrap(), corners.reduce(|a, b| a.sup(&b)).unwrap());
        // Enlarged by more than the rounding of a hit, 1e-16 of the coordinates.
        let wider = V::repeat(1e-9 * (low.amax() + high.amax()));
        let edges = |t: &[u32; 3]| {
            let [a, b, c] = t.map(corner);
            [a, b - a, c - a]
        };
        Block { low: low - wider, high: high + wider, triangles: triangles.iter().map(edges).collect() }
    };
    mesh.triangles.chunks(16).map(block).collect()
}

impl Block {
    /// Distance at which a ray enters the box, infinity if it misses the box. All triangles are farther.
    fn enters(&self, o: V, d: V) -> f64 {
        let (mut from, mut to) = (0.0f64, f64::INFINITY);
        for k in 0..3 {
            let (a, b) = ((self.low[k] - o[k]) / d[k], (self.high[k] - o[k]) / d[k]);
            (from, to) = (from.max(a.min(b)), to.min(a.max(b)));
        }
        if from <= to { from } else { f64::INFINITY }
    }

    /// Intersects all triangles. Source: Möller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
    fn triangles(&self, o: V, d: V, offer: &mut dyn FnMut(f64, V)) {
        for [a, ab, ac] in &self.triangles {
            let p = d.cross(ac);
            let det = ab.dot(&p);
            let s = (o - a) / det;
            let (u, q) = (s.dot(&p), s.cross(ab));
            let v = d.dot(&q);
            if det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
                offer(ac.dot(&q), ab.cross(ac));
            }
        }
    }
}

/// Compares an image with the caster at all pixels off silhouettes; at a silhouette, a neighbor shows another instance
/// or is more than a tenth nearer or farther. Returns the number of compared pixels.
fn compare(scene: (RenderScene, Vec<PoseF32>), view: View, name: &str) -> usize {
    let still = TestFrame { channels: Channels { color: false, ..Channels::ALL }, ..TestFrame::new(scene, view) };
    let (image, caster, w) = (still.draw(), Caster::new(&still), view.width);
    let at = |k: usize, [dx, dy]: [f64; 2]| caster.cast((k % w) as f64 + 0.5 + dx, (k / w) as f64 + 0.5 + dy);
    let hits: Vec<Option<Hit>> = (0..w * view.height).map(|k| at(k, [0.0; 2])).collect();
    let same = |a: Option<Hit>, b: Option<Hit>| match (a, b) {
        (None, None) => true,
        (Some(a), Some(b)) => a.instance == b.instance && (a.t - b.t).abs() < 0.1 * a.t,
        _ => false,
    };
    let mut compared = 0;
    for k in image.inner().filter(|&k| image.neighbors(k).all(|n| same(hits[k], hits[n]))) {
        compared += 1;
        let place = format!("{name} at ({}, {})", k % w, k / w);
        let (mask, depth, distance) = (image.mask()[k], image.depth()[k], image.distance()[k]);
        let [normal, position, shading] =
            [image.normal(), image.position(), image.shading_normal()].map(|v| V::from(v[k].map(f64::from)));
        let Some(hit) = hits[k] else {
            assert_eq!((depth, distance, mask), (f32::INFINITY, f32::INFINITY, 0), "{place}");
            assert_eq!((normal, position, shading), (V::zeros(), V::zeros(), V::zeros()), "{place}");
            continue;
        };
        let agrees = |hit: Hit| {
            let close = (f64::from(depth) - hit.t).abs() <= 1e-4 * hit.t;
            let parallel = normal.dot(&hit.normal) >= 0.5f64.to_radians().cos();
            mask == still.scene.instances()[hit.instance].mask_id && close && parallel
        };
        // A pixel center within a hundredth of a pixel of an edge may belong to either side of it.
        let mut beside = (0..48).map(|n| {
            let (sin, cos) = (n as f64 * FRAC_PI_8).sin_cos();
            [cos, sin].map(|x| [0.001, 0.003, 0.01][n / 16] * x)
        });
        let fine = agrees(hit) || beside.any(|by| at(k, by).is_some_and(agrees));
        let kind = still.scene.instances()[hit.instance].shape.name();
        assert!(fine, "{place}, {kind}: {hit:?}, rendered {mask} {depth} {normal:?}");
        assert!((normal.norm() - 1.0).abs() < 1e-5, "{place}: unit normal");
        assert!((shading.norm() - 1.0).abs() < 1e-5, "{place}: unit shading normal");
        let from_eye = position - V::from(view.world_from_camera.translation.map(f64::from));
        assert!((from_eye.norm() - f64::from(distance)).abs() <= 2e-5 * (from_eye.norm() + 1.0), "{place}");
    }
    compared
}

#[test]
fn random_scenes() {
    let mut numbers = TestRng(7);
    let mut compared = 0;
    for seed in 0..40 {
        let r = &mut numbers;
        let scene = random_scene(r, 1.2);
        let camera = r.pose(if seed % 4 == 0 { 0.5 } else { 3.0 });
        let view = look_at_view([96, 72], 1.0, camera.translation, r.vector(-0.5, 0.5).map(|x| x as f32));
        let (near, far) = [(0.01, 100.0), (1e-4, 1e5), (1.0, 4.0), (0.3, 2.0)][seed % 4];
        let (fx, fy) = (r.within(40., 120.) as f32, r.within(40., 120.) as f32);
        let (cx, cy) = (r.within(20., 80.) as f32, r.within(10., 60.) as f32);
        compared += compare(scene, View { near, far, fx, fy, cx, cy, ..view }, &format!("scene {seed}"));
    }
    assert!(compared > 40 * 96 * 72 / 2, "{compared}");
}

#[test]
fn inner_sides() {
    for shape in every_shape().into_iter().filter(|shape| !matches!(shape, Shape::Plane(_))) {
        let scene = instances([(shape.clone(), Material::default(), PoseF32::IDENTITY)]);
        for target in [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0.2, 0.], [0.3, -1., 0.1], [0., 0.2, -1.]] {
            let name = format!("inside a {}, {target:?}", shape.name());
            let compared = compare(scene.clone(), look_at_view([64, 48], 1.5, [0.01, 0.02, 0.01], target), &name);
            assert!(compared > 1000, "{name}: {compared}");
        }
    }
}

/// A crumpled grid of triangles over a square of `half` \[m\], at height 0.
fn grid(cells: usize, half: f32, random: &mut TestRng) -> TriMesh {
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

/// Every pixel of a crumpled grid is covered by exactly one triangle.
#[test]
fn watertight_edges() {
    let mut random = TestRng(3);
    // The last cameras are so low that triangles leave the guard band and reach behind the camera.
    let eyes = [([0., 0., 2.5], 1.0), ([0.3, 0.2, 0.8], 0.4), ([0.02, 0.01, 0.003], 1.0), ([0.1, -0.1, 0.0004], 30.0)];
    for (k, (eye, half)) in eyes.into_iter().enumerate() {
        let mesh = grid(7, half, &mut random);
        let view = View::look_at([120, 90], 1.0, eye, [0.05, 0.02, -0.1], [0., 1., 0.]).unwrap();
        let draw = |triangles: Vec<[u32; 3]>| {
            let mesh = TriMesh::from_triangles(mesh.positions.clone(), triangles);
            let mesh = Arc::new(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE));
            let scene = instances([(Mesh { mesh }, Material::default(), PoseF32::IDENTITY)]);
            let cfg = RasterCfg { samples: 1, ..RasterCfg::default() };
            let channels = Channels { mask: true, ..Channels::default() };
            let still = TestFrame { cfg, channels, ..TestFrame::new(scene, View { near: 1e-5, far: 1000.0, ..view }) };
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
            // The border of the grid is straight, so no pixel inside of it may be missing.
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
