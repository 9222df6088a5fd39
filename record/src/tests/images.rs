//! Folders of pictures, and animations.

use super::readers::{python, said};
use ndarray::Axis;
use super::*;
use std::path::Path;

const STEPS: u32 = 4 * PICTURE_EVERY;

/// Records, and keeps colour and depth of environment 1.
fn recorded(cfg: RecorderCfg) -> (Recorded, Vec<Vec<u8>>, Vec<Vec<f32>>) {
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(cfg).unwrap();
    let (mut colors, mut depths) = (Vec::new(), Vec::new());
    for step in 0..STEPS {
        world.step(step);
        if (step + 1) % PICTURE_EVERY == 0 {
            let camera = world.sim.sensor(world.camera).unwrap();
            let color = camera.color().unwrap().index_axis(Axis(0), 1).to_owned();
            colors.push(color.rows().into_iter().flat_map(|p| [p[0], p[1], p[2]]).collect());
            depths.push(camera.depth().unwrap().index_axis(Axis(0), 1).iter().copied().collect());
        }
    }
    (world.sim.finish_recording(recorder).unwrap(), colors, depths)
}

fn png(path: &Path) -> image::DynamicImage {
    image::open(path).unwrap()
}

#[test]
fn a_folder_has_every_picture_to_the_last_bit_and_depth_to_the_millimetre() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pictures");
    let (_, colors, depths) = recorded(RecorderCfg::new(&path));
    for env in ["env_0", "env_1"] {
        assert_eq!(std::fs::read_dir(path.join("camera/color").join(env)).unwrap().count(), colors.len());
        assert_eq!(std::fs::read_dir(path.join("camera/depth").join(env)).unwrap().count(), depths.len());
    }
    let mut seen = 0;
    for (k, (color, depth)) in colors.iter().zip(&depths).enumerate() {
        let picture = png(&path.join(format!("camera/color/env_1/{k:06}.png")));
        assert_eq!(picture.to_rgb8().as_raw(), color);
        let picture = png(&path.join(format!("camera/depth/env_1/{k:06}.png")));
        for (found, depth) in picture.as_luma16().unwrap().iter().zip(depth) {
            let metres = f32::from(*found) / 1000.0;
            // Half a millimetre of rounding, and that of f32 at some metres.
            let same = if depth.is_finite() { (metres - depth).abs() < 0.000_501 } else { *found == 0 };
            assert!(same, "{found} mm for {depth} m");
            seen += u32::from(depth.is_finite());
        }
    }
    assert!(seen > 100, "the camera sees something in {seen} pixels");
    assert!(!path.join("camera/mask").exists(), "a mask is not a picture that people look at");
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn pillow_reads_every_picture() {
    let python = python();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pictures");
    let (_, colors, depths) = recorded(RecorderCfg::new(&path));
    let found = said(&python, "read_pictures.py", &path);
    let weighed = |numbers: &mut dyn Iterator<Item = u64>| numbers.zip(1..).map(|(x, k)| x * k).sum::<u64>();
    for (k, (color, depth)) in colors.iter().zip(&depths).enumerate() {
        let step = u64::from(PICTURE_EVERY) * (k as u64 + 1);
        let sum = weighed(&mut color.iter().map(|byte| u64::from(*byte)));
        let of = |channel: &str| &found[format!("camera/{channel}/env_1/{k:06}.png")];
        assert_eq!(*of("color"), serde_json::json!(["RGB", [32, 24], sum, step]));
        // A miss is 0; half a millimetre rounds away from it.
        let mm = |depth: &f32| if depth.is_finite() { (depth * 1000.0).round() as u64 } else { 0 };
        let sum = weighed(&mut depth.iter().map(mm));
        let told = of("depth");
        assert!(["I;16", "I"].contains(&told[0].as_str().unwrap()), "{told}");
        assert_eq!((&told[1], &told[3]), (&serde_json::json!([32, 24]), &serde_json::json!(step)));
        assert_eq!(told[2].as_u64(), Some(sum));
    }
}

