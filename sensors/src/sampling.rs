//! Sampling of numeric sensors: rate, history, latency, dropout and noise.
//!
//! A sensor declares its [`SampleChannel`]s and reads the true values of one environment; the [`Sampler`] does the
//! rest. [`crate::joint_state`] is the template.

use crate::delay::{self, DelayLine};
use crate::error::SensorError;
use crate::history::History;
use crate::noise::{NoiseCfg, NoiseState};
use crate::schedule::{Phases, Schedule};
use crate::sensor::SensorContext;
use crate::state_requirements::StateRequirements;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;
use ndarray::{Array1, Array2, ArrayView, ArrayView1, ArrayView2, ArrayView3, Axis, Dimension, IntoDimension};
use serde::{Deserialize, Serialize};
use std::borrow::Cow;
use std::collections::BTreeMap;
use std::sync::Arc;

/// Rate, history, latency, dropout and noise of a sensor. `Default` is a perfect sensor that measures every step.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SamplingCfg {
    /// Time between measurements \[s\]; 0 is every physics step.
    pub update_period: f64,
    /// Rounds a period that is not a whole number of physics steps to the nearest whole number, at least 1 step.
    /// Without it, such a period is an error.
    pub round_period: bool,
    /// True to store the state when the sensor is due, and to measure this stored state when the sensor is read
    /// ([`SensorCfg::lazy`](crate::SensorCfg::lazy)). The values are those of an eager sensor, bit for bit. A sensor
    /// with a history, a latency, dropout or noise always measures when it is due, because its values depend on earlier
    /// measurements.
    pub lazy: bool,
    /// Number of measurements in the history, the newest included.
    pub history_length: usize,
    /// Latency in physics steps, from the capture of a measurement until it can be read. The measurement keeps the
    /// stamp of its capture. All sensors see a write to the state of an environment at once: outdated values are never
    /// read.
    pub latency_steps: u32,
    /// Probability that a measurement of an environment is lost, 0 to 1. A lost measurement is skipped: the previous
    /// value stays, and count and history do not change. The values after a reset or a write to the state are never
    /// lost.
    pub dropout: f64,
    /// Noise by channel name. The random numbers of an environment are one sequence, keyed by the seed of the
    /// simulation, the index of the environment and the name of the sensor. They do not depend on other sensors or on
    /// the number of threads.
    pub noise: BTreeMap<String, NoiseCfg>,
}

impl SamplingCfg {
    /// Creates the sampling of a perfect sensor that measures every `period` \[s\].
    pub fn every(period: f64) -> Self {
        Self { update_period: period, ..Self::default() }
    }

    /// Returns the schedule of a lazy sensor with this sampling, with physics steps of `dt` \[s\];
    /// [`SensorCfg::lazy`](crate::SensorCfg::lazy) returns it. `None` if [`lazy`](Self::lazy) is off, if there is a
    /// history, a latency, dropout or noise, or if the period is invalid.
    pub fn lazy_schedule(&self, dt: f64) -> Option<Schedule> {
        let single_instant =
            self.history_length == 0 && self.latency_steps == 0 && self.dropout == 0.0 && self.noise.is_empty();
        // An invalid period is reported when the sensor is built.
        (self.lazy && single_instant).then(|| Schedule::new(self.update_period, dt, self.round_period).ok()).flatten()
    }
}

/// Instant at which a channel is captured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Stamp {
    /// The time of positions and velocities, [`SceneState::time`]: [`Sampled::stamps`].
    #[default]
    State,
    /// The time of forces, efforts and accelerations, [`SceneState::force_time`]: [`Sampled::force_stamps`].
    Force,
}

/// One kind of numbers in a measurement. Recorders take name, unit and instant from here.
#[derive(Clone, Debug, PartialEq)]
pub struct SampleChannel {
    /// Name of the channel, also in [`SamplingCfg::noise`].
    pub name: &'static str,
    /// Number of values per environment.
    pub width: usize,
    /// Unit, such as `m/s` or `rad or m`; empty if the numbers have no unit or the unit is unknown. If the units of the
    /// [columns](Sampled::columns) differ, the units of all columns, separated by commas.
    pub unit: Cow<'static, str>,
    /// Instant of capture.
    pub stamp: Stamp,
    /// True if noise can be added: false for counts, and for quaternions, whose length must stay 1.
    pub noisy: bool,
    /// Smallest and largest measured value. Values with noise are clamped to this range; values without noise are not.
    /// Infinite for no bound.
    pub range: [f64; 2],
}

