//! Decoration of scenes: arrows, and lines whose width is given in pixels.

use super::layout::DecorTypes;
use kinetoscope_scene::mesh::TriMesh;
use kinetoscope_scene::shape::RenderMesh;
use kinetoscope_scene::vector::{cross, dot, scale, sub};
use std::f64::consts::TAU;

/// Faces around arrows.
const SLICES: usize = 32;
/// Radius of the heads of arrows relative to the shaft. Source: MuJoCo's classic renderer.
const HEAD: f64 = 1.75;

/// The part of a camera on which the width of lines depends.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LineView {
    /// Position of the camera \[m\].
    pub position: [f32; 3],
    /// Viewing direction, a unit vector.
    pub forward: [f32; 3],
    /// Width of a line of width 1, at depth 1, or at any depth for an orthographic camera \[m\].
    pub width: f32,
    /// Smallest visible depth \[m\].
    pub near: f32,
    /// Largest visible depth \[m\].
    pub far: f32,
    /// True for an orthographic camera.
    pub parallel: bool,
}

/// Decoration that a geom shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Decor {
    /// An arrow along z with a wide head.
    Arrow,
    /// An arrow along z whose head is as wide as its shaft.
    Arrow1,
    /// An arrow with two heads.
    Arrow2,
    /// A line along z.
    Line,
    /// The edges of a box.
    LineBox,
    /// A triangle in the plane of x and y.
    Triangle,
}

impl Decor {
    /// Decoration of a geom of this type; `None` for other types.
    pub(super) fn of(kind: i32, types: &DecorTypes) -> Option<Self> {
        let all = [
            (types.arrow, Self::Arrow),
            (types.arrow1, Self::Arrow1),
            (types.arrow2, Self::Arrow2),
            (types.line, Self::Line),
            (types.line_box, Self::LineBox),
            (types.triangle, Self::Triangle),
        ];
        all.into_iter().find(|(of, _)| *of == Some(kind)).map(|(_, decor)| decor)
    }

    /// Number of lines that the decoration consists of; 0 for arrows and triangles.
    pub(super) fn lines(self) -> usize {
        match self {
            Self::Line => 1,
            Self::LineBox => 12,
            _ => 0,
        }
    }

    /// Mesh of an arrow or a triangle of this size; `None` for lines.
    pub(super) fn mesh(self, size: [f32; 3]) -> Option<RenderMesh> {
        let [x, y, z] = size.map(f64::from);
        let mut parts = Parts { mesh: TriMesh::default(), radii: [x, y] };
        match self {
            Self::Arrow | Self::Arrow1 => {
                let head = if self == Self::Arrow { HEAD } else { 1.0 };
                parts.shaft([0.0, z / 3.0]);
                parts.head(head, [z / 3.0, z / 2.0]);
            }
            Self::Arrow2 => {
                parts.shaft([-z / 3.0, z / 3.0]);
                parts.head(HEAD, [z / 3.0, z / 2.0]);
                parts.head(HEAD, [-z / 3.0, -z / 2.0]);
            }
            Self::Triangle => {
                let corners = [[0.0; 3], [size[0], 0.0, 0.0], [0.0, size[1], 0.0]];
                let mesh = TriMesh::from_triangles(corners.to_vec(), vec![[0, 1, 2]]);
                return Some(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE));
            }
            Self::Line | Self::LineBox => return None,
        }
        let mesh = TriMesh::from_triangles(parts.mesh.positions, parts.mesh.triangles);
        Some(RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE))
    }

    /// Ends of all lines of a geom of this size, in its frame.
    fn ends(self, [x, y, z]: [f32; 3]) -> Vec<[[f32; 3]; 2]> {
        match self {
            Self::Line => vec![[[0.0; 3], [0.0, 0.0, z]]],
            Self::LineBox => {
                let corner = |k: usize| {
                    let side = |bit: usize, half: f32| if k >> bit & 1 == 1 { half } else { -half };
                    [side(0, x), side(1, y), side(2, z)]
                };
                let edges = (0..8usize).flat_map(|k| (0..3).map(move |bit| (k, k | 1 << bit)));
                edges.filter(|(a, b)| a != b).map(|(a, b)| [corner(a), corner(b)]).collect()
            }
            _ => Vec::new(),
        }
    }
}

/// A deformable mesh of as many lines as the decoration has, without extent.
pub(super) fn line_mesh(decor: Decor) -> RenderMesh {
    let count = decor.lines() as u32;
    let positions = vec![[0.0; 3]; 4 * count as usize];
    let triangles = (0..count).flat_map(|k| [[0, 1, 2], [0, 2, 3]].map(|t| t.map(|corner: u32| 4 * k + corner)));
    RenderMesh::deformable(&TriMesh {
        normals: Some(vec![[0.0, 0.0, 1.0]; positions.len()]),
        ..TriMesh::from_triangles(positions, triangles.collect())
    })
}

