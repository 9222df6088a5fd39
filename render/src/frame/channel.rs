//! The trait of image channels, and the group of pixels that channels are written from.

use ndarray::{Dimension, Ix3, Ix4};

/// Lanes of a [`PixelGroup`].
const LANES: usize = 16;

/// Computed values of 8 x 2 pixels, from which channels are written. Lane 8 r + c is the pixel in row r and column c.
#[derive(Clone, Debug, Default)]
pub struct PixelGroup {
    /// Color and opacity after the tone curve (sRGB).
    pub color: [[u8; 4]; LANES],
    /// Base color (sRGB) and opacity; 0 on a miss.
    pub albedo: [[u8; 4]; LANES],
    /// Depth along the optical axis \[m\]; +inf on a miss.
    pub depth: [f32; LANES],
    /// Distance from the camera \[m\]; +inf on a miss.
    pub distance: [f32; LANES],
    /// Mask id; 0 on a miss.
    pub mask: [i32; LANES],
    /// Geometric normal, facing the camera, world frame; 0 on a miss.
    pub normal: [[f32; LANES]; 3],
    /// Interpolated normal, world frame; 0 on a miss.
    pub shading_normal: [[f32; LANES]; 3],
    /// Position of the surface, frame of the environment \[m\]; 0 on a miss.
    pub position: [[f32; LANES]; 3],
    /// Motion since the previous frame (right, down) \[pixels\]; +inf on a miss, without a previous frame, and where
    /// the point was not in front of the camera then.
    pub flow: [[f32; LANES]; 2],
}

/// Stage of rendering at which a channel can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// After visibility: the surface at each pixel center is found.
    Geometry,
    /// As [`Geometry`](Self::Geometry), but computed only for frames with a channel of this stage.
    Surface,
    /// As [`Surface`](Self::Surface), for the base color of surfaces, which reads textures.
    Albedo,
    /// As [`Surface`](Self::Surface), for channels that need the previous frame.
    Flow,
    /// After light, transparency and multisampling.
    Color,
}

/// A quantity that a camera measures at every pixel.
pub trait Channel {
    /// Scalar type of the channel.
    type Element: Copy + Default + PartialEq + std::fmt::Debug + Send + Sync + 'static;
    /// Axes of a batch of images: view, row, column, and component if a pixel has several.
    type Layout: ChannelLayout;
    /// Canonical name.
    const NAME: &'static str;
    /// Accepted aliases.
    const ALIASES: &'static [&'static str];
    /// Components per pixel.
    const COMPONENTS: usize;
    /// Stage at which the channel can be written.
    const STAGE: Stage;

    /// Writes the components of the pixel `lane` of a group.
    fn write(group: &PixelGroup, lane: usize, out: &mut [Self::Element]);

    /// Writes up to 8 horizontally adjacent pixels of a group, as many as `out` holds, from the lane `first` on.
    /// Channels whose memory already has this order override it with a copy.
    #[inline(always)]
    fn write_row(group: &PixelGroup, first: usize, out: &mut [Self::Element]) {
        for (column, out) in out.chunks_exact_mut(Self::COMPONENTS).enumerate() {
            Self::write(group, first + column, out);
        }
    }

    /// Replaces the value of pixels that hit no surface by `value`; see `DepthMiss` of cameras. Only channels that
    /// measure depth or distance do so; other channels have their own value for a miss.
    fn replace_misses(_numbers: &mut [Self::Element], _value: f32) {}
}

/// Axes of a batch of images.
pub trait ChannelLayout: Dimension {
    /// Shape of `views` images with `height` rows of `width` pixels.
    fn dimension(views: usize, height: usize, width: usize, components: usize) -> Self;
}

/// One component per pixel: (views, height, width).
impl ChannelLayout for Ix3 {
    fn dimension(views: usize, height: usize, width: usize, _components: usize) -> Self {
        Ix3(views, height, width)
    }
}

/// Several components per pixel: (views, height, width, components).
impl ChannelLayout for Ix4 {
    fn dimension(views: usize, height: usize, width: usize, components: usize) -> Self {
        Ix4(views, height, width, components)
    }
}

/// Copies a row of pixels. A whole row has N components, a constant length that compiles to no call.
#[inline(always)]
pub(super) fn copy_row<const N: usize, T: Copy>(from: &[T], out: &mut [T]) {
    match (<&mut [T; N]>::try_from(&mut *out), from.first_chunk()) {
        (Ok(out), Some(from)) => *out = *from,
        _ => out.copy_from_slice(&from[..out.len()]),
    }
}
