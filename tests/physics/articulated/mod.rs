//! Mechanisms: bodies connected by joints.

mod newton_euler;
mod test_robots;

mod atwood_machine;
mod bead_on_a_rod;
mod bias_forces;
mod cart_pole;
mod conical_pendulum;
pub(crate) mod double_pendulum_energy;
mod equations_of_motion;
mod falling_rod;
mod four_bar;
mod free_fall_energy;
mod geared_inertia;
mod gravity_torques;
mod gyroscope;
mod internal_momentum;
mod jacobian;
mod kater_pendulum;
mod mass_matrix;
mod normal_modes;
mod parallel_axis;
mod pendulum_period;
mod skater;
mod slider_crank;
mod virtual_work;
mod viscous_joint;
