//! Height of the root link; its velocity and orientation in its own frame.

use crate::observation::ObservationTerm;
use kinetoscope_sim::RobotId;
use ndarray::{Axis, Slice};

const AXES: [&str; 3] = ["x", "y", "z"];

/// Linear velocity of the root link's origin in the axes of the root link \[m/s\]; 0 for a fixed base.
pub fn base_lin_vel(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, AXES, move |now| Ok(now.robot(robot).root_lin_vel_b().to_owned()))
}

/// Angular velocity of the root link in its own axes \[rad/s\]; 0 for a fixed base.
pub fn base_ang_vel(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, AXES, move |now| Ok(now.robot(robot).root_ang_vel_b().to_owned()))
}

/// Unit vector of gravity in the axes of the root link: (0, 0, -1) if the root is upright; 0 without gravity.
pub fn projected_gravity(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, AXES, move |now| Ok(now.robot(robot).projected_gravity_b().to_owned()))
}

/// Height of the root link's origin in the environment frame \[m\], not above terrain.
pub fn base_pos_z(name: &str, robot: RobotId) -> ObservationTerm {
    ObservationTerm::new(name, ["z"], move |now| {
        Ok(now.robot(robot).root_pose().slice_axis(Axis(1), Slice::from(2..3)).to_owned())
    })
}
