//! Meshes that are not convex: in pieces, and triangle by triangle.
//!
//! Contacts are soft: with MuJoCo's default reference a body sinks in by (1 - d) g / (d k) = 0.1 g / (0.9 · 2770 /s²) = 0.4 mm
//! at most (k = 1 / (0.95 · 0.02 s)²): SOFT.

use super::{Files, channel, empty, object};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::scene::mesh::{PiecesCfg, TriMesh};
use std::f32::consts::{FRAC_PI_2, TAU};

const SOFT: f64 = 5e-4;
const R: f64 = 0.05;

/// A prism along y over an outline in x and z, counter-clockwise, which `cut` divides into triangles; from -0.5 to 0.5 in
/// `parts` parts.
fn along_y(outline: &[[f32; 2]], cut: &[[u32; 3]], parts: u32) -> TriMesh {
    let n = outline.len() as u32;
    let ring = |k: u32| outline.iter().map(move |&[x, z]| [x, k as f32 / parts as f32 - 0.5, z]);
    let last = n * parts;
    let back = cut.iter().map(|&[a, b, c]| [a + last, c + last, b + last]);
    let rim = (0..parts).flat_map(|part| {
        (0..n).flat_map(move |k| {
            let (here, next) = (part * n + k, part * n + (k + 1) % n);
            [[here, here + n, next + n], [here, next + n, next]]
        })
    });
    let triangles = cut.iter().copied().chain(back).chain(rim).collect();
    TriMesh::from_triangles((0..=parts).flat_map(ring).collect(), triangles)
}

/// An L: a foot of 25 cm height from x = 0 to 1, a wall up to 1 m at its beginning.
fn ell() -> TriMesh {
    let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.25], [0.25, 0.25], [0.25, 1.0], [0.0, 1.0]];
    along_y(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 1)
}

/// A valley along y whose sides rise at 45 degrees from z = 0.
fn valley(parts: u32) -> TriMesh {
    let outline = [[-0.5, -0.2], [0.5, -0.2], [0.5, 0.5], [0.0, 0.0], [-0.5, 0.5]];
    along_y(&outline, &[[0, 1, 3], [1, 2, 3], [0, 3, 4]], parts)
}

/// Half a hollow ball, open above, its middle in the origin.
fn bowl(inner: f32, outer: f32, rings: u32, sides: u32) -> TriMesh {
    let ring = |radius: f32, k: u32| {
        let (across, down) = (FRAC_PI_2 * k as f32 / rings as f32).sin_cos();
        (0..sides).map(move |s| {
            let (sin, cos) = (TAU * s as f32 / sides as f32).sin_cos();
            [radius * across * cos, radius * across * sin, -radius * down]
        })
    };
    // From the lowest point up, inside and then outside.
    let mut positions = vec![[0.0, 0.0, -inner]];
    positions.extend((1..=rings).flat_map(|k| ring(inner, k)));
    let first = positions.len() as u32;
    positions.push([0.0, 0.0, -outer]);
    positions.extend((1..=rings).flat_map(|k| ring(outer, k)));
    let at = |base: u32, k: u32, s: u32| if k == 0 { base } else { base + 1 + (k - 1) * sides + s % sides };
    let mut triangles = Vec::new();
    for s in 0..sides {
        for k in 0..rings {
            let quad = |base| [at(base, k, s), at(base, k, s + 1), at(base, k + 1, s + 1), at(base, k + 1, s)];
            let ([a, b, c, d], [e, f, g, h]) = (quad(0), quad(first));
            // Inside, seen from the middle; outside, seen from below.
            triangles.extend(
                [[a, d, c], [a, c, b], [e, g, h], [e, f, g]]
                    .into_iter()
                    .filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2]),
            );
        }
        let (i, o) = ([at(0, rings, s), at(0, rings, s + 1)], [at(first, rings, s), at(first, rings, s + 1)]);
        triangles.extend([[i[0], o[0], o[1]], [i[0], o[1], i[1]]]);
    }
    TriMesh::from_triangles(positions, triangles)
}

