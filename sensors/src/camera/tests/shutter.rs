//! Rolling shutters and motion blur, against closed forms.

use super::super::{Aperture, Camera, CameraCfg, CameraError, Channels, PixelIntrinsics, RasterCfg, Renderer, Shutter};
use super::harness::{Image, Still, linear, matt, things, unlit};
use super::lenses::rays_of;
use super::stage::{DT, SIZE, ball, bits, built, cfg, context, state};
use crate::error::SensorError;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use kinetoscope_render::frame::Mask;
use kinetoscope_render::lens::Equidistant;
use kinetoscope_render::visibility::{RenderError, View};
use kinetoscope_scene::shape::Box;
use kinetoscope_scene::{Material, PoseF32, RenderScene, Sky};
use ndarray::Axis;

const HEIGHT: usize = 40;
const WIDTH: usize = 64;
/// \[pixels\].
const F: f32 = 80.0;
/// Depth of the bar's front \[m\].
const DEPTH: f32 = 2.0;
/// Half its width \[m\].
const HALF: f32 = 0.1;

/// Half its thickness \[m\]: its sides are less than a hundredth of a pixel.
const THIN: f32 = 0.0005;

/// A glowing bar across all rows, in the dark; a camera at the origin looks along x, so that the image's right is -y.
pub(super) fn bar() -> (RenderScene, View) {
    let glow = Material { emission: 1.0, ..matt([0.6; 3]) };
    let mut scene = unlit(things([(Box { half: [THIN, HALF, 5.0] }, glow, PoseF32::IDENTITY)]).0);
    scene.sky = Sky::uniform([0.0; 3]);
    let view = View::look_at([WIDTH, HEIGHT], 0.5, [0.; 3], [1., 0., 0.], [0., 0., 1.]).unwrap();
    (scene, View { fx: F, fy: F, ..view })
}

/// The bar, its front at the depth, `right` metres to the right.
pub(super) fn bar_at(right: f64) -> Vec<PoseF32> {
    vec![PoseF32::from_translation([DEPTH + THIN, -right as f32, 0.0])]
}

/// The bar goes right \[m/s\].
const SPEED: f64 = 3.0;

/// The bar `right` metres to the right, by paths of one sample at the pixel's centre for all other channels; the shutter opened
/// `before` seconds ago.
fn tracer(samples: u32, shutter: Shutter, right: f64, before: f64) -> Still {
    let (scene, view) = bar();
    Still {
        cfg: RasterCfg { samples: 1, lod: false, ..RasterCfg::default() },
        renderer: Renderer::RayTraced { samples, max_bounces: 0, denoise: false, seed: 5 },
        channels: Channels { flow: false, ..Channels::ALL },
        shutter,
        opened: Some((bar_at(right - SPEED * before), view.world_from_camera, before)),
        ..Still::new((scene, bar_at(right)), view)
    }
}

/// Of each row: the middle of the light, and its variance \[pixels\].
fn rows(image: &Image) -> Vec<(f64, f64)> {
    let row = |row: &[[u8; 4]]| {
        let light: Vec<f64> = row.iter().map(|p| linear(f32::from(p[1]) / 255.0)).collect();
        let sum: f64 = light.iter().sum();
        let mean = light.iter().zip(0..).map(|(l, x)| l * (f64::from(x) + 0.5)).sum::<f64>() / sum;
        let var = light.iter().zip(0..).map(|(l, x)| l * (f64::from(x) + 0.5 - mean).powi(2)).sum::<f64>() / sum;
        (mean, var)
    };
    image.color().chunks(WIDTH).map(row).collect()
}

