//! What a real camera does to a perfect picture: one imperfection per file, all of them in one list.
//!
//! Those of light work on linear light, where 1 is a white surface in full light: colours are taken back through the tone curve
//! and sRGB, spoilt, and brought to the screen again. So they see what the bytes still tell, 256 levels, and of what is white
//! on the screen the least light that is. Only the exposure is the renderers' own, before the tone curve. Those of depth work
//! on what near and far count, the *reach*: depth along the optical axis, or behind lenses whose rays do not all go forward
//! distance along the ray. The other of the two follows from it. All other channels stay the truth.
//!
//! Motion blur is none of them: light that falls in while the shutter is open is of several instants, which a finished picture
//! does not know any more. It is [`CameraCfg::shutter`](super::CameraCfg::shutter)'s.

mod kinds;
mod tone;

use super::error::CameraError;
use crate::error::SensorError;
pub(super) use kinds::Picture;
use kinds::{OfDepth, OfLight, Place, within};
use kinetoscope_render::ToneCurve;
use kinetoscope_render::frame::{Channel, Channels, FrameMut};
use kinetoscope_render::frame::{Color, Depth};
use serde::{Deserialize, Serialize};
use tone::Tone;

/// Declares the imperfections: a module with a type of its own each, in the order in which they come about.
macro_rules! imperfections {
    (
        light { $($(#[$of_light:meta])* $light:ident :: $Light:ident,)* }
        depth { $($(#[$of_depth:meta])* $depth:ident :: $Depth:ident,)* }
    ) => {
        $(mod $light; pub use $light::$Light;)*
        $(mod $depth; pub use $depth::$Depth;)*

        /// What is not perfect about a camera; `None`, as by default, for what is.
        ///
        /// Random numbers depend on the seed of the simulation, the environment, the name of the camera, which picture it is
        /// and which pixel, and on nothing else.
        #[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Imperfections {
            $($(#[$of_light])* pub $light: Option<$Light>,)*
            $($(#[$of_depth])* pub $depth: Option<$Depth>,)*
        }

        impl Imperfections {
            /// Whether there is one of light.
            fn of_light(&self) -> bool {
                false $(|| self.$light.is_some())*
            }

            /// Whether there is one of depth.
            fn of_depth(&self) -> bool {
                false $(|| self.$depth.is_some())*
            }

            /// What of it there is of a camera with these channels.
            pub(crate) fn of_channels(&self, channels: Channels) -> Self {
                Self {
                    $($light: self.$light.filter(|_| channels.color),)*
                    $($depth: self.$depth.filter(|_| channels.depth || channels.distance),)*
                }
            }

            /// Checks all numbers.
            fn check_numbers(&self) -> Result<(), SensorError> {
                $(self.$light.as_ref().map_or(Ok(()), OfLight::check)?;)*
                $(self.$depth.as_ref().map_or(Ok(()), OfDepth::check)?;)*
                Ok(())
            }

            fn spoil_light(&self, light: &mut [f64; 3], place: &Place<'_>) {
                $(if let Some(imperfection) = &self.$light {
                    imperfection.spoil(light, place);
                })*
            }

            fn spoil_depth(&self, depths: &mut [f32], picture: &Picture<'_>) {
                $(if let Some(imperfection) = &self.$depth {
                    imperfection.spoil(depths, picture);
                })*
            }
        }
    };
}

imperfections! {
    light {
        /// Less light away from the optical axis.
        vignetting::Vignetting,
        /// Longer or shorter exposure.
        exposure::Exposure,
        /// Noise of the light itself, which comes in quanta.
        shot_noise::ShotNoise,
        /// Noise of the electronics.
        read_noise::ReadNoise,
    }
    depth {
        /// Where a projector and a camera beside it measure nothing.
        holes::Holes,
        /// Noise that grows with the square of the depth.
        depth_noise::DepthNoise,
    }
}

impl Imperfections {
    /// Whether there is none.
    pub(crate) fn is_empty(&self) -> bool {
        !self.of_light() && !self.of_depth()
    }

    /// Checks numbers, and that a camera with these channels measures what is spoilt.
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

    /// Spoils a frame in which misses are infinite.
    pub(super) fn spoil(&self, frame: &mut FrameMut<'_>, curve: ToneCurve, picture: Picture<'_>) {
        let tone = Tone::of(curve);
        if let Some(color) = frame.color.as_deref_mut().filter(|_| self.of_light()) {
            for (pixel, bytes) in color.chunks_exact_mut(4).enumerate() {
                let mut light = [bytes[0], bytes[1], bytes[2]].map(|byte| tone.light(byte));
                self.spoil_light(&mut light, &Place { picture, pixel });
                bytes[..3].copy_from_slice(&light.map(|light| tone.byte(light)));
            }
        }
        if !self.of_depth() {
            return;
        }
        let [depth, distance] = [frame.depth.as_deref_mut(), frame.distance.as_deref_mut()];
        let (reach, other) = if picture.reaches_aside() { (distance, depth) } else { (depth, distance) };
        let times = |number: f32, factor: f64| match number.is_finite() {
            true => (f64::from(number) * factor) as f32,
            false => f32::INFINITY,
        };
        match (reach, other) {
            (Some(reach), other) => {
                self.spoil_depth(reach, &picture);
                for (pixel, (other, reach)) in other.into_iter().flatten().zip(reach).enumerate() {
                    *other = times(*reach, picture.other_than_reach(pixel));
                }
            }
            (None, Some(other)) => {
                for (pixel, number) in other.iter_mut().enumerate() {
                    // At a right angle depth is 0 and tells of no reach; nor does any reach change it.
                    let factor = picture.other_than_reach(pixel).recip();
                    *number = match factor.is_finite() || number.is_infinite() {
                        true => times(*number, factor),
                        false => picture.view.near,
                    };
                }
                self.spoil_depth(other, &picture);
                for (pixel, number) in other.iter_mut().enumerate() {
                    *number = times(*number, picture.other_than_reach(pixel));
                }
            }
            (None, None) => {}
        }
    }
}

#[cfg(test)]
mod tests;
