//! Agreement of all renderers with the rasterizer, on the scenes of the examples `create_sensor` and `render_model`.

use super::view;
use kinetoscope::prelude::*;
use kinetoscope::render::ParallelRenderer;
use kinetoscope::render::frame::Frame;
use kinetoscope::scene::pose::{from_wxyz, from_xyz_rpy};
use kinetoscope::sensors::camera::{Camera, CameraConvention, look_at_pose};
use kinetoscope::sim::OffscreenScene;
use kinetoscope_testkit::worlds::{cfg, look_at, object, sr5};
use std::f64::consts::FRAC_PI_2;

const SIZE: [usize; 2] = [320, 240];

/// The example's cameras above the cube and on the tip of the arm, and one beside the arm that shows all of it.
fn places() -> [(&'static str, Extrinsics); 3] {
    let above = Placement::Pose { pos: [1.2, -0.2, 1.5], rotation: from_wxyz([0.0, 0.0, 1.0, 0.0]) };
    let angles = [(-35f64).to_radians(), 135f64.to_radians(), 0.0];
    let tip = Placement::Pose { pos: [0.09, 0.05, 0.04], rotation: from_xyz_rpy([0.0; 3], angles).rotation };
    let (parent, convention) = (Some("sr5/ee_link".into()), CameraConvention::OpenGl);
    [
        ("above", Extrinsics { placement: above, ..Default::default() }),
        ("tip", Extrinsics { parent, placement: tip, convention }),
        ("beside", look_at([1.6, -1.2, 1.0], [0.2, 0.0, 0.4])),
    ]
}

/// Images of the arm, the hand and the cube by each renderer.
fn images(extrinsics: &Extrinsics, renderers: [Renderer; 4]) -> [Frame; 4] {
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { physics_dt: 0.01, ..cfg(1, 2) });
    let hand = ComponentCfg {
        transform: from_xyz_rpy([0.0, 0.0, 0.02], [FRAC_PI_2, 0.0, 0.0]),
        ..ComponentCfg::new("hand", assets::path("revo1_left/revo1_left.urdf").unwrap())
    };
    let arm = ComponentCfg::new("arm", assets::path("sr5/SR5.urdf").unwrap());
    let urdf = UrdfCfg { components: vec![arm, hand], ..Default::default() };
    sim.add_robot(RobotCfg { uid: "sr5".into(), urdf, ..Default::default() }).unwrap();
    sim.add_rigid_object(object("cube", ObjectShape::cube(0.05), [1.2, -0.2, 0.1])).unwrap();
    let ids: [SensorId<Camera>; 4] = std::array::from_fn(|k| {
        let cfg = CameraCfg {
            width: SIZE[0],
            height: SIZE[1],
            intrinsics: Intrinsics::Pixels { fx: 300.0, fy: 300.0, cx: 160.0, cy: 120.0 },
            near: 0.01,
            far: 10.0,
            extrinsics: extrinsics.clone(),
            channels: Channels::ALL,
            renderer: renderers[k],
            raster: RasterCfg { lod: false, ..RasterCfg::default() },
            ..Default::default()
        };
        sim.add_sensor(format!("camera_{k}"), cfg).unwrap()
    });
    sim.update(1);
    ids.map(|id| {
        let camera = sim.sensor(id).unwrap();
        Frame {
            color: Some(camera.color().unwrap().iter().copied().collect()),
            mask: Some(camera.mask().unwrap().iter().copied().collect()),
            depth: Some(camera.depth().unwrap().iter().copied().collect()),
            normal: Some(camera.normal().unwrap().iter().copied().collect()),
            ..Frame::default()
        }
    })
}

/// True if a pixel and its neighbors show the same surface, so that the pixel is not at a silhouette.
fn is_off_silhouette(frame: &Frame, [x, y]: [usize; 2]) -> bool {
    let (mask, depth) = (frame.mask.as_ref().unwrap(), frame.depth.as_ref().unwrap());
    let here = y * SIZE[0] + x;
    (0..9).map(|n| (y + n / 3 - 1) * SIZE[0] + x + n % 3 - 1).all(|at| {
        let (d, beside) = (depth[here], depth[at]);
        (d == beside || (d - beside).abs() < 0.1 * d) && mask[at] == mask[here]
    })
}