#[test]
fn a_folder_is_whole_when_it_has_its_name_and_nothing_old_is_in_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("pictures");
    let part = folder.path().join("pictures.part");
    let (was, ..) = recorded(RecorderCfg::new(&path));
    // Masks are asked for with the rest of the camera, and have no place.
    let mut world = World::new(2, 1);
    let cfg = RecorderCfg::new(&path).with_topics([Topic::Sensor("camera".into())]);
    let error = world.sim.record(cfg.clone()).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    let recorder = world.sim.record(RecorderCfg { overwrite: true, ..cfg.clone() }).unwrap();
    assert!(matches!(world.sim.record(RecorderCfg { overwrite: true, ..cfg }), Err(RecordError::Busy { .. })));
    (0..PICTURE_EVERY).for_each(|step| world.step(step));
    world.sim.observer_mut(recorder).unwrap().catch_up();
    assert!(path.join("camera/color/env_0/000003.png").exists() && part.join("camera/color/env_0/000000.png").exists());
    let time = world.sim.time()[1];
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert!(was.left_out.is_empty() && recorded.left_out.iter().any(|what| what.contains("camera/mask")), "{recorded}");
    assert!(
        !part.exists() && !path.join("camera/color/env_0/000001.png").exists(),
        "one picture, none of the four before"
    );
    let times = std::fs::read_to_string(path.join("times.csv")).unwrap();
    let lines: Vec<&str> = times.lines().collect();
    assert_eq!((lines.len(), lines[0]), (5, "picture,step,time,recorded_time"));
    let line = format!("\"camera/color/env_1/000000.png\",{PICTURE_EVERY},{time},{time}");
    assert!(lines.contains(&line.as_str()), "{times}");
    // A folder that is no recorder's is not replaced, whatever is allowed.
    let mine = folder.path().join("mine");
    std::fs::create_dir(&mine).unwrap();
    std::fs::write(mine.join("one"), "precious").unwrap();
    let cfg = RecorderCfg { overwrite: true, ..RecorderCfg::new(&mine) };
    assert!(matches!(world.sim.record(cfg), Err(RecordError::Exists { .. })));
    assert!(mine.join("one").exists());
}

/// Formats that show one camera in one environment.
fn animations() -> impl Iterator<Item = (Format, &'static str)> {
    Format::all().filter(|(format, _)| format.is_animation())
}

