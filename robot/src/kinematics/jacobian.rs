//! How joints move frames.

use super::chain::Chain;
use kinetoscope_scene::Pose;
use nalgebra::{Vector3, Vector6};

impl Chain {
    /// The geometric Jacobian at `positions` \[rad or m\]: for each variable the velocity of the origin of the frame
    /// and its angular velocity, both in the axes of the base link, per unit of the variable \[m/rad, rad/rad, m/m\].
    /// Returns the pose of the frame.
    ///
    /// A turning joint with the axis a through o gives (a × (p - o), a) at the origin p of the frame, a sliding one (a,
    /// 0). Source: Siciliano et al., "Robotics", Springer 2009, equation 3.30. What follows a variable by a ratio adds
    /// that much of its own.
    ///
    /// # Panics
    /// If there are fewer positions or columns than [`variables`](Self::variables).
    #[track_caller]
    pub fn jacobian(&self, positions: &[f64], columns: &mut [Vector6<f64>]) -> Pose {
        columns.fill(Vector6::zeros());
        let mut pose = Pose::identity();
        for joint in &self.joints {
            pose *= joint.before;
            let axis = pose.rotation * joint.axis.into_inner() * joint.ratio;
            let column = &mut columns[joint.variable];
            if joint.slides {
                add(column, 0, &axis);
            } else {
                // The velocity of the point that passes through the base; it goes to the frame below.
                add(column, 0, &pose.translation.vector.cross(&axis));
                add(column, 3, &axis);
            }
            pose *= joint.moved(positions);
        }
        pose *= self.end;
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