/// The bar goes right at v; row r is read (H - 1 - r) t before the last: there it is v (H - 1 - r) t f / z pixels farther left.
#[test]
fn shear() {
    let (row_time, before) = (0.004, 0.2);
    let moving = tracer(64, Shutter { row_time, exposure_time: 0.0 }, 0.3, before);
    // As if the bar stood, and the camera went left.
    let mut camera_moves = moving.clone();
    let left = [0.0, -(SPEED * before) as f32, 0.0];
    camera_moves.opened = Some((bar_at(0.3), PoseF32 { translation: left, ..moving.view.world_from_camera }, before));
    for image in [moving.draw(), camera_moves.draw()] {
        let pixels = f64::from(F) / f64::from(DEPTH);
        let (side, all) = (2.0 * f64::from(HALF) * pixels, rows(&image));
        for (r, (mean, var)) in all.iter().enumerate() {
            let late = (HEIGHT - 1 - r) as f64 * row_time;
            let middle = 0.5 * WIDTH as f64 + (0.3 - SPEED * late) * pixels;
            // 64 samples in each pixel, which are as even as a net: at each edge less than an eighth of a pixel times one of
            // its side's; bytes are steps of 1/255 of the whole, of pixels that are partly lit.
            assert!((mean - middle).abs() < 0.05, "row {r}: {mean}, not {middle}");
            assert!((var - side * side / 12.0 - 1.0 / 12.0).abs() < 0.2, "row {r}: {var}");
            // The pixels' centres, at the same instant.
            for x in 0..WIDTH {
                let off = (x as f64 + 0.5 - middle).abs() - 0.5 * side;
                let (mask, depth) = (image.mask()[r * WIDTH + x], image.depth()[r * WIDTH + x]);
                assert!(off.abs() < 0.01 || mask == i32::from(off < 0.0), "row {r}, column {x}: {off}");
                assert!(mask == 0 || (depth - DEPTH).abs() < 1e-4, "{depth}");
            }
        }
        let slope = (all[HEIGHT - 1].0 - all[0].0) / (HEIGHT - 1) as f64;
        assert!((slope - SPEED * row_time * pixels).abs() < 0.002, "{slope} pixels a row");
    }
}

/// Behind a lens too each row sees the bar where it is at that row's instant: the ray of the pixel (u, v) of an equidistant lens
/// is r / f from the axis, r from the principal point, and meets the plane of the bar at z tan(r / f).
#[test]
fn lens_rows() {
    let (row_time, f) = (0.004, 30.0);
    let mut still = tracer(16, Shutter { row_time, exposure_time: 0.0 }, 0.3, 0.2);
    let [cx, cy] = [WIDTH, HEIGHT].map(|side| 0.5 * side as f64);
    let pixels = PixelIntrinsics { fx: f, fy: f, cx, cy };
    still.lens = Some(rays_of(Equidistant::default().into(), pixels, [WIDTH, HEIGHT]));
    (still.view.fx, still.view.fy) = (f as f32, f as f32);
    let image = still.draw();
    // True inside of the bar at an instant, and the distance from its edge \[pixels\], about.
    let at = |u: f64, v: f64, late: f64| {
        let r = (u - cx).hypot(v - cy);
        let right = f64::from(DEPTH) * (r / f).tan() * (u - cx) / r;
        let off = (right - (0.3 - SPEED * late)).abs() - f64::from(HALF);
        // A pixel beside it is this much of the plane or more.
        (off < 0.0, off.abs() * f / f64::from(DEPTH))
    };
    let (mut seen, mut of_the_stamp) = (0, 0);
    for (y, x) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (y, x))) {
        let (u, v, k) = (x as f64 + 0.5, y as f64 + 0.5, y * WIDTH + x);
        let (inside, edge) = at(u, v, (HEIGHT - 1 - y) as f64 * row_time);
        if edge < 0.01 {
            continue;
        }
        assert_eq!(image.mask()[k], i32::from(inside), "({x}, {y}): {edge}");
        assert!(!inside || (image.depth()[k] - DEPTH).abs() < 1e-4, "({x}, {y}): {}", image.depth()[k]);
        seen += usize::from(inside);
        // The control: with the bar where it is at the stamp most rows would be wrong.
        of_the_stamp += usize::from(inside != at(u, v, 0.0).0);
        // Paths of a pixel go through its square, half of a pixel to each side of its middle.
        if edge > 1.0 {
            assert_eq!(image.color()[k][0] > 0, inside, "({x}, {y}): {:?}", image.color()[k]);
        }
    }
    assert!(seen > 80 && of_the_stamp > 80, "{seen} {of_the_stamp}");
}

