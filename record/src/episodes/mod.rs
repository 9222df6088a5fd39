//! What happened, as episodes of frames: what datasets to learn from are made of, whatever their files are.
//!
//! An episode is what an environment does from one reset to the next. Its frames have one rate, that of the rows of the recording; a
//! frame holds what was last measured, and the action that came next: the targets of the step that followed. So the last row of an
//! episode, which no action followed, is no frame.
//!
//! What a task tells after the step ([`Kind::Outcome`](crate::stream::Kind::Outcome)) is of the action of the frame before: a frame waits
//! for it until the row after its next one. Where a frame is longer than a step of the task, rewards are added up.

mod features;

use crate::error::{RecordError, Result};
use crate::packet::{EventKind, Packet, Values};
use crate::stream::Stream;
use crate::writer::{Sink, Written};
use std::path::{Path, PathBuf};
use std::sync::Arc;

pub(crate) use features::{Features, Role, holds};

/// What is wrong where no frame came of a recording.
pub(crate) const NO_FRAME: &str = "every one needs all that is measured, and the action after it";

/// A dataset on its way. Its environments have numbers: their places in [`environments`].
pub(crate) trait Dataset: Send {
    /// A picture, as the dataset keeps it.
    type Picture: Send + Sync;

    /// What is kept of a picture of red, green, blue and opacity, which is left out; width and height.
    fn picture(&mut self, rgba: &[u8], size: [usize; 2]) -> Written<Self::Picture>;

    /// An episode begins in an environment, if none goes on: a frame of it comes. Episodes have the order in which they begin.
    fn begin(&mut self, env: usize);

    /// Adds a frame to the episode of an environment, which has begun. `next` is what was measured when the
    /// action had been done; its actions are older ones.
    fn add(&mut self, env: usize, frame: &Frame<Self::Picture>, next: &Frame<Self::Picture>) -> Written;

    /// Ends the episode of an environment, if there is one.
    fn end(&mut self, env: usize) -> Written;

    /// Makes the dataset whole and gives it its name, when all episodes have ended; returns its size \[bytes\].
    fn finish(&mut self) -> Written<u64>;

    /// After an error: where what was written can be read.
    fn kept(&self) -> Option<PathBuf>;
}

/// What a frame has.
pub(crate) struct Frame<P> {
    /// Those of each feature.
    pub(crate) numbers: Vec<Vec<f64>>,
    pub(crate) pictures: Vec<Arc<P>>,
    /// What its action earned, as far as a task has told it.
    pub(crate) reward: f64,
    /// Whether the episode ended with its action, as a task has told it.
    pub(crate) done: bool,
}

/// Makes frames and episodes of packets.
pub(crate) struct Episodes<D: Dataset> {
    dataset: D,
    features: Arc<Features>,
    /// Steps from one row to the next.
    every: u64,
    envs: Vec<Env<D::Picture>>,
}

struct Env<P> {
    env: usize,
    /// What was measured last, for each stream.
    numbers: Vec<Option<Vec<f64>>>,
    pictures: Vec<Option<Arc<P>>>,
    /// The frame that waits for its action.
    pending: Option<Frame<P>>,
    /// The step of its row.
    pending_at: u64,
    /// The frame before it, which waits for what came of its action.
    complete: Option<Frame<P>>,
}

/// The environments of a dataset, in which every stream is.
///
/// # Errors
/// One of them is not there.
pub(crate) fn environments(path: &Path, streams: &[Stream]) -> Result<Vec<usize>> {
    let mut envs: Vec<usize> = streams.iter().flat_map(|stream| stream.env_ids.iter().copied()).collect();
    envs.sort_unstable();
    envs.dedup();
    for &env in &envs {
        if let Some(stream) = streams.iter().find(|stream| !stream.env_ids.contains(&env)) {
            return Err(RecordError::NotEverywhere { path: path.into(), stream: stream.name.clone(), env });
        }
    }
    Ok(envs)
}

impl<D: Dataset> Episodes<D> {
    /// Of the environments `envs`; a row every so many steps.
    pub(crate) fn new(dataset: D, features: Arc<Features>, every: u64, envs: &[usize], streams: &[Stream]) -> Self {
        let count = streams.len();
        let none = |env: &usize| Env {
            env: *env,
            numbers: vec![None; count],
            pictures: vec![None; count],
            pending: None,
            pending_at: 0,
            complete: None,
        };
        Self { dataset, features, every, envs: envs.iter().map(none).collect() }
    }

    /// Whether the rows of a step are frames, whatever happened there.
    fn is_due(&self, step: u64) -> bool {
        step.is_multiple_of(self.every)
    }

    /// Takes what is new of an environment.
    fn take(&mut self, k: usize, streams: &[Stream], packet: &Packet) -> Written {
        let Env { env, numbers, pictures, .. } = &mut self.envs[k];
        let outcome = self.features.outcome;
        for (s, (stream, block)) in streams.iter().zip(&packet.blocks).enumerate().filter(|(s, _)| Some(*s) != outcome)
        {
            let row = stream.env_ids.iter().position(|of| *of == *env);
            let Some(row) = row.filter(|row| block.used && block.fresh[*row]) else { continue };
            let range = row * stream.width()..(row + 1) * stream.width();
            let Some(size) = self.features.size_of(s) else {
                numbers[s] = Some(match &block.values {
                    Values::U8(values) => values[range].iter().map(|x| f64::from(*x)).collect(),
                    Values::I32(values) => values[range].iter().map(|x| f64::from(*x)).collect(),
                    Values::F32(values) => values[range].iter().map(|x| f64::from(*x)).collect(),
                    Values::F64(values) => values[range].to_vec(),
                });
                continue;
            };
            let rgba = block.values.bytes().get(range).unwrap_or_default();
            pictures[s] = Some(Arc::new(self.dataset.picture(rgba, size)?));
        }
        Ok(())
    }

