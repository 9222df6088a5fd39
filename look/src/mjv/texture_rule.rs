//! Mapping of two-dimensional textures onto shapes, by versions of MuJoCo's renderer.

use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::{Plane, RenderMesh, Shape};
use kinetoscope_scene::{LightingSpace, Texture, TextureKind};
use std::f64::consts::{FRAC_PI_2, PI};

/// Mapping of two-dimensional textures onto shapes without texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum TextureRule {
    /// Textures are projected along z, with their middle in the middle of the shape.
    Projected,
    /// Shapes have texture coordinates: spheres their longitude and latitude, cylinders their angle and height, boxes a
    /// square for each face. The texture of a finite plane begins at its corner.
    #[default]
    Wrapped,
}

/// Number of faces around a round shape. From pole to pole, there are half as many.
const SLICES: usize = 64;
const STACKS: usize = SLICES / 2;

/// A mesh of a round shape with the texture coordinates of [`TextureRule::Wrapped`] times `scale`, or a mesh with its own
/// texture coordinates times `scale`; `None` for other shapes, for meshes without texture coordinates, and for meshes
/// whose scale is 1.
pub(super) fn wrapped_mesh(shape: &Shape, scale: [f32; 2]) -> Option<RenderMesh> {
    if let Shape::Mesh(mesh) = shape {
        return scaled_mesh(&mesh.mesh, scale);
    }
    let mut grid = Grid { scale, ..Grid::default() };
    match shape {
        Shape::Sphere(sphere) => grid.ball([sphere.radius; 3]),
        Shape::Ellipsoid(ellipsoid) => grid.ball(ellipsoid.radii),
        Shape::Capsule(capsule) => {
            let (radius, half) = (f64::from(capsule.radius), f64::from(capsule.half_length));
            for (side, first) in [(1.0, FRAC_PI_2), (-1.0, 0.0)] {
                grid.add([SLICES, STACKS / 2], |s, t| {
                    let latitude = first - FRAC_PI_2 * t;
                    let [x, y] = circle(s, radius * cosine(latitude));
                    ([x, y, side * half + radius * latitude.sin()], [s, t])
                });
            }
            grid.add([SLICES, 1], |s, t| {
                let [x, y] = circle(s, radius);
                ([x, y, half * (1.0 - 2.0 * t)], [s, t])
            });
        }
        Shape::Cylinder(cylinder) => {
            let (radius, half) = (f64::from(cylinder.radius), f64::from(cylinder.half_length));
            grid.add([SLICES, 1], |s, t| {
                let [x, y] = circle(s, radius);
                ([x, y, half * (1.0 - 2.0 * t)], [s, t])
            });
            for side in [1.0, -1.0] {
                grid.add([SLICES, 1], |s, t| {
                    // From the middle to the rim on the upper side, from the rim to the middle below.
                    let [x, y] = circle(s, if side > 0.0 { t } else { 1.0 - t });
                    ([radius * x, radius * y, side * half], [0.5 + 0.5 * x, 0.5 + 0.5 * y])
                });
            }
        }
        _ => return None,
    }
    let mut mesh = TriMesh::from_triangles(grid.positions, grid.triangles);
    mesh.uvs = Some(grid.uvs);
    Some(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE))
}

/// A mesh whose texture coordinates are scaled; `None` for a mesh without them, and if nothing would change.
fn scaled_mesh(mesh: &RenderMesh, scale: [f32; 2]) -> Option<RenderMesh> {
    let mut mesh = mesh.to_tri_mesh();
    let uvs = mesh.uvs.as_mut().filter(|_| scale != [1.0; 2])?;
    for [u, v] in uvs {
        // Image rows run downward in MuJoCo, and upward here.
        (*u, *v) = (*u * scale[0], 1.0 - (1.0 - *v) * scale[1]);
    }
    Some(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE))
}

/// Patches of a surface, whose vertices at one place have equal coordinates.
#[derive(Default)]
struct Grid {
    scale: [f32; 2],
    positions: Vec<[f32; 3]>,
    uvs: Vec<[f32; 2]>,
    triangles: Vec<[u32; 3]>,
}

