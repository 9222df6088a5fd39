//! Terrain grids in a simulation: the heights of every type of tile, in closed form, against `mj_ray`, the height
//! scanner and a depth camera.

use super::{empty, height};
use kinetoscope::ndarray::Array2;
use kinetoscope::prelude::*;
use kinetoscope::scene::pose::from_wxyz;
use kinetoscope::scene::terrain::{TerrainGrid, TerrainTile};
use kinetoscope::sensors::camera::CameraConvention;
use kinetoscope::sensors::ray::pattern::Grid;
use kinetoscope::sensors::ray::{HitTargets, RayCasterCfg};
use std::f64::consts::TAU;

const ROWS: usize = 3;
/// Cells of a tile: 4 m in steps of 0.1 m.
const CELLS: usize = 40;
/// Cells of the border of 0.5 m.
const BORDER: usize = 5;

fn grid() -> TerrainGrid {
    TerrainGrid { rows: ROWS, tile_size: [4.0, 4.0], platform: 1.0, border: 0.5, seed: 11, ..TerrainGrid::default() }
}

/// Height of a type of tile with difficulty d at the point (x, y), counted in cells from the negative ends; `None` for
/// random heights. The numbers are those of the default tiles.
fn closed_form(tile: &TerrainTile, d: f64, [x, y]: [usize; 2]) -> Option<f64> {
    let rim = x.min(CELLS - x).min(y.min(CELLS - y));
    let is_platform = rim >= 15;
    Some(match tile {
        TerrainTile::Flat {} => 0.0,
        // The platform begins 1.5 m from the rim.
        TerrainTile::SlopeUp(_) => 0.4 * d * 0.1 * rim.min(15) as f64,
        TerrainTile::SlopeDown(_) => -0.4 * d * 0.1 * rim.min(15) as f64,
        // A step every 0.3 m, five of them.
        TerrainTile::StairsUp(_) => (0.05 + 0.18 * d) * (rim / 3).min(5) as f64,
        TerrainTile::StairsDown(_) => -(0.05 + 0.18 * d) * (rim / 3).min(5) as f64,
        TerrainTile::SteppingStones(_) => {
            let cells = |length: f64| (10.0 * length).round() as usize;
            let (stone, distance) = (cells(0.8 - 0.5 * d), cells(0.2 + 0.2 * d));
            let on = |k: usize| k % (stone + distance) <= stone;
            if is_platform || (on(x) && on(y)) { 0.0 } else { -1.0 }
        }
        TerrainTile::Gap(_) => {
            let width = (10.0 * (0.2 + 0.6 * d)).round() as usize;
            if (15 - width + 1..15).contains(&rim) { -1.0 } else { 0.0 }
        }
        TerrainTile::Waves(_) => {
            let wave = |k: usize| (4.0 * TAU * k as f64 / CELLS as f64).sin();
            (0.02 + 0.18 * d) * 0.5 * (wave(x) + wave(y))
        }
        _ => return None,
    })
}

/// Heights of the whole grid from the closed forms. Random heights are those of the generator; each of them is checked
/// for the property that its type promises.
fn expected(grid: &TerrainGrid) -> Array2<f64> {
    let own = grid.heights().unwrap();
    Array2::from_shape_fn(own.dim(), |(r, c)| {
        let Some((x, y)) = c.checked_sub(BORDER).zip(r.checked_sub(BORDER)) else { return 0.0 };
        let (row, column) = (x / CELLS, y / CELLS);
        let at = [x % CELLS, y % CELLS];
        if row >= ROWS || column >= grid.columns || at.contains(&0) {
            return 0.0;
        }
        let (tile, d) = (&TerrainTile::all()[column], 0.5 * row as f64);
        closed_form(tile, d, at).unwrap_or_else(|| {
            let height = own[(r, c)];
            match tile {
                TerrainTile::Rough(_) => {
                    let level = 100.0 * height;
                    assert!((level - level.round()).abs() < 1e-9 && height.abs() <= 0.02 + 0.08 * d + 1e-9, "{height}");
                }
                TerrainTile::Boxes(_) => {
                    // 0.45 m are five cells after rounding up. Cells of one box are equally high.
                    assert!(height.abs() <= 0.05 + 0.15 * d, "{height}");
                    let [first_x, first_y] = at.map(|k| k / 5 * 5);
                    let corner = own[(r - at[1] + first_y.max(1), c - at[0] + first_x.max(1))];
                    assert!(height == corner || height == 0.0 || corner == 0.0, "{at:?}");
                }
                TerrainTile::DiscreteObstacles(_) => {
                    assert!(height == 0.0 || (height - (0.05 + 0.15 * d)).abs() < 1e-12, "{height}");
                }
                other => panic!("{} has neither a closed form nor a property", other.name()),
            }
            height
        })
    })
}

