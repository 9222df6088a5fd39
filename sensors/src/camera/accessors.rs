//! Accessor methods of the camera channels: `camera.depth()` is `camera.channel::<Depth>()`.

use super::sensor::Camera;
use crate::error::SensorError;
use kinetoscope_render::frame::{self, ImageView};

/// Declares one accessor method per channel.
macro_rules! accessors {
    ($($(#[$doc:meta])* $name:ident :: $Channel:ident,)*) => {
        impl Camera {
            $($(#[$doc])*
            ///
            /// The first axis is the environments of the camera. Renders the frames captured since the last read.
            ///
            /// # Errors
            ///
            /// Same as [`channel`](Self::channel).
            pub fn $name(&self) -> Result<ImageView<'_, frame::$Channel>, SensorError> {
                self.channel::<frame::$Channel>()
            })*
        }
    };
}

kinetoscope_render::with_channels!(accessors);
