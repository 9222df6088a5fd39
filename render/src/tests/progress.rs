//! Long renderings report their progress and can be canceled.

use crate::frame::{Channels, Frame};
use crate::image_renderer::ImageRenderer;
use crate::parallel_renderer::ParallelRenderer;
use crate::progress::RenderProgress;
use crate::renderer::Renderer;
use crate::request::{RasterCfg, RenderRequest};
use crate::visibility::{RenderError, View};
use kinetoscope_scene::PoseF32;
use kinetoscope_testkit::scenes::humanoid;
use std::time::{Duration, Instant};

fn paths(samples: u32) -> Renderer {
    Renderer::RayTraced { samples, max_bounces: 2, denoise: true, seed: 0 }
}

fn rasterizer(samples: u32, threads: usize) -> ParallelRenderer {
    let mut rasterizer = ParallelRenderer::new(RasterCfg::default(), threads);
    rasterizer.set_renderer(paths(samples));
    rasterizer
}

fn view(size: [usize; 2]) -> View {
    View::look_at(size, 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap()
}

/// Samples, their total, finished fraction and remaining time.
type Numbers = (u64, u64, Option<f64>, Option<Duration>);

fn numbers(progress: &RenderProgress) -> Numbers {
    (progress.samples(), progress.total(), progress.fraction(), progress.remaining())
}

fn done(samples: u64) -> Numbers {
    (samples, samples, Some(1.0), Some(Duration::ZERO))
}

#[test]
fn totals() {
    let ((scene, poses), view) = (humanoid(), view([33, 21]));
    let render_request =
        |poses| RenderRequest { scene: &scene, poses, view: &view, lights: None, lens: None, previous: None };
    for threads in [1, 3] {
        let mut rasterizer = rasterizer(8, threads);
        let progress = rasterizer.progress().clone();
        assert_eq!((progress.total(), progress.fraction(), progress.remaining()), (0, None, None));
        let mut frames = [0, 1].map(|_| Frame::new(33, 21, Channels::ALL));
        let mut jobs: Vec<_> = frames.iter_mut().map(|frame| (render_request(&poses), frame.as_mut())).collect();
        rasterizer.render(&mut jobs).unwrap();
        assert_eq!(numbers(&progress), done(2 * 33 * 21 * 8));
        // Each path has at least one ray; with two bounces at most three, and one shadow ray for each light at each
        // surface.
        let most = (3 + 3 * 2 * (scene.lights.len() as u64 + 2)) * progress.samples();
        assert!((progress.samples() + 1..=most).contains(&progress.rays()), "{}", progress.rays());
        // Images without paths have no samples.
        rasterizer.set_renderer(Renderer::Raster);
        rasterizer.render(&mut jobs).unwrap();
        assert_eq!((progress.samples(), progress.total()), (0, 0));
    }
    // One of two images has an invalid pose: only the other image counts.
    let mut broken: Vec<PoseF32> = poses.clone();
    broken[0].rotation = [[0.0; 3]; 3];
    let mut rasterizer = rasterizer(8, 2);
    let [mut first, mut second] = [0, 1].map(|_| Frame::new(33, 21, Channels::ALL));
    let result =
        rasterizer.render(&mut [(render_request(&broken), first.as_mut()), (render_request(&poses), second.as_mut())]);
    assert!(matches!(result, Err((0, RenderError::InstancePose { .. }))));
    assert_eq!(numbers(rasterizer.progress()), done(33 * 21 * 8));
}

/// Rendering would take minutes. After cancellation, it ends early and leaves every channel of the frame unchanged.
#[test]
fn cancel() {
    let ((scene, poses), view) = (humanoid(), view([64, 64]));
    let mut rasterizer = rasterizer(Renderer::MAX_SAMPLES, 2);
    let mut frame = Frame::new(64, 64, Channels::ALL);
    frame.color.as_mut().unwrap().fill(77);
    frame.mask.as_mut().unwrap().fill(5);
    let before = frame.clone();
    let render_request =
        RenderRequest { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, previous: None };
    let progress = rasterizer.progress().clone();
    let canceler = std::thread::spawn({
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
    let (index, error) = rasterizer.render(&mut [(render_request, frame.as_mut())]).unwrap_err();
    let left = canceler.join().unwrap();
    let RenderError::Canceled { samples, total } = error else { panic!("{error}") };
    assert_eq!((index, total), (0, 64 * 64 * u64::from(Renderer::MAX_SAMPLES)));
    // A few pixels of each thread.
    assert!(samples > 0 && samples < total / 20, "{samples} of {total}");
    assert!(left.is_some_and(|left| left > Duration::ZERO), "{left:?}");
    assert_eq!(frame, before);
    // It stays canceled until it is resumed.
    rasterizer.set_renderer(paths(1));
    let (_, error) = rasterizer.render(&mut [(render_request, frame.as_mut())]).unwrap_err();
    assert_eq!(error, RenderError::Canceled { samples: 0, total: 64 * 64 });
    assert_eq!(frame, before);
    progress.resume();
    rasterizer.render(&mut [(render_request, frame.as_mut())]).unwrap();
    assert!(frame != before && progress.fraction() == Some(1.0));
    // A clone of a renderer has its own progress and is not canceled with the original.
    let mut clone = rasterizer.clone();
    progress.cancel();
    clone.set_renderer(paths(2));
    clone.render(&mut [(render_request, frame.as_mut())]).unwrap();
    assert_eq!((clone.progress().samples(), progress.samples()), (2 * 64 * 64, 64 * 64));
    assert!(rasterizer.render(&mut [(render_request, frame.as_mut())]).is_err());
    let single = ImageRenderer { renderer: paths(4), ..ImageRenderer::default() };
    let clone = single.clone();
    single.progress.cancel();
    assert!(!clone.progress.is_canceled() && clone.renderer == single.renderer);
}
