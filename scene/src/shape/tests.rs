//! Tests of properties that all shapes share.
use super::*;
use crate::vector::{add_scaled, cross, dot, norm, sub};

fn all() -> Vec<Shape> {
    let tetrahedron = Sphere { radius: 0.3 }.tessellate(12);
    vec![
        Plane { half: [1.0, 2.0] }.into(),
        Sphere { radius: 0.5 }.into(),
        Capsule { radius: 0.2, half_length: 0.4 }.into(),
        Ellipsoid { radii: [0.1, 0.2, 0.3] }.into(),
        Cylinder { radius: 0.2, half_length: 0.4 }.into(),
        Box { half: [0.1, 0.2, 0.3] }.into(),
        Mesh { mesh: Arc::new(RenderMesh::new(&tetrahedron, RenderMesh::DEFAULT_CREASE_ANGLE)) }.into(),
        HeightField::new([1., 2., 0.5, 0.1], 3, 4, &[0.5; 12]).unwrap().into(),
    ]
}

#[test]
fn tessellations() {
    let volumes = [0.0, 0.524, 0.13404, 0.02513, 0.10053, 0.048, 0.10077, 2.8];
    assert_eq!(all().len(), Shape::MODULES.len(), "one shape of each kind");
    assert_eq!(all()[5].name(), "box");
    for (shape, volume) in all().iter().zip(volumes) {
        let mesh = shape.tessellate(128);
        mesh.validate().unwrap();
        let (lo, hi) = mesh.bounds().unwrap();
        let [a, b] = shape.aabb();
        for k in 0..3 {
            assert!((lo[k] - a[k]).abs() < 1e-3 && (hi[k] - b[k]).abs() < 1e-3, "{} {lo:?} {a:?}", shape.name());
        }
        if volume > 0.0 {
            assert!((mesh.signed_volume() / volume - 1.0).abs() < 0.06, "{} {}", shape.name(), mesh.signed_volume());
            let closed = RenderMesh::new(&mesh, 0.5).clusters().iter().all(|c| c.closed);
            assert!(closed, "{} is closed", shape.name());
        }
    }
}

/// A closed surface without vertices at equal positions is prepared without a search for them, with the same bits.
///
/// Regression test: a height field of 1024 x 1024 took 14.7 s, mostly in tables of edges and positions that its grid
/// does not need.
#[test]
fn closed_surfaces() {
    let boxed = Box { half: [0.1, 0.2, 0.3] };
    for mesh in [
        Sphere { radius: 1.0 }.tessellate(64),
        boxed.tessellate(1),
        Cylinder { radius: 0.2, half_length: 0.4 }.tessellate(40),
    ] {
        let [all, closed] =
            [RenderMesh::new, RenderMesh::from_closed].map(|prepare| prepare(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE));
        assert_eq!(format!("{all:?}"), format!("{closed:?}"));
    }
    // Control: an open surface is not closed.
    let plane = Plane { half: [1.0, 2.0] }.tessellate(1);
    assert!(
        !RenderMesh::new(&plane, 0.5).clusters()[0].closed && RenderMesh::from_closed(&plane, 0.5).clusters()[0].closed
    );
}

