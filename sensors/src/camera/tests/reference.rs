//! Every pixel against rays in double precision: textbook formulas for shapes, Möller-Trumbore for triangles.

use super::super::{Channels, Frame, RasterCfg, Rasterizer};
use super::scenes::{Random, random};
use crate::visibility::View;
use nalgebra::{Matrix3, Vector3};
use scene::mesh::TriMesh;
use scene::{PoseF32, RenderScene, Shape};

type V = Vector3<f64>;

/// A hit: depth, normal turned to the camera (world), instance.
#[derive(Clone, Copy, Debug)]
struct Hit {
    t: f64,
    normal: V,
    instance: usize,
}

pub(super) struct Caster<'a> {
    scene: &'a RenderScene,
    poses: Vec<(Matrix3<f64>, V)>,
    meshes: Vec<Option<TriMesh>>,
    view: View,
}

impl<'a> Caster<'a> {
    pub(super) fn new(scene: &'a RenderScene, poses: &[PoseF32], view: &View) -> Self {
        let wide = |p: &PoseF32| {
            let r = p.rotation.map(|r| r.map(f64::from));
            let rows = Matrix3::from_row_slice(&[r[0], r[1], r[2]].concat());
            (rows, V::from(p.translation.map(f64::from)))
        };
        let mesh = |s: &Shape| matches!(s, Shape::Mesh(_) | Shape::HeightField(_)).then(|| s.tessellate(0));
        let meshes = scene.instances().iter().map(|i| mesh(&i.shape)).collect();
        Self { scene, poses: poses.iter().map(wide).collect(), meshes, view: *view }
    }

    /// What the ray through a point of the picture meets.
    fn cast(&self, u: f64, v: f64) -> Option<Hit> {
        let w = &self.view;
        let c = V::new((u - f64::from(w.cx)) / f64::from(w.fx), (v - f64::from(w.cy)) / f64::from(w.fy), 1.0);
        let r = w.world_from_camera.rotation.map(|r| V::from(r.map(f64::from)));
        let d = V::new(r[0].dot(&c), r[1].dot(&c), r[2].dot(&c));
        let o = V::from(w.world_from_camera.translation.map(f64::from));
        let (near, far) = (f64::from(w.near), f64::from(w.far));
        let mut best: Option<Hit> = None;
        for (k, instance) in self.scene.instances().iter().enumerate() {
            let (rotation, translation) = &self.poses[k];
            let (lo, ld) = (rotation.tr_mul(&(o - translation)), rotation.tr_mul(&d));
            let mut offer = |t: f64, n: V| {
                if t >= near && t <= far && best.is_none_or(|b| t < b.t) {
                    let n = rotation * n.normalize();
                    let normal = if n.dot(&d) > 0.0 { -n } else { n };
                    best = Some(Hit { t, normal, instance: k });
                }
            };
            match &self.meshes[k] {
                Some(mesh) => triangles(mesh, lo, ld, &mut offer),
                None => shape(&instance.shape, lo, ld, &mut offer),
            }
        }
        best
    }
}

