//! Bounding boxes and occlusions, against brute force over images of each object alone, and against closed forms.

use super::super::{
    Box2d, Camera, CameraCfg, CameraError, Extrinsics, Occlusion, PixelBox, Placement, SegmentLevel, Segmentation,
    SegmentationCfg, SegmentedEntity,
};
use super::test_scene::point;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use kinetoscope_render::frame::Channels;
use kinetoscope_render::lens::Lens;
use kinetoscope_render::{Intrinsics, RasterCfg, Renderer, Shutter};
use kinetoscope_scene::pose::from_xyz_rpy;
use kinetoscope_scene::shape::Shape;
use kinetoscope_scene::shape::{Box, Capsule, Ellipsoid, Plane, Sphere};
use kinetoscope_scene::{Instance, Material, Pose, PoseF32, RenderScene, SceneState, VisibleState};
use kinetoscope_testkit::scenes::{TestRng, every_shape, instances, random_scene, translation};
use nalgebra::{Point3, Rotation3, UnitQuaternion, Vector3};
use ndarray::Array2;
use std::collections::BTreeMap;
use std::sync::Arc;

const SIZE: [usize; 2] = [96, 72];
const LEVELS: [SegmentLevel; 3] = [SegmentLevel::Instance, SegmentLevel::Link, SegmentLevel::Semantic];
const DT: f64 = 0.01;

/// A camera with masks and positions in a scene after `step` steps; `poses` gives poses by step.
fn seen_by(cfg: &CameraCfg, scene: &RenderScene, poses: &dyn Fn(u64) -> Vec<PoseF32>, steps: u64) -> Camera {
    let mut camera = cfg.build(&context(scene)).unwrap();
    let state = |step: u64| {
        let instance_poses = Array2::from_shape_vec((1, scene.instances().len()), poses(step)).unwrap();
        let lights = Array2::from_shape_vec((1, scene.lights.len()), scene.lights.clone()).unwrap();
        let visible = Some(VisibleState { instance_poses, lights, scenes: Vec::new() });
        SceneState { step: vec![step], time: vec![step as f64 * DT], visible, ..SceneState::new(1) }
    };
    camera.reset(&[0], &state(0)).unwrap();
    (1..=steps).for_each(|step| camera.update(&state(step)).unwrap());
    camera
}

fn context(scene: &RenderScene) -> SensorContext {
    SensorContext { num_envs: 1, dt: DT, scene: Some(Arc::new(scene.clone())), threads: 1, ..SensorContext::default() }
}

/// A camera at `eye` that looks at `target`, without level of detail.
fn cfg(eye: [f64; 3], target: [f64; 3]) -> CameraCfg {
    let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
    CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: Intrinsics::Pixels { fx: 80.0, fy: 84.0, cx: 48.0, cy: 36.0 },
        near: 0.05,
        far: 50.0,
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { mask: true, position: true, ..Channels::default() },
        raster: RasterCfg { lod: false, ..RasterCfg::default() },
        ..CameraCfg::default()
    }
}

/// A camera at the origin that looks along x.
fn ahead() -> CameraCfg {
    cfg([0.0; 3], [1.0, 0.0, 0.0])
}

/// The same camera with an equidistant lens, where an angle of 1 rad is a focal length; needs a ray tracer.
fn with_equidistant_lens(cfg: CameraCfg) -> CameraCfg {
    CameraCfg { lens: Lens::from_name("equidistant").unwrap(), renderer: Renderer::FastRayTraced, ..cfg }
}

fn seen(cfg: &CameraCfg, (scene, poses): &(RenderScene, Vec<PoseF32>)) -> Camera {
    seen_by(cfg, scene, &|_| poses.clone(), 0)
}

