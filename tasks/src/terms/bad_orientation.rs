//! Robots that lie down.

use crate::termination::TerminationTerm;
use kinetoscope_sim::RobotId;

/// Ends where the upward axis of the root link of a robot is farther than an angle from the world's \[rad\].
pub fn bad_orientation(name: &str, robot: RobotId, angle: f64) -> TerminationTerm {
    TerminationTerm::new(name, move |now| {
        let poses = now.sim().robot(robot).root_pose();
        // Of w, x, y, z: the last element of the rotation matrix is the cosine of the angle between the two axes.
        let cosine = |[x, y]: [f64; 2]| (1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0);
        Ok(poses.rows().into_iter().map(|row| cosine([row[4], row[5]]).acos() > angle).collect())
    })
}