/// MuJoCo stores heights in single precision, as fractions of the range of about 2.3 m: errors of 2^-25 of it, 7e-8 m.
/// A ray caster and a depth image that measure from 6 m above have errors of single precision, 2^-24 of 6 m with a few
/// operations: 4e-6 m. Control: the grid of another seed, and one that is moved by a cell.
#[test]
fn tiles() {
    let grid = grid();
    let cfg = TerrainCfg::generated("grid", grid.clone()).unwrap();
    assert_eq!(cfg.size, [ROWS as f64 * 4.0 + 1.0, 11.0 * 4.0 + 1.0]);
    let expected = expected(&grid);
    let moved = Array2::from_shape_fn(expected.dim(), |(r, c)| expected[(r, (c + 1).min(expected.ncols() - 1))]);
    let mut sim = empty();
    sim.add_terrain(cfg.clone()).unwrap();
    // A height scanner and a camera above one tile of every type.
    let (mut scanners, mut cameras) = (Vec::new(), Vec::new());
    for column in 0..grid.columns {
        let [x, y] = grid.tile_center(1 + column % 2, column);
        let scanner = RayCasterCfg {
            offset: Pose::translation(x + 0.013, y - 0.007, 6.0),
            pattern: Grid { resolution: 0.26, size: [3.9, 3.9], ..Grid::default() }.into(),
            targets: HitTargets::Named(vec!["grid".into()]),
            ..RayCasterCfg::default()
        };
        scanners.push(sim.add_sensor(format!("scanner {column}"), scanner).unwrap());
        let placement = Placement::Pose { pos: [x, y, 6.0], rotation: from_wxyz([0.0, 1.0, 0.0, 0.0]) };
        let camera = CameraCfg {
            width: 24,
            height: 24,
            intrinsics: Intrinsics::Pixels { fx: 40.0, fy: 40.0, cx: 12.0, cy: 12.0 },
            extrinsics: Extrinsics { placement, ..Default::default() },
            channels: Channels::from_names(&["depth"]).unwrap(),
            ..Default::default()
        };
        cameras.push(sim.add_sensor(format!("camera {column}"), camera).unwrap());
    }
    sim.update(1);
    let ray = |from: [f64; 3], along: [f64; 3]| {
        let hit = sim.batch().read(1, |env| env.data().ray(from, along, 0b111)).unwrap();
        hit.map(|hit| hit.distance)
    };
    let (mut worst, mut control, mut count) = (0.0_f64, 0.0_f64, 0);
    for column in 0..grid.columns {
        for row in 0..ROWS {
            let [x, y] = grid.tile_center(row, column);
            for k in 0..400 {
                // Points of a lattice whose steps are no fraction of a cell.
                let at = [
                    x - 1.97 + 3.94 * ((k % 20) as f64 + 0.37) / 20.0,
                    y - 1.96 + 3.93 * ((k / 20) as f64 + 0.41) / 20.0,
                ];
                let found = 6.0 - ray([at[0], at[1], 6.0], [0.0, 0.0, -1.0]).unwrap();
                worst = worst.max((found - height(&cfg, &expected, at).unwrap()).abs());
                control = control.max((found - height(&cfg, &moved, at).unwrap()).abs());
                count += 1;
            }
        }
    }
    assert!(count == 33 * 400 && worst < 1e-6, "mj_ray is {worst} m off");
    assert!(control > 0.5, "the control: {control} m");
    let other = TerrainGrid { seed: 12, ..grid.clone() }.heights().unwrap();
    assert_ne!(other, cfg.heights);

    let (mut scanned, mut rendered) = (0.0_f64, 0.0_f64);
    for (&scanner, &camera) in scanners.iter().zip(&cameras) {
        let scanner = sim.sensor(scanner).unwrap();
        assert!(scanner.hit_mask().iter().all(|hit| *hit));
        let (start, hits) = (scanner.ray_starts(), scanner.hits());
        for k in 0..hits.dim().1 {
            let at = [start[(1, k, 0)], start[(1, k, 1)]];
            scanned = scanned.max((hits[(1, k, 2)] - height(&cfg, &expected, at).unwrap()).abs());
        }
        let camera = sim.sensor(camera).unwrap();
        let pose = camera.pose_w(CameraConvention::Ros);
        let rotation = from_wxyz([3, 4, 5, 6].map(|k| pose[(1, k)]));
        let depth = camera.depth().unwrap();
        // A pixel at a wall may see either side of its edge: MuJoCo and the rasterizer round differently there. The
        // median over the image is exact, and only pixels at edges differ.
        let mut off: Vec<f64> = Vec::new();
        for v in 0..24 {
            for u in 0..24 {
                let along = rotation * nalgebra::Vector3::new((u as f64 - 11.5) / 40.0, (v as f64 - 11.5) / 40.0, 1.0);
                let from = [pose[(1, 0)], pose[(1, 1)], pose[(1, 2)]];
                // The direction has length 1 along the optical axis, and `mj_ray` counts in its lengths.
                let distance = ray(from, [along.x, along.y, along.z]).unwrap();
                off.push((distance - f64::from(depth[(1, v, u)])).abs());
            }
        }
        off.sort_by(f64::total_cmp);
        assert!(off[off.len() * 95 / 100] < 1e-5, "depth is {} m off", off[off.len() * 95 / 100]);
        rendered = rendered.max(off[off.len() / 2]);
    }
    assert!(scanned < 1e-5 && rendered < 4e-6, "the scanner is {scanned} m off, the camera {rendered} m");
}

#[test]
fn in_files() {
    let file = r#"
        uid = "field"
        [heights.grid]
        rows = 2
        columns = 3
        tile_size = [4.0, 4.0]
        platform = 1.0
        tiles = [{ tile = { stairs_up = { step_height = [0.1, 0.2] } }, share = 2.0 }, { tile = { flat = {} } }]
    "#;
    let cfg: TerrainCfg = toml::from_str(file).unwrap();
    assert_eq!(cfg.heights.dim(), (3 * 40 + 40 + 1, 2 * 40 + 40 + 1));
    // The platform of the harder stairs: five steps of 0.2 m. The last column is flat.
    assert!((cfg.heights[(20 + 20, 20 + 60)] - 1.0).abs() < 1e-12);
    assert_eq!(cfg.heights[(20 + 100, 20 + 60)], 0.0);
    for (from, to, says) in [
        ("stairs_up", "stair_up", "stairs_up"),
        ("step_height", "step_heigkt", "step_height"),
        ("rows = 2", "rows = 0", "rows is 0"),
        ("heights.grid", "heights.gird", "stepping_stones"),
    ] {
        let error = toml::from_str::<TerrainCfg>(&file.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(says), "{error}");
    }
}
