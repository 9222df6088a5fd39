//! Distance from the camera \[m\].

use super::{Channel, PixelGroup, Stage};

/// Distance from the camera \[m\].
#[derive(Clone, Copy, Debug)]
pub struct Distance;

impl Channel for Distance {
    type Number = f32;
    const NAME: &'static str = "distance";
    const COMPONENTS: usize = 1;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        out[0] = group.distance[lane];
    }
}