/// What an animation is expected to be, beside its frames.
fn check_animation(end: &str, frame: &serde_json::Value, color: &[u8]) {
    let bytes = |plane: &str| -> Vec<u8> {
        let hex = frame[plane].as_str().unwrap();
        (0..hex.len()).step_by(2).map(|k| u8::from_str_radix(&hex[k..k + 2], 16).unwrap()).collect()
    };
    let pixels = color.as_chunks::<3>().0;
    match end {
        "apng" | "webp" => assert_eq!(bytes("rgb"), color, "{end}: without loss"),
        "gif" => {
            let known: std::collections::BTreeSet<_> = pixels.iter().collect();
            assert!(known.len() <= 256, "{} colours", known.len());
            assert_eq!(bytes("rgb"), color, "so many are a palette");
        }
        "mp4" => {
            // ITU-R BT.709, 8 bits, limited range: half of rounding, and what is left of constants in 65536ths.
            let close = |found: u8, wanted: f64| assert!((f64::from(found) - wanted).abs() < 0.52, "{found} {wanted}");
            let luma = |[r, g, b]: [f64; 3]| 0.2126 * r + 0.7152 * g + 0.0722 * b;
            let scaled = |p: &[u8; 3]| [p[0], p[1], p[2]].map(|x| f64::from(x) / 255.0);
            for (found, pixel) in bytes("y").into_iter().zip(pixels) {
                close(found, 16.0 + 219.0 * luma(scaled(pixel)));
            }
            let width = usize::try_from(frame["size"][0].as_u64().unwrap()).unwrap();
            for (k, (blue, red)) in bytes("u").into_iter().zip(bytes("v")).enumerate() {
                let (x, y) = (2 * (k % (width / 2)), 2 * (k / (width / 2)));
                let four = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(dy, dx)| scaled(&pixels[(y + dy) * width + x + dx]));
                let mean = [0, 1, 2].map(|c| four.iter().map(|p| p[c]).sum::<f64>() / 4.0);
                close(blue, 128.0 + 224.0 * (mean[2] - luma(mean)) / 1.8556);
                close(red, 128.0 + 224.0 * (mean[0] - luma(mean)) / 1.5748);
            }
            assert_eq!(bytes("y").len(), pixels.len());
            assert_eq!(bytes("u").len(), pixels.len() / 4);
            assert_eq!(frame["colour"], serde_json::json!([1, 13, 1, "tv"]));
        }
        _ => panic!("{end}: say what its frames should be"),
    }
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn an_animation_has_every_frame_at_its_time() {
    let python = python();
    for (_, end) in animations() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("run.{end}"));
        let cfg = RecorderCfg { envs: Some(vec![EnvId(1)]), ..RecorderCfg::new(&path) };
        let (recorded, colors, _) = recorded(cfg);
        assert_eq!(recorded.bytes, path.metadata().unwrap().len());
        let found = said(&python, "read_animation.py", &path);
        let frames = found["frames"].as_array().unwrap();
        assert_eq!(frames.len(), colors.len(), "{end}");
        for (k, (frame, color)) in frames.iter().zip(&colors).enumerate() {
            // Five steps of 10 ms.
            assert_eq!((&frame["from"], &frame["until"]), (&(50 * k).into(), &(50 * (k + 1)).into()), "{end}: {k}");
            check_animation(end, frame, color);
        }
        assert_ne!(colors[0], colors[3], "something moves");
    }
}

#[test]
fn an_animation_shows_one_camera_in_one_environment() {
    for (format, end) in animations() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("run.{end}"));
        let cfg = RecorderCfg::new(&path).with_topics([Topic::Sensor("camera".into())]);
        let error = World::new(2, 1).sim.record(cfg).unwrap_err();
        assert!(matches!(&error, RecordError::TooMany { .. }), "{error}");
        assert!(error.to_string().contains("camera/color in 2 environments"), "{error}");
        // Without a topic, the first of each is taken.
        let mut world = World::new(2, 1);
        let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
        let streams: Vec<_> =
            world.sim.observer(recorder).unwrap().streams().map(|s| (s.name.clone(), s.env_ids.clone())).collect();
        assert_eq!(streams, [("camera/color".to_string(), vec![0])]);
        // A recording without a frame is no file.
        let error = world.sim.finish_recording(recorder).unwrap_err().to_string();
        assert!(error.contains("no frame"), "{}: {error}", format.name());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}

#[test]
fn pictures_that_a_format_does_not_have_are_said_at_the_start() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = World::new(1, 1);
    let odd = CameraCfg { width: 33, height: 24, ..CameraCfg::default() };
    world.sim.add_sensor("odd", odd).unwrap();
    let cfg = |end| RecorderCfg::new(folder.path().join(end)).with_topics([Topic::channel("odd", "color")]);
    let error = world.sim.record(cfg("run.mp4")).unwrap_err();
    assert!(matches!(error, RecordError::Size { width: 33, height: 24, .. }), "{error}");
    assert!(error.to_string().contains("run.mp4") && error.to_string().contains("even numbers"), "{error}");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing was begun");
    let recorder = world.sim.record(cfg("run.webp")).unwrap();
    (0..PICTURE_EVERY).for_each(|step| world.step(step));
    world.sim.finish_recording(recorder).unwrap();
}
