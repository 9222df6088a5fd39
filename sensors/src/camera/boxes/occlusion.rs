//! How much of a thing is hidden.

use super::alone::Alone;
use crate::camera::segmentation::{SegmentLevel, Segmentation};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use ndarray::Axis;

/// How much of a segment other things hide in a picture. Both numbers are of the same instants: with a shutter that takes time each
/// row is of its own, as the mask is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occlusion {
    /// The segment, see [`Segmentation::segments`].
    pub id: i32,
    /// How many pixels see it.
    pub visible_pixels: usize,
    /// How many would see it if it were alone; at least 1.
    pub alone_pixels: usize,
}

impl Occlusion {
    /// The part of it that is hidden, as Isaac's occlusion ratio: 0 where all of what is in the picture is seen, 1 where
    /// nothing is. What the picture's edges cut off counts nowhere, nor does what it hides of itself.
    pub fn ratio(&self) -> f64 {
        1.0 - self.visible_pixels as f64 / self.alone_pixels as f64
    }
}

impl Segmentation {
    /// How much of the segments of a level is hidden in the picture of environment `env`, those that would be in it if they
    /// were alone, in the order of [`segments`](Self::segments).
    ///
    /// Each segment is drawn once more, alone, by the camera's own renderer: that takes as long as that many pictures of the
    /// mask, and allocates.
    ///
    /// # Errors
    ///
    /// [`ChannelOff`](crate::camera::CameraError::ChannelOff) for a camera that does not measure the mask, what reading it says, and
    /// an environment that the camera does not see; [`Draw`](crate::camera::CameraError::Draw) where a segment cannot be drawn.
    pub fn occlusions(&self, level: SegmentLevel, camera: &Camera, env: usize) -> Result<Vec<Occlusion>, SensorError> {
        let row = camera.row(env)?;
        let mask = camera.mask()?;
        let mask = mask.index_axis(Axis(0), row);
        let mut alone = Alone::new(camera, row, env);
        let mut found = Vec::new();
        for segment in self.segments(level) {
            let alone_pixels = alone.pixels(segment)?.count();
            if alone_pixels > 0 {
                let visible_pixels = mask.iter().filter(|id| segment.mask_ids.contains(id)).count();
                found.push(Occlusion { id: segment.id, visible_pixels, alone_pixels });
            }
        }
        Ok(found)
    }
}
