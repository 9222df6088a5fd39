//! SimBenchmark's energy test: a quadruped falls, whose joints nothing moves. Euler has z(n) = z₀ - g h² n (n + 1)/2 and
//! v(n) = -g h n, so that the energy falls by ½ m g² h t; its mean square over N steps is
//! (½ m g² h)² h² (N + 1)(2 N + 1)/6, which goes to (½ m g² h)² T²/3. The energy is the judge's.
//!
//! Tolerance: rounding of z against 1 m, 1e-13 m of weight, 1e-9 of 8 J²; 1e-7 of the mean.

use super::newton_euler::{Motion, Tree, joints};
use super::subjects::EARTH;
use crate::lab::*;
use crate::law::law;
use kinetoscope::prelude::*;

const SECONDS: f64 = 2.0;

/// Mean square of the change of the energy \[J²\], and the change over time.
fn mean_square(cfg: SimulationManagerCfg) -> (f64, f64, Vec<[f64; 2]>) {
    let mut lab = Lab::new(cfg);
    let path = assets::path("quadruped/quadruped.urdf").unwrap();
    let tree = Tree::read(&path);
    let urdf = UrdfCfg::single(path);
    let robot = RobotCfg { urdf, drive: passive(), fix_base: false, ..RobotCfg::default() };
    let robot = lab.sim.add_robot(robot).unwrap();
    let energy = |sim: &SimulationManager| {
        let body = root(sim, robot);
        let robot = sim.robot(robot);
        let (q, v) = (robot.get_qpos().row(0).to_vec(), robot.get_qvel().row(0).to_vec());
        let still = vec![0.0; q.len()];
        let pose = Pose::from_parts(body.position.into(), body.rotation);
        let motion = Motion { pose, velocity: body.velocity, spin: body.spin, ..Motion::rest(EARTH) };
        tree.energy(&joints(robot.joint_names(), &q, &v, &still), motion, EARTH)
    };
    let start = energy(&lab.sim);
    let steps = (SECONDS / lab.dt()).round() as u32;
    let (mut sum, mut curve) = (0.0, Vec::new());
    lab.watch(steps, |t, sim| {
        let change = energy(sim) - start;
        sum += change * change;
        if ((t * 1e3).round() as u32).is_multiple_of(20) {
            curve.push([t, change]);
        }
    });
    (sum / f64::from(steps), tree.mass(), curve)
}

#[test]
fn holds() {
    law(module_path!(), "<(E - E₀)²> = (½ m g² h)² h² (N + 1)(2 N + 1)/6", |m| {
        let mut curves = Vec::new();
        for (dt, name) in [(1e-3, "1 ms"), (5e-3, "5 ms")] {
            let (found, mass, curve) = mean_square(with_dt(dt, earth()));
            let n = SECONDS / dt;
            let rate = 0.5 * mass * G * G * dt;
            let expected = rate * rate * dt * dt * (n + 1.0) * (2.0 * n + 1.0) / 6.0;
            let quantity = format!("mean square of the change, h = {name}");
            m.row(&quantity, "J²", expected, found, (1e-7 * expected, "rounding of heights"));
            m.control(&quantity, "with RK4, which has no such error", mean_square(rk4(with_dt(dt, earth()))).0);
            curves.push((name, curve));
        }
        m.plot("A quadruped falls, Euler", ["time [s]", "change of the energy [J]"], false, &curves);
    });
}
