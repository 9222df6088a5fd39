//! Pictures of the past.

use super::error::CameraError;
use super::memory::{Album, Past};
use super::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::frame::{Channel, Layout, Listed};
use ndarray::{ArrayView, ArrayView2, Axis, Dimension};
use std::sync::PoisonError;

/// Past pictures of one channel, shape (views, history, height, width) or (views, history, height, width, components).
pub type HistoryView<'a, C> = ArrayView<'a, <C as Channel>::Number, <<C as Channel>::Layout as Dimension>::Larger>;

impl Camera {
    /// Pictures that are remembered at most: [`CameraCfg::history_length`](super::CameraCfg::history_length).
    pub fn history_length(&self) -> usize {
        self.past().map_or(0, Past::length)
    }

    /// How many pictures of the history of environment `env` are there.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see.
    pub fn history_filled(&self, env: usize) -> Result<usize, SensorError> {
        let row = self.row(env)?;
        Ok(self.past().map_or(0, |past| past.filled(row)))
    }

    /// Times of past pictures \[s\], newest first, shape (N, history_length); 0 where there is none yet.
    pub fn stamp_history(&self) -> ArrayView2<'_, f64> {
        let none = || self.stamps().insert_axis(Axis(1)).split_at(Axis(1), 0).0;
        self.past().map_or_else(none, |past| past.stamps.view())
    }

    /// The last pictures that arrived, of one channel, newest first: `camera.history::<Depth>()?`, shape
    /// (N, history_length, H, W) or (N, history_length, H, W, components); zeros where there is none yet. Draws those that
    /// nobody has looked at.
    ///
    /// The newest is what [`channel`](Self::channel) shows, until somebody writes to the state or moves the camera.
    ///
    /// # Errors
    ///
    /// [`CameraError::ChannelOff`], and [`CameraError::Draw`] as long as a picture that cannot be drawn is in the history.
    pub fn history<C: Listed>(&self) -> Result<HistoryView<'_, C>, SensorError> {
        let off = || CameraError::ChannelOff { channel: C::NAME, enabled: self.channels().names() };
        if !self.channels().has::<C>() {
            return Err(off().into());
        }
        let (rows, length, (height, width)) = (self.env_ids().len(), self.history_length(), self.image_shape());
        let of_one = C::Layout::of(length, height, width, C::COMPONENTS);
        let mut shape = <C::Layout as Dimension>::Larger::default();
        shape[0] = rows;
        for (axis, size) in of_one.slice().iter().enumerate() {
            shape[axis + 1] = *size;
        }
        let pictures = match self.past().filter(|past| past.length() > 0) {
            None => None,
            Some(past) => {
                let album = self.album(past)?;
                if let Some(failure) = &album.failure {
                    return Err(failure.clone().into());
                }
                Some(album.pictures.get::<C>().ok_or_else(off)?)
            }
        };
        let numbers = pictures.as_ref().and_then(|pictures| pictures.to_slice()).unwrap_or_default();
        ArrayView::from_shape(shape, numbers).map_err(|_| off().into())
    }

    /// Draws the history, if there is one.
    pub(super) fn draw_history(&self) {
        if let Some(past) = self.past().filter(|past| past.length() > 0) {
            // What is wrong is said to who reads.
            let _ = self.album(past);
        }
    }

    /// The album with all that has arrived; what was broken off is not kept, the next reader draws it again.
    fn album<'a>(&'a self, past: &'a Past) -> Result<&'a Album, CameraError> {
        if let Some(album) = past.drawn.get() {
            return Ok(album);
        }
        // One reader draws, the others wait.
        let _turn = past.turn.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(album) = past.drawn.get() {
            return Ok(album);
        }
        let album = self.draw_past(past);
        if let Some(failure) = album.failure.as_ref().filter(|failure| failure.is_cancelled()) {
            let failure = failure.clone();
            *past.shelf.lock().unwrap_or_else(PoisonError::into_inner) = Some(album);
            return Err(failure);
        }
        Ok(past.drawn.get_or_init(|| album))
    }

    /// Draws what has arrived and nobody has looked at.
    fn draw_past(&self, past: &Past) -> Album {
        // What is shown is drawn once.
        let shown = if past.shown.contains(&true) { self.pictures().ok() } else { None };
        let rows = self.env_ids().len();
        let mut shelf = past.shelf.lock().unwrap_or_else(PoisonError::into_inner);
        let (length, (height, width)) = (past.length(), self.image_shape());
        // It is missing only where a drawing panicked.
        let mut album = shelf.take().unwrap_or_else(|| Album::new(self.channels(), rows, length, width, height));
        past.move_up(&mut album);
        let Album { pictures, undrawn, failure, .. } = &mut album;
        if let Some(shown) = shown {
            for row in (0..rows).filter(|&row| past.shown[row] && undrawn[row] > 0) {
                pictures.copy_view((rows * length, row * length), shown, (rows, row));
            }
        }
        let copied = |row: usize| usize::from(shown.is_some() && past.shown[row]);
        let wanted = |view: &usize| {
            let (row, age) = (view / length, view % length);
            (copied(row)..undrawn[row]).contains(&age)
        };
        let views = (0..rows * length).filter(wanted);
        let frames = pictures.frames_mut(rows * length).enumerate().filter(|(view, _)| wanted(view));
        let places = views.clone().map(|view| (view / length, past.place(view / length, view % length)));
        let frames = frames.map(|(_, frame)| frame);
        let look = |place: usize| (&past.viewpoints[place], past.lenses[place].as_deref());
        let result = self.develop(&past.captures, look, places, frames);
        *failure = result.err().and_then(|(job, error)| {
            let view = views.clone().nth(job)?;
            Some(CameraError::Draw { env: self.env_ids()[view / length], error })
        });
        // After a failure it is not known which are good.
        if failure.is_none() {
            undrawn.fill(0);
        }
        album
    }
}
