//! Noise of image channels: [`NoiseCfg`] as in other sensors, with random numbers computed from keys.

use super::cfg::CameraCfg;
use crate::error::SensorError;
use crate::noise::{NoiseCfg, check};
use crate::sampling::SampleChannel;
use kinetoscope_render::frame::{Channel as _, Channels, FrameMut};
use kinetoscope_render::frame::{Color, Depth, Distance};
use kinetoscope_render::{RngKey, RngStream};
use std::collections::BTreeMap;

/// Noise of each channel; `None` for channels without noise.
#[derive(Clone, Debug)]
pub(crate) struct ImageNoise {
    color: Option<NoiseCfg>,
    depth: Option<NoiseCfg>,
    distance: Option<NoiseCfg>,
    /// Square root of the time between images, \[√s\].
    sqrt_period: f64,
    /// Ranges of measured depth and distance \[m\].
    ranges: [[f64; 2]; 2],
}

/// Range of color bytes.
const BYTE_RANGE: [f64; 2] = [0.0, 255.0];

impl ImageNoise {
    /// Creates the noise model of `cfg` for images every `period` seconds; `None` if [`CameraCfg::noise`] is empty.
    ///
    /// # Errors
    ///
    /// Invalid noise or dropout, or a channel that is given by two names.
    pub(crate) fn new(cfg: &CameraCfg, period: f64) -> Result<Option<Self>, SensorError> {
        let [near, far] = [f64::from(cfg.near as f32), f64::from(cfg.far as f32)];
        // Rays through corners are longer than their depth, depending on the lens. If near and far are along the ray,
        // points beside the camera have depth 0, and points behind it a negative depth.
        let depths = if cfg.lens.is_forward() { [near, far] } else { [-far, far] };
        let ranges = [depths, [near, f64::from(f32::MAX)]];
        let candidates = [
            (cfg.channels.color, SampleChannel::bounded(Color::NAME, 0, BYTE_RANGE)),
            (cfg.channels.depth, SampleChannel::bounded(Depth::NAME, 0, ranges[0])),
            (cfg.channels.distance, SampleChannel::bounded(Distance::NAME, 0, ranges[1])),
        ];
        let measured: Vec<SampleChannel> =
            candidates.into_iter().filter(|(on, _)| *on).map(|(_, channel)| channel).collect();
        // Alternative channel names are replaced by the canonical ones.
        let named = cfg.noise.iter().map(|(name, noise)| (canonical_name(name), noise));
        check(cfg.dropout, named.clone(), &measured)?;
        let of = |channel: &str| {
            let mut found = named.clone().filter(|(name, _)| *name == channel).map(|(_, noise)| *noise);
            match (found.next(), found.next()) {
                (_, Some(_)) => Err(SensorError::Pattern(format!(
                    "the noise of {channel:?} is given twice, by two names of the channel"
                ))),
                (noise, None) => Ok(noise),
            }
        };
        if cfg.noise.is_empty() {
            return Ok(None);
        }
        Ok(Some(Self {
            color: of(Color::NAME)?,
            depth: of(Depth::NAME)?,
            distance: of(Distance::NAME)?,
            sqrt_period: period.sqrt(),
            ranges,
        }))
    }

