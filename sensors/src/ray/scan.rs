//! Parallel ray casting in many environments.

use super::cast_order::coherent_order;
use crate::sensor::SensorContext;
use kinetoscope_exec::ThreadPool;
use kinetoscope_render::geometry::FixedTargets;
use kinetoscope_render::geometry::{RayAssetCache, RayHit, RayTargets, RayWorld};
use kinetoscope_scene::Ray;
use kinetoscope_scene::{EnvScene, PoseF64};
use ndarray::Array2;
use std::fmt;
use std::sync::Arc;

/// Maximum number of rays per job.
const RAYS_PER_JOB: usize = 1024;
/// Minimum number of rays per thread. Below it, the calling thread casts them: waking a thread takes some 0.05 ms, a
/// ray 0.1 µs.
const MIN_RAYS_PER_THREAD: usize = 4 * RAYS_PER_JOB;
/// Slot of an environment without a cast.
const NO_SLOT: usize = usize::MAX;

/// The rays of a sensor, the same number in every environment.
pub(crate) trait Rays: Clone + fmt::Debug + Send + Sync + 'static {
    /// Data that differs between environments: at least the pose of the rays.
    type View: Copy + fmt::Debug + Send + Sync;

    /// Number of rays.
    fn count(&self) -> usize;

    /// Efficient cast order, with neighbors together; `None` is the order of the rays. The order does not change hits.
    fn order(&self) -> Option<Vec<u32>> {
        None
    }

    /// Appends some of the rays to `out`, in the frame of the environment.
    fn append_rays(&self, view: &Self::View, which: impl Iterator<Item = usize>, out: &mut Vec<Ray>);
}

/// Rays in a frame whose pose differs between environments.
impl Rays for Vec<Ray> {
    type View = PoseF64;

    fn count(&self) -> usize {
        self.len()
    }

    fn order(&self) -> Option<Vec<u32>> {
        Some(coherent_order(self))
    }

    fn append_rays(&self, world_from_rays: &PoseF64, which: impl Iterator<Item = usize>, out: &mut Vec<Ray>) {
        out.extend(which.map(|k| self[k].transformed_by(world_from_rays)));
    }
}

/// Casts the rays of a sensor in many environments. Hits are the same bit for bit with any number of threads. After the
/// first casts, only new lookup structures of meshes and changed fixed instances allocate memory.
#[derive(Clone)]
pub(crate) struct Scan<R: Rays> {
    pool: ThreadPool,
    targets: Arc<RayTargets>,
    /// BVHs of meshes, for the targets of environments with their own scene.
    assets: RayAssetCache,
    rays: R,
    /// Order in which the rays of a view are cast, as indices of rays; `None` for the order of the pattern.
    order: Option<Vec<u32>>,
    /// Targets of the rays in each environment; mostly the same for all.
    env_targets: Vec<EnvTargets>,
    /// Fixed instances of each environment; mostly the same for all.
    fixed: Vec<Arc<FixedTargets>>,
    max_distance: f64,
    input: CastInput<R::View>,
    /// Scratch memory of the threads.
    scratch: Vec<WorkerScratch>,
    /// Hits of up to [`RAYS_PER_JOB`] rays each: all parts of a view, then those of the next view.
    job_hits: Vec<Vec<RayHit>>,
}

/// Input of the last cast.
#[derive(Clone, Debug)]
struct CastInput<V> {
    /// Environments and their views.
    views: Vec<(usize, V)>,
    /// Index of each environment in `views`.
    slots: Vec<usize>,
    /// Poses of the moving targets in their environments, view by view.
    poses: Vec<PoseF64>,
}

/// Targets of the rays in an environment.
#[derive(Clone, Debug)]
struct EnvTargets {
    /// Scene that the targets were created from.
    scene: EnvScene,
    targets: Arc<RayTargets>,
}

#[derive(Clone, Debug)]
struct WorkerScratch {
    world: RayWorld,
    /// Index of the view that the world is placed for.
    placed_view: usize,
    rays: Vec<Ray>,
}

impl<R: Rays> Scan<R> {
    /// Creates a scan; the poses of fixed instances are still unknown.
    pub(crate) fn new(targets: RayTargets, rays: R, max_distance: f64, context: &SensorContext) -> Self {
        let (n, count) = (context.num_envs, rays.count());
        let (targets, nothing) = (Arc::new(targets), Arc::new(FixedTargets::default()));
        let desk = || WorkerScratch {
            world: RayWorld::new(&targets),
            placed_view: NO_SLOT,
            rays: Vec::with_capacity(RAYS_PER_JOB.min(count)),
        };
        let of_view =
            || (0..count).step_by(RAYS_PER_JOB).map(|first| vec![RayHit::MISS; RAYS_PER_JOB.min(count - first)]);
        let look = EnvTargets { scene: EnvScene::default(), targets: Arc::clone(&targets) };
        Self {
            pool: context.pool.clone(),
            assets: context.ray_assets.clone(),
            env_targets: vec![look; n],
            order: rays.order(),
            rays,
            fixed: vec![nothing; n],
            max_distance,
            input: CastInput { views: Vec::with_capacity(n), slots: vec![NO_SLOT; n], poses: Vec::new() },
            scratch: (0..context.threads.max(1)).map(|_| desk()).collect(),
            job_hits: (0..n).flat_map(|_| of_view()).collect(),
            targets,
        }
    }

