//! Distance from the camera \[m\].

use super::{Channel, PixelGroup, Stage, copy_row};
use ndarray::Ix3;

/// Distance from the camera \[m\]; +inf where no surface was hit.
#[derive(Clone, Copy, Debug)]
pub struct Distance;

impl Channel for Distance {
    type Element = f32;
    type Layout = Ix3;
    const NAME: &'static str = "distance";
    const ALIASES: &'static [&'static str] = &["distance_to_camera"];
    const COMPONENTS: usize = 1;
    const STAGE: Stage = Stage::Surface;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        out[0] = group.distance[lane];
    }

    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [f32]) {
        copy_row::<8, _>(&group.distance[first..], out);
    }

    fn replace_misses(numbers: &mut [f32], value: f32) {
        numbers.iter_mut().filter(|x| x.is_infinite()).for_each(|x| *x = value);
    }
}
