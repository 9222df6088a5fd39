//! Energy of a falling quadruped whose trunk rotates and whose undriven legs swing: the energy, computed by the
//! reference from the URDF, is conserved.
//!
//! The second case is SimBenchmark's energy test without rotation. Euler has z(n) = z₀ - g h² n (n + 1)/2 and v(n) = -g
//! h n, so that the energy falls by ½ m g² h t, with the mean square (½ m g² h)² h² (N + 1)(2 N + 1)/6 over N steps.
//! The mass m is that of the simulation; the energy is that of the reference.
//!
//! For many steps this becomes SimBenchmark's (m g² h/2)² T²/3: 8.39 J² for the 52.135 kg of ANYmal C, which is also
//! the mass of the bundled quadruped, in 2 s by steps of 1 ms. (Published for MuJoCo 1.50: 3.48, which the formula
//! gives for 33.6 kg. Source: leggedrobotics, SimBenchmark, "ANYmal energy test".)
//!
//! Tolerance for swinging legs: the error of RK4 is (λ h)⁴/120 per radian, over λ T radians, where λ is the sum of the
//! rates of the trunk and of a leg's three joints. An angle error of ε moves each link, against its weight, by at most
//! ε times its distance from the trunk's frame, and changes the kinetic energy by 2 ε of itself. RK4 of 2.2.2
//! integrates free rotation with order 2 (law `order_of_free_rotation`). Two rotations about the axes ω and ω + ω' h
//! leave h³ |ω x ω'|/12 per step, with ω' <= λ ω. The whole body is thus rotated by λ ω² h² T/12, with its weight at
//! the lever arm of the center of mass. The reference computes all terms from the URDF and the start.
//!
//! Tolerance of mean squares: N steps round heights of up to g T²/2 and velocities of up to g T to half a digit, which
//! is at most N ε/2 of m g² T²/2 + m g² T². That is 3 N ε T/h/2 = 3/2 N² ε of Euler's change, and twice that of its
//! square. RK4 has no other error here. The formula for many steps neglects 3/(2 N) + 1/(2 N²) of itself.

use super::newton_euler::{Motion, Tree, joints};
use super::test_robots::EARTH;
use crate::lab::*;
use kinetoscope::mujoco::{BUILD_VERSION, SupportedVersion};
use nalgebra::{Point3, Vector3};
use std::path::PathBuf;

/// Energy change during a fall, and mass of the robot \[kg\].
#[derive(Debug)]
struct Fall {
    /// Largest change \[J\].
    largest: f64,
    /// Mean square of the change \[J²\].
    mean_square: f64,
    mass: f64,
    /// Mass times distance of the links from the trunk's frame, the same for the center of mass \[kg m\], and the
    /// kinetic energy \[J\].
    start: [f64; 3],
    /// The change over time \[s, J\].
    curve: Vec<[f64; 2]>,
}

/// A fall of `seconds` that starts with the joint velocities `swing` of the legs and the angular velocity `angular_velocity` of the
/// trunk \[rad/s\].
fn simulate_fall(path: PathBuf, cfg: SimulationManagerCfg, seconds: f64, swing: f64, spin: [f64; 3]) -> Fall {
    let mut lab = Lab::new(cfg);
    let tree = Tree::read(&path);
    let urdf = UrdfCfg::single(path);
    let robot = RobotCfg { urdf, drive: passive(), fix_base: false, ..RobotCfg::default() };
    let robot = lab.sim.add_robot(robot).unwrap();
    let dof = lab.sim.robot(robot).dof();
    let v: Vec<f64> = (0..dof).map(|k| swing * (1.0 + 2.0 * k as f64).sin()).collect();
    let q = lab.q(robot);
    lab.write_joints(robot, &q, &v);
    lab.write_root_velocity(robot, [0.0; 3], spin);
    let state = |sim: &SimulationManager| {
        let body = root(sim, robot);
        let robot = sim.robot(robot);
        let (q, v) = (robot.qpos().row(0).to_vec(), robot.qvel().row(0).to_vec());
        let still = vec![0.0; q.len()];
        let pose = Pose::from_parts(body.position.into(), body.rotation);
        let motion =
            Motion { pose, velocity: body.velocity, angular_velocity: body.angular_velocity, ..Motion::rest(EARTH) };
        (joints(robot.joint_names(), &q, &v, &still), motion)
    };
    let energy = |sim: &SimulationManager| {
        let (joints, motion) = state(sim);
        tree.energy(&joints, motion, EARTH)
    };
    let (at, motion) = state(&lab.sim);
    let places = tree.motions(&at, motion).into_iter().map(|(body, motion)| {
        let place = (motion.pose * Point3::from(body.com)).coords - lab.root(robot).position;
        (body.mass, place)
    });
    let places: Vec<(f64, Vector3<f64>)> = places.collect();
    let reach = places.iter().map(|(mass, place)| mass * place.norm()).sum();
    let offset = places.iter().map(|(mass, place)| *mass * place).sum::<Vector3<f64>>().norm();
    let motion_at_start = [reach, offset, tree.energy(&at, motion, Vector3::zeros())];
    let start = energy(&lab.sim);
    let steps = (seconds / lab.dt()).round() as u32;
    let (mut sum, mut largest, mut curve) = (0.0, 0.0, Vec::new());
    lab.run_with(steps, |t, sim| {
        let change = energy(sim) - start;
        sum += change * change;
        largest = max_or_nan(largest, change.abs());
        if ((t * 1e3).round() as u32).is_multiple_of(20) {
            curve.push([t, change]);
        }
    });
    let mass = lab.sim.robot(robot).total_mass();
    Fall { largest, mean_square: sum / f64::from(steps), mass, start: motion_at_start, curve }
}

