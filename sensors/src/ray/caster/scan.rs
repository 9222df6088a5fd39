//! Rays of many environments at once, on several threads.

use super::order::neighbours_together;
use crate::crew::{Crew, Work};
use crate::ray::world::FixedWorld;
use crate::ray::{Ray, RayAssets, RayHit, RayTargets, RayWorld};
use crate::sensor::SensorContext;
use ndarray::Array2;
use scene::{OwnScene, PoseF64};
use std::fmt;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock, RwLockReadGuard, RwLockWriteGuard};

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
pub(crate) struct Scan<R: Rays> {
    crew: Crew,
    /// Where the hits of an environment are among those of the last cast.
    slots: Vec<usize>,
    round: Arc<Round<R>>,
}

/// What the threads share.
#[derive(Debug)]
struct Round<R: Rays> {
    targets: Arc<RayTargets>,
    /// Where trees over meshes are, for targets of environments that look otherwise.
    assets: RayAssets,
    rays: R,
    /// The order in which they are cast.
    order: Option<Vec<u32>>,
    task: RwLock<Task<R::View>>,
    /// The next part that somebody takes.
    next: AtomicUsize,
    /// What a thread needs, for each of them.
    desks: Vec<Mutex<Desk>>,
    /// Hits of up to [`PART`] rays each: all parts of a view, then those of the next.
    parts: Vec<Mutex<Vec<RayHit>>>,
}

/// What is to be cast.
#[derive(Clone, Debug)]
struct Task<V> {
    max_distance: f64,
    /// What rays hit in each environment; mostly one and the same.
    looks: Vec<Look>,
    /// What does not move, in each environment; mostly one and the same.
    fixed: Vec<Arc<FixedWorld>>,
    /// Environments and their views.
    views: Vec<(usize, V)>,
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
    rays: Vec<Ray>,
}

impl<R: Rays> Scan<R> {
    /// Nothing is known yet of where things are that do not move.
    pub(crate) fn new(targets: RayTargets, rays: R, max_distance: f64, context: &SensorContext) -> Self {
        let (n, count) = (context.num_envs, rays.count());
        let targets = Arc::new(targets);
        let desk = || Desk { world: RayWorld::new(&targets), rays: Vec::with_capacity(PART.min(count)) };
        let nothing = Arc::new(FixedWorld::default());
        let of_view = || (0..count).step_by(PART).map(|first| vec![RayHit::MISS; PART.min(count - first)]);
        let look = Look { scene: OwnScene::default(), targets: Arc::clone(&targets) };
        let (looks, fixed, views) = (vec![look; n], vec![nothing; n], Vec::with_capacity(n));
        let task = Task { max_distance, looks, fixed, views, poses: Vec::new() };
        let round = Round {
            assets: context.ray_assets.clone(),
            task: RwLock::new(task),
            next: AtomicUsize::new(0),
            desks: (0..context.threads.max(1)).map(|_| Mutex::new(desk())).collect(),
            parts: (0..n).flat_map(|_| of_view()).map(Mutex::new).collect(),
            targets,
            order: rays.order(),
            rays,
        };
        Self { crew: context.crew.clone(), slots: vec![NOWHERE; n], round: Arc::new(round) }
    }

    pub(crate) fn targets(&self) -> &RayTargets {
        &self.round.targets
    }

    /// The rays, in their own frame.
    pub(crate) fn rays(&self) -> &R {
        &self.round.rays
    }

    /// Looks where things are that do not move, in an environment where somebody may have moved them or changed how they
    /// look; `scene` is the environment's own.
    pub(crate) fn settle(&mut self, env: usize, poses: &Array2<PoseF64>, scene: &OwnScene) {
        let (round, poses) = (&self.round, row(poses, env));
        let mut task = write(&round.task);
        let other = task.looks[env].scene != *scene;
        if other {
            let own = |scene: &_| Arc::new(RayTargets::new(scene, round.targets.instances(), &round.assets));
            let targets = scene.0.as_deref().map_or_else(|| Arc::clone(&round.targets), own);
            task.looks[env] = Look { scene: scene.clone(), targets };
        }
        let targets = Arc::clone(&task.looks[env].targets);
        let is_here = |fixed: &Arc<FixedWorld>| fixed.is_at(&targets, poses);
        if !other && is_here(&task.fixed[env]) {
            return;
        }
        // They are the same things at the same places in most environments.
        let known = task.fixed.first().filter(|first| {
            let alike = env > 0 && Arc::ptr_eq(&task.looks[0].targets, &targets);
            alike && is_here(first)
        });
        task.fixed[env] = known.map_or_else(|| Arc::new(FixedWorld::new(&targets, poses)), Arc::clone);
    }

