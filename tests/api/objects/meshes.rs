//! Mesh objects and cones: mass, sensors, collision and export.

use super::*;
use kinetoscope::mujoco::{BUILD_VERSION, ObjectKind, SupportedVersion, compile_file};
use kinetoscope::ndarray::array;
use kinetoscope::scene::mesh::write_binary_stl;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};
use kinetoscope::sim::RigidObjectId;
use nalgebra::{Matrix3, Vector3};

/// MuJoCo's mass, center of mass and inertia tensor about it, in the object's frame.
fn body(sim: &SimulationManager, id: RigidObjectId) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let uid = sim.rigid_object(id).uid();
    sim.batch().read(0, |env| {
        let model = env.data().model();
        let b = model.id(ObjectKind::Body, uid).unwrap();
        let q = std::array::from_fn(|k| model.body_iquat()[4 * b + k]);
        let turn = kinetoscope::scene::pose::from_wxyz(q).to_rotation_matrix();
        let moments = Vector3::from_column_slice(&model.body_inertia()[3 * b..3 * b + 3]);
        let tensor = turn.matrix() * Matrix3::from_diagonal(&moments) * turn.matrix().transpose();
        (model.body_mass()[b], Vector3::from_column_slice(&model.body_ipos()[3 * b..3 * b + 3]), tensor)
    })
}

/// Side lengths that are exact in single precision: mass, center and moments of the mesh equal those of the box, up to
/// rounding.
#[test]
fn box_mesh() {
    let files = TempFiles::default();
    let size = [0.25_f32, 0.5, 0.125];
    let mesh = ObjectShape::mesh(obj(&files, "b.obj", &brick(size, size.map(|s| -s / 2.0))));
    let mut sim = weightless(1);
    let [boxed, meshed] = [("box", ObjectShape::Box { size: size.map(f64::from) }, 0.0), ("mesh", mesh, 5.0)]
        .map(|(uid, shape, x)| RigidObjectCfg { density: 700.0, ..object(uid, shape, [x, 0.0, 0.0]) })
        .map(|cfg| sim.add_rigid_object(cfg).unwrap());
    assert_eq!(sim.diagnostics(), []);
    let ((mass, com, tensor), (m, c, t)) = (body(&sim, boxed), body(&sim, meshed));
    assert!((mass - 700.0 * 0.25 * 0.5 * 0.125).abs() < 1e-12);
    assert!((m - mass).abs() < 1e-12 && (c - com).norm() < 1e-12 && (t - tensor).norm() < 1e-12, "{m} {c} {t}");
    assert_eq!(sim.rigid_object(meshed).nominal_mass(), m);
}