fn quadruped() -> PathBuf {
    assets::path("quadruped/quadruped.urdf").unwrap()
}

/// Mean square of the energy change by Euler: for this number of steps, and in the limit of many steps.
fn euler_mean_square(mass: f64, h: f64, n: f64) -> [f64; 2] {
    let rate = 0.5 * mass * G * G * h;
    [rate * rate * h * h * (n + 1.0) * (2.0 * n + 1.0) / 6.0, rate * rate * (n * h).powi(2) / 3.0]
}

#[test]
fn holds() {
    law(module_path!(), "T + V = const; Euler, stiff: <(E - E₀)²> = (½ m g² h)² h² (N + 1)(2 N + 1)/6", |m| {
        const SWING: f64 = 2.0;
        const SPIN: [f64; 3] = [1.0, -2.0, 0.8];
        const SECONDS: f64 = 0.4;
        let whirl = |cfg| simulate_fall(quadruped(), cfg, SECONDS, SWING, SPIN);
        let found = whirl(rk4(earth()));
        let [reach, offset, moving] = found.start;
        let (spin, h) = (Vector3::from(SPIN).norm(), 1e-3);
        let rate = spin + 3.0 * SWING;
        let fourth = (rate * h).powi(4) / 120.0 * rate * SECONDS * (G * reach + 2.0 * moving);
        let order = match BUILD_VERSION {
            SupportedVersion::V2 => {
                let turned = rate * (spin * h).powi(2) * SECONDS / 12.0;
                (fourth + turned * G * offset, "orientation of order 2, times the weight and its arm")
            }
            SupportedVersion::V4 => (fourth, "RK4: (λ h)⁴/120 per radian"),
        };
        let quantity = "largest change in 0.4 s, legs swing";
        m.row(quantity, "J", 0.0, found.largest, order);
        m.control(quantity, "with Euler", whirl(earth()).largest);
        m.versions_differ_in(
            quantity,
            "RK4 turns free bodies with order 2 in 2.2.2 and with order 4 in 4.x (law order_of_free_rotation)",
        );
        let seconds = 2.0;
        let mut curves = Vec::new();
        for (dt, name) in [(1e-3, "1 ms"), (5e-3, "5 ms")] {
            let found = simulate_fall(quadruped(), with_dt(dt, earth()), seconds, 0.0, [0.0; 3]);
            let exact = simulate_fall(quadruped(), rk4(with_dt(dt, earth())), seconds, 0.0, [0.0; 3]);
            let n = seconds / dt;
            let [expected, of_many] = euler_mean_square(found.mass, dt, n);
            let quantity = format!("mean square of the change, h = {name}");
            let rounding = 3.0 * n * n * f64::EPSILON;
            m.row(&quantity, "J²", expected, found.mean_square, (rounding * expected, "rounding of N steps"));
            m.control(&quantity, "with RK4, which has no such error", exact.mean_square);
            let quantity = format!("mean square of the change, of (m g² h/2)² T²/3, h = {name}");
            let few = (1.5 / n + 0.5 / (n * n) + rounding, "3/(2 N) + 1/(2 N²)");
            m.row(&quantity, "", 1.0, found.mean_square / of_many, few);
            m.control(&quantity, "with RK4, which has no such error", exact.mean_square / of_many);
            let quantity = format!("mean square of the change, RK4, h = {name}");
            let change = 0.75 * n * f64::EPSILON * found.mass * (G * seconds).powi(2);
            m.row(&quantity, "J²", 0.0, exact.mean_square, (change * change, "rounding of N steps"));
            m.control(&quantity, "with Euler", found.mean_square);
            curves.push((name, found.curve));
        }
        m.plot("A quadruped falls, Euler", ["time [s]", "change of the energy [J]"], false, &curves);
    });
}

/// The formula on ANYbotics' own ANYmal C, if its description is available.
#[test]
#[ignore = "needs real robots: cargo xtask test"]
fn holds_for_anymal() {
    let path = kinetoscope_testkit::test_resources::robot("anymal_c_simple_description/urdf/anymal.urdf");
    let fall = |cfg| simulate_fall(path.clone(), cfg, 2.0, 0.0, [0.0; 3]);
    let (euler, exact) = (fall(earth()), fall(rk4(earth())));
    assert!((euler.mass - 52.13485).abs() < 1e-5, "{}", euler.mass);
    let [expected, of_many] = euler_mean_square(euler.mass, 1e-3, 2e3);
    let rounding = 3.0 * 2e3 * 2e3 * f64::EPSILON * expected;
    assert!((euler.mean_square - expected).abs() < rounding, "{} and {expected}", euler.mean_square);
    assert!((of_many - 8.391).abs() < 5e-4, "{of_many}");
    assert!(exact.mean_square < rounding, "{}", exact.mean_square);
}
