//! The trait of channels, and what is known of a group of pixels.

use ndarray::{Dimension, Ix3, Ix4};

/// Lanes of a [`PixelGroup`].
const LANES: usize = 16;

/// Everything that is known of 8 x 2 pixels; what channels are made of.
#[derive(Clone, Debug, Default)]
pub struct PixelGroup {
    /// Linear or final, as the stage says: final bytes.
    pub color: [[u8; 4]; LANES],
    /// Color of the surface itself, final bytes; 0 on a miss.
    pub albedo: [[u8; 4]; LANES],
    /// Depth along the optical axis \[m\]; +inf on a miss.
    pub depth: [f32; LANES],
    /// Distance from the camera \[m\]; +inf on a miss.
    pub distance: [f32; LANES],
    /// Mask id; 0 on a miss.
    pub mask: [i32; LANES],
    /// Normal of the surface itself, turned to the camera, world frame; 0 on a miss.
    pub normal: [[f32; LANES]; 3],
    /// Smooth normal, world frame; 0 on a miss.
    pub shading_normal: [[f32; LANES]; 3],
    /// Position of the surface, frame of the environment \[m\]; 0 on a miss.
    pub position: [[f32; LANES]; 3],
    /// How far it has moved since the image before \[pixels\]; +inf on a miss.
    pub flow: [[f32; LANES]; 2],
}

/// When a channel is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// As soon as it is known what each pixel center sees.
    Geometry,
    /// As [`Geometry`](Self::Geometry), and computed only for cameras that measure such a channel: few do.
    Detail,
    /// As [`Detail`](Self::Detail), for the color of surfaces: textures are read for it.
    Albedo,
    /// As [`Detail`](Self::Detail), for what needs the image before.
    Flow,
    /// After light, transparency and multisampling.
    Color,
}

/// One thing a camera measures at every pixel.
pub trait Channel {
    /// The type of its numbers.
    type Number: Copy + Default + PartialEq + std::fmt::Debug + Send + Sync + 'static;
    /// Axes of its images: views, rows, columns, and the numbers of a pixel where there are several.
    type Layout: Layout;
    /// Its name.
    const NAME: &'static str;
    /// Accepted aliases.
    const ALIASES: &'static [&'static str];
    /// Numbers per pixel.
    const COMPONENTS: usize;
    /// When it is known.
    const STAGE: Stage;

    /// The numbers of one pixel.
    fn write(group: &PixelGroup, lane: usize, out: &mut [Self::Number]);

    /// The numbers of pixels beside each other, at most 8 of them. Channels that have them in this order already copy them.
    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [Self::Number]) {
        for (column, out) in out.chunks_exact_mut(Self::COMPONENTS).enumerate() {
            Self::write(group, first + column, out);
        }
    }

    /// Puts `value` where nothing was hit: see `DepthMiss` of cameras. Only for channels that measure how far
    /// something is; the others have a value of their own for a miss.
    fn replace_misses(_numbers: &mut [Self::Number], _value: f32) {}
}

/// The axes of a batch of images.
pub trait Layout: Dimension {
    /// The shape of `views` images with `height` rows of `width` pixels.
    fn of(views: usize, height: usize, width: usize, components: usize) -> Self;
}

/// One number per pixel: (views, height, width).
impl Layout for Ix3 {
    fn of(views: usize, height: usize, width: usize, _components: usize) -> Self {
        Ix3(views, height, width)
    }
}

/// Several numbers per pixel: (views, height, width, components).
impl Layout for Ix4 {
    fn of(views: usize, height: usize, width: usize, components: usize) -> Self {
        Ix4(views, height, width, components)
    }
}

/// Copies the numbers of a row of pixels, of which there are N in a whole one: that many are copied without a call.
#[inline(always)]
pub(super) fn copy_row<const N: usize, T: Copy>(from: &[T], out: &mut [T]) {
    match (<&mut [T; N]>::try_from(&mut *out), from.first_chunk()) {
        (Ok(out), Some(from)) => *out = *from,
        _ => out.copy_from_slice(&from[..out.len()]),
    }
}
