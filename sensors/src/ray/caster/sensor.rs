//! The ray caster as a sensor.

use super::RayAlignment;
use super::cfg::RayCasterCfg;
use crate::error::SensorError;
use crate::expected::Expected;
use crate::ray::scan::Scan;
use crate::ray::{Ray, RayTargets};
use crate::sampling::{Sampled, Sampler};
use crate::schedule::Phases;
use crate::sensor::{Sensor, SensorCfg, SensorContext};
use crate::summary;
use kinetoscope_scene::pose::{from_row, to_row};
use kinetoscope_scene::{Marker, Pose, PoseF64, Random, SceneState};
use ndarray::{Array2, Array3, ArrayView2, ArrayView3, Axis};

/// Distances along rays that move with a body, in all environments; [`Sampled`] has their stamps and counts.
///
/// Everything is in the frame of the environment \[m\]. A ray that hits nothing has the distance +inf, the point
/// (+inf, +inf, +inf), the normal 0 and the id 0; nothing is ever NaN.
#[derive(Clone, Debug)]
pub struct RayCaster {
    path: String,
    /// The kind of pattern.
    pattern: &'static str,
    parent: Option<usize>,
    alignment: RayAlignment,
    /// The rays are in the frame that [`RayAlignment::align`] gives: the pattern, with its offset.
    scan: Scan<Vec<Ray>>,
    sampler: Sampler,
    /// The sampler's own, to know before it asks which environments are due.
    phases: Phases,
    drift: Drift,
    expected: Expected,
    due: Vec<usize>,
    /// Where the sensor was when its rays were cast last, in each environment.
    sensor_rows: Vec<[f64; 7]>,
    shown: Shown,
}

/// What is made of the current values.
#[derive(Clone, Debug)]
struct Shown {
    /// Measurements that it was made of.
    counts: Vec<u64>,
    points: Array3<f64>,
    ids: Array2<i32>,
    mask: Array2<bool>,
}

/// Errors of the sensor's position.
#[derive(Clone, Debug)]
struct Drift {
    range: [f64; 2],
    randoms: Vec<Random>,
    now: Vec<[f64; 3]>,
}

impl RayCaster {
    pub(super) fn new(
        cfg: &RayCasterCfg,
        context: &SensorContext,
        parent: Option<usize>,
        scan: Scan<Vec<Ray>>,
        phases: Phases,
        sampler: Sampler,
    ) -> Self {
        let (n, b) = (context.num_envs, scan.rays().len());
        let random =
            |env| Random::keyed(context.seed, (context.first_env + env) as u64, &format!("{}/drift", context.name));
        Self {
            path: summary::path(context, parent),
            pattern: cfg.pattern.name(),
            expected: Expected::new("ray caster", cfg.requires(), context),
            due: Vec::with_capacity(n),
            parent,
            alignment: cfg.alignment,
            scan,
            sampler,
            phases,
            drift: Drift { range: cfg.drift, randoms: (0..n).map(random).collect(), now: vec![[0.0; 3]; n] },
            sensor_rows: vec![[0.0; 7]; n],
            shown: Shown {
                counts: vec![0; n],
                points: Array3::from_elem((n, b, 3), f64::INFINITY),
                ids: Array2::zeros((n, b)),
                mask: Array2::from_elem((n, b), false),
            },
        }
    }

    /// Casts the rays of some environments; `state` was checked. An environment that is named twice is cast once.
    fn cast(&mut self, envs: &[usize], state: &SceneState) {
        let Some(poses) = &state.instance_poses else { return };
        let Self { parent, alignment, drift, sensor_rows, scan, .. } = self;
        let parent = parent.zip(state.body_poses.as_ref());
        scan.cast(envs, poses, |env| {
            let mut row = parent.map_or_else(
                || to_row(&Pose::identity()),
                |(body, poses)| std::array::from_fn(|k| poses[(env, body, k)]),
            );
            row.iter_mut().zip(drift.now[env]).for_each(|(x, drift)| *x += drift);
            sensor_rows[env] = row;
            alignment.align(&from_row(&row))
        });
    }

    /// The same, after somebody may have moved what does not move by itself.
    fn cast_anew(&mut self, envs: &[usize], state: &SceneState) {
        let Some(poses) = &state.instance_poses else { return };
        envs.iter().for_each(|&env| self.scan.settle(env, poses, state.own_scene(env)));
        self.cast(envs, state);
    }

    /// The sampler, and what was cast last.
    fn sampled(&mut self) -> (&mut Sampler, Cast<'_>) {
        let Self { sampler, sensor_rows, scan, .. } = self;
        (sampler, Cast { sensors: sensor_rows, scan })
    }

