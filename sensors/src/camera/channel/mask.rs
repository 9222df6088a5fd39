//! Which instance is seen.

use super::{Channel, PixelGroup, Stage};

/// Which instance is seen.
#[derive(Clone, Copy, Debug)]
pub struct Mask;

impl Channel for Mask {
    type Number = i32;
    const NAME: &'static str = "mask";
    const COMPONENTS: usize = 1;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [i32]) {
        out[0] = group.mask[lane];
    }
}
