//! A recorded video in Chromium.

use super::browser;
use kinetoscope::prelude::*;
use kinetoscope::record::RecorderCfg;
use kinetoscope_testkit::worlds::{camera, cfg, cube, sim};
use serde_json::json;

const SIZE: [usize; 2] = [64, 48];
const FRAMES: u32 = 6;
/// Steps of 10 ms between two frames.
const STEPS_PER_FRAME: u32 = 5;

/// Bound of the mean square error of luma. H.264 quantizes coefficients of an orthonormal transform, each with an error
/// below the quantization step of 4 (Parseval: as is the mean square error of the pixels). Rounding luma to 8 bits adds 0.5,
/// and rounding the browser's pixels adds 0.5 again.
const LUMA_ERROR: f64 = 5.0 * 5.0;

/// Luma by ITU-R BT.709, 8 bits, limited range, without rounding, of each pixel with `channels` bytes.
fn luma(pixels: &[u8], channels: usize) -> Vec<f64> {
    let of = |p: &[u8]| 0.2126 * f64::from(p[0]) + 0.7152 * f64::from(p[1]) + 0.0722 * f64::from(p[2]);
    pixels.chunks(channels).map(|pixel| 16.0 + 219.0 / 255.0 * of(pixel)).collect()
}

fn mean_square_error(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    found.iter().zip(expected).map(|(found, expected)| (found - expected).powi(2)).sum::<f64>() / found.len() as f64
}

/// Chromium plays a recorded MP4 to its end, and shows each frame of the camera.
#[test]
#[ignore = "needs Chromium: cargo xtask test"]
fn video() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.mp4");
    let mut sim = sim(cfg(1, 1));
    let red = [0.9, 0.05, 0.05, 1.0];
    sim.add_rigid_object(RigidObjectCfg { rgba: red, ..cube("cube", 0.4, 1.0, [0.0, 0.0, 0.7]) }).unwrap();
    let eye = camera(SIZE, [1.4, 0.5, 0.8], [0.0, 0.0, 0.3], Channels { color: true, ..Channels::NONE });
    let eye = sim.add_sensor("eye", CameraCfg { update_period: 0.05, ..eye }).unwrap();
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    let mut expected = Vec::new();
    for _ in 0..FRAMES {
        sim.update(STEPS_PER_FRAME);
        let color = sim.sensor(eye).unwrap().color().unwrap();
        expected.push(luma(&color.iter().copied().collect::<Vec<u8>>(), color.dim().3));
    }
    sim.finish_recording(recorder).unwrap();

    // The script of a page may not read the pixels of a video from another file.
    let bytes = json!(std::fs::read(&path).unwrap());
    let [width, height] = SIZE;
    let page = format!(
        "<!doctype html><p id='link'></p><video id='film' muted></video>
        <canvas id='stage' width='{width}' height='{height}'></canvas>
        <script>film.src = URL.createObjectURL(new Blob([new Uint8Array({bytes})], {{ type: 'video/mp4' }}));</script>"
    );
    let file = folder.path().join("film.html");
    std::fs::write(&file, page).unwrap();
    let browser = browser();
    let mut tab = browser.open(&format!("file://{}", file.display()));
    let played = tab.evaluate(
        "(async () => {
            const film = $('film');
            const ended = new Promise((end, fail) => { film.onended = end; film.onerror = () => fail(film.error.message); });
            await film.play();
            await ended;
            return [film.videoWidth, film.videoHeight, Math.round(1000 * film.duration), film.currentTime === film.duration];
        })()",
    );
    assert_eq!(played, json!([width, height, 50 * FRAMES, true]));
    for k in 0..FRAMES {
        let shown = tab.evaluate(&format!(
            "(async () => {{
                const film = $('film');
                const there = new Promise((end) => {{ film.onseeked = end; }});
                film.currentTime = {};
                await there;
                $('stage').getContext('2d').drawImage(film, 0, 0);
                return [...pixels('stage').bytes];
            }})()",
            0.05 * (f64::from(k) + 0.5)
        ));
        let shown: Vec<u8> = serde_json::from_value(shown).unwrap();
        let found = luma(&shown, 4);
        for (other, expected) in (0..).zip(&expected) {
            let error = mean_square_error(&found, expected);
            // Control: other frames are not within the bound.
            assert_eq!(error < LUMA_ERROR, other == k, "frame {k} as {other}: {error}");
        }
    }
    assert_eq!(tab.console_errors(), Vec::<String>::new());
}
