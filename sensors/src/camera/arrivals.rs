//! Frames of a camera as they arrive: the latest, shown or not, and the history.
//!
//! After a write to the state, a camera shows what there is then. Frames that were on their way arrive later, are counted, and
//! are not shown: they are older. A reader of every frame, such as a recorder, gets them by [`Camera::arrived`].

use super::cfg::CameraCfg;
use super::error::CameraError;
use super::extrinsics::CameraConvention;
use super::frame_buffer::FrameSource;
use super::sensor::Camera;
use super::sensor::drawing::DrawnImages;
use crate::cached::Cached;
use crate::error::SensorError;
use kinetoscope_render::frame::Channel;
use kinetoscope_render::frame::{Layout, Listed, PictureView};
use kinetoscope_scene::pose::to_row;
use ndarray::{Array1, Array2, Array3, ArrayView, ArrayView2, Axis, Dimension};
use std::ops::Range;

/// Past pictures of one channel, shape (views, history, height, width) or (views, history, height, width, components).
pub type HistoryView<'a, C> = ArrayView<'a, <C as Channel>::Number, <<C as Channel>::Layout as Dimension>::Larger>;

/// Images of the history: those of each row one after the other, newest first.
#[derive(Debug)]
pub(super) struct PastImages {
    images: DrawnImages,
    length: usize,
    /// Frames of each row that arrived since the images were drawn.
    new: Vec<usize>,
}

impl PastImages {
    /// Images of histories in which `filled` frames of each row are filled, none of them drawn.
    pub(super) fn new(cfg: &CameraCfg, rows: usize, filled: impl Fn(usize) -> usize) -> Self {
        let length = cfg.history_length;
        let mut images = DrawnImages::new(cfg, rows * length);
        (0..rows * length).for_each(|image| images.set_stale(image, image % length < filled(image / length)));
        Self { images, length, new: vec![0; rows] }
    }

    fn of_row(&self, row: usize) -> Range<usize> {
        row * self.length..(row + 1) * self.length
    }

    /// Moves images up that are older than those that arrived since.
    fn move_up(&mut self) {
        for row in 0..self.new.len() {
            let by = std::mem::take(&mut self.new[row]);
            self.images.move_up(self.of_row(row), by);
        }
    }
}

impl Camera {
    /// Time of the instant that the pictures show which arrived last \[s\], shape (N): as [`stamps`](Self::stamps), except with a
    /// latency after a write to the state or a move of the camera. Before the first one arrives, that of the reset.
    pub fn arrived_stamps(&self) -> Array1<f64> {
        let shown = self.stamps();
        Array1::from_shape_fn(shown.len(), |row| match self.frames.unseen(row) {
            Some(source) => source.frame.stamp,
            None => shown[row],
        })
    }

    /// Poses at that instant, as [`pose_w`](Self::pose_w).
    pub fn arrived_pose_w(&self, convention: CameraConvention) -> Array2<f64> {
        let mut poses = self.pose_w(convention);
        for (row, mut pose) in poses.rows_mut().into_iter().enumerate() {
            if let Some(FrameSource { frame, viewpoint, .. }) = self.frames.unseen(row)
                && let Some(world) = self.viewpoints.world_from(viewpoint, frame.world_from_parent)
            {
                pose.iter_mut().zip(to_row(&convention.of_optical(&world))).for_each(|(to, x)| *to = x);
            }
        }
        poses
    }

    /// Intrinsic matrices of these pictures, as [`intrinsic_matrices`](Self::intrinsic_matrices).
    pub fn arrived_intrinsic_matrices(&self) -> Array3<f64> {
        let shown = self.intrinsic_matrices();
        Array3::from_shape_fn(shown.raw_dim(), |(row, i, j)| match self.frames.unseen(row) {
            Some(source) => source.viewpoint.pixels.matrix()[(i, j)],
            None => shown[(row, i, j)],
        })
    }

