//! MuJoCo's kinematics and Jacobians: a reference for those of `kinetoscope-robot`.

use super::data::Data;
use super::error::EngineError;
use super::guard::guarded;
use mujoco_sys as mj;

impl Data {
    /// Computes poses of bodies, geoms and sites, and centers of mass, at the current positions (`mj_kinematics`,
    /// `mj_comPos`).
    ///
    /// This is the part of a forward pass that [`jacobian`](Self::jacobian) needs.
    ///
    /// # Errors
    /// MuJoCo's engine stopped.
    pub fn kinematics(&mut self) -> Result<(), EngineError> {
        let (model, data) = (self.model().raw(), self.raw_mut());
        // SAFETY: model and data are alive and belong together; an engine function (guarded).
        guarded(|| unsafe { mj::mj_kinematics(model, data) })?;
        // SAFETY: as above.
        guarded(|| unsafe { mj::mj_comPos(model, data) })
    }

    /// Computes the Jacobian of a point that moves with a body (`mj_jac`), row-major, shape (3, nv) each.
    ///
    /// `point` is in the world frame \[m\]. `linear` receives the velocity of the point, and `angular` the angular
    /// velocity, in world axes and per unit of each generalized velocity. Poses are those of the last forward pass or
    /// of [`kinematics`](Self::kinematics).
    ///
    /// # Errors
    /// MuJoCo's engine stopped.
    ///
    /// # Panics
    /// `body` is out of range, or an array does not have 3 nv numbers.
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
        // SAFETY: model and data are alive and belong together; the body exists; the arrays have the lengths that
        // mj_jac reads (3) and writes (3 nv each). It does not write to the data.
        guarded(|| unsafe { mj::mj_jac(model, data, linear, angular, point.as_ptr(), body as i32) })
    }
}
