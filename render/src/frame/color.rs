//! Color after the tone curve (sRGB) and opacity (always 255).

use super::{Channel, PixelGroup, Stage, copy_row};
use ndarray::Ix4;

/// Color after the tone curve (sRGB) and opacity (always 255).
#[derive(Clone, Copy, Debug)]
pub struct Color;

impl Channel for Color {
    type Element = u8;
    type Layout = Ix4;
    const NAME: &'static str = "color";
    const ALIASES: &'static [&'static str] = &["rgb", "rgba"];
    const COMPONENTS: usize = 4;
    const STAGE: Stage = Stage::Color;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [u8]) {
        out.copy_from_slice(&group.color[lane]);
    }

    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [u8]) {
        copy_row::<32, _>(&group.color.as_flattened()[4 * first..], out);
    }
}
