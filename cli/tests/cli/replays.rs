//! `kinetoscope replay`: what it draws, what it serves, and how it verifies.

use super::support::{Running, command, kinetoscope, said, until};
use super::windows::{Display, SIZE, close, colors, screenshot, window_of};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use std::path::{Path, PathBuf};

const SCENE: &str = r#"
[simulation]
num_envs = 1

[entities.cart]
type = "robot"
drive.drive_type = "none"
mjcf.text = '''<mujoco><option timestep="0.01"/><worldbody><body name="cart" pos="0 0 0.5">
  <joint name="x" type="slide" axis="0 1 0" stiffness="40"/>
  <geom type="sphere" size="0.2" mass="1" rgba="0.9 0 0 1"/></body></worldbody></mujoco>'''
"#;

/// A cart on a spring, written to a scene file.
fn scene(folder: &Path) -> (InteractiveScene, String) {
    let path = folder.join("cart.toml");
    std::fs::write(&path, SCENE).unwrap();
    (InteractiveScene::from_file(&path).unwrap(), path.to_str().unwrap().to_owned())
}

/// Where the red of a picture is, in the middle \[pixels\], and how many pixels it has.
fn red(image: &image::RgbImage) -> ([f64; 2], usize) {
    let red = image.enumerate_pixels().filter(|(.., p)| p[0] > 90 && p[1] < 60 && p[2] < 60);
    let (sum, count) =
        red.fold(([0.0; 2], 0), |([sx, sy], n), (x, y, _)| ([sx + f64::from(x), sy + f64::from(y)], n + 1));
    (sum.map(|s| s / (count.max(1) as f64)), count)
}

#[test]
fn pictures_of_a_recording_are_those_of_the_simulation_at_that_time() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run.npz"] {
        let (mut scene, _) = scene(folder.path());
        let sim = scene.sim_mut();
        let cart = sim.robot_id("cart").unwrap();
        sim.robot_mut(cart).write_qpos(&array![[0.8]], None, None).unwrap();
        let path = folder.path().join(name);
        let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
        let cfg = ScreenshotCfg { size: [320, 200], eye: Some(sim.overview_eye()), ..ScreenshotCfg::default() };
        let mut expected = Vec::new();
        for _ in 0..2 {
            let canvas = sim.picture_of_stage(&cfg).unwrap();
            let rgb = canvas.bytes().as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
            expected.push(red(&image::RgbImage::from_raw(320, 200, rgb).unwrap()));
            sim.update(45);
        }
        sim.finish_recording(recorder).unwrap();
        let out = folder.path().join(format!("{name}.pictures"));
        let at = ["replay", path.to_str().unwrap(), "--out", out.to_str().unwrap(), "--at", "0,0.45"];
        let (said, err, code) = said(&kinetoscope(&[&at[..], &["--width", "320", "--height", "200"]].concat()));
        assert_eq!((err.as_str(), code), ("", 0), "{said}");
        let found = ["replay_0.000s.png", "replay_0.450s.png"].map(|file| {
            assert!(said.contains(file), "{said}");
            red(&image::open(out.join(file)).unwrap().to_rgb8())
        });
        for ((place, count), (expected, pixels)) in found.iter().zip(&expected) {
            // The same ball at the same place; edges may be shaded otherwise.
            assert!(*pixels > 150 && count.abs_diff(*pixels) <= pixels / 20, "{count} instead of {pixels}");
            assert!((0..2).all(|k| (place[k] - expected[k]).abs() < 0.5), "{name}: {place:?} instead of {expected:?}");
        }
        // The control: half a swing later it is elsewhere.
        assert!((found[0].0[0] - found[1].0[0]).abs() > 20.0, "{found:?}");
    }
}

