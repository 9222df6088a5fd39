//! Tests of the generators' heights.

use super::*;
use ndarray::Array2;

#[test]
fn rough() {
    let terrain = RoughTerrain { size: [20.0, 10.0], cell: 0.1, range: [-0.04, 0.06], step: 0.02, seed: 3 };
    let heights = terrain.heights().expect("heights");
    assert_eq!(heights.dim(), (101, 201));
    let mut counts = [0u32; 6];
    for &height in &heights {
        let level = height / 0.02;
        assert!((level - level.round()).abs() < 1e-9, "{height}");
        counts[(level.round() + 2.0) as usize] += 1;
    }
    // Each count is n p and scatters by sqrt(n p (1 - p)); the limit is six times that.
    let n = heights.len() as f64;
    let (mean, sigma) = (n / 6.0, (n * 5.0 / 36.0).sqrt());
    assert!(counts.iter().all(|&count| (f64::from(count) - mean).abs() < 6.0 * sigma), "{counts:?}, not {mean}");
}

#[test]
fn seeds() {
    let bits = |seed| {
        let heights = RoughTerrain { seed, ..RoughTerrain::default() }.heights().expect("heights");
        heights.iter().map(|h| h.to_bits()).collect::<Vec<u64>>()
    };
    assert_eq!(bits(1), bits(1));
    let (a, b) = (bits(1), bits(2));
    // With four levels, a quarter of the heights agrees by chance.
    let differing = a.iter().zip(&b).filter(|(a, b)| a != b).count();
    assert!(differing > a.len() / 2, "{differing} of {}", a.len());
}

#[test]
fn slope() {
    let heights = Slope { size: [4.0, 2.0], cell: 0.5, gradient: [0.3, -0.1] }.heights().expect("heights");
    assert_eq!(heights.dim(), (5, 9));
    for ((r, c), height) in heights.indexed_iter() {
        let (x, y) = (0.5 * c as f64 - 2.0, 0.5 * r as f64 - 1.0);
        assert!((height - (0.3 * x - 0.1 * y)).abs() < 1e-12, "{r} {c}: {height}");
    }
}

#[test]
fn stairs() {
    let stairs = PyramidStairs { size: [4.0, 4.0], cell: 0.1, step_height: 0.15, tread: 0.3, platform: 1.0 };
    let heights = stairs.heights().expect("heights");
    // 1.5 m from the rim to the platform are five treads of 0.3 m. Every third point is one step higher.
    let profile: Vec<f64> = heights.row(20).iter().take(21).map(|h| (h / 0.15).round()).collect();
    let expected: Vec<f64> = (0..21).map(|k| f64::from(k / 3).min(5.0)).collect();
    assert_eq!(profile, expected);
    assert!((heights[(20, 20)] - 0.75).abs() < 1e-12);
    assert_eq!(heights, heights.t(), "the heights must be symmetric");
    assert_eq!(heights[(0, 20)], 0.0);
}

/// Checks that an error has a message with `says`.
fn refused(result: Result<Array2<f64>, TerrainError>, says: &str) {
    let message = result.expect_err(says).to_string();
    assert!(message.contains(says), "{message} lacks {says}");
}

#[test]
fn refusals() {
    let rough = RoughTerrain::default;
    for (terrain, says) in [
        (RoughTerrain { cell: 0.0, ..rough() }, "cell is 0"),
        (RoughTerrain { size: [f64::NAN, 1.0], ..rough() }, "size is NaN"),
        (RoughTerrain { size: [1.05, 1.0], ..rough() }, "the nearest valid side is 1 m"),
        (RoughTerrain { size: [0.05, 1.0], ..rough() }, "the nearest valid side is 0.2 m"),
        (RoughTerrain { size: [1e6, 1e6], ..rough() }, "too many"),
        (RoughTerrain { size: [f64::MAX, 1.0], cell: 1e-300, ..rough() }, "too many"),
        (RoughTerrain { step: -1.0, ..rough() }, "step is -1"),
        (RoughTerrain { step: 1e-300, ..rough() }, "step is 1e-300"),
        (RoughTerrain { range: [0.01, 0.015], ..rough() }, "no multiple of the step"),
        (RoughTerrain { range: [0.1, 0.0], ..rough() }, "no multiple of the step"),
        (RoughTerrain { range: [0.0, f64::INFINITY], ..rough() }, "range is inf"),
    ] {
        refused(terrain.heights(), says);
    }
    let stairs = PyramidStairs::default;
    for (terrain, says) in [
        (PyramidStairs { tread: 0.1, ..stairs() }, "two cells"),
        (PyramidStairs { platform: 9.0, ..stairs() }, "fit into the field"),
        (PyramidStairs { step_height: f64::NAN, ..stairs() }, "step_height is NaN"),
    ] {
        refused(terrain.heights(), says);
    }
    refused(Slope { gradient: [f64::NAN, 0.0], ..Slope::default() }.heights(), "gradient");
}

