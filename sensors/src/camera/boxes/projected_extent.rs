//! Extent of an instance in the image, without occluders.

use kinetoscope_render::View;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{HullPart, Plane};
use kinetoscope_scene::{Instance, PoseF32};

/// Number of edges of circles that the frustum cuts. The polygon is inside the circle by at most 1 - cos(pi / 256) of
/// its radius, which is 7.5e-5.
const CIRCLE_EDGES: usize = 256;

/// Pose of an instance in the optical frame of the camera, double precision.
struct CameraFromInstance {
    rotation: [[f64; 3]; 3],
    translation: [f64; 3],
}

impl CameraFromInstance {
    fn point(&self, p: [f64; 3]) -> [f64; 3] {
        [0, 1, 2].map(|i| self.translation[i] + (0..3).map(|j| self.rotation[i][j] * p[j]).sum::<f64>())
    }

    /// Returns R diag(radii²) Rᵀ. n · M n is the squared extent of an ellipsoid along n.
    fn ellipsoid_matrix(&self, radii: [f64; 3]) -> [[f64; 3]; 3] {
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

    /// Adds an ellipsoid, or a disc, that is entirely in front of the camera.
    ///
    /// A plane through the camera center with normal n touches the ellipsoid where (n · c)² = n · M n, with its center
    /// c. For n = (1, 0, -s), the plane x = s z, this is a quadratic equation in s. Its roots are the ends of the
    /// extent.
    fn ellipsoid(&mut self, seen: &CameraFromInstance, center: [f64; 3], radii: [f64; 3]) {
        let (c, m) = (seen.point(center), seen.ellipsoid_matrix(radii));
        for axis in 0..2 {
            let a = c[2] * c[2] - m[2][2];
            let b = c[axis] * c[2] - m[axis][2];
            let root = (b * b - a * (c[axis] * c[axis] - m[axis][axis])).max(0.0).sqrt();
            self.add(axis, (b - root) / a);
            self.add(axis, (b + root) / a);
        }
    }
}

/// Returns the extent of the part of an instance that is in the frustum \[pixels\]: smallest and largest u, then v. The
/// frustum ends at the near plane, the far plane and the four edges of the image. `None` if no part is in the frustum,
/// or if a one-sided plane is seen from behind.
pub(super) fn projected_extent(
    view: &View,
    instance: &Instance,
    world_from_instance: &PoseF32,
) -> Option<[[f64; 2]; 2]> {
    let pose = view.world_from_camera.inverse_times(world_from_instance);
    let seen = CameraFromInstance {
        rotation: pose.rotation.map(|row| row.map(f64::from)),
        translation: pose.translation.map(f64::from),
    };
    let shape = &instance.shape;
    if shape.is_one_sided() && !is_front_facing(&seen) {
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
    let is_unbounded = shape.bounds().is_none();
    if low > near && high < far && !is_unbounded {
        let mut extent = Extent::NONE;
        // x / z takes its extremes over a convex hull at the hull's parts.
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
    // A clipped shape has other extremes than the whole shape.
    let mut cutter = FrustumClipper {
        frustum_planes: frustum_planes(view),
        polygon: Vec::new(),
        clipped: Vec::new(),
        extent: Extent::NONE,
    };
    cutter.shape(shape, &seen, view);
    let [x, _] = cutter.extent.0;
    (x[0] <= x[1]).then(|| {
        // Only rounding errors are clamped: polygons end at the edges.
        let found = pixels(cutter.extent);
        [0, 1].map(|axis| found[axis].map(|x| x.clamp(0.0, size[axis])))
    })
}

/// Returns the six planes of the frustum as [a, b, c, d]: a x + b y + c z + d >= 0 inside, in the optical frame.
fn frustum_planes(view: &View) -> [[f64; 4]; 6] {
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

/// Returns true if the camera is on the visible side of a one-sided plane.
fn is_front_facing(seen: &CameraFromInstance) -> bool {
    // Camera position in the frame of the plane: -Rᵀ t.
    (0..3).map(|i| seen.rotation[i][2] * seen.translation[i]).sum::<f64>() < 0.0
}

/// Clips the surfaces of shapes to the frustum and accumulates their extent.
struct FrustumClipper {
    frustum_planes: [[f64; 4]; 6],
    /// The polygon being clipped, and the result of clipping it at one more plane.
    polygon: Vec<[f64; 3]>,
    clipped: Vec<[f64; 3]>,
    extent: Extent,
}

impl FrustumClipper {
    fn shape(&mut self, shape: &Shape, seen: &CameraFromInstance, view: &View) {
        match shape {
            Shape::Plane(Plane { half }) => {
                let far = f64::from(view.far);
                let half =
                    half.map(|half| if half == 0.0 { visible_half_extent(view, seen, far) } else { f64::from(half) });
                let [x, y] = half;
                self.polygon(&[[-x, -y], [x, -y], [x, y], [-x, y]].map(|[x, y]| seen.point([x, y, 0.0])));
            }
            _ => match shape.mesh() {
                Some(mesh) => self.triangles(mesh.positions(), mesh.triangles(), seen),
                None => {
                    let mesh = shape.tessellate(CIRCLE_EDGES);
                    self.triangles(&mesh.positions, &mesh.triangles, seen);
                }
            },
        }
    }

    fn triangles(&mut self, positions: &[[f32; 3]], triangles: &[[u32; 3]], seen: &CameraFromInstance) {
        for triangle in triangles {
            let corners = triangle.map(|k| positions.get(k as usize).copied().unwrap_or_default());
            self.polygon(&corners.map(|p| seen.point(p.map(f64::from))));
        }
    }

    /// Adds the part of a convex polygon inside the frustum. At each plane, the polygon keeps its corners inside and
    /// gains the points where its edges cross the plane. Source: Sutherland and Hodgman, "Reentrant polygon clipping",
    /// 1974.
    fn polygon(&mut self, corners: &[[f64; 3]]) {
        self.polygon.clear();
        self.polygon.extend_from_slice(corners);
        for [a, b, c, d] in self.frustum_planes {
            let within = |p: &[f64; 3]| a * p[0] + b * p[1] + c * p[2] + d;
            self.clipped.clear();
            for (k, p) in self.polygon.iter().enumerate() {
                let q = &self.polygon[(k + 1) % self.polygon.len()];
                let (here, there) = (within(p), within(q));
                if here >= 0.0 {
                    self.clipped.push(*p);
                }
                if here * there < 0.0 {
                    let share = here / (here - there);
                    self.clipped.push([0, 1, 2].map(|i| p[i] + share * (q[i] - p[i])));
                }
            }
            std::mem::swap(&mut self.polygon, &mut self.clipped);
            if self.polygon.is_empty() {
                return;
            }
        }
        for p in &self.polygon {
            self.extent.point(*p);
        }
    }
}

/// Returns half the side of a square that contains all of an infinite plane that the image shows \[m\].
fn visible_half_extent(view: &View, seen: &CameraFromInstance, far: f64) -> f64 {
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
            parallel: false,
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
        projected_extent(&view(), &Instance::new(shape, Material::default(), 1), pose)
    }

    /// A pose from roll, pitch, yaw and a position.
    fn pose(rpy: [f64; 3], at: [f64; 3]) -> PoseF32 {
        PoseF32::from(&kinetoscope_scene::pose::from_xyz_rpy(at, rpy))
    }

    /// The rays to a ball fill a cone around the direction of its center with the half-angle asin(r / d). The same
    /// holds in the plane y = 0. So u is cx + fx tan(atan2(x, z) ± asin(r / hypot(x, z))).
    #[test]
    fn balls() {
        for (at, radius) in [([0.3, -0.2, 2.0], 0.25), ([-3.0, 1.0, 1.5], 0.4), ([0.0, 0.0, 0.6], 0.45)] {
            let found = of(Sphere { radius: radius as f32 }, &pose([0.4, 0.3, -1.0], at)).unwrap();
            let radius = f64::from(radius as f32);
            let end = |x: f64, sign: f64| (x.atan2(at[2]) + sign * (radius / x.hypot(at[2])).asin()).tan();
            for (axis, (f, c)) in [(500.0, 4310.5), (520.0, 4250.25)].into_iter().enumerate() {
                for (side, sign) in [-1.0, 1.0].into_iter().enumerate() {
                    let expected = f * end(at[axis], sign) + c;
                    // The pose has single precision: 1e-7 of meters, magnified by f / z and by the slant.
                    assert!((found[axis][side] - expected).abs() < 2e-3, "{at:?}: {found:?}, {expected}");
                }
            }
        }
    }

    /// Vertices of a fine tessellation lie on the surface, so they are inside the extent. The outermost vertex is near
    /// its edge: the polygon of a circle is inside by R (1 - cos(pi / n)), times f / z and the slant of the surface.
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
                // The last poses reach through the near plane.
                let z = if turn < 8 { 1.2 + 0.3 * t } else { 0.1 + 0.03 * (t - 8.0) };
                let pose = pose([0.5 * t + 0.3, 0.7 * t, 1.1 * t + k as f64], [0.2 * t.sin(), 0.3 * t.cos(), z]);
                let Some(found) = of(shape.clone(), &pose) else {
                    assert!(matches!(shape, Shape::Plane(_)), "only planes are one-sided");
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
                    // Clipped shapes have 256 edges: 7.5e-5 of 0.3 m, at 0.1 m and 520 pixels, somewhat more at a
                    // slant.
                    let slack = if nearest < 0.11 { 0.5 } else { 2e-3 };
                    assert!(low <= least + slack && high >= most - slack, "{shape:?} {turn}: {found:?} {extremes:?}");
                    if nearest > 0.5 {
                        whole += 1;
                        // 1 - cos(pi / 512) is 1.9e-5: of 0.3 m, 520 pixels and depths above 0.5 m 6e-3 pixels, twice
                        // at a slant.
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

    /// A camera 1 m above the ground looks ahead and sees the ground up to its far plane, 20 m away: v = cy + fy / 20.
    /// The ground reaches the left, right and lower edges of the image.
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
        projected_extent(&view, &Instance::new(shape, Material::default(), 1), pose)
    }

    /// A slanted strip 1 m in front of the camera, between the lines u + v = s ± 500 w sqrt(2). The visible part is a
    /// triangle at the upper left corner, however long the strip is. A strip beside the corner is outside, although the
    /// bounding rectangle of its ends would be the whole image.
    #[test]
    fn strip() {
        let half_width = 0.01f32;
        let wide = 500.0 * f64::from(half_width) * 2f64.sqrt();
        let strip = |s: f64| {
            // Along (1, -1), through the middle of the line u + v = s, with z toward the camera.
            let h = std::f32::consts::FRAC_1_SQRT_2;
            let at = [((0.5 * s - 320.0) / 500.0) as f32, ((0.5 * s - 240.0) / 500.0) as f32, 1.0];
            let pose = PoseF32 { rotation: [[h, -h, 0.0], [-h, -h, 0.0], [0.0, 0.0, -1.0]], translation: at };
            in_narrow(0.1, Plane { half: [5.0, half_width] }, &pose)
        };
        // Single precision of the pose: 1e-7 of 1 m, and of 5 m at a slant, times 500 pixels.
        let found = strip(30.0).unwrap();
        assert!(found.iter().all(|[a, b]| *a == 0.0 && (b - 30.0 - wide).abs() < 1e-3), "{found:?}");
        assert_eq!(strip(-30.0), None);
    }

    /// A rod passes the camera on its right, from behind: 0.1 m aside, 0.02 m thick, 1 m of it ahead. Its far end is at
    /// x / z = 0.09. The rod leaves the image where 500 * 0.09 / z = 320, with a half height of 500 * 0.01 / z there.
    /// At the near plane, 5 mm away, x / z is 22.
    #[test]
    fn rod() {
        let rod = Box { half: [0.01, 0.01, 1.0] };
        let [u, v] = in_narrow(0.005, rod, &PoseF32::from_translation([0.1, 0.0, 0.0])).unwrap();
        assert!((u[0] - (320.0 + 500.0 * 0.09)).abs() < 1e-3 && u[1] == 640.0, "{u:?}");
        let half = 320.0 / 9.0;
        assert!((v[0] - (240.0 - half)).abs() < 1e-2 && (v[1] - (240.0 + half)).abs() < 1e-2, "{v:?}");
    }
}
