//! Boxes around things, held against brute force over pictures and against closed forms.

use super::super::{
    Box2d, Camera, CameraCfg, CameraError, Channels, Extrinsics, Frame, Intrinsics, Lens, PixelBox, Placement,
    RasterCfg, Rasterizer, Renderer, SegmentLevel, Segmentation, SegmentationCfg, Thing,
};
use super::scenes::{Random, every_shape, random};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use nalgebra::{Point3, UnitQuaternion, Vector3};
use ndarray::{Array2, Axis};
use scene::shape::{Box, Capsule, Ellipsoid, Plane, Sphere};
use scene::{Instance, Light, Material, Pose, PoseF32, RenderScene, SceneState, VisibleState};
use std::sync::Arc;

const SIZE: [usize; 2] = [96, 72];

/// A camera of the mask and positions at `eye` that looks at `target` in a scene with these poses, meshes as they are.
fn seen(scene: RenderScene, poses: &[PoseF32], eye: [f64; 3], target: [f64; 3]) -> Camera {
    seen_by(CameraCfg::default(), scene, poses, eye, target)
}

/// The same through a lens under which pixels are as many radians from the axis as they are focal lengths: by rays.
fn seen_through_a_lens(scene: RenderScene, poses: &[PoseF32], eye: [f64; 3], target: [f64; 3]) -> Camera {
    let lens = Lens::from_name("equidistant").unwrap();
    seen_by(CameraCfg { lens, renderer: Renderer::FastRayTraced, ..Default::default() }, scene, poses, eye, target)
}

fn seen_by(rest: CameraCfg, scene: RenderScene, poses: &[PoseF32], eye: [f64; 3], target: [f64; 3]) -> Camera {
    let lights = scene.lights.len();
    let context =
        SensorContext { num_envs: 1, dt: 0.01, scene: Some(Arc::new(scene)), threads: 1, ..SensorContext::default() };
    let placement = Placement::LookAt { eye, target, up: [0.0, 0.0, 1.0] };
    let cfg = CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: Intrinsics::Pixels { fx: 80.0, fy: 84.0, cx: 48.0, cy: 36.0 },
        near: 0.05,
        far: 50.0,
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { mask: true, position: true, ..Channels::default() },
        raster: RasterCfg { lod: false, ..RasterCfg::default() },
        ..rest
    };
    let mut camera = cfg.build(&context).unwrap();
    let state = SceneState {
        visible: Some(VisibleState {
            instance_poses: Array2::from_shape_vec((1, poses.len()), poses.to_vec()).unwrap(),
            lights: Array2::from_elem((1, lights), Light::default()),
        }),
        ..SceneState::new(1)
    };
    camera.reset(&[0], &state).unwrap();
    camera
}

/// Everything is an object of its own; those of even mask ids are of one class.
fn table(scene: &RenderScene) -> Segmentation {
    let mut ids: Vec<i32> = scene.instances().iter().map(|instance| instance.mask_id).collect();
    ids.sort_unstable();
    ids.dedup();
    let thing = |id: i32| Thing {
        id,
        object: format!("thing {id}"),
        link: None,
        class: if id % 2 == 0 { "even" } else { "odd" }.into(),
    };
    Segmentation::new(ids.into_iter().map(thing), &SegmentationCfg::default()).unwrap()
}

/// The smallest rectangle around the pixels of a mask that `is` says yes to, and their number.
fn around(mask: &[i32], width: usize, is: impl Fn(i32) -> bool) -> Option<([f64; 4], usize)> {
    let hits: Vec<[usize; 2]> =
        mask.iter().enumerate().filter(|(_, id)| is(**id)).map(|(k, _)| [k % width, k / width]).collect();
    let of = |axis: usize| hits.iter().map(move |at| at[axis] as f64);
    let least = |axis| of(axis).fold(f64::INFINITY, f64::min);
    let most = |axis| of(axis).fold(f64::NEG_INFINITY, f64::max) + 1.0;
    (!hits.is_empty()).then(|| ([least(0), least(1), most(0), most(1)], hits.len()))
}