/// A deformed mesh has the triangles of the prepared mesh with moved vertices, in clusters whose spheres contain them.
///
/// Reference: the same triangles moved by the same formula, in any order.
#[test]
fn deformable_meshes() {
    let bend = |[x, y, z]: [f32; 3]| [x + 0.3 * z * z, 2.0 * y - 0.1, z + 0.2 * x];
    let mut mesh = Sphere { radius: 1.0 }.tessellate(64);
    mesh.uvs = Some(mesh.positions.iter().map(|p| [p[0], p[1]]).collect());
    let moved: Vec<_> = mesh.positions.iter().copied().map(bend).collect();
    let mut normals = vec![[0.0; 3]; moved.len()];
    smooth_normals(&moved, &mesh.triangles, &mut normals);
    let before = RenderMesh::deformable(&mesh);
    let mut drawn = before.clone();
    drawn.deform(&moved, &normals);
    let sorted = |mut list: Vec<[[u32; 3]; 3]>| {
        list.sort_unstable();
        list
    };
    let of = |positions: &[[f32; 3]], triangles: &[[u32; 3]]| {
        let corners = |t: &[u32; 3]| t.map(|i| positions[i as usize].map(f32::to_bits));
        sorted(triangles.iter().map(corners).collect())
    };
    let expected = of(&moved, &mesh.triangles);
    assert_eq!(of(drawn.positions(), drawn.triangles()), expected);
    assert_eq!(of(drawn.normals(), drawn.triangles()), of(&normals, &mesh.triangles));
    assert_eq!(drawn.uvs(), before.uvs(), "texture coordinates stay the same");
    assert_ne!(of(before.positions(), before.triangles()), expected, "control: the original is not deformed");
    assert_eq!(of(before.positions(), before.triangles()), of(&mesh.positions, &mesh.triangles));
    let distance = |a: [f32; 3], b: [f32; 3]| (0..3).map(|k| (a[k] - b[k]).powi(2)).sum::<f32>().sqrt();
    for c in drawn.clusters() {
        for k in c.first as usize..(c.first + c.count) as usize {
            for (corner, vertex) in drawn.corners()[k].into_iter().zip(drawn.triangles()[k]) {
                let p = drawn.positions()[vertex as usize];
                let lane = c.first_vertex as usize + usize::from(corner);
                assert_eq!([0, 1, 2].map(|a| drawn.cluster_positions()[a][lane]), p);
                assert!(distance(p, c.center) <= c.radius && !c.closed);
            }
        }
    }
    let [lo, hi] = drawn.bounds();
    for k in 0..3 {
        let along = moved.iter().map(|p| p[k]);
        assert_eq!((along.clone().fold(f32::MAX, f32::min), along.fold(f32::MIN, f32::max)), (lo[k], hi[k]));
    }
    assert!(!RenderMesh::new(&mesh, 0.5).is_deformable() && drawn.level_within(1.0) == 0 && drawn.levels().is_empty());
}

#[test]
fn clusters() {
    let mesh = Sphere { radius: 1.0 }.tessellate(64);
    let drawn = RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE);
    assert_eq!(drawn.triangles().len(), mesh.triangles.len());
    let mut next = 0;
    for c in drawn.clusters() {
        assert_eq!(c.first, next);
        next += c.count;
        assert_eq!(c.vertex_count % 16, 0);
        for k in c.first..next {
            for (corner, &i) in drawn.corners()[k as usize].iter().zip(&drawn.triangles()[k as usize]) {
                let lane = c.first_vertex as usize + *corner as usize;
                let p = [0, 1, 2].map(|a| drawn.cluster_positions()[a][lane]);
                assert_eq!(p, drawn.positions()[i as usize]);
                let d = crate::vector::sub(p, c.center);
                assert!(crate::vector::dot(d, d).sqrt() <= c.radius);
                assert!(crate::vector::dot(drawn.normals()[i as usize], p) > 0.99, "smooth");
            }
        }
    }
    assert_eq!(next as usize, mesh.triangles.len());
    let sharp = RenderMesh::new(&Box { half: [1.0; 3] }.tessellate(0), RenderMesh::DEFAULT_CREASE_ANGLE);
    assert_eq!(sharp.positions().len(), 24, "a box has a normal per face and corner");
    assert!(RenderMesh::new(&TriMesh::default(), 0.5).clusters().is_empty());
}

