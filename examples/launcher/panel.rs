//! Four channels of a camera side by side, with titles and a scale for the depth.

use super::image_file;
use embedded_graphics::mono_font::MonoTextStyle;
use embedded_graphics::mono_font::ascii::{FONT_8X13, FONT_10X20};
use embedded_graphics::pixelcolor::Rgb888;
use embedded_graphics::prelude::*;
use embedded_graphics::text::{Alignment, Baseline, Text, TextStyleBuilder};
use image::{Rgb, RgbImage};
use kinetoscope::ndarray::{ArrayView, Axis, RemoveAxis};
use kinetoscope::sensors::camera::Camera;
use kinetoscope::sensors::camera::colormap::depth_color;
use std::convert::Infallible;

/// Height of a title \[pixels\].
const TITLE: u32 = 28;
/// Space around images \[pixels\].
const GAP: u32 = 8;
/// Height of the depth scale \[pixels\].
const SCALE: u32 = 24;

/// The channels of one environment's camera.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CameraChannels<'a> {
    /// Width and height \[pixels\].
    pub(crate) size: [usize; 2],
    /// RGBA, four bytes per pixel.
    pub(crate) color: &'a [u8],
    /// Depth \[m\].
    pub(crate) depth: &'a [f32],
    /// Mask ids.
    pub(crate) mask: &'a [i32],
    /// Normals, three numbers per pixel.
    pub(crate) normal: &'a [f32],
}

impl<'a> CameraChannels<'a> {
    /// The images of a camera in row `row`, with one row for each environment that the camera observes.
    ///
    /// # Errors
    /// Color, depth, mask or normals are not enabled, or cannot be rendered.
    pub(crate) fn of(camera: &'a Camera, row: usize) -> super::Result<Self> {
        let (height, width) = camera.image_shape();
        Ok(Self {
            size: [width, height],
            color: slice(camera.color()?, row)?,
            depth: slice(camera.depth()?, row)?,
            mask: slice(camera.mask()?, row)?,
            normal: slice(camera.normal()?, row)?,
        })
    }
}

/// The data of one environment in a channel.
fn slice<T, D: RemoveAxis>(channel: ArrayView<'_, T, D>, row: usize) -> super::Result<&[T]> {
    channel.index_axis_move(Axis(0), row).to_slice().ok_or_else(|| "images are not in C order".into())
}

/// A 2 x 2 grid of color, depth, mask and normals with titles.
pub(crate) fn grid(views: &CameraChannels<'_>) -> RgbImage {
    let size = views.size;
    let range = image_file::finite_range(views.depth.iter().copied()).unwrap_or([0.0, 1.0]);
    let images = [
        ("Color", image_file::color_image(size, views.color)),
        ("Depth", image_file::depth_image(size, views.depth, range)),
        ("Mask", image_file::mask_image(size, views.mask)),
        ("Normals", image_file::normal_image(size, views.normal)),
    ];
    let (width, height) = (size[0] as u32, size[1] as u32);
    let cell = [width + 2 * GAP, height + TITLE + SCALE];
    let mut out = Canvas(RgbImage::from_pixel(2 * cell[0], 2 * cell[1], Rgb([250, 250, 250])));
    for (k, (title, image)) in (0u32..).zip(&images) {
        let (x, y) = (k % 2 * cell[0] + GAP, k / 2 * cell[1] + TITLE);
        image::imageops::replace(&mut out.0, image, i64::from(x), i64::from(y));
        out.title(title, [x + width / 2, y - TITLE / 2]);
        if *title == "Depth" {
            out.depth_scale([x, y + height + 3], width, range);
        }
    }
    out.0
}

/// Size of the tiled [`grid`]s of `num_envs` environments, of channels of `size` (width, height) \[pixels\].
pub(crate) fn tiled_size(size: [usize; 2], num_envs: usize) -> [usize; 2] {
    let (gap, title) = (2 * GAP as usize, (TITLE + SCALE) as usize);
    let columns = (1..).find(|c| c * c >= num_envs).unwrap_or(1);
    [2 * columns * (size[0] + gap), 2 * num_envs.div_ceil(columns) * (size[1] + title)]
}

/// Tiles images of equal size row by row in a grid that is as square as possible.
pub(crate) fn tile(images: &[RgbImage]) -> RgbImage {
    let Some(first) = images.first() else { return RgbImage::default() };
    let columns = (1..).find(|c| c * c >= images.len()).unwrap_or(1);
    let rows = images.len().div_ceil(columns);
    let (width, height) = first.dimensions();
    let mut out = RgbImage::from_pixel(columns as u32 * width, rows as u32 * height, Rgb([250, 250, 250]));
    for (k, image) in images.iter().enumerate() {
        let at = [(k % columns) as i64 * i64::from(width), (k / columns) as i64 * i64::from(height)];
        image::imageops::replace(&mut out, image, at[0], at[1]);
    }
    out
}

pub(crate) struct Canvas(pub(crate) RgbImage);

impl Canvas {
    fn title(&mut self, text: &str, [x, y]: [u32; 2]) {
        let style = MonoTextStyle::new(&FONT_10X20, Rgb888::new(30, 30, 30));
        let place = TextStyleBuilder::new().alignment(Alignment::Center).baseline(Baseline::Middle).build();
        let Ok(_) = Text::with_text_style(text, Point::new(x as i32, y as i32), style, place).draw(self);
    }

    /// Draws a bar of the depth colors with both ends of `range` \[m\] as labels.
    fn depth_scale(&mut self, [x, y]: [u32; 2], width: u32, range: [f32; 2]) {
        let [near, far] = range.map(|d| format!("{d:.2} m"));
        let style = MonoTextStyle::new(&FONT_8X13, Rgb888::new(30, 30, 30));
        let room = 8 * near.len().max(far.len()) as u32 + 6;
        let middle = (y + 7) as i32;
        for (text, x, alignment) in [(&near, x, Alignment::Left), (&far, x + width, Alignment::Right)] {
            let place = TextStyleBuilder::new().alignment(alignment).baseline(Baseline::Middle).build();
            let Ok(_) = Text::with_text_style(text, Point::new(x as i32, middle), style, place).draw(self);
        }
        let bar = width.saturating_sub(2 * room);
        for k in 0..bar {
            let depth = range[0] + (range[1] - range[0]) * k as f32 / bar as f32;
            for row in 0..14 {
                self.0.put_pixel(x + room + k, y + row, Rgb(depth_color(depth, range)));
            }
        }
    }
}

impl OriginDimensions for Canvas {
    fn size(&self) -> Size {
        Size::new(self.0.width(), self.0.height())
    }
}

impl DrawTarget for Canvas {
    type Color = Rgb888;
    type Error = Infallible;

    fn draw_iter<I: IntoIterator<Item = Pixel<Rgb888>>>(&mut self, pixels: I) -> Result<(), Infallible> {
        for Pixel(at, color) in pixels {
            if let (Ok(x), Ok(y)) = (u32::try_from(at.x), u32::try_from(at.y))
                && x < self.0.width()
                && y < self.0.height()
            {
                self.0.put_pixel(x, y, Rgb([color.r(), color.g(), color.b()]));
            }
        }
        Ok(())
    }
}
