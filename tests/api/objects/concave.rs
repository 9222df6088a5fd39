//! Concave meshes: convex pieces, and triangle by triangle.

use super::*;
use kinetoscope::ndarray::array;
use kinetoscope::scene::mesh::ConvexDecompositionCfg;
use kinetoscope::sim::MeshCollision;
use kinetoscope_testkit::error_tables::assert_error;
use kinetoscope_testkit::worlds::count_diagnostics;
use std::f32::consts::{FRAC_PI_2, TAU};

const R: f64 = 0.05;

/// An L profile: a foot of 25 cm height from x = 0 to 1, with a wall up to 1 m at its beginning.
fn ell() -> TriMesh {
    let outline = [[0.0, 0.0], [1.0, 0.0], [1.0, 0.25], [0.25, 0.25], [0.25, 1.0], [0.0, 1.0]];
    prism(&outline, &[[0, 1, 2], [0, 2, 3], [0, 3, 4], [0, 4, 5]], 1)
}

/// A valley along y with sides that rise at 45 degrees from z = 0.
fn valley(parts: u32) -> TriMesh {
    let outline = [[-0.5, -0.2], [0.5, -0.2], [0.5, 0.5], [0.0, 0.0], [-0.5, 0.5]];
    prism(&outline, &[[0, 1, 3], [1, 2, 3], [0, 3, 4]], parts)
}

/// A hollow hemisphere, open above, with its center at the origin.
fn bowl(inner: f32, outer: f32, rings: u32, sides: u32) -> TriMesh {
    let ring = |radius: f32, k: u32| {
        let (across, down) = (FRAC_PI_2 * k as f32 / rings as f32).sin_cos();
        (0..sides).map(move |s| {
            let (sin, cos) = (TAU * s as f32 / sides as f32).sin_cos();
            [radius * across * cos, radius * across * sin, -radius * down]
        })
    };
    // Vertices from the lowest point upward, first inside, then outside.
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
            // Inside, seen from the center; outside, seen from below.
            let all = [[a, d, c], [a, c, b], [e, g, h], [e, f, g]];
            triangles.extend(all.into_iter().filter(|t| t[0] != t[1] && t[1] != t[2] && t[0] != t[2]));
        }
        let (i, o) = ([at(0, rings, s), at(0, rings, s + 1)], [at(first, rings, s), at(first, rings, s + 1)]);
        triangles.extend([[i[0], o[0], o[1]], [i[0], o[1], i[1]]]);
    }
    TriMesh::from_triangles(positions, triangles)
}

/// A ball of radius R with damping.
fn damped_ball(at: [f64; 3]) -> RigidObjectCfg {
    RigidObjectCfg { linear_damping: 2.0, angular_damping: 0.01, ..ball("ball", R, 0.5, at) }
}

fn collides(mesh: RigidObjectCfg, mesh_collision: MeshCollision) -> RigidObjectCfg {
    RigidObjectCfg { mesh_collision, ..mesh }
}

/// The position of a ball after three seconds in a static mesh, without ground.
fn resting_position(mesh: &TriMesh, collision: MeshCollision, from: [f64; 3]) -> [f64; 3] {
    let files = TempFiles::default();
    let mut sim = empty(1);
    let cfg = object("mesh", ObjectShape::mesh(obj(&files, "m.obj", mesh)), [0.0; 3]);
    sim.add_rigid_object(collides(fixed(cfg), collision)).unwrap();
    assert_eq!(sim.diagnostics(), []);
    let ball = sim.add_rigid_object(damped_ball(from)).unwrap();
    sim.update(3000);
    let pose = sim.rigid_object(ball).pose();
    [0, 1, 2].map(|k| pose[(0, k)])
}

fn pieces(max_pieces: usize, tolerance: f64) -> MeshCollision {
    MeshCollision::Pieces(ConvexDecompositionCfg { max_pieces, tolerance })
}

fn triangles(thickness: f64) -> MeshCollision {
    MeshCollision::Triangles { thickness }
}