/// The instances of a scene with these mask ids, and their poses.
fn only((scene, poses): &(RenderScene, Vec<PoseF32>), is: impl Fn(i32) -> bool) -> (RenderScene, Vec<PoseF32>) {
    let all = scene.instances().iter().cloned().zip(poses.iter().copied());
    let (instances, poses) = all.filter(|(instance, _)| is(instance.mask_id)).unzip();
    (RenderScene::new(instances).unwrap(), poses)
}

/// A segmentation in which every instance is an object; objects with even mask ids share a class.
fn segmentation_of(scene: &RenderScene) -> Segmentation {
    let ids: std::collections::BTreeSet<i32> = scene.instances().iter().map(|instance| instance.mask_id).collect();
    let class = |id| if id % 2 == 0 { "even" } else { "odd" }.into();
    let thing = |id: i32| SegmentedEntity { id, object: format!("thing {id}"), link: None, class: class(id) };
    Segmentation::new(ids.into_iter().map(thing), &SegmentationCfg::default()).unwrap()
}

/// The bounding rectangle of pixels of a mask, and their number.
fn around(mask: &[i32], width: usize, is: impl Fn(i32) -> bool) -> Option<(PixelBox, usize)> {
    let (mut min, mut max, mut count) = ([usize::MAX; 2], [0; 2], 0);
    for (v, row) in mask.chunks(width).enumerate() {
        for (u, _) in row.iter().enumerate().filter(|(_, id)| is(**id)) {
            (min, max) = ([min[0].min(u), min[1].min(v)], [max[0].max(u + 1), max[1].max(v + 1)]);
            count += 1;
        }
    }
    (count > 0).then(|| (PixelBox { min: min.map(|x| x as f64), max: max.map(|x| x as f64) }, count))
}

/// Applies [`around`] to the mask of a camera.
fn around_in(camera: &Camera, is: impl Fn(i32) -> bool) -> Option<(PixelBox, usize)> {
    let mask = camera.mask().unwrap();
    around(mask.as_slice().unwrap(), mask.dim().2, is)
}

