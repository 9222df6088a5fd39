//! Images, views and verification of `kinetoscope replay`.

use super::support::{CommandFolder, RunningCommand, colors, red, window_of};
use kinetoscope::ndarray::{Array3, array};
use kinetoscope::prelude::*;
use kinetoscope::record::RecorderCfg;
use kinetoscope::robot::description::LinkId;
use kinetoscope::sim::{OffscreenScene, WrenchFrame};
use kinetoscope::viewer::{OrbitCamera, ScreenshotCfg};
use kinetoscope_testkit::wait;
use kinetoscope_testkit::x_server::{Display, close, screenshot};

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

/// Creates a folder with `cart.toml`: a cart on a spring.
fn shell() -> CommandFolder {
    CommandFolder::with(&[("cart.toml", SCENE)])
}

/// Records the scene, with the cart at `start`, to each of these files.
fn record(shell: &CommandFolder, start: f64, cfgs: &[RecorderCfg], run: impl FnOnce(&mut SimulationManager, RobotId)) {
    let mut scene = InteractiveScene::from_file(shell.path("cart.toml")).unwrap();
    let sim = scene.sim_mut();
    let cart = sim.entities().robot_id("cart").unwrap();
    if start != 0.0 {
        sim.robot_mut(cart).write_qpos(&array![[start]], None, None).unwrap();
    }
    let recorders: Vec<_> = cfgs.iter().map(|cfg| sim.record(cfg.clone()).unwrap()).collect();
    run(sim, cart);
    recorders.into_iter().for_each(|recorder| drop(sim.finish_recording(recorder).unwrap()));
}

/// Images of a recording match the simulation at that time.
#[test]
fn images() {
    let shell = shell();
    for name in ["run.mcap", "run.npz"] {
        let (mut expected, mut stills, size) = (Vec::new(), Vec::new(), [320, 200]);
        // The ball is in the image at both times.
        record(&shell, 0.8, &[], |sim, _| {
            for _ in 0..2 {
                stills.push(OffscreenScene::overview(sim, None, &[]).unwrap());
                sim.update(45);
            }
        });
        let eye = OrbitCamera::frame_scenes(&stills.iter().map(OffscreenScene::placed).collect::<Vec<_>>(), size);
        record(&shell, 0.8, &[RecorderCfg::new(shell.path(name))], |sim, _| {
            let cfg = ScreenshotCfg { size, camera: Some(eye), ..ScreenshotCfg::default() };
            for _ in 0..2 {
                let canvas = sim.render_image(&cfg).unwrap();
                let rgb = canvas.bytes().as_chunks::<4>().0.iter().flat_map(|p| [p[0], p[1], p[2]]).collect();
                expected.push(image::RgbImage::from_raw(320, 200, rgb).unwrap());
                sim.update(45);
            }
        });
        let out = format!("{name}.images");
        let said = shell.run_ok(&format!("replay {name} --out {out} --at 0,0.45 --width 320 --height 200"));
        let found = ["replay_0.000s.png", "replay_0.450s.png"].map(|file| {
            assert!(said.contains(file), "{said}");
            shell.image(&format!("{out}/{file}"))
        });
        // Cause: the checkerboard of the ground, about 8 of 255 lighter and darker, was missing in a recorded scene.
        for (found, expected) in found.iter().zip(&expected) {
            let off = found.iter().zip(expected.iter()).map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>();
            assert!(off / (3.0 * 320.0 * 200.0) < 1.0, "{} levels off", off / (3.0 * 320.0 * 200.0));
        }
        let (found, expected) = (found.map(|image| red(&image)), expected.iter().map(red).collect::<Vec<_>>());
        for ((count, place), (pixels, expected)) in found.iter().zip(&expected) {
            // The ball is at the same place; the shading of edges may differ.
            assert!(*pixels > 150 && count.abs_diff(*pixels) <= pixels / 20, "{count} instead of {pixels}");
            assert!((0..2).all(|k| (place[k] - expected[k]).abs() < 0.5), "{name}: {place:?} instead of {expected:?}");
        }
        // Control: half a period later, the ball is elsewhere.
        assert!((found[0].1[0] - found[1].1[0]).abs() > 20.0, "{found:?}");
    }
}

#[test]
fn verification() {
    let shell = shell();
    record(&shell, 0.0, &["run.npz", "run.mcap"].map(|name| RecorderCfg::new(shell.path(name))), |sim, _| {
        sim.update(50);
    });
    record(&shell, 0.0, &[RecorderCfg::new(shell.path("pushed.npz"))], |sim, cart| {
        sim.update(20);
        let (force, link) = (Array3::from_shape_vec((1, 1, 3), vec![0.0, 5.0, 0.0]).unwrap(), LinkId(1));
        let mut cart = sim.robot_mut(cart);
        cart.set_external_wrench(&force, &(0.0 * &force), WrenchFrame::World, Some(&[link]), None).unwrap();
        sim.update(20);
    });
    for file in ["run.npz", "run.mcap"] {
        let out = shell.run_ok(&format!("replay {file} --verify --scene cart.toml"));
        assert!(out.contains("identical in 50 steps"), "{out}");
    }
    let (out, err, code) = shell.run("replay pushed.npz --verify --scene cart.toml");
    assert_eq!((err.as_str(), code), ("", 1), "{out}");
    assert!(out.contains("first different at step 21 in environment 0: cart/joint_states/"), "{out}");
    shell.assert_refused(&[
        ("replay cart.toml --verify --scene cart.toml", "NumPy archive"),
        ("replay run.npz --verify", "--scene"),
    ]);
}

