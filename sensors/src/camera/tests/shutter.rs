//! Rolling shutters and motion blur against closed forms.

use super::super::lens::Equidistant;
use super::super::{Aperture, Before, Camera, CameraCfg, CameraError, Channels, Frame, Opened, RasterCfg, Rasterizer};
use super::super::{LensRays, Optics, ParallelRasterizer, PixelIntrinsics, Renderer, Shot, Shutter, Take};
use super::determinism::bits;
use super::stage::{DT, SIZE, ball, built, cfg, context, state};
use crate::error::SensorError;
use crate::sensor::{Sensor, SensorCfg};
use crate::visibility::{RenderError, View};
use scene::shape::Box;
use scene::{Headlight, Hemisphere, Instance, Material, PoseF32, RenderScene, Sky};

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

/// A glowing bar across all rows, in the dark; a camera at the origin looks along x, so that the picture's right is -y.
fn bar() -> (RenderScene, View) {
    let glow = Material { emission: 1.0, specular: 0.0, ..Material::from_rgba([0.6, 0.6, 0.6, 1.0]) };
    let mut scene = RenderScene::new(vec![Instance::new(Box { half: [THIN, HALF, 5.0] }, glow, 3)]).unwrap();
    scene.lights.clear();
    scene.headlight = Headlight { active: false, ..Headlight::default() };
    scene.ambient = Hemisphere { sky: [0.0; 3], ground: [0.0; 3] };
    scene.sky = Sky::uniform([0.0; 3]);
    let view = View::look_at([WIDTH, HEIGHT], 0.5, [0.; 3], [1., 0., 0.], [0., 0., 1.]).unwrap();
    (scene, View { fx: F, fy: F, ..view })
}

/// The bar, its front at the depth, `right` metres to the right.
fn bar_at(right: f32) -> [PoseF32; 1] {
    [PoseF32::from_translation([DEPTH + THIN, -right, 0.0])]
}

fn tracer(samples: u32, shutter: Shutter) -> Rasterizer {
    let mut rasterizer = Rasterizer::new(RasterCfg { samples: 1, lod: false, ..RasterCfg::default() });
    rasterizer.renderer = Renderer::RayTraced { samples, max_bounces: 0, denoise: false, seed: 5 };
    rasterizer.shutter = shutter;
    rasterizer
}

/// Of each row: where the light of a picture is in the middle, and its variance \[pixels\].
fn rows(frame: &Frame) -> Vec<(f64, f64)> {
    let linear = |byte: u8| f64::from(scene::material::decode_srgb(f32::from(byte) / 255.0));
    let row = |row: &[u8]| {
        let light: Vec<f64> = row.chunks(4).map(|p| linear(p[1])).collect();
        let sum: f64 = light.iter().sum();
        let mean = light.iter().zip(0..).map(|(l, x)| l * (f64::from(x) + 0.5)).sum::<f64>() / sum;
        let var = light.iter().zip(0..).map(|(l, x)| l * (f64::from(x) + 0.5 - mean).powi(2)).sum::<f64>() / sum;
        (mean, var)
    };
    frame.color.as_ref().unwrap().chunks(4 * WIDTH).map(row).collect()
}

