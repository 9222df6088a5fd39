//! Where in the picture a thing is, as if nothing else were there.

use kinetoscope_render::View;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{HullPart, Plane};
use kinetoscope_scene::{Instance, PoseF32};

/// Edges around a circle of what is cut by a side of the frustum and has no corners of its own: the polygon is inside of
/// the circle by 1 - cos(pi / 256) of its radius at most, 7.5e-5.
const SEGMENTS: usize = 256;

/// A thing in the camera's optical frame, double precision.
struct Seen {
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
}

impl Seen {
    fn point(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| self.translation[i] + (0..3).map(|j| self.rotation[i][j] * p[j]).sum::<f64>())
    }

    /// R diag(radii²) Rᵀ: n · M n is the square of how far an ellipsoid reaches along n.
    fn spread(&self, radii: [f64; 3]) -> [[f64; 3]; 3] {
        let r = &self.rotation;
        [0, 1, 2].map(|i| [0, 1, 2].map(|j| (0..3).map(|k| r[i][k] * r[j][k] * radii[k] * radii[k]).sum()))
    }
}

/// Smallest and largest x / z and y / z so far.
#[derive(Clone, Copy)]
struct Extent([[f64; 2]; 2]);

impl Extent {
    const NONE: Self = Self([[f64::INFINITY, f64::NEG_INFINITY]; 2]);

    fn add(&mut self, axis: usize, value: f64) {
        let [low, high] = &mut self.0[axis];
        (*low, *high) = (low.min(value), high.max(value));
    }

    fn point(&mut self, [x, y, z]: [f64; 3]) {
        self.add(0, x / z);
        self.add(1, y / z);
    }

    /// A ball stretched along axes, or a disc, wholly in front of the camera.
    ///
    /// A plane through the eye with the normal n touches it where (n · c)² = n · M n, c its centre. With n = (1, 0, -s), which
    /// is the plane x = s z, that is a quadratic equation in s, whose roots are the ends of what is seen.
    fn ellipsoid(&mut self, seen: &Seen, center: [f64; 3], radii: [f64; 3]) {
        let (c, m) = (seen.point(center), seen.spread(radii));
        for axis in 0..2 {
            let a = c[2] * c[2] - m[2][2];
            let b = c[axis] * c[2] - m[axis][2];
            let root = (b * b - a * (c[axis] * c[axis] - m[axis][axis])).max(0.0).sqrt();
            self.add(axis, (b - root) / a);
            self.add(axis, (b + root) / a);
        }
    }
}

/// Smallest and largest u, then v, of the picture \[pixels\] of what an instance has in the frustum: between the near and the
/// far plane and the four edges of the picture; `None` where that is nothing.
pub(super) fn outline(view: &View, instance: &Instance, world_from_instance: &PoseF32) -> Option<[[f64; 2]; 2]> {
    let pose = view.world_from_camera.inverse_times(world_from_instance);
    let seen =
        Seen { rotation: pose.rotation.map(|row| row.map(f64::from)), translation: pose.translation.map(f64::from) };
    let shape = &instance.shape;
    if shape.is_one_sided() && !is_before(&seen) {
        return None;
    }
    let (near, far) = (f64::from(view.near), f64::from(view.far));
    let [low, high] = shape.extent(seen.rotation[2]).map(|z| z + seen.translation[2]);
    if !(high >= near && low <= far) {
        return None;
    }
    let ([fx, fy], [cx, cy]) = ([view.fx, view.fy].map(f64::from), [view.cx, view.cy].map(f64::from));
    let size = [view.width as f64, view.height as f64];
    let pixels = |Extent([x, y]): Extent| [x.map(|x| fx * x + cx), y.map(|y| fy * y + cy)];
    let endless = shape.bounds().is_none();
    if low > near && high < far && !endless {
        let mut extent = Extent::NONE;
        // x / z has its extremes over a convex hull among those over its parts.
        shape.hull(&mut |part| match part {
            HullPart::Point(at) => extent.point(seen.point(at)),
            HullPart::Ellipsoid { center, radii } => extent.ellipsoid(&seen, center, radii),
        });
        let found = pixels(extent);
        let beside = |axis: usize| !(found[axis][0] < size[axis] && found[axis][1] > 0.0);
        if beside(0) || beside(1) {
            return None;
        }
        if (0..2).all(|axis| found[axis][0] >= 0.0 && found[axis][1] <= size[axis]) {
            return Some(found);
        }
    }
    // The extremes of what is left of a thing are not those of the thing.
    let mut cutter = Cutter { sides: sides(view), polygon: Vec::new(), rest: Vec::new(), extent: Extent::NONE };
    cutter.shape(shape, &seen, view);
    let [x, _] = cutter.extent.0;
    (x[0] <= x[1]).then(|| {
        // Rounding only: polygons end at the edges.
        let found = pixels(cutter.extent);
        [0, 1].map(|axis| found[axis].map(|x| x.clamp(0.0, size[axis])))
    })
}