/// Corners and normals of the strips that show the lines of a geom, in the world: each faces the camera. `place` takes a
/// point of the geom's frame to the world.
pub(super) fn strips(
    decor: Decor,
    size: [f32; 3],
    view: &LineView,
    place: impl Fn([f32; 3]) -> [f32; 3],
) -> [Vec<[f32; 3]>; 2] {
    // MuJoCo's lines are as wide as the first number of their size, and the edges of boxes are 1.5 wide.
    let width = if decor == Decor::Line { size[0] } else { 1.5 };
    let (mut positions, mut normals) = (Vec::new(), Vec::new());
    for ends in decor.ends(size) {
        positions.extend(view.strip(ends.map(&place), width));
        normals.extend([view.forward.map(|x| -x); 4]);
    }
    [positions, normals]
}

impl LineView {
    /// Corners of the strip that shows a line of this width \[pixels\]: two at each end, in the order of `ends`. Behind the
    /// near plane, a strip has no extent.
    pub(super) fn strip(&self, ends: [[f32; 3]; 2], width: f32) -> [[f32; 3]; 4] {
        let wide = |v: [f32; 3]| v.map(f64::from);
        let (eye, forward) = (wide(self.position), wide(self.forward));
        let width = f64::from(self.width) * f64::from(width);
        let near = 1.001 * f64::from(self.near);
        let [mut a, mut b] = ends.map(|point| sub(wide(point), eye));
        let depth = |p: [f64; 3]| dot(p, forward);
        let cut = |from: [f64; 3], to: [f64; 3]| {
            let k = (near - depth(from)) / (depth(to) - depth(from));
            [0, 1, 2].map(|i| from[i] + k * (to[i] - from[i]))
        };
        match [depth(a) < near, depth(b) < near] {
            [true, true] => b = a,
            [true, false] => a = cut(a, b),
            [false, true] => b = cut(b, a),
            [false, false] => {}
        }
        let across = if self.parallel { cross(forward, sub(b, a)) } else { cross(a, b) };
        let length = dot(across, across).sqrt();
        let side = |p: [f64; 3]| {
            let half = 0.5 * width * if self.parallel { 1.0 } else { depth(p).max(near) };
            if length > 0.0 { scale(across, half / length) } else { [0.0; 3] }
        };
        [(a, -1.0), (a, 1.0), (b, 1.0), (b, -1.0)].map(|(end, sign)| {
            let offset = side(end);
            [0, 1, 2].map(|i| (eye[i] + end[i] + sign * offset[i]) as f32)
        })
    }
}

/// Triangle mesh of an arrow along z, with the semi-axes `radii` along x and y.
struct Parts {
    mesh: TriMesh,
    radii: [f64; 2],
}

impl Parts {
    /// Adds a closed elliptic cylinder between two heights.
    fn shaft(&mut self, [low, high]: [f64; 2]) {
        let rings = [self.ring(1.0, low), self.ring(1.0, high)];
        for k in 0..SLICES as u32 {
            let next = (k + 1) % SLICES as u32;
            let [a, b] = [rings[0] + k, rings[0] + next];
            let [c, d] = [rings[1] + k, rings[1] + next];
            self.mesh.triangles.extend([[a, b, d], [a, d, c]]);
        }
        self.disk(rings[0], low, true);
        self.disk(rings[1], high, false);
    }

    /// Adds a closed cone, from the height of its base to that of its tip.
    fn head(&mut self, radius: f64, [base, tip]: [f64; 2]) {
        let (ring, is_up) = (self.ring(radius, base), tip > base);
        self.disk(ring, tip, !is_up);
        self.disk(ring, base, is_up);
    }

    /// Adds the vertices of a circle; returns the index of the first one.
    fn ring(&mut self, radius: f64, height: f64) -> u32 {
        let first = self.mesh.positions.len() as u32;
        self.mesh.positions.extend((0..SLICES).map(|k| {
            let angle = TAU * k as f64 / SLICES as f64;
            let [x, y] = self.radii;
            [(radius * x * angle.cos()) as f32, (radius * y * angle.sin()) as f32, height as f32]
        }));
        first
    }

    /// Joins a circle with a point of the axis.
    fn disk(&mut self, ring: u32, height: f64, faces_down: bool) {
        let middle = self.mesh.positions.len() as u32;
        self.mesh.positions.push([0.0, 0.0, height as f32]);
        for k in 0..SLICES as u32 {
            let [a, b] = [ring + k, ring + (k + 1) % SLICES as u32];
            self.mesh.triangles.push(if faces_down { [b, a, middle] } else { [a, b, middle] });
        }
    }
}