/// All solutions of a t² + 2 b t + c = 0.
fn quadratic(a: f64, b: f64, c: f64) -> Vec<f64> {
    let d = b * b - a * c;
    if a == 0.0 || d < 0.0 { vec![] } else { vec![(-b - d.sqrt()) / a, (-b + d.sqrt()) / a] }
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

/// Source: Möller and Trumbore, Fast, minimum storage ray/triangle intersection, 1997.
fn triangles(mesh: &TriMesh, o: V, d: V, offer: &mut dyn FnMut(f64, V)) {
    for triangle in &mesh.triangles {
        let [a, b, c] = triangle.map(|i| V::from(mesh.positions[i as usize].map(f64::from)));
        let (ab, ac) = (b - a, c - a);
        let p = d.cross(&ac);
        let det = ab.dot(&p);
        let s = (o - a) / det;
        let (u, q) = (s.dot(&p), s.cross(&ab));
        let v = d.dot(&q);
        if det != 0.0 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 {
            offer(ac.dot(&q), ab.cross(&ac));
        }
    }
}

pub(super) const ALL_BUT_COLOR: Channels = Channels { color: false, ..Channels::ALL };

/// Compares a picture with the caster at all pixels that are on no silhouette: where some neighbour sees another thing or is
/// more than a tenth nearer or farther. Returns how many were compared.
pub(super) fn compare(scene: &RenderScene, poses: &[PoseF32], view: &View, name: &str) -> usize {
    let (w, h) = (view.width, view.height);
    let mut frame = Frame::new(w, h, ALL_BUT_COLOR);
    Rasterizer::new(RasterCfg::default()).render(scene, poses, view, &mut frame).unwrap();
    let caster = Caster::new(scene, poses, view);
    let hits: Vec<Option<Hit>> = (0..w * h).map(|k| caster.cast((k % w) as f64 + 0.5, (k / w) as f64 + 0.5)).collect();
    let (depth, mask) = (frame.depth.unwrap(), frame.mask.unwrap());
    let (normal, position) = (frame.normal.unwrap(), frame.position.unwrap());
    let (distance, shading) = (frame.distance.unwrap(), frame.shading_normal.unwrap());
    let mut compared = 0;
    for y in 1..h - 1 {
        for x in 1..w - 1 {
            let k = y * w + x;
            let neighbours = (0..9).map(|n| hits[(y + n / 3 - 1) * w + x + n % 3 - 1]);
            let same = |a: Option<Hit>, b: Option<Hit>| match (a, b) {
                (None, None) => true,
                (Some(a), Some(b)) => a.instance == b.instance && (a.t - b.t).abs() < 0.1 * a.t,
                _ => false,
            };
            if !neighbours.clone().all(|n| same(hits[k], n)) {
                continue;
            }
            compared += 1;
            let at = |v: &[f32]| V::new(v[3 * k].into(), v[3 * k + 1].into(), v[3 * k + 2].into());
            let place = format!("{name} at ({x}, {y})");
            let Some(hit) = hits[k] else {
                assert_eq!((depth[k], distance[k], mask[k]), (f32::INFINITY, f32::INFINITY, 0), "{place}");
                assert_eq!((at(&normal), at(&position), at(&shading)), (V::zeros(), V::zeros(), V::zeros()), "{place}");
                continue;
            };
            // A pixel centre within a hundredth of a pixel of an edge may belong to either side of it.
            let agrees = |hit: Hit| {
                let id = scene.instances()[hit.instance].mask_id;
                let close = (f64::from(depth[k]) - hit.t).abs() <= 1e-4 * hit.t;
                let angle = at(&normal).dot(&hit.normal);
                mask[k] == id && close && angle >= 0.5f64.to_radians().cos()
            };
            let around = (0..48).map(|k| {
                let (sin, cos) = (k as f64 * std::f64::consts::FRAC_PI_8).sin_cos();
                let radius = [0.001, 0.003, 0.01][k / 16];
                [radius * cos, radius * sin]
            });
            let nudged = |[dx, dy]: [f64; 2]| caster.cast(x as f64 + 0.5 + dx, y as f64 + 0.5 + dy);
            let fine = agrees(hit) || { around }.any(|by| nudged(by).is_some_and(agrees));
            let kind = scene.instances()[hit.instance].shape.name();
            assert!(fine, "{place}, {kind}: {hit:?}, drawn {} {} {:?}", mask[k], depth[k], at(&normal));
            assert!((at(&normal).norm() - 1.0).abs() < 1e-5, "{place}: unit normal");
            assert!((at(&shading).norm() - 1.0).abs() < 1e-5, "{place}: unit shading normal");
            let from_eye = at(&position) - V::from(view.world_from_camera.translation.map(f64::from));
            assert!((from_eye.norm() - f64::from(distance[k])).abs() <= 2e-5 * (from_eye.norm() + 1.0), "{place}");
        }
    }
    compared
}

#[test]
fn random_scenes_agree_with_rays() {
    let mut random_numbers = Random(7);
    let mut compared = 0;
    for seed in 0..40 {
        let r = &mut random_numbers;
        let (scene, poses) = random(r, 1.2);
        let camera = r.pose(if seed % 4 == 0 { 0.5 } else { 3.0 });
        let target = r.vector(-0.5, 0.5).map(|x| x as f32);
        let view = View::look_at([96, 72], 1.0, camera.translation, target, [0., 0., 1.]).unwrap();
        let (near, far) = [(0.01, 100.0), (1e-4, 1e5), (1.0, 4.0), (0.3, 2.0)][seed % 4];
        let (fx, fy) = (r.within(40., 120.) as f32, r.within(40., 120.) as f32);
        let (cx, cy) = (r.within(20., 80.) as f32, r.within(10., 60.) as f32);
        let view = View { near, far, fx, fy, cx, cy, ..view };
        compared += compare(&scene, &poses, &view, &format!("scene {seed}"));
    }
    println!("{compared} of {} pixels compared", 40 * 96 * 72);
    assert!(compared > 40 * 96 * 72 / 2, "{compared}");
}

#[test]
fn a_camera_inside_sees_the_inner_side() {
    for shape in super::scenes::every_shape() {
        if matches!(shape, Shape::Plane(_)) {
            continue;
        }
        let name = shape.name();
        let scene = RenderScene::new(vec![scene::Instance::new(shape, scene::Material::default(), 5)]).unwrap();
        for k in 0..6 {
            let direction =
                [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.], [-1., 0.2, 0.], [0.3, -1., 0.1], [0., 0.2, -1.]][k];
            let view = View::look_at([64, 48], 1.5, [0.01, 0.02, 0.01], direction, [0., 0., 1.]).unwrap();
            let compared = compare(&scene, &[PoseF32::IDENTITY], &view, &format!("inside a {name}, {k}"));
            assert!(compared > 1000, "{name}: {compared}");
        }
    }
}
