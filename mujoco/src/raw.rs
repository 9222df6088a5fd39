//! Access to MuJoCo's structs, for C functions that this crate does not wrap.

use super::data::Data;
use super::error::EngineError;
use super::guard::guarded;
use mujoco_sys as mj;

impl Data {
    /// Calls `call` with the raw model and data, for the C functions that are declared in [`sys`](crate::sys).
    ///
    /// An error inside MuJoCo (`mju_error`) ends `call` and becomes an `Err`. The data must then be reset or dropped.
    ///
    /// # Errors
    /// MuJoCo's engine stopped.
    ///
    /// # Safety
    /// `call` may use the pointers until it returns. It may write numbers to arrays of the data, and must write nothing
    /// to the model, which environments and threads share. It must not free, move or resize anything that the structs
    /// point to, and must not call the functions of MuJoCo that read or write files (XML, VFS, plugins): errors cannot
    /// be unwound through these. No value with a destructor may be alive in `call` while MuJoCo runs.
    pub unsafe fn with_raw<T>(
        &mut self,
        call: impl FnOnce(*const mj::mjModel, *mut mj::mjData) -> T,
    ) -> Result<T, EngineError> {
        let (model, data) = (self.model().raw(), self.raw_mut());
        guarded(|| call(model, data))
    }
}
