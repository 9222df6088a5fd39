//! LeRobot datasets, read by pyarrow, PyAV and LeRobot.

use super::episodes::Expected;
use super::images::{BT601, BT709, MP4_ERROR, hex_bytes, mean_square_error, planes_of};
use super::*;
use kinetoscope_testkit::error_tables::assert_error;

/// Records the same run with images in the tables, and with videos. The camera has a fifth of the frame rate, and its
/// last image is in each frame.
fn with_images_and_videos(folder: &Path) -> (World, Expected, [PathBuf; 2]) {
    let paths = ["images.lerobot", "videos.lerobot"].map(|name| folder.join(name));
    let cfg = |(path, use_videos): (&PathBuf, bool)| {
        assert!(RecorderCfg::default().use_videos, "as in LeRobot");
        RecorderCfg { task: "wave at the cube".into(), use_videos, ..RecorderCfg::new(path) }
    };
    let cfgs: Vec<RecorderCfg> = paths.iter().zip([false, true]).map(cfg).collect();
    let (world, expected, recorded) = Expected::record(&cfgs, 30, 12);
    assert!(recorded.iter().all(|recorded| recorded.bytes > 0 && recorded.packets > 30), "{recorded:?}");
    (world, expected, paths)
}

/// Frames of a dataset; each has the action that follows.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn frames() {
    let folder = tempfile::tempdir().unwrap();
    let (world, expected, paths) = with_images_and_videos(folder.path());
    for (path, has_videos) in paths.iter().zip([false, true]) {
        check_frames(&script_output("read_lerobot.py", path), &world, &expected, has_videos);
    }
    // Statistics are those of the images of the cameras, before they are coded.
    let [of_images, of_videos] = paths.map(|path| std::fs::read_to_string(path.join("meta/stats.json")).unwrap());
    assert!(of_images == of_videos && of_images.contains("observation.images.camera"), "{of_images}\n{of_videos}");
}

/// Largest error of RGB (root mean square of the channels) for an error of 1 in each plane: weights of BT.601 in limited
/// range, 255/219 for luma, and 255/224 times 1.402 for red, 0.344 + 0.714 for green, 1.772 for blue.
const RGB_ERROR: f64 = 2.79;

/// Root mean square errors of the planes of a frame. `color` is the image of the camera.
fn plane_errors(frame: &Value, color: &[u8], matrix: [f64; 2]) -> [f64; 3] {
    let wanted = planes_of(color.as_chunks::<3>().0, frame, matrix);
    let error = |k: usize| mean_square_error(&hex_bytes(&frame[["y", "u", "v"][k]]), &wanted[k]).sqrt();
    [0, 1, 2].map(error)
}

/// Checks a decoded frame; `color` is the image of the camera. Returns its PSNR \[dB\].
fn check_video_frame(frame: &Value, color: &[u8]) -> f64 {
    // Primaries of BT.709, transfer function of sRGB, matrix of BT.601, limited range.
    assert_eq!(frame["color"], json!([1, 13, 6, "tv"]));
    let errors = plane_errors(frame, color, BT601);
    assert!(errors.iter().all(|error| error * error < MP4_ERROR), "{errors:?}");
    // RGB without coding: four pixels share the chroma of their mean.
    let pixels = color.as_chunks::<3>().0;
    let (planes, width) = (planes_of(pixels, frame, BT601), frame["size"][0].as_u64().unwrap() as usize);
    let wanted = |k: usize| -> [f64; 3] {
        let at = k / width / 2 * (width / 2) + k % width / 2;
        let [y, cb, cr] = [planes[0][k] - 16.0, planes[1][at] - 128.0, planes[2][at] - 128.0];
        let [y, cb, cr] = [y / 219.0, cb / 224.0, cr / 224.0];
        [y + 1.402 * cr, y - 0.344_136 * cb - 0.714_136 * cr, y + 1.772 * cb].map(|x| (255.0 * x).clamp(0.0, 255.0))
    };
    let subsampled: f64 = (0..pixels.len()).map(|k| squared_error(wanted(k), pixels[k].map(f64::from))).sum();
    let found = hex_bytes(&frame["rgb"]);
    let found = found.as_chunks::<3>().0;
    let decoded: f64 =
        (0..pixels.len()).map(|k| squared_error(found[k].map(f64::from), pixels[k].map(f64::from))).sum();
    let [subsampled, decoded] = [subsampled, decoded].map(|sum| (sum / color.len() as f64).sqrt());
    // Triangle inequality: the errors of subsampling and coding, and two of rounding to integers by FFmpeg.
    let bound = subsampled + RGB_ERROR * errors.into_iter().fold(0.0, f64::max) + 1.0;
    assert!(decoded < bound, "{decoded} {bound}");
    20.0 * (255.0 / decoded).log10()
}

