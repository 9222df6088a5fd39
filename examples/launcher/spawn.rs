//! Flags for the start of a robot that stands on the ground, as those of `kinetoscope view`.

use clap::Args;
use kinetoscope::prelude::*;

/// Height of the robot at the start, and the ground.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct SpawnFlags {
    /// Height of the lowest collision point of the robot above the ground at the start, in metres; without it the robot starts
    /// where its pose in the example, or its MJCF file, puts it
    #[arg(long, alias = "spawn_height", value_name = "METRES", allow_negative_numbers = true)]
    spawn_height: Option<f64>,
    /// Leave out the ground: the robot falls
    #[arg(long, alias = "no_ground")]
    pub(crate) no_ground: bool,
}

impl SpawnFlags {
    /// Sets the ground of a simulation and the height of its robot.
    ///
    /// # Errors
    /// The height is not finite.
    pub(crate) fn apply(self, simulation: &mut SimulationManagerCfg, robot: &mut RobotCfg) -> super::Result {
        if let Some(height) = self.spawn_height.filter(|height| !height.is_finite()) {
            return Err(format!("--spawn-height {height}: give a height in metres, such as 0.1").into());
        }
        robot.ground_clearance = self.spawn_height.or(robot.ground_clearance);
        if self.no_ground {
            simulation.ground = None;
        }
        Ok(())
    }
}
