//! The spring by which a viewer drags a body.

use kinetoscope_sim::{BodyMotion, EnvId, SimulationManager};
use nalgebra::{Point3, Vector3};

/// Angular frequency of a free body on the spring \[rad/s\]: it comes within 2 % of where it is pulled in 0.7 s.
const FREQUENCY: f64 = 8.0;

/// A body in an environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct HeldBody {
    pub(super) env: EnvId,
    pub(super) body: usize,
}

/// A spring between a point of a body and a point of its environment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spring {
    pub(super) env: EnvId,
    pub(super) body: usize,
    /// In the body's frame \[m\].
    pub(super) hold: [f64; 3],
    /// In the environment \[m\].
    pub(super) target: [f64; 3],
}

impl Spring {
    /// Where it holds the body, and the force there \[N\]: of a critically damped oscillator,
    /// `F = m (w² (target - point) - 2 w v)`, with the mass of the body and all that hangs on it.
    pub(super) fn force(&self, motion: &BodyMotion) -> ([f64; 3], [f64; 3]) {
        let point = (motion.pose * Point3::from(self.hold)).coords;
        let arm = point - motion.pose.translation.vector;
        let velocity = Vector3::from(motion.linear) + Vector3::from(motion.angular).cross(&arm);
        let pull = FREQUENCY.powi(2) * (Vector3::from(self.target) - point) - 2.0 * FREQUENCY * velocity;
        (point.into(), (motion.carried_mass * pull).into())
    }

    /// What it holds.
    pub(super) fn held(&self) -> HeldBody {
        HeldBody { env: self.env, body: self.body }
    }

    /// Where it pulls with which force now; nowhere at what cannot move.
    ///
    /// # Errors
    /// There is no such environment or body.
    pub(super) fn force_now(&self, sim: &SimulationManager) -> kinetoscope_sim::Result<Option<([f64; 3], [f64; 3])>> {
        let motion = sim.scene().body_motion(self.env, self.body)?;
        Ok((!motion.is_fixed).then(|| self.force(&motion)))
    }

    /// Pulls for the next step, alone.
    ///
    /// # Errors
    /// There is nothing to pull at, or a number is not finite.
    pub(super) fn apply(&self, sim: &mut SimulationManager) -> kinetoscope_sim::Result<()> {
        let force = self.force_now(sim)?;
        sim.scene_mut().pull(self.env, self.body, force.as_slice())
    }
}

/// Lets go of a body.
pub(super) fn release(sim: &mut SimulationManager, HeldBody { env, body }: HeldBody) {
    // Of a body that is gone nothing has to be let go.
    let _ = sim.scene_mut().pull(env, body, &[]);
}