    /// What there is now, if there is something of everything; actions are filled in later.
    fn now(&self, k: usize) -> Option<Frame<D::Picture>> {
        let Env { numbers, pictures, .. } = &self.envs[k];
        let numbers = self.features.numbers.iter().map(|feature| feature.values(numbers));
        let pictures = self.features.pictures.iter().map(|picture| pictures.get(picture.stream)?.clone());
        let (numbers, pictures) = (numbers.collect::<Option<_>>()?, pictures.collect::<Option<_>>()?);
        Some(Frame { numbers, pictures, reward: 0.0, done: false })
    }

    /// The frame of a row, which waits for its action.
    fn wait(&mut self, k: usize, step: u64) {
        self.envs[k].pending = self.now(k);
        self.envs[k].pending_at = step;
    }

    /// Adds the frame that waits for what came of its action: nothing more will.
    fn settle(&mut self, k: usize) -> Written {
        let Env { pending, complete, .. } = &mut self.envs[k];
        match (complete.take(), pending) {
            (Some(frame), Some(next)) => self.dataset.add(k, &frame, next),
            _ => Ok(()),
        }
    }

    /// A task tells what came of a step.
    fn judged(&mut self, k: usize, values: &[f64], step: u64) {
        let [reward, terminated, truncated] = *values else { return };
        let Env { pending, pending_at, complete, .. } = &mut self.envs[k];
        // Of the step that led to the row that waits: its action is that of the frame before, if there is one.
        let frame = if step == *pending_at { complete } else { pending };
        if let Some(frame) = frame {
            frame.reward += reward;
            frame.done |= terminated > 0.0 || truncated > 0.0;
        }
    }

    /// The episode of an environment has ended.
    fn ended(&mut self, k: usize) -> Written {
        // What was told after the last frame counts to it: the row after it is none.
        let Env { pending, complete, .. } = &mut self.envs[k];
        if let (Some(last), Some(rest)) = (complete, pending) {
            last.reward += rest.reward;
            last.done |= rest.done;
        }
        self.settle(k)?;
        self.envs[k].pending = None;
        self.dataset.end(k)
    }

    /// A row is due.
    fn due(&mut self, k: usize, step: u64, fresh: bool) -> Written {
        if !fresh {
            // It stands still: it has diverged.
            return self.ended(k);
        }
        self.settle(k)?;
        let pending = self.envs[k].pending.take();
        self.wait(k, step);
        if let (Some(mut frame), Some(now)) = (pending, &self.envs[k].pending) {
            let numbers = frame.numbers.iter_mut().zip(&now.numbers);
            for (feature, (of_frame, of_now)) in self.features.numbers.iter().zip(numbers) {
                if feature.role.is_action() {
                    of_frame.clone_from(of_now);
                }
            }
            self.envs[k].complete = Some(frame);
            self.dataset.begin(k);
        }
        Ok(())
    }
}

impl<D: Dataset> Sink for Episodes<D> {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written {
        for k in 0..self.envs.len() {
            let env = self.envs[k].env;
            let happened = packet.event.as_ref().filter(|event| event.env_ids.contains(&env)).map(|event| event.kind);
            let told = self.features.outcome.and_then(|s| Some((streams.get(s)?, packet.blocks.get(s)?)));
            if let Some((stream, block)) = told.filter(|(_, block)| block.used) {
                let (row, width) = (stream.env_ids.iter().position(|of| *of == env), stream.width());
                let values = row.and_then(|row| block.values.states().get(row * width..(row + 1) * width));
                self.judged(k, values.unwrap_or_default(), packet.step);
            }
            if happened == Some(EventKind::Reset) {
                self.ended(k)?;
                self.envs[k].numbers.fill(None);
                self.envs[k].pictures.fill(None);
            }
            self.take(k, streams, packet)?;
            let base = self.features.base;
            let Some(block) = packet.blocks.get(base).filter(|block| block.used) else { continue };
            let row = streams[base].env_ids.iter().position(|of| *of == env);
            let fresh = row.is_some_and(|row| block.fresh[row]);
            match (&packet.event, happened) {
                (None, _) => self.due(k, packet.step, fresh)?,
                // What somebody has written is where the next action begins, where a row was due at all.
                (_, Some(EventKind::Written)) if self.envs[k].pending.is_some() && self.is_due(packet.step) => {
                    self.settle(k)?;
                    self.wait(k, packet.step);
                }
                (_, Some(EventKind::Reset)) if self.is_due(packet.step) => self.wait(k, packet.step),
                // Something happened to others before this row was taken.
                (_, None) if fresh => self.due(k, packet.step, true)?,
                _ => {}
            }
        }
        Ok(())
    }

    fn flush(&mut self) -> Written {
        // Nobody can read it before the end.
        Ok(())
    }

    fn finish(&mut self, _streams: &[Stream]) -> Written<u64> {
        (0..self.envs.len()).try_for_each(|k| self.ended(k))?;
        self.dataset.finish()
    }

    fn kept(&self) -> Option<PathBuf> {
        self.dataset.kept()
    }
}