impl Grid {
    /// Adds a patch of `columns` x `rows` squares. `surface` has the position and the texture coordinates at fractions
    /// of its width, to the right as seen from outside, and of its height, downward.
    fn add(&mut self, [columns, rows]: [usize; 2], surface: impl Fn(f64, f64) -> ([f64; 3], [f64; 2])) {
        let first = self.positions.len();
        for row in 0..=rows {
            for column in 0..=columns {
                let (position, [u, v]) = surface(column as f64 / columns as f64, row as f64 / rows as f64);
                self.positions.push(position.map(|x| x as f32));
                // Image rows run downward in MuJoCo, and upward here.
                self.uvs.push([u as f32 * self.scale[0], 1.0 - v as f32 * self.scale[1]]);
            }
        }
        for (row, column) in (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column))) {
            let at = |down: usize, right: usize| (first + (row + down) * (columns + 1) + column + right) as u32;
            let [a, b, c, d] = [at(0, 0), at(0, 1), at(1, 1), at(1, 0)];
            // At the poles, one of the triangles is a line.
            let differ = |i: u32, j: u32| self.positions[i as usize] != self.positions[j as usize];
            let triangles = [[a, d, c], [a, c, b]];
            self.triangles.extend(triangles.iter().filter(|&&[i, j, k]| differ(i, j) && differ(j, k) && differ(i, k)));
        }
    }

    fn ball(&mut self, radii: [f32; 3]) {
        let radii = radii.map(f64::from);
        self.add([SLICES, STACKS], |s, t| {
            let latitude = FRAC_PI_2 - PI * t;
            let [x, y] = circle(s, cosine(latitude));
            ([radii[0] * x, radii[1] * y, radii[2] * latitude.sin()], [s, t])
        });
    }
}

/// Point of a circle at a fraction of its circumference. The last point is the first one, bit for bit.
fn circle(fraction: f64, radius: f64) -> [f64; 2] {
    let angle = 2.0 * PI * if fraction >= 1.0 { 0.0 } else { fraction };
    [radius * angle.cos(), radius * angle.sin()]
}

/// Cosine of a latitude, 0 at the poles.
fn cosine(latitude: f64) -> f64 {
    if latitude.abs() > FRAC_PI_2 - 1e-9 { 0.0 } else { latitude.cos() }
}

/// Returns the shift of a 2D texture, left and up \[pixels\], that puts the center of an image at the center of a
/// finite plane. The texture starts at a corner of the plane. `scale` is the number of repetitions along each half
/// length. `None` for infinite planes, for cube textures, and if no shift is needed.
pub(super) fn plane_shift(plane: &Plane, scale: [f32; 2], texture: &Texture) -> Option<[usize; 2]> {
    let level = texture.mip_levels().first().filter(|_| texture.kind() == TextureKind::TwoD)?;
    let sizes = [level.width(), level.height()];
    let shift = |k: usize| {
        let wrapped = (0.5 + f64::from(scale[k])).rem_euclid(1.0);
        (((1.0 - wrapped) * f64::from(sizes[k])).round() as usize) % sizes[k] as usize
    };
    let is_finite = plane.half.iter().all(|&half| half > 0.0);
    is_finite.then(|| [shift(0), shift(1)]).filter(|shift| *shift != [0, 0])
}

