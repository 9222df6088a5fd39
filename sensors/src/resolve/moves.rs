//! Where things were when the picture before was taken.

use crate::camera::rasterizer::{Before, Shot};
use crate::lanes::{F, Simd, V3, select, splat};
use crate::visibility::{RenderError, View};
use scene::PoseF32;

/// How instances moved against the camera; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct Moves {
    list: Vec<Move>,
    /// fx, fy, cx, cy of the picture before \[pixels\]; `None` where there is none.
    lens: Option<[f32; 4]>,
}

/// How one instance moved.
#[derive(Clone, Copy, Debug)]
struct Move {
    /// Neither it nor the camera moved, and the lens is the same.
    still: bool,
    /// The camera of the picture before, from the instance.
    camera_from_instance: PoseF32,
}

impl Moves {
    pub(crate) fn bytes(&self) -> usize {
        self.list.capacity() * size_of::<Move>()
    }

    /// Takes up where the instances of a shot were.
    ///
    /// # Errors
    ///
    /// A picture before of another scene, or with a view or a pose that is no good.
    pub(crate) fn prepare(&mut self, shot: &Shot<'_>) -> Result<(), RenderError> {
        self.list.clear();
        self.lens = None;
        let Some(Before { poses, view }) = shot.before else { return Ok(()) };
        if shot.lens.is_some() {
            return Err(RenderError::LensFlow);
        }
        view.validate()?;
        let expected = shot.scene.instances().len();
        if poses.len() != expected {
            return Err(RenderError::PoseCount { expected, found: poses.len() });
        }
        if let Some((instance, pose)) = poses.iter().enumerate().find(|(_, pose)| !pose.is_rigid()) {
            return Err(RenderError::InstancePose { instance, pose: *pose });
        }
        let lens = |view: &View| [view.fx, view.fy, view.cx, view.cy];
        let same = lens(view) == lens(shot.view) && view.world_from_camera == shot.view.world_from_camera;
        self.list.extend(poses.iter().zip(shot.poses).map(|(before, now)| Move {
            still: same && before == now,
            camera_from_instance: view.world_from_camera.inverse_times(before),
        }));
        self.lens = Some(lens(view));
        Ok(())
    }

    /// How far points of an instance, seen at (u, v), have moved; `local` is where they are in its frame.
    #[inline(always)]
    pub(crate) fn of<S: Simd>(&self, s: S, instance: usize, local: V3<S>, [u, v]: [F<S>; 2]) -> [F<S>; 2] {
        let unknown = splat(s, f32::INFINITY);
        let (Some(Move { still, camera_from_instance }), Some([fx, fy, cx, cy])) = (self.list.get(instance), self.lens)
        else {
            return [unknown; 2];
        };
        if *still {
            return [splat(s, 0.0); 2];
        }
        let there = local.rotate(&camera_from_instance.rotation).add(V3::splat(s, camera_from_instance.translation));
        let ahead = there.z.simd_gt(splat(s, 0.0));
        let nearness = 1.0 / select(ahead, there.z, splat(s, 1.0));
        let right = u - (there.x * nearness * fx + cx);
        let down = v - (there.y * nearness * fy + cy);
        [select(ahead, right, unknown), select(ahead, down, unknown)]
    }
}
