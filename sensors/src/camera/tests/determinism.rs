//! The same picture, bit for bit, with every instruction set and on every thread.

use super::super::{Channels, Frame, FrameMut, ParallelRasterizer, RasterCfg, Rasterizer, Shot};
use super::scenes::{Random, figure, random};
use crate::lanes::levels;
use crate::visibility::View;
use scene::{Light, LightKind, PoseF32, RenderScene};

/// A scene with everything that colours are made of.
fn rich(seed: u64) -> (RenderScene, Vec<PoseF32>, View) {
    let mut numbers = Random(seed);
    let (mut scene, poses) = random(&mut numbers, 1.0);
    let spot = LightKind::Spot { cutoff_deg: 40.0, exponent: 10.0 };
    scene.lights.push(Light { kind: spot, position: [2., 1., 3.], direction: [-2., -1., -3.], ..Light::default() });
    scene.lights.push(Light { kind: LightKind::Point, position: [0., -2., 1.], ..Light::default() });
    scene.haze = Some(scene::Haze { color: None, start: 2.0, end: 8.0 });
    let view = View::look_at([101, 67], 0.9, [2.5, -1.5, 1.5], [0., 0., -0.1], [0., 0., 1.]).unwrap();
    (scene, poses, view)
}

/// Frames are compared as bits: NaN would equal itself.
pub(super) fn bits(frame: &Frame) -> Vec<u32> {
    let bytes = [&frame.color, &frame.albedo].into_iter().flatten().flatten();
    let mut out: Vec<u32> = bytes.map(|&x| x.into()).collect();
    out.extend(frame.mask.iter().flatten().map(|&x| x as u32));
    let floats = [&frame.depth, &frame.distance, &frame.normal, &frame.shading_normal, &frame.position, &frame.flow];
    out.extend(floats.into_iter().flatten().flatten().map(|x| x.to_bits()));
    out
}

#[test]
fn every_instruction_set_draws_the_same_bits() {
    let names: Vec<String> = levels().iter().map(|l| format!("{l:?}")).collect();
    println!("{names:?}");
    assert!(names.len() >= 2);
    for seed in 1..4 {
        let (scene, poses, view) = rich(seed);
        for samples in [1, 4] {
            let draw = |level| {
                let cfg = RasterCfg { samples, ..RasterCfg::default() };
                let mut frame = Frame::new(view.width, view.height, Channels::ALL);
                Rasterizer::with_level(cfg, level).render(&scene, &poses, &view, &mut frame).unwrap();
                bits(&frame)
            };
            let all: Vec<_> = levels().into_iter().map(draw).collect();
            for (other, name) in all.iter().zip(&names) {
                let different = other.iter().zip(&all[0]).filter(|(a, b)| a != b).count();
                assert_eq!(different, 0, "{name} differs from scalar, {samples} samples, scene {seed}");
            }
        }
    }
}

#[test]
fn every_thread_draws_the_same_bits() {
    let scenes: Vec<_> = (1..7).map(rich).collect();
    let draw = |rasterizer: &mut Rasterizer, k: usize| {
        let (scene, poses, view) = &scenes[k];
        let mut frame = Frame::new(view.width, view.height, Channels::ALL);
        rasterizer.render(scene, poses, view, &mut frame).unwrap();
        bits(&frame)
    };
    let alone: Vec<_> = (0..6).map(|k| draw(&mut Rasterizer::default(), k)).collect();
    for threads in 1..=3 {
        std::thread::scope(|scope| {
            for thread in 0..threads {
                let (draw, alone) = (&draw, &alone);
                scope.spawn(move || {
                    let mut rasterizer = Rasterizer::default();
                    for k in (thread..6).step_by(threads) {
                        assert!(draw(&mut rasterizer, k) == alone[k], "scene {k}, {threads} threads");
                    }
                });
            }
        });
    }
}