/// With the exposure e the bar is blurred: its variance is (v e f / z)² / 12 more, and its middle half of that behind.
#[test]
fn blur() {
    let exposure_time = 0.1;
    let still = tracer(256, Shutter { row_time: 0.0, exposure_time }, 0.2, 0.1);
    let image = still.draw();
    let pixels = f64::from(F) / f64::from(DEPTH);
    let (side, way) = (2.0 * f64::from(HALF) * pixels, SPEED * exposure_time * pixels);
    let (mean, var) = rows(&image).iter().fold((0.0, 0.0), |sum, row| (sum.0 + row.0, sum.1 + row.1));
    let [mean, var] = [mean, var].map(|sum| sum / HEIGHT as f64);
    // 256 samples a pixel and 40 rows of about 16 pixels: 1.6e5 places, of which x² scatters as much as it is large.
    let middle = 0.5 * WIDTH as f64 + 0.2 * pixels - 0.5 * way;
    assert!((mean - middle).abs() < 0.05, "{mean}, not {middle}");
    let expected = way * way / 12.0 + side * side / 12.0 + 1.0 / 12.0;
    assert!((var - expected).abs() < 0.02 * expected, "{var}, not {expected}");
    assert!(way * way / 12.0 > 0.5 * expected, "the control: most of it is blur");
    // The centres see the middle of the exposure.
    let hits = image.mask()[..WIDTH].iter().zip(0..).filter(|(mask, _)| **mask == 1);
    let places: Vec<f64> = hits.map(|(_, x)| f64::from(x) + 0.5).collect();
    assert!((places.iter().sum::<f64>() / places.len() as f64 - middle).abs() < 0.5);
    // Things that stand still are as with an instant, to the bit, and so is everything with an instant.
    let now = Some((still.poses.clone(), still.view.world_from_camera, 0.1));
    let of = |shutter, opened: &Option<_>| Still { shutter, opened: opened.clone(), ..still.clone() }.draw().bits();
    let instant = of(Shutter::default(), &None);
    assert!(of(still.shutter, &now) == instant && of(Shutter::default(), &still.opened) == instant);
    assert!(of(still.shutter, &still.opened) != instant);
}

const PATHS: Renderer = Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: false, seed: 3 };

#[test]
fn refusals() {
    let view_error = |cfg: CameraCfg| match cfg.build(&context(1)).unwrap_err() {
        SensorError::Camera(CameraError::View(error)) => error,
        error => panic!("{error}"),
    };
    // Renderers without paths say which one to use.
    let good = Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 };
    let slow = Shutter { row_time: 1e-4, exposure_time: 0.0 };
    for (aperture, shutter, expected) in
        [(Some(good), Shutter::default(), "an aperture (depth of field)"), (None, slow, "a shutter that takes time")]
    {
        for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced] {
            let still = Still { renderer, aperture, shutter, opened: None, ..tracer(1, slow, 0.0, 0.0) };
            let error = still.try_draw().unwrap_err();
            assert!(matches!(&error, RenderError::NeedsPaths { what, .. } if *what == expected), "{error}");
            assert!(error.to_string().contains("use renderer: RayTraced"), "{error}");
            let error = view_error(CameraCfg { renderer, aperture, shutter, ..cfg() });
            assert!(matches!(error, RenderError::NeedsPaths { .. }), "{error}");
        }
    }
    let of = |aperture| CameraCfg { renderer: PATHS, aperture: Some(aperture), ..cfg() };
    assert!(of(good).build(&context(1)).is_ok());
    for (bad, field) in [
        (Aperture { focal_length: 0.0, ..good }, "focal_length"),
        (Aperture { focal_length: f64::INFINITY, ..good }, "focal_length"),
        (Aperture { f_number: -1.0, ..good }, "f_number"),
        (Aperture { f_number: f64::NAN, ..good }, "f_number"),
        (Aperture { f_number: 1e-300, ..good }, "f_number"),
        (Aperture { focus_distance: 0.05, ..good }, "focus_distance"),
        (Aperture { focus_distance: f64::NAN, ..good }, "focus_distance"),
    ] {
        let error = view_error(of(bad));
        assert!(matches!(error, RenderError::Aperture { what, .. } if what == field), "{field}: {error}");
    }
    for (row_time, exposure_time) in [(-1e-3, 0.0), (f64::NAN, 0.0), (0.0, f64::INFINITY)] {
        let shutter = Shutter { row_time, exposure_time };
        let error = view_error(CameraCfg { shutter, renderer: PATHS, ..cfg() });
        assert!(matches!(error, RenderError::Shutter { .. }), "{error}");
    }
    // A frame every 4 steps, which takes 5.
    let shutter = Shutter { row_time: 0.0, exposure_time: 4.5 * DT };
    let error = CameraCfg { shutter, renderer: PATHS, update_period: 4.0 * DT, ..cfg() }.build(&context(1));
    assert_eq!(error.unwrap_err(), CameraError::ShutterTooSlow { span: 4.5 * DT, period: 4.0 * DT }.into());
    let channels = Channels { flow: true, ..Channels::NONE };
    let error = CameraCfg { channels, shutter: slow, renderer: PATHS, ..cfg() }.build(&context(1));
    assert_eq!(error.unwrap_err(), CameraError::FlowOfRows.into());
    // Poses must be known from long enough ago.
    let shutter = Shutter { row_time: 0.01, exposure_time: 0.0 };
    let with = |before, poses| {
        let mut still = tracer(1, shutter, 0.0, before);
        still.opened.as_mut().unwrap().0 = poses;
        still.try_draw().map(drop)
    };
    assert_eq!(with(0.4, bar_at(0.0)), Ok(()));
    let span = 0.01 * (HEIGHT - 1) as f64;
    assert_eq!(with(0.3, bar_at(0.0)), Err(RenderError::Opened { before: 0.3, span }));
    assert_eq!(with(0.4, vec![]), Err(RenderError::PoseCount { expected: 1, found: 0 }));
}