/// A ball rests on the foot of an L, at its height plus the ball's radius. On the convex hull there is a slope from the
/// wall's top to the foot's end, so that the ball rolls off.
///
/// The distance of a ball's center from the bowl's center is at least the inner radius minus the ball's radius, minus
/// the distance of the pieces above the surface (4 mm), and at most the difference of the radii; chords of 48 sides are
/// 0.2 (1 - cos(π/48)) = 0.43 mm inside.
#[test]
fn balls_on_pieces() {
    let from = [0.6, 0.0, 0.9];
    let found = resting_position(&ell(), pieces(4, 1e-3), from);
    assert_number("height on the foot", found[2], 0.25 + R, SOFT);
    assert!((found[0] - 0.6).abs() < 1e-2, "{found:?}");
    let hull = resting_position(&ell(), MeshCollision::Hull, from);
    assert!(hull[2] < -1.0, "the control: it falls off the hull: {hull:?}");

    let mesh = bowl(0.2, 0.23, 12, 48);
    assert!(mesh.is_closed() && mesh.signed_volume() > 0.0);
    let found = resting_position(&mesh, pieces(200, 4e-3), [0.06, -0.03, 0.1]);
    let gap = 0.2 - R - found.iter().map(|x| x * x).sum::<f64>().sqrt();
    assert!(gap > -SOFT.absolute && gap < 4e-3 + 0.43e-3, "{found:?} {gap}");
    // The ball rests low: a flat facet of a piece is 2 sqrt(2 · 0.2 · 0.004) = 8 cm wide, 4 cm from its middle.
    assert!(found[2] < -0.15 + 4.5e-3 && found[0].hypot(found[1]) < 0.05, "{found:?}");
    let hull = resting_position(&mesh, MeshCollision::Hull, [0.0, 0.0, 0.1]);
    assert_number("the control: it lies on the rim", hull[2], R, SOFT);
}

/// A ball between two planes at 45 degrees has its center R sqrt(2) above their line; on the hull it rests on top. In a
/// bowl chords of 24 sides and 12 rings are 0.2 (1 - cos(π/24)) = 1.7 mm inside.
#[test]
fn balls_on_triangles() {
    let from = [0.1, 0.03, 0.3];
    let chords = Tolerance::absolute(2.2e-3, "chords are 1.7 mm inside, and the contact is soft");
    for (what, mesh, collision, from, height, within, across) in [
        ("valley", valley(1), triangles(0.02), from, R * 2f64.sqrt(), SOFT * 2.0, SOFT.absolute),
        ("valley in parts", valley(7), triangles(0.005), from, R * 2f64.sqrt(), SOFT * 2.0, SOFT.absolute),
        ("the control: hull", valley(1), MeshCollision::Hull, [0.1, 0.03, 0.6], 0.5 + R, SOFT, 1.0),
        ("channel", channel(), triangles(0.02), [0.1, 0.0, 0.3], 0.1 + R, SOFT, 1.0),
        ("bowl", bowl(0.2, 0.23, 12, 24), triangles(0.01), [0.06, -0.03, 0.1], R - 0.2, chords, 0.02),
    ] {
        let found = resting_position(&mesh, collision, from);
        let off = if what == "bowl" { found[0].hypot(found[1]) } else { found[0].abs() };
        assert_number(what, found[2], height, within);
        assert!(off < across, "{what}: {found:?}");
    }
}

/// Sliding along a valley over edges between coplanar triangles, without friction and damping. The ball neither climbs
/// nor stops, but every edge slows it slightly, as documented at `MeshCollision::Triangles`.
#[test]
fn sliding_over_edges() {
    let files = TempFiles::default();
    let mut sim = empty(1);
    let smooth = |cfg| RigidObjectCfg { friction: Some([0.0; 3]), ..cfg };
    let cfg = object("mesh", ObjectShape::mesh(obj(&files, "m.obj", &valley(20))), [0.0; 3]);
    sim.add_rigid_object(smooth(collides(fixed(cfg), triangles(0.02)))).unwrap();
    let height = R * 2f64.sqrt();
    let ball = object("ball", ObjectShape::Sphere { radius: R }, [0.0, -0.4, height]);
    let ball = sim.add_rigid_object(smooth(ball)).unwrap();
    sim.update(300);
    sim.rigid_object_mut(ball).write_velocity(&row([0.0, 0.5, 0.0, 0.0, 0.0, 0.0]), None).unwrap();
    let mut highest = f64::NEG_INFINITY;
    for _ in 0..1500 {
        sim.update(1);
        highest = highest.max(sim.rigid_object(ball).pose()[(0, 2)]);
    }
    let (pose, velocity) = (sim.rigid_object(ball).pose(), sim.rigid_object(ball).velocity());
    assert!(pose[(0, 1)] > 0.2 && velocity[(0, 1)] > 0.3, "it came along: {pose} {velocity}");
    assert!((highest - height).abs() < 2e-3, "and did not jump: {highest}");
}

