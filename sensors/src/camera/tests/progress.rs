//! Progress and cancellation of long renders.

use super::test_scene::{built, cfg, context, state};
use crate::camera::{CameraCfg, CameraError};
use crate::sensor::{Sensor, SensorCfg};
use kinetoscope_render::RenderError;
use kinetoscope_render::frame::Channels;
use kinetoscope_render::frame::Color;
use kinetoscope_render::{RenderProgress, Renderer};
use kinetoscope_scene::Marker;

fn paths(samples: u32) -> Renderer {
    Renderer::RayTraced { samples, max_bounces: 2, denoise: true, seed: 0 }
}

#[test]
fn cameras() {
    fn shared<T: Send + Sync + Clone + 'static>(_: &T) {}
    let mut camera = built(&CameraCfg { renderer: paths(2), ..cfg() }, &context(1));
    let progress: RenderProgress = camera.progress().clone();
    shared(&progress);
    progress.cancel();
    let total = 2 * (cfg().width * cfg().height) as u64;
    let expected = CameraError::Render { env: 0, error: RenderError::Canceled { samples: 0, total } };
    assert_eq!(camera.color().unwrap_err(), expected.into());
    progress.resume();
    // A canceled image is rendered by the next reader.
    let fresh = built(&CameraCfg { renderer: paths(2), ..cfg() }, &context(1));
    assert_eq!((camera.color().unwrap(), progress.samples()), (fresh.color().unwrap(), total));
    // Control: an image that cannot be rendered is tried once.
    let draws = camera.render_count();
    let mut state = state(&[1]);
    state.visible.as_mut().unwrap().instance_poses[(0, 1)].translation[0] = f32::NAN;
    camera.update(&state).unwrap();
    assert!(camera.color().is_err() && camera.color().is_err());
    assert_eq!(camera.render_count(), draws + 1);
}

/// Canceled images in flight and images of the history are rendered at the next read.
#[test]
fn late_and_past() {
    let cfg = CameraCfg { renderer: paths(2), latency_steps: 2, history_length: 2, ..cfg() };
    let run = |cancelled: bool| {
        let mut camera = built(&cfg, &context(1));
        (1..=3).for_each(|step| camera.update(&state(&[step])).unwrap());
        // After a write, the shown image is not the latest delivered one.
        camera.refresh(&[0], &state(&[3])).unwrap();
        assert!(camera.color().is_ok() && camera.latest_delivered_stamps() != camera.stamps());
        if cancelled {
            camera.progress().cancel();
            for _ in 0..2 {
                assert!(camera.latest_delivered::<Color>().unwrap_err().to_string().contains("rendering was canceled"));
                assert!(camera.history::<Color>().unwrap_err().to_string().contains("rendering was canceled"));
            }
            camera.progress().resume();
        }
        let (arrived, past) =
            (camera.latest_delivered::<Color>().unwrap().to_owned(), camera.history::<Color>().unwrap());
        let drawn = camera.render_count();
        assert_eq!(
            (camera.latest_delivered::<Color>().unwrap(), camera.render_count()),
            (arrived.view(), drawn),
            "rendered once"
        );
        (arrived, past.to_owned())
    };
    assert_eq!(run(true), run(false));
}

/// An image with markers is rendered twice: without its color, which needs no path tracing, and the color with the
/// markers. Root cause: the markers were counted after the others, starting from 0 again.
#[test]
fn markers() {
    let channels = Channels { mask: true, color: true, ..Channels::default() };
    let mut shown = state(&[0, 0]);
    shown.markers = Some(vec![vec![Marker::sphere([0.0, 0.0, 0.9], 0.2, [0.0, 1.0, 0.0, 1.0])], Vec::new()]);
    let [(color, mask), (plain, plain_mask)] = [true, false].map(|draw_markers| {
        let cfg = CameraCfg { renderer: paths(2), draw_markers, channels, ..cfg() };
        let mut camera = cfg.build(&context(2)).unwrap();
        camera.reset(&[0, 1], &shown).unwrap();
        let images = (camera.color().unwrap().to_owned(), camera.mask().unwrap().to_owned());
        let total = 2 * 2 * (cfg.width * cfg.height) as u64;
        assert_eq!((camera.progress().samples(), camera.progress().total()), (total, total));
        images
    });
    let envs = ndarray::Axis(0);
    assert_ne!(color.index_axis(envs, 0), plain.index_axis(envs, 0), "the marker is seen");
    assert_eq!(color.index_axis(envs, 1), plain.index_axis(envs, 1));
    assert_eq!(mask, plain_mask, "and measured nowhere");
}