#[test]
fn pyramid_slope() {
    let slope = PyramidSlope { size: [4.0, 6.0], cell: 0.5, gradient: -0.3, platform: 1.0 };
    let heights = slope.heights().expect("heights");
    for ((r, c), height) in heights.indexed_iter() {
        let (x, y) = ((0.5 * c as f64).min(4.0 - 0.5 * c as f64), (0.5 * r as f64).min(6.0 - 0.5 * r as f64));
        assert!((height + 0.3 * x.min(y).min(1.5)).abs() < 1e-12, "{r} {c}: {height}");
    }
}

#[test]
fn gap() {
    let gap = Gap { size: [4.0, 4.0], cell: 0.1, width: 0.4, depth: 0.7, platform: 2.0 };
    let heights = gap.heights().expect("heights");
    // The platform begins 1 m from the rim; the trench of 0.4 m has walls of one cell on both sides.
    let profile: Vec<f64> = heights.row(20).iter().copied().collect();
    let expected: Vec<f64> =
        (0..41_i32).map(|k| if (7..=9).contains(&k) || (31..=33).contains(&k) { -0.7 } else { 0.0 }).collect();
    assert_eq!(profile, expected);
    assert_eq!(heights, heights.t());
    assert!(heights.row(3).iter().all(|height| *height == 0.0));
}

#[test]
fn waves() {
    let heights = Waves { size: [4.0, 8.0], cell: 0.1, amplitude: 0.2, waves: 2.0 }.heights().expect("heights");
    for ((r, c), height) in heights.indexed_iter() {
        let wave = |at: f64, length: f64| (2.0 * std::f64::consts::PI * 2.0 * at / length).sin();
        let expected = 0.1 * (wave(0.1 * c as f64, 4.0) + wave(0.1 * r as f64, 8.0));
        assert!((height - expected).abs() < 1e-12, "{r} {c}: {height}");
    }
}

#[test]
fn boxes() {
    let boxes = Boxes { size: [6.0, 6.0], cell: 0.1, side: 0.5, range: [-0.1, 0.3], platform: 1.0, seed: 4 };
    let heights = boxes.heights().expect("heights");
    let mut distinct = std::collections::BTreeSet::new();
    for ((r, c), &height) in heights.indexed_iter() {
        if (25..=35).contains(&r) && (25..=35).contains(&c) {
            assert_eq!(height, 0.0, "the platform, {r} {c}");
            continue;
        }
        assert!((-0.1..=0.3).contains(&height), "{height}");
        distinct.insert(height.to_bits());
        // The corner of the box is outside the platform for all boxes but those that it cuts.
        let corner = heights[(r / 5 * 5, c / 5 * 5)];
        assert!(height == corner || corner == 0.0, "{r} {c}");
    }
    // 13 by 13 boxes, of which 4 are hidden by the platform.
    assert!((165..=169).contains(&distinct.len()), "{}", distinct.len());
}

#[test]
fn stepping_stones() {
    let stones =
        SteppingStones { size: [6.0, 6.0], stone: 0.3, distance: 0.2, range: [0.1, 0.1], ..Default::default() };
    let heights = stones.heights().expect("heights");
    for ((r, c), &height) in heights.indexed_iter() {
        let is_platform = (20..=40).contains(&r) && (20..=40).contains(&c);
        let on = r % 5 <= 3 && c % 5 <= 3;
        let expected = if is_platform {
            0.0
        } else if on {
            0.1
        } else {
            -1.0
        };
        assert_eq!(height, expected, "{r} {c}");
    }
}