/// The bar goes right at v; row r is read (H - 1 - r) t before the last: there it is v (H - 1 - r) t f / z pixels farther left.
#[test]
fn a_moving_bar_is_sheared_by_its_speed_times_the_time_of_a_row() {
    let (scene, view) = bar();
    let (speed, row_time, before) = (3.0f64, 0.004, 0.2);
    let shutter = Shutter { row_time, exposure_time: 0.0 };
    let channels = Channels { color: true, mask: true, depth: true, position: true, ..Channels::default() };
    let (now, then) = (bar_at(0.3), bar_at((0.3 - speed * before) as f32));
    let still = view.world_from_camera;
    // As if the bar stood, and the camera went left.
    let (stands, beside) = (bar_at(0.3), PoseF32 { translation: [0.0, -(speed * before) as f32, 0.0], ..still });
    for (poses, opened, camera) in [(&now, &then, still), (&stands, &stands, beside)] {
        let mut frame = Frame::new(WIDTH, HEIGHT, channels);
        let shot = Shot { scene: &scene, poses, view: &view, lights: None, lens: None, before: None };
        let take = Take { noise: 0, opened: Some(Opened { poses: opened, world_from_camera: camera, before }) };
        tracer(64, shutter).render_take(&shot, &take, &mut frame.as_mut()).unwrap();
        let pixels = f64::from(F) / f64::from(DEPTH);
        let (side, mut slopes) = (2.0 * f64::from(HALF) * pixels, Vec::new());
        for (r, (mean, var)) in rows(&frame).into_iter().enumerate() {
            let late = (HEIGHT - 1 - r) as f64 * row_time;
            let middle = 0.5 * WIDTH as f64 + (0.3 - speed * late) * pixels;
            // 64 samples in each pixel, which are as even as a net: at each edge less than an eighth of a pixel times one of
            // its side's; bytes are steps of 1/255 of the whole, of pixels that are partly lit.
            assert!((mean - middle).abs() < 0.05, "row {r}: {mean}, not {middle}");
            assert!((var - side * side / 12.0 - 1.0 / 12.0).abs() < 0.2, "row {r}: {var}");
            slopes.push(mean);
            // What the pixels' centres see, at the same instant.
            for x in 0..WIDTH {
                let off = (x as f64 + 0.5 - middle).abs() - 0.5 * side;
                let mask = frame.mask.as_ref().unwrap()[r * WIDTH + x];
                assert!(off.abs() < 0.01 || mask == if off < 0.0 { 3 } else { 0 }, "row {r}, column {x}: {off}");
                let depth = frame.depth.as_ref().unwrap()[r * WIDTH + x];
                assert!(mask == 0 || (depth - DEPTH).abs() < 1e-4, "{depth}");
            }
        }
        let slope = (slopes[HEIGHT - 1] - slopes[0]) / (HEIGHT - 1) as f64;
        assert!((slope - speed * row_time * pixels).abs() < 0.002, "{slope} pixels a row");
    }
}

/// Behind a lens too each row sees the bar where it is at that row's instant: the ray of the pixel (u, v) of an equidistant lens
/// is r / f from the axis, r from the principal point, and meets the plane of the bar at z tan(r / f).
#[test]
fn rows_behind_a_lens_see_their_own_instant() {
    let (scene, view) = bar();
    let (speed, row_time, before, f) = (3.0f64, 0.004, 0.2, 30.0);
    let shutter = Shutter { row_time, exposure_time: 0.0 };
    let channels = Channels { color: true, mask: true, depth: true, ..Channels::default() };
    let (now, then) = (bar_at(0.3), bar_at((0.3 - speed * before) as f32));
    let [cx, cy] = [WIDTH, HEIGHT].map(|side| 0.5 * side as f64);
    let pixels = PixelIntrinsics { fx: f, fy: f, cx, cy };
    let rays = LensRays::new(&Optics::new(Equidistant::default().into(), pixels).unwrap(), [WIDTH, HEIGHT], 1).unwrap();
    let mut frame = Frame::new(WIDTH, HEIGHT, channels);
    let view = View { fx: f as f32, fy: f as f32, ..view };
    let shot = Shot { scene: &scene, poses: &now, view: &view, lights: None, lens: Some(&rays), before: None };
    let opened = Some(Opened { poses: &then, world_from_camera: view.world_from_camera, before });
    tracer(16, shutter).render_take(&shot, &Take { noise: 0, opened }, &mut frame.as_mut()).unwrap();
    let (mask, depth, color) = (frame.mask.unwrap(), frame.depth.unwrap(), frame.color.unwrap());
    // Whether the bar is at a point of the picture at an instant, and how many pixels from its edge, about.
    let at = |u: f64, v: f64, late: f64| {
        let r = (u - cx).hypot(v - cy);
        let right = f64::from(DEPTH) * (r / f).tan() * (u - cx) / r;
        let off = (right - (0.3 - speed * late)).abs() - f64::from(HALF);
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
        assert_eq!(mask[k], if inside { 3 } else { 0 }, "({x}, {y}): {edge}");
        assert!(!inside || (depth[k] - DEPTH).abs() < 1e-4, "{}", depth[k]);
        seen += usize::from(inside);
        // The control: with the bar where it is at the stamp most rows would be wrong.
        of_the_stamp += usize::from(inside != at(u, v, 0.0).0);
        // Paths of a pixel go through its square, half of a pixel to each side of its middle.
        if edge > 1.0 {
            assert_eq!(color[4 * k] > 0, inside, "({x}, {y}): {:?}", &color[4 * k..4 * k + 4]);
        }
    }
    assert!(seen > 80 && of_the_stamp > 80, "{seen} {of_the_stamp}");
}

