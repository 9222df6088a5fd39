//! Pictures as files, for people.

use super::super::{Channels, Frame, ParallelRasterizer, RasterCfg, Rasterizer, Shot};
use super::scenes::figure;
use crate::visibility::View;
use scene::{PoseF32, RenderScene};
use std::path::PathBuf;
use std::sync::OnceLock;
use std::time::Instant;

/// The folder of `KINETOSCOPE_PICTURES`; without it, no picture is written.
pub(super) fn folder() -> Option<PathBuf> {
    std::env::var_os("KINETOSCOPE_PICTURES").map(PathBuf::from)
}

pub(super) const FOUR: Channels = Channels { color: true, depth: true, mask: true, normal: true, ..Channels::NONE };

/// Draws and, where a folder is named, writes the colour, depth, mask and normals as PNG.
pub(super) fn save(name: &str, scene: &RenderScene, poses: &[PoseF32], view: &View) -> Frame {
    let mut frame = Frame::new(view.width, view.height, FOUR);
    Rasterizer::default().render(scene, poses, view, &mut frame).unwrap();
    let Some(folder) = folder() else { return frame };
    let (w, h) = (view.width as u32, view.height as u32);
    let color = image::RgbaImage::from_raw(w, h, frame.color.clone().unwrap()).unwrap();
    color.save(folder.join(format!("{name}.png"))).unwrap();
    let normal = frame.normal.as_ref().unwrap().iter().map(|n| (n * 127.0 + 128.0) as u8).collect();
    image::RgbImage::from_raw(w, h, normal).unwrap().save(folder.join(format!("{name}-normal.png"))).unwrap();
    let mask = frame.mask.as_ref().unwrap();
    let hue = |id: &i32| [(id * 71 % 200) as u8, (id * 37 % 220) as u8, (id * 113 % 240) as u8];
    let mask = mask.iter().flat_map(hue).collect();
    image::RgbImage::from_raw(w, h, mask).unwrap().save(folder.join(format!("{name}-mask.png"))).unwrap();
    let depth = frame.depth.as_ref().unwrap().iter().map(|d| (255.0 / (0.3 * d + 1.0)) as u8).collect();
    image::GrayImage::from_raw(w, h, depth).unwrap().save(folder.join(format!("{name}-depth.png"))).unwrap();
    frame
}

/// Time this thread has run \[s\] where the system tells (machines are shared), else time that has passed.
fn seconds() -> f64 {
    static START: OnceLock<Instant> = OnceLock::new();
    let passed = START.get_or_init(Instant::now).elapsed().as_secs_f64();
    let run = std::fs::read_to_string("/proc/thread-self/schedstat").ok();
    let nanoseconds = run.and_then(|text| text.split(' ').next().and_then(|n| n.parse::<f64>().ok()));
    nanoseconds.map_or(passed, |n| n * 1e-9)
}

/// Milliseconds per frame of colour, depth, mask and normal, the best of several runs.
pub(super) fn milliseconds(cfg: RasterCfg, scene: &RenderScene, poses: &[PoseF32], view: &View) -> (f64, usize) {
    let mut rasterizer = Rasterizer::new(cfg);
    let mut frame = Frame::new(view.width, view.height, FOUR);
    let mut best = f64::MAX;
    rasterizer.render(scene, poses, view, &mut frame).unwrap();
    for _ in 0..4 {
        // The system counts in ticks of some milliseconds: many frames at once.
        let (start, mut count) = (seconds(), 0);
        while seconds() - start < 0.15 {
            rasterizer.render(scene, poses, view, &mut frame).unwrap();
            count += 1;
        }
        best = best.min((seconds() - start) * 1e3 / f64::from(count));
    }
    (best, rasterizer.scratch_bytes())
}

pub(super) fn report(name: &str, scene: &RenderScene, poses: &[PoseF32], view: &View) {
    if folder().is_none() {
        return;
    }
    println!("{name}, {} x {}, {} triangles", view.width, view.height, scene.triangle_count());
    for (shadows, samples) in [(false, 1), (true, 1), (false, 4), (true, 4)] {
        for lod in [false, true] {
            let cfg = RasterCfg { samples, shadows, lod, ..RasterCfg::default() };
            let (ms, bytes) = milliseconds(cfg, scene, poses, view);
            let rate = 1e3 / ms;
            println!(
                "  shadows {shadows}, {samples} samples, lod {lod}: {ms:.3} ms, {rate:.0} images/s, scratch {} KiB",
                bytes / 1024
            );
        }
    }
}

/// Milliseconds that pass per picture with a number of threads, for one picture at a time and for many: the best of many.
fn passed(threads: usize, scene: &RenderScene, poses: &[PoseF32], view: &View) -> [f64; 2] {
    [1, 16].map(|count| {
        let mut rasterizer = ParallelRasterizer::new(RasterCfg::default(), threads);
        let mut frames = vec![Frame::new(view.width, view.height, FOUR); count];
        let mut best = f64::MAX;
        for _ in 0..40 / count.min(4) {
            let shot = Shot { scene, poses, view, lights: None, lens: None, before: None };
            let mut jobs: Vec<_> = frames.iter_mut().map(|frame| (shot, frame.as_mut())).collect();
            let start = Instant::now();
            rasterizer.render(&mut jobs).unwrap();
            best = best.min(start.elapsed().as_secs_f64() * 1e3 / count as f64);
        }
        best
    })
}

pub(super) fn report_threads(name: &str, scene: &RenderScene, poses: &[PoseF32], view: &View) {
    if folder().is_none() {
        return;
    }
    let all = [1, 2].map(|threads| passed(threads, scene, poses, view));
    for (k, what) in ["one picture", "16 pictures"].into_iter().enumerate() {
        let (one, two) = (all[0][k], all[1][k]);
        println!("{name}, {what}: {one:.2} ms each, with two threads {two:.2} ms, {:.2} times as fast", one / two);
    }
}

#[test]
fn a_figure_stands_on_the_ground() {
    let (scene, poses) = figure();
    let view = View::look_at([640, 480], 0.8, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let frame = save("figure", &scene, &poses, &view);
    let mask = frame.mask.unwrap();
    assert!((1..scene.instances().len() as i32).all(|id| mask.contains(&id)), "everything is seen");
    assert!(mask.contains(&100) && mask.contains(&0), "ground and sky");
    report("figure", &scene, &poses, &view);
    report_threads("figure", &scene, &poses, &view);
    for side in [64, 128, 256] {
        let view = View::look_at([side; 2], 0.8, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
        report("figure", &scene, &poses, &view);
    }
}