/// The six sides of the frustum as [a, b, c, d]: a x + b y + c z + d is not negative on the inside, in the optical frame.
fn sides(view: &View) -> [[f64; 4]; 6] {
    let [fx, fy, cx, cy] = [view.fx, view.fy, view.cx, view.cy].map(f64::from);
    let (near, far) = (f64::from(view.near), f64::from(view.far));
    [
        [0.0, 0.0, 1.0, -near],
        [0.0, 0.0, -1.0, far],
        [fx, 0.0, cx, 0.0],
        [-fx, 0.0, view.width as f64 - cx, 0.0],
        [0.0, fy, cy, 0.0],
        [0.0, -fy, view.height as f64 - cy, 0.0],
    ]
}

/// Whether the camera is on the side of a plane that is seen.
fn is_before(seen: &Seen) -> bool {
    // The camera in the plane's frame: -Rᵀ t.
    (0..3).map(|i| seen.rotation[i][2] * seen.translation[i]).sum::<f64>() < 0.0
}

/// Cuts what is on the surface of shapes to the frustum, and measures it.
struct Cutter {
    sides: [[f64; 4]; 6],
    /// What is left of a polygon, and what is left of that behind one more side.
    polygon: Vec<[f64; 3]>,
    rest: Vec<[f64; 3]>,
    extent: Extent,
}

impl Cutter {
    fn shape(&mut self, shape: &Shape, seen: &Seen, view: &View) {
        match shape {
            Shape::Plane(Plane { half }) => {
                let far = f64::from(view.far);
                let half = half.map(|half| if half == 0.0 { horizon(view, seen, far) } else { f64::from(half) });
                let [x, y] = half;
                self.polygon(&[[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| seen.point([x, y, 0.0])));
            }
            _ => match shape.mesh() {
                Some(mesh) => self.triangles(mesh.positions(), mesh.triangles(), seen),
                None => {
                    let mesh = shape.tessellate(SEGMENTS);
                    self.triangles(&mesh.positions, &mesh.triangles, seen);
                }
            },
        }
    }

    fn triangles(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]], seen: &Seen) {
        for triangle in triangles {
            let corners = triangle.map(|k| positions.get(k as usize).copied().unwrap_or_default());
            self.polygon(&corners.map(|p| seen.point(p.map(f64::from))));
        }
    }

    /// What a convex polygon has in the frustum: side after side, the corners within it and where edges cross it
    /// (Sutherland and Hodgman, "Reentrant polygon clipping", 1974).
    fn polygon(&mut self, corners: &[[f64; 3]]) {
        self.polygon.clear();
        self.polygon.extend_from_slice(corners);
        for [a, b, c, d] in self.sides {
            let within = |p: &[f64; 3]| a * p[0] + b * p[1] + c * p[2] + d;
            self.rest.clear();
            for (k, p) in self.polygon.iter().enumerate() {
                let q = &self.polygon[(k + 1) % self.polygon.len()];
                let (here, there) = (within(p), within(q));
                if here >= 0.0 {
                    self.rest.push(*p);
                }
                if here * there < 0.0 {
                    let share = here / (here - there);
                    self.rest.push([0, 1, 2].map(|i| p[i] + share * (q[i] - p[i])));
                }
            }
            std::mem::swap(&mut self.polygon, &mut self.rest);
            if self.polygon.is_empty() {
                return;
            }
        }
        for p in &self.polygon {
            self.extent.point(*p);
        }
    }
}