impl SampleChannel {
    /// Creates a channel of `width` numbers without a unit that can have noise, captured with positions and velocities.
    pub const fn new(name: &'static str, width: usize) -> Self {
        let range = [f64::NEG_INFINITY, f64::INFINITY];
        Self { name, width, unit: Cow::Borrowed(""), stamp: Stamp::State, noisy: true, range }
    }

    /// Creates a channel of `width` numbers that can have noise; noisy values are clamped to `range`.
    pub fn bounded(name: &'static str, width: usize, range: [f64; 2]) -> Self {
        Self { range, ..Self::new(name, width) }
    }

    /// Creates a channel of `width` numbers without noise.
    pub fn noiseless(name: &'static str, width: usize) -> Self {
        Self { noisy: false, ..Self::new(name, width) }
    }

    /// Sets the unit.
    #[must_use]
    pub fn with_unit(self, unit: impl Into<Cow<'static, str>>) -> Self {
        Self { unit: unit.into(), ..self }
    }

    /// Sets the instant of capture.
    #[must_use]
    pub fn with_stamp(self, stamp: Stamp) -> Self {
        Self { stamp, ..self }
    }
}

/// The measurements of a sensor in all environments: current, in the history and in flight.
#[derive(Clone, Debug)]
pub struct Sampler {
    name: Arc<str>,
    expected: StateRequirements,
    phases: Phases,
    period: f64,
    quantities: Vec<ChannelBuffer>,
    stamps: Array1<f64>,
    force_stamps: Array1<f64>,
    /// Both stamps of the measurements in the history.
    stamp_history: History<f64>,
    /// Both stamps of the latest delivered measurement; empty without a latency.
    latest_delivered: History<f64>,
    counts: Array1<u64>,
    noise: Option<NoiseState>,
    delay: Option<DelayLine<Vec<f64>>>,
    /// Buffer for one measurement: two stamps, then the channels.
    row: Vec<f64>,
}

/// Current values of a channel, shape \[num_envs, width\], and its history.
#[derive(Clone, Debug)]
struct ChannelBuffer {
    channel: SampleChannel,
    current: Array2<f64>,
    history: History<f64>,
    /// The latest delivered measurement, with a latency; without a latency this is `current`.
    latest_delivered: History<f64>,
}

/// Number of stamps at the beginning of a row.
const STAMP_COUNT: usize = 2;

/// Maximum count of numbers per sensor: 4 GiB. Configurations made by mistake exceed it by far.
const MAX_NUMBERS: usize = 1 << 29;

