//! Objects that are meshes, and cones: what they weigh, how they turn, what is seen, what collides.

use super::{Files, brick, channel, empty, object, weightless};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::scene::mesh::{TriMesh, write_binary_stl};
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};
use kinetoscope::sim::mj::{TARGET, Target, compile_file};
use nalgebra::{Matrix3, Quaternion, UnitQuaternion, Vector3};

/// Mass, centre of mass and tensor about it, in the object's frame, as MuJoCo has them.
fn body(sim: &SimulationManager, id: ObjectId) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let uid = sim.rigid_object(id).uid();
    sim.batch().read(0, |env| {
        let model = env.data().model();
        let b = model.id(kinetoscope::sim::mj::ObjectKind::Body, uid).unwrap();
        let q = &model.body_iquat()[4 * b..4 * b + 4];
        let turn = UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])).to_rotation_matrix();
        let moments = Vector3::from_column_slice(&model.body_inertia()[3 * b..3 * b + 3]);
        let tensor = turn.matrix() * Matrix3::from_diagonal(&moments) * turn.matrix().transpose();
        (model.body_mass()[b], Vector3::from_column_slice(&model.body_ipos()[3 * b..3 * b + 3]), tensor)
    })
}

/// Sides that single precision has: mass, moments and motion of the mesh are those of the box, to rounding.
#[test]
fn a_box_mesh_weighs_and_turns_as_a_box() {
    let files = Files::new();
    let size = [0.25_f32, 0.5, 0.125];
    let mesh = brick(size, size.map(|s| -s / 2.0));
    let mut sim = weightless(1);
    let density = 700.0;
    let cfg = |uid, shape, x| RigidObjectCfg { density, ..object(uid, shape, [x, 0.0, 0.0]) };
    let boxed = sim.add_rigid_object(cfg("box", ObjectShape::Box { size: size.map(f64::from) }, 0.0)).unwrap();
    let meshed = sim.add_rigid_object(cfg("mesh", ObjectShape::mesh(files.obj("b.obj", &mesh)), 5.0)).unwrap();
    assert_eq!(sim.diagnostics(), []);
    let ((mass, com, tensor), (m, c, t)) = (body(&sim, boxed), body(&sim, meshed));
    assert!((mass - 700.0 * 0.25 * 0.5 * 0.125).abs() < 1e-12);
    assert!((m - mass).abs() < 1e-12 && (c - com).norm() < 1e-12 && (t - tensor).norm() < 1e-12, "{m} {c} {t}");
    assert_eq!(sim.rigid_object(meshed).mass(), m);
    // Tumbling about the middle axis is the most sensitive motion a free body has: e^(w t) of rounding.
    let spin = array![[0.1, 0.2, 0.3, 3.0, 0.01, 0.02]];
    for id in [boxed, meshed] {
        sim.rigid_object_mut(id).write_velocity(&spin, None).unwrap();
    }
    sim.update(2000);
    let [a, b] = [boxed, meshed].map(|id| sim.rigid_object(id).get_velocity());
    assert!((&a - &b).iter().all(|d| d.abs() < 1e-9), "{a} {b}");
    assert!((&a - &spin).iter().any(|d| d.abs() > 0.1), "it tumbled: {a}");
}

/// The frame of a mesh is that of its file: a brick that has its corner there has its centre of mass elsewhere.
#[test]
fn the_frame_of_a_mesh_is_that_of_its_file() {
    let files = Files::new();
    let path = files.obj("b.obj", &brick([0.5, 0.25, 0.25], [0.0; 3]));
    let mut sim = weightless(1);
    let shape = ObjectShape::Mesh { path, scale: [2.0, 1.0, -1.0], hull: Default::default() };
    let id =
        sim.add_rigid_object(RigidObjectCfg { mass: Some(3.0), ..object("brick", shape, [1.0, 0.0, 0.0]) }).unwrap();
    let (mass, com, tensor) = body(&sim, id);
    assert_eq!(mass, 3.0);
    // Twice as long, and mirrored down.
    assert!((com - Vector3::new(0.5, 0.125, -0.125)).norm() < 1e-12, "{com}");
    let moments = Vector3::new(2.0 * 0.0625, 1.0625, 1.0625) * 3.0 / 12.0;
    assert!((tensor - Matrix3::from_diagonal(&moments)).norm() < 1e-12, "{tensor}");
    let read = sim.rigid_object(id);
    assert_eq!(read.get_pose().row(0).to_vec(), [1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0]);
    assert!((&read.get_center_of_mass() - &array![[0.5, 0.125, -0.125]]).iter().all(|d| d.abs() < 1e-12));
}