/// The frame of a mesh is that of its file: a brick with a corner at the origin has its center of mass elsewhere, here
/// twice as long and mirrored downward. The same triangles from STL have the same mass, to the last bit.
#[test]
fn frame_and_format() {
    let files = TempFiles::default();
    let path = obj(&files, "b.obj", &brick([0.5, 0.25, 0.25], [0.0; 3]));
    let mut sim = weightless(1);
    let shape = ObjectShape::Mesh { path, scale: [2.0, 1.0, -1.0], hull: Default::default() };
    let cfg = RigidObjectCfg { mass: Some(3.0), ..object("brick", shape, [1.0, 0.0, 0.0]) };
    let id = sim.add_rigid_object(cfg).unwrap();
    let (mass, com, tensor) = body(&sim, id);
    let moments = Vector3::new(2.0 * 0.0625, 1.0625, 1.0625) * 3.0 / 12.0;
    assert!(mass == 3.0 && (com - Vector3::new(0.5, 0.125, -0.125)).norm() < 1e-12, "{mass} {com}");
    assert!((tensor - Matrix3::from_diagonal(&moments)).norm() < 1e-12, "{tensor}");
    let read = sim.rigid_object(id);
    assert_eq!(read.pose().row(0).to_vec(), [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert!((&read.center_of_mass() - &array![[0.5, 0.125, -0.125]]).iter().all(|d| d.abs() < 1e-12));

    let mut stl = Vec::new();
    write_binary_stl(&channel(), &mut stl).unwrap();
    let [a, b] = [("obj", obj(&files, "c.obj", &channel())), ("stl", files.write("c.stl", stl))]
        .map(|(uid, path)| sim.add_rigid_object(object(uid, ObjectShape::mesh(path), [0.0; 3])).unwrap());
    assert_eq!(body(&sim, a), body(&sim, b));
    // Floor and two walls, with the density of water.
    let mass = 1000.0 * (1.0 * 0.1 + 2.0 * 0.2 * 0.4);
    assert!((sim.rigid_object(a).nominal_mass() / mass - 1.0).abs() < 1e-6);
}

fn scanner(x: f64, y: f64, resolution: f64, side: f64, target: &str) -> RayCasterCfg {
    RayCasterCfg {
        offset: Pose::translation(x, y, 2.0),
        pattern: Grid { resolution, size: [side, side], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec![target.into()]),
        ..RayCasterCfg::default()
    }
}

/// Rays hit the triangles, down in the hollow. MuJoCo's own ray hits the hull and ends at its top, where a ball also
/// comes to rest.
#[test]
fn hollow_and_hull() {
    let files = TempFiles::default();
    let mut sim = empty(2);
    let cfg = object("channel", ObjectShape::mesh(obj(&files, "c.obj", &channel())), [0.2, 0.1, 0.0]);
    let channel = sim.add_rigid_object(fixed(cfg)).unwrap();
    let ball = object("ball", ObjectShape::Sphere { radius: 0.05 }, [0.2, 0.1, 0.56]);
    let ball = sim.add_rigid_object(ball).unwrap();
    let scanner = sim.add_sensor("scanner", scanner(0.2, 0.1, 0.0317, 0.9, "channel")).unwrap();
    sim.update(400);
    let lies = sim.rigid_object(ball).pose();
    assert!((lies[(0, 2)] - 0.55).abs() < 1e-3, "on the hull: {}", lies[(0, 2)]);
    let (scan, mask_id) = (sim.sensor(scanner).unwrap(), sim.rigid_object(channel).mask_id());
    let (mut floor, mut walls) = (0, 0);
    for ray in 0..scan.num_rays() {
        let x = scan.ray_starts()[(1, ray, 0)] - 0.2;
        assert!(scan.hit_mask()[(1, ray)] && scan.hit_ids()[(1, ray)] == mask_id);
        let expected = if x.abs() < 0.3 { 0.1 } else { 0.5 };
        // Corners are in single precision: 2^-25 of 0.5 m, and the pose is exact.
        if (x.abs() - 0.3).abs() > 1e-6 {
            assert!((scan.hits()[(1, ray, 2)] - expected).abs() < 1e-7, "{x}: {}", scan.hits()[(1, ray, 2)]);
        }
        *if expected < 0.3 { &mut floor } else { &mut walls } += 1;
    }
    assert!(floor > 300 && walls > 150, "{floor} {walls}");
    let mujoco = |groups| {
        let ray = sim.batch().read(0, |env| env.data().ray([0.35, 0.1, 2.0], [0.0, 0.0, -1.0], groups)).unwrap();
        ray.map(|hit| hit.distance)
    };
    // Control: hulls are in group 3, which cameras do not render.
    assert!((mujoco(0b1000).unwrap() - 1.5).abs() < 1e-6, "{:?}", mujoco(0b1000));
    assert_eq!(mujoco(0b0011), None);
}

/// Closed forms: a third of the cylinder's mass, 3/10 m r² about the axis, 3/20 m r² + 3/80 m h² across, center at a
/// quarter of the height.
#[test]
fn cone() {
    let mut sim = sim(SimulationManagerCfg { physics_dt: 1e-3, ..Default::default() });
    let (r, h) = (0.2, 0.3);
    let shape = ObjectShape::Cone { radius: r, height: h };
    let cone = sim.add_rigid_object(object("cone", shape, [0.0, 0.0, 0.16])).unwrap();
    let (mass, com, tensor) = body(&sim, cone);
    assert!((mass - 1000.0 * std::f64::consts::PI * r * r * h / 3.0).abs() < 1e-9);
    assert!((com - Vector3::new(0.0, 0.0, -h / 4.0)).norm() < 1e-15);
    let across = mass * (3.0 / 20.0 * r * r + 3.0 / 80.0 * h * h);
    let moments = Vector3::new(across, across, 0.3 * mass * r * r);
    assert!((tensor - Matrix3::from_diagonal(&moments)).norm() < 1e-12);
    let scanner = sim.add_sensor("scanner", scanner(0.0, 0.0, 0.02, 0.3, "cone")).unwrap();
    sim.update(500);
    let pose = sim.rigid_object(cone).pose();
    // MuJoCo's soft contacts let it sink in slightly.
    assert!((pose[(0, 2)] - h / 2.0).abs() < 1e-3 && pose[(0, 3)] > 1.0 - 1e-6, "{pose}");
    let scan = sim.sensor(scanner).unwrap();
    let foot = pose[(0, 2)] - h / 2.0;
    let mut hits = 0;
    for ray in 0..scan.num_rays() {
        let [x, y] = [0, 1].map(|k| scan.ray_starts()[(0, ray, k)] - pose[(0, k)]);
        let surface = foot + h * (1.0 - x.hypot(y) / r);
        if surface > foot + 0.01 {
            hits += 1;
            // The tessellated cone is inside of the round one by at most h (1 - cos(π/64)) = 3.6e-4 m; it may tilt by
            // its penetration.
            let below = surface - scan.hits()[(0, ray, 2)];
            assert!((-2e-4..=6e-4).contains(&below), "{x} {y}: {below}");
        }
    }
    assert!(hits > 100, "{hits}");
}

/// A mesh that does not enclose a volume gives a diagnostic, and has the mass of its hull: a brick without its last
/// side, whose corners all exist, and two bricks of which one is inverted. For the latter the mass is not that of the
/// difference. The outline of their hull in x and z is one and a half squares, and a trapezoid 1 m long between them
/// and down to 0.25 m.
#[test]
fn open_meshes() {
    let files = TempFiles::default();
    let mut open = brick([0.5, 0.5, 0.25], [0.0; 3]);
    open.triangles.truncate(10);
    let (mut odd, other) = (brick([0.5; 3], [0.0; 3]), brick([0.5, 0.5, 0.25], [1.0, 0.0, 0.0]));
    odd.positions.extend(&other.positions);
    odd.triangles.extend(other.triangles.iter().map(|&[a, b, c]| [b + 8, a + 8, c + 8]));
    let odd = TriMesh::from_triangles(odd.positions, odd.triangles);
    let outline = 0.5 * 0.5 + (0.5 + 0.25) / 2.0 * 1.0;
    for (mesh, mass, within, com) in
        [(open, 62.5, 1e-9, Some([0.25, 0.25, 0.125])), (odd, 1000.0 * 0.5 * outline, 1e-6, None)]
    {
        let mut sim = empty(1);
        let shape = ObjectShape::mesh(obj(&files, "o.obj", &mesh));
        let id = sim.add_rigid_object(object("open", shape, [0.0; 3])).unwrap();
        let [diagnostic] = sim.diagnostics() else { panic!("{:?}", sim.diagnostics()) };
        assert_eq!(diagnostic.kind.name(), "open-mesh");
        assert!(diagnostic.message.contains("open") && diagnostic.message.contains("o.obj"), "{diagnostic}");
        let read = sim.rigid_object(id);
        assert!((read.nominal_mass() - mass).abs() < within, "{}", read.nominal_mass());
        let found = read.center_of_mass();
        assert!(com.is_none_or(|com| (&found - &row(com)).iter().all(|d| d.abs() < 1e-9)), "{found}");
    }
}

/// The exported model has the hull for collisions and the mesh as visual, and the same mass.
#[test]
fn exported() {
    let files = TempFiles::default();
    let mut sim = empty(1);
    let mesh = ObjectShape::mesh(obj(&files, "c.obj", &channel()));
    sim.add_rigid_object(object("channel", mesh, [0.0; 3])).unwrap();
    let cone = ObjectShape::Cone { radius: 0.1, height: 0.2 };
    sim.add_rigid_object(object("cone", cone, [3.0, 0.0, 0.0])).unwrap();
    let dump = TempFiles::default();
    assert_eq!(sim.dump(dump.folder()).unwrap(), []);
    let (v2, v4) = (dump.folder().join("robot.mjcf2.xml"), dump.folder().join("robot.mjcf4.xml"));
    let (exported, other) = if BUILD_VERSION == SupportedVersion::V2 { (v2, v4) } else { (v4, v2) };
    let model = compile_file(&exported).unwrap().into_model();
    assert_eq!(model.body_mass(), sim.batch().model().body_mass());
    assert_eq!((model.nmesh(), sim.batch().model().nmesh()), (3, 2));
    let seen = (0..model.ngeom()).filter(|&g| model.geom_group()[g] < 3).count();
    assert_eq!((model.ngeom(), seen), (3, 2), "the hull of the channel is not shown, its mesh and the cone are");
    let text = std::fs::read_to_string(other).unwrap();
    assert_eq!(
        text.contains("simple=\"false\""),
        BUILD_VERSION == SupportedVersion::V2,
        "2.2.2 does not know the attribute"
    );
}