fn squared_error(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum()
}

fn check_frames(found: &Value, world: &World, expected: &Expected, has_videos: bool) {
    let episodes = list(&found["episodes"]);
    assert_eq!(episodes.len(), 3);
    let single = |values: &[f64]| values.iter().map(|x| *x as f32).collect::<Vec<f32>>();
    // Episodes are in the order of their ends: the one that the reset ended, then those at the end of the recording.
    let mut wanted = expected.episodes();
    wanted.swap(0, 1);
    for (episode, (_, frames)) in episodes.iter().zip(wanted) {
        assert_eq!(list(episode).len(), frames.len());
        for (frame, [row, next]) in list(episode).iter().zip(frames) {
            let found = |name: &str| single(&numbers(&frame[name]));
            assert_eq!(found("state"), single(&row.positions));
            assert_eq!(found("velocity"), single(&row.velocities));
            assert_eq!(found("effort"), single(&row.efforts));
            assert_eq!(found("acceleration"), single(row.acceleration.as_ref().unwrap()));
            for (action, target) in list(&frame["actions"]).iter().zip(&next.targets) {
                assert_eq!(single(&numbers(action)), single(target));
            }
            assert_ne!(row.targets, next.targets, "an action that came before would be seen");
            assert_eq!(found("cube"), single(&row.cube));
            assert_eq!((frame["picture"].is_null(), frame["video"].is_null()), (has_videos, !has_videos));
            if has_videos {
                check_video_frame(&frame["video"], &hex_bytes(&json!(row.image)));
            } else {
                assert_eq!(frame["picture"].as_str(), row.image.as_deref());
            }
        }
    }
    assert_eq!((&found["fps"], &found["task"]), (&json!(100), &json!("wave at the cube")));
    let joints: Vec<String> =
        world.sim.robot(world.arm).joint_names().iter().map(|name| format!("arm/{name}")).collect();
    assert_eq!(found["states"], json!(joints));
    let features = list(&found["features"]);
    for name in ["action", "observation.effort", "observation.velocity", "sensors.imu.lin_acc_b", "target.effort"] {
        assert!(features.contains(&json!(name)), "{features:?}");
    }
}

/// LeRobot's own loader reads every frame. The script compares each value with those that pyarrow and PyAV read.
#[test]
#[ignore = "needs LeRobot (some gigabytes) in the Python that KINETOSCOPE_PYTHON_READERS names"]
fn own_loader() {
    let folder = tempfile::tempdir().unwrap();
    let (_, expected, paths) = with_images_and_videos(folder.path());
    let frames: usize = expected.episodes().iter().map(|(_, frames)| frames.len()).sum();
    for path in &paths {
        assert_eq!(script_output("read_lerobot.py", path)["read_by_lerobot"], json!(frames), "{}", path.display());
    }
}

