//! Sampling along rays: casts the rays of a sensor in the environments that are due, and samples their hits. Shared by
//! ray casters and ray-caster cameras.

use super::scan::{Rays, Scan};
use super::{HitTargets, RayError};
use crate::error::SensorError;
use crate::sampling::{SampleChannel, Sampler, SamplingCfg};
use crate::sensor::SensorContext;
use kinetoscope_render::geometry::RayTargets;
use kinetoscope_scene::SceneState;
use kinetoscope_scene::StateFields;

/// Limit of the memory of the rays of a sensor \[bytes\].
const MAX_BYTES: u64 = 64 << 30;

/// The parts of a ray sensor that differ between sensors: the frames of its rays, and the outputs computed from their
/// hits.
pub(crate) trait RayModel {
    /// Rays of the sensor.
    type Rays: Rays;

    /// Returns the per-environment data of the rays ([`Rays::View`]), such as their pose. `parent` is the pose of the
    /// parent as a row `[x, y, z, qw, qx, qy, qz]`, `None` for a sensor without a parent. Writes the values of the
    /// frame channels to `values`.
    fn frame(&mut self, env: usize, parent: Option<[f64; 7]>, values: &mut [f64]) -> <Self::Rays as Rays>::View;

    /// Updates the outputs of an environment from the current values of the sampler.
    fn update_outputs(&mut self, env: usize, sampler: &Sampler, rays: &Self::Rays);

    /// Samples the random numbers of an environment that change at a reset.
    fn reset(&mut self, env: usize) {
        let _ = env;
    }
}

/// Configuration of all ray sensors.
pub(crate) struct RaySamplerCfg<'a, R> {
    /// Kind of sensor, for errors.
    pub(crate) kind: &'static str,
    pub(crate) requires: StateFields,
    pub(crate) sampling: &'a SamplingCfg,
    pub(crate) targets: &'a HitTargets,
    pub(crate) groups: u32,
    /// Index, on the body axis of the state, of the body that the sensor is attached to; `None` for a sensor that is
    /// fixed in the environment.
    pub(crate) parent: Option<usize>,
    pub(crate) rays: R,
    pub(crate) max_distance: f64,
    /// Channels of the frame, sampled after distances, normals and ids.
    pub(crate) frame_channels: &'a [SampleChannel],
}

/// Rays of a sensor and the sampler of their hits, in all environments. The channels are `distances`, `normals` and
/// `ids`, then the frame channels of the sensor.
#[derive(Clone, Debug)]
pub(crate) struct RaySampler<R: Rays> {
    scan: Scan<R>,
    sampler: Sampler,
    parent: Option<usize>,
    due: Vec<usize>,
    /// Sampled frame numbers of the last cast, environment by environment.
    frames: Vec<f64>,
    /// Count of numbers per frame.
    frame_width: usize,
    /// Count of the sample that each environment shows.
    shown: Vec<u64>,
}

impl<R: Rays> RaySampler<R> {
    /// Creates a sampler that has not cast rays yet.
    ///
    /// # Errors
    ///
    /// [`RayError::NoScene`], unknown targets, and those of [`Sampler::new`].
    pub(crate) fn new(cfg: RaySamplerCfg<'_, R>, context: &SensorContext) -> Result<Self, SensorError> {
        let scene = context.scene.as_ref().ok_or(RayError::NoScene)?;
        let wanted = cfg.targets.select(scene, cfg.groups, cfg.parent, context)?;
        let targets = RayTargets::new(scene, wanted, &context.ray_assets);
        let count = cfg.rays.count();
        let mut channels = vec![
            SampleChannel::bounded("distances", count, [0.0, cfg.max_distance]).with_unit("m"),
            SampleChannel::noiseless("normals", 3 * count),
            SampleChannel::noiseless("ids", count),
        ];
        channels.extend_from_slice(cfg.frame_channels);
        let frame_width = cfg.frame_channels.iter().map(|channel| channel.width).sum();
        Ok(Self {
            sampler: Sampler::new(cfg.kind, cfg.requires, context, cfg.sampling, &channels)?,
            scan: Scan::new(targets, cfg.rays, cfg.max_distance, context),
            parent: cfg.parent,
            due: Vec::with_capacity(context.num_envs),
            frames: vec![0.0; context.num_envs * frame_width],
            frame_width,
            shown: vec![0; context.num_envs],
        })
    }

    pub(crate) fn rays(&self) -> &R {
        self.scan.rays()
    }

    pub(crate) fn targets(&self) -> &RayTargets {
        self.scan.targets()
    }