/// Half the side of a square that has all of an endless plane that the picture shows.
fn horizon(view: &View, seen: &Seen, far: f64) -> f64 {
    let wide = |c: f32, f: f32, n: usize| f64::from(c.abs().max((n as f32 - c).abs()) / f);
    let (x, y) = (wide(view.cx, view.fx, view.width), wide(view.cy, view.fy, view.height));
    let to_origin = seen.translation.iter().map(|t| t * t).sum::<f64>().sqrt();
    to_origin + far * (1.0 + x * x + y * y).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::Material;
    use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Sphere};

    /// An image so wide that only the infinite plane reaches its edges.
    fn view() -> View {
        View {
            width: 8640,
            height: 8480,
            fx: 500.0,
            fy: 520.0,
            cx: 4310.5,
            cy: 4250.25,
            near: 0.1,
            far: 20.0,
            world_from_camera: PoseF32::IDENTITY,
        }
    }

    fn of(shape: impl Into<Shape>, pose: &PoseF32) -> Option<[[f64; 2]; 2]> {
        outline(&view(), &Instance::new(shape, Material::default(), 1), pose)
    }

    /// A rotation of some angles and a place.
    fn pose(rpy: [f64; 3], at: [f64; 3]) -> PoseF32 {
        PoseF32::from(&kinetoscope_scene::pose::from_xyz_rpy(at, rpy))
    }

    /// The rays to a ball fill a cone of half the angle asin(r / d) about the direction of its centre, in the plane of y = 0
    /// too: so u is cx + fx tan(atan2(x, z) ± asin(r / hypot(x, z))).
    #[test]
    fn balls() {
        for (at, radius) in [([0.3, -0.2, 2.0], 0.25), ([-3.0, 1.0, 1.5], 0.4), ([0.0, 0.0, 0.6], 0.45)] {
            let found = of(Sphere { radius: radius as f32 }, &pose([0.4, 0.3, -1.0], at)).unwrap();
            let radius = f64::from(radius as f32);
            let end = |x: f64, sign: f64| (x.atan2(at[2]) + sign * (radius / x.hypot(at[2])).asin()).tan();
            for (axis, (f, c)) in [(500.0, 4310.5), (520.0, 4250.25)].into_iter().enumerate() {
                for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
                    let expected = f * end(at[axis], sign) + c;
                    // The pose is in single precision: 1e-7 of metres, magnified by f / z and by the slant.
                    assert!((found[axis][side] - expected).abs() < 2e-3, "{at:?}: {found:?}, {expected}");
                }
            }
        }
    }

    /// Points of fine triangles are on the surface, so they are inside of the outline; the outermost is near its edge: a
    /// circle's polygon is inside by R (1 - cos(pi / n)), times f / z and the slant of what is seen.
    #[test]
    fn shapes() {
        let shapes: Vec<Shape> = vec![
            Ellipsoid { radii: [0.3, 0.1, 0.2] }.into(),
            Capsule { radius: 0.1, half_length: 0.3 }.into(),
            Cylinder { radius: 0.2, half_length: 0.25 }.into(),
            Box { half: [0.1, 0.2, 0.3] }.into(),
            Plane { half: [0.3, 0.2] }.into(),
        ];
        let mut whole = 0;
        for (k, shape) in shapes.iter().enumerate() {
            for turn in 0..12 {
                let t = f64::from(turn);
                // The last ones reach through the near plane.
                let z = if turn < 8 { 1.2 + 0.3 * t } else { 0.1 + 0.03 * (t - 8.0) };
                let pose = pose([0.5 * t + 0.3, 0.7 * t, 1.1 * t + k as f64], [0.2 * t.sin(), 0.3 * t.cos(), z]);
                let Some(found) = of(shape.clone(), &pose) else {
                    assert!(matches!(shape, Shape::Plane(_)), "only planes have a side that is not seen");
                    continue;
                };
                let mesh = shape.tessellate(512);
                let mut extremes = [[f64::INFINITY, f64::NEG_INFINITY]; 2];
                let mut nearest = f64::INFINITY;
                for p in &mesh.positions {
                    let [x, y, z] = pose.apply(*p).map(f64::from);
                    nearest = nearest.min(z);
                    if z < 0.1 {
                        continue;
                    }
                    for (axis, value) in [500.0 * x / z + 4310.5, 520.0 * y / z + 4250.25].into_iter().enumerate() {
                        let [low, high] = &mut extremes[axis];
                        (*low, *high) = (low.min(value), high.max(value));
                    }
                }
                for axis in 0..2 {
                    let ([low, high], [least, most]) = (found[axis], extremes[axis]);
                    // What is cut is a polygon of 256 edges: 7.5e-5 of 0.3 m, at 0.1 m and 520 pixels, some more at a slant.
                    let slack = if nearest < 0.11 { 0.5 } else { 2e-3 };
                    assert!(low <= least + slack && high >= most - slack, "{shape:?} {turn}: {found:?} {extremes:?}");
                    if nearest > 0.5 {
                        whole += 1;
                        // 1 - cos(pi / 512) is 1.9e-5: of 0.3 m, 520 pixels and depths above 0.5 m 6e-3 pixels, twice at a slant.
                        assert!(low >= least - 2e-2 && high <= most + 2e-2, "{shape:?} {turn}: {found:?} {extremes:?}");
                    }
                }
            }
        }
        assert!(whole > 50, "{whole}");
    }

    #[test]
    fn unseen() {
        let ball = |z| of(Sphere { radius: 0.2 }, &pose([0.0; 3], [0.0, 0.0, z]));
        assert_eq!([ball(-0.5), ball(20.3)], [None; 2], "behind, and too far");
        assert!(ball(20.1).is_some());
        assert_eq!(of(Plane { half: [1.0, 1.0] }, &pose([0.0; 3], [0.0, 0.0, 2.0])), None, "from behind");
    }

    /// A camera 1 m above the ground that looks ahead sees it up to its far plane, 20 m away: v = cy + fy / 20, and to the
    /// edges of the image to the sides and below.
    #[test]
    fn infinite_plane() {
        // z of the plane is up, which is -y of the camera.
        let ground = PoseF32 { rotation: [[1., 0., 0.], [0., 0., -1.], [0., 1., 0.]], translation: [0.0, 1.0, 0.0] };
        let [u, v] = of(Plane::INFINITE, &ground).unwrap();
        assert!((v[0] - (4250.25 + 520.0 / 20.0)).abs() < 1e-3, "{v:?}");
        assert_eq!((v[1], u), (8480.0, [0.0, 8640.0]), "to the edges of the image");
    }

    fn in_narrow(near: f32, shape: impl Into<Shape>, pose: &PoseF32) -> Option<[[f64; 2]; 2]> {
        let view = View { width: 640, height: 480, fx: 500.0, fy: 500.0, cx: 320.0, cy: 240.0, near, ..view() };
        outline(&view, &Instance::new(shape, Material::default(), 1), pose)
    }

    /// A strip askew, 1 m before the camera, between the lines u + v = s ± 500 w sqrt(2): the visible part is a triangle at
    /// the upper left corner, however long the strip is. Beside the corner its ends are left and above, and their rectangle
    /// would be the whole image.
    #[test]
    fn strip() {
        let half_width = 0.01f32;
        let wide = 500.0 * f64::from(half_width) * 2f64.sqrt();
        let strip = |s: f64| {
            // Along (1, -1), through the middle of the line u + v = s; its z looks at the camera.
            let h = std::f32::consts::FRAC_1_SQRT_2;
            let at = [((0.5 * s - 320.0) / 500.0) as f32, ((0.5 * s - 240.0) / 500.0) as f32, 1.0];
            let pose = PoseF32 { rotation: [[h, -h, 0.0], [-h, -h, 0.0], [0.0, 0.0, -1.0]], translation: at };
            in_narrow(0.1, Plane { half: [5.0, half_width] }, &pose)
        };
        // Single precision of the pose: 1e-7 of 1 m and of 5 m at a slant, 500 pixels.
        let found = strip(30.0).unwrap();
        assert!(found.iter().all(|[a, b]| *a == 0.0 && (b - 30.0 - wide).abs() < 1e-3), "{found:?}");
        assert_eq!(strip(-30.0), None);
    }

    /// A rod that passes the camera on its right, from behind: 0.1 m aside and 0.02 m thick, 1 m of it ahead. Its near end is
    /// seen at x / z = 0.09; it leaves the image where 500 * 0.09 / z = 320, and is 500 * 0.01 / z high there. At the near
    /// plane, 5 mm away, x / z is 22.
    #[test]
    fn rod() {
        let rod = Box { half: [0.01, 0.01, 1.0] };
        let [u, v] = in_narrow(0.005, rod, &PoseF32::from_translation([0.1, 0.0, 0.0])).unwrap();
        assert!((u[0] - (320.0 + 500.0 * 0.09)).abs() < 1e-3 && u[1] == 640.0, "{u:?}");
        let half = 320.0 / 9.0;
        assert!((v[0] - (240.0 - half)).abs() < 1e-2 && (v[1] - (240.0 + half)).abs() < 1e-2, "{v:?}");
    }
}
