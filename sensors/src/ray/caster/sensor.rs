//! Ray caster sensor.

use super::RayAlignment;
use super::cfg::RayCasterCfg;
use crate::error::SensorError;
use crate::ray::sampler::{RayModel, RaySampler};
use crate::sampling::{Sampled, Sampler};
use crate::sensor::{Sensor, SensorContext};
use crate::summary;
use kinetoscope_scene::Ray;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::{KeyedRng, Marker, Pose, PoseF64, SceneState};
use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Axis};
use std::fmt;

/// Distances along rays that move with a body, in all environments; [`Sampled`] gives their stamps and counts.
///
/// All values are in the frame of the environment, lengths in \[m\]. A ray without a hit has the distance +inf, the
/// point (+inf, +inf, +inf), the normal 0 and the id 0. No value is NaN after the first measurement or reset.
#[derive(Clone, Debug)]
pub struct RayCaster {
    path: String,
    /// Name of the pattern.
    pattern: &'static str,
    /// Rays of the pattern with its offset, in the frame of [`RayAlignment::align`].
    rays: RaySampler<Vec<Ray>>,
    hits: HitModel,
}

/// Frames of the rays, and the current hits.
#[derive(Clone, Debug)]
struct HitModel {
    alignment: RayAlignment,
    drift: Drift,
    points: Array3<f64>,
    ids: Array2<i32>,
    mask: Array2<bool>,
}

/// Position drift of the sensor.
#[derive(Clone, Debug)]
struct Drift {
    range: [f64; 2],
    rngs: Vec<KeyedRng>,
    offsets: Vec<[f64; 3]>,
}

impl RayModel for HitModel {
    type Rays = Vec<Ray>;

    fn frame(&mut self, env: usize, parent: Option<[f64; 7]>, values: &mut [f64]) -> PoseF64 {
        let mut row = parent.unwrap_or_else(|| to_row(&Pose::identity()));
        row.iter_mut().zip(self.drift.offsets[env]).for_each(|(x, drift)| *x += drift);
        values.copy_from_slice(&row);
        self.alignment.align(&from_row(&row))
    }

    fn update_outputs(&mut self, env: usize, sampler: &Sampler, rays: &Vec<Ray>) {
        let frame = frame(self.alignment, env, &sampler.values("pos_w"), &sampler.values("quat_w"));
        let (distances, ids) = (sampler.row("distances", env), sampler.row("ids", env));
        let points = env_slice(self.points.as_slice_mut(), env, 3 * rays.len());
        for (((ray, &distance), &id), point) in rays.iter().zip(distances).zip(ids).zip(points.chunks_exact_mut(3)) {
            point.copy_from_slice(&hit(ray, &frame, distance, id));
        }
        let shown_ids = env_slice(self.ids.as_slice_mut(), env, rays.len());
        let mask = env_slice(self.mask.as_slice_mut(), env, rays.len());
        for ((&id, shown_id), mask) in ids.iter().zip(shown_ids).zip(mask) {
            (*shown_id, *mask) = (id as i32, id != 0.0);
        }
    }

    fn reset(&mut self, env: usize) {
        self.drift.sample(env);
    }
}

impl Drift {
    fn sample(&mut self, env: usize) {
        let [low, high] = self.range;
        if low < high {
            self.offsets[env] = [0; 3].map(|_| low + (high - low) * self.rngs[env].uniform());
        } else {
            self.offsets[env] = [low; 3];
        }
    }
}

/// Returns the pose of the ray frame in the world, from sampled positions and rotations of the body.
fn frame(alignment: RayAlignment, env: usize, pos: &ArrayView2<'_, f64>, quat: &ArrayView2<'_, f64>) -> PoseF64 {
    let row = std::array::from_fn(|k| if k < 3 { pos[(env, k)] } else { quat[(env, k - 3)] });
    alignment.align(&from_row(&row))
}

/// Returns the end of a ray in the frame that `frame` maps to; infinite for a miss.
fn hit(ray: &Ray, frame: &PoseF64, distance: f64, id: f64) -> [f64; 3] {
    if id != 0.0 { ray.transformed_by(frame).at(distance) } else { [f64::INFINITY; 3] }
}

/// Returns the values of an environment in an array in C order.
fn env_slice<T>(all: Option<&mut [T]>, env: usize, width: usize) -> &mut [T] {
    all.map_or(&mut [], |all| &mut all[env * width..(env + 1) * width])
}

impl Sensor for RayCaster {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.rays.update(state, &mut self.hits)
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.rays.reset(env_ids, state, &mut self.hits)
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.rays.refresh(env_ids, state, &mut self.hits)
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler().due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// Red balls at the hits, as in Isaac Lab.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let hits = self.hits.points.index_axis(Axis(0), env);
        let places = hits.axis_iter(Axis(0)).map(|p| [p[0], p[1], p[2]]);
        let seen = places.filter(|p| p.iter().all(|x| x.is_finite()));
        seen.map(|p| Marker::sphere(p, 0.02, [0.9, 0.05, 0.05, 1.0])).collect()
    }
}

impl Sampled for RayCaster {
    fn sampler(&self) -> &Sampler {
        self.rays.sampler()
    }
}