/// A ball of radius R that stops by itself.
fn ball(at: [f64; 3]) -> RigidObjectCfg {
    let ball = object("ball", ObjectShape::Sphere { radius: R }, at);
    RigidObjectCfg { mass: Some(0.5), linear_damping: 2.0, angular_damping: 0.01, ..ball }
}

/// Where a ball lies after three seconds in a mesh that stands, in environments without ground.
fn lies(mesh: &TriMesh, mesh_collision: MeshCollision, from: [f64; 3]) -> [f64; 3] {
    let files = Files::new();
    let mut sim = empty(1);
    let cfg = object("mesh", ObjectShape::mesh(files.obj("m.obj", mesh)), [0.0; 3]);
    sim.add_rigid_object(RigidObjectCfg { body_type: BodyType::Static, mesh_collision, ..cfg }).unwrap();
    assert_eq!(sim.diagnostics(), []);
    let ball = sim.add_rigid_object(ball(from)).unwrap();
    sim.update(3000);
    let pose = sim.rigid_object(ball).get_pose();
    [0, 1, 2].map(|k| pose[(0, k)])
}

fn pieces(max_pieces: usize, tolerance: f64) -> MeshCollision {
    MeshCollision::Pieces(PiecesCfg { max_pieces, tolerance })
}

/// On the foot of an L: its height and the ball's radius. On the hull there is a slope from the wall's top to the foot's end,
/// which it rolls down and off.
#[test]
fn a_ball_lies_on_the_foot_of_an_ell() {
    let from = [0.6, 0.0, 0.9];
    let found = lies(&ell(), pieces(4, 1e-3), from);
    assert!((found[2] - 0.25 - R).abs() < SOFT && (found[0] - 0.6).abs() < 1e-2, "{found:?}");
    let hull = lies(&ell(), MeshCollision::Hull, from);
    assert!(hull[2] < -1.0, "the control: it falls off the hull: {hull:?}");
}

/// The middle of a ball in a bowl is nowhere nearer to the bowl's middle than the inner radius less the ball's, less what the
/// pieces may be above the surface (4 mm), and nowhere farther; chords of 48 sides are 0.2 (1 - cos(π/48)) = 0.43 mm inside.
#[test]
fn a_ball_lies_in_a_bowl() {
    let mesh = bowl(0.2, 0.23, 12, 48);
    assert!(mesh.is_closed() && mesh.signed_volume() > 0.0);
    let distance = |p: [f64; 3]| p.iter().map(|x| x * x).sum::<f64>().sqrt();
    let found = lies(&mesh, pieces(200, 4e-3), [0.06, -0.03, 0.1]);
    let gap = 0.2 - R - distance(found);
    assert!(gap > -SOFT && gap < 4e-3 + 0.43e-3, "{found:?} {gap}");
    // It lies low: a flat part of a piece is 2 sqrt(2 · 0.2 · 0.004) = 8 cm wide, 4 cm from its middle.
    assert!(found[2] < -0.15 + 4.5e-3 && found[0].hypot(found[1]) < 0.05, "{found:?}");
    let hull = lies(&mesh, MeshCollision::Hull, [0.0, 0.0, 0.1]);
    assert!((hull[2] - R).abs() < SOFT, "the control: it lies on the rim: {hull:?}");
}

/// A ball between two planes at 45 degrees has its middle R sqrt(2) above their line; on the hull it lies on top.
#[test]
fn a_ball_lies_in_a_valley_of_triangles() {
    for (parts, thickness) in [(1, 0.02), (7, 0.005)] {
        let found = lies(&valley(parts), MeshCollision::Triangles { thickness }, [0.1, 0.03, 0.3]);
        assert!((found[2] - R * 2f64.sqrt()).abs() < 2.0 * SOFT && found[0].abs() < SOFT, "{parts} parts: {found:?}");
    }
    let hull = lies(&valley(1), MeshCollision::Hull, [0.1, 0.03, 0.6]);
    assert!((hull[2] - 0.5 - R).abs() < SOFT, "the control: {hull:?}");
    // The channel of the other tests: its floor is 10 cm high, its walls keep the ball in.
    let found = lies(&channel(), MeshCollision::Triangles { thickness: 0.02 }, [0.1, 0.0, 0.3]);
    assert!((found[2] - 0.1 - R).abs() < SOFT, "{found:?}");
    // A bowl of 2 · 12 · 24 - ... triangles: chords of 24 sides and 12 rings are 0.2 (1 - cos(π/24)) = 1.7 mm inside.
    let found = lies(&bowl(0.2, 0.23, 12, 24), MeshCollision::Triangles { thickness: 0.01 }, [0.06, -0.03, 0.1]);
    assert!((found[2] + 0.2 - R).abs() < 2.2e-3 && found[0].hypot(found[1]) < 0.02, "{found:?}");
}

