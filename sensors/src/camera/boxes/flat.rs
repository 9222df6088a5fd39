//! Boxes in the picture.

use super::alone::Alone;
use super::outline::outline;
use crate::camera::segmentation::{SegmentLevel, Segmentation};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::Layer;
use ndarray::Axis;

/// A rectangle of a picture \[pixels\]: from the edge where its first pixel begins to the edge where its last one ends, u to
/// the right, v down; the whole picture is \[0, 0\] to \[W, H\]. Isaac's `x_max` and `y_max` are the last pixel itself, one
/// less.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PixelBox {
    /// Left and upper edge.
    pub min: [f64; 2],
    /// Right and lower edge.
    pub max: [f64; 2],
}

/// Where a segment is in a picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box2d {
    /// The segment, see [`Segmentation::segments`].
    pub id: i32,
    /// Around the pixels that see it, with a shutter that takes time each row at its own instant; `None` where none does.
    pub tight: Option<PixelBox>,
    /// Around all of it that is in the frustum (between the near and the far plane, within the edges of the picture),
    /// whatever hides it: of shapes and the triangles of meshes, not of pixels; level of detail is not looked at. Exact for
    /// what is wholly in the frustum; what is round and cut is a polyhedron with 256 edges around, inside by 7.5e-5 of its
    /// radius at most. Behind a lens that bends lines, and of a camera whose [shutter](crate::camera::CameraCfg::shutter) takes time:
    /// around the pixels that would see it if it were alone, each row at its own instant, as
    /// [`Occlusion::alone_pixels`](super::Occlusion::alone_pixels) counts them. `None` where all of it is outside.
    pub loose: Option<PixelBox>,
    /// How many pixels see it.
    pub visible_pixels: usize,
}

impl Segmentation {
    /// Where the segments of a level are in the picture of environment `env`, those that are in it at all (one of the two
    /// boxes is there), in the order of [`segments`](Self::segments).
    ///
    /// Behind a lens that bends lines, and with a shutter that takes time, each segment is drawn once more, alone, for its loose
    /// box: see [`occlusions`](Self::occlusions).
    ///
    /// # Errors
    ///
    /// [`ChannelOff`](crate::camera::CameraError::ChannelOff) for a camera that does not measure the mask, what reading it says, and
    /// an environment that the camera does not see; where segments are drawn, [`Draw`](crate::camera::CameraError::Draw) for one that
    /// cannot be.
    pub fn boxes_2d(&self, level: SegmentLevel, camera: &Camera, env: usize) -> Result<Vec<Box2d>, SensorError> {
        let row = camera.row(env)?;
        let mask = camera.mask()?;
        let mut boxes = Boxes::new(self, level);
        for ((v, u), &id) in mask.index_axis(Axis(0), row).indexed_iter() {
            boxes.see(id, [u, v]);
        }
        if camera.bends_lines() || camera.takes_time() {
            let mut alone = Alone::new(camera, row, env);
            for segment in self.segments(level) {
                for ([u, v], id) in alone.pixels(segment)? {
                    let [left, top] = [u, v].map(|x| x as f64);
                    boxes.reach(id, [[left, left + 1.0], [top, top + 1.0]]);
                }
            }
            return Ok(boxes.finish());
        }
        camera.shot_of(row, |rasterizer, shot, _| {
            for (instance, pose) in shot.scene.instances().iter().zip(shot.poses) {
                if Layer::of(instance, rasterizer.groups()) != Layer::Hidden
                    && let Some(extent) = outline(shot.view, instance, pose)
                {
                    boxes.reach(instance.mask_id, extent);
                }
            }
        });
        Ok(boxes.finish())
    }
}

/// Boxes while they grow.
struct Boxes<'a> {
    segmentation: &'a Segmentation,
    level: SegmentLevel,
    list: Vec<Growing>,
    /// The mask id that was last looked for, and where its segment is in the list.
    last: (i32, Option<usize>),
}

/// A box while it grows.
#[derive(Clone, Copy)]
struct Growing {
    id: i32,
    pixels: usize,
    seen: [[usize; 2]; 2],
    /// Smallest and largest u, then v.
    whole: Option<[[f64; 2]; 2]>,
}

impl<'a> Boxes<'a> {
    fn new(segmentation: &'a Segmentation, level: SegmentLevel) -> Self {
        let growing = |id| Growing { id, pixels: 0, seen: [[usize::MAX; 2], [0; 2]], whole: None };
        let list = segmentation.segments(level).iter().map(|segment| growing(segment.id)).collect();
        Self { segmentation, level, list, last: (0, None) }
    }

    fn of(&mut self, mask_id: i32) -> Option<&mut Growing> {
        if self.last.0 != mask_id {
            let segment = self.segmentation.segment_of(self.level, mask_id);
            self.last = (mask_id, self.list.iter().position(|growing| growing.id == segment));
        }
        self.last.1.map(|at| &mut self.list[at])
    }

    /// A pixel sees something.
    fn see(&mut self, mask_id: i32, at: [usize; 2]) {
        let Some(growing) = self.of(mask_id) else { return };
        growing.pixels += 1;
        for (axis, x) in at.into_iter().enumerate() {
            growing.seen[0][axis] = growing.seen[0][axis].min(x);
            growing.seen[1][axis] = growing.seen[1][axis].max(x + 1);
        }
    }

    /// Something in the picture reaches from smallest to largest u, then v.
    fn reach(&mut self, mask_id: i32, extent: [[f64; 2]; 2]) {
        let Some(growing) = self.of(mask_id) else { return };
        let before = growing.whole.unwrap_or(extent);
        growing.whole = Some([0, 1].map(|k| [before[k][0].min(extent[k][0]), before[k][1].max(extent[k][1])]));
    }

    fn finish(self) -> Vec<Box2d> {
        let loose = |[u, v]: [[f64; 2]; 2]| {
            let (min, max) = ([u[0], v[0]], [u[1], v[1]]);
            (min[0] < max[0] && min[1] < max[1]).then_some(PixelBox { min, max })
        };
        let boxes = self.list.into_iter().map(|Growing { id, pixels, seen, whole }| {
            let [min, max] = seen.map(|corner| corner.map(|x| x as f64));
            let tight = (pixels > 0).then_some(PixelBox { min, max });
            Box2d { id, tight, loose: whole.and_then(loose), visible_pixels: pixels }
        });
        boxes.filter(|b| b.tight.is_some() || b.loose.is_some()).collect()
    }
}