/// Corner normals have the bits of their definition: each corner sums the triangles around it on its own.
///
/// Regression test: a height field of 1024 x 1024 took 3 s before its first image, mostly in three sums for every
/// triangle where one for each vertex is enough.
#[test]
fn corner_normals() {
    let height = |k: usize| (k.wrapping_mul(2_654_435_761) >> 7 & 1023) as f32 / 1023.0;
    let terrain = |size| {
        let elevation: Vec<f32> = (0..14 * 17).map(height).collect();
        Shape::from(HeightField::new(size, 14, 17, &elevation).unwrap()).tessellate(0)
    };
    let mut flat = Sphere { radius: 1.0 }.tessellate(16);
    flat.positions[7] = flat.positions[8];
    let meshes = [
        terrain([1.0, 1.0, 1.0, 0.1]),
        terrain([1.0, 1.0, 0.01, 0.1]),
        terrain([1.0, 1.0, 0.03, 0.1]),
        Box { half: [0.1, 0.2, 0.3] }.tessellate(1),
        Cylinder { radius: 0.2, half_length: 0.4 }.tessellate(10),
        flat,
    ];
    let mut creases = [0; 2];
    for mut mesh in meshes {
        mesh.normals = None;
        let (welded, faces) = (crease::weld(&mesh.positions), crease::face_normals(&mesh));
        for angle in [0.0, 0.1, RenderMesh::DEFAULT_CREASE_ANGLE, 1.7, 3.2] {
            let normals = crease::corner_normals(&mesh, &welded, &faces, angle);
            let limit = f32::cos(angle);
            for (k, t) in mesh.triangles.iter().enumerate() {
                for (c, &i) in t.iter().enumerate() {
                    let (mut sum, mut left_out) = ([0.0f32; 3], false);
                    for (other, around) in mesh.triangles.iter().enumerate() {
                        for corner in (0..3).filter(|&corner| welded[around[corner] as usize] == welded[i as usize]) {
                            if crate::vector::dot(faces[other], faces[k]) >= limit {
                                let w = crease::angles(&mesh, around)[corner];
                                sum = [0, 1, 2].map(|a| sum[a] + w * faces[other][a]);
                            } else {
                                left_out = true;
                            }
                        }
                    }
                    creases[usize::from(left_out)] += 1;
                    let normal = crease::unit(sum).unwrap_or(faces[k]);
                    assert_eq!(normals[k][c].map(f32::to_bits), normal.map(f32::to_bits), "{k} {c} at {angle}");
                }
            }
        }
    }
    assert!(creases.iter().all(|&count| count > 1000), "with and without creases: {creases:?}");
}

/// Codes of the space-filling curve move each bit to its position.
#[test]
fn curve() {
    for v in 0..1024u32 {
        assert_eq!(render_mesh::spread_bits(v), (0..10).fold(0, |out, bit| out | (v >> bit & 1) << (3 * bit)), "{v}");
    }
}

#[test]
fn sizes() {
    assert_eq!(Shape::from(Sphere { radius: -1.0 }).invalid_size(), Some(-1.0));
    assert!(Shape::from(Box { half: [1.0, f32::NAN, 1.0] }).invalid_size().unwrap().is_nan());
    assert_eq!(Shape::from(Plane::INFINITE).invalid_size(), None);
    assert!(HeightField::new([1.; 4], 1, 3, &[0.; 3]).is_none());
}

/// Triangles are kept in any order, with their corners, winding and texture coordinates, and a normal for each vertex.
#[test]
fn mesh_of_a_render_mesh() {
    let mut mesh = Box { half: [0.1, 0.2, 0.3] }.tessellate(1);
    mesh.uvs = Some(mesh.positions.iter().map(|p| [p[0] + 1.0, p[1] - p[2]]).collect());
    let back = RenderMesh::new(&mesh, RenderMesh::DEFAULT_CREASE_ANGLE).to_tri_mesh();
    back.validate().unwrap();
    let corners = |mesh: &TriMesh| {
        let uvs = mesh.uvs.as_ref().unwrap();
        let corner = |&i: &u32| {
            let (p, uv) = (mesh.positions[i as usize], uvs[i as usize]);
            [p[0], p[1], p[2], uv[0], uv[1]].map(|x| (x * 1000.0).round() as i64)
        };
        let triangle = |triangle: &[u32; 3]| {
            let mut corners = triangle.each_ref().map(corner);
            // Rotating the smallest corner to the front keeps the winding.
            let least = (0..3).min_by_key(|&k| corners[k]).unwrap();
            corners.rotate_left(least);
            corners
        };
        let mut triangles: Vec<_> = mesh.triangles.iter().map(triangle).collect();
        triangles.sort_unstable();
        triangles
    };
    assert_eq!(corners(&back), corners(&mesh));
    assert!((back.signed_volume() - 0.048).abs() < 1e-6);
    let normals = back.normals.unwrap();
    for triangle in &back.triangles {
        let [a, b, c] = triangle.map(|i| nalgebra::Vector3::from(back.positions[i as usize]));
        let normal = (b - a).cross(&(c - a)).normalize();
        // Edges of a box are sharp: each vertex has the normal of its face.
        assert!(triangle.iter().all(|&i| (nalgebra::Vector3::from(normals[i as usize]) - normal).norm() < 1e-6));
    }
}

