//! A wheel on a motor without gravity, for most laws of drives.

use crate::lab::*;

/// Moment of inertia of the wheel \[kg m²\].
pub(super) const MOMENT: f64 = 0.05;

/// One wheel in a simulation.
#[derive(Debug)]
pub(super) struct Wheel {
    pub(super) lab: Lab,
    pub(super) robot: RobotId,
}

/// A hinge about z from the base to the wheel.
pub(super) fn hinge() -> Joint {
    Joint::hinge("motor", ["base", "wheel"], [0.0, 0.0, 1.0])
}

impl Wheel {
    /// A wheel on a joint without limits.
    pub(super) fn new(cfg: SimulationManagerCfg, drive: DriveCfg) -> Self {
        Self::on(cfg, drive, hinge(), MOMENT)
    }

    pub(super) fn on(cfg: SimulationManagerCfg, drive: DriveCfg, joint: Joint, moment: f64) -> Self {
        let mut lab = Lab::new(cfg);
        let text = urdf(&[base(), Link::new("wheel", 1.0, [moment; 3])], &[joint]);
        let robot = lab.robot(&text, RobotCfg { drive, ..RobotCfg::default() });
        Self { lab, robot }
    }

    /// Sets the target position \[rad\].
    pub(super) fn set_target_position(&mut self, position: f64) {
        self.lab.sim.robot_mut(self.robot).set_qpos_target(&row(&[position]), None, None).unwrap();
    }

    /// Sets the target velocity \[rad/s\].
    pub(super) fn set_target_velocity(&mut self, velocity: f64) {
        self.lab.sim.robot_mut(self.robot).set_qvel_target(&row(&[velocity]), None, None).unwrap();
    }

    /// Sets the joint effort, which adds to that of the drive \[N m\].
    pub(super) fn set_effort(&mut self, effort: f64) {
        self.lab.set_joint_efforts(self.robot, &[effort]);
    }

    /// Sets an external torque \[N m\].
    pub(super) fn set_external_torque(&mut self, torque: f64) {
        let [zero, torque] = [0.0, torque].map(|z| nalgebra::Vector3::new(0.0, 0.0, z));
        self.lab.set_link_wrench(self.robot, "wheel", zero, torque);
    }

    pub(super) fn q(&self) -> f64 {
        self.lab.q(self.robot)[0]
    }

    pub(super) fn v(&self) -> f64 {
        self.lab.v(self.robot)[0]
    }

    /// Effort of the drive in the last step \[N m\].
    pub(super) fn drive_effort(&self) -> f64 {
        self.lab.effort(self.robot)[0]
    }
}