impl Sampler {
    /// Creates a sampler. `sensor` is the kind of sensor for error messages; `requires` are the state fields it reads,
    /// and `channels` its measured values.
    ///
    /// # Errors
    ///
    /// A physics step that is not positive; an invalid period, or one that is not a whole number of steps; noise of a
    /// channel that is unknown or cannot have noise, or noise parameters outside 0 to 1e100; a dropout that is not a
    /// probability; a history or a latency that needs more than 4 GiB.
    pub fn new(
        sensor: &'static str,
        requires: StateFields,
        context: &SensorContext,
        cfg: &SamplingCfg,
        channels: &[SampleChannel],
    ) -> Result<Self, SensorError> {
        let schedule = Schedule::new(cfg.update_period, context.dt, cfg.round_period)?;
        let period = schedule.period_steps();
        let seconds = period as f64 * context.dt;
        let noise = NoiseState::new(context, cfg, seconds, channels)?;
        let n = context.num_envs;
        let width = STAMP_COUNT + channels.iter().map(|c| c.width).sum::<usize>();
        let latency = u64::from(cfg.latency_steps);
        let late = usize::from(latency > 0);
        let rows = delay::capacity(latency, period).saturating_add(cfg.history_length).saturating_add(late);
        let numbers = rows.saturating_mul(n).saturating_mul(width);
        if numbers > MAX_NUMBERS {
            return Err(SensorError::TooLarge { rows, width, num_envs: n });
        }
        let quantity = |channel: &SampleChannel| ChannelBuffer {
            channel: channel.clone(),
            current: Array2::zeros((n, channel.width)),
            history: History::new(n, cfg.history_length, channel.width),
            latest_delivered: History::new(n, late, channel.width),
        };
        Ok(Self {
            name: Arc::clone(&context.name),
            expected: StateRequirements::new(sensor, requires, context),
            phases: schedule.phases(n),
            period: seconds,
            quantities: channels.iter().map(quantity).collect(),
            stamps: Array1::zeros(n),
            force_stamps: Array1::zeros(n),
            stamp_history: History::new(n, cfg.history_length, STAMP_COUNT),
            latest_delivered: History::new(n, late, STAMP_COUNT),
            counts: Array1::zeros(n),
            noise,
            delay: (latency > 0).then(|| DelayLine::new(n, latency, period, vec![0.0; width])),
            row: vec![0.0; width],
        })
    }

