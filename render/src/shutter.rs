//! When light falls on which row of a image.

use super::request::Shot;
use crate::visibility::RenderError;
use kinetoscope_scene::PoseF32;
use serde::{Deserialize, Serialize};

/// A shutter that takes time: each row of pixels is read `row_time` after the one above it, and each collects light for
/// `exposure_time` before it is read. The last row is read at the instant of the image's stamp, so the first light falls
/// in [`span`](Self::span) before it. With both 0, as by default, a image is of one instant.
///
/// What moves meanwhile is sheared by the first (rolling shutter) and blurred by the second (motion blur). Cameras look at
/// where things are at the physics step at which the shutter opens, or the one before, and at the stamp; between, things go
/// straight and turn steadily. What somebody puts elsewhere meanwhile counts as having been there since the shutter opened: how
/// it moves from then on is spread over the whole span. Lights are where they are at the stamp. Needs
/// [`Renderer::RayTraced`](crate::renderer::Renderer::RayTraced). Colors are of the whole exposure; all other channels of its middle,
/// row by row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Shutter {
    /// From the reading of a row to that of the next \[s\].
    pub row_time: f64,
    /// How long each row collects light \[s\].
    pub exposure_time: f64,
}

/// What tells a image from others of the same things from the same place.
#[derive(Clone, Copy, Debug, Default)]
pub struct Take<'a> {
    /// Paths with another number have other noise: of another image, or of another environment.
    pub noise: u32,
    /// Where things were when the shutter opened; without it nothing moves.
    pub opened: Option<Opened<'a>>,
}

/// Where things were when the shutter opened.
#[derive(Clone, Copy, Debug)]
pub struct Opened<'a> {
    /// Pose of each instance then: world from instance.
    pub poses: &'a [PoseF32],
    /// Where the camera was.
    pub world_from_camera: PoseF32,
    /// How long before the image's stamp that was \[s\]: at least the shutter's [`span`](Shutter::span).
    pub before: f64,
}

/// The time in which the shutter of a frame is open: the poses at its beginning, and the instants of rows.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ShutterInterval<'a> {
    pub(crate) opened: Opened<'a>,
    pub(crate) clock: Clock,
}

/// When rows see what they see, in parts of the time from where things were (0) to where they are (1).
#[derive(Clone, Copy, Debug)]
pub(crate) struct Clock {
    last_row: usize,
    row: f64,
    exposure: f64,
}

impl Clock {
    /// The time of a part of a row's exposure: 0 is its end, 1 its beginning.
    pub(crate) fn at(&self, row: usize, part: f64) -> f64 {
        let before = self.last_row.saturating_sub(row) as f64 * self.row + part * self.exposure;
        (1.0 - before).max(0.0)
    }
}

impl Shutter {
    /// Whether the whole image is of one instant.
    pub fn is_instant(&self) -> bool {
        self.row_time == 0.0 && self.exposure_time == 0.0
    }

    /// From the first light to the last row's reading \[s\], of a image of so many rows.
    pub fn span(&self, rows: usize) -> f64 {
        self.row_time * rows.saturating_sub(1) as f64 + self.exposure_time
    }

    /// Checks the numbers.
    pub fn check(&self) -> Result<(), RenderError> {
        for (what, value) in [("row_time", self.row_time), ("exposure_time", self.exposure_time)] {
            if !(value >= 0.0 && value.is_finite()) {
                return Err(RenderError::Shutter { what, value });
            }
        }
        Ok(())
    }

    /// The time in which the shutter of a frame is open; `None` where that is one instant.
    ///
    /// # Errors
    ///
    /// Poses from when the shutter opened that are no good, or not old enough.
    pub(crate) fn interval<'a>(
        &self,
        shot: &Shot<'_>,
        take: &Take<'a>,
    ) -> Result<Option<ShutterInterval<'a>>, RenderError> {
        let Some(opened) = take.opened.filter(|_| !self.is_instant()) else { return Ok(None) };
        let Opened { poses, world_from_camera, before } = opened;
        let expected = shot.scene.instances().len();
        if poses.len() != expected {
            return Err(RenderError::PoseCount { expected, found: poses.len() });
        }
        if let Some((instance, pose)) = poses.iter().enumerate().find(|(_, pose)| !pose.is_rigid()) {
            return Err(RenderError::InstancePose { instance, pose: *pose });
        }
        if !world_from_camera.is_rigid() {
            return Err(RenderError::CameraPose { pose: world_from_camera });
        }
        let span = self.span(shot.view.height);
        // Half a nanosecond: times are sums.
        if !(before + 5e-10 >= span && before > 0.0 && before.is_finite()) {
            return Err(RenderError::Opened { before, span });
        }
        let last_row = shot.view.height.saturating_sub(1);
        let clock = Clock { last_row, row: self.row_time / before, exposure: self.exposure_time / before };
        Ok(Some(ShutterInterval { opened, clock }))
    }
}
