//! Flags for the start height of a robot on the ground, the same as those of `kinetoscope view`.

use clap::Args;
use kinetoscope::prelude::*;

/// Start height of the robot, and the ground.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct SpawnFlags {
    /// Initial height of the robot's lowest collision point above the ground, in meters [default: the start pose of the
    /// example or of the MJCF file]
    #[arg(long, alias = "spawn_height", value_name = "METERS", allow_negative_numbers = true)]
    spawn_height: Option<f64>,
    /// Leave out the ground: the robot falls
    #[arg(long, alias = "no_ground")]
    pub(crate) no_ground: bool,
}

impl SpawnFlags {
    /// Sets the ground of a simulation and the start height of its robot.
    ///
    /// # Errors
    /// The height is not finite.
    pub(crate) fn apply(self, simulation: &mut SimulationManagerCfg, robot: &mut RobotCfg) -> super::Result {
        if let Some(height) = self.spawn_height.filter(|height| !height.is_finite()) {
            return Err(format!("--spawn-height {height}: must be a height in meters, such as 0.1").into());
        }
        robot.ground_clearance = self.spawn_height.or(robot.ground_clearance);
        if self.no_ground {
            simulation.ground = None;
        }
        Ok(())
    }
}
