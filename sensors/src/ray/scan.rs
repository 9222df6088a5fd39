//! Rays of many environments at once, on several threads.

use super::order::neighbours_together;
use crate::sensor::SensorContext;
use kinetoscope_exec::ThreadPool;
use kinetoscope_render::geometry::FixedWorld;
use kinetoscope_render::geometry::{RayAssets, RayHit, RayTargets, RayWorld};
use kinetoscope_scene::Ray;
use kinetoscope_scene::{OwnScene, PoseF64};
use ndarray::Array2;
use std::fmt;
use std::sync::Arc;

/// Rays that one thread takes at a time, at most.
const PART: usize = 1024;
/// Fewer rays than this for each thread are cast by the calling one: waking another takes some 0.05 ms, a ray 0.1 µs.
const WORTH_A_THREAD: usize = 4 * PART;
/// The slot of an environment where nothing was cast.
const NOWHERE: usize = usize::MAX;

/// The rays of a sensor: as many in every environment.
pub(crate) trait Rays: Clone + fmt::Debug + Send + Sync + 'static {
    /// What is different in every environment: where they are, at least.
    type View: Copy + fmt::Debug + Send + Sync;

    /// How many there are.
    fn count(&self) -> usize;

    /// In which order they are cast best, neighbours together; `None` for their own. It changes no hit.
    fn order(&self) -> Option<Vec<u32>> {
        None
    }

    /// Adds some of the rays to `out`, in the frame of the environment.
    fn add(&self, view: &Self::View, which: impl Iterator<Item = usize>, out: &mut Vec<Ray>);
}

/// Rays of a frame, which is somewhere else in every environment.
impl Rays for Vec<Ray> {
    type View = PoseF64;

    fn count(&self) -> usize {
        self.len()
    }

    fn order(&self) -> Option<Vec<u32>> {
        Some(neighbours_together(self))
    }

    fn add(&self, world_from_rays: &PoseF64, which: impl Iterator<Item = usize>, out: &mut Vec<Ray>) {
        out.extend(which.map(|k| self[k].mapped_by(world_from_rays)));
    }
}

/// Casts the rays of a sensor in many environments. The bits do not depend on the number of threads, and nothing is
/// allocated after the first times.
#[derive(Clone)]
pub(crate) struct Scan<R: Rays> {
    pool: ThreadPool,
    targets: Arc<RayTargets>,
    /// Where trees over meshes are, for targets of environments that look otherwise.
    assets: RayAssets,
    rays: R,
    /// The order in which they are cast.
    order: Option<Vec<u32>>,
    /// What rays hit in each environment; mostly one and the same.
    looks: Vec<Look>,
    /// What does not move, in each environment; mostly one and the same.
    fixed: Vec<Arc<FixedWorld>>,
    max_distance: f64,
    task: Task<R::View>,
    /// What a thread needs, for each of them.
    desks: Vec<Desk>,
    /// Hits of up to [`PART`] rays each: all parts of a view, then those of the next.
    parts: Vec<Vec<RayHit>>,
}

/// What was cast last.
#[derive(Clone, Debug)]
struct Task<V> {
    /// Environments and their views.
    views: Vec<(usize, V)>,
    /// Where an environment is among the views.
    slots: Vec<usize>,
    /// Where the targets are that may move, view after view.
    poses: Vec<PoseF64>,
}

/// What rays hit in an environment.
#[derive(Clone, Debug)]
struct Look {
    /// What it was made of.
    scene: OwnScene,
    targets: Arc<RayTargets>,
}

#[derive(Clone, Debug)]
struct Desk {
    world: RayWorld,
    /// The view that the world is placed for.
    placed: usize,
    rays: Vec<Ray>,
}

