//! An IMU at the radius r of a turntable with angular velocity ω and angular acceleration α. It measures ω² r inward, α
//! r along its path and g upward; ω and α about z; and the velocity ω r along its path.
//!
//! Tolerance: ω is constant, and α τ/I, to rounding: 1e-10.

use crate::lab::*;

const MOMENT: f64 = 0.08;
const RADIUS: f64 = 0.4;
const SPIN: f64 = 6.0;
const TORQUE: f64 = 0.2;

/// Acceleration, angular velocity, angular acceleration and velocity after 1 s.
fn read(cfg: SimulationManagerCfg, place: [f64; 2], spin: f64, torque: f64) -> [f64; 7] {
    let mut lab = Lab::new(cfg);
    let links = [base(), Link::new("table", 2.0, [MOMENT; 3]), Link::new("tip", 0.0, [0.0; 3])];
    let tip = Joint::fixed("screw", ["table", "tip"]).at([place[0], place[1], 0.1]);
    let text = urdf(&links, &[Joint::hinge("turn", ["base", "table"], [0.0, 0.0, 1.0]), tip]);
    let robot = lab.mechanism(&text);
    let id = lab.sim.add_sensor("imu", ImuCfg::on("tip")).unwrap();
    lab.write_joints(robot, &[0.3], &[spin]);
    lab.set_joint_efforts(robot, &[torque]);
    lab.run(1.0);
    let imu = lab.sim.sensor(id).unwrap();
    let (a, w, up, v) = (imu.lin_acc_b(), imu.ang_vel_b(), imu.ang_acc_b(), imu.lin_vel_b());
    [a[(0, 0)], a[(0, 1)], a[(0, 2)], w[(0, 2)], up[(0, 2)], v[(0, 0)], v[(0, 1)]]
}

#[test]
fn holds() {
    law(module_path!(), "a = (-ω² r, α r, g)", |m| {
        let alpha = TORQUE / MOMENT;
        let cases = [("steady", 0.0), ("speeding up", TORQUE)];
        for (name, torque) in cases {
            // The reading belongs to the beginning of the last step.
            let omega = SPIN + torque / MOMENT * (1.0 - 1e-3);
            let alpha = if torque > 0.0 { alpha } else { 0.0 };
            let found = read(earth(), [RADIUS, 0.0], SPIN, torque);
            // Controls: for each row, one cause is changed at a time.
            let farther = ("1 % farther out", read(earth(), [1.01 * RADIUS, 0.0], SPIN, torque));
            let beside = ("5 cm beside", read(earth(), [RADIUS, 0.05], SPIN, torque));
            let falling = ("without weight", read(weightless(), [RADIUS, 0.0], SPIN, torque));
            let slower = ("with 1 % less spin", read(earth(), [RADIUS, 0.0], 0.99 * SPIN, torque));
            let weaker = ("with 0.01 N m less", read(earth(), [RADIUS, 0.0], SPIN, torque - 0.01));
            let others = [&farther, &weaker, &falling, &slower, &weaker, &beside, &farther];
            let rows = [
                ("inwards", "m/s²", -omega * omega * RADIUS),
                ("along its way", "m/s²", alpha * RADIUS),
                ("upwards", "m/s²", G),
                ("angular velocity", "rad/s", omega),
                ("angular acceleration", "rad/s²", alpha),
                ("velocity inwards", "m/s", 0.0),
                ("velocity along its way", "m/s", omega * RADIUS),
            ];
            for (k, (quantity, unit, expected)) in rows.into_iter().enumerate() {
                let quantity = format!("{quantity}, {name}");
                m.row(&quantity, unit, expected, found[k], (1e-10, "rounding of 1000 sums"));
                let (without, other) = others[k];
                m.control(&quantity, without, other[k]);
            }
        }
    });
}
