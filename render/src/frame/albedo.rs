//! Albedo: base color of the surface without lighting.

use super::{Channel, PixelGroup, Stage, copy_row};
use ndarray::Ix4;

/// Base color of the surface (sRGB, without a tone curve) and opacity: 255, or 0 where no surface was hit.
///
/// The material's color times its texture, without light, shadow, highlight, mirror, emission or haze: a material of
/// `rgba` (0.5, 0.5, 0.5) is 128 everywhere. The surface is the one of the mask channel, transparent or not.
#[derive(Clone, Copy, Debug)]
pub struct Albedo;

impl Channel for Albedo {
    type Element = u8;
    type Layout = Ix4;
    const NAME: &'static str = "albedo";
    const ALIASES: &'static [&'static str] = &["diffuse_albedo"];
    const COMPONENTS: usize = 4;
    const STAGE: Stage = Stage::Albedo;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [u8]) {
        out.copy_from_slice(&group.albedo[lane]);
    }

    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [u8]) {
        copy_row::<32, _>(&group.albedo.as_flattened()[4 * first..], out);
    }
}
