//! The rays of all rows of a camera: rows of the same intrinsics share them.

use super::{Lens, LensRays, Optics};
use crate::intrinsics::PixelIntrinsics;
use crate::optics_error::OpticsError;
use std::sync::Arc;

/// The most memory that the rays of a camera may take \[bytes\].
const MAX_BYTES: usize = 16 << 30;

/// The lens of a camera and its rays; none for a pinhole.
#[derive(Clone, Debug)]
pub struct RaysOfRows {
    lens: Lens,
    size: [usize; 2],
    samples: u8,
    /// Those that are configured, and those that were set.
    known: Vec<Arc<LensRays>>,
    rows: Vec<Option<Arc<LensRays>>>,
}

impl RaysOfRows {
    /// The rays of a lens with the same pixels in every row.
    pub fn new(
        lens: Lens,
        pixels: &PixelIntrinsics,
        size: [usize; 2],
        samples: u8,
        rows: usize,
    ) -> Result<Self, OpticsError> {
        let mut all = Self { lens, size, samples, known: Vec::new(), rows: vec![None; rows] };
        all.known = all.make(std::slice::from_ref(pixels))?;
        let first = all.known.first().cloned();
        all.rows.fill(first);
        Ok(all)
    }

    /// The lens of all rows.
    pub fn lens(&self) -> Lens {
        self.lens
    }

    /// The rays of a row; `None` for a pinhole.
    ///
    /// # Panics
    /// If there is no such row.
    #[track_caller]
    pub fn row(&self, row: usize) -> Option<&LensRays> {
        self.rows[row].as_deref()
    }

    /// The rays of a row, to keep.
    #[track_caller]
    pub fn shared(&self, row: usize) -> Option<&Arc<LensRays>> {
        self.rows[row].as_ref()
    }

    /// The rays of some pixels, those of the same ones once; none for a pinhole.
    pub fn make(&self, pixels: &[PixelIntrinsics]) -> Result<Vec<Arc<LensRays>>, OpticsError> {
        if self.lens.is_pinhole() {
            self.lens.domain()?;
            return Ok(Vec::new());
        }
        let mut made: Vec<Arc<LensRays>> = Vec::new();
        for pixels in pixels {
            if made.iter().any(|rays| rays.optics().pixels() == *pixels) {
                continue;
            }
            if let Some(known) = self.known.iter().find(|rays| rays.optics().pixels() == *pixels) {
                made.push(Arc::clone(known));
                continue;
            }
            let bytes = LensRays::bytes_of(self.size, self.samples).saturating_mul(made.len() + 1);
            let granted = bytes <= MAX_BYTES && Vec::<u8>::new().try_reserve_exact(bytes).is_ok();
            if !granted {
                return Err(OpticsError::LensMemory { tables: made.len() + 1, bytes, limit: MAX_BYTES });
            }
            let optics = Optics::new(self.lens, *pixels)?;
            made.push(Arc::new(LensRays::new(&optics, self.size, self.samples)?));
        }
        Ok(made)
    }

    /// Gives rows the rays of their pixels, which were made or are known.
    pub fn set(&mut self, made: Vec<Arc<LensRays>>, rows: &[usize], pixels: impl Fn(usize) -> PixelIntrinsics) {
        if self.lens.is_pinhole() {
            return;
        }
        for rays in made {
            if !self.known.iter().any(|known| Arc::ptr_eq(known, &rays)) {
                self.known.push(rays);
            }
        }
        for &row in rows {
            let pixels = pixels(row);
            let rays = self.known.iter().find(|rays| rays.optics().pixels() == pixels);
            self.rows[row] = rays.cloned();
        }
        self.forget();
    }

    /// Frees the rays that no row has, and nobody else.
    pub fn forget(&mut self) {
        // Nobody else has them: only these lists, twice where they are in use. The first are the configured ones.
        let mut number = 0;
        self.known.retain(|rays| {
            number += 1;
            number == 1 || Arc::strong_count(rays) > 1
        });
    }

    /// Memory held \[bytes\].
    pub fn bytes(&self) -> usize {
        self.known.iter().map(|rays| rays.bytes()).sum()
    }
}