/// Sliding along a valley over edges between coplanar triangles, without friction and damping: it neither climbs nor stops,
/// but every edge brakes it a little, as `MeshCollision::Triangles` says.
#[test]
fn a_ball_slides_over_edges_of_triangles() {
    let files = Files::new();
    let mut sim = empty(1);
    let cfg = object("mesh", ObjectShape::mesh(files.obj("m.obj", &valley(20))), [0.0; 3]);
    let smooth = Some([0.0; 3]);
    let mesh_collision = MeshCollision::Triangles { thickness: 0.02 };
    sim.add_rigid_object(RigidObjectCfg { body_type: BodyType::Static, mesh_collision, friction: smooth, ..cfg })
        .unwrap();
    let height = R * 2f64.sqrt();
    let ball = object("ball", ObjectShape::Sphere { radius: R }, [0.0, -0.4, height]);
    let ball = sim.add_rigid_object(RigidObjectCfg { friction: smooth, ..ball }).unwrap();
    sim.update(300);
    sim.rigid_object_mut(ball).write_velocity(&array![[0.0, 0.5, 0.0, 0.0, 0.0, 0.0]], None).unwrap();
    let mut highest = f64::NEG_INFINITY;
    for _ in 0..1500 {
        sim.update(1);
        highest = highest.max(sim.rigid_object(ball).get_pose()[(0, 2)]);
    }
    let (pose, velocity) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(ball).get_velocity());
    assert!(pose[(0, 1)] > 0.2 && velocity[(0, 1)] > 0.3, "it came along: {pose} {velocity}");
    assert!((highest - height).abs() < 2e-3, "and did not jump: {highest}");
}

/// A triangle of 1 mm by 2e-10 m has a prism of less than MuJoCo takes: it is left out and said, and the scene stands.
#[test]
fn slivers_are_left_out_and_open_meshes_named() {
    let files = Files::new();
    let corners = vec![
        [-1.0, -1.0, 0.0],
        [1.0, -1.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.0, 0.0, 0.0],
        [1e-3, 0.0, 0.0],
        [5e-4, 2e-10, 0.0],
    ];
    let mesh = TriMesh::from_triangles(corners, vec![[0, 1, 2], [3, 4, 5]]);
    let mut sim = empty(1);
    let cfg = object("mesh", ObjectShape::mesh(files.obj("m.obj", &mesh)), [0.0; 3]);
    let mesh_collision = MeshCollision::Triangles { thickness: 0.01 };
    sim.add_rigid_object(RigidObjectCfg { body_type: BodyType::Static, mesh_collision, ..cfg }).unwrap();
    let said: Vec<String> = sim.diagnostics().iter().map(ToString::to_string).collect();
    assert!(said.iter().any(|said| said.contains("1 triangles are too thin")), "{said:?}");
    assert!(said.iter().any(|said| said.contains("not all that is behind it")), "{said:?}");
    let ball = sim.add_rigid_object(ball([0.0, -0.2, 0.1])).unwrap();
    sim.update(1000);
    assert!((sim.rigid_object(ball).get_pose()[(0, 2)] - R).abs() < SOFT);
}

