//! Episodes and frames of learning datasets, independent of their file formats.
//!
//! An episode lasts from one reset of an environment to the next, or until the environment diverges. Its frames have
//! one rate, that of the rows of the recording. A frame contains the last measurements and the action that follows: the
//! targets of the next step. No action follows the last row of an episode, so this row is not a frame.
//!
//! The result of a task step ([`StreamKind::TaskResult`](crate::stream::StreamKind::TaskResult)) belongs to the action
//! of the previous frame. A frame is therefore written only at the second row after it, when the results of its action
//! are complete. If a frame lasts longer than a step of the task, its rewards are summed.

mod features;

use crate::error::{RecordError, Result};
use crate::packet::{EventKind, Packet, ValueBuffer};
use crate::stream::StreamSchema;
use crate::writer::{FormatWriter, WriteResult};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(crate) use features::{Features, ImageFeature, Role};

/// Explanation of a recording without any frame.
pub(crate) const NO_FRAME: &str = "every frame needs a value of each stream and the action that follows";

/// Writer of a dataset. Its environments are numbered by their index in [`environments`].
pub(crate) trait DatasetWriter: Send {
    /// An image of a camera, as it waits for the frames that contain it.
    type Image: Send + Sync;

    /// Stores RGBA pixels without their alpha channel; `size` is width and height.
    fn store_image(&mut self, rgba: &[u8], size: [usize; 2]) -> WriteResult<Self::Image>;

    /// Begins an episode in an environment, unless one is in progress. A frame follows.
    fn begin(&mut self, env: usize) -> WriteResult;

    /// Adds a frame to the current episode of an environment.
    fn add(&mut self, env: usize, frame: &EpisodeFrame<Self::Image>) -> WriteResult;

    /// Ends the current episode of an environment, if there is one. Episodes are numbered in the order of their ends.
    fn end(&mut self, env: usize) -> WriteResult;

    /// Completes the dataset after the last episode and gives it its name; returns its size \[bytes\].
    fn finish(&mut self) -> WriteResult<u64>;

    /// Path of the partial dataset after an error, if it can be read.
    fn partial_path(&self) -> Option<PathBuf>;
}

/// Features, images, reward and end flag of one environment at one row of a dataset.
pub(crate) struct EpisodeFrame<P> {
    /// Values of each feature.
    pub(crate) numbers: Vec<Vec<f64>>,
    pub(crate) images: Vec<Arc<P>>,
    /// Sum of the rewards of its action so far; 0 without a task.
    pub(crate) reward: f64,
    /// True if the episode ended with its action, according to the task.
    pub(crate) done: bool,
}

/// Splits packets into frames and episodes.
pub(crate) struct EpisodeSplitter<D: DatasetWriter> {
    dataset: D,
    features: Arc<Features>,
    /// Physics steps between two rows.
    period_steps: u64,
    envs: Vec<EnvFrames<D::Image>>,
}

struct EnvFrames<P> {
    env: usize,
    /// Last measured values of each stream.
    numbers: Vec<Option<Vec<f64>>>,
    images: Vec<Option<Arc<P>>>,
    /// The frame that waits for its action; `None` before the first frame of an episode.
    pending: Option<EpisodeFrame<P>>,
    /// Physics step of the row of `pending`, since the beginning of the recording.
    pending_step: u64,
    /// The frame before `pending`, which waits for the result of its action; `None` without such a frame.
    awaiting_result: Option<EpisodeFrame<P>>,
}

/// Environments of a dataset. Each must have all streams.
///
/// # Errors
/// A stream is missing in one of them.
pub(crate) fn environments(path: &Path, streams: &[StreamSchema]) -> Result<Vec<usize>> {
    let mut envs: Vec<usize> = streams.iter().flat_map(|stream| stream.env_ids.iter().copied()).collect();
    envs.sort_unstable();
    envs.dedup();
    for &env in &envs {
        if let Some(stream) = streams.iter().find(|stream| !stream.env_ids.contains(&env)) {
            return Err(RecordError::MissingStream { path: path.into(), stream: stream.name.clone(), env });
        }
    }
    Ok(envs)
}

