//! Every renderer sees the scenes of the examples `create_sensor` and `render_model` as the rasterizer does.

use kinetoscope::prelude::*;
use kinetoscope::scene::PoseF32;
use kinetoscope::scene::pose::{from_wxyz, from_xyz_rpy};
use kinetoscope::sensors::camera::{Frame, ParallelRasterizer, look_at_pose};
use kinetoscope::sensors::visibility::View;
use kinetoscope::sim::Still;
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
            raster: RasterCfg { lod: false, ..RasterCfg::default() },
            ..Default::default()
        };
        (renderer, sim.add_sensor(format!("camera_{k}"), cfg).unwrap())
    });
    let cameras = cameras.collect();
    sim.update(1);
    (sim, cameras)
}

/// What a picture shows, row by row.
#[derive(Clone, Copy)]
struct Shown<'a> {
    mask: &'a [i32],
    depth: &'a [f32],
    normal: &'a [f32],
}

impl Shown<'_> {
    fn of(frame: &Frame) -> Shown<'_> {
        let (mask, depth) = (frame.mask.as_ref().unwrap(), frame.depth.as_ref().unwrap());
        Shown { mask, depth, normal: frame.normal.as_ref().unwrap() }
    }

    /// Whether a pixel and those around it show the same, which is no silhouette.
    fn is_whole(&self, [x, y]: [usize; 2]) -> bool {
        let here = y * SIZE[0] + x;
        (0..9).map(|n| (y + n / 3 - 1) * SIZE[0] + x + n % 3 - 1).all(|at| {
            let (d, beside) = (self.depth[here], self.depth[at]);
            (d == beside || (d - beside).abs() < 0.1 * d) && self.mask[at] == self.mask[here]
        })
    }
}

/// Masks, depths to 1e-4 and normals to half a degree of two pictures, off the silhouettes of each by itself: a pixel that shows
/// something else in the other is compared. Centres of pixels on edges between triangles may have the normal of either of them.
fn assert_alike(what: &str, a: Shown<'_>, b: Shown<'_>) {
    let (mut compared, mut different, mut turned, mut hits) = (0, 0, 0, 0);
    for (y, x) in (1..SIZE[1] - 1).flat_map(|y| (1..SIZE[0] - 1).map(move |x| (y, x))) {
        if !a.is_whole([x, y]) || !b.is_whole([x, y]) {
            continue;
        }
        let here = y * SIZE[0] + x;
        let (d, other) = (a.depth[here], b.depth[here]);
        let nothing = d == f32::INFINITY;
        let close = other == d || (other - d).abs() <= 1e-4 * d;
        let cosine: f32 = (3 * here..3 * here + 3).map(|k| a.normal[k] * b.normal[k]).sum();
        let facing = nothing || cosine >= 0.5f32.to_radians().cos();
        compared += 1;
        hits += usize::from(!nothing);
        different += usize::from(!close || a.mask[here] != b.mask[here]);
        turned += usize::from(!facing);
    }
    println!("{what}: {different} of {compared} pixels differ, {turned} in their normals, {hits} see something");
    assert!(compared > SIZE[0] * SIZE[1] * 8 / 10 && hits > SIZE[0] * SIZE[1] / 20, "{what}: {compared} {hits}");
    assert!(different == 0 && turned * 1000 <= compared, "{what}: {different}, {turned} of {compared}");
}

/// And about as bright: the same lamps, the same light from all around.
fn assert_as_bright(what: &str, a: &[u8], b: &[u8]) {
    let mean = |color: &[u8]| color.iter().map(|&x| f64::from(x)).sum::<f64>();
    let ratio = mean(b) / mean(a);
    assert!((0.8..1.25).contains(&ratio), "{what}: {ratio}");
}

/// What a camera shows.
fn frame_of(camera: &Camera) -> Frame {
    Frame {
        color: Some(camera.color().unwrap().iter().copied().collect()),
        mask: Some(camera.mask().unwrap().iter().copied().collect()),
        depth: Some(camera.depth().unwrap().iter().copied().collect()),
        normal: Some(camera.normal().unwrap().iter().copied().collect()),
        ..Frame::default()
    }
}

#[test]
fn masks_depths_and_normals_are_the_rasterizers_off_silhouettes() {
    for place in [Place::Above, Place::Tip, Place::Beside] {
        let (sim, cameras) = cameras(place);
        let raster = frame_of(sim.sensor(cameras[0].1).unwrap());
        for (renderer, camera) in &cameras[1..] {
            let other = frame_of(sim.sensor(*camera).unwrap());
            let what = format!("{place:?}, {renderer:?}");
            assert_alike(&what, Shown::of(&raster), Shown::of(&other));
            assert!(raster.color != other.color || *renderer == Renderer::FastRayTraced, "{what} is another renderer");
            assert_as_bright(&what, raster.color.as_ref().unwrap(), other.color.as_ref().unwrap());
        }
    }
}

/// As the example `render_model` draws files: glass, mirrors and lamps of a size, and a robot.
#[test]
fn files_are_drawn_alike_by_all_renderers() {
    let still_life = Still::of_mjcf(assets::path("scenes/still_life.xml").unwrap(), None).unwrap();
    let mut sim =
        SimulationManager::new(SimulationManagerCfg { ground: None, ..SimulationManagerCfg::default() }).unwrap();
    let urdf = UrdfCfg::single(assets::path("sr5/SR5.urdf").unwrap());
    sim.add_robot(RobotCfg { urdf, ..Default::default() }).unwrap();
    let robot = Still::of_env(&mut sim, EnvId(0)).unwrap();
    let front = still_life.camera("front").unwrap();
    let free = robot.free_camera();
    let aside = look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0]).unwrap();
    // From as near as half the angle makes it: MuJoCo's viewers begin far away.
    let near = 0.5 * free.fovy;
    let all = [("still life", &still_life, front.world_from_camera, front.fovy), ("robot", &robot, aside, near)];
    for (name, still, pose, radians) in all {
        let pixels = Intrinsics::Fovy { radians }.to_pixels(SIZE[0], SIZE[1]).unwrap();
        let [fx, fy, cx, cy] = [pixels.fx, pixels.fy, pixels.cx, pixels.cy].map(|x| x as f32);
        let [near, far] = still.free_camera().clip.map(|x| x as f32);
        let [width, height] = SIZE;
        let view = View { width, height, fx, fy, cx, cy, near, far, world_from_camera: PoseF32::from(&pose) };
        let draw = |renderer| {
            let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
            let mut rasterizer = ParallelRasterizer::new(RasterCfg { lod: false, ..RasterCfg::default() }, 2);
            rasterizer.set_renderer(renderer);
            let mut frame = Frame::new(width, height, channels);
            rasterizer.render(&mut [(still.shot(&view), frame.as_mut())]).unwrap();
            frame
        };
        let raster = draw(Renderer::Raster);
        let paths = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: true, seed: 0 };
        for renderer in [Renderer::Hybrid, Renderer::FastRayTraced, paths] {
            let other = draw(renderer);
            let what = format!("{name}, {renderer:?}");
            assert_alike(&what, Shown::of(&raster), Shown::of(&other));
            assert!(raster.color != other.color || renderer == Renderer::FastRayTraced, "{what} is another renderer");
        }
    }
}