/// What moves collides in pieces too, and weighs what its triangles enclose.
#[test]
fn an_ell_that_moves_carries_a_ball() {
    let files = Files::new();
    let mut sim = SimulationManager::new(SimulationManagerCfg { physics_dt: 1e-3, ..Default::default() }).unwrap();
    let cfg = object("ell", ObjectShape::mesh(files.obj("l.obj", &ell())), [0.0, 0.0, 0.001]);
    let id = sim.add_rigid_object(RigidObjectCfg { mesh_collision: pieces(4, 1e-3), ..cfg }).unwrap();
    assert!((sim.rigid_object(id).mass() / (1000.0 * (0.25 + 0.75 * 0.25)) - 1.0).abs() < 1e-6);
    let ball = sim.add_rigid_object(ball([0.7, 0.1, 0.4])).unwrap();
    sim.update(2000);
    let (lies, stands) = (sim.rigid_object(ball).get_pose(), sim.rigid_object(id).get_pose());
    assert!((lies[(0, 2)] - 0.25 - R).abs() < 2.0 * SOFT && stands[(0, 2)].abs() < SOFT, "{lies} {stands}");
    // Friction of all pieces at once, and one mask id.
    sim.rigid_object_mut(id).set_friction(&array![[0.3, 0.01, 0.001]], None).unwrap();
    sim.batch().read(0, |env| {
        let model = env.data().model();
        let body = model.id(kinetoscope::sim::mj::ObjectKind::Body, "ell").unwrap();
        let of = |geom: &usize| model.geom_bodyid()[*geom] as usize == body && model.geom_contype()[*geom] != 0;
        let shapes: Vec<usize> = (0..model.ngeom()).filter(of).collect();
        assert_eq!(shapes.len(), 2);
        assert!(shapes.iter().all(|geom| model.geom_friction()[3 * geom] == 0.3));
    });
    assert_eq!(sim.mask_ids().iter().filter(|id| id.object == "ell").count(), 1);
}

#[test]
fn collisions_that_cannot_be_are_named() {
    let files = Files::new();
    let mut sim = empty(1);
    let path = files.obj("m.obj", &valley(1));
    let mesh = object("o", ObjectShape::mesh(&path), [0.0; 3]);
    let fixed = RigidObjectCfg { body_type: BodyType::Static, ..mesh.clone() };
    let cases = [
        (RigidObjectCfg { mesh_collision: MeshCollision::Triangles { thickness: 0.01 }, ..mesh.clone() }, "Pieces"),
        (RigidObjectCfg { mesh_collision: MeshCollision::Triangles { thickness: 0.0 }, ..fixed.clone() }, "thickness"),
        (
            RigidObjectCfg { mesh_collision: MeshCollision::Triangles { thickness: f64::NAN }, ..fixed.clone() },
            "thickness",
        ),
        (RigidObjectCfg { mesh_collision: pieces(0, 1e-3), ..mesh.clone() }, "max_pieces"),
        (RigidObjectCfg { mesh_collision: pieces(8, -1.0), ..mesh.clone() }, "tolerance"),
        (
            RigidObjectCfg { mesh_collision: pieces(8, 1e-3), ..object("o", ObjectShape::cube(0.1), [0.0; 3]) },
            "ObjectShape::Mesh",
        ),
    ];
    for (cfg, says) in cases {
        let error = sim.add_rigid_object(cfg).unwrap_err();
        assert!(matches!(&error, Error::Config { field: "mesh_collision", .. }), "{error}");
        assert!(error.to_string().contains(says), "{error}");
    }
    let many = files.obj("many.obj", &valley(300));
    let cfg = RigidObjectCfg {
        shape: ObjectShape::mesh(many),
        mesh_collision: MeshCollision::Triangles { thickness: 0.01 },
        ..fixed
    };
    let error = sim.add_rigid_object(cfg).unwrap_err().to_string();
    assert!(error.contains("3006 triangles") && error.contains("2000"), "{error}");
    // Too few pieces are said.
    let round = files.obj("bowl.obj", &bowl(0.2, 0.23, 6, 24));
    let cfg = RigidObjectCfg { shape: ObjectShape::mesh(round), mesh_collision: pieces(3, 1e-4), ..mesh };
    sim.add_rigid_object(cfg).unwrap();
    let [diagnostic] = sim.diagnostics() else { panic!("{:?}", sim.diagnostics()) };
    assert!(diagnostic.to_string().contains("3 convex pieces"), "{diagnostic}");
}
