//! Cameras of rays and rasterized cameras, placed and given lenses by the same calls, see the same.

use crate::rays::scanner::tumbling;
use kinetoscope::ndarray::Axis;
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::PointFrame;

const SIZE: (usize, usize) = (120, 90);
const LENSES: [Intrinsics; 2] = [
    Intrinsics::Fovy { radians: 0.7 },
    // Off the middle, pixels that are no squares.
    Intrinsics::Pixels { fx: 110.0, fy: 95.0, cx: 52.5, cy: 50.25 },
];

/// Pixels of both environments that are compared, and of those the ones whose depth or point differs, where the rasterizer
/// has `lens` in environment 1.
fn compare(lens: Intrinsics) -> (usize, usize) {
    let (mut sim, _) = tumbling(2, 2);
    let (width, height) = SIZE;
    let rays = RayCasterCameraCfg { width, height, ..Default::default() };
    let channels = Channels::from_names(&["depth", "mask"]).unwrap();
    let raster = CameraCfg { width, height, channels, ..Default::default() };
    let (rays, raster) = (sim.add_sensor("rays", rays).unwrap(), sim.add_sensor("raster", raster).unwrap());
    let eyes = [[-1.5, 1.0, 1.4], [1.6, 1.2, 1.1]];
    let (target, up) = ([[0.1, 0.0, 0.5]], [[0.0, 0.0, 1.0]]);
    let camera = sim.sensor_mut(rays).unwrap();
    camera.look_at(&eyes, &target, &up, None).unwrap();
    camera.set_intrinsics(&LENSES, None).unwrap();
    let camera = sim.sensor_mut(raster).unwrap();
    camera.look_at(&eyes, &target, &up, None).unwrap();
    camera.set_intrinsics(&[LENSES[0], lens], None).unwrap();
    sim.update(9);
    let (rays, raster) = (sim.sensor(rays).unwrap(), sim.sensor(raster).unwrap());
    let apart = rays.pose_w(CameraConvention::Ros) - raster.pose_w(CameraConvention::Ros);
    assert!(apart.iter().all(|x| x.abs() < 1e-12), "{apart}");
    let (depth, mask) = (raster.depth().unwrap(), raster.mask().unwrap());
    let (mut compared, mut differing) = (0, 0);
    for env in 0..2 {
        let [a, b] =
            [rays.point_map(env, PointFrame::World), raster.point_map(env, PointFrame::World)].map(Result::unwrap);
        let cloud = rays.point_cloud(env, PointFrame::Camera).unwrap();
        assert_eq!(cloud.nrows(), rays.mask().index_axis(Axis(0), env).iter().filter(|id| **id != 0).count());
        for v in 0..height {
            for u in 0..width {
                let at = (env, v, u);
                // Beyond the rasterizer's far plane of 100 m there is still ground.
                if rays.depth()[at] > 99.0 {
                    continue;
                }
                compared += 1;
                // The rasterizer's planes of 1/z are in single precision: ten roundings of 6e-8, where a surface is seen at a
                // slant of up to 80 degrees six times that. Points have that error along their ray, in three numbers.
                let close = (rays.depth()[at] / depth[at] - 1.0).abs() < 5e-6;
                let apart: f32 = (0..3).map(|k| (a[(v, u, k)] - b[(v, u, k)]).abs()).sum();
                let same = rays.mask()[at] == mask[at] && close && apart <= 1e-5 * rays.distance()[at];
                differing += usize::from(!same);
            }
        }
    }
    (compared, differing)
}

#[test]
fn cameras_that_are_moved_alike_see_alike() {
    let (compared, differing) = compare(LENSES[1]);
    println!("{differing} of {compared} pixels differ");
    // Coverage is snapped to 1/256 pixel, so that outlines are off by 1/512 at most: of the some 1500 pixels on those of a
    // box, a wall and a ball in two pictures, 1500 / 256 = 6 have their centre as near as that. Twice as many are too many.
    assert!(compared > 15_000 && differing < 12, "{differing} of {compared} pixels differ");
}

/// The control: a lens that is half a percent longer is found out.
#[test]
fn another_lens_is_found_out() {
    let (compared, differing) = compare(Intrinsics::Pixels { fx: 110.5, fy: 95.5, cx: 52.5, cy: 50.25 });
    assert!(differing > compared / 4, "{differing} of {compared} pixels differ");
}
