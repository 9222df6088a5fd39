//! Polygons of shapes, as MuJoCo's OpenGL renderer draws them.

use kinetoscope_scene::shape::{Plane, RenderMesh, Shape};
use kinetoscope_scene::vector::norm;
use kinetoscope_scene::{PlaneLines, Tessellation};
use std::f64::consts::{FRAC_PI_2, PI, TAU};

/// Largest number of polygons along a side of a plane. Source: `mjMAXPLANEGRID` of MuJoCo.
const MAX_GRID: usize = 200;
/// Largest number in a [`Tessellation`].
const MAX_QUALITY: u16 = 1000;

/// Polygons of a surface, counterclockwise as seen from outside.
#[derive(Clone, Debug, Default)]
pub(super) struct Facets {
    pub(super) positions: Vec<[f32; 3]>,
    pub(super) normals: Vec<[f32; 3]>,
    /// Texture coordinates; `None` without.
    pub(super) uvs: Option<Vec<[f32; 2]>>,
    /// Corners; a triangle repeats the last one.
    pub(super) polygons: Vec<[u32; 4]>,
}

impl Facets {
    /// Polygons of a shape; none for shapes made of triangles, see [`of_mesh`](Self::of_mesh).
    pub(super) fn new(shape: &Shape, grid: &PlaneGrid) -> Self {
        let Tessellation { slices, stacks, quads } = grid.quality;
        let [slices, stacks, quads] =
            [slices.max(3), stacks.max(2), quads.max(1)].map(|n| usize::from(n.min(MAX_QUALITY)));
        let mut out = Self::default();
        match shape {
            Shape::Sphere(sphere) => out.ball([sphere.radius; 3].map(f64::from), [slices, stacks]),
            Shape::Ellipsoid(ellipsoid) => out.ball(ellipsoid.radii.map(f64::from), [slices, stacks]),
            Shape::Capsule(capsule) => {
                let (radius, half) = (f64::from(capsule.radius), f64::from(capsule.half_length));
                out.tube(radius, half, [slices, stacks]);
                for side in [1.0, -1.0] {
                    let low = if side > 0.0 { 0.0 } else { -FRAC_PI_2 };
                    out.add([slices, (stacks / 2).max(1)], |s, t| {
                        let normal = on_ball(s, low + FRAC_PI_2 * t);
                        let [x, y, z] = normal.map(|n| radius * n);
                        ([x, y, z + side * half], normal)
                    });
                }
            }
            Shape::Cylinder(cylinder) => {
                let (radius, half) = (f64::from(cylinder.radius), f64::from(cylinder.half_length));
                out.tube(radius, half, [slices, stacks]);
                for side in [1.0, -1.0] {
                    out.add([slices, (stacks / 2).max(1)], |s, t| {
                        let [x, y] = circle(s, radius * if side > 0.0 { 1.0 - t } else { t });
                        ([x, y, side * half], [0.0, 0.0, side])
                    });
                }
            }
            Shape::Box(cuboid) => {
                let half = cuboid.half.map(f64::from);
                for (axis, side) in [0, 1, 2].into_iter().flat_map(|axis| [(axis, 1.0), (axis, -1.0)]) {
                    let [right, up] = [(axis + 1) % 3, (axis + 2) % 3];
                    out.add([quads; 2], |s, t| {
                        let mut at = [side * half[axis]; 3];
                        at[right] = side * (2.0 * s - 1.0) * half[right];
                        at[up] = (2.0 * t - 1.0) * half[up];
                        let mut normal = [0.0; 3];
                        normal[axis] = side;
                        (at, normal)
                    });
                }
            }
            Shape::Plane(plane) => {
                let [columns, rows] = grid.lines(plane).map(|lines| lines.all().into_iter().map(f64::from).collect());
                let (columns, rows): (Vec<f64>, Vec<f64>) = (columns, rows);
                out.add_lines(&columns, &rows, |x, y| ([x, y, 0.0], [0.0, 0.0, 1.0]));
            }
            _ => {}
        }
        out
    }

    /// Triangles of a mesh.
    pub(super) fn of_mesh(mesh: &RenderMesh) -> Self {
        let polygons = mesh.triangles().iter().map(|&[a, b, c]| [a, b, c, c]).collect();
        let uvs = mesh.uvs().map(<[_]>::to_vec);
        Self { positions: mesh.positions().to_vec(), normals: mesh.normals().to_vec(), uvs, polygons }
    }