#[test]
fn obstacles() {
    let obstacles = DiscreteObstacles { count: 30, range: [0.2, 0.2], seed: 5, ..Default::default() };
    let heights = obstacles.heights().expect("heights");
    let raised = heights.iter().filter(|height| **height == 0.2).count();
    assert_eq!(raised + heights.iter().filter(|height| **height == 0.0).count(), heights.len());
    // 30 rectangles of 0.3 to 1 m cover at most 30 * 11² points, and at least one of them 4² points.
    assert!((16..=30 * 121).contains(&raised), "{raised}");
    for ((r, c), &height) in heights.indexed_iter() {
        let is_platform = (30..=50).contains(&r) && (30..=50).contains(&c);
        assert!(height == 0.0 || !is_platform, "{r} {c}");
    }
    let none = DiscreteObstacles { count: 0, ..Default::default() }.heights().expect("heights");
    assert!(none.iter().all(|height| *height == 0.0));
}

/// Root cause of the failure: every obstacle filled all of its points, so that many large obstacles took the product of
/// their number and their area. In a small field, heights are compared with those of obstacles that fill their points
/// one by one.
#[test]
fn many_obstacles() {
    for [wide, deep] in [[30, 20], [20, 30]] {
        let size = [wide, deep].map(|cells| 0.1 * cells as f64);
        let small = DiscreteObstacles { size, count: 600, sides: [0.1, 0.9], platform: 0.5, ..Default::default() };
        let heights = small.heights().expect("heights");
        let mut random = crate::KeyedRng::keyed(small.seed, 0, "discrete obstacles");
        let mut expected = Array2::<f64>::zeros((deep + 1, wide + 1));
        for _ in 0..small.count {
            let height = random.uniform_range(0.05, 0.2);
            let mut place = |cells: usize| {
                let side = ((random.uniform_range(0.1, 0.9) / 0.1).round() as usize).clamp(1, cells);
                let first = ((random.uniform() * (cells - side + 1) as f64) as usize).min(cells - side);
                first..first + side + 1
            };
            let (columns, rows) = (place(wide), place(deep));
            rows.for_each(|r| columns.clone().for_each(|c| expected[(r, c)] = height));
        }
        let on_platform = |r: usize, c: usize| r.abs_diff(deep / 2) <= 2 && c.abs_diff(wide / 2) <= 2;
        expected.indexed_iter_mut().filter(|((r, c), _)| on_platform(*r, *c)).for_each(|(_, height)| *height = 0.0);
        assert_eq!(heights, expected);
    }

    // The largest count in a large field: point by point, these are 2.5e10 assignments.
    let large = DiscreteObstacles {
        size: [100.0, 100.0],
        count: 100_000,
        sides: [49.0, 50.0],
        platform: 1.0,
        ..Default::default()
    };
    let start = std::time::Instant::now();
    large.heights().expect("heights");
    assert!(start.elapsed().as_secs() < 60, "{:?}", start.elapsed());
}

/// Root cause of the failure: with an odd number of cells along a tile, its center lies between the points, and a
/// platform smaller than a cell contains no point. The maximum over no points was -inf.
#[test]
fn platforms_between_points() {
    for (cells, platform) in [(5.0, 0.05), (5.0, 0.3), (6.0, 0.05)] {
        let tiles = vec![TerrainTile::SlopeUp(SlopeTile { gradient: [0.5, 0.5] }).into()];
        let tile_size = [0.1 * cells; 2];
        let grid = TerrainGrid { rows: 2, columns: 1, tile_size, tiles, platform, border: 0.3, ..Default::default() };
        // The points nearest to the center are `half` a cell or 0 from it.
        let half = if cells == 5.0 { 0.05 } else { 0.0 };
        let expected = 0.5 * (0.05 * cells - half).min(0.5 * (0.1 * cells - platform));
        let tops = grid.platform_heights().expect("heights");
        assert!(tops.iter().all(|top| (top - expected).abs() < 1e-12), "{cells} {platform}: {tops}, not {expected}");
    }
}

