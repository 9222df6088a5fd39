//! MuJoCo's ray casting: a reference for the ray casting of `kinetoscope-render`.

use super::data::Data;
use super::error::EngineError;
use super::guard::guarded;
use mujoco_sys as mj;

/// Intersection of a ray with a geom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// Distance along the ray, in multiples of the length of its direction.
    pub distance: f64,
    /// Index of the geom in the model (MuJoCo's geom id).
    pub geom: usize,
}

impl Data {
    /// Returns the nearest intersection of a ray with a geom (`mj_ray`); `None` if the ray hits nothing.
    ///
    /// Bit k of `groups` includes the geoms of group k (0 to 5), also those that are fixed to the world. Planes are hit
    /// from the front only, triangles from both sides, and fully transparent geoms never. Origin and direction are in
    /// the world frame \[m\]. Poses are those of the last forward pass.
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

    /// Computes the nearest intersections of rays from one point (`mj_multiRay`), by the rules of [`ray`](Self::ray).
    /// `origin` and `directions` are in the world frame \[m\].
    ///
    /// `distances` receives distances in multiples of the lengths of the directions, -1 for a ray without a hit. MuJoCo
    /// culls geoms for all rays at once.
    ///
    /// # Errors
    /// MuJoCo's engine stopped. On 2.2.2, which has no `mj_multiRay`, always.
    ///
    /// # Panics
    /// `directions` and `distances` have different lengths.
    #[track_caller]
    pub fn multi_ray(
        &mut self,
        origin: [f64; 3],
        directions: &[[f64; 3]],
        groups: u32,
        distances: &mut [f64],
    ) -> Result<(), EngineError> {
        assert_eq!(directions.len(), distances.len(), "directions and distances differ in length");
        #[cfg(mj4)]
        {
            let groups: [u8; mj::mjNGROUP as usize] = std::array::from_fn(|k| u8::from(groups >> k & 1 == 1));
            let count = i32::try_from(directions.len()).unwrap_or(i32::MAX);
            // MuJoCo's largest number: the cutoff excludes no hit.
            let cutoff = 1e10;
            let (data, model) = (self.raw_mut(), self.model().raw());
            let (from, along, groups) = (origin.as_ptr(), directions.as_ptr().cast(), groups.as_ptr());
            let (to, geoms, normals) = (distances.as_mut_ptr(), std::ptr::null_mut(), std::ptr::null_mut());
            // SAFETY: model and data are alive and belong together, and the data, whose stack it works on, is borrowed
            // mutably; the arrays have the lengths that mj_multiRay reads and writes (3, 3 for each of `count` rays,
            // mjNGROUP, and `count` distances); those for geoms and normals may be null.
            guarded(|| unsafe {
                mj::mj_multiRay(model, data, from, along, groups, true, -1, geoms, to, normals, count, cutoff);
            })
        }
        #[cfg(not(mj4))]
        {
            let _ = (origin, groups);
            Err(EngineError { message: "this version of MuJoCo has no mj_multiRay".into() })
        }
    }
}
