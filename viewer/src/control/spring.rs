//! Virtual spring with which a viewer drags a body.

use kinetoscope_sim::{BodyMotion, EnvId, SimulationManager};
use nalgebra::{Point3, Vector3};

/// Angular frequency of a free body on the spring \[rad/s\]. The body comes within 2 % of the target in 0.7 s.
const FREQUENCY: f64 = 8.0;

/// A body in one environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct BodyRef {
    pub(super) env: EnvId,
    pub(super) body: usize,
}

/// A spring between a point of a body and a point of its environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spring {
    pub(super) env: EnvId,
    pub(super) body: usize,
    /// Attachment point in the body frame \[m\].
    pub(super) anchor: [f64; 3],
    /// Target point in the environment frame \[m\].
    pub(super) target: [f64; 3],
}

impl Spring {
    /// Returns the attachment point \[m\] and the force there \[N\], both in the environment frame. The force is that
    /// of a critically damped oscillator: `F = m (w² (target - point) - 2 w v)`. The mass m includes all bodies
    /// attached to the body.
    pub(super) fn force(&self, motion: &BodyMotion) -> ([f64; 3], [f64; 3]) {
        let point = (motion.pose * Point3::from(self.anchor)).coords;
        let arm = point - motion.pose.translation.vector;
        let velocity = Vector3::from(motion.linear) + Vector3::from(motion.angular).cross(&arm);
        let pull = FREQUENCY.powi(2) * (Vector3::from(self.target) - point) - 2.0 * FREQUENCY * velocity;
        (point.into(), (motion.carried_mass * pull).into())
    }

    /// Returns the body on the spring.
    pub(super) fn body_ref(&self) -> BodyRef {
        BodyRef { env: self.env, body: self.body }
    }

    /// Returns the current attachment point and force, or `None` if the body cannot move.
    ///
    /// # Errors
    /// The environment or body does not exist.
    pub(super) fn current_force(
        &self,
        sim: &SimulationManager,
    ) -> kinetoscope_sim::Result<Option<([f64; 3], [f64; 3])>> {
        let motion = sim.scene().body_motion(self.env, self.body)?;
        Ok((!motion.is_fixed).then(|| self.force(&motion)))
    }

    /// Applies the force of this spring alone to the next step.
    ///
    /// # Errors
    /// The environment or body does not exist, or a number is not finite.
    pub(super) fn apply(&self, sim: &mut SimulationManager) -> kinetoscope_sim::Result<()> {
        let force = self.current_force(sim)?;
        sim.scene_mut().set_point_forces(self.env, self.body, force.as_slice())
    }
}

/// Removes the spring force from a body.
pub(super) fn release(sim: &mut SimulationManager, BodyRef { env, body }: BodyRef) {
    // An error means that the body no longer exists; no force is left to remove.
    let _ = sim.scene_mut().set_point_forces(env, body, &[]);
}
