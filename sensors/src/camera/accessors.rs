//! One method for each channel of a camera: `camera.depth()` is `camera.channel::<Depth>()`.

use super::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::frame::{self, PictureView};

/// Declares the methods.
macro_rules! accessors {
    ($($(#[$doc:meta])* $name:ident :: $Channel:ident,)*) => {
        impl Camera {
            $($(#[$doc])*
            ///
            /// The first axis is the camera's environments. Draws what was captured since the last reading.
            ///
            /// # Errors
            ///
            /// As [`channel`](Self::channel).
            pub fn $name(&self) -> Result<PictureView<'_, frame::$Channel>, SensorError> {
                self.channel::<frame::$Channel>()
            })*
        }
    };
}

kinetoscope_render::with_channels!(accessors);
