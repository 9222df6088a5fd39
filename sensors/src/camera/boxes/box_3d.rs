//! 3D bounding boxes of segments in the environment.

use crate::camera::error::CameraError;
use crate::camera::segmentation::{SegmentLevel, Segmentation};
use crate::camera::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::Layer;
use kinetoscope_scene::{Instance, Pose, PoseF32};
use nalgebra::{Matrix3, Point3, Rotation3, UnitQuaternion, Vector3};

/// A box around a segment, aligned with the axes of the segment's frame. The frame of a link segment is the frame of
/// the link. For a segment of several links or objects, it is the frame of the rendered one with the smallest mask id.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Box3d {
    /// Segment id, see [`Segmentation::segments`].
    pub id: i32,
    /// Pose of the segment's frame in the environment.
    pub pose: Pose,
    /// Smallest coordinates in the segment's frame \[m\].
    pub min: [f64; 3],
    /// Largest coordinates in the segment's frame \[m\].
    pub max: [f64; 3],
}

impl Box3d {
    /// The eight corners in the environment \[m\]: x changes first, then y, then z, smallest coordinates first.
    pub fn corners(&self) -> [[f64; 3]; 8] {
        std::array::from_fn(|corner| {
            let side = |k: usize| if corner >> k & 1 == 1 { self.max[k] } else { self.min[k] };
            (self.pose * Point3::new(side(0), side(1), side(2))).coords.into()
        })
    }

    /// Side lengths along the axes of the segment's frame \[m\].
    pub fn size(&self) -> [f64; 3] {
        [0, 1, 2].map(|k| self.max[k] - self.min[k])
    }

    /// Center in the environment \[m\].
    pub fn center(&self) -> [f64; 3] {
        let middle = [0, 1, 2].map(|k| 0.5 * (self.min[k] + self.max[k]));
        (self.pose * Point3::from(middle)).coords.into()
    }
}

impl Segmentation {
    /// Returns the 3D boxes of the segments of a level in environment `env` at the captured instant, in the order of
    /// [`segments`](Self::segments). Everything that the camera can render counts, inside the image or not; infinite
    /// segments are left out. The boxes are those of exact shapes and of mesh vertices. No image is rendered.
    ///
    /// # Errors
    ///
    /// An environment that the camera does not see; [`NothingCaptured`](CameraError::NothingCaptured) before the first
    /// reset or update; [`EntityPose`](CameraError::EntityPose) if the pose of an instance is not finite.
    pub fn boxes_3d(&self, level: SegmentLevel, camera: &Camera, env: usize) -> Result<Vec<Box3d>, SensorError> {
        let row = camera.row(env)?;
        camera.require_captured(row)?;
        camera.with_render_request(row, |rasterizer, request, _| {
            let drawn = |instance: &Instance| Layer::for_instance(instance, rasterizer.groups()) != Layer::Hidden;
            let all = request.scene.instances().iter().zip(request.poses).filter(|(instance, _)| drawn(instance));
            let of = |id: i32| -> Option<Box3d> {
                let parts = all.clone().filter(|(instance, _)| self.segment_of(level, instance.mask_id) == id);
                // The first rendered instance of the segment, by mask id, gives the frame.
                let (first, place) = parts.clone().min_by_key(|(instance, _)| instance.mask_id)?;
                let pose = frame_of(first, place);
                let (mut min, mut max) = ([f64::INFINITY; 3], [f64::NEG_INFINITY; 3]);
                for (instance, place) in parts {
                    for (axis, [low, high]) in extent(&pose, instance, place).into_iter().enumerate() {
                        (min[axis], max[axis]) = (min[axis].min(low), max[axis].max(high));
                    }
                }
                let ends = min.iter().chain(&max).all(|x| x.is_finite());
                ends.then_some(Box3d { id, pose, min, max })
            };
            let lost = |(instance, place): &(&Instance, &PoseF32)| {
                let known = self.segment_of(level, instance.mask_id) != Self::UNKNOWN;
                known && !place.rotation.iter().flatten().chain(&place.translation).all(|x| x.is_finite())
            };
            if let Some((instance, _)) = all.clone().find(lost) {
                return Err(CameraError::EntityPose { env, id: instance.mask_id }.into());
            }
            Ok(self.segments(level).iter().filter_map(|segment| of(segment.id)).collect())
        })
    }
}

/// Returns the pose of the frame of the link or object that an instance belongs to.
fn frame_of(instance: &Instance, world_from_instance: &PoseF32) -> Pose {
    pose_of(world_from_instance) * instance.frame_from_instance.inverse()
}

/// Converts a single-precision pose.
fn pose_of(pose: &PoseF32) -> Pose {
    let r = pose.rotation.map(|row| row.map(f64::from));
    let matrix = Rotation3::from_matrix_unchecked(Matrix3::from_fn(|i, j| r[i][j]));
    let rotation = UnitQuaternion::from_rotation_matrix(&matrix);
    Pose::from_parts(Vector3::from(pose.translation.map(f64::from)).into(), rotation)
}

/// Returns the smallest and largest x, y and z of an instance in a frame \[m\].
fn extent(frame: &Pose, instance: &Instance, world_from_instance: &PoseF32) -> [[f64; 2]; 3] {
    let relative = frame.inverse() * pose_of(world_from_instance);
    let rotation = relative.rotation.to_rotation_matrix();
    [0, 1, 2].map(|axis| {
        let row = rotation.matrix().row(axis);
        instance.shape.extent([row[0], row[1], row[2]]).map(|x| x + relative.translation.vector[axis])
    })
}
