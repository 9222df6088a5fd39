//! Depth along the optical axis \[m\].

use super::{Channel, PixelGroup, Stage, copy_row};
use ndarray::Ix3;

/// Depth along the optical axis \[m\]; +inf where no surface was hit. Negative behind the camera, which lenses of more
/// than 180 degrees see.
#[derive(Clone, Copy, Debug)]
pub struct Depth;

impl Channel for Depth {
    type Element = f32;
    type Layout = Ix3;
    const NAME: &'static str = "depth";
    const ALIASES: &'static [&'static str] = &["distance_to_image_plane"];
    const COMPONENTS: usize = 1;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        out[0] = group.depth[lane];
    }

    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [f32]) {
        copy_row::<8, _>(&group.depth[first..], out);
    }

    fn replace_misses(numbers: &mut [f32], value: f32) {
        numbers.iter_mut().filter(|x| x.is_infinite()).for_each(|x| *x = value);
    }
}
