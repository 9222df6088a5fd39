//! `kinetoscope plot`, compared with a motion in closed form.

use super::support::CommandFolder;
use kinetoscope::ndarray::array;
use kinetoscope::prelude::*;
use kinetoscope::record::RecorderCfg;
use kinetoscope_testkit::svg::curves;
use kinetoscope_testkit::worlds::{mjcf_robot, passive};
use std::path::Path;

/// A mass of 1 kg on a spring of 40 N/m, sliding without friction.
const SPRING: &str = r#"<mujoco><worldbody><body name="cart" pos="0 0 1">
    <joint name="x" type="slide" axis="1 0 0" stiffness="40"/><geom type="sphere" size="0.1" mass="1"/></body></worldbody></mujoco>"#;
const STEPS: u32 = 300;
/// Initial position of each environment \[m\].
const STARTS: [f64; 2] = [0.3, 0.1];

fn record(path: &Path) {
    let mut sim = SimulationManager::new(SimulationManagerCfg { num_envs: 2, ..Default::default() }).unwrap();
    let cart = sim.add_robot(passive(mjcf_robot("cart", SPRING))).unwrap();
    sim.robot_mut(cart).write_qpos(&array![[STARTS[0]], [STARTS[1]]], None, None).unwrap();
    let recorder = sim.record(RecorderCfg::new(path)).unwrap();
    sim.update(STEPS);
    sim.finish_recording(recorder).unwrap();
}

/// Exact solution of semi-implicit Euler steps of length h on a spring: x'' - 2 x' + x = -(h w)² x', from rest.
fn swing(start: f64, time: f64) -> f64 {
    let a = (1.0 - 0.5 * 0.01 * 0.01 * 40.0_f64).acos();
    let k = time / 0.01;
    start * ((k * a).cos() - (0.5 * a).tan() * (k * a).sin())
}

#[test]
fn closed_form() {
    let shell = CommandFolder::with(&[]);
    for name in ["run.mcap", "run.npz"] {
        record(&shell.path(name));
        for (env, start) in STARTS.into_iter().enumerate() {
            let said =
                shell.run_ok(&format!("plot {name} --topic /joint_states --env {env} --field position[x] -o plot.svg"));
            assert!(said.contains("1 curve, 301 points"), "{said}");
            let curves = curves(&std::fs::read_to_string(shell.path("plot.svg")).unwrap());
            assert_eq!((curves.len(), curves[0].len()), (1, 301));
            // Curves and labels are rounded to hundredths of a pixel: 3 s on more than 600 pixels, 2 starts on more
            // than 400. Between two times, the position changes by at most 6.4 starts per second.
            let (time, place) = (0.02 * 3.2 / 600.0, 0.02 * 2.2 * start / 400.0);
            for (k, [t, x]) in (0..).zip(&curves[0]) {
                assert!((t - 0.01 * f64::from(k)).abs() < time, "{name}: {t}");
                assert!((x - swing(start, 0.01 * f64::from(k))).abs() < place, "{name}: {x} at {t} s");
            }
            // Control: the motion of the other environment differs.
            let other = STARTS[0] + STARTS[1] - start;
            assert!((curves[0][0][1] - other).abs() > 100.0 * place);
        }
    }
}

#[test]
fn lists_and_refusals() {
    let shell = CommandFolder::with(&[]);
    record(&shell.path("run.npz"));
    let out = shell.run_ok("plot run.npz");
    for line in
        ["/env_1/cart/joint_states   numbers, 301 messages", "    position[x]", "    pose[cart/world, cart/cart].qw"]
    {
        assert!(out.lines().any(|found| found == line), "{line}: {out}");
    }
    let (_, err, code) =
        shell.run("plot run.npz --topic cart/joint_states --field pos* -o plot.png --width 700 --height 400");
    assert!(code == 0 && shell.image("plot.png").dimensions() == (700, 400), "{err}");
    let (out, _, code) = shell.run("plot run.npz --topic cart/targets");
    assert!(code == 0 && out.contains("/env_0/cart/targets") && !out.contains("joint_states"), "{out}");
    shell.assert_refused(&[
        ("plot run.npz --topic joint_stats --field position[x] -o plot.svg", "/cart/joint_states"),
        ("plot run.npz --topic joint_states --field position[y] -o plot.svg", "position[x]"),
        ("plot run.npz --topic joint_states --env 7 --field position[x] -o plot.svg", "environment 7"),
        ("plot run.npz --topic joint_states --field position[x]", "--out"),
        ("plot run.npz --topic joint_states -o plot.svg", "position[x]"),
        ("plot run.npz --field position[x] -o plot.svg", "--topic"),
        ("plot run.npz --topic joint_states --field position[x] -o plot.gif", ".svg or .png"),
        ("plot run.npz --topic joint_states --field position[x] -o plot.svg --width 10", "10 x 540"),
        ("plot no_such.mcap", "no_such.mcap"),
        ("plot plots.txt", ".mcap or .npz"),
    ]);
}