/// On all three levels, boxes and occlusions equal those of the mask and of images with single segments. For a pinhole,
/// these images are rendered by another rasterizer, and loose boxes contain an image eight times as fine. For a lens,
/// they are rendered by the same camera.
#[test]
fn brute_force() {
    let (mut tights, mut looses, mut hidden, mut clipped) = ([0; 2], [0; 2], [0; 2], 0);
    for (seed, lens) in (1..=6).map(|seed| (seed, false)).chain((1..=3).map(|seed| (seed, true))) {
        let mut cfg = cfg([2.4, 0.5 * seed as f64 - 1.5, 0.7], [0.0; 3]);
        if lens {
            cfg = with_equidistant_lens(cfg);
        }
        let scene = random_scene(&mut TestRng(seed), 1.0);
        let camera = seen(&cfg, &scene);
        let (segmentation, kind) = (segmentation_of(&scene.0), usize::from(lens));
        // From images of single segments, also eight times as fine. Segments of instances equal those of links here.
        let mut images = BTreeMap::new();
        for level in LEVELS {
            let boxes = segmentation.boxes_2d(level, &camera, 0).unwrap();
            let occlusions = segmentation.occlusions(level, &camera, 0).unwrap();
            for segment in segmentation.segments(level) {
                let is = |id: i32| segment.mask_ids.contains(&id);
                let alone = |k: usize| {
                    let mut view = camera.view(0).unwrap();
                    (view.width, view.height) = (k * view.width, k * view.height);
                    for x in [&mut view.fx, &mut view.fy, &mut view.cx, &mut view.cy] {
                        *x *= k as f32;
                    }
                    let channels = Channels { mask: true, ..Channels::default() };
                    let (scene, poses) = only(&scene, is);
                    let by = (Renderer::Raster, Shutter::default());
                    let frame = super::test_scene::frame_of(cfg.raster, by, channels, (&scene, &poses, &view), None);
                    around(frame.mask.as_ref().unwrap(), k * SIZE[0], is)
                };
                let [by_itself, fine] = *images.entry(segment.mask_ids.clone()).or_insert_with(|| match lens {
                    true => [around_in(&seen(&cfg, &only(&scene, is)), is), None],
                    false => [1, 8].map(alone),
                });
                let expected = around_in(&camera, is);
                let visible = expected.map_or(0, |(_, pixels)| pixels);
                let found = boxes.iter().find(|found| found.id == segment.id);
                assert_eq!(found.and_then(|b| b.tight), expected.map(|(edges, _)| edges), "{segment:?}");
                assert_eq!(found.map_or(0, |found| found.visible_pixels), visible);
                let occlusion = occlusions.iter().find(|found| found.id == segment.id);
                let both = occlusion.map(|o| (o.visible_pixels, o.unoccluded_pixels));
                assert_eq!(both, by_itself.map(|(_, alone)| (visible, alone)), "{segment:?}");
                tights[kind] += usize::from(expected.is_some());
                hidden[kind] += usize::from(occlusion.is_some_and(|o| o.ratio() > 0.1));
                let loose = found.and_then(|found| found.loose);
                if lens {
                    assert_eq!(loose, by_itself.map(|(edges, _)| edges), "{segment:?}");
                    looses[kind] += usize::from(loose.is_some());
                    continue;
                }
                // Pixels are hit at their centers, and vertices snap to 1/256 pixel.
                let Some((fine, _)) = fine else { continue };
                let (loose, slack) = (loose.unwrap(), (0.5 + 1.0 / 128.0) / 8.0);
                looses[kind] += 1;
                for (axis, side) in SIZE.into_iter().enumerate() {
                    assert!(loose.min[axis] <= fine.min[axis] / 8.0 + slack, "{segment:?}: {loose:?}, {fine:?}");
                    assert!(loose.max[axis] >= fine.max[axis] / 8.0 - slack, "{segment:?}: {loose:?}, {fine:?}");
                    assert!(0.0 <= loose.min[axis] && loose.max[axis] <= side as f64);
                    clipped += usize::from(loose.min[axis] == 0.0);
                }
            }
        }
    }
    // The closed forms of outlines show that loose boxes are as small as possible.
    assert!(tights[0] > 150 && looses[0] > 150 && hidden[0] > 20 && clipped > 6, "{tights:?} {looses:?} {hidden:?}");
    assert!(looses[1] > 60 && hidden[1] > 10, "{looses:?} {hidden:?}");
}

fn block(half: [f32; 3], [x, y, z]: [f32; 3]) -> (Shape, Material, PoseF32) {
    (Box { half }.into(), Material::default(), translation(x, y, z))
}

fn ball(radius: f32, pose: PoseF32) -> (Shape, Material, PoseF32) {
    (Sphere { radius }.into(), Material::default(), pose)
}

/// A wall of 2 by 2 m, 3.9 m in front of the camera, and a screen in front of its half y < 0. The edge is at u = cx,
/// between two pixels, so exactly half of the wall's pixels are hidden.
#[test]
fn half_hidden_wall() {
    let scene = instances([block([0.1, 1.0, 1.0], [4.0, 0.0, 0.0]), block([0.1, 2.0, 2.0], [2.0, -2.0, 0.0])]);
    let (camera, segmentation) = (seen(&ahead(), &scene), segmentation_of(&scene.0));
    let [wall, screen] = segmentation.occlusions(SegmentLevel::Instance, &camera, 0).unwrap()[..] else { panic!() };
    assert_eq!((wall.ratio(), wall.visible_pixels * 2), (0.5, wall.unoccluded_pixels));
    assert_eq!((screen.id, screen.ratio()), (2, 0.0), "parts that the image cuts off are not hidden");
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &camera, 0).unwrap();
    let Box2d { tight: Some(tight), loose: Some(loose), .. } = boxes[0] else { panic!("{:?}", boxes[0]) };
    // y points left; the front of the wall is 3.9 m away.
    let (u, v) = (80.0 / 3.9, 84.0 / 3.9);
    assert_box(loose, [48.0 - u, 36.0 - v, 48.0 + u, 36.0 + v], 1e-4);
    assert_eq!((tight.min, tight.max), ([(48.0 - u).round(), (36.0 - v).round()], [48.0, (36.0 + v).round()]));
    assert_eq!(boxes[1].loose.map(|b| b.max), Some([96.0, 72.0]), "clipped to the image");
}

