//! Heights that rays and cameras see, against the array and against `mj_ray`.

use super::{bumps, empty};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::terrain::RoughTerrain;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};
use nalgebra::Point3;

/// Rays straight down over the whole field and beyond, none of them through a point of the grid.
fn from_above() -> RayCasterCfg {
    RayCasterCfg {
        offset: Pose::translation(0.413, -0.287, 5.0),
        pattern: Grid { resolution: 0.037, size: [4.0, 4.0], ..Grid::default() }.into(),
        targets: HitTargets::Named(vec!["bumps".into()]),
        ..RayCasterCfg::default()
    }
}

/// Height of the surface as the configuration describes it, worked out with barycentric weights; `None` beside it.
fn height(cfg: &TerrainCfg, heights: &Array2<f64>, x: f64, y: f64) -> Option<f64> {
    let local = cfg.init_pose.inverse() * Point3::new(x, y, 0.0);
    let (rows, columns) = heights.dim();
    let u = (local.x + cfg.size[0] / 2.0) / cfg.size[0] * (columns - 1) as f64;
    let v = (local.y + cfg.size[1] / 2.0) / cfg.size[1] * (rows - 1) as f64;
    if !(0.0..(columns - 1) as f64).contains(&u) || !(0.0..(rows - 1) as f64).contains(&v) {
        return None;
    }
    let (c, r) = (u as usize, v as usize);
    let (s, t) = (u.fract(), v.fract());
    // The corner that the triangle does not share with its neighbour has weight |s - t|.
    let lone = if s > t { heights[(r, c + 1)] } else { heights[(r + 1, c)] };
    let shared = heights[(r, c)] * (1.0 - s.max(t)) + heights[(r + 1, c + 1)] * s.min(t);
    Some(cfg.init_pose.translation.z + shared + lone * (s - t).abs())
}

/// Rays that hit, the largest difference of their heights from those of `heights` \[m\], rays that hit or miss by mistake.
fn compare(cfg: &TerrainCfg, heights: &Array2<f64>) -> (usize, f64, usize) {
    let mut sim = empty();
    let id = sim.add_terrain(cfg.clone()).unwrap();
    let scanner = sim.add_sensor("scanner", from_above()).unwrap();
    sim.update(1);
    let (scanner, terrain) = (sim.sensor(scanner).unwrap(), sim.terrain(id));
    assert_eq!(scanner.hits().dim().0, 2);
    let (start, hit) = (scanner.ray_starts(), scanner.hits());
    let (mut hits, mut worst, mut wrong) = (0, 0.0_f64, 0);
    for env in 0..2 {
        for ray in 0..scanner.num_rays() {
            let expected = height(cfg, heights, start[(env, ray, 0)], start[(env, ray, 1)]);
            match (expected, scanner.hit_mask()[(env, ray)]) {
                (Some(expected), true) => {
                    hits += 1;
                    worst = worst.max((expected - hit[(env, ray, 2)]).abs());
                    assert_eq!(scanner.hit_ids()[(env, ray)], terrain.mask_id());
                }
                (expected, hit) => wrong += usize::from(expected.is_some() != hit),
            }
            if ray % 50 == 0 {
                let local = cfg.init_pose.inverse() * Point3::new(start[(env, ray, 0)], start[(env, ray, 1)], 0.0);
                let own = terrain.height_at([local.x, local.y]);
                let other = height(cfg, &cfg.heights, start[(env, ray, 0)], start[(env, ray, 1)]);
                assert_eq!(own.is_some(), other.is_some());
                let apart = own.zip(other).map_or(0.0, |(a, b)| (a - (b - cfg.init_pose.translation.z)).abs());
                assert!(apart < 1e-12, "height_at is off by {apart}");
            }
        }
    }
    (hits, worst, wrong)
}

/// MuJoCo keeps elevations in single precision: an error of 2^-25 of the range of 0.6 m, 2e-8 m.
#[test]
fn rays_measure_the_heights_of_the_array() {
    let cfg = bumps();
    let (hits, worst, wrong) = compare(&cfg, &cfg.heights);
    println!("{hits} hits, {worst:e} m off at most");
    // 6 m² in squares of 37 mm, in two environments.
    assert!(hits > 8000 && wrong == 0, "{hits} hits, {wrong} wrong");
    assert!(worst < 1e-6, "{worst} m");
}