/// The mask of the things of some ids alone, `k` times as fine.
fn alone(camera: &Camera, scene: &RenderScene, poses: &[PoseF32], k: usize, is: impl Fn(i32) -> bool) -> Vec<i32> {
    let (instances, poses): (Vec<Instance>, Vec<PoseF32>) =
        scene.instances().iter().cloned().zip(poses).filter(|(instance, _)| is(instance.mask_id)).unzip();
    let mut view = camera.view(0).unwrap();
    (view.width, view.height) = (k * view.width, k * view.height);
    for x in [&mut view.fx, &mut view.fy, &mut view.cx, &mut view.cy] {
        *x *= k as f32;
    }
    let mut frame = Frame::new(view.width, view.height, Channels { mask: true, ..Channels::default() });
    let cfg = RasterCfg { lod: false, ..RasterCfg::default() };
    Rasterizer::new(cfg).render(&RenderScene::new(instances).unwrap(), &poses, &view, &mut frame).unwrap();
    frame.mask.unwrap()
}

#[test]
fn boxes_and_occlusions_are_those_of_brute_force() {
    let (mut tights, mut looses, mut hidden, mut clipped) = (0, 0, 0, 0);
    for seed in 1..=6 {
        let mut numbers = Random(seed);
        let (scene, poses) = random(&mut numbers, 1.0);
        let camera = seen(scene.clone(), &poses, [2.4, 0.5 * seed as f64 - 1.5, 0.7], [0.0; 3]);
        let segmentation = table(&scene);
        let mask: Vec<i32> = camera.mask().unwrap().iter().copied().collect();
        for level in [SegmentLevel::Instance, SegmentLevel::Link, SegmentLevel::Semantic] {
            let boxes = segmentation.boxes_2d(level, &camera, 0).unwrap();
            let occlusions = segmentation.occlusions(level, &camera, 0).unwrap();
            for segment in segmentation.segments(level) {
                let is = |id: i32| segment.mask_ids.contains(&id);
                let found = boxes.iter().find(|found| found.id == segment.id);
                let tight = found.and_then(|found| found.tight).map(|b| [b.min[0], b.min[1], b.max[0], b.max[1]]);
                let expected = around(&mask, SIZE[0], is);
                assert_eq!(tight, expected.map(|(edges, _)| edges), "{segment:?}");
                let visible = expected.map_or(0, |(_, pixels)| pixels);
                assert_eq!(found.map_or(0, |found| found.visible_pixels), visible);
                tights += usize::from(tight.is_some());
                // Occlusion: the same pixels, drawn alone by another rasterizer.
                let by_itself = alone(&camera, &scene, &poses, 1, is).iter().filter(|&&id| id != 0).count();
                let occlusion = occlusions.iter().find(|found| found.id == segment.id);
                assert_eq!(
                    occlusion.map(|o| (o.visible_pixels, o.alone_pixels)),
                    (by_itself > 0).then_some((visible, by_itself))
                );
                hidden += usize::from(occlusion.is_some_and(|o| o.ratio() > 0.1));
                // The loose box holds what a picture of it alone shows, eight times as fine; pixels are hit at their
                // centres, and vertices snapped to 1/256 pixel.
                let fine = around(&alone(&camera, &scene, &poses, 8, is), 8 * SIZE[0], is);
                let loose = found.and_then(|found| found.loose);
                let Some((edges, _)) = fine else { continue };
                let loose = loose.unwrap();
                looses += 1;
                let slack = (0.5 + 1.0 / 128.0) / 8.0;
                for axis in 0..2 {
                    assert!(loose.min[axis] <= edges[axis] / 8.0 + slack, "{segment:?}: {loose:?}, {edges:?}");
                    assert!(loose.max[axis] >= edges[axis + 2] / 8.0 - slack, "{segment:?}: {loose:?}, {edges:?}");
                    assert!(0.0 <= loose.min[axis] && loose.max[axis] <= SIZE[axis] as f64);
                    clipped += usize::from(loose.min[axis] == 0.0);
                }
            }
        }
    }
    // That loose boxes are no larger than they must be is said by the closed forms of outlines.
    assert!(tights > 150 && looses > 150 && hidden > 20 && clipped > 6, "{tights} {looses} {hidden} {clipped}");
}