    /// Adds noise to a frame whose misses are +inf; misses stay. `key` is the key of the random numbers.
    pub(crate) fn apply(&self, frame: &mut FrameMut<'_>, key: &RngKey) {
        if let (Some(noise), Some(bytes)) = (&self.color, frame.color.as_deref_mut()) {
            // Four pixels have twelve numbers: alpha has no noise.
            for (k, pixels) in (0..).zip(bytes.chunks_mut(16)) {
                let blocks = [0, 1, 2].map(|b| self.sample_block(noise, 0, key, 3 * k + b));
                let errors = blocks.as_flattened().chunks_exact(3);
                for (pixel, errors) in pixels.chunks_exact_mut(4).zip(errors) {
                    for (byte, error) in pixel.iter_mut().zip(errors) {
                        *byte = noise.quantize_and_clamp(f64::from(*byte) + error, BYTE_RANGE).round() as u8;
                    }
                }
            }
        }
        let channels = [(&self.depth, frame.depth.as_deref_mut()), (&self.distance, frame.distance.as_deref_mut())];
        for ((channel, (noise, numbers)), range) in (1..).zip(channels).zip(self.ranges) {
            let (Some(noise), Some(numbers)) = (noise, numbers) else { continue };
            for (block, numbers) in (0..).zip(numbers.chunks_mut(4)) {
                let errors = self.sample_block(noise, channel, key, block);
                // Misses have no noise.
                for (number, error) in numbers.iter_mut().zip(errors).filter(|(number, _)| number.is_finite()) {
                    *number = noise.quantize_and_clamp(f64::from(*number) + error, range) as f32;
                }
            }
        }
    }

    /// Returns the noise of a block of four numbers of a channel.
    fn sample_block(&self, noise: &NoiseCfg, channel: u8, key: &RngKey, block: u32) -> [f64; 4] {
        let mut errors = [0.0; 4];
        let mut add = |size: f64, numbers: [f64; 4]| {
            errors.iter_mut().zip(numbers).for_each(|(error, number)| *error += size * number);
        };
        if noise.bias_std > 0.0 {
            add(noise.bias_std, key.biases(RngStream::bias(channel), block));
        }
        if noise.bias_walk > 0.0 {
            add(noise.bias_walk * self.sqrt_period, key.random_walks(RngStream::random_walk(channel), block));
        }
        if noise.std > 0.0 {
            add(noise.std, key.normals(RngStream::white(channel), block));
        }
        errors
    }
}

/// Returns the noise of the measured channels. Names that are not channels stay and are rejected by `check`.
pub(crate) fn for_channels(noise: &BTreeMap<String, NoiseCfg>, channels: Channels) -> BTreeMap<String, NoiseCfg> {
    let off = |name: &str| {
        Channels::NAMES.contains(&canonical_name(name)) && !channels.names().contains(&canonical_name(name))
    };
    noise.iter().filter(|(name, _)| !off(name)).map(|(name, noise)| (name.clone(), *noise)).collect()
}

/// Returns the canonical name of a channel; other names stay unchanged.
fn canonical_name(name: &str) -> &str {
    Channels::from_names(&[name]).ok().and_then(|channels| channels.names().first().copied()).unwrap_or(name)
}

#[cfg(test)]
mod tests {
    use super::*;
    use kinetoscope_render::Renderer;
    use kinetoscope_render::frame::Frame;
    use kinetoscope_render::lens::Lens;

    /// Root cause: depths were clamped to near and far, which are distances along the ray for lenses that see backward.
    /// Objects beside the camera came out at depth `near`.
    #[test]
    fn wide_lens_depths() {
        let disturbed = |lens: &str| {
            let cfg = CameraCfg {
                lens: Lens::from_name(lens).expect("a lens"),
                renderer: Renderer::FastRayTraced,
                channels: Channels { depth: true, ..Channels::default() },
                noise: [("depth".to_string(), NoiseCfg { std: 1e-9, ..NoiseCfg::default() })].into(),
                near: 0.1,
                ..CameraCfg::default()
            };
            let noise = ImageNoise::new(&cfg, 0.1).expect("numbers").expect("some");
            let mut frame = Frame::new(2, 2, cfg.channels);
            frame.depth = Some(vec![-2.0, 0.0, 0.5, 3.0]);
            noise.apply(&mut frame.as_mut(), &RngKey::new(1, 0, "eye"));
            frame.depth.expect("it is on")
        };
        for (found, was) in disturbed("equidistant").into_iter().zip([-2.0, 0.0, 0.5, 3.0]) {
            assert!((found - was).abs() < 1e-6, "{found}, not {was}");
        }
        // Control: a pinhole measures nothing nearer than `near`.
        assert_eq!(disturbed("pinhole")[..2], [0.1, 0.1]);
    }
}