/// Heights of every type of tile, halfway between the easiest and the hardest, by closed forms: of the distance from the
/// rim \[cells\], or as a set of values for random types.
#[test]
fn tiles() {
    let cfg = TileCfg { size: [8.0, 8.0], cell: 0.1, platform: 2.0, seed: 7 };
    // The platform begins 3 m from the rim. Stairs have treads of three cells, of which ten fit.
    let by_rim = |name: &str, d: f64| match name {
        "flat" => Some(0.0),
        "slope_up" => Some(0.2 * 0.1 * d.min(30.0)),
        "slope_down" => Some(-0.2 * 0.1 * d.min(30.0)),
        "stairs_up" => Some(0.14 * (d / 3.0).floor().min(10.0)),
        "stairs_down" => Some(-0.14 * (d / 3.0).floor().min(10.0)),
        // A trench of 0.5 m, with a wall of one cell on each side.
        "gap" => Some(if 25.0 < d && d < 30.0 { -1.0 } else { 0.0 }),
        _ => None,
    };
    for tile in TerrainTile::all() {
        let (name, heights) = (tile.name(), tile.heights(0.5, cfg).expect("heights"));
        assert_eq!(heights.dim(), (81, 81), "{name}");
        let mut distinct = std::collections::BTreeSet::new();
        for ((r, c), &height) in heights.indexed_iter() {
            distinct.insert(height.to_bits());
            let wave = |k: usize| (std::f64::consts::TAU * 4.0 * k as f64 / 80.0).sin();
            let exact = if name == "waves" {
                Some(0.5 * 0.11 * (wave(r) + wave(c)))
            } else {
                by_rim(name, r.min(80 - r).min(c).min(80 - c) as f64)
            };
            let is_platform = (30..=50).contains(&r) && (30..=50).contains(&c);
            let valid = match name {
                _ if exact.is_some_and(|exact| (height - exact).abs() > 1e-12) => false,
                "rough" => (height / 0.01 - (height / 0.01).round()).abs() < 1e-9 && height.abs() < 0.06 + 1e-12,
                "boxes" => height.abs() <= 0.125 + 1e-12 && (height == 0.0 || !is_platform),
                "stepping_stones" => height == 0.0 || height == -1.0 && !is_platform,
                "discrete_obstacles" => height == 0.0 || (height - 0.125).abs() < 1e-12 && !is_platform,
                _ => exact.is_some(),
            };
            assert!(valid, "{name}, row {r}, column {c}: {height}, not {exact:?}");
        }
        assert!(distinct.len() > 1 || name == "flat", "{name} is flat");
    }
}