/// With the exposure e the bar is blurred: its variance is (v e f / z)² / 12 more, and its middle half of that behind.
#[test]
fn exposure_blurs_what_moves_and_nothing_else() {
    let (scene, view) = bar();
    let (speed, exposure_time, before) = (3.0f64, 0.1, 0.1);
    let (now, then) = (bar_at(0.2), bar_at((0.2 - speed * before) as f32));
    let shot = |poses| Shot { scene: &scene, poses, view: &view, lights: None, lens: None, before: None };
    let opened = |poses| Some(Opened { poses, world_from_camera: view.world_from_camera, before });
    let shutter = Shutter { row_time: 0.0, exposure_time };
    let channels = Channels { color: true, mask: true, ..Channels::default() };
    let mut frame = Frame::new(WIDTH, HEIGHT, channels);
    let mut rasterizer = tracer(256, shutter);
    rasterizer.render_take(&shot(&now), &Take { noise: 0, opened: opened(&then) }, &mut frame.as_mut()).unwrap();
    let pixels = f64::from(F) / f64::from(DEPTH);
    let (side, way) = (2.0 * f64::from(HALF) * pixels, speed * exposure_time * pixels);
    let all = rows(&frame);
    let mean_of = |f: &dyn Fn(&(f64, f64)) -> f64| all.iter().map(f).sum::<f64>() / HEIGHT as f64;
    let (mean, var) = (mean_of(&|row| row.0), mean_of(&|row| row.1));
    // 256 samples a pixel and 40 rows of about 16 pixels: 1.6e5 places, of which x² scatters as much as it is large.
    let middle = 0.5 * WIDTH as f64 + 0.2 * pixels - 0.5 * way;
    assert!((mean - middle).abs() < 0.05, "{mean}, not {middle}");
    let expected = way * way / 12.0 + side * side / 12.0 + 1.0 / 12.0;
    assert!((var - expected).abs() < 0.02 * expected, "{var}, not {expected}");
    assert!(way * way / 12.0 > 0.5 * expected, "the control: most of it is blur");
    // What the centres see is in the middle of the exposure.
    let hits = frame.mask.as_ref().unwrap()[..WIDTH].iter().zip(0..).filter(|(mask, _)| **mask == 3);
    let places: Vec<f64> = hits.map(|(_, x)| f64::from(x) + 0.5).collect();
    assert!((places.iter().sum::<f64>() / places.len() as f64 - middle).abs() < 0.5);
    // What stands still is as it is with an instant, to the bit, and so is what moves.
    let mut draw = |shutter, poses, opened| {
        let mut frame = Frame::new(WIDTH, HEIGHT, Channels { flow: false, ..Channels::ALL });
        rasterizer.shutter = shutter;
        rasterizer.render_take(&shot(poses), &Take { noise: 0, opened }, &mut frame.as_mut()).unwrap();
        bits(&frame)
    };
    let instant = draw(Shutter::default(), &now, None);
    assert!(draw(shutter, &now, opened(&now)) == instant);
    assert!(draw(Shutter::default(), &now, opened(&then)) == instant);
    assert!(draw(shutter, &now, opened(&then)) != instant);
}

#[test]
fn other_renderers_say_what_to_use() {
    let (scene, view) = bar();
    let poses = bar_at(0.0);
    let aperture = Some(Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 });
    let slow = Shutter { row_time: 1e-4, exposure_time: 0.0 };
    let what =
        [(aperture, Shutter::default(), "an aperture (depth of field)"), (None, slow, "a shutter that takes time")];
    for (aperture, shutter, what) in what {
        for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced] {
            let mut rasterizer = Rasterizer { renderer, aperture, shutter, ..Rasterizer::default() };
            let mut frame = Frame::new(WIDTH, HEIGHT, Channels { mask: true, ..Channels::default() });
            let error = rasterizer.render(&scene, &poses, &view, &mut frame).unwrap_err();
            let RenderError::NeedsPaths { what: said, .. } = &error else { panic!("{error}") };
            assert!(*said == what && error.to_string().contains("use renderer: RayTraced"), "{error}");
            let error = CameraCfg { renderer, aperture, shutter, ..cfg() }.build(&context(1)).unwrap_err();
            assert!(matches!(error, SensorError::Camera(CameraError::View(RenderError::NeedsPaths { .. }))), "{error}");
        }
    }
}

