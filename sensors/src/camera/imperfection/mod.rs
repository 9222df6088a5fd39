//! Imperfections of real cameras, applied to rendered images; one file per imperfection.
//!
//! Imperfections of light work on linear radiance, where 1 is a fully lit white surface. The color bytes are converted
//! back through sRGB and the tone curve, modified, and encoded again. The radiance therefore has 256 levels. A white
//! pixel (byte 255) is decoded to the smallest radiance that is encoded as white. Only the exposure is applied by the
//! renderers, before the tone curve.
//!
//! Imperfections of depth change the quantity that near and far limit, here called the clip depth: depth along the
//! optical axis, or distance along the ray if not all rays of the lens go forward. The other of the two is recomputed
//! from the clip depth. All other channels keep the ground truth.
//!
//! Motion blur is not an imperfection, because it needs several instants that a finished image does not contain. See
//! [`CameraCfg::shutter`](super::CameraCfg::shutter).

mod effect;
mod tone;

use super::error::CameraError;
use crate::error::SensorError;
pub(super) use effect::ImageContext;
use effect::{DepthEffect, PixelContext, RadianceEffect, within};
use kinetoscope_render::ToneCurve;
use kinetoscope_render::frame::{Channel, Channels, FrameMut};
use kinetoscope_render::frame::{Color, Depth};
use serde::{Deserialize, Serialize};
use tone::ToneLut;

/// Declares the imperfections, in the order of their application: one module and one type each.
macro_rules! imperfections {
    (
        light { $($(#[$of_light:meta])* $light:ident :: $Light:ident,)* }
        depth { $($(#[$of_depth:meta])* $depth:ident :: $Depth:ident,)* }
    ) => {
        $(mod $light; pub use $light::$Light;)*
        $(mod $depth; pub use $depth::$Depth;)*

        /// Imperfections of a camera. A field that is `None`, the default, has no effect.
        ///
        /// The random numbers depend only on the seed of the simulation, the environment, the camera name, the image
        /// index and the pixel.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Imperfections {
            $($(#[$of_light])* pub $light: Option<$Light>,)*
            $($(#[$of_depth])* pub $depth: Option<$Depth>,)*
        }

        impl Imperfections {
            /// Returns true if there is an imperfection of light.
            fn of_light(&self) -> bool {
                false $(|| self.$light.is_some())*
            }

            /// Returns true if there is an imperfection of depth.
            fn of_depth(&self) -> bool {
                false $(|| self.$depth.is_some())*
            }

            /// Returns the imperfections that apply to a camera with these channels.
            pub(crate) fn of_channels(&self, channels: Channels) -> Self {
                Self {
                    $($light: self.$light.filter(|_| channels.color),)*
                    $($depth: self.$depth.filter(|_| channels.depth || channels.distance),)*
                }
            }

            /// Checks all parameters.
            fn check_numbers(&self) -> Result<(), SensorError> {
                $(self.$light.as_ref().map_or(Ok(()), RadianceEffect::check)?;)*
                $(self.$depth.as_ref().map_or(Ok(()), DepthEffect::check)?;)*
                Ok(())
            }

            fn spoil_light(&self, light: &mut [f64; 3], context: &PixelContext<'_>) {
                $(if let Some(imperfection) = &self.$light {
                    imperfection.apply(light, context);
                })*
            }

            fn spoil_depth(&self, depths: &mut [f32], picture: &ImageContext<'_>) {
                $(if let Some(imperfection) = &self.$depth {
                    imperfection.apply(depths, picture);
                })*
            }
        }
    };
}

imperfections! {
    light {
        /// Light falloff away from the optical axis.
        vignetting::Vignetting,
        /// Exposure compensation.
        exposure::Exposure,
        /// Photon noise.
        shot_noise::ShotNoise,
        /// Noise of the electronics.
        read_noise::ReadNoise,
    }
    depth {
        /// Depth holes of structured-light cameras.
        holes::Holes,
        /// Depth noise that grows with the square of the depth.
        depth_noise::DepthNoise,
    }
}

impl Imperfections {
    /// Returns true if all fields are `None`.
    pub(crate) fn is_empty(&self) -> bool {
        !self.of_light() && !self.of_depth()
    }

    /// Checks all parameters, and that `channels` has color for effects on light, and depth or distance for effects on
    /// depth.
    pub(crate) fn check(&self, channels: Channels) -> Result<(), SensorError> {
        let off = |channel| Err(CameraError::ChannelOff { channel, enabled: channels.names() }.into());
        if self.of_light() && !channels.color {
            return off(Color::NAME);
        }
        if self.of_depth() && !channels.depth && !channels.distance {
            return off(Depth::NAME);
        }
        self.check_numbers()
    }

    /// Applies all imperfections to a frame in which misses are infinite.
    pub(super) fn apply(&self, frame: &mut FrameMut<'_>, curve: ToneCurve, image: ImageContext<'_>) {
        let tone = ToneLut::for_curve(curve);
        if let Some(color) = frame.color.as_deref_mut().filter(|_| self.of_light()) {
            for (pixel, bytes) in color.chunks_exact_mut(4).enumerate() {
                let mut light = [bytes[0], bytes[1], bytes[2]].map(|byte| tone.decode(byte));
                self.spoil_light(&mut light, &PixelContext { image, pixel });
                bytes[..3].copy_from_slice(&light.map(|light| tone.encode(light)));
            }
        }
        if !self.of_depth() {
            return;
        }
        let [depth, distance] = [frame.depth.as_deref_mut(), frame.distance.as_deref_mut()];
        let (reach, other) = if image.clips_by_distance() { (distance, depth) } else { (depth, distance) };
        let times = |number: f32, factor: f64| match number.is_finite() {
            true => (f64::from(number) * factor) as f32,
            false => f32::INFINITY,
        };
        match (reach, other) {
            (Some(reach), other) => {
                self.spoil_depth(reach, &image);
                for (pixel, (other, reach)) in other.into_iter().flatten().zip(reach).enumerate() {
                    *other = times(*reach, image.clip_depth_conversion(pixel));
                }
            }
            (None, Some(other)) => {
                for (pixel, number) in other.iter_mut().enumerate() {
                    // At a right angle, depth is 0 for any clip depth, so the clip depth is unknown and has no effect.
                    let factor = image.clip_depth_conversion(pixel).recip();
                    *number = match factor.is_finite() || number.is_infinite() {
                        true => times(*number, factor),
                        false => image.view.near,
                    };
                }
                self.spoil_depth(other, &image);
                for (pixel, number) in other.iter_mut().enumerate() {
                    *number = times(*number, image.clip_depth_conversion(pixel));
                }
            }
            (None, None) => {}
        }
    }
}

#[cfg(test)]
mod tests;
