//! Long renderings tell how far they are, and end when they are told to.

use super::super::{Channels, Frame, ParallelRasterizer, RasterCfg, RenderProgress, Renderer, Shot};
use super::scenes::figure;
use super::stage::{built, cfg, context};
use crate::camera::{CameraCfg, CameraError};
use crate::visibility::{RenderError, View};
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
    assert!(camera.color().is_err(), "until something is set or captured");
    camera.restore(None).unwrap();
    assert!(camera.color().is_ok() && progress.samples() == total);
}