impl<D: DatasetWriter> EpisodeSplitter<D> {
    /// Creates the splitter for environments `envs`, with `period_steps` physics steps between two rows.
    pub(crate) fn new(
        dataset: D,
        features: Arc<Features>,
        period_steps: u64,
        envs: &[usize],
        streams: &[StreamSchema],
    ) -> Self {
        let count = streams.len();
        let none = |env: &usize| EnvFrames {
            env: *env,
            numbers: vec![None; count],
            images: vec![None; count],
            pending: None,
            pending_step: 0,
            awaiting_result: None,
        };
        Self { dataset, features, period_steps, envs: envs.iter().map(none).collect() }
    }

    /// True if `step` is a multiple of the row period: a regular row of the recording. Rows at other steps exist for
    /// events only.
    fn is_due(&self, step: u64) -> bool {
        step.is_multiple_of(self.period_steps)
    }

    /// Stores the new values of the environment with index `k` in `envs`.
    fn store_values(&mut self, k: usize, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        let EnvFrames { env, numbers, images, .. } = &mut self.envs[k];
        let outcome = self.features.result_stream;
        for (s, (stream, block)) in streams.iter().zip(&packet.streams).enumerate().filter(|(s, _)| Some(*s) != outcome)
        {
            let row = stream.env_ids.iter().position(|of| *of == *env);
            let Some(row) = row.filter(|row| block.has_content && block.is_new[*row]) else { continue };
            let range = row * stream.width()..(row + 1) * stream.width();
            let Some(size) = self.features.image_size(s) else {
                numbers[s] = Some(match &block.values {
                    ValueBuffer::U8(values) => values[range].iter().map(|x| f64::from(*x)).collect(),
                    ValueBuffer::I32(values) => values[range].iter().map(|x| f64::from(*x)).collect(),
                    ValueBuffer::F32(values) => values[range].iter().map(|x| f64::from(*x)).collect(),
                    ValueBuffer::F64(values) => values[range].to_vec(),
                });
                continue;
            };
            let rgba = block.values.as_u8s().get(range).unwrap_or_default();
            images[s] = Some(Arc::new(self.dataset.store_image(rgba, size)?));
        }
        Ok(())
    }

    /// Frame of the current values, if all streams have a value; actions are filled in later.
    fn present_frame(&self, k: usize) -> Option<EpisodeFrame<D::Image>> {
        let EnvFrames { numbers, images, .. } = &self.envs[k];
        let numbers = self.features.numbers.iter().map(|feature| feature.values(numbers));
        let images = self.features.images.iter().map(|image| images.get(image.stream)?.clone());
        let (numbers, images) = (numbers.collect::<Option<_>>()?, images.collect::<Option<_>>()?);
        Some(EpisodeFrame { numbers, images, reward: 0.0, done: false })
    }

    /// Creates the frame of a row, which waits for its action; there is no frame if a stream has no value yet.
    fn hold_frame(&mut self, k: usize, step: u64) {
        self.envs[k].pending = self.present_frame(k);
        self.envs[k].pending_step = step;
    }

    /// Adds the frame that waits for results, because no further ones follow.
    fn add_complete_frame(&mut self, k: usize) -> WriteResult {
        let EnvFrames { pending, awaiting_result, .. } = &mut self.envs[k];
        match awaiting_result.take() {
            Some(frame) if pending.is_some() => self.dataset.add(k, &frame),
            _ => Ok(()),
        }
    }

    /// Adds the result of a task step.
    fn add_result(&mut self, k: usize, values: &[f64], step: u64) {
        let [reward, terminated, truncated] = *values else { return };
        let EnvFrames { pending, pending_step, awaiting_result, .. } = &mut self.envs[k];
        // A result at the step of the pending row belongs to the action of the frame before it, if there is one.
        let frame = if step == *pending_step { awaiting_result } else { pending };
        if let Some(frame) = frame {
            frame.reward += reward;
            frame.done |= terminated > 0.0 || truncated > 0.0;
        }
    }

