//! Contact sensor.

use super::air_time::ContactTimers;
use super::pairs::Pairs;
use crate::error::SensorError;
use crate::sampling::{Sampled, Sampler};
use crate::select::matching;
use crate::sensor::Sensor;
use crate::summary;
use kinetoscope_scene::{Marker, Pose, SceneState};
use ndarray::{Array2, ArrayView2, ArrayView3, ArrayView4, ArrayView5};
use std::fmt;

/// Contact forces on bodies in all environments, world axes; [`Sampled`] gives their stamps and counts.
///
/// Forces act **on** the body: a foot that stands on the ground reads +z. Shapes: N environments, B bodies, M filters,
/// T measurements of history, newest first. The newest is the current measurement, except after a reset or a write to
/// the state.
#[derive(Clone, Debug)]
pub struct ContactSensor {
    pub(super) names: Vec<String>,
    pub(super) filters: Vec<String>,
    pub(super) pairs: Pairs,
    pub(super) air: Option<ContactTimers>,
    pub(super) sampler: Sampler,
    pub(super) threshold: f64,
}

impl Sensor for ContactSensor {
    fn update(&mut self, state: &SceneState) -> Result<(), SensorError> {
        self.sampler.check(state)?;
        let Self { air, pairs, sampler, .. } = self;
        if let Some(air) = air {
            for (env, &step) in state.step.iter().enumerate() {
                air.update(env, step, |net| pairs.net_forces(state, env, net));
            }
        }
        sampler.update(state, |env, row| {
            let row = pairs.read(state, env, row);
            if let Some(air) = air {
                air.read(env, row);
                air.clear_events(env);
            }
        })
    }

    fn reset(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        self.sampler.check(state)?;
        self.sampler.check_envs(env_ids)?;
        if let Some(air) = &mut self.air {
            for &env in env_ids {
                air.reset(env, state.step[env], |net| self.pairs.net_forces(state, env, net));
            }
        }
        let Self { air, pairs, sampler, .. } = self;
        sampler.reset(env_ids, state, |env, row| read(pairs, air.as_ref(), state, env, row))
    }

    fn refresh(&mut self, env_ids: &[usize], state: &SceneState) -> Result<(), SensorError> {
        let Self { air, pairs, sampler, .. } = self;
        sampler.refresh(env_ids, state, |env, row| read(pairs, air.as_ref(), state, env, row))
    }

    /// Returns 1 if air times are tracked, else the steps until the next measurement.
    fn due_in(&self, step: &[u64]) -> u64 {
        if self.air.is_some() { 1 } else { self.sampler.due_in(step) }
    }

    fn sampled(&self) -> Option<&dyn Sampled> {
        Some(self)
    }

    /// A red ball at every body in contact, with an arrow of the force, 1 m for 500 N; a green ball at every other
    /// body.
    fn markers(&self, env: usize, pose: &dyn Fn(usize) -> Pose) -> Vec<Marker> {
        let forces = self.net_forces_w();
        let mut markers = Vec::new();
        for (k, &body) in self.pairs.bodies().iter().enumerate() {
            let force = [0, 1, 2].map(|axis| forces[(env, k, axis)]);
            let place = pose(body).translation.vector.into();
            let touched = force.iter().map(|f| f * f).sum::<f64>().sqrt() > self.force_threshold();
            if touched {
                markers.push(Marker::sphere(place, 0.05, [0.9, 0.05, 0.05, 1.0]));
                markers.extend(Marker::arrow(place, force.map(|f| f / 500.0), [0.95, 0.6, 0.1, 1.0]));
            } else {
                markers.push(Marker::sphere(place, 0.05, [0.05, 0.7, 0.1, 1.0]));
            }
        }
        markers
    }
}

/// Writes the measurement of environment `env` to `row`.
fn read(pairs: &Pairs, air: Option<&ContactTimers>, state: &SceneState, env: usize, row: &mut [f64]) {
    let row = pairs.read(state, env, row);
    if let Some(air) = air {
        air.read(env, row);
    }
}

impl Sampled for ContactSensor {
    fn sampler(&self) -> &Sampler {
        &self.sampler
    }

    fn columns(&self) -> &[String] {
        &self.names
    }

    fn filters(&self) -> &[String] {
        &self.filters
    }
}

impl ContactSensor {
    /// Names of the watched bodies, in the order of the axis B.
    pub fn body_names(&self) -> &[String] {
        &self.names
    }

    /// Indices on the axis B of the bodies that a pattern matches, by full name or by link name.
    ///
    /// # Errors
    ///
    /// A pattern that is not a regular expression or matches no watched body.
    pub fn find_bodies(&self, pattern: &str) -> Result<Vec<usize>, SensorError> {
        matching(pattern, &self.names, "watched body")
    }

