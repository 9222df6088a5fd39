//! One method for each channel of a camera: `camera.depth()` is `camera.channel::<Depth>()`.

use super::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::frame::{
    Albedo, Color, Depth, Distance, Flow, Mask, Normal, PictureView, Position, ShadingNormal,
};

/// Declares the methods.
macro_rules! accessors {
    ($($(#[$doc:meta])* $name:ident -> $Channel:ident,)*) => {
        impl Camera {
            $($(#[$doc])*
            ///
            /// The first axis is the camera's environments. Draws what was captured since the last reading.
            ///
            /// # Errors
            ///
            /// As [`channel`](Self::channel).
            pub fn $name(&self) -> Result<PictureView<'_, $Channel>, SensorError> {
                self.channel::<$Channel>()
            })*
        }
    };
}

accessors! {
    /// Colour (sRGB) and opacity (always 255), u8, 4 per pixel.
    color -> Color,
    /// Depth along the optical axis \[m\], f32; +inf where nothing was hit.
    depth -> Depth,
    /// Distance from the camera \[m\], f32; +inf where nothing was hit.
    distance -> Distance,
    /// Mask id, i32; 0 where nothing was hit.
    mask -> Mask,
    /// Normal of the surface itself, turned to the camera, unit, world frame, f32, 3 per pixel; 0 where nothing was hit.
    normal -> Normal,
    /// Normal that light sees (smooth), unit, world frame, f32, 3 per pixel; 0 where nothing was hit.
    shading_normal -> ShadingNormal,
    /// Where the surface is, frame of the environment \[m\], f32, 3 per pixel; 0 where nothing was hit.
    position -> Position,
    /// Colour of the surface itself, without light (sRGB), and opacity, u8, 4 per pixel; 0 where nothing was hit.
    albedo -> Albedo,
    /// How far what is seen has moved since the image before (right, down) \[pixels\], f32, 2 per pixel; +inf where nothing
    /// was hit and in the first image.
    flow -> Flow,
}