#[track_caller]
fn assert_box(found: PixelBox, expected: [f64; 4], tolerance: f64) {
    let edges = [found.min, found.max].concat();
    assert!(edges.iter().zip(expected).all(|(a, b)| (a - b).abs() < tolerance), "{found:?}, {expected:?}");
}

/// A ball on the axis of a lens, 2 m away, and a ball 20 degrees to the left. A screen is in front of the right half of
/// each ball. The lens shows a ball of radius r at distance d as wide as the cone around it, 2 f asin(r / d).
#[test]
fn lens_cones() {
    // y points left. One screen reaches from the axis to the right; the other is rotated with the second ball.
    let aside = -20f64.to_radians();
    let turned = |angle: f64, place: [f64; 3]| {
        let rotation = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -angle);
        PoseF32::from(&Pose::from_parts((rotation * Vector3::from(place)).into(), rotation))
    };
    let ball = |angle| ball(0.3, turned(angle, [2.0, 0.0, 0.0]));
    let screen =
        |angle| (Box { half: [0.01, 0.08, 1.0] }.into(), Material::default(), turned(angle, [1.0, -0.08, 0.0]));
    let scene = instances([ball(0.0), ball(aside), screen(0.0), screen(aside)]);
    let (camera, segmentation) = (seen(&with_equidistant_lens(ahead()), &scene), segmentation_of(&scene.0));
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &camera, 0).unwrap();
    let cone = (0.3f64 / 2.0).asin();
    for (found, middle) in boxes.iter().zip([0.0, aside]) {
        let Box2d { tight: Some(tight), loose: Some(loose), visible_pixels, .. } = *found else { panic!("{found:?}") };
        // Edges are those of whole pixels whose center is inside. In the rows next to the axis, whose center is half a
        // pixel from it, the cone is narrower by (1/2)²/(2 f sin(cone)) pixels, 0.01.
        let edges = [48.0 + 80.0 * (middle - cone), 48.0 + 80.0 * (middle + cone)];
        assert_box(loose, [edges[0], loose.min[1], edges[1], loose.max[1]], 0.52);
        assert!((tight.max[0] - (48.0 + 80.0 * middle)).abs() < 0.52, "{tight:?}");
        assert_eq!((tight.min, tight.max[1]), (loose.min, loose.max[1]));
        if middle == 0.0 {
            assert!((loose.min[1] - (36.0 - 84.0 * cone)).abs() < 0.52, "{loose:?}");
            let occlusion = segmentation.occlusions(SegmentLevel::Instance, &camera, 0).unwrap()[0];
            assert_eq!((occlusion.visible_pixels, occlusion.unoccluded_pixels), (visible_pixels, 2 * visible_pixels));
        }
    }
}

/// Two cubes of one class; the second cube is higher and outside the image. The box of the class ends where the first
/// cube does.
#[test]
fn class_beside_image() {
    let (scene, poses) = instances([[2.0, -0.2, -0.4], [2.0, 9.0, 0.5]].map(|place| block([0.1; 3], place)));
    let even = scene.instances().iter().map(|cube| Instance { mask_id: 2 * cube.mask_id, ..cube.clone() }).collect();
    let scene = (RenderScene::new(even).unwrap(), poses);
    let (camera, all) = (seen(&ahead(), &scene), segmentation_of(&scene.0));
    let of = |level| all.boxes_2d(level, &camera, 0).unwrap().iter().map(|b| b.loose.unwrap()).collect::<Vec<_>>();
    let (class, cubes) = (of(SegmentLevel::Semantic), of(SegmentLevel::Instance));
    assert_eq!(class, cubes);
    // Corners of the front are 1.9 m away, of the back 2.1 m; y points left, z up.
    let expected = [48.0 + 80.0 * 0.1 / 2.1, 36.0 + 84.0 * 0.3 / 2.1, 48.0 + 80.0 * 0.3 / 1.9, 36.0 + 84.0 * 0.5 / 1.9];
    assert_box(class[0], expected, 1e-4);
}

