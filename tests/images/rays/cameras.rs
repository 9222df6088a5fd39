//! Agreement of ray-cast cameras and rasterized cameras with the same placement and the same intrinsics.

use crate::rays::scanner::tumbling_box;
use kinetoscope::ndarray::{Axis, s};
use kinetoscope::prelude::*;
use kinetoscope::sensors::camera::{CameraConvention, PointFrame};
use kinetoscope::sensors::ray::RayCasterCameraCfg;

const LENSES: [Intrinsics; 2] = [
    Intrinsics::Fovy { radians: 0.7 },
    // An off-center principal point and non-square pixels.
    Intrinsics::Pixels { fx: 110.0, fy: 95.0, cx: 52.5, cy: 50.25 },
];

/// Numbers of compared pixels, of pixels that differ in mask, depth or point, and of pixels that differ in normals,
/// over both environments. The rasterizer has the intrinsics `lens` in environment 1.
fn compare(lens: Intrinsics) -> [usize; 3] {
    let (mut sim, _) = tumbling_box(2, 2);
    let (width, height) = (120, 90);
    let rays = RayCasterCameraCfg { width, height, ..Default::default() };
    let channels = Channels::from_names(&["depth", "mask", "normal"]).unwrap();
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
    assert!(rays.mask().iter().collect::<std::collections::BTreeSet<_>>().len() >= 4, "ground, trunk, wall, ball");
    let (depth, mask, normal) = (raster.depth().unwrap(), raster.mask().unwrap(), raster.normal().unwrap());
    let points = [0, 1].map(|env| {
        let cloud = rays.point_cloud(env, PointFrame::Camera).unwrap();
        assert_eq!(cloud.nrows(), rays.mask().index_axis(Axis(0), env).iter().filter(|id| **id != 0).count());
        [rays.point_map(env, PointFrame::World), raster.point_map(env, PointFrame::World)].map(Result::unwrap)
    });
    let mut counts = [0; 3];
    for (at, id) in rays.mask().indexed_iter() {
        // Beyond the rasterizer's far plane of 100 m, the rays still hit the ground.
        if rays.depth()[at] > 99.0 {
            continue;
        }
        // The rasterizer's planes of 1/z are in single precision: ten rounding errors of 6e-8, and six times that at a
        // slant of up to 80 degrees. Points have this error along their ray, in three coordinates.
        let close = (rays.depth()[at] / depth[at] - 1.0).abs() < 5e-6;
        let (env, v, u) = at;
        let [a, b] = &points[env];
        let apart: f32 = (0..3).map(|k| (a[(v, u, k)] - b[(v, u, k)]).abs()).sum();
        let same = *id == mask[at] && close && apart <= 1e-5 * rays.distance()[at];
        let turned = &rays.normal().slice(s![env, v, u, ..]) - &normal.slice(s![env, v, u, ..]);
        counts[0] += 1;
        counts[1] += usize::from(!same);
        counts[2] += usize::from(turned.iter().any(|error| error.is_nan() || error.abs() >= 1e-3));
    }
    counts
}

/// Coverage is snapped to 1/256 pixel, so outlines are off by at most 1/512 pixel. The outlines of a box, a wall and a
/// ball in two images have about 1500 pixels; 1500 / 256 = 6 of them have their center within that distance. The limit
/// is twice as many. The control is a focal length that is half a percent longer.
#[test]
fn same_images() {
    let [compared, differing, turned] = compare(LENSES[1]);
    assert!(compared > 15_000 && differing < 12 && turned < 40, "{differing}, {turned} of {compared} pixels differ");
    let [compared, differing, _] = compare(Intrinsics::Pixels { fx: 110.5, fy: 95.5, cx: 52.5, cy: 50.25 });
    assert!(differing > compared / 4, "{differing} of {compared} pixels differ");
}