/// The prism of a triangle of 1 mm by 2e-10 m is below MuJoCo's minimum: it is left out with a diagnostic, and the
/// scene is valid.
#[test]
fn slivers() {
    let files = TempFiles::default();
    let mut corners = vec![[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [0.0, 1.0, 0.0]];
    corners.extend([[0.0, 0.0, 0.0], [1e-3, 0.0, 0.0], [5e-4, 2e-10, 0.0]]);
    let mesh = TriMesh::from_triangles(corners, vec![[0, 1, 2], [3, 4, 5]]);
    let mut sim = empty(1);
    let cfg = object("mesh", ObjectShape::mesh(obj(&files, "m.obj", &mesh)), [0.0; 3]);
    sim.add_rigid_object(collides(fixed(cfg), triangles(0.01))).unwrap();
    for words in ["1 triangles are too thin", "the volume behind it does not"] {
        assert!(count_diagnostics(&sim, &[words]) > 0, "{:?}", sim.diagnostics());
    }
    let ball = sim.add_rigid_object(damped_ball([0.0, -0.2, 0.1])).unwrap();
    sim.update(1000);
    assert_number("height", sim.rigid_object(ball).pose()[(0, 2)], R, SOFT);
}

/// A moving L collides in pieces too, with the mass of the enclosed volume.
#[test]
fn moving_pieces() {
    let files = TempFiles::default();
    let mut sim = sim(SimulationManagerCfg { physics_dt: 1e-3, ..Default::default() });
    let cfg = object("ell", ObjectShape::mesh(obj(&files, "l.obj", &ell())), [0.0, 0.0, 0.001]);
    let id = sim.add_rigid_object(collides(cfg, pieces(4, 1e-3))).unwrap();
    assert!((sim.rigid_object(id).nominal_mass() / (1000.0 * (0.25 + 0.75 * 0.25)) - 1.0).abs() < 1e-6);
    let ball = sim.add_rigid_object(damped_ball([0.7, 0.1, 0.4])).unwrap();
    sim.update(2000);
    let (lies, stands) = (sim.rigid_object(ball).pose(), sim.rigid_object(id).pose());
    assert_number("the ball", lies[(0, 2)], 0.25 + R, SOFT * 2.0);
    assert_number("the L", stands[(0, 2)], 0.0, SOFT);
    // Friction applies to all pieces, which share one mask id.
    sim.rigid_object_mut(id).set_friction(&array![[0.3, 0.01, 0.001]], None).unwrap();
    sim.batch().read(0, |env| {
        let model = env.data().model();
        let body = model.id(kinetoscope::mujoco::ObjectKind::Body, "ell").unwrap();
        let of = |geom: &usize| model.geom_bodyid()[*geom] as usize == body && model.geom_contype()[*geom] != 0;
        let frictions: Vec<f64> = (0..model.ngeom()).filter(of).map(|geom| model.geom_friction()[3 * geom]).collect();
        assert_eq!(frictions, [0.3; 2]);
    });
    assert_eq!(sim.scene().mask_ids().iter().filter(|id| id.object == "ell").count(), 1);
}

#[test]
fn refusals() {
    let files = TempFiles::default();
    let mut sim = empty(1);
    let mesh = object("o", ObjectShape::mesh(obj(&files, "m.obj", &valley(1))), [0.0; 3]);
    let many = object("o", ObjectShape::mesh(obj(&files, "many.obj", &valley(300))), [0.0; 3]);
    for (cfg, parts) in [
        (collides(mesh.clone(), triangles(0.01)), &["Pieces"][..]),
        (collides(fixed(mesh.clone()), triangles(0.0)), &["thickness"]),
        (collides(fixed(mesh.clone()), triangles(f64::NAN)), &["thickness"]),
        (collides(mesh.clone(), pieces(0, 1e-3)), &["max_pieces"]),
        (collides(mesh.clone(), pieces(8, -1.0)), &["tolerance"]),
        (collides(object("o", ObjectShape::cube(0.1), [0.0; 3]), pieces(8, 1e-3)), &["ObjectShape::Mesh"]),
        (collides(fixed(many), triangles(0.01)), &["3006 triangles", "2000"]),
    ] {
        let kind = if parts.len() == 1 { "Config { field: \"mesh_collision\"" } else { "" };
        assert_error(sim.add_rigid_object(cfg), kind, parts);
    }
    // A limit of too few pieces gives a diagnostic.
    let round = ObjectShape::mesh(obj(&files, "bowl.obj", &bowl(0.2, 0.23, 6, 24)));
    sim.add_rigid_object(collides(object("o", round, [0.0; 3]), pieces(3, 1e-4))).unwrap();
    let reported = count_diagnostics(&sim, &["3 convex pieces"]);
    assert_eq!((reported, sim.diagnostics().len()), (1, 1), "{:?}", sim.diagnostics());
}