/// Each tile of a grid is the terrain of its type and difficulty; the rims and the border are at height 0.
#[test]
fn grid() {
    let grid =
        TerrainGrid { rows: 4, tile_size: [6.0, 5.0], border: 1.0, difficulty: [0.1, 0.7], ..Default::default() };
    let heights = grid.heights().expect("heights");
    assert_eq!(heights.dim(), (11 * 50 + 20 + 1, 4 * 60 + 20 + 1));
    let inner = |x: usize, y: usize| x > 10 && y > 10 && x < 250 && y < 560;
    for (column, tile) in TerrainTile::all().iter().enumerate() {
        assert_eq!(grid.tile(column), tile);
        for row in 0..4 {
            assert!((grid.row_difficulty(row) - (0.1 + 0.2 * row as f64)).abs() < 1e-12);
            let cfg = TileCfg { size: [6.0, 5.0], cell: 0.1, platform: 2.0, seed: grid.tile_seed(row, column) };
            let own = tile.heights(0.1 + 0.2 * row as f64, cfg).expect("heights");
            let [x, y] = grid.tile_center(row, column);
            assert_eq!(grid.tile_at([x + 2.9, y - 2.4]), Some([row, column]));
            let (first_x, first_y) =
                ((10.0 * (x + 13.0 - 3.0)).round() as usize, (10.0 * (y + 28.5 - 2.5)).round() as usize);
            for ((r, c), &height) in own.indexed_iter() {
                let is_rim = r % 50 == 0 || c % 60 == 0;
                let found = heights[(first_y + r, first_x + c)];
                let expected = if is_rim { 0.0 } else { height };
                // Difficulties of the test and of the grid differ by rounding.
                assert!((found - expected).abs() < 1e-12, "{} {row} {r} {c}: {found} {expected}", tile.name());
            }
        }
    }
    assert!(heights.indexed_iter().all(|((y, x), height)| inner(x, y) || *height == 0.0));
    let tops = grid.platform_heights().expect("heights");
    // Platforms of 2 m in tiles of 6 m by 5 m begin 1.5 m from the rim: a slope of 0.4 per meter times the difficulty
    // is highest there, and lowest in the middle of a slope that leads down. Stairs have five treads of 0.3 m.
    for (row, d) in [0.1, 0.3, 0.5, 0.7].into_iter().enumerate() {
        let expected = [(0, 0.0), (2, 0.4 * d * 1.5), (3, -0.4 * d * 1.5), (4, 5.0 * (0.05 + 0.18 * d)), (8, 0.0)];
        for (column, expected) in expected {
            assert!((tops[(row, column)] - expected).abs() < 1e-9, "{row} {column}: {}", tops[(row, column)]);
        }
    }
    assert_eq!(grid.tile_at([-12.5, 0.0]), None);
    // Shares: three quarters of four columns.
    let tiles =
        vec![TileShare { tile: TerrainTile::Flat {}, share: 3.0 }, TerrainTile::Waves(WavesTile::default()).into()];
    let shared = TerrainGrid { columns: 4, tiles, ..Default::default() };
    let names: Vec<&str> = (0..4).map(|column| shared.tile(column).name()).collect();
    assert_eq!(names, ["flat", "flat", "flat", "waves"]);
}

#[test]
fn new_refusals() {
    refused(PyramidSlope { platform: 9.0, ..PyramidSlope::default() }.heights(), "fit into the field");
    refused(Gap { width: 0.1, ..Gap::default() }.heights(), "two cells");
    refused(Gap { width: 3.5, ..Gap::default() }.heights(), "the gap around it");
    refused(Waves { waves: 40.0, ..Waves::default() }.heights(), "four cells");
    refused(Boxes { range: [0.1, 0.0], ..Boxes::default() }.heights(), "at most the second");
    refused(Boxes { side: 0.1, ..Boxes::default() }.heights(), "two cells");
    refused(SteppingStones { distance: 0.1, ..SteppingStones::default() }.heights(), "two cells");
    refused(SteppingStones { stone: f64::NAN, ..SteppingStones::default() }.heights(), "stone is NaN");
    refused(DiscreteObstacles { sides: [0.5, 9.0], ..Default::default() }.heights(), "must fit into the field");
    refused(DiscreteObstacles { count: u32::MAX, ..Default::default() }.heights(), "at most 100000");
    let tiny = DiscreteObstacles { size: [2.0, 2.0], count: 442, ..Default::default() };
    refused(tiny.heights(), "at most one for each point");
    let grid = TerrainGrid::default;
    refused(TerrainGrid { rows: 0, ..grid() }.heights(), "rows is 0");
    refused(TerrainGrid { tiles: Vec::new(), ..grid() }.heights(), "name at least one");
    refused(TerrainGrid { difficulty: [0.0, 1.1], ..grid() }.heights(), "difficulty is 1.1");
    refused(TerrainGrid { border: 0.55, ..grid() }.heights(), "nearest valid side");
    refused(TerrainGrid { rows: 10_000, ..grid() }.heights(), "too many");
    refused(TerrainGrid { platform: 7.9, ..grid() }.heights(), "row 0, column 8 (gap)");
    let tile = TerrainTile::Waves(WavesTile { waves: f64::NAN, ..WavesTile::default() }).into();
    refused(TerrainGrid { tiles: vec![tile], ..grid() }.heights(), "column 0 (waves): waves: waves is NaN");
}
