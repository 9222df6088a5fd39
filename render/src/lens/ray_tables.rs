//! Rays of all views of a camera: views with the same intrinsics share them.

use super::{Lens, LensRays, Optics};
use crate::intrinsics::PixelIntrinsics;
use crate::optics_error::OpticsError;
use std::sync::Arc;

/// Largest memory of the rays that one call returns \[bytes\].
const MAX_BYTES: usize = 16 << 30;

/// Lens of a camera, and the rays of each of its views (rows). A lens without distortion has no rays.
#[derive(Clone, Debug)]
pub struct LensRayTables {
    lens: Lens,
    size: [usize; 2],
    samples: u8,
    /// Rays for the configured intrinsics, and for intrinsics that were set later.
    tables: Vec<Arc<LensRays>>,
    rows: Vec<Option<Arc<LensRays>>>,
}

impl LensRayTables {
    /// Computes the rays of a lens for `rows` views with the same intrinsics. `size` is the image size (width, height),
    /// `samples` the number of color samples per pixel, 1 or 4.
    ///
    /// # Errors
    ///
    /// Those of [`Lens::domain`], [`Optics::new`] and [`LensRays::new`], and [`OpticsError::LensMemory`].
    pub fn new(
        lens: Lens,
        pixels: &PixelIntrinsics,
        size: [usize; 2],
        samples: u8,
        rows: usize,
    ) -> Result<Self, OpticsError> {
        let mut all = Self { lens, size, samples, tables: Vec::new(), rows: vec![None; rows] };
        all.tables = all.compute(std::slice::from_ref(pixels))?;
        let first = all.tables.first().cloned();
        all.rows.fill(first);
        Ok(all)
    }

    /// Lens of all views.
    pub fn lens(&self) -> Lens {
        self.lens
    }

    /// Rays of view `row`; `None` for a lens without distortion.
    ///
    /// # Panics
    ///
    /// If `row` is out of range.
    #[track_caller]
    pub fn row(&self, row: usize) -> Option<&LensRays> {
        self.rows[row].as_deref()
    }

    /// Rays of view `row`, as the `Arc` that views with the same intrinsics share; `None` for a lens without
    /// distortion.
    ///
    /// # Panics
    ///
    /// If `row` is out of range.
    #[track_caller]
    pub fn shared(&self, row: usize) -> Option<&Arc<LensRays>> {
        self.rows[row].as_ref()
    }

    /// Returns the rays of several intrinsics, once for equal ones. Rays of intrinsics that are in use are not computed
    /// again. The list is empty for a lens without distortion.
    ///
    /// # Errors
    ///
    /// Same as [`new`](Self::new).
    pub fn compute(&self, pixels: &[PixelIntrinsics]) -> Result<Vec<Arc<LensRays>>, OpticsError> {
        if self.lens.is_pinhole() {
            self.lens.domain()?;
            return Ok(Vec::new());
        }
        let mut made: Vec<Arc<LensRays>> = Vec::new();
        for pixels in pixels {
            if made.iter().any(|rays| rays.optics().pixels() == *pixels) {
                continue;
            }
            if let Some(known) = self.tables.iter().find(|rays| rays.optics().pixels() == *pixels) {
                made.push(Arc::clone(known));
                continue;
            }
            let bytes = LensRays::table_bytes(self.size, self.samples).saturating_mul(made.len() + 1);
            let granted = bytes <= MAX_BYTES && Vec::<u8>::new().try_reserve_exact(bytes).is_ok();
            if !granted {
                return Err(OpticsError::LensMemory { tables: made.len() + 1, bytes, limit: MAX_BYTES });
            }
            let optics = Optics::new(self.lens, *pixels)?;
            made.push(Arc::new(LensRays::new(&optics, self.size, self.samples)?));
        }
        Ok(made)
    }

    /// Assigns rays to the views `rows`. `pixels(row)` returns the intrinsics of a view. `made` must be the result of
    /// [`compute`](Self::compute) for these intrinsics. Does nothing for a lens without distortion.
    ///
    /// # Panics
    ///
    /// If a row is out of range.
    pub fn set(&mut self, made: Vec<Arc<LensRays>>, rows: &[usize], pixels: impl Fn(usize) -> PixelIntrinsics) {
        if self.lens.is_pinhole() {
            return;
        }
        for rays in made {
            if !self.tables.iter().any(|known| Arc::ptr_eq(known, &rays)) {
                self.tables.push(rays);
            }
        }
        for &row in rows {
            let pixels = pixels(row);
            let rays = self.tables.iter().find(|rays| rays.optics().pixels() == pixels);
            self.rows[row] = rays.cloned();
        }
        self.drop_unused();
    }

    /// Drops the rays without users, except for those of the configured intrinsics.
    pub fn drop_unused(&mut self) {
        // Rays in use are referenced by a row or elsewhere too. The first ones are the configured ones.
        let mut number = 0;
        self.tables.retain(|rays| {
            number += 1;
            number == 1 || Arc::strong_count(rays) > 1
        });
    }

    /// Memory held \[bytes\].
    pub fn bytes(&self) -> usize {
        self.tables.iter().map(|rays| rays.bytes()).sum()
    }
}