    /// Makes points, ids and masks of the current values of an environment.
    fn show(&mut self, env: usize) {
        let (frame, count) = (self.frame(env), self.sample_counts()[env]);
        let Self { sampler, shown, scan, .. } = self;
        shown.counts[env] = count;
        let rays = scan.rays();
        let (distances, ids) = (sampler.row("distances", env), sampler.row("ids", env));
        let points = part_of(shown.points.as_slice_mut(), env, 3 * rays.len());
        for (((ray, &distance), &id), point) in rays.iter().zip(distances).zip(ids).zip(points.chunks_exact_mut(3)) {
            point.copy_from_slice(&hit(ray, &frame, distance, id));
        }
        let (shown_ids, mask) = (shown.ids.as_slice_mut(), shown.mask.as_slice_mut());
        let (shown_ids, mask) = (part_of(shown_ids, env, rays.len()), part_of(mask, env, rays.len()));
        for ((&id, shown_id), mask) in ids.iter().zip(shown_ids).zip(mask) {
            (*shown_id, *mask) = (id as i32, id != 0.0);
        }
    }

    /// World from the frame of the rays, of the current values.
    fn frame(&self, env: usize) -> PoseF64 {
        self.frame_of(env, &self.sampler.values("pos_w"), &self.sampler.values("quat_w"))
    }

    fn frame_of(&self, env: usize, pos: &ArrayView2<'_, f64>, quat: &ArrayView2<'_, f64>) -> PoseF64 {
        let row = std::array::from_fn(|k| if k < 3 { pos[(env, k)] } else { quat[(env, k - 3)] });
        self.alignment.align(&from_row(&row))
    }
}

/// Where a ray ends in the frame that `frame` maps to.
fn hit(ray: &Ray, frame: &PoseF64, distance: f64, id: f64) -> [f64; 3] {
    if id != 0.0 { ray.mapped_by(frame).at(distance) } else { [f64::INFINITY; 3] }
}

/// The numbers of an environment in an array in C order.
fn part_of<T>(all: Option<&mut [T]>, env: usize, width: usize) -> &mut [T] {
    all.map_or(&mut [], |all| &mut all[env * width..(env + 1) * width])
}

/// What was cast, for the sampler.
struct Cast<'a> {
    sensors: &'a [[f64; 7]],
    scan: &'a Scan<Vec<Ray>>,
}

impl Cast<'_> {
    /// Writes the values of an environment that was cast to a row of the sampler.
    fn write(&self, env: usize, row: &mut [f64]) {
        let rays = self.scan.rays().len();
        let (distances, row) = row.split_at_mut(rays);
        let (normals, row) = row.split_at_mut(3 * rays);
        let (ids, sensor) = row.split_at_mut(rays);
        self.scan.each_hit(env, |k, hit| {
            distances[k] = hit.distance;
            normals[3 * k..3 * k + 3].copy_from_slice(&hit.normal);
            ids[k] = hit.mask_id.into();
        });
        sensor.copy_from_slice(&self.sensors[env]);
    }
}

impl Sensor for RayCaster {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        let mut due = std::mem::take(&mut self.due);
        due.clear();
        due.extend((0..state.num_envs()).filter(|&env| self.phases.is_due(env, state.step[env])));
        self.cast(&due, state);
        self.due = due;
        let (sampler, cast) = self.sampled();
        sampler.update(state, |env, row| cast.write(env, row))?;
        for env in 0..state.num_envs() {
            if self.sample_counts()[env] != self.shown.counts[env] {
                self.show(env);
            }
        }
        Ok(())
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        self.expected.check_envs(env_ids)?;
        for &env in env_ids {
            self.phases.reset(env, state.step[env]);
            self.drift.draw(env);
        }
        self.cast_anew(env_ids, state);
        let (sampler, cast) = self.sampled();
        sampler.reset(env_ids, state, |env, row| cast.write(env, row))?;
        env_ids.iter().for_each(|&env| self.show(env));
        Ok(())
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.expected.check(state)?;
        self.expected.check_envs(env_ids)?;
        self.cast_anew(env_ids, state);
        let (sampler, cast) = self.sampled();
        sampler.refresh(env_ids, state, |env, row| cast.write(env, row))?;
        env_ids.iter().for_each(|&env| self.show(env));
        Ok(())
    }

    fn due_in(&self, step: &[u64]) -> u64 {
        self.sampler.due_in(step)
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// Red balls where rays hit, as in Isaac Lab; none where they miss.
    fn markers(&self, env: usize, _pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let hits = self.shown.points.index_axis(Axis(0), env);
        let places = hits.axis_iter(Axis(0)).map(|p| [p[0], p[1], p[2]]);
        let seen = places.filter(|p| p.iter().all(|x| x.is_finite()));
        seen.map(|p| Marker::sphere(p, 0.02, [0.9, 0.05, 0.05, 1.0])).collect()
    }
}