#[test]
fn without_box() {
    let glass = Material::from_rgba([1.0, 1.0, 1.0, 0.0]);
    let places = [[2.0, 0.0], [-2.0, 0.0], [2.0, 9.0], [1.0, 0.0], [2.0, 0.3]];
    let (scene, poses) = instances(places.map(|[x, y]| ball(0.2, translation(x, y, 0.0))));
    let mut instances = scene.instances().to_vec();
    (instances[3].material, instances[4].visible) = (glass, false);
    let scene = (RenderScene::new(instances).unwrap(), poses);
    let (camera, segmentation) = (seen(&ahead(), &scene), segmentation_of(&scene.0));
    let found = segmentation.boxes_2d(SegmentLevel::Link, &camera, 0).unwrap();
    assert_eq!(found.iter().map(|found| found.id).collect::<Vec<_>>(), [1]);
    let solid = segmentation.boxes_3d(SegmentLevel::Link, &camera, 0).unwrap();
    assert_eq!(solid.iter().map(|found| found.id).collect::<Vec<_>>(), [1, 2, 3], "those are in the environment");
    let blind = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..super::test_scene::cfg() };
    let blind = super::test_scene::built(&blind, &super::test_scene::context(1));
    let error = segmentation.boxes_2d(SegmentLevel::Link, &blind, 0).unwrap_err().to_string();
    assert_eq!(error, "the camera does not measure mask; it measures color");
    assert!(segmentation.boxes_3d(SegmentLevel::Link, &blind, 3).is_err());
    // Errors before a capture, and for a pose that is not finite.
    let scene = kinetoscope_testkit::scenes::instances([ball(0.2, translation(0.0, f32::NAN, 0.0))]);
    let boxes = |camera: &Camera| segmentation_of(&scene.0).boxes_3d(SegmentLevel::Link, camera, 0).unwrap_err();
    let early = super::test_scene::cfg().build(&context(&scene.0)).unwrap();
    assert_eq!(boxes(&early), CameraError::NothingCaptured { env: 0 }.into());
    assert_eq!(boxes(&seen(&ahead(), &scene)), CameraError::EntityPose { env: 0, id: 1 }.into());
}

