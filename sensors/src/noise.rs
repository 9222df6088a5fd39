//! Noise model of numeric sensors: white noise, bias with random walk, quantization and dropout.

use crate::error::SensorError;
use crate::sampling::{SampleChannel, SamplingCfg};
use crate::sensor::SensorContext;
use kinetoscope_scene::KeyedRng;
use kinetoscope_scene::pattern::closest_names;
use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Upper limit of the numbers of a [`NoiseCfg`]: results stay finite, however long biases walk.
const MAX_NOISE: f64 = 1e100;

/// Noise of the numbers of one channel, independent for each number: `round(value + bias + std * n)`, with n standard
/// normal. All parameters are 0 to 1e100. In a channel with bounds, such as distances, noisy values are clamped to the
/// bounds. Infinite values (nothing was hit) stay infinite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseCfg {
    /// Standard deviation of the white noise of each measurement, in the unit of the channel.
    pub std: f64,
    /// Standard deviation of the bias at the reset, in the unit of the channel. Every reset samples a new bias, which
    /// stays constant unless it has a random walk.
    pub bias_std: f64,
    /// Random walk of the bias, in the unit of the channel per sqrt(s): `t` seconds after the reset, its standard
    /// deviation is `bias_walk` times the square root of `t`.
    pub bias_walk: f64,
    /// Quantization step: values are rounded to multiples of this, in the unit of the channel; 0 for no rounding.
    pub resolution: f64,
}

impl NoiseCfg {
    /// Creates white noise only, with this standard deviation in the unit of the channel.
    pub fn white(std: f64) -> Self {
        Self { std, ..Self::default() }
    }

    /// Rounds a noisy value and clamps it to the measurable range.
    pub(crate) fn quantize_and_clamp(&self, value: f64, [least, most]: [f64; 2]) -> f64 {
        let steps = value / self.resolution;
        // A step finer than the precision of the value has no effect.
        let rounded = if self.resolution > 0.0 && steps.is_finite() { steps.round() * self.resolution } else { value };
        rounded.max(least).min(most)
    }
}

/// Checks `dropout` and all noise parameters. Returns columns, range and noise of each channel in `noise`, zero noise
/// included.
pub(crate) fn check<'a>(
    dropout: f64,
    noise: impl IntoIterator<Item = (&'a str, &'a NoiseCfg)>,
    channels: &[SampleChannel],
) -> Result<Vec<ChannelNoise>, SensorError> {
    if !(0.0..=1.0).contains(&dropout) {
        let expected = "it must be a probability, 0 to 1";
        return Err(SensorError::OutOfRange { field: "dropout".into(), value: dropout, expected });
    }
    let mut noisy_channels = Vec::new();
    for (name, noise) in noise {
        let (columns, range) = columns(name, channels)?;
        noisy_channels.push(ChannelNoise { columns, range, noise: *noise });
        for (field, value) in [
            ("std", noise.std),
            ("bias_std", noise.bias_std),
            ("bias_walk", noise.bias_walk),
            ("resolution", noise.resolution),
        ] {
            if !(0.0..=MAX_NOISE).contains(&value) {
                let (field, expected) = (format!("{field} of the noise of {name:?}"), "it must be 0 to 1e100");
                return Err(SensorError::OutOfRange { field, value, expected });
            }
        }
    }
    Ok(noisy_channels)
}

/// Noise of a channel.
#[derive(Clone, Debug)]
pub(crate) struct ChannelNoise {
    columns: Range<usize>,
    /// Smallest and largest value.
    range: [f64; 2],
    noise: NoiseCfg,
}

/// Noise of a sensor in all environments.
#[derive(Clone, Debug)]
pub(crate) struct NoiseState {
    channels: Vec<ChannelNoise>,
    dropout: f64,
    /// Square root of the time between measurements \[√s\].
    sqrt_period: f64,
    /// Biases, shape \[num_envs, row\].
    biases: Array2<f64>,
    rngs: Vec<KeyedRng>,
}

impl NoiseState {
    /// Creates the noise that `cfg` describes; `None` without noise and dropout.
    pub(crate) fn new(
        context: &SensorContext,
        cfg: &SamplingCfg,
        period: f64,
        channels: &[SampleChannel],
    ) -> Result<Option<Self>, SensorError> {
        let wanted = check(cfg.dropout, cfg.noise.iter().map(|(name, noise)| (name.as_str(), noise)), channels)?;
        if wanted.is_empty() && cfg.dropout == 0.0 {
            return Ok(None);
        }
        let width = channels.iter().map(|c| c.width).sum();
        let random = |env: usize| KeyedRng::keyed(context.seed, (context.first_env + env) as u64, &context.name);
        Ok(Some(Self {
            channels: wanted,
            dropout: cfg.dropout,
            sqrt_period: period.sqrt(),
            biases: Array2::zeros((context.num_envs, width)),
            rngs: (0..context.num_envs).map(random).collect(),
        }))
    }

    /// Samples new biases of environment `env`.
    pub(crate) fn reset(&mut self, env: usize) {
        let mut biases = self.biases.index_axis_mut(Axis(0), env);
        for ChannelNoise { columns, noise, .. } in &self.channels {
            for column in columns.clone().filter(|_| noise.bias_std > 0.0 || noise.bias_walk > 0.0) {
                biases[column] = noise.bias_std * self.rngs[env].normal();
            }
        }
    }

    /// Applies noise to the true values of environment `env`; returns true if the measurement is delivered. The number
    /// of random numbers used does not depend on the values.
    pub(crate) fn apply_to_measurement(&mut self, env: usize, row: &mut [f64]) -> bool {
        let mut biases = self.biases.index_axis_mut(Axis(0), env);
        for ChannelNoise { columns, noise, .. } in self.channels.iter().filter(|c| c.noise.bias_walk > 0.0) {
            for column in columns.clone() {
                biases[column] += noise.bias_walk * self.sqrt_period * self.rngs[env].normal();
            }
        }
        self.apply(env, row);
        self.dropout == 0.0 || self.rngs[env].uniform() >= self.dropout
    }

    /// Adds noise to the true values of environment `env`; biases do not change.
    pub(crate) fn apply(&mut self, env: usize, row: &mut [f64]) {
        let biases = self.biases.index_axis(Axis(0), env);
        for ChannelNoise { columns, range, noise } in &self.channels {
            for column in columns.clone() {
                let normal = if noise.std > 0.0 { self.rngs[env].normal() } else { 0.0 };
                let value = &mut row[column];
                // Misses have no noise: they must not become hits or NaN.
                if !value.is_finite() {
                    continue;
                }
                *value = noise.quantize_and_clamp(*value + biases[column] + noise.std * normal, *range);
            }
        }
    }
}

/// Returns the columns of the channel `name`, and its smallest and largest value; an error for an unknown channel, and
/// for one that cannot have noise.
fn columns(name: &str, channels: &[SampleChannel]) -> Result<(Range<usize>, [f64; 2]), SensorError> {
    let mut first = 0;
    for channel in channels {
        if channel.name == name && channel.noisy {
            return Ok((first..first + channel.width, channel.range));
        }
        first += channel.width;
    }
    let noisy = channels.iter().filter(|c| c.noisy).map(|c| c.name);
    Err(SensorError::UnknownName {
        what: "noise channel",
        name: name.into(),
        candidates: closest_names(name, noisy).into_iter().map(str::to_owned).collect(),
    })
}