/// Formats: the same triangles from STL weigh the same, to the last bit.
#[test]
fn the_format_of_the_file_does_not_matter() {
    let files = Files::new();
    let obj = files.obj("c.obj", &channel());
    let stl = files.0.path().join("c.stl");
    write_binary_stl(&channel(), std::fs::File::create(&stl).unwrap()).unwrap();
    let mut sim = empty(1);
    let [a, b] = [("obj", obj), ("stl", stl)]
        .map(|(uid, path)| sim.add_rigid_object(object(uid, ObjectShape::mesh(path), [0.0; 3])).unwrap());
    assert_eq!(body(&sim, a), body(&sim, b));
    // Floor and two walls, in water.
    let mass = 1000.0 * (1.0 * 0.1 + 2.0 * 0.2 * 0.4);
    assert!((sim.rigid_object(a).mass() / mass - 1.0).abs() < 1e-6);
}

/// Rays and depth are those of the triangles, down in the hollow; MuJoCo's own ray, of the hull, ends at its top, and so does
/// what lies on it.
#[test]
fn the_hollow_is_seen_and_the_hull_collides() {
    let files = Files::new();
    let path = files.obj("c.obj", &channel());
    let mut sim = empty(2);
    let cfg = object("channel", ObjectShape::mesh(path), [0.2, 0.1, 0.0]);
    let channel = sim.add_rigid_object(RigidObjectCfg { body_type: BodyType::Static, ..cfg }).unwrap();
    let ball = object("ball", ObjectShape::Sphere { radius: 0.05 }, [0.2, 0.1, 0.56]);
    let ball = sim.add_rigid_object(ball).unwrap();
    let scanner = RayCasterCfg {
        offset: Pose::translation(0.2, 0.1, 2.0),
        pattern: Grid { resolution: 0.0317, size: [0.9, 0.9], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec!["channel".into()]),
        ..RayCasterCfg::default()
    };
    let scanner = sim.add_sensor("scanner", scanner).unwrap();
    let camera = CameraCfg {
        width: 90,
        height: 90,
        intrinsics: Intrinsics::Fovy { radians: 0.5 },
        extrinsics: Extrinsics {
            placement: Placement::LookAt { eye: [0.2, 0.1, 2.5], target: [0.2, 0.1, 0.0], up: [0.0, 1.0, 0.0] },
            ..Default::default()
        },
        channels: Channels { depth: true, mask: true, ..Channels::default() },
        ..Default::default()
    };
    let camera = sim.add_sensor("camera", camera).unwrap();
    sim.update(400);
    let lies = sim.rigid_object(ball).get_pose();
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
    let (depth, mask) = (sim.sensor(camera).unwrap().depth().unwrap(), sim.sensor(camera).unwrap().mask().unwrap());
    // Beside the ball, in the middle row: the floor is 2.4 m below.
    let (u, v) = (45 + 10, 45);
    assert_eq!(mask[(0, v, u)], mask_id);
    assert!((depth[(0, v, u)] - 2.4).abs() < 1e-5, "{}", depth[(0, v, u)]);
    let mujoco = |groups| {
        let ray = sim.batch().read(0, |env| env.data().ray([0.35, 0.1, 2.0], [0.0, 0.0, -1.0], groups)).unwrap();
        ray.map(|hit| hit.distance)
    };
    // The control: group 3 is where hulls are, and cameras do not look there.
    assert!((mujoco(0b1000).unwrap() - 1.5).abs() < 1e-6, "{:?}", mujoco(0b1000));
    assert_eq!(mujoco(0b0011), None);
}