    /// Casts the rays of the environments `envs`, with the view that `view` gives for each; `poses` are those of the
    /// instances in all environments. One that is named twice is cast once.
    pub(crate) fn cast(&mut self, envs: &[usize], poses: &Array2<PoseF64>, mut view: impl FnMut(usize) -> R::View) {
        let mut task = write(&self.round.task);
        for (env, _) in task.views.drain(..) {
            self.slots[env] = NOWHERE;
        }
        task.poses.clear();
        for &env in envs {
            if self.slots[env] == NOWHERE {
                self.slots[env] = task.views.len();
                task.views.push((env, view(env)));
                task.poses.extend(self.round.targets.moving_poses(row(poses, env)));
            }
        }
        let count = task.views.len() * self.round.rays.count();
        drop(task);
        self.round.next.store(0, Ordering::Relaxed);
        let threads = (count / WORTH_A_THREAD).clamp(1, self.round.desks.len());
        self.crew.run(threads, &self.round);
    }

    /// Shows the hits of an environment of the last cast, in any order, with the index of the ray.
    pub(crate) fn each_hit(&self, env: usize, mut show: impl FnMut(usize, &RayHit)) {
        let (slot, per_view) = (self.slots[env], self.round.per_view());
        let first = if slot == NOWHERE { self.round.parts.len() } else { slot * per_view };
        for (part, hits) in self.round.parts.iter().skip(first).take(per_view).enumerate() {
            let first = part * PART;
            match &self.round.order {
                Some(order) => lock(hits).iter().zip(&order[first..]).for_each(|(hit, &k)| show(k as usize, hit)),
                None => lock(hits).iter().zip(first..).for_each(|(hit, k)| show(k, hit)),
            }
        }
    }
}

impl<R: Rays> Round<R> {
    /// Parts of a view.
    fn per_view(&self) -> usize {
        self.rays.count().div_ceil(PART)
    }
}

impl<R: Rays> Work for Round<R> {
    fn work(&self, desk: usize) {
        let task = read(&self.task);
        let mut desk = lock(&self.desks[desk]);
        let Desk { world, rays } = &mut *desk;
        let (per_view, moving) = (self.per_view(), self.targets.moving_count());
        let mut placed = NOWHERE;
        loop {
            let part = self.next.fetch_add(1, Ordering::Relaxed);
            if part >= per_view * task.views.len() {
                return;
            }
            let (at, first) = (part / per_view, part % per_view * PART);
            let (env, view) = &task.views[at];
            if placed != at {
                let moving = &task.poses[at * moving..(at + 1) * moving];
                world.place_with(&task.looks[*env].targets, &task.fixed[*env], moving);
                placed = at;
            }
            let mut hits = lock(&self.parts[part]);
            rays.clear();
            let range = first..first + hits.len();
            match &self.order {
                Some(order) => self.rays.add(view, order[range].iter().map(|&k| k as usize), rays),
                None => self.rays.add(view, range, rays),
            }
            world.cast(rays, task.max_distance, &mut hits);
        }
    }
}

/// A scan of its own: clones cast at the same time.
impl<R: Rays> Clone for Scan<R> {
    fn clone(&self) -> Self {
        let Round { targets, assets, rays, order, task, desks, parts, .. } = &*self.round;
        let round = Round {
            assets: assets.clone(),
            targets: Arc::clone(targets),
            rays: rays.clone(),
            order: order.clone(),
            task: RwLock::new(read(task).clone()),
            next: AtomicUsize::new(0),
            desks: desks.iter().map(|desk| Mutex::new(lock(desk).clone())).collect(),
            parts: parts.iter().map(|hits| Mutex::new(lock(hits).clone())).collect(),
        };
        Self { crew: self.crew.clone(), slots: self.slots.clone(), round: Arc::new(round) }
    }
}

/// Short: hits are many.
impl<R: Rays> fmt::Debug for Scan<R> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Scan")
            .field("rays", &self.round.rays.count())
            .field("targets", &self.round.targets.len())
            .field("environments", &self.slots.len())
            .finish_non_exhaustive()
    }
}

/// A lock of ours is poisoned only where casting panicked, which was raised again.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn read<T>(task: &RwLock<T>) -> RwLockReadGuard<'_, T> {
    task.read().unwrap_or_else(PoisonError::into_inner)
}

fn write<T>(task: &RwLock<T>) -> RwLockWriteGuard<'_, T> {
    task.write().unwrap_or_else(PoisonError::into_inner)
}

/// A row of an array in C order.
fn row(poses: &Array2<PoseF64>, env: usize) -> &[PoseF64] {
    let width = poses.ncols();
    poses.as_slice().map_or(&[], |flat| &flat[env * width..(env + 1) * width])
}

#[cfg(test)]
mod tests;
