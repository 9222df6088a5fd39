//! `kinetoscope plot`, held against a motion that is known in closed form.

use super::support::{kinetoscope, said};
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use std::path::Path;

/// A mass of 1 kg that slides on a spring of 40 N/m, without friction.
const SPRING: &str = r#"<mujoco><worldbody><body name="cart" pos="0 0 1">
    <joint name="x" type="slide" axis="1 0 0" stiffness="40"/><geom type="sphere" size="0.1" mass="1"/></body></worldbody></mujoco>"#;
const STEPS: u32 = 300;
/// Where it starts \[m\], in each environment.
const STARTS: [f64; 2] = [0.3, 0.1];

fn recorded(path: &Path) {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let drive = DriveCfg { drive_type: DriveType::None, ..Default::default() };
    let cart = RobotCfg { uid: "cart".into(), mjcf: Some(MjcfFile::text(SPRING)), drive, ..Default::default() };
    let cart = sim.add_robot(cart).unwrap();
    sim.robot_mut(cart).write_qpos(&array![[STARTS[0]], [STARTS[1]]], None, None).unwrap();
    let recorder = sim.record(RecorderCfg::new(path)).unwrap();
    sim.update(STEPS);
    sim.finish_recording(recorder).unwrap();
}

/// Euler steps of length h of a spring, exactly: x'' - 2 x' + x = -(h w)² x', from rest.
fn swing(start: f64, time: f64) -> f64 {
    let a = (1.0 - 0.5 * 0.01 * 0.01 * 40.0_f64).acos();
    let k = time / 0.01;
    start * ((k * a).cos() - (0.5 * a).tan() * (k * a).sin())
}

fn attribute(line: &str, name: &str) -> f64 {
    let (_, rest) = line.split_once(&format!(" {name}=\"")).unwrap();
    rest.split('"').next().unwrap().parse().unwrap()
}

/// Value and pixel of the two labels of an axis that are farthest apart.
fn ticks(svg: &str, anchor: &str, name: &str, below: f64) -> [[f64; 2]; 2] {
    let labels = svg.lines().filter(|line| line.starts_with("<text") && line.contains(anchor));
    let value = |line: &str| line.split_once('>')?.1.trim_end_matches("</text>").parse::<f64>().ok();
    let all: Vec<[f64; 2]> = labels.filter_map(|line| Some([value(line)?, attribute(line, name) - below])).collect();
    [all[0], all[all.len() - 1]]
}

/// The points of the curves as a reader sees them who has only the labels.
fn curves(svg: &str) -> Vec<Vec<[f64; 2]>> {
    let axes = [ticks(svg, "\"middle\"", "x", 0.0), ticks(svg, "\"end\"", "y", 4.0)];
    let back = |[[a, x], [b, y]]: [[f64; 2]; 2], pixel: f64| a + (pixel - x) / (y - x) * (b - a);
    let lines = svg.lines().filter(|line| line.starts_with("<polyline"));
    let points = lines.map(|line| line.split_once("points=\"").unwrap().1.trim_end_matches("\"/>"));
    let point = |point: &str| {
        let (x, y) = point.split_once(',').unwrap();
        [back(axes[0], x.parse().unwrap()), back(axes[1], y.parse().unwrap())]
    };
    points.map(|points| points.split(' ').map(point).collect()).collect()
}

#[test]
fn the_curve_of_a_swing_lies_on_the_swing() {
    let folder = tempfile::tempdir().unwrap();
    for name in ["run.mcap", "run.npz"] {
        let (path, svg) = (folder.path().join(name), folder.path().join("plot.svg"));
        recorded(&path);
        let (path, out) = (path.to_str().unwrap(), svg.to_str().unwrap());
        for (env, start) in ["0", "1"].into_iter().zip(STARTS) {
            let plot = ["plot", path, "--topic", "/joint_states", "--env", env, "--field", "position[x]", "-o", out];
            let (said, err, code) = said(&kinetoscope(&plot));
            assert_eq!((err.as_str(), code), ("", 0));
            assert!(said.contains("1 curves, 301 points"), "{said}");
            let svg = std::fs::read_to_string(&svg).unwrap();
            let curves = curves(&svg);
            assert_eq!((curves.len(), curves[0].len()), (1, 301));
            // Two decimals of a pixel, in the curve and in the labels: 3 s on more than 600 pixels, 2 starts on more than 400;
            // and between two times the swing moves by 6.4 starts a second at most.
            let (time, place) = (0.02 * 3.2 / 600.0, 0.02 * 2.2 * start / 400.0);
            for (k, [t, x]) in (0..).zip(&curves[0]) {
                assert!((t - 0.01 * f64::from(k)).abs() < time, "{name}: {t}");
                assert!((x - swing(start, 0.01 * f64::from(k))).abs() < place, "{name}: {x} at {t} s");
            }
            // The control: the swing of the other environment is another one.
            let other = STARTS[0] + STARTS[1] - start;
            assert!((curves[0][0][1] - other).abs() > 100.0 * place);
        }
    }
}

