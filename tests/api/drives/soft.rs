//! A soft drive (kp 40, kd 5) under gravity sags by exactly tau_g / kp, and not less.
//!
//! At rest the law reads kp (q* - q) = tau_g(q), with tau_g from `sim::dynamics`, which knows nothing of drives. The
//! slowest mode decays with kd / kp = 0.125 s: after 10 s, exp(-80) of it is left. Tolerance 1e-9 rad: rounding of
//! positions through kp. A 1 % change of kp would move the joints by 2 mrad.
//!
//! Control: the same constraint row with MuJoCo's own stiffness (only its reference acceleration rewritten) is a rigid
//! drive that hangs less than a tenth as low.

use crate::drives::worlds::*;
use kinetoscope::sim::mj;

#[test]
fn a_soft_drive_hangs_by_load_over_stiffness() {
    let (kp, kd) = (40.0, 5.0);
    let a = Joint::lever("a", 1.0, 0.2, 0.01);
    let b = Joint::lever("b", 0.3, 0.15, 0.002).after(&a, [0.4, 0.0, 0.0]);
    let mut world = world(&[a.effort(30.0), b.effort(10.0)], gains(kp, kd), earth());
    let aim = [0.3, -0.2];
    world.aim(&aim);
    world.step(1000);
    world.assert_well();
    let (q, load) = (world.q(), world.load_by_gravity(&EARTH));
    for i in 0..2 {
        println!("joint {i}: hangs by {:.6} rad, load / kp {:.6} rad", aim[i] - q[i], load[i] / kp);
        assert!((load[i] / kp).abs() > 0.01, "a sag that can be seen");
        assert_close(aim[i] - q[i], load[i] / kp, 1e-9, "sag");
        assert_close(world.effort()[i], load[i], 40e-9, "the drive carries the load");
    }
}

#[test]
fn a_row_with_mujocos_own_stiffness_hangs_less() {
    let (kp, kd, h, mass, length) = (40.0, 5.0, 0.01, 1.0, 0.2);
    let mut data = plain(&format!(
        "<mujoco><option timestep=\"{h}\"/><worldbody><body><joint type=\"hinge\" axis=\"0 1 0\" frictionloss=\"30\" \
         solreffriction=\"{} 1\" solimpfriction=\".999 .999 .001\"/><inertial pos=\"{length} 0 0\" mass=\"{mass}\" \
         diaginertia=\".01 .01 .01\"/></body></worldbody></mujoco>",
        2.0 * h
    ));
    for _ in 0..1000 {
        data.step1().unwrap();
        let (q, v) = (data.qpos()[0], data.qvel()[0]);
        assert_eq!(data.efc_type()[0] as u32, mj::mjCNSTR_FRICTION_DOF);
        data.efc_aref_mut()[0] = (kp / (kd + h * kp) * -q - v) / h;
        data.step2().unwrap();
    }
    let (hangs, expected) = (data.qpos()[0], mass * 9.81 * length * data.qpos()[0].cos() / kp);
    assert!(hangs.abs() < 0.1 * expected.abs(), "{hangs} {expected}");
}
