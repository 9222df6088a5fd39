//! What a camera measures: one channel per file, all of them in one list.

use crate::visibility::RenderError;

/// Lanes of a [`PixelGroup`].
const LANES: usize = 16;

/// Everything that is known of 8 x 2 pixels; what channels are made of.
#[derive(Clone, Debug)]
pub struct PixelGroup {
    /// Linear or final, as the stage says: final bytes.
    pub color: [[u8; 4]; LANES],
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
    /// Where the surface is, world frame \[m\]; 0 on a miss.
    pub position: [[f32; LANES]; 3],
}

impl Default for PixelGroup {
    fn default() -> Self {
        let v = [[0.0; LANES]; 3];
        Self {
            color: [[0; 4]; LANES],
            depth: [0.0; LANES],
            distance: [0.0; LANES],
            mask: [0; LANES],
            normal: v,
            shading_normal: v,
            position: v,
        }
    }
}

/// When a channel is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// As soon as it is known what each pixel centre sees.
    Geometry,
    /// After light, transparency and multisampling.
    Color,
}

/// One thing a camera measures at every pixel.
pub trait Channel {
    /// The type of its numbers.
    type Number: Copy + Default + PartialEq + std::fmt::Debug + Send + Sync + 'static;
    /// Its name.
    const NAME: &'static str;
    /// Numbers per pixel.
    const COMPONENTS: usize;
    /// When it is known.
    const STAGE: Stage;

    /// The numbers of one pixel.
    fn write(group: &PixelGroup, lane: usize, out: &mut [Self::Number]);
}

/// Declares the channels: a module with a type of its own each.
macro_rules! channels {
    ($($(#[$doc:meta])* $field:ident :: $Name:ident,)*) => {
        $(mod $field; pub use $field::$Name;)*

        /// Which channels are wanted.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Channels {
            $($(#[$doc])* pub $field: bool,)*
        }

        impl Channels {
            /// All of them.
            pub const ALL: Self = Self { $($field: true,)* };
            /// Their names.
            pub const NAMES: &'static [&'static str] = &[$($Name::NAME),*];
        }

        /// Pictures of one view, row by row from the top left.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Frame {
            $($(#[$doc])* pub $field: Option<Vec<<$Name as Channel>::Number>>,)*
        }

        /// Where the pictures of one view go; missing channels are not computed.
        #[derive(Debug, Default)]
        pub struct FrameMut<'a> {
            $($(#[$doc])* pub $field: Option<&'a mut [<$Name as Channel>::Number]>,)*
        }

        impl Frame {
            /// Pictures of `width` by `height` pixels, empty.
            pub fn new(width: usize, height: usize, channels: Channels) -> Self {
                let pixels = width * height;
                Self { $($field: channels.$field.then(|| vec![Default::default(); pixels * $Name::COMPONENTS]),)* }
            }

            /// Borrowed for drawing.
            pub fn as_mut(&mut self) -> FrameMut<'_> {
                FrameMut { $($field: self.$field.as_deref_mut(),)* }
            }
        }

        impl FrameMut<'_> {
            /// Which channels there are.
            pub fn channels(&self) -> Channels {
                Channels { $($field: self.$field.is_some(),)* }
            }

            /// Checks the lengths against a number of pixels.
            pub(crate) fn validate(&self, pixels: usize) -> Result<(), RenderError> {
                $(if let Some(buffer) = &self.$field {
                    let (found, expected) = (buffer.len(), pixels * $Name::COMPONENTS);
                    if found != expected {
                        return Err(RenderError::BufferSize { channel: $Name::NAME, expected, found });
                    }
                })*
                Ok(())
            }

            /// Whether a channel of this stage is wanted.
            pub(crate) fn wants(&self, stage: Stage) -> bool {
                false $(|| (self.$field.is_some() && $Name::STAGE == stage))*
            }

            /// Writes the pixels of a group, whose first is at (x, y), that are inside of the picture.
            #[inline(always)]
            pub(crate) fn write(&mut self, stage: Stage, group: &PixelGroup, at: [usize; 2], size: [usize; 2]) {
                $(if $Name::STAGE == stage && let Some(buffer) = &mut self.$field {
                    put::<$Name>(buffer, group, at, size);
                })*
            }
        }
    };
}

#[inline(always)]
fn put<C: Channel>(buffer: &mut [C::Number], group: &PixelGroup, [x, y]: [usize; 2], [width, height]: [usize; 2]) {
    let columns = 8.min(width - x);
    for row in 0..2.min(height - y) {
        let first = ((y + row) * width + x) * C::COMPONENTS;
        let line = &mut buffer[first..first + columns * C::COMPONENTS];
        for (column, out) in line.chunks_exact_mut(C::COMPONENTS).enumerate() {
            C::write(group, row * 8 + column, out);
        }
    }
}

channels! {
    /// Colour (sRGB) and opacity (always 255), u8, 4 per pixel.
    color::Color,
    /// Depth along the optical axis \[m\], f32; +inf where nothing was hit.
    depth::Depth,
    /// Distance from the camera \[m\], f32; +inf where nothing was hit.
    distance::Distance,
    /// Mask id, i32; 0 where nothing was hit.
    mask::Mask,
    /// Normal of the surface itself, turned to the camera, unit, world frame, f32, 3 per pixel; 0 where nothing was hit.
    normal::Normal,
    /// Normal that light sees (smooth), unit, world frame, f32, 3 per pixel; 0 where nothing was hit.
    shading_normal::ShadingNormal,
    /// Where the surface is, world frame \[m\], f32, 3 per pixel; 0 where nothing was hit.
    position::Position,
}
