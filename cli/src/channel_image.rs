//! Image channels as PNG files.

use crate::command_status::Result;
use image::{Rgb, RgbImage};
use kinetoscope::render::frame::Frame;
use kinetoscope::sensors::camera::colormap::{depth_color, mask_color, normal_color};
use std::path::Path;

/// Image channel to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub(crate) enum Channel {
    /// Rendered color
    Color,
    /// Depth along the optical axis, in colors from dark blue (nearest) to red (farthest)
    Depth,
    /// Segmentation: one color per link, object or geom of the world
    Mask,
    /// Surface normals as colors
    Normal,
}

/// Writes a channel of a frame as a PNG file, with depths colored from the nearest to the farthest. A channel that the
/// frame does not have is black.
///
/// # Errors
/// The file cannot be written, or its name does not end in `.png`.
pub(crate) fn write(frame: &Frame, channel: Channel, [width, height]: [usize; 2], path: &Path) -> Result<()> {
    if path.extension().is_none_or(|e| !e.eq_ignore_ascii_case("png")) {
        return Err(format!("{}: images are written as PNG; use a file name that ends in .png", path.display()).into());
    }
    let depths = frame.depth.as_deref().unwrap_or_default();
    let finite = depths.iter().copied().filter(|d| d.is_finite());
    let range = finite.fold([f32::MAX, f32::MIN], |[low, high], d| [low.min(d), high.max(d)]);
    let color = |k: usize| match channel {
        Channel::Color => frame.color.as_ref().map(|c| [c[4 * k], c[4 * k + 1], c[4 * k + 2]]),
        Channel::Depth => frame.depth.as_ref().map(|d| depth_color(d[k], range)),
        Channel::Mask => frame.mask.as_ref().map(|m| mask_color(m[k])),
        Channel::Normal => frame.normal.as_ref().map(|n| normal_color([n[3 * k], n[3 * k + 1], n[3 * k + 2]])),
    };
    let image = RgbImage::from_fn(width as u32, height as u32, |x, y| {
        Rgb(color(y as usize * width + x as usize).unwrap_or_default())
    });
    image.save(path).map_err(|e| format!("{}: {e}", path.display()).into())
}
