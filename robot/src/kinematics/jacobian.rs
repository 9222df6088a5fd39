//! Geometric Jacobian of a chain.

use super::chain::Chain;
use kinetoscope_scene::Pose;
use nalgebra::{Vector3, Vector6};

impl Chain {
    /// Computes the geometric Jacobian at `positions` \[rad or m\] and returns the pose of the frame.
    ///
    /// `columns` receives one column for each variable: the velocity of the origin of the frame, then its angular
    /// velocity, both in the axes of the base link, per unit of the variable \[m/rad, rad/rad, m/m\].
    ///
    /// A revolute joint with the axis a through o gives (a × (p - o), a) at the origin p of the frame, a prismatic
    /// joint (a, 0). Source: Siciliano et al., "Robotics", Springer 2009, equation 3.30. A mimic joint adds its own
    /// velocity times its multiplier to the column of its driver.
    ///
    /// # Panics
    /// If there are fewer positions or columns than [`variables`](Self::variables).
    #[track_caller]
    pub fn jacobian(&self, positions: &[f64], columns: &mut [Vector6<f64>]) -> Pose {
        columns.fill(Vector6::zeros());
        let mut pose = Pose::identity();
        for joint in &self.joints {
            pose *= joint.parent_from_joint;
            let axis = pose.rotation * joint.axis.into_inner() * joint.ratio;
            let column = &mut columns[joint.variable];
            if joint.is_prismatic {
                add(column, 0, &axis);
            } else {
                // Velocity of the point that coincides with the base; it is moved to the frame below.
                add(column, 0, &pose.translation.vector.cross(&axis));
                add(column, 3, &axis);
            }
            pose *= joint.transform(positions);
        }
        pose *= self.last_from_frame;
        pose.rotation.renormalize();
        for column in columns {
            let turned = Vector3::new(column[3], column[4], column[5]).cross(&pose.translation.vector);
            add(column, 0, &turned);
        }
        pose
    }
}

fn add(column: &mut Vector6<f64>, first: usize, part: &Vector3<f64>) {
    column[first] += part.x;
    column[first + 1] += part.y;
    column[first + 2] += part.z;
}