/// A link with a rotated ellipsoid and a rotated capsule. Their half lengths along the axes of the link are sqrt(sum of
/// (R a)²) and r + h |R z|.
#[test]
fn solid_boxes() {
    let link_from =
        [from_xyz_rpy([0.2, -0.1, 0.3], [0.4, 0.5, -0.6]), from_xyz_rpy([-0.3, 0.1, 0.05], [-0.9, 0.2, 1.3])];
    let (radii, radius, half_length) = ([0.3f32, 0.1, 0.2], 0.05f32, 0.25f32);
    let part = |shape: Shape, k: usize| Instance {
        frame_from_instance: link_from[k],
        ..Instance::new(shape, Material::default(), 7)
    };
    let ground = Instance::new(Plane::INFINITE, Material::default(), 8);
    let parts = [part(Ellipsoid { radii }.into(), 0), part(Capsule { radius, half_length }.into(), 1), ground];
    let scene = RenderScene::new(parts.into()).unwrap();
    let rotations = link_from.map(|pose| Rotation3::from(pose.rotation));
    let reach = |k: usize, axis: usize| -> f64 {
        let row = [0, 1, 2].map(|j| rotations[k][(axis, j)]);
        match k {
            0 => Vector3::from([0, 1, 2].map(|j| row[j] * f64::from(radii[j]))).norm(),
            _ => f64::from(radius) + f64::from(half_length) * row[2].abs(),
        }
    };
    for world_from_link in [Pose::identity(), from_xyz_rpy([0.5, 0.3, 0.2], [1.0, -0.4, 2.0])] {
        let place = |k: usize| PoseF32::from(&(world_from_link * link_from[k]));
        let poses = vec![place(0), place(1), translation(0.0, 0.0, -1.0)];
        let camera = seen(&cfg([2.0, 0.1, 0.4], [0.3, 0.2, 0.2]), &(scene.clone(), poses));
        let boxes = segmentation_of(&scene).boxes_3d(SegmentLevel::Link, &camera, 0).unwrap();
        let [found] = boxes[..] else { panic!("a plane without end has no box: {boxes:?}") };
        for axis in 0..3 {
            let side = |sign: f64| [0, 1].map(|k| link_from[k].translation.vector[axis] + sign * reach(k, axis));
            let ([a, b], [c, d]) = (side(-1.0), side(1.0));
            // Poses have single precision: some 1e-7 m, and as many rad.
            assert!(
                (found.min[axis] - a.min(b)).abs() < 2e-6 && (found.max[axis] - c.max(d)).abs() < 2e-6,
                "{found:?}"
            );
        }
        // The corners are those of the box, transformed.
        let corners = found.corners().map(Point3::from);
        for (k, corner) in corners.iter().enumerate() {
            let local = [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { found.max[axis] } else { found.min[axis] });
            assert!((corner - world_from_link * Point3::from(local)).norm() < 2e-6, "{corner:?}");
        }
        // Two corners, each rounded as above.
        let across = (corners[7] - corners[0]).norm();
        assert!((across - Vector3::from(found.size()).norm()).abs() < 4e-6, "{across}");
        let middle = nalgebra::center(&corners[0], &corners[7]);
        assert!((Point3::from(found.center()) - middle).norm() < 1e-12);
        // The box contains all visible points of the link.
        let mask = camera.mask().unwrap();
        let shown: Vec<_> = mask.indexed_iter().filter(|(_, id)| **id == 7).map(|(at, _)| at).collect();
        for &(row, v, u) in &shown {
            let p = world_from_link.inverse() * point(&camera, [row, v, u]);
            assert!((0..3).all(|k| p[k] > found.min[k] - 1e-5 && p[k] < found.max[k] + 1e-5), "{p}");
        }
        assert!(shown.len() > 50, "{}", shown.len());
    }
}

/// A fine tessellation of every shape touches all six sides of its box from inside. The gap of its polygons is
/// `R (1 - cos(pi / 256))` < 4e-5 m.
#[test]
fn tight_solids() {
    for (k, shape) in every_shape().into_iter().enumerate() {
        let frame_from_instance = from_xyz_rpy([0.1, 0.2, -0.1], [0.3 + k as f64, 0.7, -0.2]);
        let instance = Instance { frame_from_instance, ..Instance::new(shape.clone(), Material::default(), 1) };
        let scene = (RenderScene::new(vec![instance]).unwrap(), vec![PoseF32::from(&frame_from_instance)]);
        let camera = seen(&cfg([2.0, 0.0, 0.5], [0.0; 3]), &scene);
        let found = segmentation_of(&scene.0).boxes_3d(SegmentLevel::Semantic, &camera, 0).unwrap()[0];
        let positions = shape.tessellate(256).positions;
        let points: Vec<_> = positions.iter().map(|p| frame_from_instance * Point3::from(*p).cast::<f64>()).collect();
        for axis in 0..3 {
            let end = |pick: fn(f64, f64) -> f64| points.iter().map(|p| p[axis]).reduce(pick).unwrap();
            let off = [found.min[axis] - end(f64::min), end(f64::max) - found.max[axis]];
            assert!(off.iter().all(|x| (-4e-5..1e-6).contains(x)), "{}: {off:?}", shape.name());
        }
    }
}

