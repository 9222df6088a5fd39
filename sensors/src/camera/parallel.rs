//! Draws many frames on several threads.

use super::channel::FrameMut;
use super::rasterizer::{RasterCfg, Rasterizer, Shot};
use crate::visibility::RenderError;
use std::sync::Mutex;

/// Draws batches of frames on several threads; keeps the scratch memory of each. The bits do not depend on the number of
/// threads.
#[derive(Clone, Debug)]
pub struct ParallelRasterizer {
    rasterizers: Vec<Rasterizer>,
}

impl ParallelRasterizer {
    /// A rasterizer for each of `threads` threads, the calling one included; 0 counts as 1.
    pub fn new(cfg: RasterCfg, threads: usize) -> Self {
        Self { rasterizers: vec![Rasterizer::new(cfg); threads.max(1)] }
    }

    /// Number of threads, the calling one included.
    pub fn threads(&self) -> usize {
        self.rasterizers.len()
    }

    /// How frames are drawn.
    pub fn set_cfg(&mut self, cfg: RasterCfg) {
        for rasterizer in &mut self.rasterizers {
            rasterizer.cfg = cfg;
        }
    }

    /// Scratch memory held \[bytes\].
    pub fn scratch_bytes(&self) -> usize {
        self.rasterizers.iter().map(Rasterizer::scratch_bytes).sum()
    }

    /// Draws every shot into its frame.
    ///
    /// # Errors
    ///
    /// Of the first shot that cannot be drawn, with its index; the others are drawn nevertheless.
    pub fn render(&mut self, jobs: &mut [(Shot<'_>, FrameMut<'_>)]) -> Result<(), (usize, RenderError)> {
        let threads = self.rasterizers.len().min(jobs.len());
        let work = Mutex::new(jobs.iter_mut().enumerate());
        let failure = Mutex::new(None);
        let lock = |mutex: &Mutex<Option<(usize, RenderError)>>, index, error| {
            let mut first = mutex.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            if first.as_ref().is_none_or(|(other, _)| index < *other) {
                *first = Some((index, error));
            }
        };
        let draw = |rasterizer: &mut Rasterizer| {
            loop {
                let next = work.lock().unwrap_or_else(std::sync::PoisonError::into_inner).next();
                let Some((index, (shot, frame))) = next else { break };
                if let Err(error) = rasterizer.render_shot(shot, frame) {
                    lock(&failure, index, error);
                }
            }
        };
        let Some((mine, others)) = self.rasterizers.split_first_mut() else { return Ok(()) };
        if threads <= 1 {
            draw(mine);
        } else {
            std::thread::scope(|scope| {
                for rasterizer in &mut others[..threads - 1] {
                    scope.spawn(|| draw(rasterizer));
                }
                draw(mine);
            });
        }
        failure.into_inner().unwrap_or_else(std::sync::PoisonError::into_inner).map_or(Ok(()), Err)
    }
}