impl<R: Rays> Scan<R> {
    /// Nothing is known yet of where things are that do not move.
    pub(crate) fn new(targets: RayTargets, rays: R, max_distance: f64, context: &SensorContext) -> Self {
        let (n, count) = (context.num_envs, rays.count());
        let (targets, nothing) = (Arc::new(targets), Arc::new(FixedWorld::default()));
        let desk =
            || Desk { world: RayWorld::new(&targets), placed: NOWHERE, rays: Vec::with_capacity(PART.min(count)) };
        let of_view = || (0..count).step_by(PART).map(|first| vec![RayHit::MISS; PART.min(count - first)]);
        let look = Look { scene: OwnScene::default(), targets: Arc::clone(&targets) };
        Self {
            pool: context.pool.clone(),
            assets: context.ray_assets.clone(),
            looks: vec![look; n],
            order: rays.order(),
            rays,
            fixed: vec![nothing; n],
            max_distance,
            task: Task { views: Vec::with_capacity(n), slots: vec![NOWHERE; n], poses: Vec::new() },
            desks: (0..context.threads.max(1)).map(|_| desk()).collect(),
            parts: (0..n).flat_map(|_| of_view()).collect(),
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

    /// Looks where things are that do not move, in an environment where somebody may have moved them or changed how they
    /// look; `scene` is the environment's own.
    pub(crate) fn settle(&mut self, env: usize, poses: &Array2<PoseF64>, scene: &OwnScene) {
        let poses = row(poses, env);
        let other = self.looks[env].scene != *scene;
        if other {
            let own = |scene: &_| Arc::new(RayTargets::new(scene, self.targets.instances(), &self.assets));
            let targets = scene.0.as_deref().map_or_else(|| Arc::clone(&self.targets), own);
            self.looks[env] = Look { scene: scene.clone(), targets };
        }
        let targets = &self.looks[env].targets;
        let is_here = |fixed: &Arc<FixedWorld>| fixed.is_at(targets, poses);
        if !other && is_here(&self.fixed[env]) {
            return;
        }
        // They are the same things at the same places in most environments.
        let known = self.fixed.first().filter(|first| {
            let alike = env > 0 && Arc::ptr_eq(&self.looks[0].targets, targets);
            alike && is_here(first)
        });
        self.fixed[env] = known.map_or_else(|| Arc::new(FixedWorld::new(targets, poses)), Arc::clone);
    }

    /// Casts the rays of the environments `envs`, with the view that `view` gives for each; `poses` are those of the
    /// instances in all environments. One that is named twice is cast once.
    pub(crate) fn cast(&mut self, envs: &[usize], poses: &Array2<PoseF64>, mut view: impl FnMut(usize) -> R::View) {
        let Task { views, slots, poses: moved } = &mut self.task;
        for (env, _) in views.drain(..) {
            slots[env] = NOWHERE;
        }
        moved.clear();
        for &env in envs {
            if slots[env] == NOWHERE {
                slots[env] = views.len();
                views.push((env, view(env)));
                moved.extend(self.targets.moving_poses(row(poses, env)));
            }
        }
        let (per_view, moving) = (self.per_view(), self.targets.moving_count());
        let Self { pool, rays, order, looks, fixed, max_distance, task, desks, parts, .. } = self;
        let threads = (task.views.len() * rays.count() / WORTH_A_THREAD).clamp(1, desks.len());
        let desks = &mut desks[..threads];
        desks.iter_mut().for_each(|desk| desk.placed = NOWHERE);
        let parts = parts[..per_view * task.views.len()].iter_mut().enumerate();
        let (rays, order, looks, fixed) = (&*rays, order.as_deref(), &*looks, &*fixed);
        let (task, max_distance) = (&*task, *max_distance);
        pool.for_each(desks, parts, |desk, (part, hits)| {
            let (at, first) = (part / per_view, part % per_view * PART);
            let (env, view) = &task.views[at];
            if desk.placed != at {
                let moving = &task.poses[at * moving..(at + 1) * moving];
                desk.world.place_with(&looks[*env].targets, &fixed[*env], moving);
                desk.placed = at;
            }
            desk.rays.clear();
            let range = first..first + hits.len();
            match order {
                Some(order) => rays.add(view, order[range].iter().map(|&k| k as usize), &mut desk.rays),
                None => rays.add(view, range, &mut desk.rays),
            }
            desk.world.cast(&desk.rays, max_distance, hits);
        });
    }

    /// Shows the hits of an environment of the last cast, in any order, with the index of the ray.
    pub(crate) fn each_hit(&self, env: usize, mut show: impl FnMut(usize, &RayHit)) {
        let (slot, per_view) = (self.task.slots[env], self.per_view());
        let first = if slot == NOWHERE { self.parts.len() } else { slot * per_view };
        for (part, hits) in self.parts.iter().skip(first).take(per_view).enumerate() {
            let first = part * PART;
            match &self.order {
                Some(order) => hits.iter().zip(&order[first..]).for_each(|(hit, &k)| show(k as usize, hit)),
                None => hits.iter().zip(first..).for_each(|(hit, k)| show(k, hit)),
            }
        }
    }

    /// Parts of a view.
    fn per_view(&self) -> usize {
        self.rays.count().div_ceil(PART)
    }
}

/// Short: hits are many.
impl<R: Rays> fmt::Debug for Scan<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scan")
            .field("rays", &self.rays.count())
            .field("targets", &self.targets.len())
            .field("environments", &self.task.slots.len())
            .finish_non_exhaustive()
    }
}

/// A row of an array in C order.
fn row(poses: &Array2<PoseF64>, env: usize) -> &[PoseF64] {
    let width = poses.ncols();
    poses.as_slice().map_or(&[], |flat| &flat[env * width..(env + 1) * width])
}

#[cfg(test)]
mod tests;