/// Asserts agreement with the rasterizer in masks, in depths to 1e-4 and in normals to half a degree. Returns true if
/// colors differ, as they do somewhere for another renderer.
///
/// Silhouettes are excluded per image: a pixel that shows another object in only one of the images is still compared. A
/// pixel center on an edge between triangles may have the normal of either triangle.
fn assert_alike(what: &str, renderer: Renderer, raster: &Frame, other: &Frame) -> bool {
    let (a, b) = (raster, other);
    let (mut compared, mut different, mut turned, mut hits) = (0, 0, 0, 0);
    for (y, x) in (1..SIZE[1] - 1).flat_map(|y| (1..SIZE[0] - 1).map(move |x| (y, x))) {
        if !is_off_silhouette(a, [x, y]) || !is_off_silhouette(b, [x, y]) {
            continue;
        }
        let here = y * SIZE[0] + x;
        let [(mask, d, normal), (other_mask, other, other_normal)] = [a, b]
            .map(|f| (f.mask.as_ref().unwrap()[here], f.depth.as_ref().unwrap()[here], f.normal.as_ref().unwrap()));
        let nothing = d == f32::INFINITY;
        let close = other == d || (other - d).abs() <= 1e-4 * d;
        let cosine: f32 = (3 * here..3 * here + 3).map(|k| normal[k] * other_normal[k]).sum();
        let facing = nothing || cosine >= 0.5f32.to_radians().cos();
        compared += 1;
        hits += usize::from(!nothing);
        different += usize::from(!close || mask != other_mask);
        turned += usize::from(!facing);
    }
    let what = format!("{what}, {renderer:?}");
    assert!(compared > SIZE[0] * SIZE[1] * 8 / 10 && hits > SIZE[0] * SIZE[1] / 20, "{what}: {compared} {hits}");
    assert!(different == 0 && turned * 1000 <= compared, "{what}: {different}, {turned} of {compared}");
    raster.color != b.color
}

/// Asserts that each renderer with its own lighting produced a color image that differs from the rasterizer's.
fn assert_other_renderers(differs: &[(Renderer, bool)]) {
    for (renderer, _) in differs.iter().filter(|(renderer, _)| *renderer != Renderer::FastRayTraced) {
        assert!(
            differs.iter().any(|(other, differs)| other == renderer && *differs),
            "{renderer:?} is another renderer"
        );
    }
}

/// The brightness agrees too: same lights, same ambient light.
#[test]
fn example_create_sensor() {
    let paths = Renderer::RayTraced { samples: 1, max_bounces: 1, denoise: true, seed: 0 };
    let renderers = [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced, paths];
    let mut differs = Vec::new();
    for (what, extrinsics) in places() {
        let frames = images(&extrinsics, renderers);
        let sum = |frame: &Frame| frame.color.as_ref().unwrap().iter().map(|&x| f64::from(x)).sum::<f64>();
        for (renderer, frame) in renderers.into_iter().zip(&frames).skip(1) {
            differs.push((renderer, assert_alike(what, renderer, &frames[0], frame)));
            let ratio = sum(frame) / sum(&frames[0]);
            assert!((0.8..1.25).contains(&ratio), "{what}, {renderer:?}: {ratio}");
        }
    }
    assert_other_renderers(&differs);
}

/// A file with glass, mirrors and area lights, and a robot.
#[test]
fn example_render_model() {
    let still_life = OffscreenScene::of_mjcf(assets::path("scenes/still_life.xml").unwrap(), None).unwrap();
    let mut sim = kinetoscope_testkit::worlds::sim(SimulationManagerCfg { ground: None, ..Default::default() });
    sim.add_robot(sr5("robot")).unwrap();
    let robot = OffscreenScene::of_env(&mut sim, EnvId(0)).unwrap();
    let front = still_life.camera("front").unwrap();
    let free = robot.free_camera();
    let aside = look_at_pose(free.eye, free.target, [0.0, 0.0, 1.0]).unwrap();
    // A closer view, at half the distance: MuJoCo's viewers start far away.
    let near = 0.5 * free.fovy;
    let all = [("still life", &still_life, front.world_from_camera, front.fovy), ("robot", &robot, aside, near)];
    let mut differs = Vec::new();
    for (name, still, pose, radians) in all {
        let view = view(SIZE, radians, &pose, still.free_camera().clip);
        let draw = |renderer| {
            let channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::default() };
            let mut rasterizer = ParallelRenderer::new(RasterCfg { lod: false, ..RasterCfg::default() }, 2);
            rasterizer.set_renderer(renderer);
            let mut frame = Frame::new(SIZE[0], SIZE[1], channels);
            rasterizer.render(&mut [(still.render_request(&view), frame.as_mut())]).unwrap();
            frame
        };
        let raster = draw(Renderer::Raster);
        let paths = Renderer::RayTraced { samples: 4, max_bounces: 2, denoise: true, seed: 0 };
        for renderer in [Renderer::Hybrid, Renderer::FastRayTraced, paths] {
            differs.push((renderer, assert_alike(name, renderer, &raster, &draw(renderer))));
        }
    }
    assert_other_renderers(&differs);
}
