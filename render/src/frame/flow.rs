//! How far what is seen has moved in the image.

use super::{Channel, PixelGroup, Stage};
use ndarray::Ix4;

/// Optical flow \[pixels\]: how far the point of the surface that this pixel sees has moved in the image since the image
/// before, u to the right and v down. It was at (u + 0.5 - flow u, v + 0.5 - flow v) then, in the image or beside it.
///
/// It is exact, from the poses of the thing and of the camera at both instants, and the lenses of both; whether something hid
/// the point before it does not say. Exactly 0 where neither moved. +inf where nothing was hit, where the point was not in
/// front of the camera before (behind a lens: where the lens did not see it, [`Optics::domain`](crate::lens::optics::Optics::domain)), and in the
/// first image, which has none before it. Of what crosses the seam of a panorama it is a whole turn, 2 pi fx, less or more.
/// Isaac's `motion_vectors` are minus this: they count to the left and up.
#[derive(Clone, Copy, Debug)]
pub struct Flow;

impl Channel for Flow {
    type Number = f32;
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