    /// The pictures of one channel that arrived last, in the shape of [`channel`](Self::channel). Those that are not shown are drawn
    /// when they are read, with the noise that they would have been shown with.
    ///
    /// # Errors
    ///
    /// As [`channel`](Self::channel).
    pub fn arrived<C: Listed>(&self) -> Result<PictureView<'_, C>, SensorError> {
        let rows = self.env_ids().len();
        if (0..rows).all(|row| self.frames.unseen(row).is_none()) {
            return self.channel::<C>();
        }
        self.must_have::<C>()?;
        // Of what is shown only some rows may be wanted, and drawing it is what the reader would have done anyway.
        let shown = self.pictures()?;
        let make = || {
            let mut images = DrawnImages::new(&self.cfg, rows);
            let seen = (0..rows).filter(|&row| self.frames.unseen(row).is_none());
            seen.for_each(|row| images.copy(row, shown, rows, row));
            Ok(images)
        };
        let images =
            self.latest_images.get_or_update(make, |images| self.redraw(images, |row| self.frames.unseen(row)))?;
        images.pictures()?.get::<C>().ok_or_else(|| self.channel_off::<C>().into())
    }

    /// Pictures that are remembered at most: [`CameraCfg::history_length`](super::CameraCfg::history_length).
    pub fn history_length(&self) -> usize {
        self.cfg.history_length
    }

    /// How many pictures of the history of environment `env` are there.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see.
    pub fn history_filled(&self, env: usize) -> Result<usize, SensorError> {
        Ok(self.frames.stamp_history().filled(self.row(env)?))
    }

    /// Times of past pictures \[s\], newest first, shape (N, history_length); 0 before the first ones.
    pub fn stamp_history(&self) -> ArrayView2<'_, f64> {
        self.frames.stamp_history().view().index_axis_move(Axis(2), 0)
    }

    /// The last pictures that arrived, of one channel, newest first: `camera.history::<Depth>()?`, shape
    /// (N, history_length, H, W) or (N, history_length, H, W, components); zeros before the first ones. Draws those that
    /// were not read before.
    ///
    /// The newest is what [`channel`](Self::channel) shows, until the state is written to or the camera moves.
    ///
    /// # Errors
    ///
    /// [`CameraError::ChannelOff`], and [`CameraError::Draw`] as long as a picture that cannot be drawn is in the history.
    pub fn history<C: Listed>(&self) -> Result<HistoryView<'_, C>, SensorError> {
        self.must_have::<C>()?;
        let (rows, length, (height, width)) = (self.env_ids().len(), self.history_length(), self.image_shape());
        let of_one = C::Layout::of(length, height, width, C::COMPONENTS);
        let mut shape = <C::Layout as Dimension>::Larger::default();
        shape[0] = rows;
        for (axis, size) in of_one.slice().iter().enumerate() {
            shape[axis + 1] = *size;
        }
        let off = || self.channel_off::<C>();
        let pictures = self.past_images()?.images.pictures()?.get::<C>().ok_or_else(off)?;
        ArrayView::from_shape(shape, pictures.to_slice().unwrap_or_default()).map_err(|_| off().into())
    }

    /// Draws the history, if there is one.
    pub(super) fn draw_history(&self) {
        if self.history_length() > 0 {
            // Errors are returned by the next read.
            let _ = self.past_images();
        }
    }

    /// The images of the history, with all that has arrived.
    fn past_images(&self) -> Result<&PastImages, CameraError> {
        let (rows, length) = (self.env_ids().len(), self.history_length());
        let filled = |row: usize| self.frames.stamp_history().filled(row);
        self.past_images.get_or_update(
            || Ok(PastImages::new(&self.cfg, rows, filled)),
            |past| {
                past.move_up();
                // A shown image is drawn once.
                let is_shown = |row: &usize| self.frames.shows_latest(*row);
                let wants_shown = length > 0 && (0..rows).any(|row| is_shown(&row));
                let shown = if wants_shown { self.pictures().ok() } else { None };
                if let Some(shown) = shown {
                    for row in (0..rows).filter(is_shown) {
                        if past.images.is_stale(row * length) {
                            past.images.copy(row * length, shown, rows, row);
                        }
                    }
                }
                self.redraw(&mut past.images, |image| self.frames.past(image / length, image % length))
            },
        )
    }

    /// Notes that frames of a row have arrived.
    pub(super) fn note_arrivals(&mut self, row: usize, count: u64) {
        if count == 0 {
            return;
        }
        self.latest_images = Cached::empty();
        self.past_images.invalidate();
        if let Some(past) = self.past_images.value_mut() {
            past.new[row] = past.new[row].saturating_add(usize::try_from(count).unwrap_or(usize::MAX)).min(past.length);
        }
    }

    /// Makes zeros of the images of the history of a row.
    pub(super) fn forget_past_images(&mut self, row: usize) {
        self.past_images.invalidate();
        if let Some(past) = self.past_images.value_mut() {
            past.images.forget(past.of_row(row));
            past.new[row] = 0;
        }
    }
}
