//! Occlusion of segments in the image.

use super::isolated::IsolatedRenderer;
use crate::camera::segmentation::{SegmentLevel, Segmentation};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use ndarray::Axis;

/// Pixel counts of a segment with and without the other objects. Both are counted at the same instants: with a shutter
/// of nonzero span, each row of pixels has its own instant, as in the mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Occlusion {
    /// Segment id, see [`Segmentation::segments`].
    pub id: i32,
    /// Number of pixels in which the segment is visible.
    pub visible_pixels: usize,
    /// Number of pixels that the segment would cover without other objects; at least 1.
    pub unoccluded_pixels: usize,
}

impl Occlusion {
    /// Hidden fraction of the segment, as Isaac's occlusion ratio: 0 if everything inside the image is visible, 1 if
    /// nothing is. Parts outside the image do not count, nor does self-occlusion.
    pub fn ratio(&self) -> f64 {
        1.0 - self.visible_pixels as f64 / self.unoccluded_pixels as f64
    }
}

impl Segmentation {
    /// Returns the occlusion of the segments of a level in the image of environment `env`, in the order of
    /// [`segments`](Self::segments). Segments that would not be in the image if they were alone are left out.
    ///
    /// Each segment is rendered once more in isolation by the renderer of the camera. This takes as long as one mask
    /// image per segment, and allocates memory.
    ///
    /// # Errors
    ///
    /// [`ChannelOff`](crate::camera::CameraError::ChannelOff) if the camera does not measure the mask, errors of
    /// reading the mask, and an environment that the camera does not see.
    /// [`Render`](crate::camera::CameraError::Render) if a segment cannot be rendered.
    pub fn occlusions(&self, level: SegmentLevel, camera: &Camera, env: usize) -> Result<Vec<Occlusion>, SensorError> {
        let row = camera.row(env)?;
        let mask = camera.mask()?;
        let mask = mask.index_axis(Axis(0), row);
        let mut alone = IsolatedRenderer::new(camera, row, env);
        let mut found = Vec::new();
        for segment in self.segments(level) {
            let unoccluded_pixels = alone.pixels(segment)?.count();
            if unoccluded_pixels > 0 {
                let visible_pixels = mask.iter().filter(|id| segment.mask_ids.contains(id)).count();
                found.push(Occlusion { id: segment.id, visible_pixels, unoccluded_pixels });
            }
        }
        Ok(found)
    }
}
