//! Image channels of a camera: one file per channel, and one list of all of them.

mod channel;
mod file_format;

use crate::visibility::RenderError;
use channel::copy_row;
pub use channel::{Channel, ChannelLayout, PixelGroup, Stage};
use kinetoscope_scene::pattern::{UnknownName, closest_names};
use ndarray::{Array, ArrayView};
use std::ops::Range;

/// A channel of the list, with an array in [`Images`].
pub trait ListedChannel: Channel {
    /// True if the channel is selected.
    fn is_selected(channels: Channels) -> bool;

    /// Images of the channel; `None` if `images` does not store it.
    fn view_in(images: &Images) -> Option<ImageView<'_, Self>>;
}

/// View of the images of one channel, shape (views, height, width) or (views, height, width, components).
pub type ImageView<'a, C> = ArrayView<'a, <C as Channel>::Element, <C as Channel>::Layout>;

/// Calls a macro with the list of channels: documentation, module and type of each.
#[macro_export]
#[doc(hidden)]
macro_rules! with_channels {
    ($then:ident) => {
        $then! {
            /// Color (sRGB) and opacity (always 255), u8, 4 per pixel.
            color::Color,
            /// Depth along the optical axis \[m\], f32; +inf where no surface was hit.
            depth::Depth,
            /// Distance from the camera \[m\], f32; +inf where no surface was hit.
            distance::Distance,
            /// Mask id, i32; 0 where no surface was hit.
            mask::Mask,
            /// Geometric normal, facing the camera, unit, world frame, f32, 3 per pixel; 0 where no surface was hit.
            normal::Normal,
            /// Interpolated normal used for shading, unit, world frame, f32, 3 per pixel; 0 where no surface was hit.
            shading_normal::ShadingNormal,
            /// Position of the surface, frame of the environment \[m\], f32, 3 per pixel; 0 where no surface was hit.
            position::Position,
            /// Base color without lighting (sRGB), and opacity, u8, 4 per pixel; 0 where no surface was hit.
            albedo::Albedo,
            /// Motion of the visible surface since the previous image (right, down) \[pixels\], f32, 2 per pixel; +inf
            /// where no surface was hit, in images without a previous one, and where it was not in front of the camera.
            flow::Flow,
        }
    };
}