const PERIOD: u64 = 5;

/// A camera whose shutter is open for two and a half steps.
fn rolling() -> CameraCfg {
    let row_time = 2.0 * DT / (SIZE[1] - 1) as f64;
    CameraCfg {
        renderer: PATHS,
        shutter: Shutter { row_time, exposure_time: 0.5 * DT },
        update_period: PERIOD as f64 * DT,
        raster: RasterCfg { groups: u32::MAX, ..RasterCfg::default() },
        ..cfg()
    }
}

/// Asserts that a camera shows, in environment `env`, what the renderer draws of the stage at step `step` with the shutter open
/// since step `opened`; all channels but the colour, whose noise is the camera's own.
#[track_caller]
fn assert_shown(camera: &Camera, env: usize, step: u64, opened: Option<u64>) {
    assert!(shown(camera, env) == expected(camera, env, step, opened), "environment {env}, step {step}, {opened:?}");
}

fn expected(camera: &Camera, env: usize, step: u64, opened: Option<u64>) -> Vec<u32> {
    let poses = |step| vec![PoseF32::IDENTITY, PoseF32::from_translation(ball(env, step).map(|x| x as f32))];
    let view = camera.view(env).unwrap();
    let opened = opened.map(|opened| (poses(opened), view.world_from_camera, (step - opened) as f64 * DT));
    let channels = Channels { mask: true, position: true, ..Channels::NONE };
    let scene = (*context(1).scene.unwrap()).clone();
    let still = Still { shutter: rolling().shutter, opened, channels, ..Still::new((scene, poses(step)), view) };
    still.by(PATHS).bits()
}

fn shown(camera: &Camera, row: usize) -> Vec<u32> {
    let mask = camera.mask().unwrap().index_axis_move(Axis(0), row);
    let position = camera.position().unwrap().index_axis_move(Axis(0), row);
    mask.iter().map(|&x| x as u32).chain(position.iter().map(|x| x.to_bits())).collect()
}