/// A camera at the origin that looks along x, a wall of 2 by 2 m before it, 3.9 m away, and a screen in front of its half
/// y < 0: the edge is at u = cx, between two pixels, so that exactly half of the wall's pixels are hidden.
#[test]
fn half_of_a_wall_behind_a_screen_is_hidden() {
    let thing = |half: [f32; 3], id| Instance::new(Box { half }, Material::default(), id);
    let scene = RenderScene::new(vec![thing([0.1, 1.0, 1.0], 1), thing([0.1, 2.0, 2.0], 2)]).unwrap();
    let poses = [PoseF32::from_translation([4.0, 0.0, 0.0]), PoseF32::from_translation([2.0, -2.0, 0.0])];
    let camera = seen(scene.clone(), &poses, [0.0; 3], [1.0, 0.0, 0.0]);
    let segmentation = table(&scene);
    let [wall, screen] = segmentation.occlusions(SegmentLevel::Instance, &camera, 0).unwrap()[..] else { panic!() };
    assert_eq!((wall.ratio(), wall.visible_pixels * 2), (0.5, wall.alone_pixels));
    assert_eq!((screen.id, screen.ratio()), (2, 0.0), "what is cut off by the picture is not hidden");
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &camera, 0).unwrap();
    let Box2d { tight: Some(tight), loose: Some(loose), .. } = boxes[0] else { panic!("{:?}", boxes[0]) };
    // y points left; the wall's front is 3.9 m away.
    let (u, v) = (80.0 / 3.9, 84.0 / 3.9);
    for (found, expected) in
        [(loose.min[0], 48.0 - u), (loose.max[0], 48.0 + u), (loose.min[1], 36.0 - v), (loose.max[1], 36.0 + v)]
    {
        assert!((found - expected).abs() < 1e-4, "{loose:?}");
    }
    assert_eq!((tight.min, tight.max), ([(48.0 - u).round(), (36.0 - v).round()], [48.0, (36.0 + v).round()]));
    assert_eq!(boxes[1].loose.map(|b| b.max), Some([96.0, 72.0]), "clipped to the picture");
}

/// A ball on the axis of a lens, 2 m away, and one 20 degrees to the left, with screens before the right half of each: what the
/// lens shows of a ball of radius r at distance d is as wide as the cone around it, 2 f asin(r / d).
#[test]
fn boxes_behind_a_lens_are_those_of_cones() {
    let ball = |id| Instance::new(Sphere { radius: 0.3 }, Material::default(), id);
    let screen = |id| Instance::new(Box { half: [0.01, 0.08, 1.0] }, Material::default(), id);
    let scene = RenderScene::new(vec![ball(1), ball(2), screen(3), screen(4)]).unwrap();
    // y points left. A screen from the axis to the right, and the same turned with the second ball.
    let (aside, right) =
        (-20f64.to_radians(), |angle: f64| UnitQuaternion::from_axis_angle(&Vector3::z_axis(), -angle));
    let at = |angle: f64, place: [f64; 3]| {
        let turned = right(angle) * Vector3::from(place);
        PoseF32::from(&Pose::from_parts(turned.into(), right(angle)))
    };
    let poses = [
        at(0.0, [2.0, 0.0, 0.0]),
        at(aside, [2.0, 0.0, 0.0]),
        at(0.0, [1.0, -0.08, 0.0]),
        at(aside, [1.0, -0.08, 0.0]),
    ];
    let camera = seen_through_a_lens(scene.clone(), &poses, [0.0; 3], [1.0, 0.0, 0.0]);
    let segmentation = table(&scene);
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &camera, 0).unwrap();
    let cone = (0.3f64 / 2.0).asin();
    for (found, middle) in boxes.iter().zip([0.0, aside]) {
        let Box2d { tight: Some(tight), loose: Some(loose), visible_pixels, .. } = *found else { panic!("{found:?}") };
        // Edges are those of whole pixels: of those whose middle is inside, in the rows whose middle is half a pixel from the
        // axis, where the cone is narrower by (1/2)²/(2 f sin(cone)) pixels, 0.01.
        let edges = [48.0 + 80.0 * (middle - cone), 48.0 + 80.0 * (middle + cone)];
        assert!(
            (loose.min[0] - edges[0]).abs() < 0.52 && (loose.max[0] - edges[1]).abs() < 0.52,
            "{loose:?} {edges:?}"
        );
        assert!((tight.max[0] - (48.0 + 80.0 * middle)).abs() < 0.52, "{tight:?}");
        assert_eq!((tight.min, tight.max[1]), (loose.min, loose.max[1]));
        if middle == 0.0 {
            assert!((loose.min[1] - (36.0 - 84.0 * cone)).abs() < 0.52, "{loose:?}");
            let occlusion = segmentation.occlusions(SegmentLevel::Instance, &camera, 0).unwrap()[0];
            assert_eq!((occlusion.visible_pixels, occlusion.alone_pixels), (visible_pixels, 2 * visible_pixels));
        }
    }
}

