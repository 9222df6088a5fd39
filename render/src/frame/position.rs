//! Position of the surface \[m\].

use super::{Channel, PixelGroup, Stage};
use ndarray::Ix4;

/// Position of the surface in the frame of the environment \[m\]; 0 where no surface was hit.
#[derive(Clone, Copy, Debug)]
pub struct Position;

impl Channel for Position {
    type Element = f32;
    type Layout = Ix4;
    const NAME: &'static str = "position";
    const ALIASES: &'static [&'static str] = &["positions", "position_map"];
    const COMPONENTS: usize = 3;
    const STAGE: Stage = Stage::Surface;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        for (out, axis) in out.iter_mut().zip(&group.position) {
            *out = axis[lane];
        }
    }
}
