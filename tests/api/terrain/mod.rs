//! Terrain in a simulation: heights measured by rays, against the array and against `mj_ray`; objects at rest on it;
//! exports; and invalid terrains.

mod grid;

use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion, compile_file};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_xyz_rpy;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};
use kinetoscope::sim::RigidObjectId;
use kinetoscope_testkit::error_tables::assert_errors;
use kinetoscope_testkit::worlds::{ball, cfg, sim};
use nalgebra::Point3;

const RADIUS: f64 = 0.25;

/// A terrain of 3 m by 2 m with distinct heights at neighboring points, moved and rotated.
fn bumps() -> TerrainCfg {
    let heights = Array2::from_shape_fn((21, 31), |(r, c)| 0.3 * (0.7 * c as f64).sin() * (0.4 * r as f64).cos() - 0.1);
    let init_pose = from_xyz_rpy([0.4, -0.3, 0.2], [0.0, 0.0, 0.5]);
    TerrainCfg { uid: "bumps".into(), heights, size: [3.0, 2.0], init_pose, ..Default::default() }
}

/// A pit of four flat walls that rise by 1 m per meter from the middle, points 0.1 m apart.
fn pit() -> TerrainCfg {
    let at = |k: usize| 0.1 * k as f64 - 2.0;
    let heights = Array2::from_shape_fn((41, 41), |(r, c)| at(c).abs().max(at(r).abs()));
    TerrainCfg { uid: "pit".into(), heights, size: [4.0, 4.0], ..Default::default() }
}

/// Two environments without a ground.
fn empty() -> SimulationManager {
    sim(SimulationManagerCfg { ground: None, ..cfg(2, 2) })
}

/// Adds a ball beside the middle of the pit, above the surface.
fn add_ball(sim: &mut SimulationManager) -> RigidObjectId {
    sim.add_rigid_object(ball("ball", RADIUS, 0.5, [0.13, -0.08, 0.8])).unwrap()
}

fn height_of(sim: &SimulationManager, ball: RigidObjectId) -> f64 {
    sim.rigid_object(ball).pose()[(0, 2)]
}

/// Returns the height of the surface from the configuration, computed with barycentric weights; `None` outside it.
fn height(cfg: &TerrainCfg, heights: &Array2<f64>, [x, y]: [f64; 2]) -> Option<f64> {
    let local = cfg.init_pose.inverse() * Point3::new(x, y, 0.0);
    let (rows, columns) = heights.dim();
    let u = (local.x + cfg.size[0] / 2.0) / cfg.size[0] * (columns - 1) as f64;
    let v = (local.y + cfg.size[1] / 2.0) / cfg.size[1] * (rows - 1) as f64;
    if !(0.0..(columns - 1) as f64).contains(&u) || !(0.0..(rows - 1) as f64).contains(&v) {
        return None;
    }
    let (c, r) = (u as usize, v as usize);
    let (s, t) = (u.fract(), v.fract());
    // The corner that the triangle does not share with its neighbor has weight |s - t|.
    let lone = if s > t { heights[(r, c + 1)] } else { heights[(r + 1, c)] };
    let shared = heights[(r, c)] * (1.0 - s.max(t)) + heights[(r + 1, c + 1)] * s.min(t);
    Some(cfg.init_pose.translation.z + shared + lone * (s - t).abs())
}