/// Through a lens, too, all three levels: against the pictures of cameras in scenes that hold nothing else.
#[test]
fn boxes_behind_a_lens_are_those_of_brute_force() {
    let (mut looses, mut hidden) = (0, 0);
    for seed in 1..=3 {
        let (scene, poses) = random(&mut Random(seed), 1.0);
        let eye = [2.4, 0.5 * seed as f64 - 1.5, 0.7];
        let camera = seen_through_a_lens(scene.clone(), &poses, eye, [0.0; 3]);
        let segmentation = table(&scene);
        let mask: Vec<i32> = camera.mask().unwrap().iter().copied().collect();
        for level in [SegmentLevel::Instance, SegmentLevel::Link, SegmentLevel::Semantic] {
            let boxes = segmentation.boxes_2d(level, &camera, 0).unwrap();
            let occlusions = segmentation.occlusions(level, &camera, 0).unwrap();
            for segment in segmentation.segments(level) {
                let is = |id: i32| segment.mask_ids.contains(&id);
                let (instances, poses): (Vec<Instance>, Vec<PoseF32>) =
                    scene.instances().iter().cloned().zip(&poses).filter(|(instance, _)| is(instance.mask_id)).unzip();
                let other = seen_through_a_lens(RenderScene::new(instances).unwrap(), &poses, eye, [0.0; 3]);
                let by_itself: Vec<i32> = other.mask().unwrap().iter().copied().collect();
                let (tight, loose) = (around(&mask, SIZE[0], is), around(&by_itself, SIZE[0], is));
                let found = boxes.iter().find(|found| found.id == segment.id);
                let edges = |b: PixelBox| [b.min[0], b.min[1], b.max[0], b.max[1]];
                assert_eq!(found.and_then(|b| b.tight).map(edges), tight.map(|(edges, _)| edges), "{segment:?}");
                assert_eq!(found.and_then(|b| b.loose).map(edges), loose.map(|(edges, _)| edges), "{segment:?}");
                let occlusion = occlusions.iter().find(|o| o.id == segment.id);
                let expected = loose.map(|(_, alone)| (tight.map_or(0, |(_, pixels)| pixels), alone));
                assert_eq!(occlusion.map(|o| (o.visible_pixels, o.alone_pixels)), expected, "{segment:?}");
                looses += usize::from(loose.is_some());
                hidden += usize::from(occlusion.is_some_and(|o| o.ratio() > 0.1));
            }
        }
    }
    assert!(looses > 60 && hidden > 10, "{looses} {hidden}");
}

/// Two cubes of one class, the second wholly beside the picture and higher: the class ends where the first cube does.
#[test]
fn parts_beside_the_picture_do_not_widen_the_box_of_their_class() {
    let cube = |id| Instance::new(Box { half: [0.1; 3] }, Material::default(), id);
    let scene = RenderScene::new(vec![cube(2), cube(4)]).unwrap();
    let poses = [PoseF32::from_translation([2.0, -0.2, -0.4]), PoseF32::from_translation([2.0, 9.0, 0.5])];
    let camera = seen(scene.clone(), &poses, [0.0; 3], [1.0, 0.0, 0.0]);
    let all = table(&scene);
    let of = |level| all.boxes_2d(level, &camera, 0).unwrap().iter().map(|b| b.loose.unwrap()).collect::<Vec<_>>();
    let (class, things) = (of(SegmentLevel::Semantic), of(SegmentLevel::Instance));
    assert_eq!(class, things);
    // Corners of the front are 1.9 m away, of the back 2.1 m; y points left, z up.
    let expected = [48.0 + 80.0 * 0.1 / 2.1, 36.0 + 84.0 * 0.3 / 2.1, 48.0 + 80.0 * 0.3 / 1.9, 36.0 + 84.0 * 0.5 / 1.9];
    let found = [class[0].min, class[0].max].concat();
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-4), "{found:?}, {expected:?}");
}

