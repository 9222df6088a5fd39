//! Boxes around things and occlusions, against brute force over images of each thing alone and against closed forms.

use super::super::{
    Box2d, Camera, CameraCfg, CameraError, Channels, Extrinsics, Intrinsics, Lens, Occlusion, PixelBox, Placement,
    RasterCfg, Renderer, SegmentLevel, Segmentation, SegmentationCfg, Shutter, Thing,
};
use super::harness::{Still, at, point, things};
use super::scenes::{Random, every_shape, random};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use nalgebra::{Point3, Vector3};
use ndarray::Array2;
use scene::pose::from_xyz_rpy;
use scene::shape::{Box, Capsule, Ellipsoid, Plane, Sphere};
use scene::{Instance, Material, PoseF32, RenderScene, SceneState, Shape, VisibleState};
use std::collections::BTreeMap;
use std::sync::Arc;

const SIZE: [usize; 2] = [96, 72];
const LEVELS: [SegmentLevel; 3] = [SegmentLevel::Instance, SegmentLevel::Link, SegmentLevel::Semantic];
const DT: f64 = 0.01;

/// A camera of masks and positions in a scene, after so many steps; poses by step.
fn seen_by(cfg: &CameraCfg, scene: &RenderScene, poses: &dyn Fn(u64) -> Vec<PoseF32>, steps: u64) -> Camera {
    let mut camera = cfg.build(&context(scene)).unwrap();
    let state = |step: u64| {
        let instance_poses = Array2::from_shape_vec((1, scene.instances().len()), poses(step)).unwrap();
        let lights = Array2::from_shape_vec((1, scene.lights.len()), scene.lights.clone()).unwrap();
        let visible = Some(VisibleState { instance_poses, lights });
        SceneState { step: vec![step], time: vec![step as f64 * DT], visible, ..SceneState::new(1) }
    };
    camera.reset(&[0], &state(0)).unwrap();
    (1..=steps).for_each(|step| camera.update(&state(step)).unwrap());
    camera
}

fn context(scene: &RenderScene) -> SensorContext {
    SensorContext { num_envs: 1, dt: DT, scene: Some(Arc::new(scene.clone())), threads: 1, ..SensorContext::default() }
}

/// A camera at `eye` that looks at `target`, meshes as they are.
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

/// The same camera behind a lens under which pixels are as many radians from the axis as they are focal lengths: by rays.
fn behind_a_lens(cfg: CameraCfg) -> CameraCfg {
    CameraCfg { lens: Lens::from_name("equidistant").unwrap(), renderer: Renderer::FastRayTraced, ..cfg }
}

fn seen(cfg: &CameraCfg, (scene, poses): &(RenderScene, Vec<PoseF32>)) -> Camera {
    seen_by(cfg, scene, &|_| poses.clone(), 0)
}

/// Things of a scene with these mask ids, and their poses.
fn only((scene, poses): &(RenderScene, Vec<PoseF32>), is: impl Fn(i32) -> bool) -> (RenderScene, Vec<PoseF32>) {
    let all = scene.instances().iter().cloned().zip(poses.iter().copied());
    let (instances, poses) = all.filter(|(instance, _)| is(instance.mask_id)).unzip();
    (RenderScene::new(instances).unwrap(), poses)
}

/// Everything is an object of its own; those of even mask ids are of one class.
fn table(scene: &RenderScene) -> Segmentation {
    let ids: std::collections::BTreeSet<i32> = scene.instances().iter().map(|instance| instance.mask_id).collect();
    let class = |id| if id % 2 == 0 { "even" } else { "odd" }.into();
    let thing = |id: i32| Thing { id, object: format!("thing {id}"), link: None, class: class(id) };
    Segmentation::new(ids.into_iter().map(thing), &SegmentationCfg::default()).unwrap()
}

/// The smallest rectangle around pixels of a mask, and their number.
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

/// [`around`] pixels of the mask of a camera.
fn around_in(camera: &Camera, is: impl Fn(i32) -> bool) -> Option<(PixelBox, usize)> {
    let mask = camera.mask().unwrap();
    around(mask.as_slice().unwrap(), mask.dim().2, is)
}