#[test]
fn bands_and_channels_do_not_change_a_picture() {
    let (scene, poses) = figure();
    // Tall enough for several bands with four samples.
    let view = View::look_at([200, 400], 0.9, [2.6, -1.6, 1.6], [0.2, 0., 0.8], [0., 0., 1.]).unwrap();
    let draw = |channels, samples| {
        let mut frame = Frame::new(view.width, view.height, channels);
        let cfg = RasterCfg { samples, ..RasterCfg::default() };
        Rasterizer::new(cfg).render(&scene, &poses, &view, &mut frame).unwrap();
        frame
    };
    let (all, one) = (draw(Channels::ALL, 4), draw(Channels::ALL, 1));
    let depth = draw(Channels { depth: true, ..Channels::default() }, 4);
    assert!(all.depth == one.depth && all.depth == depth.depth, "multisampling is for the colour only");
    assert!(all.mask == one.mask && all.normal == one.normal);
    assert!(all.color != one.color);
    assert!(draw(Channels { color: true, ..Channels::default() }, 4).color == all.color);
}

/// A scene with everything, and things that are not quite opaque; larger than what is worth a thread.
fn large(seed: u64, size: [usize; 2]) -> (RenderScene, Vec<PoseF32>, View) {
    let (scene, poses, view) = rich(seed);
    let mut instances = scene.instances().to_vec();
    (instances[1].material.rgba[3], instances[2].material.rgba[3]) = (0.4, 0.7);
    let mut veiled = RenderScene::new(instances).unwrap();
    (veiled.lights, veiled.haze) = (scene.lights.clone(), scene.haze);
    let view = View { width: size[0], height: size[1], fx: view.fx * 3.0, fy: view.fy * 3.0, ..view };
    (veiled, poses, View { cx: 0.5 * size[0] as f32, cy: 0.5 * size[1] as f32, ..view })
}

#[test]
fn the_number_of_threads_does_not_change_pictures() {
    let sizes = [[333, 251], [64, 64], [97, 401], [8, 8], [401, 97], [203, 300], [1, 1], [120, 90], [130, 17]];
    let shots: Vec<_> = sizes.into_iter().zip(1..).map(|(size, seed)| large(seed, size)).collect();
    for samples in [1, 4] {
        let cfg = RasterCfg { samples, ..RasterCfg::default() };
        let mut alone = Rasterizer::new(cfg);
        let expected: Vec<Vec<u32>> = shots
            .iter()
            .map(|(scene, poses, view)| {
                let mut frame = Frame::new(view.width, view.height, Channels::ALL);
                alone.render(scene, poses, view, &mut frame).unwrap();
                bits(&frame)
            })
            .collect();
        for threads in [1, 2, 3, 8] {
            let mut parallel = ParallelRasterizer::new(cfg, threads);
            for count in [1, 2, 3, 5, 9] {
                let mut frames: Vec<_> =
                    shots[..count].iter().map(|(_, _, v)| Frame::new(v.width, v.height, Channels::ALL)).collect();
                let mut jobs: Vec<_> = shots[..count]
                    .iter()
                    .zip(&mut frames)
                    .map(|((scene, poses, view), frame)| {
                        (Shot { scene, poses, view, lights: None, lens: None, before: None }, frame.as_mut())
                    })
                    .collect();
                parallel.render(&mut jobs).unwrap();
                for (k, frame) in frames.iter().enumerate() {
                    assert!(bits(frame) == expected[k], "{threads} threads, shot {k} of {count}, {samples} samples");
                }
            }
        }
    }
}

#[test]
fn shots_that_cannot_be_drawn_do_not_stop_the_others() {
    let (scene, poses, view) = large(1, [333, 251]);
    for (threads, count) in [(1, 3), (2, 3), (4, 3), (2, 5), (2, 9)] {
        let mut frames = vec![Frame::new(333, 251, Channels { mask: true, ..Channels::default() }); count];
        let mut jobs: Vec<(Shot<'_>, FrameMut<'_>)> = frames
            .iter_mut()
            .map(|frame| {
                (
                    Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None },
                    frame.as_mut(),
                )
            })
            .collect();
        for k in [1, count - 1] {
            jobs[k].0.poses = &[];
        }
        let (index, _) = ParallelRasterizer::new(RasterCfg::default(), threads).render(&mut jobs).unwrap_err();
        assert_eq!(index, 1);
        for (k, frame) in frames.iter().enumerate() {
            let drawn = frame.mask.iter().flatten().any(|&m| m != 0);
            assert_eq!(drawn, k != 1 && k != count - 1, "shot {k} of {count}, {threads} threads");
        }
    }
}