/// Declares the channels: a module and a type for each.
macro_rules! channels {
    ($($(#[$doc:meta])* $field:ident :: $Name:ident,)*) => {
        $(mod $field; pub use $field::$Name;)*

        /// Set of selected channels.
        #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
        pub struct Channels {
            $($(#[$doc])* pub $field: bool,)*
        }

        impl Channels {
            /// All channels.
            pub const ALL: Self = Self { $($field: true,)* };
            /// No channels.
            pub const NONE: Self = Self { $($field: false,)* };
            /// Names of all channels.
            pub const NAMES: &'static [&'static str] = &[$($Name::NAME),*];

            /// Creates the set of channels with these names or aliases (`rgb`, `distance_to_image_plane`,
            /// `normals`...). Isaac's names `semantic_segmentation`, `instance_segmentation`,
            /// `instance_segmentation_fast` and `instance_id_segmentation_fast` select the mask, which contains one id
            /// for each link or object. [`Mask`] describes images of instances and classes.
            ///
            /// # Errors
            ///
            /// [`UnknownName`] with the most similar names, for the first unknown name.
            pub fn from_names<S: AsRef<str>>(names: &[S]) -> Result<Self, UnknownName> {
                let mut channels = Self::default();
                for name in names.iter().map(AsRef::as_ref) {
                    match name {
                        $(_ if name == $Name::NAME || $Name::ALIASES.contains(&name) => channels.$field = true,)*
                        _ => return Err(unknown_channel(name, &[$(($Name::NAME, $Name::ALIASES)),*])),
                    }
                }
                Ok(channels)
            }

            /// True if a channel is selected.
            pub fn has<C: ListedChannel>(self) -> bool {
                C::is_selected(self)
            }

            /// Names of the selected channels.
            pub fn names(self) -> Vec<&'static str> {
                [$((self.$field, $Name::NAME)),*].into_iter().filter(|(on, _)| *on).map(|(_, name)| name).collect()
            }

            /// Memory per pixel of the selected channels \[bytes\].
            pub fn bytes_per_pixel(self) -> usize {
                0 $(+ usize::from(self.$field) * size_of::<<$Name as Channel>::Element>() * $Name::COMPONENTS)*
            }
        }

        /// Images of several views, one array per channel; the first axis is the view.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Images {
            $($field: Option<Array<<$Name as Channel>::Element, <$Name as Channel>::Layout>>,)*
        }

        impl Images {
            /// Images of `views` views of `width` by `height` pixels, filled with zeros.
            ///
            /// # Panics
            ///
            /// If the images do not fit into the address space.
            #[track_caller]
            pub fn new(channels: Channels, views: usize, width: usize, height: usize) -> Self {
                Self {
                    $($field: channels.$field.then(|| {
                        let shape = <$Name as Channel>::Layout::dimension(views, height, width, $Name::COMPONENTS);
                        Array::from_elem(shape, Default::default())
                    }),)*
                }
            }

            /// Set of the stored channels.
            pub fn channels(&self) -> Channels {
                Channels { $($field: self.$field.is_some(),)* }
            }

            /// Images of one channel; `None` if the channel is not stored.
            pub fn get<C: ListedChannel>(&self) -> Option<ImageView<'_, C>> {
                C::view_in(self)
            }

            /// Moves the images of `views`, a range of the `all` views, by `by` places toward higher indices. The first
            /// `by` images of the range keep their content; the last `by` are dropped.
            ///
            /// # Panics
            ///
            /// If the range exceeds `all`.
            pub fn shift_views(&mut self, all: usize, views: Range<usize>, by: usize) {
                $(if let Some(numbers) = self.$field.as_mut().and_then(|array| array.as_slice_mut()) {
                    let each = numbers.len() / all.max(1);
                    let kept = views.len().saturating_sub(by) * each;
                    numbers[views.start * each..views.end * each].copy_within(..kept, by.min(views.len()) * each);
                })*
            }

            /// Fills the images of `views`, a range of the `all` views, with zeros.
            ///
            /// # Panics
            ///
            /// If the range exceeds `all`.
            pub fn clear_views(&mut self, all: usize, views: Range<usize>) {
                $(if let Some(numbers) = self.$field.as_mut().and_then(|array| array.as_slice_mut()) {
                    let each = numbers.len() / all.max(1);
                    numbers[views.start * each..views.end * each].fill(Default::default());
                })*
            }

            /// Copies view `from` of `others`, which has `other_count` views, to view `to` of these images, which have
            /// `count` views. Channels that are not stored on both sides are skipped.
            ///
            /// # Panics
            ///
            /// If an index is out of range, or the sizes of the images differ.
            pub fn copy_view(&mut self, count: usize, to: usize, others: &Self, other_count: usize, from: usize) {
                $(if let (Some(numbers), Some(others)) = (
                    self.$field.as_mut().and_then(|array| array.as_slice_mut()),
                    others.$field.as_ref().and_then(|array| array.as_slice()),
                ) {
                    let (each, other) = (numbers.len() / count.max(1), others.len() / other_count.max(1));
                    numbers[to * each..(to + 1) * each].copy_from_slice(&others[from * other..(from + 1) * other]);
                })*
            }

            /// Mutable frames of all views, in order. `views` must be the number of views that the images were made
            /// for.
            pub fn frames_mut(&mut self, views: usize) -> impl Iterator<Item = FrameMut<'_>> {
                $(let mut $field = self.$field.as_mut().and_then(|array| array.as_slice_mut()).map(|numbers| {
                    let each = (numbers.len() / views.max(1)).max(1);
                    numbers.chunks_exact_mut(each)
                });)*
                (0..views).map(move |_| FrameMut { $($field: $field.as_mut().and_then(Iterator::next),)* })
            }
        }

        $(impl ListedChannel for $Name {
            fn is_selected(channels: Channels) -> bool {
                channels.$field
            }

            fn view_in(images: &Images) -> Option<ImageView<'_, Self>> {
                images.$field.as_ref().map(|array| array.view())
            }
        })*

        /// Images of one view, one per channel: row by row from the top left, with the components of a pixel adjacent.
        /// `None` for channels that are not rendered.
        #[derive(Clone, Debug, Default, PartialEq)]
        pub struct Frame {
            $($(#[$doc])* pub $field: Option<Vec<<$Name as Channel>::Element>>,)*
        }

        /// Mutable buffers of one view; channels without a buffer are not computed.
        #[derive(Debug, Default)]
        pub struct FrameMut<'a> {
            $($(#[$doc])* pub $field: Option<&'a mut [<$Name as Channel>::Element]>,)*
        }

        impl Frame {
            /// Images of `width` by `height` pixels for the selected channels, filled with zeros.
            pub fn new(width: usize, height: usize, channels: Channels) -> Self {
                let pixels = width * height;
                Self { $($field: channels.$field.then(|| vec![Default::default(); pixels * $Name::COMPONENTS]),)* }
            }

            /// Mutable buffers of the frame.
            pub fn as_mut(&mut self) -> FrameMut<'_> {
                FrameMut { $($field: self.$field.as_deref_mut(),)* }
            }
        }

        impl<'a> FrameMut<'a> {
            /// Reborrows the buffers for a shorter time.
            pub fn reborrow(&mut self) -> FrameMut<'_> {
                FrameMut { $($field: self.$field.as_deref_mut(),)* }
            }

            /// Splits off the first `pixels` pixels of all channels, or as many as there are.
            pub(crate) fn split_off_first(&mut self, pixels: usize) -> FrameMut<'a> {
                FrameMut { $($field: split_off::<$Name>(&mut self.$field, pixels),)* }
            }
        }

        impl FrameMut<'_> {
            /// Replaces the value of pixels that hit no surface by `value`, in channels of depth or distance.
            pub fn replace_misses(&mut self, value: f32) {
                $(if let Some(numbers) = self.$field.as_deref_mut() {
                    $Name::replace_misses(numbers, value);
                })*
            }

            /// Set of the channels with a buffer.
            pub fn channels(&self) -> Channels {
                Channels { $($field: self.$field.is_some(),)* }
            }

            /// Copies a row of a frame with the same channels and `width` to the first row of these buffers.
            pub(crate) fn take_row(&mut self, from: &Frame, row: usize, width: usize) {
                $(if let (Some(to), Some(from)) = (self.$field.as_deref_mut(), from.$field.as_deref()) {
                    let each = width * $Name::COMPONENTS;
                    to[..each].copy_from_slice(&from[row * each..(row + 1) * each]);
                })*
            }

            /// Checks the lengths of the buffers against a number of pixels.
            pub(crate) fn validate(&self, pixels: usize) -> Result<(), RenderError> {
                $(if let Some(buffer) = &self.$field {
                    let (found, expected) = (buffer.len(), pixels * $Name::COMPONENTS);
                    if found != expected {
                        return Err(RenderError::BufferSize { channel: $Name::NAME, expected, found });
                    }
                })*
                Ok(())
            }

            /// True if a channel of this stage has a buffer.
            pub(crate) fn wants(&self, stage: Stage) -> bool {
                false $(|| (self.$field.is_some() && $Name::STAGE == stage))*
            }

            /// Writes the pixels of a group that are inside the image, in the channels of `stage`. `at` is the column
            /// and row of the first pixel of the group, `size` the width and height of the image.
            #[inline(always)]
            pub(crate) fn write(&mut self, stage: Stage, group: &PixelGroup, at: [usize; 2], size: [usize; 2]) {
                $(if $Name::STAGE == stage && let Some(buffer) = &mut self.$field {
                    write_channel::<$Name>(buffer, group, at, size);
                })*
            }
        }
    };
}

