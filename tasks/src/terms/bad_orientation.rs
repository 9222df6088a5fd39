//! Termination by a tilted root link.

use crate::termination::TerminationTerm;
use kinetoscope_sim::RobotId;

/// Creates a term called `name` that terminates environments in which the z axis of the root link deviates from the
/// world's z axis by more than `angle` \[rad\].
pub fn bad_orientation(name: &str, robot: RobotId, angle: f64) -> TerminationTerm {
    TerminationTerm::new(name, move |now| {
        let poses = now.robot(robot).root_pose();
        // With a quaternion (w, x, y, z), this element of the rotation matrix is the cosine of the angle between the z
        // axes.
        let cosine = |[x, y]: [f64; 2]| (1.0 - 2.0 * (x * x + y * y)).clamp(-1.0, 1.0);
        Ok(poses.rows().into_iter().map(|row| cosine([row[4], row[5]]).acos() > angle).collect())
    })
}