#[test]
fn apertures_and_shutters_that_no_camera_has_are_refused() {
    let good = Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 };
    let of = |aperture| CameraCfg { renderer: PATHS, aperture: Some(aperture), ..cfg() };
    for (bad, field) in [
        (Aperture { focal_length: 0.0, ..good }, "focal_length"),
        (Aperture { focal_length: f64::INFINITY, ..good }, "focal_length"),
        (Aperture { f_number: -1.0, ..good }, "f_number"),
        (Aperture { f_number: f64::NAN, ..good }, "f_number"),
        (Aperture { f_number: 1e-300, ..good }, "f_number"),
        (Aperture { focus_distance: 0.05, ..good }, "focus_distance"),
        (Aperture { focus_distance: f64::NAN, ..good }, "focus_distance"),
    ] {
        let error = of(bad).build(&context(1)).unwrap_err();
        let SensorError::Camera(CameraError::View(RenderError::Aperture { what, .. })) = error else {
            panic!("{error}")
        };
        assert_eq!(what, field);
    }
    assert!(of(good).build(&context(1)).is_ok());
    for shutter in [
        Shutter { row_time: -1e-3, exposure_time: 0.0 },
        Shutter { row_time: f64::NAN, exposure_time: 0.0 },
        Shutter { row_time: 0.0, exposure_time: f64::INFINITY },
    ] {
        let error = CameraCfg { shutter, renderer: PATHS, ..cfg() }.build(&context(1)).unwrap_err();
        assert!(matches!(error, SensorError::Camera(CameraError::View(RenderError::Shutter { .. }))), "{error}");
    }
    // A picture every 4 steps, which takes 5.
    let slow = Shutter { row_time: 0.0, exposure_time: 4.5 * DT };
    let error = CameraCfg { shutter: slow, renderer: PATHS, update_period: 4.0 * DT, ..cfg() }.build(&context(1));
    let expected = CameraError::ShutterTooSlow { span: 4.5 * DT, period: 4.0 * DT };
    assert_eq!(error.unwrap_err(), expected.into());
    let flow = Channels { flow: true, ..Channels::NONE };
    let quick = Shutter { row_time: 1e-5, exposure_time: 0.0 };
    let both = CameraCfg { channels: flow, shutter: quick, renderer: PATHS, ..cfg() };
    assert_eq!(both.build(&context(1)).unwrap_err(), CameraError::FlowOfRows.into());
    // Where things were must be known from long enough ago.
    let (scene, view) = bar();
    let poses = bar_at(0.0);
    let shot = Shot { scene: &scene, poses: &poses, view: &view, lights: None, lens: None, before: None };
    let mut frame = Frame::new(WIDTH, HEIGHT, Channels { color: true, ..Channels::default() });
    let mut rasterizer = tracer(1, Shutter { row_time: 0.01, exposure_time: 0.0 });
    let mut with = |opened| rasterizer.render_take(&shot, &Take { noise: 0, opened }, &mut frame.as_mut());
    let good = Opened { poses: &poses, world_from_camera: view.world_from_camera, before: 0.4 };
    assert_eq!(with(Some(good)), Ok(()));
    let span = 0.01 * (HEIGHT - 1) as f64;
    assert_eq!(with(Some(Opened { before: 0.3, ..good })), Err(RenderError::Opened { before: 0.3, span }));
    assert_eq!(with(Some(Opened { poses: &[], ..good })), Err(RenderError::PoseCount { expected: 1, found: 0 }));
}

const PATHS: Renderer = Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: false, seed: 3 };
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

