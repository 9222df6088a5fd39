//! Folders of images, animations and overview images.

use super::*;

const STEPS: u32 = 4 * IMAGE_EVERY;

/// Records, and returns color and depth of environment 1.
fn recorded(cfg: RecorderCfg) -> (RecordingSummary, Vec<Vec<u8>>, Vec<Vec<f32>>) {
    let mut world = World::new(2, 2);
    let recorder = world.sim.record(cfg).unwrap();
    let (mut colors, mut depths) = (Vec::new(), Vec::new());
    for step in 0..STEPS {
        world.step(step);
        if (step + 1) % IMAGE_EVERY == 0 {
            let camera = world.sim.sensor(world.camera).unwrap();
            colors.push(rgb(&camera.color().unwrap().index_axis(Axis(0), 1).to_owned()));
            depths.push(camera.depth().unwrap().index_axis(Axis(0), 1).iter().copied().collect());
        }
    }
    (world.sim.finish_recording(recorder).unwrap(), colors, depths)
}

/// A folder has every color image bit by bit, and depth to the millimeter.
#[test]
fn folder() {
    let (_folder, path) = scratch("images");
    let (_, colors, depths) = recorded(RecorderCfg::new(&path));
    for (channel, env) in [("color", 0), ("color", 1), ("depth", 0), ("depth", 1)] {
        assert_eq!(names(path.join(format!("camera/{channel}/env_{env}"))).len(), colors.len(), "{channel} {env}");
    }
    let image = |channel: &str, k: usize| image::open(path.join(format!("camera/{channel}/env_1/{k:06}.png"))).unwrap();
    let mut seen = 0;
    for (k, (color, depth)) in colors.iter().zip(&depths).enumerate() {
        assert_eq!(image("color", k).to_rgb8().as_raw(), color);
        for (found, depth) in image("depth", k).as_luma16().unwrap().iter().zip(depth) {
            let meters = f32::from(*found) / 1000.0;
            // Half a millimeter of rounding, and the rounding of f32 at some meters.
            let same = if depth.is_finite() { (meters - depth).abs() < 0.000_501 } else { *found == 0 };
            assert!(same, "{found} mm for {depth} m");
            seen += u32::from(depth.is_finite());
        }
    }
    assert!(seen > 100, "the camera sees something in {seen} pixels");
    assert!(!path.join("camera/mask").exists(), "a mask is no image to look at");
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn folder_by_pillow() {
    let (_folder, path) = scratch("images");
    let (_, colors, depths) = recorded(RecorderCfg::new(&path));
    let found = script_output("read_pictures.py", &path);
    for (k, (color, depth)) in colors.iter().zip(&depths).enumerate() {
        let step = u64::from(IMAGE_EVERY) * (k as u64 + 1);
        let of = |channel: &str| &found[format!("camera/{channel}/env_1/{k:06}.png")];
        assert_eq!(*of("color"), json!(["RGB", [32, 24], weighted_sum(color, |byte| u64::from(*byte)), step]));
        // A miss is 0; half a millimeter rounds away from zero.
        let mm = |depth: &f32| if depth.is_finite() { (depth * 1000.0).round() as u64 } else { 0 };
        let [mode, size, sum, at] = &list(of("depth"))[..] else { panic!("{}", of("depth")) };
        assert!(["I;16", "I"].contains(&mode.as_str().unwrap()), "{mode}");
        assert_eq!((size, at, sum), (&json!([32, 24]), &json!(step), &json!(weighted_sum(depth, mm))));
    }
}

/// A folder gets its name when it is complete, and keeps nothing of the folder that it replaces.
#[test]
fn overwritten_folder() {
    let (folder, path) = scratch("images");
    let part = folder.path().join("images.part");
    let (was, ..) = recorded(RecorderCfg::new(&path));
    // The topic includes masks, which the format does not support.
    let mut world = World::new(2, 1);
    let cfg = RecorderCfg::new(&path).with_topics([Topic::Sensor("camera".into())]);
    let error = world.sim.record(cfg.clone()).unwrap_err();
    assert!(matches!(error, RecordError::Exists { .. }), "{error}");
    let recorder = world.sim.record(overwriting(cfg.clone())).unwrap();
    assert!(matches!(world.sim.record(overwriting(cfg)), Err(RecordError::Busy { .. })));
    (0..IMAGE_EVERY).for_each(|step| world.step(step));
    world.sim.observers_mut().get_mut(recorder).unwrap().wait_until_written();
    assert!(path.join("camera/color/env_0/000003.png").exists() && part.join("camera/color/env_0/000000.png").exists());
    let time = world.sim.time()[1];
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert!(was.left_out.is_empty() && recorded.left_out.iter().any(|what| what.contains("camera/mask")), "{recorded}");
    assert!(!part.exists());
    assert_eq!(names(path.join("camera/color/env_0")), ["000000.png"], "one image, none of the four before");
    let times = std::fs::read_to_string(path.join("times.csv")).unwrap();
    let lines: Vec<&str> = times.lines().collect();
    assert_eq!((lines.len(), lines[0]), (5, "picture,step,time,recorded_time"));
    let line = format!("\"camera/color/env_1/000000.png\",{IMAGE_EVERY},{time},{time}");
    assert!(lines.contains(&line.as_str()), "{times}");
}

/// Formats that show one camera in one environment.
fn animations() -> impl Iterator<Item = (Format, &'static str)> {
    Format::all().filter(|(format, _)| format.is_animation())
}

/// Weights of red and blue in the luma of ITU-R BT.709 and of BT.601.
pub(crate) const BT709: [f64; 2] = [0.2126, 0.0722];
pub(crate) const BT601: [f64; 2] = [0.299, 0.114];

/// Bound of the mean square error of a plane. H.264 quantizes coefficients of an orthonormal transform, each with an
/// error below the quantization step of 4 (Parseval: as is the mean square error of the pixels); rounding to 8 bits
/// adds 0.5.
pub(crate) const MP4_ERROR: f64 = 4.5 * 4.5;

/// Planes of a frame in Y'CbCr, 8 bits, limited range, without rounding.
pub(crate) fn planes_of(pixels: &[[u8; 3]], frame: &Value, [kr, kb]: [f64; 2]) -> [Vec<f64>; 3] {
    let luma = |[r, g, b]: [f64; 3]| kr * r + (1.0 - kr - kb) * g + kb * b;
    let scaled = |p: &[u8; 3]| [p[0], p[1], p[2]].map(|x| f64::from(x) / 255.0);
    let width = usize::try_from(frame["size"][0].as_u64().unwrap()).unwrap();
    let mut planes = [pixels.iter().map(|pixel| 16.0 + 219.0 * luma(scaled(pixel))).collect(), Vec::new(), Vec::new()];
    for k in 0..pixels.len() / 4 {
        let (x, y) = (2 * (k % (width / 2)), 2 * (k / (width / 2)));
        let four = [(0, 0), (0, 1), (1, 0), (1, 1)].map(|(dy, dx)| scaled(&pixels[(y + dy) * width + x + dx]));
        let mean = [0, 1, 2].map(|c| four.iter().map(|p| p[c]).sum::<f64>() / 4.0);
        planes[1].push(128.0 + 224.0 * (mean[2] - luma(mean)) / (2.0 - 2.0 * kb));
        planes[2].push(128.0 + 224.0 * (mean[0] - luma(mean)) / (2.0 - 2.0 * kr));
    }
    planes
}

/// Bytes of hexadecimal numbers.
pub(crate) fn hex_bytes(hex: &Value) -> Vec<u8> {
    let hex = hex.as_str().unwrap();
    (0..hex.len()).step_by(2).map(|k| u8::from_str_radix(&hex[k..k + 2], 16).unwrap()).collect()
}

pub(crate) fn mean_square_error(found: &[u8], wanted: &[f64]) -> f64 {
    assert_eq!(found.len(), wanted.len());
    found.iter().zip(wanted).map(|(found, wanted)| (f64::from(*found) - wanted).powi(2)).sum::<f64>()
        / wanted.len() as f64
}

/// Checks the pixels of a frame.
fn check_frame(end: &str, frame: &Value, color: &[u8]) {
    let bytes = |plane: &str| hex_bytes(&frame[plane]);
    let pixels = color.as_chunks::<3>().0;
    match end {
        "gif" => {
            let known: std::collections::BTreeSet<_> = pixels.iter().collect();
            assert!(known.len() <= 256, "{} colors", known.len());
            assert_eq!(bytes("rgb"), color, "as many colors as fit into a palette are exact");
        }
        "mp4" => {
            let (found, wanted) = (["y", "u", "v"].map(bytes), planes_of(pixels, frame, BT709));
            for (plane, (found, wanted)) in found.iter().zip(&wanted).enumerate() {
                let error = mean_square_error(found, wanted);
                assert!(error < MP4_ERROR, "plane {plane}: {error}");
            }
            assert_eq!(frame["color"], json!([1, 13, 1, "tv"]));
        }
        _ => panic!("{end}: its frames are not checked"),
    }
}

#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn animation_frames() {
    for (_, end) in animations() {
        let (_folder, path) = scratch(&format!("run.{end}"));
        let (recorded, colors, _) = recorded(RecorderCfg { envs: Some(vec![EnvId(1)]), ..RecorderCfg::new(&path) });
        assert_eq!(recorded.bytes, path.metadata().unwrap().len());
        let found = script_output("read_animation.py", &path);
        let frames = list(&found["frames"]);
        assert_eq!(frames.len(), colors.len(), "{end}");
        for (k, (frame, color)) in frames.iter().zip(&colors).enumerate() {
            // Five steps of 10 ms.
            assert_eq!((&frame["from"], &frame["until"]), (&(50 * k).into(), &(50 * (k + 1)).into()), "{end}: {k}");
            check_frame(end, frame, color);
        }
        assert_ne!(colors[0], colors[3], "something moves");
        if end == "mp4" {
            // Control: another frame is not within the bound.
            let wanted = planes_of(colors[3].as_chunks::<3>().0, &frames[0], BT709);
            assert!(mean_square_error(&hex_bytes(&frames[0]["y"]), &wanted[0]) > MP4_ERROR);
        }
    }
}