    /// Name of the sensor.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Checks that a state has the fields that the sensor requires, with the shapes of its scene.
    ///
    /// # Errors
    ///
    /// [`SensorError::MissingFields`] or [`SensorError::WrongShape`].
    pub fn check(&self, state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)
    }

    /// Checks indices of environments.
    ///
    /// # Errors
    ///
    /// [`SensorError::IndexOutOfRange`].
    pub fn check_envs(&self, env_ids: &[usize]) -> Result<(), SensorError> {
        self.expected.check_envs(env_ids)
    }

    /// Measures in the environments that are due. `read(env, row)` writes the true values of all channels of one
    /// environment, one after the other, to `row`, which is zero before. Measurements in flight whose latency has
    /// passed become readable.
    ///
    /// # Errors
    ///
    /// Same as [`check`](Self::check). Nothing is measured then.
    ///
    /// # Panics
    ///
    /// If the steps of an environment went backwards without [`reset`](Self::reset).
    pub fn update(&mut self, state: &SceneState, mut read: impl FnMut(usize, &mut [f64])) -> Result<(), SensorError> {
        self.check(state)?;
        for env in 0..self.expected.num_envs() {
            let step = state.step[env];
            let fallen_due = self.phases.take_due_count(env, step);
            if fallen_due > 0 {
                self.read(env, state, &mut read);
                let arrives = self
                    .noise
                    .as_mut()
                    .is_none_or(|noise| noise.apply_to_measurement(env, &mut self.row[STAMP_COUNT..]));
                match &mut self.delay {
                    _ if !arrives => {}
                    Some(delay) => delay.push(env, step).copy_from_slice(&self.row),
                    None => {
                        self.push_to_history(env);
                        // A lazy sensor also counts the measurements that were not read.
                        self.counts[env] += fallen_due - 1;
                        self.set_current(env);
                    }
                }
            }
            while let Some((row, is_newest)) = self.delay.as_mut().and_then(|delay| delay.take(env, step)) {
                self.row.copy_from_slice(row);
                self.push_to_history(env);
                if is_newest {
                    self.set_current(env);
                }
            }
        }
        Ok(())
    }

    /// Returns true if the next [`update`](Self::update) measures in environment `env`, which is at physics step
    /// `step`.
    #[track_caller]
    pub(crate) fn is_due(&self, env: usize, step: u64) -> bool {
        self.phases.due_count(env, step) > 0
    }

    /// Resets the environments `env_ids` to `state` and samples new biases; see
    /// [`Sensor::reset`](crate::Sensor::reset). `read` is as for [`update`](Self::update).
    ///
    /// # Errors
    ///
    /// Same as [`check`](Self::check), and [`SensorError::IndexOutOfRange`]. Nothing is reset then.
    pub fn reset(
        &mut self,
        env_ids: &[usize],
        state: &SceneState,
        read: impl FnMut(usize, &mut [f64]),
    ) -> Result<(), SensorError> {
        self.check(state)?;
        self.expected.check_envs(env_ids)?;
        for &env in env_ids {
            self.phases.reset(env, state.step[env]);
            self.counts[env] = 0;
            self.stamp_history.reset(env);
            self.latest_delivered.reset(env);
            for quantity in &mut self.quantities {
                quantity.history.reset(env);
                quantity.latest_delivered.reset(env);
            }
            if let Some(delay) = &mut self.delay {
                delay.clear(env);
            }
            if let Some(noise) = &mut self.noise {
                noise.reset(env);
            }
        }
        self.refresh(env_ids, state, read)
    }

    /// Refreshes the current values of the environments `env_ids` from `state`, with noise: see
    /// [`Sensor::refresh`](crate::Sensor::refresh). Biases do not change. Measurements in flight still enter the
    /// history and are counted, but do not replace the refreshed values.
    ///
    /// # Errors
    ///
    /// Same as [`reset`](Self::reset). Nothing is refreshed then.
    pub fn refresh(
        &mut self,
        env_ids: &[usize],
        state: &SceneState,
        mut read: impl FnMut(usize, &mut [f64]),
    ) -> Result<(), SensorError> {
        self.check(state)?;
        self.expected.check_envs(env_ids)?;
        for &env in env_ids {
            if let Some(delay) = &mut self.delay {
                delay.refresh(env, state.step[env]);
            }
            self.read(env, state, &mut read);
            if let Some(noise) = &mut self.noise {
                noise.apply(env, &mut self.row[STAMP_COUNT..]);
            }
            self.set_current(env);
            // Before the first measurement is delivered, the values of the reset count as the latest.
            if self.latest_delivered.filled(env) == 0 {
                self.set_latest_delivered(env);
            }
        }
        Ok(())
    }

    /// Writes the stamps and true values of an environment to `row`.
    fn read(&mut self, env: usize, state: &SceneState, read: &mut impl FnMut(usize, &mut [f64])) {
        let (stamps, values) = self.row.split_at_mut(STAMP_COUNT);
        stamps.copy_from_slice(&[state.time[env], state.force_time[env]]);
        values.fill(0.0);
        read(env, values);
    }

    /// Adds `row` to the history, counts it, and makes it the latest delivered measurement.
    fn push_to_history(&mut self, env: usize) {
        let (stamps, mut values) = self.row.split_at(STAMP_COUNT);
        self.stamp_history.push(env, stamps);
        for quantity in &mut self.quantities {
            let (mine, rest) = values.split_at(quantity.current.ncols());
            quantity.history.push(env, mine);
            values = rest;
        }
        self.counts[env] += 1;
        self.set_latest_delivered(env);
    }

    /// Makes `row` the latest delivered measurement.
    fn set_latest_delivered(&mut self, env: usize) {
        let (stamps, mut values) = self.row.split_at(STAMP_COUNT);
        self.latest_delivered.push(env, stamps);
        for quantity in &mut self.quantities {
            let (mine, rest) = values.split_at(quantity.current.ncols());
            quantity.latest_delivered.push(env, mine);
            values = rest;
        }
    }

    /// Makes `row` the current values.
    fn set_current(&mut self, env: usize) {
        (self.stamps[env], self.force_stamps[env]) = (self.row[0], self.row[1]);
        let mut values = &self.row[STAMP_COUNT..];
        for quantity in &mut self.quantities {
            let width = quantity.current.ncols();
            let (mine, rest) = values.split_at(width);
            if let Some(now) = quantity.current.as_slice_mut() {
                now[env * width..(env + 1) * width].copy_from_slice(mine);
            }
            values = rest;
        }
    }

    /// Physics steps until the next measurement of any environment is captured or delivered, at least 1: see
    /// [`Sensor::due_in`](crate::Sensor::due_in).
    pub fn due_in(&self, step: &[u64]) -> u64 {
        let due = self.phases.due_in(step.iter().copied());
        let arrival = self.delay.as_ref().and_then(|delay| delay.due_in(step.iter().copied()));
        arrival.map_or(due, |arrival| arrival.min(due))
    }

    /// Period of the measurements in physics steps.
    pub fn schedule(&self) -> Schedule {
        self.phases.schedule()
    }

    /// Time between measurements \[s\], after rounding to whole physics steps.
    pub fn period(&self) -> f64 {
        self.period
    }

    /// Number of environments.
    pub fn num_envs(&self) -> usize {
        self.expected.num_envs()
    }

    /// Maximum number of measurements in the history.
    pub fn history_length(&self) -> usize {
        self.stamp_history.length()
    }

    /// True if the sampler has a channel of this name.
    pub fn has(&self, channel: &str) -> bool {
        self.channels().any(|known| known.name == channel)
    }

    /// Channels, in the order of the numbers in a measurement.
    pub fn channels(&self) -> impl Iterator<Item = &SampleChannel> {
        self.quantities.iter().map(|quantity| &quantity.channel)
    }

    #[track_caller]
    fn quantity(&self, channel: &str) -> &ChannelBuffer {
        let found = self.quantities.iter().find(|quantity| quantity.channel.name == channel);
        found.unwrap_or_else(|| panic!("this sampler was built without the channel {channel:?}"))
    }

    /// Current values of a channel, shape \[num_envs, width\]: those of the latest delivered measurement, or of a later
    /// reset or refresh; 0 before.
    ///
    /// # Panics
    ///
    /// If the sampler was built without the channel.
    #[track_caller]
    pub fn values(&self, channel: &str) -> ArrayView2<'_, f64> {
        self.quantity(channel).current.view()
    }

    /// Values of a channel in the latest delivered measurement, shape \[num_envs, width\]; those of the reset before
    /// the first one is delivered. They equal the current [`values`](Self::values), except with a latency after a write
    /// to the state: measurements in flight are then delivered, but do not replace the current values.
    ///
    /// # Panics
    ///
    /// If the sampler was built without the channel.
    #[track_caller]
    pub fn latest_delivered(&self, channel: &str) -> ArrayView2<'_, f64> {
        let quantity = self.quantity(channel);
        if self.latest_delivered.length() == 0 {
            quantity.current.view()
        } else {
            quantity.latest_delivered.view().index_axis_move(Axis(1), 0)
        }
    }

    /// Number of measurements delivered since the last reset, per environment.
    pub(crate) fn counts(&self) -> ArrayView1<'_, u64> {
        self.counts.view()
    }

    /// Returns true if the sensor has a latency.
    pub(crate) fn has_latency(&self) -> bool {
        self.latest_delivered.length() > 0
    }

    fn delivered_stamps(&self, which: usize) -> ArrayView1<'_, f64> {
        if self.latest_delivered.length() == 0 {
            return [&self.stamps, &self.force_stamps][which].view();
        }
        self.latest_delivered.view().index_axis_move(Axis(2), which).index_axis_move(Axis(1), 0)
    }

    /// Current values of a channel in one environment.
    #[track_caller]
    pub(crate) fn row(&self, channel: &str, env: usize) -> &[f64] {
        let now = &self.quantity(channel).current;
        let width = now.ncols();
        now.as_slice().map_or(&[], |all| &all[env * width..(env + 1) * width])
    }

    /// Current values of a channel in a shape with more axes, such as \[num_envs, bodies, 3\].
    ///
    /// # Panics
    ///
    /// If the sampler was built without the channel, or with another number of values.
    #[track_caller]
    pub fn values_as<D: Dimension>(&self, channel: &str, shape: impl IntoDimension<Dim = D>) -> ArrayView<'_, f64, D> {
        shaped(self.quantity(channel).current.as_slice(), shape.into_dimension())
    }

    /// History of a channel, newest first, shape \[num_envs, history_length, width\]; 0 where not filled yet. The
    /// newest values are those of the latest delivered measurement.
    ///
    /// # Panics
    ///
    /// If the sampler was built without the channel.
    #[track_caller]
    pub fn history(&self, channel: &str) -> ArrayView3<'_, f64> {
        self.quantity(channel).history.view()
    }

    /// History of a channel in a shape with more axes, such as \[num_envs, history_length, bodies, 3\].
    ///
    /// # Panics
    ///
    /// If the sampler was built without the channel, or with another number of values.
    #[track_caller]
    pub fn history_as<D: Dimension>(&self, channel: &str, shape: impl IntoDimension<Dim = D>) -> ArrayView<'_, f64, D> {
        shaped(self.quantity(channel).history.view().to_slice(), shape.into_dimension())
    }
}