    pub(crate) fn targets(&self) -> &RayTargets {
        &self.targets
    }

    /// The rays, in their own frame.
    pub(crate) fn rays(&self) -> &R {
        &self.rays
    }

    /// Updates the fixed instances of an environment after a write that may have moved them or changed their
    /// appearance. `scene` is the environment's own scene.
    pub(crate) fn update_fixed(&mut self, env: usize, poses: &Array2<PoseF64>, scene: &EnvScene) {
        let poses = row(poses, env);
        let other = self.env_targets[env].scene != *scene;
        if other {
            let own = |scene: &_| Arc::new(RayTargets::new(scene, self.targets.instances(), &self.assets));
            let targets = scene.0.as_deref().map_or_else(|| Arc::clone(&self.targets), own);
            self.env_targets[env] = EnvTargets { scene: scene.clone(), targets };
        }
        let targets = &self.env_targets[env].targets;
        let is_here = |fixed: &Arc<FixedTargets>| fixed.is_at(targets, poses);
        if !other && is_here(&self.fixed[env]) {
            return;
        }
        // Most environments have the same instances at the same poses.
        let known = self.fixed.first().filter(|first| {
            let alike = env > 0 && Arc::ptr_eq(&self.env_targets[0].targets, targets);
            alike && is_here(first)
        });
        self.fixed[env] = known.map_or_else(|| Arc::new(FixedTargets::new(targets, poses)), Arc::clone);
    }

    /// Casts the rays of the environments `envs`, each once, with the view that `view` returns. `poses` are those of
    /// the instances in all environments.
    pub(crate) fn cast(&mut self, envs: &[usize], poses: &Array2<PoseF64>, mut view: impl FnMut(usize) -> R::View) {
        let CastInput { views, slots, poses: moved } = &mut self.input;
        for (env, _) in views.drain(..) {
            slots[env] = NO_SLOT;
        }
        moved.clear();
        for &env in envs {
            if slots[env] == NO_SLOT {
                slots[env] = views.len();
                views.push((env, view(env)));
                moved.extend(self.targets.moving_poses(row(poses, env)));
            }
        }
        let (per_view, moving) = (self.jobs_per_view(), self.targets.moving_count());
        let Self { pool, rays, order, env_targets, fixed, max_distance, input, scratch, job_hits, .. } = self;
        let threads = (input.views.len() * rays.count() / MIN_RAYS_PER_THREAD).clamp(1, scratch.len());
        let desks = &mut scratch[..threads];
        desks.iter_mut().for_each(|desk| desk.placed_view = NO_SLOT);
        let parts = job_hits[..per_view * input.views.len()].iter_mut().enumerate();
        let (rays, order, looks, fixed) = (&*rays, order.as_deref(), &*env_targets, &*fixed);
        let (task, max_distance) = (&*input, *max_distance);
        pool.for_each(desks, parts, |desk, (part, hits)| {
            let (at, first) = (part / per_view, part % per_view * RAYS_PER_JOB);
            let (env, view) = &task.views[at];
            if desk.placed_view != at {
                let moving = &task.poses[at * moving..(at + 1) * moving];
                desk.world.place_with(&looks[*env].targets, &fixed[*env], moving);
                desk.placed_view = at;
            }
            desk.rays.clear();
            let range = first..first + hits.len();
            match order {
                Some(order) => rays.append_rays(view, order[range].iter().map(|&k| k as usize), &mut desk.rays),
                None => rays.append_rays(view, range, &mut desk.rays),
            }
            desk.world.cast(&desk.rays, max_distance, hits);
        });
    }

    /// Passes the hits of an environment in the last cast to `show`, with the index of the ray, in any order. An
    /// environment that was not cast has no hits.
    pub(crate) fn each_hit(&self, env: usize, mut show: impl FnMut(usize, &RayHit)) {
        let (slot, per_view) = (self.input.slots[env], self.jobs_per_view());
        let first = if slot == NO_SLOT { self.job_hits.len() } else { slot * per_view };
        for (part, hits) in self.job_hits.iter().skip(first).take(per_view).enumerate() {
            let first = part * RAYS_PER_JOB;
            match &self.order {
                Some(order) => hits.iter().zip(&order[first..]).for_each(|(hit, &k)| show(k as usize, hit)),
                None => hits.iter().zip(first..).for_each(|(hit, k)| show(k, hit)),
            }
        }
    }

    /// Returns the number of parts per view.
    fn jobs_per_view(&self) -> usize {
        self.rays.count().div_ceil(RAYS_PER_JOB)
    }
}

/// Short, because there are many hits.
impl<R: Rays> fmt::Debug for Scan<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scan")
            .field("rays", &self.rays.count())
            .field("targets", &self.targets.len())
            .field("environments", &self.input.slots.len())
            .finish_non_exhaustive()
    }
}

/// Returns a row of an array in C order.
fn row(poses: &Array2<PoseF64>, env: usize) -> &[PoseF64] {
    let width = poses.ncols();
    poses.as_slice().map_or(&[], |flat| &flat[env * width..(env + 1) * width])
}

#[cfg(test)]
mod tests;