impl Sampled for RayCaster {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }
}

impl Drift {
    fn draw(&mut self, env: usize) {
        let [low, high] = self.range;
        if low < high {
            self.now[env] = [0; 3].map(|_| low + (high - low) * self.randoms[env].uniform());
        } else {
            self.now[env] = [low; 3];
        }
    }
}

impl RayCaster {
    /// Number of rays in an environment: the second axis of what is measured.
    pub fn num_rays(&self) -> usize {
        self.scan.rays().len()
    }

    /// Where rays hit, shape (N, B, 3) \[m\]; (+inf, +inf, +inf) for a miss.
    pub fn hits(&self) -> ArrayView3<'_, f64> {
        self.shown.points.view()
    }

    /// [`hits`](Self::hits) of the measurement that arrived last, as [`Sampler::arrived`] has its distances; made when asked.
    pub fn arrived_hits(&self) -> Array3<f64> {
        let [distances, ids, pos, quat] =
            ["distances", "ids", "pos_w", "quat_w"].map(|channel| self.sampler.arrived(channel));
        let (n, b) = distances.dim();
        let mut points = Array3::zeros((n, b, 3));
        for env in 0..n {
            let frame = self.frame_of(env, &pos, &quat);
            for (k, ray) in self.scan.rays().iter().enumerate() {
                let point = hit(ray, &frame, distances[(env, k)], ids[(env, k)]);
                (0..3).for_each(|axis| points[(env, k, axis)] = point[axis]);
            }
        }
        points
    }

    /// Distances along the rays, shape (N, B) \[m\]; +inf for a miss.
    pub fn distances(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("distances")
    }

    /// Which rays hit something, shape (N, B).
    pub fn hit_mask(&self) -> ArrayView2<'_, bool> {
        self.shown.mask.view()
    }

    /// Mask ids of what was hit, shape (N, B): those of the mask channel of cameras. 0 for a miss.
    pub fn hit_ids(&self) -> ArrayView2<'_, i32> {
        self.shown.ids.view()
    }

    /// Unit normals of the surfaces, turned to where the ray comes from, shape (N, B, 3); 0 for a miss.
    pub fn normals(&self) -> ArrayView3<'_, f64> {
        self.sampler.values_as("normals", (self.shown.counts.len(), self.num_rays(), 3))
    }

    /// Where rays begin, shape (N, B, 3) \[m\]; made when asked.
    pub fn ray_starts(&self) -> Array3<f64> {
        self.of_rays(|ray| ray.origin)
    }

    /// Where rays go, of length 1, shape (N, B, 3); made when asked.
    pub fn ray_directions(&self) -> Array3<f64> {
        self.of_rays(|ray| ray.direction)
    }

    fn of_rays(&self, what: impl Fn(&Ray) -> [f64; 3]) -> Array3<f64> {
        let (n, b) = self.shown.ids.dim();
        let mut out = Array3::zeros((n, b, 3));
        for env in 0..n {
            let frame = self.frame(env);
            for (k, ray) in self.scan.rays().iter().enumerate() {
                let values = what(&ray.mapped_by(&frame));
                values.into_iter().enumerate().for_each(|(axis, x)| out[(env, k, axis)] = x);
            }
        }
        out
    }

    /// Position of the body that the sensor hangs on, with its drift, without the offset, as in Isaac Lab, shape (N, 3)
    /// \[m\].
    pub fn pos_w(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("pos_w")
    }

    /// Rotation of the body that the sensor hangs on, rows w, x, y, z, shape (N, 4).
    pub fn quat_w(&self) -> ArrayView2<'_, f64> {
        self.sampler.values("quat_w")
    }

    /// Past distances, newest first, shape (N, history_length, B) \[m\]; 0 where not filled yet.
    pub fn distance_history(&self) -> ArrayView3<'_, f64> {
        self.sampler.history("distances")
    }

    /// Indices of the instances of the scene that can be hit.
    pub fn target_instances(&self) -> impl Iterator<Item = usize> {
        self.scan.targets().instances()
    }

    pub(super) fn parts(&self) -> (&str, &str, RayAlignment, &RayTargets) {
        (&self.path, self.pattern, self.alignment, self.scan.targets())
    }
}
