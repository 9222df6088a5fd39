//! Depth along the optical axis \[m\].

use super::{Channel, PixelGroup, Stage};

/// Depth along the optical axis \[m\].
#[derive(Clone, Copy, Debug)]
pub struct Depth;

impl Channel for Depth {
    type Number = f32;
    const NAME: &'static str = "depth";
    const COMPONENTS: usize = 1;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        out[0] = group.depth[lane];
    }
}
