//! Every renderer sees the scene of the example `create_sensor` as the rasterizer does.

use kinetoscope::prelude::*;
use kinetoscope::scene::pose::{from_wxyz, from_xyz_rpy};
use std::f64::consts::FRAC_PI_2;

const SIZE: [usize; 2] = [320, 240];

/// Where the cameras are.
#[derive(Clone, Copy, Debug)]
enum Place {
    /// Above the cube, as the example has it.
    Above,
    /// On the tip of the arm, as the example has it with `--attach-sensor`.
    Tip,
    /// Beside the arm, so that all of it is seen.
    Beside,
}

impl Place {
    fn extrinsics(self) -> Extrinsics {
        let (parent, placement, convention) = match self {
            Self::Above => {
                let rotation = from_wxyz([0.0, 0.0, 1.0, 0.0]);
                (None, Placement::Pose { pos: [1.2, -0.2, 1.5], rotation }, CameraConvention::default())
            }
            Self::Tip => {
                let angles = [(-35f64).to_radians(), 135f64.to_radians(), 0.0];
                let rotation = from_xyz_rpy([0.0; 3], angles).rotation;
                (
                    Some("sr5/ee_link".into()),
                    Placement::Pose { pos: [0.09, 0.05, 0.04], rotation },
                    CameraConvention::OpenGl,
                )
            }
            Self::Beside => {
                let (eye, target) = ([1.6, -1.2, 1.0], [0.2, 0.0, 0.4]);
                (None, Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] }, CameraConvention::default())
            }
        };
        Extrinsics { parent, placement, convention }
    }
}

/// The arm, the hand and the cube, and a camera for each renderer.
fn cameras(place: Place) -> (SimulationManager, Vec<(Renderer, SensorId<Camera>)>) {
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { physics_dt: 0.01, threads: Some(2), ..Default::default() })
            .unwrap();
    let hand = ComponentCfg {
        transform: from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]),
        ..ComponentCfg::new("hand", assets::path("revo1_left/revo1_left.urdf").unwrap())
    };
    let arm = ComponentCfg::new("arm", assets::path("sr5/SR5.urdf").unwrap());
    let urdf = UrdfCfg { components: vec![arm, hand], ..Default::default() };
    sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    sim.add_rigid_object(RigidObjectCfg {
        uid: "cube".into(),
        shape: ObjectShape::cube(0.05),
        init_pose: Pose::translation(1.2, -0.2, 0.1),
        ..Default::default()
    })
    .unwrap();
    let few = Renderer::RayTraced { samples: 1, max_bounces: 1, denoise: true, seed: 0 };
    let all = [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced, few];
    let cameras = all.into_iter().enumerate().map(|(k, renderer)| {
        let cfg = CameraCfg {
            width: SIZE[0],
            height: SIZE[1],
            intrinsics: Intrinsics::Pixels { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0 },
            near: 0.01,
            far: 10.0,
            extrinsics: place.extrinsics(),
            channels: Channels::ALL,
            renderer,
            raster: RasterCfg { lod: false, ..RasterCfg::of_cameras() },
            ..Default::default()
        };
        (renderer, sim.add_sensor(format!("camera_{k}"), cfg).unwrap())
    });
    let cameras = cameras.collect();
    sim.update(1);
    (sim, cameras)
}

#[test]
fn masks_depths_and_normals_are_the_rasterizers_off_silhouettes() {
    for place in [Place::Above, Place::Tip, Place::Beside] {
        let (sim, cameras) = cameras(place);
        let raster = sim.sensor(cameras[0].1).unwrap();
        let (mask, depth) = (raster.mask().unwrap(), raster.depth().unwrap());
        let normal = raster.normal().unwrap();
        for (renderer, camera) in &cameras[1..] {
            let other = sim.sensor(*camera).unwrap();
            let (mask_2, depth_2) = (other.mask().unwrap(), other.depth().unwrap());
            let normal_2 = other.normal().unwrap();
            let (mut compared, mut different) = (0, 0);
            for y in 1..SIZE[1] - 1 {
                for x in 1..SIZE[0] - 1 {
                    let d = depth[(0, y, x)];
                    let other = depth_2[(0, y, x)];
                    // Each picture by itself: a pixel that shows something else in the other is compared.
                    let whole = (0..9).all(|n| {
                        let (at, center) = ((0, y + n / 3 - 1, x + n % 3 - 1), (0, y, x));
                        let near = |a: f32, b: f32| a == b || (a - b).abs() < 0.1 * a;
                        let [here, there] = [near(d, depth[at]), near(other, depth_2[at])];
                        here && there && mask[at] == mask[center] && mask_2[at] == mask_2[center]
                    });
                    if !whole {
                        continue;
                    }
                    compared += 1;
                    let close = other == d || (other - d).abs() <= 1e-4 * d;
                    let cosine: f32 = (0..3).map(|k| normal[(0, y, x, k)] * normal_2[(0, y, x, k)]).sum();
                    let nothing = d == f32::INFINITY;
                    let same = close && mask[(0, y, x)] == mask_2[(0, y, x)];
                    different += usize::from(!same || !(nothing || cosine >= 0.5f32.to_radians().cos()));
                }
            }
            println!("{place:?}, {renderer:?}: {different} of {compared} pixels differ");
            assert!(compared > SIZE[0] * SIZE[1] * 8 / 10, "{renderer:?}: {compared}");
            // Centres of pixels on edges between triangles may belong to either of them.
            assert!(different * 1000 <= compared, "{renderer:?}: {different} of {compared}");
            let (a, b) = (raster.color().unwrap(), sim.sensor(*camera).unwrap().color().unwrap());
            assert!(a != b || *renderer == Renderer::FastRayTraced, "{renderer:?} is another renderer");
            // And about as bright: the same lamps, the same light from all around.
            let mean = |c: &kinetoscope::ndarray::ArrayView4<'_, u8>| c.iter().map(|&x| f64::from(x)).sum::<f64>();
            let ratio = mean(&b) / mean(&a);
            assert!((0.8..1.25).contains(&ratio), "{renderer:?}: {ratio}");
        }
        assert!(mask.iter().any(|&id| id != 0));
    }
}