#[test]
fn pictures_have_ink_where_the_swing_is() {
    let folder = tempfile::tempdir().unwrap();
    let (path, png) = (folder.path().join("run.mcap"), folder.path().join("plot.png"));
    recorded(&path);
    let svg = png.with_extension("svg");
    for out in [&png, &svg] {
        let plot = ["plot", path.to_str().unwrap(), "--topic", "cart/joint_states", "--field", "pos*", "-o"];
        let size = [out.to_str().unwrap(), "--width", "700", "--height", "400"];
        let (_, err, code) = said(&kinetoscope(&[&plot[..], &size].concat()));
        assert_eq!(code, 0, "{err}");
    }
    let image = image::open(&png).unwrap().to_rgb8();
    assert_eq!(image.dimensions(), (700, 400));
    let svg = std::fs::read_to_string(svg).unwrap();
    let axes = [ticks(&svg, "\"middle\"", "x", 0.0), ticks(&svg, "\"end\"", "y", 4.0)];
    let place = |k: usize, value: f64| {
        let [[a, x], [b, y]] = axes[k];
        x + (value - a) / (b - a) * (y - x)
    };
    let blue = |x: f64, y: f64| {
        let near = [[0, 0], [0, 1], [0, -1]].map(|[dx, dy]| [x as i64 + dx, y as i64 + dy]);
        near.into_iter().any(|[x, y]| {
            let [r, _, b] = image.get_pixel(x as u32, y as u32).0;
            r < 130 && b > 140
        })
    };
    for k in 0..=STEPS {
        let time = 0.01 * f64::from(k);
        let x = place(0, time);
        assert!(blue(x, place(1, swing(STARTS[0], time))), "no ink at {time} s");
        // The control: not where the swing of another spring is, where the two are apart.
        let other = place(1, -swing(STARTS[0], time));
        let apart = (other - place(1, swing(STARTS[0], time))).abs() > 60.0;
        assert!(!apart || !blue(x, other), "ink at {time} s");
    }
}

#[test]
fn what_there_is_is_listed_and_what_is_not_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("run.npz");
    recorded(&path);
    let path = path.to_str().unwrap();
    let (out, err, code) = said(&kinetoscope(&["plot", path]));
    assert_eq!((err.as_str(), code), ("", 0));
    for line in
        ["/env_1/cart/joint_states   numbers, 301 times", "    position[x]", "    pose[cart/world, cart/cart].qw"]
    {
        assert!(out.lines().any(|found| found == line), "{line}: {out}");
    }
    let (out, _, code) = said(&kinetoscope(&["plot", path, "--topic", "cart/targets"]));
    assert!(code == 0 && out.contains("/env_0/cart/targets") && !out.contains("joint_states"), "{out}");
    let plot = folder.path().join("plot.svg");
    let plot = plot.to_str().unwrap();
    let gif = folder.path().join("plot.gif");
    for (args, words) in [
        (vec![path, "--topic", "joint_stats", "--field", "position[x]", "-o", plot], "/cart/joint_states"),
        (vec![path, "--topic", "joint_states", "--field", "position[y]", "-o", plot], "position[x]"),
        (vec![path, "--topic", "joint_states", "--env", "7", "--field", "position[x]", "-o", plot], "environment 7"),
        (vec![path, "--topic", "joint_states", "--field", "position[x]"], "--out"),
        (vec![path, "--topic", "joint_states", "-o", plot], "position[x]"),
        (vec![path, "--field", "position[x]", "-o", plot], "--topic"),
        (vec![path, "--topic", "joint_states", "--field", "position[x]", "-o", gif.to_str().unwrap()], ".svg or .png"),
        (vec![path, "--topic", "joint_states", "--field", "position[x]", "-o", plot, "--width", "10"], "10 x 540"),
        (vec!["no_such.mcap"], "no_such.mcap"),
        (vec!["plots.txt"], ".mcap or .npz"),
    ] {
        let (out, err, code) = said(&kinetoscope(&[&["plot"], &args[..]].concat()));
        assert_eq!(code, 2, "{args:?}: {out}{err}");
        assert!(err.contains(words), "{args:?}: {err}");
        assert!(!Path::new(plot).exists() && !gif.exists());
    }
}