/// The error for an unknown channel name, with the most similar names and aliases.
fn unknown_channel(name: &str, known: &[(&'static str, &[&'static str])]) -> UnknownName {
    let all = known.iter().flat_map(|(own, aliases)| aliases.iter().chain([own]));
    let candidates = closest_names(name, all.copied()).into_iter().map(String::from).collect();
    UnknownName { what: "channel", name: name.into(), candidates }
}

/// Splits off the first pixels of one channel; `None` without a buffer.
fn split_off<'a, C: Channel>(buffer: &mut Option<&'a mut [C::Element]>, pixels: usize) -> Option<&'a mut [C::Element]> {
    let all = buffer.take()?;
    let (first, rest) = all.split_at_mut(pixels.saturating_mul(C::COMPONENTS).min(all.len()));
    *buffer = Some(rest);
    Some(first)
}

#[inline(always)]
fn write_channel<C: Channel>(
    buffer: &mut [C::Element],
    group: &PixelGroup,
    [x, y]: [usize; 2],
    [width, height]: [usize; 2],
) {
    let columns = 8.min(width - x);
    for row in 0..2.min(height - y) {
        let first = ((y + row) * width + x) * C::COMPONENTS;
        C::write_row(group, row * 8, &mut buffer[first..first + columns * C::COMPONENTS]);
    }
}

with_channels!(channels);
