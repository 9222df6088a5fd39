//! How much of a thing is hidden.

use crate::camera::channel::{Channels, Frame};
use crate::camera::error::CameraError;
use crate::camera::segmentation::{Segment, SegmentLevel, Segmentation};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use scene::RenderScene;

/// How much of a segment other things hide in a picture.
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
    /// As [`boxes_2d`](Self::boxes_2d).
    pub fn occlusions(&self, level: SegmentLevel, camera: &Camera, env: usize) -> Result<Vec<Occlusion>, SensorError> {
        let boxes = self.boxes_2d(level, camera, env)?;
        let row = camera.row(env)?;
        let (height, width) = camera.image_shape();
        let mut frame = Frame::new(width, height, Channels { mask: true, ..Channels::default() });
        let mut found = Vec::new();
        for known in &boxes {
            let Some(segment) = self.segments(level).iter().find(|segment| segment.id == known.id) else { continue };
            camera
                .shot_of(row, |rasterizer, shot| {
                    let scene = alone(shot.scene, segment);
                    let mut job = [(crate::camera::Shot { scene: &scene, ..shot }, frame.as_mut())];
                    rasterizer.render(&mut job)
                })
                .map_err(|(_, error)| CameraError::Draw { env, error })?;
            let alone_pixels = frame.mask.iter().flatten().filter(|&&id| id != 0).count();
            if alone_pixels > 0 {
                found.push(Occlusion { id: known.id, visible_pixels: known.visible_pixels, alone_pixels });
            }
        }
        Ok(found)
    }
}

/// The scene with everything but a segment hidden; poses stay those of the scene.
fn alone(scene: &RenderScene, segment: &Segment) -> RenderScene {
    let mut instances = scene.instances().to_vec();
    for instance in &mut instances {
        instance.visible &= segment.mask_ids.contains(&instance.mask_id);
    }
    // Every instance was in a scene already.
    scene.with_instances(instances).unwrap_or_else(|_| RenderScene::empty())
}
