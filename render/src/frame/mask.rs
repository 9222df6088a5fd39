//! Segmentation mask: id of the visible instance.

use super::{Channel, PixelGroup, Stage, copy_row};
use ndarray::Ix3;

/// Mask id of the visible link or object; 0 where no surface was hit.
///
/// Isaac's names `semantic_segmentation` and `instance_segmentation` select this channel too; its numbers are always
/// mask ids, one for each link or object. `SceneView::segmentation` returns a `Segmentation`, which converts mask
/// images to images of instances or semantic classes.
#[derive(Clone, Copy, Debug)]
pub struct Mask;

impl Channel for Mask {
    type Element = i32;
    type Layout = Ix3;
    const NAME: &'static str = "mask";
    const ALIASES: &'static [&'static str] = &[
        "segmentation",
        "semantic_segmentation",
        "instance_segmentation",
        "instance_segmentation_fast",
        "instance_id_segmentation_fast",
    ];
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
