//! Delivered frames of a camera: the latest one, shown or not, and the frame history.
//!
//! After a write to the state, a camera shows the state as written. Frames in flight at that time are still delivered
//! later. These frames are counted but not shown, because they are older than the write. A reader of every frame, such
//! as a recorder, uses [`Camera::latest_delivered`].

use super::cfg::CameraCfg;
use super::error::CameraError;
use super::extrinsics::CameraConvention;
use super::frame_buffer::FrameSource;
use super::sensor::Camera;
use super::sensor::rendering::RenderedImages;
use crate::cached::Cached;
use crate::error::SensorError;
use kinetoscope_render::frame::Channel;
use kinetoscope_render::frame::{ChannelLayout, ImageView, ListedChannel};
use kinetoscope_scene::pose::to_row;
use ndarray::{Array1, Array2, Array3, ArrayView, ArrayView2, Axis, Dimension};
use std::ops::Range;

/// Images of one channel in the frame history, shape (views, history, height, width) or (views, history, height, width,
/// components).
pub type HistoryView<'a, C> = ArrayView<'a, <C as Channel>::Element, <<C as Channel>::Layout as Dimension>::Larger>;

/// Images of the frame history, row by row, newest first within a row.
#[derive(Debug)]
pub(super) struct HistoryImages {
    images: RenderedImages,
    length: usize,
    /// Number of frames of each row delivered since the images were rendered.
    delivered_since: Vec<usize>,
}

impl HistoryImages {
    /// Creates the history images. The first `filled(row)` images of each row are outdated, the others are zero.
    pub(super) fn new(cfg: &CameraCfg, rows: usize, filled: impl Fn(usize) -> usize) -> Self {
        let length = cfg.history_length;
        let mut images = RenderedImages::new(cfg, rows * length);
        (0..rows * length).for_each(|image| images.set_stale(image, image % length < filled(image / length)));
        Self { images, length, delivered_since: vec![0; rows] }
    }

    fn row_range(&self, row: usize) -> Range<usize> {
        row * self.length..(row + 1) * self.length
    }

    /// Shifts the images of each row toward older entries, by the number of frames delivered since the last call. The
    /// first entries become outdated.
    fn move_up(&mut self) {
        for row in 0..self.delivered_since.len() {
            let by = std::mem::take(&mut self.delivered_since[row]);
            self.images.move_up(self.row_range(row), by);
        }
    }
}

impl Camera {
    /// Capture times of the latest delivered frames \[s\], shape (N). Equal to [`stamps`](Self::stamps), except with a
    /// latency after a write to the state, until a frame captured after the write is delivered. Equal to the stamps
    /// also before the first frame is delivered.
    pub fn latest_delivered_stamps(&self) -> Array1<f64> {
        let shown = self.stamps();
        Array1::from_shape_fn(shown.len(), |row| match self.frames.latest_if_not_shown(row) {
            Some(source) => source.frame.stamp,
            None => shown[row],
        })
    }