#[test]
fn verification_says_whether_and_where_it_differs() {
    let folder = tempfile::tempdir().unwrap();
    let (mut good, file) = scene(folder.path());
    let [path, pushed, mcap] = ["run.npz", "pushed.npz", "run.mcap"].map(|name| folder.path().join(name));
    let recorders = [&path, &mcap].map(|path| good.sim_mut().record(RecorderCfg::new(path)).unwrap());
    good.update(50);
    for recorder in recorders {
        good.sim_mut().finish_recording(recorder).unwrap();
    }
    let (mut other, _) = scene(folder.path());
    let sim = other.sim_mut();
    let cart = sim.robot_id("cart").unwrap();
    let recorder = sim.record(RecorderCfg::new(&pushed)).unwrap();
    sim.update(20);
    let force = kinetoscope::ndarray::Array3::from_shape_fn((1, 1, 3), |(.., axis)| if axis == 1 { 5.0 } else { 0.0 });
    sim.robot_mut(cart)
        .set_external_wrench(&force, &(0.0 * &force), WrenchFrame::World, Some(&[LinkId(1)]), None)
        .unwrap();
    sim.update(20);
    sim.finish_recording(recorder).unwrap();
    let verify = |path: &Path| said(&kinetoscope(&["replay", path.to_str().unwrap(), "--verify", "--scene", &file]));
    for path in [&path, &mcap] {
        let (out, err, code) = verify(path);
        assert_eq!((err.as_str(), code), ("", 0), "{out}");
        assert!(out.contains("the same in 50 steps"), "{out}");
    }
    let (out, err, code) = verify(&pushed);
    assert_eq!((err.as_str(), code), ("", 1), "{out}");
    assert!(out.contains("first different at step 21 in environment 0: cart/joint_states/"), "{out}");
    let (_, err, code) = verify(Path::new(&file));
    assert!(code == 2 && err.contains("NumPy archive"), "{err}");
    let (_, err, code) = said(&kinetoscope(&["replay", path.to_str().unwrap(), "--verify"]));
    assert!(code == 2 && err.contains("--scene"), "{err}");
}

#[test]
fn it_is_served_and_what_cannot_be_shown_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let (mut scene, file) = scene(folder.path());
    let [path, bare] = ["run.mcap", "bare.mcap"].map(|name| folder.path().join(name));
    let cfgs = [RecorderCfg::new(&path), RecorderCfg { scene: false, ..RecorderCfg::new(&bare) }];
    let recorders = cfgs.map(|cfg| scene.sim_mut().record(cfg).unwrap());
    scene.update(20);
    for recorder in recorders {
        scene.sim_mut().finish_recording(recorder).unwrap();
    }
    let [path, bare] = [&path, &bare].map(|path| path.to_str().unwrap());
    let serve = ["--serve", "127.0.0.1:0", "--seconds", "0.5"];
    for args in [[&["replay", path], &serve[..]].concat(), [&["replay", bare, "--scene", &file], &serve[..]].concat()] {
        let (out, err, code) = said(&kinetoscope(&args));
        assert_eq!((err.as_str(), code), ("", 0), "{out}");
        assert!(out.contains("http://127.0.0.1:"), "{out}");
    }
    let out = folder.path().join("out");
    let out = out.to_str().unwrap();
    for (args, words) in [
        (vec!["replay", bare], "does not hold its scene"),
        (vec!["replay", path], "DISPLAY"),
        (vec!["replay", path, "--out", out, "--at", "9"], "from 0 s to 0.2"),
        (vec!["replay", path, "--out", out], "--at"),
        (vec!["replay", path, "--serve", "nowhere"], "nowhere"),
        (vec!["replay", path, "--seconds", "nan"], "--seconds"),
        (vec!["replay", "no_such.mcap"], "no_such.mcap"),
        (vec!["replay", path, "--scene", "no_such.toml"], "no_such.toml"),
    ] {
        let (out, err, code) = said(&kinetoscope(&args));
        assert_eq!(code, 2, "{args:?}: {out}{err}");
        assert!(err.contains(words), "{args:?}: {err}");
    }
}