/// A dataset has its name only when it is complete.
#[test]
#[cfg_attr(not(feature = "lerobot"), ignore = "needs the feature lerobot")]
fn unfinished() {
    let (folder, path) = scratch("run.lerobot");
    let part = folder.path().join("run.lerobot.part");
    let mut world = World::new(1, 1);
    let recorder = world.sim.record(RecorderCfg::new(&path)).unwrap();
    // Without a measurement, there is no frame.
    let error = world.sim.finish_recording(recorder).unwrap_err();
    let RecordError::Aborted { error, partial_file, .. } = error else { panic!("{error}") };
    assert!(matches!(&*error, RecordError::NoFrame { path: of, .. } if *of == path), "{error}");
    assert_eq!(partial_file.as_deref(), Some(&*part));
    assert!(!path.exists() && part.exists());
    // The partial dataset is neither accepted as complete nor deleted.
    let error = world.sim.record(RecorderCfg::new(&path)).unwrap_err();
    assert!(matches!(error, RecordError::Unfinished { recoverable: false, .. }), "{error}");
    let cfg = overwriting(RecorderCfg::new(&path));
    let recorder = world.sim.record(cfg.clone()).unwrap();
    assert!(matches!(world.sim.record(cfg), Err(RecordError::Busy { .. })), "two recorders, one dataset");
    (0..20).for_each(|step| world.step(step));
    let recorded = world.sim.finish_recording(recorder).unwrap();
    assert!(path.join("meta/info.json").is_file() && !part.exists() && recorded.bytes > 1000, "{recorded}");
}

/// Many episodes are many files, and long episodes are many row groups.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn many_episodes() {
    const ENVS: usize = 8;
    const RESETS: usize = 40;
    const STEPS: usize = 1500;
    let (_folder, path) = scratch("run.lerobot");
    let cart = r#"<mujoco><worldbody><body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/>
        <geom size="0.1" mass="1"/></body></worldbody><actuator><motor joint="x"/></actuator></mujoco>"#;
    let mut sim = simulation(ENVS);
    let cart = sim.add_mjcf(MjcfPartCfg::text("cart", cart)).unwrap();
    // All environments are reset every three steps, then no longer.
    let mut positions: Vec<Vec<f32>> = Vec::new();
    record(&mut sim, RecorderCfg::new(&path), |sim| {
        for step in 0..3 * RESETS + STEPS {
            if step % 3 == 0 && step < 3 * RESETS {
                if step > 0 {
                    sim.reset(None).unwrap();
                }
                positions.extend((0..ENVS).map(|_| Vec::new()));
            }
            let begun = positions.len() - ENVS;
            let q = sim.mjcf_part(cart).qpos();
            positions[begun..].iter_mut().enumerate().for_each(|(env, rows)| rows.push(q[(env, 0)] as f32));
            let force = Array2::from_shape_fn((ENVS, 1), |(env, _)| (env + step) as f64 * 0.01);
            sim.mjcf_part_mut(cart).set_ctrl(&force, None, None).unwrap();
            sim.update(1);
        }
    });
    let found = script_output("read_lerobot.py", &path);
    let episodes = list(&found["episodes"]);
    assert_eq!(episodes.len(), ENVS * RESETS);
    for (k, (episode, rows)) in episodes.iter().zip(&positions).enumerate() {
        let states = list(episode).iter().map(|frame| number(&frame["state"]) as f32);
        assert!(states.eq(rows.iter().copied()), "episode {k}");
    }
    assert_eq!(list(episodes.last().unwrap()).len(), STEPS + 3);
}