/// A moving bar, a moving ball, a fixed screen, and a bar that leaves the image during readout, by step. The right of
/// the image is -y.
///
/// Root cause: the mask was rendered row by row, each at its own instant, but the images of single segments at the
/// stamp. More pixels were visible than the segment had alone, and segments that had left the image by then were
/// missing.
#[test]
fn rolling_shutter() {
    const STEPS: u64 = 10;
    let bar = || block([0.05, 0.1, 5.0], [0.0; 3]);
    let (scene, _) = instances([bar(), ball(0.3, PoseF32::IDENTITY), block([0.01, 0.4, 0.3], [0.0; 3]), bar()]);
    let place = |step: u64, id: i32| {
        let t = step as f32 * DT as f32;
        let places =
            [[3.0, 0.8 - 8.0 * t, 0.0], [2.0, 0.2, 0.9 - 12.0 * t], [1.2, -0.3, 0.0], [2.5, 2.6 - 42.0 * t, 0.0]];
        PoseF32::from_translation(places[id as usize - 1])
    };
    let image = |is: &dyn Fn(i32) -> bool, shutter| {
        let (scene, _) = only(&(scene.clone(), vec![PoseF32::IDENTITY; 4]), is);
        let cfg = CameraCfg {
            width: 64,
            height: 48,
            intrinsics: Intrinsics::Pixels { fx: 60.0, fy: 60.0, cx: 32.0, cy: 24.0 },
            channels: Channels { mask: true, ..Channels::default() },
            renderer: Renderer::RAY_TRACED,
            shutter,
            update_period: STEPS as f64 * DT,
            ..ahead()
        };
        let poses = |step| scene.instances().iter().map(|thing| place(step, thing.mask_id)).collect();
        seen_by(&cfg, &scene, &poses, STEPS)
    };
    let pixels = |camera: &Camera, id| around_in(camera, |found| found == id);
    let rolling = Shutter { row_time: 0.08 / 47.0, exposure_time: 0.0 };
    let (all, segmentation) = (image(&|_| true, rolling), segmentation_of(&scene));
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &all, 0).unwrap();
    let occlusions = segmentation.occlusions(SegmentLevel::Instance, &all, 0).unwrap();
    assert_eq!((boxes.len(), occlusions.len()), (4, 4), "{boxes:?} {occlusions:?}");
    for (Box2d { id, tight, loose, visible_pixels }, occlusion) in boxes.into_iter().zip(&occlusions) {
        let visible = pixels(&all, id);
        let alone = pixels(&image(&|other| other == id, rolling), id).unwrap();
        assert_eq!((tight, visible_pixels), (visible.map(|v| v.0), visible.map_or(0, |v| v.1)), "{id}");
        assert_eq!(loose, Some(alone.0), "{id}");
        assert_eq!(*occlusion, Occlusion { id, visible_pixels, unoccluded_pixels: alone.1 });
        assert!((0.0..=1.0).contains(&occlusion.ratio()), "{occlusion:?}");
    }
    let ratios: Vec<f64> = occlusions.iter().map(Occlusion::ratio).collect();
    assert!([0, 1, 3].iter().all(|k| ratios[*k] > 0.1) && ratios[2] == 0.0, "{ratios:?}");
    // Controls: at the stamp, segments are elsewhere, and one of them has left the image.
    let instant = image(&|_| true, Shutter::default());
    let then = segmentation.boxes_2d(SegmentLevel::Instance, &instant, 0).unwrap();
    assert_eq!(then.iter().map(|found| found.id).collect::<Vec<_>>(), [1, 2, 3]);
    assert_ne!(pixels(&instant, 1), pixels(&all, 1));
    assert!(pixels(&instant, 4).is_none() && pixels(&all, 4).is_some());
}