impl RayCaster {
    pub(super) fn new(
        cfg: &RayCasterCfg,
        context: &SensorContext,
        rays: RaySampler<Vec<Ray>>,
        parent: Option<usize>,
    ) -> Self {
        let (n, b) = (context.num_envs, rays.rays().len());
        let random =
            |env| KeyedRng::keyed(context.seed, (context.first_env + env) as u64, &format!("{}/drift", context.name));
        Self {
            path: summary::path(context, parent),
            pattern: cfg.pattern.name(),
            rays,
            hits: HitModel {
                alignment: cfg.alignment,
                drift: Drift { range: cfg.drift, rngs: (0..n).map(random).collect(), offsets: vec![[0.0; 3]; n] },
                points: Array3::from_elem((n, b, 3), f64::INFINITY),
                ids: Array2::zeros((n, b)),
                mask: Array2::from_elem((n, b), false),
            },
        }
    }

    /// Number of rays per environment, the axis B.
    pub fn num_rays(&self) -> usize {
        self.rays.rays().len()
    }

    /// Hit points in the frame of the environment \[m\], shape (N, B, 3); (+inf, +inf, +inf) for a miss.
    pub fn hits(&self) -> ArrayView3<'_, f64> {
        self.hits.points.view()
    }

    /// [`hits`](Self::hits) of the latest delivered measurement, from the distances of [`Sampler::latest_delivered`];
    /// computed at every call.
    pub fn latest_delivered_hits(&self) -> Array3<f64> {
        let [distances, ids, pos, quat] =
            ["distances", "ids", "pos_w", "quat_w"].map(|channel| self.sampler().latest_delivered(channel));
        let (n, b) = distances.dim();
        let mut points = Array3::zeros((n, b, 3));
        for env in 0..n {
            let frame = frame(self.hits.alignment, env, &pos, &quat);
            for (k, ray) in self.rays.rays().iter().enumerate() {
                let point = hit(ray, &frame, distances[(env, k)], ids[(env, k)]);
                (0..3).for_each(|axis| points[(env, k, axis)] = point[axis]);
            }
        }
        points
    }

    /// Distances along the rays, shape (N, B) \[m\]; +inf for a miss.
    pub fn distances(&self) -> ArrayView2<'_, f64> {
        self.sampler().values("distances")
    }

    /// True for rays that hit a target, shape (N, B).
    pub fn hit_mask(&self) -> ArrayView2<'_, bool> {
        self.hits.mask.view()
    }

    /// Mask ids of the hits, shape (N, B), as in the mask channel of cameras; 0 for a miss.
    pub fn hit_ids(&self) -> ArrayView2<'_, i32> {
        self.hits.ids.view()
    }

    /// Unit normals of the hit surfaces in world axes, facing the origin of the ray, shape (N, B, 3); 0 for a miss.
    pub fn normals(&self) -> ArrayView3<'_, f64> {
        self.sampler().values_as("normals", (self.sampler().num_envs(), self.num_rays(), 3))
    }

    /// Origins of the rays at the current measurement, in the frame of the environment \[m\], shape (N, B, 3); computed
    /// at every call.
    pub fn ray_starts(&self) -> Array3<f64> {
        self.map_rays(|ray| ray.origin)
    }

    /// Unit directions of the rays at the current measurement, in the frame of the environment, shape (N, B, 3);
    /// computed at every call.
    pub fn ray_directions(&self) -> Array3<f64> {
        self.map_rays(|ray| ray.direction)
    }

    fn map_rays(&self, what: impl Fn(&Ray) -> [f64; 3]) -> Array3<f64> {
        let (n, b) = self.hits.ids.dim();
        let mut out = Array3::zeros((n, b, 3));
        for env in 0..n {
            let frame = frame(self.hits.alignment, env, &self.pos_w(), &self.quat_w());
            for (k, ray) in self.rays.rays().iter().enumerate() {
                let values = what(&ray.transformed_by(&frame));
                values.into_iter().enumerate().for_each(|(axis, x)| out[(env, k, axis)] = x);
            }
        }
        out
    }

    /// Position of the parent body including drift, without the offset, as in Isaac Lab, shape (N, 3) \[m\]. Without a
    /// parent, the drift alone.
    pub fn pos_w(&self) -> ArrayView2<'_, f64> {
        self.sampler().values("pos_w")
    }

    /// Rotation of the parent body before the alignment, w x y z, shape (N, 4); the identity without a parent.
    pub fn quat_w(&self) -> ArrayView2<'_, f64> {
        self.sampler().values("quat_w")
    }

    /// History of the distances, newest first, shape (N, history_length, B) \[m\]: +inf for a miss, 0 where not filled
    /// yet.
    pub fn distance_history(&self) -> ArrayView3<'_, f64> {
        self.sampler().history("distances")
    }

    /// Indices in [`RenderScene::instances`](kinetoscope_scene::RenderScene::instances) of the target instances. Hidden
    /// instances are included: rays hit them only in environments whose own scene shows them.
    pub fn target_instances(&self) -> impl Iterator<Item = usize> {
        self.rays.targets().instances()
    }
}

/// Writes a summary of several lines.
impl fmt::Display for RayCaster {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (sensors, rays) = self.hit_ids().dim();
        let targets = self.rays.targets();
        summary::write(
            f,
            "Ray-caster",
            &self.path,
            &[
                ("pattern", &self.pattern),
                ("alignment", &self.hits.alignment.name()),
                ("update period (s)", &self.sampler().period()),
                ("number of targets", &format!("{} ({} of them fixed)", targets.len(), targets.fixed_count())),
                ("number of sensors", &sensors),
                ("number of rays/sensor", &rays),
                ("total number of rays", &(sensors * rays)),
            ],
        )
    }
}
