//! Exposure time and rolling shutter.

use super::request::RenderRequest;
use crate::visibility::RenderError;
use kinetoscope_scene::PoseF32;
use serde::{Deserialize, Serialize};

/// Rolling shutter with an exposure time: each row of pixels is read `row_time` after the row above it, and each
/// collects light for `exposure_time` before it is read. The last row is read at the time stamp of the image, so
/// exposure starts [`span`](Self::span) before the stamp. With both times 0, the default, an image shows one instant.
///
/// `row_time` shears moving objects (rolling shutter), `exposure_time` blurs them (motion blur). Cameras use two poses
/// of each object: at the physics step at or just before shutter opening, and at the time stamp. Between them, objects
/// move straight and rotate steadily. A write to the state while the shutter is open replaces the poses at shutter
/// opening; the motion after the write is spread over the whole span. Lights have their poses at the stamp.
///
/// A shutter needs [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced). Color integrates the whole exposure.
/// In all other channels, each row shows the middle of its exposure.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shutter {
    /// Time from the reading of a row to that of the next \[s\].
    pub row_time: f64,
    /// Exposure time of each row \[s\].
    pub exposure_time: f64,
}

/// Noise and motion of one frame, for path tracing.
#[derive(Clone, Copy, Debug, Default)]
pub struct FrameSample<'a> {
    /// Number that is combined with the seed of [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced) by XOR:
    /// different numbers for frames and environments give each its own noise.
    pub noise: u32,
    /// Poses at or before shutter opening. With `None`, all rows show the instant of the request's poses, whatever the
    /// shutter.
    pub shutter_open: Option<ShutterOpenState<'a>>,
}

/// Poses at shutter opening, or shortly before it.
#[derive(Clone, Copy, Debug)]
pub struct ShutterOpenState<'a> {
    /// Pose of each instance, in the order of the scene: world from instance.
    pub poses: &'a [PoseF32],
    /// Pose of the camera's optical frame at the same time.
    pub world_from_camera: PoseF32,
    /// Time from these poses to the time stamp of the image \[s\]: positive, and at least the shutter's
    /// [`span`](Shutter::span).
    pub age: f64,
}

/// Exposure interval of a frame: the poses at its beginning, and the instants of its rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShutterInterval<'a> {
    pub(crate) opened: ShutterOpenState<'a>,
    pub(crate) clock: RowClock,
}

/// Instants of rows, as a fraction of the interval from the first poses (0) to the last poses (1).
#[derive(Clone, Copy, Debug)]
pub(crate) struct RowClock {
    last_row: usize,
    row: f64,
    exposure: f64,
}

impl RowClock {
    /// Instant of `row` at the fraction `part` of its exposure, counted backward: 0 is the end of the exposure, 1 its
    /// beginning.
    pub(crate) fn at(&self, row: usize, part: f64) -> f64 {
        let before = self.last_row.saturating_sub(row) as f64 * self.row + part * self.exposure;
        (1.0 - before).max(0.0)
    }
}

impl Shutter {
    /// True if the whole image shows one instant.
    pub fn is_instant(&self) -> bool {
        self.row_time == 0.0 && self.exposure_time == 0.0
    }

    /// Time from shutter opening to the reading of the last row \[s\], for an image with `rows` rows.
    pub fn span(&self, rows: usize) -> f64 {
        self.row_time * rows.saturating_sub(1) as f64 + self.exposure_time
    }

    /// Checks that both times are valid.
    ///
    /// # Errors
    ///
    /// [`RenderError::Shutter`] for a time that is negative or not finite.
    pub fn check(&self) -> Result<(), RenderError> {
        for (what, value) in [("row_time", self.row_time), ("exposure_time", self.exposure_time)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(RenderError::Shutter { what, value });
            }
        }
        Ok(())
    }

    /// Exposure interval of a frame; `None` if the frame shows one instant.
    ///
    /// # Errors
    ///
    /// For poses at shutter opening that are invalid, or not old enough.
    pub(crate) fn exposure_interval<'a>(
        &self,
        render_request: &RenderRequest<'_>,
        take: &FrameSample<'a>,
    ) -> Result<Option<ShutterInterval<'a>>, RenderError> {
        let Some(opened) = take.shutter_open.filter(|_| !self.is_instant()) else { return Ok(None) };
        let ShutterOpenState { poses, world_from_camera, age } = opened;
        let expected = render_request.scene.instances().len();
        if poses.len() != expected {
            return Err(RenderError::PoseCount { expected, found: poses.len() });
        }
        if let Some((instance, pose)) = poses.iter().enumerate().find(|(_, pose)| !pose.is_rigid()) {
            return Err(RenderError::InstancePose { instance, pose: *pose });
        }
        if !world_from_camera.is_rigid() {
            return Err(RenderError::CameraPose { pose: world_from_camera });
        }
        let span = self.span(render_request.view.height);
        // Tolerance of half a nanosecond: times are sums.
        if !(age + 5e-10 >= span && age > 0.0 && age.is_finite()) {
            return Err(RenderError::ShutterPoses { age, span });
        }
        let last_row = render_request.view.height.saturating_sub(1);
        let clock = RowClock { last_row, row: self.row_time / age, exposure: self.exposure_time / age };
        Ok(Some(ShutterInterval { opened, clock }))
    }
}
