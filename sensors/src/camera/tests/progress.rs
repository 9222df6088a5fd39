//! Long renderings tell how far they are, and end when they are told to.

use super::super::channel::Color;
use super::super::{Channels, Frame, ParallelRasterizer, RasterCfg, Rasterizer, RenderProgress, Renderer, Shot};
use super::scenes::figure;
use super::stage::{built, cfg, context, state};
use crate::camera::{CameraCfg, CameraError};
use crate::sensor::{Sensor, SensorCfg};
use crate::visibility::{RenderError, View};
use scene::Marker;
use std::time::{Duration, Instant};

fn paths(samples: u32) -> Renderer {
    Renderer::RayTraced { samples, max_bounces: 2, denoise: true, seed: 0 }
}

#[test]
fn progress_reaches_its_total() {
    let (scene, poses) = figure();
    let view = View::look_at([33, 21], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    for threads in [1, 3] {
        let mut rasterizer = ParallelRasterizer::new(RasterCfg::default(), threads);
        rasterizer.set_renderer(paths(8));
        let progress = rasterizer.progress().clone();
        assert_eq!((progress.total(), progress.fraction(), progress.remaining()), (0, None, None));
        let mut frames = [Frame::new(33, 21, Channels::ALL), Frame::new(33, 21, Channels::ALL)];
        let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
        let mut jobs: Vec<_> = frames.iter_mut().map(|frame| (shot, frame.as_mut())).collect();
        rasterizer.render(&mut jobs).unwrap();
        assert_eq!((progress.samples(), progress.total()), (2 * 33 * 21 * 8, 2 * 33 * 21 * 8));
        assert_eq!((progress.fraction(), progress.remaining()), (Some(1.0), Some(Duration::ZERO)));
        // Each path is a ray at least; of two bounces it has three, and one for each of the lamps at each, at most.
        let most = (3 + 3 * 2 * (scene.lights.len() as u64 + 2)) * progress.samples();
        assert!((progress.samples() + 1..=most).contains(&progress.rays()), "{}", progress.rays());
        // Pictures without paths have none.
        rasterizer.set_renderer(Renderer::Raster);
        rasterizer.render(&mut jobs).unwrap();
        assert_eq!((progress.samples(), progress.total()), (0, 0));
    }
}

/// It would take minutes; the frame stays as it was, every channel.
#[test]
fn what_is_broken_off_ends_early_and_leaves_the_picture_before() {
    let (scene, poses) = figure();
    let view = View::look_at([64, 64], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let mut rasterizer = ParallelRasterizer::new(RasterCfg::default(), 2);
    rasterizer.set_renderer(paths(Renderer::MAX_SAMPLES));
    let mut frame = Frame::new(64, 64, Channels::ALL);
    frame.color.as_mut().unwrap().fill(77);
    frame.mask.as_mut().unwrap().fill(5);
    let before = frame.clone();
    let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
    let progress = rasterizer.progress().clone();
    let total = 64 * 64 * u64::from(Renderer::MAX_SAMPLES);
    let canceller = std::thread::spawn({
        let progress = progress.clone();
        move || {
            let start = Instant::now();
            while progress.samples() == 0 && start.elapsed() < Duration::from_secs(60) {
                std::thread::yield_now();
            }
            let left = progress.remaining();
            progress.cancel();
            left
        }
    });
    let (index, error) = rasterizer.render(&mut [(shot, frame.as_mut())]).unwrap_err();
    let left = canceller.join().unwrap();
    let RenderError::Cancelled { samples, total: all } = error else { panic!("{error}") };
    assert_eq!((index, all), (0, total));
    // A few pixels of each thread.
    assert!(samples > 0 && samples < total / 20, "{samples} of {total}");
    assert!(left.is_some_and(|left| left > Duration::ZERO), "{left:?}");
    assert_eq!(frame, before);
    // It stays broken off, until it is resumed.
    rasterizer.set_renderer(paths(1));
    let (_, error) = rasterizer.render(&mut [(shot, frame.as_mut())]).unwrap_err();
    assert_eq!(error, RenderError::Cancelled { samples: 0, total: 64 * 64 });
    assert_eq!(frame, before);
    progress.resume();
    rasterizer.render(&mut [(shot, frame.as_mut())]).unwrap();
    assert!(frame != before && progress.fraction() == Some(1.0));
}

#[test]
fn cameras_lend_their_progress() {
    fn shared<T: Send + Sync + Clone + 'static>(_: &T) {}
    let mut camera = built(&CameraCfg { renderer: paths(2), ..cfg() }, &context(1));
    let progress: RenderProgress = camera.progress().clone();
    shared(&progress);
    progress.cancel();
    let error = camera.color().unwrap_err();
    let total = 2 * (cfg().width * cfg().height) as u64;
    let expected = CameraError::Draw { env: 0, error: RenderError::Cancelled { samples: 0, total } };
    assert_eq!(error, expected.into());
    progress.resume();
    // What was broken off is drawn by the next reader, and is what it would have been.
    let fresh = built(&CameraCfg { renderer: paths(2), ..cfg() }, &context(1));
    assert_eq!(camera.color().unwrap(), fresh.color().unwrap());
    assert_eq!(progress.samples(), total);
    // A control: what cannot be drawn stays so.
    let draws = camera.draws();
    let mut state = state(&[1]);
    state.visible.as_mut().unwrap().instance_poses[(0, 1)].translation[0] = f32::NAN;
    camera.update(&state).unwrap();
    assert!(camera.color().is_err() && camera.color().is_err());
    assert_eq!(camera.draws(), draws + 1, "tried once");
}

/// A late camera that shows something newer, and one that remembers: neither keeps what was broken off.
#[test]
fn late_and_past_pictures_that_were_broken_off_are_drawn_when_read_again() {
    let cfg = CameraCfg { renderer: paths(2), latency_steps: 2, history_length: 2, ..cfg() };
    let context = context(1);
    let run = |breaks_off: bool| {
        let mut camera = built(&cfg, &context);
        for step in 1..=3 {
            camera.update(&state(&[step])).unwrap();
        }
        // Somebody writes: what is shown is not what arrived.
        camera.refresh(&[0], &state(&[3])).unwrap();
        assert!(camera.color().is_ok() && camera.arrived_stamps() != camera.stamps());
        if breaks_off {
            camera.progress().cancel();
            for _ in 0..2 {
                assert!(camera.arrived::<Color>().unwrap_err().to_string().contains("broken off"));
                assert!(camera.history::<Color>().unwrap_err().to_string().contains("broken off"));
            }
            camera.progress().resume();
        }
        let (arrived, past) = (camera.arrived::<Color>().unwrap().to_owned(), camera.history::<Color>().unwrap());
        let drawn = camera.draws();
        assert_eq!(camera.arrived::<Color>().unwrap(), arrived);
        assert_eq!(camera.draws(), drawn, "what is drawn is kept");
        (arrived, past.to_owned())
    };
    assert_eq!(run(true), run(false));
}

/// Two pictures, of which one has a pose that is none: the other is all there is to do.
#[test]
fn pictures_that_are_refused_do_not_count() {
    let (scene, poses) = figure();
    let mut broken = poses.clone();
    broken[0].rotation = [[0.0; 3]; 3];
    let view = View::look_at([33, 21], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let mut rasterizer = ParallelRasterizer::new(RasterCfg::default(), 2);
    rasterizer.set_renderer(paths(8));
    let mut frames = [Frame::new(33, 21, Channels::ALL), Frame::new(33, 21, Channels::ALL)];
    let shot = |poses| Shot { scene: &scene, poses, view: &view, lights: None, lens: None, before: None };
    let [first, second] = &mut frames;
    let result = rasterizer.render(&mut [(shot(&broken[..]), first.as_mut()), (shot(&poses[..]), second.as_mut())]);
    assert!(matches!(result, Err((0, RenderError::InstancePose { .. }))));
    let progress = rasterizer.progress();
    assert_eq!((progress.samples(), progress.total()), (33 * 21 * 8, 33 * 21 * 8));
    assert_eq!((progress.fraction(), progress.remaining()), (Some(1.0), Some(Duration::ZERO)));
}

/// A copy of a renderer counts for itself, and breaking one off does not break off the other.
#[test]
fn copies_have_their_own_progress() {
    let (scene, poses) = figure();
    let view = View::look_at([33, 21], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let mut first = ParallelRasterizer::new(RasterCfg::default(), 2);
    first.set_renderer(paths(4));
    let mut second = first.clone();
    first.progress().cancel();
    let mut frame = Frame::new(33, 21, Channels::ALL);
    let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
    second.render(&mut [(shot, frame.as_mut())]).unwrap();
    assert_eq!((second.progress().samples(), first.progress().samples()), (33 * 21 * 4, 0));
    assert!(first.render(&mut [(shot, frame.as_mut())]).is_err());
    let single = Rasterizer { renderer: paths(4), ..Rasterizer::default() };
    let copy = single.clone();
    single.progress.cancel();
    assert!(!copy.progress.is_cancelled() && copy.renderer == single.renderer);
}

/// Of two environments one has something to show in its picture, which is drawn twice then: without its colour, which takes no
/// paths, and its colour with the markers. Root cause once: these were counted after the others had been, from 0 again.
#[test]
fn pictures_with_markers_count_once() {
    let channels = Channels { mask: true, color: true, ..Channels::default() };
    let of = |draw_markers| CameraCfg { renderer: paths(2), draw_markers, channels, ..cfg() };
    let (context, mut shown) = (context(2), state(&[0, 0]));
    shown.markers = Some(vec![vec![Marker::sphere([0.0, 0.0, 0.9], 0.2, [0.0, 1.0, 0.0, 1.0])], Vec::new()]);
    let look = |draw_markers| {
        let mut camera = of(draw_markers).build(&context).unwrap();
        camera.reset(&[0, 1], &shown).unwrap();
        let pictures = (camera.color().unwrap().to_owned(), camera.mask().unwrap().to_owned());
        let total = 2 * 2 * (cfg().width * cfg().height) as u64;
        assert_eq!((camera.progress().samples(), camera.progress().total()), (total, total));
        pictures
    };
    let ((color, mask), (plain, plain_mask)) = (look(true), look(false));
    let envs = ndarray::Axis(0);
    assert_ne!(color.index_axis(envs, 0), plain.index_axis(envs, 0), "the marker is seen");
    assert_eq!(color.index_axis(envs, 1), plain.index_axis(envs, 1));
    assert_eq!(mask, plain_mask, "and measured nowhere");
}
