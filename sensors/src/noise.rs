//! What a real sensor does to a number: noise, a bias that wanders, steps of its converter, and samples that get lost.

use crate::error::SensorError;
use crate::sampling::{Channel, SamplingCfg};
use crate::sensor::SensorContext;
use kinetoscope_scene::Random;
use kinetoscope_scene::pattern::closest;
use ndarray::{Array2, Axis};
use serde::{Deserialize, Serialize};
use std::ops::Range;

/// Largest number of a [`NoiseCfg`]: what is made of them stays finite, however long biases wander.
const MAX_NOISE: f64 = 1e100;

/// Errors of the numbers of one channel, each number for itself: `round(value + bias + std * n)`, n normal, from 0 to 1e100
/// each. A channel of what has bounds, such as distances, saturates there. What is infinite (nothing was hit) stays so.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct NoiseCfg {
    /// Standard deviation of what each measurement adds, in the unit of the channel.
    pub std: f64,
    /// Standard deviation of the bias that is drawn at every reset, in the unit of the channel.
    pub bias_std: f64,
    /// How far the bias wanders: its standard deviation after one second, growing with the square root of time, in the unit
    /// of the channel per sqrt(s).
    pub bias_walk: f64,
    /// Values are rounded to whole multiples of this, in the unit of the channel; 0 for no rounding.
    pub resolution: f64,
}

impl NoiseCfg {
    /// White noise and nothing else.
    pub fn white(std: f64) -> Self {
        Self { std, ..Self::default() }
    }

    /// Rounds a value that has its errors already, and holds it between the least and the most that can be measured.
    pub(crate) fn settle(&self, value: f64, [least, most]: [f64; 2]) -> f64 {
        let steps = value / self.resolution;
        // Steps that are finer than the value's own digits round nothing.
        let rounded = if self.resolution > 0.0 && steps.is_finite() { steps.round() * self.resolution } else { value };
        rounded.max(least).min(most)
    }
}

/// Which channels have noise, and whether `dropout` and all their numbers are good.
pub(crate) fn check<'a>(
    dropout: f64,
    noise: impl IntoIterator<Item = (&'a str, &'a NoiseCfg)>,
    channels: &[Channel],
) -> Result<Vec<Noisy>, SensorError> {
    if !(0.0..=1.0).contains(&dropout) {
        let expected = "it must be a probability, 0 to 1";
        return Err(SensorError::OutOfRange { field: "dropout".into(), value: dropout, expected });
    }
    let mut wanted = Vec::new();
    for (name, noise) in noise {
        let (columns, range) = columns(name, channels)?;
        wanted.push(Noisy { columns, range, noise: *noise });
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
    Ok(wanted)
}

/// The noise of a channel.
#[derive(Clone, Debug)]
pub(crate) struct Noisy {
    columns: Range<usize>,
    /// Smallest and largest value.
    range: [f64; 2],
    noise: NoiseCfg,
}

/// The noise of a sensor in all environments.
#[derive(Clone, Debug)]
pub(crate) struct Noise {
    channels: Vec<Noisy>,
    dropout: f64,
    /// Square root of the time between measurements.
    sqrt_period: f64,
    /// Shape \[num_envs, row\].
    biases: Array2<f64>,
    randoms: Vec<Random>,
}

impl Noise {
    /// The noise that `cfg` asks for; `None` where it asks for none.
    pub(crate) fn new(
        context: &SensorContext,
        cfg: &SamplingCfg,
        period: f64,
        channels: &[Channel],
    ) -> Result<Option<Self>, SensorError> {
        let wanted = check(cfg.dropout, cfg.noise.iter().map(|(name, noise)| (name.as_str(), noise)), channels)?;
        if wanted.is_empty() && cfg.dropout == 0.0 {
            return Ok(None);
        }
        let width = channels.iter().map(|c| c.width).sum();
        let random = |env: usize| Random::keyed(context.seed, (context.first_env + env) as u64, &context.name);
        Ok(Some(Self {
            channels: wanted,
            dropout: cfg.dropout,
            sqrt_period: period.sqrt(),
            biases: Array2::zeros((context.num_envs, width)),
            randoms: (0..context.num_envs).map(random).collect(),
        }))
    }

    /// Draws the biases of environment `env` anew.
    pub(crate) fn reset(&mut self, env: usize) {
        let mut biases = self.biases.index_axis_mut(Axis(0), env);
        for Noisy { columns, noise, .. } in &self.channels {
            for column in columns.clone().filter(|_| noise.bias_std > 0.0 || noise.bias_walk > 0.0) {
                biases[column] = noise.bias_std * self.randoms[env].normal();
            }
        }
    }

    /// Makes a measurement of the true values of environment `env`; gives whether it arrives. How many numbers are drawn
    /// does not depend on what they are.
    pub(crate) fn measure(&mut self, env: usize, row: &mut [f64]) -> bool {
        let mut biases = self.biases.index_axis_mut(Axis(0), env);
        for Noisy { columns, noise, .. } in self.channels.iter().filter(|c| c.noise.bias_walk > 0.0) {
            for column in columns.clone() {
                biases[column] += noise.bias_walk * self.sqrt_period * self.randoms[env].normal();
            }
        }
        self.disturb(env, row);
        self.dropout == 0.0 || self.randoms[env].uniform() >= self.dropout
    }

    /// Adds the noise of environment `env` to true values; biases stay where they are.
    pub(crate) fn disturb(&mut self, env: usize, row: &mut [f64]) {
        let biases = self.biases.index_axis(Axis(0), env);
        for Noisy { columns, range, noise } in &self.channels {
            for column in columns.clone() {
                let normal = if noise.std > 0.0 { self.randoms[env].normal() } else { 0.0 };
                let value = &mut row[column];
                // Nothing was hit: noise does not make a hit of it, nor a NaN.
                if !value.is_finite() {
                    continue;
                }
                *value = noise.settle(*value + biases[column] + noise.std * normal, *range);
            }
        }
    }
}

/// Columns of the channel called `name`, and its smallest and largest value.
fn columns(name: &str, channels: &[Channel]) -> Result<(Range<usize>, [f64; 2]), SensorError> {
    let mut first = 0;
    for channel in channels {
        if channel.name == name && channel.noisy {
            return Ok((first..first + channel.width, channel.range));
        }
        first += channel.width;
    }
    let noisy = channels.iter().filter(|c| c.noisy).map(|c| c.name);
    Err(SensorError::UnknownName {
        what: "channel that can have noise",
        name: name.into(),
        candidates: closest(name, noisy).into_iter().map(str::to_owned).collect(),
    })
}
