//! Boxes and occlusions of pictures whose rows are of several instants, held against pictures of each thing alone.

use super::super::{
    Box2d, Camera, CameraCfg, Channels, Extrinsics, Intrinsics, Occlusion, PixelBox, Placement, Renderer, SegmentLevel,
    Segmentation, SegmentationCfg, Shutter, Thing,
};
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use ndarray::Array2;
use scene::shape::{Box, Sphere};
use scene::{Instance, Light, Material, PoseF32, RenderScene, SceneState, VisibleState};
use std::sync::Arc;

const SIZE: [usize; 2] = [64, 48];
const F: f64 = 60.0;
const DT: f64 = 0.01;
/// Physics steps between pictures.
const PERIOD: u64 = 10;
/// How long the shutter takes \[s\].
const SPAN: f64 = 0.08;

/// A bar, a ball, a screen that stands still, and a bar that leaves the picture while it is read.
fn things() -> Vec<Instance> {
    let thing = |shape: scene::Shape, id| Instance::new(shape, Material::default(), id);
    vec![
        thing(Box { half: [0.05, 0.1, 5.0] }.into(), 1),
        thing(Sphere { radius: 0.3 }.into(), 2),
        thing(Box { half: [0.01, 0.4, 0.3] }.into(), 3),
        thing(Box { half: [0.05, 0.1, 5.0] }.into(), 4),
    ]
}

/// Where they are at a step; the camera looks along x, so that the picture's right is -y.
fn poses(step: u64) -> Vec<PoseF32> {
    let t = step as f32 * DT as f32;
    [[3.0, 0.8 - 8.0 * t, 0.0], [2.0, 0.2, 0.9 - 12.0 * t], [1.2, -0.3, 0.0], [2.5, 2.6 - 42.0 * t, 0.0]]
        .map(PoseF32::from_translation)
        .into()
}

/// The picture of step [`PERIOD`] of things with these mask ids, and nothing else.
fn seen(is: impl Fn(i32) -> bool, shutter: Shutter) -> Camera {
    let keep: Vec<bool> = things().iter().map(|thing| is(thing.mask_id)).collect();
    let kept = |list: Vec<PoseF32>| list.into_iter().zip(&keep).filter(|(_, keep)| **keep).map(|(pose, _)| pose);
    let instances = things().into_iter().filter(|thing| is(thing.mask_id)).collect();
    let scene = RenderScene::new(instances).unwrap();
    let lights = Array2::from_elem((1, scene.lights.len()), Light::default());
    let context =
        SensorContext { num_envs: 1, dt: DT, scene: Some(Arc::new(scene)), threads: 1, ..SensorContext::default() };
    let placement = Placement::LookAt { eye: [0.0; 3], target: [1.0, 0.0, 0.0], up: [0.0, 0.0, 1.0] };
    let cfg = CameraCfg {
        width: SIZE[0],
        height: SIZE[1],
        intrinsics: Intrinsics::Pixels { fx: F, fy: F, cx: 32.0, cy: 24.0 },
        extrinsics: Extrinsics { placement, ..Extrinsics::default() },
        channels: Channels { mask: true, ..Channels::default() },
        renderer: Renderer::RAY_TRACED,
        shutter,
        update_period: PERIOD as f64 * DT,
        ..CameraCfg::default()
    };
    let at = |step: u64| SceneState {
        step: vec![step],
        time: vec![step as f64 * DT],
        visible: Some(VisibleState {
            instance_poses: Array2::from_shape_vec(
                (1, keep.iter().filter(|keep| **keep).count()),
                kept(poses(step)).collect(),
            )
            .unwrap(),
            lights: lights.clone(),
        }),
        ..SceneState::new(1)
    };
    let mut camera = cfg.build(&context).unwrap();
    camera.reset(&[0], &at(0)).unwrap();
    (1..=PERIOD).for_each(|step| camera.update(&at(step)).unwrap());
    camera
}

fn pixels(camera: &Camera, id: i32) -> Option<(PixelBox, usize)> {
    let mask = camera.mask().unwrap();
    let hits: Vec<[f64; 2]> =
        mask.indexed_iter().filter(|(_, found)| **found == id).map(|((_, v, u), _)| [u as f64, v as f64]).collect();
    let end = |axis: usize, pick: fn(f64, f64) -> f64| hits.iter().map(|at| at[axis]).reduce(pick);
    let min = [end(0, f64::min)?, end(1, f64::min)?];
    let max = [end(0, f64::max)? + 1.0, end(1, f64::max)? + 1.0];
    Some((PixelBox { min, max }, hits.len()))
}

/// Root cause: the mask was drawn row by row, each at its own instant, and what each thing would look like alone as of the stamp.
/// So more of a thing was seen than there was of it, and what had left the picture by then was not in the list.
#[test]
fn boxes_of_what_moves_are_of_the_rows_that_show_it() {
    let rolling = Shutter { row_time: SPAN / (SIZE[1] - 1) as f64, exposure_time: 0.0 };
    let all = seen(|_| true, rolling);
    let thing = |id| Thing { id, object: format!("thing {id}"), link: None, class: "thing".into() };
    let segmentation = Segmentation::new((1..=4).map(thing), &SegmentationCfg::default()).unwrap();
    let boxes = segmentation.boxes_2d(SegmentLevel::Instance, &all, 0).unwrap();
    let occlusions = segmentation.occlusions(SegmentLevel::Instance, &all, 0).unwrap();
    assert_eq!((boxes.len(), occlusions.len()), (4, 4), "{boxes:?} {occlusions:?}");
    for (Box2d { id, tight, loose, visible_pixels }, occlusion) in boxes.into_iter().zip(&occlusions) {
        let visible = pixels(&all, id);
        let alone = pixels(&seen(|other| other == id, rolling), id).unwrap();
        assert_eq!((tight, visible_pixels), (visible.map(|v| v.0), visible.map_or(0, |v| v.1)), "{id}");
        assert_eq!(loose, Some(alone.0), "{id}");
        assert_eq!(*occlusion, Occlusion { id, visible_pixels, alone_pixels: alone.1 });
        assert!((0.0..=1.0).contains(&occlusion.ratio()), "{occlusion:?}");
    }
    let ratios: Vec<f64> = occlusions.iter().map(Occlusion::ratio).collect();
    assert!([0, 1, 3].iter().all(|k| ratios[*k] > 0.1) && ratios[2] == 0.0, "{ratios:?}");
    // The controls: at the stamp things are elsewhere, and one of them has left the picture.
    let instant = seen(|_| true, Shutter::default());
    let then = segmentation.boxes_2d(SegmentLevel::Instance, &instant, 0).unwrap();
    assert_eq!(then.iter().map(|found| found.id).collect::<Vec<_>>(), [1, 2, 3]);
    assert_ne!(pixels(&instant, 1), pixels(&all, 1));
    assert!(pixels(&instant, 4).is_none() && pixels(&all, 4).is_some());
}
