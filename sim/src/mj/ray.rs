//! MuJoCo's own ray casting: a judge for ours.

use super::data::Data;
use super::error::EngineError;
use super::guard::guarded;
use mujoco_sys as mj;

/// What a ray hits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance in multiples of the ray's direction.
    pub distance: f64,
    /// The geom.
    pub geom: usize,
}

impl Data {
    /// The nearest geom of the groups in `groups` (bit k is group k) along a ray, by `mj_ray`. It sees planes from the
    /// front only, triangles from both sides, and nothing that is fully transparent. Poses are those of the last forward
    /// pass.
    ///
    /// # Errors
    /// MuJoCo's engine stopped.
    pub fn ray(&self, origin: [f64; 3], direction: [f64; 3], groups: u32) -> Result<Option<RayHit>, EngineError> {
        let groups: [u8; mj::mjNGROUP as usize] = std::array::from_fn(|k| u8::from(groups >> k & 1 == 1));
        let mut geom = -1;
        let (model, data) = (self.model().raw(), self.raw());
        let (origin, direction, groups) = (origin.as_ptr(), direction.as_ptr(), groups.as_ptr());
        #[cfg(mj4)]
        // SAFETY: model and data are alive and belong together; the arrays have the lengths that mj_ray reads (3, 3,
        // mjNGROUP); the normal may be null. It does not write to the data.
        let distance = guarded(|| unsafe {
            mj::mj_ray(model, data, origin, direction, groups, true, -1, &raw mut geom, std::ptr::null_mut())
        })?;
        #[cfg(not(mj4))]
        // SAFETY: as above.
        let distance = guarded(|| unsafe { mj::mj_ray(model, data, origin, direction, groups, 1, -1, &raw mut geom) })?;
        Ok(usize::try_from(geom).ok().filter(|_| distance >= 0.0).map(|geom| RayHit { distance, geom }))
    }
}
