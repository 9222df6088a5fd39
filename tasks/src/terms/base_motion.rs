//! How the root of a robot moves and stands, in its own axes.

use crate::observation::ObservationTerm;
use kinetoscope_sim::RobotId;

const AXES: [&str; 3] = ["x", "y", "z"];

/// Velocity of the root link's frame in its own axes \[m/s\].
pub fn base_lin_vel(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, AXES, move |now| Ok(now.sim().robot(robot).root_lin_vel_b()))
}

/// Angular velocity of the root link in its own axes \[rad/s\].
pub fn base_ang_vel(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, AXES, move |now| Ok(now.sim().robot(robot).root_ang_vel_b()))
}

/// Direction of gravity in the axes of the root link, of length 1: (0, 0, -1) where it stands upright.
pub fn projected_gravity(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, AXES, move |now| Ok(now.sim().robot(robot).projected_gravity_b()))
}
