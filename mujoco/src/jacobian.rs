//! MuJoCo's own kinematics: a judge for ours.

use super::data::Data;
use super::error::EngineError;
use super::guard::guarded;
use mujoco_sys as mj;

impl Data {
    /// Poses of bodies and centres of mass at the present positions, by `mj_kinematics` and `mj_comPos`: what
    /// [`jacobian`](Self::jacobian) needs, and nothing else.
    ///
    /// # Errors
    /// MuJoCo's engine stopped.
    pub fn place(&mut self) -> Result<(), EngineError> {
        let (model, data) = (self.model().raw(), self.raw_mut());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_kinematics(model, data) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_comPos(model, data) })
    }

    /// The Jacobian of a point that moves with a body, by `mj_jac`, row-major, (3, nv) each: velocity of the point and
    /// angular velocity in world axes per unit of each generalised velocity. Poses are those of the last forward pass
    /// or of [`place`](Self::place).
    ///
    /// # Errors
    /// MuJoCo's engine stopped.
    ///
    /// # Panics
    /// There is no such body; an array has not 3 nv numbers.
    #[track_caller]
    pub fn jacobian(
        &self,
        body: usize,
        point: [f64; 3],
        linear: &mut [f64],
        angular: &mut [f64],
    ) -> Result<(), EngineError> {
        let (model, data) = (self.model().raw(), self.raw());
        let (bodies, length) = (self.model().nbody(), 3 * self.model().nv());
        assert!(body < bodies, "body {body} of {bodies}");
        assert!(linear.len() == length && angular.len() == length, "arrays of {length} numbers");
        let (linear, angular) = (linear.as_mut_ptr(), angular.as_mut_ptr());
        // SAFETY: model and data are alive and belong together; the body exists; the arrays have the lengths that mj_jac
        // reads (3) and writes (3 nv each). It does not write to the data.
        guarded(|| unsafe { mj::mj_jac(model, data, linear, angular, point.as_ptr(), body as i32) })
    }
}