    pub(crate) fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    /// Implements [`Sensor::update`](crate::Sensor::update).
    pub(crate) fn update(
        &mut self,
        state: &SceneState,
        model: &mut impl RayModel<Rays = R>,
    ) -> Result<(), SensorError> {
        self.sampler.check(state)?;
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        due.extend((0..state.num_envs()).filter(|&env| self.sampler.is_due(env, state.step[env])));
        self.cast(&due, state, model);
        self.due = due;
        let Self { sampler, scan, frames, frame_width, .. } = self;
        sampler.update(state, |env, row| write(scan, frames, *frame_width, env, row))?;
        for env in 0..state.num_envs() {
            if self.sampler.counts()[env] != self.shown[env] {
                self.show(env, model);
            }
        }
        Ok(())
    }

    /// Implements [`Sensor::reset`](crate::Sensor::reset).
    pub(crate) fn reset(
        &mut self,
        env_ids: &[usize],
        state: &SceneState,
        model: &mut impl RayModel<Rays = R>,
    ) -> Result<(), SensorError> {
        self.sampler.check(state)?;
        self.sampler.check_envs(env_ids)?;
        env_ids.iter().for_each(|&env| model.reset(env));
        self.cast_after_write(env_ids, state, model);
        let Self { sampler, scan, frames, frame_width, .. } = self;
        sampler.reset(env_ids, state, |env, row| write(scan, frames, *frame_width, env, row))?;
        env_ids.iter().for_each(|&env| self.show(env, model));
        Ok(())
    }

    /// Implements [`Sensor::refresh`](crate::Sensor::refresh).
    pub(crate) fn refresh(
        &mut self,
        env_ids: &[usize],
        state: &SceneState,
        model: &mut impl RayModel<Rays = R>,
    ) -> Result<(), SensorError> {
        self.sampler.check(state)?;
        self.sampler.check_envs(env_ids)?;
        self.cast_after_write(env_ids, state, model);
        let Self { sampler, scan, frames, frame_width, .. } = self;
        sampler.refresh(env_ids, state, |env, row| write(scan, frames, *frame_width, env, row))?;
        env_ids.iter().for_each(|&env| self.show(env, model));
        Ok(())
    }

    /// Casts the rays of some environments, each once. The state must be checked before.
    fn cast(&mut self, envs: &[usize], state: &SceneState, model: &mut impl RayModel<Rays = R>) {
        let Some(poses) = &state.instance_poses else { return };
        let Self { scan, parent, frames, frame_width, .. } = self;
        let parent = parent.zip(state.body_poses.as_ref());
        scan.cast(envs, poses, |env| {
            let parent = parent.map(|(body, poses)| std::array::from_fn(|k| poses[(env, body, k)]));
            model.frame(env, parent, &mut frames[env * *frame_width..][..*frame_width])
        });
    }

    /// Casts as [`cast`](Self::cast), after a write to the state, which may have moved fixed instances.
    fn cast_after_write(&mut self, envs: &[usize], state: &SceneState, model: &mut impl RayModel<Rays = R>) {
        let Some(poses) = &state.instance_poses else { return };
        envs.iter().for_each(|&env| self.scan.update_fixed(env, poses, state.env_scene(env)));
        self.cast(envs, state, model);
    }

    fn show(&mut self, env: usize, model: &mut impl RayModel<Rays = R>) {
        self.shown[env] = self.sampler.counts()[env];
        model.update_outputs(env, &self.sampler, self.scan.rays());
    }
}

/// Writes one environment's row of the sampler: distances, normals and ids of its hits, then the values of the frame
/// channels.
fn write<R: Rays>(scan: &Scan<R>, frames: &[f64], frame_width: usize, env: usize, row: &mut [f64]) {
    let count = scan.rays().count();
    let (distances, row) = row.split_at_mut(count);
    let (normals, row) = row.split_at_mut(3 * count);
    let (ids, frame) = row.split_at_mut(count);
    scan.each_hit(env, |k, hit| {
        distances[k] = hit.distance;
        normals[3 * k..3 * k + 3].copy_from_slice(&hit.normal);
        ids[k] = hit.mask_id.into();
    });
    frame.copy_from_slice(&frames[env * frame_width..][..frame_width]);
}

/// Rejects memory above [`MAX_BYTES`], or an allocation that would abort the process, for `rays` in each of `envs`
/// environments.
pub(crate) fn check_memory(envs: usize, rays: usize, bytes_per_ray: usize) -> Result<(), RayError> {
    let bytes = rays.checked_mul(envs).and_then(|n| n.checked_mul(bytes_per_ray)).filter(|&b| b as u64 <= MAX_BYTES);
    let granted = bytes.is_some_and(|bytes| Vec::<u8>::new().try_reserve_exact(bytes).is_ok());
    if granted { Ok(()) } else { Err(RayError::Memory { envs, rays, limit: MAX_BYTES }) }
}
