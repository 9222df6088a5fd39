//! Post-processing of rendered images: imperfections of the camera, then noise of the numbers that it sends.

use super::cfg::CameraCfg;
use super::image_noise::ImageNoise;
use super::imperfection::{ImageContext, Imperfections};
use crate::error::SensorError;
use crate::sensor::SensorContext;
use kinetoscope_exec::ThreadPool;
use kinetoscope_render::RenderJob;
use kinetoscope_render::RngKey;
use kinetoscope_render::ToneCurve;

/// Imperfections and noise of a camera, applied to its rendered images.
#[derive(Clone, Debug)]
pub(super) struct SensorNoiseModel {
    imperfections: Imperfections,
    tone: ToneCurve,
    noise: Option<ImageNoise>,
    /// One per thread.
    workers: Vec<()>,
    pool: ThreadPool,
}

impl SensorNoiseModel {
    /// Creates the model that `cfg` describes, with `period` \[s\] between images; `None` for a camera without
    /// imperfections and without [`CameraCfg::noise`].
    pub(super) fn new(cfg: &CameraCfg, context: &SensorContext, period: f64) -> Result<Option<Self>, SensorError> {
        let noise = ImageNoise::new(cfg, period)?;
        cfg.imperfections.check(cfg.channels)?;
        let any = noise.is_some() || !cfg.imperfections.is_empty();
        Ok(any.then(|| Self {
            imperfections: cfg.imperfections.clone(),
            tone: cfg.raster.tone,
            noise,
            workers: vec![(); context.threads.max(1)],
            pool: context.pool.clone(),
        }))
    }

    /// Applies imperfections and noise to images in which misses are infinite; each image is processed by one thread.
    /// `keys` are the keys of the random numbers, one per image.
    pub(super) fn apply(&mut self, jobs: &mut [RenderJob<'_>], keys: &[RngKey]) {
        let Self { imperfections, tone, noise, workers, pool } = self;
        let noise = noise.as_ref();
        pool.for_each(workers, jobs.iter_mut().zip(keys), |(), ((request, frame), rng_key)| {
            imperfections.apply(frame, *tone, ImageContext { view: request.view, rays: request.lens, rng_key });
            if let Some(noise) = noise {
                noise.apply(frame, rng_key);
            }
        });
    }
}