/// Closed forms: a third of the cylinder, 3/10 m r² about the axis, 3/20 m r² + 3/80 m h² across, a quarter of the height.
#[test]
fn a_cone_is_that_of_the_textbook_and_stands() {
    let mut sim = SimulationManager::new(SimulationManagerCfg { physics_dt: 1e-3, ..Default::default() }).unwrap();
    let (r, h) = (0.2, 0.3);
    let shape = ObjectShape::Cone { radius: r, height: h };
    let cone = sim.add_rigid_object(object("cone", shape, [0.0, 0.0, 0.16])).unwrap();
    let (mass, com, tensor) = body(&sim, cone);
    assert!((mass - 1000.0 * std::f64::consts::PI * r * r * h / 3.0).abs() < 1e-9);
    assert!((com - Vector3::new(0.0, 0.0, -h / 4.0)).norm() < 1e-15);
    let across = mass * (3.0 / 20.0 * r * r + 3.0 / 80.0 * h * h);
    let moments = Vector3::new(across, across, 0.3 * mass * r * r);
    assert!((tensor - Matrix3::from_diagonal(&moments)).norm() < 1e-12);
    let above = RayCasterCfg {
        offset: Pose::translation(0.0, 0.0, 2.0),
        pattern: Grid { resolution: 0.02, size: [0.3, 0.3], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec!["cone".into()]),
        ..RayCasterCfg::default()
    };
    let scanner = sim.add_sensor("scanner", above).unwrap();
    sim.update(500);
    let pose = sim.rigid_object(cone).get_pose();
    // MuJoCo's soft contacts let it sink by a little.
    assert!((pose[(0, 2)] - h / 2.0).abs() < 1e-3 && pose[(0, 3)] > 1.0 - 1e-6, "{pose}");
    let scan = sim.sensor(scanner).unwrap();
    let foot = pose[(0, 2)] - h / 2.0;
    let mut hits = 0;
    for ray in 0..scan.num_rays() {
        let [x, y] = [0, 1].map(|k| scan.ray_starts()[(0, ray, k)] - pose[(0, k)]);
        let surface = foot + h * (1.0 - x.hypot(y) / r);
        if surface > foot + 0.01 {
            hits += 1;
            // Inside of the round cone by at most h (1 - cos(π/64)) = 3.6e-4 m; it may lean by what it sank.
            let below = surface - scan.hits()[(0, ray, 2)];
            assert!((-2e-4..=6e-4).contains(&below), "{x} {y}: {below}");
        }
    }
    assert!(hits > 100, "{hits}");
}

/// A file without an end to it: said, and weighed as its hull.
#[test]
fn an_open_mesh_weighs_as_its_hull() {
    let files = Files::new();
    let mut open = brick([0.5, 0.5, 0.25], [0.0; 3]);
    open.triangles.truncate(10);
    let mut sim = empty(1);
    let id = sim.add_rigid_object(object("open", ObjectShape::mesh(files.obj("o.obj", &open)), [0.0; 3])).unwrap();
    let [diagnostic] = sim.diagnostics() else { panic!("{:?}", sim.diagnostics()) };
    assert_eq!(diagnostic.kind.name(), "open-mesh");
    assert!(diagnostic.message.contains("open") && diagnostic.message.contains("o.obj"), "{diagnostic}");
    // The corners of the brick are all there: the hull is the brick.
    assert!((sim.rigid_object(id).mass() - 62.5).abs() < 1e-9, "{}", sim.rigid_object(id).mass());
    assert!((&sim.rigid_object(id).get_center_of_mass() - &array![[0.25, 0.25, 0.125]]).iter().all(|d| d.abs() < 1e-9));
}