/// Episodes of one frame, in two environments, of two cameras. Each is a key frame.
#[test]
#[ignore = "needs Python readers of recordings: cargo xtask test"]
fn short_episodes() {
    let (_folder, path) = scratch("run.lerobot");
    let cart = r#"<mujoco><worldbody><body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="0 1 0"/>
        <geom type="box" size="0.2 0.2 0.2" mass="1" rgba="0 1 0 1"/></body></worldbody>
        <actuator><motor joint="x"/></actuator></mujoco>"#;
    let mut sim = simulation(2);
    let cart = sim.add_mjcf(MjcfPartCfg::text("cart", cart)).unwrap();
    let color = Channels { color: true, ..Channels::NONE };
    let camera = |size| kinetoscope_testkit::worlds::camera(size, [1.0, 0.0, 1.4], [0.0, 0.0, 1.0], color);
    let eye = sim.add_sensor("camera", camera([48, 32])).unwrap();
    sim.add_sensor("small", camera([16, 20])).unwrap();
    let mut colors = Vec::new();
    record(&mut sim, RecorderCfg::new(&path), |sim| {
        for episode in 0..5 {
            if episode > 0 {
                sim.reset(None).unwrap();
            }
            // Some centimeters within a step, so that each episode has another image.
            let force = Array2::from_shape_fn((2, 1), |(env, _)| (episode * 2 + env) as f64 * 500.0 - 2000.0);
            sim.mjcf_part_mut(cart).set_ctrl(&force, None, None).unwrap();
            sim.update(1);
            let color = sim.sensor(eye).unwrap().color().unwrap();
            colors.extend((0..2).map(|env| rgb(&color.index_axis(Axis(0), env).to_owned())));
            sim.update(1);
        }
    });
    let found = script_output("read_lerobot.py", &path);
    let episodes = list(&found["episodes"]);
    assert_eq!(episodes.len(), colors.len());
    let mut lowest = f64::INFINITY;
    for (k, (episode, color)) in episodes.iter().zip(&colors).enumerate() {
        let [frame] = &list(episode)[..] else { panic!("{} frames", list(episode).len()) };
        lowest = lowest.min(check_video_frame(&frame["video"], color));
        // Controls: the image of another episode, and another matrix, are not within the bound.
        let other = plane_errors(&frame["video"], &colors[(k + 1) % colors.len()], BT601);
        assert!(other.iter().any(|error| error * error > MP4_ERROR), "{other:?}");
        let other = plane_errors(&frame["video"], color, BT709);
        assert!(other.iter().any(|error| error * error > MP4_ERROR), "{other:?}");
    }
    println!("PSNR of RGB: at least {lowest:.1} dB");
}

/// Images that a video cannot have.
#[test]
#[cfg_attr(not(feature = "lerobot"), ignore = "needs the feature lerobot")]
fn unsupported_videos() {
    let folder = tempfile::tempdir().unwrap();
    let new = || RecorderCfg::new(folder.path().join("run.lerobot"));
    let with = |channel| new().with_topics([Topic::JointStates("arm".into()), channel]);
    let mut world = World::new(1, 1);
    world.sim.add_sensor("odd", CameraCfg { width: 33, height: 24, ..CameraCfg::default() }).unwrap();
    let size = ["run.lerobot", "33 x 24", "observation.images.odd", "even numbers", "`use_videos`"];
    let odd = with(Topic::channel("odd", "color"));
    let depth = with(Topic::channel("camera", "depth"));
    for (cfg, variant, parts) in [
        (new(), "UnsupportedSize", &size[..]),
        (odd.clone(), "UnsupportedSize", &size),
        (depth.clone(), "UnsupportedTopic", &["run.lerobot", "camera", "depth"]),
        (RecorderCfg { use_videos: false, ..depth }, "UnsupportedTopic", &["depth"]),
    ] {
        assert_error(world.sim.record(cfg), variant, parts);
    }
    assert!(names(&folder).is_empty(), "nothing was begun");
    // Control: tables hold images of any size.
    record_steps(&mut world, RecorderCfg { use_videos: false, ..odd }, 2 * IMAGE_EVERY);
    assert!(!folder.path().join("run.lerobot/videos").exists());
}

#[test]
fn feature() {
    let (folder, path) = scratch("run.lerobot");
    match World::new(1, 1).sim.record(RecorderCfg::new(path)) {
        Ok(_) => assert!(Format::LeRobot.is_built()),
        Err(error) => {
            assert!(matches!(error, RecordError::NotBuilt { feature: "lerobot", .. }), "{error}");
            assert!(!Format::LeRobot.is_built() && error.to_string().contains("--features lerobot"), "{error}");
            assert!(names(&folder).is_empty(), "nothing was begun");
        }
    }
}