/// The control: heights of the neighbouring points are found out.
#[test]
fn heights_shifted_by_a_cell_are_found_out() {
    let cfg = bumps();
    let (rows, columns) = cfg.heights.dim();
    let shifted = Array2::from_shape_fn((rows, columns), |(r, c)| cfg.heights[(r, (c + 1).min(columns - 1))]);
    let (_, worst, _) = compare(&cfg, &shifted);
    assert!(worst > 0.05, "{worst} m");
}

/// MuJoCo's own rays, on whichever line this is, see the surface of the array too.
#[test]
fn mujocos_rays_see_the_same_surface() {
    let cfg = bumps();
    let mut sim = empty();
    sim.add_terrain(cfg.clone()).unwrap();
    let batch = sim.batch();
    let (mut hits, mut worst) = (0, 0.0_f64);
    for k in 0..2000 {
        // Two irrational steps fill the square evenly.
        let [x, y] = [0.618_034, 0.754_878].map(|step| 4.0 * ((f64::from(k) * step).fract() - 0.5));
        let ray = batch.read(0, |env| env.data().ray([x, y, 5.0], [0.0, 0.0, -1.0], 0b111)).unwrap();
        match (height(&cfg, &cfg.heights, x, y), ray) {
            (Some(expected), Some(hit)) => {
                hits += 1;
                worst = worst.max((5.0 - hit.distance - expected).abs());
            }
            (expected, hit) => assert!(expected.is_none() && hit.is_none(), "({x}, {y}): {expected:?} {hit:?}"),
        }
    }
    println!("{hits} hits, {worst:e} m off at most");
    assert!(hits > 600 && worst < 1e-6, "{hits} hits, {worst} m");
}

/// A camera above sees the terrain by its id, in the table by its name, and its depth is that of the highest point and below.
#[test]
fn a_camera_sees_it_by_its_name() {
    let cfg = bumps();
    let mut sim = empty();
    let id = sim.add_terrain(cfg.clone()).unwrap();
    let [x, y] = [cfg.init_pose.translation.x, cfg.init_pose.translation.y];
    let camera = sim
        .add_sensor(
            "camera",
            CameraCfg {
                width: 120,
                height: 90,
                intrinsics: Intrinsics::Fovy { radians: 0.6 },
                extrinsics: Extrinsics {
                    placement: Placement::LookAt { eye: [x, y, 4.2], target: [x, y, 0.0], up: [0.0, 1.0, 0.0] },
                    ..Default::default()
                },
                channels: Channels { depth: true, mask: true, ..Channels::default() },
                ..Default::default()
            },
        )
        .unwrap();
    sim.update(1);
    let entry = sim.mask_ids().iter().find(|entry| entry.object == "bumps").unwrap();
    assert_eq!((entry.id, entry.class.as_str()), (sim.terrain(id).mask_id(), "terrain"));
    let (camera, [low, high]) = (sim.sensor(camera).unwrap(), sim.terrain(id).height_range());
    let (mask, depth) = (camera.mask().unwrap(), camera.depth().unwrap());
    let seen: Vec<f32> = mask.iter().zip(&depth).filter(|(mask, _)| **mask == entry.id).map(|(_, d)| *d).collect();
    assert!(seen.len() > 1000, "{} pixels", seen.len());
    // The frame is 4 m below the camera; at its rim walls go 1 m farther down.
    let (nearest, farthest) = seen.iter().fold((f32::MAX, 0.0_f32), |(a, b), d| (a.min(*d), b.max(*d)));
    assert!(f64::from(nearest) > 4.0 - high - 1e-5 && f64::from(nearest) < 4.0 - high + 0.02, "{nearest}");
    assert!(f64::from(farthest) < 4.0 - low + 1.0 + 1e-5, "{farthest}");
}

/// Rough terrain is the same in every environment and every run; another seed is another terrain.
#[test]
fn a_seed_is_a_terrain() {
    let distances = |seed: u64| {
        let rough = RoughTerrain { size: [3.0, 2.0], cell: 0.1, seed, ..RoughTerrain::default() };
        let mut sim = empty();
        sim.add_terrain(TerrainCfg { heights: rough.heights().unwrap(), size: rough.size, ..bumps() }).unwrap();
        let scanner = sim.add_sensor("scanner", from_above()).unwrap();
        sim.update(1);
        let rows = sim.sensor(scanner).unwrap().distances().mapv(f64::to_bits);
        assert_eq!(rows.row(0), rows.row(1));
        rows
    };
    assert_eq!(distances(5), distances(5));
    assert_ne!(distances(5), distances(6));
}
