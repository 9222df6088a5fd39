//! Which instance is seen.

use super::{Channel, PixelGroup, Stage, copy_row};
use ndarray::Ix3;

/// Which link or object is seen: its mask id, whichever of the channel's names it was asked by.
///
/// Isaac's names `semantic_segmentation` and `instance_segmentation` turn this channel on, they do not choose what its numbers
/// mean: they are ids of links. Images of instances or semantic classes are made of them by a
/// `Segmentation`, which `SceneView::segmentation` knows.
#[derive(Clone, Copy, Debug)]
pub struct Mask;

impl Channel for Mask {
    type Number = i32;
    type Layout = Ix3;
    const NAME: &'static str = "mask";
    const ALIASES: &'static [&'static str] = &["segmentation", "semantic_segmentation", "instance_segmentation", "instance_segmentation_fast", "instance_id_segmentation_fast"];
    const COMPONENTS: usize = 1;
    const STAGE: Stage = Stage::Geometry;

    #[inline(always)]
    fn write(group: &PixelGroup, lane: usize, out: &mut [i32]) {
        out[0] = group.mask[lane];
    }

    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [i32]) {
        copy_row::<8, _>(&group.mask[first..], out);
    }
}
