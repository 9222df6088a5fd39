//! Motion vectors: poses in the previous frame, and optical flow.

use crate::intrinsics::PixelIntrinsics;
use crate::lens::optics::Optics;
use crate::lens::rays::LensRays;
use crate::request::{PreviousState, RenderRequest};
use crate::simd::{F, LANES, M, Simd, V3, load, select, splat};
use crate::visibility::{RenderError, View};
use kinetoscope_scene::PoseF32;

/// Motion of instances relative to the camera since the previous frame; keeps its memory.
#[derive(Clone, Debug, Default)]
pub(crate) struct MotionVectors {
    list: Vec<InstanceMotion>,
    /// Projection of the previous frame; `None` without one.
    previous: Option<PreviousProjection>,
}

/// Projection from a camera's optical frame to pixels.
#[expect(clippy::large_enum_variant, reason = "one value per image; a box would need an allocation for each image")]
#[derive(Clone, Copy, Debug)]
enum PreviousProjection {
    /// fx, fy, cx, cy \[pixels\].
    Pinhole([f32; 4]),
    /// Pixels per meter along x and y, and the pixel on the axis, of an orthographic camera.
    Parallel([f32; 4]),
    Lens(Optics),
}

/// Motion of one instance.
#[derive(Clone, Copy, Debug)]
struct InstanceMotion {
    /// True if neither the instance nor the camera moved, and the lens is the same.
    is_static: bool,
    /// Camera of the previous frame, from the instance.
    camera_from_instance: PoseF32,
}

impl MotionVectors {
    pub(crate) fn bytes(&self) -> usize {
        self.list.capacity() * size_of::<InstanceMotion>()
    }

    /// Stores the poses of the previous frame.
    ///
    /// # Errors
    ///
    /// For a previous frame of another scene, or with an invalid view or pose.
    pub(crate) fn prepare(&mut self, render_request: &RenderRequest<'_>) -> Result<(), RenderError> {
        self.list.clear();
        self.previous = None;
        let Some(PreviousState { poses, view }) = render_request.previous else { return Ok(()) };
        view.validate()?;
        let expected = render_request.scene.instances().len();
        if poses.len() != expected {
            return Err(RenderError::PoseCount { expected, found: poses.len() });
        }
        if let Some((instance, pose)) = poses.iter().enumerate().find(|(_, pose)| !pose.is_rigid()) {
            return Err(RenderError::InstancePose { instance, pose: *pose });
        }
        let numbers = |view: &View| [view.fx, view.fy, view.cx, view.cy];
        let (then, now) = (numbers(view), numbers(render_request.view));
        let same = then == now
            && view.parallel == render_request.view.parallel
            && view.world_from_camera == render_request.view.world_from_camera;
        self.list.extend(poses.iter().zip(render_request.poses).map(|(before, now)| InstanceMotion {
            is_static: same && before == now,
            camera_from_instance: view.world_from_camera.inverse_times(before),
        }));
        let behind = |rays: &LensRays| {
            // The intrinsics of the rays have more digits.
            let [fx, fy, cx, cy] = then.map(f64::from);
            if then == now { *rays.optics() } else { rays.optics().with_pixels(PixelIntrinsics { fx, fy, cx, cy }) }
        };
        self.previous = Some(render_request.lens.map_or(
            if view.parallel { PreviousProjection::Parallel(then) } else { PreviousProjection::Pinhole(then) },
            |rays| PreviousProjection::Lens(behind(rays)),
        ));
        Ok(())
    }

    /// Motion of points of an instance, seen at (u, v) \[pixels\]; `local` are their positions in its frame. Lanes
    /// outside of `here` are undefined.
    #[inline(always)]
    pub(crate) fn flow_at<S: Simd>(
        &self,
        s: S,
        instance: usize,
        local: V3<S>,
        [u, v]: [F<S>; 2],
        here: M<S>,
    ) -> [F<S>; 2] {
        let unknown = splat(s, f32::INFINITY);
        let (Some(InstanceMotion { is_static, camera_from_instance }), Some(eye)) =
            (self.list.get(instance), self.previous)
        else {
            return [unknown; 2];
        };
        if *is_static {
            return [splat(s, 0.0); 2];
        }
        let there = local.rotate(&camera_from_instance.rotation).add(V3::splat(s, camera_from_instance.translation));
        match eye {
            PreviousProjection::Pinhole([fx, fy, cx, cy]) => {
                let ahead = there.z.simd_gt(splat(s, 0.0));
                let nearness = 1.0 / select(ahead, there.z, splat(s, 1.0));
                let right = u - (there.x * nearness * fx + cx);
                let down = v - (there.y * nearness * fy + cy);
                [select(ahead, right, unknown), select(ahead, down, unknown)]
            }
            PreviousProjection::Parallel([fx, fy, cx, cy]) => [u - (there.x * fx + cx), v - (there.y * fy + cy)],
            PreviousProjection::Lens(optics) => {
                let [x, y, z]: [[f32; LANES]; 3] = [there.x, there.y, there.z].map(|axis| axis.array());
                let [u, v]: [[f32; LANES]; 2] = [u, v].map(|axis| axis.array());
                let mut flow = [[f32::INFINITY; LANES]; 2];
                // Lane by lane, and only where needed: some lenses are slow.
                let here = here.to_bitmask();
                for lane in (0..LANES).filter(|lane| here >> lane & 1 == 1) {
                    let direction = [x[lane], y[lane], z[lane]].map(f64::from);
                    if let Some(before) = optics.project(direction) {
                        flow[0][lane] = (f64::from(u[lane]) - before[0]) as f32;
                        flow[1][lane] = (f64::from(v[lane]) - before[1]) as f32;
                    }
                }
                flow.map(|axis| load(s, &axis))
            }
        }
    }
}