/// Directions over the whole sphere, on a spiral.
fn directions(count: u32) -> impl Iterator<Item = V3> {
    (0..count).map(move |k| {
        let z = 1.0 - 2.0 * (f64::from(k) + 0.5) / f64::from(count);
        let (sin, cos) = (2.4 * f64::from(k)).sin_cos();
        [(1.0 - z * z).sqrt() * cos, (1.0 - z * z).sqrt() * sin, z]
    })
}

/// Support, extent and convex hull of a shape agree with its triangles, which are inside by 1 - cos(pi / 512) of a
/// radius.
#[test]
fn supports_and_hulls() {
    for shape in all() {
        let mesh = shape.tessellate(512);
        for direction in directions(60) {
            let [low, high] = shape.extent(direction);
            let [least, most] = extent(&mesh.positions, direction);
            assert_eq!(high, shape.support(direction), "{}", shape.name());
            let inside = |x: f64| (-1e-6..1e-4).contains(&x);
            assert!(inside(high - most) && inside(least - low), "{}: {low} {high}, {least} {most}", shape.name());
            let mut hull = f64::NEG_INFINITY;
            shape.hull(&mut |part| {
                let reach = |at: V3, radii: V3| dot(at, direction) + norm([0, 1, 2].map(|k| radii[k] * direction[k]));
                hull = hull.max(match part {
                    HullPart::Point(at) => reach(at, [0.0; 3]),
                    HullPart::Ellipsoid { center, radii } => reach(center, radii),
                });
            });
            assert!((hull - high).abs() < 1e-9, "{}: {hull} {high}", shape.name());
        }
    }
}

/// Sampled points are on the surface, where a ray against their normal hits it; the area is that of the triangles.
#[test]
fn area_samplings() {
    let mut sampled = 0;
    for shape in all() {
        let mesh = shape.tessellate(256);
        let corners = |t: &[u32; 3]| t.map(|i| to_f64(mesh.positions[i as usize]));
        let areas = mesh.triangles.iter().map(corners).map(|[a, b, c]| norm(cross(sub(b, a), sub(c, a))) / 2.0);
        let expected: f64 = areas.sum();
        if let Some(triangles) = shape.triangle_sampling() {
            assert!((triangles.area() / expected - 1.0).abs() < 1e-6, "{}", shape.name());
        }
        let Some(sampling) = shape.area_sampling() else { continue };
        sampled += 1;
        assert!((sampling.area() / expected - 1.0).abs() < 1e-3, "{}: {} {expected}", shape.name(), sampling.area());
        for (k, [x, y, z]) in directions(500).enumerate() {
            let [side, a, b] = [(k as f64 + 0.5) / 500.0, 0.5 + 0.499 * x, 0.5 + 0.499 * y.max(z)];
            let SurfacePoint { position, normal, .. } = sampling.sample(side, [a, b]);
            let ray = Ray { origin: add_scaled(position, 0.01, normal), direction: normal.map(|x| -x) };
            let found = shape.intersect(&ray, 1.0).unwrap();
            assert!((found.t - 0.01).abs() < 1e-9, "{}: {position:?} {normal:?} {found:?}", shape.name());
            assert!(dot(found.normal, normal).abs() > 1.0 - 1e-9, "{}: {normal:?} {found:?}", shape.name());
            assert!(shape.face(&found, &ray) < crate::RenderScene::IDS_OF_PRIMITIVE as usize);
        }
    }
    assert_eq!(sampled, 4, "planes, spheres, cylinders and boxes");
}