#[test]
fn there_are_no_boxes_before_a_capture_and_none_of_things_that_are_nowhere() {
    let scene =
        Arc::new(RenderScene::new(vec![Instance::new(Sphere { radius: 0.2 }, Material::default(), 3)]).unwrap());
    let context = SensorContext {
        num_envs: 1,
        dt: 0.01,
        scene: Some(Arc::clone(&scene)),
        threads: 1,
        ..SensorContext::default()
    };
    let early = super::stage::cfg().build(&context).unwrap();
    let error = table(&scene).boxes_3d(SegmentLevel::Link, &early, 0).unwrap_err();
    assert_eq!(error, CameraError::NothingCaptured { env: 0 }.into());
    let nowhere = PoseF32::from_translation([0.0, f32::NAN, 0.0]);
    let camera = seen((*scene).clone(), &[nowhere], [0.0; 3], [1.0, 0.0, 0.0]);
    let error = table(&scene).boxes_3d(SegmentLevel::Link, &camera, 0).unwrap_err();
    assert_eq!(error, CameraError::ThingPose { env: 0, id: 3 }.into());
}

#[test]
fn what_is_beside_the_picture_has_no_box() {
    let ball = |id| Instance::new(Sphere { radius: 0.2 }, Material::default(), id);
    let glass = Instance::new(Sphere { radius: 0.2 }, Material::from_rgba([1.0, 1.0, 1.0, 0.3]), 4);
    let hidden = Instance { visible: false, ..ball(5) };
    let scene = RenderScene::new(vec![ball(1), ball(2), ball(3), glass, hidden]).unwrap();
    let at = |x, y| PoseF32::from_translation([x, y, 0.0]);
    let poses = [at(2.0, 0.0), at(-2.0, 0.0), at(2.0, 9.0), at(1.0, 0.0), at(2.0, 0.3)];
    let camera = seen(scene.clone(), &poses, [0.0; 3], [1.0, 0.0, 0.0]);
    let segmentation = table(&scene);
    let found = segmentation.boxes_2d(SegmentLevel::Link, &camera, 0).unwrap();
    assert_eq!(found.iter().map(|found| found.id).collect::<Vec<_>>(), [1]);
    let solid = segmentation.boxes_3d(SegmentLevel::Link, &camera, 0).unwrap();
    assert_eq!(solid.iter().map(|found| found.id).collect::<Vec<_>>(), [1, 2, 3], "those are in the environment");
    let blind = CameraCfg { channels: Channels { color: true, ..Channels::default() }, ..super::stage::cfg() };
    let blind = super::stage::built(&blind, &super::stage::context(1));
    let error = segmentation.boxes_2d(SegmentLevel::Link, &blind, 0).unwrap_err().to_string();
    assert_eq!(error, "the camera does not measure mask; it measures color");
    assert!(segmentation.boxes_3d(SegmentLevel::Link, &blind, 3).is_err());
}