/// MuJoCo keeps elevations in single precision: an error of 2^-25 of the range of 0.6 m, 2e-8 m. `height_at` is exact.
/// Control: the heights of the neighboring points are measurably different.
#[test]
fn rays() {
    let cfg = bumps();
    let last = cfg.heights.ncols() - 1;
    let shifted = Array2::from_shape_fn(cfg.heights.dim(), |(r, c)| cfg.heights[(r, (c + 1).min(last))]);
    let mut sim = empty();
    let id = sim.add_terrain(cfg.clone()).unwrap();
    // Straight down over the whole field and beyond, without a ray through a grid point.
    let scanner = RayCasterCfg {
        offset: Pose::translation(0.413, -0.287, 5.0),
        pattern: Grid { resolution: 0.037, size: [4.0, 4.0], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec!["bumps".into()]),
        ..RayCasterCfg::default()
    };
    let scanner = sim.add_sensor("scanner", scanner).unwrap();
    sim.update(1);
    let (scanner, terrain) = (sim.sensor(scanner).unwrap(), sim.entities().terrain(id));
    let (start, hit, mask) = (scanner.ray_starts(), scanner.hits(), scanner.hit_mask());
    let entry = sim.scene().mask_ids().iter().find(|entry| entry.object == "bumps").unwrap();
    assert_eq!((hit.dim().0, entry.id, entry.class.as_str()), (2, terrain.mask_id(), "terrain"));
    let (mut hits, mut worst, mut control) = (0, 0.0_f64, 0.0_f64);
    for (at, &seen) in mask.indexed_iter() {
        let [x, y] = [0, 1].map(|k| start[(at.0, at.1, k)]);
        let expected = height(&cfg, &cfg.heights, [x, y]);
        assert_eq!(expected.is_some(), seen, "({x}, {y})");
        if let Some(expected) = expected {
            let found = hit[(at.0, at.1, 2)];
            hits += 1;
            worst = worst.max((expected - found).abs());
            control = control.max((height(&cfg, &shifted, [x, y]).unwrap() - found).abs());
            assert_eq!(scanner.hit_ids()[at], terrain.mask_id());
        }
        if at.1 % 50 == 0 {
            let local = cfg.init_pose.inverse() * Point3::new(x, y, 0.0);
            let own = terrain.height_at([local.x, local.y]);
            assert_eq!(own.is_some(), expected.is_some());
            let height_difference =
                own.zip(expected).map_or(0.0, |(a, b)| (a - (b - cfg.init_pose.translation.z)).abs());
            assert!(height_difference < 1e-12, "height_at is off by {height_difference}");
            let ray = sim.batch().read(at.0, |env| env.data().ray([x, y, 5.0], [0.0, 0.0, -1.0], 0b111)).unwrap();
            assert_eq!(ray.is_some(), seen, "mj_ray at ({x}, {y})");
            worst = expected.zip(ray).map_or(worst, |(height, ray)| worst.max((5.0 - ray.distance - height).abs()));
        }
    }
    // 6 m² in squares of 37 mm, in two environments.
    assert!(hits > 8000 && worst < 1e-6, "{hits} hits, {worst} m off");
    assert!(control > 0.05, "the control: {control} m");
}

/// The ball comes to rest on all four walls, which have a slope of 45 degrees: its center is sqrt(2) radii above the
/// bottom. MuJoCo's soft contacts let a ball of 0.5 kg sink by less than a millimeter. Contact sensors treat the
/// terrain as a part of the world: at rest, its walls together carry the ball's weight.
#[test]
fn ball_at_rest() {
    let mut sim = empty();
    let (terrain, ball) = (sim.add_terrain(pit()).unwrap(), add_ball(&mut sim));
    let contact_cfg = ContactSensorCfg { filters: vec!["world".into()], ..ContactSensorCfg::for_bodies("ball") };
    let sensor = sim.add_sensor("contact", contact_cfg).unwrap();
    assert_eq!((sim.entities().terrain(terrain).uid(), sim.entities().terrain(terrain).cfg()), ("pit", &pit()));
    sim.update(1000);
    let (pose, velocity) = (sim.rigid_object(ball).pose(), sim.rigid_object(ball).velocity());
    let sensor = sim.sensor(sensor).unwrap();
    for env in 0..2 {
        let center = [0, 1, 2].map(|k| pose[(env, k)]);
        assert!(velocity.row(env).iter().all(|v| v.abs() < 1e-3), "{velocity}");
        let expected_center = [0.0, 0.0, 2.0_f64.sqrt() * RADIUS];
        assert!(
            center.iter().zip(expected_center).all(|(a, b)| (a - b).abs() < 2e-3),
            "{center:?}, not {expected_center:?}"
        );
        for (k, weight) in [0.0, 0.0, 0.5 * 9.81].into_iter().enumerate() {
            // The remaining motion, below 1e-3 m/s, decelerates within some 0.01 s: below 0.05 N.
            let total = sensor.total_forces_w()[(env, 0, k)];
            assert!((total - weight).abs() < 0.05, "axis {k}: {total}");
            let (normal, of_world) = (sensor.net_forces_w()[(env, 0, k)], sensor.force_matrix_w()[(env, 0, 0, k)]);
            assert!((normal - of_world).abs() < 1e-9, "axis {k}: {normal} {of_world}");
        }
    }
}