#[track_caller]
fn shaped<D: Dimension>(values: Option<&[f64]>, shape: D) -> ArrayView<'_, f64, D> {
    let values = values.unwrap_or_default();
    match ArrayView::from_shape(shape.clone(), values) {
        Ok(view) => view,
        Err(_) => panic!("{} values in the shape {:?}", values.len(), shape.slice()),
    }
}

/// Interface of sensors with a [`Sampler`]: times and counts of measurements, and the meaning of their numbers.
///
/// [`Sampler::channels`] has the name, unit and instant of every channel. Recorders and plots use only this trait, so
/// they treat sensors of other crates as built-in ones.
pub trait Sampled {
    /// The sensor's sampler.
    fn sampler(&self) -> &Sampler;

    /// Names of the bodies, joints or other items that the numbers of each channel belong to, in order. A channel has
    /// one or more consecutive numbers for each item. Exceptions are channels of the sensor as a whole, such as
    /// `source_pos_w` of a frame transformer. Empty if the items have no names.
    fn columns(&self) -> &[String] {
        &[]
    }

    /// Names along the second axis of matrix channels: the counterparts of each [column](Self::columns). Empty for
    /// sensors without such channels.
    fn filters(&self) -> &[String] {
        &[]
    }

    /// Period of the measurements in physics steps.
    fn schedule(&self) -> Schedule {
        self.sampler().schedule()
    }