    /// Ends the episode of the environment with index `k` in `envs`: adds the frame that waits for its result, and
    /// drops the pending row.
    fn end_episode(&mut self, k: usize) -> WriteResult {
        // Results after the last frame are added to it, because the row after it is no frame.
        let EnvFrames { pending, awaiting_result, .. } = &mut self.envs[k];
        if let (Some(last), Some(rest)) = (awaiting_result, pending) {
            last.reward += rest.reward;
            last.done |= rest.done;
        }
        self.add_complete_frame(k)?;
        self.envs[k].pending = None;
        self.dataset.end(k)
    }

    /// Handles a regular row.
    fn handle_row(&mut self, k: usize, step: u64, fresh: bool) -> WriteResult {
        if !fresh {
            // A diverged environment has no new values.
            return self.end_episode(k);
        }
        self.add_complete_frame(k)?;
        let pending = self.envs[k].pending.take();
        self.hold_frame(k, step);
        if let (Some(mut frame), Some(now)) = (pending, &self.envs[k].pending) {
            let numbers = frame.numbers.iter_mut().zip(&now.numbers);
            for (feature, (of_frame, of_now)) in self.features.numbers.iter().zip(numbers) {
                if feature.role.is_action() {
                    of_frame.clone_from(of_now);
                }
            }
            self.envs[k].awaiting_result = Some(frame);
            self.dataset.begin(k)?;
        }
        Ok(())
    }
}

impl<D: DatasetWriter> FormatWriter for EpisodeSplitter<D> {
    fn write(&mut self, streams: &[StreamSchema], packet: &Packet) -> WriteResult {
        for k in 0..self.envs.len() {
            let env = self.envs[k].env;
            let happened = packet.event.as_ref().filter(|event| event.env_ids.contains(&env)).map(|event| event.kind);
            let told = self.features.result_stream.and_then(|s| Some((streams.get(s)?, packet.streams.get(s)?)));
            if let Some((stream, block)) = told.filter(|(_, block)| block.has_content) {
                let (row, width) = (stream.env_ids.iter().position(|of| *of == env), stream.width());
                let values = row.and_then(|row| block.values.as_f64s().get(row * width..(row + 1) * width));
                self.add_result(k, values.unwrap_or_default(), packet.step);
            }
            if happened == Some(EventKind::Reset) {
                self.end_episode(k)?;
                self.envs[k].numbers.fill(None);
                self.envs[k].images.fill(None);
            }
            self.store_values(k, streams, packet)?;
            let base = self.features.frame_stream;
            let Some(block) = packet.streams.get(base).filter(|block| block.has_content) else { continue };
            let row = streams[base].env_ids.iter().position(|of| *of == env);
            let fresh = row.is_some_and(|row| block.is_new[row]);
            match (&packet.event, happened) {
                (None, _) => self.handle_row(k, packet.step, fresh)?,
                // A write at a regular row replaces the state in which the next action begins.
                (_, Some(EventKind::Written)) if self.envs[k].pending.is_some() && self.is_due(packet.step) => {
                    self.add_complete_frame(k)?;
                    self.hold_frame(k, packet.step);
                }
                (_, Some(EventKind::Reset)) if self.is_due(packet.step) => self.hold_frame(k, packet.step),
                // The event concerned other environments, before this regular row.
                (_, None) if fresh => self.handle_row(k, packet.step, true)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn finish(&mut self, _streams: &[StreamSchema]) -> WriteResult<u64> {
        (0..self.envs.len()).try_for_each(|k| self.end_episode(k))?;
        self.dataset.finish()
    }

    fn partial_path(&self) -> Option<PathBuf> {
        self.dataset.partial_path()
    }
}