/// A link of an ellipsoid and a capsule that stand askew in it: half lengths along the link's axes are those of the shapes,
/// sqrt(sum of (R a)²) and r + h |R z|.
#[test]
fn solid_boxes_are_the_closed_form_in_the_links_own_frame() {
    let link_from = [
        scene::pose::from_xyz_rpy([0.2, -0.1, 0.3], [0.4, 0.5, -0.6]),
        scene::pose::from_xyz_rpy([-0.3, 0.1, 0.05], [-0.9, 0.2, 1.3]),
    ];
    let (radii, radius, half_length) = ([0.3f32, 0.1, 0.2], 0.05f32, 0.25f32);
    let part = |shape: scene::Shape, k: usize| Instance {
        frame_from_instance: link_from[k],
        ..Instance::new(shape, Material::default(), 7)
    };
    let instances = vec![
        part(Ellipsoid { radii }.into(), 0),
        part(Capsule { radius, half_length }.into(), 1),
        Instance::new(Plane::INFINITE, Material::default(), 8),
    ];
    let scene = RenderScene::new(instances).unwrap();
    let reach = |k: usize, axis: usize| -> f64 {
        let r = link_from[k].rotation.to_rotation_matrix();
        let row = [0, 1, 2].map(|j| r[(axis, j)]);
        if k == 0 {
            (0..3).map(|j| (row[j] * f64::from(radii[j])).powi(2)).sum::<f64>().sqrt()
        } else {
            f64::from(radius) + f64::from(half_length) * row[2].abs()
        }
    };
    for world_from_link in [Pose::identity(), scene::pose::from_xyz_rpy([0.5, 0.3, 0.2], [1.0, -0.4, 2.0])] {
        let place = |k: usize| PoseF32::from(&(world_from_link * link_from[k]));
        let poses = [place(0), place(1), PoseF32::from_translation([0.0, 0.0, -1.0])];
        let camera = seen(scene.clone(), &poses, [2.0, 0.1, 0.4], [0.3, 0.2, 0.2]);
        let boxes = table(&scene).boxes_3d(SegmentLevel::Link, &camera, 0).unwrap();
        let [found] = boxes[..] else { panic!("a plane without end has no box: {boxes:?}") };
        for axis in 0..3 {
            let side = |sign: f64| [0, 1].map(|k| link_from[k].translation.vector[axis] + sign * reach(k, axis));
            let ([a, b], [c, d]) = (side(-1.0), side(1.0));
            // Poses are in single precision: some 1e-7 m, and as many rad.
            assert!((found.min[axis] - a.min(b)).abs() < 2e-6, "{found:?}");
            assert!((found.max[axis] - c.max(d)).abs() < 2e-6, "{found:?}");
        }
        // Corners: the box, mapped.
        let corners = found.corners();
        for (k, corner) in corners.iter().enumerate() {
            let local =
                Point3::from([0, 1, 2].map(|axis| if k >> axis & 1 == 1 { found.max[axis] } else { found.min[axis] }));
            let expected = world_from_link * local;
            assert!((Point3::from(*corner) - expected).norm() < 2e-6, "{corner:?}");
        }
        let diagonal = Vector3::from(found.size()).norm();
        let across = (Point3::from(corners[7]) - Point3::from(corners[0])).norm();
        // Two corners, each rounded as above.
        assert!((across - diagonal).abs() < 4e-6, "{across}, {diagonal}");
        let middle = nalgebra::center(&Point3::from(corners[0]), &Point3::from(corners[7]));
        assert!((Point3::from(found.center()) - middle).norm() < 1e-12);
        // Whatever is seen of the link is in it.
        let (mask, position) = (camera.mask().unwrap(), camera.position().unwrap());
        let mut seen = 0;
        for ((_, v, u), id) in mask.indexed_iter().filter(|(_, id)| **id == 7) {
            assert_eq!(*id, 7);
            let p = Point3::from([0, 1, 2].map(|k| f64::from(position.index_axis(Axis(0), 0)[(v, u, k)])));
            let local = world_from_link.inverse() * p;
            assert!((0..3).all(|k| local[k] > found.min[k] - 1e-5 && local[k] < found.max[k] + 1e-5), "{local}");
            seen += 1;
        }
        assert!(seen > 50, "{seen}");
    }
}

/// Every shape: fine triangles of it touch all six sides of its box from inside, to what their polygons leave out, R (1 -
/// cos(pi / 256)) < 4e-5 m.
#[test]
fn boxes_of_every_shape_are_tight() {
    for (k, shape) in every_shape().into_iter().enumerate() {
        let frame_from_instance = scene::pose::from_xyz_rpy([0.1, 0.2, -0.1], [0.3 + k as f64, 0.7, -0.2]);
        let instance = Instance { frame_from_instance, ..Instance::new(shape.clone(), Material::default(), 1) };
        let scene = RenderScene::new(vec![instance]).unwrap();
        let camera = seen(scene.clone(), &[PoseF32::from(&frame_from_instance)], [2.0, 0.0, 0.5], [0.0; 3]);
        let found = table(&scene).boxes_3d(SegmentLevel::Semantic, &camera, 0).unwrap()[0];
        let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
        for p in shape.tessellate(256).positions {
            let p = frame_from_instance * Point3::from(p).cast::<f64>();
            for axis in 0..3 {
                (min[axis], max[axis]) = (min[axis].min(p[axis]), max[axis].max(p[axis]));
            }
        }
        for axis in 0..3 {
            let off = [found.min[axis] - min[axis], max[axis] - found.max[axis]];
            assert!(off.iter().all(|x| (-4e-5..1e-6).contains(x)), "{}: {off:?}", shape.name());
        }
    }
}