/// Returns the texture with its pixels shifted left and up, wrapped around at the borders.
pub(super) fn moved_texture(texture: &Texture, [left, up]: [usize; 2]) -> Option<Texture> {
    let level = texture.mip_levels().first()?;
    let (width, height) = (level.width() as usize, level.height() as usize);
    let pixels = level.bytes().as_chunks::<4>().0;
    let pixel = |row: usize, column: usize| pixels[(row + up) % height * (width + 1) + (column + left) % width];
    let bytes: Vec<u8> = (0..height).flat_map(|row| (0..width).flat_map(move |column| pixel(row, column))).collect();
    Texture::averaged_in(LightingSpace::Display, TextureKind::TwoD, level.width(), level.height(), 4, &bytes).ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_scene::shape::{Box, Capsule, Cylinder, Ellipsoid, Sphere};

    /// Texture coordinates by the formulas of each shape at all vertices, whose triangles face outward.
    #[test]
    fn wrapped_coordinates() {
        let scale = [1.5f32, 2.0];
        let shapes: [Shape; 4] = [
            Sphere { radius: 0.4 }.into(),
            Ellipsoid { radii: [0.5, 0.3, 0.4] }.into(),
            Capsule { radius: 0.2, half_length: 0.3 }.into(),
            Cylinder { radius: 0.3, half_length: 0.4 }.into(),
        ];
        for shape in &shapes {
            let mesh = wrapped_mesh(shape, scale).expect("a mesh");
            let uvs = mesh.uvs().expect("texture coordinates");
            let [low, high] = mesh.bounds();
            for ((&position, &normal), uv) in mesh.positions().iter().zip(mesh.normals()).zip(uvs) {
                let [x, y, z] = [0, 1, 2].map(|k| position[k] / high[k]);
                let longitude = (y.atan2(x) / (2.0 * PI as f32)).rem_euclid(1.0);
                let latitude = |z: f32| z.clamp(-1.0, 1.0).asin() / PI as f32;
                let [u, v] = match shape {
                    Shape::Capsule(capsule) => {
                        // The three parts: each has the whole height of the texture, so that borders have both ends.
                        let beyond = position[2].abs() - capsule.half_length;
                        let part = latitude(beyond / capsule.radius) * 2.0;
                        let along = 0.5 - 0.5 * position[2] / capsule.half_length;
                        let v = if beyond <= 1e-6 {
                            along
                        } else if z > 0.0 {
                            1.0 - part
                        } else {
                            part
                        };
                        [longitude, v]
                    }
                    Shape::Cylinder(_) if normal[2].abs() > 0.9 => [0.5 + 0.5 * x, 0.5 + 0.5 * y],
                    Shape::Cylinder(_) => [longitude, 0.5 - 0.5 * z],
                    _ => [longitude, 0.5 - latitude(z)],
                };
                let found = [uv[0] / scale[0], (1.0 - uv[1]) / scale[1]];
                // At the seam, the longitude is 0 or 1; at poles, any; between parts of a capsule, v is 0 or 1.
                let is_pole = position[0].hypot(position[1]) < 1e-6;
                let off = [found[0] - u, found[1] - v].map(|x| (x - x.round()).abs());
                assert!((is_pole || off[0] < 1e-4) && off[1] < 1e-3, "{shape:?} {position:?}: {found:?}, {u} {v}");
                assert!(found.iter().all(|x| (-1e-6..1.0 + 1e-6).contains(x)));
                // All of these shapes are convex and around their origin.
                assert!((0..3).map(|k| normal[k] * position[k]).sum::<f32>() > 0.0, "{shape:?} {position:?}");
            }
            assert!((0..3).all(|k| (low[k] + high[k]).abs() < 1e-6));
        }
        for flat in [Shape::from(Plane { half: [1.0; 2] }), Box { half: [1.0; 3] }.into()] {
            assert!(wrapped_mesh(&flat, scale).is_none());
        }
    }

    /// Texture coordinates of a mesh are scaled from the upper left corner of the image, and nothing else changes.
    #[test]
    fn scaled_coordinates() {
        let ball = wrapped_mesh(&Sphere { radius: 0.4 }.into(), [1.0, 1.0]).expect("a mesh");
        let scaled = scaled_mesh(&ball, [3.0, 2.0]).expect("texture coordinates");
        let key = |position: [f32; 3], uv: [f32; 2], normal: [f32; 3]| {
            [&position[..], &uv, &normal].concat().iter().map(|x| (x * 1e4).round() as i64).collect::<Vec<_>>()
        };
        let all = |mesh: &RenderMesh, scale: [f32; 2]| {
            let uvs = mesh.uvs().expect("texture coordinates");
            let mut all: Vec<_> = (0..uvs.len())
                .map(|k| {
                    let uv = [uvs[k][0] * scale[0], (1.0 - uvs[k][1]) * scale[1]];
                    key(mesh.positions()[k], uv, mesh.normals()[k])
                })
                .collect();
            all.sort();
            all
        };
        assert_eq!(all(&ball, [3.0, 2.0]), all(&scaled, [1.0, 1.0]));
        assert_ne!(all(&ball, [2.0, 2.0]), all(&scaled, [1.0, 1.0]));
        assert!(scaled_mesh(&ball, [1.0; 2]).is_none());
    }

    /// The middle of a moved texture is in the middle of a plane: OpenGL's coordinate there is -1/2.
    #[test]
    fn moved_textures() {
        let (width, height) = (8u32, 4u32);
        let bytes: Vec<u8> = (0..width * height).flat_map(|k| [k as u8, 0, 0]).collect();
        let texture = Texture::averaged_in(LightingSpace::Display, TextureKind::TwoD, width, height, 3, &bytes)
            .expect("a texture");
        let plane = Plane { half: [2.0, 1.0] };
        // An odd number of images on a plane has the middle of an image in its middle, wherever images begin.
        assert_eq!(plane_shift(&plane, [0.5, 1.5], &texture), None);
        assert_eq!(plane_shift(&Plane::INFINITE, [1.0, 1.0], &texture), None);
        // Two images along x begin at the middle: move them by half an image.
        let shift = plane_shift(&plane, [1.0, 0.5], &texture).expect("a shift");
        assert_eq!(shift, [4, 0]);
        let pixel = |texture: &Texture, row: usize, column: usize| {
            texture.mip_levels()[0].bytes()[4 * (row * (width as usize + 1) + column)]
        };
        let moved = moved_texture(&texture, [3, 1]).expect("a texture");
        for (row, column) in (0..4).flat_map(|row| (0..8).map(move |column| (row, column))) {
            assert_eq!(pixel(&moved, row, column), pixel(&texture, (row + 1) % 4, (column + 3) % 8));
        }
    }
}
