//! A weightless quadruped whose drives move its legs: all efforts are internal, so that linear and angular momentum,
//! computed by the reference from the URDF, stay 0.
//!
//! Tolerance: RK4 with explicit drives, whose gains reach 30 rad/s: (λ h)⁴ = 1e-6 of the internal momenta of some kg
//! m/s while the legs move. The orientation of order 2 in 2.2.2 adds 1e-6. In total 1e-5; Euler is a thousand times
//! worse.

use super::newton_euler::{Motion, Tree, joints};
use crate::lab::*;

/// Largest momentum \[kg m/s\] and angular momentum \[kg m²/s\] in 1 s, and the largest joint velocity.
fn largest(cfg: SimulationManagerCfg) -> [f64; 3] {
    let mut lab = Lab::new(cfg);
    let path = assets::path("quadruped/quadruped.urdf").unwrap();
    let tree = Tree::read(&path);
    let cfg =
        RobotCfg { urdf: UrdfCfg::single(path), drive: explicit(40.0, 2.0), fix_base: false, ..RobotCfg::default() };
    let robot = lab.sim.add_robot(cfg).unwrap();
    let dof = lab.sim.robot(robot).dof();
    let targets: Vec<f64> = (0..dof).map(|k| 0.3 * (1.0 + 2.0 * k as f64).sin()).collect();
    lab.sim.robot_mut(robot).set_qpos_target(&row(&targets), None, None).unwrap();
    let mut worst = [0.0_f64; 3];
    lab.run_with(1_000, |_, sim| {
        let body = root(sim, robot);
        let robot = sim.robot(robot);
        let (q, v) = (robot.qpos().row(0).to_vec(), robot.qvel().row(0).to_vec());
        let pose = Pose::from_parts(body.position.into(), body.rotation);
        let motion = Motion {
            pose,
            velocity: body.velocity,
            angular_velocity: body.angular_velocity,
            ..Motion::rest(Vector3::zeros())
        };
        let still = vec![0.0; q.len()];
        let (p, l) = tree.momentum(&joints(robot.joint_names(), &q, &v, &still), motion);
        let fastest = v.iter().fold(0.0, |m, v: &f64| max_or_nan(m, v.abs()));
        worst = [max_or_nan(worst[0], p.norm()), max_or_nan(worst[1], l.norm()), max_or_nan(worst[2], fastest)];
    });
    worst
}

#[test]
fn holds() {
    law(module_path!(), "Σ m v = 0, Σ (m r x v + I ω) = 0", |m| {
        let ([linear, angular, fastest], euler) = (largest(rk4(weightless())), largest(weightless()));
        assert!(fastest > 1.0, "the legs move: {fastest} rad/s");
        m.row("largest momentum", "kg m/s", 0.0, linear, (1e-5, "RK4 of drives of 30 rad/s"));
        m.row("largest angular momentum", "kg m²/s", 0.0, angular, (1e-5, "RK4 of drives of 30 rad/s"));
        m.control("largest momentum", "with Euler", euler[0]);
        m.control("largest angular momentum", "with Euler", euler[1]);
    });
}
