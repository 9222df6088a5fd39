//! 2D bounding boxes of segments in the image.

use super::isolated::IsolatedRenderer;
use super::projected_extent::projected_extent;
use crate::camera::segmentation::{SegmentLevel, Segmentation};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::Layer;
use ndarray::Axis;

/// A rectangle in the image \[pixels\], u to the right, v down. It reaches from the outer edge of its first pixel to
/// the outer edge of its last one; the whole image is \[0, 0\] to \[W, H\]. Isaac's `x_max` and `y_max` are the index
/// of the last pixel, which is one less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelBox {
    /// Left and upper edge (u, v).
    pub min: [f64; 2],
    /// Right and lower edge (u, v).
    pub max: [f64; 2],
}

/// 2D bounding boxes of a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box2d {
    /// Segment id, see [`Segmentation::segments`].
    pub id: i32,
    /// Box around the pixels in which the segment is visible; `None` without such pixels. With a
    /// [shutter](crate::camera::CameraCfg::shutter) of nonzero span, each row of pixels shows the middle of its own
    /// exposure.
    pub tight: Option<PixelBox>,
    /// Box around the whole part of the segment in the view frustum, occluded or not; `None` if all of it is outside.
    ///
    /// The frustum ends at the near plane, the far plane and the edges of the image. The box is that of shapes and mesh
    /// triangles, not of pixels; level of detail is ignored. The box is exact for segments entirely in the frustum.
    /// Round shapes cut by the frustum are approximated by a polyhedron with 256 edges around, which is inside by at
    /// most 7.5e-5 of the radius.
    ///
    /// If the lens bends lines or the [shutter](crate::camera::CameraCfg::shutter) has a nonzero span, the segment is
    /// rendered in isolation, each row at its own instant. The box then surrounds the pixels that
    /// [`Occlusion::unoccluded_pixels`](super::Occlusion::unoccluded_pixels) counts.
    pub loose: Option<PixelBox>,
    /// Number of pixels in which the segment is visible.
    pub visible_pixels: usize,
}

impl Segmentation {
    /// Returns the 2D boxes of the segments of a level in the shown image of environment `env`, in the order of
    /// [`segments`](Self::segments). Segments without a tight and without a loose box are left out.
    ///
    /// If the lens bends lines or the shutter has a nonzero span, each segment is rendered once more in isolation for
    /// its loose box: see [`occlusions`](Self::occlusions).
    ///
    /// # Errors
    ///
    /// [`ChannelOff`](crate::camera::CameraError::ChannelOff) if the camera does not measure the mask, errors of
    /// reading the mask, and an environment that the camera does not see.
    /// [`Render`](crate::camera::CameraError::Render) if an isolated segment cannot be rendered.
    pub fn boxes_2d(&self, level: SegmentLevel, camera: &Camera, env: usize) -> Result<Vec<Box2d>, SensorError> {
        let row = camera.row(env)?;
        let mask = camera.mask()?;
        let mut boxes = BoxAccumulator::new(self, level);
        for ((v, u), &id) in mask.index_axis(Axis(0), row).indexed_iter() {
            boxes.add_visible_pixel(id, [u, v]);
        }
        if camera.is_distorted() || camera.has_shutter_span() {
            let mut alone = IsolatedRenderer::new(camera, row, env);
            for segment in self.segments(level) {
                for ([u, v], id) in alone.pixels(segment)? {
                    let [left, top] = [u, v].map(|x| x as f64);
                    boxes.add_extent(id, [[left, left + 1.0], [top, top + 1.0]]);
                }
            }
            return Ok(boxes.finish());
        }
        camera.with_render_request(row, |rasterizer, request, _| {
            for (instance, pose) in request.scene.instances().iter().zip(request.poses) {
                if Layer::for_instance(instance, rasterizer.groups()) != Layer::Hidden
                    && let Some(extent) = projected_extent(request.view, instance, pose)
                {
                    boxes.add_extent(instance.mask_id, extent);
                }
            }
        });
        Ok(boxes.finish())
    }
}

/// Accumulates the boxes of the segments of a level.
struct BoxAccumulator<'a> {
    segmentation: &'a Segmentation,
    level: SegmentLevel,
    list: Vec<SegmentExtent>,
    /// Mask id of the last lookup, and the index of its segment in `list`.
    last_lookup: (i32, Option<usize>),
}

/// Box of one segment, accumulated pixel by pixel and instance by instance.
#[derive(Clone, Copy)]
struct SegmentExtent {
    id: i32,
    pixels: usize,
    visible_extent: [[usize; 2]; 2],
    /// Smallest and largest u, then v, of the loose box \[pixels\]; `None` if no part is in the image yet.
    full_extent: Option<[[f64; 2]; 2]>,
}

impl<'a> BoxAccumulator<'a> {
    fn new(segmentation: &'a Segmentation, level: SegmentLevel) -> Self {
        let growing =
            |id| SegmentExtent { id, pixels: 0, visible_extent: [[usize::MAX; 2], [0; 2]], full_extent: None };
        let list = segmentation.segments(level).iter().map(|segment| growing(segment.id)).collect();
        Self { segmentation, level, list, last_lookup: (0, None) }
    }

    fn of(&mut self, mask_id: i32) -> Option<&mut SegmentExtent> {
        if self.last_lookup.0 != mask_id {
            let segment = self.segmentation.segment_of(self.level, mask_id);
            self.last_lookup = (mask_id, self.list.iter().position(|growing| growing.id == segment));
        }
        self.last_lookup.1.map(|at| &mut self.list[at])
    }

    /// Adds a pixel that sees a mask id.
    fn add_visible_pixel(&mut self, mask_id: i32, at: [usize; 2]) {
        let Some(growing) = self.of(mask_id) else { return };
        growing.pixels += 1;
        for (axis, x) in at.into_iter().enumerate() {
            growing.visible_extent[0][axis] = growing.visible_extent[0][axis].min(x);
            growing.visible_extent[1][axis] = growing.visible_extent[1][axis].max(x + 1);
        }
    }

    /// Extends the loose box of a mask id by `extent`: smallest and largest u, then v.
    fn add_extent(&mut self, mask_id: i32, extent: [[f64; 2]; 2]) {
        let Some(growing) = self.of(mask_id) else { return };
        let before = growing.full_extent.unwrap_or(extent);
        growing.full_extent = Some([0, 1].map(|k| [before[k][0].min(extent[k][0]), before[k][1].max(extent[k][1])]));
    }

    fn finish(self) -> Vec<Box2d> {
        let loose = |[u, v]: [[f64; 2]; 2]| {
            let (min, max) = ([u[0], v[0]], [u[1], v[1]]);
            (min[0] < max[0] && min[1] < max[1]).then_some(PixelBox { min, max })
        };
        let boxes = self.list.into_iter().map(|SegmentExtent { id, pixels, visible_extent, full_extent }| {
            let [min, max] = visible_extent.map(|corner| corner.map(|x| x as f64));
            let tight = (pixels > 0).then_some(PixelBox { min, max });
            Box2d { id, tight, loose: full_extent.and_then(loose), visible_pixels: pixels }
        });
        boxes.filter(|b| b.tight.is_some() || b.loose.is_some()).collect()
    }
}