/// What the renderer draws of the stage in environment `env` at step `step`, whose shutter opened at `opened`; all channels
/// but the colour, whose noise is the camera's own.
fn expected(camera: &Camera, env: usize, step: u64, opened: Option<u64>) -> Vec<u32> {
    let scene = context(1).scene.unwrap();
    let poses = |step| [PoseF32::IDENTITY, PoseF32::from_translation(ball(env, step).map(|x| x as f32))];
    let (now, then) = (poses(step), opened.map(poses));
    let view = camera.view(env).unwrap();
    let before = opened.map_or(0.0, |opened| (step - opened) as f64 * DT);
    let world_from_camera = view.world_from_camera;
    let opened = then.as_ref().map(|poses| Opened { poses, world_from_camera, before });
    let mut frame = Frame::new(SIZE[0], SIZE[1], Channels { color: false, flow: false, ..Channels::ALL });
    let mut rasterizer = Rasterizer { renderer: PATHS, shutter: rolling().shutter, ..Rasterizer::default() };
    let shot = Shot { scene: &scene, poses: &now, view: &view, lights: None, lens: None, before: None };
    rasterizer.render_take(&shot, &Take { noise: 0, opened }, &mut frame.as_mut()).unwrap();
    frame
        .position
        .unwrap()
        .into_iter()
        .map(f32::to_bits)
        .chain(frame.mask.unwrap().into_iter().map(|x| x as u32))
        .collect()
}

fn shown(camera: &Camera, row: usize) -> Vec<u32> {
    let axis = ndarray::Axis(0);
    let position =
        camera.position().unwrap().index_axis_move(axis, row).iter().map(|x| x.to_bits()).collect::<Vec<_>>();
    position.into_iter().chain(camera.mask().unwrap().index_axis_move(axis, row).iter().map(|&x| x as u32)).collect()
}

/// Cameras ask to be woken when the shutter opens, remember where things were, and are still after a reset or a refresh.
#[test]
fn cameras_remember_where_things_were_when_the_shutter_opened() {
    let mut camera = built(&rolling(), &context(2));
    assert!(shown(&camera, 0) == expected(&camera, 0, 0, None), "after a reset nothing moved");
    let mut step = 0;
    let mut woken = Vec::new();
    while step < 3 * PERIOD {
        let wait = camera.due_in(&[step, step]);
        step += wait;
        woken.push(step);
        camera.update(&state(&[step, step])).unwrap();
        let due = step.is_multiple_of(PERIOD);
        for env in 0..2 {
            let last = step - step % PERIOD;
            assert!(shown(&camera, env) == expected(&camera, env, last, last.checked_sub(3)), "step {step}");
        }
        // A control: it is not the picture of the instant.
        assert!(!due || shown(&camera, 0) != expected(&camera, 0, step, None));
        assert_eq!(camera.frame_counts()[0], step / PERIOD);
    }
    // Three steps before, which are the next more than two and a half.
    assert_eq!(woken, [2, 5, 7, 10, 12, 15]);
    // An update at every step is the same.
    let mut often = built(&rolling(), &context(2));
    for step in 1..=3 * PERIOD {
        often.update(&state(&[step, step])).unwrap();
    }
    assert!((0..2).all(|row| super::stage::bits(&often, [row]) == super::stage::bits(&camera, [row])));
    // Somebody writes while the shutter is open: what is there then is all that the picture shows to move from.
    camera.update(&state(&[17, 17])).unwrap();
    camera.refresh(&[1], &state(&[17, 30])).unwrap();
    assert!(shown(&camera, 1) == expected(&camera, 1, 30, None));
    let mut late = state(&[20, 20]);
    late.visible.as_mut().unwrap().instance_poses[(1, 1)] = PoseF32::from_translation(ball(1, 30).map(|x| x as f32));
    camera.update(&late).unwrap();
    assert!(shown(&camera, 1) == expected(&camera, 1, 30, None), "it stands there since it was put there");
    assert!(shown(&camera, 0) == expected(&camera, 0, 20, Some(17)));
    // A reset closes the shutter.
    camera.update(&state(&[22, 22])).unwrap();
    camera.reset(&[0], &state(&[0, 22])).unwrap();
    assert!(shown(&camera, 0) == expected(&camera, 0, 0, None));
}

