//! Rolling shutters and motion blur, against closed forms.

use super::super::{Camera, CameraCfg, CameraError};
use super::test_scene::{DT, SIZE, ball, bits, built, cfg, context, state};
use crate::error::SensorError;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use kinetoscope_render::RenderError;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::frame::Mask;
use kinetoscope_render::{Aperture, RasterCfg, Renderer, Shutter, ShutterOpenState};
use kinetoscope_scene::PoseF32;
use ndarray::Axis;

const PATHS: Renderer = Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: false, seed: 3 };

#[test]
fn refusals() {
    let view_error = |cfg: CameraCfg| match cfg.build(&context(1)).unwrap_err() {
        SensorError::Camera(CameraError::View(error)) => error,
        error => panic!("{error}"),
    };
    // Renderers without path tracing name the renderer to use.
    let good = Aperture { focal_length: 0.05, f_number: 2.0, focus_distance: 2.0 };
    let slow = Shutter { row_time: 1e-4, exposure_time: 0.0 };
    for (aperture, shutter) in [(Some(good), Shutter::default()), (None, slow)] {
        for renderer in [Renderer::Raster, Renderer::Hybrid, Renderer::FastRayTraced] {
            let error = view_error(CameraCfg { renderer, aperture, shutter, ..cfg() });
            assert!(matches!(error, RenderError::NeedsPathTracing { .. }), "{error}");
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
    // A frame every 4 steps, whose exposure takes 5.
    let shutter = Shutter { row_time: 0.0, exposure_time: 4.5 * DT };
    let error = CameraCfg { shutter, renderer: PATHS, update_period: 4.0 * DT, ..cfg() }.build(&context(1));
    assert_eq!(error.unwrap_err(), CameraError::ShutterTooSlow { span: 4.5 * DT, period: 4.0 * DT }.into());
    let channels = Channels { flow: true, ..Channels::NONE };
    let error = CameraCfg { channels, shutter: slow, renderer: PATHS, ..cfg() }.build(&context(1));
    assert_eq!(error.unwrap_err(), CameraError::FlowWithShutterSpan.into());
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

/// Asserts that a camera shows, in environment `env`, the render of the test scene at step `step` with the shutter open
/// since step `opened`. Compares all channels except color, whose noise depends on the camera.
#[track_caller]
fn assert_shown(camera: &Camera, env: usize, step: u64, opened: Option<u64>) {
    assert!(shown(camera, env) == expected(camera, env, step, opened), "environment {env}, step {step}, {opened:?}");
}

fn expected(camera: &Camera, env: usize, step: u64, opened: Option<u64>) -> Vec<u32> {
    let poses = |step| vec![PoseF32::IDENTITY, PoseF32::from_translation(ball(env, step).map(|x| x as f32))];
    let view = camera.view(env).unwrap();
    let opened = opened.map(|opened| (poses(opened), view.world_from_camera, (step - opened) as f64 * DT));
    let opened = opened.as_ref();
    let opened =
        opened.map(|(poses, camera, before)| ShutterOpenState { poses, world_from_camera: *camera, age: *before });
    let channels = Channels { mask: true, position: true, ..Channels::NONE };
    let by = (PATHS, rolling().shutter);
    let (scene, poses) = (context(1).scene.unwrap(), poses(step));
    let frame = super::test_scene::frame_of(RasterCfg::default(), by, channels, (&scene, &poses, &view), opened);
    let mask = frame.mask.unwrap().into_iter().map(|x| x as u32);
    mask.chain(frame.position.unwrap().into_iter().map(f32::to_bits)).collect()
}

fn shown(camera: &Camera, row: usize) -> Vec<u32> {
    let mask = camera.mask().unwrap().index_axis_move(Axis(0), row);
    let position = camera.position().unwrap().index_axis_move(Axis(0), row);
    mask.iter().map(|&x| x as u32).chain(position.iter().map(|x| x.to_bits())).collect()
}

/// Cameras request an update when the shutter opens, store the poses of that instant, and show one instant after a
/// reset or refresh.
#[test]
fn wake_ups() {
    let mut camera = built(&rolling(), &context(2));
    // After a reset, no motion is shown.
    assert_shown(&camera, 0, 0, None);
    let (mut step, mut woken) = (0, Vec::new());
    while step < 3 * PERIOD {
        step += camera.due_in(&[step, step]);
        woken.push(step);
        camera.update(&state(&[step, step])).unwrap();
        let last = step - step % PERIOD;
        (0..2).for_each(|env| assert_shown(&camera, env, last, last.checked_sub(3)));
        // Control: the image differs from that of the instant.
        assert!(step != last || shown(&camera, 0) != expected(&camera, 0, step, None));
        assert_eq!(camera.frame_counts()[0], step / PERIOD);
    }
    // The shutter opens three steps earlier, two and a half rounded up.
    assert_eq!(woken, [2, 5, 7, 10, 12, 15]);
    // An update at every step gives the same images.
    let mut often = built(&rolling(), &context(2));
    (1..=3 * PERIOD).for_each(|step| often.update(&state(&[step, step])).unwrap());
    assert!(bits(&often, 0..2) == bits(&camera, 0..2));
    // A write while the shutter is open: the frame shows only the motion since then.
    camera.update(&state(&[17, 17])).unwrap();
    camera.refresh(&[1], &state(&[17, 30])).unwrap();
    assert_shown(&camera, 1, 30, None);
    let mut late = state(&[20, 20]);
    late.visible.as_mut().unwrap().instance_poses[(1, 1)] = PoseF32::from_translation(ball(1, 30).map(|x| x as f32));
    camera.update(&late).unwrap();
    // The written pose counts since the shutter opened.
    assert_shown(&camera, 1, 30, None);
    assert_shown(&camera, 0, 20, Some(17));
    // A reset closes the shutter.
    camera.update(&state(&[22, 22])).unwrap();
    camera.reset(&[0], &state(&[0, 22])).unwrap();
    assert_shown(&camera, 0, 0, None);
}

/// Late frames and the history equal frames without latency; the latency is three frames.
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

/// Path tracing noise differs between environments and frames, and is the same for any batch and any number of threads.
#[test]
fn noise_keys() {
    // The same state in all environments.
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
    // Images by step and environment.
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
    // Controls: other seeds of the simulation or of the renderer give other noise.
    assert!(images(&cfg, &SensorContext { seed: 9, ..context(3) })[1][0] != three[1][0]);
    let renderer = Renderer::RayTraced { samples: 2, max_bounces: 1, denoise: false, seed: 4 };
    assert!(images(&CameraCfg { renderer, ..cfg }, &context(3))[1][0] != three[1][0]);
}
