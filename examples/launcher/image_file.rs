//! Camera channels as image and array files.

use super::Result;
use image::{Rgb, RgbImage};
use kinetoscope::ndarray::{ArrayBase, Data, Dimension};
use kinetoscope::scene::npy;
use kinetoscope::sensors::camera::colormap::{depth_color, mask_color, normal_color};
use std::fs::File;
use std::io::{BufWriter, Write};
use std::path::Path;

/// Space between two images \[pixels\].
const GAP: u32 = 8;

/// Writes an array as `.npy`.
pub(crate) fn write_npy<S, D>(path: &Path, array: &ArrayBase<S, D>) -> Result
where
    S: Data,
    S::Elem: npy::NpyElement,
    D: Dimension,
{
    let write = || {
        let mut file = BufWriter::new(File::create(path)?);
        npy::write(&mut file, array)?;
        file.flush()
    };
    write().map_err(|e: std::io::Error| format!("{}: {e}", path.display()).into())
}

/// Writes an image as PNG.
pub(crate) fn write_png(path: &Path, image: &RgbImage) -> Result {
    image.save(path).map_err(|e| format!("{}: {e}", path.display()).into())
}

/// RGB image of RGBA bytes; the alpha channel is dropped.
pub(crate) fn color_image(size: [usize; 2], color: &[u8]) -> RgbImage {
    rgb_image(size, |k| [color[4 * k], color[4 * k + 1], color[4 * k + 2]])
}

/// Two images of the same size, side by side.
pub(crate) fn side_by_side(size: [usize; 2], colors: [&[u8]; 2]) -> RgbImage {
    let [left, right] = colors.map(|color| color_image(size, color));
    let second = left.width() + GAP;
    let mut both = RgbImage::from_pixel(second + right.width(), left.height(), Rgb([255; 3]));
    image::imageops::replace(&mut both, &left, 0, 0);
    image::imageops::replace(&mut both, &right, second.into(), 0);
    both
}

/// Depth image, colored over `range` \[m\].
pub(crate) fn depth_image(size: [usize; 2], depth: &[f32], range: [f32; 2]) -> RgbImage {
    rgb_image(size, |k| depth_color(depth[k], range))
}

/// Mask image with one color per id.
pub(crate) fn mask_image(size: [usize; 2], mask: &[i32]) -> RgbImage {
    rgb_image(size, |k| mask_color(mask[k]))
}

/// Normals as colors.
pub(crate) fn normal_image(size: [usize; 2], normal: &[f32]) -> RgbImage {
    rgb_image(size, |k| normal_color([normal[3 * k], normal[3 * k + 1], normal[3 * k + 2]]))
}

fn rgb_image([width, height]: [usize; 2], color: impl Fn(usize) -> [u8; 3]) -> RgbImage {
    RgbImage::from_fn(width as u32, height as u32, |x, y| Rgb(color(y as usize * width + x as usize)))
}

/// The smallest and largest finite value; `None` without finite values.
pub(crate) fn finite_range(depth: impl IntoIterator<Item = f32>) -> Option<[f32; 2]> {
    depth
        .into_iter()
        .filter(|d| d.is_finite())
        .fold(None, |range, d| Some(range.map_or([d, d], |[low, high]: [f32; 2]| [low.min(d), high.max(d)])))
}
