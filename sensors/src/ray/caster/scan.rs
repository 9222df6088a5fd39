//! Rays of many environments at once, on several threads.

use crate::ray::world::FixedWorld;
use crate::ray::{Ray, RayHit, RayTargets, RayWorld};
use crate::share::share;
use ndarray::Array2;
use scene::PoseF64;
use std::sync::Arc;

/// Rays that one thread takes at a time, at most.
const PART: usize = 1024;
/// Fewer rays than this for each thread are cast by the calling one: starting another takes some 0.05 ms, a ray 0.1 µs.
const WORTH_A_THREAD: usize = 4 * PART;

/// Casts the same rays in many environments. The bits do not depend on the number of threads.
#[derive(Clone, Debug)]
pub(crate) struct Scan {
    targets: Arc<RayTargets>,
    /// What does not move, in each environment; mostly one and the same.
    fixed: Vec<Arc<FixedWorld>>,
    desks: Vec<Desk>,
}

/// What a thread needs.
#[derive(Clone, Debug)]
struct Desk {
    world: RayWorld,
    rays: Vec<Ray>,
}

/// The rays of an environment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct View {
    pub(crate) env: usize,
    /// World from the frame of the rays.
    pub(crate) world_from_rays: PoseF64,
}

impl Scan {
    /// Nothing is known yet of where things are that do not move.
    pub(crate) fn new(targets: RayTargets, envs: usize, threads: usize) -> Self {
        let targets = Arc::new(targets);
        let desk = Desk { world: RayWorld::new(&targets), rays: Vec::with_capacity(PART) };
        let nothing = Arc::new(FixedWorld::default());
        Self { fixed: vec![nothing; envs], desks: vec![desk; threads.max(1)], targets }
    }

    pub(crate) fn targets(&self) -> &RayTargets {
        &self.targets
    }

    /// Looks where things are that do not move, in an environment where somebody may have moved them.
    pub(crate) fn settle(&mut self, env: usize, poses: &Array2<PoseF64>) {
        let poses = row(poses, env);
        let is_here = |fixed: &Arc<FixedWorld>| fixed.is_at(&self.targets, poses);
        if is_here(&self.fixed[env]) {
            return;
        }
        // They are at the same places in most environments.
        let known = self.fixed.first().filter(|first| is_here(first)).map(Arc::clone);
        self.fixed[env] = known.unwrap_or_else(|| Arc::new(FixedWorld::new(&self.targets, poses)));
    }

    /// Casts `local` in every view; `hits` has one for each ray, view after view.
    pub(crate) fn cast(
        &mut self,
        local: &[Ray],
        max_distance: f64,
        views: &[View],
        poses: &Array2<PoseF64>,
        hits: &mut [RayHit],
    ) {
        if local.is_empty() {
            return;
        }
        let threads = (hits.len() / WORTH_A_THREAD).clamp(1, self.desks.len());
        let fixed = &self.fixed;
        let parts = views.iter().zip(hits.chunks_mut(local.len())).flat_map(|(view, hits)| {
            local.chunks(PART).zip(hits.chunks_mut(PART)).map(move |(rays, hits)| (view, rays, hits))
        });
        share(&mut self.desks[..threads], parts, |desk, (view, rays, hits)| {
            desk.world.place_with(&fixed[view.env], row(poses, view.env));
            desk.rays.clear();
            desk.rays.extend(rays.iter().map(|ray| ray.mapped_by(&view.world_from_rays)));
            desk.world.cast(&desk.rays, max_distance, hits);
        });
    }
}

/// A row of an array in C order.
fn row(poses: &Array2<PoseF64>, env: usize) -> &[PoseF64] {
    let width = poses.ncols();
    poses.as_slice().map_or(&[], |flat| &flat[env * width..(env + 1) * width])
}
