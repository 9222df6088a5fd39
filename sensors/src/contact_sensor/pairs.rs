//! Sums of contact forces per body, and per pair of body and filter.

use kinetoscope_scene::Contact;
use kinetoscope_scene::SceneState;
use ndarray::Axis;

/// Layout of a measurement.
#[derive(Clone, Copy, Debug)]
pub(super) struct MeasurementLayout {
    pub bodies: usize,
    pub groups: usize,
    /// True if friction is reported by filter.
    pub friction: bool,
    /// True if contact points are reported, per body and by filter.
    pub points: bool,
    pub poses: bool,
    pub air: bool,
}

/// Returns the number of values of a measurement of one environment.
pub(super) fn value_count(layout: &MeasurementLayout) -> usize {
    let per_body = 9
        + 3 * layout.groups
        + if layout.friction { 3 * layout.groups } else { 0 }
        + if layout.points { 4 * (1 + layout.groups) } else { 0 }
        + if layout.poses { 7 } else { 0 }
        + if layout.air { super::air_time::ContactTimers::CHANNELS.len() } else { 0 };
    layout.bodies * per_body
}

/// Watched bodies and filter groups, with lookup tables.
#[derive(Clone, Debug)]
pub(super) struct Pairs {
    layout: MeasurementLayout,
    /// Watched bodies as indices of the body axis.
    bodies: Vec<usize>,
    /// Index in `bodies` of every body of the axis, with the world last; `None` for bodies that are not watched.
    watched_index: Vec<Option<usize>>,
    /// Filter groups of every body of the axis, with the world last.
    groups: Vec<Vec<usize>>,
}

impl Pairs {
    /// Creates the lookup tables. `groups` holds indices of the body axis, whose length is `axis`; `axis` stands for
    /// the world.
    pub(super) fn new(layout: MeasurementLayout, bodies: Vec<usize>, groups: &[Vec<usize>], axis: usize) -> Self {
        let watched_index = (0..=axis).map(|body| bodies.iter().position(|&b| b == body)).collect();
        let of = |body| (0..groups.len()).filter(|&g| groups[g].contains(&body)).collect();
        Self { layout, bodies, watched_index, groups: (0..=axis).map(of).collect() }
    }

    /// Watched bodies as indices of the body axis.
    pub(super) fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    /// Returns the watched ends of a contact: index of the watched body, sign of the force on it, and axis index of the
    /// other body.
    fn ends<'c>(&'c self, contact: &'c Contact) -> impl Iterator<Item = (usize, f64, usize)> + 'c {
        let world = self.watched_index.len() - 1;
        let index = move |side: usize| contact.bodies[side].map_or(world, |body| (body as usize).min(world));
        // The contact force acts on the second body.
        [(0, -1.0), (1, 1.0)].into_iter().filter_map(move |(side, sign)| {
            let slot = self.watched_index[index(side)]?;
            Some((slot, sign, index(1 - side)))
        })
    }

    /// Adds the normal forces on the watched bodies of environment `env` to `net`, 3 numbers per body \[N\].
    pub(super) fn net_forces(&self, state: &SceneState, env: usize, net: &mut [f64]) {
        for contact in state.contacts.iter().flat_map(|contacts| contacts.in_env(env)) {
            for (slot, sign, _) in self.ends(contact) {
                add(net, slot, sign * contact.normal_force, &contact.normal);
            }
        }
    }

    /// Writes forces, points and poses of environment `env` to `row`, which must be zero; returns the rest of the row.
    pub(super) fn read<'r>(&self, state: &SceneState, env: usize, row: &'r mut [f64]) -> &'r mut [f64] {
        let MeasurementLayout { bodies: b, groups: m, .. } = self.layout;
        let tracked = |tracked: bool, numbers: usize| if tracked { numbers } else { 0 };
        let (net, row) = row.split_at_mut(3 * b);
        let (friction, row) = row.split_at_mut(3 * b);
        let (total, row) = row.split_at_mut(3 * b);
        let (matrix, row) = row.split_at_mut(3 * b * m);
        let (friction_matrix, row) = row.split_at_mut(tracked(self.layout.friction, 3 * b * m));
        let (points, row) = row.split_at_mut(tracked(self.layout.points, 3 * b));
        let (counts, row) = row.split_at_mut(tracked(self.layout.points, b));
        let (point_matrix, row) = row.split_at_mut(tracked(self.layout.points, 3 * b * m));
        let (count_matrix, row) = row.split_at_mut(tracked(self.layout.points, b * m));
        for contact in state.contacts.iter().flat_map(|contacts| contacts.in_env(env)) {
            let sliding: [f64; 3] =
                std::array::from_fn(|k| contact.force[k] - contact.normal_force * contact.normal[k]);
            for (slot, sign, other) in self.ends(contact) {
                add(net, slot, sign * contact.normal_force, &contact.normal);
                add(friction, slot, sign, &sliding);
                add(total, slot, sign, &contact.force);
                if self.layout.points {
                    add(points, slot, 1.0, &contact.point);
                    counts[slot] += 1.0;
                }
                for pair in self.groups[other].iter().map(|group| slot * m + group) {
                    add(matrix, pair, sign * contact.normal_force, &contact.normal);
                    if self.layout.friction {
                        add(friction_matrix, pair, sign, &sliding);
                    }
                    if self.layout.points {
                        add(point_matrix, pair, 1.0, &contact.point);
                        count_matrix[pair] += 1.0;
                    }
                }
            }
        }
        divide_by_counts(points, counts);
        divide_by_counts(point_matrix, count_matrix);
        if !self.layout.poses {
            return row;
        }
        let (positions, row) = row.split_at_mut(3 * b);
        let (rotations, row) = row.split_at_mut(4 * b);
        if let Some(poses) = &state.body_poses {
            let poses = poses.index_axis(Axis(0), env);
            for (slot, &body) in self.bodies.iter().enumerate() {
                (0..3).for_each(|k| positions[3 * slot + k] = poses[(body, k)]);
                (0..4).for_each(|k| rotations[4 * slot + k] = poses[(body, 3 + k)]);
            }
        }
        row
    }
}

/// Adds a multiple of a vector to the vector at `index` of a list.
fn add(list: &mut [f64], index: usize, factor: f64, vector: &[f64; 3]) {
    for (sum, component) in list[3 * index..3 * index + 3].iter_mut().zip(vector) {
        *sum += factor * component;
    }
}

/// Divides sums of vectors by their counts; sums without a count stay 0.
fn divide_by_counts(list: &mut [f64], counts: &[f64]) {
    for (sum, count) in list.chunks_exact_mut(3).zip(counts).filter(|(_, count)| **count > 0.0) {
        sum.iter_mut().for_each(|x| *x /= count);
    }
}