/// A terrain can be added while objects fall; they continue from their states. Control: without the terrain they fall
/// by g t² / 2.
#[test]
fn added_later() {
    let mut sim = empty();
    let ball = add_ball(&mut sim);
    sim.update(10);
    let state = |sim: &SimulationManager| (sim.rigid_object(ball).pose(), sim.rigid_object(ball).velocity());
    let before = state(&sim);
    sim.add_terrain(pit()).unwrap();
    assert_eq!(before, state(&sim));
    sim.update(300);
    assert!(height_of(&sim, ball) > 0.2);
    let mut sim = empty();
    let ball = add_ball(&mut sim);
    sim.update(100);
    assert!(height_of(&sim, ball) < -4.0);
}

/// The exported files contain the terrain.
#[test]
fn export() {
    let mut sim = empty();
    sim.add_terrain(bumps()).unwrap();
    let dir = tempfile::tempdir().unwrap();
    assert_eq!(sim.dump(dir.path()).unwrap(), []);
    let exported = if BUILD_VERSION == SupportedVersion::V2 { "robot.mjcf2.xml" } else { "robot.mjcf4.xml" };
    for file in [exported, "run.mjcf.xml"] {
        let model = compile_file(dir.path().join(file)).unwrap().into_model();
        let (found, ours) = (model.height_field(0), sim.batch().model().height_field(0));
        assert_eq!((model.nhfield(), found.rows, found.columns), (1, 21, 31));
        assert_eq!((found.size, found.elevation), (ours.size, ours.elevation), "{file}");
    }
}

#[test]
fn mistakes() {
    let mut sim = empty();
    sim.add_terrain(bumps()).unwrap();
    let with_height = |at, height| {
        let mut cfg = bumps();
        cfg.heights[at] = height;
        cfg
    };
    let of_shape = |shape: (usize, usize)| TerrainCfg { heights: Array2::zeros(shape), ..bumps() };
    let rows = [
        ("bumps", bumps(), "taken"),
        ("ground", bumps(), "taken"),
        ("a/b", bumps(), "not usable"),
        ("other", with_height((3, 7), f64::NAN), "heights[3, 7] (terrain \"other\") is NaN"),
        ("other", with_height((0, 0), 1e9), "between -1e6 m and 1e6 m"),
        ("other", of_shape((1, 5)), "at least 2 rows"),
        ("other", of_shape((0, 0)), "at least 2 rows"),
        ("other", of_shape((3000, 3000)), "at most 4194304 points"),
        ("other", TerrainCfg { size: [0.0, 1.0], ..bumps() }, "size is [0.0, 1.0]"),
        ("other", TerrainCfg { size: [1.0, f64::NAN], ..bumps() }, "size"),
        ("other", TerrainCfg { thickness: -1.0, ..bumps() }, "thickness is -1.0"),
        ("other", TerrainCfg { friction: Some([-1.0, 0.0, 0.0]), ..bumps() }, "friction"),
        ("other", TerrainCfg { rgba: [2.0, 0.0, 0.0, 1.0], ..bumps() }, "rgba"),
        ("other", TerrainCfg { init_pose: Pose::translation(f64::NAN, 0.0, 0.0), ..bumps() }, "init_pose"),
    ];
    let mut add = |uid: &str, cfg| sim.add_terrain(TerrainCfg { uid: uid.into(), ..cfg });
    assert_errors(rows.map(|(uid, cfg, part)| (part, add(uid, cfg), "", [part])));
    assert_eq!(sim.scene().mask_ids().len(), 1);
    // A name with XML special characters, and equal heights.
    let flat = TerrainCfg { uid: "<\"flat\" & wide>".into(), heights: Array2::from_elem((2, 2), 0.3), ..bumps() };
    let flat = sim.add_terrain(flat).unwrap();
    assert_eq!(sim.entities().terrain(flat).height_at([0.0, 0.0]), Some(0.3));
    assert_eq!(sim.entities().terrain(flat).height_at([1.6, 0.0]), None);
    assert_eq!(sim.scene().mask_ids().len(), 2);
    let object = RigidObjectCfg { uid: "bumps".into(), ..Default::default() };
    assert!(sim.add_rigid_object(object).is_err(), "the name is a terrain's");
}
