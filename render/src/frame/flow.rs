//! Optical flow: motion of the visible surface in the image.

use super::{Channel, PixelGroup, Stage};
use ndarray::Ix4;

/// Optical flow \[pixels\]: motion of the visible surface point since the previous frame, u to the right and v down.
/// The point seen in column i and row j was at (i + 0.5 - u, j + 0.5 - v) in the previous frame, inside or outside of
/// the image.
///
/// The flow is exact: it comes from the poses of the instance and of the camera at both instants, and from both lenses.
/// It does not tell if the point was occluded in the previous frame. It is exactly 0 where neither instance nor camera
/// moved.
///
/// It is +inf where no surface was hit, where the point was not in front of the camera in the previous frame (for
/// lenses: outside of [`Optics::domain`](crate::lens::optics::Optics::domain)), and in frames without a previous frame.
/// Across the seam of a panorama it is a whole turn, 2 pi fx, less or more. Isaac's `motion_vectors` have the opposite
/// sign: left and up.
#[derive(Clone, Copy, Debug)]
pub struct Flow;

impl Channel for Flow {
    type Element = f32;
    type Layout = Ix4;
    const NAME: &'static str = "flow";
    const ALIASES: &'static [&'static str] = &["optical_flow"];
    const COMPONENTS: usize = 2;
    const STAGE: Stage = Stage::Flow;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [f32]) {
        for (out, axis) in out.iter_mut().zip(&group.flow) {
            *out = axis[lane];
        }
    }
}
