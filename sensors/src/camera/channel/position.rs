//! Where the surface is \[m\].

use super::{Channel, PixelGroup, Stage};

/// Where the surface is \[m\].
#[derive(Clone, Copy, Debug)]
pub struct Position;

impl Channel for Position {
    type Number = f32;
    const NAME: &'static str = "position";
    const COMPONENTS: usize = 3;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        for (out, axis) in out.iter_mut().zip(&group.position) {
            *out = axis[lane];
        }
    }
}
