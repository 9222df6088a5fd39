//! Geometric normal of the surface, facing the camera.

use super::{Channel, PixelGroup, Stage};
use ndarray::Ix4;

/// Geometric normal of the surface, facing the camera, unit, world frame; 0 where no surface was hit.
#[derive(Clone, Copy, Debug)]
pub struct Normal;

impl Channel for Normal {
    type Element = f32;
    type Layout = Ix4;
    const NAME: &'static str = "normal";
    const ALIASES: &'static [&'static str] = &["normals"];
    const COMPONENTS: usize = 3;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        for (out, axis) in out.iter_mut().zip(&group.normal) {
            *out = axis[lane];
        }
    }
}