/// Cameras ask to be woken when the shutter opens, remember poses of then, and are still after a reset or a refresh.
#[test]
fn wake_ups() {
    let mut camera = built(&rolling(), &context(2));
    // After a reset nothing moved.
    assert_shown(&camera, 0, 0, None);
    let (mut step, mut woken) = (0, Vec::new());
    while step < 3 * PERIOD {
        step += camera.due_in(&[step, step]);
        woken.push(step);
        camera.update(&state(&[step, step])).unwrap();
        let last = step - step % PERIOD;
        (0..2).for_each(|env| assert_shown(&camera, env, last, last.checked_sub(3)));
        // A control: it is not the image of the instant.
        assert!(step != last || shown(&camera, 0) != expected(&camera, 0, step, None));
        assert_eq!(camera.frame_counts()[0], step / PERIOD);
    }
    // Three steps before, which are the next more than two and a half.
    assert_eq!(woken, [2, 5, 7, 10, 12, 15]);
    // An update at every step is the same.
    let mut often = built(&rolling(), &context(2));
    (1..=3 * PERIOD).for_each(|step| often.update(&state(&[step, step])).unwrap());
    assert!(bits(&often, 0..2) == bits(&camera, 0..2));
    // A write while the shutter is open: the frame shows motion from there only.
    camera.update(&state(&[17, 17])).unwrap();
    camera.refresh(&[1], &state(&[17, 30])).unwrap();
    assert_shown(&camera, 1, 30, None);
    let mut late = state(&[20, 20]);
    late.visible.as_mut().unwrap().instance_poses[(1, 1)] = PoseF32::from_translation(ball(1, 30).map(|x| x as f32));
    camera.update(&late).unwrap();
    // It stands there since it was put there.
    assert_shown(&camera, 1, 30, None);
    assert_shown(&camera, 0, 20, Some(17));
    // A reset closes the shutter.
    camera.update(&state(&[22, 22])).unwrap();
    camera.reset(&[0], &state(&[0, 22])).unwrap();
    assert_shown(&camera, 0, 0, None);
}

/// Frames that come late, and the history, are those that come at once; a latency of three frames.
#[test]
fn latency() {
    let late = CameraCfg { latency_steps: 2 * PERIOD as u32 + 1, history_length: 2, ..rolling() };
    let (mut late, mut prompt) = (built(&late, &context(1)), built(&rolling(), &context(1)));
    let mut old = Vec::new();
    for step in 1..=5 * PERIOD + 1 {
        prompt.update(&state(&[step])).unwrap();
        late.update(&state(&[step])).unwrap();
        if step.is_multiple_of(PERIOD) {
            old.push(bits(&prompt, [0]));
        }
    }
    assert!(bits(&late, [0]) == old[2]);
    assert_eq!(late.history::<Mask>().unwrap().index_axis(Axis(1), 0), late.mask().unwrap());
}

/// Noise of paths is another one in each environment and frame, and the same in any batch and for any number of threads.
#[test]
fn noise_keys() {
    // The same things in all environments.
    let at = |envs: usize, step: u64| {
        let mut state = state(&vec![step; envs]);
        let visible = state.visible.as_mut().unwrap();
        for env in 0..envs {
            visible.instance_poses[(env, 1)] = PoseF32::from_translation([0.0, 0.0, 0.5]);
            visible.lights[(env, 0)].direction = [0.0, 0.3, -1.0];
        }
        state
    };
    let raster = RasterCfg { groups: u32::MAX, ..RasterCfg::default() };
    let channels = Channels { color: true, ..Channels::default() };
    let cfg = CameraCfg { renderer: PATHS, channels, raster, ..cfg() };
    // By step and environment.
    let images = |cfg: &CameraCfg, context: &SensorContext| {
        let mut camera = cfg.build(context).unwrap();
        let envs: Vec<usize> = (0..context.num_envs).collect();
        camera.reset(&envs, &at(envs.len(), 0)).unwrap();
        let mut all = vec![camera.color().unwrap().to_owned()];
        for step in 1..3 {
            camera.update(&at(envs.len(), step)).unwrap();
            all.push(camera.color().unwrap().to_owned());
        }
        let of = |images: &ndarray::Array4<u8>| images.outer_iter().map(|image| image.to_owned()).collect::<Vec<_>>();
        all.iter().map(of).collect::<Vec<_>>()
    };
    let three = images(&cfg, &context(3));
    assert!(three[0][0] != three[1][0] && three[1][0] != three[1][1], "other frames and environments");
    // Environment 2 alone, as a part of a larger batch, with more threads.
    let alone = images(&cfg, &SensorContext { first_env: 2, threads: 3, ..context(1) });
    assert!((0..3).all(|step| alone[step][0] == three[step][2]));
    // Controls: other seeds, of the simulation or the renderer, have other noise.
    assert!(images(&cfg, &SensorContext { seed: 9, ..context(3) })[1][0] != three[1][0]);
    let renderer = Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: false, seed: 4 };
    assert!(images(&CameraCfg { renderer, ..cfg }, &context(3))[1][0] != three[1][0]);
}