/// What is left out of a recording is a warning, and the exit code says so.
#[test]
fn a_recording_of_which_something_is_left_out_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let (mut scene, file) = scene(folder.path());
    let [path, torn] = ["run.mcap", "torn.mcap"].map(|name| folder.path().join(name));
    let recorder = scene.sim_mut().record(RecorderCfg::new(&path)).unwrap();
    scene.update(20);
    scene.sim_mut().finish_recording(recorder).unwrap();
    // As somebody else might write it: besides, a topic whose messages are cut.
    let bytes = std::fs::read(&path).unwrap();
    let mut writer = mcap::Writer::new(std::fs::File::create(&torn).unwrap()).unwrap();
    for message in mcap::MessageStream::new(&bytes).unwrap() {
        let message = message.unwrap();
        writer.write(&message).unwrap();
        if message.channel.topic.ends_with("joint_states") {
            let channel = mcap::Channel { id: 99, topic: "/env_0/torn".into(), ..(*message.channel).clone() };
            let data = message.data[..10].to_vec().into();
            writer.write(&mcap::Message { channel: channel.into(), data, ..message.clone() }).unwrap();
        }
    }
    writer.finish().unwrap();
    drop(writer);
    let [path, torn] = [&path, &torn].map(|path| path.to_str().unwrap());
    for (file_of, code_of, words) in [(path, 0, ""), (torn, 1, "/env_0/torn is left out")] {
        let out = folder.path().join(format!("pictures{code_of}"));
        let show = ["replay", file_of, "--scene", &file, "--out", out.to_str().unwrap(), "--at", "0.1"];
        let serve = ["replay", file_of, "--scene", &file, "--serve", "127.0.0.1:0", "--seconds", "0.3"];
        for args in [&show[..], &serve[..], &["plot", file_of][..]] {
            let (out, err, code) = said(&kinetoscope(args));
            assert_eq!(code, code_of, "{args:?}: {out}{err}");
            assert!(err.contains(words), "{args:?}: {err}");
        }
    }
}

/// A cart that swings for a second: the file, and the folder that holds it.
fn swing() -> (tempfile::TempDir, String) {
    let folder = tempfile::tempdir().unwrap();
    let (mut scene, _) = scene(folder.path());
    let sim = scene.sim_mut();
    let cart = sim.robot_id("cart").unwrap();
    sim.robot_mut(cart).write_qpos(&array![[0.8]], None, None).unwrap();
    let path = folder.path().join("swing.mcap");
    let recorder = sim.record(RecorderCfg::new(&path)).unwrap();
    sim.update(100);
    sim.finish_recording(recorder).unwrap();
    (folder, path.to_str().unwrap().to_owned())
}

#[test]
fn ctrl_c_is_a_good_end_of_a_page() {
    let (_folder, path) = swing();
    let mut running = Running::start(&mut command(&["replay", &path, "--serve", "127.0.0.1:0"]));
    assert!(running.line().contains("Ctrl+C ends it"));
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
}

/// Where the mark of the time line is: the middle column of what is bright yellow in the lowest rows of the window.
fn mark(picture: &[[u8; 3]]) -> Option<f64> {
    let [width, height] = SIZE;
    let bright = |column: &usize| (height - 14..height - 2).all(|row| picture[row * width + column] == [255, 210, 60]);
    let columns: Vec<usize> = (0..width).filter(bright).collect();
    (columns.len() == 3).then(|| columns[1] as f64)
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn a_window_shows_a_recording_with_its_time_line_until_it_is_closed() {
    let mut display = Display::start("1280x800");
    let (_folder, path) = swing();
    let connection = display.connect();
    let start = || {
        let mut running = Running::start(command(&["replay", &path]).env("DISPLAY", &display.name));
        assert!(running.line().contains("swing.mcap"));
        let window = until("a window", || window_of(&connection, "swing.mcap"));
        until("the recording is drawn", || (colors(&connection) > 50).then_some(()));
        (running, window)
    };
    let (mut running, window) = start();
    // It holds at the end, where the mark is at the right end of the line: 70 pixels from the side.
    until("the end", || mark(&screenshot(&connection)).filter(|mark| (*mark - (SIZE[0] as f64 - 70.0)).abs() < 2.0));
    if let Some(folder) = std::env::var_os("KINETOSCOPE_SCREENSHOTS") {
        let bytes = screenshot(&connection).concat();
        let picture = image::RgbImage::from_raw(SIZE[0] as u32, SIZE[1] as u32, bytes).unwrap();
        picture.save(PathBuf::from(folder).join("replay_window.png")).unwrap();
    }
    assert!(running.0.try_wait().unwrap().is_none(), "it does not end by itself");
    close(&connection, window);
    assert_eq!(running.ended().code(), Some(0));
    let (mut running, _) = start();
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    // The display is lost: that is an end, not a good one.
    let (mut running, _) = start();
    display.server.kill().unwrap();
    assert_eq!(running.ended().code(), Some(2));
}
