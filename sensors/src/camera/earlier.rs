//! What cameras showed in the picture before: for optical flow.

use kinetoscope_render::request::Before;
use kinetoscope_render::visibility::View;
use kinetoscope_scene::PoseF32;
use ndarray::{Array2, Axis};

/// What each row showed in the picture before the present one.
#[derive(Clone, Debug)]
pub(super) struct Earlier {
    /// World from instance, shape \[rows, instances\].
    poses: Array2<PoseF32>,
    /// `None` where the present picture is the first.
    views: Vec<Option<View>>,
    /// From where, and how, the present pictures were captured: setters since move the present picture, and not what the
    /// next one starts from, whether somebody looked or not.
    captured: Vec<Option<View>>,
}

impl Earlier {
    pub(super) fn new(rows: usize, instances: usize) -> Self {
        let poses = Array2::from_elem((rows, instances), PoseF32::IDENTITY);
        Self { poses, views: vec![None; rows], captured: vec![None; rows] }
    }

    /// The present picture of a row is captured with this view.
    pub(super) fn capture(&mut self, row: usize, view: View) {
        self.captured[row] = Some(view);
    }

    /// The present picture of a row, with `poses` of all rows, becomes the one before. One that cannot be drawn is none.
    pub(super) fn keep(&mut self, row: usize, poses: &Array2<PoseF32>) {
        let poses = poses.index_axis(Axis(0), row);
        self.poses.index_axis_mut(Axis(0), row).assign(&poses);
        let can_be_drawn = |view: &View| view.validate().is_ok() && poses.iter().all(PoseF32::is_rigid);
        self.views[row] = self.captured[row].filter(can_be_drawn);
    }

    /// The next picture of a row is its first.
    pub(super) fn forget(&mut self, row: usize) {
        self.views[row] = None;
    }

    /// The picture before of a row.
    pub(super) fn of(&self, row: usize) -> Option<Before<'_>> {
        let (view, width) = (self.views[row].as_ref()?, self.poses.ncols());
        let poses = self.poses.as_slice()?.get(row * width..(row + 1) * width)?;
        Some(Before { poses, view })
    }
}