    /// Camera poses of the latest delivered frames, in the layout of [`pose_w`](Self::pose_w): the pose of the parent
    /// at the capture, and the local pose at the delivery. Without a latency, they equal `pose_w`.
    pub fn latest_delivered_pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let mut poses = self.pose_w(convention);
        for (row, mut pose) in poses.rows_mut().into_iter().enumerate() {
            if let Some(FrameSource { frame, viewpoint, .. }) = self.frames.latest_if_not_shown(row)
                && let Some(world) = self.viewpoints.world_from(viewpoint, frame.world_from_parent)
            {
                pose.iter_mut().zip(to_row(&convention.pose_from_optical(&world))).for_each(|(to, x)| *to = x);
            }
        }
        poses
    }

    /// Intrinsic matrices of the latest delivered frames at their delivery, in the layout of
    /// [`intrinsic_matrices`](Self::intrinsic_matrices). Without a latency, they equal `intrinsic_matrices`.
    pub fn latest_delivered_intrinsic_matrices(&self) -> Array3<f64> {
        let shown = self.intrinsic_matrices();
        Array3::from_shape_fn(shown.raw_dim(), |(row, i, j)| match self.frames.latest_if_not_shown(row) {
            Some(source) => source.viewpoint.pixels.matrix()[(i, j)],
            None => shown[(row, i, j)],
        })
    }

    /// Latest delivered images of one channel, in the shape of [`channel`](Self::channel). Images that are not shown
    /// are rendered on read, with the same noise as if they had been shown.
    ///
    /// # Errors
    ///
    /// Same as [`channel`](Self::channel).
    pub fn latest_delivered<C: ListedChannel>(&self) -> Result<ImageView<'_, C>, SensorError> {
        let rows = self.env_ids().len();
        if (0..rows).all(|row| self.frames.latest_if_not_shown(row).is_none()) {
            return self.channel::<C>();
        }
        self.require_channel::<C>()?;
        // All shown rows are rendered, although some may not be needed: the caller usually reads them anyway.
        let shown = self.images()?;
        let make = || {
            let mut images = RenderedImages::new(&self.cfg, rows);
            let seen = (0..rows).filter(|&row| self.frames.latest_if_not_shown(row).is_none());
            seen.for_each(|row| images.copy(row, shown, rows, row));
            Ok(images)
        };
        let images = self
            .latest_images
            .get_or_update(make, |images| self.render_stale(images, |row| self.frames.latest_if_not_shown(row)))?;
        images.images()?.get::<C>().ok_or_else(|| self.channel_off::<C>().into())
    }

    /// Maximum number of frames in the history: [`CameraCfg::history_length`](super::CameraCfg::history_length).
    pub fn history_length(&self) -> usize {
        self.cfg.history_length
    }

    /// Number of frames in the history of environment `env`, at most [`history_length`](Self::history_length).
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see.
    pub fn history_filled(&self, env: usize) -> Result<usize, SensorError> {
        Ok(self.frames.stamp_history().filled(self.row(env)?))
    }

    /// Capture times of the frames in the history \[s\], newest first, shape (N, history_length); 0 for entries not
    /// filled yet.
    pub fn stamp_history(&self) -> ArrayView2<'_, f64> {
        self.frames.stamp_history().view().index_axis_move(Axis(2), 0)
    }

    /// Images of one channel in the history, newest first: `camera.history::<Depth>()?`. The shape is (N,
    /// history_length, H, W) or (N, history_length, H, W, components); entries not filled yet are zero. Renders the
    /// images that were not read before.
    ///
    /// The newest image equals that of [`channel`](Self::channel) until the state is written to or the camera moves.
    ///
    /// # Errors
    ///
    /// [`CameraError::ChannelOff`], and [`CameraError::Render`] while the history holds a frame that cannot be
    /// rendered.
    pub fn history<C: ListedChannel>(&self) -> Result<HistoryView<'_, C>, SensorError> {
        self.require_channel::<C>()?;
        let (rows, length, (height, width)) = (self.env_ids().len(), self.history_length(), self.image_shape());
        let of_one = C::Layout::dimension(length, height, width, C::COMPONENTS);
        let mut shape = <C::Layout as Dimension>::Larger::default();
        shape[0] = rows;
        for (axis, size) in of_one.slice().iter().enumerate() {
            shape[axis + 1] = *size;
        }
        let off = || self.channel_off::<C>();
        let images = self.history_images()?.images.images()?.get::<C>().ok_or_else(off)?;
        ArrayView::from_shape(shape, images.to_slice().unwrap_or_default()).map_err(|_| off().into())
    }

    /// Renders the history if the camera has one.
    pub(super) fn render_history(&self) {
        if self.history_length() > 0 {
            // Errors are returned by the next read.
            let _ = self.history_images();
        }
    }

    /// Returns the history images after updating those that are outdated.
    fn history_images(&self) -> Result<&HistoryImages, CameraError> {
        let (rows, length) = (self.env_ids().len(), self.history_length());
        let filled = |row: usize| self.frames.stamp_history().filled(row);
        self.past_images.get_or_update(
            || Ok(HistoryImages::new(&self.cfg, rows, filled)),
            |past| {
                past.move_up();
                // Images that are also shown are copied instead of rendered again.
                let is_shown = |row: &usize| self.frames.shows_latest(*row);
                let wants_shown = length > 0 && (0..rows).any(|row| is_shown(&row));
                let shown = if wants_shown { self.images().ok() } else { None };
                if let Some(shown) = shown {
                    for row in (0..rows).filter(is_shown) {
                        if past.images.is_stale(row * length) {
                            past.images.copy(row * length, shown, rows, row);
                        }
                    }
                }
                self.render_stale(&mut past.images, |image| self.frames.history_frame(image / length, image % length))
            },
        )
    }

    /// Records that `count` frames of a row were delivered.
    pub(super) fn record_deliveries(&mut self, row: usize, count: u64) {
        if count == 0 {
            return;
        }
        self.latest_images = Cached::empty();
        self.past_images.invalidate();
        if let Some(past) = self.past_images.value_mut() {
            past.delivered_since[row] =
                past.delivered_since[row].saturating_add(usize::try_from(count).unwrap_or(usize::MAX)).min(past.length);
        }
    }

    /// Clears the history images of a row to zero.
    pub(super) fn clear_past_images(&mut self, row: usize) {
        self.past_images.invalidate();
        if let Some(past) = self.past_images.value_mut() {
            past.images.clear(past.row_range(row));
            past.delivered_since[row] = 0;
        }
    }
}