/// An animation shows one camera in one environment.
#[test]
fn animation_streams() {
    for (format, end) in animations() {
        let (folder, path) = scratch(&format!("run.{end}"));
        let mut world = World::new(2, 1);
        let cfg = RecorderCfg::new(&path).with_topics([Topic::Sensor("camera".into())]);
        let error = world.sim.record(cfg).unwrap_err();
        assert!(matches!(&error, RecordError::NotSingleImage { .. }), "{error}");
        assert!(error.to_string().contains("camera/color in 2 environments"), "{error}");
        // Without a topic, the first camera and the first environment are used.
        let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
        let streams: Vec<_> = world
            .sim
            .observers()
            .get(recorder)
            .unwrap()
            .streams()
            .map(|s| (s.name.clone(), s.env_ids.clone()))
            .collect();
        assert_eq!(streams, [("camera/color".to_string(), vec![0])]);
        // A recording without a frame leaves no file.
        let error = world.sim.finish_recording(recorder).unwrap_err().to_string();
        assert!(error.contains("no frame"), "{}: {error}", format.name());
        assert!(names(&folder).is_empty());
    }
}

#[test]
fn odd_size() {
    let folder = tempfile::tempdir().unwrap();
    let mut world = World::new(1, 1);
    world.sim.add_sensor("odd", CameraCfg { width: 33, height: 24, ..CameraCfg::default() }).unwrap();
    let cfg = |end| RecorderCfg::new(folder.path().join(end)).with_topics([Topic::channel("odd", "color")]);
    let error = world.sim.record(cfg("run.mp4")).unwrap_err();
    assert!(matches!(error, RecordError::UnsupportedSize { width: 33, height: 24, .. }), "{error}");
    assert!(error.to_string().contains("run.mp4") && error.to_string().contains("even numbers"), "{error}");
    assert!(names(&folder).is_empty(), "nothing was begun");
    record_steps(&mut world, cfg("run.gif"), IMAGE_EVERY);
}