/// Pictures that come late, and the history, are those that come at once; a cable as long as three pictures.
#[test]
fn late_pictures_have_their_own_opening() {
    let late = CameraCfg { latency_steps: 2 * PERIOD as u32 + 1, history_length: 2, ..rolling() };
    let (mut late, mut prompt) = (built(&late, &context(1)), built(&rolling(), &context(1)));
    let mut old = Vec::new();
    for step in 1..=5 * PERIOD + 1 {
        prompt.update(&state(&[step])).unwrap();
        late.update(&state(&[step])).unwrap();
        if step.is_multiple_of(PERIOD) {
            old.push(super::stage::bits(&prompt, [0]));
        }
    }
    assert!(super::stage::bits(&late, [0]) == old[2]);
    let history = late.history::<super::super::channel::Mask>().unwrap();
    let newest: Vec<i32> = history.index_axis(ndarray::Axis(1), 0).iter().copied().collect();
    assert_eq!(newest, late.mask().unwrap().iter().copied().collect::<Vec<_>>());
}

/// Noise of paths is another one in each environment and picture, and the same in any batch and for any number of threads.
#[test]
fn paths_have_noise_of_their_own_in_every_picture() {
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
    let cfg = CameraCfg {
        renderer: PATHS,
        channels: Channels { color: true, ..Channels::default() },
        raster: RasterCfg { groups: u32::MAX, ..RasterCfg::default() },
        ..cfg()
    };
    let pictures = |cfg: &CameraCfg, context: &crate::sensor::SensorContext| {
        let mut camera = cfg.build(context).unwrap();
        let envs: Vec<usize> = (0..context.num_envs).collect();
        camera.reset(&envs, &at(envs.len(), 0)).unwrap();
        let mut all = vec![camera.color().unwrap().to_owned()];
        for step in 1..3 {
            camera.update(&at(envs.len(), step)).unwrap();
            all.push(camera.color().unwrap().to_owned());
        }
        all
    };
    let three = pictures(&cfg, &context(3));
    let view = |pictures: &[ndarray::Array4<u8>], step: usize, env: usize| {
        pictures[step].index_axis(ndarray::Axis(0), env).to_owned()
    };
    assert!(view(&three, 0, 0) != view(&three, 1, 0), "another picture");
    assert!(view(&three, 1, 0) != view(&three, 1, 1), "another environment");
    // Environment 2 alone, as a part of a larger batch, with more threads.
    let part = crate::sensor::SensorContext { first_env: 2, threads: 3, ..context(1) };
    let alone = pictures(&cfg, &part);
    assert!((0..3).all(|step| view(&alone, step, 0) == view(&three, step, 2)));
    // Controls: other seeds, of the simulation or the renderer, have other noise.
    let seeded = crate::sensor::SensorContext { seed: 9, ..context(3) };
    assert!(view(&pictures(&cfg, &seeded), 1, 0) != view(&three, 1, 0));
    let other =
        CameraCfg { renderer: Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: false, seed: 4 }, ..cfg };
    assert!(view(&pictures(&other, &context(3)), 1, 0) != view(&three, 1, 0));
}

/// Any number of threads draws the same rows.
#[test]
fn rolling_pictures_have_the_same_bits_for_any_number_of_threads() {
    let (scene, view) = bar();
    let (now, then) = (bar_at(0.3), bar_at(-0.3));
    let world_from_camera = PoseF32 { translation: [0.01, 0.0, 0.02], ..view.world_from_camera };
    let shot = Shot {
        scene: &scene,
        poses: &now,
        view: &view,
        lights: None,
        lens: None,
        before: Some(Before { poses: &then, view: &view }),
    };
    let take = Take { noise: 7, opened: Some(Opened { poses: &then, world_from_camera, before: 0.2 }) };
    let shutter = Shutter { row_time: 0.004, exposure_time: 0.01 };
    let aperture = Some(Aperture { focal_length: 0.05, f_number: 1.4, focus_distance: 1.5 });
    let draw = |threads| {
        let mut parallel = ParallelRasterizer::new(RasterCfg::default(), threads);
        parallel.set_renderer(Renderer::RayTraced { samples: 4, max_bounces: 1, denoise: true, seed: 0 });
        parallel.set_light(aperture, shutter);
        let mut frame = Frame::new(WIDTH, HEIGHT, Channels::ALL);
        parallel.render_takes(&mut [(shot, frame.as_mut())], &[take]).unwrap();
        bits(&frame)
    };
    let one = draw(1);
    assert!(draw(2) == one && draw(3) == one);
}