    /// Adds a patch of `columns` x `rows` polygons. `surface` has the position and the normal at fractions of its width
    /// to the right and of its height upward, as seen from outside.
    fn add(&mut self, [columns, rows]: [usize; 2], surface: impl Fn(f64, f64) -> ([f64; 3], [f64; 3])) {
        let lines = |count: usize| (0..=count).map(|k| k as f64 / count as f64).collect::<Vec<_>>();
        self.add_lines(&lines(columns), &lines(rows), surface);
    }

    /// As [`add`](Self::add), for given parameters of the lines.
    fn add_lines(&mut self, columns: &[f64], rows: &[f64], surface: impl Fn(f64, f64) -> ([f64; 3], [f64; 3])) {
        let first = self.positions.len();
        for (&t, &s) in rows.iter().flat_map(|t| columns.iter().map(move |s| (t, s))) {
            let (position, normal) = surface(s, t);
            self.positions.push(position.map(|x| x as f32));
            self.normals.push(normal.map(|x| x as f32));
        }
        for (row, column) in (1..rows.len()).flat_map(|row| (1..columns.len()).map(move |column| (row, column))) {
            let at = |up: usize, right: usize| (first + (row - 1 + up) * columns.len() + column - 1 + right) as u32;
            let corners = [at(0, 0), at(0, 1), at(1, 1), at(1, 0)];
            // At poles, two corners are one.
            let mut polygon = Vec::with_capacity(4);
            for corner in corners {
                let place = self.positions[corner as usize];
                if polygon.iter().all(|&other: &u32| self.positions[other as usize] != place) {
                    polygon.push(corner);
                }
            }
            if let [a, b, c] = polygon[..] {
                self.polygons.push([a, b, c, c]);
            } else if polygon.len() == 4 {
                self.polygons.push(corners);
            }
        }
    }

    fn ball(&mut self, radii: [f64; 3], size: [usize; 2]) {
        self.add(size, |s, t| {
            let unit = on_ball(s, PI * t - FRAC_PI_2);
            let gradient = [0, 1, 2].map(|k| unit[k] / radii[k]);
            let length = norm(gradient);
            ([0, 1, 2].map(|k| radii[k] * unit[k]), gradient.map(|x| x / length))
        });
    }

    /// The side of a cylinder.
    fn tube(&mut self, radius: f64, half: f64, size: [usize; 2]) {
        self.add(size, |s, t| {
            let [x, y] = circle(s, 1.0);
            ([radius * x, radius * y, half * (2.0 * t - 1.0)], [x, y, 0.0])
        });
    }
}

/// Lines of the grid of a plane along one axis, from half its size \[m\], 0 for an infinite plane. Source: `makePlane` of
/// MuJoCo's classic renderer.
#[derive(Clone, Copy, Debug)]
pub(super) struct PlaneGrid {
    /// Half the size of the polygons of a finite plane \[m\]; `None` for planes that are not in the model, which have as
    /// many polygons as a box.
    pub(super) spacing: Option<f32>,
    /// Repetitions of the texture of an infinite plane along each axis; 0 without one.
    pub(super) repeat: [f32; 2],
    /// Distance of the far plane \[m\].
    pub(super) far: f32,
    /// Numbers of polygons of shapes.
    pub(super) quality: Tessellation,
}

impl PlaneGrid {
    /// Lines along both axes.
    pub(super) fn lines(&self, plane: &Plane) -> [PlaneLines; 2] {
        [0, 1].map(|axis| {
            let (half, most) = (plane.half[axis], (MAX_GRID - 2) as f32);
            if half <= 0.0 {
                let image = if self.repeat[axis] > 0.0 { 2.0 / self.repeat[axis] } else { 2.1 * self.far / most };
                let step = (2.1 * self.far + 2.0 * image) / MAX_GRID as f32;
                let reach = step * (MAX_GRID / 2) as f32;
                return PlaneLines { reach, step, border: reach };
            }
            let Some(spacing) = self.spacing else {
                return PlaneLines {
                    reach: half,
                    step: 2.0 * half / f32::from(self.quality.quads.max(1)),
                    border: half,
                };
            };
            let spacing = spacing.max(half / most);
            // An even number of polygons between the border ones.
            let inner = 2.0 * (half / spacing / 2.0).floor();
            PlaneLines { reach: inner * spacing, step: 2.0 * spacing, border: half }
        })
    }
}

