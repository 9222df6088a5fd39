//! Pictures of one thing, as if nothing else were there.
//!
//! They are of the instants that the camera's own pictures are of: with a shutter that takes time each row is of its own.

use crate::camera::error::CameraError;
use crate::camera::segmentation::Segment;
use crate::camera::sensor::Camera;
use kinetoscope_render::Shot;
use kinetoscope_render::frame::{Channels, Frame};
use kinetoscope_scene::RenderScene;

/// Draws segments alone, by the camera's own renderer and through its lens.
pub(super) struct Alone<'a> {
    camera: &'a Camera,
    row: usize,
    env: usize,
    frame: Frame,
}

impl<'a> Alone<'a> {
    /// Of the picture of a row, which is that of environment `env`.
    pub(super) fn new(camera: &'a Camera, row: usize, env: usize) -> Self {
        let (height, width) = camera.image_shape();
        let frame = Frame::new(width, height, Channels { mask: true, ..Channels::default() });
        Self { camera, row, env, frame }
    }

    /// The pixels (u, v) that would see a segment, with its mask ids there.
    pub(super) fn pixels(
        &mut self,
        segment: &Segment,
    ) -> Result<impl Iterator<Item = ([usize; 2], i32)> + '_, CameraError> {
        let Self { camera, row, env, ref mut frame } = *self;
        camera
            .shot_of(row, |rasterizer, shot, take| {
                let scene = hide_others(shot.scene, segment);
                rasterizer.render_takes(&mut [(Shot { scene: &scene, ..shot }, frame.as_mut())], &[take])
            })
            .map_err(|(_, error)| CameraError::Draw { env, error })?;
        let width = camera.image_shape().1;
        let ids = frame.mask.iter().flatten().enumerate();
        Ok(ids.filter(|(_, id)| **id != 0).map(move |(k, &id)| ([k % width, k / width], id)))
    }
}

/// The scene with everything but a segment hidden; poses stay those of the scene.
fn hide_others(scene: &RenderScene, segment: &Segment) -> RenderScene {
    let mut instances = scene.instances().to_vec();
    for instance in &mut instances {
        instance.visible &= segment.mask_ids.contains(&instance.mask_id);
    }
    // Every instance was in a scene already.
    scene.with_instances(instances).unwrap_or_else(|_| RenderScene::empty())
}
