//! Rolling shutter: renders each row at its own instant, in all channels but path-traced color.

use super::request::RenderRequest;
use super::shutter::ShutterInterval;
use crate::frame::{Channels, Frame, FrameMut};
use crate::raster::tile::BLOCK;
use crate::shade::band::RasterScratch;
use crate::shade::prepared_frame::{PreparedFrame, RenderSettings};
use crate::trace::motion::Motion;
use crate::visibility::{RenderError, View};
use kinetoscope_scene::PoseF32;

/// Scratch memory for one row.
#[derive(Clone, Debug, Default)]
pub(super) struct RollingShutter {
    prepared: PreparedFrame,
    poses: Vec<PoseF32>,
    /// Buffers of a row of blocks.
    frame: Frame,
    /// Width and channels of the buffers.
    size: (usize, Channels),
}

impl RollingShutter {
    pub(super) fn bytes(&self) -> usize {
        let (width, channels) = self.size;
        self.prepared.bytes()
            + self.poses.capacity() * size_of::<PoseF32>()
            + width * BLOCK * channels.bytes_per_pixel()
    }

    /// Renders row `y` of an image, at the middle of its exposure, into a frame of that row.
    pub(super) fn render_row(
        &mut self,
        scratch: &mut RasterScratch,
        style: RenderSettings<'_>,
        render_request: &RenderRequest<'_>,
        interval: &ShutterInterval<'_>,
        y: usize,
        row: &mut FrameMut<'_>,
    ) -> Result<(), RenderError> {
        let Self { prepared, poses, frame, size } = self;
        let ShutterInterval { opened, clock } = interval;
        let wanted = (render_request.view.width, row.channels());
        if *size != wanted {
            (*frame, *size) = (Frame::new(wanted.0, BLOCK, wanted.1), wanted);
        }
        let time = clock.at(y, 0.5);
        let at = |from: &PoseF32, to: &PoseF32| Motion::between(from, to).map_or(*to, |m| PoseF32::from(&m.at(time)));
        poses.clear();
        poses.extend(opened.poses.iter().zip(render_request.poses).map(|(from, to)| at(from, to)));
        let world_from_camera = at(&opened.world_from_camera, &render_request.view.world_from_camera);
        let render_request =
            RenderRequest { poses, view: &View { world_from_camera, ..*render_request.view }, ..*render_request };
        prepared.prepare_row(style, &render_request, &frame.as_mut(), y)?;
        let block = y / BLOCK;
        scratch.render_band(prepared, &render_request, &mut frame.as_mut(), block..block + 1);
        row.take_row(frame, y % BLOCK, wanted.0);
        Ok(())
    }
}