#[test]
fn pages_and_refusals() {
    let shell = shell();
    let [path, bare] = ["run.mcap", "bare.mcap"].map(|name| RecorderCfg::new(shell.path(name)));
    record(&shell, 0.0, &[path, RecorderCfg { scene: false, ..bare }], |sim, _| sim.update(20));
    for line in ["replay run.mcap", "replay bare.mcap --scene cart.toml"] {
        let out = shell.run_ok(&format!("{line} --serve 127.0.0.1:0 --seconds 0.5"));
        assert!(out.contains("http://127.0.0.1:"), "{out}");
    }
    shell.assert_refused(&[
        ("replay bare.mcap", "does not contain its scene"),
        ("replay run.mcap", "DISPLAY"),
        ("replay run.mcap --out out --at 9", "from 0 s to 0.2"),
        ("replay run.mcap --out out", "--at"),
        ("replay run.mcap --serve nowhere", "nowhere"),
        ("replay run.mcap --seconds nan", "--seconds"),
        ("replay no_such.mcap", "no_such.mcap"),
        ("replay run.mcap --scene no_such.toml", "no_such.toml"),
    ]);
    let mut running = RunningCommand::start(&mut shell.command("replay run.mcap --serve 127.0.0.1:0"));
    assert!(running.line().contains("Ctrl+C ends the replay"));
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
}

/// A skipped topic is a warning, with exit code 1.
#[test]
fn torn_topic() {
    let shell = shell();
    record(&shell, 0.0, &[RecorderCfg::new(shell.path("run.mcap"))], |sim, _| sim.update(20));
    // A file as another program may write it, with a topic of truncated messages.
    let bytes = std::fs::read(shell.path("run.mcap")).unwrap();
    let mut writer = mcap::Writer::new(std::fs::File::create(shell.path("torn.mcap")).unwrap()).unwrap();
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
    for (file, expected, words) in [("run.mcap", 0, ""), ("torn.mcap", 1, "/env_0/torn is left out")] {
        for line in [
            format!("replay {file} --scene cart.toml --out images{expected} --at 0.1"),
            format!("replay {file} --scene cart.toml --serve 127.0.0.1:0 --seconds 0.3"),
            format!("plot {file}"),
        ] {
            let (out, err, code) = shell.run(&line);
            assert!(code == expected && err.contains(words), "{line}: {code} {out}{err}");
        }
    }
}

const SIZE: [usize; 2] = [960, 540];

/// Center column of the timeline mark: bright yellow columns in the lowest rows of the window.
fn mark(image: &[[u8; 3]]) -> Option<f64> {
    let [width, height] = SIZE;
    let bright = |column: &usize| (height - 14..height - 2).all(|row| image[row * width + column] == [255, 210, 60]);
    let columns: Vec<usize> = (0..width).filter(bright).collect();
    (columns.len() == 3).then(|| columns[1] as f64)
}

#[test]
#[ignore = "needs Xvfb: cargo xtask test"]
fn window() {
    let mut display = Display::start("1280x800");
    let (shell, connection) = (shell(), display.connect());
    record(&shell, 0.8, &[RecorderCfg::new(shell.path("swing.mcap"))], |sim, _| sim.update(100));
    let shown = || screenshot(&connection, [0, 0], SIZE);
    let start = || {
        let mut running = RunningCommand::start(shell.command("replay swing.mcap").env("DISPLAY", &display.name));
        assert!(running.line().contains("swing.mcap"));
        let window = wait::until_some("a window", || window_of(&connection, "swing.mcap"));
        wait::until("the recording is drawn", || colors(shown()) > 50);
        (running, window)
    };
    let (mut running, window) = start();
    // Playback pauses at the end, with the mark at the right end of the timeline, 70 pixels from the side.
    wait::until("the end", || mark(&shown()).is_some_and(|mark| (mark - (SIZE[0] as f64 - 70.0)).abs() < 2.0));
    if let Some(folder) = std::env::var_os("KINETOSCOPE_SCREENSHOTS") {
        let image = image::RgbImage::from_raw(SIZE[0] as u32, SIZE[1] as u32, shown().concat()).unwrap();
        image.save(std::path::Path::new(&folder).join("replay_window.png")).unwrap();
    }
    assert!(running.0.try_wait().unwrap().is_none(), "it does not end by itself");
    close(&connection, window);
    assert_eq!(running.ended().code(), Some(0));
    let (mut running, _) = start();
    running.interrupt();
    assert_eq!(running.ended().code(), Some(0));
    // A lost display ends the command with an error.
    let (mut running, _) = start();
    display.server.kill().unwrap();
    assert_eq!(running.ended().code(), Some(2));
}