const STAGE: [usize; 2] = [96, 64];

/// Records the overview for 0.3 s, at 20 images per second.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn stage_animations() {
    for (_, end) in animations() {
        let (_folder, path) = scratch(&format!("run.{end}"));
        let overview = OverviewCfg { size: STAGE, fps: 20.0, ..OverviewCfg::default() };
        let cfg = RecorderCfg { overview, topics: vec![Topic::Overview], ..RecorderCfg::new(&path) };
        record_steps(&mut World::new(2, 2), cfg, 30);
        if end == "mp4" {
            // The script checks the rate of smaller images.
            assert!(std::fs::metadata(&path).unwrap().len() > 1000);
            continue;
        }
        let found = script_output("read_animation.py", &path);
        let frames = list(&found["frames"]);
        let times: Vec<u64> = frames.iter().map(|frame| frame["from"].as_u64().unwrap()).collect();
        assert_eq!(times, [0, 50, 100, 150, 200, 250, 300], "{end}");
        assert!(frames.iter().all(|frame| frame["size"] == json!(STAGE)), "{end}");
        assert!(frames.windows(2).any(|pair| pair[0]["rgb"] != pair[1]["rgb"]), "{end}: something moves");
    }
}

/// Reference: the rasterizer of a camera at the viewpoint of the overview. With one environment, both images are equal.
#[test]
fn stage_by_camera() {
    let (_folder, path) = scratch("images");
    let mut world = World::new(1, 1);
    let (eye, target) = ([1.6, 1.1, 1.2], [0.3, 0.1, 0.3]);
    let camera = CameraCfg {
        width: STAGE[0],
        height: STAGE[1],
        intrinsics: Intrinsics::Fovy { radians: std::f64::consts::FRAC_PI_4 },
        extrinsics: look_at(eye, target),
        near: 0.05,
        far: 500.0,
        raster: RasterCfg { samples: 4, ..RasterCfg::default() },
        channels: Channels { color: true, ..Channels::NONE },
        update_period: 0.05,
        ..CameraCfg::default()
    };
    world.sim.add_sensor("judge", camera).unwrap();
    let overview = OverviewCfg { size: STAGE, fps: 20.0, eye: Some(eye), target: Some(target) };
    let topics = vec![Topic::Overview, Topic::channel("judge", "color")];
    record_steps(&mut world, RecorderCfg { overview, topics, ..RecorderCfg::new(&path) }, 20);
    let image = |of: &str, k: usize| std::fs::read(path.join(format!("{of}/color/env_0/{k:06}.png"))).unwrap();
    for k in 0..4 {
        // The overview also has an image at the beginning.
        assert!(image("stage", k + 1) == image("judge", k), "image {k}");
    }
    assert!(image("stage", 1) != image("stage", 4), "control: it moves");
}

/// Without a camera, the overview image is recorded.
#[test]
fn stage_alone() {
    let folder = tempfile::tempdir().unwrap();
    let mut sim = simulation(2);
    sim.add_rigid_object(kinetoscope_testkit::worlds::object("cube", ObjectShape::cube(0.2), [0.0; 3])).unwrap();
    for name in ["run.gif", "images"] {
        let recorded = record(&mut sim, RecorderCfg::new(folder.path().join(name)), |sim| sim.update(10));
        assert!(recorded.packets > 1, "{name}");
    }
    assert!(folder.path().join("images/stage/color/env_0/000000.png").is_file());
    for (overview, wrong) in [
        (OverviewCfg { fps: 0.0, ..OverviewCfg::default() }, "rate"),
        (OverviewCfg { size: [0, 10], ..OverviewCfg::default() }, "pixels"),
        (OverviewCfg { eye: Some([1.0; 3]), target: Some([1.0; 3]), ..OverviewCfg::default() }, "from"),
    ] {
        let cfg = RecorderCfg { overview, ..RecorderCfg::new(folder.path().join("wrong.gif")) };
        kinetoscope_testkit::error_tables::assert_error(sim.record(cfg), "Overview", &[wrong]);
    }
}