/// Point of the unit ball at a fraction of its circumference, and a latitude.
fn on_ball(fraction: f64, latitude: f64) -> [f64; 3] {
    let is_pole = latitude.abs() > FRAC_PI_2 - 1e-9;
    let [x, y] = circle(fraction, if is_pole { 0.0 } else { latitude.cos() });
    [x, y, latitude.sin()]
}

/// Point of a circle at a fraction of its circumference. The last point is the first one, bit for bit.
fn circle(fraction: f64, radius: f64) -> [f64; 2] {
    let angle = TAU * if fraction >= 1.0 { 0.0 } else { fraction };
    [radius * angle.cos(), radius * angle.sin()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Sphere};
    use kinetoscope_scene::vector::{cross, dot, sub, to_f64};

    const GRID: PlaneGrid = PlaneGrid {
        spacing: Some(0.25),
        repeat: [0.0; 2],
        far: 10.0,
        quality: Tessellation { slices: 28, stacks: 16, quads: 4 },
    };

    /// Volumes by the divergence theorem, against those of the polyhedra in closed form or of the round shapes: this
    /// needs all polygons, each turned outward. Normals are those of the round shape.
    #[test]
    fn volumes() {
        let quality = Tessellation { slices: 200, stacks: 100, quads: 3 };
        let grid = PlaneGrid { quality, ..GRID };
        let [r, h] = [0.3f64, 0.5];
        let ball = 4.0 / 3.0 * PI;
        let shapes: [(Shape, f64, usize); 5] = [
            (Sphere { radius: 0.3 }.into(), ball * r.powi(3), 200 * 100),
            (Ellipsoid { radii: [0.2, 0.3, 0.5] }.into(), ball * 0.2 * 0.3 * 0.5, 200 * 100),
            (Capsule { radius: 0.3, half_length: 0.5 }.into(), ball * r.powi(3) + PI * r * r * 2.0 * h, 200 * 200),
            (Cylinder { radius: 0.3, half_length: 0.5 }.into(), PI * r * r * 2.0 * h, 200 * (100 + 2 * 50)),
            (Box { half: [0.2, 0.3, 0.5] }.into(), 8.0 * 0.2 * 0.3 * 0.5, 6 * 9),
        ];
        for (shape, expected, polygons) in shapes {
            let facets = Facets::new(&shape, &grid);
            let mut volume = 0.0;
            for &[a, b, c, d] in &facets.polygons {
                for [a, b, c] in [[a, b, c], [a, c, d]] {
                    let [p, q, r] = [a, b, c].map(|i| to_f64(facets.positions[i as usize]));
                    let area = cross(sub(q, p), sub(r, p));
                    volume += dot(p, area) / 6.0;
                    let normal = to_f64(facets.normals[a as usize]);
                    let size = dot(area, area).sqrt();
                    assert!((dot(normal, normal) - 1.0).abs() < 1e-6);
                    assert!(size < 1e-12 || dot(normal, area) > 0.9 * size, "{}", shape.name());
                }
            }
            assert!((volume / expected - 1.0).abs() < 1e-3, "{}: {volume} {expected}", shape.name());
            assert_eq!(facets.polygons.len(), polygons, "{}", shape.name());
        }
    }

    /// Grids of planes, with the lines that `makePlane` of MuJoCo has, computed by hand.
    #[test]
    fn planes() {
        let lines = |half: [f32; 2], grid: PlaneGrid| grid.lines(&Plane { half }).map(|lines| lines.all());
        let [x, y] = lines([1.125, 0.5], GRID);
        assert_eq!(x, [-1.125, -1.0, -0.5, 0.0, 0.5, 1.0, 1.125]);
        assert_eq!(y, [-0.5, 0.0, 0.5]);
        let [infinite, _] = lines([0.0; 2], GRID);
        assert!(infinite.len() == MAX_GRID + 1 && infinite[0] < -10.0 && infinite[100] == 0.0);
        let [textured, _] = lines([0.0; 2], PlaneGrid { repeat: [0.5, 0.0], ..GRID });
        // Two images, of 4 m each, more than the diameter of the skybox.
        assert!((textured[MAX_GRID] - 0.5 * (21.0 + 8.0)).abs() < 1e-3, "{}", textured[MAX_GRID]);
        // A fine grid has no more polygons than MuJoCo's; a plane outside of the model those of a box.
        assert!(lines([5.0; 2], PlaneGrid { spacing: Some(1e-3), ..GRID })[0].len() <= MAX_GRID + 1);
        assert_eq!(lines([1.0; 2], PlaneGrid { spacing: None, ..GRID })[0], [-1.0, -0.5, 0.0, 0.5, 1.0]);
    }
}