/// All three levels: boxes and occlusions are those of the mask, and of images that hold nothing else. Those of a pinhole are
/// drawn by another rasterizer, and loose boxes hold an image that is eight times as fine; of a lens they are the same camera's.
#[test]
fn brute_force() {
    let (mut tights, mut looses, mut hidden, mut clipped) = ([0; 2], [0; 2], [0; 2], 0);
    for (seed, lens) in (1..=6).map(|seed| (seed, false)).chain((1..=3).map(|seed| (seed, true))) {
        let mut cfg = cfg([2.4, 0.5 * seed as f64 - 1.5, 0.7], [0.0; 3]);
        if lens {
            cfg = behind_a_lens(cfg);
        }
        let scene = random(&mut Random(seed), 1.0);
        let camera = seen(&cfg, &scene);
        let (segmentation, kind) = (table(&scene.0), usize::from(lens));
        // Of the images of things alone, also eight times as fine. Those of an instance are those of a link.
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
                    let image = Still { channels, cfg: cfg.raster, ..Still::new(only(&scene, is), view) }.draw();
                    around(image.mask(), k * SIZE[0], is)
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
                let both = occlusion.map(|o| (o.visible_pixels, o.alone_pixels));
                assert_eq!(both, by_itself.map(|(_, alone)| (visible, alone)), "{segment:?}");
                tights[kind] += usize::from(expected.is_some());
                hidden[kind] += usize::from(occlusion.is_some_and(|o| o.ratio() > 0.1));
                let loose = found.and_then(|found| found.loose);
                if lens {
                    assert_eq!(loose, by_itself.map(|(edges, _)| edges), "{segment:?}");
                    looses[kind] += usize::from(loose.is_some());
                    continue;
                }
                // Pixels are hit at their centres, and vertices snapped to 1/256 pixel.
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
    // That loose boxes are no larger than they must be is shown by the closed forms of outlines.
    assert!(tights[0] > 150 && looses[0] > 150 && hidden[0] > 20 && clipped > 6, "{tights:?} {looses:?} {hidden:?}");
    assert!(looses[1] > 60 && hidden[1] > 10, "{looses:?} {hidden:?}");
}

fn block(half: [f32; 3], [x, y, z]: [f32; 3]) -> (Shape, Material, PoseF32) {
    (Box { half }.into(), Material::default(), at(x, y, z))
}

fn ball(radius: f32, pose: PoseF32) -> (Shape, Material, PoseF32) {
    (Sphere { radius }.into(), Material::default(), pose)
}

/// Two cubes of one class, the second wholly beside the image and higher: the class ends where the first cube does.
#[test]
fn class_beside_image() {
    let (scene, poses) = things([[2.0, -0.2, -0.4], [2.0, 9.0, 0.5]].map(|place| block([0.1; 3], place)));
    let even = scene.instances().iter().map(|cube| Instance { mask_id: 2 * cube.mask_id, ..cube.clone() }).collect();
    let scene = (RenderScene::new(even).unwrap(), poses);
    let (camera, all) = (seen(&ahead(), &scene), table(&scene.0));
    let of = |level| all.boxes_2d(level, &camera, 0).unwrap().iter().map(|b| b.loose.unwrap()).collect::<Vec<_>>();
    let (class, cubes) = (of(SegmentLevel::Semantic), of(SegmentLevel::Instance));
    assert_eq!(class, cubes);
    // Corners of the front are 1.9 m away, of the back 2.1 m; y points left, z up.
    let expected = [48.0 + 80.0 * 0.1 / 2.1, 36.0 + 84.0 * 0.3 / 2.1, 48.0 + 80.0 * 0.3 / 1.9, 36.0 + 84.0 * 0.5 / 1.9];
    let edges = [class[0].min, class[0].max].concat();
    assert!(edges.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{edges:?}, {expected:?}");
}

#[test]
fn without_box() {
    let glass = Material::from_rgba([1.0, 1.0, 1.0, 0.3]);
    let places = [[2.0, 0.0], [-2.0, 0.0], [2.0, 9.0], [1.0, 0.0], [2.0, 0.3]];
    let (scene, poses) = things(places.map(|[x, y]| ball(0.2, at(x, y, 0.0))));
    let mut instances = scene.instances().to_vec();
    (instances[3].material, instances[4].visible) = (glass, false);
    let scene = (RenderScene::new(instances).unwrap(), poses);
    let (camera, segmentation) = (seen(&ahead(), &scene), table(&scene.0));
    let found = segmentation.boxes_2d(SegmentLevel::Link, &camera, 0).unwrap();
    assert_eq!(found.iter().map(|found| found.id).collect::<Vec<_>>(), [1]);
    let solid = segmentation.boxes_3d(SegmentLevel::Link, &camera, 0).unwrap();
    assert_eq!(solid.iter().map(|found| found.id).collect::<Vec<_>>(), [1, 2, 3], "those are in the environment");
    let blind = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..super::stage::cfg() };
    let blind = super::stage::built(&blind, &super::stage::context(1));
    let error = segmentation.boxes_2d(SegmentLevel::Link, &blind, 0).unwrap_err().to_string();
    assert_eq!(error, "the camera does not measure mask; it measures color");
    assert!(segmentation.boxes_3d(SegmentLevel::Link, &blind, 3).is_err());
    // Before a capture, and without a pose.
    let scene = things([ball(0.2, at(0.0, f32::NAN, 0.0))]);
    let boxes = |camera: &Camera| table(&scene.0).boxes_3d(SegmentLevel::Link, camera, 0).unwrap_err();
    let early = super::stage::cfg().build(&context(&scene.0)).unwrap();
    assert_eq!(boxes(&early), CameraError::NothingCaptured { env: 0 }.into());
    assert_eq!(boxes(&seen(&ahead(), &scene)), CameraError::ThingPose { env: 0, id: 1 }.into());
}

/// Boxes of every shape, and of a link of two that stand askew in it. Fine triangles touch all six sides from inside, to the gap
/// of their polygons, R (1 - cos(pi / 256)) < 4e-5 m; corners are those of the box, mapped; and pixels of the link are in it.
#[test]
fn solid_boxes() {
    let part = |shape: Shape, k: usize| Instance {
        frame_from_instance: from_xyz_rpy([0.1 + 0.1 * k as f64, 0.2, -0.1], [0.3 + k as f64, 0.7, -0.2]),
        ..Instance::new(shape, Material::default(), 7)
    };
    let mut links: Vec<Vec<Instance>> = every_shape().into_iter().zip(0..).map(|(s, k)| vec![part(s, k)]).collect();
    let capsule = Capsule { radius: 0.05, half_length: 0.25 };
    links.push(vec![part(Ellipsoid { radii: [0.3, 0.1, 0.2] }.into(), 0), part(capsule.into(), 5)]);
    let world_from_link = from_xyz_rpy([0.2, 0.3, 0.2], [1.0, -0.4, 2.0]);
    for parts in links {
        let corners = |part: &Instance| {
            let positions = part.shape.tessellate(256).positions.into_iter();
            positions.map(|p| part.frame_from_instance * Point3::from(p).cast::<f64>()).collect::<Vec<_>>()
        };
        let points: Vec<Point3<f64>> = parts.iter().flat_map(corners).collect();
        let what = parts[0].shape.name();
        let mut poses: Vec<PoseF32> =
            parts.iter().map(|part| PoseF32::from(&(world_from_link * part.frame_from_instance))).collect();
        poses.push(at(0.0, 0.0, -1.0));
        let ground = Instance::new(Plane::INFINITE, Material::default(), 8);
        let scene = (RenderScene::new([parts, vec![ground]].concat()).unwrap(), poses);
        let camera = seen(&cfg([2.0, 0.1, 0.4], [0.3, 0.2, 0.2]), &scene);
        let boxes = table(&scene.0).boxes_3d(SegmentLevel::Link, &camera, 0).unwrap();
        let [found] = boxes[..] else { panic!("a plane without end has no box: {boxes:?}") };
        for axis in 0..3 {
            let end = |pick: fn(f64, f64) -> f64| points.iter().map(|p| p[axis]).reduce(pick).unwrap();
            let off = [found.min[axis] - end(f64::min), end(f64::max) - found.max[axis]];
            assert!(off.iter().all(|x| (-4e-5..2e-6).contains(x)), "{what}: {off:?}");
        }
        let corners = found.corners().map(Point3::from);
        for (k, corner) in corners.iter().enumerate() {
            let local = [0, 1, 2].map(|axis| if k >> axis & 1 == 1 { found.max[axis] } else { found.min[axis] });
            // Poses are in single precision: some 1e-7 m, and as many rad.
            assert!((corner - world_from_link * Point3::from(local)).norm() < 2e-6, "{what}: {corner:?}");
        }
        let across = (corners[7] - corners[0]).norm();
        assert!((across - Vector3::from(found.size()).norm()).abs() < 4e-6, "{what}: {across}");
        let middle = nalgebra::center(&corners[0], &corners[7]);
        assert!((Point3::from(found.center()) - middle).norm() < 1e-12, "{what}");
        for ((row, v, u), _) in camera.mask().unwrap().indexed_iter().filter(|(_, id)| **id == 7) {
            let p = world_from_link.inverse() * point(&camera, [row, v, u]);
            assert!((0..3).all(|k| p[k] > found.min[k] - 1e-5 && p[k] < found.max[k] + 1e-5), "{what}: {p}");
        }
    }
}

/// A bar, a ball, a screen that stands still, and a bar that leaves the image while it is read, by step; the image's right is -y.
///
/// Root cause: the mask was drawn row by row, each at its own instant, and the images of each thing alone as of the stamp. So more
/// of a thing was seen than there was of it, and things that had left the image by then were not in the list.
#[test]
fn rolling_shutter() {
    const STEPS: u64 = 10;
    let bar = || block([0.05, 0.1, 5.0], [0.0; 3]);
    let (scene, _) = things([bar(), ball(0.3, PoseF32::IDENTITY), block([0.01, 0.4, 0.3], [0.0; 3]), bar()]);
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
    let (all, segmentation) = (image(&|_| true, rolling), table(&scene));
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &all, 0).unwrap();
    let occlusions = segmentation.occlusions(SegmentLevel::Instance, &all, 0).unwrap();
    assert_eq!((boxes.len(), occlusions.len()), (4, 4), "{boxes:?} {occlusions:?}");
    for (Box2d { id, tight, loose, visible_pixels }, occlusion) in boxes.into_iter().zip(&occlusions) {
        let visible = pixels(&all, id);
        let alone = pixels(&image(&|other| other == id, rolling), id).unwrap();
        assert_eq!((tight, visible_pixels), (visible.map(|v| v.0), visible.map_or(0, |v| v.1)), "{id}");
        assert_eq!(loose, Some(alone.0), "{id}");
        assert_eq!(*occlusion, Occlusion { id, visible_pixels, alone_pixels: alone.1 });
        assert!((0.0..=1.0).contains(&occlusion.ratio()), "{occlusion:?}");
    }
    let ratios: Vec<f64> = occlusions.iter().map(Occlusion::ratio).collect();
    assert!([0, 1, 3].iter().all(|k| ratios[*k] > 0.1) && ratios[2] == 0.0, "{ratios:?}");
    // The controls: at the stamp things are elsewhere, and one of them has left the image.
    let instant = image(&|_| true, Shutter::default());
    let then = segmentation.boxes_2d(SegmentLevel::Instance, &instant, 0).unwrap();
    assert_eq!(then.iter().map(|found| found.id).collect::<Vec<_>>(), [1, 2, 3]);
    assert_ne!(pixels(&instant, 1), pixels(&all, 1));
    assert!(pixels(&instant, 4).is_none() && pixels(&all, 4).is_some());
}