/// Two bricks of which one is inside out: said, and weighed as the hull, not as their difference.
#[test]
fn a_mesh_that_is_inside_out_in_part_weighs_as_its_hull() {
    let files = Files::new();
    let (mut mesh, other) = (brick([0.5; 3], [0.0; 3]), brick([0.5, 0.5, 0.25], [1.0, 0.0, 0.0]));
    mesh.positions.extend(&other.positions);
    mesh.triangles.extend(other.triangles.iter().map(|&[a, b, c]| [b + 8, a + 8, c + 8]));
    let mesh = TriMesh::from_triangles(mesh.positions, mesh.triangles);
    let mut sim = empty(1);
    let id = sim.add_rigid_object(object("odd", ObjectShape::mesh(files.obj("o.obj", &mesh)), [0.0; 3])).unwrap();
    let [diagnostic] = sim.diagnostics() else { panic!("{:?}", sim.diagnostics()) };
    assert_eq!(diagnostic.kind.name(), "open-mesh");
    // The outline in x and z is a square and a half, and a trapezoid 1 m long between them and down to 0.25 m.
    let outline = 0.5 * 0.5 + (0.5 + 0.25) / 2.0 * 1.0;
    assert!((sim.rigid_object(id).mass() - 1000.0 * 0.5 * outline).abs() < 1e-6, "{}", sim.rigid_object(id).mass());
}

/// What is exported has the hull to collide and the mesh to be seen, and weighs the same.
#[test]
fn the_exported_model_has_hull_and_mesh() {
    let files = Files::new();
    let path = files.obj("c.obj", &channel());
    let mut sim = empty(1);
    sim.add_rigid_object(object("channel", ObjectShape::mesh(path), [0.0; 3])).unwrap();
    let cone = ObjectShape::Cone { radius: 0.1, height: 0.2 };
    sim.add_rigid_object(object("cone", cone, [3.0, 0.0, 0.0])).unwrap();
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(sim.dump(dir.path()).unwrap(), []);
    let exported = if TARGET == Target::V2 { "robot.mjcf2.xml" } else { "robot.mjcf4.xml" };
    let model = compile_file(&dir.path().join(exported)).unwrap().into_model();
    assert_eq!(model.body_mass(), sim.batch().model().body_mass());
    assert_eq!((model.nmesh(), sim.batch().model().nmesh()), (3, 2));
    let seen = (0..model.ngeom()).filter(|&g| model.geom_group()[g] < 3).count();
    assert_eq!((model.ngeom(), seen), (3, 2), "the hull of the channel is not shown, its mesh and the cone are");
    let other = if TARGET == Target::V2 { "robot.mjcf4.xml" } else { "robot.mjcf2.xml" };
    let text = std::fs::read_to_string(dir.path().join(other)).unwrap();
    assert_eq!(text.contains("simple=\"false\""), TARGET == Target::V2, "2.2.2 does not know the attribute");
}

#[test]
fn scene_files_name_meshes_beside_them() {
    let files = Files::new();
    files.obj("b.obj", &brick([0.5, 0.5, 0.5], [0.0; 3]));
    let text = "[entities.brick]\ntype = \"rigid_object\"\nbody_type = \"kinematic\"\nrestitution = 0.5\n\
                shape.mesh = { path = \"b.obj\", scale = [2, 1, 1] }\n\
                [entities.cone]\ntype = \"rigid_object\"\nshape.cone = { radius = 0.1, height = 0.3 }\nlinear_damping = 0.2\n";
    let file = files.0.path().join("scene.toml");
    std::fs::write(&file, text).unwrap();
    let built = InteractiveScene::from_file(&file).unwrap();
    let sim = built.sim();
    let (brick, cone) = (sim.rigid_object_id("brick").unwrap(), sim.rigid_object_id("cone").unwrap());
    assert!((sim.rigid_object(brick).mass() - 250.0).abs() < 1e-9);
    assert_eq!(sim.rigid_object(brick).cfg().body_type, BodyType::Kinematic);
    assert_eq!(sim.rigid_object(brick).cfg().restitution, Some(0.5));
    assert_eq!(sim.rigid_object(cone).cfg().linear_damping, 0.2);
}
