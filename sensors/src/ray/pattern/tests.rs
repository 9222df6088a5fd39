//! Counts and orders of rays, as in Isaac Lab.

use super::*;
use kinetoscope_render::Intrinsics;

fn rays(pattern: impl Into<RayPattern>) -> Vec<Ray> {
    pattern.into().rays().unwrap()
}

/// The height scanner has 187 rays, x fastest. Grids whose size is not a multiple of the resolution begin at the edge
/// or are centered: a length of 1 at 0.3 has the points -0.5, -0.2, 0.1, 0.4.
#[test]
fn grids() {
    let all = rays(Grid::default());
    assert_eq!((all.len(), Grid::default().shape()), (187, [17, 11]));
    let near = |ray: Ray, b: [f64; 3]| (0..3).all(|k| (ray.origin[k] - b[k]).abs() < 1e-12);
    assert!(near(all[0], [-0.8, -0.5, 0.0]) && near(all[1], [-0.7, -0.5, 0.0]));
    assert!(near(all[17], [-0.8, -0.4, 0.0]) && near(all[186], [0.8, 0.5, 0.0]));
    assert!(all.iter().all(|r| r.direction == [0.0, 0.0, -1.0]));
    let other = rays(Grid { order: GridOrder::Yx, ..Grid::default() });
    assert!(near(other[1], [-0.8, -0.4, 0.0]) && near(other[11], [-0.7, -0.5, 0.0]));
    let grid = Grid { resolution: 0.3, size: [1.0, 0.0], direction: [0.0, 0.0, -2.0], ..Grid::default() };
    let x = |grid: Grid| rays(grid).iter().map(|r| (r.origin[0] * 100.0).round()).collect::<Vec<_>>();
    assert_eq!(x(grid), [-50.0, -20.0, 10.0, 40.0]);
    assert_eq!(x(Grid { centered: true, ..grid }), [-45.0, -15.0, 15.0, 45.0]);
    assert_eq!(rays(grid)[0].direction, [0.0, 0.0, -1.0], "of length 1");
}

/// A full turn excludes its end.
#[test]
fn lidars() {
    let lidar = |horizontal_fov_deg, horizontal_resolution_deg| Lidar {
        channels: 3,
        vertical_fov_deg: [-10.0, 20.0],
        horizontal_fov_deg,
        horizontal_resolution_deg,
    };
    let turn = rays(lidar([0.0, 360.0], 90.0));
    assert_eq!(turn.len(), 3 * 4);
    let angles = |r: &Ray| {
        let [x, y, z] = r.direction;
        (z.asin().to_degrees().round(), y.atan2(x).to_degrees().round())
    };
    assert_eq!(
        turn[..5].iter().map(angles).collect::<Vec<_>>(),
        [(-10., 0.), (-10., 90.), (-10., 180.), (-10., -90.), (5., 0.)]
    );
    assert_eq!(rays(lidar([-45.0, 45.0], 30.0)).len(), 3 * 4, "-45, -15, 15, 45");
    assert_eq!(rays(lidar([-45.0, 45.0], 40.0)).len(), 3 * 3, "-45, -5, 35");
    assert_eq!(rays(Lidar::default()).len(), 16 * 900);
}

/// 1152 rays, beams fastest.
#[test]
fn bpearl() {
    let all = rays(Bpearl::default());
    assert_eq!(all.len(), 1152);
    // The first azimuth is -180 degrees; the last beam is nearly level.
    let elevation = |k: usize| all[k].direction[2].asin().to_degrees();
    assert!((elevation(0) - 89.5).abs() < 1e-9 && (elevation(31) - 2.3125).abs() < 1e-9);
    assert!(all[31].direction[0] > 0.99 && (elevation(32) - 89.5).abs() < 1e-9);
    assert!(all.iter().all(|r| r.direction[2] > 0.0), "the upper half");
}

/// Rays through the centers of pixels.
#[test]
fn pinholes() {
    let intrinsics = Intrinsics::Pixels { fx: 2.0, fy: 4.0, cx: 1.0, cy: 1.0 };
    let all = rays(Pinhole { width: 2, height: 2, intrinsics });
    let expected = [[0.25, 0.125], [-0.25, 0.125], [0.25, -0.125], [-0.25, -0.125]];
    for (ray, [y, z]) in all.iter().zip(expected) {
        let [a, b, c] = ray.direction;
        assert!((b / a - y).abs() < 1e-15 && (c / a - z).abs() < 1e-15, "{ray:?}");
    }
}

#[test]
fn mistakes() {
    let error = |pattern: RayPattern| pattern.rays().unwrap_err().to_string();
    for resolution in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        let text = error(Grid { resolution, ..Grid::default() }.into());
        assert!(text.contains("resolution") && text.contains("positive"), "{text}");
        assert!(error(Lidar { horizontal_resolution_deg: resolution, ..Lidar::default() }.into()).contains("positive"));
        assert!(
            error(Bpearl { horizontal_resolution_deg: resolution, ..Bpearl::default() }.into()).contains("positive")
        );
    }
    assert!(error(Grid { resolution: 1e-9, ..Grid::default() }.into()).contains("between 1 and 16777216"));
    assert!(error(Grid { size: [-1.0, 1.0], ..Grid::default() }.into()).contains("size along x"));
    assert!(error(Grid { direction: [0.0; 3], ..Grid::default() }.into()).contains("direction other than zero"));
    assert!(error(Lidar { channels: 0, ..Lidar::default() }.into()).contains("0e0 rays"));
    assert!(error(Lidar { horizontal_fov_deg: [0.0, 400.0], ..Lidar::default() }.into()).contains("400"));
    assert!(error(Lidar { vertical_fov_deg: [0.0, 91.0], ..Lidar::default() }.into()).contains("91"));
    let intrinsics = Intrinsics::Fovy { radians: 4.0 };
    assert!(error(Pinhole { intrinsics, ..Pinhole::default() }.into()).contains("angle"));
    assert!(error(Custom { starts: vec![[0.0; 3]; 2], directions: vec![[1.0; 3]] }.into()).contains("2 starts and 1"));
    let text = error(Custom { starts: vec![[f64::NAN, 0.0, 0.0]], directions: vec![[1.0; 3]] }.into());
    assert!(text.contains("ray 0"), "{text}");
    assert!(error(Custom::default().into()).contains("0e0 rays"));
}