    /// Capture times of the current positions and velocities \[s\], shape \[num_envs\]: see [`SceneState::time`].
    fn stamps(&self) -> ArrayView1<'_, f64> {
        self.sampler().stamps.view()
    }

    /// Capture times of the current forces, efforts and accelerations \[s\], shape \[num_envs\]: see
    /// [`SceneState::force_time`].
    fn force_stamps(&self) -> ArrayView1<'_, f64> {
        self.sampler().force_stamps.view()
    }

    /// [`stamps`](Self::stamps) of the measurements of [`Sampler::latest_delivered`].
    fn latest_delivered_stamps(&self) -> ArrayView1<'_, f64> {
        self.sampler().delivered_stamps(0)
    }

    /// [`force_stamps`](Self::force_stamps) of the measurements of [`Sampler::latest_delivered`].
    fn latest_delivered_force_stamps(&self) -> ArrayView1<'_, f64> {
        self.sampler().delivered_stamps(1)
    }

    /// Times of the positions and velocities in the history \[s\], newest first, shape \[num_envs, history_length\]; 0
    /// where not filled yet.
    fn stamp_history(&self) -> ArrayView2<'_, f64> {
        self.sampler().stamp_history.view().index_axis_move(Axis(2), 0)
    }

    /// Times of the forces, efforts and accelerations in the history \[s\], newest first, shape \[num_envs,
    /// history_length\]; 0 where not filled yet.
    fn force_stamp_history(&self) -> ArrayView2<'_, f64> {
        self.sampler().stamp_history.view().index_axis_move(Axis(2), 1)
    }

    /// Number of measurements delivered since the last reset, shape \[num_envs\]. Unread measurements of a lazy sensor
    /// count; lost measurements and the refreshes of resets and writes do not.
    fn sample_counts(&self) -> ArrayView1<'_, u64> {
        self.sampler().counts()
    }

    /// Number of filled rows in the histories of environment `env`.
    ///
    /// # Panics
    ///
    /// If the environment does not exist.
    #[track_caller]
    fn history_filled(&self, env: usize) -> usize {
        self.sampler().stamp_history.filled(env)
    }
}

#[cfg(test)]
mod tests;
