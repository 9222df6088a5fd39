//! What happened, as episodes of frames: what datasets to learn from are made of, whatever their files are.
//!
//! An episode is what an environment does from one reset to the next. Its frames have one rate, that of the rows of the recording; a
//! frame holds what was last measured, and the action that came next: the targets of the step that followed. So the last row of an
//! episode, which no action followed, is no frame.

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

    /// Adds a frame to the episode of an environment, which begins with it if there is none. `next` is what was measured when the
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
        let none =
            |env: &usize| Env { env: *env, numbers: vec![None; count], pictures: vec![None; count], pending: None };
        Self { dataset, features, every, envs: envs.iter().map(none).collect() }
    }

    /// Whether the rows of a step are frames, whatever happened there.
    fn is_due(&self, step: u64) -> bool {
        step.is_multiple_of(self.every)
    }

    /// Takes what is new of an environment.
    fn take(&mut self, k: usize, streams: &[Stream], packet: &Packet) -> Written {
        let Env { env, numbers, pictures, .. } = &mut self.envs[k];
        for (s, (stream, block)) in streams.iter().zip(&packet.blocks).enumerate() {
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
        Some(Frame { numbers: numbers.collect::<Option<_>>()?, pictures: pictures.collect::<Option<_>>()? })
    }

    /// A row is due.
    fn due(&mut self, k: usize, fresh: bool) -> Written {
        let pending = self.envs[k].pending.take();
        if !fresh {
            // It stands still: it has diverged.
            return self.dataset.end(k);
        }
        let now = self.now(k);
        if let (Some(mut frame), Some(now)) = (pending, &now) {
            let numbers = frame.numbers.iter_mut().zip(&now.numbers);
            for (feature, (of_frame, of_now)) in self.features.numbers.iter().zip(numbers) {
                if feature.role.is_action() {
                    of_frame.clone_from(of_now);
                }
            }
            self.dataset.add(k, &frame, now)?;
        }
        self.envs[k].pending = now;
        Ok(())
    }
}

impl<D: Dataset> Sink for Episodes<D> {
    fn write(&mut self, streams: &[Stream], packet: &Packet) -> Written {
        for k in 0..self.envs.len() {
            let env = self.envs[k].env;
            let happened = packet.event.as_ref().filter(|event| event.env_ids.contains(&env)).map(|event| event.kind);
            if happened == Some(EventKind::Reset) {
                self.envs[k].pending = None;
                self.dataset.end(k)?;
                self.envs[k].numbers.fill(None);
                self.envs[k].pictures.fill(None);
            }
            self.take(k, streams, packet)?;
            let base = self.features.base;
            let Some(block) = packet.blocks.get(base).filter(|block| block.used) else { continue };
            let row = streams[base].env_ids.iter().position(|of| *of == env);
            let fresh = row.is_some_and(|row| block.fresh[row]);
            match (&packet.event, happened) {
                (None, _) => self.due(k, fresh)?,
                // What somebody has written is where the next action begins, where a row was due at all.
                (_, Some(EventKind::Written)) if self.envs[k].pending.is_some() && self.is_due(packet.step) => {
                    self.envs[k].pending = self.now(k);
                }
                (_, Some(EventKind::Reset)) if self.is_due(packet.step) => self.envs[k].pending = self.now(k),
                // Something happened to others before this row was taken.
                (_, None) if fresh => self.due(k, true)?,
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
        (0..self.envs.len()).try_for_each(|k| self.dataset.end(k))?;
        self.dataset.finish()
    }

    fn kept(&self) -> Option<PathBuf> {
        self.dataset.kept()
    }
}