    /// Name patterns of the filters, as configured, in the order of the axis M.
    pub fn filters(&self) -> &[String] {
        &self.filters
    }

    /// Contact threshold of the norm of the net normal force \[N\].
    pub fn force_threshold(&self) -> f64 {
        self.threshold
    }

    fn vectors(&self, channel: &str) -> ArrayView3<'_, f64> {
        self.sampler.values_as(channel, (self.sampler.num_envs(), self.names.len(), 3))
    }

    fn past_vectors(&self, channel: &str) -> ArrayView4<'_, f64> {
        let (n, t) = (self.sampler.num_envs(), self.sampler.history_length());
        self.sampler.history_as(channel, (n, t, self.names.len(), 3))
    }

    /// Sum of the normal forces on each body, in world axes \[N\], shape (N, B, 3), over all counterparts, without
    /// friction.
    pub fn net_forces_w(&self) -> ArrayView3<'_, f64> {
        self.vectors("net_forces_w")
    }

    /// History of [`net_forces_w`](Self::net_forces_w) \[N\], shape (N, T, B, 3); 0 where not filled yet.
    pub fn net_forces_w_history(&self) -> ArrayView4<'_, f64> {
        self.past_vectors("net_forces_w")
    }

    /// Sum of the friction forces on each body, in world axes \[N\], shape (N, B, 3): the tangential parts of the
    /// contact forces.
    pub fn friction_forces_w(&self) -> ArrayView3<'_, f64> {
        self.vectors("friction_forces_w")
    }

    /// History of [`friction_forces_w`](Self::friction_forces_w) \[N\], shape (N, T, B, 3); 0 where not filled yet.
    pub fn friction_forces_w_history(&self) -> ArrayView4<'_, f64> {
        self.past_vectors("friction_forces_w")
    }

    /// Sum of the contact forces on each body, including friction, in world axes \[N\], shape (N, B, 3).
    pub fn total_forces_w(&self) -> ArrayView3<'_, f64> {
        self.vectors("total_forces_w")
    }

    /// History of [`total_forces_w`](Self::total_forces_w) \[N\], shape (N, T, B, 3); 0 where not filled yet.
    pub fn total_forces_w_history(&self) -> ArrayView4<'_, f64> {
        self.past_vectors("total_forces_w")
    }

    fn pairs(&self, channel: &str) -> ArrayView4<'_, f64> {
        self.sampler.values_as(channel, (self.sampler.num_envs(), self.names.len(), self.filters.len(), 3))
    }

    fn past_pairs(&self, channel: &str) -> ArrayView5<'_, f64> {
        let (n, t) = (self.sampler.num_envs(), self.sampler.history_length());
        self.sampler.history_as(channel, (n, t, self.names.len(), self.filters.len(), 3))
    }

    /// Sum of the normal forces that the bodies of each filter exert on each body \[N\], shape (N, B, M, 3).
    pub fn force_matrix_w(&self) -> ArrayView4<'_, f64> {
        self.pairs("force_matrix_w")
    }

    /// History of [`force_matrix_w`](Self::force_matrix_w) \[N\], shape (N, T, B, M, 3); 0 where not filled yet.
    pub fn force_matrix_w_history(&self) -> ArrayView5<'_, f64> {
        self.past_pairs("force_matrix_w")
    }

    /// Sum of the friction forces that the bodies of each filter exert on each body \[N\], shape (N, B, M, 3): the
    /// tangential parts of the contact forces; `None` unless tracked. The whole force is the sum with
    /// [`force_matrix_w`](Self::force_matrix_w).
    pub fn friction_matrix_w(&self) -> Option<ArrayView4<'_, f64>> {
        self.sampler.has("friction_matrix_w").then(|| self.pairs("friction_matrix_w"))
    }

    /// History of [`friction_matrix_w`](Self::friction_matrix_w) \[N\], shape (N, T, B, M, 3); 0 where not filled yet.
    /// `None` unless [`track_friction_forces`](crate::ContactSensorCfg::track_friction_forces) is set.
    pub fn friction_matrix_w_history(&self) -> Option<ArrayView5<'_, f64>> {
        self.sampler.has("friction_matrix_w").then(|| self.past_pairs("friction_matrix_w"))
    }

    /// Mean of the contact points of each body, with equal weights \[m\], shape (N, B, 3), in the frame of the
    /// environment; `None` unless points are tracked. Without a contact, [`contact_counts`](Self::contact_counts) is 0,
    /// and the point is meaningless: 0, plus the noise of the channel. Isaac Lab returns NaN instead.
    pub fn contact_points_w(&self) -> Option<ArrayView3<'_, f64>> {
        self.sampler.has("contact_points_w").then(|| self.vectors("contact_points_w"))
    }

    /// Number of contact points of each body, shape (N, B), whole numbers without noise; `None` unless points are
    /// tracked.
    pub fn contact_counts(&self) -> Option<ArrayView2<'_, f64>> {
        self.optional_values("contact_counts")
    }

    /// Mean of the contact points between each body and the bodies of each filter, with equal weights \[m\], shape (N,
    /// B, M, 3), in the frame of the environment; `None` unless points are tracked. Without a contact,
    /// [`contact_count_matrix`](Self::contact_count_matrix) is 0, and the point is meaningless, as in
    /// [`contact_points_w`](Self::contact_points_w).
    pub fn contact_point_matrix_w(&self) -> Option<ArrayView4<'_, f64>> {
        self.sampler.has("contact_point_matrix_w").then(|| self.pairs("contact_point_matrix_w"))
    }

    /// Number of contact points between each body and the bodies of each filter, shape (N, B, M), whole numbers; `None`
    /// unless points are tracked.
    pub fn contact_count_matrix(&self) -> Option<ArrayView3<'_, f64>> {
        let shape = (self.sampler.num_envs(), self.names.len(), self.filters.len());
        let counts = "contact_count_matrix";
        self.sampler.has(counts).then(|| self.sampler.values_as(counts, shape))
    }

    /// Positions of the bodies in the frame of the environment \[m\], shape (N, B, 3); `None` unless poses are tracked.
    /// Positions are captured at [`Sampled::stamps`], forces and contact points at [`Sampled::force_stamps`].
    pub fn pos_w(&self) -> Option<ArrayView3<'_, f64>> {
        self.sampler.has("pos_w").then(|| self.vectors("pos_w"))
    }

    /// Orientations of the bodies in the frame of the environment, w x y z, shape (N, B, 4); `None` unless poses are
    /// tracked.
    pub fn quat_w(&self) -> Option<ArrayView3<'_, f64>> {
        let shape = (self.sampler.num_envs(), self.names.len(), 4);
        self.sampler.has("quat_w").then(|| self.sampler.values_as("quat_w", shape))
    }

    fn optional_values(&self, channel: &str) -> Option<ArrayView2<'_, f64>> {
        self.sampler.has(channel).then(|| self.sampler.values(channel))
    }

    /// Time since the last contact of each body, or since the reset if there was none \[s\], shape (N, B), 0 in
    /// contact; `None` unless air times are tracked. Times are whole numbers of physics steps.
    pub fn current_air_time(&self) -> Option<ArrayView2<'_, f64>> {
        self.optional_values("current_air_time")
    }

    /// Duration of the current contact of each body, counted from the reset at the earliest \[s\], shape (N, B), 0
    /// without a contact; `None` unless air times are tracked.
    pub fn current_contact_time(&self) -> Option<ArrayView2<'_, f64>> {
        self.optional_values("current_contact_time")
    }

    /// Duration of the air phase of each body before its last contact began \[s\], shape (N, B), 0 if no contact began
    /// since the reset; `None` unless air times are tracked. The first air phase counts from the reset on.
    pub fn last_air_time(&self) -> Option<ArrayView2<'_, f64>> {
        self.optional_values("last_air_time")
    }

    /// Duration of the last finished contact of each body \[s\], shape (N, B), 0 if no contact ended since the reset;
    /// `None` unless air times are tracked.
    pub fn last_contact_time(&self) -> Option<ArrayView2<'_, f64>> {
        self.optional_values("last_contact_time")
    }

    /// True where contact of a body began since the previous measurement, however short it was, shape (N, B); `None`
    /// unless air times are tracked. A contact that exists at a reset does not count. With dropout, a lost measurement
    /// also loses the contacts that began since the measurement before it.
    pub fn first_contact(&self) -> Option<Array2<bool>> {
        self.optional_values("first_contact").map(|flags| flags.mapv(|flag| flag > 0.0))
    }

    /// True where contact of a body ended since the previous measurement, however short the air phase was, shape (N,
    /// B); `None` unless air times are tracked. With dropout, a lost measurement also loses the contacts that ended
    /// since the measurement before it.
    pub fn first_air(&self) -> Option<Array2<bool>> {
        self.optional_values("first_air").map(|flags| flags.mapv(|flag| flag > 0.0))
    }
}

/// Writes a summary of several lines.
impl fmt::Display for ContactSensor {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        summary::write_sampled(
            f,
            "Contact sensor",
            &self.sampler,
            &[
                ("number of bodies", &self.names.len()),
                ("body names", &summary::list(&self.names)),
                ("filters", &summary::list(&self.filters)),
            ],
        )
    }
}
