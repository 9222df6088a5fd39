//! Shading normal: interpolated between vertices where the surface is smooth.

use super::{Channel, PixelGroup, Stage};
use ndarray::Ix4;

/// Interpolated normal used for shading, smooth where the surface is smooth, unit, world frame; 0 where no surface was
/// hit.
#[derive(Clone, Copy, Debug)]
pub struct ShadingNormal;

impl Channel for ShadingNormal {
    type Element = f32;
    type Layout = Ix4;
    const NAME: &'static str = "shading_normal";
    const ALIASES: &'static [&'static str] = &["shading_normals", "smooth_normals"];
    const COMPONENTS: usize = 3;
    const STAGE: Stage = Stage::Surface;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        for (out, axis) in out.iter_mut().zip(&group.shading_normal) {
            *out = axis[lane];
        }
    }
}
