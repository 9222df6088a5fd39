//! Tests of the generators' heights.

use super::*;

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

#[test]
fn refusals() {
    let rough = RoughTerrain::default;
    let refused = |result: Result<ndarray::Array2<f64>, TerrainError>, says: &str| {
        let message = result.expect_err(says).to_string();
        assert!(message.contains(says), "{message} lacks {says}");
    };
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
