//! Renders of single segments without occluders.
//!
//! The renders show the same instants as the images of the camera. With a shutter of nonzero span, each row has its own
//! instant.

use crate::camera::error::CameraError;
use crate::camera::segmentation::Segment;
use crate::camera::sensor::Camera;
use kinetoscope_render::RenderRequest;
use kinetoscope_render::frame::{Channels, Frame};
use kinetoscope_scene::RenderScene;

/// Renders segments in isolation, with the renderer and the lens of the camera.
pub(super) struct IsolatedRenderer<'a> {
    camera: &'a Camera,
    row: usize,
    env: usize,
    frame: Frame,
}

impl<'a> IsolatedRenderer<'a> {
    /// Creates the renderer for the image of `row`, which shows environment `env`.
    pub(super) fn new(camera: &'a Camera, row: usize, env: usize) -> Self {
        let (height, width) = camera.image_shape();
        let frame = Frame::new(width, height, Channels { mask: true, ..Channels::default() });
        Self { camera, row, env, frame }
    }

    /// Returns the pixels (u, v) that would see the segment if it were alone, each with its mask id.
    pub(super) fn pixels(
        &mut self,
        segment: &Segment,
    ) -> Result<impl Iterator<Item = ([usize; 2], i32)> + '_, CameraError> {
        let Self { camera, row, env, ref mut frame } = *self;
        camera
            .with_render_request(row, |rasterizer, request, take| {
                let scene = with_only(request.scene, segment);
                rasterizer.render_samples(&mut [(RenderRequest { scene: &scene, ..request }, frame.as_mut())], &[take])
            })
            .map_err(|(_, error)| CameraError::Render { env, error })?;
        let width = camera.image_shape().1;
        let ids = frame.mask.iter().flatten().enumerate();
        Ok(ids.filter(|(_, id)| **id != 0).map(move |(k, &id)| ([k % width, k / width], id)))
    }
}

/// Returns the scene with all instances hidden except those of the segment; poses stay unchanged.
fn with_only(scene: &RenderScene, segment: &Segment) -> RenderScene {
    let mut instances = scene.instances().to_vec();
    for instance in &mut instances {
        instance.visible &= segment.mask_ids.contains(&instance.mask_id);
    }
    // Cannot fail: every instance was part of a scene before.
    scene.with_instances(instances).unwrap_or_else(|_| RenderScene::empty())
}
